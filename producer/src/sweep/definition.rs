//! A sweep file as it is written.

mod over;
mod sample;
mod schema;
mod series;

pub(super) use over::Over;
pub(super) use sample::Samples;
pub use schema::{Grid, schema};
pub use series::Series;

use super::SweepError;
use super::document::{KeyPath, merge};
use super::values::Range;
use super::{Hooks, MeasureOf, index_of};
use schemars::JsonSchema;
use schemas::config::{ConfigError, line_at};
use schemas::presets::{PRESETS, Preset};
use schemas::spelling::did_you_mean;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue, ValueDeserializer};
use toml::{Spanned, Table, Value};

/// A value set at some points, and the line on which it stands.
#[derive(Debug, Clone)]
pub(super) struct Setting {
    pub(super) key: KeyPath,
    pub(super) value: Value,
    pub(super) line: usize,
}

/// The values of one key: written in a list, each on its line, or computed from their places.
#[derive(Debug)]
pub(super) struct Axis {
    pub(super) key: KeyPath,
    values: Values,
}

#[derive(Debug)]
enum Values {
    List(Vec<(Value, usize)>),
    Range(Range, usize),
}

impl Axis {
    /// Number of values; at least one.
    pub(super) fn count(&self) -> u64 {
        match &self.values {
            Values::List(list) => list.len() as u64,
            Values::Range(range, _) => range.count(),
        }
    }

    /// The value at `place`.
    pub(super) fn at(&self, place: u64) -> Setting {
        let (value, line) = match &self.values {
            Values::List(list) => list[index_of(place)].clone(),
            Values::Range(range, line) => (range.at(place), *line),
        };
        Setting { key: self.key.clone(), value, line }
    }

    /// Places whose values show the kind of all: each of a list, the ends of a range.
    pub(super) fn telling(&self) -> impl Iterator<Item = u64> + use<> {
        let count = self.count();
        let step = if matches!(self.values, Values::List(_)) { 1 } else { count - 1 };
        (0..count).step_by(index_of(step).max(1)) // integers
    }

    /// Text that decides the values, independent of their layout in the file.
    pub(super) fn meaning(&self) -> String {
        match &self.values {
            Values::List(list) => {
                let values: Vec<_> = list.iter().map(|(value, _)| value.to_string()).collect();
                format!("{} = [{}]", self.key, values.join(", "))
            }
            Values::Range(range, _) => format!("{} = {range:?}", self.key),
        }
    }
}

/// End of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, JsonSchema)]
#[schemars(rename_all = "lowercase")]
pub enum Until {
    /// At the duration of its configuration.
    #[default]
    End,
    /// When the reflected energy is stationary, or at the duration if it never is.
    Stationary,
}

impl Until {
    /// The word used in sweep files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::End => "end",
            Self::Stationary => "stationary",
        }
    }
}

/// A configuration file that the base of a sweep begins with.
#[derive(Debug, Clone)]
pub(super) struct BaseFile {
    pub(super) path: PathBuf,
    pub(super) text: String,
}

/// Everything in a sweep file.
#[derive(Debug)]
pub(super) struct Definition {
    pub(super) base: Table,
    pub(super) base_file: Option<BaseFile>,
    /// Values set together; at least one case, which may set nothing.
    pub(super) cases: Vec<Vec<Setting>>,
    /// Values drawn together; at least one sample, which may set nothing.
    pub(super) samples: Samples,
    /// The axes in the order of the file.
    pub(super) axes: Vec<Axis>,
    /// The values over which statistics are made.
    pub(super) over: Option<Over>,
    pub(super) until: Until,
    pub(super) record: bool,
    pub(super) check: bool,
    pub(super) split_bead: Option<u64>,
    /// Columns of analyses beside the usual ones.
    pub(super) measure: Vec<String>,
    /// The lines of these columns.
    measure_lines: Vec<usize>,
    /// The time (s) from which these look at frames.
    pub(super) measure_from_s: f64,
    /// Columns of analyses over time.
    pub(super) series: Series,
}

