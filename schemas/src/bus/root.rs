//! Where the sockets and the service descriptions of one user live.

use iceoryx2::prelude::{Config, FileName, Path as IoxPath, SemanticString};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

/// Longest root: a socket's path is the root, `/`, the prefix (11), an id (39) and `.event` (6), and must
/// fit the 107 bytes that the kernel allows.
pub(super) const MAX_ROOT_BYTES: usize = 107 - 1 - 11 - 39 - 6;

/// Why a directory cannot be the root of a bus.
#[derive(Debug, thiserror::Error)]
pub enum RootError {
    /// The paths of the sockets in it would be too long for the kernel.
    #[error(
        "the bus directory {path} has a name of {length} bytes, at most {MAX_ROOT_BYTES} fit a socket's path; \
         set BEADLINE_ROOT to a shorter one"
    )]
    TooLong {
        /// The directory.
        path: PathBuf,
        /// Its length in bytes.
        length: usize,
    },
    /// Not a directory, or a link to one.
    #[error("the bus directory {path} is not a directory of its own; remove it or set BEADLINE_ROOT")]
    NotADirectory {
        /// The path.
        path: PathBuf,
    },
    /// Somebody else's directory.
    #[error(
        "the bus directory {path} belongs to user {owner}, but this is user {user}; \
         set BEADLINE_ROOT to a directory of your own"
    )]
    NotOurs {
        /// The directory.
        path: PathBuf,
        /// Who it belongs to.
        owner: u32,
        /// Who we are.
        user: u32,
    },
    /// Others may enter it.
    #[error(
        "the bus directory {path} has mode {mode:o}, expected 700: others could join; run `chmod 700 {path}`"
    )]
    TooOpen {
        /// The directory.
        path: PathBuf,
        /// Its permission bits.
        mode: u32,
    },
    /// A name that iceoryx2 does not accept.
    #[error("the bus directory {path} has a name that cannot be used; use letters, digits, `-`, `_` and `.`")]
    Name {
        /// The directory.
        path: PathBuf,
    },
    /// It could not be created or read.
    #[error("the bus directory {path} cannot be used")]
    Io {
        /// The directory.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// `$BEADLINE_ROOT`, or else `/tmp/beadline-<uid>`.
pub(super) fn default_root() -> PathBuf {
    match std::env::var_os("BEADLINE_ROOT") {
        Some(root) if !root.is_empty() => PathBuf::from(root),
        _ => PathBuf::from(format!("/tmp/beadline-{}", rustix::process::getuid().as_raw())),
    }
}

/// Creates `path` if it is missing, checks that it is ours alone, and resolves links in its parents.
pub(super) fn prepare(path: &Path) -> Result<PathBuf, RootError> {
    let io = |source| RootError::Io { path: path.to_owned(), source };
    match std::fs::DirBuilder::new().mode(0o700).create(path) {
        Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
        other => other.map_err(io)?,
    }
    let found = std::fs::symlink_metadata(path).map_err(io)?;
    if !found.is_dir() {
        return Err(RootError::NotADirectory { path: path.to_owned() });
    }
    let user = rustix::process::getuid().as_raw();
    if found.uid() != user {
        return Err(RootError::NotOurs { path: path.to_owned(), owner: found.uid(), user });
    }
    let mode = found.mode() & 0o777;
    if mode & 0o077 != 0 {
        return Err(RootError::TooOpen { path: path.to_owned(), mode });
    }
    let path = path.canonicalize().map_err(io)?;
    let length = path.as_os_str().len();
    if length > MAX_ROOT_BYTES {
        return Err(RootError::TooLong { path, length });
    }
    Ok(path)
}

/// What every file in `/dev/shm` of this root begins with: `bl`, the first 8 hexadecimal digits of the
/// SHA-256 of the root's real path, `_`.
pub(super) fn prefix(root: &Path) -> String {
    let hash = Sha256::digest(root.as_os_str().as_encoded_bytes());
    let mut prefix = String::from("bl");
    for byte in &hash[..4] {
        // writing to a String cannot fail
        let _ = write!(prefix, "{byte:02x}");
    }
    prefix.push('_');
    prefix
}

/// The iceoryx2 configuration of `root`; nothing is read from configuration files.
pub(super) fn config(root: &Path) -> Result<Config, RootError> {
    let name = || RootError::Name { path: root.to_owned() };
    let mut config = Config::default();
    let path = IoxPath::new(root.as_os_str().as_encoded_bytes()).map_err(|_| name())?;
    config.global.set_root_path(&path);
    config.global.prefix = FileName::new(prefix(root).as_bytes()).map_err(|_| name())?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_root_that_others_can_enter_is_refused() {
        let dir = tempfile::tempdir().expect("temporary directory");
        let root = dir.path().join("root");
        prepare(&root).expect("created");
        assert_eq!(std::fs::metadata(&root).expect("exists").mode() & 0o777, 0o700);
        std::fs::set_permissions(&root, PermissionsExt::from_mode(0o750)).expect("chmod");
        let error = prepare(&root).expect_err("too open");
        assert!(error.to_string().contains("750") && error.to_string().contains("chmod 700"), "{error}");
    }

    #[test]
    fn a_link_a_file_and_a_long_path_are_refused() {
        let dir = tempfile::tempdir().expect("temporary directory");
        std::fs::write(dir.path().join("file"), "").expect("written");
        assert!(matches!(prepare(&dir.path().join("file")), Err(RootError::NotADirectory { .. })));
        std::os::unix::fs::symlink(dir.path(), dir.path().join("link")).expect("linked");
        assert!(matches!(prepare(&dir.path().join("link")), Err(RootError::NotADirectory { .. })));
        let long = dir.path().join("x".repeat(60));
        assert!(matches!(prepare(&long), Err(RootError::TooLong { length, .. }) if length > MAX_ROOT_BYTES));
    }

    /// `python3 -c "import hashlib;print(hashlib.sha256(b'/tmp/beadline-1000').hexdigest()[:8])"`
    #[test]
    fn the_prefix_is_what_a_foreign_program_computes() {
        assert_eq!(prefix(Path::new("/tmp/beadline-1000")), "bl51800e7e_");
    }
}
