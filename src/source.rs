//! Where an analysis gets its frames from, as the user names it.

use crate::args::FramesArgs;
use crate::display;
use crate::failure::{BadInput, Failure};
use anyhow::anyhow;
use producer::resimulation::{Difference, Lend, ParallelResimulation, Resimulation, ResimulationError};
use schemas::bus::{AttachError, AttachNotice, AttachOptions, Bus, Delivery, LiveError, LiveSource};
use schemas::frame::{EndReason, FrameSource, Received};
use schemas::manifest::RunManifest;
use schemas::recording::{ReadError, RecordingSource};
use schemas::run_name::RunName;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A source as named on the command line.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Named {
    /// A live run; the only one if it is not named.
    Live(Option<RunName>),
    /// A recording.
    File(PathBuf),
}

impl Named {
    /// Reads `live`, `live:RUN` or a path.
    pub(crate) fn parse(text: &str) -> Result<Self, Failure> {
        match text.strip_prefix("live") {
            Some("") => Ok(Self::Live(None)),
            Some(rest) if rest.starts_with(':') => {
                let name = rest[1..].parse().map_err(|error: String| anyhow!(error)).bad_input()?;
                Ok(Self::Live(Some(name)))
            }
            _ => Ok(Self::File(PathBuf::from(text))),
        }
    }
}

/// A source of frames of either kind.
pub(crate) enum Source {
    Live(Box<LiveSource>),
    File(Box<RecordingSource>, Arc<AtomicBool>),
}

/// A source as it is, or with what it does not hold recomputed.
pub(crate) struct Frames {
    states: States,
    /// Ends a recording early, also between recorded states.
    stop: Option<Arc<AtomicBool>>,
}

enum States {
    AsTheyCome(Source),
    Recomputed(Box<Resimulation<Source>>),
    InParallel(Box<ParallelResimulation<Source>>),
}

/// What goes wrong in any kind of source.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SourceFailure {
    #[error(transparent)]
    Live(LiveError),
    #[error(transparent)]
    File(ReadError),
    #[error(transparent)]
    Differs(Difference),
}

impl Frames {
    /// What of `source` the flags ask for, at least from the time `from_s` on.
    pub(crate) fn of(mut source: Source, args: &FramesArgs, from_s: f64) -> Result<Self, Failure> {
        let first_step = source.manifest().physics.step_at_or_after(from_s);
        source.seek(first_step)?;
        let lend = if args.every_step { Lend::Steps } else { Lend::Frames };
        if args.from_start || args.every_step || args.fill_gaps {
            return Self::recomputed(source, lend, args.from_start, first_step, args.jobs);
        }
        Ok(Self::as_they_come(source))
    }

    /// What `source` holds, and nothing else.
    pub(crate) fn as_they_come(source: Source) -> Self {
        Self { stop: source.stop(), states: States::AsTheyCome(source) }
    }

    /// What `source` holds and what lies between, from step `first_step` on, all of it proven. A sparse file
    /// is recomputed by `jobs` threads, by default one for each core; a full one and a live run by this one.
    pub(crate) fn recomputed(
        source: Source,
        lend: Lend,
        from_start: bool,
        first_step: u64,
        jobs: Option<NonZero<usize>>,
    ) -> Result<Self, Failure> {
        let stop = source.stop();
        let cores = || std::thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
        let jobs = jobs.unwrap_or_else(cores);
        let pays = ParallelResimulation::<Source>::pays(source.manifest());
        // where the system grants no thread, this one computes
        let threads = || std::thread::Builder::new().spawn(|| ()).is_ok();
        let states = if stop.is_some() && pays && jobs > NonZero::<usize>::MIN && threads() {
            let make = if from_start { ParallelResimulation::from_start } else { ParallelResimulation::new };
            let states = make(source, lend, jobs).bad_input()?.lending_from(first_step);
            States::InParallel(Box::new(states))
        } else {
            let make = if from_start { Resimulation::from_start } else { Resimulation::new };
            let states = make(source, lend).bad_input()?.lending_from(first_step);
            // what a file says of its end is no work for us; a live run has made it
            let states = if stop.is_some() { states.ending_with_the_last_state() } else { states };
            States::Recomputed(Box::new(states))
        };
        Ok(Self { states, stop })
    }
}

impl FrameSource for Frames {
    type Error = SourceFailure;

