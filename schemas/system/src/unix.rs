//! Unix.

use super::{Identity, Room};
use rustix::fs::{CWD, OFlags, RenameFlags};
use rustix::io::Errno;
use rustix::process::{Pid, Signal, kill_process};
use std::fs::{File, FileType, Metadata, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt as _, FileTypeExt as _, MetadataExt as _, OpenOptionsExt as _};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command};

fn of(found: &Metadata) -> Identity {
    Identity(found.dev(), found.ino())
}

/// The identity of `file`.
pub fn identity(file: &File) -> Option<Identity> {
    file.metadata().ok().as_ref().map(of)
}

/// The identity of the file at `path`, if there is one; that of a link itself.
pub fn identity_at(path: &Path) -> Option<Identity> {
    path.symlink_metadata().ok().as_ref().map(of)
}

/// Has files opened without waiting for a writer, as a pipe does; without `follows_links` a link is not opened.
pub fn without_waiting(options: &mut OpenOptions, follows_links: bool) -> &mut OpenOptions {
    let flags = if follows_links { OFlags::NONBLOCK } else { OFlags::NONBLOCK | OFlags::NOFOLLOW };
    options.custom_flags(flags.bits().cast_signed())
}

/// The name of a thing that is no file; none for files and directories.
pub fn not_a_file(found: FileType) -> Option<&'static str> {
    if found.is_fifo() {
        Some("a pipe (FIFO)")
    } else if found.is_socket() {
        Some("a socket")
    } else if found.is_char_device() || found.is_block_device() {
        Some("a device")
    } else {
        None
    }
}

/// Renames, but never onto an existing file, in one step.
///
/// # Errors
/// When there is such a file, or the file system cannot do that.
pub fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    Ok(rustix::fs::renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE)?)
}

/// True if a file system reports that it cannot do something; FAT and several network ones report "not permitted".
pub fn is_unsupported(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::Unsupported
        || matches!(
            Errno::from_io_error(error),
            Some(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP | Errno::PERM)
        )
}

/// Makes the names in a directory durable.
///
/// # Errors
/// When the operating system refuses.
pub fn sync_directory(path: &Path) -> io::Result<()> {
    File::open(path)?.sync_all()
}

/// Reads some bytes at a place; none at the end.
///
/// # Errors
/// When the operating system refuses.
pub fn read_at(file: &File, bytes: &mut [u8], place: u64) -> io::Result<usize> {
    file.read_at(bytes, place)
}

/// The room on the disk of a directory.
///
/// # Errors
/// When it cannot be looked at.
pub fn room(directory: &Path) -> io::Result<Room> {
    let disk = rustix::fs::statvfs(directory)?;
    let bytes = |blocks: u64| blocks.saturating_mul(disk.f_frsize);
    Ok(Room { free_bytes: bytes(disk.f_bavail), total_bytes: bytes(disk.f_blocks) })
}

/// The name of this computer.
pub fn host_name() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

/// Asks a process to end.
///
/// # Errors
/// When it has ended.
pub fn end(process: &mut Child) -> io::Result<()> {
    Ok(kill_process(Pid::from_child(process), Signal::TERM)?)
}

/// Has a process started in a group of its own, so that Ctrl-C does not reach it.
pub fn apart(command: &mut Command) {
    command.process_group(0);
}
