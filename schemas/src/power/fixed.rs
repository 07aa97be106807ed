//! Powers to more than 160 binary digits, by integers, for tables and configurations.

/// A number from 0 to below 2^64, in units of 2^−192; the least significant digits come first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Fixed([u64; LIMBS]);

const LIMBS: usize = 4;
const ZERO: Fixed = Fixed([0; LIMBS]);
const ONE: Fixed = Fixed([0, 0, 0, 1]);
/// `ln 2`
const LN_2: Fixed = Fixed([0x40f3_4326_7298_b62d, 0xc9e3_b398_03f2_f6af, 0xb172_17f7_d1cf_79ab, 0]);
/// `1/ln 2`
const LOG2_E: Fixed = Fixed([0xd6ae_f551_bad2_b4b1, 0x7d0f_fda0_d23a_7d11, 0x7154_7652_b82f_e177, 1]);

impl Fixed {
    /// The sum; digits beyond 2^64 are lost, as in the other operations.
    fn plus(self, other: Self) -> Self {
        let (mut sum, mut carry) = (ZERO, 0);
        for i in 0..LIMBS {
            let wide = u128::from(self.0[i]) + u128::from(other.0[i]) + carry;
            (sum.0[i], carry) = (low(wide), wide >> 64);
        }
        sum
    }

    /// `2^64 − self`, and 0 of 0.
    fn negated(self) -> Self {
        let [a, b, c, d] = self.0;
        Self([!a, !b, !c, !d]).plus(Self([1, 0, 0, 0]))
    }

    fn times(self, other: Self) -> Self {
        let mut product = [0_u64; 2 * LIMBS];
        for i in 0..LIMBS {
            let mut carry = 0;
            for j in 0..LIMBS {
                let wide =
                    u128::from(self.0[i]) * u128::from(other.0[j]) + u128::from(product[i + j]) + carry;
                (product[i + j], carry) = (low(wide), wide >> 64);
            }
            product[i + LIMBS] = low(carry);
        }
        Self([product[3], product[4], product[5], product[6]])
    }

    fn times_integer(self, factor: u64) -> Self {
        let (mut product, mut carry) = (ZERO, 0);
        for i in 0..LIMBS {
            let wide = u128::from(self.0[i]) * u128::from(factor) + carry;
            (product.0[i], carry) = (low(wide), wide >> 64);
        }
        product
    }

    fn over(self, divisor: u64) -> Self {
        let (mut quotient, mut remainder) = (ZERO, 0);
        for i in (0..LIMBS).rev() {
            let wide = remainder << 64 | u128::from(self.0[i]);
            quotient.0[i] = low(wide / u128::from(divisor));
            remainder = wide % u128::from(divisor);
        }
        quotient
    }

    /// `self·2^−digits`.
    fn shifted_down(self, digits: u32) -> Self {
        let (limbs, digits) = ((digits / 64) as usize, digits % 64);
        let mut shifted = ZERO;
        for i in limbs..LIMBS {
            let above = if i + 1 < LIMBS { self.0[i + 1] } else { 0 };
            shifted.0[i - limbs] = low((u128::from(above) << 64 | u128::from(self.0[i])) >> digits);
        }
        shifted
    }

    fn fraction(self) -> Self {
        Self([self.0[0], self.0[1], self.0[2], 0])
    }
}

/// The lower half of a product.
#[expect(clippy::cast_possible_truncation, reason = "the upper half is the carry")]
fn low(wide: u128) -> u64 {
    wide as u64
}

/// `mantissa·2^exponent` with a mantissa from 1 to below 2.
#[derive(Debug, Clone, Copy)]
pub(super) struct Power {
    mantissa: Fixed,
    exponent: i64,
}

impl Power {
    /// `x^y`; nothing where that is far beyond a double. `x` is positive and finite, `y` finite.
    pub(super) fn of(x: f64, y: f64) -> Option<Self> {
        let ((x_digits, x_exponent), (y_digits, y_exponent)) = (decompose(x), decompose(y));
        // |log2 x| and its sign: x = m·2^e with 1 ≤ m < 2
        let (fraction, e) = (log2(x_digits), x_exponent + 52);
        let (log, is_below_one) = if e < 0 {
            (Fixed([0, 0, 0, e.unsigned_abs()]).plus(fraction.negated()), true)
        } else {
            (Fixed([0, 0, 0, e.unsigned_abs()]).plus(fraction), false)
        };
        if log == ZERO || y_digits == 0 {
            return Some(Self { mantissa: ONE, exponent: 0 });
        }
        // |log2 x| < 2^11 and 53 digits of y fill the 64 digits before the point
        let magnitude = log.times_integer(y_digits).shifted_down(u32::try_from(-y_exponent).ok()?);
        let whole = i64::from(u32::try_from(magnitude.0[3]).ok()?);
        let fraction = magnitude.fraction();
        let (exponent, fraction) = if is_below_one == (y < 0.0) {
            (whole, fraction)
        } else if fraction == ZERO {
            (-whole, ZERO)
        } else {
            (-whole - 1, fraction.negated().fraction())
        };
        Some(Self { mantissa: exp2(fraction), exponent }.normalized())
    }

