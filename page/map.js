// The space–time map: beads to the right, time downward, a colour for each number.

import { LABEL_PX, LEFT_PX, TICK_PX, bottomAxis, frame, leftAxis, legend, linear } from "./axes.js";
import { labelled, powerLabel, signed, ticks } from "./axes.js";
import { colourScale, css } from "./colours.js";

/** @typedef {import("./surface.js").Box} Box */
/** @typedef {import("./surface.js").Surface} Surface */
/** @typedef {import("./colours.js").Theme} Theme */
/** @typedef {import("./types.d.ts").Rows} Rows */
/** @typedef {import("./types.d.ts").Field} Field */
/**
 * The window of a map. Bead or contact i reaches from i − ½ to i + ½, so that all of N are −½ … N − ½.
 * @typedef {object} View
 * @property {[number, number]} places real numbers
 * @property {[number, number]} steps real numbers
 * @property {Field} field
 * @property {boolean} [log] whether colours are logarithmic
 * @property {number} [cursor] a step
 * @property {number} [dt_s] without it, axes show steps
 * @property {[number, number]} [range] values of the colours' ends; otherwise those of the rows
 * @property {number[]} [impurities] beads
 * @property {number[]} [chosen] beads
 * @property {import("./types.d.ts").Pulse[]} [pulses]
 * @property {import("./types.d.ts").Event[]} [events]
 */

/** @type {Record<Field, [string, string]>} */
export const FIELD_LABELS = {
  velocity: ["velocity", "m/s"],
  displacement: ["displacement", "m"],
  overlap: ["overlap from rest", "m"],
  energy: ["energy", "J"],
  contacts: ["contact", ""],
  force: ["force from rest", "N"],
};

export const CONTACT_CLASSES = ["touching", "compressed", "open"];

/** Parts of the largest number below which colours are linear. */
const LINEAR_PART = { velocity: 1e-3, displacement: 1e-3, overlap: 1e-3, energy: 1e-6, contacts: 0, force: 1e-3 };

/** True if a field belongs to contacts rather than to beads. */
export const isOfContacts = (/** @type {Field} */ field) => ["overlap", "contacts", "force"].includes(field);

const NARROW_PX = 560;
const BAR_PX = 13;

/** Box of the plot in a box; a profile with the same box's x and width has the same x axis. @param {Box} box */
export function plotOf({ x, y, width, height }) {
  const isNarrow = width < NARROW_PX;
  const [top, right] = isNarrow ? [46, 14] : [12, 104];
  const [wide, high] = [Math.max(20, width - LEFT_PX - right), Math.max(20, height - top - 42)];
  return { isNarrow, plot: { x: x + LEFT_PX, y: y + top, width: wide, height: high } };
}

/**
 * Maps beads (or contacts) and steps to pixels and back.
 * @param {Box} box
 * @param {Pick<View, "places" | "steps">} view
 */
export function mapScales(box, { places, steps }) {
  const { plot } = plotOf(box);
  const of = (/** @type {number[]} */ [from, to]) => [from, to > from ? to : from + 1];
  const [[firstPlace, lastPlace], [firstStep, lastStep]] = [of(places), of(steps)];
  return {
    plot,
    x: linear(firstPlace, lastPlace, plot.x, plot.width),
    y: linear(firstStep, lastStep, plot.y, plot.height),
    place: linear(plot.x, plot.x + plot.width, firstPlace, lastPlace - firstPlace),
    step: linear(plot.y, plot.y + plot.height, firstStep, lastStep - firstStep),
  };
}

/** Scales that were made, by what they are made of: their tables take longer than a picture. */
const MOST_SCALES = 16;
/** @type {Map<string, import("./colours.js").ColourScale>} */
const madeScales = new Map();

/** Rows as they were painted: a line of pixels each, and how that looked when it was last placed. */
class Picture {
  /** @param {Rows} rows */
  constructor(rows) {
    this.columns = rows.columns;
    this.lines = document.createElement("canvas");
    this.painted = 0;
    this.seen = 0;
    this.look = "";
    this.from = 0;
    this.to = 0;
    this.reduced = document.createElement("canvas");
    this.placed = document.createElement("canvas");
    this.place = "";
    /** @type {import("./colours.js").ColourScale | undefined} */
    this.scale = undefined;
  }

