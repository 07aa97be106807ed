//! Windows.

use super::{Identity, Room};
use std::fs::{File, FileType, OpenOptions};
use std::io;
use std::os::windows::fs::{FileExt as _, OpenOptionsExt as _};
use std::os::windows::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command};
use winapi_util::{Handle, file};

/// Opens a link itself, and no thing that it leads to.
const OPEN_REPARSE_POINT: u32 = 0x0020_0000;

/// A group of its own for a process.
const NEW_PROCESS_GROUP: u32 = 0x0000_0200;

fn of(found: &file::Information) -> Identity {
    Identity(found.volume_serial_number(), found.file_index())
}

/// The identity of `file`.
pub fn identity(file: &File) -> Option<Identity> {
    file::information(file).ok().as_ref().map(of)
}

/// The identity of the file at `path`, if there is one.
pub fn identity_at(path: &Path) -> Option<Identity> {
    let handle = Handle::from_path_any(path).ok()?;
    file::information(&handle).ok().as_ref().map(of)
}

/// Without `follows_links` a link is not opened. No file here waits for a writer.
pub fn without_waiting(options: &mut OpenOptions, follows_links: bool) -> &mut OpenOptions {
    options.custom_flags(if follows_links { 0 } else { OPEN_REPARSE_POINT })
}

/// The name of a thing that is no file: there is none here.
pub fn not_a_file(_: FileType) -> Option<&'static str> {
    None
}

/// Renaming without replacing, which this system does in another way.
///
/// # Errors
/// Always: it is not supported.
pub fn rename_new(_: &Path, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// True if a file system reports that it cannot do something.
pub fn is_unsupported(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::Unsupported
}

/// Nothing: names here are durable without.
///
/// # Errors
/// None.
pub fn sync_directory(_: &Path) -> io::Result<()> {
    Ok(())
}

/// Reads some bytes at a place; none at the end.
///
/// # Errors
/// When the operating system refuses.
pub fn read_at(file: &File, bytes: &mut [u8], place: u64) -> io::Result<usize> {
    file.seek_read(bytes, place)
}

/// The room on the disk of a directory.
///
/// # Errors
/// When it cannot be looked at.
pub fn room(directory: &Path) -> io::Result<Room> {
    Ok(Room { free_bytes: fs4::available_space(directory)?, total_bytes: fs4::total_space(directory)? })
}

/// The name of this computer.
pub fn host_name() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}

/// Ends a process.
///
/// # Errors
/// When it has ended.
pub fn end(process: &mut Child) -> io::Result<()> {
    process.kill()
}

/// Has a process started in a group of its own, so that Ctrl-C does not reach it.
pub fn apart(command: &mut Command) {
    command.creation_flags(NEW_PROCESS_GROUP);
}
