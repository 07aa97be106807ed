// Caption of a file that the page makes: the run with its parameters, the time and the part that are shown, and the
// change.

import { amount } from "./axes.js";
import { leftOut } from "./curves.js";
import { summaryOf } from "./tables.js";
import { FIELDS } from "./view.js";
import { placeWord } from "./run.js";

/** @typedef {import("./page.js").Page} Page */
/** @typedef {import("./run.js").Run} Run */

/**
 * A change in words, such as "mass of bead 50: 800 mg, recorded 600 mg".
 * @param {Page} page
 */
export function changeWords({ changed }) {
  return changed === undefined ? "" : `${changed.name}: ${changed.now}, recorded ${changed.then}`;
}

/**
 * Lines of a caption.
 * @param {Page} page
 * @param {{ isTable?: boolean }} [options] of a table there is no map
 */
export function captionOf(page, { isTable = false } = {}) {
  const run = /** @type {Run} */ (page.run);
  const { info, physics } = run;
  const { provenance } = info.manifest;
  const { places, steps } = page.window();
  const dt = physics.dt_s;
  const time = (/** @type {number} */ step) => amount(Math.round(step) * dt, "s", 6);
  const field = FIELDS.find(([name]) => name === page.view.field)?.[1] ?? "";
  const where = `${placeWord(page.view.field)}s ${Math.max(0, Math.round(places[0]))} to ${Math.ceil(places[1] - 0.5)}`;
  const lines = [
    `${provenance.name}: ${summaryOf(run)}`,
    `${isTable ? "" : `map of ${field}, `}${where}, ${time(steps[0])} to ${time(steps[1])}; at the cursor ` +
      `${time(page.step)}, step ${page.step}`,
  ];
  const words = changeWords(page);
  if (words) {
    lines.push(`changed, dashed: ${words}`);
  }
  if (page.comparison.other) {
    const difference = page.comparison.difference ? ", and the difference as a map" : "";
    const isOver = page.secondState ? "" : "; it has no state at the cursor";
    lines.push(`compared, dashed: ${page.comparison.other.name}${difference}${isOver}`);
  }
  const missing = isTable ? "" : leftOut(run.rows, info);
  if (missing) {
    lines.push(`curves and map: ${missing}`);
  }
  lines.push(`run ${provenance.run_id}, ${provenance.program}`);
  return lines;
}
