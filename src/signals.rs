//! SIGINT, SIGTERM and SIGHUP ask for an orderly end; a second SIGINT or SIGTERM ends at once, and says what it leaves.
//!
//! A command looks at the flag as often as it can. Where libraries compute for seconds without a look, a command that leaves nothing
//! but results is ended all the same ([`bounded_stop_flag`]).

#[cfg(not(unix))]
#[path = "signals/unwatched.rs"]
mod watch;
#[cfg(unix)]
mod watch;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// Text about things that stay behind if a second signal ends the process; one for the process, like signals.
static LEFT: Mutex<String> = Mutex::new(String::new());

/// The first flag of this process.
static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Time of waiting for others on the bus after which a person is told.
const TOLD_AFTER: Duration = Duration::from_secs(2);

/// True if nothing but finished results would stay if the process ended now.
static LEAVES_NOTHING: AtomicBool = AtomicBool::new(false);

/// Sets whether nothing but finished results would stay if the process ended from now on. If so, a process that
/// computes on after the first signal is ended.
pub(crate) fn leaves_nothing(it_does: bool) {
    LEAVES_NOTHING.store(it_does, Ordering::Relaxed);
}

/// The flag of a command that leaves nothing but finished results all the time.
pub(crate) fn bounded_stop_flag() -> io::Result<Arc<AtomicBool>> {
    leaves_nothing(true);
    stop_flag()
}

/// Prints a notice about others on the bus that keep this process waiting. The wait goes on until the process is
/// asked to stop.
pub(crate) fn while_waiting(waiting: &bus::Waiting) -> ControlFlow<()> {
    static TOLD: AtomicBool = AtomicBool::new(false);
    if STOP.get().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
        return ControlFlow::Break(());
    }
    if waiting.waited >= TOLD_AFTER && !TOLD.swap(true, Ordering::Relaxed) {
        let holder = waiting.holder.map_or_else(String::new, |holder| format!(", now process {holder}"));
        notice!("waiting for others that start on this bus{holder} ({})", waiting.path.display());
    }
    ControlFlow::Continue(())
}

/// A flag that the first signal sets. The second one ends the process.
pub(crate) fn stop_flag() -> io::Result<Arc<AtomicBool>> {
    flag_of_signals(!watch::begin()?)
}

/// A flag that every signal sets, for code that must act before a second one ends the process.
pub(crate) fn patient_stop_flag() -> io::Result<Arc<AtomicBool>> {
    flag_of_signals(false)
}

/// A flag that every signal sets; with `shuts_down` the second one ends the process without a word.
fn flag_of_signals(shuts_down: bool) -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let _ = STOP.set(Arc::clone(&stop));
    for signal in [SIGINT, SIGTERM] {
        if shuts_down {
            // in this order: the shutdown looks at the flag before this signal sets it
            flag::register_conditional_shutdown(signal, 1, Arc::clone(&stop))?;
        }
        flag::register(signal, Arc::clone(&stop))?;
    }
    watch::obey_hangup(&stop)?;
    storage::stop_when(Arc::clone(&stop));
    Ok(stop)
}

/// Sets the text about things that stay behind if the process is ended at once from now on.
pub(crate) fn would_leave(what: String) {
    *LEFT.lock().unwrap_or_else(PoisonError::into_inner) = what;
}

/// Ends the process, and says what it leaves.
#[cfg(unix)]
pub(crate) fn end_at_once() -> ! {
    let left = LEFT.lock().map(|left| left.clone()).unwrap_or_default();
    let left = if left.is_empty() { "nothing is left but .partial files, if any".to_owned() } else { left };
    notice!("ended at once, by a second signal; {left}");
    signal_hook::low_level::exit(1)
}
