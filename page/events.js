// Events of a bead between two steps: contacts that close and open, turning points; interpolated by cubics, as
// `beadline impurity` does.

/** @typedef {import("./types.d.ts").State} State */

/**
 * The cubic through two values with their rates of change over a time (s), at a fraction of it, and its slope.
 * @param {[number, number]} start
 * @param {[number, number]} end
 * @param {number} time
 */
function cubic([y0, rate0], [y1, rate1], time) {
  const [m0, m1] = [rate0 * time, rate1 * time];
  return {
    value(/** @type {number} */ s) {
      const r = 1 - s;
      return y0 * (1 + 2 * s) * r * r + y1 * s * s * (3 - 2 * s) + s * r * (m0 * r - m1 * s);
    },
    slope(/** @type {number} */ s) {
      const r = 1 - s;
      return 6 * s * r * (y1 - y0) + m0 * r * (1 - 3 * s) + m1 * s * (3 * s - 2);
    },
  };
}

/**
 * Place between 0 and 1 at which a side changes.
 * @param {(s: number) => boolean} side
 */
function crossing(side) {
  let [low, high] = [0, 1];
  const atStart = side(low);
  for (let i = 0; i < 52; i += 1) {
    const middle = 0.5 * (low + high);
    if (side(middle) === atStart) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return 0.5 * (low + high);
}

/** Follows one bead from state to state. */
export class Follower {
  /**
   * @param {number} bead
   * @param {import("./types.d.ts").Chain} chain
   * @param {number} toleranceM up to which a contact counts as touching
   * @param {number} restSpeed up to which a bead counts as at rest (m/s)
   * @param {import("./kernel.js").Stepper} stepper of the chain
   */
  constructor(bead, chain, toleranceM, restSpeed, stepper) {
    this.bead = bead;
    this.chain = chain;
    this.toleranceM = toleranceM;
    this.restSpeed = restSpeed;
    this.stepper = stepper;
    /** @type {ReturnType<Follower["sample"]> | undefined} */
    this.before = undefined;
    this.hasMoved = false;
    /** −1, 0 (it never moved) or 1. */
    this.heading = 0;
  }

  /**
   * Displacement, velocity, and overlap and its rate on both sides.
   * @param {State} state
   */
  sample(state) {
    const { step, time_s, u, v } = state;
    const { bead: b, chain } = this;
    const [last, ring] = [u.length - 1, chain.ring];
    const walls = this.stepper.wallsOf(state);
    const closing = ring && /** @type {[number, number]} */ ([u[last] - u[0] + ring.restOverlap, v[last] - v[0]]);
    const [left, right] = [chain.leftWall, chain.rightWall];
    /** @type {([number, number] | undefined)[]} */
    const contacts = [
      b > 0
        ? [u[b - 1] - u[b] + chain.restOverlap[b - 1], v[b - 1] - v[b]]
        : left ? [walls.left.x - u[0] + left.restOverlap, walls.left.v - v[0]] : closing,
      b < last
        ? [u[b] - u[b + 1] + chain.restOverlap[b], v[b] - v[b + 1]]
        : right ? [u[b] - walls.right.x + right.restOverlap, v[b] - walls.right.v] : closing,
    ];
    return { step, time_s, u: u[b], v: v[b], contacts };
  }

  /**
   * Events since the state before.
   * @param {State} state
   * @returns {import("./types.d.ts").Event[]}
   */
  observe(state) {
    const [from, to] = [this.before, this.sample(state)];
    this.before = to;
    const headed = this.heading;
    this.heading = Math.sign(to.v) || headed;
    this.hasMoved ||= Math.abs(to.v) > this.restSpeed;
    /** @type {import("./types.d.ts").Event[]} */
    const events = [];
    if (from === undefined) {
      return events;
    }
    const time = to.time_s - from.time_s;
    const path = cubic([from.u, from.v], [to.u, to.v], time);
    const tell = (/** @type {import("./types.d.ts").Event["kind"]} */ kind, /** @type {number} */ s) =>
      events.push({ bead: this.bead, kind, step: to.step, time_s: from.time_s + s * time, u_m: path.value(s) });
    for (const side of [0, 1]) {
      const [a, b] = [from.contacts[side], to.contacts[side]];
      if (a !== undefined && b !== undefined && a[0] > this.toleranceM !== b[0] > this.toleranceM) {
        const overlap = cubic(a, b, time);
        const name = side === 0 ? "left" : "right";
        tell(`${name}-${b[0] > this.toleranceM ? "closes" : "opens"}`, crossing((s) => overlap.value(s) > this.toleranceM));
      }
    }
    if (headed !== 0 && this.heading !== headed && this.hasMoved) {
      // a bead that stood still in the state before turned there
      tell("turns", from.v === 0 ? 0 : crossing((s) => path.slope(s) > 0));
      this.hasMoved = Math.abs(to.v) > this.restSpeed;
    }
    return events.sort((a, b) => a.time_s - b.time_s);
  }
}
