//! A pulse as samples of overlap and rate, and its measures.

use super::Untold;

/// The overlap of a contact at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time (s).
    pub time_s: f64,
    /// Overlap δ (m).
    pub overlap_m: f64,
    /// Its rate of change (m/s).
    pub rate_m_s: f64,
}

/// The shape of a pulse at a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Time of the largest overlap (s), interpolated.
    pub peak_s: f64,
    /// The largest overlap (m), interpolated.
    pub overlap_m: f64,
    /// Full width at half maximum (s).
    pub width_s: f64,
    /// `(t₂ − t₁)/(t₂ + t₁)`, t₁ the time from half the peak to it, t₂ from it to half: 0 for a symmetric
    /// pulse, positive if the overlap falls more slowly than it rose.
    pub asymmetry: f64,
    /// ∫F dt over the pulse (N·s).
    pub impulse_n_s: f64,
}

/// Integrals (m·s, m²·s) and maximum (m) of a difference.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Errors {
    pub(super) integral: f64,
    pub(super) square_integral: f64,
    pub(super) largest: f64,
}

impl Sample {
    /// The compression (m); a gap is no deformation.
    pub fn compression_m(&self) -> f64 {
        if self.overlap_m > 0.0 { self.overlap_m } else { 0.0 }
    }

    /// The cubic to `next` at the part `s` of the way, from 0 to 1.
    fn towards(&self, next: &Self, s: f64) -> f64 {
        let (duration_s, rest) = (next.time_s - self.time_s, 1.0 - s);
        self.overlap_m * rest * rest * (1.0 + 2.0 * s)
            + next.overlap_m * s * s * (3.0 - 2.0 * s)
            + duration_s * s * rest * (self.rate_m_s * rest - next.rate_m_s * s)
    }

    /// The rate of that cubic times the time to `next`.
    fn rise_towards(&self, next: &Self, s: f64) -> f64 {
        let duration_s = next.time_s - self.time_s;
        6.0 * s * (1.0 - s) * (next.overlap_m - self.overlap_m)
            + duration_s * (self.rate_m_s * (1.0 - s) * (1.0 - 3.0 * s) + next.rate_m_s * s * (3.0 * s - 2.0))
    }
}

/// Reads the shape off `samples`; `force` is the force (N) of an overlap (m).
pub(super) fn shape(samples: &[Sample], force: impl Fn(f64) -> f64) -> Result<Shape, Untold> {
    let by_overlap = |a: &(usize, &Sample), b: &(usize, &Sample)| a.1.overlap_m.total_cmp(&b.1.overlap_m);
    let largest = samples.iter().enumerate().max_by(by_overlap).ok_or(Untold::NoPulse)?.0;
    if largest == 0 || largest + 1 >= samples.len() {
        return Err(Untold::Sparse);
    }
    let (peak_s, overlap_m) = peak(&samples[largest - 1..=largest + 1]);
    let half_m = 0.5 * overlap_m;
    let rising = samples[..=largest].windows(2).rev().find(|pair| pair[0].overlap_m <= half_m);
    let falling = samples[largest..].windows(2).find(|pair| pair[1].overlap_m <= half_m);
    let (Some(rising), Some(falling)) = (rising, falling) else { return Err(Untold::Sparse) };
    let (rise_s, fall_s) = (peak_s - crossing(rising, half_m), crossing(falling, half_m) - peak_s);
    let impulses = samples.windows(2).map(|pair| {
        0.5 * (force(pair[0].overlap_m) + force(pair[1].overlap_m)) * (pair[1].time_s - pair[0].time_s)
    });
    Ok(Shape {
        peak_s,
        overlap_m,
        width_s: rise_s + fall_s,
        asymmetry: (fall_s - rise_s) / (fall_s + rise_s),
        impulse_n_s: impulses.sum(),
    })
}

/// Steps in which a theory is integrated outside of the samples, on either side.
const OUTSIDE: u32 = 512;

/// The differences of `samples`, and of nothing outside of them, to `theory` (m, of a time in s), which is 0
/// outside of `extent_s`. By the trapezoidal rule.
pub(super) fn errors(samples: &[Sample], extent_s: (f64, f64), theory: impl Fn(f64) -> f64) -> Errors {
    let mut errors = Errors::default();
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return errors };
    let between = |from_s: f64, to_s: f64| {
        let steps = if to_s > from_s { OUTSIDE } else { 0 };
        (0..steps).map(move |i| from_s + (to_s - from_s) * f64::from(i) / f64::from(OUTSIDE))
    };
    let nothing = |time_s: f64| Sample { time_s, overlap_m: 0.0, rate_m_s: 0.0 };
    let early = between(extent_s.0, first.time_s).map(nothing);
    let late = between(last.time_s, extent_s.1).skip(1).map(nothing);
    let mut before: Option<(f64, f64)> = None;
    for sample in early.chain(samples.iter().copied()).chain(late) {
        let error_m = (sample.compression_m() - theory(sample.time_s)).abs();
        if let Some((time_s, error_before_m)) = before {
            let half_s = 0.5 * (sample.time_s - time_s);
            errors.integral += half_s * (error_m + error_before_m);
            errors.square_integral += half_s * (error_m * error_m + error_before_m * error_before_m);
        }
        if error_m > errors.largest {
            errors.largest = error_m;
        }
        before = Some((sample.time_s, error_m));
    }
    errors
}

