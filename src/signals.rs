//! SIGINT, SIGTERM and SIGHUP ask for an orderly end; a second SIGINT or SIGTERM ends at once, and says what it leaves.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::{flag, low_level};
use std::fs;
use std::io::{self, Read as _};
use std::os::unix::net::UnixStream;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

/// What stays behind if a second signal ends the process; one for the process, like signals.
static LEFT: Mutex<String> = Mutex::new(String::new());

/// A flag that the first signal sets. The second one ends the process.
pub(crate) fn stop_flag() -> io::Result<Arc<AtomicBool>> {
    let (mut came, coming) = UnixStream::pair()?;
    let watch = move || {
        let mut byte = [0];
        // an end of the stream is no signal
        if came.read_exact(&mut byte).is_ok() && came.read_exact(&mut byte).is_ok() {
            end_at_once();
        }
    };
    let watched = thread::Builder::new().name("signals".into()).spawn(watch).is_ok();
    let stop = Arc::new(AtomicBool::new(false));
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
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        flag::register(signal, Arc::clone(&stop))?;
    }
    obey_hangup(&stop)?;
    storage::stop_when(Arc::clone(&stop));
    Ok(stop)
}

/// A terminal that goes away asks for an orderly end, too, and more than once: the shell and the system tell of it.
fn obey_hangup(stop: &Arc<AtomicBool>) -> io::Result<()> {
    if !is_ignored(SIGHUP) {
        flag::register(SIGHUP, Arc::clone(stop))?;
    }
    Ok(())
}

/// Whether whoever started us, such as `nohup`, wants the signal to be ignored.
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask & (1 << (signal - 1)) != 0
}

/// Says what stays behind if the process is ended at once from now on.
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
