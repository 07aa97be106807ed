//! Directory of the sockets and the service descriptions of one user.

use super::creating::CreationLock;
use crate::RootError;
use crate::errors::MAX_ROOT_BYTES;
use iceoryx2::prelude::{Config, FileName, Path as IoxPath, SemanticString};
use sha2::{Digest, Sha256};
use std::fs::Metadata;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

/// Letters of a secret, five bits each; letters that differ only in case would not be safe everywhere.
const SECRET_LETTERS: &[u8; 32] = b"abcdefghijklmnopqrstuvwxyz234567";
const SECRET_LENGTH: usize = 8;

/// Default root: `$BEADLINE_ROOT`, or else `beadline` in `$XDG_RUNTIME_DIR`, or else `/tmp/beadline-<uid>`.
pub(super) fn default_root() -> PathBuf {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    set("BEADLINE_ROOT").unwrap_or_else(|| root_of_user(set("XDG_RUNTIME_DIR").as_deref()))
}

/// Root of this user: in the runtime directory, if that is this user's alone and short enough; else in `/tmp`.
fn root_of_user(runtime: Option<&Path>) -> PathBuf {
    let user = rustix::process::getuid().as_raw();
    let is_private = |mode: u32| mode & 0o777 & !0o700 == 0;
    let is_ours = |found: Metadata| found.is_dir() && found.uid() == user && is_private(found.mode());
    let runtime = runtime.filter(|path| path.is_absolute()).and_then(|path| path.canonicalize().ok());
    let runtime = runtime.filter(|path| std::fs::metadata(path).is_ok_and(is_ours));
    let root = runtime.map(|path| path.join("beadline"));
    let root = root.filter(|root| root.as_os_str().len() <= MAX_ROOT_BYTES);
    root.unwrap_or_else(|| PathBuf::from(format!("/tmp/beadline-{user}")))
}

/// Name of a user in messages.
pub(super) fn user_name(uid: u32) -> String {
    let passwd = std::fs::read_to_string("/etc/passwd").unwrap_or_default();
    let of_line = |line: &str| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(uid)).then(|| format!("user {name} ({uid})"))
    };
    passwd.lines().find_map(of_line).unwrap_or_else(|| format!("user {uid}"))
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
        return Err(RootError::NotOurs { path: path.to_owned(), owner: user_name(found.uid()), user });
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

/// Path of the secret of a root.
pub(super) fn secret_path(root: &Path) -> PathBuf {
    root.join("secret")
}

/// Reads the secret of this root, or makes it if there is none. Nobody else can read it, so nobody else can take a name
/// on the bus beforehand.
pub(super) fn secret(root: &Path) -> Result<String, RootError> {
    let path = secret_path(root);
    let failed = |cause: &dyn std::fmt::Display| {
        let cause = cause.to_string();
        RootError::Secret { path: path.clone(), cause }
    };
    let read = || std::fs::read_to_string(&path).ok().filter(|text| is_secret(text));
    if let Some(secret) = read() {
        return Ok(secret);
    }
    let lock = CreationLock::take(root).map_err(|e| failed(&e))?;
    if !lock.is_exclusive() {
        return Err(failed(&"who is making it was stopped; let it go on, or end it"));
    }
    if let Some(secret) = read() {
        return Ok(secret);
    }
    let random = uuid::Uuid::new_v4();
    let letters = random.as_bytes()[8..].iter().map(|byte| SECRET_LETTERS[usize::from(byte % 32)]);
    let secret: String = letters.map(char::from).collect();
    let new = root.join("secret.new");
    std::fs::write(&new, &secret).and_then(|()| std::fs::rename(&new, &path)).map_err(|e| failed(&e))?;
    Ok(secret)
}

fn is_secret(text: &str) -> bool {
    text.len() == SECRET_LENGTH && text.bytes().all(|byte| SECRET_LETTERS.contains(&byte))
}

/// Prefix of the names in `/dev/shm` of a root with any secret: `bl`, and the first 6 hexadecimal
/// digits of the SHA-256 of the root's real path.
pub(super) fn family(root: &Path) -> String {
    let hash = Sha256::digest(root.as_os_str().as_encoded_bytes());
    let [first, second, third, ..]: [u8; 32] = hash.into();
    format!("bl{first:02x}{second:02x}{third:02x}")
}

/// Prefix of every file in `/dev/shm` of this root: its family, its secret, `_`.
pub(super) fn prefix(root: &Path, secret: &str) -> String {
    format!("{}{secret}_", family(root))
}

/// The iceoryx2 configuration of `root`; nothing is read from configuration files.
pub(super) fn config(root: &Path, prefix: &str) -> Result<Config, RootError> {
    let name = || RootError::Name { path: root.to_owned() };
    let mut config = Config::default();
    let path = IoxPath::new(root.as_os_str().as_encoded_bytes()).map_err(|_| name())?;
    config.global.set_root_path(&path);
    config.global.prefix = FileName::new(prefix.as_bytes()).map_err(|_| name())?;
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

    #[test]
    fn the_runtime_directory_is_taken_when_it_is_ours_alone_and_short() {
        let dir = tempfile::Builder::new().prefix("bl").tempdir_in("/tmp").expect("temporary directory");
        let runtime = dir.path().join("run");
        std::fs::create_dir(&runtime).expect("created");
        std::fs::set_permissions(&runtime, PermissionsExt::from_mode(0o700)).expect("chmod");
        assert_eq!(root_of_user(Some(&runtime)), runtime.join("beadline"));
        let fallback = PathBuf::from(format!("/tmp/beadline-{}", rustix::process::getuid().as_raw()));
        assert_eq!(root_of_user(None), fallback);
        assert_eq!(root_of_user(Some(Path::new("run"))), fallback);
        assert_eq!(root_of_user(Some(&dir.path().join("none"))), fallback);
        let long = runtime.join("x".repeat(40));
        std::fs::create_dir(&long).expect("created");
        std::fs::set_permissions(&long, PermissionsExt::from_mode(0o700)).expect("chmod");
        assert_eq!(root_of_user(Some(&long)), fallback);
        std::fs::set_permissions(&runtime, PermissionsExt::from_mode(0o750)).expect("chmod");
        assert_eq!(root_of_user(Some(&runtime)), fallback);
    }

    #[test]
    fn a_secret_stays_until_it_is_spoilt() {
        let dir = tempfile::Builder::new().prefix("bl").tempdir_in("/tmp").expect("temporary directory");
        let first = secret(dir.path()).expect("made");
        assert!(is_secret(&first), "{first}");
        assert_eq!(secret(dir.path()).expect("read"), first);
        std::fs::write(secret_path(dir.path()), "").expect("written");
        let second = secret(dir.path()).expect("made");
        assert!(is_secret(&second) && second != first, "{first} {second}");
        assert!(!dir.path().join("secret.new").exists());
    }

    #[test]
    fn owners_have_names() {
        assert_eq!(user_name(0), "user root (0)");
        assert_eq!(user_name(3_999_999_999), "user 3999999999");
    }

    /// `python3 -c "import hashlib;print(hashlib.sha256(b'/tmp/beadline-1000').hexdigest()[:6])"`
    #[test]
    fn the_prefix_is_what_a_foreign_program_computes() {
        assert_eq!(prefix(Path::new("/tmp/beadline-1000"), "abcdefgh"), "bl51800eabcdefgh_");
    }
}
