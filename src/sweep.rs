//! A sweep in a directory: rows computed by any number of threads, processes and machines, and merged.
//!
//! - [`row`]: one point, a pure function of the sweep file and an index
//! - [`directory`]: what is where
//! - [`work`]: the workers of one process
//! - [`merge`]: the results, the same bytes whoever computed them in whatever order

pub(crate) mod directory;
pub(crate) mod merge;
pub(crate) mod row;
pub(crate) mod work;
