// A run in a worker: opens it, computes what the page asks for, the most urgent first.

import { Recording } from "./recording.js";
import { bytesOfArray, bytesOfFile, bytesOfUrl } from "./mcap.js";
import { shown } from "./elements.js";
import { Fields, scalesOf } from "./fields.js";
import { History, copyOf } from "./history.js";
import { DifferenceFields, DifferenceHistory } from "./difference.js";
import { Follower } from "./events.js";
import { Live } from "./live.js";
import { Tasks } from "./tasks.js";
import { RowTable, curveCount, stepsShown } from "./rows.js";

/** @typedef {import("./types.d.ts").State} State */
/** @typedef {import("./types.d.ts").RowsRequest} RowsRequest */
/** @typedef {(value: unknown) => void} Tell sends a part of an answer */

const URGENCY = { state: 5, rows: 4, series: 3, events: 2, extremes: 1, proof: 0.5, damage: 0 };
/** Beads times steps up to which every step in view is looked at unasked: a minute or two, while nothing else is to do. */
const MOST_LOOKED_AT = 2e9;
/** Between two messages with rows whose extremes grow (ms). */
const EXTREMES_EVERY_MS = 400;
/** Rows of a message of a series. */
const SERIES_ROWS = 4096;
/**
 * Work (beads times steps) that a page that came late recomputes at once: some seconds. More work waits until somebody
 * looks back, so that a run that is only watched has the machine to itself.
 */
const FEW_TO_CATCH_UP = 1e8;
/** Between two messages with rows (ms). */
const ROWS_EVERY_MS = 60;

/**
 * The arrays of a chain that came as JSON.
 * @param {any} chain
 * @returns {import("./types.d.ts").Chain}
 */
function chainOf(chain) {
  const array = (/** @type {string} */ name) => Float64Array.from(chain[name] ?? []);
  const [mass, stiffness, restOverlap] = [array("mass"), array("stiffness"), array("restOverlap")];
  const [restForce, damping] = [array("restForce"), array("damping")];
  const [leftWall, rightWall, ring] = [chain.leftWall, chain.rightWall, chain.ring].map((wall) => wall ?? undefined);
  const terms = (chain.terms ?? []).map((/** @type {any} */ term) => ({
    ...term,
    stiffness: Float64Array.from(term.stiffness),
  }));
  return {
    ...{ mass, stiffness, restOverlap, restForce, damping, leftWall, rightWall, ring, terms },
    ...{ onSite: array("onSite"), onSiteCubic: array("onSiteCubic"), drag: array("drag") },
    ...{ resonatorMass: array("resonatorMass"), resonatorStiffness: array("resonatorStiffness") },
    dampingPower: chain.dampingPower ?? 0,
  };
}

/**
 * Rows that grow with a live run: how many were sent, whether those before the page came are there, whether steps are being
 * looked at and until when they were.
 * @typedef {{ table: RowTable, tell: Tell, sent: number, over: () => void, isFilled: boolean, isLooking: boolean, looked: number }} Following
 */

/** One run. */
class Run {
  /**
   * @param {import("./types.d.ts").Info["kind"]} kind
   * @param {import("./types.d.ts").Manifest} manifest
   * @param {import("./types.d.ts").Chain} chain
   * @param {Recording | undefined} recording
   * @param {number} [startsUpTo] the last step of what is computed here from its start
   */
  constructor(kind, manifest, chain, recording, startsUpTo = manifest.physics.step_count) {
    const { physics } = manifest;
    const { firstStep, lastStep } = recording ?? { firstStep: 0, lastStep: kind === "start" ? startsUpTo : 0 };
    this.tasks = new Tasks();
    this.fields = new Fields(manifest, chain);
    this.history = new History(manifest, chain, recording, firstStep, lastStep);
    this.chain = chain;
    /** @type {Live | undefined} */
    this.live = undefined;
    /** The number of times that rows were asked for. */
    this.rowsAsked = 0;
    /** The follower of a live run, until it is over. @type {Following | undefined} */
    this.following = undefined;
    const { provenance } = manifest;
    const [program, host] = [shown(provenance.program), shown(provenance.host)];
    /** @type {import("./types.d.ts").Info} */
    this.info = {
      kind,
      manifest: { ...manifest, provenance: { ...provenance, program, host } },
      chain,
      scales: scalesOf(physics, chain),
      firstStep,
      lastStep,
      storedCount: recording?.stateCount ?? 0,
      recomputes: this.history.whyNot === "",
      whyNot: this.history.whyNot,
      end: recording?.end,
      notes: recording?.notes ?? [],
      toleranceM: this.fields.toleranceM,
      splitBead: this.fields.splitBead,
    };
  }

