//! Frames, their sources and their sinks.

pub use crate::active::Active;
use crate::chain::Chain;
use crate::manifest::RunManifest;
use std::fmt;
use std::ops::RangeInclusive;

/// One published state, lent by its source until the next call.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// Number of the frame, from 0; of a step that was recomputed between two frames, the frame before.
    pub frame: u64,
    /// Number of the time step, `min(frame·publish_every_steps, step_count)` of a frame.
    pub step: u64,
    /// Simulated time `step·dt` (s).
    pub time_s: f64,
    /// Displacement of each bead (m), N values.
    pub u_m: &'a [f64],
    /// Velocity of each bead (m/s), N values.
    pub v_m_s: &'a [f64],
    /// Further values that the method needs, `E·N` of them (none for symplectic methods).
    pub extra: &'a [f64],
    /// The beads that may differ from rest, if anybody says so.
    pub active: Option<Active>,
}

/// A window that is known, or not, makes no other state.
impl PartialEq for Frame<'_> {
    fn eq(&self, other: &Self) -> bool {
        let of = |frame: &Self| (frame.frame, frame.step, frame.time_s);
        of(self) == of(other) && (self.u_m, self.v_m_s, self.extra) == (other.u_m, other.v_m_s, other.extra)
    }
}

impl<'a> Frame<'a> {
    /// The state: displacements (m), velocities (m/s), and what else the method keeps.
    pub fn state(&self) -> [&'a [f64]; 3] {
        [self.u_m, self.v_m_s, self.extra]
    }

    /// The frame whose arrays stand one after the other in `doubles`: `[u | v | extra]`.
    pub fn of_doubles((frame, step, time_s): (u64, u64, f64), beads: usize, doubles: &'a [f64]) -> Self {
        let (u_m, rest) = doubles.split_at(beads.min(doubles.len())); // integers
        let (v_m_s, extra) = rest.split_at(beads.min(rest.len())); // integers
        Self { frame, step, time_s, u_m, v_m_s, extra, active: None }
    }

    /// The same frame, with its beads at rest sought where nobody said them.
    #[must_use]
    pub fn searched(self) -> Self {
        Self { active: self.active.or_else(|| Some(Active::of(self.u_m, self.v_m_s))), ..self }
    }

    /// The beads that may differ from rest: all where nobody says.
    pub fn moving(&self) -> Active {
        self.active.unwrap_or(Active::all(self.u_m.len()))
    }

    /// The beads that may have energy in a frame of `chain`, of their own or of a contact with a bead: at rest they have none, whatever
    /// loads them, but nobody says which resonators rest.
    pub fn with_energy(&self, chain: &Chain) -> Active {
        if chain.sites.has_resonators() { Active::all(self.u_m.len()) } else { self.moving() }
    }
}

/// The reason why no more frames come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndReason {
    /// The run reached its last step.
    Complete,
    /// The producer was asked to stop (a signal) and ended the run early, in order.
    Interrupted,
    /// The producer ended the run because of an error.
    Failed,
    /// The producer vanished without saying why.
    ProducerLost,
    /// The producer dropped this consumer because it held the run back for too long.
    Dropped,
    /// The recording was not closed: it stops before its end.
    Unfinished,
    /// We were asked to stop (a signal in this process).
    Stopped,
    /// The recording goes on in its next part.
    Continued,
    /// The recorder left the run, which went on: it was asked to stop, or the disk was nearly full.
    Detached,
}

impl EndReason {
    /// True if these are all the frames that the run ever had, or all that its recorder wanted to have.
    pub fn is_orderly(self) -> bool {
        matches!(self, Self::Complete | Self::Interrupted | Self::Continued | Self::Detached)
    }

    /// The word used in files and on the bus.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Interrupted => "interrupted",
            Self::Failed => "failed",
            Self::ProducerLost => "producer lost",
            Self::Dropped => "dropped",
            Self::Unfinished => "unfinished",
            Self::Stopped => "stopped",
            Self::Continued => "continued",
            Self::Detached => "detached",
        }
    }
}

