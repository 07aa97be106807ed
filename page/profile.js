// The chain at one time: a curve along it, and beads drawn as beads when few are in view.

import { TICK_PX, amount, bottomAxis, frame, leftAxis, linear } from "./axes.js";
import { FIELD_LABELS, beadsOf, isOfContacts, mapScales, placeOfBead, placesOf, plotOf } from "./map.js";

/** @typedef {import("./surface.js").Box} Box */
/** @typedef {import("./surface.js").Surface} Surface */
/** @typedef {import("./colours.js").Theme} Theme */
/** @typedef {import("./map.js").View} View */
/** @typedef {import("./types.d.ts").State} State */
/** @typedef {import("./types.d.ts").Chain} Chain */
/** @typedef {import("./types.d.ts").Field} Field */
/** Source of the values of a field: `Fields` of fields.js. */
/**
 * @typedef {object} Valuer
 * @property {(field: Field, state: State, places: [number, number], columns: number, into: any) => void} row
 * @property {(contact: number, overlap: number) => number} force
 * @property {Chain} chain
 */
/**
 * A state and its chain; a second one, of a changed chain, is dashed. Without `fields` there are no energy and no forces.
 * @typedef {object} ProfileData
 * @property {State | undefined} state
 * @property {Chain} chain
 * @property {Valuer} [fields]
 * @property {State | undefined} [second]
 * @property {Valuer} [secondFields]
 * @property {string} [secondName]
 */

/** Beads in view up to which they are drawn as beads. */
const MOST_BEADS = 60;

/**
 * Values of the places in view, with one more on each side; in a ring the last contact closes it.
 * @param {State} state @param {Field} field @param {[number, number]} places @param {Valuer | undefined} fields
 * @param {boolean} isRing
 */
function valuesOf(state, field, [from, to], fields, isRing) {
  const last = state.u.length - (isOfContacts(field) && !isRing ? 2 : 1);
  const first = Math.max(0, Math.floor(from));
  const count = Math.min(last, Math.ceil(to)) - first + 1;
  const values = new Float64Array(Math.max(0, count));
  if (field === "energy" || field === "force") {
    if (count > 0) {
      fields?.row(field, state, [first, first + count - 1], count, values);
    }
    return { first, values };
  }
  const { u, v } = state;
  for (let i = 0; i < values.length; i += 1) {
    const place = first + i;
    values[i] = field === "velocity" ? v[place] : field === "displacement" ? u[place] : u[place] - u[(place + 1) % u.length];
  }
  return { first, values };
}

/**
 * The range of a curve: all of it, but for beads that have flown off, if without them the rest is seen better.
 * @param {Float64Array[]} curves @param {Field} field @param {Chain} chain
 */
function rangeOf(curves, field, { restForce, stiffness }) {
  const within = (/** @type {number} */ least, /** @type {number} */ most) => {
    let [low, high, beyond, farthest] = [Infinity, -Infinity, 0, 0];
    for (const values of curves) {
      for (let i = 0; i < values.length; i += 1) {
        const value = values[i];
        if (value >= least && value <= most) {
          low = value < low ? value : low;
          high = value > high ? value : high;
        } else {
          beyond += 1;
          farthest = Math.abs(value) > Math.abs(farthest) ? value : farthest;
        }
      }
    }
    return { low, high, beyond, farthest };
  };
  const all = within(-Number.MAX_VALUE, Number.MAX_VALUE);
  let shown = all;
  if (field === "overlap" && all.high > 0 && stiffness?.some(Boolean) && !restForce?.some(Boolean)) {
    // a gap, which bonds and loaded contacts need not have, may be as wide as it likes: overlaps are to be seen beside it
    shown = within(-3 * all.high, all.high);
  } else if (field === "displacement") {
    const some = curves.map((values) => values.filter((_, i) => i % Math.ceil(values.length / 2000) === 0));
    const sorted = Float64Array.from(some.flatMap((values) => [...values])).sort();
    const few = Math.floor(0.02 * sorted.length);
    const [inner, outer] = [sorted[few], sorted[sorted.length - 1 - few]];
    // beads at either end belong to what is seen as long as they are near
    const near = 0.5 * (outer - inner);
    if (near > 0 && all.high - all.low > 10 * near) {
      shown = within(inner - near, outer + near);
    }
  }
  if (!(shown.high >= shown.low)) {
    return { from: 0, to: 1, beyond: 0, farthest: 0 };
  }
  const spare = 0.06 * (shown.high - shown.low) || Math.abs(shown.high) || 1;
  return { ...shown, from: shown.low - spare, to: shown.high + spare };
}