  /** This run less another one: its states are differences. @param {Run} other */
  less(other) {
    const run = new Run("start", this.info.manifest, this.chain, undefined);
    const history = new DifferenceHistory(this.history, other.history);
    const fields = new DifferenceFields(this.fields, other.fields);
    const { firstStep, lastStep } = history;
    return Object.assign(run, { history, fields, info: { ...run.info, firstStep, lastStep } });
  }

  /** The newest frame of a live run. */
  receive(/** @type {State} */ state) {
    const { history, following } = this;
    if (state.u.length !== this.chain.mass.length) {
      throw new Error(`A frame of ${state.u.length} beads, in a run of ${this.chain.mass.length}.`);
    }
    const { stepper } = history;
    if (stepper !== undefined && state.extra.length !== stepper.extraNames.length * state.u.length) {
      throw new Error(`A frame of ${state.extra.length} further values, in a run of ${stepper.extraNames.join(", ")}.`);
    }
    if (history.kept.length === 0) {
      history.firstStep = state.step;
    }
    history.lastStep = Math.max(history.lastStep, state.step);
    history.keep({ ...state, received: true });
    if (following !== undefined) {
      const { table } = following;
      if (table.append(state)) {
        following.sent = 0;
      }
      if (!following.isFilled) {
        return; // a curve to here from where they end would show what never was
      }
      this.lookOn(following);
      // the last one that was sent has grown
      const from = Math.max(0, following.sent - 1);
      following.tell({ from, ...table.packed(from), isWhole: false });
      following.sent = table.rows.length;
    }
  }

  /** The state at a step. */
  async state(/** @type {number} */ step) {
    const { history } = this;
    const within = Math.min(Math.max(Math.round(step), history.firstStep), history.lastStep);
    const state = await this.tasks.add(URGENCY.state, history.at(within));
    return copyOf(/** @type {State} */ (state));
  }

  /**
   * Rows of a request, as they are there.
   * @param {RowsRequest} request
   * @param {Tell} tell
   */
  async rows(request, tell) {
    this.tasks.drop(URGENCY.rows);
    this.tasks.drop(URGENCY.extremes);
    this.rowsAsked += 1;
    const asked = this.rowsAsked;
    this.following?.over();
    this.following = undefined;
    const { history } = this;
    const table = new RowTable(this.fields, request);
    const last = Math.min(request.steps[1], history.lastStep);
    if (this.live !== undefined && request.steps[1] === Infinity) {
      return new Promise((over, failed) => {
        /** @type {Following} */
        const following = { table, tell, sent: 0, over: () => over(undefined), isFilled: true, isLooking: false, looked: 0 };
        this.following = following;
        if (!this.isFew(last)) {
          tell({ from: 0, ...table.packed(0), isWhole: false });
          return;
        }
        following.isFilled = false;
        const { stride } = stepsShown([history.firstStep, last], request.rows >> 1);
        const fill = this.fill(table, [history.firstStep, last], request.rows >> 1, (isWhole) => {
          following.isFilled = isWhole;
          // newer rows as far apart as these
          table.stride = Math.max(table.stride, stride);
          following.sent = isWhole ? table.rows.length : table.contiguous(stride);
          tell({ from: 0, ...table.packed(0, following.sent), isWhole: false });
        });
        this.tasks.add(URGENCY.rows, fill).catch(failed);
      });
    }
    const first = Math.min(Math.max(request.steps[0], history.firstStep), last);
    await this.tasks.add(URGENCY.rows, this.fill(table, [first, last], request.rows, (isWhole) => {
      tell({ from: 0, ...table.packed(0), isWhole });
    }));
    if (asked === this.rowsAsked && table.seen < last && (last - first) * this.chain.mass.length <= MOST_LOOKED_AT) {
      await this.tasks.add(URGENCY.extremes, this.lookAtAll(table, last, () => {
        tell({ from: 0, ...table.packed(0), isWhole: true });
      }));
    }
    return undefined;
  }

  /** True if the steps of a live run up to this one are recomputed unasked. @param {number} last */
  isFew(last) {
    return (last - this.history.firstStep) * this.chain.mass.length <= FEW_TO_CATCH_UP;
  }

