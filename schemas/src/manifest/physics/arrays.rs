//! Arrays of a chain: one number for each bead and each contact, from the rules of a configuration.
//!
//! These arrays decide bits. They are computed with the arithmetic of the dynamics: every machine resolves a
//! manifest to the same arrays.

use super::disorder::Resolved;
use super::{Physics, larger, usize_of};
use crate::chain::{Chain, Wall, Walls};
use crate::config::{End, MassRule, Sphere, StiffnessRule};
use crate::contact::ContactLaw;
use crate::damping::{ContactDamping, Damping};
use crate::drive::{Place, Side};
use crate::power::power;
use crate::term::{Term, TermLaw};
use std::cell::Cell;
use std::sync::Arc;

impl Physics {
    /// The resolved masses, stiffnesses and rest overlaps, and all else that acts.
    pub fn chain(&self) -> Chain {
        let Contacts { mass_kg, stiffness, rest_overlap_m, walls, law, terms } = self.contacts_at_rest();
        let is_ring = self.ends.left == End::Periodic;
        let damping =
            self.damping.map(|kind| self.contact_damping(kind, &mass_kg, &stiffness, &walls, is_ring));
        let sites = self.sites();
        let moved = |side| {
            let found = self.drives.iter().enumerate().find(|(_, drive)| drive.at == Place::Wall(side));
            found.map(|(d, drive)| (d, Arc::new(drive.clone())))
        };
        let moved_walls = [moved(Side::Left), moved(Side::Right)];
        let mut chain = Chain::new(mass_kg, stiffness, rest_overlap_m, walls, law);
        (chain.sites, chain.is_ring, chain.is_bonded) = (sites, is_ring, self.bonds.is_some());
        (chain.rows, chain.moved_walls) = (self.rows(), moved_walls);
        chain.with_terms(terms).with_damping(damping)
    }

    /// The masses, and the contacts at rest. The scales follow from these alone, and drag and damping follow from the scales.
    fn contacts_at_rest(&self) -> Contacts {
        let Resolved { mass_kg, stiffness, walls: [left, right] } = self.masses_and_stiffnesses();
        let loads = self.loads(&mass_kg);
        let law = ContactLaw::new(self.alpha);
        let (mut stiffness, mut terms) = self.terms(stiffness);
        // as for the contact before where that is like it
        let last: Cell<Option<([f64; 2], f64)>> = Cell::new(None);
        let overlap_m = |stiffness: f64, load_n: f64, of_terms: &dyn Fn(&Term) -> f64| {
            if terms.is_empty() {
                let like_it = last.get().filter(|(of, _)| *of == [stiffness, load_n]);
                let overlap_m = like_it.map_or_else(|| self.overlap_under(load_n, stiffness), |(_, it)| it);
                last.set(Some(([stiffness, load_n], overlap_m)));
                return overlap_m;
            }
            balance(&law, stiffness, &terms.iter().map(|term| (&term.law, of_terms(term))), load_n)
        };
        let mut rest_overlap_m: Vec<f64> = if let Some(gaps_m) = &self.gaps_m {
            gaps_m.values(stiffness.len()).iter().map(|gap_m| 0.0 - gap_m).collect()
        } else {
            // a contact that closes a ring carries what the first one does
            let loads_n = loads.contacts.iter().chain(&loads.contacts);
            let pairs = stiffness.iter().zip(loads_n).enumerate();
            pairs.map(|(c, (k, load_n))| overlap_m(*k, *load_n, &|term| term.stiffness[c])).collect()
        };
        let is_bonded = self.bonds.is_some();
        let wall = |end: End, stiffness: f64, load_n: f64, side: usize| {
            let stiffness = if is_bonded { 0.0 } else { stiffness };
            match end {
                End::Free | End::Absorbing => Wall::default(),
                End::Fixed | End::Periodic => {
                    let rest_m = overlap_m(stiffness, load_n, &|term| term.wall_stiffness[side]);
                    Wall::new(&law, stiffness, rest_m)
                }
            }
        };
        let is_ring = self.ends.left == End::Periodic;
        let walls = if stiffness.len() == mass_kg.len() {
            let closing =
                [&mut stiffness, &mut rest_overlap_m].map(|values| values.pop().unwrap_or_default());
            for term in &mut terms {
                term.wall_stiffness = [term.stiffness.pop().unwrap_or_default(), 0.0];
            }
            Walls { left: Wall::new(&law, closing[0], closing[1]), right: Wall::default() }
        } else if is_ring {
            Walls { left: wall(End::Periodic, left, self.load.precompression_n, 0), right: Wall::default() }
        } else {
            Walls {
                left: wall(self.ends.left, left, loads.left_wall, 0),
                right: wall(self.ends.right, right, loads.right_wall, 1),
            }
        };
        Contacts { mass_kg, stiffness, rest_overlap_m, walls, law, terms }
    }

