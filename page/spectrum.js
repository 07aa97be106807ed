// The spectrum of the chosen bead, or of the force between it and the next one, over the time in view, with linear modes.

import { LEFT_PX, LABEL_PX, TICK_PX, bottomAxis, frame, linear, powerLabel } from "./axes.js";
import { make, save, table } from "./elements.js";
import { Welch, segmentLength } from "./welch.js";
import { CanvasSurface } from "./surface.js";
import { amount } from "./axes.js";
import { curveCount } from "./rows.js";
import { theme } from "./colours.js";

/** @typedef {import("./page.js").Page} Page */
/** @typedef {import("./run.js").Run} Run */
/** @typedef {"velocity" | "displacement" | "force"} Of */
/** @typedef {{ frequencies: Float64Array, density: Float64Array, segments: number, length: number }} Found */

/** Steps that are transformed at most. */
const MOST_STEPS = 4_000_000;
const HIGH_PX = 230;
/** Parts of the largest density that are shown: powers of ten. */
const DECADES = 8;
const SQUARED = { velocity: "(m/s)²/Hz", displacement: "m²/Hz", force: "N²/Hz" };
const COLUMN = { velocity: "m2_s2_hz", displacement: "m2_hz", force: "n2_hz" };

/** The largest number of a list. @param {ArrayLike<number>} values */
function largest(values) {
  let most = 0;
  for (let i = 0; i < values.length; i += 1) {
    most = Math.max(most, values[i]);
  }
  return most;
}

/** The questions to a run, and the answers. */
export class Spectrum {
  /** @param {Page} page */
  constructor(page) {
    this.page = page;
    /** @type {Of} */
    this.of = "velocity";
    this.asked = "";
    /** @type {Found | undefined} */
    this.found = undefined;
    this.words = "";
  }

  /** The steps in view, the chosen bead, and what of it. */
  request() {
    const { page } = this;
    const run = /** @type {Run} */ (page.run);
    const { steps } = page.window();
    const last = run.lastPlace(this.of);
    return { bead: Math.min(page.bead, last), steps: /** @type {[number, number]} */ ([run.clamp(steps[0]), run.clamp(steps[1])]) };
  }

  /** The choices that a spectrum depends on. */
  get key() {
    const { bead, steps } = this.request();
    return `${this.of} ${bead} ${steps}`;
  }

  /** Asks for the spectrum unless it was asked for. */
  async ask() {
    const { page, key } = this;
    const run = /** @type {Run} */ (page.run);
    if (key === this.asked) {
      return;
    }
    Object.assign(this, { asked: key, found: undefined, words: "Transforming …" });
    const { bead, steps } = this.request();
    const isGrowing = run.info.kind === "live" && run.ended === "";
    if (isGrowing || steps[1] - steps[0] > MOST_STEPS) {
      this.words = isGrowing
        ? "The spectrum of a live run: `beadline spectrum live`."
        : `At most ${MOST_STEPS} steps are transformed here: zoom in, or take \`beadline spectrum\`.`;
      return;
    }
    try {
      const found = await transformed(run, this.of, bead, steps);
      if (this.asked === key && page.run === run) {
        this.found = found;
        this.words = found ? "" : "There are too few equally distant states for a spectrum.";
      }
    } catch (error) {
      this.words = error instanceof Error ? error.message : String(error);
    }
    page.tabs.forget();
    page.board.invalidate();
  }

  close() {
    Object.assign(this, { asked: "", found: undefined });
  }
}

/**
 * @param {Run} run @param {Of} of @param {number} bead @param {[number, number]} steps
 * @returns {Promise<Found | undefined>}
 */
async function transformed(run, of, bead, steps) {
  const follow = of === "force" ? [bead, (bead + 1) % run.beads] : [bead];
  const [wide, first] = [curveCount(follow), curveCount([])];
  const { restOverlap, ring } = run.info.chain;
  const rest = restOverlap[bead] ?? ring?.restOverlap;
  const value = (/** @type {Float64Array} */ values, /** @type {number} */ at) =>
    of === "velocity"
      ? values[at + 1]
      : of === "displacement"
        ? values[at]
        : run.fields.force(bead, values[at] - values[at + 2] + rest);
  /** @type {Welch | undefined} */
  let welch;
  let [before, interval] = [-1, 0];
  /** @type {number[]} */
  const early = [];
  await run.engine.series({ steps, follow }, ({ steps: here, values }) => {
    here.forEach((step, i) => {
      const sample = value(values, i * wide + first);
      if (before >= 0 && interval === 0) {
        interval = step - before;
        welch = new Welch(segmentLength(Math.floor((steps[1] - before) / interval) + 1));
        welch.push(early[0]);
      }
      if (interval > 0 && step - before < interval) {
        return; // the last state may be nearer
      }
      if (interval > 0 && step - before > interval) {
        welch?.restart();
      }
      before = step;
      early.push(...(interval === 0 ? [sample] : []));
      welch?.push(sample);
    });
  });
  if (!welch || welch.segments === 0) {
    return undefined;
  }
  const { length, segments } = welch;
  const rate = 1 / (interval * run.physics.dt_s);
  const frequencies = Float64Array.from({ length: length / 2 + 1 }, (_, line) => (line * rate) / length);
  return { frequencies, density: welch.density(rate), segments, length };
}

