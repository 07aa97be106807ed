//! Gives a file its name without replacing another, and makes names durable.

use super::WholeFileError;
use std::fs::{self, OpenOptions};
use std::io;
use std::path::Path;

/// A way to rename that fails if the new name is taken.
type Rename = fn(&Path, &Path) -> io::Result<()>;

/// Renames, but never onto an existing file.
pub(super) fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    first_possible(&[system::rename_new, by_link, by_reservation], from, to)
}

/// The first of `ways` that the file system can do.
fn first_possible(ways: &[Rename], from: &Path, to: &Path) -> io::Result<()> {
    let mut outcome = Err(io::ErrorKind::Unsupported.into());
    for way in ways {
        outcome = way(from, to);
        match &outcome {
            Err(error) if system::is_unsupported(error) => {}
            _ => break,
        }
    }
    outcome
}

/// Renames by a second name, which cannot be given if it is taken.
fn by_link(from: &Path, to: &Path) -> io::Result<()> {
    fs::hard_link(from, to)?;
    fs::remove_file(from)
}

/// Renames without either: an empty file of our own takes the name, and only that is replaced.
fn by_reservation(from: &Path, to: &Path) -> io::Result<()> {
    OpenOptions::new().write(true).create_new(true).open(to)?;
    fs::rename(from, to).inspect_err(|_| {
        // best effort: the user has to know of the rename's error
        let _ = fs::remove_file(to);
    })
}

/// Makes the names in the directory of `path` durable.
pub(super) fn sync_directory(path: &Path) -> Result<(), WholeFileError> {
    sync_name(path).map_err(WholeFileError::io(directory_of(path)))
}

/// Makes the name `path` durable, and all others in its directory.
///
/// # Errors
/// When the operating system refuses.
pub fn sync_name(path: &Path) -> io::Result<()> {
    match system::sync_directory(directory_of(path)) {
        // file systems that cannot sync directories do without
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        synced => synced,
    }
}

/// Makes the directory `path` and those above it that are missing, durably: a file that is synced is lost with a
/// directory that is not.
///
/// # Errors
/// When the operating system refuses.
pub fn create_directory(path: &Path) -> io::Result<()> {
    if path.as_os_str().is_empty() || path.is_dir() {
        return Ok(());
    }
    create_directory(directory_of(path))?;
    match fs::create_dir(path) {
        Err(_) if path.is_dir() => {}
        made => made?,
    }
    sync_name(path)
}

/// The directory that `path` is in.
pub fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cannot(_: &Path, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Without hard links, and without the flag, too.
    #[test]
    fn no_way_of_naming_replaces_a_file() {
        let ways: [&[Rename]; 4] =
            [&[system::rename_new], &[by_link], &[by_reservation], &[cannot, cannot, by_reservation]];
        for ways in ways {
            let directory = tempfile::tempdir().expect("directory");
            let (from, to) = (directory.path().join("from"), directory.path().join("to"));
            fs::write(&from, "new").expect("written");
            fs::write(&to, "old").expect("written");
            let refused = first_possible(ways, &from, &to).expect_err("taken");
            assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
            assert_eq!(fs::read_to_string(&to).expect("kept"), "old");
            fs::remove_file(&to).expect("removed");
            first_possible(ways, &from, &to).expect("free");
            assert_eq!(fs::read_to_string(&to).expect("named"), "new");
            assert!(!from.exists());
        }
    }

    #[test]
    fn a_name_that_was_reserved_in_vain_is_free_again() {
        let directory = tempfile::tempdir().expect("directory");
        let (from, to) = (directory.path().join("from"), directory.path().join("to"));
        assert!(by_reservation(&from, &to).is_err(), "there is nothing to rename");
        assert!(!to.exists());
    }
}