    fn contact_damping(
        &self,
        kind: Damping,
        mass_kg: &[f64],
        stiffness: &[f64],
        walls: &Walls,
        is_ring: bool,
    ) -> ContactDamping {
        let at = |stiffness: f64, reduced_kg: f64| kind.coefficient(self.alpha, stiffness, reduced_kg);
        let reduced_kg = |pair: &[f64]| pair[0] * pair[1] / (pair[0] + pair[1]);
        let coefficient =
            mass_kg.windows(2).zip(stiffness).map(|(pair, k)| at(*k, reduced_kg(pair))).collect();
        let wall = |wall: &Wall, mass_kg: f64| if wall.is_there { at(wall.stiffness, mass_kg) } else { 0.0 };
        let [first_kg, last_kg] = [mass_kg[0], mass_kg[mass_kg.len() - 1]];
        let left_kg = if is_ring { reduced_kg(&[last_kg, first_kg]) } else { first_kg };
        let ends = [wall(&walls.left, left_kg), wall(&walls.right, last_kg)];
        ContactDamping { kind, coefficient, wall_coefficient: ends }
    }

    /// The mass of each bead (kg), N values, by the rules and before any disorder.
    pub(super) fn masses_kg(&self) -> Vec<f64> {
        let beads = usize_of(self.beads);
        let mut mass_kg: Vec<f64> = match &self.masses {
            MassRule::Uniform => vec![self.bead_mass_kg; beads],
            MassRule::PatternKg(pattern) => pattern.iter().copied().cycle().take(beads).collect(),
            MassRule::Taper(ratio) => (0..beads).map(|bead| self.tapered_kg(*ratio, bead as f64)).collect(),
            MassRule::ListKg(list) => list.clone(),
        };
        for impurity in &self.impurities {
            mass_kg[usize_of(impurity.bead)] = impurity.mass_kg;
        }
        mass_kg
    }

    /// The mass of the striker (kg).
    pub(super) fn striker_kg(&self) -> f64 {
        let bead = self.striker.bead;
        if self.spheres.is_some() || !self.disorder.is_empty() {
            return self.chain_masses_kg()[usize_of(bead)];
        }
        if let Some(impurity) = self.impurities.iter().find(|impurity| impurity.bead == bead) {
            return impurity.mass_kg;
        }
        match &self.masses {
            MassRule::Uniform => self.bead_mass_kg,
            MassRule::PatternKg(pattern) => pattern[usize_of(bead) % pattern.len()],
            MassRule::Taper(ratio) => self.tapered_kg(*ratio, bead as f64),
            MassRule::ListKg(list) => list[usize_of(bead)],
        }
    }

    /// `bead_mass_kg · ratio^bead` (kg).
    pub(super) fn tapered_kg(&self, ratio: f64, bead: f64) -> f64 {
        self.bead_mass_kg * power(ratio, bead)
    }