/**
 * A curve through values; where they are denser than pixels, from the least to the largest in each.
 * @param {Float64Array} values @param {(i: number) => number} x @param {(value: number) => number} y
 * @param {number} ratio
 */
function curveOf(values, x, y, ratio) {
  const pitch = (x(1) - x(0)) * ratio;
  if (pitch >= 1) {
    return Array.from(values).flatMap((value, i) => [x(i), y(value)]);
  }
  /** @type {number[]} */
  const points = [];
  for (let i = 0; i < values.length;) {
    const pixel = Math.floor(x(i) * ratio);
    let [low, high, first] = [values[i], values[i], values[i]];
    let last = first;
    for (; i < values.length && Math.floor(x(i) * ratio) === pixel; i += 1) {
      last = values[i];
      low = Math.min(low, last);
      high = Math.max(high, last);
    }
    const middle = (pixel + 0.5) / ratio;
    points.push(middle, y(first), middle, y(low), middle, y(high), middle, y(last));
  }
  return points;
}

/**
 * Draws the profile; its x axis is that of a map in a box with the same x and width.
 * @param {Surface} surface
 * @param {Box} box
 * @param {ProfileData} data
 * @param {View} view
 * @param {Theme} theme
 */
export function drawProfile(surface, box, data, view, theme) {
  const { state, second } = data;
  const { plot: across } = plotOf(box);
  const inside = { ...across, y: box.y + 10, height: Math.max(20, box.height - 52) };
  // contacts as such have no curve
  const field = view.field === "contacts" ? "overlap" : view.field;
  const { x } = mapScales(box, view);
  const inView = view.places[1] - view.places[0];
  const strip =
    state !== undefined && inView <= MOST_BEADS + 1 && inside.height >= 90 ? Math.round(0.42 * inside.height) : 0;
  const plot = { ...inside, height: inside.height - (strip > 0 ? strip + 6 : 0) };
  /** @type {{ first: number, values: Float64Array, colour: string, dash: number[] }[]} */
  const curves = [];
  const [isRing, isSecondRing] = [data.chain, data.secondFields?.chain].map((chain) => chain?.ring !== undefined);
  if (state !== undefined) {
    curves.push({ ...valuesOf(state, field, view.places, data.fields, isRing), colour: theme.curves[0], dash: [] });
  }
  if (second !== undefined) {
    curves.push({ ...valuesOf(second, field, view.places, data.secondFields, isSecondRing), colour: theme.curves[1], dash: [6, 3] });
  }
  const { from, to, beyond, farthest } = rangeOf(
    curves.map(({ values }) => values),
    field,
    data.chain,
  );
  const [name, unit] = FIELD_LABELS[field];
  leftAxis(surface, plot, { from, to, name, unit }, theme, { hasGrid: true });
  const y = linear(from, to, plot.y + plot.height, -plot.height);
  surface.clip(plot.x, plot.y, plot.width, plot.height, () => {
    const upright = (/** @type {number} */ bead, /** @type {string} */ colour, /** @type {number[]} */ dash) => {
      const at = x(placeOfBead(bead, view));
      surface.lines([at, plot.y, at, plot.y + plot.height], { colour, width: 1, dash, crisp: true });
    };
    const impurities = view.impurities ?? [];
    if (impurities.length <= 12) {
      impurities.forEach((bead) => upright(bead, theme.muted, [5, 4]));
    }
    (view.chosen ?? []).forEach((bead) => upright(bead, theme.accent, [2, 3]));
    for (const { first, values, colour, dash } of curves) {
      const points = curveOf(values, (i) => x(first + i), y, surface.ratio);
      surface.lines(points, { colour, width: 1.5, dash });
      if (inView <= MOST_BEADS + 1) {
        values.forEach((value, i) => surface.circle(x(first + i), y(value), 2.5, { fill: colour }));
      }
    }
  });
  frame(surface, plot, theme);
  const notes = [];
  if (beyond > 0) {
    const places = `${isOfContacts(field) ? "contact" : "bead"}${beyond === 1 ? "" : "s"}`;
    notes.push(`${beyond} ${places} beyond the frame, as far as ${amount(farthest, unit, 3)}`);
  }
  if (second !== undefined) {
    notes.push(`dashed: ${data.secondName ?? "changed"}`);
  }
  notes.forEach((note, i) => {
    const size = Math.min(TICK_PX, (TICK_PX * (plot.width - 16)) / surface.textWidth(note, TICK_PX));
    surface.text(plot.x + 8, plot.y + 11 + 15 * i, note, { size, colour: theme.foreground, halo: theme.background });
  });
  if (strip > 0 && state !== undefined) {
    const band = { ...inside, y: plot.y + plot.height + 6, height: strip };
    drawBeads(surface, band, state, data, view, x, theme);
    frame(surface, band, theme);
    bottomAxis(surface, box, band, placesOf(view), theme);
  } else {
    bottomAxis(surface, box, plot, placesOf(view), theme);
  }
}

