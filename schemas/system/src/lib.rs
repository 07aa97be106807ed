//! Unix and Windows by the same names: the identity of a file, names, places in a file, room on a disk, the host's name, the end of a process.

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
pub use unix::*;
#[cfg(windows)]
pub use windows::*;

use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::Path;

/// Identity of a file among all that there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Identity(u64, u64);

/// Bytes of a disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// Those that are free for us.
    pub free_bytes: u64,
    /// All.
    pub total_bytes: u64,
}

/// True if `file` is the file at `path`, and not one that a link there leads to.
pub fn is_at(file: &File, path: &Path) -> bool {
    identity(file).is_some_and(|ours| identity_at(path) == Some(ours))
}

/// Fills `bytes` from a place in a file.
///
/// # Errors
/// When the file ends before, or the operating system refuses.
pub fn read_exact_at(file: &File, mut bytes: &mut [u8], mut place: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        match read_at(file, bytes, place) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(read) => {
                bytes = &mut bytes[read..];
                place += read as u64;
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