    /// The stiffness of each contact (N·m^−α), [`Physics::contacts_by_rule`] values.
    pub(super) fn contact_stiffnesses(&self, mass_kg: &[f64], spheres: Option<&[Sphere]>) -> Vec<f64> {
        let (contacts, beads) = (usize_of(self.contacts_by_rule()), mass_kg.len());
        let pairs = (0..contacts).map(|c| (c, (c + 1) % beads));
        let mut stiffness: Vec<f64> = match (&self.stiffnesses, spheres) {
            (_, Some(spheres)) => pairs.map(|(i, j)| spheres[i].stiffness_with(&spheres[j])).collect(),
            (StiffnessRule::Uniform, None) => vec![self.stiffness; contacts],
            (StiffnessRule::Radii, None) => {
                pairs.map(|(i, j)| self.stiffness_of_spheres(mass_kg[i], mass_kg[j])).collect()
            }
            (StiffnessRule::Pattern(pattern), None) => {
                pattern.iter().copied().cycle().take(contacts).collect()
            }
            (StiffnessRule::List(list), None) => list.clone(),
        };
        if let (Some(closing), Some(asked)) = (stiffness.get_mut(beads - 1), self.ends.left_stiffness) {
            *closing = asked;
        }
        for odd in &self.contacts {
            stiffness[usize_of(odd.contact)] = odd.stiffness;
        }
        stiffness
    }

    /// The stiffnesses (N·m^−α) that the contacts with the left and with the right wall have where there is one.
    pub(super) fn wall_stiffnesses(&self, mass_kg: &[f64], spheres: Option<&[Sphere]>) -> [f64; 2] {
        let [first_kg, last_kg] = [mass_kg[0], mass_kg[mass_kg.len() - 1]];
        let usual = match (spheres, &self.stiffnesses) {
            (Some(spheres), _) => self.sphere_walls(spheres),
            (None, StiffnessRule::Radii) => {
                [self.stiffness_at_wall(first_kg), self.stiffness_at_wall(last_kg)]
            }
            (None, _) => [self.stiffness; 2],
        };
        [self.ends.left_stiffness.unwrap_or(usual[0]), self.ends.right_stiffness.unwrap_or(usual[1])]
    }

    /// `k·√(2·r_i·r_j/(r_i + r_j))` (N·m^−3/2): Hertz's law for spheres of one material.
    pub(super) fn stiffness_of_spheres(&self, first_kg: f64, second_kg: f64) -> f64 {
        let (first, second) = (self.relative_radius(first_kg), self.relative_radius(second_kg));
        self.stiffness * (2.0 * (first * second) / (first + second)).sqrt()
    }

    /// `k·√(2·r)` (N·m^−3/2): a sphere against a plane of its material.
    pub(super) fn stiffness_at_wall(&self, mass_kg: f64) -> f64 {
        self.stiffness * (2.0 * self.relative_radius(mass_kg)).sqrt()
    }

    /// Radius over that of a bead of `bead_mass_kg` and of the same density.
    fn relative_radius(&self, mass_kg: f64) -> f64 {
        power(mass_kg / self.bead_mass_kg, 1.0 / 3.0)
    }

    /// The load of each contact in static equilibrium.
    fn loads(&self, mass_kg: &[f64]) -> Loads {
        let (gravity, pressed_n) = (self.load.gravity_m_s2, self.load.precompression_n);
        let contacts = mass_kg.len() - 1;
        let mut contacts_n = vec![pressed_n; contacts];
        let (mut left_n, mut right_n) = (pressed_n, pressed_n);
        if gravity > 0.0 {
            for (load_n, mass_kg) in contacts_n.iter_mut().zip(mass_kg) {
                right_n += gravity * mass_kg;
                *load_n = right_n;
            }
            right_n += gravity * mass_kg[contacts];
        } else if gravity < 0.0 {
            for (load_n, mass_kg) in contacts_n.iter_mut().zip(&mass_kg[1..]).rev() {
                left_n -= gravity * mass_kg;
                *load_n = left_n;
            }
            left_n -= gravity * mass_kg[0];
        }
        Loads { contacts: contacts_n, left_wall: left_n, right_wall: right_n }
    }

    /// The overlap (m) at which a contact of stiffness `stiffness` carries `load_n`: `(load/k)^(1/α)`.
    pub(super) fn overlap_under(&self, load_n: f64, stiffness: f64) -> f64 {
        if load_n > 0.0 { power(load_n / stiffness, 1.0 / self.alpha) } else { 0.0 }
    }

    /// The largest rest overlap (m) that a contact may have, 0 in a chain that nothing loads: that of the softest
    /// contact under the largest load.
    pub(super) fn largest_rest_overlap_m(&self) -> f64 {
        if self.load.is_none() {
            return 0.0;
        }
        if self.has_other_laws() {
            let rest_overlap_m = self.contacts_at_rest().rest_overlap_m;
            return rest_overlap_m.iter().fold(0.0, |most, rest_m| larger(most, *rest_m));
        }
        self.overlap_under(self.extreme_loads_n().1, self.extremes().softest)
    }