/**
 * Places of drawn beads: circles of radius ∝ m^(1/3) side by side at rest, moved together and apart as overlaps and gaps change,
 * and as much larger as contacts overlap at rest.
 * @param {State} state @param {ProfileData} data @param {View} view
 */
function arranged({ u }, { chain }, view) {
  const [from, to] = beadsOf(view);
  const first = Math.max(0, Math.floor(from) - 1);
  const last = Math.min(u.length - 1, Math.ceil(to) + 1);
  const count = last - first + 1;
  const radii = Float64Array.from({ length: count }, (_, i) => Math.cbrt(chain.mass[first + i]));
  const sum = radii.reduce((total, radius) => total + radius, 0);
  radii.forEach((radius, i) => {
    radii[i] = (0.5 * radius * count) / sum; // so that they fill the places that they have
  });
  const restOf = (/** @type {number} */ i) => chain.restOverlap[first + i] ?? 0;
  const overlaps = Float64Array.from(
    { length: Math.max(0, count - 1) },
    (_, i) => u[first + i] - u[first + i + 1] + restOf(i),
  );
  const isSeen = (/** @type {number} */ bead) => bead >= from - 0.5 && bead <= to + 0.5;
  const seen = overlaps.filter((_, i) => isSeen(first + i) && isSeen(first + i + 1));
  const most = seen.reduce((most, overlap) => Math.max(most, overlap), 0);
  const widest = seen.reduce((widest, overlap) => Math.max(widest, -overlap), 0);
  // metres that are drawn as one place; a gap is drawn up to half a place
  const metres = Math.max(most, Math.min(widest, most > 1e-3 * widest ? 2 * most : widest)) / 0.4;
  const places = new Float64Array(Math.max(0, count));
  const drawn = (/** @type {number} */ overlap) => (metres > 0 ? Math.min(Math.max(overlap / metres, -0.5), 0.5) : 0);
  for (let i = 1; i < count; i += 1) {
    places[i] = places[i - 1] + radii[i - 1] + radii[i] + drawn(restOf(i - 1)) - drawn(overlaps[i - 1]);
  }
  const isCut = metres > 0 && widest / metres > 0.5;
  // the middle of what is in view stays where it is
  const shift = places.reduce((total, place, i) => total + first + i - place, 0) / Math.max(1, count);
  const wide = radii.map((radius, i) => radius + 0.25 * (drawn(restOf(i - 1)) + drawn(restOf(i))));
  return { first, isSeen, radii: wide, overlaps, metres, isCut, places: places.map((place) => place + shift) };
}

