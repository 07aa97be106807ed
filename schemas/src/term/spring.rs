//! Two-sided springs: `F = k·δ^n`, also where δ < 0.

use super::{BondForm, Holds, InGroups, Law, TermLaw};
use crate::simd::{Group, load, store};
use pulp::Simd;

/// `F = k·δ^n` with n = 1, 2 or 3, k in N·m^−n.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spring(pub u8);

impl Law for Spring {
    fn forms() -> &'static [BondForm] {
        const {
            &[
                BondForm {
                    key: "linear",
                    words: "linear",
                    parameter: None,
                    has_either_sign: false,
                    allowed: "stiffnesses of 0, or 1e-100 to 1e100",
                    is_slope: true,
                    holds: Holds::Weak,
                    law: |_| TermLaw::Spring(Spring(1)),
                },
                BondForm {
                    key: "quadratic",
                    words: "quadratic (FPUT-α)",
                    parameter: None,
                    has_either_sign: true,
                    allowed: "0, or 1e-100 to 1e100 of either sign",
                    is_slope: false,
                    holds: Holds::None,
                    law: |_| TermLaw::Spring(Spring(2)),
                },
                BondForm {
                    key: "cubic",
                    words: "cubic (FPUT-β)",
                    parameter: None,
                    has_either_sign: false,
                    allowed: "0, or 1e-100 to 1e100: with less than 0 the bond would break away",
                    is_slope: false,
                    holds: Holds::All,
                    law: |_| TermLaw::Spring(Spring(3)),
                },
            ]
        }
    }

    fn named(&self) -> (&'static str, f64) {
        ("spring", f64::from(self.0))
    }

    #[inline(always)]
    fn force(&self, stiffness: f64, overlap_m: f64) -> f64 {
        match self.0 {
            1 => stiffness * overlap_m,
            2 => stiffness * (overlap_m * overlap_m),
            _ => stiffness * (overlap_m * overlap_m * overlap_m),
        }
    }

    #[inline(always)]
    fn tangent(&self, stiffness: f64, overlap_m: f64) -> f64 {
        match self.0 {
            1 => stiffness,
            2 => 2.0 * stiffness * overlap_m,
            _ => 3.0 * stiffness * (overlap_m * overlap_m),
        }
    }

    fn excess_j(&self, stiffness: f64, rest_m: f64, approach_m: f64, _: bool) -> f64 {
        let a = approach_m;
        match self.0 {
            1 => 0.5 * stiffness * (a * a),
            2 => stiffness * (a * a) * (rest_m + a / 3.0),
            _ => stiffness * (a * a) * ((1.5 * (rest_m * rest_m) + rest_m * a) + 0.25 * (a * a)),
        }
    }

    /// The energy of a cubic bond is at least `k·a⁴/12` for the approach `a`, whatever its rest overlap.
    fn tangent_by_energy(&self, stiffness: f64, rest_m: f64, energy_j: f64) -> Option<f64> {
        let approach_m = if stiffness > 0.0 { (12.0 * energy_j / stiffness).sqrt().sqrt() } else { 0.0 };
        (self.0 == 3).then(|| self.tangent(stiffness, rest_m.abs() + approach_m))
    }
}

impl Spring {
    /// The forces (N) of a register of contacts with the overlaps `d` (m).
    #[inline(always)]
    pub fn in_register<S: Simd>(self, simd: S, stiffness: S::f64s, d: S::f64s) -> S::f64s {
        let power = match self.0 {
            1 => d,
            2 => simd.mul_f64s(d, d),
            _ => simd.mul_f64s(simd.mul_f64s(d, d), d),
        };
        simd.mul_f64s(stiffness, power)
    }
}

impl InGroups for Spring {
    #[inline(always)]
    fn add_to<S: Simd, const G: usize>(
        &self,
        simd: S,
        stiffness: &[f64; G],
        overlap_m: &Group<G>,
        sum_n: &mut Group<G>,
    ) {
        for at in (0..G).step_by(S::F64_LANES) {
            let force_n = self.in_register(simd, load::<S>(stiffness, at), load::<S>(&overlap_m.0, at));
            store::<S>(simd.add_f64s(load::<S>(&sum_n.0, at), force_n), &mut sum_n.0, at);
        }
    }
}
