// The rows of a map with the curves beside it: a state each, thinned to what can be seen.

import { ENERGY_COUNT, columnCount } from "./fields.js";
import { rankOf } from "./history.js";

/** @typedef {import("./types.d.ts").RowsRequest} RowsRequest */
/** @typedef {import("./types.d.ts").State} State */
/** @typedef {{ step: number, cells: Float32Array, energies: Float64Array, followed: Float64Array }} Row */

/**
 * The steps that a map of these steps shows: multiples of a power of two, so that states are met again when somebody
 * zooms, and the last one.
 * @param {[number, number]} steps
 * @param {number} rows
 */
export function stepsShown([first, last], rows) {
  let stride = 1;
  while ((last - first) / stride > rows) {
    stride *= 2;
  }
  const shown = [];
  for (let step = Math.floor(first / stride) * stride; step <= last; step += stride) {
    shown.push(step);
  }
  if (shown.at(-1) !== last) {
    shown.push(last);
  }
  return { stride, shown };
}

/** Rows of one request. */
export class RowTable {
  /**
   * @param {import("./fields.js").Fields} fields
   * @param {RowsRequest} request
   */
  constructor(fields, request) {
    this.fields = fields;
    this.request = request;
    this.columns = columnCount(request.places, request.columns);
    /** In the order of their steps. @type {Row[]} */
    this.rows = [];
    /** Rows closer than this to the last one are left out, as a live run goes on. */
    this.stride = 1;
  }

  /**
   * @param {State} state
   * @returns {Row}
   */
  rowOf(state) {
    const { fields, request, columns } = this;
    const cells = new Float32Array(columns);
    fields.row(request.field, state, request.places, columns, cells);
    const energies = new Float64Array(ENERGY_COUNT);
    fields.energies(state, energies, 0);
    const followed = new Float64Array(request.follow.flatMap((bead) => [state.u[bead], state.v[bead]]));
    return { step: state.step, cells, energies, followed };
  }

  /** Whether there is a row of this step. */
  has(/** @type {number} */ step) {
    return this.rows[rankOf(this.rows, step) - 1]?.step === step;
  }

  /** Adds a row of a state, unless it is there. */
  insert(/** @type {State} */ state) {
    if (!this.has(state.step)) {
      this.rows.splice(rankOf(this.rows, state.step), 0, this.rowOf(state));
    }
  }

  /**
   * Adds the newest state of a live run; true if older rows were thinned for it.
   * @param {State} state
   */
  append(state) {
    const last = this.rows.at(-1);
    if (last !== undefined && state.step < last.step + this.stride) {
      return false;
    }
    this.rows.push(this.rowOf(state));
    if (this.rows.length <= this.request.rows) {
      return false;
    }
    this.stride = Math.max(1, (2 * (state.step - this.rows[0].step)) / this.request.rows);
    let before = -Infinity;
    this.rows = this.rows.filter(({ step }, i) => {
      const stays = step >= before + this.stride || i === this.rows.length - 1;
      before = stays ? step : before;
      return stays;
    });
    return true;
  }

  /**
   * The rows from `from` on in arrays of their own.
   * @param {number} from
   */
  packed(from) {
    const { columns } = this;
    const rows = this.rows.slice(from);
    const wide = 2 * this.request.follow.length;
    const steps = new Float64Array(rows.length);
    const cells = new Float32Array(rows.length * columns);
    const energies = new Float64Array(rows.length * ENERGY_COUNT);
    const followed = new Float64Array(rows.length * wide);
    rows.forEach((row, i) => {
      steps[i] = row.step;
      cells.set(row.cells, i * columns);
      energies.set(row.energies, i * ENERGY_COUNT);
      followed.set(row.followed, i * wide);
    });
    return { columns, steps, cells, energies, followed };
  }
}
