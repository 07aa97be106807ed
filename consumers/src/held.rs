//! Frames that outlive the call that lent them.

use schemas::frame::Frame;

/// A copy of a frame.
#[derive(Debug, Clone, Default)]
pub struct HeldFrame {
    frame: u64,
    step: u64,
    time_s: f64,
    u_m: Vec<f64>,
    v_m_s: Vec<f64>,
}

impl HeldFrame {
    /// Replaces what is held, in the same memory.
    pub fn hold(&mut self, frame: &Frame<'_>) {
        (self.frame, self.step, self.time_s) = (frame.frame, frame.step, frame.time_s);
        self.u_m.clear();
        self.u_m.extend_from_slice(frame.u_m);
        self.v_m_s.clear();
        self.v_m_s.extend_from_slice(frame.v_m_s);
    }

    /// The frame, without the further values of its method.
    pub fn frame(&self) -> Frame<'_> {
        let (u_m, v_m_s) = (&self.u_m[..], &self.v_m_s[..]);
        Frame { frame: self.frame, step: self.step, time_s: self.time_s, u_m, v_m_s, extra: &[] }
    }
}
