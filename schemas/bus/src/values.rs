//! Values that pass between the bus and its users.

#[cfg(feature = "live")]
use iceoryx2::prelude::ZeroCopySend as Element;
use schemas::frame::EndReason;
use schemas::manifest::RunId;
use schemas::results::RowValues;
use schemas::run_name::RunName;
use std::fmt::{self, Debug};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Samples that one consumer may hold at a time.
pub const BORROWED: usize = 2;

/// Kind of delivery that a consumer wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delivery {
    /// The consumer gets every frame, and holds the producer back.
    Lossless,
    /// The consumer never holds the producer back, keeps a short queue, and counts the frames that it misses.
    Latest,
}

impl Delivery {
    /// Word with which a subscriber's name begins.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Lossless => "lossless",
            Self::Latest => "latest",
        }
    }
}

/// Event that a producer may report about its consumers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ConsumerEvent {
    /// A consumer finished its handshake.
    Joined {
        /// Name of its subscriber.
        name: String,
    },
    /// A lossless consumer is alive, but took nothing for too long: it no longer holds the run back.
    Evicted {
        /// Name of its subscriber.
        name: String,
        /// Time for which the consumer held the run back.
        held: Duration,
    },
    /// Somebody removed or replaced the directory of the bus: attached consumers read on, and
    /// nobody else can attach.
    BusGone {
        /// The directory.
        root: PathBuf,
    },
    /// The remains of dead processes were cleaned up while a consumer held the run back.
    CleanedUp {
        /// Number of dead processes.
        dead: u64,
    },
}

/// Identity of a stream: one publishing of one run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StreamId {
    /// Id of the run.
    pub run_id: RunId,
    /// Id of the publishing.
    pub stream_id: u64,
}

impl StreamId {
    /// Makes the identity of a new publishing of `run_id`.
    pub fn new(run_id: RunId) -> Self {
        let bytes = RunId::random().0;
        // 64 random bits of a UUID: its two halves without the fixed version and variant positions
        let half = |at: usize| bytes[at..at + 8].iter().fold(0, |n, byte| n << 8 | u64::from(*byte));
        Self { run_id, stream_id: half(0) ^ half(8).rotate_left(29) }
    }
}

/// The remedies against known traps; tests switch one off to see that it is needed.
#[cfg(feature = "live")]
#[derive(Debug, Clone, Copy)]
#[cfg_attr(not(feature = "faults"), expect(unreachable_pub, reason = "tests reach it"))]
#[expect(clippy::struct_excessive_bools, reason = "independent switches")]
pub struct Remedies {
    /// Clean up dead processes while blocked.
    pub clean_while_blocked: bool,
    /// Send a frame again when the send was interrupted by a signal.
    pub resend: bool,
    /// Hold no entry of the blackboard for longer than an update.
    pub release_board: bool,
    /// Update connections in the handshake.
    pub connect_on_join: bool,
    /// Pause between two looks at a full queue, so that no core is kept busy.
    pub pause: bool,
    /// Number of times that a delivered send of a frame is treated as interrupted; a fault for tests, not a remedy.
    pub interruptions: u32,
}

#[cfg(feature = "live")]
impl Default for Remedies {
    fn default() -> Self {
        Self {
            clean_while_blocked: true,
            resend: true,
            release_board: true,
            connect_on_join: true,
            pause: true,
            interruptions: 0,
        }
    }
}

/// Options for publishing a run.
#[derive(Debug, Clone)]
pub struct PublishOptions {
    /// Number of the first frame that will be published.
    pub first_frame: u64,
    /// Longest time that a lossless consumer may take nothing before it is dropped. Default: 30 s.
    pub stuck_after: Duration,
    /// When set, a publish that is held back gives up with [`PublishError::Stopped`](crate::PublishError::Stopped).
    pub stop: Arc<AtomicBool>,
    /// Remedies that tests switch off.
    #[cfg(feature = "faults")]
    pub remedies: Remedies,
}

impl Default for PublishOptions {
    fn default() -> Self {
        Self {
            first_frame: 0,
            stuck_after: Duration::from_secs(30),
            stop: Arc::default(),
            #[cfg(feature = "faults")]
            remedies: Remedies::default(),
        }
    }
}

/// Result of a wait for consumers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WaitOutcome {
    /// Enough lossless consumers are ready.
    Ready,
    /// We were asked to stop.
    Stopped,
    /// The time is over; this many are ready.
    TimedOut {
        /// Lossless consumers that are ready.
        ready: usize,
    },
}

/// Counts of a publisher's work so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PublishCounts {
    /// Frames published.
    pub frames: u64,
    /// Lossless consumers that are ready.
    pub lossless: usize,
    /// Consumers with [`Delivery::Latest`].
    pub latest: usize,
    /// Lossless consumers dropped because they were stuck.
    pub evicted: u64,
    /// Frames sent again because a signal interrupted the first send.
    pub resent: u64,
    /// Time spent waiting for lossless consumers.
    pub held_back: Duration,
}