/**
 * Draws a density over frequency, up to where it is less than a millionth of its largest and all modes are seen.
 * @param {HTMLCanvasElement} canvas
 * @param {Found} found @param {Of} of @param {import("./types.d.ts").Mode[]} modes @param {boolean} isDark
 */
function draw(canvas, { frequencies, density }, of, modes, isDark) {
  const colours = theme(isDark);
  const width = Math.max(200, canvas.clientWidth);
  const ratio = devicePixelRatio || 1;
  [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(HIGH_PX * ratio)];
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const surface = new CanvasSurface(context, width, HIGH_PX, ratio);
  const box = { x: 0, y: 0, width, height: HIGH_PX };
  const plot = { x: LEFT_PX, y: 8, width: width - LEFT_PX - 12, height: HIGH_PX - 8 - 42 };
  // line 0 is what is left of the mean
  const most = largest(density.subarray(1)) || 1;
  let last = density.length - 1;
  while (last > 4 && density[last] < 1e-6 * most) {
    last -= 1;
  }
  const top = Math.min(Math.max(frequencies[last], 1.05 * largest(modes.map((mode) => mode.frequency_hz))), frequencies[frequencies.length - 1]);
  const high = Math.ceil(Math.log10(most) + 0.1);
  const x = linear(0, top, plot.x, plot.width);
  const y = linear(high - DECADES, high, plot.y + plot.height, -plot.height);
  for (let power = high - DECADES; power <= high; power += 2) {
    surface.lines([plot.x, y(power), plot.x + plot.width, y(power)], { colour: colours.grid, width: 1, crisp: true });
    surface.text(plot.x - 8, y(power), powerLabel(power), { size: TICK_PX, align: "right", colour: colours.foreground });
  }
  surface.clip(plot.x, plot.y, plot.width, plot.height, () => {
    for (const { frequency_hz: frequency } of modes) {
      surface.lines([x(frequency), plot.y, x(frequency), plot.y + 6], { colour: colours.muted, width: 1 });
    }
    const points = Array.from(density).flatMap((value, i) => [x(frequencies[i]), y(Math.log10(Math.max(value, 1e-300)))]);
    surface.lines(points, { colour: colours.curves[0], width: 1.3 });
  });
  frame(surface, plot, colours);
  bottomAxis(surface, box, plot, { from: 0, to: top, name: "frequency", unit: "Hz", prefixed: true }, colours);
  const middle = plot.y + plot.height / 2;
  surface.text(0.7 * LABEL_PX + 2, middle, `density (${SQUARED[of]})`, { size: LABEL_PX, align: "center", colour: colours.foreground, turned: true });
}

/**
 * The spectrum, and the linear modes.
 * @param {Page} page
 */
export function spectrumPanel(page) {
  const { spectrum } = page;
  const run = /** @type {Run} */ (page.run);
  void spectrum.ask();
  const { found, of, words } = spectrum;
  const { bead } = spectrum.request();
  const select = make(
    "select",
    { id: "spectrum-of", "aria-label": "spectrum of" },
    make("option", { value: "velocity" }, "velocity of the bead"),
    make("option", { value: "displacement" }, "displacement of the bead"),
    make("option", { value: "force" }, "elastic force on the next bead"),
  );
  select.value = of;
  select.addEventListener("change", () => {
    spectrum.of = /** @type {Of} */ (select.value);
    page.tabs.forget();
    page.board.invalidate();
  });
  const place = of === "force" ? `contact ${bead}, of beads ${bead} and ${(bead + 1) % run.beads}` : `bead ${bead}`;
  const text = (/** @type {string} */ said) => make("p", { class: "words" }, said);
  const csv = () => {
    const lines = Array.from(/** @type {Found} */ (found).density, (value, i) => `${found?.frequencies[i]},${value}`);
    const name = `${run.info.manifest.provenance.name.replace(/[^\w-]+/g, "-")}-spectrum.csv`;
    save(name, new Blob([`frequency_hz,density_${COLUMN[of]}\n${lines.join("\n")}\n`], { type: "text/csv" }));
  };
  const canvas = make("canvas", { class: "chart", role: "img", "aria-label": `spectrum of ${place}` });
  const modes = run.modes;
  if (found) {
    requestAnimationFrame(() => canvas.isConnected && draw(canvas, found, of, modes, page.isDark));
  }
  const head = ["mode", "frequency", "beads that take part", "most at bead"];
  const rows = modes.map(({ mode, frequency_hz, participation_beads, centre_bead }) => [
    mode,
    amount(frequency_hz, "Hz", 6),
    Number(participation_beads.toPrecision(3)),
    centre_bead,
  ]);
  return [
    make("div", { class: "row" }, select, make("button", { type: "button", disabled: !found, onclick: csv }, "CSV")),
    ...(found
      ? [canvas, text(`${place}, the time in view, ${found.segments} segments of ${found.length} samples, Hann window.`)]
      : [text(words)]),
    ...(rows.length > 0
      ? [make("h3", {}, "Linear modes"), text("About rest; ticks above the spectrum."), table("modes", head, rows)]
      : []),
  ];
}
