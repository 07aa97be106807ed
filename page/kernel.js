// The arithmetic of a step, written from docs/KERNEL.md alone: what it computes has the bits of a recording
// of kernel version 2.
// No dependencies, nothing of a browser or of Node.js; doubles are taken apart as on a little-endian machine.
//
//     import { Stepper } from "./kernel.js";
//     const stepper = new Stepper(physics, chain);
//     const state = stepper.initialState();          // { u, v, extra }, Float64Arrays
//     stepper.step(state, 1000);                     // in place, without allocating
//     const { kinetic, potential, dissipated } = stepper.energies(state);
//
// This is the plain chain, of contacts of one power, by the methods without a drive; chains.js has everything else.
// `physics` is the JSON of that name in the manifest; of it `kernel_version`, `beads`, `alpha`, `dt_s`, `method`, `damping`,
// `striker` and `strikers` are used. `chain` is `/chain`: { mass: N numbers, stiffness, restOverlap, restForce, damping: N − 1 each
// (damping may be empty), leftWall, rightWall: { stiffness, restOverlap, restForce, damping }, left out at a free end }.
// Units are SI.

/** @import { Chain, Physics, Wall } from "./types.js" */
/**
 * State that a step changes: u (m), v (m/s), and further arrays of the method; where something is driven, also the
 * step.
 * @typedef {{ u: Float64Array, v: Float64Array, extra: Float64Array, step?: number }} Motion
 */

export const KERNEL_VERSION = 3;

/** Versions of the dynamics that this page has. @param {number} version */
export const isKnown = (version) => version === 2 || version === KERNEL_VERSION;

const double = new Float64Array(1);
const words = new Uint32Array(double.buffer); // the lower half of its bits, the upper half

/** The double of these bits, as sixteen hexadecimal digits. @param {string} hex */
export function fromHex(hex) {
  words[1] = parseInt(hex.slice(0, 8), 16);
  words[0] = parseInt(hex.slice(8), 16);
  return double[0];
}

/** The bits of a double, as sixteen hexadecimal digits. @param {number} x */
export function toHex(x) {
  double[0] = x;
  return words[1].toString(16).padStart(8, "0") + words[0].toString(16).padStart(8, "0");
}

/** 2^n, n from −1022 to 1023. @param {number} n */
export function powerOfTwo(n) {
  words[1] = (1023 + n) << 20;
  words[0] = 0;
  return double[0];
}

/** A straight line between powers of two, near 2^x. @param {number} x */
function line(x) {
  const whole = Math.floor(x);
  return (1 + (x - whole)) * powerOfTwo(whole);
}

// Numbers of many digits: a BigInt over 2^DIGITS.
const DIGITS = 256n;
const ONE = 1n << DIGITS;
const times = (/** @type {bigint} */ a, /** @type {bigint} */ b) => (a * b) >> DIGITS;

/** ln(p/q), by the series of 2·artanh((p − q)/(p + q)). @param {bigint} p @param {bigint} q */
function logarithm(p, q) {
  let power = ((p - q) << DIGITS) / (p + q);
  const square = times(power, power);
  let sum = 0n;
  for (let k = 1n; power !== 0n; k += 2n) {
    sum += power / k;
    power = times(power, square);
  }
  return 2n * sum;
}

const LN_2 = logarithm(2n, 1n);

/** 2^x as `fraction`·2^`exponent` with 1 ≤ fraction < 2. @param {bigint} x */
function exponential(x) {
  const exponent = x >> DIGITS;
  const HALVINGS = 16n; // of ln 2·(x − ⌊x⌋), so that few terms do
  const small = times(x - (exponent << DIGITS), LN_2) >> HALVINGS;
  let [fraction, term] = [ONE, ONE];
  for (let k = 1n; term !== 0n; k += 1n) {
    term = times(term, small) / k;
    fraction += term;
  }
  for (let n = 0n; n < HALVINGS; n += 1n) {
    fraction = times(fraction, fraction);
  }
  return { fraction, exponent: Number(exponent) };
}

/** A double in many digits: exact from 2^−200 on. @param {number} x */
function manyDigits(x) {
  double[0] = x;
  const mantissa = (BigInt(words[1] & 0xfffff) << 32n) | BigInt(words[0]) | (1n << 52n);
  return (mantissa << DIGITS) >> BigInt(1075 - (words[1] >>> 20));
}

const CLOSED_FORMS = [1, 1.5, 2, 3, 5];

