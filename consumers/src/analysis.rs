//! An analysis in one file: everything that is needed to offer it on the command line, in sweeps, on the bus, in recordings, in
//! Python and in the documentation.
//!
//! An [`Offer`] is the part that is known without a run: its name, its options, its columns. [`Offer::begin`] makes the
//! [`Analysis`] of one run. It takes frames, hands rows to an [`Outlet`], and reports at the end. It parses no arguments, opens no
//! files and knows no bus.

mod setting;

pub use setting::{Allowed, Setting, Settings, Takes};

use crate::table::{Cell, Column};
use figure::{Figure, FigureError};
use schemas::amounts::count;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::{KeptValues, ResultColumns};
use schemas::text::shown;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::ops::RangeInclusive;

pub use crate::table::Kind;
pub use schemas::results::RowValues;

/// An analysis before it looks at a run.
#[derive(Debug)]
pub struct Offer {
    /// Name of the command, of the topic on the bus, and in `measure` of sweeps: `[a-z0-9-]`.
    pub name: &'static str,
    /// Purpose, in one line.
    pub about: &'static str,
    /// Examples, one a line, and then what a user has to know about the method.
    pub help: &'static str,
    /// Options beside those of every analysis.
    pub settings: &'static [Setting],
    /// Tables that it writes, each a flag with a file's name.
    pub tables: &'static [TableFlag],
    /// Columns with a row for each frame, in the tables, on the bus and in recordings. A name in capitals stands for a number or
    /// a place: `u_BEAD_m`.
    pub columns: &'static [Meaning],
    /// Numbers of its summary, which sweeps may keep.
    pub summary: &'static [Meaning],
    /// The part of a chain that the summary is about.
    pub place: Whereabouts,
    /// Sources and frames that it needs.
    pub needs: Needs,
    /// Begins to look at a run.
    pub begin: fn(&Beginning<'_>) -> Result<Box<dyn Analysis>, Refusal>,
}

impl Offer {
    /// An analysis without options, to be completed: `Offer { name: …, about: …, begin: …, ..Offer::PLAIN }`.
    pub const PLAIN: Self = Self {
        name: "",
        about: "",
        help: "Examples:\n",
        settings: &[],
        tables: &[TableFlag { name: "out", help: "Table of the numbers in each frame" }],
        columns: &[],
        summary: &[],
        place: Whereabouts::Chain,
        needs: Needs::FRAMES,
        begin: |_| Err(Refusal { setting: None, why: String::new() }),
    };

    /// The numbers of its summary: if it says nothing else, those of the last frame.
    pub fn numbers(&self) -> &'static [Meaning] {
        if self.summary.is_empty() && self.has_fixed_columns() { self.columns } else { self.summary }
    }

    /// The rows that `analysis` publishes: if it says nothing else, its columns.
    pub fn published(&self, analysis: &dyn Analysis) -> Option<ResultColumns> {
        let names: Vec<&str> = self.columns.iter().map(|column| column.name).collect();
        analysis.published().or_else(|| self.has_fixed_columns().then(|| ResultColumns::named(&names)))
    }

    /// The columns of a table of `analysis`: if it says nothing else, those of its rows.
    pub fn columns_of(&self, analysis: &dyn Analysis, table: usize) -> Vec<Column> {
        let columns = analysis.columns(table);
        match self.published(analysis).filter(|_| columns.is_empty()) {
            Some(published) => frame_columns(published.names.split(',')),
            None => columns,
        }
    }

    /// True if its columns are the same whatever the run and the settings.
    fn has_fixed_columns(&self) -> bool {
        !self.columns.is_empty() && self.columns.iter().all(Meaning::has_own_name)
    }

    /// True if it draws its figure without any setting.
    pub fn draws_unasked(&self) -> bool {
        self.settings.iter().all(|setting| setting.required_unless.is_none())
    }
}

/// A flag that names the file of a table.
#[derive(Debug)]
pub struct TableFlag {
    /// Name of the flag.
    pub name: &'static str,
    /// Contents of the table, in one line.
    pub help: &'static str,
}

/// A column or a number of a summary.
#[derive(Debug, Clone, Copy)]
pub struct Meaning {
    /// Name, which ends with the unit.
    pub name: &'static str,
    /// Whole number or double.
    pub kind: Kind,
    /// Meaning, in a few words.
    pub meaning: &'static str,
}

