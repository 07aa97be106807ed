// A manifest is refused here for what the command refuses it for (schemas/src/manifest), as far as it says that itself: the
// longest step and the range of the scales follow from a resolved chain, and `verify` knows them.

import { METHODS } from "./kernel.js";
import { BONDS } from "./laws.js";
import { Waveform } from "./waveforms.js";

/** @typedef {(value: any, key: string) => void} Rule throws an Error whose message is for the user */
/** @typedef {Record<string, Rule>} Rules */

const MOST_BEADS = 20e6;
const MOST_STEPS = 2 ** 52;
const MOST_EXPONENTS = 16;
const MOST_DISORDERS = 16;
const MOST_FRICTION = 0.5; // of baths, in a step
const STEPS_OF_PERIOD = 20;
const LONGEST_SHOWN = 60;

/** @param {string} key @param {unknown} found @param {string} allowed @returns {never} */
function refuse(key, found, allowed) {
  const text = JSON.stringify(found) ?? "nothing";
  const short = text.length > LONGEST_SHOWN ? `${text.slice(0, LONGEST_SHOWN)}…` : text;
  throw new Error(`the manifest has an impossible ${key}: found ${short}; allowed: ${allowed}`);
}

/** @param {(value: any) => boolean} isRight @param {string} allowed @returns {Rule} */
const rule = (isRight, allowed) => (value, key) => void (isRight(value) || refuse(key, value, allowed));

const isPositive = (/** @type {number} */ x) => x >= 1e-100 && x <= 1e100;
const number = (/** @type {(x: number) => boolean} */ isRight, /** @type {string} */ allowed) =>
  rule((x) => typeof x === "number" && isRight(x), allowed);
const positive = number(isPositive, "a positive number, 1e-100 to 1e100");
const orZero = number((x) => x === 0 || isPositive(x), "0, or 1e-100 to 1e100");
const eitherSign = number((x) => x === 0 || isPositive(Math.abs(x)), "0, or 1e-100 to 1e100 in size");
const finite = number((x) => Math.abs(x) <= 1e100, "a number of at most 1e100 in size");
const between = (/** @type {number} */ least, /** @type {number} */ most) =>
  number((x) => x >= least && x <= most, `a number from ${least} to ${most}`);
const count = (/** @type {number} */ least, /** @type {number} */ most) =>
  number((x) => Number.isInteger(x) && x >= least && x <= most, `a whole number from ${least} to ${most}`);
const anyCount = count(0, 2 ** 64);
const text = rule((x) => typeof x === "string", "a text");
const word = (/** @type {string[]} */ ...known) => rule((x) => known.includes(x), known.join(", "));

/** @param {Rule} of @param {number} [least] values @param {number} [most] @returns {Rule} */
function list(of, least = 0, most = Infinity) {
  return (values, key) => {
    if (!Array.isArray(values)) {
      refuse(key, values, "a list");
    }
    if (values.length < least || values.length > most) {
      refuse(key, `${values.length} values`, least === most ? `${least}` : `${least} to ${most}`);
    }
    values.forEach((value, i) => of(value, `${key}[${i}]`));
  };
}

/** @param {Rules} needed keys @param {Rules} [further] @returns {Rule} */
function object(needed, further = {}) {
  return (value, key) => {
    if (typeof value !== "object" || value === null || Array.isArray(value)) {
      refuse(key, value, "an object");
    }
    const at = (/** @type {string} */ name) => (key === "" ? name : `${key}.${name}`);
    for (const [name, inside] of Object.entries(value)) {
      const known = [needed, further].find((rules) => Object.hasOwn(rules, name));
      known === undefined ? refuse(at(name), inside, "no such key") : known[name](inside, at(name));
    }
    for (const name of Object.keys(needed)) {
      if (!Object.hasOwn(value, name)) {
        refuse(at(name), undefined, "a value");
      }
    }
  };
}

/** One key of several, or one of these words. @param {Rules} forms @param {string[]} words @returns {Rule} */
function one(forms, ...words) {
  const inside = object({}, forms);
  return (value, key) => {
    if (!words.includes(value)) {
      inside(value, key);
      if (Object.keys(value).length !== 1) {
        refuse(key, value, `one of ${[...words, ...Object.keys(forms)].join(", ")}`);
      }
    }
  };
}