/** δ^α as docs/KERNEL.md has it: a closed form, or a table whose entries are made when they are first needed. */
export class Power {
  /** @param {number} alpha */
  constructor(alpha) {
    const w = 900 / (alpha + 1);
    this.alpha = alpha;
    this.form = CLOSED_FORMS.indexOf(alpha); // −1: the table
    /** P is 0 up to this. */
    this.z = line(-w);
    this.top = Infinity;
    [this.b, this.shift, this.first] = [0, 0, 0];
    /** Number of intervals, with that of `top`. */
    this.intervals = 0;
    this.table = new Float64Array(0); // c, H, L of each; c is 0 where they are yet to be made
    /** Factors of c^α. @type {Map<number, { fraction: bigint, exponent: number }>} */
    this.ofMantissa = new Map();
    /** @type {Map<number, { fraction: bigint, exponent: number }>} */
    this.ofExponent = new Map();
    this.g1 = this.g2 = this.g3 = this.g4 = this.g5 = 0;
    if (this.form >= 0) {
      return;
    }
    this.top = line(w);
    let b = 7;
    if (alpha > 5) {
      for (b = 9; alpha > powerOfTwo(b - 6); b += 1);
    }
    this.b = b;
    this.shift = 20 - b; // of the upper 32 bits; all of the lower ones are without meaning for the interval
    double[0] = this.z;
    words[0] = 0xffffffff;
    words[1] |= (1 << this.shift) - 1;
    this.z = double[0];
    this.first = (words[1] >>> this.shift) + 1;
    double[0] = this.top;
    this.intervals = (words[1] >>> this.shift) - this.first + 1;
    this.table = new Float64Array(3 * this.intervals);

    const g = [0, alpha];
    for (let j = 2; j <= 5; j += 1) {
      g[j] = (g[j - 1] * (alpha - (j - 1))) / j;
    }
    const e = (g[5] * (alpha - 5)) / 6;
    const q = powerOfTwo(-2 * (b + 1));
    g[4] = g[4] + 1.5 * q * e;
    g[2] = g[2] - 0.5625 * (q * q) * e;
    [, this.g1, this.g2, this.g3, this.g4, this.g5] = g;
  }

  /** P(x). @param {number} x */
  at(x) {
    return x > this.z ? this.above(x) : 0;
  }

  /** P of a number above z. @param {number} x */
  above(x) {
    switch (this.form) {
      case 0:
        return x;
      case 1:
        return x * Math.sqrt(x);
      case 2:
        return x * x;
      case 3:
        return x * x * x;
      case 4:
        return x * x * (x * x) * x;
      default:
        return this.fromTable(x);
    }
  }

  /** @param {number} x */
  fromTable(x) {
    if (x >= this.top) {
      return Infinity;
    }
    double[0] = x;
    const i = 3 * ((words[1] >>> this.shift) - this.first);
    const table = this.table;
    if (table[i] === 0) {
      this.make(i / 3);
    }
    const c = table[i];
    const h = table[i + 1];
    const r = (x - c) / c; // that of the mantissas: x and c have the same exponent
    const s = (((this.g5 * r + this.g4) * r + this.g3) * r + this.g2) * r + this.g1;
    return h + (h * (s * r) + table[i + 2]);
  }

  /**
   * The centre c of an interval, and c^α in two doubles: [c, H, L]. `i` counts from the first interval above z.
   * @param {number} i
   */
  entry(i) {
    if (this.table[3 * i] === 0) {
      this.make(i);
    }
    return this.table.subarray(3 * i, 3 * i + 3);
  }

  /** @param {number} i */
  make(i) {
    const interval = this.first + i;
    const upper = interval & ((1 << this.b) - 1);
    const exponent = (interval >> this.b) - 1023;
    // c = odd/2^(b+1) · 2^exponent, and c^α = 2^(α·log2(odd/2^(b+1))) · 2^(α·exponent)
    const odd = BigInt((1 << (this.b + 1)) + 2 * upper + 1);
    const alpha = manyDigits(this.alpha);
    let a = this.ofMantissa.get(upper);
    if (a === undefined) {
      const log2 = (logarithm(odd, 1n << BigInt(this.b + 1)) << DIGITS) / LN_2;
      a = exponential(times(alpha, log2));
      this.ofMantissa.set(upper, a);
    }
    let b = this.ofExponent.get(exponent);
    if (b === undefined) {
      b = exponential(alpha * BigInt(exponent));
      this.ofExponent.set(exponent, b);
    }
    const product = times(a.fraction, b.fraction); // from 1 to 4
    const dropped = DIGITS - (product >= 2n * ONE ? 88n : 89n); // 90 binary digits stay
    const rounded = (product + (1n << (dropped - 1n))) >> dropped;
    const h = Number(rounded); // to nearest, ties to even
    const scale = powerOfTwo(a.exponent + b.exponent + Number(dropped - DIGITS));
    this.table[3 * i + 1] = h * scale;
    this.table[3 * i + 2] = Number(rounded - BigInt(h)) * scale;
    words[1] = (interval << this.shift) | (1 << (this.shift - 1));
    words[0] = 0;
    this.table[3 * i] = double[0];
  }
}

