//! `x^α` of many `x` and one α: from a table, the same bits on every IEEE machine.
//!
//! The upper bits of `x`, its exponent and the first `b` digits after the point of its mantissa, choose an interval with the
//! centre `c`, so that `x = c·(1 + r)` with `|r| < 2^-(b+1)` and `x^α = c^α + c^α·((1 + r)^α − 1)`. The table has `c^α` to 90
//! digits, as two doubles; the rest is a binomial series. `docs/KERNEL.md` defines every bit of it.

use super::fixed::Power;
use std::sync::{Arc, Mutex, PoisonError};

/// Room for entries: at most 229,400 are used, and 100,000 at α = 1.3. Memory that is not used is never touched.
const SPAN: usize = 1 << 18;
/// Terms of the series.
const TERMS: usize = 5;
/// Number of tables that are kept for the next user of the same exponent: 51 MB of α = 1.3, at most 117 MB. A sweep makes the points of a
/// batch before it runs them, on each core.
const KEPT: usize = 32;

const MANTISSA: u64 = (1 << 52) - 1;
const ONE: u64 = 1023 << 52;

/// The powers of one exponent.
#[derive(Debug)]
pub struct PowerTable {
    alpha: f64,
    /// `c^α` of each interval between the bounds, as a double and the rest; the first entry is zero.
    entries: Box<[[f64; 2]; SPAN]>,
    numbers: Numbers,
}

/// Numbers for the computation, beside the table.
#[derive(Debug, Clone, Copy)]
struct Numbers {
    /// Coefficients of `r` to `r^5` in the series of `(1 + r)^α − 1`.
    series: [f64; TERMS],
    /// Digits of a double that do not choose the interval, `52 − b`.
    shift: u32,
    /// Upper bits of the interval of the first entry.
    first: u64,
    /// The last number of that interval: up to it, the power is taken for zero.
    zero_up_to: f64,
    /// From here on the power is taken for infinite.
    infinite_from: f64,
}

/// The powers of one exponent, for loops: numbers in it are not fetched again after each store.
#[derive(Debug, Clone, Copy)]
pub struct Powers<'a> {
    entries: &'a [[f64; 2]; SPAN],
    numbers: Numbers,
}

impl PowerTable {
    /// The table of `alpha`, from 1 to 1000, that was made last, or a new one, which takes 2 ms (more above α = 5).
    pub fn shared(alpha: f64) -> Arc<Self> {
        static RECENT: Mutex<Vec<Arc<PowerTable>>> = Mutex::new(Vec::new());
        let recent = || RECENT.lock().unwrap_or_else(PoisonError::into_inner);
        let find = |tables: &[Arc<Self>]| tables.iter().position(|table| table.alpha == alpha);
        let mut tables = recent();
        if let Some(at) = find(&tables) {
            tables[..=at].rotate_right(1);
            return Arc::clone(&tables[0]);
        }
        // others need not wait for it
        drop(tables);
        let made = Arc::new(Self::new(alpha));
        let mut tables = recent();
        tables.insert(0, Arc::clone(&made));
        tables.truncate(KEPT);
        made
    }

    fn new(alpha: f64) -> Self {
        let bits = digits_of_interval(alpha);
        let (count, shift) = (1_u64 << bits, 52 - bits);
        let [zero_up_to, infinite_from] = bounds(alpha);
        let zero_up_to = f64::from_bits(zero_up_to.to_bits() | ((1 << shift) - 1));
        let (first, last) = (zero_up_to.to_bits() >> shift, infinite_from.to_bits() >> shift);
        let power = |x: f64| Power::of(x, alpha).expect("overlaps are no extreme numbers");
        let centres: Vec<Power> =
            (0..count).map(|i| power(f64::from_bits(ONE | i << shift | 1 << (shift - 1)))).collect();
        let mut entries: Box<[[f64; 2]; SPAN]> =
            vec![[0.0; 2]; SPAN].into_boxed_slice().try_into().expect("SPAN entries");
        let mut of_two = power(f64::from_bits(first >> bits << 52));
        for (upper, entry) in (first + 1..=last).zip(&mut entries[1..]) {
            if upper % count == 0 {
                of_two = power(f64::from_bits(upper << shift));
            }
            #[expect(clippy::cast_possible_truncation, reason = "fewer than SPAN")]
            let centre = centres[(upper % count) as usize];
            *entry = of_two.times(centre).in_two_doubles();
        }
        let numbers = Numbers { series: series(alpha, bits), shift, first, zero_up_to, infinite_from };
        Self { alpha, entries, numbers }
    }

