//! A run's configuration as a user writes it.
//!
//! A [`RunConfig`] may still be impossible; `Physics::resolve` turns it into the
//! validated form that everything else uses.

mod bonds;
mod disorder;
mod initial;
mod profile;
mod several;
mod sites;
mod spheres;
mod strikers;
mod words;

pub use crate::config_error::{ConfigError, line_at, line_of_key};
pub use crate::damping::{DampingConfig, PowerDamping};
pub use bonds::{Bond, Bonds, SecondPower};
pub use disorder::{Disorder, Disordered, TwoValued};
pub use initial::{
    FromRecording, Gaussian, Initial, ModeEnergies, ModeShape, Phase, PlaneWave, Solitary, Thermal,
};
pub use profile::Profile;
pub use sites::{OnSite, Resonators};
pub use spheres::{OddSphere, Sphere, Spheres, WallMaterial};
pub use strikers::Strikers;

use crate::amounts::count;
use crate::bath::Bath;
use crate::credit::Credit;
use crate::drive::Drive;
use crate::json_schema::{self, exponent, is_default, not_negative, positive, without_default};
use crate::method::{Feature, Method};
use crate::text::MAX_TEXT_BYTES;
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};

/// A configuration file (TOML), every value as written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RunConfig {
    /// Name of the run on the bus: 1 to 64 of a-z, 0-9 and -, the first of which is no - [default: the file's name].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(regex(pattern = "^[a-z0-9][a-z0-9-]{0,63}$"))]
    pub name: Option<String>,
    /// Seed of disorder, thermal velocities and baths [default: 0].
    #[serde(default, skip_serializing_if = "is_default")]
    pub seed: u64,
    /// The beads and their contacts.
    pub chain: ChainConfig,
    /// Random changes of the chain, in turn.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub disorder: Vec<Disorder>,
    /// Conditions at the ends of the chain.
    #[serde(default, skip_serializing_if = "EndsConfig::is_free")]
    pub ends: EndsConfig,
    /// Load of the chain before the shock.
    #[serde(default, skip_serializing_if = "LoadConfig::is_none")]
    pub load: LoadConfig,
    /// Damping of the contacts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<DampingConfig>,
    /// Springs and drag of each bead.
    #[serde(default, skip_serializing_if = "OnSite::is_none")]
    pub on_site: OnSite,
    /// Resonators inside the beads.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resonators: Option<Resonators>,
    /// The beads that are struck at the beginning.
    #[serde(default)]
    #[schemars(schema_with = "several::schema::<StrikerConfig>")]
    pub striker: Strikers,
    /// Initial state, beside the strikers.
    #[serde(default, skip_serializing_if = "Initial::is_none")]
    pub initial: Initial,
    /// Drives of walls and beads.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drive: Vec<Drive>,
    /// Heat baths.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bath: Vec<Bath>,
    /// Duration and time step.
    pub time: TimeConfig,
    /// The integration method [default: rkn4, or the first one that takes all that the run has].
    #[serde(default)]
    pub integrator: IntegratorConfig,
    /// Intervals of publishing and recording.
    #[serde(default)]
    pub stream: StreamConfig,
    /// The author and the licence, for those who cite the run.
    #[serde(default, skip_serializing_if = "Credit::is_none")]
    pub provenance: Credit,
}

