//! What decides the bits of a run.

mod arrays;
mod check;
mod particulars;
mod time_step;

use super::{KERNEL_VERSION, to_json, usize_of};
use crate::chain::Energy;
use crate::config::{
    ConfigError, EndsConfig, Impurity, LoadConfig, MassRule, OddContact, RunConfig, StiffnessRule,
    StrikerConfig,
};
use crate::damping::Damping;
use crate::method::Method;
use crate::scales::Scales;
use crate::simd::ordered_sum;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Everything that decides the bits of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Physics {
    /// The dynamics that computed it, [`KERNEL_VERSION`].
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
    /// What the ends of the chain touch.
    #[serde(default, skip_serializing_if = "EndsConfig::is_free")]
    pub ends: EndsConfig,
    /// What loads the chain.
    #[serde(default, skip_serializing_if = "LoadConfig::is_none")]
    pub load: LoadConfig,
    /// What contacts dissipate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<Damping>,
    /// The bead that moves at the beginning.
    pub striker: StrikerConfig,
    /// The integration method.
    pub method: Method,
    /// Time step (s).
    pub dt_s: f64,
    /// Number of steps.
    pub step_count: u64,
}

impl Physics {
    /// Validates `config` and fills in what it leaves open.
    ///
    /// # Errors
    /// With the key, the value and what is allowed.
    pub fn resolve(config: &RunConfig) -> Result<Self, ConfigError> {
        let chain = &config.chain;
        let mut physics = Self {
            kernel_version: KERNEL_VERSION,
            beads: chain.beads,
            bead_mass_kg: chain.bead_mass_kg,
            alpha: chain.alpha,
            stiffness: chain.stiffness,
            masses: chain.masses.clone(),
            stiffnesses: chain.stiffnesses.clone(),
            impurities: chain.impurities.clone(),
            contacts: chain.contacts.clone(),
            ends: config.ends,
            load: config.load,
            damping: config.damping.map(Damping::resolve).transpose()?,
            striker: StrikerConfig {
                // −0 is 0
                velocity_m_s: config.striker.velocity_m_s + 0.0,
                ..config.striker
            },
            method: config.integrator.method,
            dt_s: 0.0,
            step_count: 0,
        };
        physics.impurities.sort_by_key(|impurity| impurity.bead);
        physics.contacts.sort_by_key(|odd| odd.contact);
        physics.check_chain(&chain.impurities, &chain.contacts)?;
        (physics.dt_s, physics.step_count) = physics.steps(config.time)?;
        Ok(physics)
    }

    /// Scales L and T of a bead of `bead_mass_kg` at the striker's speed; if nothing strikes, those of a loaded
    /// contact, [`Scales::of_load`] at the largest rest overlap.
    pub fn scales(&self) -> Scales {
        let speed_m_s = self.striker.velocity_m_s.abs();
        if speed_m_s > 0.0 {
            Scales::new(self.bead_mass_kg, speed_m_s, self.stiffness, self.alpha)
        } else {
            Scales::of_load(self.bead_mass_kg, self.largest_rest_overlap_m(), self.stiffness, self.alpha)
        }
    }

    /// Displacements (m) and velocities (m/s) at step 0, N values each.
    pub fn initial_state(&self) -> (Vec<f64>, Vec<f64>) {
        let beads = usize_of(self.beads);
        let mut v_m_s = vec![0.0; beads];
        v_m_s[usize_of(self.striker.bead)] = self.striker.velocity_m_s;
        (vec![0.0; beads], v_m_s)
    }

    /// Energy of the initial state, which every drift is measured against.
    pub fn initial_energy(&self) -> Energy {
        let (u_m, v_m_s) = self.initial_state();
        self.chain().energy(&u_m, &v_m_s, &mut vec![0.0; u_m.len() - 1])
    }

    /// Doubles for each bead beyond displacement and velocity that a frame carries: those of the method, and with
    /// damping one more, the work that the bead's contact has dissipated.
    pub fn extra_per_bead(&self) -> usize {
        self.method.extra_per_bead() + usize::from(self.damping.is_some())
    }

    /// The work (J) that contacts have dissipated so far, from the `extra` of a state: the [`ordered_sum`] of its last
    /// N values, of which number `c` belongs to contact `c` and the last one to both walls.
    pub fn dissipated_j(&self, extra: &[f64]) -> f64 {
        let values = if self.damping.is_some() { usize_of(self.beads) } else { 0 };
        let work_j = &extra[extra.len().saturating_sub(values)..];
        ordered_sum([work_j], |[work_j]| work_j)
    }

    /// The time `step·dt` (s).
    pub fn time_s(&self, step: u64) -> f64 {
        step as f64 * self.dt_s
    }

    /// The first step at or after the simulated time `time_s` (s); one beyond the last if there is none.
    pub fn step_at_or_after(&self, time_s: f64) -> u64 {
        // the quotient is rounded, the times of steps are what counts
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, NaN is 0")]
        let near = ((time_s / self.dt_s) as u64).saturating_sub(1).min(self.step_count); // integers
        (near..=self.step_count).find(|step| self.time_s(*step) >= time_s).unwrap_or(self.step_count + 1)
    }

    /// The last step at or before the simulated time `time_s` (s); step 0 if there is none.
    pub fn step_at_or_before(&self, time_s: f64) -> u64 {
        let after = self.step_at_or_after(time_s);
        if after <= self.step_count && self.time_s(after) <= time_s { after } else { after.saturating_sub(1) }
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
