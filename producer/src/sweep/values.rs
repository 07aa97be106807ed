//! The values of a range, each a function of its place.
//!
//! Architecture invariant: values of a range decide the bits of runs, and are computed with reproducible
//! arithmetic only.

use super::MAX_POINTS;
use schemas::power::power;
use schemas::spelling::did_you_mean;
use toml::{Table, Value};

/// The values of `{ from, to, count, spacing }`, both ends included, each computed from its place.
///
/// Linear: `vᵢ = (from·(n − 1 − i) + to·i)/(n − 1)`; logarithmic: `vᵢ = from·(to/from)^(i/(n − 1))`, with the power
/// function of the dynamics. The ends are exactly `from` and `to`. A range between whole numbers has whole numbers,
/// and is refused if some of its values are not whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    count: u64,
    spacing: Spacing,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Spacing {
    /// `from + gap·i`.
    Whole {
        from: i64,
        gap: i128,
    },
    Linear(f64, f64),
    Log(f64, f64),
}

impl Range {
    /// Reads `{ from, to, count, spacing }`.
    pub(super) fn read(range: &Table) -> Result<Self, String> {
        let known = ["from", "to", "count", "spacing"];
        if let Some(key) = range.keys().find(|key| !known.contains(&key.as_str())) {
            let hint = did_you_mean(key, known);
            return Err(format!(
                "found the unknown key `{key}` in a range; allowed: {}{hint}",
                known.join(", ")
            ));
        }
        let counted =
            |count: &i64| u64::try_from(*count).ok().filter(|count| (2..=MAX_POINTS).contains(count));
        let count = range.get("count").and_then(Value::as_integer).as_ref().and_then(counted);
        let count = count.ok_or_else(|| {
            wrong("count", range.get("count"), &format!("a whole number from 2 to {MAX_POINTS}"))
        })?;
        let (from, to) = (number(range, "from")?, number(range, "to")?);
        let spacing = match (from, to, is_logarithmic(range)?) {
            (Value::Integer(from), Value::Integer(to), false) => {
                Spacing::Whole { from: *from, gap: whole_gap(*from, *to, count)? }
            }
            (from, to, false) => Spacing::Linear(double(from), double(to)),
            (from, to, true) => {
                let (from, to) = (double(from), double(to));
                if !(from > 0.0 && to > 0.0) {
                    return Err(not_logarithmic(from, to));
                }
                Spacing::Log(from, to)
            }
        };
        Ok(Self { count, spacing })
    }

    /// The `count` whole numbers after `from`, with that among them.
    pub(super) fn whole(from: i64, count: u64) -> Self {
        Self { count, spacing: Spacing::Whole { from, gap: 1 } }
    }

    /// Number of values.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// The value at place `i` from 0.
    pub(super) fn at(&self, i: u64) -> Value {
        let last = self.count - 1;
        let (place, gaps) = (i as f64, last as f64);
        match self.spacing {
            Spacing::Whole { from, gap } => {
                // between the ends, which are such numbers
                Value::Integer(i64::try_from(i128::from(from) + gap * i128::from(i)).unwrap_or(from))
            }
            Spacing::Linear(from, _) | Spacing::Log(from, _) if i == 0 => Value::Float(from),
            Spacing::Linear(_, to) | Spacing::Log(_, to) if i == last => Value::Float(to),
            Spacing::Linear(from, to) => Value::Float((from * (gaps - place) + to * place) / gaps),
            Spacing::Log(from, to) => Value::Float(from * power(to / from, place / gaps)),
        }
    }
}

/// A range that values are drawn from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Interval {
    /// Whole numbers, both ends included.
    Whole(i64, i64),
    Linear(f64, f64),
    /// Equal ratios are equally likely; the ends are positive.
    Log(f64, f64),
}

impl Interval {
    /// Reads `{ from, to, spacing }`. A range between whole numbers has whole numbers.
    pub(super) fn read(range: &Table) -> Result<Self, String> {
        let known = ["from", "to", "spacing"];
        if let Some(key) = range.keys().find(|key| !known.contains(&key.as_str())) {
            let hint = did_you_mean(key, known);
            return Err(format!("found `{key}` in a range of [sample]; allowed: {}{hint}", known.join(", ")));
        }
        let (from, to) = (number(range, "from")?, number(range, "to")?);
        let logarithmic = is_logarithmic(range)?;
        let (low, high) = (double(from), double(to));
        if low >= high {
            return Err(format!("found a range from {from} to {to}; allowed: `from` below `to`"));
        }
        match (from, to) {
            (Value::Integer(from), Value::Integer(to)) if !logarithmic => Ok(Self::Whole(*from, *to)),
            _ if !logarithmic => Ok(Self::Linear(low, high)),
            _ if low > 0.0 => Ok(Self::Log(low, high)),
            _ => Err(not_logarithmic(low, high)),
        }
    }