/// The `[chain]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChainConfig {
    /// Number of beads N, 2 to 20,000,000.
    #[schemars(range(min = 2))]
    pub beads: u64,
    /// Mass of a bead (kg), unless `masses` says otherwise. With `spheres` it is left out: the first sphere gives it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = positive)]
    pub bead_mass_kg: Option<f64>,
    /// Exponent α of the contact law. May be left out with `spheres`, where it is 1.5, and with `bonds`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = exponent)]
    pub alpha: Option<f64>,
    /// Stiffness k of a contact (N·m^−α), unless `stiffnesses` says otherwise. It is left out with `spheres`, and may be with
    /// `bonds`: the first contact gives it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = positive)]
    pub stiffness: Option<f64>,
    /// A rule for the masses of all beads.
    #[serde(default, skip_serializing_if = "MassRule::is_uniform")]
    pub masses: MassRule,
    /// A rule for the stiffnesses of all contacts.
    #[serde(default, skip_serializing_if = "StiffnessRule::is_uniform")]
    pub stiffnesses: StiffnessRule,
    /// Beads of another mass than the rule gives them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub impurities: Vec<Impurity>,
    /// Contacts of another stiffness than the rule gives them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<OddContact>,
    /// Spheres of given materials, whose masses and stiffnesses take the place of all others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "several::schema::<Sphere>")]
    pub spheres: Option<Spheres>,
    /// Spheres that differ from the others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(schema_with = "spheres::odd_schema")]
    pub odd_spheres: Vec<OddSphere>,
    /// The exponent of each contact, in place of `alpha`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = exponent)]
    pub alphas: Option<Profile>,
    /// A second power that is added to the force of each contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<SecondPower>,
    /// The gap (m) of each contact before anything moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = not_negative)]
    pub gaps_m: Option<Profile>,
    /// Bonds in place of contacts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bonds: Option<Bonds>,
}

impl ChainConfig {
    /// Keys of the numbers that spheres or bonds may stand for.
    const SCALES: [&str; 3] = ["chain.bead_mass_kg", "chain.alpha", "chain.stiffness"];

    /// The mass (kg), the exponent and the stiffness (N·m^−α) that spheres or bonds stand for.
    fn usual_scales(&self) -> [Option<f64>; 3] {
        match (&self.spheres, &self.bonds) {
            (Some(spheres), _) => spheres.scales().map_or([None; 3], |scales| scales.map(Some)),
            (None, Some(bonds)) => bonds.scales(),
            (None, None) => [None; 3],
        }
    }

    /// The mass (kg), the exponent and the stiffness (N·m^−α) of the scales.
    ///
    /// # Errors
    /// With the key of one that is missing.
    pub fn scales(&self) -> Result<[f64; 3], ConfigError> {
        let [mass_kg, alpha, stiffness] = self.usual_scales();
        let numbers = [self.bead_mass_kg.or(mass_kg), self.alpha.or(alpha), self.stiffness.or(stiffness)];
        match numbers {
            [Some(mass_kg), Some(alpha), Some(stiffness)] => Ok([mass_kg, alpha, stiffness]),
            [None, ..] => Err(ConfigError::missing(Self::SCALES[0])),
            [_, None, _] => Err(ConfigError::missing(Self::SCALES[1])),
            [.., None] => Err(ConfigError::missing(Self::SCALES[2])),
        }
    }
}

/// Allowed values of numbers that bonds stand for.
pub const OWN_STIFFNESSES: &str = "nothing beside chain.bonds, which have stiffnesses of their own";

/// Allowed for seeds that are asked for by a flag or by a sweep.
pub const DRAWS: &str = "a seed where it has an effect: with [[disorder]], initial.thermal, initial.modes of random phases, or a [[bath]] \
                         without a seed of its own";

/// The masses of the beads of a chain, before its impurities.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = positive)]
pub enum MassRule {
    /// Every bead has `bead_mass_kg`.
    #[default]
    Uniform,
    /// Masses (kg) that repeat along the chain: two for a dimer chain.
    PatternKg(Vec<f64>),
    /// Each bead has this many times the mass of the bead before; bead 0 has `bead_mass_kg`.
    Taper(f64),
    /// The mass of each bead (kg), N values.
    ListKg(Vec<f64>),
}

