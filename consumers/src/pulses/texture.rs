//! Texture of an uneven chain: there a pulse is followed by the mean velocity of several beads.
//!
//! A light bead rattles between heavy ones while one pulse passes, so that it and its neighbours move fastest
//! several times, and lose touch in between. Rattling carries no momentum along the chain: the velocity of the
//! centre of mass of the beads around rises and falls once a pulse.

use schemas::active::Active;
use schemas::chain::Chain;
use std::ops::Range;

/// Masses of neighbours, or forces of contacts, in this ratio or a larger one are different: from about there on a bead may move
/// fastest several times while one pulse passes.
const DIFFERENT: f64 = 1.4;

/// Beads on either side that are looked at together where the chain is uneven. With weights that fall off as a cosine
/// both kinds of beads of a chain of dimers count alike wherever one looks; a pulse is hardly narrower.
const REACH: usize = 3;

/// Beads on either side that decide the texture at a bead.
const AROUND: usize = 8;

/// With so many changes from up to down or back among them it is not even: two impurities that are near each other
/// have three.
const FEWEST_TURNS: usize = 4;

/// A few beads that are alike by chance are no even stretch where so many beads to the left and to the right …
const FAR: usize = 24;

/// … have so many changes each.
const FEWEST_FAR_TURNS: usize = 4;

/// The longest pattern that is known as one.
const LONGEST_PERIOD: usize = 8;

/// Beads of less than this part of the heaviest mass around rattle.
const CARRIES: f64 = 0.8;

/// The beads that are looked at together with each bead of an uneven chain, and their weights.
#[derive(Debug, Clone)]
pub(super) struct Texture {
    windows: Vec<Window>,
    /// Weights of the beads of all windows, one window after the other, each of sum 1.
    weights: Vec<f64>,
    /// Most beads on either side of one that are looked at together with it.
    farthest: usize,
}

#[derive(Debug, Clone)]
struct Window {
    beads: Range<usize>,
    /// Index of its first weight.
    weights: usize,
    /// Mean mass of its beads (kg).
    mass_kg: f64,
    /// True if the bead is one of the heavy ones.
    carries: bool,
}

impl Texture {
    /// The texture of a chain; none if it is even, but for a few impurities and steps. Contacts are alike if they have like forces at
    /// `overlap_m` (m).
    pub(super) fn of(chain: &Chain, overlap_m: f64) -> Option<Self> {
        let forces_n: Vec<f64> = (0..chain.contact_count()).map(|c| chain.force_n(c, overlap_m)).collect();
        let reaches = reaches(&chain.mass_kg, &forces_n);
        let farthest = reaches.iter().copied().max().filter(|reach| *reach > 0)?;
        let mut texture = Self { windows: Vec::with_capacity(reaches.len()), weights: Vec::new(), farthest };
        for (bead, reach) in reaches.into_iter().enumerate() {
            texture.add(chain, bead, reach);
        }
        Some(texture)
    }

    fn add(&mut self, chain: &Chain, bead: usize, reach: usize) {
        let beads = bead.saturating_sub(reach)..(bead + reach + 1).min(chain.bead_count());
        let masses = &chain.mass_kg[beads.clone()];
        let heaviest = masses.iter().fold(0.0_f64, |heaviest, mass| heaviest.max(*mass));
        let falls = |other: usize| {
            1.0 + (std::f64::consts::PI * other.abs_diff(bead) as f64 / (reach + 1) as f64).cos()
        };
        let parts: Vec<_> = beads.clone().zip(masses).map(|(other, mass)| falls(other) * mass).collect();
        let whole: f64 = parts.iter().sum();
        self.windows.push(Window {
            weights: self.weights.len(),
            mass_kg: masses.iter().sum::<f64>() / masses.len() as f64,
            carries: chain.mass_kg[bead] >= CARRIES * heaviest,
            beads,
        });
        self.weights.extend(parts.iter().map(|part| part / whole));
    }

    /// True if the chain is uneven around `bead`.
    pub(super) fn is_uneven(&self, bead: usize) -> bool {
        self.windows[bead].beads.len() > 1
    }

    /// True if `bead` is one of the heavy ones around it.
    pub(super) fn carries(&self, bead: usize) -> bool {
        self.windows[bead].carries
    }

    /// Mean mass (kg) of the beads around `bead`.
    pub(super) fn mass_kg(&self, bead: usize) -> f64 {
        self.windows[bead].mass_kg
    }

    /// The beads that are looked at with `bead`, and their weights.
    pub(super) fn parts(&self, bead: usize) -> impl Iterator<Item = (usize, f64)> {
        let window = &self.windows[bead];
        window.beads.clone().zip(self.weights[window.weights..].iter().copied())
    }

    /// The contacts between the beads that are looked at with `bead`, of one bead the next contact.
    pub(super) fn contacts(&self, bead: usize) -> Range<usize> {
        let beads = &self.windows[bead].beads;
        beads.start..(beads.end - 1).max(beads.start + 1)
    }

    /// The beads around which the mean velocity may differ from 0 where no beads but `active` move.
    pub(super) fn around(&self, active: Active) -> Active {
        Active { first: active.first.saturating_sub(self.farthest), end: active.end + self.farthest }
    }

