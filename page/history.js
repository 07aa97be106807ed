// The states of a run: those that came with it, those that were recomputed and kept, and through both any step.

import { stepperOf } from "./chains.js";
import { whyNotRecomputed } from "./fields.js";

/** @typedef {import("./types.d.ts").State} State */
/** @typedef {import("./kernel.js").Stepper} Stepper */

/** Bytes of states that are kept; beyond, every second one is forgotten. */
const KEPT_BYTES = 192 << 20;
/** Time of a piece of work before others have their turn (ms). */
const PIECE_MS = 8;

/**
 * A copy of a state that may be stepped on.
 * @param {State} state
 * @returns {State}
 */
export function copyOf({ step, time_s, u, v, extra }) {
  return { step, time_s, u: u.slice(), v: v.slice(), extra: extra.slice() };
}

/**
 * The first number of two states that differs in a bit.
 * @param {State} stored
 * @param {State} computed
 */
export function differenceOf(stored, computed) {
  for (const array of /** @type {("u" | "v" | "extra")[]} */ (["u", "v", "extra"])) {
    const [a, b] = [stored[array], computed[array]];
    const words = (/** @type {Float64Array} */ x) => new Int32Array(x.buffer, x.byteOffset, 2 * x.length);
    const [left, right] = [words(a), words(b)];
    for (let i = 0; i < Math.max(left.length, right.length); i += 1) {
      if (left[i] !== right[i] && !(Number.isNaN(a[i >> 1]) && Number.isNaN(b[i >> 1]))) {
        const bead = (i >> 1) % computed.u.length;
        return { step: stored.step, bead, array, stored: a[i >> 1], computed: b[i >> 1] };
      }
    }
  }
  return undefined;
}

/**
 * Number of elements, in the order of their steps, that are at or before a step.
 * @param {{ step: number }[]} all
 * @param {number} step
 */
