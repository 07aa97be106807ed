//! Everything that decides the bits of a run.

mod arrays;
mod baths;
mod check;
mod disorder;
mod drives;
mod ends;
mod initial;
mod kernel;
mod particulars;
mod sites;
mod spheres;
mod terms;
mod time_step;

pub use disorder::Ranges;
pub use time_step::Limit;

use super::{KERNEL_VERSION, to_json, usize_of};
use crate::bath::Bath;
use crate::chain::{Chain, Energy};
use crate::config::{
    Bonds, ConfigError, Disorder, End, EndsConfig, Impurity, Initial, LoadConfig, MassRule, OddContact,
    OddSphere, OnSite, Profile, Resonators, RunConfig, SecondPower, Spheres, StiffnessRule, StrikerConfig,
};
use crate::damping::Damping;
use crate::drive::Drive;
use crate::functions::{larger, smaller};
use crate::json_schema::is_default;
use crate::method::{Feature, Method};
use crate::rows::Rows;
use crate::scales::Scales;
use crate::simd::ordered_sum;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::ops::RangeInclusive;

/// Everything that decides the bits of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Physics {
    /// The version of the dynamics: the first of [`KERNEL_VERSIONS`](super::KERNEL_VERSIONS) that gives the bits of the run.
    pub kernel_version: u32,
    /// Number of beads N.
    pub beads: u64,
    /// Mass of a bead (kg) where no rule says otherwise, and that of the scales L and T.
    pub bead_mass_kg: f64,
    /// Exponent α of the contact law.
    pub alpha: f64,
    /// Stiffness k (N·m^−α) of a contact where no rule says otherwise, and that of L and T.
    pub stiffness: f64,
    /// The masses of the beads that are no impurities.
    #[serde(default, skip_serializing_if = "MassRule::is_uniform")]
    pub masses: MassRule,
    /// The stiffnesses of the contacts that are not odd.
    #[serde(default, skip_serializing_if = "StiffnessRule::is_uniform")]
    pub stiffnesses: StiffnessRule,
    /// Beads of another mass, in the order of the beads.
    pub impurities: Vec<Impurity>,
    /// Contacts of another stiffness, in the order of the contacts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<OddContact>,
    /// Conditions at the ends of the chain.
    #[serde(default, skip_serializing_if = "EndsConfig::is_free")]
    pub ends: EndsConfig,
    /// Load of the chain.
    #[serde(default, skip_serializing_if = "LoadConfig::is_none")]
    pub load: LoadConfig,
    /// Damping of the contacts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<Damping>,
    /// The first bead that is struck at the beginning; none is struck where its velocity is 0.
    pub striker: StrikerConfig,
    /// The other strikers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub strikers: Vec<StrikerConfig>,
    /// Seed of disorder and thermal velocities.
    #[serde(default, skip_serializing_if = "is_default")]
    pub seed: u64,
    /// Random changes of the chain, in turn.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub disorder: Vec<Disorder>,
    /// Spheres, whose masses and stiffnesses take the place of the rules above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spheres: Option<Spheres>,
    /// Spheres that differ from the others, in the order of the beads.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub odd_spheres: Vec<OddSphere>,
    /// The exponent of each contact, in place of `alpha`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alphas: Option<Profile>,
    /// A second power in the force of each contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<SecondPower>,
    /// The gap (m) of each contact before anything moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gaps_m: Option<Profile>,
    /// Bonds in place of contacts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bonds: Option<Bonds>,
    /// Springs and drag of each bead.
    #[serde(default, skip_serializing_if = "OnSite::is_none")]
    pub on_site: OnSite,
    /// Resonators inside the beads.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resonators: Option<Resonators>,
    /// Initial state, beside the strikers.
    #[serde(default, skip_serializing_if = "Initial::is_none")]
    pub initial: Initial,
    /// Drives of walls and beads.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<Drive>,
    /// Heat baths, in the order of the beads.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub baths: Vec<Bath>,
    /// The integration method.
    pub method: Method,
    /// Time step (s).
    pub dt_s: f64,
    /// Number of steps.
    pub step_count: u64,
}

/// The part of a time by which it may differ from that of a step and be the same: people write 1e-5 for ten steps of 1e-6, whose double is less.
const SAME_TIME: f64 = 1e-12;

