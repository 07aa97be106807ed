//! The manifest: the description of a run, validated and complete.
//!
//! Architecture invariant: past this module nobody sees a [`RunConfig`]. [`Physics`] holds everything that
//! decides the bits of a run; it is stored, never derived a second time.

mod physics;

pub use physics::{Limit, Physics, Ranges};

use crate::config::{ConfigError, End, RunConfig};
use crate::credit::Credit;
use crate::run_name::RunName;
use crate::text::{MAX_TEXT_BYTES, shown_within};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Newest version of the dynamics: changes whenever the bits of any run change.
pub const KERNEL_VERSION: u32 = 3;

/// Versions of the dynamics that this program has. A run names the first of them that gives its bits, so a run without the changes of
/// version 3 stays a run of version 2.
pub const KERNEL_VERSIONS: std::ops::RangeInclusive<u32> = 2..=KERNEL_VERSION;

/// Version of the schemas of frames, manifests and recordings. Another major version is refused.
pub const SCHEMA_VERSION: SchemaVersion = SchemaVersion { major: 1, minor: 1 };

/// Largest number of beads: a frame then stays below the 1 GiB that a reader accepts.
pub const MAX_BEADS: u64 = 20_000_000;

/// Largest number of steps: step numbers and frame numbers are exact as doubles.
pub const MAX_STEPS: u64 = 1 << 52;

/// Longest manifest as JSON: a reader of recordings takes records of 64 MiB, and 4 KiB are for the rest of the record.
pub const MAX_JSON_BYTES: usize = (64 << 20) - 4096;

/// The error about a manifest that is too long for its readers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "the manifest has {bytes} bytes, at most {MAX_JSON_BYTES} can be published and recorded; give fewer beads, or fewer \
     numbers of their own (lists, `[initial] from`)"
)]
pub struct ManifestTooLong {
    /// Its length as JSON.
    pub bytes: usize,
}

impl ManifestTooLong {
    /// Refuses a manifest of `bytes` as JSON if it is too long for its readers.
    ///
    /// # Errors
    /// When there are more than [`MAX_JSON_BYTES`].
    pub fn check(bytes: usize) -> Result<(), Self> {
        if bytes <= MAX_JSON_BYTES { Ok(()) } else { Err(Self { bytes }) }
    }
}

/// A `major.minor` version.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SchemaVersion {
    /// Changes when old readers would misunderstand.
    pub major: u32,
    /// Changes when something is added.
    pub minor: u32,
}

impl fmt::Display for SchemaVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

/// The origin of a run and its intervals of publishing and recording; it decides no bit of a state.
///
/// [`RunManifest::from_json`] decides about unknown keys: a later minor version may have some.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// Name of the run on the bus.
    pub name: RunName,
    /// Identity of the run, different for each.
    pub run_id: RunId,
    /// Program that computed the run, with its version.
    pub program: String,
    /// Machine it ran on.
    pub host: String,
    /// Start of the run, nanoseconds since 1970-01-01 UTC.
    pub started_unix_ns: u64,
    /// Number of steps from one published frame to the next.
    pub publish_every_steps: u64,
    /// Number of steps from one recorded frame to the next.
    pub record_every_steps: u64,
    /// The author and the licence.
    #[serde(flatten)]
    pub credit: Credit,
}

/// The description of a run: all other parts of the program know the run by it alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunManifest {
    /// Version of the schemas that the manifest was written with.
    pub schema_version: SchemaVersion,
    /// Everything that decides the bits.
    pub physics: Physics,
    /// The origin of the run.
    pub provenance: Provenance,
}

/// Identity of a run: a random UUID.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RunId(pub [u8; 16]);

impl RunId {
    /// A new identity.
    pub fn random() -> Self {
        Self(*uuid::Uuid::new_v4().as_bytes())
    }
}

impl fmt::Display for RunId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        uuid::Uuid::from_bytes(self.0).hyphenated().fmt(f)
    }
}

