//! A run's configuration as a user writes it.
//!
//! A [`RunConfig`] may still be impossible; [`crate::manifest::Physics::resolve`] turns it into the
//! validated form that everything else uses.

use crate::method::Method;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};

/// A configuration file (TOML), every value as written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunConfig {
    /// Name of the run on the bus, `[a-z0-9-]{1,64}`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The beads and their contacts.
    pub chain: ChainConfig,
    /// The bead that moves at the beginning.
    pub striker: StrikerConfig,
    /// How long to simulate, and with which step.
    pub time: TimeConfig,
    /// The integration method.
    #[serde(default)]
    pub integrator: IntegratorConfig,
    /// What is published and recorded.
    #[serde(default)]
    pub stream: StreamConfig,
}

/// The `[chain]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChainConfig {
    /// Number of beads N.
    pub beads: u64,
    /// Mass of a bead (kg).
    pub bead_mass_kg: f64,
    /// Exponent α of the contact law.
    pub alpha: f64,
    /// Stiffness k of every contact (N·m^−α).
    pub stiffness: f64,
    /// Beads of another mass.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub impurities: Vec<Impurity>,
}

/// A bead of another mass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Impurity {
    /// Which bead, from 0.
    pub bead: u64,
    /// Its mass (kg).
    pub mass_kg: f64,
}

/// The `[striker]` table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StrikerConfig {
    /// Which bead, from 0.
    pub bead: u64,
    /// Its initial velocity v0 (m/s); positive is towards higher bead numbers.
    pub velocity_m_s: f64,
}

/// The `[time]` table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeConfig {
    /// Simulated time (s).
    pub duration_s: f64,
    /// Time step (s); by default a fraction of the collision time T, see
    /// [`Method::default_step_fraction`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dt_s: Option<f64>,
}

/// The `[integrator]` table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IntegratorConfig {
    /// The method.
    pub method: Method,
}

impl Default for IntegratorConfig {
    fn default() -> Self {
        Self { method: Method::Rkn4 }
    }
}

/// The `[stream]` table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StreamConfig {
    /// Every how many steps a frame is published.
    pub publish_every_steps: u64,
    /// Every how many steps a frame is recorded; a multiple of `publish_every_steps`.
    pub record_every_steps: u64,
}

impl Default for StreamConfig {
    fn default() -> Self {
        Self { publish_every_steps: 1, record_every_steps: 1 }
    }
}

/// Why a configuration cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigError {
    /// Where it was read, if it was a file.
    pub path: Option<PathBuf>,
    /// The line (from 1), if the value stands in a file.
    pub line: Option<usize>,
    /// The key, such as `chain.alpha`; empty if the text could not be read at all.
    pub key: String,
    /// What was found, what is allowed.
    pub message: String,
}

impl ConfigError {
    /// An impossible value: `key`, what was found, what is allowed.
    pub(crate) fn value(key: &str, found: impl fmt::Display, allowed: &str) -> Self {
        Self {
            path: None,
            line: None,
            key: key.to_owned(),
            message: format!("found {found}; allowed: {allowed}"),
        }
    }

    /// An impossible number, written with an exponent where it is very small or very large.
    pub(crate) fn number(key: &str, found: f64, allowed: &str) -> Self {
        let plain = found == 0.0 || (1e-4..1e6).contains(&found.abs());
        if plain {
            Self::value(key, found, allowed)
        } else {
            Self::value(key, format_args!("{found:e}"), allowed)
        }
    }

    /// The same error with the line of `toml` at which its key stands, and the file's `path`.
    #[must_use]
    pub fn located(mut self, toml: &str, path: Option<&Path>) -> Self {
        self.path = path.map(Path::to_owned);
        self.line = self.line.or_else(|| line_of_key(toml, &self.key));
        self
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.path, self.line) {
            (Some(path), Some(line)) => write!(f, "{}:{line}: ", path.display())?,
            (Some(path), None) => write!(f, "{}: ", path.display())?,
            (None, Some(line)) => write!(f, "line {line}: ")?,
            (None, None) => {}
        }
        if self.key.is_empty() {
            write!(f, "{}", self.message)
        } else {
            write!(f, "{}: {}", self.key, self.message)
        }
    }
}

impl std::error::Error for ConfigError {}

impl RunConfig {
    /// Reads a configuration from TOML text.
    ///
    /// # Errors
    /// When the text is not TOML, a key is unknown or missing, or a value has the wrong type; the
    /// error carries the line.
    pub fn from_toml(text: &str) -> Result<Self, ConfigError> {
        toml::from_str(text).map_err(|error| ConfigError {
            path: None,
            line: error.span().map(|span| line_at(text, span.start)),
            key: String::new(),
            message: error.message().to_owned(),
        })
    }

    /// The configuration as TOML text that reads back to an equal configuration.
    pub fn to_toml(&self) -> String {
        // every field is a plain table, number or string, which TOML can always express
        toml::to_string(self).unwrap_or_default()
    }
}

/// The line, from 1, of byte `offset` of `text`.
fn line_at(text: &str, offset: usize) -> usize {
    let end = offset.min(text.len());
    text.as_bytes()[..end].split(|byte| *byte == b'\n').count()
}

/// The line of a dotted key such as `chain.impurities[1].mass_kg` in `toml`, if it is there.
fn line_of_key(toml: &str, key: &str) -> Option<usize> {
    let document = toml::de::DeTable::parse(toml).ok()?;
    let mut table = Some(document.get_ref());
    let mut found = None;
    for part in key.split('.') {
        let (name, index) = match part.split_once('[') {
            Some((name, rest)) => (name, rest.strip_suffix(']').and_then(|i| i.parse().ok())),
            None => (part, None::<usize>),
        };
        let (_, value) = table?.iter().find(|(k, _)| k.get_ref().as_ref() == name)?;
        let mut value = value;
        if let (Some(index), toml::de::DeValue::Array(array)) = (index, value.get_ref()) {
            value = array.get(index)?;
        }
        found = Some(line_at(toml, value.span().start));
        table = match value.get_ref() {
            toml::de::DeValue::Table(inner) => Some(inner),
            _ => None,
        };
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"a\"\n[chain]\nbeads = 10\nbead_mass_kg = 1e-3\nalpha = 0.5\n\
        stiffness = 1e7\nimpurities = [\n  { bead = 5, mass_kg = 1e-3 },\n  { bead = 6, mass_kg = -1.0 },\n]\n\
        [striker]\nbead = 0\nvelocity_m_s = 5.0\n[time]\nduration_s = 0.01\n";

    #[test]
    fn round_trips_through_toml() {
        let config = RunConfig::from_toml(TEXT).expect("valid");
        assert_eq!(RunConfig::from_toml(&config.to_toml()), Ok(config));
    }

    #[test]
    fn unknown_keys_are_refused_with_their_line() {
        let error = RunConfig::from_toml(&TEXT.replace("stiffness", "stifness")).expect_err("typo");
        assert_eq!(error.line, Some(6));
        assert!(error.message.contains("stifness") && error.message.contains("stiffness"), "{error}");
    }

    #[test]
    fn keys_are_found_at_their_lines() {
        assert_eq!(line_of_key(TEXT, "chain.alpha"), Some(5));
        assert_eq!(line_of_key(TEXT, "chain.impurities[1].mass_kg"), Some(9));
        assert_eq!(line_of_key(TEXT, "time.dt_s"), None);
    }
}