impl Physics {
    /// Validates `config` and fills in what it leaves open.
    ///
    /// # Errors
    /// With the key, the value and what is allowed.
    pub fn resolve(config: &RunConfig) -> Result<Self, ConfigError> {
        let chain = &config.chain;
        let [bead_mass_kg, alpha, stiffness] = chain.scales()?;
        /// Keys that are the same in a manifest, and the others with their values.
        macro_rules! physics {
            (config: $($key:ident)+; chain: $($of_chain:ident)+; $($name:ident: $value:expr),+) => {
                Self {
                    $($key: config.$key.clone(),)+
                    $($of_chain: chain.$of_chain.clone(),)+
                    $($name: $value),+
                }
            };
        }
        let mut physics = physics! {
            config: seed disorder ends load on_site resonators initial;
            chain: beads masses stiffnesses impurities contacts spheres odd_spheres alphas second gaps_m bonds;
            bead_mass_kg: bead_mass_kg,
            alpha: alpha,
            stiffness: stiffness,
            kernel_version: KERNEL_VERSION,
            damping: config.damping.map(Damping::resolve).transpose()?,
            striker: without_sign(*config.striker),
            strikers: config.striker.more.iter().copied().map(without_sign).collect(),
            drives: config.drive.clone(),
            baths: config.bath.clone(),
            method: config.integrator.method,
            dt_s: 0.0,
            step_count: 0
        };
        physics.impurities.sort_by_key(|impurity| impurity.bead);
        physics.contacts.sort_by_key(|odd| odd.contact);
        physics.odd_spheres.sort_by_key(|odd| odd.bead);
        physics.baths.iter_mut().for_each(|bath| bath.beads = bath.beads.counted(chain.beads));
        physics.check_chain(&chain.impurities, &chain.contacts)?;
        physics.check_scales_of_spheres()?;
        (physics.dt_s, physics.step_count) = physics.steps(config.time)?;
        physics.check_drive_times()?;
        physics.check_frictions()?;
        physics.kernel_version = physics.first_kernel();
        Ok(physics)
    }

    /// Scales L and T of a bead of `bead_mass_kg` at the largest speed that strikers, initial velocities or drives give. If no speed is
    /// given, but displacements or a load, the scales of a contact with that overlap, [`Scales::of_load`].
    pub fn scales(&self) -> Scales {
        let speed_m_s = self.typical_speed_m_s();
        let of_overlap =
            |overlap_m| Scales::of_load(self.bead_mass_kg, overlap_m, self.stiffness, self.alpha);
        if speed_m_s > 0.0 {
            let scales = Scales::new(self.bead_mass_kg, speed_m_s, self.stiffness, self.alpha);
            // beside a bath, which gives speeds, drives and displacements may press more
            let pressed_m = if self.baths.is_empty() { 0.0 } else { self.typical_overlap_m() };
            return if pressed_m > scales.length_m { of_overlap(pressed_m) } else { scales };
        }
        let rest_m = self.largest_rest_overlap_m();
        of_overlap(if rest_m > 0.0 { rest_m } else { self.typical_overlap_m() })
    }

    /// Energy of the initial state, which every drift is measured against.
    pub fn initial_energy(&self) -> Energy {
        self.initial_energy_of(&self.chain())
    }

    /// The same where its `chain` is known.
    pub fn initial_energy_of(&self, chain: &Chain) -> Energy {
        let (u_m, v_m_s) = self.initial_state();
        let extra = self.initial_extra(&u_m);
        chain.energy(&u_m, &v_m_s, &extra, &mut vec![0.0; u_m.len() - 1])
    }

    /// The rows of the `extra` of its frames.
    pub fn rows(&self) -> Rows {
        Rows {
            of_method: self.method.extra_per_bead(),
            resonators: self.resonators.is_some(),
            work: self.damping.is_some() || self.has_drag(),
            drives: !self.drives.is_empty(),
            heat: !self.baths.is_empty(),
        }
    }

    /// The features of the run that not every method takes.
    pub(crate) fn features(&self) -> Vec<Feature> {
        let on_site = &self.on_site;
        let all = [
            (Feature::Damping, self.damping.is_some()),
            (Feature::Drag, self.has_drag()),
            (Feature::OtherLaws, self.has_other_laws()),
            (Feature::OnSite, on_site.linear_n_per_m.is_some() || on_site.cubic_n_per_m3.is_some()),
            (Feature::Resonators, self.resonators.is_some()),
            (Feature::Ring, self.ends.left == End::Periodic),
            (Feature::Drives, !self.drives.is_empty()),
            (Feature::Baths, !self.baths.is_empty()),
        ];
        all.into_iter().filter(|(_, is_there)| *is_there).map(|(feature, _)| feature).collect()
    }

