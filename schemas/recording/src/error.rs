//! Errors of recordings.

use schemas::manifest::{ManifestError, ManifestTooLong};
use schemas::whole_file::WholeFileError;
use std::io;
use std::path::{Path, PathBuf};

/// Why a recording cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file cannot be created or renamed.
    #[error(transparent)]
    File(WholeFileError),
    /// An unfinished recording has this name.
    #[error(
        "{path} exists: an unfinished recording; read it as it is (`beadline info {path}`), move it away, or \
         replace it with --force",
        path = path.display()
    )]
    PartialExists {
        /// The file in the way.
        path: PathBuf,
    },
    /// The interrupted recording of a run that was being resumed has this name.
    #[error(
        "{path} exists: the recording of an interrupted run. Finish the run (`beadline run --resume {path}`), move the \
         file away, or choose another name; --force does not replace it",
        path = path.display()
    )]
    InterruptedExists {
        /// The file in the way.
        path: PathBuf,
    },
    /// The disk cannot hold what a run will write.
    #[error(
        "not enough space in {}: this recording takes at least {}, {} are free; record fewer \
         steps (record_every_steps) or choose another directory",
        directory.display(), Bytes(*needed_bytes), Bytes(*free_bytes)
    )]
    NoSpace {
        /// The directory of the recording.
        directory: PathBuf,
        /// The least that it takes.
        needed_bytes: u64,
        /// Free space in that directory.
        free_bytes: u64,
    },
    /// The file system there stores no files.
    #[error("{} is on a file system that stores no files, like /proc or /sys; choose another directory", directory.display())]
    NoDisk {
        /// The directory of the recording.
        directory: PathBuf,
    },
    /// The operating system refused.
    #[error("cannot write {}", path.display())]
    Io {
        /// The file being written.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// The operating system refused, and frames accepted after the last whole chunk are lost.
    #[error("cannot write {}: the last {lost_frames} accepted frames are not in it", path.display())]
    Lost {
        /// The file being written.
        path: PathBuf,
        /// Frames accepted, but not written.
        lost_frames: u64,
        /// The operating system's error.
        source: io::Error,
    },
    /// Its manifest could not be read again.
    #[error(transparent)]
    Manifest(#[from] ManifestTooLong),
    /// A frame that this recording cannot hold.
    #[error("frame {frame} (step {step}) does not fit into {}: {what}", path.display())]
    Frame {
        /// The recording.
        path: PathBuf,
        /// The frame.
        frame: u64,
        /// Its step.
        step: u64,
        /// The expected and the found value.
        what: String,
    },
    /// Writing failed before; the recording takes nothing more.
    #[error("{} was given up after a write error", path.display())]
    GivenUp {
        /// The recording.
        path: PathBuf,
    },
}

impl From<WholeFileError> for WriteError {
    fn from(error: WholeFileError) -> Self {
        match error {
            WholeFileError::PartialExists { path } => Self::PartialExists { path },
            other => Self::File(other),
        }
    }
}

impl WriteError {
    /// True if an existing file is in the way, so that another name must be chosen.
    pub fn is_in_the_way(&self) -> bool {
        match self {
            Self::File(error) => error.is_in_the_way(),
            Self::PartialExists { .. } | Self::InterruptedExists { .. } | Self::NoDisk { .. } => true,
            _ => false,
        }
    }

    /// For `map_err`: an error of the operating system about `path`.
    pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}

/// Why a recording cannot be read. Everything read before stays valid.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The operating system refused.
    #[error("cannot read {}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// Not an MCAP file.
    #[error("{} is not an MCAP file, so it is not a recording{}", path.display(), instead(path))]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// MCAP, but not ours.
    #[error("{} is an MCAP file, but not a Beadline recording: {what}", path.display())]
    NotBeadline {
        /// The file.
        path: PathBuf,
        /// The expected and the found contents.
        what: String,
    },
    /// A recording of ours without the topic that was looked for.
    #[error("{} holds no `{topic}` channel, only {found}", path.display())]
    NoChannel {
        /// The file.
        path: PathBuf,
        /// The topic that was looked for.
        topic: &'static str,
        /// The topics in the file.
        found: String,
    },
    /// The manifest cannot be used; the message names both versions if it is too new.
    #[error("cannot read {}", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// The error in the manifest.
        source: ManifestError,
    },
    /// The manifest was changed after it was written.
    #[error(
        "{} is damaged: the manifest's checksum is {found}, its contents give {computed}", path.display()
    )]
    ManifestChecksum {
        /// The file.
        path: PathBuf,
        /// The checksum in the file.
        found: String,
        /// The checksum of the file's contents.
        computed: String,
    },
    /// A checksum is wrong.
    #[error(
        "{} is damaged: the CRC of {part} is {computed:08x} instead of {found:08x}; copy it again \
         from its source, or save what is left with `beadline recover`", path.display()
    )]
    Crc {
        /// The file.
        path: PathBuf,
        /// The damaged part, with its offset.
        part: String,
        /// The checksum in the file.
        found: u32,
        /// The checksum of the file's contents.
        computed: u32,
    },
    /// Something in the file is wrong.
    #[error("{} is damaged at byte {offset}: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Offset of the damage from the start of the file: of a record, or of the chunk that holds the message.
        offset: u64,
        /// The expected and the found contents.
        what: String,
    },
}

impl ReadError {
    /// For `map_err`: an error of the operating system about `path`.
    pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    pub(super) fn damaged(path: &Path, offset: u64, what: impl Into<String>) -> Self {
        Self::Damaged { path: path.to_owned(), offset, what: what.into() }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        match self {
            Self::Io { path, .. }
            | Self::NotMcap { path }
            | Self::NotBeadline { path, .. }
            | Self::NoChannel { path, .. }
            | Self::Manifest { path, .. }
            | Self::ManifestChecksum { path, .. }
            | Self::Crc { path, .. }
            | Self::Damaged { path, .. } => path,
        }
    }

    /// Offset of the damage from the start of the file, if it is in one place.
    pub fn byte(&self) -> Option<u64> {
        match self {
            Self::Damaged { offset, .. } => Some(*offset),
            _ => None,
        }
    }
}

/// Advice about a file that is not a recording, judged by its name.
fn instead(path: &Path) -> &'static str {
    match path.extension().and_then(|end| end.to_str()).unwrap_or_default() {
        "csv" | "parquet" => {
            "; a table of a sweep, an analysis or an export is for pandas, Polars, DuckDB, gnuplot or a spreadsheet, and \
             figures are drawn from the recording (.mcap) that it was made from"
        }
        "npz" | "h5" | "hdf5" | "h5md" => {
            "; an export is for other programs; name the recording (.mcap) that it was made from"
        }
        "toml" => "; give a configuration to `beadline run`, a sweep file to `beadline sweep`",
        _ => "; recordings are the .mcap files that `beadline run` and `beadline record` write",
    }
}

/// A size for a message, in decimal units as disks are sold and listed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bytes(pub(super) u64);

impl std::fmt::Display for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(bytes) = *self;
        match bytes {
            0..1000 => write!(f, "{bytes} B"),
            1000..1_000_000 => write!(f, "{:.1} kB", bytes as f64 / 1e3),
            1_000_000..1_000_000_000 => write!(f, "{:.1} MB", bytes as f64 / 1e6),
            _ => write!(f, "{:.1} GB", bytes as f64 / 1e9),
        }
    }
}
