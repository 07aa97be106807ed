//! Columns of the rows of analyses over time: `[series]` of a sweep file.
//!
//! The row of a point has their means in intervals of time behind its other cells: for each interval the mean time of its frames and the
//! mean of each column. Tables have a line for each interval instead.

use crate::measures::{InRow, Measure, place_among};
use consumers::analysis::{Analysis, LastRow, Settings};
use consumers::table::{Cell, Column, Kind};
use producer::sweep::{MeasureOf, Sweep};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// The column with the mean time of the frames of an interval.
const TIME: &str = "time_s";

/// The columns of one interval; none where the sweep asks for no column over time.
fn names(sweep: &Sweep) -> Vec<&str> {
    let measure = &sweep.series().measure;
    let time = (!measure.is_empty()).then_some(TIME);
    time.into_iter().chain(measure.iter().map(String::as_str)).collect()
}

/// The columns of all intervals, in the order of their cells in a row.
pub(crate) fn columns(sweep: &Sweep) -> impl Iterator<Item = Column> {
    let names = names(sweep);
    (0..sweep.series().count).flat_map(move |interval| {
        let of = |name: &&str| Column::new(format!("{name}[{interval}]"), Kind::Double);
        names.iter().map(of).collect::<Vec<_>>()
    })
}

/// The analyses that look at the frames of a run for their rows, and the sums of these.
#[derive(Default)]
pub(crate) struct SeriesSums {
    /// Each analysis and place once.
    looking: Vec<Box<dyn Analysis>>,
    /// For each column which of these, and the way to its number.
    columns: Vec<(usize, InRow)>,
    /// The first step, and the last step of each interval.
    first: u64,
    ends: Vec<u64>,
    /// Number and sum of the values of the time and of each column, in each interval.
    sums: Vec<Vec<[f64; 2]>>,
}

impl SeriesSums {
    /// Begins to look at the run of `manifest`; energies without options have the settings `of_energies`.
    ///
    /// # Errors
    /// The place in the list and what is wrong with it.
    pub(crate) fn new(
        sweep: &Sweep,
        manifest: &RunManifest,
        of_energies: &Settings,
    ) -> Result<Self, (usize, String)> {
        let mut found = Vec::new();
        let mut series = Self::default();
        for (i, text) in sweep.series().measure.iter().enumerate() {
            let wrong = |why| (i, why);
            let measure = Measure::parse(MeasureOf::Rows, text).map_err(wrong)?;
            let (at, is_new) = place_among(&mut found, measure.key());
            if is_new {
                let is_standard =
                    measure.offer.name == analyses::energies::OFFER.name && measure.has_no_options();
                let begun = if is_standard {
                    measure.begin_with(of_energies, manifest, false)
                } else {
                    measure.begin(manifest, false)
                };
                series.looking.push(begun.map_err(wrong)?);
            }
            let place = measure.in_rows_of(&*series.looking[at]).map_err(wrong)?;
            series.columns.push((at, place));
        }
        let edges_s = sweep.series_edges_s(manifest).map_err(|why| (0, why))?;
        // times that people write are those of steps
        let physics = &manifest.physics;
        series.first = edges_s.first().map_or(0, |edge_s| physics.step_at_or_after(*edge_s));
        series.ends = edges_s.iter().skip(1).map(|edge_s| physics.step_at_or_before(*edge_s)).collect();
        series.sums = vec![vec![[0.0; 2]; series.columns.len() + 1]; series.ends.len()];
        Ok(series)
    }

    pub(crate) fn observe(&mut self, frame: &Frame<'_>) {
        let interval = self.ends.partition_point(|end| *end < frame.step);
        let rows = self.looking.iter_mut().map(|analysis| {
            let mut row = LastRow::default();
            analysis.observe(frame, &mut row);
            row
        });
        let rows: Vec<LastRow> = rows.collect();
        if frame.step < self.first {
            return;
        }
        let Some(sums) = self.sums.get_mut(interval) else { return };
        let value = |(at, way): &(usize, InRow)| {
            let found = match way {
                InRow::Place(place) => rows[*at].values().and_then(|row| row.numbers().get(*place).copied()),
                InRow::Number(name) => {
                    self.looking[*at].value(name, None).and_then(|number| Cell::from(number).number())
                }
            };
            found.unwrap_or(f64::NAN)
        };
        let values = [frame.time_s].into_iter().chain(self.columns.iter().map(value));
        for ([count, sum], value) in sums.iter_mut().zip(values).filter(|(_, value)| value.is_finite()) {
            *count += 1.0;
            *sum += value;
        }
    }

    /// The cells of all intervals: means of the values that there are, empty where there is none.
    pub(crate) fn cells(&self) -> impl Iterator<Item = Cell> {
        let mean = |[count, sum]: &[f64; 2]| Some(sum / count).filter(|mean| mean.is_finite());
        self.sums.iter().flatten().map(move |sums| mean(sums).into())
    }
}

/// The way from rows with all intervals to a line for each: what points share, the time, the rest.
#[derive(Debug, Clone)]
pub struct Lines {
    /// Cells of a row that stand before the time, and those of it and beyond that stand behind.
    head: [usize; 2],
    /// Cells of a row before those of its intervals.
    fixed: usize,
    /// Cells of an interval, and those of them that are about its time.
    width: usize,
    time: usize,
}

impl Lines {
    /// The lines of rows of `sweep`, which have these columns; none where it asks for no column over time.
    pub fn of(sweep: &Sweep, all: &[Column]) -> Option<Self> {
        let (width, parameters) = (names(sweep).len(), sweep.parameters().len());
        let fixed = all.len() - columns(sweep).count();
        (width > 0).then_some(Self { head: [parameters; 2], fixed, width, time: 1 })
    }

    /// The lines of rows in which each number has become `cells` of them, the first of the intervals at `fixed`, behind what they share
    /// and their count.
    pub(crate) fn of_statistics(&self, shared: usize, fixed: usize, cells: usize) -> Self {
        Self { head: [shared, shared + 1], fixed, width: self.width * cells, time: cells }
    }

    /// The cells, or columns, of a row that are not of an interval.
    pub fn fixed<'a, T>(&self, row: &'a [T]) -> &'a [T] {
        &row[..self.fixed]
    }

    /// True if the cell at `place` of a row is not of an interval.
    pub(crate) fn is_fixed(&self, place: usize) -> bool {
        place < self.fixed
    }

    /// The columns of lines, of rows with `columns`.
    pub fn columns(&self, columns: &[Column]) -> Vec<Column> {
        let mut line = self.line(columns, &columns[self.fixed..self.fixed + self.width]);
        for column in &mut line {
            column.name = column.name.strip_suffix("[0]").unwrap_or(&column.name).to_owned();
        }
        line[self.head[0]] = Column::new(TIME, Kind::Double);
        line
    }

    /// The lines of a row: those of intervals with a time.
    pub fn lines(&self, row: &[Cell]) -> impl Iterator<Item = Vec<Cell>> {
        let intervals = row[self.fixed..].chunks(self.width).filter(|cells| cells[0] != Cell::Empty);
        intervals.map(move |cells| self.line(row, cells))
    }

    fn line<T: Clone>(&self, row: &[T], interval: &[T]) -> Vec<T> {
        let [before, head] = self.head;
        [&row[..before], &interval[..1], &row[before..head], &interval[self.time..]].concat()
    }
}
