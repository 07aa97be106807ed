//! Results of analyses: their topics and what the elements of a row mean.

mod columns;
mod kinds;
mod topic;

pub use columns::{MOST_NAMES_BYTES, ResultColumns};
pub use kinds::{ENERGIES, MOTION, MOTION_FIELDS, PULSE};
pub use topic::{OwnTopic, Topic};
