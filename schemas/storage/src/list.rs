//! What lies under a directory or a URL.

use crate::{is_url, remote};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// A file or an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Where it is.
    pub path: PathBuf,
    /// Its size in bytes.
    pub bytes: u64,
}

/// All files under the directory `root`, or all objects under the URL `root`, in the order of their names. Symbolic links to
/// directories are not followed.
///
/// # Errors
/// When a directory cannot be read, or the store refuses.
pub fn list(root: &Path) -> io::Result<Vec<Entry>> {
    let mut entries = Vec::new();
    if is_url(root) {
        entries = remote::list(root)?;
    } else {
        walk(root, &mut entries)?;
    }
    entries.sort_by(|one, other| one.path.cmp(&other.path));
    Ok(entries)
}

fn walk(directory: &Path, entries: &mut Vec<Entry>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        let path = entry.path();
        if entry.file_type()?.is_dir() {
            walk(&path, entries)?;
        } else if let Ok(found) = fs::metadata(&path)
            && found.is_file()
        {
            entries.push(Entry { path, bytes: found.len() });
        }
    }
    Ok(())
}
