// Pointers on a map or a profile: mouse, pen or fingers.

/**
 * Gestures that a pointer asks for; places are parts of the plot from 0 to 1, from its left and from its top.
 * @typedef {object} Gestures
 * @property {() => import("./surface.js").Box | undefined} plot in CSS pixels of the canvas
 * @property {(x: number, y: number) => void} onhover
 * @property {() => void} onleave
 * @property {(x: number, y: number) => void} onclick
 * @property {() => void} onwhole
 * @property {(factorX: number, factorY: number, x: number, y: number) => void} onzoom
 * @property {(byX: number, byY: number) => void} onpan
 * @property {(x0: number, y0: number, x1: number, y1: number) => boolean} onrule a drag that may lay a ruler: whether it did
 * @property {(box: [number, number, number, number] | undefined) => void} onbox while it is drawn: x0, y0, x1, y1
 * @property {(box: [number, number, number, number]) => void} onboxed
 */

const CLICK_PX = 4;

/**
 * Listens to a canvas.
 * @param {HTMLCanvasElement} canvas
 * @param {Gestures} gestures
 */
export function watchPointer(canvas, gestures) {
  /** Pointers that are down, and where. @type {Map<number, [number, number]>} */
  const down = new Map();
  /** @type {[number, number]} */
  let start = [0, 0];
  let isBox = false;
  let hasMoved = false;
  let wasPinch = false;
  const at = (/** @type {MouseEvent} */ { clientX, clientY }) => {
    const plot = gestures.plot();
    const { left, top } = canvas.getBoundingClientRect();
    return (
      plot &&
      /** @type {[number, number]} */ ([(clientX - left - plot.x) / plot.width, (clientY - top - plot.y) / plot.height])
    );
  };
  const size = () => gestures.plot() ?? { width: 1, height: 1 };
  const isInside = (/** @type {number[]} */ [x, y]) => x >= 0 && x <= 1 && y >= 0 && y <= 1;
  const boxTo = (/** @type {[number, number]} */ [x, y]) => {
    const clip = (/** @type {number} */ part) => Math.min(Math.max(part, 0), 1);
    const [xs, ys] = [
      [start[0], clip(x)],
      [start[1], clip(y)],
    ];
    return /** @type {[number, number, number, number]} */ ([
      Math.min(...xs),
      Math.min(...ys),
      Math.max(...xs),
      Math.max(...ys),
    ]);
  };

  canvas.addEventListener("pointerdown", (event) => {
    const place = at(event);
    if (!place || event.button !== 0 || !isInside(place)) {
      return;
    }
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, place);
    if (down.size === 1) {
      start = place;
      isBox = event.shiftKey;
      hasMoved = false;
      wasPinch = false;
    } else {
      wasPinch = true;
    }
  });
  canvas.addEventListener("pointermove", (event) => {
    const place = at(event);
    if (!place) {
      return;
    }
    const before = down.get(event.pointerId);
    if (!before) {
      if (isInside(place)) {
        gestures.onhover(...place);
      } else {
        gestures.onleave();
      }
      return;
    }
    const { width, height } = size();
    hasMoved ||= Math.hypot((place[0] - start[0]) * width, (place[1] - start[1]) * height) > CLICK_PX;
    if (down.size === 2) {
      const other = [...down].find(([id]) => id !== event.pointerId)?.[1] ?? before;
      const factor = (/** @type {number} */ axis, /** @type {number} */ least) => {
        const [was, is] = [Math.abs(before[axis] - other[axis]), Math.abs(place[axis] - other[axis])];
        return was > least && is > least ? was / is : 1; // fingers side by side say nothing of this axis
      };
      gestures.onzoom(factor(0, 0.08), factor(1, 0.08), (place[0] + other[0]) / 2, (place[1] + other[1]) / 2);
      gestures.onpan((before[0] - place[0]) / 2, (before[1] - place[1]) / 2);
    } else if (hasMoved && isBox) {
      gestures.onbox(boxTo(place));
    } else if (hasMoved && !wasPinch && !gestures.onrule(...start, ...place)) {
      gestures.onpan(before[0] - place[0], before[1] - place[1]);
    }
    down.set(event.pointerId, place);
  });
  const up = (/** @type {PointerEvent} */ event) => {
    if (!down.delete(event.pointerId) || down.size > 0 || wasPinch) {
      return;
    }
    const place = at(event);
    gestures.onbox(undefined);
    if (event.type === "pointerup" && place) {
      if (hasMoved && isBox) {
        gestures.onboxed(boxTo(place));
      } else if (!hasMoved) {
        gestures.onclick(...start);
      }
    }
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("pointerleave", () => gestures.onleave());
  canvas.addEventListener("dblclick", () => gestures.onwhole());
  canvas.addEventListener(
    "wheel",
    (event) => {
      const place = at(event);
      if (!place || !isInside(place)) {
        return;
      }
      event.preventDefault();
      const pixels = (event.deltaY || event.deltaX) * (event.deltaMode === 1 ? 16 : 1); // lines, in Firefox
      const factor = Math.exp(Math.min(Math.max(pixels, -240), 240) * (event.ctrlKey ? 0.01 : 0.002));
      gestures.onzoom(event.shiftKey || event.ctrlKey ? factor : 1, event.shiftKey ? 1 : factor, ...place);
    },
    { passive: false },
  );
}
