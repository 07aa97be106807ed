//! Recovers a recording: writes everything in it that can be read and proven to a new one, and recomputes the frames
//! between.
//!
//! A run is determined by its manifest, so the computed states are the measure: a state of the file is kept if it
//! follows from them. A file of another kernel version cannot be measured; its states are kept as they are if their
//! checksums hold.

mod salvager;

use crate::resimulation::{Difference, OtherKernel};
use recording::{
    Audit, Audited, BeginRecord, CopyError, Damage, DamageKind, EncodedStates, EndRecord, OtherCopier,
    ReadError, RecordingWriter, WriteError,
};
use salvager::Salvager;
use schemas::frame::EndReason;
use schemas::manifest::RunManifest;
use std::collections::BTreeMap;

/// Largest number of differences and of ranges that are kept; more are only counted.
pub const MOST_KEPT: usize = 20;

/// Least size of a state in a file: its entry in a message index, and that of its summary. It bounds the number of
/// lost states.
const BYTES_OF_A_STATE: u64 = 32;

/// Result of recovering a recording.
#[derive(Debug)]
pub struct Recovery {
    /// States of the file that were written again.
    pub kept_count: u64,
    /// The kept states after step 0 to which the manifest's initial condition leads.
    pub kept_after_start_count: u64,
    /// The kept states that came without a valid checksum, and were proven by recomputing them.
    pub proven_without_checksum_count: u64,
    /// Frames that were recomputed, from and up to; the first ranges.
    pub recomputed: Vec<(u64, u64)>,
    /// Number of recomputed states.
    pub recomputed_count: u64,
    /// States of the file that do not follow from the states before them: recomputed or left out.
    pub differences: Vec<Difference>,
    /// Number of differences.
    pub difference_count: u64,
    /// States without a checksum that holds and that could not be proven: left out, unless recomputed.
    pub unproven_count: u64,
    /// Frames missing in the new file, from and up to; up to an unknown one where the
    /// file was cut off after damage. The first ranges.
    pub lost: Vec<(u64, Option<u64>)>,
    /// Number of lost ranges.
    pub lost_count: u64,
    /// Numbers of kept and lost messages of other channels, by topic.
    pub others: BTreeMap<String, OtherCounts>,
    /// Attachments, metadata and private records of others that were copied.
    pub kept_records: Vec<String>,
    /// Those that could not be.
    pub lost_records: Vec<String>,
    /// Damages of the file; the first ones.
    pub damages: Vec<Damage>,
    /// Number of damages.
    pub damage_count: u64,
    /// The other kernel version, if this program cannot recompute the run.
    pub other_kernel: Option<OtherKernel>,
    /// Step of the last state that was written.
    pub last_step: Option<u64>,
    /// Why the new recording ends.
    pub end: EndReason,
    /// True if the end was read from the file.
    pub end_was_read: bool,
}

/// Messages of another channel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct OtherCounts {
    /// Messages that were written again.
    pub kept: u64,
    /// Messages in the file that are damaged.
    pub lost: u64,
}

impl Recovery {
    /// True if everything in the file was right, and is in the new one.
    pub fn is_whole(&self) -> bool {
        self.lost_count + self.difference_count == 0
            && self.others.values().all(|counts| counts.lost == 0)
            && self.lost_records.is_empty()
    }

    /// True if the file has states, and its manifest leads to none of them but that of step 0.
    pub fn manifest_fits_no_state(&self) -> bool {
        self.other_kernel.is_none() && self.difference_count > 0 && self.kept_after_start_count == 0
    }
}

/// Why recovering failed.
#[derive(Debug, thiserror::Error)]
pub enum RecoveryError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The contents of others cannot be copied.
    #[error(transparent)]
    Copy(#[from] CopyError),
    /// The caller asked to stop.
    #[error("stopped before everything was read")]
    Stopped,
}