  /**
   * Widens the range of numbers by rows that are new; with some to spare, since each change paints all anew.
   * @param {Rows} rows
   */
  widen(rows) {
    const end = rows.count * rows.columns;
    let [low, high] = [0, 0];
    for (let i = Math.min(this.seen, rows.fresh * rows.columns); i < end; i += 1) {
      const value = rows.cells[i];
      if (value < low) {
        low = value;
      } else if (value > high) {
        high = value;
      }
    }
    const spare = this.seen > 0 ? 1.1 : 1;
    this.from = low < this.from ? spare * low : this.from;
    this.to = high > this.to ? spare * high : this.to;
    this.seen = end;
  }

  /** @param {Rows} rows @param {View} view @param {Theme} theme */
  paint(rows, view, theme) {
    this.widen(rows);
    const [from, to] = view.range ?? [this.from, this.to];
    const look = [rows.request.field, view.log, theme.isDark, from, to].join();
    if (this.scale === undefined || look !== this.look) {
      this.scale = madeScales.get(look) ?? scaleOf(rows.request.field, from, to, view.log ?? false, theme);
      if (madeScales.size >= MOST_SCALES) {
        madeScales.clear();
      }
      madeScales.set(look, this.scale);
      this.look = look;
      this.painted = 0;
    }
    const { scale } = this;
    this.painted = Math.min(this.painted, rows.fresh);
    rows.fresh = rows.count;
    if (this.painted === rows.count) {
      return scale;
    }
    const { lines, columns } = this;
    let context = lines.getContext("2d");
    if (lines.width !== columns || lines.height < rows.count) {
      lines.width = columns;
      lines.height = Math.ceil(1.5 * rows.count);
      this.painted = 0;
      context = lines.getContext("2d");
    }
    const first = this.painted;
    const data = /** @type {CanvasRenderingContext2D} */ (context).createImageData(columns, rows.count - first);
    scale.paint(rows.cells.subarray(first * columns, rows.count * columns), new Uint32Array(data.data.buffer));
    context?.putImageData(data, 0, first);
    this.painted = rows.count;
    this.place = "";
    return scale;
  }

  /**
   * Puts each row where it belongs, in pixels of the device.
   * @param {Rows} rows @param {View} view @param {Box} plot @param {number} ratio
   */
  put(rows, view, plot, ratio) {
    const [width, height] = [Math.round(plot.width * ratio), Math.round(plot.height * ratio)];
    const place = [width, height, ...view.places, ...view.steps].join();
    if (place === this.place) {
      return;
    }
    this.place = place;
    const { placed, lines, columns } = this;
    placed.width = width;
    placed.height = height;
    const context = /** @type {CanvasRenderingContext2D} */ (placed.getContext("2d"));
    const {
      places: [first, last],
    } = rows.request;
    const x = linear(view.places[0], view.places[1], 0, width);
    const y = linear(view.steps[0], view.steps[1], 0, height);
    const [left, right] = [x(first - 0.5), x(last + 0.5)];
    const { steps, count } = rows;
    const gap = (/** @type {number} */ i) =>
      i + 1 < count ? steps[i + 1] - steps[i] : i > 0 ? steps[i] - steps[i - 1] : 1;
    for (let i = 0; i < count;) {
      // rows that are equally far apart are placed at once
      let end = i + 1;
      while (end < count && gap(end) === gap(i)) {
        end += 1;
      }
      const [top, bottom] = [Math.round(y(steps[i])), Math.round(y(steps[end - 1] + gap(end - 1)))];
      if (bottom > top && bottom > 0 && top < height) {
        // where pixels are fewer than numbers, none is to be dropped
        const [denseRows, denseColumns] = [end - i > bottom - top, columns > right - left + 1];
        if (denseRows || denseColumns) {
          // reduced the one way, and blocks stay crisp the other way
          const { reduced } = this;
          reduced.width = denseColumns ? Math.ceil(right - left) : columns;
          reduced.height = denseRows ? bottom - top : end - i;
          reduced.getContext("2d")?.drawImage(lines, 0, i, columns, end - i, 0, 0, reduced.width, reduced.height);
          context.imageSmoothingEnabled = false;
          context.drawImage(reduced, left, top, right - left, bottom - top);
        } else {
          context.imageSmoothingEnabled = false;
          context.drawImage(lines, 0, i, columns, end - i, left, top, right - left, bottom - top);
        }
      }
      i = end;
    }
  }
}

/** @type {WeakMap<Rows, Picture>} */
const pictures = new WeakMap();

/**
 * @param {Field} field
 * @param {number} from
 * @param {number} to
 * @param {boolean} isLog
 * @param {Theme} theme
 */
