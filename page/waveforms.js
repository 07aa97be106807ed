// Sine, cosine, exponential and waveforms, written from docs/KERNEL.md alone: what drives a chain, and what exponential bonds take.
// A time or an angle is a pair of doubles whose sum is meant.

import { fromHex, powerOfTwo } from "./kernel.js";

/** @import { Shape } from "./types.js" */
/** @typedef {[number, number]} Pair */

const hex = (/** @type {string} */ text) => text.split(" ").map(fromHex);
const SINE = hex(
  "bfc5555555555555 3f81111111111111 bf2a01a01a01a01a 3ec71de3a556c734 " +
    "be5ae64567f544e4 3de6124613a86d09 bd6ae7f3e733b81f 3ce952c77030ad4a",
);
const COSINE = hex(
  "3fa5555555555555 bf56c16c16c16c17 3efa01a01a01a01a be927e4fb7789f5c " +
    "3e21eed8eff8d898 bda93974a8c07c9d 3d2ae7f3e733b81f bca6827863b97d97",
);
const [T1, T2, J1, J2] = hex("401921fb54442d18 3cb1a62633145c07 3fc45f306dc9c883 bc66b01ec5417056");
const [I, H, L] = hex("3ff71547652b82fe 3fe62e42fee00000 3dea39ef35793c76");
/** 1/2! … 1/15! */
const EXPONENTIAL = hex(
  "3fe0000000000000 3fc5555555555555 3fa5555555555555 3f81111111111111 3f56c16c16c16c17 3f2a01a01a01a01a 3efa01a01a01a01a " +
    "3ec71de3a556c734 3e927e4fb7789f5c 3e5ae64567f544e4 3e21eed8eff8d898 3de6124613a86d09 3da93974a8c07c9d 3d6ae7f3e733b81f",
);

/** @param {number} a @param {number} b @returns {Pair} */
function twoSum(a, b) {
  const s = a + b;
  const p = s - a;
  return [s, a - (s - p) + (b - p)];
}

/** @param {number} a @param {number} b @returns {Pair} */
function fastTwoSum(a, b) {
  const s = a + b;
  return [s, b - (s - a)];
}

/** @param {number} a @returns {Pair} */
function halves(a) {
  const c = 134217729 * a;
  const high = c - (c - a);
  return [high, a - high];
}

/** @param {number} a @param {number} b @returns {Pair} */
export function twoProduct(a, b) {
  const p = a * b;
  const [[a1, a2], [b1, b2]] = [halves(a), halves(b)];
  return [p, a1 * b1 - p + a1 * b2 + a2 * b1 + a2 * b2];
}

/** c_0 + x·(c_1 + x·(…)), from the last one on. @param {number[]} coefficients @param {number} x */
function series(coefficients, x) {
  let total = coefficients[coefficients.length - 1];
  for (let i = coefficients.length - 2; i >= 0; i -= 1) {
    total = total * x + coefficients[i];
  }
  return total;
}

/** Sine and cosine of x + y turns. @param {number} x @param {number} y @returns {Pair} */
export function sincos(x, y) {
  const k = Math.floor(4 * x + 0.5);
  const [a, b] = twoSum(x - 0.25 * k, y);
  const [p, e] = twoProduct(a, T1);
  const l = e + (a * T2 + b * T1);
  const [z, f] = twoProduct(p, p);
  const h = 0.5 * z;
  const sin = p + (p * z * series(SINE, z) + (l - l * h));
  const w = 1 - h;
  const cos = w + (1 - w - h + (z * z * series(COSINE, z) - (0.5 * f + p * l)));
  const all = /** @type {Pair[]} */ ([[sin, cos], [cos, -sin], [-sin, -cos], [-cos, sin]]);
  return all[k - 4 * Math.floor(0.25 * k)];
}

/** (exp(r) − 1 − r)/r² of a small r. @param {number} r */
export function q2(r) {
  return series(EXPONENTIAL, r);
}

/** exp(x), less 1 or 0. @param {number} x @param {0 | 1} less */
function exponential(x, less) {
  if (x > 700 || x < -700) {
    return x > 0 ? Infinity : -less;
  }
  const n = Math.floor(x * I + 0.5);
  const r = x - n * H - n * L;
  const m = r + r * r * q2(r);
  const s = powerOfTwo(n);
  return s * m + (s - less);
}
/** @param {number} x */
export const exp = (x) => exponential(x, 0);
/** @param {number} x */
export function expm1(x) {
  return exponential(x, 1);
}

const ROOT_2 = fromHex("3ff6a09e667f3bcd");
/** 2/3, 2/5, … 2/23 */
const LOGARITHM = Array.from({ length: 11 }, (_, j) => 2 / (2 * j + 3));

/** The natural logarithm of a normal x > 0. @param {number} x */
export function ln(x) {
  let [m, n] = [x, 0];
  // powers of two are exact
  for (; m < 1; n -= 1) {
    m *= 2;
  }
  for (; m >= 2; n += 1) {
    m *= 0.5;
  }
  if (m > ROOT_2) {
    [m, n] = [0.5 * m, n + 1];
  }
  const f = m - 1;
  const s = f / (2 + f);
  const z = s * s;
  const h = 0.5 * f * f;
  const r = s * (h + z * series(LOGARITHM, z)) + n * L;
  return n * H - (h - r - f);
}

