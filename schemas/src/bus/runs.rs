//! Which runs are on the bus.

use super::board::BoardReader;
use super::own_topic::OwnTopic;
use super::wire::{RunStatus, STATE_DONE, STATE_FAILED, STATE_INTERRUPTED, STATE_RUNNING, STATE_WAITING};
use super::{Bus, BusError, Ipc};
use crate::manifest::RunId;
use crate::run_name::RunName;
use iceoryx2::prelude::{CallbackProgression, Service as _};
use std::fmt;
use std::time::{Duration, SystemTime};

/// How far a run is.
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
    /// The word for it.
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
    /// Its name.
    pub name: RunName,
    /// Its identity.
    pub run_id: RunId,
    /// How far it is.
    pub state: RunState,
    /// The last frame published.
    pub frame: Option<u64>,
    /// The step of that frame.
    pub step: u64,
    /// Simulated time of that frame (s).
    pub time_s: f64,
    /// How long ago the producer last wrote its status.
    pub age: Duration,
    /// Lossless consumers that are ready.
    pub lossless: u64,
    /// Consumers that take what there is.
    pub latest: u64,
    /// Lossless consumers that were dropped.
    pub evicted: u64,
    /// Process of the producer.
    pub pid: u64,
}

impl RunInfo {
    /// Whether a consumer can attach.
    pub fn is_live(&self) -> bool {
        matches!(self.state, RunState::Waiting | RunState::Running)
    }

    fn new(name: RunName, status: &RunStatus, alive: bool) -> Self {
        let state = match status.state {
            STATE_DONE => RunState::Done,
            STATE_INTERRUPTED => RunState::Interrupted,
            STATE_FAILED => RunState::Failed,
            _ if !alive => RunState::Dead,
            STATE_WAITING => RunState::Waiting,
            STATE_RUNNING.. => RunState::Running,
        };
        let written = SystemTime::UNIX_EPOCH + Duration::from_nanos(status.written_unix_ns);
        Self {
            name,
            run_id: RunId(status.run_id),
            state,
            frame: status.last_frame(),
            step: status.step,
            time_s: status.time_s,
            age: SystemTime::now().duration_since(written).unwrap_or_default(),
            lossless: status.lossless,
            latest: status.latest,
            evicted: status.evicted,
            pid: status.pid,
        }
    }
}

/// The names of the runs on the bus, in order.
pub(super) fn run_names(bus: &Bus) -> Result<Vec<RunName>, BusError> {
    let mut names: Vec<RunName> = Vec::new();
    each_service(bus, |name| {
        let run = name.strip_suffix("/manifest");
        names.extend(run.and_then(|run| run.parse::<RunName>().ok()));
    })?;
    names.sort();
    names.dedup();
    Ok(names)
}

/// The topics of `run` that are not ours, in order.
pub(super) fn own_topics(bus: &Bus, run: &RunName) -> Result<Vec<OwnTopic>, BusError> {
    let mut topics: Vec<OwnTopic> = Vec::new();
    each_service(bus, |name| {
        let own = name.strip_prefix(run.as_str()).and_then(|topic| topic.strip_prefix("/own/"));
        topics.extend(own.and_then(|own| own.parse::<OwnTopic>().ok()));
    })?;
    topics.sort_by(|one, other| one.as_str().cmp(other.as_str()));
    topics.dedup();
    Ok(topics)
}

/// Tells `see` the name of every service, without `beadline/`.
fn each_service(bus: &Bus, mut see: impl FnMut(&str)) -> Result<(), BusError> {
    bus.clear_half_made();
    let listed = Ipc::list(bus.config(), |details| {
        if let Some(name) = details.static_details.name().as_str().strip_prefix("beadline/") {
            see(name);
        }
        CallbackProgression::Continue
    });
    listed.map_err(|e| BusError::service("beadline/*", "list", &e))
}

/// Every run on the bus, by name: also those that are over while consumers are still reading, and those
/// whose producer was killed. Neither disturbs runs nor cleans anything up.
///
/// # Errors
/// When the bus cannot be used.
pub fn list_runs(bus: &Bus) -> Result<Vec<RunInfo>, BusError> {
    look_at(bus, run_names(bus)?)
}

/// Those of `names` that are on the bus.
pub(super) fn look_at(bus: &Bus, names: Vec<RunName>) -> Result<Vec<RunInfo>, BusError> {
    if names.is_empty() {
        return Ok(Vec::new());
    }
    let node = bus.observer()?;
    let mut runs = Vec::new();
    for name in names {
        // gone, or of another version, since it was listed: nothing to show
        let Ok(Some(board)) = BoardReader::find(&node, &name) else { continue };
        let status = board.status();
        let alive = bus.is_alive(status.node_id);
        runs.push(RunInfo::new(name, &status, alive));
    }
    Ok(runs)
}
