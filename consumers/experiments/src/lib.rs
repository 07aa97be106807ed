//! Runs and what looks at them, in one process and without a bus.
//!
//! - [`row`]: a point of a sweep, a pure function of the sweep file and an index
//! - `measures`: numbers of any analysis that a row has when it is asked for them by name
//! - [`series`]: columns of any analysis over time
//! - [`ensemble`]: what the rows of points have in common that differ in one key
//! - [`compare`]: a run and its twins, side by side
//! - [`recorded`]: a run that goes into a file
//! - [`pool`]: jobs shared out among threads

mod columns;
pub mod compare;
pub mod ensemble;
mod measures;
mod point;
pub mod pool;
mod prepare;
pub mod recorded;
pub mod row;
pub mod series;

pub use columns::{ERROR_COLUMN, columns, parameter_cell};
pub use prepare::{files_of, prepared};

use producer::sweep::Hooks;

/// The hooks that sweeps need.
pub const HOOKS: Hooks = Hooks { prepare: prepared, measure: measures::check };
