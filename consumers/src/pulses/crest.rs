//! Crests: maxima of |v| of a bead over time.

use schemas::active::Active;
use std::ops::Range;

/// Frames kept: a crest is looked for in the middle one, and interpolated through all.
pub(super) const DEPTH: usize = 5;

/// Fewer frames than this over a crest's full width at half maximum do not show it.
pub(super) const FEWEST_FRAMES: f64 = 3.0;

/// With this many, the quartic through five frames is good to 1e-4 of the peak: for a Gaussian of σ = 8/2.355 h
/// the error is at most 1e-4.
pub(super) const ENOUGH_FRAMES: f64 = 8.0;

/// Full width at half maximum of a Gaussian, in σ.
const GAUSSIAN_FWHM: f64 = 2.354_820_045_030_949;

/// The velocities of some beads, or means of them, in the last [`DEPTH`] frames.
#[derive(Debug, Clone)]
pub(super) struct History {
    /// The first of the beads; beads are named by their numbers in the chain.
    first: usize,
    beads: usize,
    /// A ring of [`DEPTH`] frames.
    v_m_s: Vec<f64>,
    /// The beads that may move in each of them.
    active: [Active; DEPTH],
    times_s: [f64; DEPTH],
    filled: usize,
    newest: usize,
}

/// A crest at one bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crest {
    /// Time (s), interpolated.
    pub(super) time_s: f64,
    /// The velocity then (m/s), interpolated.
    pub(super) v_m_s: f64,
    /// Frames over its full width at half maximum, judged by its curvature.
    pub(super) frames: f64,
}

impl History {
    pub(super) fn new(beads: Range<usize>) -> Self {
        let (first, beads) = (beads.start, beads.len());
        Self {
            first,
            beads,
            v_m_s: vec![0.0; DEPTH * beads],
            active: [Active::all(0); DEPTH],
            times_s: [0.0; DEPTH],
            filled: 0,
            newest: 0,
        }
    }

    /// The beads.
    pub(super) fn range(&self) -> Range<usize> {
        self.first..self.first + self.beads
    }

    /// Takes the next frame, in which no beads but `active` move: `put` writes the velocities (m/s) of the beads that it is given.
    pub(super) fn push(&mut self, time_s: f64, active: Active, put: impl FnOnce(Range<usize>, &mut [f64])) {
        self.newest = (self.newest + 1) % DEPTH;
        self.filled = DEPTH.min(self.filled + 1);
        self.times_s[self.newest] = time_s;
        let beads = self.active[self.newest].renew(active).within(self.range());
        let start = self.newest * self.beads;
        let slot = &mut self.v_m_s[start..start + self.beads];
        put(beads.clone(), &mut slot[beads.start - self.first..beads.end - self.first]);
    }

    /// The beads that may move in the newest frame.
    pub(super) fn moving(&self) -> Range<usize> {
        self.active[self.newest].within(self.range())
    }

    /// The beads that may move in one of the frames.
    pub(super) fn moved(&self) -> Range<usize> {
        let [one, others @ ..] = self.active;
        others.into_iter().fold(one, Active::with).within(self.range())
    }

    /// Forgets all frames.
    pub(super) fn clear(&mut self) {
        self.filled = 0;
    }

    /// True if there are [`DEPTH`] frames in a row.
    pub(super) fn is_full(&self) -> bool {
        self.filled == DEPTH
    }

    /// Time (s) of the frame `back` frames before the newest.
    pub(super) fn time_s(&self, back: usize) -> f64 {
        self.times_s[self.slot(back)]
    }

    /// Velocity (m/s) of `bead` in the frame `back` frames before the newest; none if it is not one of the beads.
    pub(super) fn at(&self, back: usize, bead: i64) -> Option<f64> {
        let index = usize::try_from(bead).ok()?.checked_sub(self.first)?;
        self.v_m_s(back).get(index).copied()
    }

    /// Velocities (m/s) in the frame `back` frames before the newest.
    pub(super) fn v_m_s(&self, back: usize) -> &[f64] {
        let start = self.slot(back) * self.beads;
        &self.v_m_s[start..start + self.beads]
    }

