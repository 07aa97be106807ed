//! Values at times, with straight lines or cubic pieces between them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Values at some times; before the first time the value is the first one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// Times (s), increasing.
    pub times_s: Vec<f64>,
    /// The value at each time.
    pub values: Vec<f64>,
    /// The interpolation between the times.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// The interpolation between two times of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Straight lines.
    #[default]
    Linear,
    /// Cubic pieces with a continuous slope: at each time that of the parabola through it and its neighbours.
    Cubic,
}

/// Reads a table from text with a time (s) and a value in each row, separated by a comma, semicolon, tab or spaces. It skips empty
/// lines, comments after a `#`, and a first row without any number.
///
/// ```
/// let table = schemas::drive::table_from_csv("t_s,force_n\n0,0 # at rest\n1e-3,2.5\n")?;
/// assert_eq!((table.times_s, table.values), (vec![0.0, 1e-3], vec![0.0, 2.5]));
/// # Ok::<(), String>(())
/// ```
///
/// # Errors
/// When a row has not two numbers, or there are fewer than two rows; the message names the line.
pub fn table_from_csv(text: &str) -> Result<Table, String> {
    let mut table = Table { times_s: vec![], values: vec![], interpolation: Interpolation::Linear };
    let mut may_be_header = true;
    for (number, line) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
        let row = line.split('#').next().unwrap_or_default();
        let row = row.trim_end_matches(|c: char| c == ',' || c == ';' || c.is_whitespace());
        if row.is_empty() {
            continue;
        }
        let fields: Vec<&str> = match row.chars().find(|c| [',', ';'].contains(c)) {
            Some(separator) => row.split(separator).map(str::trim).collect(),
            None => row.split_whitespace().collect(),
        };
        let numbers: Vec<Option<f64>> = fields.iter().map(|field| field.parse().ok()).collect();
        match numbers[..] {
            [Some(time), Some(value)] => {
                table.times_s.push(time);
                table.values.push(value);
            }
            _ if may_be_header && numbers.iter().all(Option::is_none) => {}
            _ => {
                return Err(format!(
                    "line {number}: found {:?}; allowed: two numbers, a time (s) and a value",
                    row.trim()
                ));
            }
        }
        may_be_header = false;
    }
    if table.times_s.len() < 2 {
        return Err(format!("found {} rows; allowed: 2 or more", table.times_s.len()));
    }
    Ok(table)
}

impl Table {
    /// A number that no value between its times exceeds in size: a cubic piece leaves the range of its two values by at most 4/27 of
    /// each of its slopes.
    pub(super) fn largest(&self) -> f64 {
        let mut largest = 0.0;
        for (index, value) in self.values.iter().enumerate() {
            let mut beyond = 0.0;
            if self.interpolation == Interpolation::Cubic {
                for near in index.saturating_sub(1)..=index {
                    let Some(end) = self.times_s.get(near + 1) else { break };
                    let slopes = self.slope_at(near).abs() + self.slope_at(near + 1).abs();
                    let steep = (end - self.times_s[near]) * slopes;
                    if steep > beyond {
                        beyond = steep;
                    }
                }
            }
            let reach = value.abs() + 4.0 / 27.0 * beyond;
            if reach > largest {
                largest = reach;
            }
        }
        largest
    }

    /// The value and the slope at a time (s); after the last time the value stays.
    pub(super) fn value_and_slope(&self, t: f64) -> (f64, f64) {
        let (times, values) = (&self.times_s[..], &self.values[..]);
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return (f64::NAN, f64::NAN) };
        if t < first || times.len() < 2 || values.len() != times.len() {
            return (values.first().copied().unwrap_or(f64::NAN), 0.0);
        }
        let t = if t < last { t } else { last };
        // the last interval that has begun
        let begun = times[1..times.len() - 1].partition_point(|time| *time <= t);
        let (t0, y0, h) = (times[begun], values[begun], times[begun + 1] - times[begun]);
        let rise = values[begun + 1] - y0;
        let x = (t - t0) / h;
        match self.interpolation {
            Interpolation::Linear => (y0 + x * rise, rise / h),
            Interpolation::Cubic => {
                let (d0, d1) = (h * self.slope_at(begun), h * self.slope_at(begun + 1));
                let second = 3.0 * rise - (2.0 * d0 + d1);
                let third = (d0 + d1) - 2.0 * rise;
                let value = y0 + x * (d0 + x * (second + x * third));
                (value, (d0 + x * (2.0 * second + x * (3.0 * third))) / h)
            }
        }
    }

    /// The slope at a time of the table: that of the parabola through three neighbours, at the ends the first or last three.
    fn slope_at(&self, index: usize) -> f64 {
        let (times, values) = (&self.times_s[..], &self.values[..]);
        let secant = |i: usize| (values[i + 1] - values[i]) / (times[i + 1] - times[i]);
        let length = |i: usize| times[i + 1] - times[i];
        let last = times.len() - 1;
        if last == 1 {
            return secant(0);
        }
        let (own, other) = if index == 0 {
            (0, 1)
        } else if index == last {
            (last - 1, last - 2)
        } else {
            let (before, after) = (index - 1, index);
            let sum = length(before) + length(after);
            return (length(after) * secant(before) + length(before) * secant(after)) / sum;
        };
        let sum = length(own) + length(other);
        secant(own) + (secant(own) - secant(other)) * length(own) / sum
    }
}
