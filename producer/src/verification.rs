//! Proving a recording: every state must be what the state before it leads to.
//!
//! The states are read once, in order, and handed in batches to threads that recompute the steps between
//! them. Memory is bounded by a few batches.

use crate::integrator::Integrator;
use crate::resimulation::{Difference, OtherKernel, check_kernel, difference};
use crate::state::ChainState;
use schemas::frame::{EndReason, FrameSource, Received};
use schemas::manifest::RunManifest;
use std::num::NonZero;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};

/// A batch covers at least this many steps, unless it has [`BATCH_DOUBLES`].
const BATCH_STEPS: u64 = 256;

/// A batch with this many doubles is full.
const BATCH_DOUBLES: usize = 1 << 19;

/// The differences that are kept; more are only counted.
pub const MOST_DIFFERENCES: usize = 20;

/// What a recording was found to be.
#[derive(Debug)]
pub struct Verification<E> {
    /// States read.
    pub state_count: u64,
    /// Step of the first state.
    pub first_step: Option<u64>,
    /// Step of the last state.
    pub last_step: Option<u64>,
    /// States that do not follow from the one before; the first ones, in order.
    pub differences: Vec<Difference>,
    /// How many there are.
    pub difference_count: u64,
    /// Frames that should be there but are not, from and up to.
    pub missing: Vec<(u64, u64)>,
    /// Why the states end.
    pub end: EndReason,
    /// Why they end before the recording does, if they do.
    pub failure: Option<E>,
}

impl<E> Verification<E> {
    /// Whether all is as it must be, from the first state to the end of the run.
    pub fn is_proven(&self) -> bool {
        self.is_proven_so_far() && self.end.is_orderly()
    }

    /// Whether what there is, is as it must be.
    pub fn is_proven_so_far(&self) -> bool {
        self.state_count > 0
            && self.difference_count == 0
            && self.missing.is_empty()
            && self.failure.is_none()
    }
}

/// Verifies the states of `source` with `threads` threads that recompute, beside this one that reads. `watch`
/// sees the step of each state that was read.
///
/// # Errors
/// When the run was computed by another dynamics.
pub fn verify<S: FrameSource>(
    source: &mut S,
    threads: NonZero<usize>,
    mut watch: impl FnMut(u64),
) -> Result<Verification<S::Error>, OtherKernel> {
    let manifest = source.manifest().clone();
    check_kernel(&manifest)?;
    let (sender, batches) = sync_channel(2 * threads.get());
    let batches = Mutex::new(batches);
    std::thread::scope(|scope| {
        let workers: Vec<_> =
            (0..threads.get()).map(|_| scope.spawn(|| prove_batches(&manifest, &batches))).collect();
        let mut found = read(source, &manifest, &sender, &mut watch);
        drop(sender);
        for worker in workers {
            // a thread that panicked has said why; the panic goes on here
            let (differences, count) = worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            found.differences.extend(differences);
            found.difference_count += count;
        }
        found.differences.sort_by_key(|difference| difference.step);
        found.differences.truncate(MOST_DIFFERENCES);
        Ok(found)
    })
}

/// Reads all states and hands them out in batches, of which each begins with the last state of the one before.
fn read<S: FrameSource>(
    source: &mut S,
    manifest: &RunManifest,
    batches: &SyncSender<Vec<ChainState>>,
    watch: &mut impl FnMut(u64),
) -> Verification<S::Error> {
    let mut found = Verification {
        state_count: 0,
        first_step: None,
        last_step: None,
        differences: Vec::new(),
        difference_count: 0,
        missing: Vec::new(),
        end: EndReason::Unfinished,
        failure: None,
    };
    let mut batch: Vec<ChainState> = Vec::new();
    // the threads live as long as this one sends
    let hand_out = |batch: Vec<ChainState>| {
        if batch.len() > 1 {
            let _ = batches.send(batch);
        }
    };
    loop {
        match source.receive() {
            Ok(Received::Frame(frame)) => {
                let state = ChainState::of_frame(&frame);
                watch(frame.step);
                found.state_count += 1;
                found.last_step = Some(frame.step);
                if found.first_step.is_none() {
                    found.first_step = Some(frame.step);
                    let initial = (frame.step == 0).then(|| ChainState::initial(&manifest.physics));
                    if let Some(wrong) = initial.and_then(|initial| difference(&initial, &frame, None)) {
                        found.differences.push(wrong);
                        found.difference_count += 1;
                    }
                }
                batch.push(state);
                let covered = frame.step - batch[0].step;
                if covered >= BATCH_STEPS || batch.len() * manifest.frame_doubles() >= BATCH_DOUBLES {
                    let next = batch[batch.len() - 1].clone();
                    hand_out(std::mem::replace(&mut batch, vec![next]));
                }
            }
            Ok(Received::Missed { from, to }) => found.missing.push((from, to)),
            Ok(Received::End(reason)) => {
                found.end = reason;
                break;
            }
            Err(error) => {
                found.failure = Some(error);
                break;
            }
        }
    }
    hand_out(batch);
    found
}

/// Recomputes batches until there are no more: the first differences, and how many there are.
fn prove_batches(
    manifest: &RunManifest,
    batches: &Mutex<Receiver<Vec<ChainState>>>,
) -> (Vec<Difference>, u64) {
    let (mut differences, mut count) = (Vec::new(), 0);
    loop {
        // a receiver is as good after a panic of another thread as before
        let batch = batches.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(batch) = batch else { return (differences, count) };
        for wrong in prove(manifest, &batch) {
            count += 1;
            if differences.len() < MOST_DIFFERENCES {
                differences.push(wrong);
            }
        }
    }
}

/// The states of `batch` that do not follow from the one before.
fn prove(manifest: &RunManifest, batch: &[ChainState]) -> Vec<Difference> {
    let mut differences = Vec::new();
    let Some((first, rest)) = batch.split_first() else { return differences };
    let mut integrator = Integrator::new(&manifest.physics);
    let (mut state, mut from_step) = (first.clone(), first.step);
    for target in rest {
        while state.step < target.step {
            integrator.step(&mut state);
        }
        let frame = target.as_frame(manifest, manifest.frame_at(target.step));
        if let Some(wrong) = difference(&state, &frame, Some(from_step)) {
            differences.push(wrong);
            // what follows may still follow from what is there
            state.clone_from(target);
            integrator = Integrator::new(&manifest.physics);
        }
        from_step = target.step;
    }
    differences
}
