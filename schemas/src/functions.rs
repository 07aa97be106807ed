//! The project's own sine, cosine, exponential and logarithm, the same bits on every machine.
//!
//! Functions of platforms differ between C libraries, so nothing that decides bits calls them. Every function here is made of
//! `+ − × ÷` and `⌊ ⌋` of doubles, each rounded once, in the order that `docs/KERNEL.md` states. Arguments of waves are pairs of
//! doubles, reduced exactly from the number of the step: step 10^9 is as good as step 1.

mod moment;
mod table;

pub use moment::Moment;
pub(crate) use moment::angular;

use table::{COSINE, EXPONENTIAL, LOGARITHM, SINE};

/// The double next to 2π, and the double next to the rest.
pub(crate) const TURN: [f64; 2] =
    [f64::from_bits(0x4019_21fb_5444_2d18), f64::from_bits(0x3cb1_a626_3314_5c07)];
/// `ln 2` without its lowest 21 bits, so that products with a few thousands are exact, and the double next to the rest.
const LN_2: [f64; 2] = [f64::from_bits(0x3fe6_2e42_fee0_0000), f64::from_bits(0x3dea_39ef_3579_3c76)];
/// The double next to `1/ln 2`.
const LOG2_E: f64 = f64::from_bits(0x3ff7_1547_652b_82fe);
/// The double next to `√2`.
const ROOT_2: f64 = f64::from_bits(0x3ff6_a09e_667f_3bcd);

/// The larger of two numbers, none of them NaN.
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The smaller of two numbers, none of them NaN.
pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// `a + b` exactly: the rounded sum and the error of the rounding (Knuth).
///
/// ```
/// assert_eq!(schemas::functions::two_sum(1.0, 1e-30), (1.0, 1e-30));
/// ```
#[inline(always)]
pub fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// [`two_sum`] where `|a| ≥ |b|` or `a` is 0 (Dekker).
#[inline(always)]
pub fn fast_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

/// `a·b` exactly: the rounded product and the error of the rounding (Dekker, with Veltkamp's halves). Factors are below 2^990 and the
/// product is 0 or from 2^−900 on.
///
/// # Source
/// T. J. Dekker, Numer. Math. 18 (1971) 224, doi:10.1007/BF01397083
///
/// ```
/// let x = 1.0 + f64::EPSILON;
/// assert_eq!(schemas::functions::two_product(x, x), (1.0 + 2.0 * f64::EPSILON, f64::EPSILON * f64::EPSILON));
/// ```
#[inline(always)]
pub fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let ([a1, a2], [b1, b2]) = (halves(a), halves(b));
    (product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2)
}

/// Two numbers of at most 26 digits with the sum `a`.
#[inline(always)]
fn halves(a: f64) -> [f64; 2] {
    const SPLITTER: f64 = 134_217_729.0; // 2^27 + 1
    let c = SPLITTER * a;
    let high = c - (c - a);
    [high, a - high]
}

/// Sine and cosine of `2π·(x + y)` for `|x| ≤ 1` and a `y` that is small beside 1; at most 0.85 ulp from the exact ones.
///
/// ```
/// let (sine, cosine) = schemas::functions::sine_cosine((0.25, 0.0));
/// assert_eq!((sine, cosine), (1.0, 0.0));
/// let (sine, cosine) = schemas::functions::sine_cosine((1.0 / 12.0, 0.0)); // 30°, its double is 2^−58 turns off
/// assert!((sine - 0.5).abs() < 1e-16 && (cosine - 0.75_f64.sqrt()).abs() < 2e-16);
/// ```
#[inline(always)]
pub fn sine_cosine((x, y): (f64, f64)) -> (f64, f64) {
    let quarters = (4.0 * x + 0.5).floor();
    let (a, b) = two_sum(x - 0.25 * quarters, y);
    // the angle p + l, |p| ≤ π/4 and a little
    let (p, rest) = two_product(a, TURN[0]);
    let l = rest + (a * TURN[1] + b * TURN[0]);
    let (z, z_rest) = two_product(p, p);
    let half = 0.5 * z;
    let sine = p + ((p * z) * series(&SINE, z) + (l - l * half));
    let whole = 1.0 - half;
    let lost = (1.0 - whole) - half;
    let cosine = whole + (lost + ((z * z) * series(&COSINE, z) - (0.5 * z_rest + p * l)));
    let quadrant = quarters - 4.0 * (0.25 * quarters).floor();
    if quadrant == 0.0 {
        (sine, cosine)
    } else if quadrant == 1.0 {
        (cosine, -sine)
    } else if quadrant == 2.0 {
        (-sine, -cosine)
    } else {
        (-cosine, sine)
    }
}

