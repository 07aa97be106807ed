//! A recording that ended before its run did, to be gone on with.

use super::error::ReadError;
use super::info::RecordingInfo;
use crate::whole_file::{LockedFile, Names, WholeFileError, directory_of};
use std::path::{Path, PathBuf};

/// A recording that is written again from its beginning, so that its run can go on: in its place, or in another
/// one.
///
/// In its place it is renamed to `<name>.mcap.interrupted` until the new `<name>.mcap.partial` has everything that it
/// has. Whoever was killed in between finds it there the next time.
#[derive(Debug)]
pub struct InterruptedRecording {
    file: LockedFile,
    /// Of a former attempt, with nothing that this one has not.
    leftover: Option<LockedFile>,
    names: Names,
    target: PathBuf,
    info: RecordingInfo,
}

/// Why a recording cannot be gone on with.
#[derive(Debug, thiserror::Error)]
pub enum ResumeError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file cannot be locked, renamed or removed.
    #[error(transparent)]
    File(#[from] WholeFileError),
    /// There is another file that the recording would have to replace.
    #[error(
        "{} cannot be gone on with while there is {}, too: move one of them away, or write to another place with --out",
        path.display(), other.display()
    )]
    InTheWay {
        /// The recording.
        path: PathBuf,
        /// The other one.
        other: PathBuf,
    },
}

impl InterruptedRecording {
    /// Finds the recording that `path` is about, which may be called `.mcap`, `.mcap.partial` or `.mcap.interrupted`.
    /// It will be written again as `out`, or in its place; `replace` says whether a finished file may be replaced.
    ///
    /// # Errors
    /// When it cannot be read or is being written, or when a file is in the way.
    pub fn find(path: &Path, out: Option<&Path>, replace: bool) -> Result<Self, ResumeError> {
        let names = Names::of(path);
        let out = out.filter(|out| !is_same_place(out, &names.whole));
        let target = out.map_or_else(|| names.whole.clone(), Path::to_owned);
        let is_whole = path == names.whole;
        let mut in_the_way = match (out, is_whole) {
            (Some(_), _) => vec![],
            (None, true) => vec![&names.partial, &names.aside],
            (None, false) if replace => vec![],
            (None, false) => vec![&names.whole],
        };
        in_the_way.retain(|other| other.exists());
        if let Some(other) = in_the_way.pop() {
            return Err(ResumeError::InTheWay { path: path.to_owned(), other: other.clone() });
        }
        let (file, info, leftover) = if !is_whole && names.aside.exists() {
            best_of(&names)?
        } else {
            // a file that is not there cannot be read, rather than written
            path.metadata().map_err(ReadError::io(path))?;
            let file = LockedFile::open(path)?;
            let info = RecordingInfo::read(path)?;
            (file, info, None)
        };
        Ok(Self { file, leftover, names, target, info })
    }

    /// What is in it.
    pub fn info(&self) -> &RecordingInfo {
        &self.info
    }

    /// Where it is now.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Where it will be when it is finished.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Whether it will be written again in its place.
    pub fn is_in_place(&self) -> bool {
        self.target == self.names.whole
    }

    /// Makes room for the new one.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn set_aside(&mut self) -> Result<(), WholeFileError> {
        if !self.is_in_place() {
            return Ok(());
        }
        if let Some(leftover) = self.leftover.take() {
            leftover.remove()?;
        }
        if self.file.path() == self.names.aside {
            return Ok(());
        }
        self.file.rename(&self.names.aside)
    }

    /// Gives a complete one its name, if it was killed before it had it, and returns where it is.
    ///
    /// # Errors
    /// When the operating system refuses, or when there is something of that name.
    pub fn give_name(mut self) -> Result<PathBuf, WholeFileError> {
        if let Some(leftover) = self.leftover.take() {
            leftover.remove()?;
        }
        if self.file.path() != self.names.whole {
            self.file.rename(&self.names.whole)?;
        }
        Ok(self.names.whole)
    }

    /// Gives it a name under which it is found, after the new one came to nothing.
    ///
    /// # Errors
    /// When the operating system refuses, or when there is something of that name; it then stays where it is.
    pub fn put_back(mut self) -> Result<(), WholeFileError> {
        if self.file.path() != self.names.aside {
            return Ok(());
        }
        let name = if self.info.finished { &self.names.whole } else { &self.names.partial };
        self.file.rename(&name.clone())
    }

    /// Removes it, because the new one has everything that it has. In another place than the new one it stays.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn remove(self) -> Result<(), WholeFileError> {
        if self.is_in_place() { self.file.remove() } else { Ok(()) }
    }
}

/// Whether both are the same name in the same directory.
fn is_same_place(one: &Path, other: &Path) -> bool {
    let directory = |path| directory_of(path).canonicalize().ok();
    one == other || (one.file_name() == other.file_name() && directory(one) == directory(other))
}

/// After an attempt that was killed: the recording that was set aside or, if that has come further, the new one.
fn best_of(names: &Names) -> Result<(LockedFile, RecordingInfo, Option<LockedFile>), ResumeError> {
    let old = LockedFile::open(&names.aside)?;
    let info = RecordingInfo::read(&names.aside)?;
    if !names.partial.exists() {
        return Ok((old, info, None));
    }
    let new = LockedFile::open(&names.partial)?;
    match RecordingInfo::read(&names.partial) {
        Ok(found) if is_further(&found, &info) => Ok((new, found, Some(old))),
        // a copy that was not finished
        _ => Ok((old, info, Some(new))),
    }
}

/// Whether `new` has everything that `old` has, and more.
fn is_further(new: &RecordingInfo, old: &RecordingInfo) -> bool {
    let same = new.manifest.provenance.run_id == old.manifest.provenance.run_id;
    same && new.damage.is_none() && new.last_step > old.last_step
}
