//! Looks after the bus while a process uses it: removes things that it could wait for, and notices a missing root.

use super::leftovers::{HalfMade, Removed};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between two looks.
const PERIOD: Duration = Duration::from_millis(250);
/// Longest time between two looks, when looks take long because many processes use the bus or the machine is busy.
const LONGEST_PERIOD: Duration = Duration::from_secs(2);
/// Looks take at most one part in `SHARE` of a core, until the period is the longest.
const SHARE: u32 = 200;

/// Thread that looks after the bus; it ends when this value is dropped.
pub(super) struct Warden {
    shared: Arc<(Mutex<State>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct State {
    ends: bool,
    root_is_gone: bool,
    removed: Removed,
}

/// Identity of a root; another root at the same path has another identity.
#[derive(PartialEq, Eq)]
struct Identity(Option<(u64, u64)>, Option<u64>);

impl Identity {
    fn of(root: &Path, secret: &Path) -> Self {
        let look = |path| std::fs::symlink_metadata(path).ok();
        Self(look(root).map(|found| (found.dev(), found.ino())), look(secret).map(|found| found.ino()))
    }
}

impl Warden {
    /// Starts the thread. If no thread can be started, nobody looks.
    pub(super) fn start(root: PathBuf, secret: PathBuf, prefix: String) -> Self {
        let shared: Arc<(Mutex<State>, Condvar)> = Arc::default();
        let watched = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("bus".into());
        let thread = thread.spawn(move || watch(&watched, &root, &secret, &prefix)).ok();
        Self { shared, thread }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.shared.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// True if somebody removed the root, or put another in its place.
    pub(super) fn root_is_gone(&self) -> bool {
        self.state().root_is_gone
    }

    /// Adds things that others in this process removed.
    pub(super) fn note(&self, removed: Removed) {
        self.state().removed.add(removed);
    }

    /// Leftovers removed since the last call.
    pub(super) fn take_removed(&self) -> Removed {
        std::mem::take(&mut self.state().removed)
    }
}

impl Drop for Warden {
    fn drop(&mut self) {
        self.state().ends = true;
        self.shared.1.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn watch(shared: &(Mutex<State>, Condvar), root: &Path, secret: &Path, prefix: &str) {
    let at_first = Identity::of(root, secret);
    let mut half_made = HalfMade::default();
    let mut state = shared.0.lock().unwrap_or_else(PoisonError::into_inner);
    while !state.ends {
        drop(state);
        let start = Instant::now();
        let removed = half_made.remove(prefix);
        let root_is_gone = Identity::of(root, secret) != at_first;
        let period = (start.elapsed() * SHARE).clamp(PERIOD, LONGEST_PERIOD);
        state = shared.0.lock().unwrap_or_else(PoisonError::into_inner);
        state.removed.add(removed);
        state.root_is_gone |= root_is_gone;
        if !state.ends {
            state = shared.1.wait_timeout(state, period).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}
