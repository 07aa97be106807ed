//! Values that wait on the disk: formats that have one array behind the other get a value of each at a time.

use schemas::whole_file::WholeFileError;
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// An array of 8-byte numbers in a file without a name, beside the output: it vanishes with this process.
#[derive(Debug)]
pub(super) struct Spool {
    out: BufWriter<File>,
    beside: PathBuf,
    bytes: u64,
    is_being_read: bool,
    /// The bytes of one call, put together.
    row: Vec<u8>,
}

impl Spool {
    /// An empty one on the disk of the file `beside`.
    pub(super) fn beside(beside: &Path) -> Result<Self, WholeFileError> {
        let directory = beside.parent().filter(|parent| !parent.as_os_str().is_empty());
        let file = tempfile::tempfile_in(directory.unwrap_or(Path::new(".")));
        let file = file.map_err(WholeFileError::io(beside))?;
        let out = BufWriter::with_capacity(1 << 18, file);
        Ok(Self { out, beside: beside.to_owned(), bytes: 0, is_being_read: false, row: Vec::new() })
    }

    pub(super) fn doubles(&mut self, values: &[f64]) -> Result<(), WholeFileError> {
        self.row.resize(values.len() * 8, 0);
        for (bytes, value) in self.row.chunks_exact_mut(8).zip(values) {
            bytes.copy_from_slice(&value.to_le_bytes());
        }
        self.write_row()
    }

    pub(super) fn integer(&mut self, value: i64) -> Result<(), WholeFileError> {
        self.row.clear();
        self.row.extend(value.to_le_bytes());
        self.write_row()
    }

    fn write_row(&mut self) -> Result<(), WholeFileError> {
        self.out.write_all(&self.row).map_err(WholeFileError::removed(&self.beside))?;
        self.bytes += self.row.len() as u64;
        Ok(())
    }

    /// Number of bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// True if [`copy`](Self::copy) has begun.
    pub(super) fn is_being_read(&self) -> bool {
        self.is_being_read
    }

    /// Copies the next piece, from the beginning on, and returns its size in bytes: 0 at the end. Nothing can be
    /// added any more.
    pub(super) fn copy(&mut self, to: &mut impl Write, at_most: u64) -> io::Result<u64> {
        if !self.is_being_read {
            self.out.flush()?;
            self.out.get_mut().rewind()?;
            self.is_being_read = true;
        }
        io::copy(&mut self.out.get_mut().take(at_most), to)
    }
}
