// Pictures of all canvases: the run, and the changed one, in the window that is looked at.

import { byId } from "./elements.js";
import { changeWords } from "./caption.js";
import { FIELDS } from "./view.js";
import { drawRuler } from "./ruler.js";
import { placeWord } from "./run.js";
import { LABEL_PX, amount } from "./axes.js";
import { theme, colourScale } from "./colours.js";
import { drawMap, mapScales } from "./map.js";
import { drawNotes } from "./notes.js";
import { drawProfile } from "./profile.js";
import { drawEnergies, drawTrajectories, leftOut } from "./curves.js";

/** @typedef {import("./surface.js").Box} Box */
/** @typedef {import("./surface.js").Surface} Surface */
/** @typedef {import("./run.js").Run} Run */

export class Pictures {
  /** @param {import("./page.js").Page} page */
  constructor(page) {
    this.page = page;
  }

  names() {
    return ["map", "second", "difference", "profile", "energies", "path", "marks"];
  }

  /** The run that a canvas shows. @param {string} id */
  runOf(id) {
    const { run, second, comparison } = this.page;
    return id === "second" ? second : id === "difference" ? comparison.shown : run;
  }

  /**
   * @param {string} name
   * @param {Surface} surface
   * @param {Box} box
   */
  draw(name, surface, box) {
    const { run, second } = this.page;
    const shown = this.runOf(name);
    const colours = theme(this.page.isDark);
    if (!run || !shown) {
      return;
    }
    if (["map", "second", "difference"].includes(name)) {
      drawMap(surface, box, shown.rows, this.mapView(shown), colours);
      this.drawTitle(surface, box, shown);
      this.drawBox(surface, box);
      this.drawOver(surface, box, shown);
    } else if (name === "profile") {
      drawProfile(
        surface,
        box,
        {
          state: run.state,
          chain: run.info.chain,
          fields: run.fields,
          second: this.page.secondState,
          secondFields: second?.fields,
          secondName: this.page.comparison.other?.name,
        },
        this.mapView(run),
        colours,
      );
    } else if (name === "energies" || name === "path") {
      const split = run.info.splitBead;
      const isImpurity = run.physics.impurities.some(({ bead }) => bead === split);
      (name === "path" ? drawTrajectories : drawEnergies)(
        surface,
        box,
        {
          rows: run.rows,
          second: second?.rows,
          second_dt_s: second?.physics.dt_s,
          secondName: this.page.comparison.other?.name,
          splitName: isImpurity ? "impurity" : `bead ${split}`,
          events: this.page.followed.flatMap((bead) => run.events.get(bead)?.events ?? []),
          leftOut: leftOut(run.rows, run.info),
        },
        this.mapView(run),
        colours,
      );
    } else {
      this.drawMarks(surface, box);
    }
  }

  /** Descriptions of the canvases, in words. */
  describe() {
    const { run, second, view, comparison } = this.page;
    if (!run) {
      return;
    }
    const { places, steps } = this.page.window();
    const field = FIELDS.find(([name]) => name === view.field)?.[1] ?? "";
    const dt = run.physics.dt_s;
    const where = `${placeWord(view.field)}s ${Math.round(places[0])} to ${Math.ceil(places[1] - 0.5)}`;
    const when = `${amount(steps[0] * dt, "s", 5)} to ${amount(steps[1] * dt, "s", 5)}`;
    const now = amount((run.state?.step ?? 0) * dt, "s", 6);
    const words = {
      map: `Map of ${field}, ${where} to the right, ${when} downward`,
      second: second ? `The same map, changed: ${changeWords(this.page)}` : "The same map with one thing changed, not there",
      difference: `Difference of both maps: ${comparison.shown ? comparison.title(comparison.shown) : "not there"}`,
      profile: `${field} of ${where} at ${now}`,
      energies: `Energies, ${when}`,
      path: `Displacement and velocity of beads ${this.page.followed.join(", ")}, ${when}`,
    };
    for (const [id, text] of Object.entries(words)) {
      if (byId(id).getAttribute("aria-label") !== text) {
        byId(id).setAttribute("aria-label", text);
      }
    }
  }

  /** The window of a run's map, and its style. @param {Run} run */
  mapView(run) {
    const { page } = this;
    const { places, steps } = page.window();
    const factor = run === page.second ? page.secondStep(1) : 1;
    const bead = page.bead;
    return {
      places,
      steps: /** @type {[number, number]} */ ([steps[0] * factor, steps[1] * factor]),
      field: page.view.field,
      log: page.view.log,
      range: page.view.colours ?? page.comparison.commonEnds(run),
      cursor: (run === page.second ? page.secondState : page.run?.state)?.step,
      dt_s: run.physics.dt_s,
      impurities: run.physics.impurities.map((impurity) => impurity.bead),
      chosen: [...new Set([...page.view.beads, ...(page.view.bead === undefined ? [] : [bead])])],
      pulses: page.view.tab === "pulses" ? run.pulses : [],
      events: page.view.tab === "events" ? (run.events.get(bead)?.events ?? []) : [],
    };
  }

