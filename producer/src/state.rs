//! The state of a chain at a step.

use crate::aligned::aligned;
use crate::integrator::first_terms;
use aligned_vec::AVec;
use schemas::frame::Frame;
use schemas::manifest::{Physics, RunManifest};

/// The state on which the next step depends.
///
/// Its arrays begin at a cache line: vectors of numbers that lie across two lines take longer to fetch, a sixth of a
/// step.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainState {
    /// Displacements (m), N values.
    pub u_m: AVec<f64>,
    /// Velocities (m/s), N values.
    pub v_m_s: AVec<f64>,
    /// Further values that the method carries from step to step, `E·N` values: see [`Physics::extra_per_bead`].
    pub extra: AVec<f64>,
    /// Number of the step.
    pub step: u64,
}

impl ChainState {
    /// The state at step 0.
    pub fn initial(physics: &Physics) -> Self {
        let (u_m, v_m_s) = physics.initial_state();
        Self::starting_at(physics, &u_m, &v_m_s)
    }

    /// A state at step 0 with the given displacements (m) and velocities (m/s), N values each.
    ///
    /// The higher derivatives that `gear5` carries are those of the exact motion, so that it has its order
    /// from the first step.
    pub fn starting_at(physics: &Physics, u_m: &[f64], v_m_s: &[f64]) -> Self {
        let mut extra = physics.initial_extra(u_m);
        let terms = first_terms(physics, u_m, v_m_s);
        extra[..terms.len()].copy_from_slice(&terms);
        Self { u_m: aligned(u_m), v_m_s: aligned(v_m_s), extra: aligned(&extra), step: 0 }
    }

    /// The state of `frame`: a run goes on from it with the bits that it had.
    pub fn of_frame(frame: &Frame<'_>) -> Self {
        Self {
            u_m: aligned(frame.u_m),
            v_m_s: aligned(frame.v_m_s),
            extra: aligned(frame.extra),
            step: frame.step,
        }
    }

    /// Makes this the state of `frame`, which is a frame of the same run.
    ///
    /// # Panics
    /// When the frame has another number of beads, as no frame of the same run has.
    pub fn copy_from(&mut self, frame: &Frame<'_>) {
        self.u_m.copy_from_slice(frame.u_m);
        self.v_m_s.copy_from_slice(frame.v_m_s);
        self.extra.copy_from_slice(frame.extra);
        self.step = frame.step;
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
