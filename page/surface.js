// One way to draw, on a canvas or into an SVG, so that what is seen can be exported.
// Lengths are CSS pixels; points of a line are x0, y0, x1, y1, …, and a number that is not finite interrupts it.

/** @typedef {{ x: number, y: number, width: number, height: number }} Box */
/** @typedef {{ colour: string, width?: number, dash?: number[], crisp?: boolean }} Stroke */
/** @typedef {{ fill?: string, colour?: string, width?: number }} Disc */
/**
 * Style of a text: `turned` reads upward, `halo` is a colour behind it.
 * @typedef {object} Lettering
 * @property {number} [size]
 * @property {"left" | "center" | "right"} [align]
 * @property {"top" | "middle" | "bottom"} [baseline]
 * @property {string} colour
 * @property {boolean} [turned]
 * @property {boolean} [bold]
 * @property {string} [halo]
 */
/** @typedef {CanvasSurface | SvgSurface} Surface */

export const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Liberation Sans", Arial, sans-serif';

const fontOf = (/** @type {number} */ size, /** @type {boolean | undefined} */ bold) =>
  `${bold ? "600 " : ""}${size}px ${FONT}`;

/** The middle of the device pixels that are nearest to a line of this width. */
function snapped(/** @type {number} */ x, /** @type {number} */ width, /** @type {number} */ ratio) {
  const wide = Math.max(1, Math.round(width * ratio));
  return (Math.round(x * ratio - wide / 2) + wide / 2) / ratio;
}

/** @type {CanvasRenderingContext2D | undefined} */
let ruler;

export function widthOf(/** @type {string} */ string, /** @type {number} */ size, /** @type {boolean | undefined} */ bold) {
  if (typeof document === "undefined") {
    return 0.56 * size * string.length;
  }
  ruler ??= /** @type {CanvasRenderingContext2D} */ (document.createElement("canvas").getContext("2d"));
  ruler.font = fontOf(size, bold);
  return ruler.measureText(string).width;
}

