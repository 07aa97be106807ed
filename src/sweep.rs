//! A sweep in a directory: rows computed by any number of threads, processes and machines, and merged.
//!
//! - [`row`]: one point, a pure function of the sweep file and an index, from its [`analyses`] to its [`columns`]
//! - [`directory`]: what is where
//! - [`work`]: the workers of one process
//! - [`merge`]: the results, the same bytes whoever computed them in whatever order

mod analyses;
mod columns;
pub(crate) mod directory;
pub(crate) mod merge;
mod row;
pub(crate) mod work;

/// Bytes in hexadecimal.
fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
