//! Pulses: found, followed from bead to bead and measured while a run goes.
//!
//! A pulse passes a bead when the bead's |v| has a maximum in time while both of its contacts are pressed, as bonds
//! always are: the *crest*.
//! A loose bead that flies off, however fast, has no crest. If light and heavy beads alternate, the mean velocity of
//! several beads has the crest: see `texture.rs`. Crests that follow each other from bead to bead in one direction are
//! a track, and a track of [`Pulses::SHORTEST_TRACK`] beads is a pulse. The tracker gives a [`Point`] for each bead
//! that a pulse passes, and a [`Pulse`] when it has ended.
//!
//! One pass, and memory that does not grow with the run: five frames of velocities, and for each pulse under way the
//! last [`Pulses::REACH`] beads on either side of the point that is measured.
//!
//! A pulse ends where it meets one of the [`Obstacles`], such as an impurity: other pulses leave it.
//!
//! A disturbance that passed along the chain and is in no pulse is [`Unfollowed`]. It is found in another way than
//! pulses.
//!
//! [`Probes`] look at chosen beads only.

mod control;
mod crest;
mod edges;
mod found;
mod front;
mod heads;
mod lead;
mod obstacles;
mod origins;
mod passing;
mod probes;
mod sight;
mod strongest;
mod surroundings;
mod texture;
mod track;
mod tracker;

pub use found::{Counts, Happening, UnderWay, Unfollowed};
pub use obstacles::Obstacles;
pub use probes::{Passage, Probes};
pub use strongest::{Path, Strongest};
pub use track::{Measured, Point, Shape};
pub use tracker::Pulses;

/// Bead numbers are at most 2e7.
fn signed(bead: u64) -> i64 {
    i64::try_from(bead).unwrap_or(i64::MAX)
}

/// Beads, rounded.
fn nearest(beads: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let nearest = beads.round() as i64;
    nearest
}

/// Direction of a pulse.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Towards higher bead numbers.
    Forward,
    /// Towards lower bead numbers.
    Backward,
}

impl Direction {
    /// +1 or −1 bead.
    pub fn sign(self) -> i64 {
        match self {
            Self::Forward => 1,
            Self::Backward => -1,
        }
    }

    /// The word used in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Forward => "forward",
            Self::Backward => "backward",
        }
    }
}

/// Origin of a pulse: the obstacle near the first bead that it passes, if anything has reached that.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Birth {
    /// It was there when the frames began, or began again after a gap.
    UnderWay,
    /// A striker.
    Striker,
    /// A driven bead, or a wall that a drive moves.
    Drive,
    /// An impurity, or where two kinds of beads meet.
    Impurity,
    /// A free end of the chain.
    End,
    /// A wall that stands still.
    Wall,
    /// The contact that closes a ring, where the numbers of the beads begin again: a pulse that came round.
    Seam,
    /// Two pulses that met.
    Collision,
    /// A pulse of the same direction that it splits from.
    Split,
    /// The chain between all of these.
    Chain,
}

impl Birth {
    /// The word used in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::UnderWay => "under-way",
            Self::Striker => "striker",
            Self::Drive => "drive",
            Self::Impurity => "impurity",
            Self::End => "end",
            Self::Wall => "wall",
            Self::Seam => "seam",
            Self::Collision => "collision",
            Self::Split => "split",
            Self::Chain => "chain",
        }
    }
}

/// End of a pulse.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It was there when the frames ended.
    UnderWay,
    /// It met an impurity, or another kind of beads.
    Impurity,
    /// It reached a free end of the chain.
    End,
    /// It reached a wall.
    Wall,
    /// It reached the contact that closes a ring, and goes on as another pulse at the other end of the numbers.
    Seam,
    /// It became part of another pulse.
    Merged,
    /// It sank below the threshold, or lost its crest.
    Faded,
    /// Frames were missing, and it was not found again.
    Gap,
}

impl Fate {
    /// The word used in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::UnderWay => "under-way",
            Self::Impurity => "impurity",
            Self::End => "end",
            Self::Wall => "wall",
            Self::Seam => "seam",
            Self::Merged => "merged",
            Self::Faded => "faded",
            Self::Gap => "gap",
        }
    }
}

/// A pulse from its first bead to its last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pulse {
    /// Its number, from 1, in the order in which pulses are found.
    pub number: u64,
    /// Its direction.
    pub direction: Direction,
    /// Time (s) at which its crest passed its first bead.
    pub birth_time_s: f64,
    /// Its first bead.
    pub birth_bead: u64,
    /// Its origin.
    pub birth: Birth,
    /// Time (s) at which its crest passed its last bead.
    pub end_time_s: f64,
    /// Its last bead.
    pub end_bead: u64,
    /// Its end.
    pub fate: Fate,
    /// Beads at which its crest was seen.
    pub bead_count: u64,
    /// Its values at the last bead where it could be measured undisturbed; if there is none, where its velocity changed least.
    pub measured: Measured,
    /// Its speed relative to that of the exact solitary wave of the same peak velocity; none where there is no
    /// such wave, as in a loaded chain or for α = 1.
    pub speed_over_solitary: Option<f64>,
    /// Its full width at half maximum relative to that wave's.
    pub fwhm_over_solitary: Option<f64>,
}

impl Pulse {
    /// The one of the larger peak velocity; the first, if they have the same.
    pub fn stronger(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        let peak = |pulse: &Self| pulse.measured.point.v_peak_m_s.abs();
        match (one, other) {
            (Some(one), Some(other)) => Some(if peak(&other) > peak(&one) { other } else { one }),
            (one, other) => one.or(other),
        }
    }
}
