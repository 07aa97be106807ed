//! Against arbitrary precision (`tests/reference/functions.py`), and against sums of two doubles at many more points.

use super::*;
use crate::simd::vectorized;
use pulp::Arch;

fn double(bits: &str) -> f64 {
    f64::from_bits(u64::from_str_radix(bits, 16).expect("16 hex digits"))
}

fn ulp(x: f64) -> f64 {
    x.abs().next_up() - x.abs()
}

/// Every row of the table: values next to the exact ones, at step 2^52 as at step 1. An angle of `n` turns is right to 2^−105·n turns,
/// which near a zero of the sine is more than an ulp of the sine.
#[test]
fn functions_are_next_to_the_exact_ones() {
    let mut worst: Vec<(String, f64)> = Vec::new();
    for line in include_str!("../../../tests/reference/functions.csv").lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let at: Vec<f64> = fields[1].split(' ').map(double).collect();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count up to 2^52")]
        let turns = || Moment::new(at[0] as u64, at[1], at[2]).turns(at[3], at[4]);
        let (found, angle_error) = match fields[0] {
            "sine" => (sine_cosine(turns()).0, at[0] * at[1] * at[3]),
            "cosine" => (sine_cosine(turns()).1, at[0] * at[1] * at[3]),
            "turns_sine" => (sine_cosine((at[0], at[1])).0, 0.0),
            "turns_cosine" => (sine_cosine((at[0], at[1])).1, 0.0),
            "exp" => (exp(at[0]), 0.0),
            "expm1" => (exp_m1(at[0]), 0.0),
            "ln" => (ln(at[0]), 0.0),
            other => panic!("{other}"),
        };
        let (nearest, remainder): (f64, f64) = (double(fields[2]), fields[3].parse().expect("a number"));
        let angle_error = 6.3 * (angle_error + 1.0) * 2.0_f64.powi(-105) / ulp(nearest);
        let angle_error = if fields[0].ends_with("sine") { angle_error } else { 0.0 };
        let error = ((found - nearest) / ulp(nearest) - remainder).abs() - angle_error;
        match worst.iter_mut().find(|(name, _)| name == fields[0]) {
            Some((_, largest)) => *largest = largest.max(error),
            None => worst.push((fields[0].to_owned(), error)),
        }
    }
    println!("{worst:?}");
    assert_eq!(worst.len(), 7);
    for (name, error) in worst {
        assert!(error < limit(&name), "{name}: {error} ulp");
    }
}

fn limit(name: &str) -> f64 {
    match name {
        "expm1" => 2.5,
        "exp" | "ln" => 1.0,
        "cosine" | "turns_cosine" => 0.7,
        _ => 0.85,
    }
}

/// A sum of two doubles.
#[derive(Clone, Copy)]
struct Pair(f64, f64);

impl Pair {
    fn plus(self, other: Self) -> Self {
        let (sum, rest) = two_sum(self.0, other.0);
        let (high, low) = fast_two_sum(sum, rest + (self.1 + other.1));
        Self(high, low)
    }
    fn times(self, other: Self) -> Self {
        let (product, rest) = two_product(self.0, other.0);
        let (high, low) = fast_two_sum(product, rest + (self.0 * other.1 + self.1 * other.0));
        Self(high, low)
    }
    fn over(self, divisor: f64) -> Self {
        let quotient = self.0 / divisor;
        let (product, rest) = two_product(quotient, divisor);
        let (high, low) = fast_two_sum(quotient, (((self.0 - product) - rest) + self.1) / divisor);
        Self(high, low)
    }
    /// `1 + x + x²/2! + …` without its even or odd terms, alternating if `sign` is −1.
    fn series(self, first: u32, step: u32, sign: f64) -> Self {
        let power = if step == 2 { self.times(self) } else { self };
        let (mut term, mut sum) = (Self(1.0, 0.0), Self(0.0, 0.0));
        if first == 1 {
            term = self;
        }
        for n in 0..40 / step {
            sum = sum.plus(term);
            let at = f64::from(first + n * step);
            term = term.times(power);
            for factor in 1..=step {
                term = term.over(at + f64::from(factor));
            }
            term = Self(sign * term.0, sign * term.1);
        }
        sum
    }
    fn error_of(self, found: f64) -> f64 {
        ((found - self.0) - self.1).abs() / ulp(self.0)
    }
}

