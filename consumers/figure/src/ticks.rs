//! The round numbers that are written along an axis.

use super::prefixes::with_prefix;
use super::scale::{RoundStep, Scale, power_of_ten};

/// Ticks and numbers along an axis; places are fractions of its length, from the left or the bottom.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ticks {
    pub(super) major: Vec<(f64, String)>,
    pub(super) minor: Vec<f64>,
    /// The numbers are to be multiplied by 10 to this power.
    pub(super) exponent: i32,
}

impl Scale {
    /// About `count` round numbers; their common factor does not depend on `count`.
    pub(super) fn ticks(&self, count: usize) -> Ticks {
        if self.log { self.log_ticks(count) } else { self.linear_ticks(count) }
    }

    fn linear_ticks(&self, count: usize) -> Ticks {
        let step = RoundStep::near(((self.to - self.from) / count.max(1) as f64).max(self.least_step));
        let small_step = step.size() / step.minor_count();
        let exponent = self.exponent();
        let decimals = step.decimals(exponent);
        let write = |value: f64| signed(value / power_of_ten(exponent), decimals);
        Ticks {
            major: self
                .multiples(step.size())
                .filter_map(|value| Some((self.place(value)?.clamp(0.0, 1.0), write(value))))
                .collect(),
            minor: self
                .multiples(if small_step < self.least_step { step.size() } else { small_step })
                .filter_map(|value| Some(self.place(value)?.clamp(0.0, 1.0)))
                .collect(),
            exponent,
        }
    }

    /// The power of ten, a multiple of three, by which numbers on a linear axis become short.
    fn exponent(&self) -> i32 {
        let largest = self.from.abs().max(self.to.abs());
        let usual_step = RoundStep::near((self.to - self.from) / 4.0);
        let most = if self.takes_prefix { 2e4 } else { 1e5 };
        if largest < most && usual_step.decimals(0) <= 2 {
            return 0;
        }
        // At most ±290.
        #[allow(clippy::cast_possible_truncation)]
        let thousands = (largest.log10() / 3.0 + 1e-9).floor() as i32;
        3 * thousands
    }

    /// Multiples of `step` in the range, at most 1000.
    fn multiples(&self, step: f64) -> impl Iterator<Item = f64> + use<> {
        // An end that differs from a multiple by less than can be seen counts as one.
        const UNSEEN: f64 = 1.2e-3;
        let unseen = UNSEEN * (self.to - self.from) / step;
        let first = (self.from / step - unseen).ceil();
        let last = (self.to / step + unseen).floor();
        let multiples = (0..1000_u16).map(move |index| first + f64::from(index));
        multiples.take_while(move |multiple| *multiple <= last).map(move |multiple| multiple * step)
    }

    fn log_ticks(&self, count: usize) -> Ticks {
        // At most ±308.
        #[allow(clippy::cast_possible_truncation)]
        let (first, last) =
            ((self.from.log10() - 1e-9).ceil() as i32, (self.to.log10() + 1e-9).floor() as i32);
        let decades = usize::try_from(last - first + 1).unwrap_or(0);
        if decades < 2 {
            return self.ticks_within_a_decade(first - 1, last, count);
        }
        if decades == 2 && is_plain(first - 1) && is_plain(last) {
            let ticks = self.ticks_within_a_decade(first - 1, last, count);
            if ticks.major.len() <= count {
                return ticks;
            }
        }
        let stride = decades.div_ceil(count.max(2));
        Ticks {
            major: (first..=last)
                .step_by(stride)
                .filter_map(|power| Some((self.place(power_of_ten(power))?, power_label(false, power))))
                .collect(),
            minor: if stride == 1 {
                self.mantissas(first - 1, last, &[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
                    .filter_map(|value| self.place(value))
                    .collect()
            } else {
                (first..=last).filter_map(|power| self.place(power_of_ten(power))).collect()
            },
            exponent: 0,
        }
    }

    /// Ticks where powers of ten are too sparse: 1, 2, 5 of each decade, or the round numbers of a linear axis.
    fn ticks_within_a_decade(&self, first: i32, last: i32, count: usize) -> Ticks {
        let chosen: Vec<f64> = self.mantissas(first, last, &[1.0, 2.0, 5.0]).collect();
        if chosen.len() < 3 {
            let mut ticks = self.linear_ticks(count);
            ticks.minor.clear();
            return ticks;
        }
        let exponent = if is_plain(first) && is_plain(last) { 0 } else { last };
        let label = |value: f64| {
            let scaled = value / power_of_ten(exponent);
            // Digits down to the value's own first one; at most a few by the choice of exponent.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let decimals = (-(scaled * 1.0001).log10().floor()).max(0.0) as usize;
            signed(scaled, decimals)
        };
        Ticks {
            major: chosen.iter().filter_map(|value| Some((self.place(*value)?, label(*value)))).collect(),
            minor: self
                .mantissas(first, last, &[3.0, 4.0, 6.0, 7.0, 8.0, 9.0])
                .filter_map(|value| self.place(value))
                .collect(),
            exponent,
        }
    }

    /// These multiples of the powers of ten, as far as they are in the range.
    fn mantissas<'a>(
        &self,
        first: i32,
        last: i32,
        mantissas: &'a [f64],
    ) -> impl Iterator<Item = f64> + use<'a> {
        let (from, to) = (self.from * (1.0 - 1e-9), self.to * (1.0 + 1e-9));
        (first..=last)
            .flat_map(move |power| mantissas.iter().map(move |m| m * power_of_ten(power)))
            .filter(move |value| (from..=to).contains(value))
    }
}

