//! The bounded queue between the recording thread and the writing threads.

use super::block::Block;
use super::chunks::{Chunks, Due};
use std::io;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Chunks that several threads work on.
#[derive(Debug)]
pub(super) struct Queue {
    state: Mutex<State>,
    /// Signals that there is something to do, or an end.
    work: Condvar,
    /// Signals that something was written, or that writing failed.
    progress: Condvar,
}

#[derive(Debug)]
struct State {
    chunks: Chunks,
    phase: Phase,
    held_back: Duration,
}

#[derive(Debug)]
enum Phase {
    Recording,
    /// The waiting chunks are written, then no more.
    Ending,
    /// Nothing is written any more.
    GivenUp,
    /// Writing failed, and no caller knows it yet.
    Failed(io::Error),
}

/// Reason why the queue takes nothing more.
#[derive(Debug)]
pub(super) enum Refused {
    /// Writing failed, and this caller learns of it first.
    Failed {
        /// The operating system's error.
        source: io::Error,
        /// Frames that were accepted, but are not in the file.
        lost_frames: u64,
    },
    /// Writing failed before.
    GivenUp,
}

impl Queue {
    pub(super) fn new(chunks: Chunks) -> Self {
        let state = State { chunks, phase: Phase::Recording, held_back: Duration::ZERO };
        Self { state: Mutex::new(state), work: Condvar::new(), progress: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // a thread that panicked has said why, and its end is noticed by `fail`
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits while the queue is full, and then has `append` put records into the open chunk.
    pub(super) fn record(&self, append: impl FnOnce(&mut Chunks, Instant)) -> Result<(), Refused> {
        let mut now = Instant::now();
        let mut state = self.lock();
        if state.chunks.is_full() {
            state = self.wait(state, Chunks::is_full);
            state.held_back += now.elapsed();
            now = Instant::now();
        }
        state.check()?;
        let waiting = state.chunks.waiting_count();
        let was_open = state.chunks.is_open();
        append(&mut state.chunks, now);
        let closed = state.chunks.waiting_count() > waiting;
        // a thread must close the opened chunk in time
        if closed || !was_open {
            self.work.notify_one();
        }
        let at_once = state.chunks.options().flush_period.is_zero();
        drop(state);
        if at_once { self.flush() } else { Ok(()) }
    }

    /// Waits while `condition` holds and there is no error.
    fn wait<'a>(
        &self,
        mut state: MutexGuard<'a, State>,
        condition: impl Fn(&Chunks) -> bool,
    ) -> MutexGuard<'a, State> {
        while state.is_working() && condition(&state.chunks) {
            state = self.progress.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state
    }

    /// Closes the open chunk and waits until everything is in the file.
    pub(super) fn flush(&self) -> Result<(), Refused> {
        let mut state = self.lock();
        state.check()?;
        state.chunks.close();
        self.work.notify_all();
        self.wait(state, |chunks| chunks.waiting_count() > 0).check()
    }

    /// Has the threads write everything that waits, and end.
    pub(super) fn end(&self) {
        let mut state = self.lock();
        if matches!(state.phase, Phase::Recording) {
            state.chunks.close();
            state.phase = Phase::Ending;
        }
        self.work.notify_all();
    }

    /// Ends the threads without writing the waiting chunks.
    pub(super) fn give_up(&self) {
        let mut state = self.lock();
        state.chunks.give_up();
        state.phase = Phase::GivenUp;
        self.work.notify_all();
        self.progress.notify_all();
    }

    /// Waits for the next thing to do; none when a thread is to end.
    pub(super) fn next(&self) -> Option<Due> {
        let mut state = self.lock();
        loop {
            if !state.is_working() {
                return None;
            }
            let now = Instant::now();
            let until = match state.chunks.next(now) {
                Due::Nothing(_) if matches!(state.phase, Phase::Ending) => return None,
                Due::Nothing(until) => until,
                next => return Some(next),
            };
            state = match until {
                Some(until) => {
                    let period = until.saturating_duration_since(now);
                    self.work.wait_timeout(state, period).unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.work.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// Takes `block` back, which is in the file.
    pub(super) fn written(&self, block: Block) {
        self.lock().chunks.written(block);
        self.progress.notify_all();
    }

    /// Notes that writing failed: the queue takes nothing more.
    pub(super) fn fail(&self, error: io::Error) {
        let mut state = self.lock();
        // the first error is the cause of the others
        if state.is_working() {
            state.phase = Phase::Failed(error);
            state.chunks.give_up();
        }
        self.work.notify_all();
        self.progress.notify_all();
    }

    /// Fails if writing failed before.
    pub(super) fn check(&self) -> Result<(), Refused> {
        self.lock().check()
    }

    /// Bytes recorded and not yet in the file.
    pub(super) fn pending_bytes(&self) -> u64 {
        self.lock().chunks.pending_bytes()
    }

    /// Time spent waiting until there was room.
    pub(super) fn held_back(&self) -> Duration {
        self.lock().held_back
    }
}

impl State {
    fn is_working(&self) -> bool {
        matches!(self.phase, Phase::Recording | Phase::Ending)
    }

    /// Hands an error out once.
    fn check(&mut self) -> Result<(), Refused> {
        if self.is_working() {
            return Ok(());
        }
        match std::mem::replace(&mut self.phase, Phase::GivenUp) {
            Phase::Failed(source) => {
                Err(Refused::Failed { source, lost_frames: self.chunks.unwritten_frames() })
            }
            _ => Err(Refused::GivenUp),
        }
    }
}
