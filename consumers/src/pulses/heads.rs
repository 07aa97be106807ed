//! The tracks near a bead, found without a look at all of them.

use super::nearest;
use super::track::Track;
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// The heads of all tracks, in the order of the beads.
#[derive(Debug, Clone, Default)]
pub(super) struct Heads {
    /// The bead of each head, and the index of its track.
    at: BTreeSet<(i64, usize)>,
    /// The first and the last time (s) for which positions are asked.
    times_s: [f64; 2],
    /// No bead that a track remembers, and no position of a pulse at these times, is farther (beads) from its head.
    farthest: i64,
}

impl Heads {
    /// Takes all tracks anew, whose indices have changed.
    pub(super) fn renumber(&mut self, tracks: &[Track]) {
        self.at = tracks.iter().enumerate().map(|(i, track)| (track.head().bead, i)).collect();
    }

    /// Takes the times (s) for which positions will be asked from now on, and the farthest of these.
    pub(super) fn look(&mut self, tracks: &[Track], times_s: [f64; 2]) {
        (self.times_s, self.farthest) = (times_s, 0);
        for track in tracks {
            self.reach(track);
        }
    }

    pub(super) fn add(&mut self, i: usize, track: &Track) {
        self.at.insert((track.head().bead, i));
        self.reach(track);
    }

    fn reach(&mut self, track: &Track) {
        let head = track.head().bead;
        self.farthest = self.farthest.max(track.length_beads());
        for time_s in self.times_s.into_iter().filter(|_| track.number > 0) {
            let moved = (track.position_beads(time_s) - head as f64).abs();
            // with room for rounding
            self.farthest = self.farthest.max(if moved < 1e9 { nearest(moved) + 2 } else { i64::MAX });
        }
    }

    /// Forgets a track, before its head moves on.
    pub(super) fn remove(&mut self, i: usize, track: &Track) {
        self.at.remove(&(track.head().bead, i));
    }

    /// The indices of the tracks whose heads are at these beads.
    pub(super) fn at(&self, beads: RangeInclusive<i64>) -> impl Iterator<Item = usize> {
        let from_first = self.at.range((*beads.start(), 0)..);
        from_first.take_while(move |(bead, _)| bead <= beads.end()).map(|(_, i)| *i)
    }

    /// The indices of all tracks that remember one of these beads or are there at any of the times, and of some more.
    pub(super) fn around(&self, beads: RangeInclusive<i64>) -> impl Iterator<Item = usize> {
        self.at(beads.start().saturating_sub(self.farthest)..=beads.end().saturating_add(self.farthest))
    }
}
