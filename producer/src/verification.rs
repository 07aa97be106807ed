//! Proves a recording: every state must follow from the state before it, every summary must match its state, and every
//! other record the rest of the file.
//!
//! The file is read once, in order. Threads receive its encoded states in batches, decode them and recompute the steps
//! between. Memory is bounded by a few batches and two chunks.

mod batches;
mod parts;

pub(crate) use parts::is_affordable;
pub use parts::{Follows, follows, follows_the_run};

use crate::resimulation::{Difference, OtherKernel, check_kernel, difference};
use crate::state::ChainState;
use batches::{Proof, Proving, prove_batches};
use recording::{
    Audit, Audited, BeginRecord, Damage, EncodedStates, EndRecord, ReadError, RowsFound, SummaryDifference,
    state_hash,
};
use schemas::frame::EndReason;
use schemas::manifest::RunManifest;
use std::collections::BTreeMap;
use std::num::NonZero;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex};

/// A batch covers at least this many steps, unless it has [`BATCH_BYTES`].
const BATCH_STEPS: u64 = 256;

/// Size of a full batch (bytes).
const BATCH_BYTES: usize = 1 << 20;

/// Most batches that wait for a thread.
const MOST_WAITING: usize = 4;

/// Largest number of differences that are kept; more are only counted.
pub const MOST_DIFFERENCES: usize = 20;

/// Result of verifying a recording.
#[derive(Debug)]
pub struct Verification {
    /// The run.
    pub manifest: RunManifest,
    /// States read.
    pub state_count: u64,
    /// The first state.
    pub first: Option<ChainState>,
    /// The last state.
    pub last: Option<ChainState>,
    /// Hash of the last state, as in `beadline.end`.
    pub last_state_hash: Option<String>,
    /// The other dynamics that computed the run, if no step could be recomputed for that reason.
    pub other_kernel: Option<OtherKernel>,
    /// Summaries that were compared with their states.
    pub summary_count: u64,
    /// Rows of results, by topic. They are in order and belong to frames of the run; their values were not checked.
    pub rows: BTreeMap<String, RowsFound>,
    /// Messages of other channels by topic, which are not checked.
    pub foreign: BTreeMap<String, u64>,
    /// Attachments, metadata and private records of others, of which nothing is known.
    pub other_records: Vec<String>,
    /// The configuration as the user gave it, if it is there.
    pub run_toml: Option<String>,
    /// True if there is a summary section; it was compared with the rest of the file.
    pub has_summary_section: bool,
    /// States that do not follow from the one before; the first ones, in order.
    pub differences: Vec<Difference>,
    /// Number of differences.
    pub difference_count: u64,
    /// The first summaries, in order, that do not match their states.
    pub summary_differences: Vec<SummaryDifference>,
    /// Number of differing summaries.
    pub summary_difference_count: u64,
    /// Damages of the file; the first ones, in order.
    pub damages: Vec<Damage>,
    /// Number of damages.
    pub damage_count: u64,
    /// The hash that the end of the file names, if it is not the hash of the last state.
    pub wrong_end_hash: Option<String>,
    /// Missing frames, from and up to; the first ranges.
    pub missing: Vec<(u64, u64)>,
    /// Number of missing ranges.
    pub missing_count: u64,
    /// Begin of the recording.
    pub begin: BeginRecord,
    /// The record of the end, if there is one.
    pub end_record: Option<EndRecord>,
    /// Why the states end.
    pub end: EndReason,
    /// The step after which states are unchecked, if the verification was asked to stop.
    pub stopped_after: Option<u64>,
}

impl Verification {
    /// True if everything is correct, from the first state to the end of the recording. [`follows`] or [`follows_the_run`]
    /// proves the first state, if it is not that of step 0.
    pub fn is_proven(&self) -> bool {
        self.is_proven_so_far() && self.end.is_orderly()
    }

    /// True if everything in the file is correct.
    pub fn is_proven_so_far(&self) -> bool {
        self.is_sound_so_far() && self.other_kernel.is_none()
    }

