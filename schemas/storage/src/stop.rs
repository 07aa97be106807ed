//! Whoever waits for a store stops waiting when the program is asked to stop.

use std::cell::Cell;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

/// The flag that asks the program to stop; one for the process, like its signals.
static ASKED: Mutex<Option<Arc<AtomicBool>>> = Mutex::new(None);

thread_local! {
    /// True in a thread that finishes its work after a stop.
    static IS_PATIENT: Cell<bool> = const { Cell::new(false) };
}

/// Lets every thread that waits for a store give up when `flag` is set, except for threads that send recordings.
pub fn stop_when(flag: Arc<AtomicBool>) {
    *ASKED.lock().unwrap_or_else(PoisonError::into_inner) = Some(flag);
}

/// Lets this thread go on after the program was asked to stop.
pub(crate) fn be_patient() {
    IS_PATIENT.set(true);
}

/// True if this thread is to wait no longer.
#[cfg(feature = "remote")]
pub(crate) fn is_asked() -> bool {
    let asked = || ASKED.lock().unwrap_or_else(PoisonError::into_inner).clone();
    !IS_PATIENT.get() && asked().is_some_and(|flag| flag.load(std::sync::atomic::Ordering::Relaxed))
}