  /**
   * Looks at the steps of a live run from where it has, as long as they are few: rows from before the page came and later
   * ones show the same.
   * @param {Following} following
   */
  lookOn(following) {
    const { lastStep } = this.history;
    const isTime = performance.now() - following.looked > EXTREMES_EVERY_MS;
    if (following.isLooking || !isTime || this.history.whyNot !== "" || !this.isFew(lastStep)) {
      return;
    }
    following.isLooking = true;
    const { table, tell } = following;
    const tellAll = () => {
      following.sent = table.rows.length;
      tell({ from: 0, ...table.packed(0), isWhole: false });
    };
    const looking = this.lookAtAll(table, lastStep, tellAll, (state) => table.place(state));
    const over = () => {
      Object.assign(following, { isLooking: false, looked: performance.now() });
    };
    this.tasks.add(URGENCY.extremes, looking).then(over, over);
  }

  /**
   * Gives rows the extremes of all steps up to the next one.
   * @param {RowTable} table
   * @param {number} last
   * @param {() => void} tell
   * @param {(state: State) => void} put
   */
  async *lookAtAll(table, last, tell, put = (state) => table.widen(state)) {
    let told = performance.now();
    const look = (/** @type {State} */ state) => {
      put(state);
      table.seen = state.step;
    };
    for await (const _ of this.history.each([Math.max(table.rows[0].step, table.seen), last], look)) {
      if (performance.now() - told > EXTREMES_EVERY_MS) {
        told = performance.now();
        tell();
      }
      yield;
    }
    table.seen = last;
    tell();
  }

  /**
   * Energies and followed beads at every step.
   * @param {{ steps: [number, number], follow: number[] }} request
   * @param {(part: { steps: Float64Array, values: Float64Array }) => void} tell
   */
  async *series({ steps, follow }, tell) {
    const table = new RowTable(this.fields, { field: "velocity", places: [0, 0], columns: 1, steps, rows: 0, follow });
    /** @type {{ step: number, values: Float64Array }[]} */
    let rows = [];
    const flush = () => {
      const wide = curveCount(follow);
      const values = new Float64Array(rows.length * wide);
      rows.forEach((row, i) => values.set(row.values, i * wide));
      tell({ steps: Float64Array.from(rows, ({ step }) => step), values });
      rows = [];
    };
    const look = (/** @type {State} */ state) => void rows.push({ step: state.step, values: table.curvesOf(state) });
    for await (const _ of this.history.each(steps, look)) {
      if (rows.length >= SERIES_ROWS) {
        flush();
      }
      yield;
    }
    flush();
  }

  /**
   * Fills a table with the rows of some steps: first what is in memory, then the rest.
   * @param {RowTable} table
   * @param {[number, number]} steps
   * @param {number} most
   * @param {(isWhole: boolean) => void} tell
   */
  async *fill(table, steps, most, tell) {
    const { history } = this;
    const { stride, shown } = stepsShown(steps, most);
    const wanted = new Set(shown);
    let told = performance.now();
    for (const step of shown) {
      const state = history.inMemory(step);
      if (state !== undefined && state.step > step - stride) {
        table.insert(state);
      }
      if (performance.now() - told > ROWS_EVERY_MS) {
        told = performance.now();
        tell(false);
        yield;
      }
    }
    tell(false);
    for (const step of shown.filter((one) => one >= history.firstStep && !table.has(one))) {
      const state = yield* history.at(step);
      table.insert(state);
      if (performance.now() - told > ROWS_EVERY_MS) {
        told = performance.now();
        tell(false);
      }
    }
    if (this.following?.table !== table && history.whyNot === "") {
      table.rows = table.rows.filter(({ step }) => wanted.has(step));
      table.seen = stride === 1 ? steps[1] : table.seen;
    }
    tell(true);
  }

  /**
   * Finds the events of a bead over the whole run, at every step where steps can be recomputed.
   * @param {number} bead
   * @param {Tell} tell
   */
  async *events(bead, tell) {
    const { history, info } = this;
    const restSpeed = info.scales.time_s > 0 ? (1e-6 * info.scales.length_m) / info.scales.time_s : 0;
    const follower = new Follower(bead, this.chain, info.toleranceM, restSpeed, this.fields.stepper);
    const first = yield* history.at(history.firstStep);
    follower.observe(first);
    /** @type {import("./types.d.ts").Event[]} */
    const events = [];
    let told = performance.now();
    const breathe = () => {
      told = performance.now();
      tell({ events, isDone: false });
    };
    const look = (/** @type {State} */ state) => {
      if (state.step > first.step) {
        events.push(...follower.observe(state));
      }
    };
    for await (const _ of history.each([first.step, history.lastStep], look)) {
      yield;
      if (performance.now() - told > 10 * ROWS_EVERY_MS) {
        breathe();
      }
    }
    return { events, isDone: true };
  }

  /** Compares what is stored with what is computed. */
  async *proof(/** @type {Tell} */ tell) {
    const work = this.history.prove();
    let told = performance.now();
    for (;;) {
      const { done, value } = await work.next();
      if (done) {
        return value;
      }
      if (performance.now() - told > ROWS_EVERY_MS) {
        told = performance.now();
        tell(value);
      }
      yield;
    }
  }
}

