//! Errors of the bus.

use schemas::manifest::{ManifestError, ManifestTooLong, RunId, SchemaVersion};
use schemas::results::Topic;
use schemas::run_name::RunName;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// Longest root: a socket's path is the root, `/`, the prefix (17), an id (39) and `.event` (6), and must
/// fit the 107 bytes that the kernel allows.
pub(crate) const MAX_ROOT_BYTES: usize = 107 - 1 - 17 - 39 - 6;

/// Bytes that a process needs to register itself and attach to a run.
pub(crate) const LEAST_BYTES: u64 = 1 << 20;

/// Why the bus cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The directory of the bus cannot be used.
    #[error(transparent)]
    Root(#[from] RootError),
    /// This process could not register itself.
    #[error("cannot register on the bus in {root}: {cause}; check that the directory is writable")]
    Node {
        /// Root of the bus.
        root: String,
        /// Error from iceoryx2.
        cause: String,
    },
    /// The segment that all processes share cannot be used.
    #[error(transparent)]
    SharedSegment(#[from] SharedSegmentError),
    /// Shared memory is short.
    #[error(transparent)]
    Room(#[from] RoomError),
    /// The file of a long manifest cannot be written.
    #[error("cannot write {path}, the manifest of the run")]
    ManifestFile {
        /// The file.
        path: PathBuf,
        /// Error from the system.
        source: std::io::Error,
    },
    /// We were asked to stop while others held the lock.
    #[error("stopped while other processes were starting")]
    Stopped,
    /// The lock cannot be taken, so nothing can be created on the bus.
    #[error("cannot lock {path}: {cause}; see who holds it with `fuser {path}`")]
    Locked {
        /// The lock file.
        path: PathBuf,
        /// Cause of the failure.
        cause: String,
    },
    /// A service could not be used.
    #[error("cannot {doing} {service}: {cause}")]
    Service {
        /// Name of the service.
        service: String,
        /// Attempted action, `open` for instance.
        doing: &'static str,
        /// Error from iceoryx2.
        cause: String,
    },
    /// A service has another schema version.
    #[error(
        "{service} has schema version {found}, this program speaks {expected}; use the same Beadline on both sides"
    )]
    Version {
        /// Name of the service.
        service: String,
        /// Version of the service.
        found: String,
        /// Version of this program.
        expected: SchemaVersion,
    },
}

/// Why a directory cannot be the root of a bus.
#[derive(Debug, thiserror::Error)]
pub enum RootError {
    /// This build has no bus.
    #[error(
        "this beadline was built without live streams: record runs with `beadline run`, and give the file in the place of \
         `live`; with Rust from rustup.rs on Linux, `cargo install --git {} beadline` installs one that has them",
        env!("CARGO_PKG_REPOSITORY")
    )]
    Absent,
    /// The paths of the sockets in it would be too long for the kernel.
    #[error(
        "the path of the bus directory {path} has {length} bytes, at most {MAX_ROOT_BYTES} fit a socket's path; \
         set BEADLINE_ROOT to a shorter one"
    )]
    TooLong {
        /// The directory.
        path: PathBuf,
        /// Length of the path in bytes.
        length: usize,
    },
    /// The path is not a directory, or is a link to one.
    #[error("the bus directory {path} is not a directory of its own; remove it or set BEADLINE_ROOT")]
    NotADirectory {
        /// The path.
        path: PathBuf,
    },
    /// The directory belongs to somebody else.
    #[error(
        "the bus directory {path} belongs to {owner}, but this is user {user}; \
         set BEADLINE_ROOT to a directory of your own"
    )]
    NotOurs {
        /// The directory.
        path: PathBuf,
        /// Owner of the directory.
        owner: String,
        /// Id of this user.
        user: u32,
    },
    /// Others may enter the directory.
    #[error(
        "the bus directory {path} has mode {mode:o}, expected 700: others could join; run `chmod 700 {path}`"
    )]
    TooOpen {
        /// The directory.
        path: PathBuf,
        /// Permission bits of the directory.
        mode: u32,
    },
    /// The secret could not be read or made.
    #[error("cannot make the secret {path}: {cause}; check that the directory is writable")]
    Secret {
        /// The file.
        path: PathBuf,
        /// Cause of the failure.
        cause: String,
    },
    /// iceoryx2 does not accept the directory's name.
    #[error("the bus directory {path} has a name that cannot be used; use letters, digits, `-`, `_` and `.`")]
    Name {
        /// The directory.
        path: PathBuf,
    },
    /// The directory could not be created or read.
    #[error("the bus directory {path} cannot be used")]
    Io {
        /// The directory.
        path: PathBuf,
        /// Error from the system.
        source: std::io::Error,
    },
}

