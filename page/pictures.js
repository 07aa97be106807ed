// What is drawn on each canvas: the run, and the changed one, in the window that is looked at.

import { byId } from "./elements.js";
import { theme, colourScale } from "./colours.js";
import { drawMap, mapScales } from "./map.js";
import { drawProfile } from "./profile.js";
import { drawEnergies, drawTrajectories } from "./curves.js";

/** @typedef {import("./board.js").Box} Box */
/** @typedef {import("./run.js").Run} Run */

export class Pictures {
  /** @param {import("./page.js").Page} page */
  constructor(page) {
    this.page = page;
    /** Where the maps and the profile were drawn last. @type {Map<string, Box>} */
    this.boxes = new Map();
  }

  names() {
    return ["map", "second", "profile", "energies", "path", "marks"];
  }
}