    /// Puts into `means` the mean velocities (m/s) around each of `beads`.
    pub(super) fn average(&self, v_m_s: &[f64], beads: Range<usize>, means: &mut [f64]) {
        for (mean, window) in means.iter_mut().zip(&self.windows[beads]) {
            let weights = &self.weights[window.weights..window.weights + window.beads.len()];
            *mean = weights.iter().zip(&v_m_s[window.beads.clone()]).map(|(weight, v)| weight * v).sum();
        }
    }
}

/// Number of beads on either side that the tracker sees together with each bead.
fn reaches(mass_kg: &[f64], forces_n: &[f64]) -> Vec<usize> {
    let (masses, forces) = (turns(mass_kg), turns(forces_n));
    let count = mass_kg.len();
    let between = |low: usize, high: usize| {
        let within = |turns: &[usize]| {
            turns.partition_point(|turn| *turn < high) - turns.partition_point(|turn| *turn < low)
        };
        within(&masses).max(within(&forces))
    };
    let reach = |bead: usize| {
        let (low, high) = (bead.saturating_sub(AROUND), (bead + AROUND + 1).min(count));
        if between(low, high) >= FEWEST_TURNS {
            return period([mass_kg, forces_n], low..high).map_or(REACH, whole_periods);
        }
        let (left, right) = (bead.saturating_sub(FAR), (bead + FAR).min(count));
        let both = between(left, bead) >= FEWEST_FAR_TURNS && between(bead, right) >= FEWEST_FAR_TURNS;
        if both { REACH } else { 0 }
    };
    (0..count).map(reach).collect()
}

/// After how many beads the masses and forces of contacts among `beads` repeat, if they do.
fn period([mass_kg, forces_n]: [&[f64]; 2], beads: Range<usize>) -> Option<usize> {
    let masses = &mass_kg[beads.clone()];
    let forces = &forces_n[beads.start..beads.end - 1];
    let repeats =
        |values: &[f64], period: usize| values.iter().zip(values.iter().skip(period)).all(|(a, b)| a == b);
    (2..=LONGEST_PERIOD).find(|period| repeats(masses, *period) && repeats(forces, *period))
}

/// The least reach, from [`REACH`] on, whose window of 2·(reach + 1) beads is made of two or more whole periods: then
/// its weights count each bead of a period alike.
fn whole_periods(period: usize) -> usize {
    let window = (2 * (REACH + 1)..).step_by(2).find(|beads| beads % period == 0 && beads / period > 1);
    window.map_or(REACH, |beads| beads / 2 - 1)
}

/// Indices at which `values` stop to rise and begin to fall, or the other way round, in their order.
fn turns(values: &[f64]) -> Vec<usize> {
    let mut turns = Vec::new();
    let mut rose = None;
    for (index, pair) in values.windows(2).enumerate() {
        let ratio = pair[1] / pair[0];
        let rises = if ratio >= DIFFERENT {
            true
        } else if ratio <= 1.0 / DIFFERENT {
            false
        } else {
            continue;
        };
        if rose.is_some_and(|rose| rose != rises) {
            turns.push(index);
        }
        rose = Some(rises);
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::chain::Walls;
    use schemas::contact::ContactLaw;

    fn texture(mass_kg: Vec<f64>) -> Option<Texture> {
        let contacts = mass_kg.len() - 1;
        let (stiffness, rest_overlap_m) = (vec![1.0; contacts], vec![0.0; contacts]);
        let law = ContactLaw::new(1.5);
        Texture::of(&Chain::new(mass_kg, stiffness, rest_overlap_m, Walls::default(), law), 1e-3)
    }

    #[test]
    fn dimers_are_uneven_and_impurities_steps_and_tapers_are_not() {
        let masses = |mass: fn(i32) -> f64| (0..100).map(mass).collect::<Vec<_>>();
        assert!(texture(masses(|bead| 0.9_f64.powi(bead))).is_none());
        assert!(texture(masses(|bead| if bead < 30 { 1.0 } else { 2.0 })).is_none());
        assert!(texture(masses(|bead| if bead == 50 || bead == 54 { 0.1 } else { 1.0 })).is_none());
        let dimers = texture(masses(|bead| if bead % 2 == 0 { 1.0 } else { 0.1 })).unwrap();
        assert!((0..100).all(|bead| dimers.is_uneven(bead) && dimers.carries(bead) == (bead % 2 == 0)));
        let half = texture(masses(|bead| if bead % 2 == 0 || bead < 50 { 1.0 } else { 0.1 })).unwrap();
        assert!(!half.is_uneven(40) && half.is_uneven(60));
    }

    /// By the weights 1 + cos(πd/4), of sum 4 for even distances d and of sum 4 for odd ones.
    #[test]
    fn rattling_is_no_mean_velocity() {
        let dimers = texture((0..100).map(|bead| if bead % 2 == 0 { 1.0 } else { 0.1 }).collect()).unwrap();
        // as much momentum one way as the other
        let v: Vec<f64> = (0..100).map(|bead| if bead % 2 == 0 { 0.3 } else { -3.0 }).collect();
        let mut means = [f64::NAN; 100];
        dimers.average(&v, 10..90, &mut means[10..90]);
        assert!(means[10..90].iter().all(|mean| mean.abs() < 1e-15), "{means:?}");
        dimers.average(&[0.7; 100], 0..100, &mut means);
        assert!(means.iter().all(|mean| (mean - 0.7).abs() < 1e-15), "{means:?}");
    }
}
