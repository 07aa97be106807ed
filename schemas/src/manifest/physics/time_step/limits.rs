//! The limits of a step, in words; and what smooth forces and drag allow.

use super::{Physics, larger, smaller};
use crate::chain::Chain;
use crate::manifest::physics::usize_of;
use crate::power::power;
use crate::term::Holds;

/// The part of a chain that decides a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// The collision time T of a bead of `bead_mass_kg`, or the time scale of what else moves it.
    Collision,
    /// The collision time of the striker's own mass.
    Striker,
    /// The collision time of the lightest bead with the stiffest contact.
    Lightest,
    /// The stiffest contact under the load.
    Load,
    /// The force of this contact, which joins the bead of this number to the next one.
    Contact(u64),
    /// The contacts and springs of this bead.
    Bead(u64),
    /// The resonator of this bead.
    Resonator(u64),
    /// The damping of contacts.
    Damping,
    /// The drag of this bead.
    Drag(u64),
    /// The friction of this bath.
    Bath(u64),
    /// This drive.
    Drive(u64),
}

impl Physics {
    /// The words for the limit of the default step: `by the contact of beads 3 and 4`. They need a search through the whole chain.
    ///
    /// ```
    /// use schemas::{manifest::Physics, presets::Preset};
    /// let physics = Physics::resolve(&Preset::find("walls").ok_or("no preset")?.config())?;
    /// let (_, limit) = physics.usual_step();
    /// assert_eq!(physics.limit_words(limit), "by the collision time T");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn limit_words(&self, limit: Limit) -> String {
        let contact = |contact: u64| format!("the contact of beads {contact} and {}", contact + 1);
        match limit {
            Limit::Collision => "by the collision time T".to_owned(),
            Limit::Striker => format!("by the striker, bead {}", self.striker.bead),
            Limit::Lightest => {
                let (bead, stiffest) = lightest_and_stiffest(&self.chain());
                let stiffest = stiffest.map(|c| format!(" and {}, the stiffest", contact(c)));
                format!("by bead {bead}, the lightest{}", stiffest.unwrap_or_default())
            }
            Limit::Load => {
                let tangents = self.chain().tangents_n_per_m();
                format!("by {} under the load", contact(place_of_largest(&tangents)))
            }
            Limit::Contact(c) => format!("by {}", contact(c)),
            Limit::Bead(bead) => format!("by bead {bead} between its contacts"),
            Limit::Resonator(bead) => format!("by the resonator of bead {bead}"),
            Limit::Damping => "by the damping".to_owned(),
            Limit::Drag(bead) => format!("by the drag of bead {bead}"),
            Limit::Bath(number) => format!("by the friction of bath {number}"),
            Limit::Drive(number) => format!("by drive {number}"),
        }
    }

    /// The shortest time (s) in which drag slows a bead down by a factor e, and the bead.
    pub(super) fn fastest_drag(&self) -> Option<(f64, u64)> {
        if !self.has_drag() {
            return None;
        }
        let (chain, drag) = (self.chain(), self.sites().drag_n_s_per_m);
        let times = chain.mass_kg.iter().zip(&drag).map(|(mass_kg, drag)| mass_kg / drag);
        times.zip(0..).filter(|(time_s, _)| time_s.is_finite()).reduce(|a, b| if b.0 < a.0 { b } else { a })
    }

    /// `2/ω` (s) of the highest frequency that the lightest bead could have by all forces that are not one power of the overlap, at
    /// the largest overlap and displacement that is to be expected; nothing where there are no others.
    ///
    /// ω is that of a chain of such beads, `ω² = 4·k/m`. An impurity is alone: its ω² is at most
    /// `(k_l + k_r)/m + k_l/√(m·m_l) + k_r/√(m·m_r)` with the stiffnesses and masses on its left and right.
    pub(super) fn fastest_linear(&self) -> Option<(f64, Limit)> {
        let sites = self.sites();
        let is_softened = !self.is_moved_otherwise();
        if !self.has_other_laws() && sites.is_none() && is_softened {
            return None;
        }
        let chain = self.chain();
        let tangents = self.expected_tangents(&chain);
        let moved_m = self.expected_overlap_m(&chain);
        let on_site = |most: &dyn Fn(&[f64]) -> f64| {
            most(&sites.linear_n_per_m) + 3.0 * most(&sites.cubic_n_per_m3) * (moved_m * moved_m)
        };
        let is_impurity = self.impurity_marks();
        let ordinary = chain.mass_kg.iter().zip(&is_impurity).filter(|(_, is_odd)| !**is_odd);
        let lightest_kg = ordinary.map(|(mass_kg, _)| *mass_kg).fold(f64::INFINITY, smaller);
        let stiffest = place_of_largest(&tangents);
        let largest = tangents.iter().copied().fold(0.0, larger);
        let most = |values: &[f64]| values.iter().copied().fold(0.0, larger);
        let by_bonds = largest / lightest_kg;
        let by_springs = 0.25 * on_site(&most) / lightest_kg;
        let mut fastest = (by_bonds + by_springs, Limit::Contact(stiffest));
        if by_springs > by_bonds {
            fastest.1 = Limit::Bead(place_of_largest(&sites.linear_n_per_m));
        }
        let mut with = |squared: f64, by: Limit| {
            if squared > fastest.0 {
                fastest = (squared, by);
            }
        };
        let of_impurity = |i: usize| {
            let side = |k: f64, other: usize| k * (1.0 + (chain.mass_kg[i] / chain.mass_kg[other]).sqrt());
            let left = if i > 0 { side(tangents[i - 1], i - 1) } else { 0.0 };
            let right = if i < tangents.len() { side(tangents[i], i + 1) } else { 0.0 };
            let at = |values: &[f64]| values.get(i).copied().unwrap_or(0.0);
            0.25 * (left + right + on_site(&at)) / chain.mass_kg[i]
        };
        for (i, _) in is_impurity.iter().enumerate().filter(|(_, is_odd)| **is_odd) {
            with(of_impurity(i), Limit::Bead(i as u64));
        }
        let (bead_kg, springs) = (&chain.mass_kg, by_springs * lightest_kg);
        let resonators = sites.resonator_kg.iter().zip(&sites.resonator_n_per_m).enumerate();
        for (i, (mass_kg, stiffness)) in resonators.filter(|(_, (mass_kg, _))| **mass_kg > 0.0) {
            let inside = 0.25 * stiffness * (1.0 / mass_kg + 1.0 / bead_kg[i]);
            with(inside + (largest + springs) / bead_kg[i], Limit::Resonator(i as u64));
        }
        (fastest.0 > 0.0).then(|| (1.0 / fastest.0.sqrt(), fastest.1))
    }

    /// True for each bead that is an impurity or an odd sphere.
    fn impurity_marks(&self) -> Vec<bool> {
        let mut marks = vec![false; usize_of(self.beads)];
        for odd in self.odd_beads() {
            marks[usize_of(odd.bead)] = true;
        }
        marks
    }

    /// The largest overlap (m), or displacement, that is to be expected beyond that at rest.
    fn expected_overlap_m(&self, chain: &Chain) -> f64 {
        let speed_m_s = self.typical_speed_m_s();
        // where forces are linear a speed compresses a bond by v·√(m/k)
        let softest = chain.tangents_n_per_m().into_iter().filter(|k| *k > 0.0).reduce(smaller);
        let struck_m = match softest {
            Some(softest) => speed_m_s * (self.bead_mass_kg / softest).sqrt(),
            None => {
                self.striker_ratio(self.stiffness).map_or(0.0, |ratio| power(ratio, 1.0 / (self.alpha + 1.0)))
            }
        };
        larger(struck_m, self.typical_overlap_m())
    }

    /// Slope dF/dδ (N/m) of each contact where it is pressed as far as is to be expected, N − 1 values.
    fn expected_tangents(&self, chain: &Chain) -> Vec<f64> {
        let moved_m = self.expected_overlap_m(chain);
        let energy_j = self.energy_for_bonds_j();
        // the overlap of the contact before: most contacts are alike
        let mut before = (0, f64::NAN);
        let mut at = |c: usize| {
            let rest_m = larger(chain.rest_overlap_m[c], 0.0);
            let moved_m = if self.bonds.is_some() {
                moved_m
            } else {
                if !before.1.is_finite() || !is_alike(chain, before.0, c) {
                    before = (
                        c,
                        self.struck_by_its_laws_m(chain, c)
                            .map_or(moved_m, |struck_m| larger(struck_m, self.typical_overlap_m())),
                    );
                }
                before.1
            };
            let slope = |overlap_m: f64| {
                let by_law = chain.law.tangent(chain.stiffness[c], overlap_m);
                chain.terms.iter().fold(by_law, |sum, term| {
                    let stiffness = term.stiffness[c];
                    let tangent = term.law.tangent(stiffness, overlap_m);
                    let by_energy =
                        energy_j.and_then(|energy_j| term.law.tangent_by_energy(stiffness, rest_m, energy_j));
                    sum + by_energy.map_or(tangent, |most| smaller(tangent, most))
                })
            };
            // bonds may be harder where they are longer
            let others_m =
                if self.bonds.is_some() { [rest_m, rest_m - moved_m] } else { [rest_m + moved_m; 2] };
            others_m.into_iter().map(slope).fold(slope(rest_m + moved_m), larger)
        };
        (0..chain.contact_count()).map(&mut at).collect()
    }

    /// The overlap scale (m) of the striker in contact `c`, that of its hardest power: where contacts have several exponents, or nothing
    /// presses them; else none.
    fn struck_by_its_laws_m(&self, chain: &Chain, c: usize) -> Option<f64> {
        if self.alphas.is_none() && self.second.is_none() {
            return None;
        }
        let of = |stiffness: f64, alpha: f64| {
            let ratio = (stiffness > 0.0).then(|| self.striker_ratio(stiffness)).flatten();
            ratio.map(|ratio| power(ratio, 1.0 / (alpha + 1.0)))
        };
        let further =
            chain.terms.iter().map(|term| term.law.exponent().and_then(|alpha| of(term.stiffness[c], alpha)));
        further.chain([of(chain.stiffness[c], chain.law.alpha())]).flatten().reduce(smaller)
    }

    /// The energy (J) that one bond may have at most: that of the whole chain, where nothing drives it and no term has a negative energy.
    fn energy_for_bonds_j(&self) -> Option<f64> {
        let bonds = self.bonds.as_ref()?;
        let counts = bonds.laws().any(|bond| bond.law.tangent_by_energy(1.0, 0.0, 1.0).is_some());
        let is_closed = !self.is_driven() && bonds.laws().all(|bond| bond.form.holds != Holds::None);
        (counts && is_closed).then(|| self.initial_energy().total_j())
    }
}

/// True if two contacts have the same stiffnesses and rest overlap.
fn is_alike(chain: &Chain, a: usize, b: usize) -> bool {
    chain.stiffness[a] == chain.stiffness[b]
        && chain.rest_overlap_m[a] == chain.rest_overlap_m[b]
        && chain.terms.iter().all(|term| term.stiffness[a] == term.stiffness[b])
}

/// The place of the largest of `values`, the first of them.
fn place_of_largest(values: &[f64]) -> u64 {
    let places = values.iter().zip(0..);
    places.reduce(|a, b| if b.0 > a.0 { b } else { a }).map_or(0, |(_, place)| place)
}

/// The lightest bead, and the stiffest contact where contacts differ.
fn lightest_and_stiffest(chain: &Chain) -> (u64, Option<u64>) {
    let negative: Vec<f64> = chain.mass_kg.iter().map(|mass_kg| -mass_kg).collect();
    let differ = chain.stiffness.iter().any(|k| *k != chain.stiffness[0]);
    (place_of_largest(&negative), differ.then(|| place_of_largest(&chain.stiffness)))
}
