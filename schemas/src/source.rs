//! Frames by the name of where they come from: what a consumer of one's own begins with.

use crate::bus::{
    AttachError, AttachOptions, Bus, Delivery, LiveError, LiveSource, ResultColumns, ResultPublisher,
    ResultsError, RootError, Topic,
};
use crate::frame::{FrameSource, Received};
use crate::manifest::RunManifest;
use crate::recording::{ReadError, RecordingSource};
use std::path::Path;

/// A live run or a recording: a consumer need not tell them apart.
///
/// ```no_run
/// use schemas::frame::{FrameSource, Received};
/// use schemas::source::Source;
///
/// let mut source = Source::open("live:light-impurity", &Default::default())?;
/// while let Received::Frame(frame) = source.receive()? {
///     let fastest_m_s = frame.v_m_s.iter().fold(0.0, |most, v| v.abs().max(most));
/// #   let _: f64 = fastest_m_s;
/// }
/// # Ok::<_, schemas::source::SourceError>(())
/// ```
pub enum Source {
    /// A live run.
    Live(Box<LiveSource>),
    /// A recording.
    File(Box<RecordingSource>),
}

/// Why there are no frames, or why results cannot be published.
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
    /// Opens `live` (the only live run), `live:RUN`, or else the recording of this name. A live run is waited for,
    /// and every frame of it comes, from the one on with which it was joined; see [`AttachOptions`].
    ///
    /// # Errors
    /// When nothing comes in time, when it is not clear which run is meant, or when it cannot be read.
    pub fn open(name: &str, options: &AttachOptions) -> Result<Self, SourceError> {
        let run = match name.strip_prefix("live") {
            Some("") => None,
            Some(run) if run.starts_with(':') => Some(run[1..].parse().map_err(SourceError::Name)?),
            _ => return Ok(Self::File(Box::new(RecordingSource::open(Path::new(name))?))),
        };
        let bus = Bus::from_env()?;
        let live = LiveSource::attach(&bus, run.as_ref(), Delivery::Lossless, options)?;
        Ok(Self::Live(Box::new(live)))
    }

    /// A publisher of results called `name`, as `own/NAME` on the bus of a live run; none for a recording.
    ///
    /// # Errors
    /// When this is no name, when the columns are none ([`ResultColumns::fields`]), when another process publishes
    /// these results, or when the bus cannot be used.
    pub fn results(
        &self,
        name: &str,
        columns: &ResultColumns,
    ) -> Result<Option<ResultPublisher<f64>>, SourceError> {
        let topic = Topic::own(name).map_err(SourceError::Name)?;
        match self {
            Self::Live(live) => Ok(Some(live.results(topic, columns)?)),
            Self::File(_) => Ok(None),
        }
    }
}

impl FrameSource for Source {
    type Error = SourceError;

    fn manifest(&self) -> &RunManifest {
        match self {
            Self::Live(live) => live.manifest(),
            Self::File(file) => file.manifest(),
        }
    }

    fn receive(&mut self) -> Result<Received<'_>, SourceError> {
        match self {
            Self::Live(live) => Ok(live.receive()?),
            Self::File(file) => Ok(file.receive()?),
        }
    }
}
