//! A thread that watches the signals of a Unix system.

use super::{LEAVES_NOTHING, end_at_once};
use rustix::time::{ClockId, clock_gettime};
use schemas::whole_file;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::{flag, low_level};
use std::fs;
use std::io::{self, ErrorKind, Read as _};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Longest computation after a signal that the process does not notice. It is time of a processor, so that a busy
/// machine ends nothing early.
const BOUND: Duration = Duration::from_millis(400);

/// Interval at which that computation is measured.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// Begins to watch; false if the system grants no thread.
pub(super) fn begin() -> io::Result<bool> {
    let (came, coming) = UnixStream::pair()?;
    // it ends with the process
    let watch = move || drop(watch(came));
    if thread::Builder::new().name("signals".into()).spawn(watch).is_err() {
        return Ok(false);
    }
    for signal in [SIGINT, SIGTERM] {
        low_level::pipe::register(signal, coming.try_clone()?)?;
    }
    Ok(true)
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

/// A terminal that goes away asks for an orderly end, too, and more than once: the shell and the system tell of it.
pub(super) fn obey_hangup(stop: &Arc<AtomicBool>) -> io::Result<()> {
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

/// Ends a process that leaves nothing.
fn leave() -> ! {
    whole_file::remove_unfinished();
    notice!("stopped in the middle of a computation; nothing is left but .partial files, if any");
    low_level::exit(3)
}
