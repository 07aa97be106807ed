// Gestures of pointers on the maps and the profile.

import { byId } from "./elements.js";
import { watchPointer } from "./pointer.js";
import { placeWord } from "./run.js";
import { LEAST_PLACES, LEAST_STEPS, within } from "./view.js";

/** @typedef {import("./page.js").Page} Page */
/** @typedef {import("./run.js").Run} Run */

/** Two clicks within this are one double click. */
const DOUBLE_MS = 500;

/** When somebody clicked, and what was looked at before. @type {{ time: number, step?: number, bead?: number }} */
let clicked = { time: 0 };

/** Listens to all of them. @param {Page} page */
export function watchGestures(page) {
  for (const id of ["map", "second", "difference", "profile"]) {
    wireCanvas(page, id);
  }
}

/**
 * @param {Page} page
 * @param {string} id
 */
function wireCanvas(page, id) {
  const canvas = /** @type {HTMLCanvasElement} */ (byId(id));
  const isMap = id !== "profile";
  /** The place and the step at parts of the plot. */
  const at = (/** @type {number} */ x, /** @type {number} */ y) => {
    const run = /** @type {Run} */ (page.run);
    const { steps } = page.window();
    const place = Math.min(Math.max(Math.round(page.pictures.placeAt(x)), 0), run.lastPlace(page.view.field));
    return { place, step: isMap ? run.clamp(steps[0] + y * (steps[1] - steps[0])) : page.step };
  };
  watchPointer(canvas, {
    plot: () => (page.run ? page.pictures.plot(id) : undefined),
    onhover: (x, y) => {
      page.hover = at(x, y);
      page.board.invalidate();
    },
    onleave: () => {
      page.hover = undefined;
      page.board.invalidate();
    },
    onclick: (x, y) => {
      const { place, step } = at(x, y);
      const now = performance.now();
      if (now - clicked.time > DOUBLE_MS) {
        clicked = { time: now, step: page.view.step, bead: page.view.bead };
      }
      page.look({ bead: Math.min(place, /** @type {Run} */ (page.run).beads - 1) });
      if (isMap) {
        page.timeline.pause();
        page.seek(step);
      }
    },
    onwhole: () => {
      const { step, bead } = clicked; // the two clicks before were not meant as such
      page.look({ places: undefined, steps: isMap ? undefined : page.view.steps, step, bead });
      if (!page.isFollowing) {
        page.run?.seek(page.step);
      }
    },
    onzoom: (ofPlaces, ofSteps, x, y) =>
      isMap ? page.zoom(ofPlaces, ofSteps, x, y) : page.zoom(ofPlaces * ofSteps, 1, x, y),
    onpan: (byX, byY) => page.pan(byX, isMap ? byY : 0),
    onrule: (x0, y0, x1, y1) => {
      if (!isMap || !page.view.ruler) {
        return false;
      }
      const { places, steps } = page.window();
      const half = placeWord(page.view.field) === "contact" ? 0.5 : 0; // contact i is between beads i and i + 1
      const bead = (/** @type {number} */ x) => places[0] + x * (places[1] - places[0]) + half;
      const step = (/** @type {number} */ y) => steps[0] + y * (steps[1] - steps[0]);
      page.look({ ruler: [bead(x0), step(y0), bead(x1), step(y1)] });
      return true;
    },
    onbox: (box) => {
      page.box = isMap ? box : undefined;
      page.board.invalidate();
    },
    onboxed: ([x0, y0, x1, y1]) => {
      const { places, steps, allPlaces, allSteps } = page.window();
      const part = (/** @type {[number, number]} */ [from, to], /** @type {number} */ a, /** @type {number} */ b) =>
        /** @type {[number, number]} */ ([from + a * (to - from), from + b * (to - from)]);
      page.look({
        places: within(part(places, x0, x1), allPlaces, LEAST_PLACES),
        steps: isMap ? within(part(steps, y0, y1), allSteps, LEAST_STEPS) : page.view.steps,
      });
    },
  });
}
