//! What `beadline reproduce` is made of: the runs in their cache, the workers, the sweep of the energy figures, the report.

pub(crate) mod cache;
pub(crate) mod markdown;
pub(crate) mod progress;
pub(crate) mod reflection;
pub(crate) mod report;
pub(crate) mod workers;