    /// The feature that its method took once and takes no more: `gear5` had dashpots and restitution. Recordings of such runs are read;
    /// none of their steps are computed.
    pub fn retired(&self) -> Option<Feature> {
        let was_taken = self.damping.is_some_and(|damping| !damping.is_since_1_1());
        self.method.took().filter(|feature| *feature == Feature::Damping && was_taken)
    }

    /// True if drag acts on a bead.
    pub fn has_drag(&self) -> bool {
        self.on_site.drag_n_s_per_m.is_some() || self.is_absorbing()
    }

    /// True if neither damping nor drag takes energy from the beads; a drag of 0 takes none.
    pub fn is_without_loss(&self) -> bool {
        let drag = self.on_site.drag_n_s_per_m.as_ref().map_or(0.0, Profile::largest);
        self.damping.is_none() && drag == 0.0 && !self.is_absorbing()
    }

    fn is_absorbing(&self) -> bool {
        [self.ends.left, self.ends.right].contains(&End::Absorbing)
    }

    /// Doubles for each bead beyond displacement and velocity that a frame carries: see [`Rows`].
    pub fn extra_per_bead(&self) -> usize {
        self.rows().count()
    }

    /// The work (J) that damped contacts and drag have dissipated so far, from the `extra` of a state: the [`ordered_sum`] of its
    /// row.
    pub fn dissipated_j(&self, extra: &[f64]) -> f64 {
        ordered_sum([self.rows().work_of(extra)], |[work_j]| work_j)
    }

    /// The energy (J) that came from outside so far, from the `extra` of a state: the work of all drives and the heat of all baths.
    pub fn driven_j(&self, extra: &[f64]) -> f64 {
        let works = self.rows().drives_of(extra).iter().step_by(2).take(self.drives.len());
        works.chain(self.rows().heat_of(extra)).fold(0.0, |sum, work_j| sum + work_j)
    }

    /// True if drives or baths give energy to the chain, or take it.
    pub fn is_driven(&self) -> bool {
        !self.drives.is_empty() || !self.baths.is_empty()
    }

    /// True if the chain is moved by other things than strikers.
    pub(crate) fn is_moved_otherwise(&self) -> bool {
        !self.initial.is_none() || self.is_driven()
    }

    /// The time `step·dt` (s).
    pub fn time_s(&self, step: u64) -> f64 {
        step as f64 * self.dt_s
    }

    /// The first step at or after the simulated time `time_s` (s), to 1e-12 of it; one beyond the last if there is none.
    pub fn step_at_or_after(&self, time_s: f64) -> u64 {
        let least_s = time_s * (1.0 - SAME_TIME);
        let found = self.steps_near(least_s).find(|step| self.time_s(*step) >= least_s);
        found.unwrap_or(self.step_count + 1)
    }

    /// The last step at or before the simulated time `time_s` (s), likewise; step 0 if there is none.
    pub fn step_at_or_before(&self, time_s: f64) -> u64 {
        let most_s = time_s * (1.0 + SAME_TIME);
        self.steps_near(most_s).rev().find(|step| self.time_s(*step) <= most_s).unwrap_or(0)
    }

    /// Steps of which one is the next to a time, if there is one: the quotient is rounded, and the times of steps are what counts.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, NaN is 0")]
    fn steps_near(&self, time_s: f64) -> RangeInclusive<u64> {
        let near = ((time_s / self.dt_s) as u64).min(self.step_count); // integers
        near.saturating_sub(1)..=(near + 2).min(self.step_count) // integers
    }

    /// SHA-256 of the physics as JSON: equal exactly when the bits of two runs must be equal.
    pub fn hash(&self) -> [u8; 32] {
        Sha256::digest(self.to_json().as_bytes()).into()
    }

    /// The physics as JSON, with every double in the shortest form that reads back to its bits.
    pub fn to_json(&self) -> String {
        to_json(self)
    }
}

/// Replaces a velocity of −0 by 0.
fn without_sign(striker: StrikerConfig) -> StrikerConfig {
    StrikerConfig { velocity_m_s: striker.velocity_m_s + 0.0, ..striker }
}

/// The smallest and the largest of some numbers, none of them NaN.
fn range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, 0.0), |(low, high), value| (smaller(low, *value), larger(high, *value)))
}
