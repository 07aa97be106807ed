//! Files that have their name only once they are whole.
//!
//! A file that is being written is `<name>.partial`; [`WholeFile::publish`] syncs it and gives it its name, by one
//! rename. Recordings, contacts maps, tables and figures are written in this way.
//!
//! Architecture invariants: a write replaces an existing file of either name only if that was asked for, and never
//! a file that appears meanwhile. It never takes a `.partial` from a living process that writes it.
//! The writer holds an advisory lock (`flock`) on its `.partial`; on file systems without locks a living writer
//! cannot be told from a dead one, and only the rule about existing files is left.

mod aside;
mod naming;

pub use aside::{LockedFile, Names};
pub use naming::{create_directory, directory_of, sync_name};

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use system::{Identity, identity_at, is_at, without_waiting};

/// A file that is being written and does not have its name yet.
///
/// A drop before [`publish`](Self::publish) removes the file, so that a start that failed does not stand in the way of
/// the next one. [`keep`](Self::keep) prevents that.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    partial: PathBuf,
    /// The file that may be replaced: the one of that name in the beginning, if replacement was asked for.
    replaced: Option<Replaced>,
    keep: bool,
    file: Arc<File>,
}

/// The `.partial`s to remove if the process ends: those that nobody has asked to keep.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes every file of this process that is not finished and not [kept](WholeFile::keep): for a process that ends without
/// dropping anything.
pub fn remove_unfinished() {
    for partial in unfinished().drain(..) {
        // at best: what is left is an unfinished file
        let _ = fs::remove_file(partial);
    }
}

/// A file that may be replaced.
#[derive(Debug)]
struct Replaced {
    identity: Identity,
    /// Open, so that no other file gets its inode; none if it may not be read.
    _held: Option<File>,
}

impl Replaced {
    /// The file at `path`, if there is one.
    fn at(path: &Path) -> Option<Self> {
        let held = without_waiting(OpenOptions::new().read(true), false).open(path).ok();
        identity_at(path).map(|identity| Self { identity, _held: held })
    }
}