/** A number, or some for these places. @param {Rule} of @param {number} places @returns {Rule} */
function profile(of, places) {
  const several = one({ pattern: list(of, 1, places), list: list(of, places, places) });
  return (value, key) => (typeof value === "number" ? of : several)(value, key);
}

/** Each place once, in order. @param {any[]} values @param {string} name @param {string} key */
function inOrder(values, name, key) {
  values.forEach((value, i) => {
    if (i > 0 && values[i - 1][name] >= value[name]) {
      refuse(`${key}[${i}].${name}`, value[name], "each once, in order");
    }
  });
}

const MATERIAL = {
  ...{ density_kg_m3: positive, young_pa: positive },
  poisson: number((x) => x > -1 && x <= 0.5, "above −1 and at most 0.5"),
};
const SPHERE = { radius_m: positive, ...MATERIAL };
const RAMPS = { ramp_s: orZero, ramp_down_s: orZero };
const WAVEFORM = one({
  constant: finite,
  sine: object({ amplitude: finite, frequency_hz: positive }, { phase_rad: finite, until_s: positive, ...RAMPS }),
  chirp: object({ amplitude: finite, from_hz: orZero, to_hz: orZero, duration_s: positive }, RAMPS),
  step: object({ amplitude: finite }, { at_s: finite, rise_s: orZero }),
  ramp: object({ amplitude: finite, to_s: finite }, { from_s: finite }),
  half_sine: object({ amplitude: finite, duration_s: positive }, { at_s: finite }),
  gaussian: object({ amplitude: finite, at_s: finite, width_s: positive }, { frequency_hz: orZero }),
  table: object({ times_s: list(finite, 2), values: list(finite, 2) }, { interpolation: word("linear", "cubic") }),
});
/** Seeds that JSON keeps. */
const seed = count(0, Number.MAX_SAFE_INTEGER);
const BATH = object(
  { beads: rule((x) => typeof x === "string" && /^\d+\.\.\d+$/.test(x), 'beads such as "0..4"'), friction_per_s: positive },
  { temperature_j: WAVEFORM, temperature_k: WAVEFORM, seed, pairs: rule((x) => x === true, "true") },
);
const DAMPING = one({
  viscous_n_s_per_m: positive,
  kuwabara_kono_s: positive,
  power: object({ coefficient: positive, exponent: between(0, 100) }),
  restitution: object({ coefficient: between(1e-3, 1 - 1e-9), damping_ratio: number(() => true, "a number") }),
});
const DISORDER = object(
  { of: word("masses", "radii", "stiffnesses") },
  {
    ...{ uniform: between(0, 10), normal: between(0, 10), log_normal: between(0, 10) },
    two_valued: object({ fraction: between(0, 1), factor: number(() => true, "a number") }),
    permuted: rule((x) => typeof x === "boolean", "true or false"),
  },
);

