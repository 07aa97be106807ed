// The canvases of the page: sized, drawn once a frame when something has changed, and drawn again for a file.

import { byId, save } from "./elements.js";
import { CanvasSurface, SvgSurface } from "./surface.js";

/** @typedef {import("./surface.js").Surface} Surface */
/** @typedef {(surface: Surface, box: import("./surface.js").Box) => void} Draw */

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
    this.panels = Object.entries(draws).map(([id, draw]) => ({ canvas: /** @type {HTMLCanvasElement} */ (byId(id)), draw }));
    const resized = new ResizeObserver(() => this.invalidate());
    this.panels.forEach(({ canvas }) => resized.observe(canvas));
  }

  /** Draws at the next frame. */
  invalidate() {
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

  /** Panels that are seen, with their places in the window. */
  seen() {
    const all = this.panels.map(({ canvas, draw }) => ({ canvas, draw, place: canvas.getBoundingClientRect() }));
    return all.filter(({ place }) => place.width > 1 && place.height > 1);
  }

  paint() {
    const ratio = devicePixelRatio || 1;
    for (const { canvas, draw, place } of this.seen()) {
      const [width, height] = [Math.round(place.width), Math.round(place.height)];
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
   */
  compose(surfaceOf) {
    const panels = this.seen().filter(({ canvas }) => canvas.id !== "marks");
    const left = Math.min(...panels.map(({ place }) => place.left));
    const top = Math.min(...panels.map(({ place }) => place.top));
    const width = Math.ceil(Math.max(...panels.map(({ place }) => place.right)) - left);
    const height = Math.ceil(Math.max(...panels.map(({ place }) => place.bottom)) - top);
    const surface = surfaceOf(width, height);
    surface.rect(0, 0, width, height, getComputedStyle(document.body).backgroundColor);
    for (const { draw, place } of panels) {
      const [x, y] = [Math.round(place.left - left), Math.round(place.top - top)];
      draw(surface, { x, y, width: Math.round(place.width), height: Math.round(place.height) });
    }
    return surface;
  }

  /** @param {string} name of the file, without its ending */
  saveSvg(name) {
    const surface = this.compose((width, height) => new SvgSurface(width, height));
    save(`${name}.svg`, new Blob([surface.toString()], { type: "image/svg+xml" }));
  }

  /** At twice the size of the screen. @param {string} name of the file, without its ending */
  savePng(name) {
    const canvas = document.createElement("canvas");
    this.compose((width, height) => {
      canvas.width = 2 * width;
      canvas.height = 2 * height;
      return new CanvasSurface(/** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")), width, height, 2);
    });
    canvas.toBlob((blob) => blob && save(`${name}.png`, blob));
  }
}