/// Writes everything that can be saved of the recording `audit`, which begins as `begin` says, to `writer`, which must
/// still be finished. With `fill` it recomputes lost frames. The file should have `expected` messages of each topic, if
/// that is known. `watch` sees the step of each state, and returns false to stop.
///
/// # Errors
/// When reading or writing fails, or `watch` says so.
pub fn recover(
    mut audit: Audit,
    begin: &BeginRecord,
    fill: bool,
    expected: Option<&BTreeMap<String, u64>>,
    writer: &mut RecordingWriter,
    watch: &mut dyn FnMut(u64) -> bool,
) -> Result<Recovery, RecoveryError> {
    let manifest = audit.manifest().clone();
    let fill_most = if fill { audit.file_bytes() / BYTES_OF_A_STATE } else { 0 };
    let mut salvager = Salvager::new(&manifest, begin, fill_most, writer, watch);
    let mut others: BTreeMap<String, OtherCounts> = BTreeMap::new();
    let mut unchecked: BTreeMap<String, u64> = BTreeMap::new();
    let mut copier = OtherCopier::default();
    let mut one = EncodedStates::default();
    let mut doubles = Vec::new();
    loop {
        match audit.read_next()? {
            Audited::State(state) => {
                one.clear();
                one.push(state.frame, state.step, state.message);
                // its lengths were checked when it was read
                if let Ok(frame) = one.decode(0, &manifest, &mut doubles) {
                    if state.is_checked { salvager.take(&frame)? } else { salvager.take_unchecked(&frame)? }
                }
            }
            Audited::Summary(_) => {}
            Audited::Other(message) if message.is_checked() => {
                copier.copy(&message, salvager.writer())?;
                others.entry(message.topic().to_owned()).or_default().kept += 1;
            }
            Audited::Other(message) => *unchecked.entry(message.topic().to_owned()).or_insert(0) += 1,
            Audited::End => break,
        }
    }
    let end = audit.end().cloned();
    let loses_tail = loses_tail(&audit);
    let records = audit.other_records().clone();
    let mut recovery = salvager.finish(end.as_ref(), loses_tail)?;
    records.copy(audit.path(), writer)?;
    recovery.kept_records = records.whole.into_values().collect();
    recovery.lost_records = records.lost.into_iter().collect();
    count_lost(&mut others, &unchecked, &audit.lost_counts(), expected);
    recovery.others = others;
    recovery.damages = audit.damages().to_vec();
    recovery.damage_count = audit.damage_count();
    recovery.end_was_read = end.is_some();
    recovery.end = end_reason(&manifest, end.as_ref(), recovery.last_step);
    Ok(recovery)
}

/// True if some content after the last state is damaged, more than a record that was never whole.
fn loses_tail(audit: &Audit) -> bool {
    let is_open = |damage: &&Damage| damage.frames.is_some_and(|frames| frames.to.is_none());
    audit.damages().iter().filter(is_open).any(|damage| damage.kind != DamageKind::Torn)
}

/// Why the new recording ends: as the file says, if it reaches that far.
fn end_reason(manifest: &RunManifest, end: Option<&EndRecord>, last_step: Option<u64>) -> EndReason {
    let reached = end.filter(|end| end.last_step == last_step);
    match reached {
        _ if last_step == Some(manifest.physics.step_count) => EndReason::Complete,
        // a file may say that it is complete and end before the run does
        Some(end) if end.reason != EndReason::Complete => end.reason,
        _ => EndReason::Interrupted,
    }
}

/// Counts the messages of other channels that were in the file and are not in the new one.
fn count_lost(
    others: &mut BTreeMap<String, OtherCounts>,
    unchecked: &BTreeMap<String, u64>,
    by_index: &BTreeMap<String, u64>,
    expected: Option<&BTreeMap<String, u64>>,
) {
    let of_frames = |topic: &str| ["/state", "/summary", "/chain"].contains(&topic);
    let known = unchecked.keys().chain(by_index.keys()).chain(expected.into_iter().flat_map(BTreeMap::keys));
    for topic in known.filter(|topic| !of_frames(topic)) {
        let count = |counts: &BTreeMap<String, u64>| counts.get(topic).copied().unwrap_or(0);
        let (seen, indexed) = (count(unchecked), count(by_index));
        let entry = others.entry(topic.clone()).or_default();
        let damaged = if seen > indexed { seen } else { indexed };
        let missing = expected.map_or(0, |expected| count(expected).saturating_sub(entry.kept));
        entry.lost = if missing > damaged { missing } else { damaged };
    }
}