/** Rules for the value of each key of `physics`. @param {number} beads @param {number} contacts */
function rulesOf(beads, contacts) {
  const bead = count(0, beads - 1);
  const exponent = between(1, 1000);
  const struck = object({
    bead,
    velocity_m_s: number((x) => Object.is(x, 0) || isPositive(Math.abs(x)), "0, or 1e-100 to 1e100 in size"),
  });
  const end = word("free", "fixed", "periodic", "absorbing");
  const moved = { displacement_m: finite, velocity_m_s: finite };
  const ofContacts = (/** @type {Rule} */ of) => profile(of, contacts);
  const ofBeads = (/** @type {Rule} */ of) => profile(of, beads);
  return object(
    {
      ...{ kernel_version: count(0, 2 ** 32 - 1), beads: count(2, MOST_BEADS), bead_mass_kg: positive, alpha: exponent },
      ...{ stiffness: positive, impurities: list(object({ bead, mass_kg: positive })), striker: struck },
      ...{ method: word(...METHODS), dt_s: number((x) => x > 0, "a positive number"), step_count: count(1, MOST_STEPS) },
    },
    {
      masses: one(
        { pattern_kg: list(positive, 1, beads), list_kg: list(positive, beads, beads), taper: positive },
        "uniform",
      ),
      stiffnesses: one(
        { pattern: list(positive, 1, beads), list: list(positive, contacts, contacts) },
        ...["uniform", "radii"],
      ),
      contacts: list(object({ contact: count(0, contacts - 1), stiffness: positive })),
      ends: object(
        {},
        {
          ...{ left: end, right: end, left_stiffness: positive, right_stiffness: positive },
          ...{ left_material: object(MATERIAL), right_material: object(MATERIAL) },
          ...{ absorbing_beads: count(1, beads), absorbing_drag_n_s_per_m: positive },
        },
      ),
      load: object({}, { gravity_m_s2: finite, precompression_n: between(0, 1e100) }),
      damping: DAMPING,
      strikers: list(struck),
      seed: anyCount,
      disorder: list(DISORDER, 0, MOST_DISORDERS),
      spheres: (value, key) => (Array.isArray(value) ? list(object(SPHERE), 1, beads) : object(SPHERE))(value, key),
      odd_spheres: list(object({ bead, ...SPHERE })),
      alphas: ofContacts(exponent),
      second: object({ alpha: exponent, stiffness: ofContacts(orZero) }),
      gaps_m: ofContacts(orZero),
      bonds: object(
        {},
        Object.fromEntries(
          Object.entries(BONDS).map(([key, { hasEitherSign, parameter }]) => {
            const stiffness = ofContacts(hasEitherSign ? eitherSign : orZero);
            return [key, parameter === undefined ? stiffness : object({ stiffness, [parameter]: positive })];
          }),
        ),
      ),
      on_site: object(
        {},
        { linear_n_per_m: ofBeads(orZero), cubic_n_per_m3: ofBeads(orZero), drag_n_s_per_m: ofBeads(orZero) },
      ),
      resonators: object({ mass_kg: ofBeads(orZero), stiffness_n_per_m: ofBeads(positive) }),
      initial: object(
        {},
        {
          ...{ displacements_m: list(finite, 1), velocities_m_s: list(finite, 1), solitary: list(text, 0, 0) },
          ...{ resonator_displacements_m: list(finite, 1), resonator_velocities_m_s: list(finite, 1) },
          gaussian: object({ bead: finite, width_beads: positive }, moved),
          plane_wave: object({ cycles: finite }, { ...moved, phase_rad: finite }),
          mode: object({ number: count(1, beads) }, moved),
          thermal: one({ temperature_k: positive, energy_j: positive }),
          from: object({ recording: text, step: anyCount }, { sha256: text }),
        },
      ),
      drives: list(
        object({}, {
          ...{ wall: word("left", "right"), bead, force_n: WAVEFORM, displacement_m: WAVEFORM, velocity_m_s: WAVEFORM },
        }),
        ...[0, Math.floor(beads / 2)],
      ),
      baths: list(BATH, 0, beads),
    },
  );
}

/** The coefficient of restitution of a damping ratio. @param {number} ratio */
function restitutionOf(ratio) {
  const [below, above] = [1 - ratio, 1 + ratio];
  if (below > 0) {
    return Math.exp((-ratio / Math.sqrt(below * above)) * 4 * Math.atan(Math.sqrt(below / above)));
  }
  const rate = Math.sqrt(-below * above);
  return below < 0 ? Math.pow(ratio + rate, (-2 * ratio) / rate) : Math.exp(-2);
}

