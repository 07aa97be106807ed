// The page: one run at a time, its view, and all controls.

import { act } from "./actions.js";
import { Board } from "./board.js";
import { carried, carriedRecording, carriedResults, listing, resultsOf, sourceOf } from "./carried.js";
import { watchDrops, workerMaker } from "./carried.js";
import { changedSource, describe, readChange, writeChange } from "./changing.js";
import { Comparison } from "./comparing.js";
import { byId, make, shown } from "./elements.js";
import { Engine } from "./engine.js";
import { folderTable } from "./folder.js";
import { watchGestures } from "./gestures.js";
import { watchKeys } from "./keyboard.js";
import { Original, carriedNotes } from "./notes.js";
import { Pictures } from "./pictures.js";
import { prove } from "./prove.js";
import { ReadOut } from "./readout.js";
import { Run, unitOf } from "./run.js";
import { Spectrum } from "./spectrum.js";
import { Tabs } from "./tabs.js";
import { thumbnail } from "./thumbnails.js";
import { Timeline } from "./timeline.js";
import { FIELDS, LEAST_PLACES, LEAST_STEPS, freshView, readView, within, writeView } from "./view.js";

/** @typedef {import("./types.d.ts").Source} Source */
/** @typedef {import("./types.d.ts").Entry} Entry */
/** @typedef {import("./types.d.ts").Results} Results */
/** @typedef {import("./change.js").Change} Change */

/** Events are looked for unasked where that takes no longer than this many beads times steps: seconds. */
const CHEAP = 2e8;

/** Pulses, and modes, that are shown: the command finds 500 at most. */
const MOST_RESULTS = 1000;