    /// The value at `fraction`, from 0 to 1, of the range: `from·(1 − fraction) + to·fraction`. Each whole number has
    /// an equal part. A logarithmic range gives `from·(to/from)^fraction`, with the power function of the dynamics.
    pub(super) fn at(self, fraction: f64) -> Value {
        let within = |from: f64, to: f64, value: f64| match value {
            value if value < from => from,
            value if value > to => to,
            value => value,
        };
        match self {
            Self::Whole(from, to) => {
                let count = i128::from(to) - i128::from(from) + 1;
                #[expect(clippy::cast_possible_truncation, reason = "floor of what is not negative")]
                let steps = (count as f64 * fraction) as i128;
                let steps = if steps < count { steps } else { count - 1 };
                Value::Integer(i64::try_from(i128::from(from) + steps).unwrap_or(to))
            }
            Self::Linear(from, to) => Value::Float(within(from, to, from * (1.0 - fraction) + to * fraction)),
            Self::Log(from, _) if fraction == 0.0 => Value::Float(from),
            Self::Log(from, to) => Value::Float(within(from, to, from * power(to / from, fraction))),
        }
    }
}

fn is_logarithmic(range: &Table) -> Result<bool, String> {
    match range.get("spacing").map(Value::as_str) {
        None | Some(Some("linear")) => Ok(false),
        Some(Some("log")) => Ok(true),
        Some(_) => Err(wrong("spacing", range.get("spacing"), "\"linear\" (the default) or \"log\"")),
    }
}

fn not_logarithmic(from: f64, to: f64) -> String {
    format!("a range from {from} to {to} has no logarithmic spacing; allowed: positive ends")
}

fn wrong(key: &str, found: Option<&Value>, allowed: &str) -> String {
    let found = found.map_or("nothing".to_owned(), Value::to_string);
    format!("found {found} for `{key}` of a range; allowed: {allowed}")
}

fn number<'a>(range: &'a Table, key: &str) -> Result<&'a Value, String> {
    match range.get(key) {
        Some(value @ Value::Integer(_)) => Ok(value),
        Some(value @ Value::Float(number)) if number.is_finite() => Ok(value),
        found => Err(wrong(key, found, "a finite number")),
    }
}

fn double(value: &Value) -> f64 {
    match value {
        Value::Integer(whole) => *whole as f64,
        other => other.as_float().unwrap_or(f64::NAN),
    }
}