    fn slot(&self, back: usize) -> usize {
        (self.newest + DEPTH - back) % DEPTH
    }

    /// Puts into `beads` those that have, in the middle frame, a maximum of |v| above `threshold_m_s`.
    pub(super) fn candidates(&self, threshold_m_s: f64, beads: &mut Vec<usize>) {
        const BLOCK: usize = 16;
        beads.clear();
        let moved = self.moved();
        let [before, at, after] =
            [3, 2, 1].map(|back| &self.v_m_s(back)[moved.start - self.first..moved.end - self.first]);
        let square = threshold_m_s * threshold_m_s;
        // without a branch in it the loop over a block is vectorised; a block with a crest in it is rare
        #[expect(clippy::needless_bitwise_bool, reason = "lazy operators are branches")]
        let is_crest = |((before, at), after): ((&f64, &f64), &f64)| {
            (at * at > square) & ((at - before) * at > 0.0) & ((at - after) * at >= 0.0)
        };
        let blocks = before.chunks(BLOCK).zip(at.chunks(BLOCK)).zip(after.chunks(BLOCK));
        for (block, ((before, at), after)) in blocks.enumerate() {
            let crests = before.iter().zip(at).zip(after);
            if crests.clone().fold(false, |any, crest| any | is_crest(crest)) {
                let hits = crests.enumerate().filter(|(_, crest)| is_crest(*crest));
                beads.extend(hits.map(|(offset, _)| moved.start + block * BLOCK + offset));
            }
        }
    }

    /// True if |v| of `bead` has a minimum in the middle frame, or v another sign than in the frame before.
    pub(super) fn is_least(&self, bead: usize) -> bool {
        let [before, at, after] = [3, 2, 1].map(|back| self.v_m_s(back)[bead - self.first]);
        at * before <= 0.0 || (at.abs() < before.abs() && at.abs() <= after.abs())
    }

    /// The crest at `bead` in the middle frame.
    pub(super) fn crest(&self, bead: usize) -> Crest {
        let middle_s = self.time_s(2);
        let unit_s = self.time_s(1) - middle_s;
        let x: [f64; DEPTH] = std::array::from_fn(|i| (self.time_s(DEPTH - 1 - i) - middle_s) / unit_s);
        let y: [f64; DEPTH] = std::array::from_fn(|i| self.v_m_s(DEPTH - 1 - i)[bead - self.first]);
        let quartic = polynomial(x, y);
        let at = extremum(quartic, x[1], x[3]);
        let v_m_s = value(&quartic, at);
        let curvature = 2.0 * quartic[2].abs();
        Crest {
            time_s: middle_s + at * unit_s,
            v_m_s,
            frames: GAUSSIAN_FWHM * (v_m_s.abs() / curvature).sqrt(),
        }
    }

    /// Time (s) at which `bead` passed `level_m_s` (of velocity times `sign`) between the two frames before the middle
    /// one and the middle one; none if it did not.
    pub(super) fn crossing_s(&self, bead: i64, sign: f64, level_m_s: f64) -> Option<f64> {
        self.at(0, bead)?;
        let y: [f64; 4] = std::array::from_fn(|i| sign * self.at(4 - i, bead).unwrap_or(0.0) - level_m_s);
        if (y[1] < 0.0) == (y[2] < 0.0) {
            return None;
        }
        let (from_s, unit_s) = (self.time_s(3), self.time_s(2) - self.time_s(3));
        let x: [f64; 4] = std::array::from_fn(|i| (self.time_s(4 - i) - from_s) / unit_s);
        let cubic = polynomial(x, y);
        let (mut low, mut high) = (0.0, 1.0);
        // 2^−40 of a frame
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if (value(&cubic, middle) < 0.0) == (y[1] < 0.0) { low = middle } else { high = middle }
        }
        Some(from_s + 0.5 * (low + high) * unit_s)
    }
}

