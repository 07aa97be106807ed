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
}