/** Draws on a canvas of `width` × `height` CSS pixels, with `ratio` pixels of the device to each. */
export class CanvasSurface {
  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number} width
   * @param {number} height
   * @param {number} ratio
   */
  constructor(context, width, height, ratio) {
    this.context = context;
    this.ratio = ratio;
    /** The one that is set. */
    this.font = "";
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
  }

  /** @param {ArrayLike<number>} points @param {Stroke} stroke */
  lines(points, { colour, width = 1, dash = [], crisp = false }) {
    const { context, ratio } = this;
    const at = (/** @type {number} */ i) => (crisp ? snapped(points[i], width, ratio) : points[i]);
    context.strokeStyle = colour;
    context.lineWidth = crisp ? Math.max(1, Math.round(width * ratio)) / ratio : width;
    context.lineJoin = "round";
    context.setLineDash(dash);
    context.beginPath();
    let isOn = false;
    for (let i = 0; i + 1 < points.length; i += 2) {
      const isHere = Number.isFinite(points[i]) && Number.isFinite(points[i + 1]);
      if (isHere && isOn) {
        context.lineTo(at(i), at(i + 1));
      } else if (isHere) {
        context.moveTo(at(i), at(i + 1));
      }
      isOn = isHere;
    }
    context.stroke();
    context.setLineDash([]);
  }

  /** A filled shape. @param {ArrayLike<number>} points @param {string} colour */
  area(points, colour) {
    const { context } = this;
    context.fillStyle = colour;
    context.beginPath();
    for (let i = 0; i + 1 < points.length; i += 2) {
      context.lineTo(points[i], points[i + 1]);
    }
    context.fill();
  }

  /** @param {number} x @param {number} y @param {number} width @param {number} height @param {string} colour */
  rect(x, y, width, height, colour) {
    this.context.fillStyle = colour;
    this.context.fillRect(x, y, width, height);
  }

  /** @param {number} x @param {number} y @param {number} radius @param {Disc} disc */
  circle(x, y, radius, { fill, colour, width = 1 }) {
    const { context } = this;
    if (!Number.isFinite(x + y + radius)) {
      return;
    }
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    if (fill !== undefined) {
      context.fillStyle = fill;
      context.fill();
    }
    if (colour !== undefined) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.stroke();
    }
  }

  /** @param {number} x @param {number} y @param {string} string @param {Lettering} lettering */
  text(x, y, string, { size = 12, align = "left", baseline = "middle", colour, turned = false, bold, halo }) {
    const { context } = this;
    const font = fontOf(size, bold);
    if (font !== this.font) {
      // which takes longer than the text
      this.font = font;
      context.font = font;
    }
    context.save();
    context.translate(x, y);
    if (turned) {
      context.rotate(-Math.PI / 2);
    }
    context.textAlign = align;
    context.textBaseline = "alphabetic";
    const down = risen(baseline) * size;
    if (halo !== undefined) {
      context.strokeStyle = halo;
      context.lineWidth = 3;
      context.lineJoin = "round";
      context.strokeText(string, 0, down);
    }
    context.fillStyle = colour;
    context.fillText(string, 0, down);
    context.restore();
  }

  /** Width of a text. @param {string} string @param {number} [size] @param {boolean} [bold] */
  textWidth(string, size = 12, bold) {
    return widthOf(string, size, bold);
  }

  /**
   * @param {HTMLCanvasElement} picture
   * @param {number} x @param {number} y @param {number} width @param {number} height
   * @param {boolean} smooth
   */
  image(picture, x, y, width, height, smooth) {
    this.context.imageSmoothingEnabled = smooth;
    this.context.drawImage(picture, x, y, width, height);
  }

  /** @param {number} x @param {number} y @param {number} width @param {number} height @param {() => void} draw */
  clip(x, y, width, height, draw) {
    const { context } = this;
    context.save();
    context.beginPath();
    context.rect(x, y, width, height);
    context.clip();
    draw();
    context.restore();
    this.font = "";
  }
}

/** Distance of a text's baseline below its place, in sizes. */
function risen(/** @type {"top" | "middle" | "bottom"} */ baseline) {
  return baseline === "top" ? 0.8 : baseline === "middle" ? 0.36 : -0.2;
}

/** A number as short as a picture needs it. */
const short = (/** @type {number} */ x) => String(Math.round(x * 100) / 100);

const ESCAPES = new Map([
  ["&", "&amp;"],
  ["<", "&lt;"],
  [">", "&gt;"],
  ['"', "&quot;"],
  ["'", "&#39;"],
]);

