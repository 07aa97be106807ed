//! Writes an unfinished file again, in its place, without ever having less of it.
//!
//! The file is renamed to `<name>.interrupted`, read there while `<name>.partial` is written anew, and removed when the new file
//! has everything that it had. Whatever happens in between, one of the two is whole.

use super::{WholeFileError, give_name, naming, regular_file_at};
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use system::{is_at, without_waiting};

/// Ending of a name while the file is written.
const PARTIAL: &str = ".partial";

/// Ending of a name while the file is written again.
const ASIDE: &str = ".interrupted";

/// The three names of a file: the one that it will have, and those while it is written, and written again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Names {
    /// The final name.
    pub whole: PathBuf,
    /// Its name while it is written.
    pub partial: PathBuf,
    /// Its name while it is written again.
    pub aside: PathBuf,
}

impl Names {
    /// The names of the file that has `path` as one of the three.
    pub fn of(path: &Path) -> Self {
        let text = path.as_os_str().to_string_lossy();
        let ends = [PARTIAL, ASIDE].into_iter().find(|ending| text.ends_with(ending));
        match ends {
            Some(_) => Self::of_whole(&path.with_extension("")),
            None => Self::of_whole(path),
        }
    }

    /// The names of the file that will be called `whole`.
    pub fn of_whole(whole: &Path) -> Self {
        let with = |ending| {
            let mut name = OsString::from(whole);
            name.push(ending);
            PathBuf::from(name)
        };
        Self { whole: whole.to_owned(), partial: with(PARTIAL), aside: with(ASIDE) }
    }
}

/// An unfinished file that is to be read, and perhaps written again. Nobody else writes it as long as this lives.
#[derive(Debug)]
pub struct LockedFile {
    path: PathBuf,
    file: File,
}

impl LockedFile {
    /// Locks the file at `path`.
    ///
    /// # Errors
    /// When there is none, when it cannot be replaced, or when another process writes it.
    pub fn open(path: &Path) -> Result<Self, WholeFileError> {
        let io = WholeFileError::io(path);
        if !regular_file_at(path)? {
            return Err(io(io::ErrorKind::NotFound.into()));
        }
        let open = |write| without_waiting(OpenOptions::new().read(true).write(write), false).open(path);
        // locks need a file open for writing on some file systems; one that may only be read can be copied elsewhere
        let file = open(true).or_else(|_| open(false)).map_err(&io)?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(WholeFileError::Busy { path: path.to_owned() });
        }
        Ok(Self { path: path.to_owned(), file })
    }

    /// Its present path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Syncs its contents, since its writer may not have.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn sync(&self) -> Result<(), WholeFileError> {
        self.file.sync_all().map_err(WholeFileError::io(&self.path))
    }

    /// Gives it another name, durably. An existing file of that name is in the way unless `replace`.
    ///
    /// # Errors
    /// When the operating system refuses, or when it is not there any more.
    pub fn rename(&mut self, to: &Path, replace: bool) -> Result<(), WholeFileError> {
        if !is_at(&self.file, &self.path) {
            return Err(WholeFileError::Gone { partial: self.path.clone() });
        }
        give_name(&self.path, to, replace)?;
        to.clone_into(&mut self.path);
        Ok(())
    }

    /// Removes it, durably.
    ///
    /// # Errors
    /// When the operating system refuses, or when it is not there any more.
    pub fn remove(self) -> Result<(), WholeFileError> {
        if !is_at(&self.file, &self.path) {
            return Err(WholeFileError::Gone { partial: self.path });
        }
        fs::remove_file(&self.path).map_err(WholeFileError::io(&self.path))?;
        naming::sync_directory(&self.path)
    }
}
