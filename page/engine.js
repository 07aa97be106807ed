// A run as the page sees it: everything is asked of a worker that has it.

import { curveCount } from "./rows.js";

/** @typedef {import("./types.d.ts").State} State */
/** @typedef {import("./types.d.ts").Rows} Rows */
/** @typedef {import("./types.d.ts").RowsRequest} RowsRequest */

/**
 * The array with more values from a place on: itself, or where it has no room a larger one.
 * @param {Float64Array} array
 * @param {Float64Array} more
 * @param {number} from
 */
function put(array, more, from) {
  let into = array;
  if (from + more.length > array.length) {
    into = new Float64Array(Math.max(from + more.length, 2 * array.length));
    into.set(array.subarray(0, from));
  }
  into.set(more, from);
  return into;
}

export class Engine {
  /** @param {Worker} worker */
  constructor(worker) {
    this.worker = worker;
    /** @type {import("./types.d.ts").Info} */
    this.info = /** @type {any} */ (undefined);
    /** @type {((state: State) => void) | undefined} */
    this.onstate = undefined;
    /** @type {((status: import("./types.d.ts").LiveStatus) => void) | undefined} */
    this.onstatus = undefined;
    /** @type {((reason: string) => void) | undefined} */
    this.onend = undefined;
    /** @type {((message: string) => void) | undefined} */
    this.onfault = undefined;
    /** Told what is found to be wrong with a file that is shown. @type {((note: string) => void) | undefined} */
    this.onnote = undefined;
    /** @type {Map<number, { done: (value: any) => void, failed: (error: Error) => void, part: (value: any) => void }>} */
    this.asked = new Map();
    this.next = 0;
    this.rowsAsked = 0;
    worker.onmessage = ({ data }) => this.hear(data);
    worker.onerror = (event) => {
      event.preventDefault();
      this.fail(new Error(event.message ?? "The worker that computes has stopped."));
    };
  }

  /**
   * Opens a source in a worker of its own; rejects with what to tell the user.
   * @param {import("./types.d.ts").Source} source
   * @param {() => Worker} startWorker
   */
  static async open(source, startWorker) {
    const engine = new Engine(startWorker());
    try {
      // a worker made from text has no address that others could be relative to
      const absolute = "url" in source ? { ...source, url: new URL(source.url, document.baseURI).href } : source;
      if (absolute.kind === "live") {
        absolute.url = absolute.url.replace(/^http/, "ws");
      }
      engine.info = await engine.ask("open", [absolute]);
      return engine;
    } catch (error) {
      engine.close();
      throw error;
    }
  }

  /**
   * @param {string} call
   * @param {unknown[]} args
   * @param {(value: any) => void} [part]
   * @returns {Promise<any>}
   */
  ask(call, args, part = () => {}) {
    return new Promise((done, failed) => {
      this.next += 1;
      this.asked.set(this.next, { done, failed, part });
      this.worker.postMessage({ id: this.next, call, args });
    });
  }

  /** @param {any} message */
  hear({ id, part, value, error, event }) {
    if (event !== undefined) {
      this.hearEvent(event, value);
      return;
    }
    const asked = this.asked.get(id);
    if (part !== undefined) {
      asked?.part(part);
      return;
    }
    this.asked.delete(id);
    if (error !== undefined) {
      asked?.failed(new Error(error));
    } else {
      asked?.done(value);
    }
  }

  /**
   * @param {string} event
   * @param {any} value
   */
  hearEvent(event, value) {
    if (this.info !== undefined && (event === "state" || this.info.recomputes)) {
      this.info.lastStep = Math.max(this.info.lastStep, value.step ?? 0);
    }
    if (event === "state") {
      this.onstate?.(value);
      void this.ask("seen", []);
    } else if (event === "status") {
      this.onstatus?.(value);
    } else if (event === "end") {
      this.onend?.(value.reason);
    } else if (event === "note") {
      this.onnote?.(value);
    } else {
      this.onfault?.(value);
    }
  }

  /** @param {Error} error */
  fail(error) {
    this.asked.forEach(({ failed }) => failed(error));
    this.asked.clear();
    this.onfault?.(error.message);
  }

  /**
   * The state at any step, recomputed if need be.
   * @param {number} step
   * @returns {Promise<State>}
   */
  state(step) {
    return this.ask("state", [step]);
  }

  /**
   * Rows of a map and its curves; `onrows` is called whenever there are more. A newer request replaces an older one.
   * @param {RowsRequest} request
   * @param {(rows: Rows) => void} onrows
   * @returns {Promise<void>} settles when all are there, or a newer request has come
   */
  rows(request, onrows) {
    this.rowsAsked += 1;
    const asked = this.rowsAsked;
    const wide = curveCount(request.follow);
    /** @type {Rows} */
    let rows = {
      request,
      columns: 0,
      count: 0,
      steps: new Float64Array(0),
      cells: new Float64Array(0),
      lows: new Float64Array(0),
      highs: new Float64Array(0),
      seen: -1,
      fresh: 0,
      isWhole: false,
    };
    return this.ask("rows", [request], ({ from, columns, steps, cells, lows, highs, seen, isWhole }) => {
      if (asked !== this.rowsAsked) {
        return;
      }
      if (from === 0) {
        // all of them anew, in an object of its own: whoever has painted the rows before sees that it is another
        rows = { request, columns, count: steps.length, steps, cells, lows, highs, seen, fresh: 0, isWhole };
      } else {
        rows.steps = put(rows.steps, steps, from);
        rows.cells = put(rows.cells, cells, from * columns);
        rows.lows = put(rows.lows, lows, from * wide);
        rows.highs = put(rows.highs, highs, from * wide);
        rows.count = from + steps.length;
        rows.fresh = Math.min(rows.fresh, from);
        Object.assign(rows, { seen, isWhole });
      }
      onrows(rows);
    });
  }

  /**
   * Energies and followed beads at every step, or where steps are not recomputed at every state that is there.
   * @param {{ steps: [number, number], follow: number[] }} request
   * @param {(part: { steps: Float64Array, values: Float64Array }) => void} onpart some steps, and `curveCount` values of each
   * @returns {Promise<void>}
   */
  series(request, onpart) {
    return this.ask("series", [request], onpart);
  }

  /**
   * Finds the events of a bead over the whole run; the last call has them all.
   * @param {number} bead
   * @param {(events: import("./types.d.ts").Event[], isDone: boolean) => void} onevents
   */
  async events(bead, onevents) {
    const last = await this.ask("events", [bead], ({ events, isDone }) => onevents(events, isDone));
    if (last !== undefined) {
      onevents(last.events, last.isDone);
    }
  }

  /**
   * Recomputes what is stored and compares the bits.
   * @param {(proof: import("./types.d.ts").Proof) => void} onproof
   * @returns {Promise<import("./types.d.ts").Proof>}
   */
  prove(onproof) {
    return this.ask("prove", [], onproof);
  }

  close() {
    this.worker.terminate();
    this.fail(new Error("This run was closed."));
  }
}
