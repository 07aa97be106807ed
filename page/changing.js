// The form in which one thing is changed, and the configuration of the changed run.

import { changed, changesOf, configuration, whyNotChanged, whyNothingChanged } from "./change.js";
import { amount } from "./axes.js";
import { make } from "./elements.js";

/** @typedef {import("./change.js").Change} Change */
/** @typedef {import("./run.js").Run} Run */

/**
 * A change as the fragment has it.
 * @param {string} text
 * @returns {Change | undefined}
 */
export function readChange(text) {
  const match = /^(mass|alpha|speed|drive|bond):(\d{1,12})(?:\.([\w.]{1,64}))?:([-+.e\d]{1,32})$/.exec(text);
  return match
    ? { what: /** @type {Change["what"]} */ (match[1]), bead: Number(match[2]), value: Number(match[4]), part: match[3] }
    : undefined;
}

/** A change for the fragment. @param {Change} change */
export function writeChange({ what, bead, part, value }) {
  return `${what}:${bead}${part ? `.${part}` : ""}:${value}`;
}

/**
 * A change in words: what is changed, to what, and what it was.
 * @param {Change} change
 * @param {Run} run
 */
export function describe(change, { physics, info }) {
  const known = changesOf(physics, info.chain).find((one) => isSame(one.change, change));
  const [name, unit] = known ? [known.name, known.unit] : [change.what, ""];
  const then = known ? amount(known.change.value, unit, 6) : "";
  return { name, now: amount(change.value, unit, 6), then };
}

/** True if two changes are of the same thing. @param {Change} a @param {Change} b */
function isSame(a, b) {
  return a.what === b.what && a.part === b.part && (!["mass", "drive"].includes(a.what) || a.bead === b.bead);
}

/**
 * The changed chain, to be opened; throws an Error that says why it cannot be.
 * @param {Change} change
 * @param {Run} run
 * @returns {import("./types.d.ts").Source}
 */
export function changedSource(change, { info, physics, beads }) {
  const why =
    (info.recomputes ? "" : info.whyNot) ||
    (change.bead < beads ? "" : "There is no such bead.") ||
    whyNotChanged(change, physics);
  if (why) {
    throw new Error(why);
  }
  return { kind: "start", ...changed(change, info.manifest, info.chain) };
}

/**
 * @param {Run} run
 * @param {Run | undefined} second what is shown now with a change
 * @param {Change | undefined} change that one's
 * @param {(change: Change | undefined) => void} onchange
 */
export function changeForm(run, second, change, onchange) {
  const { info, physics } = run;
  const whyNothing = info.recomputes ? whyNothingChanged(physics) : info.whyNot;
  if (whyNothing) {
    return [make("p", { class: "words" }, whyNothing)];
  }
  const choices = changesOf(physics, info.chain);
  const chosen = Math.max(
    0,
    choices.findIndex((one) => change && isSame(one.change, change)),
  );
  const select = make(
    "select",
    { id: "change-what" },
    ...choices.map(({ name }, i) => make("option", { value: i }, name)),
  );
  select.value = String(chosen);
  const input = make("input", {
    id: "change-value",
    type: "text",
    inputmode: "decimal",
    autocomplete: "off",
    spellcheck: "false",
  });
  const slider = make("input", {
    type: "range",
    min: -1,
    max: 1,
    step: 0.01,
    "aria-label": "value, from a tenth to ten times",
  });
  const unit = make("span");
  const why = make("p", { class: "words", role: "status" });
  const choice = () => choices[Number(select.value)];
  const value = () => ({ ...choice().change, value: Number(input.value.trim() || NaN) });
  const check = () => {
    why.textContent = whyNotChanged(value(), physics);
  };
  const reset = () => {
    const isShown = change && second && isSame(choice().change, change);
    input.value = String(isShown ? change.value : choice().change.value);
    unit.textContent = choice().unit;
    slider.hidden = choice().change.what === "alpha";
    slider.value = String(Math.log10(Math.abs(Number(input.value) / choice().change.value)) || 0);
    check();
  };
  select.addEventListener("change", reset);
  input.addEventListener("input", check);
  slider.addEventListener("input", () => {
    input.value = String(Number((choice().change.value * 10 ** Number(slider.value)).toPrecision(3)));
    check();
  });
  const form = make(
    "form",
    {
      onsubmit: (/** @type {Event} */ event) => {
        event.preventDefault();
        check();
        if (why.textContent === "") {
          onchange(value());
        }
      },
    },
    make("label", {}, "change ", select),
    make("label", {}, "to ", input, " ", unit),
    slider,
    make(
      "div",
      { class: "row" },
      make("button", { class: "main" }, "Simulate beside it"),
      make(
        "button",
        { type: "button", disabled: second === undefined, onclick: () => onchange(undefined) },
        "Take back",
      ),
    ),
    why,
  );
  reset();
  const words = make(
    "p",
    { class: "words" },
    "The chain is simulated here from step 0 and shown beside the run, at the same times." +
      " With another α the stiffness becomes one that leaves L and T as they are.",
  );
  if (!second) {
    return [form, words];
  }
  const text = configuration(second.info.manifest);
  const copy = make(
    "button",
    {
      type: "button",
      onclick: async () => {
        try {
          await navigator.clipboard.writeText(text);
          copy.textContent = "Copied";
        } catch {
          getSelection()?.selectAllChildren(listing); // not allowed here: it can be copied by hand
        }
      },
    },
    "Copy",
  );
  const listing = make("pre", { tabindex: 0 }, text);
  return [
    form,
    words,
    make("div", { class: "row" }, make("h3", {}, "Configuration for `beadline run`"), copy),
    listing,
  ];
}
