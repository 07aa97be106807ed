// Tables of a run in words and numbers: parameters and provenance, pulses, events, progress of a live run.

import { make, shown, table } from "./elements.js";
import { amount } from "./axes.js";

/** @typedef {import("./run.js").Run} Run */

/**
 * Names and values, in sections.
 * @param {[string, string][]} pairs
 */
function pairsOf(pairs) {
  return make("dl", {}, ...pairs.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
}

/** @param {string} text */
function heading(text) {
  return make("h3", {}, text);
}

/** @param {string} text */
function words(text) {
  return make("p", { class: "words" }, text);
}

/** A rule of masses or stiffnesses in words. @param {unknown} rule */
function ruleOf(rule) {
  const text = typeof rule === "string" ? rule : JSON.stringify(rule).replace(/["{}]/g, "").replace(/_/g, " ");
  return text.length > 120 ? `${text.slice(0, 117)} …` : text;
}

/** Strikers, and drives, that are named. */
const MOST_ROWS = 20;

/** Keys of a manifest for chains beyond one power law; their values are shown as they are. */
const FURTHER = [
  ...["contacts", "alphas", "second", "gaps_m", "bonds", "on_site", "resonators", "spheres", "odd_spheres"],
  ...["disorder", "seed", "initial"],
];

/** @param {import("./types.d.ts").Physics} physics @param {number | undefined} digits */
function lawOf(physics, digits) {
  const { alpha, stiffness } = physics;
  if ("bonds" in physics) {
    return "two-sided bonds";
  }
  const isMore = "second" in physics || "alphas" in physics;
  return `F = k·δ^α, α = ${alpha}, k = ${amount(stiffness, "", digits)} N/m^α${isMore ? ", and more below" : ""}`;
}

/**
 * Names and values of what a chain is, and what happens to it.
 * @param {import("./types.d.ts").Physics} physics
 * @param {number | undefined} digits of numbers; undefined: all of them
 */
function chainPairs(physics, digits) {
  const { impurities, load, damping, ends } = physics;
  /** @type {[string, string][]} */
  const chain = [
    ["beads", `${physics.beads} of ${amount(physics.bead_mass_kg, "kg", digits)}`],
    ["contact law", lawOf(physics, digits)],
  ];
  const strikers = [physics.striker, ...(physics.strikers ?? [])].filter(({ velocity_m_s: v }) => v !== 0);
  for (const { bead, velocity_m_s: speed } of strikers.slice(0, MOST_ROWS)) {
    chain.push(["striker", `bead ${bead} at ${amount(speed, "m/s", digits)}`]);
  }
  if (strikers.length > MOST_ROWS) {
    chain.push(["strikers", `and ${strikers.length - MOST_ROWS} more`]);
  }
  if (impurities.length > 0) {
    const some = impurities.slice(0, 6).map(({ bead, mass_kg: mass }) => `bead ${bead} of ${amount(mass, "kg", digits)}`);
    chain.push(["impurities", some.join(", ") + (impurities.length > 6 ? ` and ${impurities.length - 6} more` : "")]);
  }
  if (physics.masses !== undefined) {
    chain.push(["masses", ruleOf(physics.masses)]);
  }
  if (physics.stiffnesses !== undefined) {
    chain.push(["stiffnesses", ruleOf(physics.stiffnesses)]);
  }
  for (const name of FURTHER) {
    const value = /** @type {Record<string, unknown>} */ (/** @type {unknown} */ (physics))[name];
    if (value !== undefined && !(Array.isArray(value) && value.length === 0)) {
      chain.push([name.replace(/_/g, " "), ruleOf(value)]);
    }
  }
  const drives = physics.drives ?? [];
  for (const { wall, bead, ...prescribed } of drives.slice(0, MOST_ROWS)) {
    chain.push(["drive", `${wall ? `${wall} wall` : `bead ${bead}`}, ${ruleOf(prescribed)}`]);
  }
  if (drives.length > MOST_ROWS) {
    chain.push(["drives", `and ${drives.length - MOST_ROWS} more`]);
  }
  for (const { beads, pairs, friction_per_s: friction, seed, temperature_j: joule, temperature_k: kelvin } of (
    physics.baths ?? []
  ).slice(0, MOST_ROWS)) {
    const [held, unit] = joule === undefined ? [kelvin, "K"] : [joule, "J"];
    const { constant } = held ?? {};
    const temperature = typeof constant === "number" ? amount(constant, unit, digits) : `${ruleOf(held)} ${unit}`;
    const own = seed === undefined ? "" : `, seed ${seed}`;
    chain.push([pairs ? "pair bath" : "bath", `beads ${beads}: ${temperature}, friction ${friction} 1/s${own}`]);
  }
  if (ends) {
    const { left = "free", right = "free", ...more } = ends;
    chain.push(["ends", [left, right, ...(Object.keys(more).length > 0 ? [ruleOf(more)] : [])].join(", ")]);
  }
  if (load?.gravity_m_s2) {
    chain.push(["gravity", amount(load.gravity_m_s2, "m/s²", digits)]);
  }
  if (load?.precompression_n) {
    chain.push(["precompression", amount(load.precompression_n, "N", digits)]);
  }
  if (damping?.restitution) {
    chain.push(["restitution", `${damping.restitution.coefficient}`]);
  }
  if (damping?.viscous_n_s_per_m !== undefined) {
    chain.push(["viscous damping", `${damping.viscous_n_s_per_m} N·s/m`]);
  }
  if (damping?.kuwabara_kono_s !== undefined) {
    chain.push(["damping of Kuwabara and Kono", amount(damping.kuwabara_kono_s, "s", digits)]);
  }
  if (damping?.power) {
    const { coefficient, exponent } = damping.power;
    chain.push(["damping", `η·δ^p·dδ/dt, η = ${amount(coefficient, "", digits)}, p = ${exponent}`]);
  }
  return chain;
}

/** The parameters of a run in a line. @param {Run} run */
export function summaryOf({ physics }) {
  const parts = chainPairs(physics, 6).map(([name, value]) => (name === "contact law" ? value : `${name} ${value}`));
  return [...parts, `${physics.method}, dt = ${amount(physics.dt_s, "s", 6)}`].join("; ");
}

/**
 * Parameters and provenance.
 * @param {Run} run
 * @param {number} [digits] of numbers; without it all of them
 */
export function runTable({ info, physics }, digits) {
  const { provenance } = info.manifest;
  const chain = chainPairs(physics, digits);
  const { length_m: length, time_s: time } = info.scales;
  /** @type {[string, string][]} */
  const time_ = [
    ["duration", `${amount(physics.step_count * physics.dt_s, "s", 9)}, ${physics.step_count} steps`],
    ["dt", amount(physics.dt_s, "s", digits)],
    ["method", `${physics.method}, kernel ${physics.kernel_version}`],
    ...(time > 0
      ? /** @type {[string, string][]} */ ([["scales", `L = ${amount(length, "m", 6)}, T = ${amount(time, "s", 6)}`]])
      : []),
  ];
  const started = provenance.started_unix_ns / 1e6;
  /** @type {[string, string][]} */
  const origin = [
    ["run", provenance.name],
    ["id", provenance.run_id],
    ["program", provenance.program],
    ["host", provenance.host],
    ["started", started > 0 ? new Date(started).toISOString().replace("T", " ").replace(/\..*/, " UTC") : "not known"],
  ];
  for (const key of /** @type {const} */ (["author", "orcid", "licence", "doi"])) {
    const said = provenance[key];
    if (said !== undefined) {
      origin.push([key, shown(said)]);
    }
  }
  if (info.kind === "recording") {
    origin.push(["stored states", `${info.storedCount}, steps ${info.firstStep} to ${info.lastStep}`]);
    origin.push(["ended", info.end ? info.end.reason : "not closed: it was cut short, or is still being written"]);
  }
  return [heading("Chain"), pairsOf(chain), heading("Time"), pairsOf(time_), heading("Origin"), pairsOf(origin)];
}

/**
 * @param {Run} run
 * @param {(step: number) => void} onstep
 */
export function pulseTable({ pulses, physics, info }, onstep) {
  if (pulses.length === 0) {
    const why =
      info.kind === "live"
        ? "Pulses of a live run: `beadline pulses live`."
        : "No pulses came with this run: `beadline pulses` finds them.";
    return [words(why)];
  }
  const rows = pulses.map((pulse) => [
    `${pulse.pulse} ${pulse.direction === "forward" ? "→" : "←"}`,
    `${pulse.birth}, ${pulse.birth_bead}`,
    amount(pulse.birth_time_s, "s", 4),
    pulse.fate,
    amount(pulse.v_peak_m_s, "m/s", 4),
    Number(pulse.velocity_beads_per_s.toPrecision(4)),
    pulse.fwhm_beads === null ? "" : Number(pulse.fwhm_beads.toPrecision(3)),
  ]);
  const head = ["pulse", "born of, at bead", "at", "fate", "peak", "beads/s", "beads wide"];
  return [table("pulses", head, rows, (row) => onstep(Math.round(pulses[row].birth_time_s / physics.dt_s)))];
}

/**
 * @param {Run} run
 * @param {number} bead
 * @param {(step: number) => void} onstep
 */
export function eventTable(run, bead, onstep) {
  const known = run.events.get(bead);
  const title = heading(`Bead ${bead}`);
  if (!known) {
    const isGrowing = run.info.kind === "live" && run.ended === "";
    return [title, words(isGrowing ? "Events are looked for when the run has ended." : "The map comes first …")];
  }
  const { events, isDone } = known;
  const state = isDone ? `${events.length} events, every step looked at.` : `Looking … ${events.length} events so far.`;
  const shown = events.slice(0, 1000); // a table longer than this nobody reads, and the browser toils
  const more = events.length > shown.length ? [words(`The first ${shown.length} are shown.`)] : [];
  const rows = shown.map(({ kind, time_s: time, step, u_m: u }) => [
    kind.replace("-", " "),
    amount(time, "s", 6),
    step,
    amount(u, "m", 5),
  ]);
  return [
    title,
    words(state),
    table("events", ["event", "time", "step", "displacement"], rows, (row) => onstep(events[row].step)),
    ...more,
  ];
}

/** @param {Run} run */
export function liveTable({ info, status, ended }) {
  if (info.kind !== "live") {
    return [words("This run is not live.")];
  }
  if (!status) {
    return [words(ended || "Waiting for the run …")];
  }
  const { state, step, steps_per_s: rate, frames_seen: seen, frames_skipped: skipped, consumers } = status;
  const rows = consumers.map(({ label, delivery, pid, lag_frames: lag, frames_missed: missed }) => [
    label,
    delivery,
    pid ?? "",
    lag ?? "",
    missed ?? "",
  ]);
  return [
    heading("Run"),
    pairsOf([
      ["state", ended || state],
      ["step", `${step}`],
      ["rate", `${Math.round(rate)} steps/s`],
      ["frames seen", `${seen}`],
      ["frames skipped", `${skipped}`],
    ]),
    heading("Consumers"),
    rows.length > 0
      ? table("consumers", ["name", "delivery", "process", "lag", "missed"], rows)
      : words("None but this page."),
  ];
}