impl Meaning {
    /// A double.
    pub const fn number(name: &'static str, meaning: &'static str) -> Self {
        Self { name, kind: Kind::Double, meaning }
    }

    /// A whole number.
    pub const fn count(name: &'static str, meaning: &'static str) -> Self {
        Self { name, kind: Kind::Integer, meaning }
    }

    /// True if its name has no capitals, which stand for numbers and places that settings decide.
    pub fn has_own_name(&self) -> bool {
        !self.name.bytes().any(|byte| byte.is_ascii_uppercase())
    }
}

/// The part of a chain that a summary is about: what may stand behind `@` in `measure` of a sweep.
#[derive(Debug)]
pub enum Whereabouts {
    /// All of the chain.
    Chain,
    /// One place, which is the value of a setting.
    Of {
        /// Name of the setting.
        setting: &'static str,
        /// Settings that are set with it.
        also: &'static [&'static str],
        /// Places that are allowed, in words.
        allowed: &'static str,
    },
    /// One of these words, which [`Analysis::value`] is told, or none of them.
    Words(&'static [&'static str]),
}

/// Sources and frames that an analysis needs.
#[derive(Debug, Default)]
pub struct Needs {
    /// It takes a configuration, too, as far as it looks at no frame.
    pub takes_configurations: bool,
    /// Its summary depends on the last frame alone.
    pub last_frame_only: bool,
    /// It can be redrawn from the rows that it published: [`Analysis::recall`].
    pub takes_own_rows: bool,
    /// The way in which a recorded row can be made again.
    pub remake: Remake,
    /// The most steps between frames with which it sees what it looks for; recordings with fewer frames are recomputed.
    pub longest_interval_steps: Option<fn(&RunManifest) -> Option<u64>>,
}

impl Needs {
    /// Frames of any kind.
    pub const FRAMES: Self = Self {
        takes_configurations: false,
        last_frame_only: false,
        takes_own_rows: false,
        remake: Remake::Not,
        longest_interval_steps: None,
    };
}

/// The way in which a recorded row can be made again, so that `beadline verify` proves it.
#[derive(Debug, Default)]
pub enum Remake {
    /// None: a row depends on frames before, or on settings that it does not tell.
    #[default]
    Not,
    /// A row is a function of its frame.
    OfFrame,
    /// The same, with the numbers of the things that it is about as this setting.
    OfThings(&'static str),
    /// The same, with its tolerance as this setting.
    OfTolerance(&'static str),
    /// A row depends on all frames since the analysis began, and on the threshold of its channel as this setting.
    OfFramesBefore(&'static str),
    /// The same, with values of a setting that the names of its columns tell.
    OfNames {
        /// Name of the setting.
        setting: &'static str,
        /// Settings that are set with it.
        also: &'static [&'static str],
        /// The value that a name tells, if it does.
        value: fn(&str) -> Option<String>,
    },
}

/// A run and what is asked about it.
#[derive(Debug)]
pub struct Beginning<'a> {
    /// Name of the analysis.
    pub name: &'static str,
    /// The run.
    pub manifest: &'a RunManifest,
    /// The options that are set.
    pub settings: &'a Settings,
    /// The steps that are looked at.
    pub steps: RangeInclusive<u64>,
    /// A figure will be drawn: what it needs must be kept.
    pub is_drawn: bool,
    /// It will look at no frame: whoever asks wants to know that it could.
    pub is_trial: bool,
}

impl<'a> Beginning<'a> {
    /// All of the run of `manifest`, with no figure.
    pub fn whole(name: &'static str, manifest: &'a RunManifest, settings: &'a Settings) -> Self {
        let steps = 0..=manifest.physics.step_count;
        Self { name, manifest, settings, steps, is_drawn: false, is_trial: false }
    }

    /// The bead that `setting` names, if it is set.
    ///
    /// # Errors
    /// When the chain has no such bead.
    pub fn bead(&self, setting: &'static str) -> Result<Option<u64>, Refusal> {
        Ok(self.beads(setting)?.first().copied())
    }

    /// The beads that `setting` names.
    ///
    /// # Errors
    /// When the chain has no such bead.
    pub fn beads(&self, setting: &'static str) -> Result<Vec<u64>, Refusal> {
        self.numbers(setting, "beads", 0..=self.manifest.physics.beads - 1)
    }

