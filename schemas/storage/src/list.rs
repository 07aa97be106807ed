//! Files under a directory, objects under a URL.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use system::not_a_file;

/// A file or an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Its path or URL.
    pub path: PathBuf,
    /// Its size in bytes.
    pub bytes: u64,
}

/// Something that has a name in a directory or a listing, and cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Skipped {
    /// Its name, as it is written there. It is no path: nothing may be opened by it.
    pub name: String,
    /// The reason: its kind, or its name.
    pub why: String,
}

/// Files or objects that were found, and others that cannot be read.
#[derive(Debug, Default)]
pub struct Listing {
    /// In the order of their names.
    pub entries: Vec<Listed>,
    /// The first paths that cannot be read.
    pub skipped: Vec<Skipped>,
    /// The number of all of these.
    pub skipped_count: u64,
    /// Objects or files that were looked at.
    pub seen_count: u64,
}

impl Listing {
    /// Notes something that cannot be read.
    pub(crate) fn skip(&mut self, name: String, why: String) {
        /// More than a person reads.
        const MOST_SKIPPED: usize = 100;
        self.skipped_count += 1;
        if self.skipped.len() < MOST_SKIPPED {
            self.skipped.push(Skipped { name, why });
        }
    }
}

/// Adds the files under `directory` to `listing` whose path is `wanted`.
pub(crate) fn walk(
    directory: &Path,
    wanted: &impl Fn(&Path) -> bool,
    listing: &mut Listing,
) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        let path = entry.path();
        listing.seen_count += 1;
        let kind = entry.file_type()?;
        if kind.is_dir() {
            if let Err(error) = walk(&path, wanted, listing) {
                listing.skip(path.display().to_string(), format!("it cannot be listed: {error}"));
            }
        } else if wanted(&path) {
            match fs::metadata(&path) {
                Ok(found) if found.is_file() => listing.entries.push(Listed { path, bytes: found.len() }),
                Ok(found) => {
                    if let Some(what) = not_a_file(found.file_type()) {
                        listing.skip(path.display().to_string(), format!("it is {what}, and no file"));
                    }
                }
                Err(error) if kind.is_symlink() => {
                    listing.skip(path.display().to_string(), format!("the link leads to no file: {error}"));
                }
                // it was removed meanwhile
                Err(_) => {}
            }
        }
    }
    Ok(())
}