/// The stiffnesses of the contacts of a chain, before its odd contacts.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = positive)]
pub enum StiffnessRule {
    /// Every contact has `stiffness`.
    #[default]
    Uniform,
    /// Spheres of one material (α = 1.5): `k·√(2·r_i·r_j/(r_i + r_j))` with radii `r = (m/bead_mass_kg)^(1/3)`, so
    /// that two beads of `bead_mass_kg` have `stiffness`; `k·√(2r)` against a wall.
    Radii,
    /// Stiffnesses (N·m^−α) that repeat along the chain.
    Pattern(Vec<f64>),
    /// The stiffness of each contact (N·m^−α), N − 1 values.
    List(Vec<f64>),
}

impl MassRule {
    /// True if it is the usual rule, [`Self::Uniform`].
    pub fn is_uniform(&self) -> bool {
        *self == Self::Uniform
    }
}

impl StiffnessRule {
    /// True if it is the usual rule, [`Self::Uniform`].
    pub fn is_uniform(&self) -> bool {
        *self == Self::Uniform
    }
}

/// A contact of another stiffness.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OddContact {
    /// Number of the contact, from 0; it joins the beads `contact` and `contact + 1`.
    pub contact: u64,
    /// Its stiffness (N·m^−α).
    #[schemars(transform = positive)]
    pub stiffness: f64,
}

/// The `[ends]` table.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EndsConfig {
    /// The left end, beside bead 0.
    pub left: End,
    /// The right end, beside the last bead.
    pub right: End,
    /// Stiffness (N·m^−α) of the contact with the left wall [default: that of the chain].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = positive)]
    pub left_stiffness: Option<f64>,
    /// Stiffness (N·m^−α) of the contact with the right wall [default: that of the chain].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = positive)]
    pub right_stiffness: Option<f64>,
    /// Material of the left wall, with spheres [default: that of the end bead].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_material: Option<WallMaterial>,
    /// Material of the right wall, with spheres [default: that of the end bead].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub right_material: Option<WallMaterial>,
    /// Beads with drag at an absorbing end [default: a fifth of the chain, at most 100].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub absorbing_beads: Option<u64>,
    /// The drag (N·s/m) of the last bead of an absorbing end [default: half of m/T, 1/200 of it in a chain without load or bonds].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = positive)]
    pub absorbing_drag_n_s_per_m: Option<f64>,
}

/// The condition at an end of the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// Nothing.
    #[default]
    Free,
    /// A wall that the end bead touches.
    Fixed,
    /// The other end: the last bead touches the first one.
    Periodic,
    /// A free end, with drag on the beads near it that grows towards the end.
    Absorbing,
}

impl EndsConfig {
    /// True if both ends are free and nothing else is set.
    pub fn is_free(&self) -> bool {
        *self == Self::default()
    }
}

/// The `[load]` table.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LoadConfig {
    /// Constant acceleration of every bead (m/s²), positive towards higher bead numbers; a wall must carry
    /// the weight.
    #[serde(skip_serializing_if = "is_default")]
    pub gravity_m_s2: f64,
    /// Force (N) that presses the chain together from both ends: a wall exerts it, or a constant force on the end bead where
    /// there is no wall.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(transform = not_negative)]
    pub precompression_n: f64,
}

impl LoadConfig {
    /// True if nothing loads the chain.
    pub fn is_none(&self) -> bool {
        self.gravity_m_s2 == 0.0 && self.precompression_n == 0.0
    }
}

/// A bead of another mass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Impurity {
    /// Number of the bead, from 0.
    pub bead: u64,
    /// Its mass (kg).
    #[schemars(transform = positive)]
    pub mass_kg: f64,
}

/// The `[striker]` table.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StrikerConfig {
    /// Number of the bead, from 0.
    pub bead: u64,
    /// Its initial velocity v0 (m/s); positive is towards higher bead numbers.
    pub velocity_m_s: f64,
}

/// The `[time]` table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeConfig {
    /// Simulated time (s).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub duration_s: f64,
    /// Time step (s) [default: a fraction of the collision time T, which depends on the method].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub dt_s: Option<f64>,
}