    /// The whole numbers of `setting`, each once, which stand for things of the chain that are numbered by `allowed`.
    ///
    /// # Errors
    /// When the chain has no such thing.
    pub fn numbers(
        &self,
        setting: &'static str,
        things: &str,
        allowed: RangeInclusive<u64>,
    ) -> Result<Vec<u64>, Refusal> {
        let mut found: Vec<u64> = self.settings.all(setting);
        let mut seen = BTreeSet::new();
        found.retain(|number| seen.insert(*number));
        match found.iter().find(|number| !allowed.contains(number)) {
            None => Ok(found),
            Some(number) => {
                let (first, last) = (allowed.start(), allowed.end());
                let why = format!("the chain has {things} {first} to {last}");
                Err(Refusal::of(setting, number.to_string(), why))
            }
        }
    }
}

/// Looks at the frames of one run.
pub trait Analysis: Send {
    /// The columns of the table of that index in [`Offer::tables`]; those of its rows if it gives none.
    fn columns(&self, _table: usize) -> Vec<Column> {
        Vec::new()
    }

    /// The rows that it publishes on the bus, one for each frame, if they are not those of [`Offer::columns`].
    fn published(&self) -> Option<ResultColumns> {
        None
    }

    /// True while it wants frames. Without, it reports at once.
    fn wants_frames(&self) -> bool {
        true
    }

    /// Looks at the next frame.
    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet);

    /// Frames are missing before the next one: nothing may be interpolated across the gap.
    fn gap(&mut self) {}

    /// The reason why frames so many steps apart are too few for its summary, if they are.
    fn too_coarse(&self, _interval_steps: u64) -> Option<String> {
        None
    }

    /// Takes the row of a frame, as it was published, in place of the frame.
    fn recall(&mut self, _step: u64, _tolerance_m: f64, _row: RowValues<'_>) {}

    /// Ends: no more frames come.
    ///
    /// # Errors
    /// When there were not enough frames.
    fn finish(&mut self, _out: &mut dyn Outlet) -> Result<(), Refusal> {
        Ok(())
    }

    /// The outcome, after [`Analysis::finish`]; none if it is the numbers of the summary.
    fn report(&mut self) -> Option<Report> {
        None
    }

    /// The figure, after [`Analysis::finish`]; none if it is the columns over time.
    ///
    /// # Errors
    /// When it cannot be drawn.
    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        Ok(None)
    }

    /// A number of the summary, after [`Analysis::finish`]; none if it does not exist, or is that of the last row. `word` is one
    /// of [`Whereabouts::Words`].
    fn value(&self, _name: &str, _word: Option<&str>) -> Option<Number> {
        None
    }
}

/// A number of a summary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// A whole number.
    Count(u64),
    /// A double; NaN and infinite ones do not exist.
    Double(f64),
}

impl From<Number> for Cell {
    fn from(number: Number) -> Self {
        match number {
            Number::Count(count) => Self::Integer(count),
            Number::Double(number) if number.is_finite() => Self::Double(number),
            Number::Double(_) => Self::Empty,
        }
    }
}

/// Takes the rows of an analysis: to tables, to the bus, or nowhere.
pub trait Outlet {
    /// True if somebody reads the table of that index in [`Offer::tables`].
    fn wants(&self, table: usize) -> bool;

    /// Adds a line to a table.
    fn line(&mut self, table: usize, cells: &[Cell]);

    /// True if somebody may read published rows.
    fn is_published(&self) -> bool;

    /// Publishes the row of `frame`.
    fn publish(&mut self, frame: &Frame<'_>, row: RowValues<'_>);
}

impl dyn Outlet + '_ {
    /// Adds the row of `frame` to the first table, and publishes it. NaN does not exist: it is empty in the table.
    pub fn row(&mut self, frame: &Frame<'_>, row: &[f64]) {
        if self.wants(0) {
            let values = row.iter().map(|value| Some(*value).filter(|value| !value.is_nan()));
            self.line_of(0, frame, values.map(Cell::from));
        }
        self.publish(frame, RowValues::Numbers(row));
    }

    /// Adds a line about `frame` to a table.
    pub fn line_of(&mut self, table: usize, frame: &Frame<'_>, cells: impl IntoIterator<Item = Cell>) {
        let head = [Cell::Integer(frame.frame), Cell::Integer(frame.step), Cell::Double(frame.time_s)];
        let line: Vec<Cell> = head.into_iter().chain(cells).collect();
        self.line(table, &line);
    }
}

/// Keeps the last row that was published.
#[derive(Debug, Clone, Default)]
pub struct LastRow {
    kept: Option<KeptValues>,
    is_read: bool,
}