/** Refuses keys that spheres, bonds and other laws exclude. @param {any} physics */
function checkLaws(physics) {
  const { alpha, masses, stiffnesses, impurities, contacts, spheres, odd_spheres: odd, ends, damping } = physics;
  const { alphas, second, gaps_m: gaps, bonds, load, disorder = [], bead_mass_kg: mass, beads } = physics;
  const isRule = (/** @type {unknown} */ found) => found !== undefined && found !== "uniform";
  inOrder(impurities, "bead", "impurities");
  inOrder(contacts ?? [], "contact", "contacts");
  inOrder(odd ?? [], "bead", "odd_spheres");
  if (masses?.taper !== undefined && !isPositive(mass * masses.taper ** (beads - 1))) {
    refuse("masses.taper", masses.taper, "a last bead of 1e-100 to 1e100 kg");
  }
  if (stiffnesses === "radii" && alpha !== 1.5) {
    refuse("stiffnesses", stiffnesses, "alpha = 1.5 with radii");
  }
  if (spheres === undefined && (odd?.length > 0 || ends?.left_material || ends?.right_material)) {
    refuse("spheres", undefined, "spheres, where some of them or of walls are of a material");
  }
  if (spheres && (isRule(masses) || isRule(stiffnesses) || impurities.length > 0 || alpha !== 1.5)) {
    refuse("spheres", "spheres", "no masses, impurities or stiffnesses beside them, and alpha = 1.5");
  }
  const written = typeof alphas === "number" ? [alphas] : alphas?.pattern ?? alphas?.list ?? [];
  if (new Set(written).size > MOST_EXPONENTS) {
    refuse("alphas", "more exponents", `at most ${MOST_EXPONENTS} different ones`);
  }
  const isLoaded = Boolean(load?.gravity_m_s2 || load?.precompression_n);
  if (gaps !== undefined && isLoaded) {
    refuse("gaps_m", "gaps with a load", "no gaps in a chain that is pressed together");
  }
  if (bonds) {
    const isElse = alphas !== undefined || second || gaps !== undefined || spheres || isRule(stiffnesses);
    if (isElse || contacts?.length > 0 || load?.gravity_m_s2) {
      refuse("bonds", "bonds and contacts", "bonds alone");
    }
    if (!Object.entries(BONDS).some(([key, { holds }]) => holds && bonds[key] !== undefined)) {
      refuse("bonds", bonds, "one among them that has a bottom");
    }
  }
  disorder.forEach((/** @type {any} */ one, /** @type {number} */ i) => {
    const { of, permuted, ...asked } = one;
    if (Object.keys(asked).length + Number(permuted === true) !== 1) {
      refuse(`disorder[${i}]`, one, "one of uniform, normal, log_normal, two_valued, permuted");
    }
    if (of === "radii" && !spheres && stiffnesses !== "radii") {
      refuse(`disorder[${i}].of`, of, "radii only with spheres, or with stiffnesses by radii");
    }
  });
  const { coefficient, damping_ratio: ratio } = damping?.restitution ?? { coefficient: 1, damping_ratio: 0 };
  if (!(Math.abs(restitutionOf(ratio) - coefficient) <= 1e-9)) {
    refuse("damping.restitution.damping_ratio", ratio, `that of the coefficient ${coefficient}`);
  }
}

/** Refuses keys that ends, springs and methods exclude. @param {any} physics */
function checkEnds(physics) {
  const { ends = {}, load = {}, damping, on_site: site, method, beads, kernel_version: kernel } = physics;
  const { left = "free", right = "free" } = ends;
  const kinds = [left, right];
  const isRing = left === "periodic";
  if ((left === "periodic") !== (right === "periodic") || (isRing && beads < 3)) {
    refuse("ends", kinds, "periodic at both ends, of 3 beads or more");
  }
  if (isRing && kernel >= 3 && ends.right_stiffness !== undefined) {
    refuse("ends.right_stiffness", ends.right_stiffness, "nothing in a ring");
  }
  for (const side of ["left", "right"]) {
    const stiffness = ends[`${side}_stiffness`];
    if (stiffness !== undefined && ["free", "absorbing"].includes(ends[side] ?? "free")) {
      refuse(`ends.${side}_stiffness`, stiffness, "nothing at a free end");
    }
  }
  const isAbsorbing = kinds.includes("absorbing");
  if (!isAbsorbing && (ends.absorbing_beads ?? ends.absorbing_drag_n_s_per_m) !== undefined) {
    refuse("ends", ends, "an absorbing end with what it absorbs by");
  }
  const gravity = load.gravity_m_s2 ?? 0;
  if (gravity !== 0 && (gravity > 0 ? right : left) !== "fixed") {
    refuse("load.gravity_m_s2", gravity, "a fixed end that carries the weight");
  }
  const holds = site?.linear_n_per_m !== undefined || site?.cubic_n_per_m3 !== undefined;
  if (holds && (gravity !== 0 || (isRing && load.precompression_n))) {
    refuse("on_site", "springs with a load", "no gravity, and no load of a ring, beside them");
  }
  const isSlowed = isAbsorbing || site?.drag_n_s_per_m !== undefined;
  const isBeyond = physics.alphas !== undefined || Boolean(physics.second || physics.bonds);
  const needsRunge = damping?.kuwabara_kono_s !== undefined || damping?.power !== undefined;
  if (damping && isBeyond && damping.viscous_n_s_per_m === undefined) {
    refuse("damping", damping, "viscous_n_s_per_m where contacts are not one power of one exponent");
  }
  const hasSite = site && Object.keys(site).length > 0;
  const hasBaths = physics.baths?.length > 0;
  const isMore = isBeyond || hasSite || physics.resonators || physics.drives?.length > 0 || hasBaths || isRing || isSlowed;
  const isSplit = ["velocity-verlet", "rkn4"].includes(method);
  if ((method === "gear5" && (needsRunge || isMore)) || (isSplit && (damping || isSlowed)) || (hasBaths && !isSplit)) {
    refuse("method", method, "one that takes these forces");
  }
}

