// Colours of the page, and of numbers: those of our figures, and their like on a dark ground.

/** @typedef {[number, number, number]} Rgb 0 to 255 */
/**
 * Colours of everything. `shade` gives the colour of a signed number's shade (−1 to 1), `part` that of a part (0 to 1).
 * @typedef {object} Theme
 * @property {boolean} isDark
 * @property {string} background
 * @property {string} foreground
 * @property {string} muted
 * @property {string} grid
 * @property {string} accent the time cursor, and what is chosen
 * @property {string} unknown where nothing is known yet
 * @property {string} impurity
 * @property {string} force
 * @property {string[]} curves in the order in which they are taken
 * @property {Rgb[]} contacts touching, compressed, open
 * @property {(shade: number) => Rgb} shade
 * @property {(part: number) => Rgb} part
 */

/** A linear part of the light of the screen as sRGB writes it. */
function byte(/** @type {number} */ linear) {
  const x = Math.min(Math.max(linear, 0), 1);
  return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * Math.pow(x, 1 / 2.4) - 0.055));
}

/**
 * A colour by its coordinates in OKLab (B. Ottosson, A perceptual color space for image processing, 2020), in which
 * steps look even; the hue in degrees.
 * @param {number} lightness @param {number} chroma @param {number} hue
 * @returns {Rgb}
 */
