//! Files and topics that the rows of an analysis go to.

use super::{AnalysisError, Session};
use crate::args::{AskedAnalysis, keeps_rows};
use crate::display::{count, number};
use crate::failure::Failure;
use crate::outputs::extension;
use bus::{ResultPublisher, ResultsError};
use consumers::analysis::{Analysis, LastRow, Meaning, Number, Offer, Outlet, Report, RowValues, Words};
use consumers::series::Series;
use consumers::table::{Cell, Table};
use figure::{Figure, FigureError};
use recording::{ContactsRow, ContactsWriter, WriteOptions};
use schemas::frame::{EndReason, Frame};
use schemas::manifest::RunManifest;
use serde_json::Value;
use std::path::PathBuf;

/// Takes the rows of one analysis. An error is kept until [`Outputs::check`].
#[derive(Default)]
pub(crate) struct Outputs {
    tables: Vec<Option<Table>>,
    /// Published rows in a file of their own, and their tolerance (m).
    map: Option<(ContactsWriter, f64)>,
    publisher: Option<Publisher>,
    failure: Option<AnalysisError>,
    kept: Kept,
}

/// Published rows that are kept for an analysis that reports and draws nothing of its own.
#[derive(Default)]
pub(crate) struct Kept {
    /// The last row.
    last: LastRow,
    /// A curve for each column, if a figure is drawn.
    curves: Vec<Series<1>>,
}

enum Publisher {
    Numbers(ResultPublisher<f64>),
    Classes(ResultPublisher<u8>),
}

impl Outputs {
    /// Creates the files that `asked` names; `session` is where rows are published, if they are.
    pub(crate) fn open(
        asked: &AskedAnalysis,
        analysis: &dyn Analysis,
        manifest: &RunManifest,
        session: Option<&Session<'_>>,
    ) -> Result<Self, Failure> {
        let force = asked.common.frames.force;
        let mut outputs = Self::default();
        for (index, files) in asked.tables.iter().enumerate() {
            let (rows, lines): (Vec<&PathBuf>, Vec<&PathBuf>) =
                files.iter().partition(|path| keeps_rows(asked.offer, index) && extension(path) == "mcap");
            let columns = asked.offer.columns_of(analysis, index);
            let table = lines.first().map(|path| Table::create(path, &columns, force));
            outputs.tables.push(table.transpose()?);
            if let Some(path) = rows.first() {
                let options = WriteOptions { force, ..WriteOptions::default() };
                let tolerance_m = analysis.published().and_then(|columns| columns.tolerance_m);
                let map = ContactsWriter::create(path, manifest, &options)?;
                outputs.map = Some((map, tolerance_m.unwrap_or(f64::NAN)));
            }
        }
        let published = asked.offer.published(analysis);
        if let Some(columns) = published.as_ref().filter(|columns| columns.tolerance_m.is_none()) {
            let drawn = if asked.common.figure.is_empty() { 0 } else { columns.width };
            outputs.kept.curves = vec![Series::default(); drawn];
        }
        if let Some((session, columns)) = session.zip(published) {
            outputs.publisher = match columns.tolerance_m {
                Some(_) => session.results(asked.offer, &columns)?.map(Publisher::Classes),
                None => session.results(asked.offer, &columns)?.map(Publisher::Numbers),
            };
        }
        Ok(outputs)
    }

    /// The first error since the last look.
    pub(crate) fn check(&mut self) -> Result<(), AnalysisError> {
        self.failure.take().map_or(Ok(()), Err)
    }

    fn keep<E: Into<AnalysisError>>(&mut self, done: Result<(), E>) {
        if let Err(error) = done {
            self.failure.get_or_insert_with(|| error.into());
        }
    }

    /// Ends everything; `end` says how the frames ended, and `missed` which was the last one that did not arrive. Gives the
    /// rows that were kept.
    pub(crate) fn finish(mut self, end: EndReason, missed: Option<u64>) -> Result<Kept, Failure> {
        self.check()?;
        unless_stopped(match self.publisher {
            Some(Publisher::Numbers(publisher)) => publisher.finish_short_of(missed),
            Some(Publisher::Classes(publisher)) => publisher.finish_short_of(missed),
            None => Ok(()),
        })?;
        self.tables.into_iter().flatten().try_for_each(|table| table.finish().map(drop))?;
        self.map.map(|(map, _)| map.finish(end)).transpose()?;
        Ok(self.kept)
    }
}

impl Kept {
    /// The report of `analysis`, or the numbers of its summary.
    pub(crate) fn report(&self, offer: &'static Offer, analysis: &mut dyn Analysis) -> Report {
        if let Some(report) = analysis.report() {
            return report;
        }
        let (mut words, mut results) = (Words::default(), serde_json::Map::new());
        for Meaning { name, .. } in offer.numbers() {
            let (text, value) = match self.last.value(offer, analysis, name, None) {
                Some(Number::Count(value)) => (count(value).to_string(), value.into()),
                Some(Number::Double(value)) if value.is_finite() => (number(value), value.into()),
                _ => (String::new(), Value::Null),
            };
            if !value.is_null() {
                words.add(*name, text);
            }
            results.insert((*name).to_owned(), value);
        }
        Report { title: offer.name, words, results: results.into(), ..Report::default() }
    }

    /// The figure of `analysis`, or its columns over time.
    pub(crate) fn figure(
        &self,
        manifest: &RunManifest,
        offer: &'static Offer,
        analysis: &mut dyn Analysis,
    ) -> Result<Figure, FigureError> {
        if let Some(figure) = analysis.figure()? {
            return Ok(figure);
        }
        let names = offer.published(analysis).map(|published| published.names).unwrap_or_default();
        Ok(plots::columns_over_time(manifest, names.split(','), &self.curves))
    }
}

impl Outlet for Outputs {
    fn wants(&self, table: usize) -> bool {
        self.tables.get(table).is_some_and(Option::is_some)
    }

    fn line(&mut self, table: usize, cells: &[Cell]) {
        let Some(Some(file)) = self.tables.get_mut(table) else { return };
        let done = file.add_row(cells);
        self.keep(done);
    }

    fn is_published(&self) -> bool {
        self.publisher.is_some()
    }

    fn publish(&mut self, frame: &Frame<'_>, row: RowValues<'_>) {
        let (number, step, time_s) = (frame.frame, frame.step, frame.time_s);
        let done = match (&mut self.publisher, row) {
            (Some(Publisher::Numbers(to)), RowValues::Numbers(row)) => to.publish(number, step, time_s, row),
            (Some(Publisher::Classes(to)), RowValues::Classes(row)) => to.publish(number, step, time_s, row),
            _ => Ok(()),
        };
        self.keep(unless_stopped(done));
        if let RowValues::Numbers(numbers) = row {
            self.kept.last.take(row);
            for (curve, value) in self.kept.curves.iter_mut().zip(numbers) {
                curve.push(time_s, [*value]);
            }
        }
        if let (Some((map, tolerance_m)), RowValues::Classes(classes)) = (&mut self.map, row) {
            let row = ContactsRow { frame: number, step, time_s, tolerance_m: *tolerance_m, classes };
            let done = map.write(&row);
            self.keep(done);
        }
    }
}

/// A stop that comes while rows are published is no error.
fn unless_stopped(done: Result<(), ResultsError>) -> Result<(), ResultsError> {
    match done {
        Err(ResultsError::Stopped { .. }) => Ok(()),
        done => done,
    }
}