/// The polynomial with these coefficients, that of `x^0` first.
#[inline(always)]
fn series<const TERMS: usize>(coefficients: &[f64; TERMS], x: f64) -> f64 {
    let mut sum = coefficients[TERMS - 1];
    let mut n = TERMS - 1;
    while n > 0 {
        n -= 1;
        sum = sum * x + coefficients[n];
    }
    sum
}

/// `((e^x − 1)/x − 1)/x`, for `|x| ≤ 0.35`: ½ + x/6 + …
#[inline(always)]
pub fn q2(x: f64) -> f64 {
    series(&EXPONENTIAL, x)
}

/// `2^n` and `m` with `e^x = 2^n·(1 + m)`, for `|x| ≤ 700`.
#[inline(always)]
fn scale_and_rest(x: f64) -> (f64, f64) {
    /// A double plus this is whole; next to it doubles are 1 apart.
    const WHOLE: f64 = 6_755_399_441_055_744.0; // 1.5·2^52
    /// The lowest bits of `n` plus this are those of 1023 + n.
    const EXPONENT: f64 = 4_503_599_627_371_519.0; // 2^52 + 1023
    let y = x * LOG2_E + 0.5;
    let nearest = (y + WHOLE) - WHOLE;
    // ⌊y⌋, without a call on machines that have no instruction for it, and a conversion that some have for single numbers only
    let n = if nearest > y { nearest - 1.0 } else { nearest };
    let r = (x - n * LN_2[0]) - n * LN_2[1];
    let scale = f64::from_bits((n + EXPONENT).to_bits() << 52);
    (scale, r + (r * r) * q2(r))
}

/// `e^x − 1`, +∞ above 700 and −1 below −700; at most 2.5 ulp from the exact one.
///
/// ```
/// assert_eq!(schemas::functions::exp_m1(1e-20), 1e-20);
/// ```
#[inline(always)]
pub fn exp_m1(x: f64) -> f64 {
    let within = x.abs() <= 700.0;
    let (scale, m) = scale_and_rest(if within { x } else { 0.0 });
    let inside = scale * m + (scale - 1.0);
    if within { inside } else { beyond(x, -1.0) }
}

/// `e^x`, +∞ above 700 and 0 below −700; at most 1 ulp from the exact one.
///
/// ```
/// assert_eq!(schemas::functions::exp(0.0), 1.0);
/// ```
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    let within = x.abs() <= 700.0;
    let (scale, m) = scale_and_rest(if within { x } else { 0.0 });
    let inside = scale * m + scale;
    if within { inside } else { beyond(x, 0.0) }
}

#[inline(always)]
fn beyond(x: f64, below: f64) -> f64 {
    if x > 0.0 {
        f64::INFINITY
    } else if x < 0.0 {
        below
    } else {
        x // NaN
    }
}

/// The natural logarithm of a positive normal `x`; at most 1 ulp from the exact one.
///
/// ```
/// assert_eq!(schemas::functions::ln(1.0), 0.0);
/// assert_eq!(schemas::functions::ln(2.0), std::f64::consts::LN_2);
/// ```
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    const MANTISSA: u64 = (1 << 52) - 1;
    const ONE: u64 = 1023 << 52;
    let (mut m, mut n) =
        (f64::from_bits(x.to_bits() & MANTISSA | ONE), (x.to_bits() >> 52).cast_signed() - 1023);
    if m > ROOT_2 {
        (m, n) = (0.5 * m, n + 1);
    }
    let n = n as f64;
    // ln (1 + f) = f − f²/2 + s·(f²/2 + 2·s²/3 + 2·s⁴/5 + …) with s = f/(2 + f)
    let f = m - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let half = (0.5 * f) * f;
    let rest = s * (half + z * series(&LOGARITHM, z)) + n * LN_2[1];
    n * LN_2[0] - ((half - rest) - f)
}

#[cfg(test)]
mod tests;
