// Change one thing: the chain of a run with another mass, exponent, striker, drive or bond, and its configuration.

import { scalesOf } from "./fields.js";
import { beyondPlain, unknownPhysics } from "./keys.js";
import { checkPhysics } from "./manifest.js";

/** @typedef {import("./types.d.ts").Manifest} Manifest */
/** @typedef {import("./types.d.ts").Chain} Chain */
/** @typedef {import("./types.d.ts").Physics} Physics */

/**
 * A change: "mass" (kg, of `bead`), "alpha", "speed" of the striker (m/s), a number of the drive `bead` at the path
 * `part`, or the stiffness `part` of all bonds.
 * @typedef {{ what: "mass" | "alpha" | "speed" | "drive" | "bond", bead: number, value: number, part?: string }} Change
 */

/** Numbers of a waveform that are changed here. */
const OF_DRIVES = ["constant", "amplitude", "frequency_hz", "phase_rad"];

/** Stiffnesses of bonds, and the springs that they make: terms of δ, δ² and δ³. @type {[string, number, string][]} */
const OF_BONDS = [
  ["linear", 1, "N/m"],
  ["quadratic", 2, "N/m²"],
  ["cubic", 3, "N/m³"],
];

/** Beads, and drives, of which changes are offered. */
const MOST_OFFERED = 200;

/**
 * The numbers of drives that can be changed.
 * @param {Physics} physics
 * @returns {{ name: string, unit: string, change: Change }[]}
 */
function ofDrives({ drives = [] }) {
  return drives.slice(0, MOST_OFFERED).flatMap((drive, bead) => {
    const where = drive.wall ? `${drive.wall} wall` : `bead ${drive.bead}`;
    return /** @type {const} */ (["force_n", "displacement_m", "velocity_m_s"]).flatMap((kind) =>
      Object.entries(drive[kind] ?? {}).flatMap(([shape, held]) => {
        const numbers = typeof held === "number" ? { [shape]: held } : /** @type {Record<string, unknown>} */ (held);
        return Object.entries(numbers)
          .filter(([key, value]) => OF_DRIVES.includes(key) && typeof value === "number")
          .map(([key, value]) => ({
            name: `${key.replace(/_\w+$/, "")} of the drive of ${where}`,
            unit: { frequency_hz: "Hz", phase_rad: "rad" }[key] ?? { force_n: "N", displacement_m: "m", velocity_m_s: "m/s" }[kind],
            change: { what: /** @type {const} */ ("drive"), bead, value: Number(value), part: key === shape ? `${kind}.${key}` : `${kind}.${shape}.${key}` },
          }));
      }),
    );
  });
}

/**
 * The stiffnesses of bonds that can be changed: those that all bonds have.
 * @param {Physics} physics @param {Chain} chain
 * @returns {{ name: string, unit: string, change: Change }[]}
 */
function ofBonds({ bonds }, { terms = [] }) {
  return OF_BONDS.flatMap(([part, power, unit]) => {
    const value = /** @type {Record<string, unknown> | undefined} */ (bonds)?.[part];
    const springs = terms.filter((term) => term.kind === "spring" && term.parameter === power);
    const isOfAll = springs.length === 1 && springs[0].stiffness.every((k) => k === value);
    return typeof value === "number" && isOfAll
      ? [{ name: `${part} stiffness of bonds`, unit, change: { what: /** @type {const} */ ("bond"), bead: 0, value, part } }]
      : [];
  });
}

/**
 * Possible changes of a run.
 * @param {Physics} physics
 * @param {Chain} chain
 * @returns {{ name: string, unit: string, change: Change }[]}
 */
export function changesOf(physics, chain) {
  const { impurities, striker, alpha } = physics;
  const isPlain = beyondPlain(physics) === "";
  const beads = [...new Set([...impurities.slice(0, MOST_OFFERED).map(({ bead }) => bead), striker.bead])];
  const all = [
    ...beads.map((bead) => ({
      name: `mass of bead ${bead}`,
      unit: "kg",
      change: /** @type {Change} */ ({ what: "mass", bead, value: chain.mass[bead] }),
    })),
    ...(isPlain ? [{ name: "exponent α", unit: "", change: /** @type {Change} */ ({ what: "alpha", bead: 0, value: alpha }) }] : []),
    {
      name: "speed of the striker",
      unit: "m/s",
      change: /** @type {Change} */ ({ what: "speed", bead: 0, value: striker.velocity_m_s }),
    },
    ...ofDrives(physics),
    ...ofBonds(physics, chain),
  ];
  return isPlain ? all : all.filter(({ change }) => change.what === "drive" || whyNotChanged(change, physics) === "");
}

