//! Arrays of what goes beyond one power law: terms of forces, what acts on each bead, spheres of given materials.

use super::{Physics, usize_of};
use crate::config::{End, Profile, Sphere, WallMaterial};
use crate::contact::ContactLaw;
use crate::sites::Sites;
use crate::term::{Term, TermLaw};

impl Physics {
    /// Whether contacts have other forces than one power of one exponent.
    pub(super) fn is_beyond_one_power(&self) -> bool {
        self.alphas.is_some() || self.second.is_some() || self.bonds.is_some()
    }

    /// What is left of the `stiffness` of the contacts for the law of exponent `alpha`, and the further terms of their forces.
    pub(super) fn terms(&self, mut stiffness: Vec<f64>) -> (Vec<f64>, Vec<Term>) {
        let contacts = stiffness.len();
        let mut terms = Vec::new();
        if let Some(bonds) = &self.bonds {
            stiffness.fill(0.0);
            let springs = [&bonds.linear, &bonds.quadratic, &bonds.cubic];
            for (n, stiffness) in (1..).zip(springs) {
                terms.extend(stiffness.iter().map(|k| term(TermLaw::Spring(n), k, contacts)));
            }
            let toda = bonds.toda.iter();
            terms.extend(
                toda.map(|toda| term(TermLaw::Toda(toda.steepness_per_m), &toda.stiffness, contacts)),
            );
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

    /// What acts on each bead beside its contacts.
    pub(super) fn sites(&self) -> Sites {
        let beads = usize_of(self.beads);
        let values = |profile: &Option<Profile>| profile.as_ref().map(|profile| profile.values(beads));
        let cubic = values(&self.on_site.cubic_n_per_m3);
        let linear = values(&self.on_site.linear_n_per_m);
        // the linear ones are there where any are
        let linear = linear.or_else(|| cubic.as_ref().map(|_| vec![0.0; beads]));
        let (resonator_kg, resonator_n_per_m) = match &self.resonators {
            None => (Vec::new(), Vec::new()),
            Some(resonators) => {
                let mass_kg = resonators.mass_kg.values(beads);
                let mut stiffness = resonators.stiffness_n_per_m.values(beads);
                for (stiffness, mass_kg) in stiffness.iter_mut().zip(&mass_kg) {
                    *stiffness = if *mass_kg > 0.0 { *stiffness } else { 0.0 };
                }
                (mass_kg, stiffness)
            }
        };
        Sites {
            linear_n_per_m: linear.unwrap_or_default(),
            cubic_n_per_m3: cubic.unwrap_or_default(),
            drag_n_s_per_m: if self.has_drag() { self.drags() } else { Vec::new() },
            resonator_kg,
            resonator_n_per_m,
        }
    }

    /// The drag of each bead (N·s/m): what is asked for, and at an absorbing end one that grows with the cube of the way into it.
    fn drags(&self) -> Vec<f64> {
        let beads = usize_of(self.beads);
        let mut drag =
            self.on_site.drag_n_s_per_m.as_ref().map_or(vec![0.0; beads], |drag| drag.values(beads));
        let most = self.ends.absorbing_drag_n_s_per_m.unwrap_or_else(|| self.usual_drag_n_s_per_m());
        let depth = self.absorbing_beads();
        for (end, from) in [(self.ends.left, 0), (self.ends.right, beads - 1)] {
            if end != End::Absorbing {
                continue;
            }
            for way in 0..depth {
                let bead = if from == 0 { way } else { from - way };
                let part = (depth - way) as f64 / depth as f64;
                drag[bead] += most * (part * part * part);
            }
        }
        drag
    }

    /// Beads with drag at an absorbing end.
    pub(super) fn absorbing_beads(&self) -> usize {
        let usual = (self.beads / 5).clamp(1, 100); // integers
        usize_of(self.ends.absorbing_beads.unwrap_or(usual))
    }

    /// Half of `m/T` where contacts are loaded or bonds: a wave dies out on its way there and back. Where beads are loose the last of
    /// them carry the energy away, as from a free end, and are slowed down then; a strong drag on the way would send back more than it
    /// takes: 1/200 of `m/T`.
    fn usual_drag_n_s_per_m(&self) -> f64 {
        let is_loose = self.load.is_none() && self.bonds.is_none();
        let part = if is_loose { 0.005 } else { 0.5 };
        part * self.bead_mass_kg / self.scales().time_s
    }

    /// The sphere that each bead is, before any disorder; none in a chain of masses.
    pub(super) fn all_spheres(&self) -> Option<Vec<Sphere>> {
        let pattern = &self.spheres.as_ref()?.0;
        let mut all: Vec<Sphere> = pattern.iter().copied().cycle().take(usize_of(self.beads)).collect();
        for odd in &self.odd_spheres {
            all[usize_of(odd.bead)] = odd.sphere;
        }
        Some(all)
    }

    /// Stiffnesses (N·m^−3/2) of the contacts of `spheres` with walls.
    pub(super) fn sphere_walls(&self, spheres: &[Sphere]) -> [f64; 2] {
        let (first, last) = (&spheres[0], &spheres[spheres.len() - 1]);
        let at = |sphere: &Sphere, material: Option<WallMaterial>| match (material, self.ends.left) {
            // the contact that closes a ring joins the last sphere to the first
            (_, End::Periodic) => last.stiffness_with(first),
            (Some(wall), _) => sphere.stiffness_at(&wall.0),
            (None, _) => sphere.stiffness_at(&sphere.material),
        };
        [at(first, self.ends.left_material), at(last, self.ends.right_material)]
    }
}

/// A term with the stiffness of the first and the last contact at the ends.
fn term(law: TermLaw, stiffness: &Profile, contacts: usize) -> Term {
    let stiffness = stiffness.values(contacts);
    let wall_stiffness = [stiffness[0], stiffness[contacts - 1]];
    Term { law, stiffness, wall_stiffness }
}

/// Each number once, in the order of their first places.
pub(super) fn different(values: &[f64]) -> Vec<f64> {
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

/// Different exponents that the contacts of a chain can have: each has a table of its own.
pub(super) const MOST_EXPONENTS: usize = 16;
