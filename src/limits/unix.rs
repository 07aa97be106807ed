//! The limits of a Unix system.

use anyhow::Error;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use schemas::amounts::bytes;
use signal_hook::consts::SIGABRT;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Files that a run with some consumers holds open.
const FILES_OF_A_RUN: u64 = 256;

/// Files that are asked for.
const MOST_FILES: u64 = 1 << 16;

/// Memory that is enough for most commands (bytes).
const MEMORY_OF_A_COMMAND: u64 = 1 << 30;

/// Niceness of a long computation beyond that of work that a user waits for: a tenth of its share of a core.
#[cfg(target_os = "linux")]
const PATIENT: i32 = 10;

/// True if stdout was closed when the process was started.
static STDOUT_WAS_CLOSED: AtomicBool = AtomicBool::new(false);

/// Looks at stdout before the standard library replaces it by `/dev/null`, where results would vanish without a
/// word.
extern "C" fn look_at_stdout() {
    let closed = rustix::io::fcntl_getfd(rustix::stdio::stdout()).is_err();
    STDOUT_WAS_CLOSED.store(closed, Ordering::Relaxed);
}

/// Has [`look_at_stdout`] called before `main`.
///
/// Safety: the section holds pointers to functions that take nothing they need, and this one makes one system call
/// and stores one flag; it uses nothing that the standard library sets up.
#[used]
#[expect(
    unsafe_code,
    reason = "nothing safe runs before the standard library has changed what is to be seen"
)]
#[cfg_attr(not(target_vendor = "apple"), unsafe(link_section = ".init_array"))]
#[cfg_attr(target_vendor = "apple", unsafe(link_section = "__DATA,__mod_init_func"))]
static BEFORE_MAIN: extern "C" fn() = look_at_stdout;

/// True if stdout is closed, so that results cannot be printed.
pub(crate) fn stdout_was_closed() -> bool {
    STDOUT_WAS_CLOSED.load(Ordering::Relaxed)
}

/// Raises the limit of open files, and makes running out of memory end in a sentence, which `told` makes a line of.
pub(crate) fn prepare(told: impl FnOnce(&str) -> String) {
    let files = getrlimit(Resource::Nofile);
    let wanted = files.maximum.map_or(MOST_FILES, |maximum| maximum.min(MOST_FILES));
    if files.current.is_some_and(|files| files < wanted) {
        // consumers need files; a limit that is too low is explained when it is met
        let _ = setrlimit(Resource::Nofile, Rlimit { current: Some(wanted), ..files });
    }
    let Some(limit) = getrlimit(Resource::As).current else { return };
    let line = told(&no_memory(limit)) + "\n";
    let end = Arc::new(move || {
        // whoever does not listen is not told
        let _ = rustix::io::write(rustix::stdio::stderr(), line.as_bytes());
        signal_hook::low_level::exit(1);
    });
    // the standard library panics where there is no room for the second stack of a new thread
    let (tell, end_thread) = (std::panic::take_hook(), Arc::clone(&end));
    std::panic::set_hook(Box::new(move |panic| {
        if panic.location().is_some_and(|at| at.file().ends_with("stack_overflow.rs")) {
            end_thread();
        }
        tell(panic);
    }));
    // Safety: the action makes two system calls and allocates nothing; it never returns.
    #[expect(unsafe_code, reason = "allocations that fail abort, and only a handler can still say why")]
    // without it the process is aborted, as by default
    let _ = unsafe { signal_hook::low_level::register(SIGABRT, move || end()) };
}

fn no_memory(limit: u64) -> String {
    format!(
        "there is not enough memory: this process may have {} (`ulimit -v`); allow more, or ask for less at a time \
         (fewer --jobs, a part by --from and --until)",
        bytes(limit)
    )
}

/// This thread, and those that it starts, compute when no other wants to.
pub(crate) fn compute_beside_others() {
    // elsewhere a process has one priority
    #[cfg(target_os = "linux")]
    // at best
    let _ = rustix::process::nice(PATIENT);
}

/// Adds to a failure the limit that may be its cause, if that is tight.
pub(crate) fn explain(error: Error) -> Error {
    let files = getrlimit(Resource::Nofile).current.filter(|files| *files < FILES_OF_A_RUN);
    if let Some(files) = files {
        return Error::msg(format!(
            "{error:#}; this process may have only {files} files open at a time, which may be the cause: allow \
             {FILES_OF_A_RUN} or more (`ulimit -n {FILES_OF_A_RUN}`)"
        ));
    }
    match getrlimit(Resource::As).current.filter(|limit| *limit < MEMORY_OF_A_COMMAND) {
        Some(limit) => Error::msg(format!(
            "{error:#}; this process may have only {} of memory (`ulimit -v`), which may be the cause: allow more",
            bytes(limit)
        )),
        None => error,
    }
}
