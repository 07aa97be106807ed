//! Recomputing on several threads: each takes a stretch between recorded states.

mod stretch;

use super::{Difference, Lend, OtherKernel, ResimulationError, check_kernel, difference};
use crate::state::ChainState;
use schemas::frame::{EndReason, Frame, FrameSource, Received};
use schemas::manifest::RunManifest;
use std::collections::VecDeque;
use std::io;
use std::num::NonZero;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;
use stretch::{Block, Piece, Stretch, Workers};

/// Several threads are faster for a recording with at most one state in this many steps. If states are closer, reading
/// and handing them over takes longer than computing them.
const FEW_STATES_STEPS: u64 = 8;

/// Interval at which a thread that waits for states checks for a request to stop.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// Limits of the memory.
#[derive(Debug, Clone, Copy)]
struct Limits {
    /// Fewest steps of a stretch, unless its recorded states have [`Self::stretch_doubles`].
    stretch_steps: u64,
    /// The doubles of the recorded states of a stretch, or two states.
    stretch_doubles: usize,
    /// The doubles of the recomputed states that are handed over at once, or one state.
    block_doubles: usize,
    /// The doubles of all recomputed states that wait to be lent, or two blocks for each stretch.
    waiting_doubles: usize,
}

impl Default for Limits {
    fn default() -> Self {
        // 4 MiB, 1 MiB and 128 MiB
        Self {
            stretch_steps: 256,
            stretch_doubles: 1 << 19,
            block_doubles: 1 << 17,
            waiting_doubles: 1 << 24,
        }
    }
}

/// A [`Resimulation`](super::Resimulation) that ends with the last state, computed ahead by several threads: the
/// same states in the same order, the same gaps, errors and end.
///
/// It reads its source ahead, so that it suits files and not live runs. At most one stretch more than there are
/// threads is in work. Memory is bounded: 128 MiB of recomputed states, or two blocks for each stretch if that is more
/// (a block is 1 MiB, or one state), and 4 MiB of recorded states for each stretch, or two of them. A stretch whose
/// states do not fit into its share is computed while it is being lent.
#[derive(Debug)]
pub struct ParallelResimulation<S: FrameSource> {
    source: S,
    limits: Limits,
    /// The next states, in order. Dropped before the workers, so that none waits for room in it.
    upcoming: VecDeque<Upcoming<S::Error>>,
    workers: Workers,
    /// The recorded states of the next stretch so far; the first is the last one of the stretch before.
    states: Vec<ChainState>,
    /// True if the first of them has not been handed out before.
    is_first: bool,
    /// The frames that were missed since the last state.
    missed: Option<(u64, u64)>,
    /// States to be lent, with the number of those that have been.
    block: Block,
    lent_count: usize,
    /// Ends the source when it is set.
    stop: Option<Arc<AtomicBool>>,
}