    /// True if every contact and wall carries its load at some overlap.
    pub(super) fn carries_its_load(&self) -> bool {
        let Contacts { rest_overlap_m, walls, .. } = self.contacts_at_rest();
        let walls_m = [walls.left, walls.right].map(|wall| wall.rest_overlap_m);
        rest_overlap_m.iter().chain(&walls_m).all(|rest_m| *rest_m < UNBOUND_M)
    }

    /// The smallest and the largest load (N) of any contact that carries one, without an array: bounds where
    /// masses differ.
    pub(super) fn extreme_loads_n(&self) -> (f64, f64) {
        let (weight, pressed_n) = (self.load.gravity_m_s2.abs(), self.load.precompression_n);
        let extremes = self.extremes();
        let lightest_n = if pressed_n > 0.0 { pressed_n } else { weight * extremes.lightest_kg };
        (lightest_n, weight * (self.beads as f64 * extremes.heaviest_kg) + pressed_n)
    }
}

/// The overlap (m) at which a contact of `law` and further terms carries `load_n`: the last double before the force exceeds it, where it
/// first does so; more than [`UNBOUND_M`] if it never does.
fn balance<'a>(
    law: &ContactLaw,
    stiffness: f64,
    terms: &(impl Iterator<Item = (&'a TermLaw, f64)> + Clone),
    load_n: f64,
) -> f64 {
    if load_n <= 0.0 {
        return 0.0;
    }
    let force_n = |overlap_m: f64| {
        let by_law = law.force(stiffness, overlap_m);
        terms.clone().fold(by_law, |sum, (term, stiffness)| sum + term.force(stiffness, overlap_m))
    };
    let is_below = |overlap_m: f64| force_n(overlap_m) < load_n;
    let balanced = |low: f64, high: f64| last_before(low, high, |overlap_m| force_n(overlap_m) <= load_n);
    let mut high = 1.0;
    while is_below(high) && high < UNBOUND_M {
        high *= 2.0;
    }
    let rising = balanced(0.0, high);
    if !terms.clone().any(|(_, stiffness)| stiffness < 0.0) {
        return rising;
    }
    // a force that falls again behind a top: the top is looked at, too
    let slope = |overlap_m: f64| {
        let by_law = law.tangent(stiffness, overlap_m);
        terms.clone().fold(by_law, |sum, (term, stiffness)| sum + term.tangent(stiffness, overlap_m))
    };
    let (mut low, mut high) = (0.0, load_n / slope(0.0));
    high = if high > 0.0 && high < UNBOUND_M { high } else { 1e-100 };
    while !is_below(high) {
        high *= 0.5;
    }
    while is_below(high) && high < UNBOUND_M {
        (low, high) = (high, high * FINE);
        if slope(low) > 0.0 && slope(high) <= 0.0 {
            let top = last_before(low, high, |overlap_m| slope(overlap_m) > 0.0);
            high = if is_below(top) { high } else { top };
        }
    }
    let first = balanced(low, high);
    // recordings have its bits
    if (rising / first - 1.0).abs() < 1e-12 { rising } else { first }
}

/// No contact has as large an overlap (m).
const UNBOUND_M: f64 = 1e100;

/// The factor between overlaps at which a force that falls is looked at: what rises again within it is taken for rising all along.
const FINE: f64 = 1.02;

/// The last double from `low` to `high`, neither negative, before `holds` ends.
fn last_before(low: f64, high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    // the bits of positive doubles are in the order of their values
    let (mut low, mut high) = (low.to_bits(), high.to_bits());
    while high - low > 1 {
        let middle = low + (high - low) / 2; // integers
        (low, high) = if holds(f64::from_bits(middle)) { (middle, high) } else { (low, middle) };
    }
    f64::from_bits(low)
}

/// Masses, and contacts in static equilibrium.
struct Contacts {
    mass_kg: Vec<f64>,
    stiffness: Vec<f64>,
    rest_overlap_m: Vec<f64>,
    walls: Walls,
    law: ContactLaw,
    terms: Vec<Term>,
}

/// Forces (N) of the contacts in static equilibrium, compressive ones positive.
struct Loads {
    /// N − 1 values.
    contacts: Vec<f64>,
    left_wall: f64,
    right_wall: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Impurity, OddContact, RunConfig};
    use crate::presets::Preset;

    /// Four beads of 1 kg, k = 2 N·m^−2, struck at 1 m/s, changed by `change`.
    fn chain(change: impl FnOnce(&mut RunConfig)) -> Chain {
        let mut config = Preset::find("homogeneous").expect("preset").config();
        config.chain.beads = 4;
        (config.chain.bead_mass_kg, config.chain.alpha, config.chain.stiffness) =
            (Some(1.0), Some(2.0), Some(2.0));
        config.striker.velocity_m_s = 1.0;
        config.time.duration_s = 10.0;
        change(&mut config);
        Physics::resolve(&config).expect("valid").chain()
    }

    #[test]
    fn masses_follow_their_rule_but_for_impurities() {
        let masses = |rule: MassRule| {
            chain(|c| {
                c.chain.masses = rule;
                c.chain.impurities = vec![Impurity { bead: 2, mass_kg: 9.0 }];
            })
            .mass_kg
        };
        assert_eq!(masses(MassRule::Uniform), [1.0, 1.0, 9.0, 1.0]);
        assert_eq!(masses(MassRule::PatternKg(vec![1.0, 3.0])), [1.0, 3.0, 9.0, 3.0]);
        assert_eq!(masses(MassRule::Taper(0.5)), [1.0, 0.5, 9.0, 0.125]);
        assert_eq!(masses(MassRule::ListKg(vec![4.0, 3.0, 2.0, 1.0])), [4.0, 3.0, 9.0, 1.0]);
    }

    #[test]
    fn stiffnesses_follow_their_rule_but_for_odd_contacts() {
        let stiffnesses = |rule: StiffnessRule| {
            chain(|c| {
                c.chain.stiffnesses = rule;
                c.chain.contacts = vec![OddContact { contact: 1, stiffness: 7.0 }];
            })
            .stiffness
        };
        assert_eq!(stiffnesses(StiffnessRule::Uniform), [2.0, 7.0, 2.0]);
        assert_eq!(stiffnesses(StiffnessRule::Pattern(vec![1.0, 2.0])), [1.0, 7.0, 1.0]);
        assert_eq!(stiffnesses(StiffnessRule::List(vec![1.0, 2.0, 3.0])), [1.0, 7.0, 3.0]);
    }

    /// The usual drag follows from the scales, and the scales from the contacts under the load, which must not ask for the drag.
    #[test]
    fn a_loaded_chain_of_several_powers_may_end_in_an_absorbing_end() {
        let chain = chain(|c| {
            let stiffness = crate::config::Profile::Same(1.0);
            c.chain.second = Some(crate::config::SecondPower { alpha: 3.0, stiffness });
            (c.striker.velocity_m_s, c.load.precompression_n) = (0.0, 6.0);
            c.ends.right = End::Absorbing;
            c.integrator.method = crate::method::Method::Rk5;
        });
        assert!(chain.sites.drag_n_s_per_m[3] > 0.0 && chain.rest_overlap_m[0] > 0.0);
    }

    /// Radii 1 and 2 (masses 1 and 8): √(2·1·2/3) = 2/√3, √(2·2·2/4) = √2; against walls √2 and √4.
    #[test]
    fn spheres_are_as_stiff_as_their_radii_say() {
        let chain = chain(|c| {
            c.chain.alpha = Some(1.5);
            c.chain.masses = MassRule::ListKg(vec![1.0, 1.0, 8.0, 8.0]);
            c.chain.stiffnesses = StiffnessRule::Radii;
            (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed);
        });
        let expected = [2.0, 2.0 * (4.0_f64 / 3.0).sqrt(), 2.0 * 2.0_f64.sqrt()];
        for (found, expected) in chain.stiffness.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-15, "{found} {expected}");
        }
        let walls = [chain.walls.left.stiffness, chain.walls.right.stiffness];
        assert!((walls[0] / 8.0_f64.sqrt() - 1.0).abs() < 1e-15 && (walls[1] / 4.0 - 1.0).abs() < 1e-15);
    }

    /// F = 2·δ², g = 2 m/s², 6 N from both ends: contacts carry 8, 10 and 12 N, the wall below 14 N.
    /// δ − q·δ² + c·δ³ under several loads and in several units: the first overlap that carries the load, which the top of the force may
    /// be near; none above the top of a force that never rises again.
    #[test]
    fn a_bond_that_softens_carries_its_load_where_it_first_can() {
        use crate::term::Spring;
        let law = ContactLaw::new(1.0);
        for unit_m in [1.0, 1e-2, 3.66e-4, 1e30] {
            let rest = |q: f64, c: f64, load_n: f64| {
                let terms = [(1, 1.0), (2, -q / unit_m), (3, c / unit_m / unit_m)]
                    .map(|(power, stiffness)| (TermLaw::Spring(Spring(power)), stiffness));
                balance(&law, 0.0, &terms.iter().map(|(law, k)| (law, *k)), load_n * unit_m) / unit_m
            };
            let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-6;
            assert!(near(rest(0.25, 0.0, 0.5), 2.0 - 2.0_f64.sqrt()) && near(rest(0.25, 0.0, 1.0), 2.0));
            assert!(rest(0.25, 0.0, 1.0 + 1e-9) * unit_m >= UNBOUND_M);
            // roots 0.2385, 0.5367 and 1.1247; a load above the first top has the last one alone
            assert!(near(rest(1.9, 1.0, 0.144), 0.238_537_3), "{}", rest(1.9, 1.0, 0.144));
            let high = rest(1.9, 1.0, 0.2);
            assert!(high > 1.0 && near(high - 1.9 * high * high + high.powi(3), 0.2), "{high}");
        }
    }

    #[test]
    fn a_loaded_chain_carries_its_weight() {
        let overlap = |load: f64| (load / 2.0).sqrt();
        let down = chain(|c| {
            (c.load.gravity_m_s2, c.load.precompression_n) = (2.0, 6.0);
            c.ends.right = End::Fixed;
        });
        let up = chain(|c| {
            (c.load.gravity_m_s2, c.load.precompression_n) = (-2.0, 6.0);
            (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed);
        });
        let close = |found: f64, load: f64| (found / overlap(load) - 1.0).abs() < 1e-15;
        for (contact, load) in [8.0, 10.0, 12.0].into_iter().enumerate() {
            assert!(close(down.rest_overlap_m[contact], load));
            assert!(close(up.rest_overlap_m[2 - contact], load));
            assert!((down.rest_force_n[contact] / load - 1.0).abs() < 1e-15);
        }
        assert!(close(down.walls.right.rest_overlap_m, 14.0) && close(up.walls.left.rest_overlap_m, 14.0));
        assert!(close(up.walls.right.rest_overlap_m, 6.0));
        assert_eq!(down.walls.left, Wall::default());
    }

    /// η = ζ·√(2·(α+1)·k·m*) with m* = ½ between equal beads and 1 at a wall.
    #[test]
    fn damping_depends_on_the_masses_that_meet() {
        let mut config = Preset::find("homogeneous").expect("preset").config();
        config.chain.beads = 2;
        (config.chain.bead_mass_kg, config.chain.alpha, config.chain.stiffness) =
            (Some(1.0), Some(2.0), Some(2.0));
        config.ends.right = End::Fixed;
        config.time.duration_s = 10.0;
        let physics = Physics::resolve(&config).expect("valid");
        let kind = Damping::resolve(crate::config::DampingConfig::Restitution(0.5)).expect("possible");
        let Damping::Restitution(restitution) = kind else { panic!("{kind:?}") };
        let chain = physics.chain();
        let damping = physics.contact_damping(kind, &chain.mass_kg, &chain.stiffness, &chain.walls, false);
        assert_eq!(damping.coefficient, [restitution.damping_ratio * 6.0_f64.sqrt()]);
        assert_eq!(damping.wall_coefficient, [0.0, restitution.damping_ratio * 12.0_f64.sqrt()]);
    }
}
