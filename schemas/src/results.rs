//! Results of analyses: their topics and what the elements of a row mean.

mod columns;
mod topic;

pub use columns::{MOST_NAMES_BYTES, ResultColumns};
pub use topic::{OwnTopic, Topic};
