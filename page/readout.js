// Readout: the values at the pointer, or else at the cursor, in six digits or in full, with their descriptions.

import { amount } from "./axes.js";
import { byId, make } from "./elements.js";
import { placeWord, unitOf } from "./run.js";
import { FIELDS } from "./view.js";

/** Digits of a number that nobody has asked for all of. */
const DIGITS = 6;

/** @typedef {import("./page.js").Page} Page */
/** @typedef {import("./run.js").Run} Run */

export class ReadOut {
  /** @param {Page} page */
  constructor(page) {
    this.page = page;
    /** True if a state is on its way. */
    this.isBusy = false;
    this.saying = 0;
  }

  /** The values at the pointer, or else at the cursor. */
  show() {
    const { page } = this;
    const run = /** @type {Run} */ (page.run);
    const { field } = page.view;
    const at = page.hover ?? { place: Math.min(page.bead, run.lastPlace(field)), step: page.step };
    const show = (/** @type {import("./types.d.ts").State} */ state) => {
      const place = Math.min(at.place, run.lastPlace(field));
      const value = run.value(field, state, place);
      const number = page.view.digits ? `${value}` : `${Number(value.toPrecision(DIGITS))}`;
      const word = field === "contacts" ? ["touching", "compressed", "open"][value] : `${number} ${unitOf(field)}`;
      const parts = [`${placeWord(field)} ${place}`, amount(state.time_s, "s", 7), `step ${state.step}`];
      const name = FIELDS.find(([one]) => one === field)?.[1] ?? "";
      const output = byId("readout");
      output.replaceChildren(
        ...parts.map((part) => make("span", {}, part)),
        make("b", {}, field === "contacts" ? word : `${name} ${word}`),
      );
      output.title = `${value}: all digits by the key g`;
      Object.assign(output.dataset, { place, step: state.step, value });
      if (!page.hover && !page.timeline.isPlaying && !page.isFollowing) {
        this.say(`${parts.join(", ")}, ${name} ${word}`);
      }
    };
    if (!page.hover || (run.state && run.state.step === at.step)) {
      if (run.state) {
        show(run.state);
      }
      return;
    }
    if (this.isBusy) {
      return; // asked again when the answer has come
    }
    this.isBusy = true;
    const asked = page.hover;
    run.engine
      .state(at.step)
      .then(
        (state) => {
          if (page.run === run && page.hover) {
            show(state);
          }
        },
        () => {},
      )
      .finally(() => {
        this.isBusy = false;
        if (page.hover && page.hover !== asked) {
          page.board.invalidate();
        }
      });
  }

  /** For those who hear the page; not more often than they can. @param {string} text */
  say(text) {
    clearTimeout(this.saying);
    this.saying = setTimeout(() => {
      byId("said").textContent = text;
    }, 400);
  }
}