/** The sum of term(0) … term(n − 1) in eight parts. @param {number} n @param {(i: number) => number} term */
export function sum(n, term) {
  const s = new Float64Array(8);
  for (let i = 0; i < n; i += 1) {
    s[i & 7] += term(i);
  }
  return s[0] + s[4] + (s[2] + s[6]) + (s[1] + s[5] + (s[3] + s[7]));
}

/** e_0 … e_7 of the energy beyond that at rest. @param {number} alpha */
export function excessSeries(alpha) {
  const e = [0.5 * alpha];
  for (let n = 1; n <= 7; n += 1) {
    e[n] = (e[n - 1] * (alpha - n)) / (n + 2);
  }
  return e;
}

// constants of rkn4
export const A1 = fromHex("3fcf65f4cb6cb771");
export const A2 = fromHex("3fe35b1debaf2655");
export const A3 = fromHex("bfd669363d14a862");
export const B1 = fromHex("3fb53e774fa406be");
export const B2 = fromHex("3fd95d23c9214375");
export const B3 = fromHex("bfa3ff3020b02cb4");
export const B4 = fromHex("3fbe9923385e0390");
// of gear5
const [C0, C1, C3, C4, C5] = [3 / 20, 251 / 360, 11 / 18, 1 / 6, 1 / 60];

/** Kicks of a step, at most: each moves one bead further. */
const REACH = 7;

const TINY = powerOfTwo(-900);
const orZero = (/** @type {number} */ q) => (Math.abs(q) <= TINY ? 0 : q);

/** The method for any forces, which came with schema version 1.1. */
export const RUNGE = "rk5";

/** Methods that are known here. */
export const METHODS = ["velocity-verlet", "rkn4", "gear5", RUNGE];

/** What no kernel computes any more; undefined of other runs. @param {Physics} physics */
export const retired = ({ method, damping }) => (method === "gear5" && damping ? "gear5 with damping" : undefined);

/**
 * True if a `Stepper` moves this chain; else it is one of chains.js.
 * @param {Physics} physics
 * @param {Chain} chain
 */
export function isSimple({ method, drives, baths }, { terms, ring, onSite, onSiteCubic, drag, resonatorMass, dampingPower }) {
  const isThere = [drives, baths, terms, onSite, onSiteCubic, drag, resonatorMass].some((some) => some && some.length > 0);
  return !isThere && ring === undefined && !dampingPower && method !== RUNGE;
}

/**
 * Names of the arrays of N values in `extra`, in their order.
 * @param {Physics} physics
 * @param {Chain} chain
 */
export function extraNamesOf({ method, damping, drives = [], baths = [] }, { resonatorMass = NONE, drag = NONE }) {
  const isThere = {
    ...{ q2: method === "gear5", q3: method === "gear5", q4: method === "gear5", q5: method === "gear5" },
    ...{ w: resonatorMass.length > 0, w_v: resonatorMass.length > 0 },
    ...{ W: damping !== undefined || drag.length > 0, drives: drives.length > 0, heat: baths.length > 0 },
  };
  return Object.entries(isThere).flatMap(([name, is]) => (is ? [name] : []));
}
const NONE = new Float64Array(0);