/** s after step n. @param {number} n @param {number} s @param {number} dt @returns {Pair} */
function moment(n, s, dt) {
  const [a, b] = twoProduct(n, dt);
  const [c, e] = twoSum(a, s);
  return fastTwoSum(c, b + e);
}

/** @param {Pair} t @param {number} start @returns {Pair} */
function since([h, l], start) {
  const [c, e] = twoSum(h, -start);
  return fastTwoSum(c, l + e);
}

/** A frequency with a phase, in turns. @param {Pair} t @param {number} f @param {number} phase @returns {Pair} */
function turns([h, l], f, phase) {
  const [p, e] = twoProduct(f, h);
  const [a, b] = twoProduct(phase, J1);
  const [q, c] = twoSum(p, a);
  const y = e + f * l + (b + phase * J2) + c;
  return twoSum(q - Math.floor(q + 0.5), y);
}

/** f·t + g·t² turns. @param {Pair} t @param {number} f @param {number} g @returns {Pair} */
function chirped([h, l], f, g) {
  const [p, e] = twoProduct(f, h);
  const [u, v] = twoProduct(h, h);
  const [a, b] = twoProduct(g, u);
  const [q, c] = twoSum(p, a);
  const y = e + f * l + (b + g * (v + 2 * (h * l))) + c;
  return twoSum(q - Math.floor(q + 0.5), y);
}

/** A quarter of a turn of sin². @param {number} tau @param {number} length @returns {Pair} value and slope, as of all below */
function rise(tau, length) {
  const [s, c] = sincos(tau / (4 * length), 0);
  return [s * s, s * c * ((0.5 * T1) / length)];
}

/**
 * @param {Pair} t
 * @param {number} up
 * @param {number | undefined} end
 * @param {number} down
 * @returns {Pair}
 */
function envelope(t, up, end, down) {
  if (end !== undefined) {
    const tau = -since(t, end)[0];
    if (tau <= 0) {
      return [0, 0];
    }
    if (tau < down) {
      const [value, slope] = rise(tau, down);
      return [value, -slope];
    }
  }
  return t[0] < up ? rise(t[0], up) : [1, 0];
}

/** @param {number} a @param {Pair} envelope @param {number} s @param {number} slope @returns {Pair} */
function modulated(a, [e, change], s, slope) {
  return [a * (e * s), a * (e * slope + change * s)];
}

/** @param {Pair} t @param {NonNullable<Shape["sine"]>} shape */
function sine(t, { amplitude, frequency_hz: f, phase_rad: phase = 0, ramp_s: up = 0, until_s: end, ramp_down_s: down = 0 }) {
  const [s, c] = sincos(...turns(t, f, phase));
  return modulated(amplitude, envelope(t, up, end, down), s, T1 * f * c);
}

/** @param {Pair} t @param {NonNullable<Shape["chirp"]>} shape */
function chirp(t, { amplitude, from_hz: from, to_hz: to, duration_s: end, ramp_s: up = 0, ramp_down_s: down = 0 }) {
  const g = (0.5 * (to - from)) / end;
  const [s, c] = sincos(...chirped(t, from, g));
  return modulated(amplitude, envelope(t, up, end, down), s, T1 * (from + 2 * g * t[0]) * c);
}

/** @param {Pair} t @param {NonNullable<Shape["step"]>} shape @returns {Pair} */
function step(t, { amplitude, at_s: at = 0, rise_s: length = 0 }) {
  const [tau] = since(t, at);
  const [value, slope] = tau < 0 ? [0, 0] : tau < length ? rise(tau, length) : [1, 0];
  return [amplitude * value, amplitude * slope];
}

/** @param {Pair} t @param {NonNullable<Shape["ramp"]>} shape @returns {Pair} */
function ramp(t, { amplitude, from_s: from = 0, to_s: to }) {
  const [[tau], length] = [since(t, from), to - from];
  if (tau < 0) {
    return [0, 0];
  }
  return tau < length ? [amplitude * (tau / length), amplitude / length] : [amplitude, 0];
}

/** @param {Pair} t @param {NonNullable<Shape["half_sine"]>} shape @returns {Pair} */
function halfSine(t, { amplitude, duration_s: length, at_s: at = 0 }) {
  const [tau] = since(t, at);
  if (tau < 0 || tau >= length) {
    return [0, 0];
  }
  const [s, c] = sincos(tau / (2 * length), 0);
  return [amplitude * s, amplitude * (((0.5 * T1) / length) * c)];
}

/** @param {Pair} t @param {NonNullable<Shape["gaussian"]>} shape @returns {Pair} */
function gaussian(t, { amplitude, at_s: at, width_s: width, frequency_hz: f = 0 }) {
  const late = since(t, at);
  const z = late[0] / width;
  const b = amplitude * exp(-0.5 * (z * z));
  const [s, c] = sincos(...turns(late, f, 0));
  return [b * c, b * -((z / width) * c + T1 * f * s)];
}

