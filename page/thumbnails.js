// Pictures of the runs of a table, each opened for it and closed again.

import { sourceOf } from "./carried.js";
import { Engine } from "./engine.js";

/**
 * Draws a small picture of a whole run.
 * @param {import("./page.js").Page} page
 * @param {import("./types.d.ts").Entry} entry
 * @param {HTMLCanvasElement} canvas
 */
export async function thumbnail(page, entry, canvas) {
  if (entry.kind === "live") {
    canvas.classList.add("blank");
    return;
  }
  const engine = await Engine.open(await sourceOf(entry), page.startWorker);
  try {
    const { info } = engine;
    const last = info.manifest.physics.beads - 1;
    const request = {
      field: /** @type {const} */ ("velocity"),
      places: /** @type {[number, number]} */ ([0, last]),
      columns: canvas.width,
      steps: /** @type {[number, number]} */ ([info.firstStep, info.lastStep]),
      rows: canvas.height,
      follow: [],
    };
    await new Promise((done, failed) => {
      engine
        .rows(request, (rows) => {
          page.pictures.thumbnail(canvas, rows);
          if (rows.isWhole) {
            done(undefined);
          }
        })
        .then(done, failed);
    });
  } finally {
    engine.onfault = undefined;
    engine.close();
  }
}