  /** The ruler, and notes. @param {Surface} surface @param {Box} box @param {Run} shown */
  drawOver(surface, box, shown) {
    const { page } = this;
    const view = this.mapView(shown);
    const factor = shown === page.second ? page.secondStep(1) : 1;
    const colours = theme(page.isDark);
    if (page.source?.kind === "bytes") {
      drawNotes(surface, box, view, page.notes, factor, colours);
    }
    if (page.view.ruler) {
      drawRuler(surface, box, view, page.view.ruler, factor, /** @type {Run} */ (page.run).info, colours);
    }
  }

  /** Box of the plot of a map or a profile, in its canvas. @param {string} id */
  plot(id) {
    const shown = this.runOf(id);
    const { width, height } = this.page.board.size(id);
    if (!shown || width < 2 || height < 2) {
      return undefined;
    }
    return mapScales({ x: 0, y: 0, width, height }, this.mapView(shown)).plot;
  }

  /** The place at a part of the plot's width. @param {number} x */
  placeAt(x) {
    const {
      places: [from, to],
    } = this.page.window();
    return from + x * (to - from);
  }

  /** Draws the name of a map, one of two, in its corner. @param {Surface} surface @param {Box} box @param {Run} shown
   * */
  drawTitle(surface, box, shown) {
    const { run, changed, comparison } = this.page;
    const { name = "", now = "", then = "" } = changed ?? {};
    const own = { recording: "recorded", live: "live", start: "unchanged" }[shown.info.kind];
    const ofChange = shown === run ? `${own}: ${name} ${then}` : `changed: ${name} ${now}`;
    const text = changed === undefined ? comparison.title(shown) : ofChange;
    if (text === "") {
      return;
    }
    const { plot } = mapScales(box, this.mapView(shown));
    const { foreground, background } = theme(this.page.isDark);
    const size = Math.min(LABEL_PX, (LABEL_PX * (plot.width - 16)) / surface.textWidth(text, LABEL_PX, true));
    const at = plot.y + plot.height - 12;
    surface.text(plot.x + 8, at, text, { size, colour: foreground, bold: true, halo: background });
  }

  /** The box that is being drawn. @param {Surface} surface @param {Box} box */
  drawBox(surface, box) {
    if (!this.page.box || !this.page.run) {
      return;
    }
    const [x0, y0, x1, y1] = this.page.box;
    const { plot } = mapScales(box, this.mapView(this.page.run));
    const [left, right] = [plot.x + x0 * plot.width, plot.x + x1 * plot.width];
    const [top, bottom] = [plot.y + y0 * plot.height, plot.y + y1 * plot.height];
    const { accent: colour } = theme(this.page.isDark);
    surface.lines([left, top, right, top, right, bottom, left, bottom, left, top], { colour, width: 1.5 });
  }

  /** Over the slider of time: events below, pulses above. @param {Surface} surface @param {Box} box */
  drawMarks(surface, box) {
    const { page } = this;
    const { firstStep, lastStep } = /** @type {Run} */ (page.run).info;
    const { foreground, muted } = theme(page.isDark);
    const { events, births } = page.timeline.marks(page.bead);
    const inset = 8; // half of the slider's thumb
    const draw = (
      /** @type {number[]} */ steps,
      /** @type {number} */ top,
      /** @type {number} */ bottom,
      /** @type {string} */ colour,
    ) => {
      for (const step of steps) {
        const x = box.x + inset + ((step - firstStep) / Math.max(1, lastStep - firstStep)) * (box.width - 2 * inset);
        surface.lines([x, box.y + top, x, box.y + bottom], { colour, width: 1, crisp: true });
      }
    };
    draw(events.slice(0, 2000), 6, box.height, muted);
    draw(births, 0, 5, foreground);
  }

  /**
   * A small picture of a whole run.
   * @param {HTMLCanvasElement} canvas
   * @param {import("./types.d.ts").Rows} rows
   */
  thumbnail(canvas, rows) {
    const { columns, count } = rows;
    if (count === 0) {
      return;
    }
    const cells = rows.cells.subarray(0, columns * count);
    const most = cells.reduce((size, value) => Math.max(size, Math.abs(value)), 0);
    const scale = colourScale({ from: -most, to: most, log: most / 50 }, theme(this.page.isDark).shade);
    const pixels = new ImageData(columns, count);
    scale.paint(cells, new Uint32Array(pixels.data.buffer));
    const picture = document.createElement("canvas");
    picture.width = columns;
    picture.height = count;
    /** @type {CanvasRenderingContext2D} */ (picture.getContext("2d")).putImageData(pixels, 0, 0);
    /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")).drawImage(
      picture,
      0,
      0,
      canvas.width,
      canvas.height,
    );
  }
}