    /// True if this program finds nothing wrong with the file.
    pub fn is_sound_so_far(&self) -> bool {
        self.has_sound_states() && self.rows.values().all(|rows| rows.missing_count == 0)
    }

    /// True if this program finds nothing wrong with the file but rows of results that are missing.
    pub fn has_sound_states(&self) -> bool {
        let cut_off = |damage: &Damage| damage.kind == recording::DamageKind::Torn;
        self.state_count > 0
            && self.difference_count + self.summary_difference_count + self.missing_count == 0
            && self.damage_count == self.damages.iter().filter(|damage| cut_off(damage)).count() as u64
            && self.wrong_end_hash.is_none()
    }

    /// Steps of the first and the last state.
    pub fn step_range(&self) -> Option<(u64, u64)> {
        Some((self.first.as_ref()?.step, self.last.as_ref()?.step))
    }
}

/// Verifies the recording `audit` with `threads` threads that recompute, or as many as the system grants, beside this
/// one that reads. Without any, this thread does both. `watch` sees the step of each state that was read; `stop` ends
/// the verification early.
///
/// # Errors
/// When the operating system refuses, or the recording holds no states.
pub fn verify(
    mut audit: Audit,
    threads: NonZero<usize>,
    stop: &AtomicBool,
    mut watch: impl FnMut(u64),
) -> Result<Verification, ReadError> {
    let manifest = audit.manifest().clone();
    let (sender, batches) = sync_channel(MOST_WAITING);
    // back again, so that their memory is not asked for anew each time
    let (give_back, spent) = channel();
    std::thread::scope(|scope| {
        let batches = Arc::new(Mutex::new(batches));
        let run = &manifest;
        // owned by the threads and nobody else: if all of them panic it is gone, and reading does not wait for them
        let start = |batches: Arc<Mutex<_>>, spent: Sender<_>| {
            let work = move || prove_batches(run, batches.as_ref(), &spent, stop);
            std::thread::Builder::new().spawn_scoped(scope, work).ok()
        };
        let workers: Vec<_> =
            (0..threads.get()).map_while(|_| start(Arc::clone(&batches), give_back.clone())).collect();
        drop(batches);
        let mut own = Proving::new(run);
        let mut hand_out = |batch: EncodedStates| {
            if workers.is_empty() {
                own.prove(&batch, stop);
                return give_back.send(batch).is_ok();
            }
            sender.send(batch).is_ok()
        };
        let read = read(&mut audit, &manifest, (&mut hand_out, &spent), stop, &mut watch);
        drop(sender);
        let mut proof = own.proof;
        for worker in workers {
            // a thread that panicked has said why; the panic goes on here
            proof.add(worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        proof.sort();
        let read = read?;
        audit.check_has_states()?;
        Ok(read.into_verification(&manifest, &audit, proof))
    })
}

/// Results of reading.
struct Read {
    state_count: u64,
    summary_count: u64,
    first: Option<ChainState>,
    last: Option<ChainState>,
    /// Difference of the first state from the manifest's initial condition, if there is one.
    initial: Option<Difference>,
    stopped: bool,
}

impl Read {
    fn into_verification(self, manifest: &RunManifest, audit: &Audit, mut proof: Proof) -> Verification {
        let last_read = self.last.as_ref().filter(|_| self.stopped).map(|last| last.step);
        let stopped_after = proof.stopped_after.or(last_read);
        let last_state_hash = self.last.as_ref().map(hash_of);
        if let Some(wrong) = self.initial {
            proof.differences.insert(0, wrong);
            proof.difference_count += 1;
        }
        proof.differences.truncate(MOST_DIFFERENCES);
        let end_record = audit.end().cloned();
        // the end of the run may be among the states that were lost
        let is_last = |end: &&EndRecord| end.last_step == self.last.as_ref().map(|last| last.step);
        let said_hash = end_record.as_ref().filter(is_last).and_then(|end| end.last_state_hash.clone());
        Verification {
            manifest: manifest.clone(),
            state_count: self.state_count,
            summary_count: self.summary_count,
            rows: audit.rows().clone(),
            foreign: audit.foreign_counts(),
            other_records: audit.other_records().clone().into_names(),
            run_toml: audit.run_toml().map(str::to_owned),
            has_summary_section: audit.has_summary_section(),
            first: self.first,
            last: self.last,
            wrong_end_hash: said_hash.filter(|said| Some(said) != last_state_hash.as_ref()),
            last_state_hash,
            other_kernel: check_kernel(manifest).err(),
            differences: proof.differences,
            difference_count: proof.difference_count,
            summary_differences: proof.summary_differences,
            summary_difference_count: proof.summary_difference_count,
            damages: audit.damages().to_vec(),
            damage_count: audit.damage_count(),
            missing: audit.missing().to_vec(),
            missing_count: audit.missing_count(),
            begin: audit.begin().clone(),
            end: if stopped_after.is_some() { EndReason::Stopped } else { audit.end_reason() },
            stopped_after,
            end_record,
        }
    }
}

/// The hash of a state, as in `beadline.end`.
pub(crate) fn hash_of(state: &ChainState) -> String {
    state_hash(state.step, &[&state.u_m[..], &state.v_m_s, &state.extra].concat())
}

/// Reads all states and hands them out in batches, each of which begins with the last state of the one before. Batches
/// that come back are used again.
fn read(
    audit: &mut Audit,
    manifest: &RunManifest,
    (hand_out, spent): (&mut dyn FnMut(EncodedStates) -> bool, &Receiver<EncodedStates>),
    stop: &AtomicBool,
    watch: &mut impl FnMut(u64),
) -> Result<Read, ReadError> {
    let mut found =
        Read { state_count: 0, summary_count: 0, first: None, last: None, initial: None, stopped: false };
    let mut batch = EncodedStates::default();
    loop {
        match audit.read_next()? {
            Audited::State(state) if state.is_checked => {
                let full = batch.step_range().is_some_and(|(first, last)| last - first >= BATCH_STEPS);
                if full || batch.bytes() >= BATCH_BYTES {
                    let mut next = spent.try_recv().unwrap_or_default();
                    next.begin_after(&batch);
                    if !hand_out(std::mem::replace(&mut batch, next)) {
                        // all threads have panicked, which goes on when they are joined
                        return Ok(found);
                    }
                }
                batch.push(state.frame, state.step, state.message);
                found.state_count += 1;
                if found.first.is_none() {
                    found.first = decode(&batch, 0, manifest);
                    found.initial =
                        found.first.as_ref().and_then(|first| initial_difference(manifest, first));
                }
                watch(state.step);
                if stop.load(Ordering::Relaxed) {
                    found.stopped = true;
                    break;
                }
            }
            Audited::Summary(message) => {
                found.summary_count += 1;
                batch.push_summary(message);
            }
            Audited::State(_) | Audited::Other(_) => {}
            Audited::End => break,
        }
    }
    found.last = batch.len().checked_sub(1).and_then(|last| decode(&batch, last, manifest));
    hand_out(batch);
    Ok(found)
}

/// A state that was checked when it was read.
fn decode(batch: &EncodedStates, index: usize, manifest: &RunManifest) -> Option<ChainState> {
    let mut doubles = Vec::new();
    batch.decode(index, manifest, &mut doubles).ok().map(|frame| ChainState::of_frame(&frame))
}

/// Difference of the first state from the manifest's initial condition, if it should equal it.
fn initial_difference(manifest: &RunManifest, first: &ChainState) -> Option<Difference> {
    let is_initial = first.step == 0 && check_kernel(manifest).is_ok();
    let initial = is_initial.then(|| ChainState::initial(&manifest.physics))?;
    difference(&initial, &first.as_frame(manifest, 0), None)
}