/// Coefficients, the constant first, of the polynomial through the points (x, y): Newton's divided differences.
fn polynomial<const POINTS: usize>(x: [f64; POINTS], y: [f64; POINTS]) -> [f64; POINTS] {
    let mut divided = y;
    for order in 1..POINTS {
        for i in (order..POINTS).rev() {
            divided[i] = (divided[i] - divided[i - 1]) / (x[i] - x[i - order]);
        }
    }
    let mut coefficients = [0.0; POINTS];
    for i in (0..POINTS).rev() {
        // coefficients ← coefficients·(x − x_i) + divided_i
        for power in (1..POINTS).rev() {
            coefficients[power] = coefficients[power - 1] - x[i] * coefficients[power];
        }
        coefficients[0] = divided[i] - x[i] * coefficients[0];
    }
    coefficients
}

fn value(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

/// Extremum of a quartic near 0, between `low` and `high`.
fn extremum(quartic: [f64; DEPTH], low: f64, high: f64) -> f64 {
    let mut at = 0.0;
    for _ in 0..8 {
        let slope = quartic[1] + at * (2.0 * quartic[2] + at * (3.0 * quartic[3] + at * 4.0 * quartic[4]));
        let curvature = 2.0 * quartic[2] + at * (6.0 * quartic[3] + at * 12.0 * quartic[4]);
        let next = at - slope / curvature;
        // a flat top has no better place than the middle
        if !(low..=high).contains(&next) {
            return at;
        }
        at = next;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of one bead between two at rest, at uneven times.
    fn history(times_s: [f64; DEPTH], v: impl Fn(f64) -> f64) -> History {
        let mut history = History::new(0..3);
        for t in times_s {
            history.push(t, Active { first: 1, end: 2 }, |beads, to| to[1 - beads.start] = v(t));
        }
        history
    }

    #[test]
    fn a_quartic_is_found_exactly_at_uneven_times() {
        let v = |t: f64| -3.0 + 2.0 * (t - 0.7).powi(2) - 0.5 * (t - 0.7).powi(4);
        let history = history([0.0, 0.25, 0.6, 0.9, 1.25], v);
        let mut beads = Vec::new();
        history.candidates(1e-3, &mut beads);
        assert_eq!(beads, [1]);
        let crest = history.crest(1);
        assert!((crest.time_s - 0.7).abs() < 1e-14 && (crest.v_m_s + 3.0).abs() < 1e-14, "{crest:?}");
        let level = history.crossing_s(1, -1.0, 2.97).unwrap();
        // the cubic through four frames misses the quartic's term, at most 0.5·0.6·0.35·0.3·0.3 of it
        assert!((-v(level) - 2.97).abs() < 0.01, "{level}");
    }

    /// The promise of [`ENOUGH_FRAMES`], for any position of the crest between frames.
    #[test]
    fn eight_frames_a_width_give_the_peak_to_a_ten_thousandth() {
        let mut worst = 0.0_f64;
        for shift in 0..50 {
            let centre = 2.0 + f64::from(shift - 25) / 50.0;
            let sigma = ENOUGH_FRAMES / GAUSSIAN_FWHM;
            let v = |t: f64| (-0.5 * ((t - centre) / sigma).powi(2)).exp();
            let crest = history([0.0, 1.0, 2.0, 3.0, 4.0], v).crest(1);
            assert!((crest.frames / ENOUGH_FRAMES - 1.0).abs() < 0.1, "{crest:?}");
            worst = worst.max((crest.v_m_s - 1.0).abs());
        }
        assert!(worst < 1e-4, "{worst:e}");
    }

    #[test]
    fn neither_a_plateau_nor_rest_nor_a_minimum_is_a_crest() {
        for v in [
            |_: f64| 0.355,
            |_| 0.0,
            |t: f64| 1.0 + (t - 2.0).powi(2),
            |t: f64| 1e-4 - 1e-5 * (t - 2.0).powi(2),
        ] {
            let mut beads = Vec::new();
            history([0.0, 1.0, 2.0, 3.0, 4.0], v).candidates(1e-3, &mut beads);
            assert!(beads.is_empty());
        }
    }
}
