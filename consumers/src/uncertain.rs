//! Numbers with their uncertainty, and no digit beyond it.

use std::fmt;
use std::ops::Div;

/// A value, and half the width of the interval that it stands for.
///
/// ```
/// use consumers::uncertain::Uncertain;
/// let ratio = Uncertain { value: 0.024_030_219_669, plus_minus: 2.37e-10 };
/// assert_eq!(ratio.to_string(), "0.02403021967 ± 2.4e-10");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertain {
    /// The value.
    pub value: f64,
    /// Uncertainty in the same unit: 0 if the value is exact, NaN or infinite if nobody knows.
    pub plus_minus: f64,
}

/// Digits of what a number may be off by.
const DIGITS: i32 = 2;

/// Digits of a number of unknown uncertainty.
const DIGITS_UNKNOWN: i32 = 3;

/// Digits of a double that mean something.
const DIGITS_OF_A_DOUBLE: i32 = 17;

impl Uncertain {
    /// A value that may be off by `plus_minus`.
    pub fn new(value: f64, plus_minus: f64) -> Self {
        Self { value, plus_minus: plus_minus.abs() }
    }

    /// A value of unknown uncertainty.
    pub fn unknown(value: f64) -> Self {
        Self { value, plus_minus: f64::NAN }
    }

    /// Uncertainty as a part of the value.
    pub fn relative(self) -> f64 {
        self.plus_minus / self.value
    }

    /// The value, down to the second digit of its uncertainty; three digits if that is unknown, and all of
    /// them if it is exact.
    pub fn value_text(self) -> String {
        if !self.value.is_finite() {
            return "–".to_owned();
        }
        if self.plus_minus == 0.0 {
            return if self.value == 0.0 { "0".to_owned() } else { self.value.to_string() };
        }
        let last = if self.plus_minus.is_finite() {
            last_place(self.plus_minus, DIGITS)
        } else {
            last_place(self.value, DIGITS_UNKNOWN)
        };
        write_to(self.value, last)
    }

    /// The uncertainty, with two digits; empty if it is not known.
    pub fn plus_minus_text(self) -> String {
        match self.plus_minus {
            0.0 => "0".to_owned(),
            known if known.is_finite() => write_to(known, last_place(known, DIGITS)),
            _ => String::new(),
        }
    }
}

/// In another unit.
impl Div<f64> for Uncertain {
    type Output = Self;

    fn div(self, unit: f64) -> Self {
        Self::new(self.value / unit, self.plus_minus / unit)
    }
}

impl fmt::Display for Uncertain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.value_text())?;
        match self.plus_minus_text().as_str() {
            "" | "0" => Ok(()),
            known => write!(f, " ± {known}"),
        }
    }
}

/// The power of ten of the first digit.
fn exponent(value: f64) -> i32 {
    let text = format!("{value:e}");
    text.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0)
}

/// `value` rounded to `digits` digits.
fn rounded(value: f64, digits: i32) -> f64 {
    let decimals = usize::try_from(digits - 1).unwrap_or(0);
    format!("{value:.decimals$e}").parse().unwrap_or(value)
}

/// The place, as a power of ten, of the last of so many digits.
fn last_place(value: f64, digits: i32) -> i32 {
    exponent(rounded(value, digits)) - (digits - 1)
}

/// `value` down to the place `last`, a power of ten. A zero has neither sign nor places.
fn write_to(value: f64, last: i32) -> String {
    let last = last.max(exponent(value) - (DIGITS_OF_A_DOUBLE - 1));
    let digits = exponent(value) - last + 1;
    let value = match digits {
        1.. => rounded(value, digits),
        // a digit below the last place: rounded up or down
        0 if value.abs() >= 5.0 * 10_f64.powi(last - 1) => 10_f64.powi(last).copysign(value),
        _ => return "0".to_owned(),
    };
    if value == 0.0 {
        return "0".to_owned();
    }
    let first = exponent(value);
    let is_plain = (-4..7).contains(&first);
    let decimals = usize::try_from(if is_plain { -last } else { first - last }).unwrap_or(0);
    if is_plain { format!("{value:.decimals$}") } else { format!("{value:.decimals$e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(value: f64, plus_minus: f64) -> String {
        Uncertain::new(value, plus_minus).to_string()
    }

    #[test]
    fn no_digit_stands_beyond_what_is_known() {
        assert_eq!(shown(0.024_030_219_669_019_0, 2.4e-10), "0.02403021967 ± 2.4e-10");
        assert_eq!(shown(3.334_107_2, 2.04e-5), "3.334107 ± 2.0e-5");
        assert_eq!(shown(-11_545.912, 0.31), "-11545.91 ± 0.31");
        assert_eq!(shown(0.996_04, 0.000_29), "0.99604 ± 0.00029");
        assert_eq!(shown(5.910_973_935e-7, 1.3e-12), "5.910974e-7 ± 1.3e-12");
        assert_eq!(shown(12_345.6, 340.0), "12350 ± 340");
        assert_eq!(shown(2.5e12, 3.1e9), "2.5000e12 ± 3.1e9");
    }

    #[test]
    fn what_rounds_to_nothing_is_a_zero_without_sign_or_places() {
        assert_eq!(shown(-1e-16, 4.2e-9), "0 ± 4.2e-9");
        assert_eq!(shown(-3.2e-16, 4.4e-16), "-3.2e-16 ± 4.4e-16");
        assert_eq!(shown(-0.0, 0.1), "0 ± 0.10");
        assert_eq!(shown(4e-11, 4.2e-9), "0 ± 4.2e-9");
        assert_eq!(shown(-6e-11, 4.2e-9), "-1e-10 ± 4.2e-9");
    }

    #[test]
    fn rounding_up_makes_no_third_digit() {
        assert_eq!(shown(3.0, 0.099_6), "3.00 ± 0.10");
        assert_eq!(shown(0.999_96, 0.001), "1.0000 ± 0.0010");
        assert_eq!(shown(9.999_999_7e-8, 1e-13), "1.0000000e-7 ± 1.0e-13");
    }

    #[test]
    fn exact_and_unknown_are_told_apart() {
        assert_eq!(shown(21.0, 0.0), "21");
        assert_eq!(Uncertain::unknown(0.123_456).to_string(), "0.123");
        assert_eq!(Uncertain::unknown(1.278_67e-7).to_string(), "1.28e-7");
        assert_eq!(Uncertain::unknown(48_215.0).to_string(), "48200");
        assert_eq!(Uncertain::new(1.5, f64::INFINITY).to_string(), "1.50");
        assert_eq!(
            (Uncertain::unknown(0.0).to_string(), shown(f64::NAN, 1.0)),
            ("0".into(), "– ± 1.0".into())
        );
    }

    /// Whatever the size: the last digit of the value is the second of the uncertainty, and the value shown is the
    /// nearest one.
    #[test]
    fn values_of_every_size_are_rounded_to_the_nearest() {
        for power in -30..=15 {
            for digits in 1..=14 {
                for lead in
                    [1.0, 1.234_567_890_123_4, 5.555_555_555_555_5, 9.995_555_555_5, 9.999_999_999_999_9]
                {
                    let value = lead * 10_f64.powi(power);
                    let plus_minus = 3.7 * 10_f64.powi(power - digits);
                    let shown: f64 = Uncertain::new(value, plus_minus).value_text().parse().unwrap();
                    let unit = 10_f64.powi(power - digits - 1);
                    assert!(
                        (shown - value).abs() <= 0.5001 * unit + 2e-16 * value,
                        "{value:e} ± {plus_minus:e}: {shown:e}"
                    );
                }
            }
        }
    }
}