impl LastRow {
    /// One that also gets the rows which analyses make only for readers.
    pub fn read() -> Self {
        Self { is_read: true, ..Self::default() }
    }

    /// A number of the summary of `analysis` once it has finished, from its rows if it gives none.
    pub fn value(
        &self,
        offer: &Offer,
        analysis: &dyn Analysis,
        name: &str,
        word: Option<&str>,
    ) -> Option<Number> {
        let of_row = || {
            let published = offer.published(analysis)?;
            let place = published.names.split(',').position(|column| column == name)?;
            self.values()?.numbers().get(place).copied().map(Number::Double)
        };
        analysis.value(name, word).or_else(of_row)
    }

    /// The row, if there is one.
    pub fn values(&self) -> Option<RowValues<'_>> {
        self.kept.as_ref().map(KeptValues::lend)
    }

    /// Keeps a row.
    pub fn take(&mut self, row: RowValues<'_>) {
        match (&mut self.kept, row) {
            (Some(KeptValues::Numbers(kept)), RowValues::Numbers(row)) => row.clone_into(kept),
            (Some(KeptValues::Classes(kept)), RowValues::Classes(row)) => row.clone_into(kept),
            (kept, row) => *kept = Some(row.into()),
        }
    }
}

impl Outlet for LastRow {
    fn wants(&self, _: usize) -> bool {
        false
    }

    fn line(&mut self, _: usize, _: &[Cell]) {}

    fn is_published(&self) -> bool {
        self.is_read
    }

    fn publish(&mut self, _: &Frame<'_>, row: RowValues<'_>) {
        self.take(row);
    }
}

/// The columns of lines about frames, followed by `names`.
pub fn frame_columns<N: Into<String>>(names: impl IntoIterator<Item = N>) -> Vec<Column> {
    let head = ["frame", "step", "time_s"].map(String::from);
    head.into_iter().chain(names.into_iter().map(N::into)).map(Column::from).collect()
}

/// Outcome of an analysis, for people and for programs.
#[derive(Debug, Default)]
pub struct Report {
    /// Its subject: `energies`, `wave map`.
    pub title: &'static str,
    /// Names and values for people.
    pub words: Words,
    /// The same and more for programs.
    pub results: Value,
    /// Warnings.
    pub notices: Vec<String>,
    /// Some of what it looked for was lost.
    pub is_lossy: bool,
}

/// Names and values for people, a line each.
#[derive(Debug, Default)]
pub struct Words(Vec<(Cow<'static, str>, String)>);

impl Words {
    /// Adds a line.
    pub fn add(&mut self, name: impl Into<Cow<'static, str>>, value: impl Display) {
        // a value may be a text of a file
        self.0.push((name.into(), shown(&value.to_string()).into_owned()));
    }

    /// Adds a line for each value, all of the same name.
    pub fn each(&mut self, name: &'static str, values: impl IntoIterator<Item: Display>) {
        values.into_iter().for_each(|value| self.add(name, value));
    }

    /// Adds a line that says how many of `all` are not shown, if any.
    pub fn more(&mut self, name: &'static str, all: u64, shown: usize, of: &str) {
        let more = all.saturating_sub(shown as u64);
        if more > 0 {
            self.add(name, format_args!("and {} more{of}", count(more)));
        }
    }

    /// Adds the lines of others.
    pub fn append(&mut self, mut others: Self) {
        self.0.append(&mut others.0);
    }

    /// The lines, aligned under a title.
    pub fn under(&self, title: impl Display) -> String {
        let width = self.0.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        let lines = self.0.iter().map(|(name, value)| format!("  {name:width$}  {value}\n"));
        std::iter::once(format!("{title}\n")).chain(lines).collect()
    }
}

/// Reason why an analysis cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{why}", .setting.as_ref().map_or_else(String::new, |(setting, found)| format!("{setting} {found}: ")))]
pub struct Refusal {
    /// The setting that is wrong and its value, if one is.
    pub setting: Option<(&'static str, String)>,
    /// The error, the allowed values, and what to do.
    pub why: String,
}

impl Refusal {
    /// The value `found` of `setting` is wrong.
    pub fn of(setting: &'static str, found: impl Into<String>, why: impl Into<String>) -> Self {
        Self { setting: Some((setting, found.into())), why: why.into() }
    }
}

impl From<String> for Refusal {
    fn from(why: String) -> Self {
        Self { setting: None, why }
    }
}
