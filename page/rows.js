// The rows of a map with the curves beside it: what the states of some steps have, thinned to what can be seen.

import { ENERGY_COUNT, columnCount, outermost } from "./fields.js";
import { rankOf } from "./history.js";

/** @typedef {import("./types.d.ts").RowsRequest} RowsRequest */
/** @typedef {import("./types.d.ts").State} State */
/** `lows` and `highs` are the extremes of what curves show, `cells` those of the map. */
/** @typedef {{ step: number, cells: Float64Array, lows: Float64Array, highs: Float64Array }} Row */

/**
 * Curves have so many numbers of a state: its energies, and u and v of each followed bead.
 * @param {number[]} follow
 */
export function curveCount(follow) {
  return ENERGY_COUNT + 2 * follow.length;
}

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
    /** Rows closer than this to the last one become part of it, as a live run goes on. */
    this.stride = 1;
    /** The steps up to this one, and from the first row on, were all looked at. */
    this.seen = -1;
  }

  /**
   * @param {State} state
   * @returns {Row}
   */
  rowOf(state) {
    const { fields, request, columns } = this;
    const cells = new Float64Array(columns);
    fields.row(request.field, state, request.places, columns, cells);
    const lows = this.curvesOf(state);
    return { step: state.step, cells, lows, highs: lows.slice() };
  }

  /** The values that curves show of a state. @param {State} state */
  curvesOf(state) {
    const { follow } = this.request;
    const values = new Float64Array(curveCount(follow));
    this.fields.energies(state, values, 0);
    follow.forEach((bead, i) => values.set([state.u[bead], state.v[bead]], ENERGY_COUNT + 2 * i));
    return values;
  }

  /**
   * Makes a row stand for another one, too.
   * @param {Row} row
   * @param {Row} other
   */
  merge({ cells, lows, highs }, other) {
    const { field } = this.request;
    for (let i = 0; i < cells.length; i += 1) {
      cells[i] = outermost(field, cells[i], other.cells[i]);
    }
    for (let i = 0; i < lows.length; i += 1) {
      lows[i] = Math.min(lows[i], other.lows[i]);
      highs[i] = Math.max(highs[i], other.highs[i]);
    }
  }

  /** Makes the row at or before a state stand for it, too. @param {State} state */
  widen(state) {
    const row = this.rows[rankOf(this.rows, state.step) - 1];
    if (row !== undefined) {
      this.merge(row, this.rowOf(state));
    }
  }

  /**
   * Gives a state of a live run a row, where the one before is as far away as rows are, or makes that stand for it, too.
   * @param {State} state
   */
  place(state) {
    const rank = rankOf(this.rows, state.step);
    if (rank > 0 && state.step < this.rows[rank - 1].step + this.stride) {
      this.merge(this.rows[rank - 1], this.rowOf(state));
    } else {
      this.rows.splice(rank, 0, this.rowOf(state));
    }
  }

  /** The number of rows before the first two that are farther apart than twice this. @param {number} stride */
  contiguous(stride) {
    const gap = this.rows.findIndex(({ step }, i) => i > 0 && step - this.rows[i - 1].step > 2 * stride);
    return gap < 0 ? this.rows.length : gap;
  }

  /** True if there is a row of this step. */
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
   * Adds the newest state of a live run; true if older rows became fewer for it.
   * @param {State} state
   */
  append(state) {
    const last = this.rows.at(-1);
    if (last !== undefined && state.step < last.step + this.stride) {
      this.widen(state);
      return false;
    }
    this.rows.push(this.rowOf(state));
    if (this.rows.length <= this.request.rows) {
      return false;
    }
    this.stride = Math.max(1, (2 * (state.step - this.rows[0].step)) / this.request.rows);
    /** @type {Row[]} */
    const kept = [];
    for (const row of this.rows) {
      const before = kept.at(-1);
      if (before === undefined || row.step >= before.step + this.stride || row.step === state.step) {
        kept.push(row);
      } else {
        this.merge(before, row);
      }
    }
    this.rows = kept;
    return true;
  }

  /**
   * The rows from `from` on, or of them those before `end`, in arrays of their own.
   * @param {number} from
   * @param {number} [end]
   */
  packed(from, end) {
    const { columns } = this;
    const rows = this.rows.slice(from, end);
    const wide = curveCount(this.request.follow);
    const steps = new Float64Array(rows.length);
    const cells = new Float64Array(rows.length * columns);
    const lows = new Float64Array(rows.length * wide);
    const highs = new Float64Array(rows.length * wide);
    rows.forEach((row, i) => {
      steps[i] = row.step;
      cells.set(row.cells, i * columns);
      lows.set(row.lows, i * wide);
      highs.set(row.highs, i * wide);
    });
    return { columns, steps, cells, lows, highs, seen: this.seen };
  }
}
