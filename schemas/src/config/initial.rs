//! The `[initial]` table: displacements and velocities at step 0, beside those of strikers.

use super::several::{self, several};
use crate::json_schema::positive;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, de::Error};

/// The `[initial]` table, whose entries are added up.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Initial {
    /// Displacement of each bead (m), N values.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "of_beads")]
    #[schemars(length(min = 1))]
    pub displacements_m: Vec<f64>,
    /// Velocity of each bead (m/s), N values.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "of_beads")]
    #[schemars(length(min = 1))]
    pub velocities_m_s: Vec<f64>,
    /// Displacement of each resonator (m), N values, in place of those of their beads.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "of_beads")]
    #[schemars(length(min = 1))]
    pub resonator_displacements_m: Vec<f64>,
    /// Velocity of each resonator (m/s), N values, in place of rest.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "of_beads")]
    #[schemars(length(min = 1))]
    pub resonator_velocities_m_s: Vec<f64>,
    /// A bell curve.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaussian: Option<Gaussian>,
    /// A plane wave.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane_wave: Option<PlaneWave>,
    /// A mode of equal beads between fixed ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<ModeShape>,
    /// Exact solitary waves, which become lists before a run begins.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "several")]
    #[schemars(schema_with = "several::schema::<Solitary>")]
    pub solitary: Vec<Solitary>,
    /// Linear modes with given energies, which become lists before a run begins.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modes: Option<ModeEnergies>,
    /// Normal velocities.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thermal: Option<Thermal>,
    /// The energy (J) of the whole state over the number of beads, to which it is scaled before a run begins.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy_per_bead_j: Option<f64>,
    /// The state of another recording, which becomes lists before a run begins.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<FromRecording>,
}

impl Initial {
    /// True if the table is empty.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// Reads a list of values of beads, which is left out where there is none.
fn of_beads<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let values = Vec::deserialize(deserializer)?;
    if values.is_empty() { Err(D::Error::invalid_length(0, &"a value for each bead")) } else { Ok(values) }
}

/// `A·exp(−(i − b)²/(2·w²))`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gaussian {
    /// Its middle b, in beads.
    pub bead: f64,
    /// Its width w, in beads.
    #[schemars(transform = positive)]
    pub width_beads: f64,
    /// The amplitude A of the displacements (m).
    #[serde(default)]
    pub displacement_m: f64,
    /// The amplitude A of the velocities (m/s).
    #[serde(default)]
    pub velocity_m_s: f64,
}

/// `u = A·sin(2π·cycles·i/N + φ)`, `v = B·cos` of the same.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlaneWave {
    /// Wavelengths in the chain.
    pub cycles: f64,
    /// The amplitude A of the displacements (m).
    #[serde(default)]
    pub displacement_m: f64,
    /// The amplitude B of the velocities (m/s).
    #[serde(default)]
    pub velocity_m_s: f64,
    /// The phase φ (rad).
    #[serde(default)]
    pub phase_rad: f64,
}

/// `u = A·sin(π·number·(i + 1)/(N + 1))`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModeShape {
    /// Number of the mode, from 1.
    #[schemars(range(min = 1))]
    pub number: u64,
    /// The amplitude A of the displacements (m).
    #[serde(default)]
    pub displacement_m: f64,
    /// The same of the velocities (m/s).
    #[serde(default)]
    pub velocity_m_s: f64,
}

/// Linear modes of a chain, each with an energy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModeEnergies {
    /// A mode, counted from 1, and its energy (J); or the first and the last mode of a band, and the energy of each.
    pub energies_j: Vec<Vec<f64>>,
    /// The phases of the modes.
    #[serde(default)]
    pub phase: Phase,
}

/// Phases of modes.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "\"random\", or a phase in rad")]
pub enum Phase {
    /// All the same (rad): at 0 a mode is displaced and at rest.
    Rad(f64),
    /// By the seed of the run.
    #[default]
    #[serde(with = "random")]
    #[schemars(schema_with = "random::schema")]
    Random,
}

/// The word for random phases.
mod random {
    use schemars::{Schema, SchemaGenerator, json_schema};
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub(super) fn serialize<S: Serializer>(serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str("random")
    }

    pub(super) fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "const": "random" })
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
        let word = String::deserialize(deserializer)?;
        if word == "random" { Ok(()) } else { Err(D::Error::custom("another word")) }
    }
}

/// The solitary wave of an unloaded chain of equal beads, given by its speed or by its amplitude.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Solitary {
    /// Position of its crest, in beads.
    pub bead: f64,
    /// The speed (beads/s) at which it travels; negative: to the left.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_beads_s: Option<f64>,
    /// The largest velocity (m/s) of a bead in it; negative: it travels to the left.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_m_s: Option<f64>,
}

/// Normal velocities of all beads, without total momentum: one of its keys.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Thermal {
    /// T (K): the mean kinetic energy of a bead is `k_B·T/2`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = positive)]
    pub temperature_k: Option<f64>,
    /// The mean kinetic energy of a bead (J).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = positive)]
    pub energy_j: Option<f64>,
}

/// A state of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FromRecording {
    /// The file.
    pub recording: String,
    /// Its step.
    pub step: u64,
    /// SHA-256 of the state's displacements and velocities, as they were read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

#[cfg(test)]
mod tests {
    use crate::config::RunConfig;

    #[test]
    fn a_list_without_values_is_refused() {
        let text = "chain = { beads = 2, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0 }\ntime.duration_s = 1.0\n\
                    initial.velocities_m_s = []\nstriker = { bead = 0, velocity_m_s = 1.0 }\n";
        let refused = RunConfig::from_toml(text).expect_err("no values").to_string();
        let expected = "initial.velocities_m_s: found []; allowed: a value for each bead";
        assert!(refused.contains(expected), "{refused}");
    }
}
