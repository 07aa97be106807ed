// Chains beyond one power law: contacts of several terms, bonds, gaps, rings, springs and drag of each bead, resonators, what is
// driven, baths, and the method of Dormand and Prince. Written from docs/KERNEL.md alone, like kernel.js, which has the rest.
//
//     import { stepperOf } from "./chains.js";
//     const stepper = stepperOf(physics, chain);   // used like a `Stepper`; states need the number of their `step`

import { Bath } from "./baths.js";
import { A1, A2, A3, B1, B2, B3, B4, Power, RUNGE, Stepper, excessSeries, fromHex, isSimple, sum } from "./kernel.js";
import { LAWS } from "./laws.js";
import { Knots, Piece } from "./pieces.js";
import { Waveform } from "./waveforms.js";

/** @import { Chain, DriveEntry, Physics } from "./types.js" */
/** @import { Motion } from "./kernel.js" */
/** @import { When } from "./pieces.js" */

/**
 * The stepper of a chain of any kind.
 * @param {Physics} physics
 * @param {Chain} chain
 * @returns {Stepper}
 */
export function stepperOf(physics, chain) {
  return isSimple(physics, chain) ? new Stepper(physics, chain) : new AnyStepper(physics, chain);
}

/** A further term of the force of each contact. Contact 0 and the last one are those at the ends. */
class Term {
  /**
   * @param {string} kind
   * @param {number} parameter
   * @param {Float64Array} k
   */
  constructor(kind, parameter, k) {
    this.law = Object.hasOwn(LAWS, kind) ? LAWS[kind] : undefined;
    if (kind !== "power" && !this.law?.has(parameter)) {
      throw new Error(`/chain has a term of a kind that is not known here: ${kind}, ${parameter}`);
    }
    this.parameter = parameter;
    this.k = k;
    this.power = kind === "power" ? new Power(parameter) : undefined;
    this.series = excessSeries(parameter);
  }

  /** T of contact i. @param {number} i @param {number} delta */
  force(i, delta) {
    const k = this.k[i];
    if (k === 0) {
      return 0;
    }
    return this.law?.force(k, this.parameter, delta) ?? k * /** @type {Power} */ (this.power).at(delta);
  }

  /** U of a power, 0 of others. @param {number} i @param {number} delta */
  energy(i, delta) {
    const power = this.power;
    return power !== undefined && delta > power.z ? (this.k[i] * power.at(delta) * delta) / (this.parameter + 1) : 0;
  }

  /**
   * The energy beyond that at rest, less the work of the force at rest.
   * @param {number} i
   * @param {number} a approach
   * @param {number} rho rest overlap
   */
  excess(i, a, rho) {
    const [k, b] = [this.k[i], this.parameter];
    if (k === 0) {
      return 0;
    }
    if (this.law !== undefined) {
      return this.law.excess(k, b, a, rho);
    }
    const [x, rest] = [a / rho, this.force(i, rho)];
    if (Math.abs(x) <= 1 / (16 * (b + 1))) {
      return rest * a * x * this.series.reduceRight((total, e) => total * x + e, 0);
    }
    return this.energy(i, a + rho) - this.energy(i, rho) - rest * a;
  }
}

const GAUSS = [fromHex("3fbcda042f0236e1"), 0.5, fromHex("3fec64bf7a1fb924")]; // ½ ∓ √15/10

/** A drive: it moves a wall ("left", "right") or a bead (its number), or pulls at a bead. */
class Drive {
  /** @param {DriveEntry} entry @param {number} dt */
  constructor(entry, dt) {
    const shape = entry.force_n ?? entry.displacement_m ?? entry.velocity_m_s;
    if (shape === undefined) {
      throw new Error("a drive without force, displacement or velocity");
    }
    this.wall = entry.wall;
    this.bead = entry.bead ?? -1;
    this.wave = new Waveform(shape, dt);
    this.isVelocity = entry.velocity_m_s !== undefined;
    /** True if it prescribes a motion, not a force. */
    this.moves = entry.force_n === undefined;
    this.movesBead = this.moves && this.wall === undefined;
    /** Force (N), or displacement (m) and velocity (m/s), at the time of `set`. */
    this.f = this.x = this.v = 0;
    /** The velocity (m/s) of its bead at the beginning of a piece. */
    this.startedAt = 0;
  }