/** A chain, and how it moves. One may be used for any number of states. */
export class Stepper {
  /**
   * @param {Physics} physics
   * @param {Chain} chain
   * @param {Power} power the `new Power(alpha)` of another chain with this alpha, to share its table
   */
  constructor(physics, chain, power = new Power(physics.alpha)) {
    const n = chain.mass.length;
    if (!isKnown(physics.kernel_version)) {
      throw new Error(`kernel version ${physics.kernel_version}, not 2 or ${KERNEL_VERSION}`);
    }
    if (physics.beads !== n || chain.stiffness.length !== n - 1 || physics.alpha !== power.alpha) {
      throw new Error("physics and chain do not belong together");
    }
    if (!METHODS.includes(physics.method)) {
      throw new Error(`unknown method ${physics.method}`);
    }
    if (new.target === Stepper && !isSimple(physics, chain)) {
      throw new Error("a chain of chains.js: use its stepperOf");
    }
    this.beads = n;
    this.dt = physics.dt_s;
    this.method = physics.method;
    this.strikers = [physics.striker, ...(physics.strikers ?? [])];
    this.power = power;
    this.damped = physics.damping !== undefined;
    this.restitution = physics.damping?.restitution !== undefined;
    /** Names of the arrays of N values in `extra`. */
    this.extraNames = extraNamesOf(physics, chain);
    this.mass = Float64Array.from(chain.mass);
    this.inverseMass = this.mass.map((m) => 1 / m);
    // Contact i has bead i − 1 on its left and bead i on its right: 0 and N are the walls. A wall that is
    // not there is infinitely far away.
    const none = { stiffness: 0, restOverlap: -Infinity, restForce: 0, damping: 0 };
    this.hasWall = [chain.leftWall !== undefined, chain.rightWall !== undefined];
    const [left, right] = [chain.leftWall ?? none, chain.rightWall ?? none];
    const fill = (/** @type {keyof Wall} */ name) => {
      const all = new Float64Array(n + 1);
      all[0] = left[name] ?? 0;
      all.set(chain[name] ?? [], 1);
      all[n] = right[name] ?? 0;
      return all;
    };
    this.k = fill("stiffness");
    this.rho = fill("restOverlap");
    this.rest = fill("restForce");
    this.eta = fill("damping");
    this.net = new Float64Array(n + 1); // F of each contact
    // the beads that a step moves: others are at rest
    this.from = 0;
    this.to = n;
    // u' of gear5, with a 0 in place of a bead on either side, and v'
    this.predictedU = new Float64Array(n + 2);
    this.predictedV = new Float64Array(n);
    this.isLoaded = chain.restOverlap.some((rho) => rho !== 0);
    this.excessSeries = excessSeries(physics.alpha);
  }

  /** The state at step 0. */
  initialState() {
    const n = this.beads;
    const extra = new Float64Array(this.extraNames.length * n);
    const state = { u: new Float64Array(n), v: new Float64Array(n), extra };
    for (const { bead, velocity_m_s: speed } of this.strikers) {
      if (speed !== 0) {
        state.v[bead] = speed;
      }
    }
    if (this.method === "gear5") {
      this.startGear5(state);
    }
    return state;
  }

  /** Goes on by `count` steps; many at once take a little less time than one by one. @param {Motion} state */
  step(state, count = 1) {
    const { dt, method } = this;
    if (method === "gear5") {
      for (let i = 0; i < count; i += 1) {
        this.stepGear5(state);
      }
      return;
    }
    [this.from, this.to] = [0, this.beads];
    this.forces(state.u);
    for (let i = 0; i < count && this.narrow(state); i += 1) {
      if (method === "rkn4") {
        this.kickDrift(state, B1 * dt, A1 * dt);
        this.kickDrift(state, B2 * dt, A2 * dt);
        this.kickDrift(state, B3 * dt, A3 * dt);
        this.kickDrift(state, B4 * dt, A3 * dt);
        this.kickDrift(state, B3 * dt, A2 * dt);
        this.kickDrift(state, B2 * dt, A1 * dt);
        this.kick(state, B1 * dt);
      } else {
        this.kickDrift(state, 0.5 * dt, dt);
        this.kick(state, 0.5 * dt);
      }
    }
  }

  /**
   * Leaves out what a step would not change: beads at both ends that are at rest in balance, but for as many as the
   * kicks of a step can reach. False if that is all of the chain.
   * @param {Motion} state
   */
  narrow({ u, v }) {
    const { beads: n, net } = this;
    const isAtRest = (/** @type {number} */ i) => Object.is(u[i], 0) && Object.is(v[i], 0) && net[i] === net[i + 1];
    let [first, last] = [this.from, this.to - 1];
    while (first <= last && isAtRest(first)) {
      first += 1;
    }
    while (first <= last && isAtRest(last)) {
      last -= 1;
    }
    this.from = Math.max(0, first - REACH);
    this.to = Math.min(n, last + 1 + REACH);
    return first <= last;
  }

