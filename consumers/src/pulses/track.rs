//! The track of one pulse: which beads its crest has passed, and when.

use super::edges::Edges;
use super::{Birth, Direction};
use std::collections::VecDeque;

/// Beads before and behind a point between which the speed there is measured.
pub(super) const REACH: usize = 5;

/// Beads that a leading pulse may skip: no crest of it is lost for longer.
pub(super) const FAR: i64 = 12;

/// The shape of a pulse, from the times at which its edges pass the beads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Full width (beads) where the velocity is half of its peak.
    pub fwhm_beads: f64,
    /// `(rear − front)/(rear + front)` of the half widths behind and ahead of the crest: 0 for a symmetric
    /// pulse, positive where it trails off behind.
    pub asymmetry: f64,
}

/// A pulse at one bead that its crest passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Number of the pulse, [`super::Pulse::number`].
    pub pulse: u64,
    /// The bead.
    pub bead: u64,
    /// Time (s) at which it moves fastest, interpolated.
    pub time_s: f64,
    /// Its velocity then (m/s), interpolated.
    pub v_peak_m_s: f64,
    /// Speed of the pulse (beads/s) between the beads up to 5 before and behind; none at the ends of a track.
    pub speed_beads_per_s: Option<f64>,
    /// Its shape; none where an edge was not seen, or where pulses that overlap have one edge for all.
    pub shape: Option<Shape>,
}

/// Values of a pulse at one bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Its bead, time, speed and width.
    pub point: Point,
    /// Momentum (kg·m/s) of the hump from one minimum of |v| to the next.
    pub momentum_kg_m_s: f64,
    /// Kinetic and potential energy (J) of the hump, in a loaded chain beyond that at rest: `φ(δ) − φ(δ₀) −
    /// φ′(δ₀)·(δ − δ₀)` of each contact.
    pub energy_j: f64,
    /// True if the pulse was seen at each of the 5 beads before and behind, and neither an obstacle, nor an end,
    /// nor a gap between beads was near.
    pub undisturbed: bool,
}

/// A bead passed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Passed {
    pub(super) bead: i64,
    pub(super) time_s: f64,
    /// Velocity (m/s) of the crest that is followed.
    pub(super) crest_m_s: f64,
    /// Velocity (m/s) of the bead itself.
    pub(super) v_peak_m_s: f64,
    pub(super) shape: Option<Shape>,
    pub(super) momentum_kg_m_s: f64,
    pub(super) energy_j: f64,
    /// Nothing is near that would disturb the pulse.
    pub(super) free: bool,
    /// The bead is not a light one among heavy ones.
    pub(super) carries: bool,
    /// The crest is twice as high as the threshold, or higher.
    pub(super) clear: bool,
}

/// Worth of the values at a bead: it carries the pulse, is undisturbed, has a speed and a shape, beads before and behind it that were
/// seen, and the change of the velocity between them, times −1.
type Worth = (bool, bool, bool, bool, usize, f64);

/// A crest that is followed; a pulse once it has a number.
#[derive(Debug, Clone)]
pub(super) struct Track {
    /// 0 until it is long enough.
    pub(super) number: u64,
    /// Sign of the velocity.
    pub(super) sign: f64,
    /// +1 or −1; 0 until it is known.
    pub(super) ahead: i64,
    pub(super) birth: Birth,
    pub(super) first: Passed,
    pub(super) bead_count: u64,
    /// Number of the beads that it would pass if the threshold were higher.
    pub(super) clear_bead_count: u64,
    pub(super) edges: Option<Edges>,
    /// Its best values so far, and their worth.
    pub(super) measured: Option<(Measured, Worth)>,
    /// Frames were missing since the last bead.
    pub(super) gap: bool,
    /// The last beads passed.
    recent: VecDeque<Passed>,
    /// Number of these that have not been given out as points.
    pending: usize,
}

impl Track {
    pub(super) fn new(first: Passed, ahead: i64, birth: Birth) -> Self {
        let mut track = Self {
            number: 0,
            sign: first.crest_m_s.signum(),
            ahead,
            birth,
            first,
            bead_count: 0,
            clear_bead_count: 0,
            edges: None,
            measured: None,
            gap: false,
            recent: VecDeque::with_capacity(2 * REACH + 2),
            pending: 0,
        };
        track.pass(first);
        track
    }