/** Text as it may stand in SVG. */
export function escaped(/** @type {string} */ string) {
  // what is no character of XML would make the file unreadable
  const characters = string.replace(/[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\u{10000}-\u{10ffff}]/gu, "\ufffd");
  return characters.replace(/[&<>"']/g, (character) => /** @type {string} */ (ESCAPES.get(character)));
}

/** Draws into an SVG of `width` × `height`. */
export class SvgSurface {
  /** @param {number} width @param {number} height */
  constructor(width, height) {
    this.width = width;
    this.height = height;
    this.ratio = 2; // of pictures
    /** @type {string[]} */
    this.parts = [];
    this.clips = 0;
  }

  toString() {
    const { width, height } = this;
    const size = `width="${width}" height="${height}" viewBox="0 0 ${width} ${height}"`;
    const root = `<svg xmlns="http://www.w3.org/2000/svg" ${size} font-family="${escaped(FONT)}">`;
    return `${root}\n${this.parts.join("\n")}\n</svg>\n`;
  }

  /**
   * @param {string} name
   * @param {Record<string, string | number | undefined>} attributes
   * @param {string} [content]
   */
  add(name, attributes, content) {
    const given = Object.entries(attributes).filter(([, value]) => value !== undefined);
    const written = given.map(
      ([key, value]) => ` ${key}="${typeof value === "number" ? short(value) : escaped(String(value))}"`,
    );
    this.parts.push(`<${name}${written.join("")}${content === undefined ? "/>" : `>${escaped(content)}</${name}>`}`);
  }

  /** @param {ArrayLike<number>} points @param {Stroke} stroke */
  lines(points, { colour, width = 1, dash = [], crisp = false }) {
    let path = "";
    let isOn = false;
    for (let i = 0; i + 1 < points.length; i += 2) {
      const isHere = Number.isFinite(points[i]) && Number.isFinite(points[i + 1]);
      const at = (/** @type {number} */ x) => short(crisp ? snapped(x, width, 1) : x);
      path += isHere ? `${isOn ? "L" : "M"}${at(points[i])} ${at(points[i + 1])}` : "";
      isOn = isHere;
    }
    const dashes = dash.length > 0 ? dash.join(" ") : undefined;
    const join = "round";
    this.add("path", {
      d: path,
      fill: "none",
      stroke: colour,
      "stroke-width": width,
      "stroke-dasharray": dashes,
      "stroke-linejoin": join,
    });
  }

  /** @param {ArrayLike<number>} points @param {string} colour */
  area(points, colour) {
    this.add("polygon", { points: Array.from(points, short).join(" "), fill: colour });
  }

  /** @param {number} x @param {number} y @param {number} width @param {number} height @param {string} colour */
  rect(x, y, width, height, colour) {
    this.add("rect", { x, y, width, height, fill: colour });
  }

  /** @param {number} x @param {number} y @param {number} radius @param {Disc} disc */
  circle(x, y, radius, { fill = "none", colour, width = 1 }) {
    if (!Number.isFinite(x + y + radius)) {
      return;
    }
    this.add("circle", { cx: x, cy: y, r: radius, fill, stroke: colour, "stroke-width": colour && width });
  }

  /** @param {number} x @param {number} y @param {string} string @param {Lettering} lettering */
  text(x, y, string, { size = 12, align = "left", baseline = "middle", colour, turned = false, bold, halo }) {
    const down = risen(baseline) * size;
    const [left, top] = turned ? [x + down, y] : [x, y + down];
    this.add(
      "text",
      {
        x: left,
        y: top,
        fill: colour,
        "font-size": size,
        "font-weight": bold ? 600 : undefined,
        "text-anchor": { left: "start", center: "middle", right: "end" }[align],
        transform: turned ? `rotate(-90 ${short(left)} ${short(top)})` : undefined,
        stroke: halo,
        "stroke-width": halo && 3,
        "stroke-linejoin": halo && "round",
        "paint-order": halo && "stroke",
      },
      string,
    );
  }

  /** Width of a text. @param {string} string @param {number} [size] @param {boolean} [bold] */
  textWidth(string, size = 12, bold) {
    return widthOf(string, size, bold);
  }

  /**
   * @param {HTMLCanvasElement} picture
   * @param {number} x @param {number} y @param {number} width @param {number} height
   * @param {boolean} smooth
   */
  image(picture, x, y, width, height, smooth) {
    const href = picture.toDataURL("image/png");
    const rendering = smooth ? undefined : "pixelated";
    this.add("image", { x, y, width, height, preserveAspectRatio: "none", "image-rendering": rendering, href });
  }

  /** @param {number} x @param {number} y @param {number} width @param {number} height @param {() => void} draw */
  clip(x, y, width, height, draw) {
    this.clips += 1;
    const id = `clip${this.clips}`;
    const [left, top, wide, high] = [x, y, width, height].map(short);
    this.parts.push(`<clipPath id="${id}"><rect x="${left}" y="${top}" width="${wide}" height="${high}"/></clipPath>`);
    this.parts.push(`<g clip-path="url(#${id})">`);
    draw();
    this.parts.push("</g>");
  }
}
