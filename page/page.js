// The page: one run at a time, what is looked at of it, and everything that a person can do.

import { Engine } from "./engine.js";
import { Run, placeWord, unitOf } from "./run.js";
import { Board } from "./board.js";
import { Pictures } from "./pictures.js";
import { Timeline } from "./timeline.js";
import { FIELDS, TABS, freshView, readView, writeView, within } from "./view.js";
import { carried, carriedRecording, carriedResults, listing, resultsOf, sourceOf, watchDrops, chooseFile, workerMaker } from "./carried.js";
import { keyTable, watchKeys } from "./keyboard.js";
import { byId, make } from "./elements.js";
import { runTable, pulseTable, eventTable, liveTable } from "./tables.js";
import { changeForm, changedSource, readChange } from "./changing.js";
import { exportDialog } from "./exporting.js";
import { folderTable } from "./folder.js";
import { prove } from "./prove.js";
import { watchPointer } from "./pointer.js";
import { amount } from "./axes.js";

/** @typedef {import("./types.d.ts").Source} Source */
/** @typedef {import("./types.d.ts").Entry} Entry */
/** @typedef {import("./types.d.ts").Results} Results */
/** @typedef {import("./change.js").Change} Change */

/** Events are looked for unasked where that takes no longer than this many beads times steps: seconds. */
const CHEAP = 2e8;
/** Two clicks within this are one double click. */
const DOUBLE_MS = 500;
/** Of the steps and beads that a window has at least. */
const [LEAST_STEPS, LEAST_PLACES] = [4, 2];