function scaleOf(field, from, to, isLog, theme) {
  const log = isLog ? LINEAR_PART[field] * Math.max(Math.abs(from), Math.abs(to)) : 0;
  if (field === "contacts") {
    return colourScale({ from: 0, to: 2 }, (shade) => theme.contacts[Math.min(Math.max(Math.round(2 * shade), 0), 2)]);
  }
  // energy is not negative but for a loaded chain's, which counts from rest
  const hasSign = field !== "energy" || from < -1e-3 * to;
  return colourScale(
    { from: hasSign ? from : 0, to, log },
    hasSign ? theme.shade : (shade) => theme.part(Math.abs(shade)),
  );
}

/**
 * Draws the colours only, into the whole of a box; returns their scale.
 * @param {Surface} surface @param {Box} box @param {Rows} rows @param {View} view @param {Theme} theme
 */
export function drawPicture(surface, box, rows, view, theme) {
  const picture = pictures.get(rows) ?? new Picture(rows);
  pictures.set(rows, picture);
  const scale = picture.paint(rows, view, theme);
  picture.put(rows, view, box, surface.ratio);
  surface.image(picture.placed, box.x, box.y, box.width, box.height, true);
  return scale;
}

/**
 * Draws the map of these rows, as far as there are any.
 * @param {Surface} surface
 * @param {Box} box
 * @param {Rows | undefined} rows
 * @param {View} view
 * @param {Theme} theme
 */
export function drawMap(surface, box, rows, view, theme) {
  const { isNarrow, plot } = plotOf(box);
  surface.rect(plot.x, plot.y, plot.width, plot.height, theme.unknown);
  const scales = mapScales(box, view);
  if (rows !== undefined && rows.count > 0 && rows.columns > 0) {
    const scale = drawPicture(surface, plot, rows, view, theme);
    if (rows.request.field === "contacts") {
      drawClasses(surface, box, plot, isNarrow, theme);
    } else {
      drawBar(surface, box, plot, isNarrow, scale, rows.request.field, theme);
    }
  }
  surface.clip(plot.x, plot.y, plot.width, plot.height, () => drawMarks(surface, scales, view, theme));
  frame(surface, plot, theme);
  const dt = view.dt_s;
  const [from, to] = view.steps;
  const time =
    dt === undefined
      ? { from, to, name: "step", whole: true }
      : { from: from * dt, to: to * dt, name: "time", unit: "s", prefixed: true };
  leftAxis(surface, plot, time, theme, { isDown: true });
  bottomAxis(surface, box, plot, placesOf(view), theme);
  drawChosen(surface, scales, view, theme);
}

/** The axis of beads, or contacts. @param {View} view */
export function placesOf({ places: [from, to], field }) {
  return { from, to, name: isOfContacts(field) ? "contact" : "bead", whole: true };
}

/** The ends of the places in view as beads, of real number. @param {Pick<View, "places" | "field">} view */
export function beadsOf({ places, field }) {
  return places.map((place) => (isOfContacts(field) ? place + 0.5 : place));
}

/** @typedef {ReturnType<typeof mapScales>} Scales */

/** A bead on the axis of a field: bead b is between contacts b − 1 and b. @param {number} bead @param {View} view */
export function placeOfBead(bead, { field }) {
  return isOfContacts(field) ? bead - 0.5 : bead;
}

/** @param {Surface} surface @param {Scales} scales @param {View} view @param {Theme} theme */
function drawMarks(surface, scales, view, theme) {
  const { plot, x, y } = scales;
  const at = (/** @type {number} */ bead) => x(placeOfBead(bead, view));
  const bottom = plot.y + plot.height;
  const upright = (/** @type {number} */ bead, /** @type {string} */ colour, /** @type {number[]} */ dash) => {
    surface.lines([at(bead), plot.y, at(bead), bottom], { colour, width: 1, dash, crisp: true });
  };
  const impurities = view.impurities ?? [];
  if (impurities.length <= 12) {
    impurities.forEach((bead) => upright(bead, theme.muted, [5, 4]));
  }
  (view.chosen ?? []).forEach((bead) => upright(bead, theme.accent, [2, 3]));
  const numbered = /** @type {number[][]} */ ([]);
  for (const { track, pulse } of view.pulses ?? []) {
    drawTrack(surface, scales, view, track, String(pulse), theme, numbered);
  }
  for (const { bead, step } of view.events ?? []) {
    surface.circle(at(bead), y(step), 3.5, { fill: theme.background, colour: theme.accent, width: 1.5 });
  }
  const words = [
    impurities.length > 0 && impurities.length <= 12 ? "dashed: impurity" : "",
    (view.pulses ?? []).length > 0 ? "dotted: pulses by number" : "",
    (view.events ?? []).length > 0 ? "circles: a contact opens or closes, or the bead turns" : "",
  ].filter(Boolean);
  surface.text(plot.x + plot.width - 6, plot.y + 10, words.join("; "), {
    size: TICK_PX,
    align: "right",
    colour: theme.foreground,
    halo: theme.background,
  });
  if (view.cursor !== undefined) {
    const here = y(view.cursor);
    surface.lines([plot.x, here, plot.x + plot.width, here], { colour: theme.accent, width: 1, crisp: true });
  }
}

