// What a state shows: a quantity for each bead or contact, energies, and what is reduced to a pixel.

import { KERNEL_VERSION, Stepper } from "./kernel.js";

/** Kinetic, potential, left, split bead, right, dissipated (J). */
export const ENERGY_COUNT = 6;

/** Methods and kinds of damping that this page can recompute. */
const METHODS = ["velocity-verlet", "rkn4", "gear5"];
const DAMPING = ["viscous_n_s_per_m", "restitution"];

/**
 * Why steps of this run cannot be recomputed here; "" if they can.
 * @param {import("./types.d.ts").Physics} physics
 */
export function whyNotRecomputed(physics) {
  if (physics.kernel_version !== KERNEL_VERSION) {
    return `This run was computed by kernel ${physics.kernel_version}, and this page has kernel ${KERNEL_VERSION}.`;
  }
  if (!METHODS.includes(physics.method)) {
    return `This page does not have the method ${physics.method}.`;
  }
  const damping = Object.keys(physics.damping ?? {}).find((kind) => !DAMPING.includes(kind));
  return damping === undefined ? "" : `This page does not have damping by ${damping}.`;
}

/**
 * Length L (m) and time T (s) of a collision at the striker's speed, or where nothing strikes of a loaded contact.
 * @param {import("./types.d.ts").Physics} physics
 * @param {import("./types.d.ts").Chain} chain
 */
export function scalesOf(physics, chain) {
  const { alpha, stiffness: k, bead_mass_kg: m } = physics;
  const speed = Math.abs(physics.striker.velocity_m_s);
  if (speed > 0) {
    const length = Math.pow((m * speed * speed) / k, 1 / (alpha + 1));
    return { length_m: length, time_s: length / speed };
  }
  let length = Math.max(chain.leftWall?.restOverlap ?? 0, chain.rightWall?.restOverlap ?? 0);
  for (const overlap of chain.restOverlap) {
    length = Math.max(length, overlap);
  }
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
    const method = METHODS.includes(physics.method) ? physics.method : "rkn4";
    this.stepper = new Stepper({ ...physics, kernel_version: KERNEL_VERSION, method }, chain);
    this.chain = chain;
    this.splitBead = splitBeadOf(physics);
    this.toleranceM = 1e-6 * scalesOf(physics, chain).length_m;
    this.contactJ = new Float64Array(physics.beads + 1); // contact i has bead i on its right; walls at both ends
    this.isLoaded = [chain.leftWall, chain.rightWall].some((wall) => wall !== undefined && wall.restOverlap !== 0);
    this.isLoaded ||= chain.restOverlap.some((overlap) => overlap !== 0);
  }

  /**
   * Energy of each contact (J).
   * @param {Float64Array} u
   */
  contacts(u) {
    const { stepper, contactJ } = this;
    const n = u.length;
    contactJ[0] = stepper.hasWall[0] ? stepper.excess(0, -u[0]) : 0;
    contactJ[n] = stepper.hasWall[1] ? stepper.excess(n, u[n - 1]) : 0;
    const z = stepper.power.z;
    for (let i = 1; i < n; i += 1) {
      if (this.isLoaded) {
        contactJ[i] = stepper.excess(i, u[i - 1] - u[i]);
      } else {
        const delta = u[i - 1] - u[i];
        contactJ[i] = delta > z ? stepper.potential(i, delta) : 0;
      }
    }
    return contactJ;
  }

  /**
   * Writes ENERGY_COUNT energies of a state to `into`, from `at` on.
   * @param {import("./types.d.ts").State} state
   * @param {Float64Array} into
   * @param {number} at
   */
  energies({ u, v, extra }, into, at) {
    const { mass } = this.chain;
    const s = this.splitBead;
    const contactJ = this.contacts(u);
    const sides = [0, 0, 0]; // left, split bead, right
    let [kinetic, potential, dissipated] = [0, 0, 0];
    for (let i = 0; i < u.length; i += 1) {
      const energy = 0.5 * mass[i] * (v[i] * v[i]);
      kinetic += energy;
      sides[i < s ? 0 : i === s ? 1 : 2] += energy;
    }
    for (let i = 0; i <= u.length; i += 1) {
      // between bead i − 1 and bead i: half of it belongs to the split bead if that is one of them
      const energy = contactJ[i];
      potential += energy;
      const isWall = i === 0 || i === u.length;
      const share = !isWall && (i === s || i === s + 1) ? 0.5 * energy : 0;
      sides[1] += share;
      sides[i <= s ? 0 : 2] += energy - share;
    }
    if (this.stepper.damped) {
      for (let i = extra.length - u.length; i < extra.length; i += 1) {
        dissipated += extra[i];
      }
    }
    into.set([kinetic, potential, sides[0], sides[1], sides[2], dissipated], at);
  }

  /**
   * Writes a row of a map to `into`: for each of `columns` columns the value that is largest in magnitude among
   * the places `first` to `last`, so that no pulse is lost between pixels; of contacts the rarest class
   * (0 touching, 1 compressed, 2 open). Overlaps of a loaded chain count from rest.
   * @param {import("./types.d.ts").Field} field
   * @param {import("./types.d.ts").State} state
   * @param {[number, number]} places
   * @param {number} columns
   * @param {Float32Array} into
   */
  row(field, state, [first, last], columns, into) {
    const { u, v } = state;
    const { mass, restOverlap } = this.chain;
    const contactJ = field === "energy" ? this.contacts(u) : this.contactJ;
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
          value = u[place] - u[place + 1];
        } else if (field === "energy") {
          value = 0.5 * mass[place] * (v[place] * v[place]) + 0.5 * (contactJ[place] + contactJ[place + 1]);
        } else {
          const overlap = u[place] - u[place + 1] + restOverlap[place];
          // compressed before open before touching
          value = overlap > tolerance ? 1 : overlap < -tolerance ? 2 : 0;
          shown = value === 1 || shown === 1 ? 1 : value === 2 ? 2 : shown;
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
 * How many columns a row of these places has.
 * @param {[number, number]} places
 * @param {number} columns
 */
export function columnCount([first, last], columns) {
  return Math.max(1, Math.min(last - first + 1, columns));
}
