// Fields of a state: a quantity for each bead or contact, energies, and their reduction to pixels.

import { BOLTZMANN } from "./baths.js";
import { stepperOf } from "./chains.js";
import { KERNEL_VERSION, METHODS, RUNGE, isKnown, retired } from "./kernel.js";
import { unknownPhysics } from "./keys.js";
import { Waveform, largest } from "./waveforms.js";

/** Kinetic, potential, left, split bead, right, dissipated, driven, total (J). */
export const ENERGY_COUNT = 8;

/**
 * Things that a chain has according to `physics`, and that it lacks; "" if there are none.
 * @param {import("./types.d.ts").Physics} physics
 * @param {import("./types.d.ts").Chain} chain
 */
function missing({ bonds, second, resonators, ends }, { terms, resonatorMass, ring, drag }) {
  const isEnd = (/** @type {string} */ kind) => ends?.left === kind || ends?.right === kind;
  /** @type {[string, unknown, unknown][]} */
  const pairs = [
    ["bonds", bonds, terms?.length],
    ["second powers", second, terms?.length],
    ["resonators", resonators, resonatorMass?.length],
    ["a periodic end", isEnd("periodic"), ring],
    ["an absorbing end", isEnd("absorbing"), drag?.length],
  ];
  return pairs.find(([, isSaid, isThere]) => isSaid && !isThere)?.[0] ?? "";
}

/**
 * Why steps of this run cannot be recomputed here; "" if they can.
 * @param {import("./types.d.ts").Physics} physics
 * @param {import("./types.d.ts").Chain} chain
 */
export function whyNotRecomputed(physics, chain) {
  if (!isKnown(physics.kernel_version)) {
    return `This run was computed by kernel ${physics.kernel_version}, and this page has kernels 2 to ${KERNEL_VERSION}.`;
  }
  if (!METHODS.includes(physics.method)) {
    return `This page does not have the method ${physics.method}.`;
  }
  if (retired(physics)) {
    return `This run was computed by ${retired(physics)}, which this page does not have.`;
  }
  const unknown = unknownPhysics(physics);
  if (unknown !== "") {
    return `This page does not know what ${unknown} in the manifest does to a run.`;
  }
  const lacking = missing(physics, chain);
  return lacking && `The manifest has ${lacking}, and the chain that came with it has not.`;
}

/** The largest speed (m/s), and the largest overlap (m), that something gives beads, as the command estimates them. @param {any} physics */
function estimates({ bead_mass_kg: m, stiffness: k, alpha, ends, on_site: site, resonators, drives = [], baths = [], initial = {}, ...physics }) {
  const { thermal, displacements_m: u = [0], resonator_displacements_m: w = [] } = initial;
  const shapes = [initial.gaussian, initial.plane_wave, initial.mode];
  const peaks = (/** @type {string} */ key, unit = 1) =>
    [...drives, ...baths].map(({ [key]: shape }) => (shape ? unit * new Waveform(shape, 1).largest() : 0));
  const hot = [...peaks("temperature_j"), ...peaks("temperature_k", BOLTZMANN)];
  hot.push(thermal ? 2 * (thermal.energy_j ?? 0.5 * BOLTZMANN * thermal.temperature_k) : 0);
  const speed = largest(
    ...[initial.velocities_m_s, initial.resonator_velocities_m_s, peaks("velocity_m_s")],
    [physics.striker, physics.strikers, shapes].flat().map((one) => one?.velocity_m_s),
    hot.map((joule) => 3 * Math.sqrt(joule / m)), // three standard deviations
  );
  const [first, last] = [u[0], u[u.length - 1]];
  const atEnds = ends?.left === "periodic" ? last - first : [ends?.left === "fixed" && first, ends?.right === "fixed" && last];
  const springs = resonators?.stiffness_n_per_m;
  const stiffest = largest(springs?.pattern ?? springs?.list ?? springs);
  const pushed = largest(peaks("force_n"), w.map((/** @type {number} */ x, /** @type {number} */ i) => stiffest * (x - (u[i] ?? 0))));
  const overlap = largest(
    u.map((/** @type {number} */ x, /** @type {number} */ i) => (i > 0 ? u[i - 1] - x : 0)),
    ...[site ? u : atEnds, shapes.map((shape) => shape?.displacement_m), peaks("displacement_m"), Math.pow(pushed / k, 1 / alpha)],
  );
  return { speed, overlap };
}