/// The `[integrator]` table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IntegratorConfig {
    /// The method.
    pub method: Method,
}

impl Default for IntegratorConfig {
    fn default() -> Self {
        Self { method: Method::default_for(&[]) }
    }
}

/// The `[stream]` table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StreamConfig {
    /// Number of steps from one published frame to the next.
    #[schemars(range(min = 1))]
    pub publish_every_steps: u64,
    /// Number of steps from one recorded frame to the next; a multiple of `publish_every_steps` [default: that].
    #[schemars(range(min = 1), transform = without_default)]
    pub record_every_steps: u64,
}

impl Default for StreamConfig {
    fn default() -> Self {
        Self { publish_every_steps: 1, record_every_steps: 1 }
    }
}

impl RunConfig {
    /// The JSON Schema of configurations.
    pub fn schema() -> Schema {
        json_schema::of::<Self>("A run of Beadline", "A chain of beads, its beginning and its duration.")
    }

    /// Reads a configuration from TOML text.
    ///
    /// # Errors
    /// When the text is not TOML, a key is unknown or missing, or a value has the wrong type; the
    /// error carries the line.
    pub fn from_toml(text: &str) -> Result<Self, ConfigError> {
        let (config, document) = Self::with_document(text)?;
        config.is_moved_in(&document)?;
        Ok(config)
    }

    /// Like [`Self::from_toml`], but for questions about the chain and not about a run: nothing has to move the chain.
    ///
    /// # Errors
    /// As [`Self::from_toml`].
    pub fn of_chain(text: &str) -> Result<Self, ConfigError> {
        Self::with_document(text).map(|(config, _)| config)
    }

    fn with_document(text: &str) -> Result<(Self, toml::Table), ConfigError> {
        let document: toml::Table = text.parse().map_err(|error| ConfigError::of_toml(&error, text))?;
        check_texts(&document)?;
        let config: Self = toml::from_str(text).map_err(|error| ConfigError::of_toml(&error, text))?;
        Ok((config.completed(&document)?, document))
    }

    /// Refuses a run in which nothing moves.
    fn is_moved_in(&self, document: &toml::Table) -> Result<(), ConfigError> {
        let moves = !self.drive.is_empty() || !self.bath.is_empty() || !self.initial.is_none();
        if !document.contains_key("striker") && !moves {
            return Err(ConfigError::missing("striker"));
        }
        Ok(())
    }

    /// Reads a configuration from a TOML document.
    ///
    /// # Errors
    /// As [`Self::from_toml`]; the line is that in the document as text.
    pub fn from_table(document: &toml::Table) -> Result<Self, ConfigError> {
        check_texts(document)?;
        match Self::deserialize(document.clone()) {
            Ok(config) => {
                let config = config.completed(document)?;
                config.is_moved_in(document)?;
                Ok(config)
            }
            // only the text knows where the mistake is; a table is always TOML
            Err(_) => Self::from_toml(&toml::to_string(document).unwrap_or_default()),
        }
    }

    /// True if the seed has an effect. Ask before the states that it draws are made.
    pub fn draws(&self) -> bool {
        let Initial { thermal, modes, .. } = &self.initial;
        let has_phases = modes.as_ref().is_some_and(|modes| modes.phase == Phase::Random);
        let has_states = thermal.is_some() || has_phases;
        has_states || !self.disorder.is_empty() || self.bath.iter().any(|bath| bath.seed.is_none())
    }

    /// Checks the scales, and fills in the method and the intervals that `document`, the source of this configuration, leaves open.
    fn completed(mut self, document: &toml::Table) -> Result<Self, ConfigError> {
        self.check_scales()?;
        if !document.contains_key("integrator") {
            self.integrator.method = self.default_method();
        }
        let stream = document.get("stream").and_then(toml::Value::as_table);
        if stream.is_some_and(|stream| !stream.contains_key("record_every_steps")) {
            // every frame is recorded
            self.stream.record_every_steps = self.stream.publish_every_steps;
        }
        Ok(self)
    }