/// Why a run does not fit into shared memory.
#[derive(Debug, thiserror::Error)]
pub enum RoomError {
    /// Too little is free.
    #[error(
        "publishing this run needs {needed_bytes} bytes of shared memory, {free_bytes} are free in {path}; \
         free some, enlarge it (docker: --shm-size), or publish fewer beads"
    )]
    Full {
        /// Directory of shared memory.
        path: PathBuf,
        /// Bytes that the run takes when it starts.
        needed_bytes: u64,
        /// Bytes that are free.
        free_bytes: u64,
    },
    /// The system refused for another reason.
    #[error("cannot take {needed_bytes} bytes of shared memory for {path}")]
    Reserve {
        /// The segment.
        path: PathBuf,
        /// Size of the segment.
        needed_bytes: u64,
        /// Error from the system.
        source: std::io::Error,
    },
    /// Next to nothing is free.
    #[error(
        "using the bus needs {LEAST_BYTES} bytes of shared memory, {free_bytes} are free in {path}; \
         free some, or enlarge it (docker: --shm-size)"
    )]
    Least {
        /// Directory of shared memory.
        path: PathBuf,
        /// Bytes that are free.
        free_bytes: u64,
    },
    /// The file system could not be asked.
    #[error("cannot find out how much shared memory is free in {path}")]
    Io {
        /// Directory of shared memory.
        path: PathBuf,
        /// Error from the system.
        source: std::io::Error,
    },
}

/// Why the segment that all processes share cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SharedSegmentError {
    /// Somebody else's file has the segment's name.
    #[error(
        "{path} belongs to {owner}, and nothing can begin on this bus; have it removed, or remove {secret} when \
         nothing runs: the next start then takes another name"
    )]
    NotOurs {
        /// The file.
        path: PathBuf,
        /// Owner of the file.
        owner: String,
        /// File of the secret, from which the name is made.
        secret: PathBuf,
    },
    /// The segment could not be made.
    #[error("cannot make {path}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Error from the system.
        source: std::io::Error,
    },
}

/// Why we could not attach.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// Error of the bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// No run came in time.
    #[error("no run{} was published within {:.1} s; start one with `beadline run`", named(.name.as_ref()), waited.as_secs_f64())]
    Timeout {
        /// The run asked for.
        name: Option<RunName>,
        /// Time waited.
        waited: Duration,
    },
    /// More than one run is being published, and none was named.
    #[error("several runs are being published, name one: {}", join_names(.names))]
    SeveralRuns {
        /// Names of the runs.
        names: Vec<RunName>,
    },
    /// We were asked to stop.
    #[error("stopped while waiting for a run")]
    Stopped,
    /// The manifest that the producer published cannot be read.
    #[error("run {name} cannot be read")]
    Manifest {
        /// The run.
        name: RunName,
        /// Error in the manifest.
        source: ManifestError,
    },
    /// No more consumers can attach.
    #[error(
        "run {name} already has as many consumers as it can; end one, or record the run and read the file"
    )]
    Full {
        /// The run.
        name: RunName,
    },
}

fn named(name: Option<&RunName>) -> String {
    name.map(|name| format!(" {name}")).unwrap_or_default()
}

fn join_names(names: &[RunName]) -> String {
    names.iter().map(RunName::as_str).collect::<Vec<_>>().join(", ")
}

