//! Creating what processes share, one creator at a time, and taking away what a killed one left half-made.
//!
//! iceoryx2 waits for whoever is creating a service, and cannot know that nobody is. Here every creator holds a
//! lock that the kernel takes away from the dead: what is half-made while we hold it has no creator.

use super::services::{Class, Classify};
use super::{BusError, Ipc};
use iceoryx2::node::Node;
use iceoryx2::prelude::{Config, MessagingPattern, Service, ServiceName};
use iceoryx2::service::service_hash::ServiceHash;
use std::fs::{File, TryLockError};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const LOCK_FILE: &str = "creating.lock";
/// How long others may hold the lock, all together.
const LOCK_PATIENCE: Duration = Duration::from_secs(15);
/// How long a service may be in the middle of being created or removed.
const PATIENCE: Duration = Duration::from_secs(5);
/// How old what is half-made must be, and how long it must have been seen: programs that are not ours do not
/// take the lock, but need only milliseconds.
const STALE_AFTER: Duration = Duration::from_secs(1);
const SEGMENT_STALE_AFTER: Duration = Duration::from_secs(2);
const SEGMENTS: &str = "/dev/shm";
const PAUSE: Duration = Duration::from_millis(2);

/// Held while something is created on the bus.
pub(super) struct CreationLock(#[expect(dead_code, reason = "closing it unlocks")] File);

impl CreationLock {
    pub(super) fn take(root: &Path) -> Result<Self, BusError> {
        let path = root.join(LOCK_FILE);
        let failed =
            |e: &dyn std::fmt::Display| BusError::Locked { path: path.clone(), cause: e.to_string() };
        let mut options = File::options();
        let file = options.write(true).create(true).truncate(false).mode(0o600).open(&path);
        let file = file.map_err(|e| failed(&e))?;
        let start = Instant::now();
        loop {
            match file.try_lock() {
                Ok(()) => return Ok(Self(file)),
                Err(TryLockError::WouldBlock) if start.elapsed() >= LOCK_PATIENCE => {
                    return Err(failed(&format!("another process has held it for {LOCK_PATIENCE:?}")));
                }
                Err(TryLockError::Error(e)) if e.kind() != std::io::ErrorKind::Interrupted => {
                    return Err(failed(&e));
                }
                Err(_) => std::thread::sleep(PAUSE),
            }
        }
    }
}

fn root_of(config: &Config) -> PathBuf {
    PathBuf::from(config.global.root_path().to_string())
}

/// Whether `path` is a file of ours that nobody has written for `age`.
pub(super) fn is_stale(path: &Path, age: Duration) -> bool {
    let Ok(found) = std::fs::symlink_metadata(path) else { return false };
    let untouched = found.modified().ok().and_then(|at| at.elapsed().ok());
    let ours = found.uid() == rustix::process::getuid().as_raw();
    found.is_file() && ours && untouched.is_some_and(|untouched| untouched >= age)
}

/// The segment that all processes of a bus share, if its creator has not finished it: it was killed meanwhile,
/// or memory was full.
pub(super) fn half_made_segment(prefix: &str) -> Option<PathBuf> {
    let entries = std::fs::read_dir(SEGMENTS).ok()?.flatten();
    let mut shared = entries.filter(|entry| {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        name.starts_with(prefix) && name.ends_with(".global_mgmt")
    });
    let unreadable =
        |path: &PathBuf| std::fs::symlink_metadata(path).is_ok_and(|found| found.mode() & 0o400 == 0);
    shared.find_map(|entry| Some(entry.path()).filter(unreadable))
}

/// Removes what [`half_made_segment`] found, if nobody works on it any more.
pub(super) fn remove_segment(root: &Path, path: &Path) -> Result<(), BusError> {
    if is_stale(path, SEGMENT_STALE_AFTER) {
        let _lock = CreationLock::take(root)?;
        // another process may have been faster, and this may be a new one
        if is_stale(path, SEGMENT_STALE_AFTER) {
            // what remains is reported by the caller
            let _ = std::fs::remove_file(path);
        }
    }
    Ok(())
}

/// A service that is to be there.
pub(super) struct Wanted<'a> {
    pub(super) node: &'a Node<Ipc>,
    pub(super) text: &'a str,
    pub(super) name: &'a ServiceName,
    pub(super) pattern: MessagingPattern,
}

impl Wanted<'_> {
    /// Opens what is there, or creates it; whether it is new. An existing service keeps the limits it was
    /// created with.
    pub(super) fn open_or_create<T, O: Classify, C: Classify>(
        &self,
        try_open: impl Fn() -> Result<T, O>,
        try_create: impl Fn() -> Result<T, C>,
    ) -> Result<(T, bool), BusError> {
        let failed = |doing, e: &dyn std::fmt::Debug| BusError::Service {
            service: self.text.to_owned(),
            doing,
            cause: format!("{e:?}"),
        };
        match try_open() {
            Ok(service) => return Ok((service, false)),
            Err(e) if e.class() == Class::Refused => return Err(failed("open", &e)),
            Err(_) => {}
        }
        let _lock = CreationLock::take(&root_of(self.node.config()))?;
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
                    if since.elapsed() >= STALE_AFTER && self.remove_half_made() {
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

    /// Removes the description of the service, by which it exists; everything else of it has names of its own.
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
