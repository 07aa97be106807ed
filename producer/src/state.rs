//! The state of a chain at a step.

use schemas::frame::Frame;
use schemas::manifest::{Physics, RunManifest};

/// Everything that the next step depends on.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainState {
    /// Displacements (m), N values.
    pub u_m: Vec<f64>,
    /// Velocities (m/s), N values.
    pub v_m_s: Vec<f64>,
    /// What else the method carries from step to step, `E·N` values.
    pub extra: Vec<f64>,
    /// Number of the step.
    pub step: u64,
}

impl ChainState {
    /// The state at step 0.
    pub fn initial(physics: &Physics) -> Self {
        let (u_m, v_m_s) = physics.initial_state();
        Self { u_m, v_m_s, extra: Vec::new(), step: 0 }
    }

    /// The state that a frame shows.
    pub fn of_frame(frame: &Frame<'_>) -> Self {
        Self {
            u_m: frame.u_m.to_vec(),
            v_m_s: frame.v_m_s.to_vec(),
            extra: frame.extra.to_vec(),
            step: frame.step,
        }
    }

    /// This state as frame number `frame` of `manifest`'s run.
    pub fn as_frame(&self, manifest: &RunManifest, frame: u64) -> Frame<'_> {
        Frame {
            frame,
            step: self.step,
            time_s: manifest.physics.time_s(self.step),
            u_m: &self.u_m,
            v_m_s: &self.v_m_s,
            extra: &self.extra,
        }
    }

    /// The first bead whose displacement or velocity is not finite.
    pub fn first_non_finite(&self) -> Option<usize> {
        // x·0 is NaN exactly where x is not finite, and a sum keeps a NaN
        let sum = |values: &[f64]| values.iter().fold(0.0, |sum, x| sum + x * 0.0);
        if sum(&self.u_m) == 0.0 && sum(&self.v_m_s) == 0.0 {
            return None;
        }
        self.u_m.iter().zip(&self.v_m_s).position(|(u, v)| !(u.is_finite() && v.is_finite()))
    }
}
