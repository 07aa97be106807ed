//! Results of analyses on the bus: one row per frame.

mod publisher;
mod subscriber;
mod watch;

pub use publisher::ResultPublisher;
pub use subscriber::{ResultReceived, ResultSubscriber, Row};
pub use watch::ResultsWatch;

use super::BusError;
use super::services::{SliceService, attribute};
use iceoryx2::prelude::{PortFactory as _, ZeroCopySend};
use schemas::results::{ResultColumns, RowValues, Topic};
use schemas::run_name::RunName;
use std::fmt::Debug;

const COLUMNS_KEY: &str = "beadline.columns";
const WIDTH_KEY: &str = "beadline.width";
const TOLERANCE_KEY: &str = "beadline.tolerance_m";

/// Element of a row: `f64` for numbers, `u8` for classes, one byte a contact.
pub trait ResultElement: Copy + Debug + ZeroCopySend + Send + Sync + 'static {
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

/// Attributes of a service that describe the elements of its rows.
fn attributes_of(columns: &ResultColumns) -> Vec<(&'static str, String)> {
    let ResultColumns { width, names, tolerance_m } = columns;
    let tolerance = tolerance_m.map(|m| (TOLERANCE_KEY, format!("{m:e}")));
    [(COLUMNS_KEY, names.clone()), (WIDTH_KEY, width.to_string())].into_iter().chain(tolerance).collect()
}

/// Columns that the attributes of `service` describe.
fn columns_of<T: ResultElement>(service: &SliceService<T>) -> ResultColumns {
    let attribute = |key| attribute(service.attributes(), key);
    let tolerance_m = || attribute(TOLERANCE_KEY).and_then(|m| m.parse().ok()).unwrap_or(f64::NAN);
    ResultColumns {
        width: attribute(WIDTH_KEY).and_then(|width| width.parse().ok()).unwrap_or(0),
        names: attribute(COLUMNS_KEY).unwrap_or_default(),
        tolerance_m: T::ARE_CLASSES.then(tolerance_m),
    }
}
