//! The results of a sweep: the same bytes for any workers and any order of its rows.

use super::directory::{Directory, ENSEMBLES, FORMATS, RESULTS};
use super::pending::Points;
use super::sorted::Sorter;
use crate::display::{self, counted};
use crate::failure::Failure;
use anyhow::anyhow;
use consumers::journal::{self, Entry};
use consumers::table::{Cell, Column, Kind, Table, TableError};
use experiments::ensemble::EnsembleTable;
use experiments::series::Lines;
use experiments::{ERROR_COLUMN, parameter_cell};
use producer::sweep::Sweep;
use std::path::PathBuf;

/// Most failed points that are named.
const MOST_NAMED: usize = 1000;

/// The rows that there are.
#[derive(Debug, Default)]
pub(super) struct Merged {
    pub(super) rows: u64,
    pub(super) failed: Failed,
    /// The tables; none if none were to be written, or if another process is just doing that.
    pub(super) files: Option<Vec<PathBuf>>,
}

/// Points whose rows say why they have no results.
#[derive(Debug, Default)]
pub(super) struct Failed {
    /// The first of them.
    pub(super) first: Vec<u64>,
    pub(super) count: u64,
}

impl Failed {
    pub(super) fn add(&mut self, index: u64) {
        self.count += 1;
        if self.first.len() < MOST_NAMED {
            self.first.push(index);
        }
    }
}

/// Points that have a row.
///
/// # Errors
/// When a journal cannot be read.
pub(super) fn present(directory: &Directory, point_count: u64) -> Result<Points, Failure> {
    let mut points = Points::none_of(point_count);
    for path in directory.journals()? {
        journal::read(&path, directory.head(), |index, _| {
            points.add(index);
            Ok::<_, Failure>(())
        })?;
    }
    Ok(points)
}

/// Tells `take` each existing row of `sweep`, also as JSON, in their order, from every journal.
///
/// # Errors
/// When a journal cannot be read, when a row is not of its point or was computed twice with different results, or when `take` fails.
pub(super) fn rows(
    directory: &Directory,
    sweep: &Sweep,
    mut take: impl FnMut(&Entry, &[u8]) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut sorter = Sorter::new(directory.file(""));
    for path in directory.journals()? {
        // this program writes none, but somebody may have edited the file
        let (mut strangers, mut stranger) = (0, 0);
        let damaged = journal::read(&path, directory.head(), |index, json| {
            if index < sweep.point_count() {
                sorter.push(index, json)?;
            } else {
                (strangers, stranger) = (strangers + 1, index);
            }
            Ok::<_, Failure>(())
        })?;
        let path = path.display();
        if damaged > 0 {
            let damaged = counted(damaged, "damaged row");
            display::notice(format_args!("{path}: left out {damaged}"));
        }
        if strangers > 0 {
            let strangers = counted(strangers, "row");
            display::notice(format_args!(
                "{path}: left out {strangers} of points that the sweep does not have, such as point {stranger}"
            ));
        }
    }
    let mut sorted = sorter.finish()?;
    let mut found: Option<(Entry, Box<[u8]>)> = None;
    while let Some((index, json)) = sorted.next()? {
        let parameters = sweep.parameters_of(index)?;
        let cells = parameters.iter().map(|parameter| parameter_cell(parameter.as_ref()));
        let is_of_point = |entry: &Entry| cells.zip(&entry.cells).all(|(cell, found)| is_same(&cell, found));
        let entry = journal::entry(&json, &directory.head().columns).filter(is_of_point).ok_or_else(|| {
            anyhow!(
                "{}: the row of point {index} has values of other kinds than its columns, or of another point; delete its \
                 line, and the sweep computes it again",
                directory.rows().display()
            )
        })?;
        match &found {
            Some((found, _)) if found.index == index => same(found, &entry, directory)?,
            _ => {
                if let Some((whole, json)) = found.replace((entry, json)) {
                    take(&whole, &json)?;
                }
            }
        }
    }
    found.map_or(Ok(()), |(last, json)| take(&last, &json))
}

/// Refuses two rows of one point that differ in a bit.
fn same(a: &Entry, b: &Entry, directory: &Directory) -> Result<(), Failure> {
    if a.cells.len() == b.cells.len() && a.cells.iter().zip(&b.cells).all(|(a, b)| is_same(a, b)) {
        return Ok(());
    }
    Err(Failure::Failed(anyhow!(
        "point {} was computed twice with different results, which are in {}: two programs differ, or a machine computes wrongly",
        a.index,
        directory.rows().display()
    )))
}

