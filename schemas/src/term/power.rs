//! A power of the overlap, as a term: `F = k·δ^α` where the contact is closed.

use super::{Contacts, Law};
use crate::contact::{ContactLaw, Power, PowerUser, evaluate};
use crate::excess::{AtRest, Excess};

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
    fn forces_of(&self, contacts: Contacts<'_>, force_n: &mut [f64]) {
        self.with_power(Forces { contacts, force_n, zero_up_to_m: self.zero_up_to_m() });
    }

    fn exponent(&self) -> Option<f64> {
        Some(self.alpha())
    }
}

struct Forces<'a> {
    contacts: Contacts<'a>,
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
            |[left, right, _, rest]| (left - right) + rest,
            #[inline(always)]
            |[_, _, stiffness, _], _, power| stiffness * power,
            #[inline(always)]
            |_, any_closed| any_closed,
        );
    }
}
