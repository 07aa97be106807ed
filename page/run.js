// One run as it is looked at: its engine, the state at the cursor, the rows of its map, its events.

import { Fields } from "./fields.js";
import { isOfContacts } from "./map.js";

/** @typedef {import("./types.d.ts").State} State */
/** @typedef {import("./types.d.ts").Field} Field */
/** @typedef {import("./types.d.ts").Event} Event */

/**
 * A place that a field has a value at, in words.
 * @param {Field} field
 */
export function placeWord(field) {
  return isOfContacts(field) ? "contact" : "bead";
}

/** The unit of a field's values; "" of classes. @param {Field} field */
export function unitOf(field) {
  return { velocity: "m/s", displacement: "m", overlap: "m", energy: "J", contacts: "", force: "N" }[field];
}

/** The part of a live run that is seen on the map of its whole duration. */
const LEAST_PART = 1 / 200;

/** Time after which rows are shown though some are missing. */
const PATIENCE_MS = 400;

/** A run, and what of it has arrived. */
export class Run {
  /**
   * @param {import("./engine.js").Engine} engine
   * @param {() => void} onnews something arrived
   * @param {(message: string) => void} onfault
   */
  constructor(engine, onnews, onfault) {
    this.engine = engine;
    this.onnews = onnews;
    this.onfault = onfault;
    this.info = engine.info;
    this.physics = engine.info.manifest.physics;
    this.fields = new Fields(engine.info.manifest, engine.info.chain);
    /** @type {import("./types.d.ts").Rows | undefined} */
    this.rows = undefined;
    /** @type {State | undefined} the one at the cursor */
    this.state = undefined;
    /** @type {State | undefined} of a live run */
    this.newest = undefined;
    /** @type {import("./types.d.ts").LiveStatus | undefined} */
    this.status = undefined;
    this.ended = "";
    /** @type {Map<number, { events: Event[], isDone: boolean }>} by bead */
    this.events = new Map();
    /** @type {import("./types.d.ts").Pulse[]} */
    this.pulses = [];
    /** @type {import("./types.d.ts").Mode[]} */
    this.modes = [];
    this.asked = "";
    /** @type {number | undefined} */
    this.wanted = undefined;
    this.isBusy = false;
    this.isClosed = false;
    /** @type {((state: State | undefined) => void)[]} */
    this.waiting = [];
  }

  /** Beads. */
  get beads() {
    return this.physics.beads;
  }

  /** Last place of a field. @param {Field} field */
  lastPlace(field) {
    return this.beads - (placeWord(field) === "bead" || this.info.chain.ring ? 1 : 2);
  }

  /**
   * The last step that a whole map shows. For a live run it is the end of its duration, so that nothing moves while it
   * goes. For a run so long that nothing would be visible yet, it lies ahead and doubles.
   */
  get endStep() {
    const { kind, firstStep, lastStep } = this.info;
    const isGrowing = kind === "live" && this.ended === "";
    const { step_count: all } = this.physics;
    const ahead = lastStep < LEAST_PART * all ? Math.min(2 ** Math.ceil(Math.log2(Math.max(lastStep, 64))), all) : all;
    return Math.max(firstStep + 1, isGrowing ? ahead : lastStep);
  }

  /** Place of the cursor until it is moved: at the end, unless all of the run would have to be computed for it. */
  get ownStep() {
    const { kind, firstStep, lastStep } = this.info;
    return kind === "start" ? firstStep : lastStep;
  }

  /** @param {number} step */
  clamp(step) {
    return Math.min(Math.max(Math.round(step), this.info.firstStep), this.info.lastStep);
  }

  /**
   * Brings the state at a step to the cursor. While one is on its way only the last that is wanted waits.
   * @param {number} step
   * @returns {Promise<State | undefined>} what arrived
   */
  seek(step) {
    this.wanted = this.clamp(step);
    const arrived = new Promise((/** @type {(state: State | undefined) => void} */ done) => this.waiting.push(done));
    if (!this.isBusy) {
      this.fetch();
    }
    return arrived;
  }

  async fetch() {
    this.isBusy = true;
    while (this.wanted !== undefined) {
      const step = this.wanted;
      this.wanted = undefined;
      try {
        this.state = await this.engine.state(step);
        this.onnews();
      } catch (error) {
        this.fault(error);
      }
    }
    this.isBusy = false;
    for (const done of this.waiting.splice(0)) {
      done(this.state);
    }
  }

  /**
   * Asks for rows, unless they are the ones asked for last.
   * @param {import("./types.d.ts").RowsRequest} request
   */
  ask(request) {
    const asked = request.steps[1] === Infinity ? `${JSON.stringify(request)} live` : JSON.stringify(request);
    if (asked === this.asked) {
      return;
    }
    this.asked = asked;
    const since = performance.now();
    const onrows = (/** @type {import("./types.d.ts").Rows} */ rows) => {
      // the picture before, stretched, is better than a new one that has only begun
      const isGood =
        rows.isWhole || this.rows?.request.field !== request.field || performance.now() - since > PATIENCE_MS;
      if (this.asked === asked && (isGood || rows.request.steps[1] === Infinity)) {
        this.rows = rows;
        this.onnews();
      }
    };
    this.engine.rows(request, onrows).catch((error) => this.fault(error));
  }

  /** Looks for events of a bead, once. One search replaces another that is not done. @param {number} bead */
  find(bead) {
    if (this.events.has(bead)) {
      return;
    }
    this.events.forEach(({ isDone }, other) => isDone || this.events.delete(other));
    this.events.set(bead, { events: [], isDone: false });
    const onevents = (/** @type {Event[]} */ events, /** @type {boolean} */ isDone) => {
      if (this.events.has(bead)) {
        this.events.set(bead, { events, isDone });
        this.onnews();
      }
    };
    this.engine.events(bead, onevents).catch((error) => this.fault(error));
  }

  /** @param {unknown} error */
  fault(error) {
    if (!this.isClosed) {
      this.onfault(error instanceof Error ? error.message : String(error));
    }
  }

  close() {
    this.isClosed = true;
    this.engine.close();
  }

  /**
   * The value of a field at a place of a state, in full.
   * @param {Field} field
   * @param {State} state
   * @param {number} place
   */
  value(field, state, place) {
    const into = new Float64Array(1);
    this.fields.row(field, state, [place, place], 1, into);
    return into[0];
  }
}
