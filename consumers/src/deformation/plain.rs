//! Beads that nothing acts on but equal contacts of one power, as the theories have them.

use schemas::chain::Chain;
use schemas::drive::{Place, Side};
use schemas::manifest::Physics;
use std::ops::Range;

/// Finds where the theories of equal beads do not hold.
#[derive(Debug, Clone)]
pub struct Plain {
    /// Beads that something acts on from outside, and what that is.
    outside: Vec<(Range<usize>, &'static str)>,
    /// True if what takes energy counts: it makes another shape, and a wave of the same law that becomes weaker.
    is_lossless: bool,
}

impl Plain {
    /// Gathers the drives and baths of `physics`; what takes energy counts if `is_lossless`.
    pub fn of(physics: &Physics, is_lossless: bool) -> Self {
        let number = |bead: u64| usize::try_from(bead).unwrap_or(usize::MAX - 1);
        let driven = physics.drives.iter().map(|drive| match drive.at {
            Place::Wall(Side::Left) => 0,
            Place::Wall(Side::Right) => number(physics.beads - 1),
            Place::Bead(bead) => number(bead),
        });
        let drives = driven.map(|bead| (bead..bead + 1, "a drive acts on beads"));
        let baths = physics
            .baths
            .iter()
            .filter(|_| is_lossless)
            .map(|bath| (bath.beads.range(), "a bath acts on beads"));
        Self { outside: drives.chain(baths).collect(), is_lossless }
    }

    /// Checks some `beads` of `chain` and the `contacts` between them.
    ///
    /// # Errors
    /// With what is there that no theory has.
    pub fn check(
        &self,
        chain: &Chain,
        beads: &(impl Iterator<Item = usize> + Clone),
        contacts: &(impl Iterator<Item = usize> + Clone),
    ) -> Result<(), &'static str> {
        let acts = |values: &[f64]| {
            let value = |bead: usize| values.get(bead).is_some_and(|value| *value != 0.0);
            beads.clone().any(value)
        };
        let masses = beads.clone().map(|bead| chain.mass_kg[bead]);
        let stiffnesses = contacts.clone().map(|contact| chain.stiffness_of(contact));
        let of_chain = [
            (differ(masses) || differ(stiffnesses), "beads or contacts differ"),
            (self.is_lossless && chain.damping.is_some(), "contacts dissipate"),
            (
                !contacts.clone().all(|contact| is_one_power(chain, contact)),
                "contacts do not follow `chain.alpha` alone, or springs hold the beads",
            ),
            (contacts.clone().any(|contact| chain.rest_m(contact) != 0.0), "contacts have gaps"),
            (acts(&chain.sites.resonator_kg), "beads have resonators"),
            (self.is_lossless && acts(&chain.sites.drag_n_s_per_m), "drag acts on beads"),
        ];
        let is_acted_on = |places: &Range<usize>| beads.clone().any(|bead| places.contains(&bead));
        let outside = self.outside.iter().map(|(places, what)| (is_acted_on(places), *what));
        match of_chain.into_iter().chain(outside).find(|(is_so, _)| *is_so) {
            Some((_, what)) => Err(what),
            None => Ok(()),
        }
    }
}

/// Beads slower than this part of L/T rest, as beside a wave that a run begins with.
const REST: f64 = 1e-3;

/// The velocity (m/s) that more than half of the beads begin with, to a thousandth of L/T; none if there is no such velocity.
pub(crate) fn common_velocity_m_s(physics: &Physics) -> Option<f64> {
    let (_, mut v_m_s) = physics.initial_state();
    let (count, rest_m_s) = (v_m_s.len(), REST * physics.scales().speed_m_s());
    let medians = [(count - 1) / 2, count / 2].map(|rank| {
        let v = *v_m_s.select_nth_unstable_by(rank, f64::total_cmp).1;
        if v.abs() > rest_m_s { v } else { 0.0 }
    });
    let is_common = |median: &f64| {
        let alike = v_m_s.iter().filter(|v| (**v - median).abs() <= rest_m_s);
        2 * alike.count() > count
    };
    let [low, high] = if medians[0].abs() < medians[1].abs() { medians } else { [medians[1], medians[0]] };
    [low, high].into_iter().find(is_common)
}

/// The beads that are struck, or begin with another velocity than most.
pub(super) fn beads_in_motion(physics: &Physics) -> Vec<usize> {
    let (_, v_m_s) = physics.initial_state();
    let common_m_s = common_velocity_m_s(physics).unwrap_or(0.0);
    let rest_m_s = REST * physics.scales().speed_m_s();
    let moves = |bead: &usize| (v_m_s[*bead] - common_m_s).abs() > rest_m_s;
    (0..v_m_s.len()).filter(moves).collect()
}

fn is_one_power(chain: &Chain, contact: usize) -> bool {
    if contact < chain.contact_count() {
        return chain.is_one_power(contact..contact + 1);
    }
    chain.is_one_power(0..0) && chain.terms.iter().all(|term| term.wall_stiffness[0] == 0.0)
}

fn differ(mut values: impl Iterator<Item = f64>) -> bool {
    let first = values.next();
    values.any(|value| Some(value) != first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::RunConfig;

    /// In a chain of 60 beads each of these is at bead 30 or at contact 30.
    #[test]
    fn whatever_acts_on_a_bead_is_found_near_it_alone() {
        let list = |key: &str, count: usize| {
            let values: Vec<f64> = (0..count).map(|i| if i == 30 { 1e-4 } else { 0.0 }).collect();
            format!("{key} = {{ list = {values:?} }}\n")
        };
        let of_chain = |keys: &str| (keys.to_owned(), String::new());
        let beside = |tables: &str| (String::new(), tables.to_owned());
        let resonators = format!("[resonators]\nstiffness_n_per_m = 1e5\n{}", list("mass_kg", 60));
        for ((keys, tables), expected) in [
            (of_chain("impurities = [{ bead = 30, mass_kg = 2e-3 }]\n"), "differ"),
            (of_chain(&list("gaps_m", 59)), "gaps"),
            (beside(&resonators), "resonators"),
            (beside(&format!("[on_site]\n{}", list("drag_n_s_per_m", 60))), "drag"),
            (beside("[[drive]]\nbead = 30\nforce_n = 1.0\n"), "drive"),
            (beside("[[bath]]\nbeads = 30\ntemperature_j = 1e-9\nfriction_per_s = 10.0\n"), "bath"),
        ] {
            let config = RunConfig::from_toml(&format!(
                "[chain]\nbeads = 60\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n{keys}\
                 [striker]\nbead = 0\nvelocity_m_s = 1.0\n[time]\nduration_s = 1e-3\n{tables}"
            ));
            let physics = Physics::resolve(&config.expect("valid")).expect("valid");
            let (plain, chain) = (Plain::of(&physics, true), physics.chain());
            assert_eq!(plain.check(&chain, &(20..30), &(20..29)), Ok(()), "{expected}");
            assert_eq!(plain.check(&chain, &(31..40), &(31..39)), Ok(()), "{expected}");
            let why = plain.check(&chain, &(27..32), &(27..31)).expect_err(expected);
            assert!(why.contains(expected), "{why}");
        }
    }
}