fn is_same(a: &Cell, b: &Cell) -> bool {
    match (a, b) {
        (Cell::Double(a), Cell::Double(b)) => a.to_bits() == b.to_bits(),
        (a, b) => a == b,
    }
}

/// Goes through the existing rows, and writes the results, their statistics and the timings if `write` says so.
///
/// # Errors
/// As [`rows`], and when a table cannot be written.
pub(super) fn merge(sweep: &Sweep, directory: &Directory, write: bool) -> Result<Merged, Failure> {
    let error = directory.head().columns.iter().position(|column| column.name == ERROR_COLUMN);
    let mut merged = Merged::default();
    let mut tables = match write.then(|| Tables::create(sweep, directory)).transpose() {
        Ok(tables) => tables,
        Err(TableError::Busy { .. }) => None,
        Err(error) => return Err(error.into()),
    };
    rows(directory, sweep, |entry, json| {
        merged.rows += 1;
        if error.and_then(|place| entry.cells.get(place)).is_some_and(|cell| *cell != Cell::Empty) {
            merged.failed.add(entry.index);
        }
        tables.as_mut().map_or(Ok(()), |tables| tables.add(entry, json))
    })?;
    merged.files = tables.map(|tables| tables.finish(directory)).transpose()?;
    Ok(merged)
}

/// The tables of a sweep, to which rows are added in their order.
struct Tables<'a> {
    results: Wide,
    timings: Table,
    ensemble: Option<EnsembleTables<'a>>,
}

struct EnsembleTables<'a> {
    rows: EnsembleTable<'a>,
    tables: Wide,
    /// Rows that have to come in another order.
    by_group: Option<Sorter>,
}

/// A table of rows in each format, and that of their lines over time.
struct Wide {
    rows: Vec<Table>,
    series: Option<(Lines, Vec<Table>)>,
}

impl Wide {
    /// Creates the tables of rows with `columns`, and of their `lines`, under these names.
    fn create(
        names: [&str; 2],
        columns: &[Column],
        lines: Option<Lines>,
        directory: &Directory,
    ) -> Result<Self, TableError> {
        let create = |name: &str, columns: &[Column]| -> Result<Vec<Table>, TableError> {
            let columns = [&[Column::new("index", Kind::Integer)], columns].concat();
            let file = |format: &str| directory.file(&format!("{name}.{format}"));
            // the existing tables were merged from the same sweep
            FORMATS.iter().map(|format| Table::create(&file(format), &columns, true)).collect()
        };
        let fixed = lines.as_ref().map_or(columns, |lines| lines.fixed(columns));
        let rows = create(names[0], fixed)?;
        let series = lines.map(|lines| {
            let tables = create(names[1], &lines.columns(columns))?;
            Ok((lines, tables))
        });
        Ok(Self { rows, series: series.transpose()? })
    }

    fn add(&mut self, index: u64, cells: &[Cell]) -> Result<(), Failure> {
        let Self { rows, series } = self;
        let fixed = series.as_ref().map_or(cells, |(lines, _)| lines.fixed(cells));
        rows.iter_mut().try_for_each(|table| add(table, index, fixed))?;
        if let Some((lines, tables)) = series {
            for line in lines.lines(cells) {
                tables.iter_mut().try_for_each(|table| add(table, index, &line))?;
            }
        }
        Ok(())
    }

    fn tables(self) -> impl Iterator<Item = Table> {
        self.rows.into_iter().chain(self.series.into_iter().flat_map(|(_, tables)| tables))
    }
}

impl<'a> Tables<'a> {
    fn create(sweep: &Sweep, directory: &'a Directory) -> Result<Self, TableError> {
        let columns = &directory.head().columns;
        let lines = Lines::of(sweep, columns);
        let ensemble = EnsembleTable::new(sweep, columns).map(|rows| -> Result<_, TableError> {
            let lines = lines.as_ref().map(|lines| rows.lines(lines));
            let tables = Wide::create(ENSEMBLES, &rows.columns(), lines, directory)?;
            let by_group = rows.is_by_group().then(|| Sorter::new(directory.file("")));
            Ok(EnsembleTables { rows, tables, by_group })
        });
        let ensemble = ensemble.transpose()?;
        let timings = [("index", Kind::Integer), ("wall_s", Kind::Double)];
        let timings = timings.map(|(name, kind)| Column::new(name, kind));
        Ok(Self {
            results: Wide::create(RESULTS, columns, lines, directory)?,
            timings: Table::create(&directory.file("timings.csv"), &timings, true)?,
            ensemble,
        })
    }