/// The reason why a file could not be created, or not be given its name.
#[derive(Debug, thiserror::Error)]
pub enum WholeFileError {
    /// There is a file of this name.
    #[error("{} exists already; choose another name, or replace it with --force", path.display())]
    Exists {
        /// The file in the way.
        path: PathBuf,
    },
    /// There is an unfinished file of this name.
    #[error(
        "{} exists: a part of a file, left by an earlier command; move it away, or replace it with --force",
        path.display()
    )]
    PartialExists {
        /// The file in the way.
        path: PathBuf,
    },
    /// A living process writes to this name.
    #[error("{} is being written by another process; wait for its end, or choose another name", path.display())]
    Busy {
        /// The file it writes.
        path: PathBuf,
    },
    /// The thing of this name is not a file that could be replaced.
    #[error("{} is {found} and cannot be replaced by a file; choose another name", path.display())]
    NotAFile {
        /// The thing in the way.
        path: PathBuf,
        /// Its kind, such as `a directory`.
        found: &'static str,
    },
    /// A file of the final name appeared while this one was being written.
    #[error(
        "{} appeared while it was being written and is left alone; the finished file is {}: rename it",
        path.display(), partial.display()
    )]
    Appeared {
        /// The file in the way.
        path: PathBuf,
        /// The finished file.
        partial: PathBuf,
    },
    /// The file was moved or deleted while it was being written.
    #[error("{} was moved or deleted while it was being written", partial.display())]
    Gone {
        /// The path that it had.
        partial: PathBuf,
    },
    /// There is no room, and the file was removed: a part of it would only fill the disk.
    #[error(
        "cannot write {}: there is no room, and the part that was written is removed; make room, or name a file on another disk",
        path.display()
    )]
    NoRoom {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The operating system refused.
    #[error("cannot write {}", path.display())]
    Io {
        /// The path of the file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
}

impl WholeFileError {
    /// For `map_err`: an error of the operating system about `path`.
    pub fn io(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    /// For `map_err`: the same for the file `path`, which is removed if there is no room for all of it.
    pub fn removed(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        move |source| {
            let path = path.to_owned();
            if is_no_room(&source) { Self::NoRoom { path, source } } else { Self::Io { path, source } }
        }
    }

    /// True if an existing file is in the way, so that another name must be chosen.
    pub fn is_in_the_way(&self) -> bool {
        matches!(self, Self::Exists { .. } | Self::PartialExists { .. } | Self::NotAFile { .. })
    }
}

/// True if a disk, a quota or a limit is used up.
fn is_no_room(error: &io::Error) -> bool {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge)
}

/// Longest time for which another process that only looks may hold the lock of a new file.
const LOCK_PATIENCE: Duration = Duration::from_secs(1);

/// Largest number of attempts to create a `.partial` that others create or remove meanwhile.
const MAX_ATTEMPTS: u32 = 10;

impl WholeFile {
    /// Creates `<path>.partial`. Existing regular files of both names are in the way unless `replace`; anything
    /// else (a directory, a link, a device) always is, and so is the `.partial` of a living process.
    ///
    /// # Errors
    /// Any error but [`WholeFileError::Appeared`] and [`WholeFileError::Gone`].
    pub fn create(path: &Path, replace: bool) -> Result<Self, WholeFileError> {
        if regular_file_at(path)? && !replace {
            return Err(WholeFileError::Exists { path: path.to_owned() });
        }
        let partial = Names::of_whole(path).partial;
        for _ in 0..MAX_ATTEMPTS {
            if let Some(file) = create_locked(&partial, replace)? {
                unfinished().push(partial.clone());
                return Ok(Self {
                    path: path.to_owned(),
                    partial,
                    // looked at under the lock: another writer's finished file is there
                    replaced: if replace { Replaced::at(path) } else { None },
                    keep: false,
                    file: Arc::new(file),
                });
            }
        }
        Err(WholeFileError::Busy { path: partial })
    }

    /// The path that it will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path of the bytes until then: `<path>.partial`.
    pub fn partial(&self) -> &Path {
        &self.partial
    }

    /// The file, to write to it and to sync it.
    pub fn file(&self) -> &Arc<File> {
        &self.file
    }

    /// Keeps the written part: the `.partial` stays even if it is never finished.
    pub fn keep(&mut self) {
        self.keep = true;
        self.forget();
    }

    fn forget(&self) {
        unfinished().retain(|partial| *partial != self.partial);
    }

    /// Makes the error of a failed write. The written part stays, if [`keep`](Self::keep) asked for that, unless there was no room.
    #[must_use]
    pub fn refused(&mut self, source: io::Error) -> WholeFileError {
        self.keep &= !is_no_room(&source);
        WholeFileError::removed(&self.path)(source)
    }

    /// Removes the file.
    pub fn discard(mut self) {
        self.keep = false;
    }

    /// Makes the name of the `.partial` durable.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn sync_name(&self) -> Result<(), WholeFileError> {
        naming::sync_directory(&self.path)
    }

    /// Syncs the file and gives it its name, durably. After an error the `.partial` stays.
    ///
    /// # Errors
    /// [`WholeFileError::Appeared`], [`WholeFileError::Gone`], or when the operating system refuses.
    pub fn publish(mut self) -> Result<PathBuf, WholeFileError> {
        self.keep();
        let Self { path, partial, replaced, .. } = &self;
        self.file.sync_all().map_err(WholeFileError::io(partial))?;
        if !is_at(&self.file, partial) {
            return Err(WholeFileError::Gone { partial: partial.clone() });
        }
        let is_replaced = replaced.as_ref().is_some_and(|file| identity_at(path) == Some(file.identity));
        let named = if is_replaced { fs::rename(partial, path) } else { naming::rename_new(partial, path) };
        match named {
            Ok(()) => {}
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                return Err(WholeFileError::Appeared { path: path.clone(), partial: partial.clone() });
            }
            Err(error) => return Err(WholeFileError::io(path)(error)),
        }
        naming::sync_directory(path)?;
        Ok(path.clone())
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if !self.keep && is_at(&self.file, &self.partial) {
            // at best: what is left is an unfinished file
            let _ = fs::remove_file(&self.partial);
        }
        self.forget();
    }
}

