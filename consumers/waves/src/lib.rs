//! Analyses of the waves of a chain: [`spectra`](welch) at single places, [maps over ω and q](wave_map), the
//! [linear modes](modes) about an equilibrium and [their energies](modal), [correlations](correlation), and [forces as a sensor
//! sees them](peaks).
//!
//! Values come one frame at a time and memory is bounded by segments, never by the length of a run.

pub mod correlation;
pub mod dispersion;
mod eigen;
pub mod grid;
pub mod linear;
pub mod modal;
pub mod modes;
pub mod peaks;
pub mod place;
pub mod sampling;
pub mod segments;
pub mod spectrogram;
pub mod wave_map;
pub mod welch;
