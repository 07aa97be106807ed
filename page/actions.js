// Actions of keys and buttons.

import { carried, chooseFile } from "./carried.js";
import { colourForm } from "./colouring.js";
import { byId } from "./elements.js";
import { exportDialog } from "./exporting.js";
import { keyTable } from "./keyboard.js";
import { FIELDS, freshView } from "./view.js";

/** @typedef {import("./page.js").Page} Page */

/** Place of the cursor in the window, if it is there: zooming by keys goes towards it. @param {Page} page */
function cursorPart(page) {
  const {
    steps: [from, to],
  } = page.window();
  const part = (page.step - from) / (to - from);
  return part >= 0 && part <= 1 ? part : 0.5;
}

/** Goes on following the chosen bead when another is chosen, or no longer. @param {Page} page */
function pin(page) {
  const { bead, view } = page;
  const others = view.beads.filter((one) => one !== bead);
  page.look({ beads: others.length < view.beads.length ? others : [...others, bead].slice(-3) });
}

/**
 * Does what a key or a button is for.
 * @param {Page} page
 * @param {string} action
 * @param {number} by
 * @param {string} key
 * @returns {boolean} whether it did
 */
export function act(page, action, by, key) {
  const { run, view, timeline } = page;
  /** @type {Record<string, () => void>} */
  const always = {
    theme: () => {
      page.look({ theme: page.isDark ? "light" : "dark" });
      page.applyTheme();
    },
    open: () => chooseFile((file) => page.openFile(file)),
    help: () => page.dialog("Keys and pointer", keyTable()),
    back: () => {
      if (page.entries.length > 1) {
        page.look({ ...freshView(), theme: view.theme });
        page.list(carried().title);
      }
    },
  };
  if (always[action]) {
    always[action]();
    return true;
  }
  if (!run) {
    return false;
  }
  const { steps } = page.window();
  const marks = timeline.marks(page.bead);
  const back = key === "," || key === "<" ? -1 : 1;
  /** @type {Record<string, () => void>} */
  const acts = {
    play: () => timeline.toggle(),
    step: () => timeline.by(by),
    frame: () => timeline.byFrame(by),
    leap: () => timeline.by(by * Math.max(1, Math.round((steps[1] - steps[0]) / 20))),
    ends: () => timeline.by(by * Infinity),
    live: () => run.info.kind === "live" && page.look({ step: undefined }),
    event: () => {
      run.find(page.bead);
      timeline.jump(marks.events, back);
    },
    pulse: () => timeline.jump(marks.births, back),
    bead: () => page.look({ bead: Math.min(Math.max(page.bead + by, 0), run.beads - 1) }),
    follow: () => pin(page),
    zoomSteps: () => page.zoom(1, by, 0.5, cursorPart(page)),
    zoomPlaces: () => page.zoom(by, 1),
    panSteps: () => page.pan(0, by),
    panPlaces: () => page.pan(by, 0),
    whole: () => page.look({ places: undefined, steps: undefined }),
    field: () => page.look({ field: FIELDS[Number(key) - 1][0] }),
    log: () => page.look({ log: !view.log }),
    colours: () => {
      if (view.field !== "contacts") {
        const dialog = /** @type {HTMLDialogElement} */ (byId("dialog"));
        page.dialog("Numbers at the ends of the colours", colourForm(page, () => dialog.close()));
      }
    },
    ruler: () => page.look({ ruler: view.ruler ? undefined : [page.bead, page.step, page.bead, page.step] }),
    rulerEnd: () => view.ruler && page.look({ ruler: [view.ruler[0], view.ruler[1], page.bead, page.step] }),
    digits: () => {
      page.look({ digits: !view.digits });
      page.tabs.forget();
    },
    prove: () => void page.prove().catch(() => {}),
    change: () => {
      page.look({ tab: "change" });
      page.tabs.show();
      byId("tab").querySelector("select")?.focus();
    },
    export: () => page.dialog("Export what is seen", exportDialog(page)),
  };
  acts[action]?.();
  return acts[action] !== undefined;
}