/** @param {unknown} error */
function sentence(error) {
  const text = shown(error instanceof Error ? error.message : String(error));
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}${/[.!?]$/.test(text) ? "" : "."}`;
}

export class Page {
  constructor() {
    this.view = readView(location.hash);
    this.original = new Original();
    this.notes = carriedNotes();
    this.comparison = new Comparison(this);
    this.spectrum = new Spectrum(this);
    this.startWorker = workerMaker();
    /** @type {Run | undefined} */
    this.run = undefined;
    /** With one thing changed. @type {Run | undefined} */
    this.second = undefined;
    /** The source of the run. @type {Source | undefined} */
    this.source = undefined;
    /** The change in it. @type {{ name: string, now: string, then: string } | undefined} */
    this.changed = undefined;
    /** @type {Entry[]} */
    this.entries = [];
    /** Number of further entries, which are not listed. */
    this.moreEntries = 0;
    /** The keys that were swept. @type {string[]} */
    this.keys = [];
    /** Place and step of the pointer on the map. @type {{ place: number, step: number } | undefined} */
    this.hover = undefined;
    /** A box being drawn on the map, parts of the plot. @type {[number, number, number, number] | undefined} */
    this.box = undefined;
    /** Number of times that something was opened or changed: late answers to an earlier one are dropped. */
    this.opening = 0;
    this.changing = 0;
    this.isDark = false;
    this.hasFailed = false;
    this.renewReady();
    this.pictures = new Pictures(this);
    this.readOut = new ReadOut(this);
    this.tabs = new Tabs(this);
    /** @type {Record<string, import("./board.js").Draw>} */
    const draws = {};
    for (const name of this.pictures.names()) {
      draws[name] = (surface, box) => this.pictures.draw(name, surface, box);
    }
    this.board = new Board(
      draws,
      () => this.prepare(),
      (error) => this.fail(error),
    );
    this.timeline = new Timeline({
      onseek: (step) => this.seek(step),
      onspeed: (speed) => this.look({ speed }),
      onlive: () => this.look({ step: undefined }),
    });
    this.wire();
    this.applyTheme();
  }

  renewReady() {
    this.hasFailed = false;
    /** @type {Promise<import("./types.d.ts").Info>} */
    this.ready = new Promise((opened, failed) => {
      this.opened = opened;
      this.failed = failed;
    });
    this.ready.catch(() => {}); // what went wrong stands on the page
  }

  // ---- where runs come from

  /** Opens the runs of the page. */
  async begin() {
    const { kind, title } = carried();
    document.title = title ? `${title} · Beadline` : "Beadline";
    try {
      if (kind === "embedded") {
        await this.open(await carriedRecording(), title, carriedResults());
      } else if (kind === "server") {
        await this.beginServed();
      } else {
        this.section("waiting");
      }
    } catch (error) {
      this.fail(error);
    }
  }

  async beginServed() {
    const { entries, kind, title, keys, more } = await listing();
    this.entries = entries;
    this.moreEntries = more ?? 0;
    this.keys = keys ?? [];
    const isOwn = kind === "one" || kind === "pair";
    const entry = entries.find(({ id }) => id === this.view.run) ?? (isOwn ? entries[0] : undefined);
    if (kind === "pair" && !this.view.run) {
      this.look({ other: entries[1].id, run: entries[0].id, difference: true });
    }
    if (entry) {
      await this.openEntry(entry);
    } else {
      this.list(title);
    }
  }

  /** @param {string} title */
  list(title) {
    this.close();
    document.title = `${title} · Beadline`;
    byId("name").textContent = title;
    byId("kind").textContent = `${this.entries.length} ${this.entries.length === 1 ? "run" : "runs"}`;
    const table = folderTable(
      this.entries,
      { keys: this.keys, isDark: () => this.isDark, more: this.moreEntries },
      (entry) => {
        this.look({ ...freshView(), theme: this.view.theme, run: entry.id });
        this.openEntry(entry).catch((error) => this.fail(error));
      },
      (entry, canvas) => thumbnail(this, entry, canvas),
    );
    const nothing = make("p", { class: "words" }, "Nothing is here yet. Load the page again when there is.");
    byId("list").replaceChildren(this.entries.length > 0 ? table : nothing);
    this.section("list");
  }

  /** @param {Entry} entry */
  async openEntry(entry) {
    byId("list-back").hidden = this.entries.length < 2;
    const results = resultsOf(entry).catch(() => undefined);
    await this.open(await sourceOf(entry), entry.name, results);
  }

  /** @param {File} file */
  openFile(file) {
    this.look({ ...freshView(), theme: this.view.theme, field: this.view.field });
    this.open({ kind: "file", file }, file.name, Promise.resolve(undefined)).catch((error) => this.fail(error));
  }

  /**
   * @param {Source} source
   * @param {string} title
   * @param {Promise<Results | undefined>} results that may come later
   */
  async open(source, title, results) {
    this.close();
    this.opening += 1;
    const opening = this.opening;
    this.note(`Opening ${title} …`);
    const engine = await Engine.open(source, this.startWorker).catch((error) => {
      if (opening === this.opening) {
        throw error;
      }
    });
    if (!engine || opening !== this.opening) {
      engine?.close(); // something else is opened by now
      return;
    }
    const run = this.runOf(engine);
    this.run = run;
    this.source = source;
    document.title = `${title} · Beadline`;
    byId("name").textContent = title;
    this.note(
      ...run.info.notes.map(sentence),
      run.info.recomputes ? "" : `${run.info.whyNot} The recorded states are shown.`,
    );
    this.section("run");
    this.timeline.open(run, this.view.speed);
    this.tabs.open();
    this.showControls();
    engine.onstate = (state) => {
      run.newest = state;
      if (this.isFollowing) {
        run.state = state;
      }
      this.board.invalidate(true);
    };
    engine.onstatus = (status) => {
      run.status = status;
      this.board.invalidate(true);
    };
    engine.onend = (reason) => {
      run.ended = `The run has ended: ${reason}.`;
      run.asked = "";
      this.note(run.ended);
      run.seek(this.step); // the last frame may have been left out
    };
    results.then((found) => {
      // a shared file may hold any number of them
      run.pulses = (found?.pulses ?? []).slice(0, MOST_RESULTS);
      run.modes = (found?.modes ?? []).slice(0, MOST_RESULTS);
      this.board.invalidate();
    });
    if (!this.isFollowing) {
      await run.seek(this.view.step ?? run.ownStep);
    }
    this.opened?.(run.info);
    this.applyChange(readChange(this.view.change));
    void this.comparison.restore();
  }

  /** @param {Engine} engine */
  runOf(engine) {
    const run = new Run(
      engine,
      () => this.board.invalidate(this.isFollowing),
      (message) => this.note(sentence(message)),
    );
    engine.onfault = (message) => run.fault(new Error(message));
    engine.onnote = (note) => {
      byId("notes").append(make("p", { class: "bad" }, sentence(note)));
    };
    return run;
  }

  close() {
    this.opening += 1;
    this.timeline.pause();
    this.run?.close();
    this.second?.close();
    this.comparison.close();
    this.spectrum.close();
    if (this.run || this.hasFailed) {
      this.renewReady();
    }
    [this.run, this.second, this.changed, this.hover] = [undefined, undefined, undefined, undefined];
    this.note();
  }

  /** @param {unknown} error */
  fail(error) {
    this.close();
    const message = sentence(error);
    byId("name").textContent = "Beadline";
    byId("waiting-title").textContent = "This cannot be shown";
    byId("waiting-text").textContent = message;
    byId("waiting").classList.add("bad");
    this.section("waiting");
    this.failed?.(new Error(message));
    this.hasFailed = true;
  }

  /** @param {"waiting" | "list" | "run"} name */
  section(name) {
    for (const other of ["waiting", "list", "run"]) {
      byId(other).hidden = other !== name;
    }
    byId("timeline").hidden = name !== "run";
    byId("for-run").hidden = name !== "run";
    byId("list-back").hidden = name === "list" || this.entries.length < 2;
    if (name !== "run") {
      byId("kind").textContent = name === "list" ? byId("kind").textContent : "";
    }
    this.board.invalidate();
  }

  /** Sentences under the bar. @param {...string} sentences */
  note(...sentences) {
    byId("notes").replaceChildren(...sentences.filter(Boolean).map((text) => make("p", {}, text)));
  }

  // ---- what is looked at

  /** True if the newest state of a live run is shown. */
  get isFollowing() {
    return this.run?.info.kind === "live" && this.view.step === undefined && this.run.ended === "";
  }

  /** The bead that tables and read-outs are about. */
  get bead() {
    const { run, view } = this;
    return Math.min(view.bead ?? run?.info.splitBead ?? 0, (run?.beads ?? 1) - 1);
  }

  /** Beads whose way is shown. */
  get followed() {
    const { run, view } = this;
    const beads = [run?.info.splitBead ?? 0, ...view.beads, this.bead];
    return [...new Set(beads)].filter((bead) => bead < (run?.beads ?? 0)).slice(0, 5);
  }

  /** The step of the cursor. */
  get step() {
    const { run, view } = this;
    return run ? run.clamp(view.step ?? run.ownStep) : 0;
  }

  /** Places and steps that are in view. */
  window() {
    const run = /** @type {Run} */ (this.run);
    const last = run.lastPlace(this.view.field);
    /** @type {[number, number]} */
    const allPlaces = [-0.5, last + 0.5]; // each place is as wide as another
    /** @type {[number, number]} */
    const allSteps = [run.info.firstStep, run.endStep];
    const [places, steps] = [this.view.places, this.view.steps];
    return {
      allPlaces,
      allSteps,
      places: (places && within(places, allPlaces, LEAST_PLACES)) ?? allPlaces,
      steps: (steps && within(steps, allSteps, LEAST_STEPS)) ?? allSteps,
    };
  }

  /**
   * Looks at something else.
   * @param {Partial<import("./view.js").View>} change
   */
  look(change) {
    const isOther = change.field !== undefined && change.field !== this.view.field;
    Object.assign(this.view, isOther ? { colours: undefined } : {}, change);
    this.hover = undefined; // what is under the pointer has become another
    clearTimeout(this.writing);
    this.writing = setTimeout(() => this.write(), 250);
    if (!("step" in change) || Object.keys(change).length > 1) {
      this.showControls();
    }
    this.board.invalidate();
    dispatchEvent(new Event("look"));
  }

  write() {
    const fragment = writeView(this.view);
    if (fragment !== location.hash.replace(/^#/, "")) {
      history.replaceState(null, "", fragment ? `#${fragment}` : location.pathname + location.search);
    }
  }

  /**
   * Brings the cursor to a step; resolves when its state is shown.
   * @param {number} step
   */
  async seek(step) {
    const { run, second } = this;
    if (!run) {
      return;
    }
    const to = run.clamp(step);
    this.look({ step: to });
    await Promise.all([run.seek(to), second?.seek(this.secondStep(to))]);
  }

  /** The step of the changed run at the time of a step. @param {number} step */
  secondStep(step) {
    const { run, second } = this;
    return run && second ? (step * run.physics.dt_s) / second.physics.dt_s : step;
  }

  /** The state of the changed run, or the other one, at the cursor; none beyond its ends. */
  get secondState() {
    const { second } = this;
    const step = this.secondStep(this.step);
    return second && Math.abs(second.clamp(step) - step) < 1 ? second.state : undefined;
  }

  /**
   * Zooms: factors below 1 show less; around a part of the plot.
   * @param {number} ofPlaces
   * @param {number} ofSteps
   * @param {number} [x]
   * @param {number} [y]
   */
  zoom(ofPlaces, ofSteps, x = 0.5, y = 0.5) {
    if (!this.run) {
      return;
    }
    const { places, steps, allPlaces, allSteps } = this.window();
    const scaled = (
      /** @type {[number, number]} */ [from, to],
      /** @type {number} */ factor,
      /** @type {number} */ part,
    ) => {
      const at = from + part * (to - from);
      return /** @type {[number, number]} */ ([at - (at - from) * factor, at + (to - at) * factor]);
    };
    this.look({
      places: ofPlaces === 1 ? this.view.places : within(scaled(places, ofPlaces, x), allPlaces, LEAST_PLACES),
      steps: ofSteps === 1 ? this.view.steps : within(scaled(steps, ofSteps, y), allSteps, LEAST_STEPS),
    });
  }

  /** Moves the window by parts of it. @param {number} byPlaces @param {number} bySteps */
  pan(byPlaces, bySteps) {
    if (!this.run) {
      return;
    }
    const { places, steps, allPlaces, allSteps } = this.window();
    const moved = (/** @type {[number, number]} */ [from, to], /** @type {number} */ part) =>
      /** @type {[number, number]} */ ([from + part * (to - from), to + part * (to - from)]);
    this.look({
      places: this.view.places && within(moved(places, byPlaces), allPlaces, LEAST_PLACES),
      steps: this.view.steps && within(moved(steps, bySteps), allSteps, LEAST_STEPS),
    });
  }

  // ---- what is drawn

  /** Before each drawing: asks for what is missing, and brings words up to date. */
  prepare() {
    const { run, second } = this;
    const { difference } = this.comparison;
    if (!run) {
      return;
    }
    if (this.isFollowing) {
      run.state = run.newest ?? run.state;
    } else if (run.state === undefined && !run.isBusy) {
      run.seek(this.step);
    }
    this.askRows(run, "map", 1);
    if (second) {
      this.askRows(second, "second", run.physics.dt_s / second.physics.dt_s);
      if (this.isFollowing && !second.isBusy) {
        second.seek(this.secondStep(this.step));
      }
    }
    byId("difference-panel").hidden = this.comparison.shown === undefined;
    if (difference) {
      this.askRows(difference, "difference", 1);
    }
    const isCheap = run.info.recomputes && run.beads * run.info.lastStep < CHEAP;
    const isGrowing = run.info.kind === "live" && run.ended === "";
    if (!isGrowing && run.rows?.isWhole && (this.view.tab === "events" || isCheap)) {
      run.find(this.bead);
    }
    const isBusy = !isGrowing && ![run, second, difference].every((one) => one === undefined || one.rows?.isWhole);
    byId("map-panel").classList.toggle("busy", isBusy);
    this.timeline.show(this.step, this.isFollowing, this.bead);
    this.showKind();
    this.tabs.show();
    this.pictures.describe();
    this.readOut.show();
  }

  /**
   * @param {Run} run
   * @param {string} id of its canvas
   * @param {number} factor its steps for a step of the first run
   */
  askRows(run, id, factor) {
    const plot = this.pictures.plot(id);
    if (!plot) {
      return;
    }
    const { places, steps, allSteps } = this.window();
    const { field } = this.view;
    const whole = steps === allSteps && run.info.kind === "live" && run.ended === "";
    const ratio = Math.min(devicePixelRatio || 1, 2);
    run.ask({
      field,
      places: [Math.max(0, Math.round(places[0])), Math.min(run.lastPlace(field), Math.ceil(places[1] - 0.5))],
      columns: Math.max(16, Math.round(plot.width * ratio)),
      steps: whole
        ? [run.info.firstStep, Infinity]
        : [
            Math.max(run.info.firstStep, Math.floor(steps[0] * factor)),
            Math.min(run.info.lastStep, Math.ceil(steps[1] * factor)),
          ],
      // enough that a pulse does not leap over beads from row to row, and for curves a row for each pixel
      rows: Math.max(
        16,
        Math.round(plot.height * ratio),
        Math.round(this.board.size("energies").width * ratio),
        Math.min(Math.ceil(places[1] - places[0]), 1000),
      ),
      follow: this.followed,
    });
  }

  showKind() {
    const { info, status, ended } = /** @type {Run} */ (this.run);
    const live = ended ? "live run, ended" : status ? `live · ${Math.round(status.steps_per_s)} steps/s` : "live";
    const { lastStep, manifest } = info;
    const part = lastStep < manifest.physics.step_count ? ` up to step ${lastStep}, where its row ended` : "";
    const kind = { live, recording: `recording · ${info.storedCount} states`, start: `computed here${part}` }[info.kind];
    byId("kind").textContent = kind;
    byId("kind").className = info.kind === "live" && !ended ? "live" : "";
  }

  // ---- controls

  showControls() {
    const { field, log } = this.view;
    /** @type {HTMLSelectElement} */ (byId("field")).value = field;
    byId("log").setAttribute("aria-pressed", String(log));
    /** @type {HTMLButtonElement} */ (byId("log")).disabled = field === "contacts";
    /** @type {HTMLButtonElement} */ (byId("colours")).disabled = field === "contacts";
    byId("colours").setAttribute("aria-pressed", String(this.view.colours !== undefined));
    const [least, largest] = this.view.colours ?? [];
    byId("colours").title =
      least === undefined ? "fix the ends of the colours (k)" : `fixed from ${least} to ${largest} ${unitOf(field)} (k)`;
    byId("ruler").setAttribute("aria-pressed", String(this.view.ruler !== undefined));
    /** @type {HTMLButtonElement} */ (byId("whole")).disabled = !this.view.places && !this.view.steps;
  }

  applyTheme() {
    const { theme } = this.view;
    this.isDark = theme ? theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    document.documentElement.dataset.theme = this.isDark ? "dark" : "light";
    this.board.invalidate();
  }

  /** Listens to everything, once. */
  wire() {
    byId("field").append(...FIELDS.map(([value, name]) => make("option", { value }, name)));
    byId("field").addEventListener("change", (event) => {
      const { value } = /** @type {HTMLSelectElement} */ (event.target);
      this.look({ field: /** @type {any} */ (value) });
    });
    const sameNamed = ["log", "colours", "ruler", "whole", "prove", "change", "export", "open", "theme", "help"].map((id) => [id, id]);
    for (const [id, action] of [...sameNamed, ["choose", "open"], ["list-back", "back"]]) {
      byId(id).addEventListener("click", () => act(this, action, 0, ""));
    }
    watchKeys((action, by, key) => act(this, action, by, key));
    watchDrops((file) => this.openFile(file));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.applyTheme());
    addEventListener("hashchange", () => this.readAgain());
    watchGestures(this);
  }

  /** Somebody else wrote the fragment: a link, or the address bar. */
  readAgain() {
    const before = this.view.run;
    const { change, other, difference } = this.view;
    this.view = readView(location.hash);
    this.applyTheme();
    const entry = this.entries.find(({ id }) => id === this.view.run);
    if (this.view.run !== before) {
      const opened = entry
        ? this.openEntry(entry)
        : Promise.resolve(this.entries.length > 1 ? this.list(carried().title) : undefined);
      opened.catch((error) => this.fail(error));
    } else if (this.run) {
      this.look({});
      if (!this.isFollowing) {
        this.seek(this.step);
      }
      if (this.view.change !== change || this.view.other !== other) {
        this.applyChange(readChange(this.view.change));
        void this.comparison.restore();
      } else if (this.view.difference !== difference) {
        void this.comparison.showDifference();
      }
    }
  }

  /**
   * @param {string} title
   * @param {Node} contents
   */
  dialog(title, contents) {
    const dialog = /** @type {HTMLDialogElement} */ (byId("dialog"));
    const close = make("button", { class: "quiet", "aria-label": "close", onclick: () => dialog.close() }, "✕");
    dialog.replaceChildren(make("header", {}, make("h2", { id: "dialog-title" }, title), close), contents);
    dialog.showModal();
  }

  async prove() {
    const { run } = this;
    if (!run) {
      throw new Error("There is no run to prove.");
    }
    const bar = make("progress", { max: 1, value: 0, "aria-label": "progress" });
    const words = make("span");
    const line = make("p", { class: "proof" }, words, bar);
    byId("notes").querySelector(".proof")?.remove();
    byId("notes").append(line);
    const button = /** @type {HTMLButtonElement} */ (byId("prove"));
    button.disabled = true;
    try {
      return await prove(run.engine, (text, share, kind) => {
        words.textContent = text;
        bar.value = share;
        line.className = `proof ${kind}`;
      });
    } catch (error) {
      words.textContent = sentence(error);
      throw error;
    } finally {
      button.disabled = false;
      bar.remove();
    }
  }

  // ---- the chain with one thing changed

  /** @param {Change | undefined} change */
  change(change) {
    const text = change ? writeChange(change) : "";
    this.look({ change: text });
    this.applyChange(change);
  }

  /** @param {Change | undefined} change */
  async applyChange(change) {
    const { run } = this;
    this.changing += 1;
    const changing = this.changing;
    this.second?.close();
    this.comparison.close();
    [this.second, this.changed] = [undefined, undefined];
    if (change) {
      this.look({ other: "" });
    }
    byId("second-panel").hidden = true;
    if (!run || !change) {
      this.board.invalidate();
      return;
    }
    try {
      const engine = await Engine.open(changedSource(change, run), this.startWorker);
      if (this.run !== run || changing !== this.changing) {
        engine.close();
        return;
      }
      this.second = this.runOf(engine);
      this.changed = describe(change, run);
      byId("second-panel").hidden = false;
      await this.second.seek(this.secondStep(this.step));
    } catch (error) {
      this.note(sentence(error));
      this.look({ change: "" });
    }
    this.board.invalidate();
  }
}

