// Keys of `physics` in a manifest: those that this page knows, and those that can be changed.

import { BONDS } from "./laws.js";

/** Keys of a chain of one power law that something strikes, each with what it holds if that has keys, too. */
const PLAIN_KEYS = {
  ...{ kernel_version: 0, beads: 0, bead_mass_kg: 0, alpha: 0, stiffness: 0, method: 0, dt_s: 0, step_count: 0 },
  masses: { pattern_kg: 0, taper: 0, list_kg: 0 },
  stiffnesses: { pattern: 0, list: 0 },
  impurities: { bead: 0, mass_kg: 0 },
  contacts: { contact: 0, stiffness: 0 },
  ends: { left: 0, right: 0, left_stiffness: 0, right_stiffness: 0 },
  load: { gravity_m_s2: 0, precompression_n: 0 },
  damping: { viscous_n_s_per_m: 0, restitution: { coefficient: 0, damping_ratio: 0 } },
  striker: { bead: 0, velocity_m_s: 0 },
};

const RAMPS = { ramp_s: 0, ramp_down_s: 0 };
const SHAPES = {
  constant: 0,
  sine: { amplitude: 0, frequency_hz: 0, phase_rad: 0, until_s: 0, ...RAMPS },
  chirp: { amplitude: 0, from_hz: 0, to_hz: 0, duration_s: 0, ...RAMPS },
  step: { amplitude: 0, at_s: 0, rise_s: 0 },
  ramp: { amplitude: 0, from_s: 0, to_s: 0 },
  half_sine: { amplitude: 0, duration_s: 0, at_s: 0 },
  gaussian: { amplitude: 0, at_s: 0, width_s: 0, frequency_hz: 0 },
  table: { times_s: 0, values: 0, interpolation: 0 },
};

/** All known keys. Keys with a result in `/chain` are not looked into. */
const PHYSICS_KEYS = {
  ...PLAIN_KEYS,
  ...{ seed: 0, disorder: 0, spheres: 0, odd_spheres: 0, alphas: 0, second: 0, gaps_m: 0, initial: 0 },
  bonds: Object.fromEntries(
    Object.entries(BONDS).map(([key, { parameter }]) => [key, parameter === undefined ? 0 : { stiffness: 0, [parameter]: 0 }]),
  ),
  on_site: { linear_n_per_m: 0, cubic_n_per_m3: 0, drag_n_s_per_m: 0 },
  resonators: { mass_kg: 0, stiffness_n_per_m: 0 },
  ends: {
    ...PLAIN_KEYS.ends,
    ...{ left_material: 0, right_material: 0, absorbing_beads: 0, absorbing_drag_n_s_per_m: 0 },
  },
  damping: { ...PLAIN_KEYS.damping, kuwabara_kono_s: 0, power: { coefficient: 0, exponent: 0 } },
  strikers: PLAIN_KEYS.striker,
  drives: { wall: 0, bead: 0, force_n: SHAPES, displacement_m: SHAPES, velocity_m_s: SHAPES },
  baths: { beads: 0, temperature_j: SHAPES, temperature_k: SHAPES, friction_per_s: 0, seed: 0, pairs: 0 },
};

/**
 * The first key that is not among `known`, with the keys that lead to it; "" if there is none.
 * @param {unknown} values @param {object} known @returns {string}
 */
export function unknownKey(values, known) {
  if (typeof values !== "object" || values === null) {
    return "";
  }
  if (Array.isArray(values)) {
    for (const value of values) {
      const found = unknownKey(value, known);
      if (found !== "") {
        return found;
      }
    }
    return "";
  }
  for (const [key, value] of Object.entries(values)) {
    const inside = Object.hasOwn(known, key) ? Reflect.get(known, key) : undefined;
    const found = inside === undefined ? key : inside === 0 ? "" : unknownKey(value, inside);
    if (found !== "") {
      return inside === undefined ? key : `${key}.${found}`;
    }
  }
  return "";
}

/** The first key of `physics` that is not known here; "" if all are. @param {unknown} physics */
export function unknownPhysics(physics) {
  return unknownKey(physics, PHYSICS_KEYS);
}

/**
 * Reason why a chain cannot be changed here: a key of `physics`; "" if it can be changed.
 * @param {import("./types.d.ts").Physics} physics
 */
export function beyondPlain(physics) {
  const end = [physics.ends?.left, physics.ends?.right].find((kind) => kind && !["free", "fixed"].includes(kind));
  return unknownKey(physics, PLAIN_KEYS) || (end === undefined ? "" : `ends = "${end}"`);
}