/// A sweep file being read.
struct Reader<'a> {
    text: &'a str,
    path: &'a Path,
}

const KNOWN: [&str; 13] = [
    "base",
    "grid",
    "case",
    "sample",
    "seeds",
    "ensemble",
    "until",
    "record",
    "check",
    "split_bead",
    "measure",
    "measure_from_s",
    "series",
];

impl Definition {
    /// Reads the sweep file `path` with the contents `text`; `read` gives the contents of another file.
    pub(super) fn read(
        text: &str,
        path: &Path,
        read: impl Fn(&Path) -> std::io::Result<String>,
    ) -> Result<Self, SweepError> {
        let reader = Reader { text, path };
        let document = DeTable::parse(text).map_err(|error| syntax(text, path, &error))?;
        let document = document.get_ref();
        let unknown = document.iter().find(|(key, _)| !KNOWN.contains(&key.get_ref().as_ref()));
        if let Some((key, _)) = unknown {
            return Err(reader.refuse(key.span().start, key.get_ref(), unknown_key(key.get_ref(), &KNOWN)));
        }
        let (base, base_file) = reader.base(document.get("base"), read)?;
        let mut axes = document.get("grid").map_or(Ok(Vec::new()), |grid| reader.grid(grid))?;
        axes.extend(reader.seeds(document.get("seeds"))?);
        let samples = reader.samples(document.get("sample"))?;
        let cases = document.get("case").map_or(Ok(vec![Vec::new()]), |cases| reader.cases(cases))?;
        let (measure, measure_lines) = reader.measure(document.get("measure"))?.into_iter().unzip();
        Ok(Self {
            base,
            base_file,
            over: reader.over(document.get("ensemble"), document.contains_key("sample"), &axes)?,
            cases,
            samples,
            axes,
            until: reader.until(document.get("until"))?,
            record: reader.option(document.get("record"), "record", "true or false")?.unwrap_or(false),
            check: reader.option(document.get("check"), "check", "true or false")?.unwrap_or(false),
            split_bead: reader.option(document.get("split_bead"), "split_bead", "the number of a bead")?,
            measure,
            measure_lines,
            measure_from_s: reader.measure_from_s(document.get("measure_from_s"))?,
            series: reader.series(document.get("series"))?,
        })
    }

    /// Replaces the entries of `measure`, and of that of `[series]`, by their whole names, which the hooks know, and refuses unknown ones.
    pub(super) fn name_measures(&mut self, path: &Path, hooks: &Hooks) -> Result<(), ConfigError> {
        let series = &mut self.series;
        for (kind, names, lines) in [
            (MeasureOf::Summary, &mut self.measure, &self.measure_lines),
            (MeasureOf::Rows, &mut series.measure, &series.lines),
        ] {
            for (place, line) in lines.iter().enumerate() {
                let named = (hooks.measure)(kind, &names[place], None).and_then(|name| {
                    let is_twice = names[..place].contains(&name);
                    if is_twice {
                        Err(format!("found `{name}` twice; allowed: each column once"))
                    } else {
                        Ok(name)
                    }
                });
                names[place] = named.map_err(|message| ConfigError {
                    path: Some(path.to_owned()),
                    line: Some(*line),
                    key: kind.key(place),
                    message,
                })?;
            }
        }
        Ok(())
    }
}

/// The values of one key of a table `[grid]`, each with its line.
#[derive(Debug, Clone)]
pub struct GridAxis {
    /// The key.
    pub key: KeyPath,
    /// Its values; at least one.
    pub values: Vec<(Value, usize)>,
}

