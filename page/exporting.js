// What is seen as a file: pictures, and tables in CSV, with numbers in full and units in the names.

import { ENERGY_COUNT } from "./fields.js";
import { make, save } from "./elements.js";
import { fileWords, takeRecording } from "./taking.js";

/** @typedef {import("./run.js").Run} Run */

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
    fields.row("energy", state, [first, last], energies.length, /** @type {any} */ (energies));
    for (let bead = first; bead <= last; bead += 1) {
      rows.push([state.step, state.time_s, bead, state.u[bead], state.v[bead], energies[bead - first]]);
    }
  }
  return csv(rows);
}

/**
 * Energies, and the beads that are followed, at the rows in view.
 * @param {Run} run
 */
export function curvesCsv({ rows, physics }) {
  const names = ["kinetic_J", "potential_J", "left_J", "split_bead_J", "right_J", "dissipated_J", "driven_J"];
  const follow = rows?.request.follow ?? [];
  /** @type {(string | number)[][]} */
  const lines = [["step", "time_s", ...names, ...follow.flatMap((bead) => [`u_${bead}_m`, `v_${bead}_m_s`])]];
  for (let i = 0; rows && i < rows.count; i += 1) {
    const wide = 2 * follow.length;
    const energies = rows.energies.subarray(i * ENERGY_COUNT, (i + 1) * ENERGY_COUNT);
    lines.push([
      rows.steps[i],
      rows.steps[i] * physics.dt_s,
      ...energies,
      ...rows.followed.subarray(i * wide, (i + 1) * wide),
    ]);
  }
  return csv(lines);
}

/**
 * The map: a line for each row, a column for each column of the picture, named by its first place. These numbers are
 * what is painted: of several places the one of the largest magnitude, in single precision.
 * @param {Run} run
 */
export function mapCsv({ rows, physics }) {
  if (!rows) {
    return "";
  }
  const { request, columns } = rows;
  const [first, last] = request.places;
  const width = (last - first + 1) / columns;
  const places = Array.from({ length: columns }, (_, column) => first + Math.ceil(column * width));
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
  const text = (/** @type {string} */ part, /** @type {string} */ csv) =>
    save(`${name}-${part}.csv`, new Blob([csv], { type: "text/csv" }));
  const places = () => {
    const [from, to] = page.window().places;
    return /** @type {[number, number]} */ ([
      Math.max(0, Math.round(from)),
      Math.min(run.beads - 1, Math.ceil(to - 0.5)),
    ]);
  };
  /** @type {[string, string, () => void][]} */
  const files = [
    ["PNG", "all panels, at twice the size", () => page.board.savePng(name)],
    ["SVG", "all panels, for a paper or slides", () => page.board.saveSvg(name)],
    [
      "CSV: profile",
      "displacement, velocity, energy of the beads in view at the cursor",
      () => text("profile", profileCsv(run, places())),
    ],
    ["CSV: curves", "energies and followed beads over the time in view", () => text("curves", curvesCsv(run))],
    ["CSV: map", "the map as it is painted", () => text("map", mapCsv(run))],
  ];
  const words = fileWords(page.source, run.info);
  if (words !== undefined) {
    files.push(["MCAP", words, () => takeRecording(/** @type {any} */ (page.source), name).catch((error) => run.fault(error))]);
  }
  return make(
    "div",
    { class: "files" },
    ...files.flatMap(([what, words, onclick]) => [make("button", { onclick }, what), make("span", {}, words)]),
  );
}