impl Serialize for RunId {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for RunId {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let uuid = uuid::Uuid::parse_str(&text).map_err(serde::de::Error::custom)?;
        Ok(Self(*uuid.as_bytes()))
    }
}

/// The reason why bytes are not a manifest that we can use.
#[derive(Debug, thiserror::Error)]
pub enum ManifestError {
    /// Not JSON of the right shape.
    #[error("the manifest cannot be read")]
    Json(#[from] serde_json::Error),
    /// A manifest of our version with a key that no manifest of this version has.
    #[error("the manifest has the unknown key `{key}`; it was changed, or another program wrote it")]
    UnknownKey {
        /// The key, such as `provenance.colour`.
        key: String,
    },
    /// A manifest of version 1.0 with a key that version 1.1 brought.
    #[error(
        "the manifest has schema version {found} and `{key}`, which came with 1.1; it was changed, or another program wrote it"
    )]
    KeyOfLater {
        /// The version found.
        found: SchemaVersion,
        /// The key.
        key: &'static str,
    },
    /// Written by a later minor version, with contents that may not be left out.
    #[error(
        "the manifest has schema version {found}, this program reads {SCHEMA_VERSION}, and it has contents \
         that cannot be left out; use a Beadline that reads {found}"
    )]
    Newer {
        /// The version found.
        found: SchemaVersion,
        /// The error about the contents that this program does not know.
        source: serde_json::Error,
    },
    /// Written by a later, incompatible version.
    #[error(
        "the manifest has schema version {found}, this program reads {SCHEMA_VERSION}; \
         use a Beadline that reads {found}"
    )]
    Version {
        /// The version found.
        found: SchemaVersion,
    },
    /// A value that no run can have.
    #[error("the manifest is not a possible run")]
    Value(#[from] ConfigError),
}

impl RunManifest {
    /// The manifest of a new run: validates `config`, with a name made of `fallback_name` if it names none.
    ///
    /// # Errors
    /// With the key, the value and what is allowed.
    pub fn new(config: &RunConfig, fallback_name: &str, origin: Origin) -> Result<Self, ConfigError> {
        Self::of(Physics::resolve(config)?, config, fallback_name, origin)
    }