/** Why no change is made here in this chain; "" if some can be. @param {Physics} physics */
export function whyNothingChanged(physics) {
  const isRounded = (physics.seed ?? 0) > Number.MAX_SAFE_INTEGER;
  const beyond = physics.initial !== undefined ? "initial" : isRounded ? "a seed above 2^53" : unknownPhysics(physics);
  return beyond && `Nothing is changed here in a chain with ${beyond}: change its configuration, and run that.`;
}

/** Keys beside which the mass of a bead, and nothing else, becomes another one. */
const MASSES_ARE_FREE = ["bonds", "drives", "strikers", "gaps_m", "second", "alphas"];

/**
 * Why a change is not made here; "" if it can be.
 * @param {Change} change
 * @param {Physics} physics
 */
export function whyNotChanged(change, physics) {
  const { what, value } = change;
  const whyNothing = whyNothingChanged(physics);
  if (whyNothing) {
    return whyNothing;
  }
  const { load, damping, stiffnesses } = physics;
  if (what === "bond" && load) {
    return "Bonds cannot be changed here under load: the overlaps at rest depend on them.";
  }
  const others = Object.fromEntries(Object.entries(physics).filter(([key]) => !MASSES_ARE_FREE.includes(key)));
  const beyond = beyondPlain(what === "mass" ? /** @type {any} */ (others) : physics);
  if (beyond && (what === "mass" || what === "alpha")) {
    const name = { mass: "A mass", alpha: "α" }[what];
    return `${name} cannot be changed here in a chain with ${beyond}: change its configuration, and run that.`;
  }
  if (!Number.isFinite(value) || (what === "mass" && value <= 0) || (what === "alpha" && (value < 1 || value > 10))) {
    const allowed = { mass: "A mass is more than 0 kg.", alpha: "α is from 1 to 10.", speed: "A speed is a number." };
    return { ...allowed, drive: "Expected a number.", bond: "Expected a number." }[what];
  }
  if (what === "speed" && value === 0 && !load && !physics.drives?.length && !physics.strikers?.length) {
    return "A striker at rest leaves the chain at rest.";
  }
  if (what === "alpha" && (load || damping)) {
    return load
      ? "α cannot be changed here under load: the overlaps at rest depend on it."
      : "α cannot be changed here with damping: the dashpots depend on it.";
  }
  if (what === "alpha" && stiffnesses !== undefined) {
    return "α cannot be changed here: the stiffnesses follow a rule of their own.";
  }
  if (what === "mass" && load?.gravity_m_s2) {
    return "A mass cannot be changed here under gravity: the overlaps at rest depend on it.";
  }
  if (what === "mass" && damping?.restitution) {
    return "A mass cannot be changed here with a coefficient of restitution: the dashpots depend on it.";
  }
  if (what === "mass" && stiffnesses === "radii") {
    return "A mass cannot be changed here: the stiffnesses follow the beads' radii.";
  }
  if (what === "mass" || what === "alpha") {
    return "";
  }
  try {
    checkPhysics(withNumber(change, physics));
  } catch (error) {
    return `There is no such run: ${/** @type {Error} */ (error).message}.`;
  }
  return "";
}

/**
 * The physics with another speed, number of a drive, or stiffness of all bonds.
 * @param {Change} change
 * @param {Physics} before
 */
function withNumber({ what, bead, value, part = "" }, before) {
  const physics = structuredClone(before);
  const keys = what === "speed" ? ["striker", "velocity_m_s"] : what === "bond" ? ["bonds", part] : ["drives", bead, ...part.split(".")];
  const last = keys.pop() ?? "";
  const held = keys.reduce((/** @type {any} */ inside, key) => inside?.[key], physics);
  if (typeof held?.[last] !== "number") {
    throw new Error(`the manifest has no number at ${[...keys, last].join(".")}`);
  }
  // L and T are those of a bond, but in manifests that took a cubic one for linear
  const was = what === "bond" ? scaleOfBonds(held) : undefined;
  held[last] = value + 0; // −0 is 0
  return was?.alpha === physics.alpha && was?.stiffness === physics.stiffness ? Object.assign(physics, scaleOfBonds(held)) : physics;
}