export function rankOf(all, step) {
  let [low, high] = [0, all.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (all[middle].step <= step) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low;
}

/** States of one run by their steps. */
export class History {
  /**
   * @param {import("./types.d.ts").Manifest} manifest
   * @param {import("./types.d.ts").Chain} chain
   * @param {import("./recording.js").Recording | undefined} recording where stored states come from, if from a file
   * @param {number} firstStep
   * @param {number} lastStep
   */
  constructor(manifest, chain, recording, firstStep, lastStep) {
    const { physics } = manifest;
    this.dt = physics.dt_s;
    this.kernel = physics.kernel_version;
    this.recording = recording;
    this.recordEvery = manifest.provenance?.record_every_steps ?? Infinity;
    this.firstStep = firstStep;
    this.lastStep = lastStep;
    this.whyNot = whyNotRecomputed(physics, chain);
    this.stepper = this.whyNot === "" ? stepperOf(physics, chain) : undefined;
    /** True if the state of step 0 was given: then it is not made here. */
    this.isStartGiven = physics.initial !== undefined;
    /** In the order of their steps; `received` are those that came from a live run. @type {(State & { received?: boolean })[]} */
    this.kept = [];
    /** Most states that are kept. */
    this.most = Math.max(64, Math.floor(KEPT_BYTES / (16 * physics.beads)));
    /** Steps that take about PIECE_MS; measured as they are computed. */
    this.piece = Math.max(1, Math.floor(PIECE_MS / (physics.beads * 5e-5)));
    /** Steps of this piece so far, and when it began. */
    this.taken = 0;
    this.began = performance.now();
    if (this.stepper !== undefined && firstStep === 0 && !this.isStartGiven) {
      this.keep(this.initialState());
    }
  }

  /** @returns {State} */
  initialState() {
    const { u, v, extra } = /** @type {Stepper} */ (this.stepper).initialState();
    return { step: 0, time_s: 0, u, v, extra };
  }

  /**
   * Keeps a state, which nobody may change from then on.
   * @param {State & { received?: boolean }} state
   */
  keep(state) {
    const rank = rankOf(this.kept, state.step);
    if (rank > 0 && this.kept[rank - 1].step === state.step) {
      return;
    }
    this.kept.splice(rank, 0, state);
    if (this.kept.length > this.most) {
      this.kept = this.kept.filter((_, i) => i % 2 === 0 || i === this.kept.length - 1);
    }
  }

  /**
   * The latest state at or before a step that is in memory.
   * @param {number} step
   * @returns {State | undefined}
   */
  inMemory(step) {
    const rank = rankOf(this.kept, step);
    const kept = rank > 0 ? this.kept[rank - 1] : undefined;
    const stored = this.recording?.cachedBefore(step);
    return stored !== undefined && stored.step > (kept?.step ?? -1) ? stored : kept;
  }

  /**
   * Recomputes a state up to a step, in place and in pieces; others have their turn at each `yield`.
   * @param {State} state
   * @param {number} step
   */
  *advance(state, step) {
    const stepper = /** @type {Stepper} */ (this.stepper);
    while (state.step < step) {
      const count = Math.min(step - state.step, this.piece - this.taken);
      stepper.step(state, count);
      state.step += count;
      state.time_s = state.step * this.dt;
      this.taken += count;
      if (this.taken < this.piece) {
        continue;
      }
      const now = performance.now();
      // by a factor of 2 at most: other work, or none, may have been in between
      const factor = Math.min(Math.max(PIECE_MS / (now - this.began), 0.5), 2);
      this.piece = Math.max(1, Math.round(this.piece * factor));
      this.taken = 0;
      yield;
      this.began = performance.now();
    }
  }

  /**
   * The state at a step: the stored one, a recomputed one, or, where steps cannot be recomputed, the one before.
   * Returned states belong to the history.
   * @param {number} step
   * @returns {AsyncGenerator<void, State>}
   */
  async *at(step) {
    let from = this.inMemory(step);
    if (from?.step === step) {
      return from;
    }
    // a file is asked when computing would take longer than reading
    if (this.recording !== undefined && (from === undefined || this.whyNot !== "" || step - from.step > this.piece)) {
      yield;
      const stored = await this.recording.before(step);
      if (stored !== undefined && stored.step > (from?.step ?? -1)) {
        from = stored;
      }
    }
    if (from === undefined) {
      throw new Error(`There is no state at or before step ${step}.`);
    }
    if (from.step === step || this.whyNot !== "") {
      return from;
    }
    const state = copyOf(from);
    const far = Math.max(8 * this.piece, Math.ceil(this.lastStep / this.most));
    while (step - state.step > far) {
      yield* this.advance(state, state.step + far);
      this.keep(copyOf(state));
    }
    yield* this.advance(state, step);
    this.keep(state);
    return state;
  }

  /**
   * Shows `look` every step from one to another, or where steps cannot be recomputed every state that is there; what it is
   * shown it may not keep.
   * @param {[number, number]} steps
   * @param {(state: State) => void} look
   */
  async *each([first, last], look) {
    let began = performance.now();
    if (this.whyNot !== "") {
      for await (const state of this.recording?.states(first) ?? this.kept.slice()) {
        if (state.step > last) {
          return;
        }
        if (state.step >= first) {
          look(state);
        }
        if (performance.now() - began > PIECE_MS) {
          yield;
          began = performance.now();
        }
      }
      return;
    }
    const state = copyOf(yield* this.at(first));
    look(state);
    while (state.step < last) {
      /** @type {Stepper} */ (this.stepper).step(state);
      state.step += 1;
      state.time_s = state.step * this.dt;
      look(state);
      if (performance.now() - began > PIECE_MS) {
        yield;
        began = performance.now();
      }
    }
  }

  /**
   * Recomputes what is stored, each state from the one before it, and compares the bits. Yields what it found so far.
   * @returns {AsyncGenerator<import("./types.d.ts").Proof, import("./types.d.ts").Proof>}
   */
  async *prove() {
    const { whyNot } = this;
    /** @type {import("./types.d.ts").Proof} */
    const proof = { states: 0, compared: 0, steps: 0, missing: 0, lacks: "", isDone: false, first: undefined, whyNot, believed: undefined };
    const { recording } = this;
    proof.lacks = recording?.lacks ?? "";
    const received = this.kept.filter((state) => state.received);
    proof.states = recording?.stateCount ?? received.length;
    if (whyNot === "" && proof.states === 0) {
      proof.whyNot = `Nothing is stored here: every state is computed by this page, with kernel ${this.kernel}.`;
    }
    /** @type {State | undefined} */
    let before = this.firstStep === 0 && !this.isStartGiven && proof.whyNot === "" ? this.initialState() : undefined;
    if (proof.whyNot === "") {
      for await (const stored of recording?.states() ?? received) {
        if (before !== undefined) {
          const from = before.step;
          for (const _ of this.advance(before, stored.step)) {
            yield proof;
          }
          proof.steps += stored.step - from;
          proof.missing += recording !== undefined && stored.step - from > this.recordEvery ? 1 : 0;
          proof.compared += 1;
          proof.first = differenceOf(stored, before);
          if (proof.first !== undefined) {
            break;
          }
        } else {
          before = copyOf(stored);
          proof.believed = stored.step;
        }
      }
    }
    proof.isDone = true;
    return proof;
  }
}