    /// Like [`Self::new`], with the `physics` that `config` resolves to.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of(
        physics: Physics,
        config: &RunConfig,
        fallback_name: &str,
        origin: Origin,
    ) -> Result<Self, ConfigError> {
        let name = match &config.name {
            None => RunName::closest(fallback_name),
            Some(name) => name.parse().map_err(|_| {
                let allowed = format!("{}, such as `{}`", RunName::ALLOWED, RunName::closest(name));
                ConfigError::value("name", format!("`{}`", shown_within(name, 200)), &allowed)
            })?,
        };
        for (key, text) in [("program", &origin.program), ("host", &origin.host)] {
            if text.len() > MAX_TEXT_BYTES {
                let allowed = format!("at most {MAX_TEXT_BYTES} bytes");
                return Err(ConfigError::value(key, format!("a text of {} bytes", text.len()), &allowed));
            }
        }
        config.provenance.check()?;
        let stream = config.stream;
        let manifest = Self {
            schema_version: SCHEMA_VERSION,
            physics,
            provenance: Provenance {
                name,
                run_id: RunId::random(),
                program: origin.program,
                host: origin.host,
                started_unix_ns: origin.started_unix_ns,
                publish_every_steps: stream.publish_every_steps,
                record_every_steps: stream.record_every_steps,
                credit: config.provenance.clone(),
            },
        };
        manifest.check_stream()?;
        Ok(manifest)
    }

    /// The same run, with a state recorded every `steps` steps.
    ///
    /// # Errors
    /// When `steps` is no multiple of the steps between two frames.
    pub fn recorded_every(mut self, steps: u64) -> Result<Self, ConfigError> {
        self.provenance.record_every_steps = steps;
        self.check_stream()?;
        Ok(self)
    }

    fn check_stream(&self) -> Result<(), ConfigError> {
        let provenance = &self.provenance;
        if !(1..=MAX_STEPS).contains(&provenance.publish_every_steps) {
            let found = provenance.publish_every_steps;
            return Err(ConfigError::value("stream.publish_every_steps", found, "1 to 2^52"));
        }
        let record = provenance.record_every_steps;
        if record == 0 || record > MAX_STEPS || !record.is_multiple_of(provenance.publish_every_steps) {
            let allowed = format!(
                "a multiple of publish_every_steps = {}; only published frames are recorded",
                provenance.publish_every_steps
            );
            return Err(ConfigError::value("stream.record_every_steps", record, &allowed));
        }
        Ok(())
    }

    /// Reads and validates a manifest from JSON. No later use of the run fails over a value in it.
    ///
    /// # Errors
    /// As [`glance`](Self::glance), and those of [`check_whole`](Self::check_whole).
    pub fn from_json(json: &[u8]) -> Result<Self, ManifestError> {
        let manifest = Self::glance(json)?;
        manifest.check_whole()?;
        Ok(manifest)
    }

    /// Checks the values that need the arrays of the whole chain, which a glance does not make: the masses and stiffnesses that
    /// disorder gives, the scales of length and time, and the step.
    ///
    /// # Errors
    /// When the run is not possible.
    pub fn check_whole(&self) -> Result<(), ManifestError> {
        Ok(self.physics.check_whole()?)
    }

    /// Reads a manifest from JSON to show its contents, in a time proportional to its length. Before anything is computed, call
    /// [`check_whole`](Self::check_whole).
    ///
    /// In a manifest of a later minor version, unknown keys outside of `physics` decide no bit: they are left out, and
    /// [`is_newer_minor`](Self::is_newer_minor) is true. An unknown key of `physics` is refused, because it may decide bits. In any
    /// other manifest every unknown key is refused.
    ///
    /// # Errors
    /// When it is not a manifest, has keys that are not known, is of another major schema version, or has a value that no run can have.
    pub fn glance(json: &[u8]) -> Result<Self, ManifestError> {
        #[derive(Deserialize)]
        struct Versioned {
            schema_version: SchemaVersion,
        }
        let Versioned { schema_version: found } = serde_json::from_slice(json)?;
        if found.major != SCHEMA_VERSION.major {
            return Err(ManifestError::Version { found });
        }
        let is_newer = found.minor > SCHEMA_VERSION.minor;
        let manifest: Self = serde_json::from_slice(json).map_err(|source| {
            if is_newer { ManifestError::Newer { found, source } } else { ManifestError::Json(source) }
        })?;
        if !is_newer {
            manifest.refuse_unknown_keys(json)?;
        }
        manifest.physics.check_form()?;
        if let (0, Some(key)) = (found.minor, manifest.physics.key_since_1_1()) {
            return Err(ManifestError::KeyOfLater { found, key });
        }
        manifest.check_stream()?;
        Ok(manifest)
    }

    /// True if a later minor version wrote the manifest: it may have had keys that are not known here.
    pub fn is_newer_minor(&self) -> bool {
        self.schema_version.major == SCHEMA_VERSION.major && self.schema_version.minor > SCHEMA_VERSION.minor
    }

    /// Refuses a manifest if `json`, its source, has keys that the manifest itself does not have. The derived reader does
    /// that for the physics.
    #[expect(clippy::zero_sized_map_values, reason = "serde passes over the values of an object in this way")]
    fn refuse_unknown_keys(&self, json: &[u8]) -> Result<(), ManifestError> {
        // the physics may have long lists, of which no second copy is made
        type Keys = BTreeMap<String, IgnoredAny>;
        #[derive(Deserialize)]
        struct Parts {
            provenance: Keys,
        }
        let parts = ["schema_version", "physics", "provenance"];
        let found: Keys = serde_json::from_slice(json)?;
        if let Some(key) = found.into_keys().find(|key| !parts.contains(&key.as_str())) {
            return Err(ManifestError::UnknownKey { key });
        }
        let found: Parts = serde_json::from_slice(json)?;
        let known: Keys = serde_json::from_str(&to_json(&self.provenance))?;
        match found.provenance.into_keys().find(|key| !known.contains_key(key)) {
            Some(key) => Err(ManifestError::UnknownKey { key: format!("provenance.{key}") }),
            None => Ok(()),
        }
    }

    /// The manifest as JSON.
    pub fn to_json(&self) -> String {
        to_json(self)
    }

    /// The step of frame `frame`.
    pub fn step_of_frame(&self, frame: u64) -> u64 {
        frame.saturating_mul(self.provenance.publish_every_steps).min(self.physics.step_count) // integers
    }

    /// The frame at `step`; between two frames, the one before.
    pub fn frame_at(&self, step: u64) -> u64 {
        if step >= self.physics.step_count {
            self.frame_count() - 1
        } else {
            step / self.provenance.publish_every_steps
        }
    }

    /// True if there is a frame at `step`: every K-th, the first and the last.
    pub fn is_frame(&self, step: u64) -> bool {
        step.is_multiple_of(self.provenance.publish_every_steps) || step == self.physics.step_count
    }

    /// Number of frames of the whole run, the first and the last included.
    pub fn frame_count(&self) -> u64 {
        self.physics.step_count.div_ceil(self.provenance.publish_every_steps) + 1
    }

    /// True if the frame at `step` is recorded: every K-th, the first and the last.
    pub fn is_recorded(&self, step: u64) -> bool {
        step.is_multiple_of(self.provenance.record_every_steps) || step == self.physics.step_count
    }

    /// Number of frames that a recording of the whole run holds.
    pub fn recorded_count(&self) -> u64 {
        self.physics.step_count.div_ceil(self.provenance.record_every_steps) + 1
    }

    /// Number of contacts of a bead with the next one, N − 1.
    pub fn contact_count(&self) -> usize {
        usize_of(self.physics.beads) - 1
    }

    /// Number of contacts, with the one that closes a ring: N in a ring.
    pub fn all_contact_count(&self) -> usize {
        self.contact_count() + usize::from(self.physics.ends.left == End::Periodic)
    }

    /// Doubles in a frame on the bus: `(2 + E)·N`.
    pub fn frame_doubles(&self) -> usize {
        (2 + self.physics.extra_per_bead()) * usize_of(self.physics.beads)
    }
}

