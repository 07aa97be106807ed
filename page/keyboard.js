// Keys and their actions: one table; `?` shows its words.

import { make } from "./elements.js";

/**
 * @typedef {object} Key
 * @property {string[]} keys as `KeyboardEvent.key` says, "Shift+" before those that need it said
 * @property {string} shown
 * @property {string} does
 * @property {string} action
 * @property {number} [by]
 */

/**
 * @param {string} keys separated by spaces
 * @param {string} shown
 * @param {string} does
 * @param {string} action
 * @param {number} [by]
 * @returns {Key}
 */
function key(keys, shown, does, action, by) {
  return { keys: keys.split(" ").map((name) => (name === "Space" ? " " : name)), shown, does, action, by };
}

/** @type {Key[]} */
export const KEYS = [
  key("Space", "space", "play, pause", "play"),
  key("ArrowLeft", "←", "a step back", "step", -1),
  key("ArrowRight", "→", "a step on", "step", 1),
  key("Shift+ArrowLeft", "shift ←", "a frame back", "frame", -1),
  key("Shift+ArrowRight", "shift →", "a frame on", "frame", 1),
  key("PageUp", "page up", "a twentieth of the window back", "leap", -1),
  key("PageDown", "page down", "a twentieth of the window on", "leap", 1),
  key("Home", "home", "the first step", "ends", -1),
  key("End", "end", "the last step", "ends", 1),
  key("n", "n", "newest state of a live run, and follow it", "live"),
  key(", .", ", .", "the event before, the next one", "event"),
  key("< >", "< >", "the pulse before, the next one", "pulse"),
  key("ArrowUp [", "↑ [", "the bead before", "bead", -1),
  key("ArrowDown ]", "↓ ]", "the next bead", "bead", 1),
  key("Enter", "enter", "follow the chosen bead, or no longer", "follow"),
  key("+ =", "+", "zoom into time", "zoomSteps", 0.5),
  key("-", "−", "out of time", "zoomSteps", 2),
  key("i", "i", "zoom into beads", "zoomPlaces", 0.5),
  key("u", "u", "out of beads", "zoomPlaces", 2),
  key("w", "w", "earlier", "panSteps", -0.25),
  key("s", "s", "later", "panSteps", 0.25),
  key("a", "a", "beads to the left", "panPlaces", -0.25),
  key("d", "d", "beads to the right", "panPlaces", 0.25),
  key("0", "0", "all of it", "whole"),
  key("1 2 3 4 5 6", "1 … 6", "velocity, displacement, overlap, energy density, contacts, force", "field"),
  key("l", "l", "logarithmic colours, linear ones", "log"),
  key("k", "k", "fix the ends of the colours", "colours"),
  key("r", "r", "a ruler from the chosen bead at the cursor, or none", "ruler"),
  key("R", "shift r", "its other end to the chosen bead at the cursor", "rulerEnd"),
  key("g", "g", "all digits of what is read out, or six", "digits"),
  key("t", "t", "light, dark", "theme"),
  key("v", "v", "prove the recording", "prove"),
  key("c", "c", "change one thing", "change"),
  key("e", "e", "export what is seen", "export"),
  key("o", "o", "open a file", "open"),
  key("b", "b", "back to the table of runs", "back"),
  key("?", "?", "this list", "help"),
];

/**
 * Listens to keys; those that a control has a use for stay its own.
 * @param {(action: string, by: number, key: string) => boolean} act whether it did something
 */
export function watchKeys(act) {
  addEventListener("keydown", (event) => {
    const target = /** @type {HTMLElement} */ (event.target);
    if (event.ctrlKey || event.metaKey || event.altKey || target.closest("dialog[open]")) {
      return;
    }
    const isSlider = target instanceof HTMLInputElement && target.type === "range";
    if (target.closest("input, select, textarea") && !isSlider) {
      return;
    }
    const own = target.closest("[role=tab]") ? [" ", "Enter", "ArrowLeft", "ArrowRight"] : [" ", "Enter"];
    if (target.closest("button, a, tr[tabindex]") && own.includes(event.key)) {
      return;
    }
    const name = event.shiftKey && event.key.startsWith("Arrow") ? `Shift+${event.key}` : event.key;
    const found = KEYS.find(({ keys }) => keys.includes(name));
    if (found && act(found.action, found.by ?? 0, event.key)) {
      event.preventDefault();
    }
  });
}

/** The table of all keys and of the gestures of the pointer. */
export function keyTable() {
  const pointer = [
    ["wheel", "zoom into time; with shift into beads, with ctrl into both"],
    ["drag", "move; with shift: zoom into a box; lays the ruler where there is one"],
    ["click", "choose time and bead"],
    ["double click", "all of it"],
    ["two fingers", "move and zoom"],
  ];
  const rows = [...KEYS.map(({ shown, does }) => [shown, does]), ...pointer];
  return make(
    "table",
    { class: "keys" },
    make(
      "tbody",
      {},
      ...rows.map(([shown, does]) =>
        make("tr", {}, make("th", { scope: "row" }, make("kbd", {}, shown)), make("td", {}, does)),
      ),
    ),
  );
}
