//! The project's own power function, the same bits on every machine.
//!
//! Platform `pow` differs between C libraries and their versions, so the contact law never calls
//! it. Everything here is IEEE-754 `+ − × ÷ √`, correctly rounded fused multiply-add, comparisons
//! that select, and integer operations on the bits of a double; there are no branches and no
//! tables, so that the compiler can vectorise a loop over contacts.
//!
//! The logarithm is `log2 x = e + (2/ln 2)·atanh s` with `s = (m − 1)/(m + 1)`, `x = m·2^e`,
//! `√½ ≤ m < √2`, carried as an unevaluated sum of two doubles (about 2⁻⁶⁵ relative), so that the
//! product with the exponent is good to a fraction of an ulp of the result.

use std::f64::consts::LN_2;

/// `1/3` minus its nearest double.
const THIRD_LOW: f64 = 1.850_371_707_708_594e-17;
/// `2/ln 2`, nearest double.
const TWO_OVER_LN2: f64 = 2.885_390_081_777_926_8;
/// `2/ln 2` minus [`TWO_OVER_LN2`].
const TWO_OVER_LN2_LOW: f64 = 4.071_054_748_186_206_6e-17;
/// Bits of the double next to `√½`, where the reduced mantissa begins.
const SQRT_HALF_BITS: u64 = 0x3fe6_a09e_667f_3bcd;
/// Bits of `2^52`: adding a small integer to them and subtracting `2^52` turns it into a double.
const TWO_52_BITS: u64 = 0x4330_0000_0000_0000;
/// `1.5·2^52`: adding and subtracting it rounds to the nearest integer.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// `1/(2j + 3)` for j = 1…11: the series of `(atanh s − s)/s³ − 1/3` in `s²`, divided by `s²`.
const ATANH: [f64; 11] = [
    1.0 / 5.0,
    1.0 / 7.0,
    1.0 / 9.0,
    1.0 / 11.0,
    1.0 / 13.0,
    1.0 / 15.0,
    1.0 / 17.0,
    1.0 / 19.0,
    1.0 / 21.0,
    1.0 / 23.0,
    1.0 / 25.0,
];

/// `ln 2` minus its nearest double.
const LN_2_LOW: f64 = 2.319_046_813_846_3e-17;
/// `(ln 2)^k/k!` for k = 2…14: the series of `(2^r − 1 − r·ln 2)/r²`.
const EXP2: [f64; 13] = [
    2.402_265_069_591_007_2e-1,
    5.550_410_866_482_158e-2,
    9.618_129_107_628_477e-3,
    1.333_355_814_642_844_3e-3,
    1.540_353_039_338_161e-4,
    1.525_273_380_405_984_1e-5,
    1.321_548_679_014_431e-6,
    1.017_808_600_923_97e-7,
    7.054_911_620_801_123e-9,
    4.445_538_271_870_811_6e-10,
    2.567_843_599_348_820_6e-11,
    1.369_148_885_390_412_8e-12,
    6.778_726_354_822_545e-14,
];

/// `x^exponent` for a positive, normal, finite `x`.
///
/// The result is within 0.7 ulp of the exact power (see the tests) where it lies between `2^−1021` and `2^1023`; it is
/// `+0` below and `+∞` above. For `x` that is zero, negative, subnormal or not finite the value is
/// unspecified (but the same everywhere).
///
/// # Source
/// The reduction is the classical one of W. J. Cody and W. Waite, *Software Manual for the
/// Elementary Functions* (1980); error-free sums and products after T. J. Dekker, Numer. Math. 18
/// (1971) 224, doi:10.1007/BF01397083.
///
/// ```
/// assert_eq!(schemas::power::power(4.0, 2.5), 32.0);
/// ```
#[inline(always)]
pub fn power(x: f64, exponent: f64) -> f64 {
    let (log_high, log_low) = log2(x);
    let y = exponent * log_high;
    let y_low = exponent.mul_add(log_high, -y) + exponent * log_low;
    exp2(y, y_low)
}

/// `log2 x` as an unevaluated sum of two doubles.
#[inline(always)]
fn log2(x: f64) -> (f64, f64) {
    let bits = x.to_bits();
    // e + 1024 as a small positive integer, so that no signed 64-bit shift is needed
    let shifted = bits.wrapping_sub(SQRT_HALF_BITS).wrapping_add(1024 << 52) >> 52;
    let e = f64::from_bits(TWO_52_BITS | shifted) - (4_503_599_627_370_496.0 + 1024.0);
    let m = f64::from_bits(bits.wrapping_sub(shifted.wrapping_sub(1024) << 52));

    let numerator = m - 1.0; // exact
    let denominator = m + 1.0;
    // exact: what the rounding of m + 1 left behind (1 and m differ by less than a factor 2)
    let big = if m > 1.0 { m } else { 1.0 };
    let small = if m > 1.0 { 1.0 } else { m };
    let denominator_low = small - (denominator - big);
    let s = numerator / denominator;
    let remainder = (-s).mul_add(denominator, numerator) - s * denominator_low;
    let s_low = remainder / denominator;

    let w = s * s;
    let w_low = s.mul_add(s, -w);
    // atanh(s)/s − 1 = w·(1/3 + w·(1/5 + …)), its leading part in two doubles
    let tail = w * polynomial(&ATANH, w);
    let third = 1.0 / 3.0;
    let p = third + tail;
    let p_low = (third - p) + tail + THIRD_LOW;
    let q = w * p;
    let q_low = w.mul_add(p, -q) + (w * p_low + w_low * p);
    // atanh s = s + s·(q + q_low) + s_low·(1 + w + w²)
    let sq = s * q;
    let sq_low = s.mul_add(q, -sq) + s * q_low + s_low * w.mul_add(w + 1.0, 1.0);
    let a = s + sq;
    let a_low = (s - a) + sq + sq_low;

    let l = a * TWO_OVER_LN2;
    let l_low = a.mul_add(TWO_OVER_LN2, -l) + (a * TWO_OVER_LN2_LOW + a_low * TWO_OVER_LN2);
    // |e| ≥ 1 > |l| or e = 0, so this sum is exact either way
    let high = e + l;
    let low = (e - high) + l + l_low;
    (high, low)
}