/// Reason why several threads do not recompute.
#[derive(Debug, thiserror::Error)]
pub enum ParallelError {
    /// The run was computed by another dynamics.
    #[error(transparent)]
    Kernel(#[from] OtherKernel),
    /// The system grants no thread.
    #[error("no thread can be started; allow more processes (`ulimit -u`), or recompute with --jobs 1")]
    NoThread(#[source] io::Error),
}

#[derive(Debug)]
enum Upcoming<E> {
    /// States, as they are computed.
    States(Receiver<Piece>),
    /// Missing frames, with nothing to compute them from.
    Missed {
        from: u64,
        to: u64,
    },
    Differs(Difference),
    /// The source failed; it is asked again after this.
    Failed(E),
    End(EndReason),
}

impl<S: FrameSource> ParallelResimulation<S> {
    /// Lends everything from the first state that `source` delivers, with `threads` threads that recompute,
    /// beside this one that reads and lends.
    ///
    /// # Errors
    /// When the run was computed by another dynamics, or the system grants no thread.
    pub fn new(source: S, lend: Lend, threads: NonZero<usize>) -> Result<Self, ParallelError> {
        Self::with_limits(source, lend, threads, Limits::default())
    }

    /// Lends everything from step 0, whenever the source begins.
    ///
    /// # Errors
    /// As [`ParallelResimulation::new`].
    pub fn from_start(source: S, lend: Lend, threads: NonZero<usize>) -> Result<Self, ParallelError> {
        Ok(Self::new(source, lend, threads)?.with_initial_state())
    }

    /// True if several threads are faster than one with the recordings of `manifest`: with sparse ones.
    pub fn pays(manifest: &RunManifest) -> bool {
        manifest.provenance.record_every_steps >= FEW_STATES_STEPS
    }

    /// The initial state comes first, like a state that the source delivers.
    fn with_initial_state(mut self) -> Self {
        self.states.push(ChainState::initial(&self.source.manifest().physics));
        self
    }

    fn with_limits(
        source: S,
        lend: Lend,
        threads: NonZero<usize>,
        limits: Limits,
    ) -> Result<Self, ParallelError> {
        check_kernel(source.manifest())?;
        let workers = Workers::new(Arc::new(source.manifest().clone()), lend, threads, &limits)
            .map_err(ParallelError::NoThread)?;
        Ok(Self {
            source,
            limits,
            upcoming: VecDeque::new(),
            workers,
            states: Vec::new(),
            is_first: true,
            missed: None,
            block: Block::default(),
            lent_count: 0,
            stop: None,
        })
    }

    /// Lends nothing before step `first_step`: earlier states of the source only serve to compute.
    #[must_use]
    pub fn lending_from(mut self, first_step: u64) -> Self {
        self.workers.lend_from(first_step);
        self
    }

    /// As [`Resimulation::stopped_by`](super::Resimulation::stopped_by).
    #[must_use]
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Self {
        Self { stop: Some(stop), ..self }
    }

    /// The next piece of a stretch; none if the source is to stop before the piece is there.
    fn next_piece(&self, pieces: &Receiver<Piece>) -> Option<Result<Piece, RecvTimeoutError>> {
        loop {
            match pieces.recv_timeout(LOOK_PERIOD) {
                Err(RecvTimeoutError::Timeout) if self.is_stopped() => return None,
                Err(RecvTimeoutError::Timeout) => {}
                received => return Some(received),
            }
        }
    }

    fn is_stopped(&self) -> bool {
        self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    /// Reads until all threads have enough to do, or the source delivers nothing for now.
    fn read_ahead(&mut self) {
        while self.workers.have_room() && !matches!(self.upcoming.back(), Some(last) if last.ends_reading()) {
            match self.source.receive() {
                Ok(Received::Frame(frame)) => {
                    self.missed = None;
                    match self.states.last() {
                        // the initial state was lent before
                        Some(last) if last.step == frame.step => {
                            if let Some(difference) = difference(last, &frame, None) {
                                self.hand_out();
                                self.upcoming.push_back(Upcoming::Differs(difference));
                            }
                        }
                        _ => {
                            self.states.push(ChainState::of_frame(&frame));
                            if self.is_enough() {
                                self.hand_out();
                            }
                        }
                    }
                }
                Ok(Received::Missed { from, to }) if self.states.is_empty() => {
                    self.upcoming.push_back(Upcoming::Missed { from, to });
                }
                Ok(Received::Missed { from, to }) => self.missed = Some((from, to)),
                Ok(Received::End(reason)) => {
                    self.hand_out();
                    let missed = self.missed.take();
                    self.upcoming.extend(missed.map(|(from, to)| Upcoming::Missed { from, to }));
                    self.upcoming.push_back(Upcoming::End(reason));
                }
                Err(error) => {
                    self.hand_out();
                    self.upcoming.push_back(Upcoming::Failed(error));
                }
            }
        }
    }

    /// True if the recorded states read so far are enough for a stretch.
    fn is_enough(&self) -> bool {
        let (Some(first), Some(last)) = (self.states.first(), self.states.last()) else { return false };
        let doubles = self.states.len() * self.source.manifest().frame_doubles();
        let many = self.states.len() > 1 && doubles >= self.limits.stretch_doubles;
        many || last.step - first.step >= self.limits.stretch_steps
    }

    /// Hands out the steps between the recorded states read so far, to be computed.
    fn hand_out(&mut self) {
        let Some(last) = self.states.last() else { return };
        if self.states.len() > 1 || self.is_first {
            let next = last.clone();
            let states = std::mem::replace(&mut self.states, vec![next]);
            let stretch = Stretch { states, lends_first: self.is_first };
            self.upcoming.push_back(Upcoming::States(self.workers.take(stretch)));
            self.is_first = false;
        }
    }

    /// Gets the next states to lend, or the reason why there are none.
    fn advance(&mut self) -> Result<Option<Received<'static>>, ResimulationError<S::Error>> {
        self.workers.give_back(std::mem::take(&mut self.block));
        self.lent_count = 0;
        self.read_ahead();
        match self.upcoming.pop_front() {
            Some(Upcoming::States(pieces)) => match self.next_piece(&pieces) {
                Some(Ok(Piece::Block(block))) => {
                    self.block = block;
                    self.upcoming.push_front(Upcoming::States(pieces));
                }
                Some(Ok(Piece::Differs(difference))) => return self.refuse(difference),
                Some(Ok(Piece::Done)) => self.workers.done(),
                None => {
                    self.upcoming.push_front(Upcoming::States(pieces));
                    return Ok(Some(Received::End(EndReason::Stopped)));
                }
                Some(Err(_)) => {
                    // so that no thread waits for room in a queue that nobody reads any more
                    self.workers.stop();
                    self.upcoming.clear();
                    self.workers.resume_panic();
                }
            },
            Some(Upcoming::Missed { from, to }) => return Ok(Some(Received::Missed { from, to })),
            Some(Upcoming::Differs(difference)) => return self.refuse(difference),
            Some(Upcoming::Failed(error)) => return Err(ResimulationError::Source(error)),
            Some(Upcoming::End(reason)) => {
                self.upcoming.push_front(Upcoming::End(reason));
                return Ok(Some(Received::End(reason)));
            }
            None => {}
        }
        Ok(None)
    }

    /// Ends the stream at a wrong state: nothing after it is trusted.
    fn refuse<T>(&mut self, difference: Difference) -> Result<T, ResimulationError<S::Error>> {
        self.workers.stop();
        self.upcoming.clear();
        self.upcoming.push_back(Upcoming::End(EndReason::Unfinished));
        Err(ResimulationError::Differs(difference))
    }

    /// State number `lent_count` of the block, before this one was counted.
    fn lend(&self) -> Frame<'_> {
        let manifest = self.source.manifest();
        self.block.frame(self.lent_count - 1, manifest)
    }
}

impl<E> Upcoming<E> {
    fn ends_reading(&self) -> bool {
        matches!(self, Self::Differs(_) | Self::Failed(_) | Self::End(_))
    }
}

impl<S: FrameSource> FrameSource for ParallelResimulation<S> {
    type Error = ResimulationError<S::Error>;

    fn manifest(&self) -> &RunManifest {
        self.source.manifest()
    }

    fn receive(&mut self) -> Result<Received<'_>, Self::Error> {
        while self.lent_count == self.block.len() {
            if let Some(other) = self.advance()? {
                return Ok(other);
            }
        }
        self.lent_count += 1;
        Ok(Received::Frame(self.lend()))
    }
}

#[cfg(test)]
mod tests;
