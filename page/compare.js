// Runs of a table beside each other: a plot of one of their numbers over another, and which of them are looked at.

import { LEFT_PX, bottomAxis, frame, leftAxis, legend, linear } from "./axes.js";
import { theme } from "./colours.js";
import { make } from "./elements.js";
import { CanvasSurface } from "./surface.js";

/** @typedef {Record<string, number | string>} Traits */
/** @typedef {{ traits: Traits, name: string, open: () => void }} Compared */

/** Units as names of columns end with them, the longest of those that fit first. */
const UNITS = Object.entries({
  ...{ beads_per_s: "beads/s", rad_per_s: "rad/s", n_per_m: "N/m", n_per_m3: "N/m³", n_s_per_m: "N·s/m", kg_m3: "kg/m³" },
  ...{ m_s2: "m/s²", beads2: "beads²", kg_m_s: "kg·m/s", n_s: "N·s", m_s: "m/s", beads_s: "beads/s", per_s: "1/s", per_m: "1/m" },
  ...{ beads: "beads", kg: "kg", rad: "rad", hz: "Hz", pa: "Pa", j: "J", w: "W", k: "K", n: "N", m: "m", s: "s" },
});

/**
 * The name of a column and its unit, as a path or a name says them, with the place that may follow.
 * @param {string} path
 * @returns {[string, string]}
 */
export function nameAndUnit(path) {
  const [column, place] = path.split("@");
  const found = UNITS.find(([end]) => column.toLowerCase().endsWith(`_${end}`));
  const name = found ? column.slice(0, -1 - found[0].length) : column;
  const words = name.replace(/\.0\b|\[0\]/g, "").replace(/[._]/g, " ").replace(/^chain /, "");
  return [words + (place ? ` at ${place}` : ""), found?.[1] ?? ""];
}

/** @param {string} path */
export function title(path) {
  const [name, unit] = nameAndUnit(path);
  return unit ? `${name} (${unit})` : name;
}

/** A comparison of a filter: name, sign, value. */
const COMPARISON = /^(.+?)(<=|>=|!=|=|<|>)(.+)$/;

/** The columns that a name in a filter stands for: that of this name, or all with it inside. @param {string} name @param {string[]} columns */
function columnsOf(name, columns) {
  return columns.includes(name) ? [name] : columns.filter((one) => one.includes(name));
}

/** Why comparisons of a filter choose nothing; "" if each is of one column. @param {string} filter @param {string[]} columns */
export function unclear(filter, columns) {
  const names = filter.split(/\s+/).flatMap((word) => COMPARISON.exec(word)?.[1] ?? []);
  const name = names.find((one) => columnsOf(one, columns).length !== 1);
  if (name === undefined) {
    return "";
  }
  const found = columnsOf(name, columns);
  const few = `${found.slice(0, 4).join(", ")}${found.length > 4 ? ", …" : ""}`;
  return found.length > 0 ? `${name} is in the names of ${found.length} columns: write all of one (${few}).` : `No column has ${name} in its name.`;
}

/**
 * True if a filter asks for a run: the filter has words that the run's name or a value has, and comparisons such as
 * `alpha>=1.5`; all of them must hold.
 * @param {string} filter
 * @param {Compared} run
 * @param {string[]} [columns] those of all runs
 */
export function passes(filter, { traits, name }, columns = Object.keys(traits)) {
  return filter
    .split(/\s+/)
    .filter(Boolean)
    .every((word) => {
      const asked = COMPARISON.exec(word);
      if (!asked) {
        return [name, ...Object.values(traits)].some((value) => `${value}`.toLowerCase().includes(word.toLowerCase()));
      }
      const [, column, sign, text] = asked;
      const found = columnsOf(column, columns);
      const value = found.length === 1 ? traits[found[0]] : undefined;
      const order = typeof value === "number" ? value - Number(text) : `${value}`.localeCompare(text);
      const isEqual = typeof value === "number" ? order === 0 : `${value}` === text;
      const holds = { "=": isEqual, "!=": !isEqual, "<": order < 0, ">": order > 0, "<=": order <= 0, ">=": order >= 0 };
      return value !== undefined && holds[/** @type {keyof typeof holds} */ (sign)];
    });
}

/** Groups that have a colour of their own, and are named. */
const MOST_GROUPS = 6;

/**
 * Points of a plot in groups: runs that differ in nothing that was swept but the quantity to the right.
 * @param {Compared[]} runs @param {string} x @param {string} y @param {string[]} keys
 */
function groupsOf(runs, x, y, keys) {
  const others = keys.filter((key) => key !== x && key !== y);
  /** @type {Map<string, [number, number, Compared][]>} */
  const groups = new Map();
  for (const run of runs) {
    const [right, up] = [run.traits[x], run.traits[y]];
    if (typeof right === "number" && typeof up === "number") {
      const name = others.map((key) => `${title(key)} ${run.traits[key] ?? "–"}`).join(", ");
      groups.set(name, [...(groups.get(name) ?? []), [right, up, run]]);
    }
  }
  groups.forEach((points) => points.sort((a, b) => a[0] - b[0]));
  return [...groups];
}

