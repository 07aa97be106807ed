// Round numbers along an axis, numbers with units, and the axes themselves.

/** @typedef {import("./surface.js").Box} Box */
/** @typedef {import("./surface.js").Surface} Surface */
/** @typedef {import("./colours.js").Theme} Theme */
/**
 * Quantity of an axis: `whole` has no ticks between integers, `prefixed` always takes a prefix.
 * @typedef {{ from: number, to: number, name: string, unit?: string, whole?: boolean, prefixed?: boolean }} Quantity
 */
/**
 * Round values, what is written at them, smaller ticks, and the label of the axis.
 * @typedef {{ values: number[], labels: string[], minor: number[], label: string }} Ticks
 */

const PREFIXES = new Map([
  [-15, "f"],
  [-12, "p"],
  [-9, "n"],
  [-6, "µ"],
  [-3, "m"],
  [0, ""],
  [3, "k"],
  [6, "M"],
  [9, "G"],
]);
const PREFIXABLE = /^(?:m|s|g|N|J|Pa|Hz)(?![A-Za-z²³⁻^])[^^ᵅ]*$/;
const DIGITS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

const raised = (/** @type {number} */ n) =>
  String(n)
    .replace("-", "⁻")
    .replace(/\d/g, (digit) => DIGITS[Number(digit)]);

/** A number with a true minus sign. @param {number} value @param {number} decimals */
export function signed(value, decimals) {
  const digits = Math.abs(value).toFixed(Math.min(decimals, 20));
  return value < 0 && /[1-9]/.test(digits) ? `−${digits}` : digits;
}

/** A power of ten of either sign. */
export function powerLabel(/** @type {number} */ power, isNegative = false) {
  return `${isNegative ? "−" : ""}10${raised(power)}`;
}

/** A unit that is 10^`exponent` times as large: with a prefix where there is one. */
function scaledUnit(/** @type {string} */ unit, /** @type {number} */ exponent) {
  if (exponent === 0) {
    return unit;
  }
  const isLong = unit === "s" && exponent > 0;
  const prefix = PREFIXABLE.test(unit) && !isLong ? PREFIXES.get(exponent) : undefined;
  return prefix === undefined ? `10${raised(exponent)} ${unit}`.trim() : prefix + unit;
}

/**
 * A label whose unit carries the factor of the numbers.
 * @param {string} name
 * @param {string} unit
 * @param {number} exponent
 */
export function labelled(name, unit, exponent = 0) {
  const written = scaledUnit(unit, exponent);
  return written === "" ? name : `${name} (${written})`;
}

/** 1, 2 or 5 times a power of ten, the nearest by ratio: its mantissa and power. */
function roundStep(/** @type {number} */ size) {
  const power = Math.floor(Math.log10(size));
  const excess = size / 10 ** power;
  const mantissa = excess < Math.SQRT2 ? 1 : excess < Math.sqrt(10) ? 2 : excess < Math.sqrt(50) ? 5 : 10;
  return mantissa === 10 ? { mantissa: 1, power: power + 1 } : { mantissa, power };
}

/** 10^power times an integer or a small one: exact where a product is not. */
const times10 = (/** @type {number} */ x, /** @type {number} */ power) =>
  power < 0 ? x / 10 ** -power : x * 10 ** power;

/** Multiples of a step in a range, at most 1000; one that is nearly in it counts. */
function multiples(
  /** @type {number} */ from,
  /** @type {number} */ to,
  /** @type {number} */ factor,
  /** @type {number} */ power,
) {
  const unseen = 1.2e-3 * (to - from);
  const step = times10(factor, power);
  const values = [];
  for (let i = Math.ceil((from - unseen) / step); i * step <= to + unseen && values.length < 1000; i += 1) {
    values.push(times10(i * factor, power));
  }
  return values;
}

/** The power of ten, a multiple of 3, that makes numbers short. */
const thousands = (/** @type {number} */ largest) => 3 * Math.floor(Math.log10(largest) / 3 + 1e-9);

/**
 * About `count` round values.
 * @param {Quantity} quantity
 * @param {number} count
 * @returns {Ticks}
 */
