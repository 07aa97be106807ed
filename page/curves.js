// Curves over time: energies, and the motion of followed beads.

import { ENERGY_COUNT } from "./fields.js";
import { curveCount } from "./rows.js";
import { LEFT_PX, TICK_PX, bottomAxis, frame, leftAxis, legend, linear } from "./axes.js";

/** @typedef {import("./surface.js").Box} Box */
/** @typedef {import("./surface.js").Surface} Surface */
/** @typedef {import("./colours.js").Theme} Theme */
/** @typedef {import("./map.js").View} View */
/** @typedef {import("./types.d.ts").Rows} Rows */
/**
 * Rows of a run, and of a second one, which is dashed; its steps may be of another length.
 * @typedef {object} CurvesData
 * @property {Rows | undefined} rows
 * @property {Rows | undefined} [second]
 * @property {number} [second_dt_s]
 * @property {string} [secondName]
 * @property {string} [splitName] what the bead between left and right is called
 * @property {import("./types.d.ts").Event[]} [events] of followed beads
 * @property {string} [leftOut] what the curves leave out
 */
/** x (in the unit of its axis) and value in turns. */
/** @typedef {{ points: Float64Array, colour: string, dash?: number[] }} Curve */


/** Box of the plot of energies in a box, or of both plots of a trajectory. @param {Box} box */
export function curvePlot({ x, y, width, height }, top = 8) {
  return {
    x: x + LEFT_PX,
    y: y + top,
    width: Math.max(20, width - LEFT_PX - 16),
    height: Math.max(20, height - top - 42),
  };
}

/**
 * A curve through rows, from the least to the largest value in each: which of both comes first is the one that is nearer
 * to where the curve is.
 * @param {Rows} rows @param {number} dt @param {number} column of `lows` and `highs`
 */
function pointsOf({ steps, count, lows, highs, request }, dt, column) {
  const wide = curveCount(request.follow);
  const points = [];
  let at = NaN;
  for (let i = 0; i < count; i += 1) {
    const [low, high] = [lows[i * wide + column], highs[i * wide + column]];
    const isUp = !(Math.abs(at - high) < Math.abs(at - low));
    points.push(steps[i] * dt, isUp ? low : high);
    if (low !== high) {
      const next = i + 1 < count ? steps[i + 1] : steps[i];
      points.push(0.5 * (steps[i] + next) * dt, isUp ? high : low);
    }
    at = isUp ? high : low;
  }
  return Float64Array.from(points);
}

/** The part of a live run whose steps may still be looked at before that is said. */
const NEWEST_PART = 0.05;

/**
 * Steps that a curve leaves out, in a few words; "" if every step was computed.
 * @param {Rows | undefined} rows @param {import("./types.d.ts").Info | undefined} info
 */
export function leftOut(rows, info) {
  if (rows === undefined || info === undefined || rows.count < 2) {
    return "";
  }
  const { steps, count, seen } = rows;
  const apart = Math.round((steps[count - 1] - steps[0]) / (count - 1));
  if (!info.recomputes) {
    return seen >= steps[count - 1] ? "extremes of the recorded states" : `a recorded state every ${apart} steps`;
  }
  // the newest steps of a live run are looked at as it goes on
  const newest = info.kind === "live" ? NEWEST_PART * (steps[count - 1] - steps[0]) : 0;
  if (seen >= steps[count - 1] - newest) {
    return "";
  }
  const samples = `a sample every ${apart} steps`;
  return seen < 0 ? samples : `${samples} beyond step ${seen}: others are being looked at`;
}

/** @param {View} view */
function timeOf({ steps: [from, to], dt_s: dt }) {
  return dt === undefined
    ? { from, to, name: "step", whole: true }
    : { from: from * dt, to: to * dt, name: "time", unit: "s", prefixed: true };
}