/** Refuses waveforms in wrong places. @param {any} waveform @param {string} key @param {number} dt @param {number} duration */
function checkWaveform(waveform, key, dt, duration) {
  const [[kind, shape]] = Object.entries(waveform);
  const { times_s: times, values, ramp_s: up = 0, ramp_down_s: down = 0, from_s: from = 0 } = shape;
  const until = kind === "chirp" ? shape.duration_s : shape.until_s;
  if (until === undefined ? down > 0 : up + down > until) {
    refuse(`${key}.${kind}.ramp_down_s`, down, "ramps that leave room for each other before an end");
  }
  if (kind === "ramp" && !(shape.to_s > from)) {
    refuse(`${key}.ramp.to_s`, shape.to_s, "a time after from_s");
  }
  if (kind === "table") {
    const isGrowing = times.every((/** @type {number} */ time, /** @type {number} */ i) => i === 0 || time - times[i - 1] >= 1e-100);
    if (!isGrowing || values.length !== times.length || times.at(-1) < duration * (1 - 1e-9)) {
      refuse(`${key}.table`, waveform, "times that increase up to the end of the run, with a value each");
    }
  }
  const half = (/** @type {number} */ time) => (time > 0 ? 0.5 / time : 0);
  const fastest = Math.max(
    ...[shape.frequency_hz ?? 0, shape.from_hz ?? 0, shape.to_hz ?? 0, half(up), half(down), half(shape.rise_s ?? 0)],
    ...[kind === "half_sine" ? half(shape.duration_s) : 0],
    kind === "gaussian" ? (shape.frequency_hz ?? 0) + 0.5 / shape.width_s : 0,
  );
  if (fastest > 0 && 1 / (fastest * dt) < STEPS_OF_PERIOD) {
    refuse(key, `${fastest} Hz`, `a period of at least ${STEPS_OF_PERIOD} steps`);
  }
}

