//! A power of the overlap, as a term: `F = k·δ^α` where the contact is closed.

use super::{InGroups, Law};
use crate::contact::{ContactLaw, Power, PowerUser, evaluate};
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

    #[inline(always)]
    fn tangent_by_force(&self, _: f64, overlap_m: f64, force_n: f64) -> f64 {
        if overlap_m > 0.0 { self.alpha() * (force_n / overlap_m) } else { 0.0 }
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

    #[inline(always)]
    fn forces(&self, stiffness: &[f64], overlap_m: &[f64], force_n: &mut [f64]) {
        self.with_power(Forces {
            contacts: [overlap_m, stiffness],
            force_n,
            zero_up_to_m: self.zero_up_to_m(),
        });
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
        let (zero_up_to_m, mut closed_m) = (simd.splat_f64s(law.zero_up_to_m()), Group([0.0; G]));
        for at in (0..G).step_by(S::F64_LANES) {
            store::<S>(above(simd, load::<S>(&overlap_m.0, at), zero_up_to_m), &mut closed_m.0, at);
        }
        let powers = power.raise_group(simd, &closed_m);
        for at in (0..G).step_by(S::F64_LANES) {
            let force_n = simd.mul_f64s(load::<S>(stiffness, at), load::<S>(&powers.0, at));
            store::<S>(simd.add_f64s(load::<S>(&sum_n.0, at), force_n), &mut sum_n.0, at);
        }
    }
}

struct Forces<'a> {
    contacts: [&'a [f64]; 2],
    force_n: &'a mut [f64],
    zero_up_to_m: f64,
}

impl PowerUser for Forces<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        evaluate(
            self.contacts,
            self.force_n,
            power,
            self.zero_up_to_m,
            #[inline(always)]
            |[overlap_m, _]| overlap_m,
            #[inline(always)]
            |[_, stiffness], _, power| stiffness * power,
            #[inline(always)]
            |_, any_closed| any_closed,
        );
    }
}
