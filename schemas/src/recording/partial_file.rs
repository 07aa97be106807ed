//! A file that is written as `<name>.partial` and gets its name when it is finished.

use super::error::WriteError;
use rustix::fs::{CWD, RenameFlags};
use rustix::io::Errno;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The file on its way to its name. Holds an advisory lock, so that no other recorder takes it over.
#[derive(Debug)]
pub(super) struct PartialFile {
    path: PathBuf,
    partial: PathBuf,
    force: bool,
    file: Arc<File>,
    position: Arc<AtomicU64>,
}

/// The end of a [`PartialFile`] that MCAP writes to, unbuffered: chunks come whole.
#[derive(Debug)]
pub(super) struct Sink {
    file: Arc<File>,
    position: Arc<AtomicU64>,
}

impl PartialFile {
    /// Creates `<path>.partial`; refuses existing files of both names unless `force`.
    pub(super) fn create(path: &Path, force: bool) -> Result<(Self, Sink), WriteError> {
        if !force && path.symlink_metadata().is_ok() {
            return Err(WriteError::Exists { path: path.to_owned() });
        }
        let mut name = OsString::from(path);
        name.push(".partial");
        let partial = PathBuf::from(name);
        let file = create_locked(&partial, force)?;
        let (file, position) = (Arc::new(file), Arc::new(AtomicU64::new(0)));
        let sink = Sink { file: Arc::clone(&file), position: Arc::clone(&position) };
        Ok((Self { path: path.to_owned(), partial, force, file, position }, sink))
    }

    /// Where the bytes are until the file is finished.
    pub(super) fn partial(&self) -> &Path {
        &self.partial
    }

    /// Bytes handed to the operating system.
    pub(super) fn bytes_written(&self) -> u64 {
        self.position.load(Ordering::Relaxed)
    }

    /// The file, to sync it.
    pub(super) fn file(&self) -> &Arc<File> {
        &self.file
    }

    /// Cuts off what a failed write may have left after the first `length_bytes`.
    pub(super) fn truncate(&self, length_bytes: u64) {
        // at best: the write error is what the user has to know
        let _ = self.file.set_len(length_bytes);
    }

    /// Makes the name of the partial file durable.
    pub(super) fn sync_name(&self) -> Result<(), WriteError> {
        sync_directory(&self.path)
    }

    /// Syncs the file and gives it its name, durably.
    pub(super) fn publish(self) -> Result<PathBuf, WriteError> {
        let Self { path, partial, force, file, .. } = self;
        file.sync_all().map_err(WriteError::io(&partial))?;
        let renamed = if force { fs::rename(&partial, &path) } else { rename_new(&partial, &path) };
        match renamed {
            Ok(()) => {}
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                return Err(WriteError::Appeared { path, partial });
            }
            Err(error) => return Err(WriteError::io(&path)(error)),
        }
        sync_directory(&path)?;
        Ok(path)
    }
}

fn create_locked(partial: &Path, force: bool) -> Result<File, WriteError> {
    let io = WriteError::io(partial);
    let create = || OpenOptions::new().write(true).create_new(true).open(partial);
    let file = match create() {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            if File::open(partial).is_ok_and(|file| is_locked(&file)) {
                return Err(WriteError::Busy { path: partial.to_owned() });
            }
            if !force {
                return Err(WriteError::PartialExists { path: partial.to_owned() });
            }
            fs::remove_file(partial).map_err(&io)?;
            create().map_err(&io)?
        }
        created => created.map_err(&io)?,
    };
    // file systems without locks do without
    let _ = file.try_lock();
    Ok(file)
}

fn is_locked(file: &File) -> bool {
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}

/// Renames, but never onto an existing file.
fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    match rustix::fs::renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        // file systems that cannot: a second name fails if there is one, too
        Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => {
            fs::hard_link(from, to)?;
            fs::remove_file(from)
        }
        renamed => Ok(renamed?),
    }
}

fn sync_directory(path: &Path) -> Result<(), WriteError> {
    let directory = directory_of(path);
    match File::open(directory).and_then(|directory| directory.sync_all()) {
        // file systems that cannot sync directories do without
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        synced => synced.map_err(WriteError::io(directory)),
    }
}

/// The directory that `path` is in.
pub(super) fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = (&*self.file).write(bytes)?;
        self.position.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Sink {
    /// Tells the position; there is no other.
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.position.load(Ordering::Relaxed)),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}
