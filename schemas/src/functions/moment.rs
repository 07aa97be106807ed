//! A time of a run as two doubles, exact for every step.

use super::{TURN, fast_two_sum, two_product, two_sum};

/// `1/2π` as two doubles.
const TURNS_OF_A_RADIAN: [f64; 2] =
    [f64::from_bits(0x3fc4_5f30_6dc9_c883), f64::from_bits(0xbc66_b01e_c541_7056)];

/// A time (s) that is `hi + lo` exactly, with `hi` next to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    pub(crate) hi: f64,
    pub(crate) lo: f64,
}

impl Moment {
    /// `after_s` after the beginning of step `step`, of up to 2^52, of a run with steps of `dt_s`.
    ///
    /// ```
    /// use schemas::functions::Moment;
    /// assert_eq!(Moment::new(3, 0.1, 0.0).seconds(), 0.30000000000000004); // three times the double next to 0.1
    /// ```
    #[inline(always)]
    pub fn new(step: u64, dt_s: f64, after_s: f64) -> Self {
        let (h, l) = two_product(step as f64, dt_s);
        let (h, e) = two_sum(h, after_s);
        let (hi, lo) = fast_two_sum(h, l + e);
        Self { hi, lo }
    }

    /// The double next to the time (s).
    pub fn seconds(self) -> f64 {
        self.hi
    }

    /// The time (s) since `start_s`.
    #[inline(always)]
    pub(crate) fn since(self, start_s: f64) -> Self {
        let (h, e) = two_sum(self.hi, -start_s);
        let (hi, lo) = fast_two_sum(h, self.lo + e);
        Self { hi, lo }
    }

    /// The time (s) until `end_s`.
    #[inline(always)]
    pub(crate) fn until(self, end_s: f64) -> Self {
        let Self { hi, lo } = self.since(end_s);
        Self { hi: -hi, lo: -lo }
    }

    /// Turns of an oscillation of the frequency `hz` with the phase `phase_rad` at time 0, without whole turns: a double between
    /// −½ and ½ and a small rest, right to 2^−105 of the number of turns.
    #[inline(always)]
    pub(crate) fn turns(self, hz: f64, phase_rad: f64) -> (f64, f64) {
        let (p, e) = two_product(hz, self.hi);
        let e = e + hz * self.lo;
        let (a, b) = two_product(phase_rad, TURNS_OF_A_RADIAN[0]);
        let (p, c) = two_sum(p, a);
        without_whole_turns(p, (e + (b + phase_rad * TURNS_OF_A_RADIAN[1])) + c)
    }

    /// The same for a frequency that is `from_hz` at time 0 and grows by `2·half_rate` (Hz/s).
    #[inline(always)]
    pub(crate) fn chirped_turns(self, from_hz: f64, half_rate: f64) -> (f64, f64) {
        let (p, e) = two_product(from_hz, self.hi);
        let e = e + from_hz * self.lo;
        let (square, square_rest) = two_product(self.hi, self.hi);
        let (q, q_rest) = two_product(half_rate, square);
        let q_rest = q_rest + half_rate * (square_rest + 2.0 * (self.hi * self.lo));
        let (p, c) = two_sum(p, q);
        without_whole_turns(p, (e + q_rest) + c)
    }
}

#[inline(always)]
fn without_whole_turns(turns: f64, rest: f64) -> (f64, f64) {
    two_sum(turns - (turns + 0.5).floor(), rest)
}

/// `2π·hz` (rad/s).
#[inline(always)]
pub(crate) fn angular(hz: f64) -> f64 {
    TURN[0] * hz
}
