//! Numbers as a person reads them: counts, sizes, times, quantities with their units.

use std::fmt::Display;
use std::time::Duration;

/// `1,234,567`
pub fn count(value: u64) -> impl Display {
    let digits = value.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// `1 frame`, `1,234 frames`
pub fn counted(value: u64, one: &str) -> String {
    let ending = if value == 1 { "" } else { "s" };
    format!("{} {one}{ending}", count(value))
}

/// `139.20 MB`
pub fn bytes(value: u64) -> impl Display {
    let mut scaled = value as f64;
    if scaled < 1e3 {
        return format!("{value} B");
    }
    let mut prefixes = "kMGTPE".chars();
    let mut prefix = ' ';
    while scaled >= 1e3 {
        scaled /= 1e3;
        prefix = prefixes.next().unwrap_or(prefix);
    }
    format!("{scaled:.2} {prefix}B")
}

/// Seconds with three digits and a fitting unit.
pub fn seconds(value: f64) -> String {
    let (scaled, unit) = match value.abs() {
        0.0 => return "0 s".to_owned(),
        v if v >= 1.0 => (value, "s"),
        v if v >= 1e-3 => (value * 1e3, "ms"),
        v if v >= 1e-6 => (value * 1e6, "µs"),
        v if v >= 1e-9 => (value * 1e9, "ns"),
        _ => return format!("{value:.2e} s"),
    };
    let decimals = decimals_of_three_digits(scaled);
    format!("{scaled:.decimals$} {unit}")
}

/// A result in six significant digits, `0.0104820` or `3.96405e-7`; zero has no sign.
pub fn number(value: f64) -> String {
    const DIGITS: i32 = 6;
    // of the rounded number: 9.9999996 has two digits before the point
    let scientific = format!("{value:.5e}");
    let Some((mantissa, power)) = scientific.split_once('e') else { return scientific };
    let power = power.parse().unwrap_or(0);
    match power {
        _ if value == 0.0 => "0".to_owned(),
        -4..DIGITS => fixed(value, usize::try_from(DIGITS - 1 - power).unwrap_or(0)),
        _ => format!("{mantissa}e{power}"),
    }
}

/// The same as one would type it: no zeros at its end.
pub fn typed(value: f64) -> String {
    let number = number(value);
    if number.contains('e') || !number.contains('.') {
        return number;
    }
    number.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A result in six significant digits, with a prefix of the unit that makes it 1 to 1000: `-396.405 mm/s`.
pub fn quantity(value: f64, unit: &str) -> String {
    let (prefix, one) = prefix(value);
    format!("{} {prefix}{unit}", number(value / one))
}

/// The same as one would type it: `0.3 µm`.
pub fn typed_quantity(value: f64, unit: &str) -> String {
    let (prefix, one) = prefix(value);
    format!("{} {prefix}{unit}", typed(value / one))
}

/// Two results with the prefix of the larger one: `-0.396405 to 3.23870 m/s`.
pub fn range([from, to]: [f64; 2], unit: &str) -> String {
    let (prefix, one) = prefix(if to.abs() > from.abs() { to } else { from });
    format!("{} to {} {prefix}{unit}", number(from / one), number(to / one))
}

/// The unit with the prefix that makes `value` 1 to 1000, and the size of that unit.
pub fn unit(value: f64, unit: &str) -> (String, f64) {
    let (prefix, one) = prefix(value);
    (format!("{prefix}{unit}"), one)
}

/// The prefix that makes a number 1 to 1000, and its factor; no prefix and 1 where there is none.
fn prefix(value: f64) -> (&'static str, f64) {
    const PREFIXES: [(i32, &str, f64); 5] =
        [(-15, "f", 1e-15), (-12, "p", 1e-12), (-9, "n", 1e-9), (-6, "µ", 1e-6), (-3, "m", 1e-3)];
    let scientific = format!("{value:.5e}");
    let power: i32 = scientific.split_once('e').and_then(|(_, power)| power.parse().ok()).unwrap_or(0);
    let found = PREFIXES.iter().find(|(prefix, _, _)| value != 0.0 && *prefix == 3 * power.div_euclid(3));
    found.map_or(("", 1.0), |(_, name, one)| (*name, *one))
}

/// A number with `decimals` decimals; zero has no sign.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|digit| matches!(digit, '0' | '.')) => digits.to_owned(),
        _ => text,
    }
}