/** @param {unknown} error */
function sentence(error) {
  const text = error instanceof Error ? error.message : String(error);
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}${/[.!?]$/.test(text) ? "" : "."}`;
}

export class Page {
  constructor() {
    this.view = readView(location.hash);
    this.startWorker = workerMaker();
    /** @type {Run | undefined} */
    this.run = undefined;
    /** With one thing changed. @type {Run | undefined} */
    this.second = undefined;
    /** @type {Entry[]} */
    this.entries = [];
    /** Where the pointer is: place and step of the map. @type {{ place: number, step: number } | undefined} */
    this.hover = undefined;
    /** What is being asked for to be read out, and what is to be asked next. */
    this.reading = false;
    /** A box being drawn on the map, parts of the plot. @type {[number, number, number, number] | undefined} */
    this.box = undefined;
    this.opening = 0;
    this.isDark = false;
    /** When somebody clicked, and what was looked at before. @type {{ time: number, step?: number, bead?: number }} */
    this.clicked = { time: 0 };
    this.shownTab = "";
    this.said = "";
    this.renewReady();
    this.pictures = new Pictures(this);
    /** @type {Record<string, import("./board.js").Draw>} */
    const draws = {};
    for (const name of this.pictures.names()) {
      draws[name] = (surface, box) => this.pictures.draw(name, surface, box);
    }
    this.board = new Board(draws, () => this.prepare(), (error) => this.fail(error));
    this.timeline = new Timeline({
      onseek: (step) => this.seek(step),
      onspeed: (speed) => this.look({ speed }),
      onlive: () => this.look({ step: undefined }),
    });
    this.wire();
    this.applyTheme();
  }

  renewReady() {
    /** @type {Promise<import("./types.d.ts").Info>} */
    this.ready = new Promise((opened, failed) => {
      this.opened = opened;
      this.failed = failed;
    });
    this.ready.catch(() => {}); // what went wrong stands on the page
  }

  // ---- where runs come from

  /** Opens what the page has. */
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
    const { entries, kind, title } = await listing();
    this.entries = entries;
    const entry = entries.find(({ id }) => id === this.view.run) ?? (kind === "one" ? entries[0] : undefined);
    if (entry) {
      await this.openEntry(entry);
    } else if (kind === "one") {
      throw new Error("The server has nothing to show.");
    } else {
      this.list(title);
    }
  }

  /** @param {string} [title] */
  list(title = document.title) {
    this.close();
    byId("name").textContent = title;
    byId("kind").textContent = `${this.entries.length} ${this.entries.length === 1 ? "run" : "runs"}`;
    const table = folderTable(this.entries, (entry) => {
      this.view = { ...freshView(), theme: this.view.theme, run: entry.id };
      this.openEntry(entry).catch((error) => this.fail(error));
    }, (entry, canvas) => this.thumbnail(entry, canvas));
    byId("list").replaceChildren(table);
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
    const engine = await Engine.open(source, this.startWorker);
    if (opening !== this.opening) {
      engine.close();
      return;
    }
    const run = this.runOf(engine);
    this.run = run;
    document.title = `${title} · Beadline`;
    byId("name").textContent = title;
    this.note(...run.info.notes.map(sentence), run.info.recomputes ? "" : `${run.info.whyNot} The recorded states are shown.`);
    this.section("run");
    this.timeline.open(run, this.view.speed);
    this.makeTabs();
    this.showControls();
    engine.onstate = (state) => {
      run.newest = state;
      if (this.isFollowing) {
        run.state = state;
      }
      this.board.invalidate();
    };
    engine.onstatus = (status) => {
      run.status = status;
      this.board.invalidate();
    };
    engine.onend = (reason) => {
      run.ended = `The run has ended: ${reason}.`;
      run.asked = "";
      this.note(run.ended);
      this.board.invalidate();
    };
    results.then((found) => {
      run.pulses = found?.pulses ?? [];
      this.shownTab = "";
      this.board.invalidate();
    });
    if (!this.isFollowing) {
      await run.seek(this.view.step ?? run.info.firstStep);
    }
    await this.applyChange(readChange(this.view.change));
    this.opened?.(run.info);
  }

  /** @param {Engine} engine */
  runOf(engine) {
    const run = new Run(engine, () => this.board.invalidate(), (message) => this.note(sentence(message)));
    engine.onfault = (message) => run.fault(new Error(message));
    return run;
  }

  close() {
    this.opening += 1;
    this.timeline.pause();
    this.run?.close();
    this.second?.close();
    if (this.run) {
      this.renewReady();
    }
    [this.run, this.second, this.hover] = [undefined, undefined, undefined];
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

  /** Whether the newest state of a live run is shown. */
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
    return run ? run.clamp(view.step ?? (run.info.kind === "live" ? run.info.lastStep : run.info.firstStep)) : 0;
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
    Object.assign(this.view, change);
    this.hover = undefined; // what is under the pointer has become another
    clearTimeout(this.writing);
    this.writing = setTimeout(() => this.write(), 250);
    if (!("step" in change) || Object.keys(change).length > 1) {
      this.showControls();
    }
    this.board.invalidate();
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
    const scaled = (/** @type {[number, number]} */ [from, to], /** @type {number} */ factor, /** @type {number} */ part) => {
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
    const moved = (/** @type {[number, number]} */ [from, to], /** @type {number} */ part) => (
      /** @type {[number, number]} */ ([from + part * (to - from), to + part * (to - from)])
    );
    this.look({
      places: this.view.places && within(moved(places, byPlaces), allPlaces, LEAST_PLACES),
      steps: this.view.steps && within(moved(steps, bySteps), allSteps, LEAST_STEPS),
    });
  }

  // ---- what is drawn

  /** Before each drawing: asks for what is missing, and brings words up to date. */
  prepare() {
    const { run, second } = this;
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
    const isCheap = run.info.recomputes && run.beads * run.info.lastStep < CHEAP;
    if (run.info.kind !== "live" && run.rows?.isWhole && (this.view.tab === "events" || isCheap)) {
      run.find(this.bead);
    }
    const isBusy = run.info.kind !== "live" && ![run, ...(second ? [second] : [])].every(({ rows }) => rows?.isWhole);
    byId("map-panel").classList.toggle("busy", isBusy);
    this.timeline.show(this.step, this.isFollowing);
    this.showKind();
    this.showTab();
    this.pictures.describe();
    this.readOut();
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
      steps: whole ? [run.info.firstStep, Infinity] : [
        Math.max(run.info.firstStep, Math.floor(steps[0] * factor)), Math.min(run.info.lastStep, Math.ceil(steps[1] * factor)),
      ],
      rows: Math.max(16, Math.round(plot.height)),
      follow: this.followed,
    });
  }

  showKind() {
    const { info, status, ended } = /** @type {Run} */ (this.run);
    const live = ended ? "live run, ended" : (status ? `live · ${Math.round(status.steps_per_s)} steps/s` : "live");
    const kind = { live, recording: `recording · ${info.storedCount} states`, start: "computed here" }[info.kind];
    byId("kind").textContent = kind;
    byId("kind").className = info.kind === "live" && !ended ? "live" : "";
  }

  /** The values at the pointer, or else at the cursor, in full. */
  readOut() {
    const run = /** @type {Run} */ (this.run);
    const { field } = this.view;
    const at = this.hover ?? { place: Math.min(this.bead, run.lastPlace(field)), step: this.step };
    const show = (/** @type {import("./types.d.ts").State} */ state) => {
      const place = Math.min(at.place, run.lastPlace(field));
      const value = run.value(field, state, place);
      const word = field === "contacts" ? ["touching", "compressed", "open"][value] : `${value} ${unitOf(field)}`;
      const parts = [`${placeWord(field)} ${place}`, amount(state.time_s, "s", 7), `step ${state.step}`];
      const name = FIELDS.find(([one]) => one === field)?.[1] ?? "";
      const output = byId("readout");
      output.replaceChildren(...parts.map((part) => make("span", {}, part)), make("b", {}, field === "contacts" ? word : `${name} ${word}`));
      Object.assign(output.dataset, { place, step: state.step, value });
      if (!this.hover && !this.timeline.isPlaying && !this.isFollowing) {
        this.say(`${parts.join(", ")}, ${name} ${word}`);
      }
    };
    if (!this.hover || (run.state && run.state.step === at.step)) {
      if (run.state) {
        show(run.state);
      }
      return;
    }
    if (this.reading) {
      return; // asked again when the answer has come
    }
    this.reading = true;
    const asked = this.hover;
    run.engine.state(at.step).then((state) => {
      if (this.run === run && this.hover) {
        show(state);
      }
    }, () => {}).finally(() => {
      this.reading = false;
      if (this.hover && this.hover !== asked) {
        this.board.invalidate();
      }
    });
  }

  /** For those who hear the page; not more often than they can. @param {string} text */
  say(text) {
    clearTimeout(this.saying);
    this.saying = setTimeout(() => {
      byId("said").textContent = text;
    }, 400);
  }

  // ---- controls

  makeTabs() {
    const tabs = TABS.filter((name) => name !== "live" || this.run?.info.kind === "live");
    byId("tabs").replaceChildren(...tabs.map((name) => make("button", {
      role: "tab", id: `tab-${name}`, "aria-controls": "tab", onclick: () => this.look({ tab: name }),
      onkeydown: (/** @type {KeyboardEvent} */ event) => {
        const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        if (by) {
          const next = tabs[(tabs.indexOf(name) + by + tabs.length) % tabs.length];
          this.look({ tab: next });
          byId(`tab-${next}`).focus();
        }
      },
    }, name)));
    this.shownTab = "";
  }

  showTab() {
    const run = /** @type {Run} */ (this.run);
    const { tab } = this.view;
    const events = run.events.get(this.bead);
    const state = {
      run: "", pulses: run.pulses.length, live: `${run.ended}${run.status?.step}${run.status?.frames_seen}`,
      events: `${this.bead} ${events?.events.length} ${events?.isDone}`, change: `${this.view.change} ${this.second !== undefined}`,
    };
    const shown = `${tab} ${state[/** @type {keyof typeof state} */ (tab)]}`;
    if (shown === this.shownTab) {
      return;
    }
    const isOther = !this.shownTab.startsWith(`${tab} `);
    this.shownTab = shown;
    for (const button of byId("tabs").children) {
      const isChosen = button.id === `tab-${tab}`;
      button.setAttribute("aria-selected", String(isChosen));
      /** @type {HTMLElement} */ (button).tabIndex = isChosen ? 0 : -1;
    }
    const panel = byId("tab");
    panel.setAttribute("aria-labelledby", `tab-${tab}`);
    const top = isOther ? 0 : panel.scrollTop;
    const seek = (/** @type {number} */ step) => void this.seek(step);
    const contents = tab === "run" ? runTable(run) : tab === "pulses" ? pulseTable(run, seek)
      : tab === "events" ? eventTable(run, this.bead, seek) : tab === "live" ? liveTable(run)
        : changeForm(run, this.second, readChange(this.view.change), (change) => this.change(change));
    panel.replaceChildren(...contents);
    panel.scrollTop = top;
  }

  showControls() {
    const { field, log } = this.view;
    /** @type {HTMLSelectElement} */ (byId("field")).value = field;
    byId("log").setAttribute("aria-pressed", String(log));
    /** @type {HTMLButtonElement} */ (byId("log")).disabled = field === "contacts";
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
    const acts = { log: "log", whole: "whole", prove: "prove", change: "change", export: "export", open: "open", theme: "theme", help: "help" };
    for (const [id, action] of Object.entries({ ...acts, choose: "open", "list-back": "back" })) {
      byId(id).addEventListener("click", () => this.act(action, 0, ""));
    }
    watchKeys((action, by, key) => this.act(action, by, key));
    watchDrops((file) => this.openFile(file));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.applyTheme());
    addEventListener("hashchange", () => this.readAgain());
    for (const id of ["map", "second", "profile"]) {
      this.wireCanvas(id);
    }
  }

  /** Somebody else wrote the fragment: a link, or the address bar. */
  readAgain() {
    const before = this.view.run;
    const change = this.view.change;
    this.view = readView(location.hash);
    this.applyTheme();
    const entry = this.entries.find(({ id }) => id === this.view.run);
    if (this.view.run !== before) {
      const opened = entry ? this.openEntry(entry) : Promise.resolve(this.entries.length > 1 ? this.list() : undefined);
      opened.catch((error) => this.fail(error));
    } else if (this.run) {
      this.look({});
      if (!this.isFollowing) {
        this.seek(this.step);
      }
      if (this.view.change !== change) {
        this.applyChange(readChange(this.view.change));
      }
    }
  }

  /** @param {string} id */
  wireCanvas(id) {
    const canvas = /** @type {HTMLCanvasElement} */ (byId(id));
    const isMap = id !== "profile";
    /** The place and the step at parts of the plot. */
    const at = (/** @type {number} */ x, /** @type {number} */ y) => {
      const run = /** @type {Run} */ (this.run);
      const { steps } = this.window();
      const place = Math.min(Math.max(Math.round(this.pictures.placeAt(x)), 0), run.lastPlace(this.view.field));
      return { place, step: isMap ? run.clamp(steps[0] + y * (steps[1] - steps[0])) : this.step };
    };
    watchPointer(canvas, {
      plot: () => (this.run ? this.pictures.plot(id) : undefined),
      onhover: (x, y) => {
        this.hover = at(x, y);
        this.board.invalidate();
      },
      onleave: () => {
        this.hover = undefined;
        this.board.invalidate();
      },
      onclick: (x, y) => {
        const { place, step } = at(x, y);
        const now = performance.now();
        if (now - this.clicked.time > DOUBLE_MS) {
          this.clicked = { time: now, step: this.view.step, bead: this.view.bead };
        }
        this.look({ bead: Math.min(place, /** @type {Run} */ (this.run).beads - 1) });
        if (isMap) {
          this.timeline.pause();
          this.seek(step);
        }
      },
      onwhole: () => {
        const { step, bead } = this.clicked; // the two clicks before were not meant as such
        this.look({ places: undefined, steps: isMap ? undefined : this.view.steps, step, bead });
        if (step !== undefined) {
          this.seek(step);
        }
      },
      onzoom: (ofPlaces, ofSteps, x, y) => (isMap ? this.zoom(ofPlaces, ofSteps, x, y) : this.zoom(ofPlaces * ofSteps, 1, x, y)),
      onpan: (byX, byY) => this.pan(byX, isMap ? byY : 0),
      onbox: (box) => {
        this.box = isMap ? box : undefined;
        this.board.invalidate();
      },
      onboxed: ([x0, y0, x1, y1]) => {
        const { places, steps, allPlaces, allSteps } = this.window();
        const part = (/** @type {[number, number]} */ [from, to], /** @type {number} */ a, /** @type {number} */ b) => (
          /** @type {[number, number]} */ ([from + a * (to - from), from + b * (to - from)])
        );
        this.look({
          places: within(part(places, x0, x1), allPlaces, LEAST_PLACES),
          steps: isMap ? within(part(steps, y0, y1), allSteps, LEAST_STEPS) : this.view.steps,
        });
      },
    });
  }

  /**
   * Does what a key or a button is for.
   * @param {string} action
   * @param {number} by
   * @param {string} key
   * @returns {boolean} whether it did
   */
  act(action, by, key) {
    const { run, view, timeline } = this;
    /** @type {Record<string, () => void>} */
    const always = {
      theme: () => {
        this.look({ theme: this.isDark ? "light" : "dark" });
        this.applyTheme();
      },
      open: () => chooseFile((file) => this.openFile(file)),
      help: () => this.dialog("Keys and pointer", keyTable()),
      back: () => {
        if (this.entries.length > 1) {
          this.look({ ...freshView(), theme: view.theme });
          this.list(carried().title);
        }
      },
    };
    if (always[action]) {
      always[action]();
      return true;
    }
    if (!run) {
      return false;
    }
    const { steps } = this.window();
    const marks = timeline.marks(this.bead);
    const back = key === "," || key === "<" ? -1 : 1;
    /** @type {Record<string, () => void>} */
    const acts = {
      play: () => timeline.toggle(),
      step: () => timeline.by(by),
      frame: () => timeline.by(by * timeline.frameSteps),
      leap: () => timeline.by(by * Math.max(1, Math.round((steps[1] - steps[0]) / 20))),
      ends: () => timeline.by(by * Infinity),
      live: () => run.info.kind === "live" && this.look({ step: undefined }),
      event: () => {
        run.find(this.bead);
        timeline.jump(marks.events, back);
      },
      pulse: () => timeline.jump(marks.births, back),
      bead: () => this.look({ bead: Math.min(Math.max(this.bead + by, 0), run.beads - 1) }),
      follow: () => this.pin(),
      zoomSteps: () => this.zoom(1, by, 0.5, this.cursorPart()),
      zoomPlaces: () => this.zoom(by, 1),
      panSteps: () => this.pan(0, by),
      panPlaces: () => this.pan(by, 0),
      whole: () => this.look({ places: undefined, steps: undefined }),
      field: () => this.look({ field: FIELDS[Number(key) - 1][0] }),
      log: () => this.look({ log: !view.log }),
      prove: () => void this.prove(),
      change: () => {
        this.look({ tab: "change" });
        this.showTab();
        byId("tab").querySelector("select")?.focus();
      },
      export: () => this.dialog("Export what is seen", exportDialog(this)),
    };
    acts[action]?.();
    return acts[action] !== undefined;
  }

  /** Where the cursor is in the window, if it is there: zooming by keys goes towards it. */
  cursorPart() {
    const { steps: [from, to] } = this.window();
    const part = (this.step - from) / (to - from);
    return part >= 0 && part <= 1 ? part : 0.5;
  }

  /** Goes on following the chosen bead when another is chosen, or no longer. */
  pin() {
    const { bead, view } = this;
    const others = view.beads.filter((one) => one !== bead);
    this.look({ beads: others.length < view.beads.length ? others : [...others, bead].slice(-3) });
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
    byId("notes").replaceChildren(line);
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
    const text = change ? `${change.what}:${change.bead}:${change.value}` : "";
    this.look({ change: text });
    this.applyChange(change);
  }

  /** @param {Change | undefined} change */
  async applyChange(change) {
    const { run } = this;
    this.second?.close();
    this.second = undefined;
    byId("second-panel").hidden = true;
    if (!run || !change) {
      this.board.invalidate();
      return;
    }
    try {
      const engine = await Engine.open(changedSource(change, run), this.startWorker);
      if (this.run !== run) {
        engine.close();
        return;
      }
      this.second = this.runOf(engine);
      byId("second-panel").hidden = false;
      await this.second.seek(this.secondStep(this.step));
    } catch (error) {
      this.note(sentence(error));
      this.look({ change: "" });
    }
    this.board.invalidate();
  }

  // ---- pictures of the table of runs

  /**
   * @param {Entry} entry
   * @param {HTMLCanvasElement} canvas
   */
  async thumbnail(entry, canvas) {
    if (entry.kind === "live") {
      canvas.classList.add("blank");
      return;
    }
    const engine = await Engine.open(await sourceOf(entry), this.startWorker);
    try {
      const { info } = engine;
      const last = info.manifest.physics.beads - 1;
      const request = {
        field: /** @type {const} */ ("velocity"), places: /** @type {[number, number]} */ ([0, last]), columns: canvas.width,
        steps: /** @type {[number, number]} */ ([info.firstStep, info.lastStep]), rows: canvas.height, follow: [],
      };
      await new Promise((done, failed) => {
        engine.rows(request, (rows) => {
          this.pictures.thumbnail(canvas, rows);
          if (rows.isWhole) {
            done(undefined);
          }
        }).then(done, failed);
      });
    } finally {
      engine.onfault = undefined;
      engine.close();
    }
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
      seek: async (/** @type {number} */ step) => {
        await page.ready;
        await page.seek(step);
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