/// Why frames can no longer be received.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// iceoryx2 could not receive.
    #[error("run {name}: frames can no longer be received: {cause}")]
    Receive {
        /// The run.
        name: RunName,
        /// Error from iceoryx2.
        cause: String,
    },
    /// A frame has another length than the manifest's.
    #[error("run {name}: frame {frame} has {found} values, its manifest says {expected}")]
    Shape {
        /// The run.
        name: RunName,
        /// The frame.
        frame: u64,
        /// Values expected.
        expected: usize,
        /// Values found.
        found: usize,
    },
}

/// Why a run cannot be published.
#[derive(Debug, thiserror::Error)]
pub enum PublishError {
    /// Error of the bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// Another producer has this name.
    #[error(
        "run {name} is being published already: run id {run_id}, process {pid}; use another name, or end it"
    )]
    NameTaken {
        /// The name.
        name: RunName,
        /// The other run.
        run_id: RunId,
        /// The other producer's process.
        pid: u64,
        /// Start of the other run.
        started: SystemTime,
    },
    /// The manifest is so long that no consumer would read it.
    #[error(transparent)]
    ManifestTooLong(#[from] ManifestTooLong),
    /// A frame has another number of values than the run's frames.
    #[error("frame {frame} has {found} values, the run's frames have {expected}")]
    Shape {
        /// Number of the frame.
        frame: u64,
        /// Values expected.
        expected: usize,
        /// Values found.
        found: usize,
    },
    /// A frame does not follow the one before it: consumers would take the gap for a loss.
    #[error("frame {found} was published where frame {expected} was expected")]
    Order {
        /// Number of the expected frame.
        expected: u64,
        /// Number of the frame that came.
        found: u64,
    },
    /// The run would wait for more consumers than can attach.
    #[error(
        "this run cannot wait for {asked} lossless consumers: at most {most} can attach (fewer when frames \
         are large and shared memory is short); wait for {most} or fewer"
    )]
    TooManyConsumers {
        /// Number of consumers to wait for.
        asked: usize,
        /// Most consumers that can be attached at a time.
        most: usize,
    },
    /// We were asked to stop while a consumer held the run back; not every consumer got the frame.
    #[error("stopped while a consumer held the run back at frame {frame}")]
    Stopped {
        /// Number of the frame.
        frame: u64,
    },
    /// The frame could not be sent.
    #[error("frame {frame} could not be sent: {cause}")]
    Send {
        /// Number of the frame.
        frame: u64,
        /// Error from iceoryx2.
        cause: String,
    },
}

/// Why results cannot be published or read.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// A recording could not describe the rows, or the topic has no rows.
    #[error("{topic}: {what}")]
    Columns {
        /// Topic of the results.
        topic: Topic,
        /// Reason for the refusal.
        what: String,
    },
    /// Error of the bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// Another process publishes these results already; this process can go on without publishing them.
    #[error("{topic} of run {name} are already published by another process")]
    AlreadyPublished {
        /// The run.
        name: RunName,
        /// Topic of the results.
        topic: Topic,
    },
    /// Subscribers to earlier results with other columns keep the service as it was.
    #[error(
        "{topic} of run {name} had other columns before ({found}, now {expected}), and still has subscribers \
         to those; end them"
    )]
    OtherColumns {
        /// The run.
        name: RunName,
        /// Topic of the results.
        topic: Topic,
        /// Elements in a row now.
        expected: usize,
        /// Elements in a row before.
        found: usize,
    },
    /// A row has another width.
    #[error("frame {frame}: a row of {found} elements, expected {expected}")]
    Width {
        /// The frame.
        frame: u64,
        /// Elements expected.
        expected: usize,
        /// Elements found.
        found: usize,
    },
    /// We were asked to stop while a subscriber held us back.
    #[error("stopped while a subscriber to {topic} held us back")]
    Stopped {
        /// Topic of the results.
        topic: Topic,
    },
    /// Sending or receiving failed.
    #[error("{topic}: {cause}")]
    Port {
        /// Topic of the results.
        topic: Topic,
        /// Error from iceoryx2.
        cause: String,
    },
}
