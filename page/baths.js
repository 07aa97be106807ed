// Heat baths, written from docs/KERNEL.md alone: part of chains.js.

import { Waveform, exp, expm1, ln, sincos } from "./waveforms.js";

/** @import { BathEntry } from "./types.js" */

export const BOLTZMANN = 1.380649e-23;

/** The upper 32 bits of a product. @param {number} a @param {number} b */
function high(a, b) {
  const [a1, a0, b1, b0] = [a >>> 16, a & 0xffff, b >>> 16, b & 0xffff];
  const middle = a1 * b0 + ((a0 * b0) >>> 16);
  const other = a0 * b1 + (middle % 65536);
  return a1 * b1 + Math.floor(middle / 65536) + Math.floor(other / 65536);
}

/** The four words of a seed and a counter: Philox4x32-10. @param {number} seed @param {number[]} counter */
function words(seed, [c0, c1, c2, c3]) {
  let [k0, k1] = [seed >>> 0, Math.floor(seed / 2 ** 32) >>> 0];
  for (let round = 0; round < 10; round += 1) {
    const [p, q] = [high(0xd2511f53, c0), high(0xcd9e8d57, c2)];
    [c0, c1, c2, c3] = [
      ...[(q ^ c1 ^ k0) >>> 0, Math.imul(0xcd9e8d57, c2) >>> 0],
      ...[(p ^ c3 ^ k1) >>> 0, Math.imul(0xd2511f53, c0) >>> 0],
    ];
    [k0, k1] = [(k0 + 0x9e3779b9) >>> 0, (k1 + 0xbb67ae85) >>> 0];
  }
  return [c0, c1, c2, c3];
}

/** Two normal numbers: of the cosine and of the sine. @param {number[]} words */
function normals([w0, w1, w2, w3]) {
  const bits = (/** @type {number} */ a, /** @type {number} */ b) => (a >>> 5) * 2 ** 26 + (b >>> 6);
  const [sine, cosine] = sincos(bits(w2, w3) / 2 ** 53, 0);
  const root = Math.sqrt(0 - 2 * ln((bits(w0, w1) + 1) / 2 ** 53));
  return [root * cosine, root * sine];
}

/** A bath of a chain. */
export class Bath {
  /**
   * @param {BathEntry} entry
   * @param {Float64Array} mass
   * @param {boolean} isRing
   * @param {number} dt
   * @param {number} seed that of the run
   */
  constructor(entry, mass, isRing, dt, seed) {
    const [from, to] = entry.beads.split("..").map(Number);
    const shape = entry.temperature_j ?? entry.temperature_k;
    if (shape === undefined) {
      throw new Error("a bath without a temperature");
    }
    this.mass = mass;
    this.seed = entry.seed ?? seed;
    this.pairs = entry.pairs === true;
    this.from = from;
    this.to = this.pairs && !(isRing && to - from === mass.length) ? to - 1 : to;
    this.unit = entry.temperature_j === undefined ? BOLTZMANN : 1;
    this.wave = new Waveform(shape, dt);
    this.e = exp(-(entry.friction_per_s * (0.5 * dt)));
    this.q = Math.sqrt(0 - expm1(-(entry.friction_per_s * dt)));
  }

  /**
   * B (0) or B' (1) of step n.
   * @param {Float64Array} v
   * @param {Float64Array} heat
   * @param {number} n
   * @param {0 | 1} half
   */
  act(v, heat, n, half) {
    const { mass, pairs, e, q, from, to } = this;
    const value = this.wave.value(n + half, 0);
    const t = value > 0 ? this.unit * value : 0;
    for (let turn = from; turn < to; turn += 1) {
      const i = half === 0 ? turn : to - 1 - (turn - from);
      const xi = normals(words(this.seed, [n >>> 0, Math.floor(n / 2 ** 32), i, pairs ? 2 : 1]))[half];
      const j = (i + 1) % mass.length;
      if (!pairs) {
        heat[i] += this.put(v, i, e * v[i] + q * Math.sqrt(t * (1 / mass[i])) * xi + 0);
        continue;
      }
      const g = 1 / mass[i] + 1 / mass[j];
      const s = v[i] - v[j];
      const y = e * s + q * Math.sqrt(t * g) * xi - s;
      const [toI, toJ] = [v[i] + (1 / mass[i] / g) * y, v[j] - (1 / mass[j] / g) * y];
      heat[i] += this.put(v, i, toI) + this.put(v, j, toJ);
    }
  }

  /** Gives a bead another velocity; the energy that this takes. @param {Float64Array} v @param {number} i @param {number} after */
  put(v, i, after) {
    const before = v[i];
    v[i] = after;
    return 0.5 * this.mass[i] * ((after - before) * (after + before));
  }
}
