// Change one thing: the chain of a run with another mass, exponent or striker, and its configuration.

import { beyondPlain } from "./keys.js";

/** @typedef {import("./types.d.ts").Manifest} Manifest */
/** @typedef {import("./types.d.ts").Chain} Chain */
/** @typedef {import("./types.d.ts").Physics} Physics */

/**
 * What is changed: `what` is "mass" (kg, of `bead`), "alpha" or "speed" (m/s).
 * @typedef {{ what: "mass" | "alpha" | "speed", bead: number, value: number }} Change
 */

/**
 * What can be changed in a run.
 * @param {Physics} physics
 * @param {Chain} chain
 * @returns {{ name: string, unit: string, change: Change }[]}
 */
export function changesOf({ impurities, striker, alpha }, chain) {
  const beads = [...new Set([...impurities.map(({ bead }) => bead), striker.bead])];
  return [
    ...beads.map((bead) => ({
      name: `mass of bead ${bead}`,
      unit: "kg",
      change: /** @type {Change} */ ({ what: "mass", bead, value: chain.mass[bead] }),
    })),
    { name: "exponent α", unit: "", change: { what: "alpha", bead: 0, value: alpha } },
    { name: "speed of the striker", unit: "m/s", change: { what: "speed", bead: 0, value: striker.velocity_m_s } },
  ];
}

/** Why no change is made here in this chain; "" if some can be. @param {Physics} physics */
export function whyNothingChanged(physics) {
  const beyond = beyondPlain(physics);
  return beyond && `Nothing is changed here in a chain with ${beyond}: change its configuration, and run that.`;
}

/**
 * Why a change is not made here; "" if it can be.
 * @param {Change} change
 * @param {Physics} physics
 */
export function whyNotChanged({ what, value }, physics) {
  const whyNothing = whyNothingChanged(physics);
  if (whyNothing) {
    return whyNothing;
  }
  const { load, damping, stiffnesses } = physics;
  if (!Number.isFinite(value) || (what === "mass" && value <= 0) || (what === "alpha" && (value < 1 || value > 10))) {
    return { mass: "A mass is more than 0 kg.", alpha: "α is from 1 to 10.", speed: "A speed is a number." }[what];
  }
  if (what === "speed" && value === 0 && !load) {
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
  return "";
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
export function changed({ what, bead, value }, manifest, chain) {
  const before = manifest.physics;
  const physics = structuredClone(before);
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
    physics.striker.velocity_m_s = value;
    const [now, then] = [collisionTime(physics), collisionTime(before)];
    shorter = now > 0 && then > 0 ? now / then : 1;
  } else {
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
  return JSON.stringify(value);
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
  const tables = Object.entries({
    chain: {
      beads,
      bead_mass_kg,
      alpha,
      stiffness,
      masses,
      stiffnesses,
      impurities: impurities.length > 0 ? impurities : undefined,
      contacts: contacts?.length ? contacts : undefined,
    },
    ends,
    load,
    damping: kind,
    striker,
    time: { duration_s: dt_s * step_count, dt_s },
    integrator: { method },
    stream: { publish_every_steps, record_every_steps },
  }).filter(([, table]) => table !== undefined);
  const text = tables.map(([name, table]) => {
    const lines = Object.entries(table ?? {}).filter(([, value]) => value !== undefined && value !== null);
    return [`[${name}]`, ...lines.map(([key, value]) => `${key} = ${tomlValue(value)}`), ""].join("\n");
  });
  return [`name = ${JSON.stringify(provenance.name)}`, "", ...text].join("\n");
}
