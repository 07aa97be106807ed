//! The values over which statistics are made: seeds, or another key of the grid.

use super::super::MAX_POINTS;
use super::super::document::KeyPath;
use super::super::values::Range;
use super::{Axis, Located, Reader, SweepError, Values, unknown_key};
use schemas::config::line_at;
use toml::Value;

/// The key over which statistics are made, unless the file names another one.
const SEED: &str = "seed";

/// The values over which statistics are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum Over {
    /// All values that `[sample]` draws.
    Sample,
    /// One key of the grid, by its place there.
    Axis(usize),
}

impl Reader<'_> {
    /// The key `seed` with the values of `seeds = { from, count }`, if the file has that.
    pub(super) fn seeds(&self, value: Option<&Located<'_>>) -> Result<Option<Axis>, SweepError> {
        let Some(value) = value else { return Ok(None) };
        let plain = self.plain(value, "seeds")?;
        let wrong = || {
            let found = format!("found {}; allowed: {{ from = 0, count = 100 }}", self.written(value));
            self.refuse(value.span().start, "seeds", found)
        };
        let table = plain.as_table().ok_or_else(wrong)?;
        let whole = |key, default| table.get(key).map_or(Some(default), Value::as_integer);
        let (from, count) = whole("from", 0).zip(whole("count", 0)).ok_or_else(wrong)?;
        let is_known = table.keys().all(|key| key == "from" || key == "count");
        let count =
            u64::try_from(count).ok().filter(|count| (1..=MAX_POINTS).contains(count)).ok_or_else(wrong)?;
        if !is_known || from < 0 || from.checked_add_unsigned(count - 1).is_none() {
            return Err(wrong());
        }
        let line = line_at(self.text, value.span().start);
        let key = KeyPath::parse(SEED).map_err(|_| wrong())?;
        Ok(Some(Axis { key, values: Values::Range(Range::whole(from, count), line) }))
    }

    /// The choice of the table `[ensemble]`; without that table the key `seed`, if the grid has it.
    pub(super) fn over(
        &self,
        value: Option<&Located<'_>>,
        has_sample: bool,
        axes: &[Axis],
    ) -> Result<Option<Over>, SweepError> {
        let keys: Vec<String> = axes.iter().map(|axis| axis.key.to_string()).collect();
        let axis = |key: &str| keys.iter().position(|known| known == key).map(Over::Axis);
        let Some(value) = value else { return Ok(axis(SEED)) };
        let table = self.table(value, "ensemble")?;
        if let Some((key, _)) = table.iter().find(|(key, _)| key.get_ref() != "over") {
            let name = key.get_ref();
            return Err(self.refuse(
                key.span().start,
                &format!("ensemble.{name}"),
                unknown_key(name, &["over"]),
            ));
        }
        let written = table.get("over");
        let name: Option<String> = self.option(written, "ensemble.over", "the name of a key")?;
        let name = name.unwrap_or_else(|| SEED.to_owned());
        if has_sample && name == "sample" {
            return Ok(Some(Over::Sample));
        }
        // `a[00].b` is `a[0].b`
        let key = KeyPath::parse(&name).map_or(name.clone(), |key| key.to_string());
        axis(&key).map(Some).ok_or_else(|| {
            let mut known = keys.clone();
            known.extend(has_sample.then(|| "sample".to_owned()));
            let known =
                if known.is_empty() { "a key, once [grid] has one".to_owned() } else { known.join(", ") };
            let offset = written.unwrap_or(value).span().start;
            self.refuse(
                offset,
                "ensemble.over",
                format!("found `{name}`, which the grid does not have; allowed: {known}"),
            )
        })
    }
}
