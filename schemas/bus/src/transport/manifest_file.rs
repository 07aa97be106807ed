//! The file of a manifest that is too long for the blackboard.
//!
//! The file lies in the root. Its name has the id of its producer's node, so that the next start removes the file of a
//! killed producer.

use super::{Bus, Ipc};
use crate::BusError;
use iceoryx2::node::Node;
use schemas::manifest::MAX_JSON_BYTES;
use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

/// File of a long manifest; removed when this value is dropped.
pub(super) struct ManifestFile {
    path: PathBuf,
    name: String,
}

impl ManifestFile {
    /// Writes `json` for the producer that is registered as `node`. Call it with the lock of the bus held.
    pub(super) fn write(bus: &Bus, node: &Node<Ipc>, json: &[u8]) -> Result<Self, BusError> {
        let name = format!("{}{}.manifest", bus.prefix(), node.id().value());
        let path = bus.root().join(&name);
        let file = Self { path: path.clone(), name };
        let write = || File::options().write(true).create_new(true).mode(0o600).open(&path)?.write_all(json);
        write().map_err(|source| BusError::ManifestFile { path, source })?;
        Ok(file)
    }

    /// Name of the file in the root.
    pub(super) fn name(&self) -> &str {
        &self.name
    }
}

impl Drop for ManifestFile {
    fn drop(&mut self) {
        // what stays goes with the next start
        let _ = fs::remove_file(&self.path);
    }
}

/// Reads the manifest of `length` bytes from the file `name`, which is filled up with zeros; none if the file is gone.
pub(super) fn read(root: &Path, name: &[u8], length: usize) -> Option<Vec<u8>> {
    let name = std::str::from_utf8(name.split(|byte| *byte == 0).next()?).ok()?;
    if name.contains('/') || !name.ends_with(".manifest") || length > MAX_JSON_BYTES {
        return None;
    }
    let mut json = Vec::new();
    File::open(root.join(name)).ok()?.take(length as u64 + 1).read_to_end(&mut json).ok()?;
    (json.len() == length).then_some(json)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_files_in_the_root_are_manifests() {
        let root = tempfile::tempdir().expect("a folder");
        fs::write(root.path().join("a.manifest"), "{} ").expect("written");
        fs::write(root.path().join("secret"), "{} ").expect("written");
        let read = |name: &[u8], length| read(root.path(), name, length);
        assert_eq!(read(b"a.manifest\0\0", 3).as_deref(), Some(&b"{} "[..]));
        assert_eq!(read(b"a.manifest", 2), None, "it is longer");
        assert_eq!(read(b"a.manifest", 4), None, "it is shorter");
        assert_eq!(read(b"a.manifest", MAX_JSON_BYTES + 1), None);
        let outside = format!("../{}/a.manifest", root.path().file_name().unwrap_or_default().display());
        assert_eq!(read(outside.as_bytes(), 3), None);
        for name in [&b"secret"[..], b"b.manifest", b"\0", b"\xff.manifest"] {
            assert_eq!(read(name, 3), None, "{name:?}");
        }
    }
}