/// The axes in the table `[grid]` of any file `path` with the contents `text`, in the order of the file; none without such a table.
///
/// # Errors
/// With the line, for a wrong value, and for more than `most` points.
pub fn grid(text: &str, path: &Path, most: u64) -> Result<Vec<GridAxis>, SweepError> {
    let reader = Reader { text, path };
    let document = DeTable::parse(text).map_err(|error| syntax(text, path, &error))?;
    let Some(grid) = document.get_ref().get("grid") else { return Ok(Vec::new()) };
    let axes = reader.grid(grid)?;
    let points = axes.iter().fold(1, |points: u64, axis| points.saturating_mul(axis.count()));
    if points > most {
        let message = format!("found {points} points; allowed: at most {most}");
        return Err(reader.refuse(grid.span().start, "grid", message));
    }
    let of = |axis: &Axis| {
        let settings = (0..axis.count()).map(|place| axis.at(place));
        let values = settings.map(|Setting { value, line, .. }| (value, line)).collect();
        GridAxis { key: axis.key.clone(), values }
    };
    Ok(axes.iter().map(of).collect())
}

type Located<'i> = Spanned<DeValue<'i>>;

impl Reader<'_> {
    fn refuse(&self, offset: usize, key: &str, message: String) -> SweepError {
        let line = Some(line_at(self.text, offset));
        SweepError::Config(ConfigError {
            path: Some(self.path.to_owned()),
            line,
            key: key.to_owned(),
            message,
        })
    }

    fn table<'a, 'i>(&self, value: &'a Located<'i>, key: &str) -> Result<&'a DeTable<'i>, SweepError> {
        match value.get_ref() {
            DeValue::Table(table) => Ok(table),
            _ => Err(self.refuse(value.span().start, key, "expected a table".to_owned())),
        }
    }

    /// The value without its place.
    fn plain(&self, value: &Located<'_>, key: &str) -> Result<Value, SweepError> {
        Value::deserialize(ValueDeserializer::from(value.clone())).map_err(|error| {
            // such as a whole number of more than 64 bits, which is TOML all the same
            self.refuse(error.span().unwrap_or(value.span()).start, key, error.message().to_owned())
        })
    }

    /// The value as it is written.
    fn written(&self, value: &Located<'_>) -> &str {
        self.text.get(value.span()).unwrap_or_default()
    }

    fn option<T: for<'de> Deserialize<'de>>(
        &self,
        value: Option<&Located<'_>>,
        key: &str,
        allowed: &str,
    ) -> Result<Option<T>, SweepError> {
        let Some(value) = value else { return Ok(None) };
        let read = T::deserialize(ValueDeserializer::from(value.clone()));
        read.map(Some).map_err(|_| {
            let found = format!("found {}; allowed: {allowed}", self.written(value));
            self.refuse(value.span().start, key, found)
        })
    }

    fn until(&self, value: Option<&Located<'_>>) -> Result<Until, SweepError> {
        let Some(found) = value else { return Ok(Until::End) };
        let word: Option<String> = self.option(value, "until", "\"end\" or \"stationary\"")?;
        let known = [Until::End, Until::Stationary];
        known.into_iter().find(|until| Some(until.as_str()) == word.as_deref()).ok_or_else(|| {
            let message = format!("found {}; allowed: \"end\" or \"stationary\"", self.written(found));
            self.refuse(found.span().start, "until", message)
        })
    }

    /// The names in `measure`, each with its line.
    fn measure(&self, value: Option<&Located<'_>>) -> Result<Vec<(String, usize)>, SweepError> {
        let Some(value) = value else { return Ok(Vec::new()) };
        let allowed =
            "a list of columns of analyses, such as [\"energies.driven_j\", \"forces.peak_n@right\"]";
        let DeValue::Array(list) = value.get_ref() else {
            let found = format!("found {}; allowed: {allowed}", self.written(value));
            return Err(self.refuse(value.span().start, "measure", found));
        };
        let entry = |(place, entry): (usize, &Located<'_>)| {
            let key = MeasureOf::Summary.key(place);
            let name: Option<String> = self.option(Some(entry), &key, "a text in quotes")?;
            Ok((name.unwrap_or_default(), line_at(self.text, entry.span().start)))
        };
        list.iter().enumerate().map(entry).collect()
    }

    fn measure_from_s(&self, value: Option<&Located<'_>>) -> Result<f64, SweepError> {
        let (key, allowed) = ("measure_from_s", "a time (s) of 0 or more");
        let from_s: f64 = self.option(value, key, allowed)?.unwrap_or(0.0);
        if from_s >= 0.0 && from_s.is_finite() {
            return Ok(from_s);
        }
        let start = value.map_or(0, |value| value.span().start);
        Err(self.refuse(start, key, format!("found {from_s:?}; allowed: {allowed}")))
    }

    /// The `[base]` table over the preset or the file that it names.
    fn base(
        &self,
        value: Option<&Located<'_>>,
        read: impl Fn(&Path) -> std::io::Result<String>,
    ) -> Result<(Table, Option<BaseFile>), SweepError> {
        let missing =
            "a sweep needs a [base]: a configuration, or `preset = \"NAME\"`, or `file = \"FILE.toml\"`";
        let value = value.ok_or_else(|| self.refuse(0, "base", missing.to_owned()))?;
        let written = self.table(value, "base")?;
        let mut over = match self.plain(value, "base")? {
            Value::Table(table) => table,
            _ => Table::new(),
        };
        over.remove("preset");
        over.remove("file");
        let preset: Option<String> = self.option(written.get("preset"), "base.preset", "a name")?;
        let file: Option<String> = self.option(written.get("file"), "base.file", "a path")?;
        let (mut base, base_file) = match (preset, file) {
            (None, None) => (Table::new(), None),
            (Some(_), Some(_)) => {
                let message = "found both `preset` and `file`; allowed: one of them".to_owned();
                return Err(self.refuse(value.span().start, "base", message));
            }
            (Some(name), None) => (self.preset(&name, written)?, None),
            (None, Some(name)) => {
                let path = self.path.parent().unwrap_or(Path::new("")).join(&name);
                let text =
                    read(&path).map_err(|source| SweepError::Unreadable { path: path.clone(), source })?;
                let mut table: Table = text.parse().map_err(|error| syntax(&text, &path, &error))?;
                // files that it names lie beside it
                root(&mut table, Path::new(&name).parent().unwrap_or(Path::new("")));
                (table, Some(BaseFile { path, text }))
            }
        };
        merge(&mut base, over).map_err(|message| self.refuse(value.span().start, "base", message))?;
        Ok((base, base_file))
    }

    fn preset(&self, name: &str, base: &DeTable<'_>) -> Result<Table, SweepError> {
        let config = Preset::find(name).map(|preset| preset.config()).ok_or_else(|| {
            let known = PRESETS.map(|preset| preset.name);
            let hint = did_you_mean(name, known);
            let message = format!("found `{name}`; allowed: {}{hint}", known.join(", "));
            self.refuse(base.get("preset").map_or(0, |value| value.span().start), "base.preset", message)
        })?;
        // a configuration written as TOML is always a table
        let mut table: Table = config.to_toml().parse().unwrap_or_default();
        // of frames and of the method a preset has no wish of its own, and its name is that of another run
        for key in ["stream", "integrator", "name"] {
            table.remove(key);
        }
        Ok(table)
    }

    fn grid(&self, value: &Located<'_>) -> Result<Vec<Axis>, SweepError> {
        let mut entries = Vec::new();
        self.entries("", self.table(value, "grid")?, false, &mut entries)?;
        entries.into_iter().map(|(key, value)| self.axis(key, value)).collect()
    }

    /// Keys and values of `table` in the order of the file; keys may be written quoted, or dotted as in TOML. In a case a table in
    /// braces is a value, else one with an end of a range is.
    fn entries<'a, 'i>(
        &self,
        prefix: &str,
        table: &'a DeTable<'i>,
        is_case: bool,
        found: &mut Vec<(KeyPath, &'a Located<'i>)>,
    ) -> Result<(), SweepError> {
        let mut entries: Vec<_> = table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        for (key, value) in entries {
            let name = format!("{prefix}{}", key.get_ref());
            let has_end = |inner: &DeTable<'_>| inner.contains_key("from") || inner.contains_key("to");
            let in_braces = self.written(value).starts_with('{');
            match value.get_ref() {
                DeValue::Table(inner) if inner.is_empty() => {
                    let message = "found an empty table; allowed: values".to_owned();
                    return Err(self.refuse(key.span().start, &name, message));
                }
                DeValue::Table(inner) if !(if is_case { in_braces } else { has_end(inner) }) => {
                    self.entries(&format!("{name}."), inner, is_case, found)?;
                }
                _ => {
                    let path = KeyPath::parse(&name)
                        .map_err(|message| self.refuse(key.span().start, &name, message))?;
                    found.push((path, value));
                }
            }
        }
        Ok(())
    }

    fn axis(&self, key: KeyPath, value: &Located<'_>) -> Result<Axis, SweepError> {
        let name = key.to_string();
        let refuse = |message| self.refuse(value.span().start, &name, message);
        let line = |offset| line_at(self.text, offset);
        let values = match value.get_ref() {
            DeValue::Array(list) if !list.is_empty() => {
                let entry = |entry: &Located<'_>| Ok((self.plain(entry, &name)?, line(entry.span().start)));
                Values::List(list.iter().map(entry).collect::<Result<_, SweepError>>()?)
            }
            DeValue::Table(_) => {
                let range = self.plain(value, &name)?;
                let range = Range::read(range.as_table().unwrap_or(&Table::new())).map_err(refuse)?;
                Values::Range(range, line(value.span().start))
            }
            _ => {
                return Err(refuse(format!(
                    "found {}; allowed: a list of values, or a range {{ from = …, to = …, count = … }}",
                    self.written(value)
                )));
            }
        };
        Ok(Axis { key, values })
    }

    fn cases(&self, value: &Located<'_>) -> Result<Vec<Vec<Setting>>, SweepError> {
        let DeValue::Array(list) = value.get_ref() else {
            let message = "expected [[case]]: tables of keys that are set together".to_owned();
            return Err(self.refuse(value.span().start, "case", message));
        };
        if list.is_empty() {
            let message = "found no case, and so no point; leave `case` out, or write one".to_owned();
            return Err(self.refuse(value.span().start, "case", message));
        }
        list.iter().map(|case| self.case(case)).collect()
    }

    fn case(&self, value: &Located<'_>) -> Result<Vec<Setting>, SweepError> {
        let mut entries = Vec::new();
        self.entries("", self.table(value, "case")?, true, &mut entries)?;
        let line = |value: &Located<'_>| line_at(self.text, value.span().start);
        let setting = |(key, value): (KeyPath, &Located<'_>)| {
            Ok(Setting { value: self.plain(value, &key.to_string())?, line: line(value), key })
        };
        entries.into_iter().map(setting).collect()
    }
}

/// Puts `directory` before the names of files of waveforms and states.
fn root(table: &mut Table, directory: &Path) {
    for (key, value) in table.iter_mut() {
        match value {
            Value::String(name) if ["csv", "recording"].contains(&key.as_str()) && !name.contains("://") => {
                *name = directory.join(&*name).to_string_lossy().into_owned();
            }
            Value::Table(inner) => root(inner, directory),
            Value::Array(all) => {
                all.iter_mut().filter_map(Value::as_table_mut).for_each(|inner| root(inner, directory));
            }
            _ => {}
        }
    }
}

/// Message that a key is unknown, with the known ones.
fn unknown_key(key: &str, known: &[&str]) -> String {
    let hint = did_you_mean(key, known.iter().copied());
    format!("found an unknown key; allowed: {}{hint}", known.join(", "))
}

/// Error that `text`, the contents of `path`, is no TOML.
fn syntax(text: &str, path: &Path, error: &toml::de::Error) -> SweepError {
    SweepError::Config(ConfigError { path: Some(path.to_owned()), ..ConfigError::of_toml(error, text) })
}
