//! Results of analyses: their topics, their rows, and what the elements of a row mean.

mod columns;
mod kinds;
mod row;
mod things;
mod topic;

pub use columns::{MOST_NAMES_BYTES, ResultColumns};
pub use kinds::{ENERGIES, MOTION, PULSE};
pub use row::{KeptValues, ResultRow, RowValues};
pub use things::{Things, ThingsNumbers};
pub use topic::{ResultsName, Topic};