/**
 * @param {Surface} surface @param {Scales} scales @param {View} view
 * @param {number[]} track @param {string} name @param {Theme} theme
 * @param {number[][]} numbered where numbers stand already: one that would cover another is left out
 */
function drawTrack(surface, { plot, x, y }, view, track, name, theme, numbered) {
  const dt = view.dt_s ?? 1;
  const points = track.map((number, i) => (i % 2 === 0 ? x(placeOfBead(track[i + 1], view)) : y(track[i - 1] / dt)));
  surface.lines(points, { colour: theme.foreground, width: 1.2, dash: [2, 4] });
  // the number stands at three quarters of what is seen of it
  const seen = [];
  const PARTS = 32;
  for (let i = 0; i + 3 < points.length; i += 2) {
    for (let part = 0; part < PARTS; part += 1) {
      const right = points[i] + (part / PARTS) * (points[i + 2] - points[i]);
      const down = points[i + 1] + (part / PARTS) * (points[i + 3] - points[i + 1]);
      if (
        right > plot.x + 10 &&
        right < plot.x + plot.width - 10 &&
        down > plot.y + 9 &&
        down < plot.y + plot.height - 9
      ) {
        seen.push([right, down]);
      }
    }
  }
  const place = seen[Math.floor(0.75 * (seen.length - 1))];
  const isApart = (/** @type {number[]} */ [right, down]) =>
    Math.abs(right - place[0]) > 0.8 * TICK_PX * (name.length + 1) || Math.abs(down - place[1]) > 1.3 * TICK_PX;
  if (!place || !numbered.every(isApart)) return;
  numbered.push(place);
  const { foreground: colour, background: halo } = theme;
  surface.text(place[0], place[1], name, { size: TICK_PX, align: "center", colour, bold: true, halo });
}

/**
 * Numbers of chosen beads, and the cursor's arrow, outside of the plot.
 * @param {Surface} surface
 * @param {Scales} scales
 * @param {View} view
 * @param {Theme} theme
 */
function drawChosen(surface, { plot, x, y }, view, theme) {
  for (const bead of view.chosen ?? []) {
    const at = x(placeOfBead(bead, view));
    if (at >= plot.x && at <= plot.x + plot.width) {
      surface.area([at, plot.y, at - 4, plot.y - 6, at + 4, plot.y - 6], theme.accent);
    }
  }
  const here = view.cursor === undefined ? NaN : y(view.cursor);
  if (here >= plot.y - 1 && here <= plot.y + plot.height + 1) {
    const right = plot.x + plot.width;
    surface.area([right + 1, here, right + 7, here - 4, right + 7, here + 4], theme.accent);
  }
}

/** @param {Surface} surface @param {Box} box @param {Box} plot @param {boolean} isNarrow @param {Theme} theme */
function drawClasses(surface, box, plot, isNarrow, theme) {
  const entries = CONTACT_CLASSES.map((name, i) => ({ name, colour: css(theme.contacts[i]), isBlock: true }));
  if (isNarrow) {
    legend(surface, { x: plot.x, y: box.y + 12, width: plot.width, height: 17 }, entries, theme);
  } else {
    const x = plot.x + plot.width + 11;
    // one below the other
    entries.forEach((entry, i) => legend(surface, { x, y: plot.y + 2 + 20 * i, width: 1, height: 17 }, [entry], theme));
  }
}

/**
 * 0 and powers of ten of both signs that have room on a bar, `apart` parts of it from each other.
 * @param {import("./colours.js").ColourScale} scale
 * @param {number} apart
 */
