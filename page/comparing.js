// Another run beside this one: its map beside this one's, its curves dashed, and a map of the difference of both below.

import { chooseFile, sourceOf } from "./carried.js";
import { byId, make } from "./elements.js";
import { whyNoDifference } from "./difference.js";
import { endsOf } from "./colouring.js";
import { Engine } from "./engine.js";
import { amount } from "./axes.js";

/** @typedef {import("./page.js").Page} Page */
/** @typedef {import("./run.js").Run} Run */
/** @typedef {import("./types.d.ts").Source} Source */

/** A source that a worker can ask for: it has no address that others could be relative to. @param {Source} source */
function absolute(source) {
  return "url" in source ? { ...source, url: new URL(source.url, document.baseURI).href } : source;
}

/** The run that a page compares its own with. */
export class Comparison {
  /** @param {Page} page */
  constructor(page) {
    this.page = page;
    /** The other run's name and source. @type {{ name: string, source: Source } | undefined} */
    this.other = undefined;
    /** @type {Run | undefined} */
    this.difference = undefined;
    /** Why there is none, though it is wanted. */
    this.whyNot = "";
    /** The ends of the colours of rows, while there are two maps. @type {WeakMap<object, [number, [number, number]]>} */
    this.ends = new WeakMap();
  }

  close() {
    this.difference?.close();
    [this.other, this.difference, this.whyNot] = [undefined, undefined, ""];
  }

  /** Opens the run that the address names. */
  async restore() {
    const { page } = this;
    const entry = page.entries.find(({ id }) => id === page.view.other);
    if (entry) {
      await this.open(() => sourceOf(entry), entry.name);
    }
  }

  /**
   * Shows another run beside that of the page.
   * @param {() => Promise<Source>} getSource
   * @param {string} name
   */
  async open(getSource, name) {
    const { page } = this;
    const { run } = page;
    if (!run) {
      return;
    }
    page.look({ change: "" });
    await page.applyChange(undefined); // closes what was beside it
    const { changing } = page;
    const isLate = () => page.run !== run || page.changing !== changing;
    try {
      const source = absolute(await getSource());
      const engine = await Engine.open(source, page.startWorker);
      if (isLate()) {
        engine.close();
        return;
      }
      page.second = page.runOf(engine);
      this.other = { name, source };
      byId("second-panel").hidden = false;
      await Promise.all([page.second.seek(page.secondStep(page.step)), this.showDifference()]);
    } catch (error) {
      if (!isLate()) {
        page.note(`${name} cannot be compared: ${error instanceof Error ? error.message : error}`);
        page.look({ other: "" });
      }
    }
    page.tabs.forget();
    page.board.invalidate();
  }

  /** Opens the difference if it is wanted, and closes it if not. */
  async showDifference() {
    const { page, other } = this;
    const { run, second, source } = page;
    this.difference?.close();
    [this.difference, this.whyNot] = [undefined, ""];
    if (!page.view.difference || !other || !run || !second || !source) {
      return;
    }
    this.whyNot = run.info.kind === "live" ? "A live run is compared side by side." : whyNoDifference(run.info, second.info);
    if (this.whyNot === "") {
      const pair = { kind: /** @type {const} */ ("difference"), first: absolute(source), other: other.source };
      const engine = await Engine.open(pair, page.startWorker);
      if (this.other !== other || !page.view.difference) {
        engine.close();
        return;
      }
      const difference = page.runOf(engine);
      // a chain that is open has no contact that closes it
      difference.lastPlace = (field) => Math.min(run.lastPlace(field), second.lastPlace(field));
      this.difference = difference;
    }
    page.tabs.forget();
    page.board.invalidate();
  }

  /** The difference where it has a map: classes of contacts have none. */
  get shown() {
    return this.page.view.field === "contacts" ? undefined : this.difference;
  }

  /** The title of a map where there are two; "" if nothing is compared. @param {Run} shown */
  title(shown) {
    const { page, other } = this;
    const own = page.run?.info.manifest.provenance.name ?? "";
    if (!other) {
      return "";
    }
    return shown === page.run ? own : shown === this.difference ? `${own} − ${other.name}` : other.name;
  }