/// `2^(y + y_low)`, flushed to `+0` below the normal range and to `+∞` above it.
#[inline(always)]
fn exp2(y: f64, y_low: f64) -> f64 {
    let in_range = if y > -1021.0 { y } else { -1021.0 };
    let in_range = if in_range < 1023.0 { in_range } else { 1023.0 };
    let rounded = in_range + ROUNDER;
    let n_bits = rounded.to_bits() << 52;
    let r = in_range - (rounded - ROUNDER); // exact, |r| ≤ 1/2
    // 2^(r + y_low) = 1 + (r + y_low)·ln 2 + …, the first two terms in two doubles
    let linear = r * LN_2;
    let linear_low = r.mul_add(LN_2, -linear) + (r * LN_2_LOW + y_low * LN_2);
    let whole = r + y_low;
    let curved = whole * whole * polynomial(&EXP2, whole);
    let sum = 1.0 + linear;
    let sum_low = (1.0 - sum) + linear;
    let fraction = sum + (sum_low + (curved + linear_low));
    let value = f64::from_bits(fraction.to_bits().wrapping_add(n_bits));
    let value = if y > -1021.0 { value } else { 0.0 };
    if y < 1023.0 { value } else { f64::INFINITY }
}

/// Horner's rule with fused multiply-add; `coefficients[k]` belongs to `x^k`.
#[inline(always)]
fn polynomial<const COUNT: usize>(coefficients: &[f64; COUNT], x: f64) -> f64 {
    let mut sum = coefficients[COUNT - 1];
    let mut k = COUNT - 1;
    while k > 0 {
        k -= 1;
        sum = sum.mul_add(x, coefficients[k]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arbitrary-precision values (`tests/reference/powers.py`), over overlaps from 1e-290 m up and close to 1.
    #[test]
    fn is_within_0_7_ulp_of_the_exact_power() {
        let reference = include_str!("../../tests/reference/powers.csv");
        let double = |bits: &str| f64::from_bits(u64::from_str_radix(bits, 16).expect("16 hex digits"));
        let (mut rows, mut worst) = (0, 0.0_f64);
        for line in reference.lines().skip(1) {
            let fields: Vec<&str> = line.split(',').collect();
            let (x, exponent, nearest) = (double(fields[0]), double(fields[1]), double(fields[2]));
            let remainder: f64 = fields[3].parse().expect("a number");
            // both are normal doubles a few ulp apart, so the difference of their bits counts ulps
            let ulps = power(x, exponent).to_bits().wrapping_sub(nearest.to_bits()).cast_signed();
            worst = worst.max((ulps as f64 - remainder).abs());
            rows += 1;
        }
        assert!(rows > 1500 && worst < 0.7, "worst error {worst} ulp in {rows} rows");
    }

    #[test]
    fn powers_of_two_are_exact() {
        for e in (-200_i32..200).step_by(2) {
            assert_eq!(power(2.0_f64.powi(e), 2.5), 2.0_f64.powf(2.5 * f64::from(e)));
            assert_eq!(power(2.0_f64.powi(e), 1.0), 2.0_f64.powi(e));
        }
    }

    #[test]
    fn one_to_any_power_is_one() {
        for exponent in [1.0, 1.3, 400.0] {
            assert_eq!(power(1.0, exponent), 1.0);
        }
    }

    #[test]
    fn leaves_the_range_without_subnormals() {
        assert_eq!(power(1e-40, 10.0), 0.0);
        assert_eq!(power(1e40, 10.0), f64::INFINITY);
        assert!(power(2.0_f64.powi(-102), 10.0) >= f64::MIN_POSITIVE);
    }

    /// Pins the bits: these change only together with the kernel version.
    #[test]
    fn bits_are_pinned() {
        let mut hash = 0_u64;
        let mut x = 3e-7_f64;
        while x < 2.0 {
            hash = hash.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ power(x, 1.3).to_bits();
            x *= 1.0137;
        }
        assert_eq!(hash, PINNED);
    }
    const PINNED: u64 = 7_089_292_935_293_369_913;
}