/// `BEADLINE_FUNCTIONS=10000000` tries so many points for each; `--nocapture` shows the largest errors.
#[test]
fn functions_are_within_their_bounds() {
    let tries =
        std::env::var("BEADLINE_FUNCTIONS").map_or(20_000_u64, |tries| tries.parse().expect("a number"));
    let mut worst = [0.0_f64; 5];
    for n in 1..=tries {
        let random = n.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let random = (random ^ random >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let random = (random ^ random >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        let uniform = (random >> 11) as f64 * 2.0_f64.powi(-53);
        // turns, within an eighth for the series of two doubles
        let (x, y) = (0.25 * uniform - 0.125, (random & 2047) as f64 * 2.0_f64.powi(-70));
        let angle = Pair(x, 0.0).plus(Pair(y, 0.0)).times(Pair(TURN[0], TURN[1]));
        let (sine, cosine) = sine_cosine((x, y));
        let quarter_on = sine_cosine((x + 0.25, y));
        if x + 0.25 - 0.25 == x {
            assert_eq!(quarter_on, (cosine, -sine));
        }
        let x = 1.5 * uniform - 0.75;
        let r = Pair(x, 0.0);
        let exact = r.series(0, 1, 1.0);
        let exact_m1 = exact.plus(Pair(-1.0, 0.0));
        // ln x = y + ln (x·e^−y) with a first guess y
        let at = 0.7 + 0.72 * uniform;
        let guess = ln(at);
        let off = Pair(-guess, 0.0).series(0, 1, 1.0).times(Pair(at, 0.0)).plus(Pair(-1.0, 0.0));
        let square = off.times(off).over(-2.0);
        let logarithm = Pair(guess, 0.0).plus(off).plus(square);
        let errors = [
            angle.series(1, 2, -1.0).error_of(sine),
            angle.series(0, 2, -1.0).error_of(cosine),
            exact.error_of(exp(x)),
            if x.abs() > 1e-9 { exact_m1.error_of(exp_m1(x)) } else { 0.0 },
            if (at - 1.0).abs() > 1e-9 { logarithm.error_of(guess) } else { 0.0 },
        ];
        for (largest, error) in worst.iter_mut().zip(errors) {
            *largest = largest.max(error);
        }
    }
    for (name, error) in ["sine", "cosine", "exp", "expm1", "ln"].iter().zip(worst) {
        println!("{name}: {error:.4} ulp");
        assert!(error < limit(name), "{name}: {error} ulp");
    }
}

/// Exponentials of a million numbers of all sizes, in vectors of each width, have the bits of `docs/KERNEL.md`, one number at a time.
#[test]
fn exponentials_in_vectors_have_the_bits_of_the_definition() {
    let defined = |x: f64| {
        let n = (x * LOG2_E + 0.5).floor();
        let r = (x - n * LN_2[0]) - n * LN_2[1];
        let m = r + (r * r) * EXPONENTIAL.iter().rev().fold(0.0, |sum, e| sum * r + e);
        #[expect(clippy::cast_possible_truncation, reason = "whole")]
        let s = 2.0_f64.powi(n as i32);
        match x {
            x if x.is_nan() => [x; 2],
            x if x > 700.0 => [f64::INFINITY; 2],
            x if x < -700.0 => [0.0, -1.0],
            _ => [s * m + s, s * m + (s - 1.0)],
        }
    };
    let ends =
        [0.0, f64::MIN_POSITIVE, 5e-324, 1.0, 700.0, 700.0_f64.next_up(), f64::MAX, f64::INFINITY, f64::NAN];
    let borders = (0..1011).map(|n| (f64::from(n) - 0.5) / LOG2_E);
    let borders = borders.flat_map(|x| [x.next_down(), x, x.next_up()]);
    let random = (0..500_000).map(|n| crate::philox::words(1, n, [0, 0]));
    let random = random.flat_map(|[a, b, c, _]| {
        [f64::from_bits(u64::from(a) << 32 | u64::from(b)), 750.0 / 2.0_f64.powi(32) * f64::from(c)]
    });
    let all: Vec<f64> = ends.into_iter().chain(borders).chain(random).flat_map(|x| [x, -x]).collect();
    let mut archs = vec![Arch::Scalar, Arch::new()];
    #[cfg(target_arch = "x86_64")]
    archs.extend(pulp::x86::V3::try_new().map(Arch::V3));
    for arch in archs {
        let mut found = vec![[0.0; 2]; all.len()];
        vectorized(
            arch,
            #[inline(always)]
            || found.iter_mut().zip(&all).for_each(|(found, x)| *found = [exp(*x), exp_m1(*x)]),
        );
        for (x, found) in all.iter().zip(found) {
            let (found, expected) = (found.map(f64::to_bits), defined(*x).map(f64::to_bits));
            assert!(found == expected, "{arch:?}, {x:e}: {found:x?} for {expected:x?}");
        }
    }
}

#[test]
fn quarter_turns_are_exact() {
    for (quarters, expected) in
        [(0.0, (0.0, 1.0)), (0.25, (1.0, 0.0)), (0.5, (0.0, -1.0)), (-0.25, (-1.0, 0.0)), (1.0, (0.0, 1.0))]
    {
        assert_eq!(sine_cosine((quarters, 0.0)), expected);
    }
}

#[test]
fn what_is_beyond_is_zero_one_or_infinite() {
    assert_eq!((exp(701.0), exp(-701.0)), (f64::INFINITY, 0.0));
    assert_eq!((exp_m1(701.0), exp_m1(-701.0)), (f64::INFINITY, -1.0));
    assert!(exp(f64::NAN).is_nan() && exp_m1(f64::NAN).is_nan());
    assert!(exp(700.0).is_finite() && exp(-700.0) > f64::MIN_POSITIVE);
}

/// A moment is exact: differences of neighbouring steps are the step, at the end of the longest run.
#[test]
fn a_moment_is_exact() {
    let dt = 0.1;
    let (late, next) = (Moment::new((1 << 52) - 1, dt, 0.0), Moment::new(1 << 52, dt, 0.0));
    let difference = (next.hi - late.hi) + (next.lo - late.lo);
    assert_eq!(difference, dt);
    assert_eq!(next.since(next.hi).hi, next.lo);
    assert_eq!(Moment::new(7, 0.125, 0.0625).until(1.0), Moment { hi: 0.0625, lo: 0.0 });
}
