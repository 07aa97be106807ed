//! The points that are left to compute: a bit for each point, and a guess at their cost.

use super::directory::Directory;
use crate::args::Shard;
use producer::sweep::Sweep;
use schemas::manifest::Physics;

/// Points that are looked at to guess the cost of all.
const LOOKED_AT: usize = 100;

/// Some points of a sweep.
#[derive(Debug)]
pub(super) struct Points {
    bits: Vec<u64>,
    /// Points of the sweep.
    all: u64,
    count: u64,
}

impl Points {
    /// None of `points`.
    pub(super) fn none_of(points: u64) -> Self {
        Self { bits: vec![0; place(points).0 + 1], all: points, count: 0 }
    }

    /// Adds a point; one that the sweep does not have is none.
    pub(super) fn add(&mut self, index: u64) {
        if index < self.all && !self.has(index) {
            let (word, bit) = place(index);
            self.bits[word] |= bit;
            self.count += 1;
        }
    }

    pub(super) fn has(&self, index: u64) -> bool {
        let (word, bit) = place(index);
        self.bits[word] & bit != 0
    }

    /// Number of the points.
    pub(super) fn count(&self) -> u64 {
        self.count
    }
}

/// The word of a point, and its bit there.
fn place(index: u64) -> (usize, u64) {
    (usize::try_from(index / 64).unwrap_or(usize::MAX), 1 << (index % 64))
}

/// The points of a shard that have no row yet, or no recording where there is to be one.
pub(super) struct Pending<'a> {
    pub(super) directory: &'a Directory,
    /// Points that have a row.
    pub(super) rows: &'a Points,
    pub(super) shard: Shard,
    pub(super) record: bool,
}

impl Pending<'_> {
    /// Their indices, in ascending order.
    pub(super) fn indices(&self) -> impl Iterator<Item = u64> {
        let has_recording = |index| !self.record || self.directory.recording(index).is_file();
        let step = usize::try_from(self.shard.count).unwrap_or(usize::MAX);
        let shard = (self.shard.number..self.rows.all).step_by(step);
        shard.filter(move |index| !(self.rows.has(*index) && has_recording(*index)))
    }
}

/// Likely cost of points.
#[derive(Debug)]
pub(super) struct Guess {
    /// Number of the points.
    pub(super) count: u64,
    /// Steps of beads of one of them, unless it ends early.
    pub(super) cost: u64,
    /// Physics of the first of them, if it is valid.
    pub(super) like: Option<Physics>,
}

impl Guess {
    /// The likely cost of the `count` points `indices`, from some that lie evenly among them.
    pub(super) fn of(sweep: &Sweep, count: u64, indices: impl Iterator<Item = u64>) -> Self {
        let step = usize::try_from(count).unwrap_or(usize::MAX).div_ceil(LOOKED_AT).max(1);
        let looked_at = indices.step_by(step).filter_map(|index| sweep.point(index).ok());
        let mut guess = Self { count, cost: 0, like: None };
        let (mut looked, mut cost) = (0_u64, 0_u64);
        for point in looked_at {
            looked += 1;
            cost = cost.saturating_add(point.physics.step_count.saturating_mul(point.physics.beads));
            guess.like.get_or_insert(point.physics);
        }
        guess.cost = cost / looked.max(1);
        guess
    }
}
