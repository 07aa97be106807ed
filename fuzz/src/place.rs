//! Where the bytes of a recording become a file.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::PathBuf;

/// A directory for files, which `fuzz/run` puts into memory and removes: libFuzzer ends without dropping anything.
#[derive(Debug)]
pub struct Place(PathBuf);

impl Place {
    /// A place of this process.
    pub fn new() -> Self {
        let directory = std::env::temp_dir().join(format!("beadline-fuzz-{}", std::process::id()));
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