/// Writes a file of these bytes, whole. An existing file of this name is in the way unless `replace`.
///
/// # Errors
/// As for [`WholeFile::create`] and [`WholeFile::publish`].
pub fn write(path: &Path, bytes: &[u8], replace: bool) -> Result<(), WholeFileError> {
    let mut file = WholeFile::create(path, replace)?;
    (&**file.file()).write_all(bytes).map_err(|source| file.refused(source))?;
    file.publish().map(drop)
}

/// Gives the finished file `from` the name `to`, durably. An existing file of that name is in the way unless `replace`.
///
/// # Errors
/// [`WholeFileError::Exists`], or when the operating system refuses; `from` then stays.
pub fn give_name(from: &Path, to: &Path, replace: bool) -> Result<(), WholeFileError> {
    let named = if replace { fs::rename(from, to) } else { naming::rename_new(from, to) };
    match named {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            Err(WholeFileError::Exists { path: to.to_owned() })
        }
        named => {
            named.map_err(WholeFileError::io(to))?;
            naming::sync_directory(to)
        }
    }
}

/// True if a living process is writing the file at `path`; always false where the file system has no locks.
pub fn is_being_written(path: &Path) -> bool {
    // a pipe would keep us waiting
    let file = path.is_file().then(|| File::open(path));
    file.and_then(Result::ok)
        .is_some_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// True if there is a regular file at `path`; anything else there is an error.
fn regular_file_at(path: &Path) -> Result<bool, WholeFileError> {
    let refuse = |found| Err(WholeFileError::NotAFile { path: path.to_owned(), found });
    if path.file_name().is_none() {
        return refuse("not the name of a file");
    }
    match path.symlink_metadata().map(|found| found.file_type()) {
        // the operating system refuses an unreachable path when it is created
        Err(_) => Ok(false),
        Ok(found) if found.is_file() => Ok(true),
        Ok(found) if found.is_dir() => refuse("a directory"),
        Ok(found) if found.is_symlink() => refuse("a link"),
        Ok(_) => refuse("a device, pipe or socket"),
    }
}

/// Creates and locks `partial`; none if another process came in between, so that another attempt is worthwhile.
fn create_locked(partial: &Path, replace: bool) -> Result<Option<File>, WholeFileError> {
    match OpenOptions::new().write(true).create_new(true).open(partial) {
        Ok(file) => lock_new(&file, partial).map(|ours| ours.then_some(file)),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            make_room(partial, replace).map(|()| None)
        }
        Err(error) => Err(WholeFileError::io(partial)(error)),
    }
}

/// Locks the file just created at `partial`, and returns true if it is still there.
fn lock_new(file: &File, partial: &Path) -> Result<bool, WholeFileError> {
    let start = Instant::now();
    // another starter may be looking whether its writer lives, or be removing it
    while let Err(TryLockError::WouldBlock) = file.try_lock() {
        if start.elapsed() >= LOCK_PATIENCE {
            return Err(WholeFileError::Busy { path: partial.to_owned() });
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(is_at(file, partial))
}

/// Removes the file at `partial` if nobody writes it, and if `replace` asks for that or the file is empty.
fn make_room(partial: &Path, replace: bool) -> Result<(), WholeFileError> {
    if !regular_file_at(partial)? {
        return Ok(()); // gone by now
    }
    // locks need a file open for writing on some file systems; what took its place meanwhile must not block
    let opened = without_waiting(OpenOptions::new().write(true), false).open(partial);
    let found = match opened {
        Ok(found) => found,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(_) if !replace => return Err(WholeFileError::PartialExists { path: partial.to_owned() }),
        Err(error) => return Err(WholeFileError::io(partial)(error)),
    };
    // held until it is removed, so that nobody begins to write it
    let locked = found.try_lock();
    if let Err(TryLockError::WouldBlock) = locked {
        return Err(WholeFileError::Busy { path: partial.to_owned() });
    }
    if !is_at(&found, partial) {
        return Ok(()); // its writer has finished it
    }
    // of one that was killed before it wrote anything nothing is lost
    let is_empty = locked.is_ok() && found.metadata().is_ok_and(|found| found.len() == 0);
    if !replace && !is_empty {
        return Err(WholeFileError::PartialExists { path: partial.to_owned() });
    }
    fs::remove_file(partial).map_err(WholeFileError::io(partial))
}

#[cfg(test)]
mod tests;
