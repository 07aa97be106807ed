//! Opens a live run or a recording by its name: the beginning of every consumer.

use bus::{
    AttachError, AttachOptions, Bus, Delivery, LiveError, LiveSource, ResultPublisher, ResultsError,
    RootError,
};
use recording::{ReadError, RecordingSource};
use schemas::frame::{EndReason, FrameSource, Received};
use schemas::manifest::RunManifest;
use schemas::results::{ResultColumns, Topic};
use schemas::run_name::RunName;
use std::fmt;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The name of a source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Named {
    /// `live:RUN`, or `live` for the only live run.
    Live(Option<RunName>),
    /// A recording.
    File(PathBuf),
}

impl Named {
    /// The path of the recording, if it is one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::Live(_) => None,
            Self::File(path) => Some(path),
        }
    }
}

impl FromStr for Named {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.strip_prefix("live") {
            Some("") => Ok(Self::Live(None)),
            Some(run) if run.starts_with(':') => Ok(Self::Live(Some(run[1..].parse()?))),
            _ => Ok(Self::File(PathBuf::from(text))),
        }
    }
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Live(None) => f.write_str("live"),
            Self::Live(Some(run)) => write!(f, "live:{run}"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

/// A live run or a recording; consumers need not tell them apart.
///
/// ```no_run
/// use schemas::frame::{FrameSource, Received};
/// use source::Source;
///
/// let mut source = Source::open("live:light-impurity", &Default::default())?;
/// while let Received::Frame(frame) = source.receive()? {
///     let fastest_m_s = frame.v_m_s.iter().fold(0.0, |most, v| v.abs().max(most));
/// #   let _: f64 = fastest_m_s;
/// }
/// # Ok::<_, source::SourceError>(())
/// ```
pub enum Source {
    /// A live run.
    Live(Box<LiveSource>),
    /// A recording, and the flag that ends it early.
    File(Box<RecordingSource>, Arc<AtomicBool>),
}

/// The reason why there are no frames, or why results cannot be published.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// Not the name of a run or of results.
    #[error("{0}")]
    Name(String),
    /// The directory of the bus.
    #[error(transparent)]
    Root(#[from] RootError),
    /// The run.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// Its frames.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// The recording.
    #[error(transparent)]
    File(#[from] ReadError),
    /// The results.
    #[error(transparent)]
    Results(#[from] ResultsError),
}

impl Source {
    /// Opens `live` (the only live run), `live:RUN`, or else the recording of this name. Waits for a live
    /// run, and then gives every frame from the one at which it joined; see [`AttachOptions`].
    ///
    /// # Errors
    /// When nothing comes in time, when it is not clear which run is meant, or when it cannot be read.
    pub fn open(name: &str, options: &AttachOptions) -> Result<Self, SourceError> {
        match name.parse().map_err(SourceError::Name)? {
            Named::File(path) => Ok(Self::recording(&path, &options.stop)?),
            Named::Live(run) => {
                let live = LiveSource::attach(&Bus::from_env()?, run.as_ref(), Delivery::Lossless, options)?;
                Ok(Self::Live(Box::new(live)))
            }
        }
    }

    /// The frames of a recording, until `stop` is set.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn recording(path: &Path, stop: &Arc<AtomicBool>) -> Result<Self, ReadError> {
        Ok(Self::File(Box::new(RecordingSource::open(path)?), Arc::clone(stop)))
    }

    /// All states of a recording, also those between frames, until `stop` is set.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn all_states(path: &Path, stop: &Arc<AtomicBool>) -> Result<Self, ReadError> {
        Ok(Self::File(Box::new(RecordingSource::open_all(path)?), Arc::clone(stop)))
    }

    /// Goes to the last state at or before the first of `steps`, if it is a recording, and ends with the first one at or after the
    /// last of them.
    ///
    /// # Errors
    /// When the recording cannot be read.
    pub fn seek(&mut self, steps: &RangeInclusive<u64>) -> Result<(), ReadError> {
        let Self::File(file, _) = self else { return Ok(()) };
        if *steps.end() < file.manifest().physics.step_count {
            file.end_at(*steps.end());
        }
        if *steps.start() > 0 { file.seek_to_step(*steps.start()) } else { Ok(()) }
    }

    /// The flag that ends a recording early; none for a live run.
    pub fn stop(&self) -> Option<&Arc<AtomicBool>> {
        match self {
            Self::Live(_) => None,
            Self::File(_, stop) => Some(stop),
        }
    }

    /// The flag that ends the source early, whatever it is.
    pub fn flag(&self) -> &Arc<AtomicBool> {
        match self {
            Self::Live(live) => live.stop(),
            Self::File(_, stop) => stop,
        }
    }

    /// A publisher of results called `name`, as `own/NAME` on the bus of a live run; none for a recording.
    ///
    /// # Errors
    /// When the name or the columns ([`ResultColumns::fields`]) are invalid, when another process publishes
    /// these results, or when the bus cannot be used.
    pub fn results(
        &self,
        name: &str,
        columns: &ResultColumns,
    ) -> Result<Option<ResultPublisher<f64>>, SourceError> {
        let topic = Topic::own(name).map_err(SourceError::Name)?;
        match self {
            Self::Live(live) => Ok(Some(live.results(topic, columns)?)),
            Self::File(..) => Ok(None),
        }
    }
}

impl FrameSource for Source {
    type Error = SourceError;

    fn manifest(&self) -> &RunManifest {
        match self {
            Self::Live(live) => live.manifest(),
            Self::File(file, _) => file.manifest(),
        }
    }

    fn receive(&mut self) -> Result<Received<'_>, SourceError> {
        match self {
            Self::Live(live) => Ok(live.receive()?),
            Self::File(_, stop) if stop.load(Ordering::Relaxed) => Ok(Received::End(EndReason::Stopped)),
            Self::File(file, _) => Ok(file.receive()?),
        }
    }
}