/// Time (s) and overlap (m) where the rate, a parabola through three of them, changes its sign.
fn peak(around: &[Sample]) -> (f64, f64) {
    let [before, middle, after] = around else { return (f64::NAN, f64::NAN) };
    // the largest sample is one side of the peak, its rate says which
    let (left, right) = if middle.rate_m_s > 0.0 { (middle, after) } else { (before, middle) };
    let time_s = zero_of_parabola([before, middle, after]).clamp(left.time_s, right.time_s);
    let s = (time_s - left.time_s) / (right.time_s - left.time_s);
    (time_s, left.towards(right, s))
}

/// The zero, near the middle, of the parabola through the rates of three samples.
fn zero_of_parabola([before, middle, after]: [&Sample; 3]) -> f64 {
    let (left_s, right_s) = (middle.time_s - before.time_s, after.time_s - middle.time_s);
    let left = (middle.rate_m_s - before.rate_m_s) / left_s;
    let right = (after.rate_m_s - middle.rate_m_s) / right_s;
    let curvature = (right - left) / (left_s + right_s);
    let slope = left + curvature * left_s;
    // of the two zeros the one near the middle, without cancellation
    let root = (slope * slope - 4.0 * curvature * middle.rate_m_s).sqrt();
    let offset_s = -2.0 * middle.rate_m_s / (slope + root.copysign(slope));
    if offset_s.is_finite() { middle.time_s + offset_s } else { middle.time_s }
}

/// Time (s) at which the cubic between two samples passes `level_m`, which lies between them.
fn crossing(pair: &[Sample], level_m: f64) -> f64 {
    let [first, second] = pair else { return f64::NAN };
    let rises = second.overlap_m > first.overlap_m;
    let (mut low, mut high, mut s) = (0.0, 1.0, 0.5);
    for _ in 0..60 {
        let above_m = first.towards(second, s) - level_m;
        if (above_m > 0.0) == rises {
            high = s;
        } else {
            low = s;
        }
        // Newton's step while it stays inside
        let next = s - above_m / first.rise_towards(second, s);
        s = if next > low && next < high { next } else { 0.5 * (low + high) };
    }
    first.time_s + s * (second.time_s - first.time_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(time_s: f64, overlap_m: f64, rate_m_s: f64) -> Sample {
        Sample { time_s, overlap_m, rate_m_s }
    }

    /// δ = t²·(3 − t): rate 6t − 3t², peak 4 at t = 2. A cubic is exact.
    #[test]
    fn a_cubic_is_read_exactly() {
        let at = |t: f64| sample(t, t * t * (3.0 - t), 6.0 * t - 3.0 * t * t);
        let samples: Vec<_> = [0.0, 0.4, 0.9, 1.3, 1.8, 2.3, 2.6, 3.0].map(at).into();
        let shape = shape(&samples, |overlap_m| overlap_m).expect("a pulse");
        assert!((shape.peak_s - 2.0).abs() < 1e-12 && (shape.overlap_m - 4.0).abs() < 1e-12);
        // δ = 2 at t = 1 and t = 1 + √3
        assert!((shape.width_s - 3.0_f64.sqrt()).abs() < 1e-12);
        let (rise, fall) = (1.0, 3.0_f64.sqrt() - 1.0);
        assert!((shape.asymmetry - (fall - rise) / (fall + rise)).abs() < 1e-12);
    }

    #[test]
    fn errors_are_integrals_over_time() {
        let samples = [sample(0.0, 1.0, 0.0), sample(2.0, -3.0, 0.0), sample(3.0, 2.0, 0.0)];
        // differences to 1: 0, 1 (a gap is no deformation), 1
        let inside = errors(&samples, (0.0, 3.0), |_| 1.0);
        assert_eq!(inside, Errors { integral: 2.0, square_integral: 2.0, largest: 1.0 });
        // a theory of ½ that goes on for 4 s on either side, over samples that it equals
        let same = [0.0, 1.0].map(|time_s| sample(time_s, 0.5, 0.0));
        let beyond = errors(&same, (-4.0, 5.0), |_| 0.5);
        // between the last of what it equals and the first of nothing the trapezoid has half a step
        assert!((beyond.integral - 4.0).abs() < 0.01 && (beyond.square_integral - 2.0).abs() < 0.01);
    }
}