    /// True if the power is between 2^−1021 and 2^1023.
    pub(super) fn is_normal(&self) -> bool {
        (-1021..1023).contains(&self.exponent)
    }

    /// The product.
    pub(super) fn times(self, other: Self) -> Self {
        let exponent = self.exponent + other.exponent;
        Self { mantissa: self.mantissa.times(other.mantissa), exponent }.normalized()
    }

    fn normalized(self) -> Self {
        if self.mantissa.0[3] < 2 {
            return self;
        }
        Self { mantissa: self.mantissa.shifted_down(1), exponent: self.exponent + 1 }
    }

    /// The power, which [is normal](Power::is_normal), rounded to 90 binary digits: the double next to that, and the rest.
    pub(super) fn in_two_doubles(self) -> [f64; 2] {
        const UNIT: u32 = 37;
        const DOUBLE: u32 = 74;
        let [_, middle, high, _] = self.mantissa.0;
        // from 2^126 to below 2^127, the digits beyond are no more than an error
        let digits = 1 << 126 | (u128::from(high) << 64 | u128::from(middle)) >> 2;
        let rounded = (digits + (1 << (UNIT - 1))) >> UNIT << UNIT;
        let (nearest, beyond) = (rounded >> DOUBLE, rounded & ((1 << DOUBLE) - 1));
        let half = 1 << (DOUBLE - 1);
        let is_up = beyond > half || beyond == half && nearest & 1 == 1;
        let nearest = nearest + u128::from(is_up);
        let rest = rounded.wrapping_sub(nearest << DOUBLE).cast_signed();
        // 53 and 37 digits
        let exponent = self.exponent - 126;
        [
            scaled(nearest as f64, exponent + i64::from(DOUBLE)),
            scaled((rest >> UNIT) as f64, exponent + i64::from(UNIT)),
        ]
    }
}

/// `digits·2^exponent`, a normal double or 0.
fn scaled(digits: f64, exponent: i64) -> f64 {
    // in two steps: the scale itself may be below the smallest normal double
    let scale = |exponent: i64| f64::from_bits(((1023 + exponent) << 52).cast_unsigned());
    let half = exponent / 2;
    digits * scale(half) * scale(exponent - half)
}

/// `|x| = digits·2^exponent` with 53 digits, or 0.
fn decompose(x: f64) -> (u64, i64) {
    let (bits, exponent) = (x.to_bits() & (u64::MAX >> 12), (x.to_bits() >> 52 & 0x7ff).cast_signed());
    if exponent > 0 {
        return (bits | 1 << 52, exponent - 1075);
    }
    // subnormal
    let missing = bits.leading_zeros() - 11;
    if bits == 0 { (0, 0) } else { (bits << missing, -1074 - i64::from(missing)) }
}

/// `log2 (digits/2^52)` of 53 digits: `2·atanh s/ln 2` with `s = (m − 1)/(m + 1)`.
fn log2(digits: u64) -> Fixed {
    let (numerator, denominator) = (digits - (1 << 52), digits + (1 << 52));
    let s = Fixed([0, 0, 0, numerator]).over(denominator);
    let square = s.times(s);
    let (mut sum, mut power, mut n) = (ZERO, s, 1);
    while power != ZERO {
        sum = sum.plus(power.over(n));
        (power, n) = (power.times(square), n + 2);
    }
    sum.plus(sum).times(LOG2_E)
}

/// `2^x` for `x` below 1: the exponential series of a 256th, squared eight times.
fn exp2(x: Fixed) -> Fixed {
    let part = x.times(LN_2).shifted_down(8);
    let mut less_one = ZERO;
    for n in (1..19).rev() {
        less_one = less_one.plus(ONE).times(part).over(n);
    }
    for _ in 0..8 {
        less_one = less_one.plus(less_one).plus(less_one.times(less_one));
    }
    less_one.plus(ONE)
}