/** The largest rest overlap (m) that rules allow. @param {any} physics @param {import("./types.d.ts").Chain} chain */
function largestRest({ bead_mass_kg: m, stiffness: k, load, masses, stiffnesses, contacts = [], ends = {}, ...physics }, chain) {
  if (!load || physics.alphas || physics.second || physics.bonds) {
    return load ? chain.restOverlap.reduce((most, rho) => Math.max(most, rho), 0) : 0;
  }
  const rule = masses?.pattern_kg ?? masses?.list_kg ?? [m, m * Math.pow(masses?.taper ?? 1, physics.beads - 1)];
  let all = [...rule, ...physics.impurities.map((/** @type {any} */ one) => one.mass_kg)];
  const least = (/** @type {number[]} */ values) => values.reduce((a, b) => Math.min(a, b));
  const usual = stiffnesses === "radii" ? k * Math.sqrt(Math.cbrt(least(all) / m)) : k;
  const walls = ["left", "right"].flatMap((end) => (ends[end] === "fixed" ? [ends[`${end}_stiffness`] ?? k] : []));
  let soft = [...(stiffnesses?.pattern ?? stiffnesses?.list ?? [usual]), ...contacts.map((/** @type {any} */ odd) => odd.stiffness), ...walls];
  if (physics.spheres || physics.disorder) {
    const closing = physics.kernel_version > 2 && chain.ring ? [chain.ring.stiffness] : [];
    [all, soft] = [[...chain.mass], [...chain.stiffness, ...closing]];
  }
  // the softest contact under all of the load
  const most = Math.abs(load.gravity_m_s2 ?? 0) * (physics.beads * largest(all)) + (load.precompression_n ?? 0);
  return Math.pow(most / least(soft), 1 / physics.alpha);
}

/**
 * Length L (m) and time T (s) of a collision at the largest speed that something gives, or where there is none of a contact with the
 * largest overlap, as the command has them.
 * @param {import("./types.d.ts").Physics} physics
 * @param {import("./types.d.ts").Chain} chain
 */
export function scalesOf(physics, chain) {
  const { alpha, stiffness: k, bead_mass_kg: m, baths } = physics;
  const { speed, overlap } = estimates(physics);
  const struck = Math.pow((m * (speed * speed)) / k, 1 / (alpha + 1));
  // beside a bath, which gives speeds, drives and displacements may press more
  if (speed > 0 && !(baths?.length && overlap > struck)) {
    return { length_m: struck, time_s: struck / speed };
  }
  const length = (speed > 0 ? 0 : largestRest(physics, chain)) || overlap;
  return { length_m: length, time_s: length > 0 ? Math.sqrt(m / (k * Math.pow(length, alpha - 1))) : 0 };
}

/**
 * The bead that divides left from right: the first impurity that is not the striker, otherwise the middle one.
 * @param {import("./types.d.ts").Physics} physics
 */
export function splitBeadOf(physics) {
  const impurity = physics.impurities.find(({ bead }) => bead !== physics.striker.bead);
  return impurity === undefined ? Math.floor(physics.beads / 2) : impurity.bead;
}

/** Energies, and values of a field, of the states of one run. */
export class Fields {
  /**
   * @param {import("./types.d.ts").Manifest} manifest
   * @param {import("./types.d.ts").Chain} chain
   */
  constructor({ physics }, chain) {
    // energies are the same whatever moved the beads
    const isOurs = METHODS.includes(physics.method);
    const method = isOurs ? physics.method : RUNGE;
    this.stepper = stepperOf({ ...physics, kernel_version: KERNEL_VERSION, method }, chain);
    /** Number of the array of `extra` with the dissipated work; −1: none, or not known. */
    this.work = isOurs ? this.stepper.extraNames.indexOf("W") : -1;
    this.chain = chain;
    this.splitBead = splitBeadOf(physics);
    this.toleranceM = 1e-6 * scalesOf(physics, chain).length_m;
    this.contactJ = new Float64Array(physics.beads + 1); // contact i has bead i on its right; walls at both ends
  }

  /**
   * Energy of each contact (J).
   * @param {import("./types.d.ts").State} state
   */
  contacts(state) {
    this.stepper.contactEnergies(state, this.contactJ);
    return this.contactJ;
  }

  /** Force of a contact between beads (N), without what damps it. @param {number} contact @param {number} overlap */
  force(contact, overlap) {
    return this.stepper.elastic(contact + 1, overlap);
  }

