//! Resources that the system grants this process, and the messages when they are not enough.

#[cfg(unix)]
mod unix;
#[cfg(not(unix))]
mod unlimited;

#[cfg(unix)]
pub(crate) use unix::{compute_beside_others, explain, prepare, stdout_was_closed};
#[cfg(not(unix))]
pub(crate) use unlimited::{compute_beside_others, explain, prepare, stdout_was_closed};