/// True if a power of ten is written out where few are needed.
pub(super) fn is_plain(power: i32) -> bool {
    (-3..5).contains(&power)
}

/// A number with a true minus sign.
pub(super) fn signed(value: f64, decimals: usize) -> String {
    let digits = format!("{:.decimals$}", value.abs());
    let is_zero = digits.chars().all(|digit| matches!(digit, '0' | '.'));
    if value < 0.0 && !is_zero { format!("−{digits}") } else { digits }
}

/// A power of ten of either sign.
pub(super) fn power_label(negative: bool, power: i32) -> String {
    format!("{}10{}", if negative { "−" } else { "" }, raised(power))
}

/// An integer in superscript.
fn raised(number: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raise = |character: char| character.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    number.to_string().chars().map(raise).collect()
}

/// An axis label whose unit carries the factor of the numbers, as a prefix where there is one: `v (m/s)` becomes
/// `v (mm/s)`, `strain (%)` becomes `strain (10⁻³ %)`.
pub(super) fn label_with_factor(label: &str, exponent: i32) -> String {
    if exponent == 0 {
        return label.to_owned();
    }
    let prefixed = label.strip_suffix(')').and_then(|label| label.rsplit_once('('));
    if let Some((name, unit)) = prefixed.and_then(|(name, unit)| Some((name, with_prefix(unit, exponent)?))) {
        return format!("{name}({unit})");
    }
    let factor = format!("10{}", raised(exponent));
    match label.rfind('(') {
        Some(open) if label.ends_with(')') => {
            let (name, unit) = label.split_at(open + 1);
            format!("{name}{factor}\u{a0}{unit}")
        }
        _ if label.is_empty() => format!("× {factor}"),
        _ => format!("{label} ({factor})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Axis;
    use crate::scale::Margin;

    fn labels(axis: &Axis, count: usize) -> Vec<String> {
        let ticks = Scale::new(axis, std::iter::empty(), Margin::Nothing).ticks(count);
        ticks.major.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn linear_ticks_are_round_and_at_their_places() {
        let axis = Axis::new("x").limits(-0.13, 0.31);
        assert_eq!(labels(&axis, 5), ["−0.1", "0.0", "0.1", "0.2", "0.3"]);
        let scale = Scale::new(&Axis::new("x").limits(0.0, 1000.0), std::iter::empty(), Margin::Nothing);
        let ticks = scale.ticks(5);
        assert_eq!(ticks.major[1], (0.2, "200".to_owned()));
        assert_eq!(ticks.major.last().map(|tick| tick.0), Some(1.0));
    }

    #[test]
    fn an_end_that_is_nearly_round_has_its_number() {
        let axis = Axis::new("x").limits(-0.5, 999.5);
        assert_eq!(labels(&axis, 2), ["0", "500", "1000"]);
        assert_eq!(labels(&Axis::new("x").limits(0.0, 994.0), 2), ["0", "500"]);
    }

    #[test]
    fn nothing_is_between_two_beads() {
        let axis = |label| Axis::new(label).limits(4.5, 6.5);
        assert_eq!(labels(&axis("bead"), 5), ["5", "6"]);
        assert_eq!(labels(&axis("x"), 5), ["4.5", "5.0", "5.5", "6.0", "6.5"]);
        let ticks = Scale::new(&axis("contact"), std::iter::empty(), Margin::Nothing).ticks(5);
        assert_eq!(ticks.minor, [0.25, 0.75]);
    }

    #[test]
    fn small_and_large_numbers_share_a_factor_in_the_label() {
        let axis = Axis::new("x").limits(0.0, 4.1e-6);
        let ticks = Scale::new(&axis, std::iter::empty(), Margin::Nothing).ticks(4);
        assert_eq!(ticks.exponent, -6);
        assert_eq!(ticks.major[2].1, "2");
        assert_eq!(label_with_factor("u (%)", -6), "u (10⁻⁶\u{a0}%)");
        assert_eq!(label_with_factor("step", 3), "step (10³)");
    }

    #[test]
    fn thousands_of_a_unit_have_a_prefix_before_those_of_a_count() {
        let exponent = |label: &str| {
            Scale::new(&Axis::new(label).limits(0.0, 6e4), std::iter::empty(), Margin::Nothing)
                .ticks(4)
                .exponent
        };
        assert_eq!(["time (ms)", "frequency (Hz)", "bead", "speed (beads/s)"].map(exponent), [3, 3, 0, 0]);
    }

    #[test]
    fn a_factor_becomes_the_prefix_of_the_unit() {
        let cases = [
            ("energy (mJ)", -3, "energy (µJ)"),
            ("u (m)", -6, "u (µm)"),
            ("v_{0} (m/s)", -3, "v_{0} (mm/s)"),
            ("time (ms)", 3, "time (s)"),
            ("impulse (N s)", -3, "impulse (mN s)"),
            ("time (ms)", -15, "time (10⁻¹⁵\u{a0}ms)"),
            ("area (m²)", -6, "area (10⁻⁶\u{a0}m²)"),
            ("speed (beads/s)", 3, "speed (10³\u{a0}beads/s)"),
        ];
        for (label, exponent, expected) in cases {
            assert_eq!(label_with_factor(label, exponent), expected);
        }
    }

    #[test]
    fn log_ticks_are_powers_or_parts_of_one() {
        assert_eq!(
            labels(&Axis::new("x").limits(1e-3, 10.0).log(), 6),
            ["10⁻³", "10⁻²", "10⁻¹", "10⁰", "10¹"]
        );
        assert_eq!(labels(&Axis::new("x").limits(0.04, 0.6).log(), 6), ["0.05", "0.1", "0.2", "0.5"]);
        assert_eq!(
            labels(&Axis::new("x").limits(3.0, 3.9).log(), 4).first().map(String::as_str),
            Some("3.0")
        );
        assert_eq!(labels(&Axis::new("x").limits(1e-12, 1e12).log(), 6).len(), 5);
    }

    #[test]
    fn any_range_gives_finite_places_and_some_ticks() {
        let cases: [&[f64]; 8] = [
            &[],
            &[0.0],
            &[-5.0, -5.0],
            &[f64::NAN, f64::INFINITY],
            &[1e-308, 2e-308],
            &[-1e300, 1e300],
            &[1e15, 1e15 + 1.0],
            &[1e-9, 1e9],
        ];
        for values in cases {
            for axis in [Axis::new(""), Axis::new("").log(), Axis::new("").reversed()] {
                let scale = Scale::new(&axis, values.iter().copied(), Margin::Part(0.05));
                let ticks = scale.ticks(5);
                assert!(ticks.major.len() >= 2, "{values:?} {axis:?} {scale:?}");
                assert!(ticks.major.len() <= 13, "{values:?} {axis:?}");
                assert!(ticks.major.iter().all(|tick| (-0.01..=1.01).contains(&tick.0)));
            }
        }
    }

    #[test]
    fn limits_that_differ_by_rounding_have_some_room() {
        let value = 1.8e-6;
        let axis = Axis::new("").limits(value, value * (1.0 + 4.0 * f64::EPSILON));
        assert_eq!(labels(&axis, 4), ["1.7", "1.8", "1.9"]);
        assert_eq!(labels(&axis.log(), 4), ["1.7", "1.8", "1.9"]);
    }
}
