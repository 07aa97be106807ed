// Pieces of a step: a step ends at each knot of a drive and goes on there. Written from docs/KERNEL.md.

import { twoProduct } from "./waveforms.js";

/** @import { Waveform } from "./waveforms.js" */

/** Knots nearer to each other than this part of a step are one. */
const APART = 2 ** -20;

/**
 * A time of step n: `s` after its beginning, `since` after that of its piece at `start`; what jumps is looked at `beside` later.
 * @typedef {{ n: number, start: number, since: number, s: number, isEnd: boolean, beside: number }} When
 */

/** From `start` to `stop` in step n. */
export class Piece {
  /**
   * @param {number} n
   * @param {number} start
   * @param {number} stop
   * @param {boolean} isLast
   * @param {number} after how far from its beginning what jumps is looked at
   * @param {number} before how far from its end
   */
  constructor(n, start, stop, isLast, after = 0, before = 0) {
    this.n = n;
    this.start = start;
    this.stop = stop;
    this.isLast = isLast;
    this.after = after;
    this.before = before;
    this.length = stop - start;
  }

  /** @returns {When} */
  begin() {
    return { n: this.n, start: this.start, since: 0, s: this.start, isEnd: false, beside: this.after };
  }

  /** @param {number} since @returns {When} */
  within(since) {
    return { n: this.n, start: this.start, since, s: this.start + since, isEnd: false, beside: 0 };
  }

  /** @returns {When} */
  end() {
    return { n: this.n, start: this.start, since: this.length, s: this.stop, isEnd: this.isLast, beside: -this.before };
  }
}

/** The places at which the steps of a run are divided. */
export class Knots {
  /** @param {Waveform[]} waveforms @param {number} dt */
  constructor(waveforms, dt) {
    this.dt = dt;
    /** @type {Map<number, number[]>} by step, the times after its beginning; 0 is the beginning itself */
    this.bySteps = new Map();
    const times = waveforms.flatMap((waveform) => waveform.knots()).filter((knot) => knot > APART * dt);
    let last = 0;
    for (const knot of Float64Array.from(times).sort()) {
      if (knot - last > APART * dt) {
        last = knot;
        this.add(knot);
      }
    }
  }

  /** @param {number} knot */
  add(knot) {
    const near = APART * this.dt;
    let n = Math.floor(knot / this.dt);
    const [p, e] = twoProduct(n, this.dt);
    let s = knot - p - e;
    if (s <= near) {
      s = 0;
    } else if (this.dt - s <= near) {
      [n, s] = [n + 1, 0];
    }
    const others = this.bySteps.get(n) ?? [];
    others.push(s);
    this.bySteps.set(n, others);
  }

  /** The pieces of step n, one after the other. @param {number} n */
  pieces(n) {
    const ofStep = this.bySteps.get(n) ?? [];
    const bounds = [0, ...ofStep.filter((s) => s > 0), this.dt];
    const isKnot = bounds.map(() => true);
    isKnot[0] = ofStep[0] === 0;
    isKnot[bounds.length - 1] = this.bySteps.get(n + 1)?.[0] === 0;
    return bounds.slice(1).map((stop, i) => {
      const inside = Math.min(0.25 * (stop - bounds[i]), 2 * APART * this.dt);
      const [after, before] = [isKnot[i], isKnot[i + 1]].map((is) => (is ? inside : 0));
      return new Piece(n, bounds[i], stop, i === bounds.length - 2, after, before);
    });
  }
}