/**
 * Opens a run.
 * @param {import("./types.d.ts").Source} source
 * @param {(event: string, value: unknown, transfer?: Transferable[]) => void} say
 * @returns {Promise<Run>}
 */
async function open(source, say) {
  if (source.kind === "start") {
    if (source.manifest.physics.initial !== undefined) {
      throw new Error("This page does not make the initial state of this run: run it, and open its recording.");
    }
    return new Run("start", source.manifest, chainOf(source.chain), undefined, source.lastStep);
  }
  if (source.kind === "live") {
    return openLive(source.url, say);
  }
  if (source.kind === "difference") {
    const [first, other] = [await open(source.first, say), await open(source.other, say)];
    return first.less(other);
  }
  const bytes =
    source.kind === "bytes" ? bytesOfArray(source.bytes) : source.kind === "file" ? bytesOfFile(source.file) : await bytesOfUrl(source.url);
  const recording = await Recording.open(bytes);
  const run = new Run("recording", recording.manifest, recording.chain, recording);
  run.tasks.add(URGENCY.damage, recording.check((note) => say("note", note))).catch(() => {});
  return run;
}

/**
 * A live run was at a step that was not sent: it can be recomputed.
 * @param {Run | undefined} run
 * @param {number | undefined} step
 */
function reach(run, step) {
  if (run?.info.recomputes && step !== undefined) {
    run.history.lastStep = Math.max(run.history.lastStep, step);
  }
}

/**
 * @param {string} url
 * @param {(event: string, value: unknown, transfer?: Transferable[]) => void} say
 * @returns {Promise<Run>}
 */
function openLive(url, say) {
  return new Promise((opened, failed) => {
    /** @type {Run | undefined} */
    let run;
    const live = new Live(url, {
      onrun: ({ manifest, chain }) => {
        run = new Run("live", manifest, chainOf(chain), undefined);
        run.live = live;
      },
      onframe: (state) => {
        const attached = /** @type {Run} */ (run);
        attached.receive(state);
        opened(attached);
        const copy = copyOf(state);
        say("state", copy, [copy.u.buffer, copy.v.buffer, copy.extra.buffer]);
      },
      onstatus: (status) => {
        reach(run, status.step);
        say("status", status);
      },
      onend: (reason, step) => {
        if (run !== undefined) {
          reach(run, step);
          opened(run);
        }
        failed(new Error(`The run has ended (${reason}) before it sent anything.`));
        say("end", { reason, step });
      },
      onfault: (message) => {
        failed(new Error(message));
        say("fault", message);
      },
    });
  });
}

/** Answers the page; this is what the worker does. */
export function serve() {
  /** @type {Run | undefined} */
  let run;
  const post = (/** @type {object} */ message, /** @type {Transferable[]} */ transfer = []) =>
    globalThis.postMessage(message, { transfer });
  // at most one newest state is on its way to the page
  /** @type {{ value: unknown, transfer: Transferable[] } | undefined} */
  let pending;
  let isUnderWay = false;
  const say = (/** @type {string} */ event, /** @type {unknown} */ value, /** @type {Transferable[]} */ transfer = []) => {
    if (event === "state" && isUnderWay) {
      pending = { value, transfer };
      return;
    }
    isUnderWay ||= event === "state";
    post({ event, value }, transfer);
  };
  /** @type {Record<string, (tell: Tell, ...args: any[]) => Promise<unknown> | undefined>} */
  const calls = {
    open: async (_, source) => {
      run = await open(source, say);
      return run.info;
    },
    state: (_, step) => run?.state(step),
    rows: async (tell, request) => run?.rows(request, tell),
    series: (tell, request) => run?.tasks.add(URGENCY.series, run.series(request, tell)),
    events: (tell, bead) => {
      run?.tasks.drop(URGENCY.events);
      return run?.tasks.add(URGENCY.events, run.events(bead, tell));
    },
    prove: (tell) => run?.tasks.add(URGENCY.proof, run.proof(tell)),
    seen: async () => {
      isUnderWay = false;
      if (pending !== undefined) {
        const { value, transfer } = pending;
        pending = undefined;
        say("state", value, transfer);
      }
    },
  };
  globalThis.onmessage = async ({ data: { id, call, args } }) => {
    try {
      const value = await calls[call]((/** @type {any} */ part) => post({ id, part }), ...args);
      post({ id, value });
    } catch (error) {
      post({ id, error: error instanceof Error ? error.message : String(error) });
    }
  };
}