  /** F of the contacts of beads `from` up to `to`, into `net`. @param {Float64Array} u */
  forces(u) {
    const { beads: n, from, to, power, net, k, rho, rest } = this;
    if (from === 0) {
      net[0] = k[0] * power.at(-u[0] + rho[0]) - rest[0];
    }
    if (to === n) {
      net[n] = k[n] * power.at(u[n - 1] + rho[n]) - rest[n];
    }
    const [first, end] = [Math.max(from, 1), Math.min(to + 1, n)];
    if (power.alpha === 1.5) {
      this.forcesOfSpheres(u, first, end);
      return;
    }
    for (let i = first; i < end; i += 1) {
      const delta = u[i - 1] - u[i] + rho[i];
      let force = 0 - rest[i];
      if (delta > power.z) {
        force = k[i] * power.above(delta) - rest[i];
      }
      net[i] = force;
    }
  }

  /**
   * The same between beads for α = 3/2, the usual one: a loop of its own, and in just this form, is twice as fast.
   * @param {Float64Array} u
   * @param {number} first
   * @param {number} end
   */
  forcesOfSpheres(u, first, end) {
    const { net, k, rho, rest } = this;
    const z = this.power.z;
    for (let i = first; i < end; i += 1) {
      const delta = u[i - 1] - u[i] + rho[i];
      let force = 0 - rest[i];
      if (delta > z) {
        force = k[i] * (delta * Math.sqrt(delta)) - rest[i];
      }
      net[i] = force;
    }
  }

  /** @param {Motion} state @param {number} h */
  kick({ v }, h) {
    const { from, to, inverseMass, net } = this;
    for (let i = from; i < to; i += 1) {
      v[i] += h * inverseMass[i] * (net[i] - net[i + 1]);
    }
  }

  /** A kick, a drift, and the forces where that leads to. @param {Motion} state @param {number} h @param {number} d */
  kickDrift({ u, v }, h, d) {
    const { from, to, inverseMass, net } = this;
    for (let i = from; i < to; i += 1) {
      v[i] += h * inverseMass[i] * (net[i] - net[i + 1]);
      u[i] += d * v[i];
    }
    this.forces(u);
  }

  /** @param {Motion} state */
  stepGear5({ u, v, extra }) {
    const { beads: n, dt, inverseMass, rho, net, predictedU: up, predictedV: vp } = this;
    const [n2, n3] = [2 * n, 3 * n];
    const [half, rate, c1] = [0.5 * (dt * dt), 1 / dt, C1 / dt];
    for (let i = 0; i < n; i += 1) {
      const [q2, q3, q4, q5] = [extra[i], extra[n + i], extra[n2 + i], extra[n3 + i]];
      up[i + 1] = u[i] + (dt * v[i] + (q5 + q4 + q3 + q2));
      vp[i] = v[i] + rate * (2 * q2 + (3 * q3 + (4 * q4 + 5 * q5)));
    }
    for (let i = 0; i <= n; i += 1) {
      net[i] = this.elastic(i, up[i] - up[i + 1] + rho[i]) - this.rest[i];
    }
    for (let i = 0; i < n; i += 1) {
      const [q2, q3, q4, q5] = [extra[i], extra[n + i], extra[n2 + i], extra[n3 + i]];
      const x = half * inverseMass[i] * (net[i] - net[i + 1]);
      const y = x - (3 * q3 + (6 * q4 + 10 * q5) + q2);
      u[i] = up[i + 1] + C0 * y;
      v[i] = vp[i] + c1 * y;
      extra[i] = x;
      extra[n + i] = orZero(4 * q4 + 10 * q5 + q3 + C3 * y);
      extra[n2 + i] = orZero(5 * q5 + q4 + C4 * y);
      extra[n3 + i] = orZero(q5 + C5 * y);
    }
  }