  /**
   * Goes to a time; the end of a step is the beginning of the next one.
   * @param {When} when
   * @param {number} before displacement at the beginning of the piece
   */
  set({ n, start, since, s, isEnd, beside }, before) {
    const { wave } = this;
    const [step, late] = isEnd ? [n + 1, 0] : [n, s];
    const [value, slope] = beside === 0 ? wave.at(step, late) : wave.at(n, s + beside);
    const atKnot = beside === 0 ? value : value - slope * beside;
    if (!this.moves) {
      this.f = atKnot;
    } else if (!this.isVelocity) {
      [this.x, this.v] = [beside === 0 ? value : wave.value(step, late), slope];
    } else {
      const [a, b, c] = GAUSS.map((g) => wave.value(n, start + since * g));
      this.x = before + since * ((5 / 18) * a + (8 / 18) * b + (5 / 18) * c);
      this.v = atKnot;
    }
  }
}

// method of Dormand and Prince: when a stage is, and what each derivative before counts in it
const STAGES = [0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1];
const COUNTS = [
  [],
  [1 / 5],
  [3 / 40, 9 / 40],
  [44 / 45, -56 / 15, 32 / 9],
  [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
  [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
];
const WEIGHTS = [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84];

/** @type {Record<string, { kicks: number[], drifts: number[] }>} */
const SPLIT = {
  "velocity-verlet": { kicks: [0.5, 0.5], drifts: [1] },
  rkn4: { kicks: [B1, B2, B3, B4, B3, B2, B1], drifts: [A1, A2, A3, A3, A2, A1] },
};

/** Any chain by every method but gear5. */
export class AnyStepper extends Stepper {
  /**
   * @param {Physics} physics
   * @param {Chain} chain
   */
  constructor(physics, chain) {
    const { ring } = chain;
    super(physics, ring === undefined ? chain : { ...chain, leftWall: ring, rightWall: ring });
    const n = this.beads;
    if (this.method === "gear5") {
      throw new Error("gear5 takes no chain of this kind");
    }
    this.isRing = ring !== undefined;
    if (ring !== undefined) {
      // the contact of the ring is at both ends of the arrays
      this.hasWall = [false, false];
      this.isLoaded ||= ring.restOverlap !== 0;
    }
    this.terms = (chain.terms ?? []).map(({ kind, parameter, stiffness, leftWall, rightWall, ring: closing }) => {
      const [left, right] = this.isRing ? [closing, closing] : [leftWall, rightWall];
      if (stiffness.length !== n - 1) {
        throw new Error("physics and chain do not belong together");
      }
      return new Term(kind, parameter, Float64Array.from([left ?? 0, ...stiffness, right ?? 0]));
    });
    /** The first term of each contact, as the others are. */
    this.law = new Term("power", physics.alpha, this.k);
    this.isBonded = physics.bonds !== undefined;
    const array = (/** @type {Float64Array | undefined} */ values) => {
      if (values !== undefined && values.length !== 0 && values.length !== n) {
        throw new Error("physics and chain do not belong together");
      }
      return values?.length === n ? values : undefined;
    };
    this.onSite = array(chain.onSite);
    this.onSiteCubic = array(chain.onSiteCubic);
    this.drag = array(chain.drag);
    this.resonatorMass = array(chain.resonatorMass);
    this.resonatorStiffness = array(chain.resonatorStiffness) ?? new Float64Array(n);
    this.drives = (physics.drives ?? []).map((entry) => new Drive(entry, this.dt));
    this.knots = new Knots(physics.kernel_version < 3 ? [] : this.drives.map(({ wave }) => wave), this.dt);
    const { baths = [], seed = 0 } = physics;
    this.baths = baths.map((entry) => new Bath(entry, this.mass, this.isRing, this.dt, seed));
    this.dampingPower = chain.dampingPower ? new Power(chain.dampingPower) : undefined;
    if (this.method === RUNGE && baths.length > 0) {
      throw new Error(`${RUNGE} takes no baths`);
    }
    if (this.method !== RUNGE && (this.damped || this.drag !== undefined)) {
      throw new Error(`damping or drag with the method ${this.method}`);
    }
    // where in `extra` each array begins; less than 0: nowhere
    const at = (/** @type {string} */ name) => n * this.extraNames.indexOf(name);
    this.atW = at("w");
    this.atWv = at("w_v");
    this.atWork = at("W");
    this.atDrives = at("drives");
    this.atHeat = at("heat");
    this.pull = new Float64Array(n); // G of each bead
    this.inner = new Float64Array(n); // r of each bead
    this.lost = new Float64Array(n + 1); // power of each damped contact
    // displacement and velocity of both walls, at the time that the drives are set to
    this.xLeft = this.xRight = this.vLeft = this.vRight = 0;
    // of Dormand and Prince: u, v and extra one after the other, of the step, of a stage, and the derivatives of each stage
    const length = this.method === RUNGE ? (2 + this.extraNames.length) * n : 0;
    this.whole = new Float64Array(length);
    this.stage = new Float64Array(length);
    this.rates = STAGES.map(() => new Float64Array(length));
  }

  initialState() {
    const state = super.initialState();
    this.setDrives(new Piece(0, 0, this.dt, true).begin(), new Float64Array(2 * this.drives.length));
    this.drives.forEach((drive, d) => {
      if (drive.moves) {
        // −0 becomes +0
        state.extra[this.atDrives + 2 * d + 1] = drive.x + 0;
        if (drive.movesBead) {
          [state.u[drive.bead], state.v[drive.bead]] = [drive.x + 0, drive.v + 0];
        }
      }
    });
    if (this.atW >= 0) {
      state.extra.set(state.u, this.atW);
    }
    return state;
  }

  /** @param {Motion} state @param {number} count */
  step(state, count = 1) {
    if (state.step === undefined) {
      throw new Error("a state without the number of its step");
    }
    const heat = this.heatOf(state);
    for (let n = state.step; n < state.step + count; n += 1) {
      this.baths.forEach((bath) => bath.act(state.v, heat, n, 0));
      for (const piece of this.knots.pieces(n)) {
        const before = state.extra.slice(this.atDrives, this.atDrives + 2 * this.drives.length);
        for (const drive of this.drives) {
          drive.startedAt = state.v[drive.bead];
        }
        if (this.method === RUNGE) {
          this.stepRunge(state, piece, before);
        } else {
          this.stepSplit(state, piece, before);
        }
        this.endPiece(state, piece.end(), before);
      }
      for (let i = this.baths.length - 1; i >= 0; i -= 1) {
        this.baths[i].act(state.v, heat, n, 1);
      }
    }
  }

  /** The heat that baths have given, at each place. @param {Motion} state */
  heatOf({ extra }) {
    return this.atHeat < 0 ? new Float64Array(0) : extra.subarray(this.atHeat, this.atHeat + this.beads);
  }

  /**
   * All drives at a time.
   * @param {When} when
   * @param {Float64Array} before their numbers at the beginning of the piece
   */
  setDrives(when, before) {
    this.drives.forEach((drive, d) => {
      drive.set(when, before[2 * d + 1]);
      if (drive.wall === "left") {
        [this.xLeft, this.vLeft] = [drive.x, drive.v];
      } else if (drive.wall === "right") {
        [this.xRight, this.vRight] = [drive.x, drive.v];
      }
    });
  }

  /** Moves driven beads and walls to the end of a piece. @param {Motion} state @param {When} end @param {Float64Array} before */
  endPiece({ u, v, extra }, end, before) {
    this.drives.forEach((drive, d) => {
      const [at, bead] = [this.atDrives + 2 * d, drive.bead];
      if (!drive.moves) {
        return;
      }
      drive.set(end, before[2 * d + 1]);
      extra[at + 1] = drive.x;
      if (drive.movesBead) {
        const half = 0.5 * this.mass[bead];
        [u[bead], v[bead]] = [drive.x, drive.v];
        extra[at] += half * (drive.v * drive.v) - half * (drive.startedAt * drive.startedAt);
      }
    });
  }

  /**
   * Displacement left of contact i less that right of it.
   * @param {number} i
   * @param {Float64Array} x of the beads
   * @param {number} left of the wall
   * @param {number} right
   */
  approach(i, x, left, right) {
    const n = this.beads;
    const before = i > 0 ? x[i - 1] : this.isRing ? x[n - 1] : left;
    const after = i < n ? x[i] : this.isRing ? x[0] : right;
    return before - after;
  }

  /** E of contact i. @param {number} i @param {number} delta */
  elastic(i, delta) {
    let force = this.law.force(i, delta);
    for (const term of this.terms) {
      force += term.force(i, delta);
    }
    return force;
  }

  /** F of all contacts, into `net`. @param {Float64Array} u */
  allForces(u) {
    for (let i = 0; i <= this.beads; i += 1) {
      this.net[i] = this.elastic(i, this.approach(i, u, this.xLeft, this.xRight) + this.rho[i]) - this.rest[i];
    }
  }

  /** The same with damping, and what it takes per time into `lost`. @param {Float64Array} u @param {Float64Array} v */
  dampedForces(u, v) {
    for (let i = 0; i <= this.beads; i += 1) {
      const delta = this.approach(i, u, this.xLeft, this.xRight) + this.rho[i];
      const omega = this.approach(i, v, this.vLeft, this.vRight);
      let [force, lost] = [0, 0];
      if (this.isBonded || delta > this.power.z) {
        const elastic = this.elastic(i, delta);
        force = elastic + this.eta[i] * this.dampingFactor(delta) * omega;
        force = this.isBonded || force > 0 ? force : 0;
        lost = (force - elastic) * omega;
      }
      this.net[i] = force - this.rest[i];
      this.lost[i] = lost;
    }
  }

  /** f. @param {number} delta */
  dampingFactor(delta) {
    if (this.restitution) {
      return Math.sqrt(this.power.at(delta) / delta);
    }
    return this.dampingPower === undefined ? 1 : this.dampingPower.at(delta) / delta;
  }

  /** G and r of all beads. @param {Float64Array} u @param {Float64Array} extra of the state, with w */
  beadForces(u, extra) {
    const { net, pull, inner, onSite, onSiteCubic } = this;
    for (let i = 0; i < this.beads; i += 1) {
      let g = net[i] - net[i + 1];
      if (onSite !== undefined) {
        g -= onSiteCubic === undefined ? onSite[i] * u[i] : onSite[i] * u[i] + onSiteCubic[i] * (u[i] * u[i] * u[i]);
      }
      if (this.atW >= 0) {
        inner[i] = this.resonatorStiffness[i] * (extra[this.atW + i] - u[i]);
        g += inner[i];
      }
      pull[i] = g;
    }
  }

  /**
   * A piece of a step by kicks and drifts.
   * @param {Motion} state
   * @param {Piece} piece
   * @param {Float64Array} before
   */
  stepSplit(state, piece, before) {
    const { u, v, extra } = state;
    const { beads } = this;
    const { kicks, drifts } = SPLIT[this.method];
    const dt = piece.length;
    let passed = 0;
    this.setDrives(piece.begin(), before);
    this.kickAll(state, kicks[0] * dt);
    drifts.forEach((drift, i) => {
      const d = drift * dt;
      for (let bead = 0; bead < beads; bead += 1) {
        u[bead] += d * v[bead];
        if (this.atW >= 0) {
          extra[this.atW + bead] += d * extra[this.atWv + bead];
        }
      }
      passed += drift;
      this.setDrives(i === drifts.length - 1 ? piece.end() : piece.within(passed * dt), before);
      for (const drive of this.drives) {
        if (drive.movesBead) {
          u[drive.bead] = drive.x;
        }
      }
      this.kickAll(state, kicks[i + 1] * dt);
    });
  }

  /** A kick of duration h, with the work of the drives in it. @param {Motion} state @param {number} h */
  kickAll({ u, v, extra }, h) {
    const { beads, net, pull, inner, inverseMass, resonatorMass } = this;
    this.allForces(u);
    this.beadForces(u, extra);
    const speeds = this.drives.map(({ bead }) => v[bead]);
    for (let i = 0; i < beads; i += 1) {
      v[i] += h * inverseMass[i] * pull[i];
      if (resonatorMass !== undefined && resonatorMass[i] !== 0) {
        extra[this.atWv + i] += h * (1 / resonatorMass[i]) * -inner[i];
      }
    }
    this.drives.forEach(({ moves, wall, bead, f, v: speed }, d) => {
      const at = this.atDrives + 2 * d;
      if (!moves) {
        v[bead] += h * inverseMass[bead] * f;
        extra[at] += h * f * (0.5 * (speeds[d] + v[bead]));
      } else if (wall === "left") {
        extra[at] += h * (net[0] * speed);
      } else if (wall === "right") {
        extra[at] -= h * (net[beads] * speed);
      } else {
        v[bead] = speeds[d];
        extra[at] -= h * (pull[bead] * speed);
      }
    });
  }

  /**
   * A piece of a step by the method of Dormand and Prince.
   * @param {Motion} state
   * @param {Piece} piece
   * @param {Float64Array} before
   */
  stepRunge({ u, v, extra }, piece, before) {
    const { whole, stage, rates, beads } = this;
    const dt = piece.length;
    whole.set(u);
    whole.set(v, beads);
    whole.set(extra, 2 * beads);
    STAGES.forEach((c, s) => {
      this.advance(COUNTS[s], dt);
      this.setDrives(c === 0 ? piece.begin() : c === 1 ? piece.end() : piece.within(c * dt), before);
      this.derive(stage, rates[s]);
    });
    this.advance(WEIGHTS, dt);
    u.set(stage.subarray(0, beads));
    v.set(stage.subarray(beads, 2 * beads));
    extra.set(stage.subarray(2 * beads));
  }

  /** `stage` becomes the state ahead by these counts of the derivatives. @param {number[]} counts @param {number} dt */
  advance(counts, dt) {
    const { whole, stage, rates } = this;
    stage.set(whole);
    for (let i = 0; counts.length > 0 && i < whole.length; i += 1) {
      let change = counts[0] * rates[0][i];
      for (let s = 1; s < counts.length; s += 1) {
        if (counts[s] !== 0) {
          change += counts[s] * rates[s][i];
        }
      }
      stage[i] += dt * change;
    }
  }

  /**
   * The derivatives of all of a state, at the time that the drives are set to; moved beads are put where they are then.
   * @param {Float64Array} y
   * @param {Float64Array} into
   */
  derive(y, into) {
    const { beads: n, drives, damped, drag, net, pull, inner, lost, inverseMass, resonatorMass } = this;
    const [u, v, extra] = [y.subarray(0, n), y.subarray(n, 2 * n), y.subarray(2 * n)];
    const [du, dv, rates] = [into.subarray(0, n), into.subarray(n, 2 * n), into.subarray(2 * n)];
    for (const { movesBead, bead, x, v: speed } of drives) {
      if (movesBead) {
        [u[bead], v[bead]] = [x, speed];
      }
    }
    if (damped) {
      this.dampedForces(u, v);
    } else {
      this.allForces(u);
    }
    this.beadForces(u, extra);
    for (let i = 0; i < n; i += 1) {
      if (drag !== undefined) {
        pull[i] -= drag[i] * v[i];
      }
      du[i] = v[i];
      dv[i] = inverseMass[i] * pull[i];
      if (resonatorMass !== undefined) {
        rates[this.atW + i] = extra[this.atWv + i];
        rates[this.atWv + i] = resonatorMass[i] === 0 ? 0 : (1 / resonatorMass[i]) * -inner[i];
      }
      if (this.atWork >= 0) {
        let power = 0;
        if (damped) {
          power = i < n - 1 ? lost[i + 1] : this.isRing ? lost[0] : lost[0] + lost[n];
        }
        rates[this.atWork + i] = drag === undefined ? power : power + drag[i] * (v[i] * v[i]);
      }
    }
    drives.forEach(({ moves, wall, bead, f, v: speed }, d) => {
      const at = this.atDrives + 2 * d;
      if (!moves) {
        dv[bead] += inverseMass[bead] * f;
        rates[at] = f * v[bead];
      } else if (wall === "left") {
        rates[at] = net[0] * speed;
      } else if (wall === "right") {
        rates[at] = 0 - net[n] * speed;
      } else {
        rates[at] = 0 - pull[bead] * v[bead];
        [du[bead], dv[bead]] = [0, 0];
      }
    });
  }

  /** Work of all drives and heat of all baths. @param {Motion} state */
  drivenWork(state) {
    const work = this.drives.reduce((total, _, d) => total + state.extra[this.atDrives + 2 * d], 0);
    return this.heatOf(state).reduce((total, heat) => total + heat, work);
  }

  /** Displacement and velocity of both walls in a state with a step. @param {Motion} state */
  wallsOf({ extra, step = 0 }) {
    const walls = super.wallsOf();
    this.drives.forEach((drive, d) => {
      if (drive.wall !== undefined) {
        const x = extra[this.atDrives + 2 * d + 1];
        drive.set(new Piece(step, 0, this.dt, true).begin(), x);
        walls[drive.wall] = { x, v: drive.v };
      }
    });
    return walls;
  }

  /**
   * Energy of each contact. The contact of a ring is the first one, and also the last one.
   * @param {Motion} state
   * @param {Float64Array} into
   */
  contactEnergies(state, into) {
    const { beads: n, terms } = this;
    let [left, right] = [0, 0];
    this.drives.forEach(({ wall }, d) => {
      const x = state.extra[this.atDrives + 2 * d + 1];
      left = wall === "left" ? x : left;
      right = wall === "right" ? x : right;
    });
    for (let i = 0; i <= n; i += 1) {
      const isEnd = i === 0 || i === n;
      const [a, rho] = [this.approach(i, state.u, left, right), this.rho[i]];
      const isExcess = this.isLoaded || (isEnd && !this.isRing);
      let energy = 0;
      if (!isEnd || this.isRing || this.hasWall[i === 0 ? 0 : 1]) {
        energy = isExcess ? this.law.excess(i, a, rho) : this.law.energy(i, a + rho);
        for (const term of terms) {
          energy += isExcess || term.power === undefined ? term.excess(i, a, rho) : term.energy(i, a + rho);
        }
      }
      into[i] = energy;
    }
  }

  /** Energy of the spring of bead i. @param {Motion} state @param {number} i */
  siteEnergy({ u }, i) {
    const square = u[i] * u[i];
    const linear = this.onSite === undefined ? 0 : 0.5 * this.onSite[i] * square;
    return this.onSiteCubic === undefined ? linear : linear + 0.25 * this.onSiteCubic[i] * (square * square);
  }

  /** Kinetic and potential energy of the resonator of bead i. @param {Motion} state @param {number} i */
  resonatorEnergy({ u, extra }, i) {
    if (this.resonatorMass === undefined) {
      return { kinetic: 0, potential: 0 };
    }
    const [stretch, speed] = [extra[this.atW + i] - u[i], extra[this.atWv + i]];
    return {
      kinetic: 0.5 * this.resonatorMass[i] * (speed * speed),
      potential: 0.5 * this.resonatorStiffness[i] * (stretch * stretch),
    };
  }

  /** Kinetic and potential energy, and the work dissipated and driven since step 0 (J). @param {Motion} state */
  energies(state) {
    const { beads: n, mass } = this;
    const { v, extra } = state;
    const contacts = new Float64Array(n + 1);
    this.contactEnergies(state, contacts);
    const ends = this.isRing ? contacts[0] : contacts[0] + contacts[n];
    let potential = sum(n - 1, (i) => contacts[i + 1]) + ends;
    let kinetic = sum(n, (i) => 0.5 * mass[i] * (v[i] * v[i]));
    if (this.onSite !== undefined) {
      potential += sum(n, (i) => this.siteEnergy(state, i));
    }
    if (this.resonatorMass !== undefined) {
      kinetic += sum(n, (i) => this.resonatorEnergy(state, i).kinetic);
      potential += sum(n, (i) => this.resonatorEnergy(state, i).potential);
    }
    return {
      kinetic,
      potential,
      dissipated: this.atWork < 0 ? 0 : sum(n, (i) => extra[this.atWork + i]),
      driven: this.drivenWork(state),
    };
  }
}
