//! Drives: functions of time that prescribe the motion of a bead or a wall, or the force on a bead.

mod check;
mod knots;
mod read;
mod table;
mod waveform;

pub use knots::{APART, knots_of};
pub use table::{Interpolation, Table, table_from_csv};
pub use waveform::{Chirp, Gaussian, HalfSine, Ramp, Sine, Step, Waveform};

use crate::config_error::ConfigError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

/// An end of the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Before bead 0.
    Left,
    /// After the last bead.
    Right,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

/// The place at which a drive acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Place {
    /// At a wall.
    Wall(Side),
    /// At a bead, from 0.
    Bead(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wall(side) => write!(f, "the {side} wall"),
            Self::Bead(bead) => write!(f, "bead {bead}"),
        }
    }
}

/// The quantity that a drive prescribes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// A force on a bead (N), positive towards higher bead numbers, beside those of its contacts.
    Force,
    /// The displacement of a bead or a wall (m).
    Displacement,
    /// The velocity of a bead or a wall (m/s), which starts at the displacement 0.
    Velocity,
}

impl Quantity {
    /// The key of a configuration, with its unit.
    pub fn key(self) -> &'static str {
        match self {
            Self::Force => "force_n",
            Self::Displacement => "displacement_m",
            Self::Velocity => "velocity_m_s",
        }
    }

    /// The unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Force => "N",
            Self::Displacement => "m",
            Self::Velocity => "m/s",
        }
    }
}

/// Something that acts on the chain from outside: `{ wall = "left", displacement_m = { sine = … } }`.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "read::WrittenDrive")]
#[schemars(into = "read::WrittenDrive")]
pub struct Drive {
    /// The place at which it acts.
    pub at: Place,
    /// The quantity that it prescribes there.
    pub prescribes: Quantity,
    /// Its value at each time.
    pub waveform: Waveform,
}

impl Drive {
    /// Refuses a drive that no run of `duration_s` can have. `key` is its place in the configuration: `drive[0]`.
    ///
    /// # Errors
    /// When a number is impossible, a table ends before the run, or a displacement jumps.
    pub fn check(&self, key: &str, duration_s: f64) -> Result<(), ConfigError> {
        let key = format!("{key}.{}", self.prescribes.key());
        self.waveform.check(&key, duration_s)?;
        if self.prescribes == Quantity::Displacement
            && let Some(jump) = self.waveform.jump()
        {
            let allowed = "a displacement without a jump: give `rise_s`, `ramp_s` or `ramp_down_s`";
            return Err(ConfigError::value(&format!("{key}.{}", self.waveform.kind()), jump, allowed));
        }
        Ok(())
    }

    /// A phrase for captions: `displacement of the left wall: sine of 10 nm at 6300 Hz`.
    pub fn words(&self) -> String {
        let quantity = match self.prescribes {
            Quantity::Force => "force on",
            Quantity::Displacement => "displacement of",
            Quantity::Velocity => "velocity of",
        };
        format!("{quantity} {}: {}", self.at, self.waveform.words(self.prescribes.unit()))
    }
}

#[cfg(test)]
mod tests;