/**
 * @param {Surface} surface @param {Box} band @param {State} state @param {ProfileData} data @param {View} view
 * @param {(place: number) => number} x @param {Theme} theme
 */
function drawBeads(surface, band, state, data, view, x, theme) {
  const { first, isSeen, radii, overlaps, metres, isCut, places } = arranged(state, data, view);
  const pitch = x(1) - x(0);
  const at = (/** @type {number} */ i) => x(placeOfBead(places[i], view));
  const LINE = 16; // of text below
  const middle = band.y + (band.height - LINE) / 2;
  const forces = overlaps.map((overlap, i) => Math.abs(data.fields?.force(first + i, overlap) ?? 0));
  const strongest = forces.reduce(
    (most, force, i) => (isSeen(first + i) && isSeen(first + i + 1) ? Math.max(most, force) : most),
    0,
  );
  const fastest = places.reduce(
    (most, _, i) => (isSeen(first + i) ? Math.max(most, Math.abs(state.v[first + i])) : most),
    0,
  );
  const impurities = new Set(view.impurities);
  const chosen = new Set(view.chosen);
  const tall = (band.height - LINE) / 2 - 2;
  surface.clip(band.x, band.y, band.width, band.height - LINE, () => {
    places.forEach((_, i) => {
      const colour = impurities.has(first + i) ? theme.impurity : theme.curves[0];
      surface.circle(at(i), middle, radii[i] * pitch, { fill: veiled(colour), colour, width: 1.2 });
    });
    places.forEach((_, i) => {
      if (chosen.has(first + i)) {
        surface.circle(at(i), middle, radii[i] * pitch, { colour: theme.accent, width: 2.5 });
      }
    });
    forces.forEach((force, i) => {
      const high = strongest > 0 ? Math.min(1, force / strongest) * tall : 0;
      if (high > 0.5) {
        const between = 0.5 * (at(i) + radii[i] * pitch + at(i + 1) - radii[i + 1] * pitch);
        surface.lines([between, middle - high, between, middle + high], {
          colour: theme.force,
          width: Math.min(4, 0.25 * pitch),
        });
      }
    });
    places.forEach((_, i) => {
      const long = (state.v[first + i] / (fastest || Infinity)) * Math.max(1.2 * pitch, 16);
      if (Math.abs(long) > 4) {
        drawArrow(surface, at(i), middle, long, theme.foreground);
      }
    });
  });
  const notes =
    metres > 0
      ? [`a bead's width = ${amount(metres, "m", 2)} of overlap or gap${isCut ? ", longer gaps cut" : ""}`]
      : [];
  if (strongest > 0) {
    notes.push(`bar: force, up to ${amount(strongest, "N", 3)}`);
  }
  if (fastest > 0) {
    notes.push(`arrow: velocity, up to ${amount(fastest, "m/s", 3)}`);
  }
  while (notes.length > 1 && surface.textWidth(notes.join("; "), TICK_PX) > band.width - 12) {
    notes.pop();
  }
  const note = notes.join("; ");
  const size = Math.min(TICK_PX, (TICK_PX * (band.width - 12)) / Math.max(1, surface.textWidth(note, TICK_PX)));
  surface.text(band.x + 6, band.y + band.height - LINE / 2, note, { size, colour: theme.muted });
}

/** A colour through which others are seen. */
const veiled = (/** @type {string} */ colour) => `${colour}55`;

/** @param {Surface} surface @param {number} x @param {number} y @param {number} long @param {string} colour */
function drawArrow(surface, x, y, long, colour) {
  const head = Math.min(6, 0.6 * Math.abs(long)) * Math.sign(long);
  const wide = Math.abs(head) * 0.6;
  surface.lines([x, y, x + long - head, y], { colour, width: 1.5 });
  surface.area([x + long, y, x + long - head, y - wide, x + long - head, y + wide], colour);
}
