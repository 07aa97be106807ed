//! Toda's exponential, also where δ < 0.
//!
//! # Source
//! M. Toda, J. Phys. Soc. Jpn. 22 (1967) 431, doi:10.1143/JPSJ.22.431.

use super::{BondForm, Holds, InGroups, Law, TermLaw};
use crate::functions::{exp_m1, q2};
use crate::simd::Group;
use pulp::Simd;

/// `F = k·(exp(b·δ) − 1)/b` with the steepness b (1/m), k in N/m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Toda(pub f64);

/// The step is that of a multiple of the energy: where a bond is as hard as a wall, the step in which it turns a bead back counts.
const SPARE_ENERGY: f64 = 4.0;

impl Law for Toda {
    fn forms() -> &'static [BondForm] {
        const {
            &[BondForm {
                key: "toda",
                words: "Toda",
                parameter: Some(("steepness_per_m", "1/m")),
                has_either_sign: false,
                allowed: "stiffnesses of 0, or 1e-100 to 1e100",
                is_slope: true,
                holds: Holds::Weak,
                law: |steepness_per_m| TermLaw::Toda(Toda(steepness_per_m)),
            }]
        }
    }

    fn named(&self) -> (&'static str, f64) {
        ("toda", self.0)
    }

    #[inline(always)]
    fn force(&self, stiffness: f64, overlap_m: f64) -> f64 {
        stiffness * (exp_m1(self.0 * overlap_m) / self.0)
    }

    #[inline(always)]
    fn tangent(&self, stiffness: f64, overlap_m: f64) -> f64 {
        stiffness * (exp_m1(self.0 * overlap_m) + 1.0)
    }

    fn excess_j(&self, stiffness: f64, rest_m: f64, approach_m: f64, _: bool) -> f64 {
        let (a, b) = (approach_m, self.0);
        let x = b * a;
        let shape = if x.abs() <= 0.34 { a * a * q2(x) } else { (exp_m1(x) / b - a) / b };
        stiffness * (exp_m1(b * rest_m) + 1.0) * shape
    }

    /// With `x = b·a` for the approach `a`, and `e = energy·b²/at_rest`, `exp(x) − 1 − x = e`, so that `x ≤ √(2·e)` and
    /// `exp(x) ≤ 1 + e + √(2·e)`: it grows with the energy, not with the exponential of a speed.
    fn tangent_by_energy(&self, stiffness: f64, rest_m: f64, energy_j: f64) -> Option<f64> {
        let at_rest = self.tangent(stiffness, rest_m);
        if at_rest == 0.0 {
            return Some(0.0);
        }
        let e = SPARE_ENERGY * energy_j * (self.0 * self.0) / at_rest;
        Some(at_rest * (1.0 + e + (2.0 * e).sqrt()))
    }
}

impl InGroups for Toda {
    #[inline(always)]
    fn add_to<S: Simd, const G: usize>(
        &self,
        _: S,
        stiffness: &[f64; G],
        overlap_m: &Group<G>,
        sum_n: &mut Group<G>,
    ) {
        let contacts = stiffness.iter().zip(&overlap_m.0);
        for (sum_n, (stiffness, overlap_m)) in sum_n.0.iter_mut().zip(contacts) {
            *sum_n += self.force(*stiffness, *overlap_m);
        }
    }
}