    /// The bead passed last.
    pub(super) fn head(&self) -> &Passed {
        self.recent.back().unwrap_or(&self.first)
    }

    /// Beads from the first to the last one that it remembers.
    pub(super) fn length_beads(&self) -> i64 {
        let head = self.head().bead;
        self.recent.front().map_or(0, |first| (head - first.bead).abs())
    }

    pub(super) fn direction(&self) -> Direction {
        if self.ahead < 0 { Direction::Backward } else { Direction::Forward }
    }

    /// Adds the next bead.
    pub(super) fn pass(&mut self, passed: Passed) {
        if self.bead_count > 0 {
            self.ahead = (passed.bead - self.head().bead).signum();
        }
        self.recent.push_back(passed);
        self.bead_count += 1;
        self.clear_bead_count += u64::from(passed.clear);
        self.pending += 1;
        self.gap = false;
        // crests that come late make it longer for a while
        while self.recent.len() > (2 * REACH + 1).max(self.pending) {
            self.recent.pop_front();
        }
    }

    /// Notes the velocity `v_m_s` of `bead`, if it is faster than before in the same crest; `around_m_s` is the followed velocity there.
    pub(super) fn rattle(&mut self, bead: i64, v_m_s: f64, around_m_s: f64) {
        /// The pulse has passed where the followed velocity has sunk to this part of its crest.
        const PASSED: f64 = 0.5;
        let passed = self.recent.iter_mut().rev().take(self.pending).find(|passed| passed.bead == bead);
        if let Some(passed) = passed
            && around_m_s * self.sign > PASSED * passed.crest_m_s.abs()
            && v_m_s * self.sign > passed.v_peak_m_s.abs()
        {
            passed.v_peak_m_s = v_m_s;
        }
    }

    /// Height (m/s) of the crest at the last beads on average, over any two kinds of them.
    pub(super) fn mean_crest_m_s(&self) -> f64 {
        const BEADS: usize = 6;
        let last = self.recent.iter().rev().take(BEADS);
        last.clone().map(|passed| passed.crest_m_s.abs()).sum::<f64>() / last.len() as f64
    }

    /// Speed (beads/s) over the last beads.
    pub(super) fn speed_beads_per_s(&self) -> Option<f64> {
        self.speed_over(REACH)
    }

    /// Speed (beads/s) over as many of the last beads as there are.
    fn steady_speed_beads_per_s(&self) -> Option<f64> {
        self.speed_over(2 * REACH)
    }

    fn speed_over(&self, beads: usize) -> Option<f64> {
        let first = self.recent.len().saturating_sub(beads + 1);
        speed(&self.recent[first], self.head())
    }

    /// Position of its crest at `time_s` (beads), if it moves on at its speed.
    pub(super) fn position_beads(&self, time_s: f64) -> f64 {
        let head = self.head();
        let moved = self.speed_beads_per_s().unwrap_or_default() * (time_s - head.time_s);
        head.bead as f64 + moved * self.ahead as f64
    }

    /// Distance (beads) of a crest of `crest_m_s` at `bead` at `time_s` from the place where this track expects its next
    /// crest, or none if the crest does not belong to it. Up to `coast` beads may have been skipped; the first step takes less
    /// than `longest_s`, others less than `wait_s` a bead.
    pub(super) fn fit_beads(
        &self,
        (bead, time_s, crest_m_s): (i64, f64, f64),
        coast: i64,
        [longest_s, wait_s]: [f64; 2],
    ) -> Option<f64> {
        /// A crest beyond others that is so many times as high or as low as those before is another pulse's.
        const UNLIKE: f64 = 4.0;
        let head = self.head();
        let (beads, passed_s) = (bead - head.bead, time_s - head.time_s);
        if passed_s <= 0.0 || (self.ahead != 0 && beads * self.ahead <= 0) {
            return None;
        }
        let beads = beads.abs();
        let speed = if beads == 1 { self.speed_beads_per_s() } else { self.steady_speed_beads_per_s() };
        let Some(speed) = speed else {
            return (beads == 1 && passed_s < longest_s).then_some(passed_s / longest_s);
        };
        let moved = speed * passed_s;
        let most = if self.number == 0 { 1 } else { coast };
        let expected = beads as f64;
        // young pulses change their speed from bead to bead; two that meet shift the crests of each other
        // before they are out of sight
        let near = moved > 0.3 * expected && moved < 1.5 * expected + if beads == 1 { 1.0 } else { 2.0 };
        let ratio = crest_m_s.abs() / self.mean_crest_m_s();
        let alike = beads == 1 || ratio < UNLIKE && ratio > 1.0 / UNLIKE;
        (beads <= most && near && alike && passed_s < wait_s * expected).then_some((moved - expected).abs())
    }

