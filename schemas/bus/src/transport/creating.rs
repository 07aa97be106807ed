//! Creates shared resources, one creator at a time, and removes half-made ones of killed creators.
//!
//! iceoryx2 waits for the creator of a service, and cannot know that it is dead. Here every creator holds a
//! lock that the kernel takes away from the dead: a half-made service has no creator while we hold the lock.

use super::Ipc;
use super::services::{Class, Classify};
use crate::{BusError, Waiting};
use iceoryx2::node::Node;
use iceoryx2::prelude::{Config, MessagingPattern, Service, ServiceName};
use iceoryx2::service::service_hash::ServiceHash;
use std::cell::RefCell;
use std::fs::{File, TryLockError};
use std::ops::ControlFlow;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::rc::{Rc, Weak};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

const LOCK_FILE: &str = "creating.lock";
/// Longest time that one process may hold the lock. A start holds it for some milliseconds, or while it takes the memory of a large run.
const LOCK_PATIENCE: Duration = Duration::from_secs(15);
/// Longest wait for the lock, over all of its holders: thousands of starts at once.
const LONGEST_WAIT: Duration = Duration::from_mins(2);
/// Time between two looks for the holder of the lock, while waiting for it.
const LOOK_PERIOD: Duration = Duration::from_millis(100);
/// Shortest and longest pause between two tries to take the lock. The pause grows with the wait, so that many waiting
/// processes do not keep the cores busy.
const LOCK_PAUSES: [Duration; 2] = [Duration::from_millis(1), Duration::from_millis(20)];
/// Longest wait for a stopped process that holds the lock: it may never go on.
const PATIENCE_WITH_STOPPED: Duration = Duration::from_millis(500);
/// Longest time that a service may be in the middle of being created or removed.
const PATIENCE: Duration = Duration::from_secs(5);
/// Least age of a half-made service that may be removed, and least time for which it must have been seen. Other
/// people's programs do not take the lock, but need only milliseconds.
const STALE_AFTER: Duration = Duration::from_secs(1);
const PAUSE: Duration = Duration::from_millis(2);

/// Function that is called during waits; one for the process, like the signals that the function may look at.
static WHILE_WAITING: OnceLock<fn(&Waiting) -> ControlFlow<()>> = OnceLock::new();

/// Sets the function that is called some ten times a second while this process waits for others that create something
/// on the bus. If the function returns `Break`, the wait ends with [`BusError::Stopped`]. Only the first call of
/// `while_waiting` counts.
pub fn while_waiting(ask: fn(&Waiting) -> ControlFlow<()>) {
    let _ = WHILE_WAITING.set(ask);
}

/// Lock that is held while something is created on the bus. A thread that holds it may take it again.
pub(super) struct CreationLock(Rc<Held>);

struct Held {
    /// Lock file; closing it unlocks.
    _file: File,
    exclusive: bool,
}

thread_local! {
    /// Locks that this thread holds.
    static HELD: RefCell<Vec<(PathBuf, Weak<Held>)>> = const { RefCell::new(Vec::new()) };
}

impl CreationLock {
    pub(super) fn take(root: &Path) -> Result<Self, BusError> {
        let path = root.join(LOCK_FILE);
        HELD.with_borrow_mut(|all| {
            all.retain(|(_, held)| held.strong_count() > 0);
            let ours = all.iter().find(|(held, _)| *held == path).and_then(|(_, held)| held.upgrade());
            if let Some(held) = ours {
                return Ok(Self(held));
            }
            let held = Rc::new(lock(&path)?);
            all.push((path, Rc::downgrade(&held)));
            Ok(Self(held))
        })
    }

    /// True if nobody else is creating anything. False if the lock's holder is a stopped process that we did not wait
    /// for: anything half-made may belong to that process.
    pub(super) fn is_exclusive(&self) -> bool {
        self.0.exclusive
    }
}

fn lock(path: &Path) -> Result<Held, BusError> {
    let failed = |e: &dyn std::fmt::Display| BusError::Locked { path: path.to_owned(), cause: e.to_string() };
    let mut options = File::options();
    let file = options.write(true).create(true).truncate(false).mode(0o600).open(path);
    let file = file.map_err(|e| failed(&e))?;
    let start = Instant::now();
    let (mut looked, mut holder, mut held_since) = (start, None, start);
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(Held { _file: file, exclusive: true }),
            Err(TryLockError::Error(e)) if e.kind() != std::io::ErrorKind::Interrupted => {
                return Err(failed(&e));
            }
            Err(_) => {}
        }
        let waited = start.elapsed();
        if looked.elapsed() >= LOOK_PERIOD {
            looked = Instant::now();
            let found = holder_of(&file);
            if found != holder {
                // others come and go
                (holder, held_since) = (found, looked);
            }
            if waited >= PATIENCE_WITH_STOPPED && holder.is_some_and(is_stopped) {
                return Ok(Held { _file: file, exclusive: false });
            }
            let waiting = Waiting { path: path.to_owned(), holder, waited };
            if WHILE_WAITING.get().is_some_and(|ask| ask(&waiting).is_break()) {
                return Err(BusError::Stopped);
            }
            if held_since.elapsed() >= LOCK_PATIENCE {
                let who = holder.map_or("another process".to_owned(), |holder| format!("process {holder}"));
                return Err(failed(&format!("{who} has held it for {LOCK_PATIENCE:?}")));
            }
        }
        if waited >= LONGEST_WAIT {
            return Err(failed(&format!("one process after the other has held it for {LONGEST_WAIT:?}")));
        }
        let [shortest, longest] = LOCK_PAUSES;
        std::thread::sleep((waited / 16).clamp(shortest, longest));
    }
}

