// Laws of contacts beside a power: their forces and energies, and how a manifest writes them. Written from docs/KERNEL.md alone.

import { expm1, q2 } from "./waveforms.js";

/**
 * A law of stiffness k and parameter b: the force at an overlap δ; the energy beyond that at rest, less the work of the force at
 * rest, at an approach a from the rest overlap ρ.
 * @typedef {{ force: (k: number, b: number, delta: number) => number, excess: (k: number, b: number, a: number, rho: number) => number,
 *   has: (b: number) => boolean }} Law
 */

/** Laws by the kinds of terms in `/chain`. @type {Record<string, Law>} */
export const LAWS = {
  spring: {
    has: (b) => [1, 2, 3].includes(b),
    force: (k, b, delta) => k * (b === 1 ? delta : b === 2 ? delta * delta : delta * delta * delta),
    excess: (k, b, a, rho) => {
      const square = a * a;
      if (b === 1) {
        return 0.5 * k * square;
      }
      return k * square * (b === 2 ? rho + a / 3 : 1.5 * (rho * rho) + rho * a + 0.25 * square);
    },
  },
  toda: {
    has: () => true,
    force: (k, b, delta) => k * (expm1(b * delta) / b),
    excess: (k, b, a, rho) => {
      const x = b * a;
      return k * (expm1(b * rho) + 1) * (Math.abs(x) <= 0.34 ? a * a * q2(x) : (expm1(x) / b - a) / b);
    },
  },
};

/**
 * What `bonds` of a manifest may have: a stiffness, or a stiffness and a parameter. Those that hold have a bottom.
 * @type {Record<string, { holds: boolean, hasEitherSign?: boolean, parameter?: string }>}
 */
export const BONDS = {
  linear: { holds: true },
  quadratic: { holds: false, hasEitherSign: true },
  cubic: { holds: true },
  toda: { holds: true, parameter: "steepness_per_m" },
};