/** The largest stiffness of a law of bonds, which may have a parameter, and be a list or a pattern. @param {any} bond */
const stiffest = (bond) => {
  const stiffness = bond?.stiffness ?? bond ?? 0;
  return [stiffness.pattern ?? stiffness.list ?? stiffness].flat().reduce((most, k) => Math.max(most, k), -Infinity);
};

/** The exponent and the stiffness of L and T: of a bond with a slope at rest, or else of the cubic one. @param {object} bonds */
function scaleOfBonds(bonds) {
  const acting = Object.entries(bonds).map(([name, bond]) => ({ name, stiffness: stiffest(bond) })).filter((one) => one.stiffness > 0);
  const found = acting.find(({ name }) => !["quadratic", "cubic"].includes(name)) ?? acting.find(({ name }) => name === "cubic");
  return { alpha: found?.name === "cubic" ? 3 : 1, stiffness: found?.stiffness ?? stiffest(Object.values(bonds)[0]) };
}

/** The slope (N/m) of the stiffest bonds at the overlap L. @param {any} physics @param {Chain} chain */
function slopeOfBonds(physics, chain) {
  const { length_m } = scalesOf(physics, chain);
  return OF_BONDS.reduce((sum, [name, power]) => sum + power * Math.abs(stiffest(physics.bonds[name])) * Math.pow(length_m, power - 1), 0);
}

/** T up to a factor that stays: of a striker with v0, L/v0. @param {Physics} physics */
function collisionTime({ bead_mass_kg: m, stiffness: k, alpha, striker: { velocity_m_s: v } }) {
  return v === 0 ? 0 : Math.pow((m * v * v) / k, 1 / (alpha + 1)) / Math.abs(v);
}

/**
 * The run with a change. The step becomes shorter with T and with a bead that is lighter than any other; the simulated
 * time stays. With another α the stiffnesses become such that L and T stay, so that runs can be compared.
 * @param {Change} change
 * @param {Manifest} manifest
 * @param {Chain} chain
 * @returns {{ manifest: Manifest, chain: Chain }}
 */
export function changed(change, manifest, chain) {
  const { what, bead, value, part = "" } = change;
  const before = manifest.physics;
  const physics = what === "mass" || what === "alpha" ? structuredClone(before) : withNumber(change, before);
  const other = structuredClone(chain);
  let shorter = 1;
  if (what === "mass") {
    other.mass[bead] = value;
    const impurity = physics.impurities.find((one) => one.bead === bead);
    if (impurity) {
      impurity.mass_kg = value;
    } else {
      physics.impurities.push({ bead, mass_kg: value });
    }
    const lightest = chain.mass.reduce((least, mass) => Math.min(least, mass));
    shorter = Math.min(1, Math.sqrt(value / lightest));
  } else if (what === "speed") {
    const [now, then] = [collisionTime(physics), collisionTime(before)];
    shorter = now > 0 && then > 0 ? now / then : 1;
    shorter = beyondPlain(before) && !(shorter < 1) ? 1 : shorter;
  } else if (what === "drive") {
    const [now, then] = [physics, before].map((one) => scalesOf(one, chain).time_s);
    shorter = now > 0 && then > 0 ? Math.min(1, now / then) : 1;
  } else if (what === "bond") {
    const power = OF_BONDS.find(([name]) => name === part)?.[1];
    const spring = other.terms?.find((term) => term.kind === "spring" && term.parameter === power);
    if (!spring) {
      throw new Error(`There is no stiffness ${part} of all bonds.`);
    }
    const [now, then] = [physics, before].map((one) => slopeOfBonds(one, chain));
    shorter = then > 0 ? Math.min(1, Math.sqrt(then / now)) : 1;
    spring.stiffness.fill(value);
    for (const end of /** @type {const} */ (["leftWall", "rightWall", "ring"])) {
      spring[end] = spring[end] ? value : spring[end];
    }
  } else if (what === "alpha") {
    const length = Math.abs(before.striker.velocity_m_s) * collisionTime(before);
    const factor = Math.pow(length, before.alpha - value);
    physics.alpha = value;
    physics.stiffness *= factor;
    for (const contact of physics.contacts ?? []) {
      contact.stiffness *= factor;
    }
    for (const end of /** @type {const} */ (["left_stiffness", "right_stiffness"])) {
      if (physics.ends?.[end] !== undefined) {
        physics.ends[end] *= factor;
      }
    }
    other.stiffness = other.stiffness.map((k) => k * factor);
    for (const wall of [other.leftWall, other.rightWall]) {
      if (wall) {
        wall.stiffness *= factor;
      }
    }
  }
  const { left, right, absorbing_drag_n_s_per_m: given } = before.ends ?? {};
  if (given === undefined && [left, right].includes("absorbing")) {
    // by default it follows T, and so what is changed; here it stays as it is, but for rounding where another drag is added to it
    const usual = ((before.load || before.bonds ? 0.5 : 0.005) * before.bead_mass_kg) / scalesOf(before, chain).time_s;
    const found = chain.drag?.[left === "absorbing" ? 0 : before.beads - 1] ?? usual;
    physics.ends = { ...physics.ends, absorbing_drag_n_s_per_m: Math.abs(found / usual - 1) < 1e-9 ? found : usual };
  }
  if (shorter !== 1) {
    physics.dt_s = before.dt_s * shorter;
    physics.step_count = Math.max(1, Math.round((before.step_count * before.dt_s) / physics.dt_s));
  }
  const name = `${manifest.provenance.name}-changed`.slice(-64).replace(/^-+/, "");
  return { manifest: { ...manifest, physics, provenance: { ...manifest.provenance, name } }, chain: other };
}