/** Refuses baths at wrong beads, and of wrong temperatures. @param {any} physics */
function checkBaths({ beads, baths = [], drives = [], seed: ofRun = 0, dt_s: dt, step_count: steps }) {
  const moved = drives.flatMap((/** @type {any} */ { bead, force_n: force }) => (force === undefined ? [bead] : []));
  /** @type {number[][]} */
  const rows = [];
  baths.forEach((/** @type {any} */ bath, /** @type {number} */ i) => {
    const key = `baths[${i}]`;
    const [from, to] = bath.beads.split("..").map(Number);
    if (!(from < to && to <= beads && (!bath.pairs || to - from > 1))) {
      refuse(`${key}.beads`, bath.beads, "beads of this chain, two or more for pairs");
    }
    rows.push([from, to]);
    const { temperature_j: joule, temperature_k: kelvin } = bath;
    const temperature = joule ?? kelvin;
    if ((joule === undefined) === (kelvin === undefined)) {
      refuse(key, bath, "one of temperature_j and temperature_k");
    }
    const [[kind, shape]] = Object.entries(temperature);
    const numbers = kind === "constant" ? [shape] : shape.values ?? [shape.amplitude];
    const swings = ["sine", "chirp"].includes(kind) || (kind === "gaussian" && shape.frequency_hz);
    if (swings || numbers.some((/** @type {number} */ x) => x < 0)) {
      refuse(key, temperature, "a temperature of 0 or more at all times");
    }
    checkWaveform(temperature, key, dt, steps * dt);
    if (bath.friction_per_s * dt > MOST_FRICTION) {
      refuse(`${key}.friction_per_s`, bath.friction_per_s, `at most ${MOST_FRICTION} in a step`);
    }
    seed(bath.seed ?? ofRun, `${key}.seed`);
  });
  rows.sort(([one], [two]) => one - two);
  rows.forEach(([from], i) => {
    if (i > 0 && rows[i - 1][1] > from) {
      refuse("baths", `bead ${from} in two of them`, "each bead in one bath");
    }
  });
  moved.sort((/** @type {number} */ one, /** @type {number} */ two) => one - two);
  let next = 0;
  for (const bead of moved) {
    while (next < rows.length && rows[next][1] <= bead) {
      next += 1;
    }
    if (next < rows.length && rows[next][0] <= bead) {
      refuse("baths", `bead ${bead}, which a drive moves`, "beads that no drive moves");
    }
  }
}

/** Lists of an initial state. */
const LISTS = ["displacements_m", "velocities_m_s", "resonator_displacements_m", "resonator_velocities_m_s"];

/** Refuses a chain that nothing sets in motion. @param {any} physics */
function checkMotion(physics) {
  const { beads, striker, strikers = [], initial = {}, drives = [], baths = [], resonators, ends, load, dt_s: dt, step_count: steps } = physics;
  const struck = [striker, ...strikers];
  const beadsStruck = new Set();
  struck.forEach(({ bead }, i) => {
    if (beadsStruck.has(bead)) {
      refuse(`strikers[${i - 1}].bead`, bead, "each bead once");
    }
    beadsStruck.add(bead);
  });
  const moving = new Set(struck.filter((one) => one.velocity_m_s !== 0).map(({ bead }) => bead));
  for (const key of LISTS) {
    const values = initial[key] ?? [];
    if (values.length > 0 && key.startsWith("resonator") && !resonators) {
      refuse(`initial.${key}`, `${values.length} values`, "none without resonators");
    }
    if (values.length > 0 && values.length !== beads) {
      refuse(`initial.${key}`, `${values.length} values`, `${beads}, one for each bead`);
    }
  }
  if (initial.from && !initial.displacements_m?.length) {
    refuse("initial.from", initial.from, "the lists of that state beside it");
  }
  /** @type {Set<string | number>} */
  const places = new Set();
  drives.forEach((/** @type {any} */ drive, /** @type {number} */ i) => {
    const { wall, bead, ...quantities } = drive;
    const key = `drives[${i}]`;
    const [[quantity, waveform] = [], ...others] = Object.entries(quantities);
    if ((wall === undefined) === (bead === undefined) || quantity === undefined || others.length > 0) {
      refuse(key, drive, "one place, and one of force_n, displacement_m, velocity_m_s");
    }
    if (wall !== undefined && (quantity === "force_n" || ends?.[wall] !== "fixed")) {
      refuse(key, drive, "displacement_m or velocity_m_s of a wall that is there");
    }
    if (places.has(wall ?? bead)) {
      refuse(key, drive, "one drive at a place");
    }
    places.add(wall ?? bead);
    if (quantity !== "force_n" && moving.has(bead)) {
      refuse(`${key}.bead`, bead, "a bead that is not struck");
    }
    if (quantity === "displacement_m" && waveform.step && !waveform.step.rise_s) {
      refuse(`${key}.${quantity}.step`, waveform.step, "a displacement without a jump");
    }
    checkWaveform(waveform, `${key}.${quantity}`, dt, steps * dt);
  });
  const isAny = (/** @type {any} */ value) => (Array.isArray(value) ? value.some(Boolean) : Boolean(value));
  const shapes = [initial.gaussian, initial.plane_wave, initial.mode];
  const entries = [...drives, ...baths.map((/** @type {any} */ { temperature_j: t, temperature_k: k }) => ({ t: t ?? k }))];
  const drivenBy = entries.flatMap((/** @type {any} */ { wall, bead, ...by }) => Object.values(by).flatMap((x) => Object.values(x)));
  const isMoved =
    [load?.gravity_m_s2, load?.precompression_n, initial.thermal, ...LISTS.map((key) => initial[key])].some(isAny) ||
    struck.some((one) => one.velocity_m_s !== 0) ||
    shapes.some((shape) => shape?.displacement_m || shape?.velocity_m_s) ||
    drivenBy.some((/** @type {any} */ shape) => isAny(typeof shape === "number" ? shape : shape.amplitude ?? shape.values));
  if (!isMoved) {
    refuse("striker.velocity_m_s", striker.velocity_m_s, "something that sets the chain in motion");
  }
}

