//! SIGINT, SIGTERM and SIGHUP ask for an orderly end; a second SIGINT or SIGTERM ends at once, and says what it leaves.
//!
//! A command looks at the flag as often as it can. Where libraries compute for seconds without a look, a command that leaves nothing
//! but results is ended all the same ([`bounded_stop_flag`]).

use rustix::time::{ClockId, clock_gettime};
use schemas::whole_file;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::{flag, low_level};
use std::fs;
use std::io::{self, ErrorKind, Read as _};
use std::ops::ControlFlow;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::Duration;

/// Text about things that stay behind if a second signal ends the process; one for the process, like signals.
static LEFT: Mutex<String> = Mutex::new(String::new());

/// The first flag of this process.
static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Longest computation after a signal that the process does not notice. It is time of a processor, so that a busy
/// machine ends nothing early.
const BOUND: Duration = Duration::from_millis(400);

/// Interval at which that computation is measured.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// Time of waiting for others on the bus after which a person is told.
const TOLD_AFTER: Duration = Duration::from_secs(2);

/// True if nothing but finished results would stay if the process ended now.
static LEAVES_NOTHING: AtomicBool = AtomicBool::new(false);

/// Sets whether nothing but finished results would stay if the process ended from now on. If so, a process that
/// computes for [`BOUND`] after the first signal is ended.
pub(crate) fn leaves_nothing(it_does: bool) {
    LEAVES_NOTHING.store(it_does, Ordering::Relaxed);
}

/// The flag of a command that leaves nothing but finished results all the time.
pub(crate) fn bounded_stop_flag() -> io::Result<Arc<AtomicBool>> {
    leaves_nothing(true);
    stop_flag()
}

/// Waits for the first signal and then for the second one, or until the process has computed for [`BOUND`] and leaves nothing.
fn watch(mut came: UnixStream) -> io::Result<()> {
    let mut byte = [0];
    // an end of the stream is no signal
    came.read_exact(&mut byte)?;
    let first = clock_gettime(ClockId::ProcessCPUTime);
    came.set_read_timeout(Some(LOOK_PERIOD))?;
    loop {
        match came.read_exact(&mut byte) {
            Ok(()) => end_at_once(),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                let computed = Duration::try_from(clock_gettime(ClockId::ProcessCPUTime) - first);
                if LEAVES_NOTHING.load(Ordering::Relaxed) && computed.is_ok_and(|computed| computed >= BOUND)
                {
                    leave();
                }
            }
            Err(error) => return Err(error),
        }
    }
}

/// Ends a process that leaves nothing.
fn leave() -> ! {
    whole_file::remove_unfinished();
    notice!("stopped in the middle of a computation; nothing is left but .partial files, if any");
    low_level::exit(3)
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
    let (came, coming) = UnixStream::pair()?;
    // it ends with the process
    let watch = move || drop(watch(came));
    let watched = thread::Builder::new().name("signals".into()).spawn(watch).is_ok();
    let stop = new_flag();
    for signal in [SIGINT, SIGTERM] {
        if watched {
            low_level::pipe::register(signal, coming.try_clone()?)?;
        } else {
            // in this order: the shutdown looks at the flag before this signal sets it
            flag::register_conditional_shutdown(signal, 1, Arc::clone(&stop))?;
        }
        flag::register(signal, Arc::clone(&stop))?;
    }
    obey_hangup(&stop)?;
    storage::stop_when(Arc::clone(&stop));
    Ok(stop)
}

/// A flag that every signal sets, for code that must act before a second one ends the process.
pub(crate) fn patient_stop_flag() -> io::Result<Arc<AtomicBool>> {
    let stop = new_flag();
    for signal in [SIGINT, SIGTERM] {
        flag::register(signal, Arc::clone(&stop))?;
    }
    obey_hangup(&stop)?;
    storage::stop_when(Arc::clone(&stop));
    Ok(stop)
}

fn new_flag() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let _ = STOP.set(Arc::clone(&stop));
    stop
}

/// A terminal that goes away asks for an orderly end, too, and more than once: the shell and the system tell of it.
fn obey_hangup(stop: &Arc<AtomicBool>) -> io::Result<()> {
    if !is_ignored(SIGHUP) {
        flag::register(SIGHUP, Arc::clone(stop))?;
    }
    Ok(())
}

/// True if the caller of this process, such as `nohup`, wants the signal to be ignored.
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask & (1 << (signal - 1)) != 0
}

/// Sets the text about things that stay behind if the process is ended at once from now on.
pub(crate) fn would_leave(what: String) {
    *LEFT.lock().unwrap_or_else(PoisonError::into_inner) = what;
}

/// Ends the process, and says what it leaves.
pub(crate) fn end_at_once() -> ! {
    let left = LEFT.lock().map(|left| left.clone()).unwrap_or_default();
    let left = if left.is_empty() { "nothing is left but .partial files, if any".to_owned() } else { left };
    notice!("ended at once, by a second signal; {left}");
    low_level::exit(1)
}