/// The gap between two neighbours of `count` whole numbers from `from` to `to`.
fn whole_gap(from: i64, to: i64, count: u64) -> Result<i128, String> {
    let width = i128::from(to) - i128::from(from);
    let gaps = i128::from(count) - 1;
    if width % gaps != 0 {
        return Err(format!(
            "{count} values from {from} to {to} are no whole numbers; change the count, or write {from}.0 for a key that takes others"
        ));
    }
    Ok(width / gaps)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Result<Vec<Value>, String> {
        let range = Range::read(&text.parse().expect("TOML"))?;
        Ok((0..range.count()).map(|i| range.at(i)).collect())
    }

    fn doubles(text: &str) -> Vec<f64> {
        values(text).expect(text).iter().map(|value| value.as_float().expect("float")).collect()
    }

    #[test]
    fn linear_ranges_have_both_ends() {
        assert_eq!(doubles("from = 1.0\nto = 2.0\ncount = 5"), [1.0, 1.25, 1.5, 1.75, 2.0]);
        let masses = doubles("from = 0.6e-3\nto = 5e-3\ncount = 23");
        assert_eq!((masses.len(), masses[0], masses[22]), (23, 0.6e-3, 5e-3));
        assert!(masses.windows(2).all(|pair| (pair[1] - pair[0] - 0.2e-3).abs() < 1e-17));
    }

    #[test]
    fn logarithmic_ranges_have_equal_ratios() {
        let values = doubles("from = 1\nto = 16.0\ncount = 5\nspacing = \"log\"");
        for (value, expected) in values.iter().zip([1.0, 2.0, 4.0, 8.0, 16.0]) {
            // the power function is good to a few ulp
            assert!((value / expected - 1.0).abs() < 1e-15, "{value}");
        }
        // the middle is the power function's, to the bit: √10 · 10⁻³ from its own 10^0.5
        let decade = doubles("from = 1e-3\nto = 1e-2\ncount = 3\nspacing = \"log\"");
        assert_eq!(decade[1].to_bits(), (1e-3 * power(1e-2 / 1e-3, 0.5)).to_bits());
    }

    #[test]
    fn whole_numbers_stay_whole() {
        let whole = values("from = 100\nto = 400\ncount = 4").expect("whole");
        assert_eq!(whole, [100, 200, 300, 400].map(Value::Integer));
        let down = values("from = 5\nto = -5\ncount = 3").expect("whole");
        assert_eq!(down, [5, 0, -5].map(Value::Integer));
        assert!(values("from = 1\nto = 2\ncount = 4").expect_err("fractions").contains("1.0"));
    }

    /// The formulas of the whole list, which earlier versions made before the first point: every value has their bits.
    #[test]
    fn a_value_from_its_place_has_the_bits_of_the_list() {
        let (from, to, count) = (0.6e-3, 5e-3, 1001_i64);
        let gaps = (count - 1) as f64;
        let inner = |i: i64| (from * (gaps - i as f64) + to * i as f64) / gaps;
        let log = |i: i64| from * power(to / from, i as f64 / gaps);
        let list = |inner: &dyn Fn(i64) -> f64| -> Vec<u64> {
            let value = |i| {
                if i == 0 {
                    from
                } else if i == count - 1 {
                    to
                } else {
                    inner(i)
                }
            };
            (0..count).map(|i| value(i).to_bits()).collect()
        };
        let bits = |text: &str| -> Vec<u64> { doubles(text).into_iter().map(f64::to_bits).collect() };
        let text = "from = 0.6e-3\nto = 5e-3\ncount = 1001\n";
        assert_eq!(bits(text), list(&inner));
        assert_eq!(bits(&format!("{text}spacing = \"log\"")), list(&log));
        let wide = values("from = -9223372036854775807\nto = 9223372036854775807\ncount = 3").expect("whole");
        assert_eq!(wide, [-i64::MAX, 0, i64::MAX].map(Value::Integer));
    }

    #[test]
    fn drawn_values_lie_in_their_range() {
        let interval = |text: &str| Interval::read(&text.parse().expect("TOML"));
        let at = |text, fraction| interval(text).expect(text).at(fraction);
        assert_eq!(at("from = 1.0\nto = 2", 0.25), Value::Float(1.25));
        let below_1 = 1.0 - f64::EPSILON / 2.0;
        let dice = "from = 1\nto = 6";
        assert_eq!([0.0, 0.17, below_1, 1.0].map(|f| at(dice, f)), [1, 2, 6, 6].map(Value::Integer));
        let decade = at("from = 1e-3\nto = 1e-2\nspacing = \"log\"", 0.5);
        assert_eq!(decade.as_float().map(f64::to_bits), Some((1e-3 * power(1e-2 / 1e-3, 0.5)).to_bits()));
        assert_eq!(at("from = 0.1\nto = 0.3", 1.0), Value::Float(0.3));
        for (text, says) in [
            ("from = 2.0\nto = 1.0", "below"),
            ("from = 1.0\nto = 2.0\ncount = 3", "`count`"),
            ("from = 0.0\nto = 2.0\nspacing = \"log\"", "positive"),
        ] {
            assert!(interval(text).expect_err(text).contains(says), "{text}");
        }
    }

    #[test]
    fn impossible_ranges_are_refused() {
        for (text, says) in [
            ("from = 1.0\nto = 2.0", "`count`"),
            ("from = 1.0\nto = 2.0\ncount = 1", "found 1"),
            ("from = 1.0\nto = nan\ncount = 3", "`to`"),
            ("to = 2.0\ncount = 3", "`from`"),
            ("from = -1.0\nto = 2.0\ncount = 3\nspacing = \"log\"", "positive"),
            ("from = 1.0\nto = 2.0\ncount = 3\nspacing = \"cubic\"", "cubic"),
            ("from = 1.0\nto = 2.0\ncount = 3\nstep = 1", "`step`"),
        ] {
            let error = values(text).expect_err(text);
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