impl fmt::Display for EndReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// The next thing from a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Received<'a> {
    /// The next frame.
    Frame(Frame<'a>),
    /// Frames `from` up to and including `to` were published, but did not reach us.
    Missed {
        /// First missing frame.
        from: u64,
        /// Last missing frame.
        to: u64,
    },
    /// No more frames.
    End(EndReason),
}

/// A part of a run, in simulated time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Begin (s): earlier frames are passed over.
    pub from_s: f64,
    /// End (s): a frame at this time, as steps are told from times ([`Physics`](crate::manifest::Physics)), still belongs to the window.
    pub until_s: f64,
}

impl Window {
    /// The steps of the window.
    pub fn steps(&self, manifest: &RunManifest) -> RangeInclusive<u64> {
        let physics = &manifest.physics;
        physics.step_at_or_after(self.from_s)..=physics.step_at_or_before(self.until_s)
    }

    /// All of a run.
    pub const WHOLE: Self = Self { from_s: 0.0, until_s: f64::INFINITY };

    /// The first and the last of the frames `from` up to and including `to` that lie within; none if no frame does.
    pub fn clip(&self, manifest: &RunManifest, from: u64, to: u64) -> Option<(u64, u64)> {
        let physics = &manifest.physics;
        let first = physics.step_at_or_after(self.from_s).div_ceil(manifest.provenance.publish_every_steps);
        let last = manifest.frame_at(physics.step_at_or_before(self.until_s));
        let (from, to) = (from.max(first), to.min(last)); // integers
        (from <= to).then_some((from, to))
    }

    /// True if no step later than `step` lies within, though the run goes on.
    pub fn ends_at(&self, manifest: &RunManifest, step: u64) -> bool {
        step < manifest.physics.step_count && step >= manifest.physics.step_at_or_before(self.until_s)
    }
}

/// Source of the frames of an analysis: a live run, a replay, a file or a re-simulation.
///
/// A source never skips silently: undelivered frames are reported as [`Received::Missed`], in
/// order, and after [`Received::End`] it only repeats the end.
pub trait FrameSource {
    /// The error of this kind of source.
    type Error: std::error::Error + Send + Sync + 'static;

    /// The run that the frames belong to.
    fn manifest(&self) -> &RunManifest;

    /// Waits for the next frame and lends it until the next call.
    ///
    /// # Errors
    /// When the source can no longer be read; frames lent before stay valid results.
    fn receive(&mut self) -> Result<Received<'_>, Self::Error>;
}

impl<S: FrameSource + ?Sized> FrameSource for &mut S {
    type Error = S::Error;

    fn manifest(&self) -> &RunManifest {
        (**self).manifest()
    }

    fn receive(&mut self) -> Result<Received<'_>, Self::Error> {
        (**self).receive()
    }
}

/// Sink of a run's frames: a publisher or a recorder.
pub trait FrameSink {
    /// The error of this kind of sink.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Takes one frame.
    ///
    /// # Errors
    /// When the frame could not be taken; the sink has not kept a part of it.
    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Self::Error>;
}
/// A copy of a frame, which outlives the call that lent it.
#[derive(Debug, Clone, Default)]
pub struct HeldFrame {
    frame: u64,
    step: u64,
    time_s: f64,
    parts: [Vec<f64>; 3],
}

impl HeldFrame {
    /// Replaces the frame that is held, in the same memory.
    pub fn hold(&mut self, frame: &Frame<'_>) {
        (self.frame, self.step, self.time_s) = (frame.frame, frame.step, frame.time_s);
        for (held, part) in self.parts.iter_mut().zip([frame.u_m, frame.v_m_s, frame.extra]) {
            held.clear();
            held.extend_from_slice(part);
        }
    }

    /// The frame.
    pub fn frame(&self) -> Frame<'_> {
        let [u_m, v_m_s, extra] = &self.parts;
        Frame { frame: self.frame, step: self.step, time_s: self.time_s, u_m, v_m_s, extra, active: None }
    }
}
