//! The metadata records: `beadline.run`, the first record of a file, `beadline.begin`, and `beadline.end`, the last.

use super::error::ReadError;
use mcap::records::Metadata;
use schemas::frame::EndReason;
use schemas::manifest::{ManifestError, RunManifest, SCHEMA_VERSION, SchemaVersion};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::path::Path;

/// Name of the metadata record with the manifest.
pub(super) const RUN: &str = "beadline.run";

/// Name of the metadata record with the beginning, in files that do not begin with the run.
pub(super) const BEGIN: &str = "beadline.begin";

/// Name of the metadata record with the end.
pub(super) const END: &str = "beadline.end";

/// Largest number of parts of a recording.
const MOST_PARTS: u64 = u32::MAX as u64;

/// Name of the attachment with the configuration as the user gave it.
pub(super) const RUN_TOML: &str = "run.toml";

/// Beginning of a recording, as in its metadata record `beadline.begin`. Without that record it begins with the run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BeginRecord {
    /// Step from which on states are recorded.
    pub first_step: u64,
    /// Number of this part of a split recording, from 1.
    pub part: u64,
    /// SHA-256 of the last state of the part before, in hex; absent in the first part.
    pub previous_state_hash: Option<String>,
}

impl Default for BeginRecord {
    /// The beginning of a recording that begins with the run.
    fn default() -> Self {
        Self { first_step: 0, part: 1, previous_state_hash: None }
    }
}

/// End of a recording, as in its metadata record `beadline.end`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EndRecord {
    /// Why no more frames follow.
    pub reason: EndReason,
    /// Step of the first recorded state, absent if there is none.
    pub first_step: Option<u64>,
    /// Step of the last recorded state, absent if there is none.
    pub last_step: Option<u64>,
    /// Number of this part of a split recording, from 1.
    pub part: u64,
    /// SHA-256 of the last state of the part before, in hex; absent in the first part.
    pub previous_state_hash: Option<String>,
    /// SHA-256 of the last state in this file, in hex; absent if there is none.
    pub last_state_hash: Option<String>,
}

/// `manifest` as a metadata record.
pub(super) fn run_metadata(manifest: &RunManifest) -> Metadata {
    // we write only what we know of a newer run, which is then no longer of its version
    let version = if manifest.is_newer_minor() { SCHEMA_VERSION } else { manifest.schema_version };
    let version = version.to_string();
    let physics = manifest.physics.to_json();
    // a struct of numbers and strings always serialises
    let provenance = serde_json::to_string(&manifest.provenance).unwrap_or_default();
    let checksum = checksum(RUN, [&version, &physics, &provenance]);
    let entries = [
        ("schema_version", version),
        ("physics", physics),
        ("provenance", provenance),
        ("checksum", checksum),
    ];
    metadata(RUN, entries)
}

fn metadata<const N: usize>(name: &str, entries: [(&str, String); N]) -> Metadata {
    let metadata = entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    Metadata { name: name.to_owned(), metadata }
}

/// SHA-256 in hex of the name of a metadata record and its values, each followed by a line feed.
fn checksum(name: &str, values: [&str; 3]) -> String {
    let mut hash = Sha256::new();
    for part in [name].into_iter().chain(values) {
        hash.update(part);
        hash.update("\n");
    }
    hex(&hash.finalize())
}

/// The bytes as two digits each.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// SHA-256 in hex of a state: its step, then `[u | v | extra]`, eight little-endian bytes each.
pub fn state_hash(step: u64, doubles: &[f64]) -> String {
    let mut hash = Sha256::new();
    hash.update(step.to_le_bytes());
    for value in doubles {
        hash.update(value.to_le_bytes());
    }
    hex(&hash.finalize())
}

/// The manifest in a metadata record `beadline.run`, as [`RunManifest::glance`] reads it.
pub(super) fn read_run(path: &Path, record: &Metadata) -> Result<RunManifest, ReadError> {
    let entry = |key: &str| {
        record.metadata.get(key).ok_or_else(|| ReadError::NotBeadline {
            path: path.to_owned(),
            what: format!("its metadata `{RUN}` has no `{key}`"),
        })
    };
    let wrong = |source| ReadError::Manifest { path: path.to_owned(), source };
    let version = entry("schema_version")?;
    let found = parse_version(version).ok_or_else(|| ReadError::NotBeadline {
        path: path.to_owned(),
        what: format!("its schema version is `{version}` instead of one like {SCHEMA_VERSION}"),
    })?;
    // before the checksum: another major version may have another rule
    if found.major != SCHEMA_VERSION.major {
        return Err(wrong(ManifestError::Version { found }));
    }
    let (physics, provenance) = (entry("physics")?, entry("provenance")?);
    let computed = checksum(RUN, [version, physics, provenance]);
    let stored = entry("checksum")?;
    if *stored != computed {
        return Err(ReadError::ManifestChecksum { path: path.to_owned(), found: stored.clone(), computed });
    }
    RunManifest::glance(&join(found, physics, provenance).map_err(wrong)?).map_err(wrong)
}

