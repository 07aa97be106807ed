// Exports of the view: pictures, and tables in CSV, with numbers in full and units in the names.

import { captionOf } from "./caption.js";
import { curveCount } from "./rows.js";
import { make, save } from "./elements.js";
import { beadsOf } from "./map.js";
import { filmWords, hasFilm, makeFilm } from "./film.js";
import { fileWords, takeRecording } from "./taking.js";

/** @typedef {import("./run.js").Run} Run */

/** Rows of a table that a browser still holds in memory as text. */
const MOST_ROWS = 2_000_000;

/** @param {(string | number)[][]} rows */
function csv(rows) {
  return `${rows.map((row) => row.join(",")).join("\n")}\n`;
}

/**
 * The profile at the cursor, of the beads in view.
 * @param {Run} run
 * @param {[number, number]} places
 */
export function profileCsv({ state, fields }, [first, last]) {
  /** @type {(string | number)[][]} */
  const rows = [["step", "time_s", "bead", "displacement_m", "velocity_m_s", "energy_J"]];
  if (state) {
    const energies = new Float64Array(last - first + 1);
    fields.row("energy", state, [first, last], energies.length, energies);
    for (let bead = first; bead <= last; bead += 1) {
      rows.push([state.step, state.time_s, bead, state.u[bead], state.v[bead], energies[bead - first]]);
    }
  }
  return csv(rows);
}

/**
 * Energies, and the beads that are followed, at every step; where steps are not recomputed, of every state that is there.
 * @param {Run} run
 * @param {{ steps: [number, number], follow: number[] }} request
 * @param {(rows: number) => void} onrows how many there are so far
 * @returns {Promise<string[]>} pieces of the text
 */
export async function curvesCsv({ engine, physics }, request, onrows) {
  const { follow } = request;
  const names = ["kinetic_J", "potential_J", "left_J", "split_bead_J", "right_J", "dissipated_J", "driven_J", "total_J"];
  const beads = follow.flatMap((bead) => [`u_${bead}_m`, `v_${bead}_m_s`]);
  const pieces = [csv([["step", "time_s", ...names, ...beads]])];
  const wide = curveCount(follow);
  let count = 0;
  await engine.series(request, ({ steps, values }) => {
    /** @type {(string | number)[][]} */
    const lines = [];
    steps.forEach((step, i) => {
      lines.push([step, step * physics.dt_s, ...values.subarray(i * wide, (i + 1) * wide)]);
    });
    if (lines.length > 0) {
      pieces.push(csv(lines));
    }
    count += lines.length;
    onrows(count);
  });
  return pieces;
}

/**
 * The map: a line for each row, a column for each column of the picture, named by its first place. These numbers are
 * what is painted: of the places and steps of a cell the value of the largest magnitude.
 * @param {Run} run
 */
export function mapCsv({ rows, physics }) {
  if (!rows) {
    return "";
  }
  const { request, columns } = rows;
  const [first, last] = request.places;
  const count = last - first + 1;
  const places = Array.from({ length: columns }, (_, column) => first + Math.ceil((column * count) / columns));
  /** @type {(string | number)[][]} */
  const lines = [["step", "time_s", ...places.map((place) => `${request.field}_${place}`)]];
  for (let i = 0; i < rows.count; i += 1) {
    lines.push([rows.steps[i], rows.steps[i] * physics.dt_s, ...rows.cells.subarray(i * columns, (i + 1) * columns)]);
  }
  return csv(lines);
}

/**
 * Buttons that save what is seen.
 * @param {import("./page.js").Page} page
 */
export function exportDialog(page) {
  const run = /** @type {Run} */ (page.run);
  const name = run.info.manifest.provenance.name.replace(/[^\w-]+/g, "-") || "beadline";
  const text = (/** @type {string} */ part, /** @type {string[]} */ ...pieces) => {
    const head = captionOf(page, { isTable: true }).map((line) => `# ${line.replace(/[\r\n]/g, " ")}\n`);
    save(`${name}-${part}.csv`, new Blob([...head, ...pieces], { type: "text/csv" }));
  };
  const { steps } = page.window();
  /** @type {[number, number]} */
  const window = [Math.max(run.info.firstStep, Math.floor(steps[0])), Math.min(run.info.lastStep, Math.ceil(steps[1]))];
  const stepCount = window[1] - window[0] + 1;
  const isTooLong = stepCount > MOST_ROWS;
  const curves = async (/** @type {Record<"currentTarget", HTMLButtonElement>} */ { currentTarget: button }) => {
    const words = button.textContent ?? "";
    button.disabled = true;
    try {
      const request = { steps: window, follow: page.followed };
      const onrows = (/** @type {number} */ rows) => {
        button.textContent = `${Math.round((100 * rows) / stepCount)} %`;
      };
      text("curves", ...(await curvesCsv(run, request, onrows)));
    } catch (error) {
      run.fault(error);
    }
    button.textContent = words;
    button.disabled = false;
  };
  const places = () => {
    const [from, to] = beadsOf({ ...page.window(), field: page.view.field });
    return /** @type {[number, number]} */ ([
      Math.max(0, Math.round(from)),
      Math.min(run.beads - 1, Math.ceil(to - 0.5)),
    ]);
  };
  /** @type {[string, string, (event: any) => void][]} */
  const files = [
    ["PNG", "all panels with a caption, at twice the size", () => page.board.savePng(name, captionOf(page))],
    ["SVG", "all panels with a caption, for a paper or slides", () => page.board.saveSvg(name, captionOf(page))],
    [
      "CSV: profile",
      "displacement, velocity, energy of the beads in view at the cursor",
      () => text("profile", profileCsv(run, places())),
    ],
    [
      "CSV: curves",
      run.info.recomputes
        ? `energies and followed beads at every step in view: ${stepCount}${isTooLong ? ", too many: zoom in" : ""}`
        : "energies and followed beads of every recorded state in view",
      curves,
    ],
    ["CSV: map", "the map as it is painted: of each cell the value farthest from 0", () => text("map", mapCsv(run))],
  ];
  const filmed = (/** @type {"webm" | "png"} */ kind) => () => makeFilm(page, kind, name);
  const [webm, png] = [filmed("webm"), filmed("png")];
  files.push(["WebM", filmWords(page), webm], ["PNG series", "the same as pictures in a ZIP file, at twice the size", png]);
  const words = fileWords(page.source, run.info);
  if (words !== undefined) {
    files.push(["MCAP", words, () => takeRecording(/** @type {any} */ (page.source), name).catch((error) => run.fault(error))]);
  }
  /** @type {Map<unknown, boolean>} */
  const isNone = new Map([
    [curves, isTooLong],
    [webm, !hasFilm(page, "webm")],
    [png, !hasFilm(page, "png")],
  ]);
  return make(
    "div",
    { class: "files" },
    ...files.flatMap(([what, words, onclick]) => [
      make("button", { onclick, disabled: isNone.get(onclick) }, what),
      make("span", {}, words),
    ]),
  );
}
