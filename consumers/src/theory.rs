//! The waves that theory expects in a chain of equal beads, `F = k·δ^α`, at rest and without precompression.
//!
//! [`SolitaryWave`] is the exact travelling wave of the lattice, [`ContinuumWave`] the long-wave
//! approximation that the paper compares with, [`GaussianLimit`] what becomes of both near α = 1. Each
//! has a shape, a function of ξ, the distance from its centre in beads, that is 1 at the centre, and
//! [`Coefficients`], which [`Coefficients::scaled`] turns into units for given beads.
//!
//! In the frame of a wave that moves at V (beads/s) a contact at ξ, halfway between its two beads, has the
//! overlap δ(ξ), and a bead at ξ the velocity v(ξ). The overlap of one contact over time is therefore
//! `overlap_m · wave.overlap(V·(t − t0))`, with t0 when the centre passes it.
//!
//! This is analysis, not dynamics: it decides no bit of a run, and so it uses the platform's `powf`.
//!
//! ```
//! use consumers::theory::{SolitaryWave, Strength};
//!
//! let wave = SolitaryWave::new(1.5)?;
//! assert!((wave.coefficients().speed - 0.9074700784).abs() < 1e-9); // shared reference
//! // beads of 1 g with k = 10^7 N·m^−1.5 and a wave of v_max = 1 m/s: V = C_V·(10^10)^0.4·1^0.2
//! let scale = wave.coefficients().scaled(1e-3, 1e7, Strength::PeakVelocity { m_s: 1.0 })?;
//! assert!((scale.speed_beads_per_s - 9074.700784).abs() < 1e-5);
//! assert_eq!(wave.overlap(0.0) * scale.overlap_m, scale.overlap_m);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod coefficients;
mod continuum;
mod fixed_point;
mod profile;
mod solitary;

pub use coefficients::{Coefficients, ScaleError, Strength, WaveScale};
pub use continuum::{ContinuumWave, GaussianLimit};
pub use solitary::SolitaryWave;

/// Reason why there is no wave of an exponent.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum WaveError {
    /// No such wave exists, or it is out of reach of the numerical method.
    #[error("no wave for α = {alpha}: expected α {}", allowed(*smallest, *largest))]
    Exponent {
        /// The exponent asked for.
        alpha: f64,
        /// The smallest for which the wave can be had.
        smallest: f64,
        /// The largest.
        largest: f64,
    },
    /// The fixed point was not reached.
    #[error(
        "the solitary wave of α = {alpha} still changes by {last_step:e} of its height in step {step_count}, \
         instead of {tolerance:e}; this is a fault of ours"
    )]
    NotConverged {
        /// The exponent.
        alpha: f64,
        /// The largest change in the last step, relative to the height of the wave.
        last_step: f64,
        /// The largest change allowed.
        tolerance: f64,
        /// Steps done.
        step_count: usize,
    },
}

fn allowed(smallest: f64, largest: f64) -> String {
    if largest == f64::MAX { "above 1".to_owned() } else { format!("from {smallest} to {largest}") }
}