function oklab(lightness, chroma, hue) {
  const [a, b] = [chroma * Math.cos((hue * Math.PI) / 180), chroma * Math.sin((hue * Math.PI) / 180)];
  const cubed = (/** @type {number} */ fromA, /** @type {number} */ fromB) => (lightness + fromA * a + fromB * b) ** 3;
  const l = cubed(0.3963377774, 0.2158037573);
  const m = cubed(-0.1055613458, -0.0638541728);
  const s = cubed(-0.0894841775, -1.291485548);
  return [
    byte(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
    byte(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
    byte(-0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s),
  ];
}

/** Colour of 0 on a dark background. @type {Rgb} */
const GROUND = [0x0f, 0x13, 0x18];

/** A colour that comes out of the dark ground near 0. */
function onGround(/** @type {Rgb} */ colour, /** @type {number} */ part) {
  const weight = Math.min(1, 8 * part);
  return /** @type {Rgb} */ (colour.map((byte, i) => Math.round(GROUND[i] + (byte - GROUND[i]) * weight)));
}

/**
 * The colour of a shade from −1 (blue) over 0 to 1 (red); lightness changes evenly, so that it is read without any
 * colour vision but for the sign.
 * @param {number} shade @param {boolean} [isDark]
 */
export function diverging(shade, isDark = false) {
  const part = Math.min(Math.abs(shade), 1);
  // near the dark ground the eye needs larger steps
  const [from, to, rise] = isDark ? [0.2, 0.86, part ** 0.75] : [1, 0.4, part];
  const chroma = (isDark ? 0.12 * (1 - 0.25 * part) : 0.13) * part * (2 - part);
  const colour = oklab(from + (to - from) * rise, chroma, shade < 0 ? (isDark ? 240 : 255) : isDark ? 50 : 38);
  return isDark ? onGround(colour, part) : colour;
}

/**
 * The colour of a part from 0 to 1 of what has no sign: over yellow and red to violet, on a dark ground the other way.
 * @param {number} part @param {boolean} [isDark]
 */
export function sequential(part, isDark = false) {
  const x = Math.min(Math.max(part, 0), 1);
  const [from, to] = isDark ? [0.2, 0.93] : [1, 0.32];
  const hue = isDark ? 300 + 150 * x : 95 - 140 * x;
  const colour = oklab(from + (to - from) * x, 0.15 * Math.min(1, 4 * x) * (isDark ? 1 - 0.3 * x : 1 - 0.2 * x), hue);
  return isDark ? onGround(colour, x) : colour;
}

/** Okabe and Ito's colours (Color Universal Design, 2008) in the order of our figures, and a little lighter ones. */
const CURVES = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"];
const CURVES_IN_DARK = ["#56b4e9", "#ff8a3d", "#2fc79a", "#e79cc5", "#e6b43c", "#4c93d9", "#ffffff"];

/** @type {Theme} */
const LIGHT = {
  isDark: false,
  background: "#ffffff",
  foreground: "#1a1a1a",
  muted: "#626262",
  grid: "#e4e4e4",
  accent: "#c2185b",
  unknown: "#ececec",
  impurity: "#cc79a7",
  force: "#d55e00",
  curves: CURVES,
  contacts: [
    [255, 255, 255],
    [0, 0, 0],
    [0xe6, 0x9f, 0x00],
  ],
  shade: (shade) => diverging(shade),
  part: (part) => sequential(part),
};

/** @type {Theme} */
const DARK = {
  isDark: true,
  background: "#0f1318",
  foreground: "#e6eaee",
  muted: "#9aa5b1",
  grid: "#2a323b",
  accent: "#ff7eb0",
  unknown: "#232a32",
  impurity: "#e79cc5",
  force: "#ff8a3d",
  curves: CURVES_IN_DARK,
  contacts: [GROUND, [0xf4, 0xf4, 0xf4], [0xe6, 0x9f, 0x00]],
  shade: (shade) => diverging(shade, true),
  part: (part) => sequential(part, true),
};

/** @param {boolean} isDark */
export function theme(isDark) {
  return isDark ? DARK : LIGHT;
}

export const css = (/** @type {Rgb} */ [red, green, blue]) => `rgb(${red},${green},${blue})`;

/** Colours that a number may have between 0 and an end. */
const LEVELS = 512;

const isLittleEndian = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/** A colour as the pixels of a picture have it. */
function pixel(/** @type {Rgb} */ [red, green, blue]) {
  const word = isLittleEndian
    ? (255 << 24) | (blue << 16) | (green << 8) | red
    : (red << 24) | (green << 16) | (blue << 8) | 255;
  return word >>> 0;
}

/** Colours of numbers. */
export class ColourScale {
  /**
   * @param {{ from: number, to: number, log?: number }} range the numbers that are shown, and 0; logarithmic beyond
   * ±`log` if that is given
   * @param {(shade: number) => Rgb} colourOf
   */
  constructor({ from, to, log = 0 }, colourOf) {
    const usable = (/** @type {number} */ x) => (Number.isFinite(x) ? x : 0);
    this.from = Math.min(usable(from), 0);
    this.to = Math.max(usable(to), 0);
    if (this.from === this.to) {
      this.to = 1;
    }
    this.limit = Math.max(this.to, -this.from);
    this.linear = log > 0 && log < this.limit ? log : 0;
    this.colourOf = colourOf;
    /** @type {Uint32Array | undefined} */
    this.table = undefined;
  }

  /** Shade of a number: between 0 and the colours of the ends (−1 and 1). */
  shade(/** @type {number} */ value) {
    const size = Math.abs(value);
    const { linear, limit } = this;
    const part = linear === 0 ? size / limit : Math.log1p(size / linear) / Math.log1p(limit / linear);
    return Math.sign(value) * Math.min(part, 1);
  }

  /** The place of a number on the bar, from 0 at its lower end to 1. */
  place(/** @type {number} */ value) {
    const [low, high] = [this.shade(this.from), this.shade(this.to)];
    return (this.shade(value) - low) / (high - low);
  }

  /** The colour of a place on the bar. */
  at(/** @type {number} */ place) {
    const [low, high] = [this.shade(this.from), this.shade(this.to)];
    return this.colourOf(low + place * (high - low));
  }

  /**
   * Paints a pixel for each number.
   * @param {ArrayLike<number>} cells
   * @param {Uint32Array} pixels
   */
  paint(cells, pixels) {
    this.table ??= this.made();
    const { table, limit } = this;
    // the upper half of a float's bits tells it to 1 part in 128, which is finer than the eye is
    const float = new Float32Array(1);
    const bits = new Uint32Array(float.buffer);
    for (let i = 0; i < cells.length; i += 1) {
      float[0] = cells[i] / limit;
      pixels[i] = table[bits[0] >>> 16];
    }
  }

  made() {
    const levels = Array.from({ length: 2 * LEVELS + 1 }, (_, i) => pixel(this.colourOf(i / LEVELS - 1)));
    const word = new Uint32Array(1);
    const float = new Float32Array(word.buffer);
    return Uint32Array.from({ length: 1 << 16 }, (_, upper) => {
      // the middle of its floats, but of powers of two themselves: classes and 0 are exact
      word[0] = (upper << 16) | (upper & 0x7f ? 0x8000 : 0);
      const shade = this.shade(Math.min(Math.max(float[0] * this.limit, this.from), this.to)); // beyond the ends as at the ends
      return levels[Math.round(LEVELS * (Number.isNaN(shade) ? 0 : shade)) + LEVELS];
    });
  }
}

/**
 * @param {{ from: number, to: number, log?: number }} range
 * @param {(shade: number) => Rgb} colourOf
 */
export function colourScale(range, colourOf) {
  return new ColourScale(range, colourOf);
}