/// Process that holds the lock, as far as the kernel tells.
fn holder_of(file: &File) -> Option<u32> {
    let inode = file.metadata().ok()?.ino();
    let locks = std::fs::read_to_string("/proc/locks").ok()?;
    // `1: FLOCK  ADVISORY  WRITE 4711 00:2a:123 0 EOF`
    locks.lines().find_map(|line| {
        let mut fields = line.split_ascii_whitespace().skip(1);
        let is_flock = fields.next() == Some("FLOCK");
        let holder = fields.nth(2)?.parse().ok()?;
        let is_this = fields.next()?.rsplit(':').next()?.parse() == Ok(inode);
        (is_flock && is_this).then_some(holder)
    })
}

/// True if the process was stopped (SIGSTOP, Ctrl-Z).
fn is_stopped(process: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    matches!(stat.rsplit(')').next().and_then(|state| state.trim_start().chars().next()), Some('T' | 't'))
}

pub(super) fn root_of(config: &Config) -> PathBuf {
    PathBuf::from(config.global.root_path().to_string())
}

/// True if `path` is a file of ours that nobody has written for `age`.
fn is_stale(path: &Path, age: Duration) -> bool {
    let Ok(found) = std::fs::symlink_metadata(path) else { return false };
    let untouched = found.modified().ok().and_then(|at| at.elapsed().ok());
    let ours = found.uid() == rustix::process::getuid().as_raw();
    found.is_file() && ours && untouched.is_some_and(|untouched| untouched >= age)
}

/// Service to be opened or created.
pub(super) struct Wanted<'a> {
    pub(super) node: &'a Node<Ipc>,
    pub(super) text: &'a str,
    pub(super) name: &'a ServiceName,
    pub(super) pattern: MessagingPattern,
}

impl Wanted<'_> {
    /// Opens the service, or creates it; returns it, and true if it is new. An existing service keeps the limits it
    /// was created with.
    pub(super) fn open_or_create<T, O: Classify, C: Classify>(
        &self,
        try_open: impl Fn() -> Result<T, O>,
        try_create: impl Fn() -> Result<T, C>,
    ) -> Result<(T, bool), BusError> {
        let failed = |doing, e: &dyn std::fmt::Debug| BusError::service(self.text, doing, e);
        match try_open() {
            Ok(service) => return Ok((service, false)),
            Err(e) if e.class() == Class::Refused => return Err(failed("open", &e)),
            Err(_) => {}
        }
        let lock = CreationLock::take(&root_of(self.node.config()))?;
        let start = Instant::now();
        let mut broken_since: Option<Instant> = None;
        loop {
            let (class, error) = match try_open() {
                Ok(service) => return Ok((service, false)),
                Err(e) if e.class() == Class::Missing => match try_create() {
                    Ok(service) => return Ok((service, true)),
                    Err(e) => (e.class(), failed("create", &e)),
                },
                Err(e) => (e.class(), failed("open", &e)),
            };
            match class {
                Class::Refused => return Err(error),
                Class::Interrupted => broken_since = None,
                Class::Missing | Class::Exists | Class::Broken => {
                    let since = *broken_since.get_or_insert_with(Instant::now);
                    if since.elapsed() >= STALE_AFTER && lock.is_exclusive() && self.remove_half_made() {
                        broken_since = None;
                    }
                }
            }
            if start.elapsed() >= PATIENCE {
                return Err(error);
            }
            std::thread::sleep(PAUSE);
        }
    }

    /// Removes the description of the service; without it the service does not exist. The other parts have names of their own.
    fn remove_half_made(&self) -> bool {
        let path = self.description();
        is_stale(&path, STALE_AFTER) && std::fs::remove_file(path).is_ok()
    }

    fn description(&self) -> PathBuf {
        let global = &self.node.config().global;
        let hash = ServiceHash::new::<<Ipc as Service>::ServiceNameHasher>(self.name, self.pattern);
        let suffix = &global.service.static_config_storage_suffix;
        let name = format!("{}{}{suffix}", global.prefix, hash.as_str());
        Path::new(&global.service_dir().to_string()).join(name)
    }
}
