//! The state of a chain at a step.

pub use crate::aligned::Padded;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// The state on which the next step depends.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainState {
    /// Displacements (m), N values.
    pub u_m: Padded,
    /// Velocities (m/s), N values.
    pub v_m_s: Padded,
    /// Further values that the method carries from step to step, `E·N` values: see
    /// [`Physics::extra_per_bead`](schemas::manifest::Physics::extra_per_bead).
    pub extra: Padded,
    /// Number of the step.
    pub step: u64,
}

impl ChainState {
    /// The state of `frame`: a run goes on from it with the bits that it had.
    pub fn of_frame(frame: &Frame<'_>) -> Self {
        Self {
            u_m: Padded::of(frame.u_m),
            v_m_s: Padded::of(frame.v_m_s),
            extra: Padded::of(frame.extra),
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
            active: None,
        }
    }
}