/** @param {Pair} t @param {NonNullable<Shape["table"]>} shape @returns {Pair} */
function table([h], { times_s: times, values, interpolation }) {
  if (h < times[0]) {
    return [values[0], 0];
  }
  const last = times.length - 1;
  const tau = h < times[last] ? h : times[last];
  let [i, above] = [0, last];
  while (above - i > 1) {
    const middle = (i + above) >> 1;
    [i, above] = times[middle] <= tau ? [middle, above] : [i, middle];
  }
  const [length, y] = [times[i + 1] - times[i], values[i + 1] - values[i]];
  const x = (tau - times[i]) / length;
  if (interpolation === "linear") {
    return [values[i] + x * y, y / length];
  }
  const [d0, d1] = [length * tangent(times, values, i), length * tangent(times, values, i + 1)];
  const [a, b] = [3 * y - (2 * d0 + d1), d0 + d1 - 2 * y];
  return [values[i] + x * (d0 + x * (a + x * b)), (d0 + x * (2 * a + x * (3 * b))) / length];
}

/** The slope of a cubic table at its time number j. @param {number[]} times @param {number[]} values @param {number} j */
function tangent(times, values, j) {
  const last = times.length - 1;
  const length = (/** @type {number} */ i) => times[i + 1] - times[i];
  const secant = (/** @type {number} */ i) => (values[i + 1] - values[i]) / length(i);
  if (last === 1) {
    return secant(0);
  }
  if (j > 0 && j < last) {
    return (length(j) * secant(j - 1) + length(j - 1) * secant(j)) / (length(j - 1) + length(j));
  }
  const [near, far] = j === 0 ? [0, 1] : [last - 1, last - 2];
  return secant(near) + ((secant(near) - secant(far)) * length(near)) / (length(near) + length(far));
}

/** The largest size of some numbers and lists of numbers; what is none counts as 0. @param {...any} values @returns {number} */
export const largest = (...values) => values.flat(2).reduce((most, x) => Math.max(most, Math.abs(x) || 0), 0);

/** A waveform of a drive. */
export class Waveform {
  /** @param {Shape} shape @param {number} dt */
  constructor(shape, dt) {
    this.shape = shape;
    this.dt = dt;
  }

  /** Value and slope at the time s after step n. @param {number} n @param {number} s @returns {Pair} */
  at(n, s) {
    const { shape } = this;
    const t = moment(n, s, this.dt);
    if (shape.sine) {
      return sine(t, shape.sine);
    }
    if (shape.chirp) {
      return chirp(t, shape.chirp);
    }
    if (shape.step) {
      return step(t, shape.step);
    }
    if (shape.ramp) {
      return ramp(t, shape.ramp);
    }
    if (shape.half_sine) {
      return halfSine(t, shape.half_sine);
    }
    if (shape.gaussian) {
      return gaussian(t, shape.gaussian);
    }
    if (shape.table) {
      return table(t, shape.table);
    }
    if (shape.constant === undefined) {
      throw new Error(`a waveform that is not known here: ${Object.keys(shape)}`);
    }
    return [shape.constant, 0];
  }

  /** A number that no value exceeds in size: a cubic leaves the range of its two values by at most 4/27 of each of its slopes. */
  largest() {
    const [held] = /** @type {any[]} */ (Object.values(this.shape));
    const { times_s: t, values = [held.amplitude ?? held], interpolation } = held;
    const slopes = (/** @type {number} */ i) => Math.abs(tangent(t, values, i)) + Math.abs(tangent(t, values, i + 1));
    const steep = (/** @type {number} */ i) => (interpolation === "cubic" && t[i + 1] > t[i] ? (t[i + 1] - t[i]) * slopes(i) : 0);
    return largest(values.map((/** @type {number} */ x, /** @type {number} */ i) => Math.abs(x) + (4 / 27) * Math.max(steep(i - 1), steep(i))));
  }

  /** The times at which it jumps, has a kink, or goes over into another formula (s). @returns {number[]} */
  knots() {
    const { sine, chirp, step, ramp, half_sine: half, table } = this.shape;
    const oscillation = sine ?? chirp;
    if (oscillation) {
      const { ramp_s: up = 0, ramp_down_s: down = 0 } = oscillation;
      const end = chirp ? chirp.duration_s : sine?.until_s;
      const last = end === undefined ? [] : down > 0 ? [end - down, end] : [end];
      return up > 0 ? [up, ...last] : last;
    }
    if (step) {
      return [step.at_s ?? 0, (step.at_s ?? 0) + (step.rise_s ?? 0)];
    }
    if (ramp) {
      return [ramp.from_s ?? 0, ramp.to_s];
    }
    if (half) {
      return [half.at_s ?? 0, (half.at_s ?? 0) + half.duration_s];
    }
    return table ? table.times_s : [];
  }

  /** @param {number} n @param {number} s */
  value(n, s) {
    return this.at(n, s)[0];
  }
}
