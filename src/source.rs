//! Where an analysis gets its frames from, as the user names it.

use crate::args::AnalysisArgs;
use crate::display;
use crate::failure::{BadInput, Failure};
use anyhow::anyhow;
use producer::resimulation::{Difference, Lend, Resimulation, ResimulationError};
use schemas::bus::{AttachError, AttachNotice, AttachOptions, Bus, Delivery, LiveError, LiveSource};
use schemas::frame::{EndReason, FrameSource, Received};
use schemas::manifest::RunManifest;
use schemas::recording::{ReadError, RecordingSource};
use schemas::run_name::RunName;
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
pub(crate) enum Frames {
    AsTheyCome(Source),
    Recomputed(Box<Resimulation<Source>>),
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
    /// What of `source` the flags ask for.
    pub(crate) fn of(source: Source, args: &AnalysisArgs) -> Result<Self, Failure> {
        let lend = if args.every_step { Lend::Steps } else { Lend::Frames };
        if args.from_start {
            Ok(Self::Recomputed(Box::new(Resimulation::from_start(source, lend).bad_input()?)))
        } else if args.every_step || args.fill_gaps {
            Ok(Self::Recomputed(Box::new(Resimulation::new(source, lend).bad_input()?)))
        } else {
            Ok(Self::AsTheyCome(source))
        }
    }
}

impl FrameSource for Frames {
    type Error = SourceFailure;

    fn manifest(&self) -> &RunManifest {
        match self {
            Self::AsTheyCome(source) => source.manifest(),
            Self::Recomputed(resimulation) => resimulation.manifest(),
        }
    }

    fn receive(&mut self) -> Result<Received<'_>, SourceFailure> {
        match self {
            Self::AsTheyCome(source) => source.receive(),
            Self::Recomputed(resimulation) => resimulation.receive().map_err(|error| match error {
                ResimulationError::Source(failure) => failure,
                ResimulationError::Differs(difference) => SourceFailure::Differs(difference),
            }),
        }
    }
}

impl Source {
    /// Opens a recording; `stop` ends it early.
    pub(crate) fn open(path: &Path, stop: &Arc<AtomicBool>) -> Result<Self, Failure> {
        let recording = RecordingSource::open(path).bad_input()?;
        Ok(Self::File(Box::new(recording), Arc::clone(stop)))
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
    args: &AnalysisArgs,
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
