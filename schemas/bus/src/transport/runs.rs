//! Lists the runs on the bus.

use super::board::BoardReader;
use super::position::Position;
use super::services::{self};
use super::wire::{RunStatus, STATE_DONE, STATE_FAILED, STATE_INTERRUPTED, STATE_RUNNING, STATE_WAITING};
use super::{Bus, Ipc};
use crate::{BusError, ConsumerInfo, Delivery, RunInfo, RunState};
use iceoryx2::node::Node;
use iceoryx2::prelude::{CallbackProgression, PortFactory as _, Service as _};
use schemas::manifest::{RunId, RunManifest};
use schemas::results::{ResultsName, Topic};
use schemas::run_name::RunName;
use std::time::{Duration, SystemTime};

impl ConsumerInfo {
    /// Makes the entry of a subscriber with a name like `lossless.energies.4711`.
    fn new(name: &str, position: Option<Position>) -> Self {
        let delivery = Delivery::of_name(name);
        let rest = name.strip_prefix(delivery.as_str()).unwrap_or(name).trim_start_matches(['.', '-', '_']);
        let (label, pid) = match rest.rsplit_once('.').map(|(label, pid)| (label, pid.parse().ok())) {
            Some((label, Some(pid))) => (label, Some(pid)),
            _ => (rest, None),
        };
        Self {
            label: label.to_owned(),
            delivery,
            pid,
            lag_frames: position.map(|position| position.behind),
            missed: position.map(|position| position.missed),
        }
    }
}

impl RunInfo {
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
            step_count: None,
            ends_in: None,
            consumers: Vec::new(),
        }
    }

    /// Adds the fields that take longer to find.
    fn look_closer(&mut self, bus: &Bus, node: &Node<Ipc>, board: &BoardReader, status: &RunStatus) {
        let manifest = board.manifest(status.stream()).and_then(|json| RunManifest::glance(&json).ok());
        if let Some(manifest) = manifest {
            self.step_count = Some(manifest.physics.step_count);
            let first_step = manifest.step_of_frame(status.first_frame);
            self.ends_in = time_left(status, first_step, manifest.physics.step_count)
                .filter(|_| self.state == RunState::Running);
        }
        self.consumers = consumers(bus, node, &self.name, status);
    }
}

/// Time for the rest of the run, at the mean speed from the first frame to the last one.
fn time_left(status: &RunStatus, first_step: u64, step_count: u64) -> Option<Duration> {
    let made = status.step.checked_sub(first_step).filter(|made| *made > 0)?;
    let elapsed_ns = status.written_unix_ns.checked_sub(status.began_unix_ns)?;
    let left = step_count.checked_sub(status.step)? as f64;
    let seconds = elapsed_ns as f64 / 1e9 * left / made as f64;
    Duration::try_from_secs_f64(seconds).ok().filter(|_| status.began_unix_ns > 0)
}

/// The living consumers of `run`, in the order of their names.
fn consumers(bus: &Bus, node: &Node<Ipc>, run: &RunName, status: &RunStatus) -> Vec<ConsumerInfo> {
    // gone since it was listed: nobody listens
    let Ok(Some(state)) = services::find_slices::<f64>(node, run, Topic::State) else { return Vec::new() };
    let mut found = Vec::new();
    state.dynamic_config().list_subscribers(|subscriber| {
        let name = subscriber.subscriber_name.as_str().to_owned();
        found.push((name, subscriber.subscriber_id.value(), subscriber.node_id.value().to_le_bytes()));
        CallbackProgression::Continue
    });
    found.retain(|(_, _, node)| bus.is_alive(*node));
    found.sort();
    let position = |id| Position::read(bus.root(), id, status.last_frame());
    found.iter().map(|(name, id, _)| ConsumerInfo::new(name, position(*id))).collect()
}

/// The names of the runs on the bus, in order.
pub(super) fn run_names(bus: &Bus) -> Result<Vec<RunName>, BusError> {
    in_services(bus, |name| name.strip_suffix("/manifest")?.parse().ok())
}

/// The results of `run` that have services, in order.
pub(super) fn results_of(bus: &Bus, run: &RunName) -> Result<Vec<ResultsName>, BusError> {
    in_services(bus, |name| name.strip_prefix(run.as_str())?.strip_prefix('/')?.parse().ok())
}

/// Everything that `find` finds in the names of all services, without `beadline/`: in order, each once.
fn in_services<T: Ord>(bus: &Bus, find: impl Fn(&str) -> Option<T>) -> Result<Vec<T>, BusError> {
    bus.clear_half_made();
    let mut found = Vec::new();
    let listed = Ipc::list(bus.config(), |details| {
        let name = details.static_details.name().as_str().strip_prefix("beadline/");
        found.extend(name.and_then(&find));
        CallbackProgression::Continue
    });
    listed.map_err(|e| BusError::service("beadline/*", "list", &e))?;
    found.sort();
    found.dedup();
    Ok(found)
}

/// Lists every run on the bus, by name, including runs that are over while consumers are still reading and runs whose
/// producer was killed. Neither disturbs runs nor cleans anything up.
///
/// # Errors
/// When the bus cannot be used.
pub fn list_runs(bus: &Bus) -> Result<Vec<RunInfo>, BusError> {
    each_run(bus, run_names(bus)?, |run, node, board, status| run.look_closer(bus, node, board, status))
}

/// The runs among `names` that are on the bus, without the fields that take longer to find.
pub(super) fn look_at(bus: &Bus, names: Vec<RunName>) -> Result<Vec<RunInfo>, BusError> {
    each_run(bus, names, |_, _, _, _| {})
}

fn each_run(
    bus: &Bus,
    names: Vec<RunName>,
    add: impl Fn(&mut RunInfo, &Node<Ipc>, &BoardReader, &RunStatus),
) -> Result<Vec<RunInfo>, BusError> {
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
        let mut run = RunInfo::new(name, &status, alive);
        add(&mut run, &node, &board, &status);
        runs.push(run);
    }
    Ok(runs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subscriber_says_by_its_name_who_it_is() {
        let known = Position { next_frame: 9, behind: 2, missed: 1 };
        let found = ConsumerInfo::new("lossless.energies.4711", Some(known));
        assert_eq!((found.label.as_str(), found.pid), ("energies", Some(4711)));
        assert_eq!((found.delivery, found.lag_frames, found.missed), (Delivery::Lossless, Some(2), Some(1)));
        let found = ConsumerInfo::new("latest-my.python", None);
        assert_eq!((found.label.as_str(), found.pid, found.lag_frames), ("my.python", None, None));
        assert_eq!(ConsumerInfo::new("somebody", None).label, "somebody");
    }

    #[test]
    fn the_rest_takes_as_long_for_each_step_as_those_before() {
        let second = 1_000_000_000;
        let status = RunStatus {
            step: 300,
            began_unix_ns: 100 * second,
            written_unix_ns: 102 * second,
            ..RunStatus::default()
        };
        assert_eq!(time_left(&status, 100, 700), Some(Duration::from_secs(4)));
        assert_eq!(time_left(&status, 300, 700), None, "no step was made yet");
        assert_eq!(time_left(&RunStatus { began_unix_ns: 0, ..status }, 100, 700), None);
    }
}
