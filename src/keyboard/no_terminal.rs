//! Terminals of other systems, whose keys are not taken: runs and replays go on without.

use super::Key;
use crate::signals;
use std::convert::Infallible;
use std::io;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// The keys of a terminal: there are none.
pub(crate) struct Keyboard<K = Key>(Infallible, PhantomData<K>);

impl Keyboard {
    /// None, and a flag that the first signal sets.
    pub(crate) fn open() -> io::Result<(Option<Self>, Arc<AtomicBool>)> {
        Ok((None, signals::stop_flag()?))
    }
}

impl<K> Keyboard<K> {
    pub(crate) fn wait(&self, _: Duration) -> Option<K> {
        match self.0 {}
    }

    pub(crate) fn try_next(&self) -> Option<K> {
        match self.0 {}
    }
}