/**
 * One plot of curves over time, with the cursor.
 * @param {Surface} surface @param {Box} box @param {Box} plot @param {Curve[]} curves
 * @param {{ name: string, unit: string, hasZero?: boolean, isBare?: boolean, marks?: number[], note?: string }} look
 * @param {View} view @param {Theme} theme
 */
function drawCurves(
  surface,
  box,
  plot,
  curves,
  { name, unit, hasZero = false, isBare = false, marks = [], note = "" },
  view,
  theme,
) {
  const time = timeOf(view);
  let [low, high] = hasZero ? [0, 0] : [Infinity, -Infinity];
  const near = 0.02 * (time.to - time.from);
  for (const { points } of curves) {
    for (let i = 0; i < points.length; i += 2) {
      const value = points[i + 1];
      if (Number.isFinite(value) && points[i] >= time.from - near && points[i] <= time.to + near) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
  }
  if (!(high >= low)) {
    [low, high] = [0, 1];
  }
  const spare = 0.06 * (high - low) || Math.abs(high) || 1;
  const [from, to] = [hasZero && low === 0 ? 0 : low - spare, high + spare];
  leftAxis(surface, plot, { from, to, name, unit }, theme, { hasGrid: true });
  const x = linear(time.from, time.to, plot.x, plot.width);
  const y = linear(from, to, plot.y + plot.height, -plot.height);
  surface.clip(plot.x, plot.y, plot.width, plot.height, () => {
    for (const { points, colour, dash } of curves) {
      surface.lines(
        points.map((number, i) => (i % 2 === 0 ? x(number) : y(number))),
        { colour, width: 1.5, dash },
      );
    }
    for (let i = 0; i < marks.length; i += 2) {
      surface.circle(x(marks[i]), y(marks[i + 1]), 3, { fill: theme.background, colour: theme.accent, width: 1.5 });
    }
    if (view.cursor !== undefined) {
      const at = x(view.cursor * (view.dt_s ?? 1));
      surface.lines([at, plot.y, at, plot.y + plot.height], { colour: theme.accent, width: 1, crisp: true });
    }
  });
  const size = Math.min(TICK_PX, (TICK_PX * (plot.width - 12)) / Math.max(1, surface.textWidth(note, TICK_PX)));
  surface.text(plot.x + 6, plot.y + 0.3 * plot.height, note, { size, colour: theme.foreground, halo: theme.background });
  frame(surface, plot, theme);
  bottomAxis(surface, box, plot, time, theme, { isBare });
}

/**
 * Energies over time: total, its kinetic and potential parts, left of the split bead, of it and right, and what was
 * dissipated, and what drives have done, where anything was.
 * @param {Surface} surface
 * @param {Box} box
 * @param {CurvesData} data
 * @param {View} view
 * @param {Theme} theme
 */
export function drawEnergies(
  surface,
  box,
  { rows, second, second_dt_s: secondDt, secondName, splitName = "split bead", leftOut: note = "" },
  view,
  theme,
) {
  const [blue, vermillion, green, purple, orange, sky] = theme.curves;
  const has = (/** @type {Rows | undefined} */ some, /** @type {number} */ part) => {
    const wide = curveCount(some?.request.follow ?? []);
    for (let i = 0; some !== undefined && i < some.count; i += 1) {
      if (some.lows[i * wide + part] !== 0 || some.highs[i * wide + part] !== 0) {
        return true;
      }
    }
    return false;
  };
  /** @type {{ name: string, colour: string, part: number }[]} */
  const kinds = [
    { name: "kinetic", colour: sky, part: 0 },
    { name: "potential", colour: orange, part: 1 },
    { name: "left", colour: blue, part: 2 },
    { name: splitName, colour: purple, part: 3 },
    { name: "right", colour: vermillion, part: 4 },
    ...(has(rows, 5) || has(second, 5) ? [{ name: "dissipated", colour: green, part: 5 }] : []),
    ...(has(rows, 6) || has(second, 6) ? [{ name: "driven", colour: theme.muted, part: 6 }] : []),
    { name: "total", colour: theme.foreground, part: 7 },
  ];
  const dt = view.dt_s ?? 1;
  /** @type {Curve[]} */
  const curves = [];
  const add = (/** @type {Rows | undefined} */ some, /** @type {number} */ dt, /** @type {number[]} */ dash) => {
    for (const { colour, part } of some === undefined ? [] : kinds) {
      curves.push({ points: pointsOf(/** @type {Rows} */ (some), dt, part), colour, dash });
    }
  };
  add(second, secondDt ?? dt, [5, 3]);
  add(rows, dt, []);
  const entries = kinds.map(({ name, colour }) => ({ name, colour }));
  const top = drawLegend(surface, box, entries, second !== undefined, theme, secondName);
  const look = { name: "energy", unit: "J", hasZero: true, note };
  drawCurves(surface, box, curvePlot(box, top), curves, look, view, theme);
}

/**
 * A legend above a plot; returns where the plot may begin.
 * @param {Surface} surface @param {Box} box
 * @param {{ name: string, colour: string, dash?: number[], isCircle?: boolean }[]} entries
 * @param {boolean} hasSecond @param {Theme} theme @param {string} [secondName]
 */
function drawLegend(surface, box, entries, hasSecond, theme, secondName = "changed") {
  const all = hasSecond ? [...entries, { name: secondName, colour: theme.muted, dash: [5, 3] }] : entries;
  return (
    4 + legend(surface, { x: box.x + LEFT_PX, y: box.y + 2, width: box.width - LEFT_PX - 8, height: 0 }, all, theme) + 4
  );
}

/**
 * Displacement and velocity of the followed beads over time, with what happened to them.
 * @param {Surface} surface
 * @param {Box} box
 * @param {CurvesData} data
 * @param {View} view
 * @param {Theme} theme
 */
export function drawTrajectories(
  surface,
  box,
  { rows, second, second_dt_s: secondDt, secondName, events = [], leftOut: note = "" },
  view,
  theme,
) {
  const follow = rows?.request.follow ?? [];
  const colours = theme.curves.slice(0, 6);
  const colourOf = (/** @type {number} */ i) => colours[i % colours.length];
  const circle = { name: "a contact opens or closes, or the bead turns", colour: theme.accent, isCircle: true };
  const entries = [
    ...follow.map((bead, i) => ({ name: `bead ${bead}`, colour: colourOf(i) })),
    ...(events.length > 0 ? [circle] : []),
  ];
  const top = drawLegend(surface, box, entries, second !== undefined, theme, secondName);
  const whole = curvePlot(box, top);
  const high = (whole.height - 8) / 2;
  const dt = view.dt_s ?? 1;
  [
    { name: "displacement", unit: "m" },
    { name: "velocity", unit: "m/s" },
  ].forEach((look, part) => {
    /** @type {Curve[]} */
    const curves = [];
    const add = (/** @type {Rows | undefined} */ some, /** @type {number} */ dt, /** @type {number[]} */ dash) => {
      some?.request.follow.forEach((bead, i) => {
        const rank = follow.indexOf(bead);
        if (rank >= 0) {
          curves.push({
            points: pointsOf(some, dt, ENERGY_COUNT + 2 * i + part),
            colour: colourOf(rank),
            dash,
          });
        }
      });
    };
    add(second, secondDt ?? dt, [5, 3]);
    add(rows, dt, []);
    const plot = { ...whole, y: whole.y + part * (high + 8), height: high };
    const seen = part === 0 ? events.filter(({ bead }) => follow.includes(bead)) : [];
    const marks = seen.flatMap(({ step, u_m: u }) => [step * dt, u]);
    drawCurves(surface, box, plot, curves, { ...look, isBare: part === 0, marks, note: part === 0 ? note : "" }, view, theme);
  });
}
