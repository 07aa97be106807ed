//! Threads that compute stretches of a run, and their results.

use super::Limits;
use crate::integrator::Integrator;
use crate::resimulation::{Difference, Lend, difference};
use crate::state::ChainState;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use std::io;
use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Steps to be computed: those between recorded states.
#[derive(Debug)]
pub(super) struct Stretch {
    /// The recorded states; each follows from the one before.
    pub(super) states: Vec<ChainState>,
    /// True if the first of them is lent, too.
    pub(super) lends_first: bool,
}

/// States one after the other, each `[u | v | extra]`.
#[derive(Debug, Default)]
pub(super) struct Block {
    steps: Vec<u64>,
    doubles: Vec<f64>,
}

/// A message from a thread about its stretch.
#[derive(Debug)]
pub(super) enum Piece {
    /// The next states.
    Block(Block),
    /// The next recorded state is wrong; nothing comes after this.
    Differs(Difference),
    /// The end of the stretch.
    Done,
}

/// The threads.
#[derive(Debug)]
pub(super) struct Workers {
    stretches: Option<Sender<(Stretch, SyncSender<Piece>)>>,
    threads: Vec<JoinHandle<()>>,
    shared: Arc<Shared>,
    /// Blocks of a stretch that may wait to be lent.
    waiting_blocks: usize,
    /// Stretches that have been handed out and not been lent to their end.
    in_work: usize,
}

/// State that all threads share.
#[derive(Debug)]
struct Shared {
    manifest: Arc<RunManifest>,
    lend: Lend,
    first_step: AtomicU64,
    block_doubles: usize,
    /// Blocks to be used again.
    spare: Mutex<Vec<Block>>,
    stop: AtomicBool,
}

impl Workers {
    pub(super) fn new(
        manifest: Arc<RunManifest>,
        lend: Lend,
        threads: NonZero<usize>,
        limits: &Limits,
    ) -> io::Result<Self> {
        let state_doubles = manifest.frame_doubles();
        let block_doubles = limits.block_doubles.max(state_doubles); // integers
        let share = limits.waiting_doubles / (threads.get() + 1) / block_doubles;
        let shared = Arc::new(Shared {
            manifest,
            lend,
            first_step: AtomicU64::new(0),
            block_doubles,
            spare: Mutex::default(),
            stop: AtomicBool::new(false),
        });
        let (sender, receiver) = channel();
        let receiver = Arc::new(Mutex::new(receiver));
        let work = || {
            let (shared, receiver) = (Arc::clone(&shared), Arc::clone(&receiver));
            move || shared.work(&receiver)
        };
        let first = std::thread::Builder::new().spawn(work())?;
        let more = (1..threads.get()).map_while(|_| std::thread::Builder::new().spawn(work()).ok());
        // where the system grants fewer threads, those compute everything
        let threads = std::iter::once(first).chain(more).collect();
        // one more is being filled
        let waiting_blocks = share.saturating_sub(1).max(1); // integers
        Ok(Self { stretches: Some(sender), threads, shared, waiting_blocks, in_work: 0 })
    }

    /// Sets the first step that is lent, before anything is handed out.
    pub(super) fn lend_from(&mut self, first_step: u64) {
        self.shared.first_step.store(first_step, Ordering::Relaxed);
    }

    /// True if another stretch can be taken: one more than there are threads.
    pub(super) fn have_room(&self) -> bool {
        self.in_work <= self.threads.len()
    }

    /// Starts computing a stretch and returns the receiver of its states.
    pub(super) fn take(&mut self, stretch: Stretch) -> Receiver<Piece> {
        let (sender, receiver) = sync_channel(self.waiting_blocks);
        self.in_work += 1;
        if let Some(stretches) = &self.stretches {
            // fails only if all threads have panicked, which the receiver finds out
            let _ = stretches.send((stretch, sender));
        }
        receiver
    }

    /// Notes that a stretch has been lent to its end.
    pub(super) fn done(&mut self) {
        self.in_work -= 1;
    }

    /// Takes a block to be used again.
    pub(super) fn give_back(&self, block: Block) {
        if block.doubles.capacity() > 0 {
            self.shared.spare().push(block);
        }
    }

    /// Stops the work on all stretches.
    pub(super) fn stop(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }

    /// Goes on with the panic of a thread that left its stretch undone. The work of the others must have been stopped,
    /// and nobody may wait for it.
    pub(super) fn resume_panic(&mut self) {
        self.stretches = None;
        for thread in self.threads.drain(..) {
            if let Err(panic) = thread.join() {
                std::panic::resume_unwind(panic);
            }
        }
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        self.stop();
        self.stretches = None;
        // each ends with its step, or with its block, which nobody receives any more
        for thread in self.threads.drain(..) {
            // the thread has reported its panic, or its waiter has resumed it
            let _ = thread.join();
        }
    }
}