    /// FNV-1a over the bits of the entries, each number as one: high and low part in turn, from the first that is not zero.
    #[cfg(test)]
    pub(super) fn hash(&self) -> u64 {
        let used = self.entries[1..].iter().take_while(|entry| entry[0] != 0.0);
        used.flatten()
            .fold(0xcbf2_9ce4_8422_2325, |hash: u64, x| (hash ^ x.to_bits()).wrapping_mul(0x0100_0000_01b3))
    }

    /// For use in loops.
    pub fn powers(&self) -> Powers<'_> {
        Powers { entries: &self.entries, numbers: self.numbers }
    }

    /// Up to this the power is taken for zero.
    pub fn zero_up_to(&self) -> f64 {
        self.numbers.zero_up_to
    }
}

/// Digits after the point that choose the interval: so many that what the series leaves out is below 2^-58 (α ≤ 5), or
/// `|α·r| ≤ 2^-7`.
fn digits_of_interval(alpha: f64) -> u32 {
    if alpha <= 5.0 {
        return 7;
    }
    let mut bits = 9;
    while alpha > f64::from(1_u32 << (bits - 6)) {
        bits += 1;
    }
    bits
}

/// Between these overlaps neither `δ^α` nor `δ^(α+1)` leaves the range of normal doubles, with room for a stiffness: from
/// `2^(−900/(α+1))` to `2^(900/(α+1))`, with a straight line in place of the fraction of a power of two.
pub(crate) fn bounds(alpha: f64) -> [f64; 2] {
    let digits = 900.0 / (alpha + 1.0);
    let line = |x: f64| {
        let whole = x.floor();
        #[expect(clippy::cast_possible_truncation, reason = "whole, and within ±450")]
        let scale = f64::from_bits(((1023 + whole as i64) << 52).cast_unsigned());
        (1.0 + (x - whole)) * scale
    };
    [line(-digits), line(digits)]
}

/// Coefficients of `r` to `r^5` in `(1 + r)^α − 1`, the sixth term folded into them.
fn series(alpha: f64, bits: u32) -> [f64; TERMS] {
    let mut series = [alpha; TERMS];
    for n in 1..TERMS {
        series[n] = series[n - 1] * (alpha - n as f64) / (n as f64 + 1.0);
    }
    // by the polynomial that is nearest to it for |r| ≤ R (Chebyshev): r^6 ≈ 3/2·R²·r^4 − 9/16·R^4·r²
    let sixth = series[4] * (alpha - 5.0) / 6.0;
    let square = f64::from_bits((1023 - 2 * u64::from(bits + 1)) << 52);
    series[3] += 1.5 * square * sixth;
    series[1] -= 0.5625 * (square * square) * sixth;
    series
}

impl Powers<'_> {
    /// `x^α` of each `x`, 0 where `x` is not above [`PowerTable::zero_up_to`].
    ///
    /// In loops of which the compiler makes vectors, but for the one in the middle, which loads two doubles at a time.
    #[inline(always)]
    pub fn raise<const B: usize>(self, x: &[f64; B]) -> [f64; B] {
        let (mut above, mut places) = ([0.0; B], [0_u32; B]);
        for n in 0..B {
            above[n] = self.above(x[n]);
            places[n] = self.place(above[n]);
        }
        let mut entries = [[0.0; 2]; B];
        for n in 0..B {
            entries[n] = self.entries[places[n] as usize % SPAN];
        }
        let mut powers = [0.0; B];
        for n in 0..B {
            powers[n] = self.near(above[n], entries[n]);
        }
        powers
    }

    /// The same of one `x`.
    #[inline(always)]
    pub fn raise_one(self, x: f64) -> f64 {
        let above = self.above(x);
        self.near(above, self.entries[self.place(above) as usize % SPAN])
    }

    #[inline(always)]
    fn above(self, x: f64) -> f64 {
        if x > self.numbers.zero_up_to { x } else { self.numbers.zero_up_to }
    }

    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "fewer than SPAN; what is beyond the table is infinite"
    )]
    fn place(self, x: f64) -> u32 {
        (x.to_bits() >> self.numbers.shift).wrapping_sub(self.numbers.first) as u32
    }

    /// `x^α` from the power of the centre of its interval.
    #[inline(always)]
    fn near(self, x: f64, [high, low]: [f64; 2]) -> f64 {
        let Numbers { series, shift, infinite_from, .. } = self.numbers;
        let below = (1_u64 << shift) - 1;
        let mantissa = f64::from_bits(x.to_bits() & MANTISSA | ONE);
        let centre = f64::from_bits(x.to_bits() & (MANTISSA & !below) | (ONE | (below ^ below >> 1)));
        let r = (mantissa - centre) / centre; // the difference is exact
        let mut sum = series[TERMS - 1];
        let mut n = TERMS - 1;
        while n > 0 {
            n -= 1;
            sum = sum * r + series[n];
        }
        let power = high + (high * (sum * r) + low);
        if x < infinite_from { power } else { f64::INFINITY }
    }
}
