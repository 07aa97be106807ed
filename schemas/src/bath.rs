//! Heat baths: beads that a surrounding of a given temperature slows down and shakes.
//!
//! A bath adds to a bead of mass m the motion `dv = −γ·v·dt + √(2·γ·T/m)·dW` (Langevin), which is solved exactly over half a step before each
//! step of the method and over half a step after it. The noise is counted: its numbers depend on (seed, step, bead) alone, so a step stays a
//! function of the state and its number.
//!
//! # Source
//! N. Bou-Rabee and H. Owhadi, SIAM J. Numer. Anal. 48 (2010) 278, doi:10.1137/090758842: averages of the equilibrium have the order
//! of the method between the two halves.

use crate::amounts::{typed, typed_quantity};
use crate::beads::Beads;
use crate::config_error::ConfigError;
use crate::drive::Waveform;
use crate::functions::Moment;
use crate::json_schema::positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Boltzmann's constant (J/K), exact in the SI of 2019.
pub(crate) const BOLTZMANN_J_K: f64 = 1.380_649e-23;

/// The largest product of friction and time step: half a step slows a bead down by a fifth.
pub(crate) const MOST_FRICTION: f64 = 0.5;

/// A heat bath: `[[bath]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bath {
    /// The beads in it [default: all].
    #[serde(default)]
    pub beads: Beads,
    /// The temperature `k_B·T` (J), a number or a function of time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_j: Option<Waveform>,
    /// The temperature T (K), in place of `temperature_j`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_k: Option<Waveform>,
    /// The friction γ (1/s).
    #[schemars(transform = positive)]
    pub friction_per_s: f64,
    /// Seed of its noise [default: that of the run].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// True if it acts on the relative velocity of neighbours, so that it conserves momentum [default: false].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub pairs: bool,
}

impl Bath {
    /// `k_B·T` (J) at a time; what is not above 0 counts as 0.
    pub fn temperature_j(&self, at: Moment) -> f64 {
        let temperature_j = match (&self.temperature_j, &self.temperature_k) {
            (Some(joule), _) => joule.value(at),
            (None, Some(kelvin)) => BOLTZMANN_J_K * kelvin.value(at),
            (None, None) => 0.0,
        };
        if temperature_j > 0.0 { temperature_j } else { 0.0 }
    }

    /// True if its temperature is the same at all times.
    pub fn is_steady(&self) -> bool {
        matches!(self.written(), None | Some((_, Waveform::Constant(_))))
    }

    /// The largest `k_B·T` (J), for scales.
    pub fn hottest_j(&self) -> f64 {
        let joule = self.temperature_j.iter().map(Waveform::largest);
        joule.chain(self.temperature_k.iter().map(|t| BOLTZMANN_J_K * t.largest())).fold(0.0, f64::max)
    }

    /// The temperature as it is written, with its key and unit.
    fn written(&self) -> Option<([&'static str; 2], &Waveform)> {
        let joule = self.temperature_j.as_ref().map(|joule| (["temperature_j", "J"], joule));
        joule.or(self.temperature_k.as_ref().map(|kelvin| (["temperature_k", "K"], kelvin)))
    }

    /// The second word of the stream of its noise. At step n of place i, the half before and the half after have the two [`normals`] of index n in the
    /// stream (i, this word); i is a bead, or the contact on its right.
    ///
    /// [`normals`]: crate::random::normals
    pub fn stream(&self) -> u32 {
        if self.pairs { 2 } else { 1 }
    }

    /// Refuses a bath that no run of `duration_s` can have; `key` is its place in the configuration: `bath[0]`.
    pub(crate) fn check(&self, key: &str, duration_s: f64) -> Result<(), ConfigError> {
        let Some(([name, unit], waveform)) =
            self.written().filter(|_| self.temperature_j.is_none() || self.temperature_k.is_none())
        else {
            let found = if self.temperature_j.is_some() { "both" } else { "neither" };
            return Err(ConfigError::value(key, found, "one of temperature_j (k_B·T) and temperature_k"));
        };
        let name = format!("{key}.{name}");
        waveform.check(&name, duration_s)?;
        if waveform.can_be_negative() {
            let allowed = "a temperature of 0 or more at all times: a number, `step`, `ramp`, `half_sine`, `gaussian` or `table`";
            return Err(ConfigError::value(&name, waveform.words(unit), allowed));
        }
        Ok(())
    }

    /// A phrase for captions: `bath at beads 0 to 3: 1 nJ, 500 1/s`.
    pub fn words(&self) -> String {
        let Range { start, end } = self.beads.range();
        let beads = if end == start + 1 {
            format!("bead {start}")
        } else {
            format!("beads {start} to {}", end.saturating_sub(1))
        };
        let kind = if self.pairs { "pair bath" } else { "bath" };
        let temperature = match self.written() {
            Some(([_, unit], Waveform::Constant(value))) => typed_quantity(*value, unit),
            Some(([_, unit], waveform)) => waveform.words(unit),
            None => String::new(),
        };
        format!("{kind} at {beads}: {temperature}, {} 1/s", typed(self.friction_per_s))
    }
}