    fn add(&mut self, entry: &Entry, json: &[u8]) -> Result<(), Failure> {
        self.results.add(entry.index, &entry.cells)?;
        add(&mut self.timings, entry.index, &[Cell::Double(entry.wall_s)])?;
        match &mut self.ensemble {
            Some(EnsembleTables { rows, by_group: Some(sorter), .. }) => {
                Ok(sorter.push(rows.group(entry.index), json)?)
            }
            Some(ensemble) => ensemble.add(entry),
            None => Ok(()),
        }
    }

    /// The tables, in the order in which they are told. Those that an earlier form of the sweep file asked for are removed.
    fn finish(self, directory: &Directory) -> Result<Vec<PathBuf>, Failure> {
        let Self { results, timings, ensemble } = self;
        if results.series.is_none() {
            [RESULTS[1], ENSEMBLES[1]].iter().try_for_each(|name| directory.remove_table(name))?;
        }
        if ensemble.is_none() {
            ENSEMBLES.iter().try_for_each(|name| directory.remove_table(name))?;
        }
        let columns = &directory.head().columns;
        let ensemble = ensemble.map(|ensemble| ensemble.finish(columns)).transpose()?;
        let tables = results.tables().chain(ensemble.into_iter().flat_map(Wide::tables)).chain([timings]);
        Ok(tables.map(Table::finish).collect::<Result<_, TableError>>()?)
    }
}

impl EnsembleTables<'_> {
    fn add(&mut self, entry: &Entry) -> Result<(), Failure> {
        let groups = self.rows.take(entry.index, &entry.cells);
        self.write(&groups)
    }

    fn write(&mut self, groups: &[(u64, Vec<Cell>)]) -> Result<(), Failure> {
        groups.iter().try_for_each(|(group, cells)| self.tables.add(*group, cells))
    }

    fn finish(mut self, columns: &[Column]) -> Result<Wide, Failure> {
        if let Some(mut sorted) = self.by_group.take().map(Sorter::finish).transpose()? {
            while let Some((_, json)) = sorted.next()? {
                // it was read before
                journal::entry(&json, columns).map_or(Ok(()), |entry| self.add(&entry))?;
            }
        }
        let rest = self.rows.rest();
        self.write(&rest)?;
        Ok(self.tables)
    }
}

/// Adds a row to a table.
pub(super) fn add(table: &mut Table, index: u64, cells: &[Cell]) -> Result<(), Failure> {
    Ok(table.integer(index).add_row(cells)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Shard;
    use producer::sweep::Hooks;
    use std::path::Path;

    /// The sweep of so many points in a directory, and the indices of its rows after some were written.
    fn found(text: &str, written: &[u64], alpha: f64) -> Result<Vec<u64>, Failure> {
        let no_files = |_: &Path| Err(std::io::ErrorKind::NotFound.into());
        let sweep = Sweep::from_toml(text, Path::new("s.toml"), no_files, Hooks::NONE).expect("valid");
        let place = tempfile::tempdir().expect("tempdir");
        let directory = Directory::open(place.path(), &sweep, false).expect("empty");
        let journal = directory.journal(Shard::WHOLE, |_| ()).expect("ours");
        for index in written {
            let mut cells = vec![Cell::Empty; directory.head().columns.len()];
            cells[0] = Cell::Double(alpha);
            journal.append(&Entry { index: *index, wall_s: 1.0, cells }).expect("disk");
        }
        let mut found = Vec::new();
        rows(&directory, &sweep, |row, _| {
            found.push(row.index);
            Ok(())
        })?;
        assert_eq!(present(&directory, sweep.point_count())?.count(), found.len() as u64);
        Ok(found)
    }

    #[test]
    fn rows_of_points_that_the_sweep_does_not_have_do_not_count() {
        let text = "[base]\npreset = \"homogeneous\"\n[grid]\nchain.alpha = [1.5, 2.0]\n";
        assert_eq!(found(text, &[7, 1, 2, u64::MAX, 1], 2.0).expect("readable"), [1]);
        // the value of point 0 in the row of point 1
        assert!(found(text, &[1], 1.5).is_err());
    }
}
