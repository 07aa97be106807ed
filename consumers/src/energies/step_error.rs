//! Errors of energies from the time step.
//!
//! A run knows its own error: the total energy, with the dissipated energy and without the work of drives, must not
//! change, and it does. Its largest error has the size of the error of every part of the energy that has come to rest,
//! because the same collisions make both. [`STEP_SAFETY`] times as much covers the difference to a step that is four
//! times shorter in every case of `docs/NUMERICS.md`. Rounding adds a unit in the last place for every bead.
//!
//! It does not cover the parts while energy crosses from one to the other: then the time matters. It also does not
//! cover the work of drives and of damping, which may be as wrong as the energy that it became.

/// The error of a part of the energy, in largest errors of the total.
pub const STEP_SAFETY: f64 = 3.0;

/// The error (J) that time step and rounding may give a part of the energy of a chain of `beads`, where the balance of energies was off by
/// up to `off_j` (J) so far, and the largest term of that balance was `largest_j` (J).
pub fn step_error_j(off_j: f64, largest_j: f64, beads: u64) -> f64 {
    STEP_SAFETY * off_j + beads as f64 * f64::EPSILON * largest_j
}
