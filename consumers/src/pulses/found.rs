//! Output of the tracker.

use super::{Point, Pulse};
use serde::Serialize;

/// A rise matters that is this part of the largest speed of its bead.
pub(super) const MATTERS: f64 = 0.1;

/// Beads in a row that a disturbance has passed: twice as many as the shortest track.
pub(super) const SHORTEST: usize = 10;

/// Something that the tracker found in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Happening {
    /// A pulse passed a bead, a few beads ago.
    Passed(Point),
    /// A pulse has ended.
    Ended(Pulse),
}

/// A pulse as it is in the last frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnderWay {
    /// Its number.
    pub number: u64,
    /// Position of its crest (beads).
    pub position_beads: f64,
    /// Velocity of the bead that its crest passed last (m/s).
    pub v_peak_m_s: f64,
    /// Its speed (beads/s), negative if it travels backward; 0 if it is not known.
    pub velocity_beads_per_s: f64,
    /// Its full width at half maximum (beads), if it is known.
    pub fwhm_beads: Option<f64>,
}

/// Something that passed along the chain, and that no pulse follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unfollowed {
    /// The beads that it passed, in the order in which it did.
    pub beads: [u64; 2],
    /// Times (s) at which it passed the first and the last of them.
    pub times_s: [f64; 2],
    /// The largest velocity of those beads then (m/s).
    pub v_peak_m_s: f64,
    /// It was the first that those beads saw: the leading pulse is missing.
    pub leads: bool,
}

/// Counts of pulses and crests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Pulses found.
    pub pulses: u64,
    /// Pulses that have ended and are clear: also found if the threshold were twice as high, and over
    /// [`super::Pulses::CLEAR_TRACK`] beads. The threshold decides whether the others count.
    pub clear_pulses: u64,
    /// Disturbances that no pulse follows, known at the end: [`super::Pulses::unfollowed`].
    pub unfollowed: u64,
    /// Crests seen in so few frames that their peaks are off by more than 1e-4.
    pub coarse_crests: u64,
    /// Crests seen in too few frames to be told from anything else; they were left out.
    pub unresolved_crests: u64,
    /// The most steps from one frame to the next.
    pub longest_interval_steps: u64,
}
