//! Creates shared resources, one creator at a time, and removes half-made ones of killed creators.
//!
//! iceoryx2 waits for the creator of a service, and cannot know that it is dead. Here every creator holds a
//! lock that the kernel takes away from the dead: a half-made service has no creator while we hold the lock.

use super::services::{Class, Classify};
use super::{BusError, Ipc};
use iceoryx2::node::Node;
use iceoryx2::prelude::{Config, MessagingPattern, Service, ServiceName};
use iceoryx2::service::service_hash::ServiceHash;
use std::cell::RefCell;
use std::fs::{File, TryLockError};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::rc::{Rc, Weak};
use std::time::{Duration, Instant};

const LOCK_FILE: &str = "creating.lock";
/// How long all others together may hold the lock.
const LOCK_PATIENCE: Duration = Duration::from_secs(15);
/// The same if its holder was stopped, and may never go on.
const PATIENCE_WITH_STOPPED: Duration = Duration::from_millis(500);
/// How long a service may be in the middle of being created or removed.
const PATIENCE: Duration = Duration::from_secs(5);
/// How old a half-made service must be, and how long it must have been seen: other people's programs do not
/// take the lock, but need only milliseconds.
const STALE_AFTER: Duration = Duration::from_secs(1);
const PAUSE: Duration = Duration::from_millis(2);

/// Held while something is created on the bus. A thread that holds it may take it again.
pub(super) struct CreationLock(Rc<Held>);

struct Held {
    /// Closing it unlocks.
    _file: File,
    exclusive: bool,
}

thread_local! {
    /// What this thread holds.
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

    /// Whether nobody else is creating anything. False if the lock's holder was stopped and is not waited for:
    /// anything half-made may be its own.
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
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(Held { _file: file, exclusive: true }),
            Err(TryLockError::WouldBlock) if start.elapsed() >= LOCK_PATIENCE => {
                return Err(failed(&format!("another process has held it for {LOCK_PATIENCE:?}")));
            }
            Err(TryLockError::WouldBlock)
                if start.elapsed() >= PATIENCE_WITH_STOPPED && holder_is_stopped(&file) =>
            {
                return Ok(Held { _file: file, exclusive: false });
            }
            Err(TryLockError::Error(e)) if e.kind() != std::io::ErrorKind::Interrupted => {
                return Err(failed(&e));
            }
            Err(_) => std::thread::sleep(PAUSE),
        }
    }
}

/// Whether the process that holds the lock was stopped (SIGSTOP, Ctrl-Z), as far as the kernel tells.
fn holder_is_stopped(file: &File) -> bool {
    let Ok(inode) = file.metadata().map(|found| found.ino()) else { return false };
    let locks = std::fs::read_to_string("/proc/locks").unwrap_or_default();
    // `1: FLOCK  ADVISORY  WRITE 4711 00:2a:123 0 EOF`
    let holder = locks.lines().find_map(|line| {
        let mut fields = line.split_ascii_whitespace().skip(1);
        let is_flock = fields.next() == Some("FLOCK");
        let holder = fields.nth(2)?;
        let is_this = fields.next()?.rsplit(':').next()?.parse() == Ok(inode);
        (is_flock && is_this).then(|| holder.to_owned())
    });
    let stat = holder.and_then(|holder| std::fs::read_to_string(format!("/proc/{holder}/stat")).ok());
    let state = stat.as_ref().and_then(|stat| stat.rsplit(')').next()?.trim_start().chars().next());
    matches!(state, Some('T' | 't'))
}

pub(super) fn root_of(config: &Config) -> PathBuf {
    PathBuf::from(config.global.root_path().to_string())
}

/// Whether `path` is a file of ours that nobody has written for `age`.
fn is_stale(path: &Path, age: Duration) -> bool {
    let Ok(found) = std::fs::symlink_metadata(path) else { return false };
    let untouched = found.modified().ok().and_then(|at| at.elapsed().ok());
    let ours = found.uid() == rustix::process::getuid().as_raw();
    found.is_file() && ours && untouched.is_some_and(|untouched| untouched >= age)
}

/// A service that is to be there.
pub(super) struct Wanted<'a> {
    pub(super) node: &'a Node<Ipc>,
    pub(super) text: &'a str,
    pub(super) name: &'a ServiceName,
    pub(super) pattern: MessagingPattern,
}

impl Wanted<'_> {
    /// Opens the service, or creates it; returns whether it is new. An existing service keeps the limits it was
    /// created with.
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

    /// Removes the description of the service, by which it exists; its other parts have their own names.
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