export function ticks({ from, to, name, unit = "", whole = false, prefixed = false }, count) {
  if (!(to > from) || !Number.isFinite(to - from)) {
    return { values: [], labels: [], minor: [], label: labelled(name, unit) };
  }
  let step = roundStep((to - from) / Math.max(1, count));
  if (whole && step.power < 0) {
    step = { mantissa: 1, power: 0 };
  }
  // far from 0 and close together, numbers count from a round one that the label names
  const largest = Math.max(Math.abs(from), Math.abs(to));
  const isFar = !whole && largest > 2000 * (to - from);
  const coarse = Math.ceil(Math.log10(to - from));
  const base = isFar ? times10(Math.floor(from / 10 ** coarse), coarse) : 0;
  const reach = isFar ? to - base : largest;
  const usual = roundStep((to - from) / 4);
  let exponent = 0;
  if (prefixed || unit === "m" || unit === "J" || isFar || reach >= 1e5 || usual.power < -2) {
    exponent = thousands(reach);
  }
  if (((unit === "s" && exponent > 0) || whole) && reach < 1e6) {
    exponent = 0;
  }
  const decimals = Math.max(0, exponent - step.power);
  const values = multiples(from, to, step.mantissa, step.power);
  const parts = step.mantissa === 2 ? 4 : 5;
  const divided = step.mantissa === 2 ? 5 : step.mantissa === 5 ? 10 : 2;
  const hasMinor = !whole || step.power > 0 || (step.mantissa === 5 && step.power === 0);
  return {
    values,
    labels: values.map((value) => signed(times10(value - base, -exponent), decimals)),
    minor: hasMinor && parts > 1 ? multiples(from, to, divided, step.power - 1) : [],
    label: labelled(isFar && base !== 0 ? `${name} − ${amount(base, unit)}` : name, unit, exponent),
  };
}

/**
 * A value with its unit, prefixed so that it reads well: all the digits that tell it from other doubles, or `digits` of
 * them. Digits are moved, not computed: they are those of the value itself.
 * @param {number} value
 * @param {string} unit
 * @param {number} [digits]
 */
export function amount(value, unit, digits) {
  if (!Number.isFinite(value)) {
    return `${Number.isNaN(value) ? "not a number" : value < 0 ? "−∞" : "∞"}${unit && ` ${unit}`}`;
  }
  const isGrams = unit === "kg";
  const written =
    digits === undefined ? value.toExponential() : value.toExponential(Math.min(Math.max(digits, 1), 17) - 1);
  const [mantissa, power] = written
    .replace("-", "−")
    .split("e")
    .map((part, i) => (i === 0 ? part : part.replace("−", "-")));
  const places = value === 0 ? 0 : Number(power) + (isGrams ? 3 : 0);
  const sign = mantissa.startsWith("−") ? "−" : "";
  const figures = mantissa.replace(/[−.]/g, "");
  const base = isGrams ? "g" : unit;
  let exponent = 0;
  if (value !== 0 && PREFIXABLE.test(base)) {
    // 0.6 g rather than 600 mg
    const wanted = 3 * Math.floor((places + (isGrams ? 1 : 0)) / 3);
    exponent = PREFIXES.has(wanted) ? Math.min(wanted, base === "s" ? 0 : isGrams ? 3 : wanted) : 0;
  }
  const at = places - exponent; // digits before the point, less one
  const after = unit === "" ? "" : ` ${scaledUnit(base, exponent)}`;
  if (value === 0) {
    return `0${unit && ` ${unit}`}`;
  }
  if (at >= 6 || at < -3) {
    const fraction = trimmed(`${figures[0]}.${figures.slice(1)}`);
    return `${sign}${fraction === "1" ? "" : `${fraction}×`}${powerLabel(at)}${after}`;
  }
  if (at < 0) {
    return `${sign}${trimmed(`0.${"0".repeat(-at - 1)}${figures}`)}${after}`;
  }
  const padded = figures.padEnd(at + 1, "0");
  return `${sign}${trimmed(`${padded.slice(0, at + 1)}.${padded.slice(at + 1)}`)}${after}`;
}

/** A number without zeros that say nothing. */
const trimmed = (/** @type {string} */ number) => number.replace(/\.?0*$/, "");

/** Sizes of texts (px): ticks, labels. */
export const TICK_PX = 11;
export const LABEL_PX = 12;

/** A line around a plot. @param {Surface} surface @param {Box} plot @param {Theme} theme */
export function frame(surface, { x, y, width, height }, theme) {
  const corners = [x, y, x + width, y, x + width, y + height, x, y + height, x, y];
  surface.lines(corners, { colour: theme.foreground, width: 1, crisp: true });
}

/**
 * A straight scale: from a value to a pixel.
 * @param {number} from
 * @param {number} to
 * @param {number} start
 * @param {number} length
 */
export function linear(from, to, start, length) {
  return (/** @type {number} */ value) => start + ((value - from) / (to - from)) * length;
}

/**
 * Ticks, numbers and label under a plot; a number that has no room is left out.
 * @param {Surface} surface @param {Box} box what must not be left
 * @param {Box} plot @param {Quantity} quantity @param {Theme} theme
 * @param {{ isBare?: boolean }} [options] bare: ticks only
 */