/// `123 steps/s`, `1.23 k steps/s`, `12.3 M steps/s`
pub fn per_second(rate: f64, what: &str) -> String {
    let (scaled, prefix) = match rate {
        rate if rate >= 1e6 => (rate / 1e6, "M "),
        rate if rate >= 1e3 => (rate / 1e3, "k "),
        rate => (rate, ""),
    };
    let decimals = if prefix.is_empty() { 0 } else { decimals_of_three_digits(scaled) };
    format!("{scaled:.decimals$} {prefix}{what}/s")
}

/// The decimals of a number from 1 to 1000 that is shown with three digits.
fn decimals_of_three_digits(value: f64) -> usize {
    match value.abs() {
        100.0.. => 0,
        10.0.. => 1,
        _ => 2,
    }
}

/// A duration like [`seconds`].
pub fn duration(value: Duration) -> String {
    seconds(value.as_secs_f64())
}

/// A rough time: `40 s`, `3 min 20 s`, `2 h 5 min`.
pub fn left(seconds: f64) -> String {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let seconds = seconds.ceil() as u64;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_commas_and_sizes_a_prefix() {
        let counts =
            [0, 999, 1000, 12_345, 123_456, 1_234_567_890, u64::MAX].map(|value| count(value).to_string());
        let expected =
            ["0", "999", "1,000", "12,345", "123,456", "1,234,567,890", "18,446,744,073,709,551,615"];
        assert_eq!(counts, expected);
        let sizes = [0, 999, 1000, 139_204_000, 999_999, 1_500_000_000_000, u64::MAX];
        let expected = ["0 B", "999 B", "1.00 kB", "139.20 MB", "1000.00 kB", "1.50 TB", "18.45 EB"];
        assert_eq!(sizes.map(|value| bytes(value).to_string()), expected);
    }

    #[test]
    fn numbers_have_six_digits_and_zero_has_no_sign() {
        let cases = [
            (20.001_019_598_849_677, "20.0010"),
            (0.010_482, "0.0104820"),
            (-0.396_405, "-0.396405"),
            (9.999_999_6, "10.0000"),
            (123_456.7, "123457"),
            (1e6, "1.00000e6"),
            (-3.964_05e-7, "-3.96405e-7"),
            (-0.0, "0"),
            (f64::NAN, "NaN"),
        ];
        for (value, expected) in cases {
            assert_eq!(number(value), expected);
        }
        assert_eq!((fixed(-1e-9, 6), fixed(-0.5, 1)), ("0.000000".to_owned(), "-0.5".to_owned()));
    }

    #[test]
    fn units_have_the_prefix_that_fits() {
        let cases = [
            (0.0125, "12.5000 mJ"),
            (-3.964_05e-7, "-396.405 nJ"),
            (0.999_999_9, "1.00000 J"),
            (0.0, "0 J"),
            (1500.0, "1500.00 J"),
            (2e-20, "2.00000e-20 J"),
        ];
        for (value, expected) in cases {
            assert_eq!(quantity(value, "J"), expected);
        }
        assert_eq!([3e-7, 0.0, -2.5].map(|m| typed_quantity(m, "m")), ["300 nm", "0 m", "-2.5 m"]);
        assert_eq!(range([-0.396_405, 3.2387], "m/s"), "-0.396405 to 3.23870 m/s");
        assert_eq!(range([-0.010_166_1, 0.000_641_949], "m"), "-10.1661 to 0.641949 mm");
    }
}