/// The program, the machine and the time of the start of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// Program with its version.
    pub program: String,
    /// Name of the machine.
    pub host: String,
    /// Nanoseconds since 1970-01-01 UTC.
    pub started_unix_ns: u64,
}

fn to_json(value: &impl Serialize) -> String {
    // plain structs of finite numbers and strings always serialise
    serde_json::to_string(value).unwrap_or_default()
}

/// A validated count of beads as an index; [`MAX_BEADS`] fits every platform's usize.
fn usize_of(beads: u64) -> usize {
    usize::try_from(beads).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{DampingConfig, MassRule, OddContact, StiffnessRule};
    use crate::method::Method;
    use crate::presets::PRESETS;

    fn origin() -> Origin {
        Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 }
    }

    fn manifest() -> RunManifest {
        RunManifest::new(&PRESETS[0].config(), "run", origin()).expect("valid preset")
    }

    /// Every configuration that the documentation shows is a possible run.
    #[test]
    fn the_documented_configurations_are_valid() {
        let page = include_str!("../../docs/CONFIGURATION.md");
        // a sweep file has its own test
        let page = page.split("## Sweeps").next().expect("a part");
        let blocks: Vec<&str> =
            page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
        assert_eq!(blocks.len(), 13);
        for block in &blocks {
            let config = RunConfig::from_toml(block).unwrap_or_else(|error| panic!("{error} in\n{block}"));
            let physics = Physics::resolve(&config);
            let physics = physics.unwrap_or_else(|error| panic!("{error} in\n{block}"));
            let expected = if config.damping.is_some() { Method::Rk5 } else { Method::Rkn4 };
            assert_eq!(physics.method, expected);
        }
    }

    /// 0.08 s in steps of 0.02·72.477966 µs, or as nearly as divides them.
    #[test]
    fn light_impurity_has_the_documented_step() {
        let m = manifest();
        assert!((m.physics.dt_s / (0.02 * 72.477_966e-6) - 1.0).abs() < 0.5 / 55_189.0);
        assert_eq!(m.physics.dt_s, 0.08 / 55_189.0);
        assert_eq!(m.physics.step_count, 55_189);
        assert_eq!(m.frame_count(), 55_190);
    }

    #[test]
    fn a_text_that_nobody_could_be_shown_is_not_written_and_is_read() {
        let long = "p".repeat(MAX_TEXT_BYTES + 1);
        let origin = Origin { program: long.clone(), ..origin() };
        let error = RunManifest::new(&PRESETS[0].config(), "run", origin).expect_err("too long");
        assert_eq!(error.key, "program");
        let json = manifest().to_json().replace("\"program\":\"test\"", &format!("\"program\":\"{long}\""));
        let read = RunManifest::from_json(json.as_bytes()).expect("as it is");
        assert_eq!(read.provenance.program, long);
    }

    #[test]
    fn json_round_trips_bit_for_bit() {
        let m = manifest();
        let back = RunManifest::from_json(m.to_json().as_bytes()).expect("own JSON");
        assert_eq!(back, m);
        assert_eq!(back.physics.dt_s.to_bits(), m.physics.dt_s.to_bits());
        assert_eq!(back.physics.hash(), m.physics.hash());
    }

    /// Credit decides no bit: not the hash, and not whether an earlier recording opens. A later one may say more.
    #[test]
    fn credit_is_kept_beside_the_physics() {
        let mut config = PRESETS[0].config();
        let [orcid, licence] = ["0000-0002-1825-0097", "CC-BY-4.0"].map(|text| Some(text.to_owned()));
        config.provenance = Credit { orcid, licence, ..Credit::default() };
        let m = RunManifest::new(&config, "run", origin()).expect("valid");
        assert_eq!(m.physics.hash(), manifest().physics.hash());
        let json = m.to_json();
        assert!(json.contains(r#","orcid":"0000-0002-1825-0097","licence":"CC-BY-4.0"}}"#), "{json}");
        assert_eq!(RunManifest::from_json(json.as_bytes()).expect("own JSON"), m);
        assert_eq!(RunConfig::from_toml(&config.to_toml()), Ok(config.clone()));
        let colour = json.replace("\"orcid\"", "\"colour\":1,\"orcid\"");
        let error = RunManifest::from_json(colour.as_bytes()).expect_err("a key that no manifest has");
        assert!(error.to_string().contains("`provenance.colour`"), "{error}");
        let later = colour.replace("\"minor\":1", "\"minor\":2");
        let read = RunManifest::from_json(later.as_bytes()).expect("a later version");
        assert_eq!(read.provenance.credit, config.provenance);
        config.provenance.doi = Some("doi:10.5281/1".to_owned());
        let error = RunManifest::new(&config, "run", origin()).expect_err("no DOI");
        assert_eq!(error.key, "provenance.doi");
    }

    #[test]
    fn another_major_version_is_refused_with_both_versions() {
        let json = manifest().to_json().replace("\"major\":1", "\"major\":2");
        let error = RunManifest::from_json(json.as_bytes()).expect_err("newer");
        assert!(error.to_string().contains("2.1") && error.to_string().contains("1.1"), "{error}");
    }

    /// The manifest with `provenance` and `physics` beginning with more keys, of version `1.minor`.
    fn with_keys(minor: u32, provenance: &str, physics: &str) -> Result<RunManifest, ManifestError> {
        let json = manifest().to_json().replace("\"minor\":1", &format!("\"minor\":{minor}"));
        let json = json.replace("\"provenance\":{", &format!("\"provenance\":{{{provenance}"));
        let json = json.replace("\"physics\":{", &format!("\"physics\":{{{physics}"));
        RunManifest::from_json(json.as_bytes())
    }

    #[test]
    fn a_newer_minor_version_may_say_more_of_where_a_run_comes_from() {
        let newer = with_keys(2, "\"colour\":\"red\",", "").expect("readable");
        assert!(newer.is_newer_minor() && !manifest().is_newer_minor());
        assert_eq!(newer.physics, manifest().physics);
        assert_eq!(newer.schema_version.to_string(), "1.2");
        let json = newer.to_json().replacen('{', "{\"signature\":[1],", 1);
        assert!(RunManifest::from_json(json.as_bytes()).is_ok(), "also beside the two parts");
    }

    #[test]
    fn a_newer_minor_version_may_not_say_more_of_the_physics() {
        let json = manifest().to_json().replace("\"minor\":1", "\"minor\":2");
        let method = json.replace("\"method\":\"rkn4\"", "\"method\":\"gear7\"");
        let impurity = json.replace("{\"bead\":500,", "{\"bead\":500,\"radius_m\":1,");
        assert!(method != json && impurity != json);
        for (read, key) in [
            (with_keys(2, "", "\"walls\":2,"), "`walls`"),
            (RunManifest::from_json(method.as_bytes()), "`gear7`"),
            (RunManifest::from_json(impurity.as_bytes()), "`radius_m`"),
        ] {
            let error = read.expect_err(key);
            let cause = std::error::Error::source(&error).map(ToString::to_string).unwrap_or_default();
            let text = error.to_string();
            assert!(matches!(error, ManifestError::Newer { .. }), "{text}");
            assert!(text.contains("1.2") && text.contains("1.1") && cause.contains(key), "{text}: {cause}");
        }
    }

    /// The largest number of a contact, lists out of order and −0 come from no configuration.
    #[test]
    fn a_hostile_manifest_is_refused() {
        let contact = format!("\"contacts\":[{{\"contact\":{},\"stiffness\":1.0}}],", u64::MAX);
        assert!(matches!(with_keys(1, "", &contact), Err(ManifestError::Value(_))));
        let twice = "\"contacts\":[{\"contact\":5,\"stiffness\":1e7},{\"contact\":4,\"stiffness\":1e7}],";
        assert!(matches!(with_keys(1, "", twice), Err(ManifestError::Value(_))));
        let json = manifest().to_json().replace("\"velocity_m_s\":5.0", "\"velocity_m_s\":-0.0");
        let json = json.replace("\"striker\"", "\"load\":{\"precompression_n\":1.0},\"striker\"");
        assert!(matches!(RunManifest::from_json(json.as_bytes()), Err(ManifestError::Value(_))));
    }

    #[test]
    fn unknown_keys_of_our_version_are_refused() {
        for (read, key) in [
            (with_keys(1, "\"colour\":1,", ""), "provenance.colour"),
            (
                RunManifest::from_json(manifest().to_json().replacen('{', "{\"more\":1,", 1).as_bytes()),
                "more",
            ),
        ] {
            let error = read.expect_err(key);
            assert!(matches!(&error, ManifestError::UnknownKey { key: found } if found == key), "{error}");
        }
        assert!(matches!(with_keys(1, "", "\"walls\":2,"), Err(ManifestError::Json(_))));
    }

    #[test]
    fn a_manifest_from_elsewhere_is_checked_like_a_configuration() {
        for (from, to) in [("\"alpha\":1.5", "\"alpha\":0.5"), ("\"beads\":1000", "\"beads\":400")] {
            let json = manifest().to_json().replace(from, to);
            assert!(matches!(RunManifest::from_json(json.as_bytes()), Err(ManifestError::Value(_))));
        }
    }

    #[test]
    fn impossible_values_name_key_value_and_what_is_allowed() {
        let refuse = |change: fn(&mut RunConfig), key: &str| {
            let mut config = PRESETS[0].config();
            change(&mut config);
            let error = RunManifest::new(&config, "run", origin()).expect_err(key);
            assert_eq!(error.key, key, "{error}");
            assert!(error.message.contains("allowed"), "{error}");
        };
        refuse(|c| c.chain.alpha = Some(0.99), "chain.alpha");
        refuse(|c| c.chain.alpha = Some(f64::NAN), "chain.alpha");
        refuse(|c| (c.chain.stiffness, c.striker.velocity_m_s) = (Some(1e90), 1e-60), "chain.stiffness");
        refuse(|c| c.chain.beads = 1, "chain.beads");
        refuse(|c| c.chain.bead_mass_kg = Some(0.0), "chain.bead_mass_kg");
        refuse(|c| c.chain.stiffness = Some(-1.0), "chain.stiffness");
        refuse(|c| c.chain.impurities[0].bead = 1000, "chain.impurities[0].bead");
        refuse(|c| c.chain.impurities[0].mass_kg = f64::INFINITY, "chain.impurities[0].mass_kg");
        refuse(|c| c.chain.impurities.push(c.chain.impurities[0]), "chain.impurities[1].bead");
        refuse(|c| c.striker.bead = 5000, "striker.bead");
        refuse(|c| c.striker.velocity_m_s = 0.0, "striker.velocity_m_s");
        refuse(|c| c.chain.masses = MassRule::PatternKg(Vec::new()), "chain.masses.pattern_kg");
        refuse(|c| c.chain.masses = MassRule::ListKg(vec![1e-3; 999]), "chain.masses.list_kg");
        refuse(|c| c.chain.masses = MassRule::Taper(0.5), "chain.masses");
        refuse(|c| c.chain.masses = MassRule::Taper(0.0), "chain.masses.taper");
        refuse(|c| c.chain.stiffnesses = StiffnessRule::List(vec![1.0; 1000]), "chain.stiffnesses.list");
        refuse(
            |c| (c.chain.alpha, c.chain.stiffnesses) = (Some(2.0), StiffnessRule::Radii),
            "chain.stiffnesses",
        );
        refuse(
            |c| c.chain.contacts = vec![OddContact { contact: 999, stiffness: 1.0 }],
            "chain.contacts[0].contact",
        );
        refuse(|c| c.ends.left_stiffness = Some(-1.0), "ends.left_stiffness");
        refuse(|c| c.ends.left_stiffness = Some(1e7), "ends.left_stiffness");
        refuse(|c| c.load.gravity_m_s2 = 9.81, "load.gravity_m_s2");
        refuse(|c| c.load.precompression_n = -1.0, "load.precompression_n");
        refuse(|c| c.damping = Some(DampingConfig::Restitution(1.5)), "damping.restitution");
        refuse(|c| c.damping = Some(DampingConfig::Restitution(0.5)), "integrator.method");
        refuse(|c| c.time.dt_s = Some(1e-3), "time.dt_s");
        refuse(|c| c.time.duration_s = -1.0, "time.duration_s");
        refuse(|c| c.stream.publish_every_steps = 0, "stream.publish_every_steps");
        refuse(|c| c.stream.publish_every_steps = 3, "stream.record_every_steps");
        refuse(|c| c.name = Some("Not Allowed".into()), "name");
    }

    #[test]
    fn the_first_and_the_last_frame_are_always_recorded() {
        let mut config = PRESETS[2].config();
        config.stream = crate::config::StreamConfig { publish_every_steps: 10, record_every_steps: 100 };
        let m = RunManifest::new(&config, "run", origin()).expect("valid");
        let last = m.frame_count() - 1;
        assert_eq!(m.step_of_frame(last), m.physics.step_count);
        let recorded = (0..=last).filter(|f| m.is_recorded(m.step_of_frame(*f))).count();
        assert_eq!(recorded as u64, m.recorded_count());
        assert!(m.is_recorded(0) && m.is_recorded(m.physics.step_count));
        assert!((0..=last).all(|f| m.is_frame(m.step_of_frame(f)) && m.frame_at(m.step_of_frame(f)) == f));
        assert!(!m.is_frame(19) && m.frame_at(19) == 1);
    }
}