  /** The same ends of colours for two runs, so that colours may be compared. @param {Run} shown */
  commonEnds(shown) {
    const { run, second } = this.page;
    if (!run || !second || shown === this.difference) {
      return undefined;
    }
    const [a, b] = [run, second].map(({ rows }) => this.endsOf(rows));
    return a && b && /** @type {[number, number]} */ ([Math.min(a[0], b[0]), Math.max(a[1], b[1])]);
  }

  /** @param {import("./types.d.ts").Rows | undefined} rows */
  endsOf(rows) {
    if (rows === undefined) {
      return undefined;
    }
    const [count, known] = this.ends.get(rows) ?? [-1, undefined];
    const ends = count === rows.count && known ? known : endsOf(rows);
    this.ends.set(rows, [rows.count, ends]);
    return ends;
  }
}

/** The distance of two states, in words. @param {Page} page */
function apart({ run, second }) {
  const [a, b] = [run?.state, second?.state];
  if (!a || !b || a.u.length !== b.u.length || Math.abs(a.time_s - b.time_s) > 1e-6 * (run?.physics.dt_s ?? 0)) {
    return "";
  }
  const most = (/** @type {Float64Array} */ x, /** @type {Float64Array} */ y, /** @type {string} */ unit) => {
    let bead = 0;
    for (let i = 1; i < x.length; i += 1) {
      bead = Math.abs(x[i] - y[i]) > Math.abs(x[bead] - y[bead]) ? i : bead;
    }
    const value = x[bead] - y[bead];
    return value === 0 ? `0 ${unit}` : `${amount(value, unit, 4)} at bead ${bead}`;
  };
  return `At the cursor the largest differences are ${most(a.u, b.u, "m")} and ${most(a.v, b.v, "m/s")}.`;
}

/**
 * The form in which another run is chosen.
 * @param {Page} page
 */
export function compareForm(page) {
  const { comparison, view } = page;
  const others = page.entries.filter(({ id, error, kind }) => error === undefined && kind !== "live" && id !== view.run);
  const select = make(
    "select",
    { id: "compare-with", "aria-label": "another run" },
    make("option", { value: "" }, comparison.other && !view.other ? comparison.other.name : "another run …"),
    ...others.map(({ id, name }) => make("option", { value: id }, name)),
  );
  select.value = view.other;
  select.addEventListener("change", () => {
    page.look({ other: select.value });
    void (select.value ? comparison.restore() : page.applyChange(undefined));
  });
  const file = () =>
    chooseFile((chosen) => {
      page.look({ other: "" });
      void comparison.open(async () => ({ kind: "file", file: chosen }), chosen.name);
    });
  const box = make("input", { type: "checkbox", id: "compare-difference" });
  box.checked = view.difference;
  box.addEventListener("change", () => {
    page.look({ difference: box.checked });
    void comparison.showDifference();
  });
  const back = () => {
    page.look({ other: "" });
    void page.applyChange(undefined);
  };
  const first = make(
    "div",
    { class: "row" },
    ...(others.length > 0 ? [select] : []),
    make("button", { type: "button", onclick: file }, "Choose a file"),
    ...(comparison.other ? [make("button", { type: "button", onclick: back }, "Take back")] : []),
  );
  const words = (/** @type {string} */ text) => make("p", { class: "words" }, text);
  const { run, second } = page;
  const [dt, other] = [run?.physics.dt_s, second?.physics.dt_s];
  const isInterpolated = comparison.difference && dt !== other;
  return [
    make("form", { onsubmit: (/** @type {Event} */ event) => event.preventDefault() }, first, make("label", {}, box, " difference")),
    ...(comparison.whyNot ? [words(comparison.whyNot)] : []),
    ...(comparison.other ? [words(apart(page))] : []),
    ...(isInterpolated
      ? [words("Their time steps differ: between steps of the other run its states are those of a cubic through displacements and velocities.")]
      : []),
    words("The other run is shown beside this one at the same times, with the same colours, and dashed in the curves."),
  ];
}