/** Starts the page; `window.beadline` is for those who script it. */
export function start() {
  const page = new Page();
  const arrays = async (/** @type {number} */ step) => {
    await page.ready;
    const { step: at, time_s, u, v } = await /** @type {Run} */ (page.run).engine.state(step);
    return { step: at, time_s, u, v };
  };
  const told = (/** @type {Run | undefined} */ run) =>
    run && { info: run.info, state: (/** @type {number} */ step) => run.engine.state(step) };
  Object.defineProperty(window, "beadline", {
    value: {
      get ready() {
        return page.ready;
      },
      get info() {
        return page.run?.info;
      },
      get view() {
        return { ...page.view, ...(page.run && page.window()) };
      },
      state: arrays,
      /** Looks at something else; each time that anybody does, the window has an event `look`. */
      look: (/** @type {Partial<import("./view.js").View>} */ change) => page.look(change),
      seek: async (/** @type {number} */ step) => {
        await page.ready;
        await page.seek(step);
      },
      /** The run with one thing changed, or the other one that is compared. */
      get changed() {
        return told(page.second);
      },
      /** This run less the other one, if that is shown. */
      get difference() {
        return told(page.comparison.difference);
      },
      prove: async () => {
        await page.ready;
        const { compared, steps, first, whyNot } = await page.prove();
        return { states: compared, steps, first, whyNot };
      },
    },
  });
  page.begin();
}
