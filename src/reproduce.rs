//! What `beadline reproduce` is made of: the runs in their cache, the workers, the report.

pub(crate) mod cache;
pub(crate) mod markdown;
pub(crate) mod progress;
pub(crate) mod report;
pub(crate) mod workers;