/** @param {number[]} values @returns {[number, number]} */
function span(values) {
  const [low, high] = values.reduce(([least, most], value) => [Math.min(least, value), Math.max(most, value)], [
    Infinity,
    -Infinity,
  ]);
  const spare = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
  return low <= high ? [low - spare, high + spare] : [0, 1];
}

/**
 * Draws one column over another; returns where each run is.
 * @param {import("./surface.js").Surface} surface @param {number} width @param {number} height
 * @param {ReturnType<typeof groupsOf>} groups @param {string} x @param {string} y @param {import("./colours.js").Theme} colours
 * @param {boolean} isSwept whether x was swept: then runs that differ in it alone are joined
 */
function draw(surface, width, height, groups, x, y, colours, isSwept) {
  const colourOf = (/** @type {number} */ i) => (groups.length > MOST_GROUPS ? colours.curves[0] : colours.curves[i]);
  const isNamed = groups.length > 1 && groups.length <= MOST_GROUPS;
  const entries = isNamed ? groups.map(([name], i) => ({ name, colour: colourOf(i) })) : [];
  const top = 8 + legend(surface, { x: LEFT_PX, y: 2, width: width - LEFT_PX - 8, height: 0 }, entries, colours);
  const plot = { x: LEFT_PX, y: top, width: width - LEFT_PX - 16, height: height - top - 42 };
  const points = groups.flatMap(([, found]) => found);
  const quantity = (/** @type {string} */ path, /** @type {[number, number]} */ [from, to]) => {
    const [name, unit] = nameAndUnit(path);
    return { from, to, name, unit };
  };
  const across = quantity(x, span(points.map(([right]) => right)));
  const up = quantity(y, span(points.map(([, high]) => high)));
  leftAxis(surface, plot, up, colours, { hasGrid: true });
  bottomAxis(surface, { x: 0, y: 0, width, height }, plot, across, colours);
  const toX = linear(across.from, across.to, plot.x, plot.width);
  const toY = linear(up.from, up.to, plot.y + plot.height, -plot.height);
  /** @type {{ x: number, y: number, run: Compared }[]} */
  const placed = [];
  groups.forEach(([, found], i) => {
    const line = found.flatMap(([right, high]) => [toX(right), toY(high)]);
    const isOneOver = new Set(found.map(([right]) => right)).size === found.length;
    if (isSwept && isOneOver && groups.length <= MOST_GROUPS) {
      surface.lines(line, { colour: colourOf(i), width: 1.2 });
    }
    found.forEach(([right, high, run]) => {
      surface.circle(toX(right), toY(high), 3.5, { fill: colourOf(i) });
      placed.push({ x: toX(right), y: toY(high), run });
    });
  });
  frame(surface, plot, colours);
  return placed;
}

/**
 * A plot of any column over any other, of those runs that are looked at. `show` draws it anew.
 * @param {string[]} columns with numbers
 * @param {string[]} keys what was swept
 * @param {() => boolean} isDark
 */
export function comparison(columns, keys, isDark) {
  const options = () => columns.map((column) => make("option", { value: column }, title(column)));
  const across = make("select", { "aria-label": "column to the right" }, ...options());
  const up = make("select", { "aria-label": "column upward" }, ...options());
  across.value = columns.find((column) => keys.includes(column)) ?? columns[0];
  up.value = columns.find((column) => !keys.includes(column) && column !== across.value) ?? columns[0];
  const canvas = make("canvas", { role: "img", class: "comparison" });
  /** @type {Compared[]} */
  let runs = [];
  /** @type {ReturnType<typeof draw>} */
  let placed = [];
  const show = (/** @type {Compared[]} */ looked = runs) => {
    runs = looked;
    const [width, height, ratio] = [canvas.clientWidth, canvas.clientHeight, devicePixelRatio || 1];
    if (width < 2 || height < 2) {
      return;
    }
    Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    const groups = groupsOf(runs, across.value, up.value, keys);
    const surface = new CanvasSurface(context, width, height, ratio);
    placed = draw(surface, width, height, groups, across.value, up.value, theme(isDark()), keys.includes(across.value));
    const left = runs.length - placed.length;
    const words = `${title(up.value)} over ${title(across.value)}: ${placed.length} runs${left ? `, ${left} without a value` : ""}`;
    canvas.setAttribute("aria-label", words);
    said.textContent = words;
  };
  const said = make("span", { class: "words" });
  const near = (/** @type {MouseEvent} */ { offsetX, offsetY }) => {
    const far = (/** @type {Record<"x" | "y", number>} */ { x, y }) => Math.hypot(x - offsetX, y - offsetY);
    const [found] = [...placed].sort((a, b) => far(a) - far(b));
    return found && far(found) < 12 ? found.run : undefined;
  };
  canvas.addEventListener("mousemove", (event) => {
    canvas.title = near(event)?.name ?? "";
  });
  canvas.addEventListener("click", (event) => near(event)?.open());
  [across, up].forEach((select) => select.addEventListener("change", () => show()));
  new ResizeObserver(() => show()).observe(canvas);
  const element = make("div", { class: "compare" }, make("div", { class: "row" }, up, " over ", across, " ", said), canvas);
  return { element, show };
}