export function bottomAxis(surface, box, plot, quantity, theme, { isBare = false } = {}) {
  const bottom = plot.y + plot.height;
  const at = linear(quantity.from, quantity.to, plot.x, plot.width);
  const mark = (/** @type {number} */ value, /** @type {number} */ length) => {
    const x = Math.min(Math.max(at(value), plot.x), plot.x + plot.width);
    surface.lines([x, bottom, x, bottom + length], { colour: theme.foreground, width: 1, crisp: true });
  };
  let count = Math.max(2, Math.floor(plot.width / 90));
  let shown = ticks(quantity, count);
  const widest = (/** @type {Ticks} */ { labels }) =>
    Math.max(0, ...labels.map((label) => surface.textWidth(label, TICK_PX)));
  while (count > 1 && shown.labels.length * (widest(shown) + 14) > plot.width) {
    count -= 1;
    shown = ticks(quantity, count);
  }
  shown.minor.forEach((value) => mark(value, 2.5));
  let free = box.x;
  shown.values.forEach((value, i) => {
    mark(value, 5);
    if (isBare) {
      return;
    }
    const half = surface.textWidth(shown.labels[i], TICK_PX) / 2;
    const x = Math.min(Math.max(at(value), box.x + half), box.x + box.width - half);
    if (x - half >= free) {
      surface.text(x, bottom + 8, shown.labels[i], {
        size: TICK_PX,
        align: "center",
        baseline: "top",
        colour: theme.foreground,
      });
      free = x + half + 6;
    }
  });
  if (!isBare) {
    const middle = plot.x + plot.width / 2;
    surface.text(middle, bottom + 23, shown.label, {
      size: LABEL_PX,
      align: "center",
      baseline: "top",
      colour: theme.foreground,
    });
  }
}

/** The width that a left axis is given (px). */
export const LEFT_PX = 58;

/**
 * Ticks, numbers and label on the left of a plot; `from` of the quantity is at the bottom, or with `isDown` at the top.
 * @param {Surface} surface @param {Box} plot @param {Quantity} quantity @param {Theme} theme
 * @param {{ isDown?: boolean, hasGrid?: boolean }} [options]
 */
export function leftAxis(surface, plot, quantity, theme, { isDown = false, hasGrid = false } = {}) {
  const { x, y, width, height } = plot;
  const at = isDown
    ? linear(quantity.from, quantity.to, y, height)
    : linear(quantity.from, quantity.to, y + height, -height);
  const room = LEFT_PX - 8 - 1.2 * LABEL_PX - 4;
  let count = Math.max(2, Math.floor(height / (isDown ? 60 : 40)));
  let shown = ticks(quantity, count);
  // one number alone says nothing of the scale
  while (shown.values.length < 2 && count < 8 && height > 50) {
    count += 1;
    shown = ticks(quantity, count);
  }
  const mark = (/** @type {number} */ value, /** @type {number} */ length) => {
    const place = Math.min(Math.max(at(value), y), y + height);
    surface.lines([x - length, place, x, place], { colour: theme.foreground, width: 1, crisp: true });
  };
  shown.minor.forEach((value) => mark(value, 2.5));
  shown.values.forEach((value, i) => {
    if (hasGrid) {
      surface.lines([x, at(value), x + width, at(value)], { colour: theme.grid, width: 1, crisp: true });
    }
    mark(value, 5);
    const fits = Math.min(TICK_PX, (TICK_PX * room) / Math.max(1, surface.textWidth(shown.labels[i], TICK_PX)));
    surface.text(x - 8, at(value), shown.labels[i], { size: fits, align: "right", colour: theme.foreground });
  });
  const long = surface.textWidth(shown.label, LABEL_PX);
  const size = Math.max(8, Math.min(LABEL_PX, (LABEL_PX * (height + 4)) / Math.max(1, long)));
  const place = x - LEFT_PX + 0.7 * LABEL_PX + 2;
  surface.text(place, y + height / 2, shown.label, { size, align: "center", colour: theme.foreground, turned: true });
}

/**
 * Names beside short lines, in rows from the top left on; returns the height that they take.
 * @param {Surface} surface @param {Box} box
 * @param {{ name: string, colour: string, dash?: number[], isBlock?: boolean, isCircle?: boolean }[]} entries
 * @param {Theme} theme
 * @param {boolean} [isDrawn] false to ask for the height only
 */
export function legend(surface, box, entries, theme, isDrawn = true) {
  const ROW = 17;
  let [x, y] = [box.x, box.y];
  for (const { name, colour, dash, isBlock, isCircle } of entries) {
    const wide = (isBlock ? 11 : 20) + 6 + surface.textWidth(name, TICK_PX);
    if (x > box.x && x + wide > box.x + box.width) {
      [x, y] = [box.x, y + ROW];
    }
    if (isDrawn && isBlock) {
      surface.rect(x, y + ROW / 2 - 5.5, 11, 11, colour);
      frame(surface, { x, y: y + ROW / 2 - 5.5, width: 11, height: 11 }, { ...theme, foreground: theme.muted });
    } else if (isDrawn && isCircle) {
      surface.circle(x + 10, y + ROW / 2, 3.5, { fill: theme.background, colour, width: 1.5 });
    } else if (isDrawn) {
      surface.lines([x, y + ROW / 2, x + 20, y + ROW / 2], { colour, width: 2, dash });
    }
    if (isDrawn) {
      surface.text(x + (isBlock ? 16 : 25), y + ROW / 2, name, { size: TICK_PX, colour: theme.foreground });
    }
    x += wide + 14;
  }
  return entries.length === 0 ? 0 : y + ROW - box.y;
}