/** True if kernel 2 does not give the bits of this run. @param {any} physics */
function needsKernel3(physics) {
  const { ends = {}, drives = [], disorder = [], stiffnesses = "uniform", contacts = [], alphas, second, bonds = {} } = physics;
  const end = physics.step_count * physics.dt_s;
  const shapes = drives.flatMap((/** @type {any} */ { wall, bead, ...by }) => Object.values(by));
  const hasKnots = shapes.some((/** @type {any} */ shape) =>
    new Waveform(shape, physics.dt_s).knots().some((knot) => knot >= 0 && knot <= end),
  );
  const isEven = (/** @type {any} */ values) => values === undefined || typeof values === "number";
  const stiffnessOf = (/** @type {string} */ key) => (BONDS[key].parameter === undefined ? bonds[key] : bonds[key]?.stiffness);
  const evenBonds = [...Object.keys(BONDS).map(stiffnessOf), second?.stiffness].every(isEven);
  const evenContacts = stiffnesses === "uniform" && contacts.length === 0 && alphas === undefined && physics.gaps_m === undefined;
  const onlyMasses = disorder.every((/** @type {any} */ { of }) => of === "masses");
  const closes = ends.left === "periodic" && !(evenBonds && evenContacts && onlyMasses);
  const byRadii = physics.spheres !== undefined || stiffnesses === "radii";
  return hasKnots || closes || (byRadii && disorder.length > 0 && [ends.left, ends.right].includes("fixed"));
}

/**
 * Throws where no run has this physics.
 * @param {any} physics
 */
export function checkPhysics(physics) {
  const { beads, ends, kernel_version: kernel } = physics;
  count(2, MOST_BEADS)(beads, "beads");
  rulesOf(beads, beads - (ends?.left === "periodic" && kernel >= 3 ? 0 : 1))(physics, "");
  checkLaws(physics);
  checkEnds(physics);
  checkBaths(physics);
  checkMotion(physics);
  if (kernel === 3 && !needsKernel3(physics)) {
    refuse("kernel_version", kernel, "2, which gives the bits of this run");
  }
}

const PROVENANCE = {
  name: rule((x) => typeof x === "string" && /^[a-z0-9][a-z0-9-]{0,63}$/.test(x), "1 to 64 characters of a-z, 0-9 and -"),
  run_id: rule((x) => typeof x === "string" && /^[\da-f]{8}(-[\da-f]{4}){3}-[\da-f]{12}$/i.test(x), "a UUID"),
  ...{ program: text, host: text, started_unix_ns: anyCount },
  ...{ publish_every_steps: count(1, MOST_STEPS), record_every_steps: count(1, MOST_STEPS) },
};

const CREDIT = { author: text, orcid: text, licence: text, doi: text };

/**
 * Throws where no run has this provenance; of a later version it may say more.
 * @param {any} provenance
 * @param {boolean} isNewer
 */
export function checkProvenance(provenance, isNewer) {
  const known = Object.entries(provenance).filter(([key]) => !isNewer || Object.hasOwn({ ...PROVENANCE, ...CREDIT }, key));
  object(PROVENANCE, CREDIT)(Object.fromEntries(known), "");
  const { publish_every_steps: publish, record_every_steps: record } = provenance;
  if (record % publish !== 0) {
    refuse("record_every_steps", record, `a multiple of publish_every_steps = ${publish}`);
  }
}
