//! Sources of an analysis's frames, as the user names them.

use crate::args::FramesArgs;
use crate::failure::{BadInput, Failure};
use crate::threads;
use bus::{AttachError, AttachNotice, AttachOptions, Bus, Delivery, LiveSource};
use producer::resimulation::{Lend, ParallelError, ParallelResimulation, Resimulation, ResimulationError};
use schemas::frame::{EndReason, FrameSource, Received, Window};
use schemas::manifest::RunManifest;
use schemas::run_name::RunName;
use source::{Source, SourceError};
use std::num::NonZero;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A source as it is, or with missing steps recomputed.
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

/// Errors of any kind of source.
pub(crate) type FramesError = ResimulationError<SourceError>;

/// True if a recording is to blame, and not a live run.
pub(crate) fn is_of_a_file(error: &FramesError) -> bool {
    matches!(error, ResimulationError::Source(SourceError::File(_)) | ResimulationError::Differs(_))
}

impl Frames {
    /// The part of `source` that the flags ask for, at least that in `window`.
    pub(crate) fn of(mut source: Source, args: &FramesArgs, window: Window) -> Result<Self, Failure> {
        let steps = window.steps(source.manifest());
        let first_step = *steps.start();
        source.seek(&steps).bad_input()?;
        let lend = if args.every_step { Lend::Steps } else { Lend::Frames };
        if args.from_start || args.every_step || args.fill_gaps {
            return Self::recomputed(source, lend, args.from_start, first_step, args.jobs);
        }
        Ok(Self::as_they_come(source))
    }

    /// The states that `source` holds, and nothing else.
    pub(crate) fn as_they_come(source: Source) -> Self {
        Self { stop: source.stop().cloned(), states: States::AsTheyCome(source) }
    }

    /// The states of `source` and those between, from step `first_step` on, all of them proven. A sparse file
    /// is recomputed by `jobs` threads, by default one for each core; a full one and a live run by this one.
    pub(crate) fn recomputed(
        source: Source,
        lend: Lend,
        from_start: bool,
        first_step: u64,
        jobs: Option<NonZero<usize>>,
    ) -> Result<Self, Failure> {
        let (stop, flag) = (source.stop().cloned(), Arc::clone(source.flag()));
        let jobs = threads::or_cores(jobs);
        let pays = ParallelResimulation::<Source>::pays(source.manifest());
        // where the system grants no thread, this one computes; the one that tries must be gone before others take its place
        let threads = || std::thread::Builder::new().spawn(|| ()).is_ok_and(|thread| thread.join().is_ok());
        let states = if stop.is_some() && pays && jobs > NonZero::<usize>::MIN && threads() {
            let make = if from_start { ParallelResimulation::from_start } else { ParallelResimulation::new };
            let states = make(source, lend, jobs).map_err(|error| match error {
                ParallelError::Kernel(other) => Failure::BadInput(other.into()),
                refused @ ParallelError::NoThread(_) => Failure::Failed(refused.into()),
            })?;
            let states = states.lending_from(first_step).stopped_by(flag);
            States::InParallel(Box::new(states))
        } else {
            let make = if from_start { Resimulation::from_start } else { Resimulation::new };
            let states = make(source, lend).bad_input()?.lending_from(first_step).stopped_by(flag);
            // compute nothing for a file's claim about its end; a live run has really reached it
            let states = if stop.is_some() { states.ending_with_the_last_state() } else { states };
            States::Recomputed(Box::new(states))
        };
        Ok(Self { states, stop })
    }
}

impl FrameSource for Frames {
    type Error = FramesError;

    fn manifest(&self) -> &RunManifest {
        match &self.states {
            States::AsTheyCome(source) => source.manifest(),
            States::Recomputed(resimulation) => resimulation.manifest(),
            States::InParallel(resimulation) => resimulation.manifest(),
        }
    }

    fn receive(&mut self) -> Result<Received<'_>, FramesError> {
        if self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
            return Ok(Received::End(EndReason::Stopped));
        }
        match &mut self.states {
            States::AsTheyCome(source) => source.receive().map_err(ResimulationError::Source),
            States::Recomputed(resimulation) => resimulation.receive(),
            States::InParallel(resimulation) => resimulation.receive(),
        }
    }
}

/// Prints a notice about the cause of an attachment's wait.
pub(crate) fn tell(notice: &AttachNotice) {
    match notice {
        AttachNotice::WaitingForRun { name: Some(name) } => {
            notice!("waiting for the run {name}");
        }
        AttachNotice::WaitingForRun { name: None } => {
            notice!("waiting for a run; start one with `beadline run`");
        }
        AttachNotice::Joining { .. } => {}
        AttachNotice::WaitingForAnswer { name } => {
            notice!("the run {name} does not answer yet: a consumer holds it back");
        }
    }
}

/// Attaches to a live run as the consumer `label`, with every frame or the `latest`, and tells `notice` why it waits.
pub(crate) fn attach(
    bus: &Bus,
    name: Option<&RunName>,
    label: &str,
    (latest, timeout_s): (bool, Option<f64>),
    stop: &Arc<AtomicBool>,
    notice: impl Fn(&AttachNotice) + Send + Sync + 'static,
) -> Result<LiveSource, Failure> {
    let options = AttachOptions {
        label: label.to_owned(),
        timeout: timeout_s.map(Duration::from_secs_f64),
        stop: Arc::clone(stop),
        notice: Arc::new(notice),
    };
    let delivery = if latest { Delivery::Latest } else { Delivery::Lossless };
    LiveSource::attach(bus, name, delivery, &options).map_err(|error| match error {
        error @ AttachError::SeveralRuns { .. } => bad_input!("{error}, as in `beadline {label} live:NAME`"),
        error => error.into(),
    })
}
