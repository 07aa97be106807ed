//! Batches of states, decoded and recomputed.

use super::MOST_DIFFERENCES;
use crate::integrator::Integrator;
use crate::resimulation::{Difference, check_kernel, difference};
use crate::state::ChainState;
use recording::{EncodedStates, SummaryChecker, SummaryDifference};
use schemas::manifest::RunManifest;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Mutex, PoisonError};

/// Results of a thread.
#[derive(Debug, Default)]
pub(super) struct Proof {
    pub(super) differences: Vec<Difference>,
    pub(super) difference_count: u64,
    pub(super) summary_differences: Vec<SummaryDifference>,
    pub(super) summary_difference_count: u64,
    /// The step after which states were not recomputed, if the thread was asked to stop.
    pub(super) stopped_after: Option<u64>,
}

impl Proof {
    pub(super) fn add(&mut self, other: Self) {
        self.differences.extend(other.differences);
        self.difference_count += other.difference_count;
        self.summary_differences.extend(other.summary_differences);
        self.summary_difference_count += other.summary_difference_count;
        self.stopped_after = self.stopped_after.into_iter().chain(other.stopped_after).min(); // integers
    }

    /// Sorts the results by steps, and keeps the first ones only.
    pub(super) fn sort(&mut self) {
        self.differences.sort_by_key(|wrong| wrong.step);
        self.summary_differences.sort_by_key(|wrong| wrong.step);
        self.summary_differences.truncate(MOST_DIFFERENCES);
    }

    fn differs(&mut self, wrong: Difference) {
        self.difference_count += 1;
        if self.differences.len() < MOST_DIFFERENCES {
            self.differences.push(wrong);
        }
    }

    fn summary_differs(&mut self, wrong: SummaryDifference) {
        self.summary_difference_count += 1;
        if self.summary_differences.len() < MOST_DIFFERENCES {
            self.summary_differences.push(wrong);
        }
    }
}

/// Recomputes batches until there are no more, and gives them back to `spent`.
pub(super) fn prove_batches(
    manifest: &RunManifest,
    batches: &Mutex<Receiver<EncodedStates>>,
    spent: &Sender<EncodedStates>,
    stop: &AtomicBool,
) -> Proof {
    let mut proving = Proving::new(manifest);
    loop {
        // a receiver is as good after a panic of another thread as before
        let Ok(batch) = batches.lock().unwrap_or_else(PoisonError::into_inner).recv() else {
            return proving.proof;
        };
        proving.prove(&batch, stop);
        // nobody takes it any more at the end
        let _ = spent.send(batch);
    }
}

/// The proof of one thread so far.
pub(super) struct Proving<'a> {
    manifest: &'a RunManifest,
    can_be_proven: bool,
    /// Made when there is something to prove: a file may claim many beads and hold no state of them.
    prover: Option<Prover<'a>>,
    pub(super) proof: Proof,
}

impl<'a> Proving<'a> {
    pub(super) fn new(manifest: &'a RunManifest) -> Self {
        // of another kernel version nothing can be recomputed
        let can_be_proven = check_kernel(manifest).is_ok();
        Self { manifest, can_be_proven, prover: None, proof: Proof::default() }
    }

    /// Recomputes a batch.
    pub(super) fn prove(&mut self, batch: &EncodedStates, stop: &AtomicBool) {
        if self.can_be_proven && !batch.is_empty() {
            let prover = self.prover.get_or_insert_with(|| Prover::new(self.manifest));
            prover.prove(batch, stop, &mut self.proof);
        }
    }
}

/// Goes on to `step`; false if it was asked to stop before.
pub(super) fn advance(
    integrator: &mut Integrator,
    state: &mut ChainState,
    step: u64,
    stop: &AtomicBool,
) -> bool {
    while state.step < step {
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        integrator.advance(state, step);
    }
    true
}

struct Prover<'a> {
    manifest: &'a RunManifest,
    checker: SummaryChecker,
    state: ChainState,
    doubles: Vec<f64>,
}

impl<'a> Prover<'a> {
    fn new(manifest: &'a RunManifest) -> Self {
        let state = ChainState::initial(&manifest.physics);
        let checker = SummaryChecker::new(manifest);
        Self { manifest, checker, state, doubles: Vec::new() }
    }

    /// Finds the states of `batch` that do not follow from the one before, and the summaries that do not match their
    /// states.
    fn prove(&mut self, batch: &EncodedStates, stop: &AtomicBool, proof: &mut Proof) {
        let mut integrator = Integrator::new(&self.manifest.physics);
        let mut from_step = None;
        for index in 0..batch.len() {
            // lengths were checked when it was read
            let Ok(frame) = batch.decode(index, self.manifest, &mut self.doubles) else { continue };
            if let Some(summary) = batch.summary(index)
                && let Some(wrong) = self.checker.check(&frame, summary)
            {
                proof.summary_differs(wrong);
            }
            if from_step.is_none() {
                self.state.copy_from(&frame);
            }
            let from = self.state.step;
            if !advance(&mut integrator, &mut self.state, frame.step, stop) {
                let stopped_after = proof.stopped_after.into_iter().chain([from]).min(); // integers
                proof.stopped_after = stopped_after;
                return;
            }
            if from_step.is_some()
                && let Some(wrong) = difference(&self.state, &frame, from_step)
            {
                proof.differs(wrong);
                // what follows may still follow from what is there
                self.state.copy_from(&frame);
                integrator = Integrator::new(&self.manifest.physics);
            }
            from_step = Some(frame.step);
        }
    }
}
