//! Opens files that may be read without waiting for anybody.

use std::fs::{File, FileType, OpenOptions};
use std::io::{self, ErrorKind, Read as _};
use std::path::Path;
use system::{not_a_file, without_waiting};

/// Opens the regular file `path` for reading. A pipe, on which a reader waits for a writer, is refused, and so are sockets and
/// devices.
///
/// # Errors
/// When it is no regular file, or cannot be read.
pub fn open_file(path: &Path) -> io::Result<File> {
    // a device may do something when it is opened
    refuse(path.metadata()?.file_type())?;
    // it may be another one by now; `O_NONBLOCK` means nothing to a regular file
    let file = without_waiting(OpenOptions::new().read(true), true).open(path)?;
    refuse(file.metadata()?.file_type())?;
    Ok(file)
}

/// The bytes of the regular file `path`, at most `most_bytes`.
///
/// # Errors
/// When it is no regular file, is larger, or cannot be read.
pub fn read_file(path: &Path, most_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let read = open_file(path)?.take(most_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if read as u64 > most_bytes {
        let why = format!("it is larger than {most_bytes} bytes, the most that is read of such a file");
        return Err(io::Error::new(ErrorKind::FileTooLarge, why));
    }
    Ok(bytes)
}

/// Refuses anything but a file; the operating system refuses a directory when it is read.
fn refuse(found: FileType) -> io::Result<()> {
    match not_a_file(found) {
        None => Ok(()),
        Some(what) => {
            let why = format!("it is {what}, and no file; only regular files are read");
            Err(io::Error::new(ErrorKind::InvalidInput, why))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixListener;

    #[test]
    fn what_is_no_file_is_refused_at_once_and_named() {
        let dir = tempfile::tempdir().expect("temporary directory");
        let (pipe, socket, file) =
            (dir.path().join("pipe"), dir.path().join("socket"), dir.path().join("file"));
        let mode = rustix::fs::Mode::from_raw_mode(0o600);
        rustix::fs::mknodat(rustix::fs::CWD, &pipe, rustix::fs::FileType::Fifo, mode, 0).expect("made");
        let _listening = UnixListener::bind(&socket).expect("made");
        std::fs::write(&file, "text").expect("written");
        for (path, what) in
            [(pipe.as_path(), "a pipe (FIFO)"), (&socket, "a socket"), (Path::new("/dev/zero"), "a device")]
        {
            let error = open_file(path).expect_err("no file").to_string();
            assert!(error.contains(what) && error.contains("only regular files"), "{error}");
        }
        assert_eq!(read_file(&file, 4).expect("read"), b"text");
        assert!(read_file(&file, 3).expect_err("larger").to_string().contains("larger than 3 bytes"));
    }
}