/// The manifest's JSON from its parts, each of which must be a value of its own.
fn join(version: SchemaVersion, physics: &str, provenance: &str) -> Result<Vec<u8>, ManifestError> {
    for part in [physics, provenance] {
        serde_json::from_str::<serde::de::IgnoredAny>(part)?;
    }
    let SchemaVersion { major, minor } = version;
    let json = format!(
        r#"{{"schema_version":{{"major":{major},"minor":{minor}}},"physics":{physics},"provenance":{provenance}}}"#
    );
    Ok(json.into_bytes())
}

fn parse_version(text: &str) -> Option<SchemaVersion> {
    let (major, minor) = text.split_once('.')?;
    Some(SchemaVersion { major: major.parse().ok()?, minor: minor.parse().ok()? })
}

impl BeginRecord {
    /// The metadata record; none if the recording begins with the run.
    pub(super) fn metadata(&self) -> Option<Metadata> {
        let (first_step, part) = (self.first_step.to_string(), self.part.to_string());
        let previous_state_hash = self.previous_state_hash.clone().unwrap_or_default();
        let checksum = checksum(BEGIN, [&first_step, &part, &previous_state_hash]);
        let entries = [
            ("first_step", first_step),
            ("part", part),
            ("previous_state_hash", previous_state_hash),
            ("checksum", checksum),
        ];
        (*self != Self::default()).then(|| metadata(BEGIN, entries))
    }

    pub(super) fn from_metadata(record: &Metadata) -> Result<Self, String> {
        let (first_step, part) = (entry(record, "first_step")?, entry(record, "part")?);
        let computed = checksum(BEGIN, [first_step, part, entry(record, "previous_state_hash")?]);
        let stored = entry(record, "checksum")?;
        if stored != computed {
            return Err(format!("metadata `{BEGIN}` with the checksum {stored} instead of {computed}"));
        }
        Ok(Self {
            first_step: number("first_step", first_step)?,
            part: part_number(part)?,
            previous_state_hash: optional(record, "previous_state_hash")?.map(str::to_owned),
        })
    }
}

impl EndRecord {
    pub(super) fn metadata(&self) -> Metadata {
        let step = |step: Option<u64>| step.map(|step| step.to_string()).unwrap_or_default();
        let entries = [
            ("reason", self.reason.as_str().to_owned()),
            ("first_step", step(self.first_step)),
            ("last_step", step(self.last_step)),
            ("part", self.part.to_string()),
            ("previous_state_hash", self.previous_state_hash.clone().unwrap_or_default()),
            ("last_state_hash", self.last_state_hash.clone().unwrap_or_default()),
        ];
        metadata(END, entries)
    }

    pub(super) fn from_metadata(record: &Metadata) -> Result<Self, String> {
        let reason = entry(record, "reason")?;
        let step = |key| optional(record, key)?.map(|text| number(key, text)).transpose();
        Ok(Self {
            reason: parse_reason(reason)
                .ok_or_else(|| format!("an end for the unknown reason `{reason}`"))?,
            first_step: step("first_step")?,
            last_step: step("last_step")?,
            part: part_number(entry(record, "part")?)?,
            previous_state_hash: optional(record, "previous_state_hash")?.map(str::to_owned),
            last_state_hash: optional(record, "last_state_hash")?.map(str::to_owned),
        })
    }
}

fn entry<'a>(record: &'a Metadata, key: &str) -> Result<&'a str, String> {
    let value = record.metadata.get(key).map(String::as_str);
    value.ok_or_else(|| format!("metadata `{}` without `{key}`", record.name))
}

fn optional<'a>(record: &'a Metadata, key: &str) -> Result<Option<&'a str>, String> {
    entry(record, key).map(|text| if text.is_empty() { None } else { Some(text) })
}

fn number(key: &str, text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("metadata with {key} = `{text}` instead of a number"))
}

fn part_number(text: &str) -> Result<u64, String> {
    let part = number("part", text)?;
    if (1..=MOST_PARTS).contains(&part) {
        return Ok(part);
    }
    Err(format!("metadata with part = {part} instead of 1 to {MOST_PARTS}"))
}

fn parse_reason(text: &str) -> Option<EndReason> {
    use EndReason::{
        Complete, Continued, Detached, Dropped, Failed, Interrupted, ProducerLost, Stopped, Unfinished,
    };
    [Complete, Interrupted, Failed, ProducerLost, Dropped, Unfinished, Stopped, Continued, Detached]
        .into_iter()
        .find(|reason| reason.as_str() == text)
}
