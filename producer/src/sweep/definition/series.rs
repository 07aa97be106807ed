//! Columns of analyses over time, which each row has beside its numbers.

use super::{Located, Reader, SweepError};
use schemars::JsonSchema;
use schemas::config::line_at;
use schemas::power::power;
use serde::Deserialize;
use toml::Spanned;
use toml::de::ValueDeserializer;

/// Most numbers of a row over time: a line of a journal holds them.
const MOST_NUMBERS: u64 = 20_000;

/// Intervals of time, unless the file says otherwise.
const COUNT: u64 = 50;

/// The table `[series]` of a sweep file.
#[derive(Debug, Default)]
pub struct Series {
    /// Columns of the rows of analyses, by their whole names.
    pub measure: Vec<String>,
    /// The lines of these.
    pub(super) lines: Vec<usize>,
    /// Number of intervals of time.
    pub count: u64,
    is_log: bool,
    from_s: Option<f64>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub(super) struct Written {
    /// Columns of the rows of analyses, as `measure` of a sweep; `beadline analyses` lists them.
    #[schemars(with = "Vec<String>", length(min = 1))]
    measure: Vec<Spanned<String>>,
    /// Number of intervals of time [default: 50].
    #[schemars(range(min = 1, max = MOST_NUMBERS / 2))]
    count: Option<u64>,
    /// The lengths of the intervals: equal, or in equal ratios.
    #[serde(default)]
    spacing: Spacing,
    /// The first end of the intervals (s) [default: 0, or the first frame after it].
    #[schemars(range(min = 0))]
    from_s: Option<f64>,
}

#[derive(Deserialize, Default, PartialEq, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Spacing {
    /// Equal differences.
    #[default]
    Linear,
    /// Equal ratios.
    Log,
}

impl Series {
    /// Text that decides the numbers, independent of the layout of the file.
    pub(in super::super) fn meaning(&self) -> String {
        format!("{:?} {} {} {:?}", self.measure, self.count, self.is_log, self.from_s)
    }

    /// The ends (s) of the intervals of a run with frames every `frame_s`, in order; the first begins at the first number.
    ///
    /// # Errors
    /// When they would begin after the run.
    pub fn edges_s(&self, frame_s: f64, duration_s: f64) -> Result<Vec<f64>, String> {
        let from_s = self.from_s.unwrap_or(if self.is_log { frame_s } else { 0.0 });
        if from_s >= duration_s {
            return Err(format!("found {from_s}; allowed: less than the duration, {duration_s} s"));
        }
        let part = |i: u64| i as f64 / self.count as f64;
        let edge = |i: u64| match i {
            i if i == self.count => duration_s,
            i if self.is_log => from_s * power(duration_s / from_s, part(i)),
            i => from_s + (duration_s - from_s) * part(i),
        };
        Ok((0..=self.count).map(edge).collect())
    }
}

impl Reader<'_> {
    /// The table `[series]`, which may not be there.
    pub(super) fn series(&self, value: Option<&Located<'_>>) -> Result<Series, SweepError> {
        let Some(value) = value else { return Ok(Series::default()) };
        let refuse = |key: &str, message| self.refuse(value.span().start, key, message);
        let written = Written::deserialize(ValueDeserializer::from(value.clone())).map_err(|error| {
            let start = error.span().unwrap_or(value.span()).start;
            self.refuse(start, "series", error.message().to_owned())
        })?;
        let Written { measure, count, spacing, from_s } = written;
        let (count, is_log) = (count.unwrap_or(COUNT), spacing == Spacing::Log);
        let most = MOST_NUMBERS / (measure.len() as u64 + 1);
        if measure.is_empty() {
            let allowed = "columns of analyses, such as [\"energies.total_j\"]";
            return Err(refuse("series.measure", format!("found nothing; allowed: {allowed}")));
        }
        if !(1..=most).contains(&count) {
            let allowed = format!("a whole number from 1 to {most} with so many columns");
            return Err(refuse("series.count", format!("found {count}; allowed: {allowed}")));
        }
        let is_possible = |from_s: f64| from_s.is_finite() && from_s >= 0.0 && (from_s > 0.0 || !is_log);
        if let Some(from_s) = from_s.filter(|from_s| !is_possible(*from_s)) {
            let allowed = if is_log { "a time above 0 (s), as spacing is \"log\"" } else { "a time (s)" };
            return Err(refuse("series.from_s", format!("found {from_s}; allowed: {allowed}")));
        }
        let lines = measure.iter().map(|name| line_at(self.text, name.span().start)).collect();
        Ok(Series {
            measure: measure.into_iter().map(Spanned::into_inner).collect(),
            lines,
            count,
            is_log,
            from_s,
        })
    }
}