/// Why [`LiveSource::attach`](crate::LiveSource::attach) is waiting.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AttachNotice {
    /// No such run is being published; told once.
    WaitingForRun {
        /// Name of the run, if one was asked for.
        name: Option<RunName>,
    },
    /// The run is there, and the handshake with its producer comes next. Told before each try.
    Joining {
        /// Name of the run.
        name: RunName,
    },
    /// The run is there, but its producer does not answer yet: another consumer holds it back; told once.
    WaitingForAnswer {
        /// Name of the run.
        name: RunName,
    },
}

/// Options for attaching to a run.
#[derive(Clone)]
pub struct AttachOptions {
    /// Name of the consumer in messages, `energies` for instance; at most 30 characters count.
    pub label: String,
    /// Longest wait for a run. Default: for ever.
    pub timeout: Option<Duration>,
    /// When set, waiting ends, and the source ends with [`EndReason::Stopped`](schemas::frame::EndReason::Stopped).
    pub stop: Arc<AtomicBool>,
    /// Function that gets a notice of each thing that we wait for.
    pub notice: Arc<dyn Fn(&AttachNotice) + Send + Sync>,
}

impl Default for AttachOptions {
    fn default() -> Self {
        Self { label: "consumer".into(), timeout: None, stop: Arc::default(), notice: Arc::new(|_| {}) }
    }
}

/// Wait of this process for others that create something on the bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Waiting {
    /// Path of the lock.
    pub path: PathBuf,
    /// Process that holds the lock, as far as the kernel tells.
    pub holder: Option<u32>,
    /// Time waited so far.
    pub waited: Duration,
}

/// State of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunState {
    /// Waits for consumers before it starts.
    Waiting,
    /// Publishes frames.
    Running,
    /// Reached its last step.
    Done,
    /// Was asked to stop, and ended in order.
    Interrupted,
    /// Ended because of an error.
    Failed,
    /// Its producer was killed.
    Dead,
}

impl RunState {
    /// Word for the state.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Done => "done",
            Self::Interrupted => "interrupted",
            Self::Failed => "failed",
            Self::Dead => "dead",
        }
    }
}

impl fmt::Display for RunState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// One run, as `beadline ls` shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Name of the run.
    pub name: RunName,
    /// Identity of the run.
    pub run_id: RunId,
    /// State of the run.
    pub state: RunState,
    /// The last frame published.
    pub frame: Option<u64>,
    /// The step of that frame.
    pub step: u64,
    /// Simulated time of that frame (s).
    pub time_s: f64,
    /// Time since the producer last wrote its status.
    pub age: Duration,
    /// Lossless consumers that are ready.
    pub lossless: u64,
    /// Consumers with [`Delivery::Latest`].
    pub latest: u64,
    /// Lossless consumers that were dropped.
    pub evicted: u64,
    /// Process of the producer.
    pub pid: u64,
    /// Steps of the whole run; none if its manifest cannot be read.
    pub step_count: Option<u64>,
    /// The remaining time at the mean speed since the first frame.
    pub ends_in: Option<Duration>,
    /// Consumers of the run.
    pub consumers: Vec<ConsumerInfo>,
}

impl RunInfo {
    /// True if a consumer can attach.
    pub fn is_live(&self) -> bool {
        matches!(self.state, RunState::Waiting | RunState::Running)
    }
}

/// A consumer of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConsumerInfo {
    /// Label of the consumer, `energies` for instance.
    pub label: String,
    /// Delivery that the consumer wants.
    pub delivery: Delivery,
    /// Process of the consumer, if its name tells it.
    pub pid: Option<u64>,
    /// Published frames that the consumer does not have yet; none if it does not tell.
    pub lag_frames: Option<u64>,
    /// Frames that the consumer has missed; none if it does not tell.
    pub missed: Option<u64>,
}

/// Anything could lie in memory that is not shared.
#[cfg(not(feature = "live"))]
pub trait Element {}

#[cfg(not(feature = "live"))]
impl<T> Element for T {}

/// Element of a row: `f64` for numbers, `u8` for classes, one byte a contact.
pub trait ResultElement: Copy + Debug + Element + Send + Sync + 'static {
    /// True if the elements are classes of contacts.
    const ARE_CLASSES: bool;

    /// Values of a row of such elements.
    fn values(row: &[Self]) -> RowValues<'_>;
}

impl ResultElement for f64 {
    const ARE_CLASSES: bool = false;

    fn values(row: &[Self]) -> RowValues<'_> {
        RowValues::Numbers(row)
    }
}

impl ResultElement for u8 {
    const ARE_CLASSES: bool = true;

    fn values(row: &[Self]) -> RowValues<'_> {
        RowValues::Classes(row)
    }
}

/// One row of results, lent until the next call.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<'a> {
    /// The stream of frames it belongs to.
    pub stream: StreamId,
    /// The frame it belongs to.
    pub frame: u64,
    /// The step of that frame.
    pub step: u64,
    /// The time of that frame (s).
    pub time_s: f64,
    /// True if the row's publisher had rows before this one, received or not.
    pub follows: bool,
    /// The values.
    pub values: RowValues<'a>,
}

/// Next item for a subscriber to results.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ResultReceived<'a> {
    /// The next row.
    Row(Row<'a>),
    /// Rows of the frames `from` up to and including `to` did not reach us.
    Missed {
        /// First missing frame.
        from: u64,
        /// Last missing frame.
        to: u64,
    },
    /// No more rows come.
    End(EndReason),
}
