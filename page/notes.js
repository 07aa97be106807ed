// Notes of one's own at beads and times of a run: shown on the map, listed, and kept in a copy of the shared file.

import { TICK_PX, amount } from "./axes.js";
import { make, save } from "./elements.js";
import { mapScales, placeOfBead } from "./map.js";

/** @typedef {import("./page.js").Page} Page */
/** @typedef {{ bead: number, step: number, text: string }} Note */

const MOST_NOTES = 500;
const MOST_CHARACTERS = 2000;
const ID = "own-notes";

/** A note that is written and not yet added: the form is made anew where the cursor moves. */
let draft = "";

/** @param {any} note @returns {note is Note} */
function isNote(note) {
  const isWhole = (/** @type {unknown} */ number) => Number.isSafeInteger(number) && Number(number) >= 0;
  return isWhole(note?.bead) && isWhole(note?.step) && typeof note?.text === "string" && note.text.length <= MOST_CHARACTERS;
}

/** The notes that came with the page. @returns {Note[]} */
export function carriedNotes() {
  try {
    const notes = JSON.parse(document.getElementById(ID)?.textContent ?? "[]");
    return Array.isArray(notes) ? notes.filter(isNote).slice(0, MOST_NOTES) : [];
  } catch {
    return []; // the recording is there without them
  }
}

/** The document before the page has changed it: texts, and scripts, which nothing changes. */
export class Original {
  constructor() {
    const { documentElement: root, head, body } = document;
    const tag = /** @type {Element} */ (root.cloneNode(false)).outerHTML.replace("</html>", "");
    this.before = `<!doctype html>\n${tag}\n${head.outerHTML}\n<body>`;
    /** @type {(string | HTMLScriptElement)[]} */
    this.parts = [...body.childNodes].map((node) =>
      node instanceof HTMLScriptElement ? node : node instanceof Element ? node.outerHTML : (node.textContent ?? ""),
    );
  }

  /** The same document with these notes. @param {Note[]} notes */
  withNotes(notes) {
    // in a script nothing but `<` can end it
    const text = JSON.stringify(notes).replace(/</g, "\\u003c");
    const block = `<script type="application/json" id="${ID}">${text}<${"/"}script>`;
    const parts = this.parts.flatMap((part) => {
      if (typeof part === "string") {
        return [part];
      }
      return part.id === ID ? [] : part.id === "code" ? [block, part.outerHTML] : [part.outerHTML];
    });
    return [this.before, ...parts, "\n</body>\n</html>\n"];
  }
}

/**
 * Draws the numbers of notes on a map.
 * @param {import("./surface.js").Surface} surface
 * @param {import("./surface.js").Box} box
 * @param {import("./map.js").View} view of the map
 * @param {Note[]} notes
 * @param {number} factor steps of this map for a step of a note
 * @param {import("./colours.js").Theme} theme
 */
export function drawNotes(surface, box, view, notes, factor, { accent, background }) {
  const { plot, x, y } = mapScales(box, view);
  surface.clip(plot.x, plot.y, plot.width, plot.height, () => {
    notes.forEach(({ bead, step }, i) => {
      const [left, top] = [x(placeOfBead(bead, view)), y(step * factor)];
      surface.circle(left, top, 9, { fill: background, colour: accent, width: 1.5 });
      surface.text(left, top, `${i + 1}`, { size: TICK_PX, align: "center", colour: accent, bold: true });
    });
  });
}

/**
 * The list of notes, and the form for another one.
 * @param {Page} page
 */
export function noteList(page) {
  const run = /** @type {import("./run.js").Run} */ (page.run);
  const { notes } = page;
  const where = ({ bead, step } = { bead: page.bead, step: page.step }) =>
    `bead ${bead}, ${amount(step * run.physics.dt_s, "s", 6)}`;
  const change = (/** @type {Note[]} */ changed) => {
    page.notes = changed;
    page.tabs.forget();
    page.board.invalidate();
  };
  const lines = notes.map((note, i) => {
    const go = () => {
      page.look({ bead: Math.min(note.bead, run.beads - 1) });
      page.seek(note.step);
    };
    const away = () => change(notes.filter((other) => other !== note));
    return make(
      "li",
      {},
      make("button", { class: "link", onclick: go }, where(note)),
      make("button", { class: "quiet", "aria-label": `delete note ${i + 1}`, onclick: away }, "✕"),
      make("p", {}, note.text),
    );
  });
  if (page.source?.kind !== "bytes") {
    return [make("p", { class: "words" }, "Notes are kept in a shared file, which `beadline share` makes of a recording.")];
  }
  const keep = () => {
    draft = text.value;
  };
  const text = make("textarea", { id: "note-text", rows: 3, maxlength: MOST_CHARACTERS, oninput: keep });
  text.value = draft;
  const add = (/** @type {Event} */ event) => {
    event.preventDefault();
    const written = text.value.trim();
    if (written !== "" && notes.length < MOST_NOTES) {
      draft = "";
      change([...notes, { bead: page.bead, step: page.step, text: written }]);
    }
  };
  const copy = () => {
    const name = run.info.manifest.provenance.name.replace(/[^\w-]+/g, "-") || "beadline";
    save(`${name}.html`, new Blob(page.original.withNotes(page.notes), { type: "text/html" }));
  };
  const form = make(
    "form",
    { onsubmit: add },
    make("label", { for: "note-text", id: "note-where" }, `A note at ${where()}`),
    text,
    make(
      "div",
      { class: "row" },
      make("button", {}, "Add"),
      make("button", { type: "button", class: "main", onclick: copy }, "Save a copy"),
    ),
  );
  return [
    form,
    make("p", { class: "words" }, "Notes are in the copy that you save, with all else that is in this file; this file stays as it is."),
    make("ol", { class: "notes" }, ...lines),
  ];
}