function decades(scale, apart) {
  const zero = scale.place(0);
  const [first, last] = [Math.ceil(Math.log10(scale.linear)), Math.floor(Math.log10(scale.limit) + 1e-9)];
  /** @type {[number, number][]} a value and its power */
  const all = [];
  for (let power = last; power >= first; power -= 1) {
    all.push([10 ** power, power], [-(10 ** power), power]);
  }
  const fits = all.filter(
    ([value]) => value >= scale.from && value <= scale.to && Math.abs(scale.place(value) - zero) >= apart,
  );
  const powers = [...new Set(fits.map(([, power]) => power))];
  const isApart = (/** @type {number} */ stride) => {
    const places = powers
      .filter((_, i) => i % stride === 0)
      .map((power) => scale.place((scale.to >= -scale.from ? 1 : -1) * 10 ** power));
    return places.every((place, i) => i === 0 || Math.abs(place - places[i - 1]) >= apart);
  };
  let stride = 1;
  while (stride < powers.length && !isApart(stride)) {
    stride += 1;
  }
  const isPlain = powers.every((power) => power >= -3 && power < 5);
  const label = (/** @type {number} */ value, /** @type {number} */ power) =>
    isPlain ? signed(value, Math.max(0, -power)) : powerLabel(power, value < 0);
  const chosen = fits.filter(([, power]) => powers.indexOf(power) % stride === 0);
  return [...chosen.map(([value, power]) => ({ value, label: label(value, power) })), { value: 0, label: "0" }];
}

/**
 * The bar that explains the colours: beside the plot, or above a narrow one.
 * @param {Surface} surface @param {Box} box @param {Box} plot @param {boolean} isNarrow
 * @param {import("./colours.js").ColourScale} scale @param {Field} field @param {Theme} theme
 */
function drawBar(surface, box, plot, isNarrow, scale, field, theme) {
  const [name, unit] = FIELD_LABELS[field];
  const bar = isNarrow
    ? { x: plot.x, y: box.y + 4, width: Math.round(plot.width * 0.62), height: 10 }
    : { x: plot.x + plot.width + 14, y: plot.y, width: BAR_PX, height: plot.height };
  const length = isNarrow ? bar.width : bar.height;
  const cells = Math.max(2, Math.round(length / 2));
  for (let i = 0; i < cells; i += 1) {
    const colour = css(scale.at((i + 0.5) / cells));
    // each reaches under the next one, so that no seam is seen
    if (isNarrow) {
      surface.rect(
        bar.x + (i * bar.width) / cells,
        bar.y,
        ((i + 1 < cells ? 2 : 1) * bar.width) / cells,
        bar.height,
        colour,
      );
    } else {
      const top = bar.y + (1 - (i + 1) / cells) * bar.height;
      surface.rect(
        bar.x,
        i + 1 < cells ? top - bar.height / cells : top,
        bar.width,
        ((i + 1 < cells ? 2 : 1) * bar.height) / cells,
        colour,
      );
    }
  }
  frame(surface, bar, theme);
  const least = isNarrow ? 44 : 20;
  const isLog = scale.linear > 0;
  const plain = ticks(
    { from: scale.from, to: scale.to, name, unit },
    Math.max(2, Math.floor(length / (isNarrow ? 60 : 50))),
  );
  const marks = isLog
    ? decades(scale, least / length)
    : plain.values.map((value, i) => ({ value, label: plain.labels[i] }));
  for (const { value, label } of marks) {
    const place = scale.place(value);
    if (isNarrow) {
      const x = bar.x + place * bar.width;
      surface.lines([x, bar.y + bar.height, x, bar.y + bar.height + 4], {
        colour: theme.foreground,
        width: 1,
        crisp: true,
      });
      surface.text(x, bar.y + bar.height + 6, label, {
        size: TICK_PX,
        align: "center",
        baseline: "top",
        colour: theme.foreground,
      });
    } else {
      const y = bar.y + (1 - place) * bar.height;
      surface.lines([bar.x + bar.width, y, bar.x + bar.width + 4, y], {
        colour: theme.foreground,
        width: 1,
        crisp: true,
      });
      surface.text(bar.x + bar.width + 7, y, label, { size: TICK_PX, colour: theme.foreground });
    }
  }
  const label = isLog ? labelled(name, unit) : plain.label;
  if (isNarrow) {
    surface.text(bar.x + bar.width + 12, bar.y + bar.height / 2, label, { size: TICK_PX, colour: theme.foreground });
  } else {
    const x = box.x + box.width - 0.7 * LABEL_PX - 2;
    surface.text(x, bar.y + bar.height / 2, label, {
      size: LABEL_PX,
      align: "center",
      colour: theme.foreground,
      turned: true,
    });
  }
}