    /// Refuses numbers of the scales that are missing, or that bonds do not have, and leaves those to spheres and bonds that these have.
    fn check_scales(&mut self) -> Result<(), ConfigError> {
        let chain = &mut self.chain;
        if chain.bonds.as_ref().is_some_and(Bonds::let_go) && chain.spheres.is_none() {
            return Err(Bonds::refusal());
        }
        let usual = chain.usual_scales();
        let numbers = [&mut chain.bead_mass_kg, &mut chain.alpha, &mut chain.stiffness];
        for ((number, usual), key) in numbers.into_iter().zip(usual).zip(ChainConfig::SCALES) {
            match *number {
                Some(found) if found.is_nan() => return Err(ConfigError::value(key, "nan", "a number")),
                found if found == usual => *number = None,
                Some(found) if chain.bonds.is_some() && usual.is_some() => {
                    return Err(ConfigError::number(key, found, OWN_STIFFNESSES));
                }
                _ => {}
            }
        }
        chain.scales().map(drop)
    }

    /// The method of a configuration that names none: the usual one, or one that takes forces of velocities if there are any.
    pub(crate) fn default_method(&self) -> Method {
        let is_slowed = self.on_site.drag_n_s_per_m.is_some()
            || [self.ends.left, self.ends.right].contains(&End::Absorbing);
        let features = [(Feature::Damping, self.damping.is_some()), (Feature::Drag, is_slowed)];
        let there: Vec<_> = features.iter().filter(|(_, is_there)| *is_there).map(|(of, _)| *of).collect();
        Method::default_for(&there)
    }

    /// The configuration as TOML text that reads back to an equal configuration.
    pub fn to_toml(&self) -> String {
        // every field is a plain table, number or string, which TOML can always express
        toml::to_string(self).unwrap_or_default()
    }
}

/// Refuses texts that are too long to be shown.
fn check_texts(document: &toml::Table) -> Result<(), ConfigError> {
    let Some((key, bytes)) = long_text(document) else { return Ok(()) };
    let allowed = format!("texts of at most {} bytes", count(MAX_TEXT_BYTES as u64));
    Err(ConfigError::value(&key, format!("a text of {} bytes", count(bytes as u64)), &allowed))
}

