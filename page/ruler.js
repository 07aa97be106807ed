// A ruler on the map: from a bead and a step to another, its slope a speed.

import { TICK_PX, amount } from "./axes.js";
import { mapScales, placeOfBead } from "./map.js";

/** @typedef {[number, number, number, number]} Ruler bead and step of both ends, real numbers */
/** @typedef {import("./types.d.ts").Physics} Physics */

/** Digits that a pointer on a screen decides. */
const DIGITS = 3;

/** True if a seed has changed these values. @param {Physics} physics @param {string} what */
function isDisordered({ disorder = [] }, what) {
  return disorder.some(({ of }) => of === what);
}

/**
 * Distance of the centres of two spheres (m), at rest and just touching; undefined where beads have no size. Radii that a seed
 * has changed follow from masses.
 * @param {Physics} physics
 * @param {ArrayLike<number>} mass of each bead (kg)
 * @param {number} from a bead, of real number
 * @param {number} to
 */
export function distanceM(physics, mass, from, to) {
  const { beads, spheres, odd_spheres: odd = [] } = physics;
  if (spheres === undefined) {
    return undefined;
  }
  const inTurn = Array.isArray(spheres) ? spheres : [spheres];
  const byMass = isDisordered(physics, "radii") && !isDisordered(physics, "masses");
  const radius = (/** @type {number} */ bead) => {
    const sphere = odd.find((one) => one.bead === bead) ?? inTurn[bead % inTurn.length];
    return byMass ? Math.cbrt((0.75 * mass[bead]) / (Math.PI * sphere.density_kg_m3)) : sphere.radius_m;
  };
  const place = (/** @type {number} */ at) => {
    const last = Math.min(Math.max(Math.floor(at), 0), beads - 2);
    let sum = 0;
    for (let bead = 0; bead < last; bead += 1) {
      sum += radius(bead) + radius(bead + 1);
    }
    return sum + (at - last) * (radius(last) + radius(last + 1));
  };
  return place(to) - place(from);
}

/**
 * Measures of a ruler: beads, time (s), beads/s, and m/s where beads have a size.
 * @param {Ruler} ruler
 * @param {Physics} physics
 * @param {ArrayLike<number>} mass
 */
export function measured([bead0, step0, bead1, step1], physics, mass) {
  const time_s = (step1 - step0) * physics.dt_s;
  const metres = distanceM(physics, mass, bead0, bead1);
  return {
    beads: bead1 - bead0,
    time_s,
    beads_per_s: (bead1 - bead0) / time_s,
    m_per_s: metres === undefined ? undefined : metres / time_s,
  };
}

/** A number of a few digits, with a true minus sign. @param {number} value @param {string} unit */
function few(value, unit) {
  return amount(value, unit, DIGITS);
}

/**
 * Text at a ruler, in two lines.
 * @param {Ruler} ruler
 * @param {Physics} physics
 * @param {ArrayLike<number>} mass
 */
export function rulerWords(ruler, physics, mass) {
  const { beads, time_s, beads_per_s: rate, m_per_s: speed } = measured(ruler, physics, mass);
  if (beads === 0 && time_s === 0) {
    return ["drag over the map", ""];
  }
  // where a seed has changed masses, too, radii are those of the rule in the mean
  const about = ["radii", "masses"].every((what) => isDisordered(physics, what)) ? "≈ " : "";
  const metres = speed === undefined ? "" : ` = ${about}${few(speed, "m/s")}`;
  return [
    time_s === 0 ? "at one time" : `${few(rate, "beads/s")}${metres}`,
    `${few(beads, "beads")} in ${few(time_s, "s")}`,
  ];
}

/**
 * Draws a ruler on a map.
 * @param {import("./surface.js").Surface} surface
 * @param {import("./surface.js").Box} box
 * @param {import("./map.js").View} view of the map
 * @param {Ruler} ruler
 * @param {number} factor steps of this map for a step of the ruler
 * @param {import("./types.d.ts").Info} info of the run
 * @param {import("./colours.js").Theme} theme
 */
export function drawRuler(surface, box, view, ruler, factor, { manifest, chain }, theme) {
  const { plot, x, y } = mapScales(box, view);
  const [x0, x1] = [ruler[0], ruler[2]].map((bead) => x(placeOfBead(bead, view)));
  const [y0, y1] = [ruler[1], ruler[3]].map((step) => y(step * factor));
  const { accent: colour, background } = theme;
  surface.clip(plot.x, plot.y, plot.width, plot.height, () => {
    surface.lines([x0, y0, x1, y1], { colour: background, width: 5 });
    surface.lines([x0, y0, x1, y1], { colour, width: 2 });
    surface.circle(x0, y0, 4, { fill: background, colour, width: 2 });
    surface.circle(x1, y1, 4, { fill: background, colour, width: 2 });
  });
  const words = rulerWords(ruler, manifest.physics, chain.mass).filter(Boolean);
  const size = TICK_PX + 1;
  const width = Math.max(...words.map((text) => surface.textWidth(text, size, true))) + 12;
  const height = 17 * words.length + 6;
  // beside the middle of the line, where that is in the plot, and not on it
  const left = within((x0 + x1) / 2 + 10, plot.x + 4, plot.x + plot.width - width - 4);
  const isFalling = (x1 - x0) * (y1 - y0) >= 0;
  const top = within((y0 + y1) / 2 + (isFalling ? -height - 6 : 6), plot.y + 4, plot.y + plot.height - height - 4);
  surface.rect(left, top, width, height, background);
  surface.lines([left, top, left + width, top, left + width, top + height, left, top + height, left, top], { colour });
  words.forEach((text, i) => {
    surface.text(left + 6, top + 12 + 17 * i, text, { size, colour: theme.foreground, bold: i === 0 });
  });
}

/** @param {number} value @param {number} least @param {number} most */
function within(value, least, most) {
  return Math.max(Math.min(value, most), least);
}
