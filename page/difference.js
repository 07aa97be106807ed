// The difference of two runs: off each state of the one is taken the state of the other at the same time. In a worker.

import { AnyStepper } from "./chains.js";
import { ENERGY_COUNT } from "./fields.js";
import { copyOf } from "./history.js";

/** @typedef {import("./types.d.ts").State} State */
/** @typedef {import("./history.js").History} History */
/** @typedef {State & { pair?: [State, State] }} Difference */

/** Parts of a step up to which times are the same. */
const SAME = 1e-6;

/**
 * A state between two others, by the cubic that has their displacements and velocities; works and heat on a straight line.
 * @param {State} before @param {State} after @param {number} part of the step, from 0 to 1
 * @param {import("./kernel.js").Stepper} stepper
 * @returns {State}
 */
export function between(before, after, part, stepper) {
  const [x, y, dt] = [part, 1 - part, stepper.dt];
  const [atBefore, atAfter] = [y * y * (1 + 2 * x), x * x * (3 - 2 * x)];
  const slope = (6 * x * y) / dt;
  /** @param {ArrayLike<number>} u @param {ArrayLike<number>} v @param {ArrayLike<number>} nextU @param {ArrayLike<number>} nextV */
  const cubic = (u, v, nextU, nextV) => [
    Float64Array.from(u, (u, i) => atBefore * u + atAfter * nextU[i] + dt * x * y * (y * v[i] - x * nextV[i])),
    Float64Array.from(v, (v, i) => slope * (nextU[i] - u[i]) + y * (1 - 3 * x) * v + x * (3 * x - 2) * nextV[i]),
  ];
  const [u, v] = cubic(before.u, before.v, after.u, after.v);
  const extra = before.extra.map((value, i) => y * value + x * after.extra[i]);
  if (stepper instanceof AnyStepper) {
    // resonators move as beads do, and walls as they are driven
    const { atW: w, beads: n } = stepper;
    const row = (/** @type {State} */ { extra }, /** @type {number} */ at) => extra.subarray(at, at + n);
    if (w >= 0) {
      cubic(row(before, w), row(before, w + n), row(after, w), row(after, w + n)).forEach((values, i) => extra.set(values, w + i * n));
    }
    const [walls, next] = [stepper.wallsOf(before), stepper.wallsOf(after)];
    stepper.drives.forEach(({ wall }, d) => {
      if (wall !== undefined) {
        [extra[stepper.atDrives + 2 * d + 1]] = cubic([walls[wall].x], [walls[wall].v], [next[wall].x], [next[wall].v])[0];
      }
    });
  }
  return { step: before.step, time_s: before.time_s + part * dt, u, v, extra };
}

/** Values of the difference, in the places of the first run. */
export class DifferenceFields {
  /**
   * @param {import("./fields.js").Fields} first
   * @param {import("./fields.js").Fields} other
   */
  constructor(first, other) {
    this.first = first;
    this.other = other;
    this.values = [new Float64Array(0), new Float64Array(0)];
  }

  /**
   * As `Fields.row`; of energies and forces the difference of both runs' values.
   * @param {import("./types.d.ts").Field} field
   * @param {Difference} state
   * @param {[number, number]} places
   * @param {number} columns
   * @param {Float64Array} into
   */
  row(field, { pair }, [first, last], columns, into) {
    const count = last - first + 1;
    if (this.values[0].length !== count) {
      this.values = [new Float64Array(count), new Float64Array(count)];
    }
    const [own, others] = this.values;
    const [a, b] = /** @type {[State, State]} */ (pair);
    this.first.row(field, a, [first, last], count, own);
    this.other.row(field, b, [first, last], count, others);
    let place = 0;
    for (let column = 0; column < columns; column += 1) {
      const end = Math.ceil(((column + 1) * count) / columns);
      let shown = 0;
      for (; place < end; place += 1) {
        const value = own[place] - others[place];
        shown = Math.abs(value) > Math.abs(shown) ? value : shown;
      }
      into[column] = shown;
    }
  }

  /** Curves show both runs, and not their difference. @param {State} _state @param {Float64Array} into @param {number} at */
  energies(_state, into, at) {
    into.fill(0, at, at + ENERGY_COUNT);
  }
}

/** The differences of two histories, by the steps of the first one. */
export class DifferenceHistory {
  /**
   * @param {History} first
   * @param {History} other
   */
  constructor(first, other) {
    this.first = first;
    this.other = other;
    const ratio = other.dt / first.dt;
    this.firstStep = Math.max(first.firstStep, Math.ceil(other.firstStep * ratio - SAME));
    this.lastStep = Math.min(first.lastStep, Math.floor(other.lastStep * ratio + SAME));
    this.whyNot = "";
  }

  /** None is kept: they are made of states that are. @param {number} _step @returns {Difference | undefined} */
  inMemory(_step) {
    return undefined;
  }

  /**
   * The other run's state at a time of the first one.
   * @param {number} time_s
   */
  async *otherAt(time_s) {
    const { dt } = this.other;
    const step = time_s / dt;
    const nearest = Math.round(step);
    if (Math.abs(step - nearest) <= SAME) {
      return yield* this.other.at(nearest);
    }
    const before = yield* this.other.at(Math.floor(step));
    const after = yield* this.other.at(Math.floor(step) + 1);
    return between(before, after, step - Math.floor(step), /** @type {import("./kernel.js").Stepper} */ (this.other.stepper));
  }

  /** @param {number} step @returns {AsyncGenerator<void, Difference>} */
  async *at(step) {
    const a = yield* this.first.at(step);
    return differenceOf(a, yield* this.otherAt(a.step * this.first.dt));
  }

  /**
   * As `History.each`.
   * @param {[number, number]} steps
   * @param {(state: Difference) => void} look
   */
  async *each([from, to], look) {
    const { first, other } = this;
    if (first.dt !== other.dt) {
      for (let step = from; step <= to; step += 1) {
        look(yield* this.at(step));
      }
      return;
    }
    const own = copyOf(yield* first.at(from));
    const others = copyOf(yield* other.at(from));
    look(differenceOf(own, others));
    while (own.step < to) {
      yield* first.advance(own, own.step + 1);
      yield* other.advance(others, own.step);
      look(differenceOf(own, others));
    }
  }
}

/** @param {State} a @param {State} b @returns {Difference} */
function differenceOf(a, b) {
  const [u, v] = [a.u.map((u, i) => u - b.u[i]), a.v.map((v, i) => v - b.v[i])];
  return { step: a.step, time_s: a.time_s, u, v, extra: new Float64Array(0), pair: [a, b] };
}

/**
 * Why there is no difference of two runs; "" if there is.
 * @param {import("./types.d.ts").Info} first
 * @param {import("./types.d.ts").Info} other
 */
export function whyNoDifference(first, other) {
  const [beads, others] = [first.chain.mass.length, other.chain.mass.length];
  if (beads !== others) {
    return `One run has ${beads} beads and the other ${others}: they have no difference bead by bead.`;
  }
  const why = first.whyNot || other.whyNot;
  return why && `A difference needs the states of both runs at the same times. ${why}`;
}
