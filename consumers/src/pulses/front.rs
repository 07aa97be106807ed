//! The front: the farthest motion along the chain, and the pulse that leads it, if any.
//!
//! Beads that move for the first time, one after the other, are the front, independent of the tracker. A leading pulse
//! runs close behind the front. If there is none for many beads, the tracker has not followed the leading pulse.

use super::crest::History;
use super::found::{MATTERS, SHORTEST, Unfollowed};
use super::surroundings::Surroundings;
use super::track::Track;
use super::{Direction, nearest, signed};
use schemas::frame::Frame;

/// Crests lower than this part of the largest velocity near the front are not of the pulse that leads it.
const RIPPLE: f64 = 0.25;

/// The fronts that run forward and backward.
#[derive(Debug, Clone)]
pub(super) struct Front {
    threshold_m_s: f64,
    /// One flag for each bead: true if it has moved faster than the threshold.
    reached: Vec<bool>,
    /// Nothing is known of what has moved before.
    is_first: bool,
    arrivals: Vec<usize>,
    alone: Vec<Alone>,
    found: Vec<Unfollowed>,
}

/// Beads that one front passed with no pulse behind it.
#[derive(Debug, Clone, Copy)]
struct Alone {
    direction: Direction,
    beads: [usize; 2],
    /// Beads from the first of them to the last.
    length: usize,
    times_s: [f64; 2],
    v_peak_m_s: f64,
}

impl Front {
    /// Beads in a row without a pulse that matter: the first crests of a pulse are not one yet. What is farther ahead is another front.
    const LONGEST: usize = SHORTEST + 10;

    pub(super) fn new(bead_count: usize, threshold_m_s: f64) -> Self {
        Self {
            threshold_m_s,
            reached: vec![false; bead_count],
            is_first: true,
            arrivals: Vec::new(),
            alone: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Looks at the newest velocities in the `history` of all beads, their own or means, while the pulses `tracks` are under way.
    pub(super) fn observe(
        &mut self,
        around: &Surroundings,
        frame: &Frame<'_>,
        history: &History,
        tracks: &[Track],
    ) {
        let v_m_s = history.v_m_s(0);
        let is_new = |bead: &usize| !self.reached[*bead] && v_m_s[*bead].abs() > self.threshold_m_s;
        self.arrivals.clear();
        self.arrivals.extend(history.moving().filter(is_new));
        if self.is_first {
            // what moves when frames begin has come from anywhere
            self.is_first = false;
            if let [first, .., last] = self.arrivals[..] {
                self.reached[first..=last].fill(true);
            }
        }
        for i in 0..self.arrivals.len() {
            let bead = self.arrivals[i];
            let came =
                |from: Option<usize>| from.and_then(|from| self.reached.get(from)).copied().unwrap_or(false);
            let [left, right] = [came(bead.checked_sub(1)), came(Some(bead + 1))];
            self.reached[bead] = true;
            // loose beads that fly are no front
            if left != right && around.is_pressed(frame, bead) {
                let direction = if left { Direction::Forward } else { Direction::Backward };
                self.arrive(around, (bead, frame.time_s), direction, v_m_s, tracks);
            }
        }
    }

    /// The front comes to `bead`.
    fn arrive(
        &mut self,
        around: &Surroundings,
        (bead, time_s): (usize, f64),
        direction: Direction,
        v_m_s: &[f64],
        tracks: &[Track],
    ) {
        let behind = around.behind_front(bead);
        let part = match direction {
            Direction::Forward => bead.saturating_sub(behind)..bead + 1,
            Direction::Backward => bead..(bead + behind + 1).min(v_m_s.len()),
        };
        let v_peak_m_s = fastest(&v_m_s[part]);
        // near and no mere ripple, or so much stronger that all of this is its forerunner
        let leads = |track: &Track| {
            let beads = around.way(track.head().bead, signed(bead as u64), direction);
            let over = track.mean_crest_m_s() / v_peak_m_s.abs();
            let is_it =
                if beads.unsigned_abs() <= behind as u64 { over > RIPPLE } else { over * MATTERS > 1.0 };
            track.number > 0 && track.ahead == direction.sign() && is_it
        };
        let behind_it = |(i, alone): (usize, &Alone)| {
            let way = around.way(signed(alone.beads[1] as u64), signed(bead as u64), direction);
            let way = usize::try_from(way).ok().filter(|way| (1..=Self::LONGEST).contains(way))?;
            (alone.direction == direction).then_some((way, i))
        };
        let nearest = self.alone.iter().enumerate().filter_map(behind_it).min();
        let before = nearest.map(|(way, i)| (way, self.alone.swap_remove(i)));
        if tracks.iter().any(leads) {
            self.found.extend(before.and_then(|(_, alone)| alone.unfollowed()));
            return;
        }
        let first = Alone { direction, beads: [bead; 2], length: 0, times_s: [time_s; 2], v_peak_m_s };
        let (way, mut alone) = before.unwrap_or((0, first));
        (alone.beads[1], alone.times_s[1]) = (bead, time_s);
        alone.length += way;
        alone.v_peak_m_s = fastest(&[alone.v_peak_m_s, v_peak_m_s]);
        self.alone.push(alone);
    }

    /// Frames are missing: where the front has come to meanwhile is not known.
    pub(super) fn gap(&mut self) {
        self.end();
        self.is_first = true;
    }

    /// Disturbances that led a front without being followed, once there are no more frames.
    pub(super) fn unfollowed(&mut self) -> &[Unfollowed] {
        self.end();
        &self.found
    }

    fn end(&mut self) {
        self.found.extend(self.alone.drain(..).filter_map(|alone| alone.unfollowed()));
    }
}

impl Alone {
    fn unfollowed(&self) -> Option<Unfollowed> {
        let Self { beads, times_s, v_peak_m_s, length, .. } = *self;
        let beads = beads.map(|bead| bead as u64);
        (length >= Front::LONGEST).then_some(Unfollowed { beads, times_s, v_peak_m_s, leads: true })
    }
}

/// The velocity (m/s) of the fastest bead.
fn fastest(v_m_s: &[f64]) -> f64 {
    v_m_s.iter().fold(0.0, |fastest: f64, v| if v.abs() > fastest.abs() { *v } else { fastest })
}

impl Surroundings {
    /// Beads from `from` to `to` in the `direction`, negative if `to` is behind; in a ring the shorter way round.
    fn way(&self, from: i64, to: i64, direction: Direction) -> i64 {
        let way = (to - from) * direction.sign();
        let beads = signed(self.chain.bead_count() as u64);
        if self.chain.is_ring { (way + beads / 2).rem_euclid(beads) - beads / 2 } else { way }
    }

    /// Largest distance (beads) behind the front at `bead` of the crest of the pulse that leads it. Without a solitary
    /// wave a front gets wider with the cube root of its way.
    fn behind_front(&self, bead: usize) -> usize {
        /// From the first motion to the first crest of the Airy function, in its units, and some more.
        const AIRY: f64 = 8.0;
        let way = bead.max(self.chain.bead_count() - bead) as f64;
        let spread = if self.chain.is_loaded() || self.chain.law.alpha() < 1.05 {
            AIRY * (0.5 * way).cbrt()
        } else {
            0.0
        };
        usize::try_from(self.reach.coast + 8 + nearest(spread)).unwrap_or_default()
    }
}