    fn manifest(&self) -> &RunManifest {
        match &self.states {
            States::AsTheyCome(source) => source.manifest(),
            States::Recomputed(resimulation) => resimulation.manifest(),
            States::InParallel(resimulation) => resimulation.manifest(),
        }
    }

    fn receive(&mut self) -> Result<Received<'_>, SourceFailure> {
        if self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
            return Ok(Received::End(EndReason::Stopped));
        }
        match &mut self.states {
            States::AsTheyCome(source) => source.receive(),
            States::Recomputed(resimulation) => resimulation.receive().map_err(SourceFailure::of),
            States::InParallel(resimulation) => resimulation.receive().map_err(SourceFailure::of),
        }
    }
}

impl SourceFailure {
    fn of(error: ResimulationError<Self>) -> Self {
        match error {
            ResimulationError::Source(failure) => failure,
            ResimulationError::Differs(difference) => Self::Differs(difference),
        }
    }
}

impl Source {
    /// Opens a recording with its frames; `stop` ends it early.
    pub(crate) fn open(path: &Path, stop: &Arc<AtomicBool>) -> Result<Self, Failure> {
        let recording = RecordingSource::open(path).bad_input()?;
        Ok(Self::File(Box::new(recording), Arc::clone(stop)))
    }

    /// Opens a recording with all of its states, also those between frames.
    pub(crate) fn open_all(path: &Path, stop: &Arc<AtomicBool>) -> Result<Self, Failure> {
        let recording = RecordingSource::open_all(path).bad_input()?;
        Ok(Self::File(Box::new(recording), Arc::clone(stop)))
    }

    /// Goes to the last state at or before `step`, if it is a recording.
    pub(crate) fn seek(&mut self, step: u64) -> Result<(), Failure> {
        match self {
            Self::File(file, _) if step > 0 => file.seek_to_step(step).bad_input(),
            Self::File(..) | Self::Live(_) => Ok(()),
        }
    }

    /// What ends it early, if it is a recording.
    fn stop(&self) -> Option<Arc<AtomicBool>> {
        match self {
            Self::Live(_) => None,
            Self::File(_, stop) => Some(Arc::clone(stop)),
        }
    }
}

impl FrameSource for Source {
    type Error = SourceFailure;

    fn manifest(&self) -> &RunManifest {
        match self {
            Self::Live(live) => live.manifest(),
            Self::File(file, _) => file.manifest(),
        }
    }

    fn receive(&mut self) -> Result<Received<'_>, SourceFailure> {
        match self {
            Self::Live(live) => live.receive().map_err(SourceFailure::Live),
            Self::File(_, stop) if stop.load(Ordering::Relaxed) => Ok(Received::End(EndReason::Stopped)),
            Self::File(file, _) => file.receive().map_err(SourceFailure::File),
        }
    }
}

/// Attaches to a live run, with a notice while there is none.
pub(crate) fn attach(
    bus: &Bus,
    name: Option<&RunName>,
    args: &FramesArgs,
    label: &str,
    stop: &Arc<AtomicBool>,
) -> Result<LiveSource, Failure> {
    let options = AttachOptions {
        label: label.to_owned(),
        timeout: args.timeout.map(Duration::from_secs_f64),
        stop: Arc::clone(stop),
        notice: Arc::new(tell),
    };
    let delivery = if args.latest { Delivery::Latest } else { Delivery::Lossless };
    attach_with(bus, name, delivery, &options)
}

/// Says what an attachment waits for.
pub(crate) fn tell(notice: &AttachNotice) {
    match notice {
        AttachNotice::WaitingForRun { name: Some(name) } => {
            display::notice(format_args!("waiting for the run {name}"));
        }
        AttachNotice::WaitingForRun { name: None } => {
            display::notice("waiting for a run; start one with `beadline run`");
        }
        AttachNotice::Joining { .. } => {}
        AttachNotice::WaitingForAnswer { name } => {
            display::notice(format_args!("the run {name} does not answer yet: a consumer holds it back"));
        }
    }
}

/// Attaches to a live run.
pub(crate) fn attach_with(
    bus: &Bus,
    name: Option<&RunName>,
    delivery: Delivery,
    options: &AttachOptions,
) -> Result<LiveSource, Failure> {
    match LiveSource::attach(bus, name, delivery, options) {
        Ok(live) => Ok(live),
        Err(error @ AttachError::SeveralRuns { .. }) => {
            Err(Failure::BadInput(anyhow!("{error}, as in `beadline {} live:NAME`", options.label)))
        }
        Err(error) => Err(error.into()),
    }
}
