//! The key `spectra` of `[continue]`.

use super::{File, refused};
use crate::MapError;
use crate::spectra::Spectrum;
use schemars::JsonSchema;
use schemas::config::ConfigError;
use serde::Deserialize;
use std::sync::atomic::AtomicBool;

/// Runs from the seed, whose spectra are asked for.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub(super) struct Runs {
    /// Values of the key that is followed.
    #[schemars(length(min = 1, max = 4))]
    at: Vec<f64>,
    /// The bead whose velocity has the spectrum.
    bead: u64,
    /// Duration of the runs (s).
    duration_s: f64,
}

impl Runs {
    /// Refuses runs that cannot be made.
    pub(super) fn check(&self, file: &File) -> Result<(), ConfigError> {
        let is_some = (1..=4).contains(&self.at.len());
        if !is_some || !self.at.iter().all(|value| value.is_finite()) {
            return Err(refused(
                "continue.spectra.at",
                &format!("{:?}", self.at),
                "a list of 1 to 4 numbers",
            ));
        }
        for value in &self.at {
            let physics = file.problem(*value)?.physics;
            let (dt_s, beads) = (physics.dt_s, physics.initial_state().0.len());
            if self.bead >= beads as u64 {
                let allowed = format!("a bead from 0 to {}", beads - 1);
                return Err(refused("continue.spectra.bead", &self.bead.to_string(), &allowed));
            }
            if !(1e3..1e9).contains(&(self.duration_s / dt_s)) {
                let allowed = format!("a time (s) of 1000 to 1e9 steps of {dt_s}");
                let found = self.duration_s.to_string();
                return Err(refused("continue.spectra.duration_s", &found, &allowed));
            }
        }
        Ok(())
    }

    /// Makes the runs.
    pub(super) fn make(&self, file: &File, stop: &AtomicBool) -> Result<Vec<Spectrum>, MapError> {
        let bead = usize::try_from(self.bead).unwrap_or(0);
        let problems = self.at.iter().filter_map(|value| Some((*value, file.problem(*value).ok()?)));
        problems
            .map(|(value, problem)| Spectrum::of(&problem, (value, bead, self.duration_s), stop))
            .collect()
    }
}
