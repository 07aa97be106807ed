// The canvases of the page: sized, drawn once a frame when something has changed, and drawn again for a file.

import { byId, save } from "./elements.js";
import { CanvasSurface, SvgSurface, widthOf } from "./surface.js";

/** @typedef {import("./surface.js").Surface} Surface */
/** @typedef {(surface: Surface, box: import("./surface.js").Box) => void} Draw */

/** Interval between two drawings of a panel while a run goes on (ms): the profile and numbers whenever there is
 * something new. */
const PERIODS_MS = new Map([
  ["map", 50],
  ["second", 50],
  ["energies", 200],
  ["path", 200],
  ["marks", 200],
]);

/** Text of captions (px). */
const CAPTION_PX = 11;

/**
 * A text in lines of a width, broken between words.
 * @param {string} text @param {number} width
 */
function folded(text, width) {
  /** @type {string[]} */
  const lines = [];
  for (const word of text.split(" ")) {
    const longer = `${lines.at(-1)} ${word}`;
    if (lines.length > 0 && widthOf(longer, CAPTION_PX, false) <= width) {
      lines[lines.length - 1] = longer;
    } else {
      lines.push(word);
    }
  }
  return lines;
}

/** Canvases by the ids of their elements. */
export class Board {
  /**
   * @param {Record<string, Draw>} draws
   * @param {() => void} before what is to be done before each drawing
   * @param {(error: unknown) => void} onerror of a run that cannot be drawn, whatever its file made of it
   */
  constructor(draws, before, onerror) {
    this.before = before;
    this.onerror = onerror;
    this.isDue = false;
    /** True if all panels are to be drawn now. */
    this.isUrgent = false;
    this.panels = Object.entries(draws).map(([id, draw]) => {
      const canvas = /** @type {HTMLCanvasElement} */ (byId(id));
      const { clientWidth: width, clientHeight: height } = canvas;
      return { canvas, draw, width, height, drawn: -Infinity, period: PERIODS_MS.get(id) ?? 0 };
    });
    // asking for sizes while drawing would lay the page out again for each frame
    const resized = new ResizeObserver((entries) => {
      for (const {
        target,
        contentRect: { width, height },
      } of entries) {
        Object.assign(this.panels.find(({ canvas }) => canvas === target) ?? {}, {
          width: Math.round(width),
          height: Math.round(height),
        });
      }
      this.invalidate();
    });
    this.panels.forEach(({ canvas }) => resized.observe(canvas));
  }

  /** Width and height of a canvas (CSS pixels); 0 where it is not shown. @param {string} id */
  size(id) {
    const { width, height } = this.panels.find(({ canvas }) => canvas.id === id) ?? { width: 0, height: 0 };
    return { width, height };
  }

  /**
   * Draws at the next frame.
   * @param {boolean} [isNews] of a run that goes on: each panel in its time
   */
  invalidate(isNews = false) {
    this.isUrgent ||= !isNews;
    if (!this.isDue) {
      this.isDue = true;
      requestAnimationFrame(() => {
        this.isDue = false;
        try {
          this.before();
          this.paint();
        } catch (error) {
          this.onerror(error);
        }
      });
    }
  }

  paint() {
    const ratio = devicePixelRatio || 1;
    const now = performance.now();
    const { isUrgent } = this;
    this.isUrgent = false;
    for (const panel of this.panels.filter(({ width, height }) => width > 1 && height > 1)) {
      const { canvas, draw, width, height, drawn, period } = panel;
      if (!isUrgent && now - drawn < period) {
        clearTimeout(this.later);
        this.later = setTimeout(() => this.invalidate(true), period);
        continue;
      }
      panel.drawn = now;
      const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
      if (canvas.width !== wide || canvas.height !== high) {
        canvas.width = wide;
        canvas.height = high;
      }
      const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
      draw(new CanvasSurface(context, width, height, ratio), { x: 0, y: 0, width, height });
    }
  }

  /**
   * Draws all that is seen side by side, as the page has it.
   * @template {Surface} T
   * @param {(width: number, height: number) => T} surfaceOf
   * @param {string[]} caption lines below all else
   */
  compose(surfaceOf, caption) {
    const all = this.panels.map(({ canvas, draw }) => ({ draw, place: canvas.getBoundingClientRect(), id: canvas.id }));
    const panels = all.filter(({ place, id }) => place.width > 1 && place.height > 1 && id !== "marks");
    const left = Math.min(...panels.map(({ place }) => place.left));
    const top = Math.min(...panels.map(({ place }) => place.top));
    const width = Math.ceil(Math.max(...panels.map(({ place }) => place.right)) - left);
    const height = Math.ceil(Math.max(...panels.map(({ place }) => place.bottom)) - top);
    const { backgroundColor, color } = getComputedStyle(document.body);
    const lines = caption.flatMap((line) => folded(line, width - 2 * CAPTION_PX));
    const whole = height + Math.ceil((lines.length + 0.5) * 1.4 * CAPTION_PX);
    const surface = surfaceOf(width, whole);
    surface.rect(0, 0, width, whole, backgroundColor);
    lines.forEach((line, i) => {
      const y = height + (i + 0.75) * 1.4 * CAPTION_PX;
      surface.text(CAPTION_PX, y, line, { size: CAPTION_PX, colour: color });
    });
    for (const { draw, place } of panels) {
      const [x, y] = [Math.round(place.left - left), Math.round(place.top - top)];
      draw(surface, { x, y, width: Math.round(place.width), height: Math.round(place.height) });
    }
    return surface;
  }

  /** @param {string} name of the file, without its ending @param {string[]} caption */
  saveSvg(name, caption) {
    const surface = this.compose((width, height) => new SvgSurface(width, height), caption);
    save(`${name}.svg`, new Blob([surface.toString()], { type: "image/svg+xml" }));
  }

  /** At twice the size of the screen. @param {string} name of the file, without its ending @param {string[]} caption */
  savePng(name, caption) {
    const canvas = document.createElement("canvas");
    this.compose((width, height) => {
      canvas.width = 2 * width;
      canvas.height = 2 * height;
      return new CanvasSurface(/** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")), width, height, 2);
    }, caption);
    canvas.toBlob((blob) => blob && save(`${name}.png`, blob));
  }
}
