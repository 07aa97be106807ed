//! Where the bytes of a recording become a file.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A file in memory, if this machine has such a place, that goes away with this.
#[derive(Debug)]
pub struct Place(PathBuf);

impl Place {
    /// A place of this process.
    pub fn new() -> Self {
        let memory = Path::new("/dev/shm");
        let directory = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        let directory = directory.join(format!("beadline-fuzz-{}", std::process::id()));
        fs::create_dir_all(&directory).expect("a temporary directory");
        Self(directory)
    }

    /// A file of that name.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Makes `bytes` the contents of a file.
    pub fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path(name);
        // not by truncating it, which some file systems wait for
        let mut file =
            OpenOptions::new().write(true).create(true).truncate(false).open(&path).expect("a file");
        file.write_all(bytes).expect("space for it");
        file.set_len(bytes.len() as u64).expect("space for it");
        path
    }
}

impl Default for Place {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}