/** @param {unknown} value @returns {string} */
function tomlValue(value) {
  if (Array.isArray(value)) {
    return `[${value.map(tomlValue).join(", ")}]`;
  }
  if (typeof value === "object" && value !== null) {
    return `{ ${Object.entries(value)
      .map(([key, part]) => `${key} = ${tomlValue(part)}`)
      .join(", ")} }`;
  }
  // in full digits these would be whole numbers of TOML, which end at 2^63
  return typeof value === "number" && Math.abs(value) >= 2 ** 53 ? value.toExponential() : JSON.stringify(value);
}

/**
 * The configuration that `beadline run` takes for these manifest's physics.
 * @param {Manifest} manifest
 */
export function configuration({ physics, provenance }) {
  const { beads, bead_mass_kg, alpha, stiffness, masses, stiffnesses, impurities, contacts } = physics;
  const { damping, dt_s, step_count, ends, load, striker, method } = physics;
  const { publish_every_steps, record_every_steps } = provenance;
  const kind = damping?.restitution ? { restitution: damping.restitution.coefficient } : damping;
  const { seed, disorder, spheres, odd_spheres, alphas, second, gaps_m, bonds, on_site, resonators, drives, baths, strikers } =
    /** @type {any} */ (physics);
  // spheres and bonds stand for what they make
  const law = spheres ? {} : bonds ? { bead_mass_kg, masses } : { bead_mass_kg, alpha, stiffness, masses, stiffnesses };
  const isStruck = striker.velocity_m_s !== 0;
  const hasOne = !strikers?.length;
  const top = { seed, disorder, drive: drives, bath: baths, striker: hasOne ? undefined : [striker, ...strikers] };
  const tables = Object.entries({
    chain: {
      beads,
      ...law,
      ...{ spheres, odd_spheres, alphas, second, gaps_m, bonds },
      impurities: impurities.length > 0 ? impurities : undefined,
      contacts: contacts?.length ? contacts : undefined,
    },
    ends,
    load,
    damping: kind,
    ...{ on_site, resonators },
    striker: hasOne && (isStruck || !drives?.length) ? striker : undefined,
    time: { duration_s: dt_s * step_count, dt_s },
    integrator: { method },
    stream: { publish_every_steps, record_every_steps },
  }).filter(([, table]) => table !== undefined);
  const text = tables.map(([name, table]) => {
    const lines = Object.entries(table ?? {}).filter(([, value]) => value !== undefined && value !== null);
    return [`[${name}]`, ...lines.map(([key, value]) => `${key} = ${tomlValue(value)}`), ""].join("\n");
  });
  const first = Object.entries(top)
    .filter(([, value]) => value !== undefined)
    .map(([key, value]) => `${key} = ${tomlValue(value)}`);
  return [`name = ${JSON.stringify(provenance.name)}`, ...first, "", ...text].join("\n");
}
