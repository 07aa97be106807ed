//! A power of the overlap, as a term: `F = k·δ^α` where the contact is closed.

use super::{InGroups, Law};
use crate::contact::{ContactLaw, Power, PowerUser};
use crate::excess::{AtRest, Excess};
use crate::simd::{Group, above, load, store};
use pulp::{Simd, WithSimd};

impl Law for ContactLaw {
    fn named(&self) -> (&'static str, f64) {
        ("power", self.alpha())
    }

    fn force(&self, stiffness: f64, overlap_m: f64) -> f64 {
        ContactLaw::force(self, stiffness, overlap_m)
    }

    fn tangent(&self, stiffness: f64, overlap_m: f64) -> f64 {
        ContactLaw::tangent(self, stiffness, overlap_m)
    }

    fn excess_j(&self, stiffness: f64, rest_m: f64, approach_m: f64, is_loaded: bool) -> f64 {
        let energy_j = self.energy(stiffness, approach_m + rest_m);
        if !is_loaded {
            return energy_j;
        }
        let rest = AtRest {
            overlap_m: rest_m,
            force_n: ContactLaw::force(self, stiffness, rest_m),
            energy_j: self.energy(stiffness, rest_m),
        };
        Excess::new(self).energy_j(rest, approach_m, energy_j)
    }

    fn exponent(&self) -> Option<f64> {
        Some(self.alpha())
    }
}

impl InGroups for ContactLaw {
    #[inline(always)]
    fn add_to<S: Simd, const G: usize>(
        &self,
        simd: S,
        stiffness: &[f64; G],
        overlap_m: &Group<G>,
        sum_n: &mut Group<G>,
    ) {
        // a call, so that its loops are there once for all laws of the contact itself
        simd.vectorize(AddPowers { law: self, stiffness, overlap_m, sum_n });
    }

    #[inline(always)]
    fn add_slopes<S: Simd, const G: usize>(
        &self,
        simd: S,
        contacts: [&[[f64; G]]; 2],
        sums: &mut [[f64; G]],
    ) {
        self.with_power(AddSlopes { simd, law: self, contacts, sums });
    }
}

struct AddPowers<'a, const G: usize> {
    law: &'a ContactLaw,
    stiffness: &'a [f64; G],
    overlap_m: &'a Group<G>,
    sum_n: &'a mut Group<G>,
}

impl<const G: usize> WithSimd for AddPowers<'_, G> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.law.with_power(AddPowersIn { simd, add: self });
    }
}

struct AddPowersIn<'a, S, const G: usize> {
    simd: S,
    add: AddPowers<'a, G>,
}

impl<S: Simd, const G: usize> PowerUser for AddPowersIn<'_, S, G> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        let Self { simd, add: AddPowers { law, stiffness, overlap_m, sum_n } } = self;
        let powers = power.raise_group(simd, &closed(simd, law, &overlap_m.0));
        for at in (0..G).step_by(S::F64_LANES) {
            let force_n = simd.mul_f64s(load::<S>(stiffness, at), load::<S>(&powers.0, at));
            store::<S>(simd.add_f64s(load::<S>(&sum_n.0, at), force_n), &mut sum_n.0, at);
        }
    }
}

struct AddSlopes<'a, S, const G: usize> {
    simd: S,
    law: &'a ContactLaw,
    contacts: [&'a [[f64; G]]; 2],
    sums: &'a mut [[f64; G]],
}

impl<S: Simd, const G: usize> PowerUser for AddSlopes<'_, S, G> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        let Self { simd, law, contacts: [stiffness, overlap_m], sums } = self;
        let (none, alpha) = (simd.splat_f64s(0.0), simd.splat_f64s(law.alpha()));
        let zero_up_to_m = simd.splat_f64s(law.zero_up_to_m());
        for (sums, (stiffness, overlap_m)) in sums.iter_mut().zip(stiffness.iter().zip(overlap_m)) {
            let powers = match power.formula() {
                Some(_) => Group([0.0; G]),
                None => power.raise_group(simd, &closed(simd, law, overlap_m)),
            };
            for at in (0..G).step_by(S::F64_LANES) {
                let overlap_m = load::<S>(overlap_m, at);
                let slope = match power.formula() {
                    Some(formula) => formula.slope(simd, overlap_m, at / S::F64_LANES),
                    None => simd.mul_f64s(alpha, simd.div_f64s(load::<S>(&powers.0, at), overlap_m)),
                };
                // whatever comes of open contacts is left out
                let slope = simd.select_f64s(simd.greater_than_f64s(overlap_m, zero_up_to_m), slope, none);
                let slope = simd.mul_f64s(load::<S>(stiffness, at), slope);
                store::<S>(simd.add_f64s(load::<S>(sums, at), slope), sums, at);
            }
        }
    }
}

/// The overlaps (m) as they count in powers: 0 in open contacts.
#[inline(always)]
fn closed<S: Simd, const G: usize>(simd: S, law: &ContactLaw, overlap_m: &[f64; G]) -> Group<G> {
    let (zero_up_to_m, mut closed_m) = (simd.splat_f64s(law.zero_up_to_m()), Group([0.0; G]));
    for at in (0..G).step_by(S::F64_LANES) {
        store::<S>(above(simd, load::<S>(overlap_m, at), zero_up_to_m), &mut closed_m.0, at);
    }
    closed_m
}
