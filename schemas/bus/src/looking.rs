//! Threads that look for publishers, awaited.

use std::convert::Infallible;
use std::sync::mpsc::{Sender, channel};

/// The promise of a thread to look for a publisher, kept when it is dropped.
#[derive(Debug, Clone)]
pub struct Looking {
    #[expect(dead_code, reason = "nothing is sent: its end is the message")]
    kept: Sender<Infallible>,
}

impl Looking {
    /// Lets `start` give the promise to threads, and waits until all of them have kept it.
    pub fn awaited(start: impl FnOnce(&Self)) {
        let (kept, all_kept) = channel();
        let looking = Self { kept };
        start(&looking);
        drop(looking);
        let _ = all_kept.recv();
    }
}