/// The key and the length of a text that is too long, if there is one.
fn long_text(table: &toml::Table) -> Option<(String, usize)> {
    fn below(value: &toml::Value) -> Option<(String, usize)> {
        match value {
            toml::Value::String(text) => (text.len() > MAX_TEXT_BYTES).then(|| (String::new(), text.len())),
            toml::Value::Array(list) => list
                .iter()
                .enumerate()
                .find_map(|(i, value)| below(value).map(|(key, bytes)| (format!("[{i}]{key}"), bytes))),
            toml::Value::Table(table) => long_text(table).map(|(key, bytes)| (format!(".{key}"), bytes)),
            _ => None,
        }
    }
    table.iter().find_map(|(name, value)| below(value).map(|(key, bytes)| (format!("{name}{key}"), bytes)))
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

    /// A configuration with rules beyond equal beads between free ends.
    #[test]
    fn every_rule_can_be_written() {
        let text = "[chain]\nbeads = 3\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n\
            masses = { pattern_kg = [1e-3, 2e-3] }\nstiffnesses = \"radii\"\n\
            contacts = [{ contact = 1, stiffness = 2e7 }]\n[ends]\nleft = \"free\"\nright = \"fixed\"\n\
            right_stiffness = 1e8\n[load]\ngravity_m_s2 = 9.81\nprecompression_n = 1.0\n[damping]\n\
            restitution = 0.9\n[striker]\nbead = 0\nvelocity_m_s = 5.0\n[time]\nduration_s = 0.01\n\
            [integrator]\nmethod = \"rkn4\"\n";
        let config = RunConfig::from_toml(text).expect("valid");
        assert_eq!(config.chain.masses, MassRule::PatternKg(vec![1e-3, 2e-3]));
        assert_eq!(config.chain.stiffnesses, StiffnessRule::Radii);
        assert_eq!((config.ends.right, config.ends.right_stiffness), (End::Fixed, Some(1e8)));
        assert_eq!(config.damping, Some(DampingConfig::Restitution(0.9)));
        assert_eq!(RunConfig::from_toml(&config.to_toml()), Ok(config));
        for (from, to) in [("restitution", "bounce"), ("pattern_kg", "pattern"), ("\"fixed\"", "\"stuck\"")] {
            let error = RunConfig::from_toml(&text.replace(from, to)).expect_err("unknown");
            assert!(error.line.is_some() && error.message.contains("allowed: "), "{error}");
        }
    }

    #[test]
    fn a_text_that_nobody_could_be_shown_is_refused_with_its_key() {
        let (most, more) = ("a".repeat(MAX_TEXT_BYTES), "a".repeat(MAX_TEXT_BYTES + 1));
        assert!(RunConfig::from_toml(&TEXT.replace("\"a\"", &format!("\"{most}\""))).is_ok());
        let drives = format!("\n[[drive]]\nbead = 1\n[[drive]]\nforce_n = [0, \"{more}\"]\n");
        for (text, key) in [
            (TEXT.replace("\"a\"", &format!("\"{more}\"")), "name"),
            (format!("{TEXT}{drives}"), "drive[1].force_n[1]"),
        ] {
            let of_table = RunConfig::from_table(&text.parse().expect("TOML"));
            for found in [RunConfig::from_toml(&text), of_table] {
                let error = found.expect_err(key);
                assert_eq!(error.key, key);
                assert!(
                    error.message.contains("65,537 bytes; allowed: texts of at most 65,536 bytes"),
                    "{error}"
                );
            }
        }
    }

    /// The text of a schema is for people who know neither Rust nor JSON.
    #[test]
    fn nothing_of_the_program_is_left_in_the_schema() {
        let text = RunConfig::schema().as_value().to_string();
        for leak in ["null", "[`", "::", "Written", "uint64"] {
            let near = text.find(leak).and_then(|at| text.get(at.saturating_sub(80)..at + 40));
            assert_eq!(near, None, "{leak}");
        }
    }

    #[test]
    fn unknown_keys_are_refused_with_their_line() {
        let error = RunConfig::from_toml(&TEXT.replace("stiffness", "stifness")).expect_err("typo");
        assert_eq!(error.line, Some(6));
        assert!(error.message.contains("stifness") && error.message.contains("stiffness"), "{error}");
    }

    /// NaN is not a number that was left out, also where spheres would give that number.
    #[test]
    fn nan_is_not_missing() {
        for (from, to, says) in [
            ("stiffness = 1e7", "stiffness = nan", "line 6: chain.stiffness: found nan; allowed: a number"),
            ("bead_mass_kg = 1e-3", "bead_mass_kg = -nan", "line 4: chain.bead_mass_kg: found nan"),
            (
                "alpha = 0.5",
                "alpha = nan\nspheres = { material = \"steel\", radius_m = 5e-3 }",
                "line 5: chain.alpha: found nan",
            ),
            ("stiffness = 1e7\n", "", "chain.stiffness: missing; "),
        ] {
            let text = TEXT.replace(from, to);
            let error = RunConfig::from_toml(&text).expect_err(to).located(&text, None).to_string();
            assert!(error.contains(says), "{to}: {error}");
        }
    }

    #[test]
    fn keys_are_found_at_their_lines() {
        assert_eq!(line_of_key(TEXT, "chain.alpha"), Some(5));
        assert_eq!(line_of_key(TEXT, "chain.impurities[1].mass_kg"), Some(9));
        assert_eq!(line_of_key(TEXT, "time.dt_s"), None);
    }
}
