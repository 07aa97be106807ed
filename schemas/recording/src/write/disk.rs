//! Room left on a disk while a recording is written.

use crate::error::WriteError;
use schemas::whole_file::directory_of;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use system::Room;

/// The room on the disk that the file `path` is on, or will be.
///
/// # Errors
/// When its directory cannot be looked at.
pub fn room_for(path: &Path) -> Result<Room, WriteError> {
    let directory = directory_of(path);
    system::room(directory).map_err(WriteError::io(directory))
}

/// Checks now and then that as much room is left on a disk as must stay free.
#[derive(Debug)]
pub struct DiskWatch {
    path: PathBuf,
    reserve_bytes: u64,
    looked_at: Option<Instant>,
    /// Bytes that had been written at the last look.
    written_bytes: u64,
    /// Bytes to be written until the next look.
    stride_bytes: u64,
}

impl DiskWatch {
    /// Longest time between two looks while bytes are written.
    const PERIOD: Duration = Duration::from_millis(100);

    /// Most bytes written between two looks; fewer where there is little room left.
    const STRIDE_BYTES: u64 = 4 << 20;

    /// Watches the disk of the file `path`, on which `reserve_bytes` must stay free.
    pub fn new(path: &Path, reserve_bytes: u64) -> Self {
        Self { path: path.to_owned(), reserve_bytes, looked_at: None, written_bytes: 0, stride_bytes: 0 }
    }

    /// True if too little room would be left once the `pending_bytes` that wait in memory are on the disk. The watch
    /// asks for them only when it is time to look. `written_bytes` are on the disk already; there are at least as many
    /// each time.
    ///
    /// # Errors
    /// When the disk cannot be looked at.
    pub fn is_short(
        &mut self,
        written_bytes: u64,
        pending_bytes: impl FnOnce() -> u64,
    ) -> Result<bool, WriteError> {
        let is_due = self.looked_at.is_none_or(|at| at.elapsed() >= Self::PERIOD)
            || written_bytes.saturating_sub(self.written_bytes) >= self.stride_bytes;
        if !is_due {
            return Ok(false);
        }
        self.looked_at = Some(Instant::now());
        self.written_bytes = written_bytes;
        let needed_bytes = self.reserve_bytes.saturating_add(pending_bytes());
        let free_bytes = room_for(&self.path)?.free_bytes;
        self.stride_bytes = (free_bytes.saturating_sub(needed_bytes) / 8).min(Self::STRIDE_BYTES); // integers
        Ok(free_bytes < needed_bytes)
    }
}
