//! What the time step costs in energies.
//!
//! A run knows its own error: the total energy must not change, and it does. The largest relative error of the total
//! over the frames, |ΔE/E|, is of the size of the error of every part of the energy that has come to rest, because the
//! same collisions make both. [`STEP_SAFETY`] times as much covers the difference to a step that is four times shorter
//! in every case of `docs/NUMERICS.md`. Rounding adds a unit in the last place for every bead.
//!
//! It does not cover the parts while energy crosses from one to the other: then what counts is when.

/// The error of a part of the energy, in largest errors of the total.
pub const STEP_SAFETY: f64 = 3.0;

/// How far a part of the energy of a chain of `beads` may be off for the time step and rounding (J), where the total
/// `total_j` (J) was off by up to the part `max_abs_drift` so far.
pub fn step_error_j(total_j: f64, max_abs_drift: f64, beads: u64) -> f64 {
    total_j * (STEP_SAFETY * max_abs_drift + beads as f64 * f64::EPSILON)
}