/// Error: nobody wants the states that are being computed.
struct Unwanted;

impl Shared {
    fn spare(&self) -> MutexGuard<'_, Vec<Block>> {
        // a list of buffers is as good after a panic as before
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Computes stretches until there are no more.
    fn work(&self, stretches: &Mutex<Receiver<(Stretch, SyncSender<Piece>)>>) {
        loop {
            let next = stretches.lock().unwrap_or_else(PoisonError::into_inner).recv();
            let Ok((stretch, pieces)) = next else { return };
            let mut outlet = Outlet { shared: self, block: Block::default(), pieces };
            let last = match self.compute(&stretch, &mut outlet) {
                Ok(None) => Piece::Done,
                Ok(Some(difference)) => Piece::Differs(difference),
                Err(Unwanted) => continue,
            };
            if outlet.hand_over().is_ok() {
                // if it fails nobody wants it
                let _ = outlet.pieces.send(last);
            }
        }
    }

    /// Hands over the states of `stretch` up to its end or the first recorded state that is wrong.
    fn compute(&self, stretch: &Stretch, outlet: &mut Outlet<'_>) -> Result<Option<Difference>, Unwanted> {
        let Some((first, rest)) = stretch.states.split_first() else { return Ok(None) };
        let mut integrator = Integrator::new(&self.manifest.physics);
        let (mut state, mut from_step) = (first.clone(), first.step);
        if stretch.lends_first {
            outlet.put(&state)?;
        }
        for target in rest {
            while state.step < target.step {
                if self.stop.load(Ordering::Relaxed) {
                    return Err(Unwanted);
                }
                let next = self.lend.next(state.step, target.step, &self.manifest);
                integrator.advance(&mut state, next);
                if state.step < target.step {
                    outlet.put(&state)?;
                }
            }
            let frame = target.as_frame(&self.manifest, self.manifest.frame_at(target.step));
            if let Some(difference) = difference(&state, &frame, Some(from_step)) {
                return Ok(Some(difference));
            }
            outlet.put(&state)?;
            from_step = target.step;
        }
        Ok(None)
    }
}

/// Outlet of the states of a stretch.
struct Outlet<'a> {
    shared: &'a Shared,
    block: Block,
    pieces: SyncSender<Piece>,
}

impl Outlet<'_> {
    /// Puts the state into the block, if it is to be lent.
    fn put(&mut self, state: &ChainState) -> Result<(), Unwanted> {
        let Shared { manifest, lend, first_step, block_doubles, .. } = self.shared;
        if state.step < first_step.load(Ordering::Relaxed) || !lend.includes(state.step, manifest) {
            return Ok(());
        }
        if self.block.doubles.len() + manifest.frame_doubles() > *block_doubles {
            self.hand_over()?;
        }
        if self.block.doubles.capacity() == 0 {
            self.block = self.shared.spare().pop().unwrap_or_default();
            self.block.clear();
        }
        self.block.push(state);
        Ok(())
    }

    /// Hands over the states in the block.
    fn hand_over(&mut self) -> Result<(), Unwanted> {
        let block = std::mem::take(&mut self.block);
        if block.steps.is_empty() {
            return Ok(());
        }
        self.pieces.send(Piece::Block(block)).map_err(|_| Unwanted)
    }
}

impl Block {
    /// Number of states.
    pub(super) fn len(&self) -> usize {
        self.steps.len()
    }

    fn clear(&mut self) {
        self.steps.clear();
        self.doubles.clear();
    }

    fn push(&mut self, state: &ChainState) {
        self.steps.push(state.step);
        for values in [&state.u_m, &state.v_m_s, &state.extra] {
            self.doubles.extend_from_slice(values);
        }
    }

    /// State number `index` as a frame of `manifest`'s run, or under the number of the frame before it.
    pub(super) fn frame(&self, index: usize, manifest: &RunManifest) -> Frame<'_> {
        let (step, length) = (self.steps[index], manifest.frame_doubles());
        let beads = length / (2 + manifest.physics.extra_per_bead());
        let (u_m, rest) = self.doubles[index * length..][..length].split_at(beads);
        let (v_m_s, extra) = rest.split_at(beads);
        let (frame, time_s) = (manifest.frame_at(step), manifest.physics.time_s(step));
        Frame { frame, step, time_s, u_m, v_m_s, extra, active: None }.searched()
    }
}