    /// Distance (beads) to a crest at `bead` at `time_s`, of the height `crest_m_s`, if this track goes on with it
    /// where nothing else has been before: the track leads, so that a crest so far ahead can only be its own.
    pub(super) fn leads_to(&self, (bead, time_s): (i64, f64), crest_m_s: f64) -> Option<i64> {
        /// A crest lower than this part of those before is one of a forerunner.
        const LEAST: f64 = 0.35;
        let head = self.head();
        let beads = (bead - head.bead) * self.ahead;
        let moved = self.steady_speed_beads_per_s()? * (time_s - head.time_s);
        let high = crest_m_s.abs() > LEAST * self.mean_crest_m_s();
        let expected = beads as f64;
        // a light bead may have its crest at once after the heavy one before it
        let in_time = moved > if beads <= 2 { 0.0 } else { 0.2 * expected } && moved < 2.5 * expected + 2.0;
        ((1..=FAR).contains(&beads) && high && in_time).then_some(beads)
    }

    /// Takes `passed` where the track has skipped a bead that has its crest a little later than the next ones. True if
    /// it is one of those.
    pub(super) fn pass_late(&mut self, passed: Passed) -> bool {
        /// Beads that the pulse may have moved on from where it should have been.
        const LATE: f64 = 3.5;
        let Some(speed) = self.speed_beads_per_s() else { return false };
        if self.number == 0 || self.sign != passed.crest_m_s.signum() {
            return false;
        }
        let ahead = self.ahead;
        let behind = |other: &Passed| (passed.bead - other.bead) * ahead;
        let Some(after) = self.recent.iter().position(|other| behind(other) <= 0) else { return false };
        if after == 0 || behind(&self.recent[after]) == 0 {
            return false;
        }
        let before = &self.recent[after - 1];
        let expected_s = before.time_s + behind(before) as f64 / speed;
        if (passed.time_s - expected_s).abs() * speed > LATE {
            return false;
        }
        if after >= self.recent.len() - self.pending {
            self.recent.insert(after, passed);
            self.pending += 1;
            self.bead_count += 1;
            self.clear_bead_count += u64::from(passed.clear);
        }
        true
    }

    /// The next point whose surroundings are complete; with `all` also those whose never will be.
    pub(super) fn next_point(&mut self, all: bool) -> Option<Point> {
        if self.pending == 0 || (!all && self.pending <= REACH) {
            return None;
        }
        let at = self.recent.len() - self.pending;
        self.pending -= 1;
        let reach = REACH.min(at).min(self.pending);
        let passed = self.recent[at];
        let (before, behind) = (&self.recent[at - reach], &self.recent[at + reach]);
        let seen = (behind.bead - before.bead).unsigned_abs() == 2 * REACH as u64;
        let point = Point {
            pulse: self.number,
            bead: passed.bead.unsigned_abs(),
            time_s: passed.time_s,
            v_peak_m_s: passed.v_peak_m_s,
            speed_beads_per_s: if reach == 0 { None } else { speed(before, behind) },
            shape: passed.shape,
        };
        let measured = Measured {
            point,
            momentum_kg_m_s: passed.momentum_kg_m_s,
            energy_j: passed.energy_j,
            undisturbed: seen && behind.free,
        };
        // the later the better, as pulses settle and come apart; unless they fall apart in gaps
        let changes = [before, behind].map(|end| (end.v_peak_m_s / passed.v_peak_m_s - 1.0).abs());
        let steady = if measured.undisturbed { 0.0 } else { -changes[0] - changes[1] };
        let (with_speed, with_shape) = (point.speed_beads_per_s.is_some(), point.shape.is_some());
        let worth = (passed.carries, measured.undisturbed, with_speed, with_shape, reach, steady);
        if self.measured.is_none_or(|(_, best)| worth >= best) {
            self.measured = Some((measured, worth));
        }
        Some(point)
    }
}

fn speed(from: &Passed, to: &Passed) -> Option<f64> {
    let beads = (to.bead - from.bead).abs();
    (beads > 0).then(|| beads as f64 / (to.time_s - from.time_s))
}
