//! Results of analyses on the bus: one row per frame.

mod publisher;
mod subscriber;
mod watch;

pub use publisher::ResultPublisher;
pub use subscriber::ResultSubscriber;
pub use watch::ResultsWatch;

use super::services::{SliceService, attribute};
use crate::ResultElement;
use iceoryx2::prelude::PortFactory as _;
use schemas::results::ResultColumns;

const COLUMNS_KEY: &str = "beadline.columns";
const WIDTH_KEY: &str = "beadline.width";
const TOLERANCE_KEY: &str = "beadline.tolerance_m";

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
