//! The one segment that all processes of a bus share, made by us so that it is ours alone from its first moment.
//!
//! iceoryx2 counts nodes in it, and would make it writable for every user of the machine: anybody could spoil it, or
//! cut it off under a process that has mapped it.

use super::leftovers::SEGMENTS;
use super::root::user_name;
use crate::SharedSegmentError;
use std::fs::{self, File};
use std::io::{ErrorKind, Read as _, Write as _};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Name of the segment after the prefix: a hash of the type in it, and the version of iceoryx2.
const NAME: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";
/// Version in the segment (three numbers of 16 bits, the lowest last); a counter follows it.
const VERSION: u64 = 10 << 16;
const BYTES: usize = 16;

fn path_of(prefix: &str) -> PathBuf {
    Path::new(SEGMENTS).join(format!("{prefix}{NAME}"))
}

/// True if the segment is there, whole and ours alone.
fn is_whole(path: &Path) -> bool {
    let read = || -> std::io::Result<bool> {
        let found = fs::symlink_metadata(path)?;
        let user = rustix::process::getuid().as_raw();
        if !found.is_file()
            || found.uid() != user
            || found.mode() & 0o777 != 0o600
            || found.len() != BYTES as u64
        {
            return Ok(false);
        }
        let mut bytes = [0; BYTES];
        File::open(path)?.read_exact(&mut bytes)?;
        Ok(bytes[..8] == VERSION.to_le_bytes())
    };
    read().unwrap_or(false)
}

/// Makes the segment if it is missing, and again if it is wrong; returns true if a wrong one was there. Processes look
/// into it only while they register, so registered processes lose nothing.
pub(super) fn ensure(prefix: &str, secret: &Path) -> Result<bool, SharedSegmentError> {
    let path = path_of(prefix);
    let io = |source| SharedSegmentError::Io { path: path.clone(), source };
    let found = match fs::symlink_metadata(&path) {
        Ok(found) => Some(found),
        Err(e) if e.kind() == ErrorKind::NotFound => None,
        Err(e) => return Err(io(e)),
    };
    if let Some(found) = &found {
        if found.uid() != rustix::process::getuid().as_raw() {
            let (owner, secret) = (user_name(found.uid()), secret.to_owned());
            return Err(SharedSegmentError::NotOurs { path, owner, secret });
        }
        if is_whole(&path) {
            return Ok(false);
        }
    }
    // whole at once: other processes find the old one, none, or the new one
    let new = Path::new(SEGMENTS).join(format!("{prefix}{}.new", uuid::Uuid::new_v4().simple()));
    make(&new).and_then(|()| fs::rename(&new, &path)).map_err(|e| {
        let _ = fs::remove_file(&new);
        io(e)
    })?;
    Ok(found.is_some())
}

fn make(path: &Path) -> std::io::Result<()> {
    let mut bytes = [0; BYTES];
    bytes[..8].copy_from_slice(&VERSION.to_le_bytes());
    let mut file = File::options().write(true).create_new(true).mode(0o600).open(path)?;
    file.set_permissions(fs::Permissions::from_mode(0o600))?;
    file.write_all(&bytes)
}

/// True if the segment needs no repair, so that no lock is needed.
pub(super) fn is_ready(prefix: &str) -> bool {
    is_whole(&path_of(prefix))
}