  /**
   * Writes ENERGY_COUNT energies of a state to `into`, from `at` on.
   * @param {import("./types.d.ts").State} state
   * @param {Float64Array} into
   * @param {number} at
   */
  energies(state, into, at) {
    const { u, v, extra } = state;
    const { mass, ring } = this.chain;
    const { stepper, work, splitBead: s } = this;
    const contactJ = this.contacts(state);
    const sideOf = (/** @type {number} */ bead) => (bead < s ? 0 : bead === s ? 1 : 2);
    const sides = [0, 0, 0]; // left, split bead, right
    let [kinetic, potential, dissipated] = [0, 0, 0];
    for (let i = 0; i < u.length; i += 1) {
      const energy = 0.5 * mass[i] * (v[i] * v[i]);
      const [site, resonator] = [stepper.siteEnergy(state, i), stepper.resonatorEnergy(state, i)];
      kinetic += energy + resonator.kinetic;
      potential += site + resonator.potential;
      sides[sideOf(i)] += energy + site + resonator.kinetic + resonator.potential;
    }
    if (ring !== undefined) {
      // at both ends of the array, and there is one
      const energy = contactJ[0];
      potential += energy;
      sides[sideOf(0)] += 0.5 * energy;
      sides[sideOf(u.length - 1)] += 0.5 * energy;
    }
    const [firstContact, lastContact] = ring === undefined ? [0, u.length] : [1, u.length - 1];
    for (let i = firstContact; i <= lastContact; i += 1) {
      // between bead i − 1 and bead i: half of it belongs to the split bead if that is one of them
      const energy = contactJ[i];
      potential += energy;
      const isWall = i === 0 || i === u.length;
      const share = !isWall && (i === s || i === s + 1) ? 0.5 * energy : 0;
      sides[1] += share;
      sides[i <= s ? 0 : 2] += energy - share;
    }
    for (let i = 0; work >= 0 && i < u.length; i += 1) {
      dissipated += extra[work * u.length + i];
    }
    const driven = stepper.drivenWork(state);
    into.set([kinetic, potential, sides[0], sides[1], sides[2], dissipated, driven, kinetic + potential], at);
  }

  /**
   * Writes a row of a map to `into`: for each of `columns` columns the value that is largest in magnitude among
   * the places `first` to `last`, so that no pulse is lost between pixels; of contacts the rarest class
   * (0 touching, 1 compressed, 2 open). Overlaps and forces count from rest; forces are without damping. The last contact of a
   * ring closes it.
   * @param {import("./types.d.ts").Field} field
   * @param {import("./types.d.ts").State} state
   * @param {[number, number]} places
   * @param {number} columns
   * @param {Float64Array} into
   */
  row(field, state, [first, last], columns, into) {
    const { u, v } = state;
    const { mass, restOverlap, restForce, ring } = this.chain;
    const { stepper } = this;
    const apart = (/** @type {number} */ contact) => u[contact] - u[contact + 1 < u.length ? contact + 1 : 0];
    const restOf = (/** @type {number} */ contact) => restOverlap[contact] ?? ring?.restOverlap ?? 0;
    // a bead has all of the energy of its contact with a wall
    const wallJ = (/** @type {number} */ bead) =>
      ring ? 0 : (bead === 0 ? contactJ[0] : 0) + (bead === u.length - 1 ? contactJ[u.length] : 0);
    const contactJ = field === "energy" ? this.contacts(state) : this.contactJ;
    const tolerance = this.toleranceM;
    const count = last - first + 1;
    let place = first;
    for (let column = 0; column < columns; column += 1) {
      const end = first + Math.ceil(((column + 1) * count) / columns);
      let shown = 0;
      for (; place < end; place += 1) {
        let value = 0;
        if (field === "velocity") {
          value = v[place];
        } else if (field === "displacement") {
          value = u[place];
        } else if (field === "overlap") {
          value = apart(place);
        } else if (field === "force") {
          value = this.force(place, apart(place) + restOf(place)) - (restForce[place] ?? ring?.restForce ?? 0);
        } else if (field === "energy") {
          const { kinetic, potential } = stepper.resonatorEnergy(state, place);
          value = 0.5 * mass[place] * (v[place] * v[place]) + 0.5 * (contactJ[place] + contactJ[place + 1] + wallJ(place));
          value += stepper.siteEnergy(state, place) + kinetic + potential;
        } else {
          const overlap = apart(place) + restOf(place);
          // compressed before open before touching
          value = overlap > tolerance ? 1 : overlap < -tolerance ? 2 : 0;
          shown = outermost(field, shown, value);
          continue;
        }
        if (Math.abs(value) > Math.abs(shown)) {
          shown = value;
        }
      }
      into[column] = shown;
    }
  }
}

/**
 * Value of a cell that stands for two values of a field: the one farther from 0, of contacts the rarer class.
 * @param {import("./types.d.ts").Field} field
 * @param {number} a
 * @param {number} b
 */
export function outermost(field, a, b) {
  if (field === "contacts") {
    return a === 1 || b === 1 ? 1 : Math.max(a, b);
  }
  return Math.abs(b) > Math.abs(a) ? b : a;
}

/**
 * Number of columns of a row of these places.
 * @param {[number, number]} places
 * @param {number} columns
 */
export function columnCount([first, last], columns) {
  return Math.max(1, Math.min(last - first + 1, columns));
}
