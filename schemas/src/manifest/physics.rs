//! What decides the bits of a run.

use super::{KERNEL_VERSION, MAX_BEADS, MAX_STEPS, to_json, usize_of};
use crate::chain::{Chain, Energy};
use crate::config::{ConfigError, Impurity, RunConfig, StrikerConfig};
use crate::contact::ContactLaw;
use crate::method::Method;
use crate::power::power;
use crate::scales::Scales;
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
    /// Mass of a bead that is no impurity (kg).
    pub bead_mass_kg: f64,
    /// Exponent α of the contact law.
    pub alpha: f64,
    /// Stiffness k of every contact (N·m^−α).
    pub stiffness: f64,
    /// Beads of another mass, in the order of the beads.
    pub impurities: Vec<Impurity>,
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
            impurities: chain.impurities.clone(),
            striker: config.striker,
            method: config.integrator.method,
            dt_s: 0.0,
            step_count: 0,
        };
        physics.impurities.sort_by_key(|impurity| impurity.bead);
        physics.check_chain(&chain.impurities)?;
        physics.dt_s = config.time.dt_s.unwrap_or_else(|| physics.default_dt_s());
        physics.check_dt()?;
        physics.step_count = step_count(config.time.duration_s, physics.dt_s)?;
        Ok(physics)
    }

    /// `fraction · min(T, 4·T_fast) · min(1, 5/α)`: the fraction of [`Method::default_step_fraction`], T of a bead of
    /// `bead_mass_kg`, and [`Physics::fastest_s`], which decides only where a bead is lighter than about 1/16 of
    /// the others or the striker much heavier. The larger α, the shorter the part of T in which a contact
    /// is stiff.
    fn default_dt_s(&self) -> f64 {
        let (usual, fast) = (self.scales().time_s, 4.0 * self.fastest_s());
        let time_s = if fast < usual { fast } else { usual };
        self.method.default_step_fraction() * time_s * self.stiff_fraction()
    }

    /// `T_fast = √(m_light/(k·L_s^(α−1)))` (s), with the overlap scale `L_s = (m_s·v0²/k)^(1/(α+1))` of the striker:
    /// how fast the lightest bead moves between neighbours that the shock presses together. It is T in a
    /// chain of equal beads.
    fn fastest_s(&self) -> f64 {
        let lightest = self.impurities.iter().fold(self.bead_mass_kg, |lightest, impurity| {
            if impurity.mass_kg < lightest { impurity.mass_kg } else { lightest }
        });
        let striker = self.impurities.iter().find(|impurity| impurity.bead == self.striker.bead);
        let striker_kg = striker.map_or(self.bead_mass_kg, |impurity| impurity.mass_kg);
        let speed_m_s = self.striker.velocity_m_s.abs();
        let ratio = striker_kg * (speed_m_s * speed_m_s) / self.stiffness;
        let pressed = power(ratio, (self.alpha - 1.0) / (self.alpha + 1.0));
        (lightest / (self.stiffness * pressed)).sqrt()
    }

    /// `min(1, 5/α)`.
    fn stiff_fraction(&self) -> f64 {
        if self.alpha > 5.0 { 5.0 / self.alpha } else { 1.0 }
    }

    /// Scales L and T of a bead of `bead_mass_kg` at the striker's speed.
    pub fn scales(&self) -> Scales {
        Scales::new(self.bead_mass_kg, self.striker.velocity_m_s.abs(), self.stiffness, self.alpha)
    }

    /// Checks everything but the time; `written` are the impurities in the user's order.
    fn check_chain(&self, written: &[Impurity]) -> Result<(), ConfigError> {
        if !(2..=MAX_BEADS).contains(&self.beads) {
            return Err(ConfigError::value("chain.beads", self.beads, "2 to 20000000 beads"));
        }
        check_positive("chain.bead_mass_kg", self.bead_mass_kg, "kg")?;
        if !(1.0..=1000.0).contains(&self.alpha) {
            return Err(ConfigError::number("chain.alpha", self.alpha, "an exponent from 1 to 1000"));
        }
        check_positive("chain.stiffness", self.stiffness, "N/m^alpha")?;
        for (i, impurity) in written.iter().enumerate() {
            self.check_bead(&format!("chain.impurities[{i}].bead"), impurity.bead)?;
            check_positive(&format!("chain.impurities[{i}].mass_kg"), impurity.mass_kg, "kg")?;
            if written[..i].iter().any(|other| other.bead == impurity.bead) {
                let key = format!("chain.impurities[{i}].bead");
                return Err(ConfigError::value(&key, impurity.bead, "each bead once"));
            }
        }
        self.check_bead("striker.bead", self.striker.bead)?;
        check_positive("striker.velocity_m_s", self.striker.velocity_m_s.abs(), "m/s").map_err(|_| {
            let allowed = "a velocity of 1e-100 to 1e100 m/s, in either direction";
            ConfigError::number("striker.velocity_m_s", self.striker.velocity_m_s, allowed)
        })?;
        self.check_scales()
    }

    /// L and T come from `m·v0²/k`, which must be far from where forces are flushed to zero.
    fn check_scales(&self) -> Result<(), ConfigError> {
        let speed_m_s = self.striker.velocity_m_s.abs();
        let masses = self.impurities.iter().map(|impurity| impurity.mass_kg).chain([self.bead_mass_kg]);
        for mass_kg in masses {
            let ratio = mass_kg * (speed_m_s * speed_m_s) / self.stiffness;
            if !(1e-200..=1e200).contains(&ratio) {
                let allowed = "stiffness, masses and velocity with m·v0²/k from 1e-200 to 1e200 m^(α+1)";
                let found = format!("{:e} with m·v0²/k = {ratio:e}", self.stiffness);
                return Err(ConfigError::value("chain.stiffness", found, allowed));
            }
        }
        Ok(())
    }

    fn check_bead(&self, key: &str, bead: u64) -> Result<(), ConfigError> {
        if bead < self.beads {
            return Ok(());
        }
        let allowed = format!("beads 0 to {} of this chain", self.beads - 1);
        Err(ConfigError::value(key, bead, &allowed))
    }

    fn check_dt(&self) -> Result<(), ConfigError> {
        let longest = 0.25 * self.fastest_s() * self.stiff_fraction();
        if self.dt_s > 0.0 && self.dt_s <= longest {
            return Ok(());
        }
        let allowed = format!(
            "a step of more than 0 and at most {longest:.3e} s, a quarter of the collision time of the \
             lightest bead (less for α > 5); {:.3e} s is the default",
            self.default_dt_s()
        );
        Err(ConfigError::number("time.dt_s", self.dt_s, &allowed))
    }

    /// Checks a manifest that came from elsewhere as strictly as a configuration.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        self.check_chain(&self.impurities)?;
        self.check_dt()?;
        if !(1..=MAX_STEPS).contains(&self.step_count) {
            return Err(ConfigError::value("step_count", self.step_count, "1 to 2^52 steps"));
        }
        Ok(())
    }

    /// The resolved masses, stiffnesses and rest overlaps.
    pub fn chain(&self) -> Chain {
        let beads = usize_of(self.beads);
        let mut mass_kg = vec![self.bead_mass_kg; beads];
        for impurity in &self.impurities {
            mass_kg[usize_of(impurity.bead)] = impurity.mass_kg;
        }
        Chain {
            mass_kg,
            stiffness: vec![self.stiffness; beads - 1],
            rest_overlap_m: vec![0.0; beads - 1],
            law: ContactLaw::new(self.alpha),
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

    /// The time `step·dt` (s).
    pub fn time_s(&self, step: u64) -> f64 {
        step as f64 * self.dt_s
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

/// `round(duration/dt)`, at least 1.
fn step_count(duration_s: f64, dt_s: f64) -> Result<u64, ConfigError> {
    let steps = (duration_s / dt_s).round();
    if duration_s > 0.0 && (1.0..=MAX_STEPS as f64).contains(&steps) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        return Ok(steps as u64);
    }
    let allowed = format!("a time of at least one step of {dt_s:.6e} s and at most 2^52 steps");
    Err(ConfigError::number("time.duration_s", duration_s, &allowed))
}

/// Positive, and far enough from the ends of the range that no product of scales leaves it.
fn check_positive(key: &str, value: f64, unit: &str) -> Result<(), ConfigError> {
    if (1e-100..=1e100).contains(&value) {
        return Ok(());
    }
    Err(ConfigError::number(key, value, &format!("a positive number of {unit}, 1e-100 to 1e100")))
}
