//! Laws beside one power of one exponent: their checks, and the terms that they give.

use super::check::{check_positive, is_0_or_more};
use super::{Physics, usize_of};
use crate::config::{Bond, Bonds, ConfigError, End, Profile};
use crate::contact::ContactLaw;
use crate::damping::Damping;
use crate::term::{Term, TermLaw};

impl Physics {
    /// True if contacts have other forces than one power of one exponent.
    pub(super) fn has_other_laws(&self) -> bool {
        self.alphas.is_some() || self.second.is_some() || self.bonds.is_some()
    }

    pub(super) fn check_laws(&self) -> Result<(), ConfigError> {
        let contacts = self.contacts_by_rule();
        if let Some(alphas) = &self.alphas {
            let key = "chain.alphas";
            let allowed = "exponents from 1 to 1000";
            alphas.check(key, contacts, |alpha| (1.0..=1000.0).contains(&alpha), allowed)?;
            if different(alphas.written()).len() > MOST_EXPONENTS {
                let allowed = format!("at most {MOST_EXPONENTS} different ones: each has a table of its own");
                return Err(ConfigError::value(key, "more different exponents", &allowed));
            }
        }
        if let Some(second) = &self.second {
            if !(1.0..=1000.0).contains(&second.alpha) {
                let allowed = "an exponent from 1 to 1000";
                return Err(ConfigError::number("chain.second.alpha", second.alpha, allowed));
            }
            second.stiffness.check(
                "chain.second.stiffness",
                contacts,
                is_0_or_more,
                "stiffnesses of 0, or 1e-100 to 1e100",
            )?;
        }
        if let Some(gaps_m) = &self.gaps_m {
            let allowed = "gaps of 0 m, or 1e-100 to 1e100 m; [load] presses contacts together";
            gaps_m.check("chain.gaps_m", contacts, is_0_or_more, allowed)?;
            if !self.load.is_none() {
                let allowed = "no gaps in a chain that [load] presses together: it closes them";
                return Err(ConfigError::value("chain.gaps_m", "gaps with a load", allowed));
            }
        }
        if let Some(bonds) = &self.bonds {
            self.check_bonds(bonds)?;
        }
        match self.damping {
            Some(Damping::ViscousNSPerM(_)) | None => Ok(()),
            Some(_) if !self.has_other_laws() => Ok(()),
            Some(damping) => {
                let allowed = "viscous_n_s_per_m where contacts are not one power of one exponent";
                Err(ConfigError::value("damping", damping.key(), allowed))
            }
        }
    }

    /// The likely reason for which numbers of this run leave the range of doubles, and what to do.
    pub fn why_not_finite(&self) -> &'static str {
        let can_break = |bonds: &Bonds| bonds.can_break(usize_of(self.contacts_by_rule()));
        if self.bonds.as_ref().is_some_and(can_break) && self.on_site.cubic_n_per_m3.is_none() {
            "a bond was pulled over the edge of its potential, which a quadratic force has where no cubic one holds it; begin with \
             less energy, or add `cubic` to the bonds (or choose a smaller dt, if this energy is far below the edge)"
        } else {
            "the time step is too long for this chain; choose a smaller dt"
        }
    }

    fn check_bonds(&self, bonds: &Bonds) -> Result<(), ConfigError> {
        let contacts = self.contacts_by_rule();
        for Bond { form, law, stiffness } in bonds.laws() {
            let key = format!("chain.bonds.{}", form.key);
            let is_allowed =
                |value: f64| is_0_or_more(if form.has_either_sign { value.abs() } else { value });
            let Some((parameter, unit)) = form.parameter else {
                stiffness.check(&key, contacts, is_allowed, form.allowed)?;
                continue;
            };
            stiffness.check(&format!("{key}.stiffness"), contacts, is_allowed, form.allowed)?;
            check_positive(&format!("{key}.{parameter}"), law.named().1, unit)?;
        }
        if !bonds.hold() {
            return Err(Bonds::refusal());
        }
        let is_else = self.alphas.is_some()
            || self.second.is_some()
            || self.gaps_m.is_some()
            || self.spheres.is_some()
            || !self.stiffnesses.is_uniform()
            || !self.contacts.is_empty()
            || self.load.gravity_m_s2 != 0.0;
        if is_else {
            let allowed = "bonds alone: no alphas, second, gaps_m, spheres, stiffnesses, contacts or gravity beside them";
            return Err(ConfigError::value("chain.bonds", "bonds and contacts", allowed));
        }
        Ok(())
    }

    /// The `stiffness` that contacts keep for the law of exponent `alpha`, and the further terms of their forces.
    pub(super) fn terms(&self, mut stiffness: Vec<f64>) -> (Vec<f64>, Vec<Term>) {
        let contacts = stiffness.len();
        let mut terms = Vec::new();
        if let Some(bonds) = &self.bonds {
            stiffness.fill(0.0);
            terms.extend(bonds.laws().map(|bond| term(bond.law.clone(), &bond.stiffness, contacts)));
        }
        if let Some(alphas) = &self.alphas {
            let alphas = alphas.values(contacts);
            for alpha in different(&alphas) {
                if alpha == self.alpha {
                    continue;
                }
                let mut of_alpha = vec![0.0; contacts];
                for (c, of_alpha) in of_alpha.iter_mut().enumerate() {
                    if alphas[c] == alpha {
                        std::mem::swap(of_alpha, &mut stiffness[c]);
                    }
                }
                let law = TermLaw::Power(ContactLaw::new(alpha));
                terms.push(Term { law, stiffness: of_alpha, wall_stiffness: [0.0; 2] });
            }
        }
        if let Some(second) = &self.second {
            let law = TermLaw::Power(ContactLaw::new(second.alpha));
            terms.push(term(law, &second.stiffness, contacts));
        }
        // where there is no wall there is no force either; a ring has one contact more
        for term in &mut terms {
            for (side, end) in [self.ends.left, self.ends.right].into_iter().enumerate() {
                let is_there = end == End::Fixed || (end == End::Periodic && side == 0);
                if !is_there {
                    term.wall_stiffness[side] = 0.0;
                }
            }
        }
        (stiffness, terms)
    }
}

/// A term with the stiffness of the first and the last contact at the ends.
fn term(law: TermLaw, stiffness: &Profile, contacts: usize) -> Term {
    let stiffness = stiffness.values(contacts);
    let wall_stiffness = [stiffness[0], stiffness[contacts - 1]];
    Term { law, stiffness, wall_stiffness }
}

/// Each number once, in the order of their first places.
fn different(values: &[f64]) -> Vec<f64> {
    let mut found: Vec<f64> = Vec::new();
    for value in values {
        if !found.contains(value) {
            found.push(*value);
        }
        if found.len() > MOST_EXPONENTS {
            break;
        }
    }
    found
}

/// Largest number of different exponents of the contacts of a chain: each has a table of its own.
const MOST_EXPONENTS: usize = 16;
