// The form in which the numbers at the ends of the colours are fixed, so that they stay wherever one looks.

import { make } from "./elements.js";
import { unitOf } from "./run.js";

/** @typedef {import("./page.js").Page} Page */

/** The least and the largest number of a map, and 0. @param {import("./types.d.ts").Rows | undefined} rows */
export function endsOf(rows) {
  let [low, high] = [0, 0];
  for (let i = 0; rows && i < rows.count * rows.columns; i += 1) {
    low = Math.min(low, rows.cells[i]);
    high = Math.max(high, rows.cells[i]);
  }
  return /** @type {[number, number]} */ ([low, high]);
}

/** Why colours cannot have these ends; "" if they can. @param {number} low @param {number} high */
export function whyNoColours(low, high) {
  if (!Number.isFinite(low) || !Number.isFinite(high)) {
    return "Both are numbers, such as −2.5 or 3e-6.";
  }
  return low <= 0 && high >= 0 && low < high
    ? ""
    : "0 has a colour of its own: the least is at most 0, the largest at least 0, and they differ.";
}

/**
 * @param {Page} page
 * @param {() => void} ondone
 */
export function colourForm(page, ondone) {
  const [low, high] = page.view.colours ?? endsOf(page.run?.rows).map((end) => Number(end.toPrecision(3)));
  const input = (/** @type {string} */ id, /** @type {number} */ value) =>
    make("input", { id, type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: "false", value });
  const [least, largest] = [input("colours-least", low), input("colours-largest", high)];
  const why = make("p", { class: "words", role: "status" });
  const number = (/** @type {HTMLInputElement} */ { value }) => Number(value.trim().replace("−", "-") || NaN);
  const fix = (/** @type {Event} */ event) => {
    event.preventDefault();
    const ends = /** @type {[number, number]} */ ([number(least), number(largest)]);
    why.textContent = whyNoColours(...ends);
    if (why.textContent === "") {
      page.look({ colours: ends });
      ondone();
    }
  };
  const free = () => {
    page.look({ colours: undefined });
    ondone();
  };
  const unit = unitOf(page.view.field);
  return make(
    "form",
    { class: "small", onsubmit: fix },
    make("label", {}, "from ", least, ` ${unit}`),
    make("label", {}, "to ", largest, ` ${unit}`),
    make(
      "div",
      { class: "row" },
      make("button", { class: "main" }, "Fix"),
      make("button", { type: "button", onclick: free }, "As what is seen"),
    ),
    why,
    make(
      "p",
      { class: "words" },
      "Fixed colours stay while you scroll and zoom, hold for both maps, and are in the address. What lies beyond has the colour of the end." +
        " Another quantity has colours of its own again.",
    ),
  );
}