  /**
   * The terms q2 … q5 at step 0: those of the exact motion, from the series of every contact's force.
   * @param {Motion} state
   */
  startGear5({ u, v, extra }) {
    const { beads: n, dt, power, k, rho } = this;
    const q = [u, v.map((speed) => speed * dt), ...[0, 1, 2, 3].map((j) => extra.subarray(j * n, (j + 1) * n))];
    // per contact the series of δ, P and F, four terms each
    const [deltas, ps, fs] = [0, 1, 2].map(() => Array.from({ length: n + 1 }, () => [0, 0, 0, 0, 0]));
    for (let j = 0; j <= 3; j += 1) {
      for (let i = 0; i <= n; i += 1) {
        const [delta, p, f] = [deltas[i], ps[i], fs[i]];
        for (let order = j; order <= j + 1; order += 1) {
          const terms = q[order];
          delta[order] = (i > 0 ? terms[i - 1] : 0) - (i < n ? terms[i] : 0) + (order === 0 ? rho[i] : 0);
        }
        if (j === 0) {
          p[0] = power.at(delta[0]);
          f[0] = k[i] * p[0];
        } else if (f[0] !== 0 && !(Math.abs(delta[1]) >= delta[0])) {
          p[j] = nextTerm(this.power.alpha, p, delta, j);
          f[j] = k[i] * p[j];
        }
      }
      for (let i = 0; i < n; i += 1) {
        const net = (/** @type {number} */ c) => (j === 0 ? fs[c][0] - this.rest[c] : fs[c][j]);
        q[j + 2][i] = ((dt * dt) / ((j + 1) * (j + 2)) / this.mass[i]) * (net(i) - net(i + 1));
      }
    }
  }

  /** Kinetic and potential energy, and the work dissipated and driven since step 0 (J). @param {Motion} state */
  energies(state) {
    const { beads: n, mass } = this;
    const { v, extra } = state;
    const contacts = new Float64Array(n + 1);
    this.contactEnergies(state, contacts);
    return {
      kinetic: sum(n, (i) => 0.5 * mass[i] * (v[i] * v[i])),
      potential: sum(n - 1, (i) => contacts[i + 1]) + (contacts[0] + contacts[n]),
      dissipated: this.damped ? sum(n, (i) => extra[n * this.extraNames.indexOf("W") + i]) : 0,
      driven: 0,
    };
  }

  /**
   * Energy of each contact: contact i has bead i on its right; walls are at both ends.
   * @param {Motion} state
   * @param {Float64Array} into
   */
  contactEnergies({ u }, into) {
    const { beads: n, rho, isLoaded } = this;
    into[0] = this.hasWall[0] ? this.excess(0, -u[0]) : 0;
    into[n] = this.hasWall[1] ? this.excess(n, u[n - 1]) : 0;
    for (let i = 1; i < n; i += 1) {
      const a = u[i - 1] - u[i];
      into[i] = isLoaded ? this.excess(i, a) : this.potential(i, a + rho[i]);
    }
  }

  /** Energy of the spring that holds bead i at its place. @param {Motion} _state @param {number} _i */
  siteEnergy(_state, _i) {
    return 0;
  }

  /** Kinetic and potential energy of the resonator of bead i. @param {Motion} _state @param {number} _i */
  resonatorEnergy(_state, _i) {
    return { kinetic: 0, potential: 0 };
  }

  /** E of contact i. @param {number} i @param {number} delta */
  elastic(i, delta) {
    return this.k[i] * this.power.at(delta);
  }

  /** Work of all drives. @param {Motion} _state */
  drivenWork(_state) {
    return 0;
  }

  /** Displacement and velocity of both walls. @param {Motion} [_state] */
  wallsOf(_state) {
    return { left: { x: 0, v: 0 }, right: { x: 0, v: 0 } };
  }

  /** U of contact i. @param {number} i @param {number} delta */
  potential(i, delta) {
    return delta > this.power.z ? (this.k[i] * this.power.at(delta) * delta) / (this.power.alpha + 1) : 0;
  }

  /**
   * Energy of contact i at an approach a from its rest, beyond the energy at rest, less the work of the rest force.
   * @param {number} i @param {number} a
   */
  excess(i, a) {
    const alpha = this.power.alpha;
    const [rho, rest] = [this.rho[i], this.rest[i]];
    const x = a / rho;
    if (Math.abs(x) <= 1 / (16 * (alpha + 1))) {
      const e = this.excessSeries;
      let series = e[7];
      for (let n = 6; n >= 0; n -= 1) {
        series = series * x + e[n];
      }
      return rest * a * x * series;
    }
    return this.potential(i, a + rho) - this.potential(i, rho) - rest * a;
  }
}

/**
 * Term j of A = δ^a from those before it and the terms of δ.
 * @param {number} a @param {number[]} terms @param {number[]} delta @param {number} j
 */
function nextTerm(a, terms, delta, j) {
  let total = 0;
  for (let i = 1; i <= j; i += 1) {
    total += (i * a - (j - i)) * delta[i] * terms[j - i];
  }
  return total / (j * delta[0]);
}
