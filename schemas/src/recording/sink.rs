//! Where MCAP's bytes go.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes to a file, unbuffered because chunks come whole, and counts.
#[derive(Debug)]
pub(super) struct Sink {
    file: Arc<File>,
    position: Arc<AtomicU64>,
}

/// Bytes handed to the operating system by a [`Sink`].
#[derive(Debug)]
pub(super) struct Position(Arc<AtomicU64>);

impl Sink {
    /// Into `file`, which is empty.
    pub(super) fn new(file: Arc<File>) -> (Self, Position) {
        let position = Arc::new(AtomicU64::new(0));
        (Self { file, position: Arc::clone(&position) }, Position(position))
    }
}

impl Position {
    pub(super) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
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
