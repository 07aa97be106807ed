//! The results of a sweep, the same bytes whoever computed its rows in whatever order.

use super::directory::{Directory, ENSEMBLES};
use crate::display::{self, counted};
use crate::failure::Failure;
use anyhow::anyhow;
use consumers::journal::{self, Entry};
use consumers::table::{Cell, Column, Kind, Table, TableError};
use experiments::ERROR_COLUMN;
use experiments::ensemble::EnsembleTable;
use producer::sweep::Sweep;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The existing rows by index, from every journal of the sweep of `point_count` points.
///
/// # Errors
/// When a journal cannot be read, or when a row was computed twice with different results.
pub(super) fn rows(directory: &Directory, point_count: u64) -> Result<BTreeMap<u64, Entry>, Failure> {
    let mut rows: BTreeMap<u64, Entry> = BTreeMap::new();
    for path in directory.journals()? {
        let contents = journal::read(&path, directory.head())?;
        if contents.damaged_count > 0 {
            let (damaged, path) = (counted(contents.damaged_count, "damaged row"), path.display());
            display::notice(format_args!("{path}: left out {damaged}"));
        }
        // this program writes none, but somebody may have edited the file
        let (entries, strangers): (Vec<_>, Vec<_>) =
            contents.entries.into_iter().partition(|entry| entry.index < point_count);
        if let Some(stranger) = strangers.first() {
            let (strangers, path) = (counted(strangers.len() as u64, "row"), path.display());
            display::notice(format_args!(
                "{path}: left out {strangers} of points that the sweep does not have, such as point {}",
                stranger.index
            ));
        }
        for entry in entries {
            match rows.get(&entry.index) {
                Some(found) if !is_same(&found.cells, &entry.cells) => {
                    return Err(Failure::Failed(anyhow!(
                        "point {} was computed twice with different results, once in {}: two programs differ, or a \
                         machine computes wrongly",
                        entry.index,
                        path.display()
                    )));
                }
                Some(_) => {}
                None => {
                    rows.insert(entry.index, entry);
                }
            }
        }
    }
    Ok(rows)
}

/// Whether two rows have the same bits.
fn is_same(a: &[Cell], b: &[Cell]) -> bool {
    let same = |(a, b): (&Cell, &Cell)| match (a, b) {
        (Cell::Double(a), Cell::Double(b)) => a.to_bits() == b.to_bits(),
        (a, b) => a == b,
    };
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// Indices of the rows that say why a point has no results.
pub(super) fn failed(rows: &BTreeMap<u64, Entry>, columns: &[Column]) -> Vec<u64> {
    let error = columns.iter().position(|column| column.name == ERROR_COLUMN);
    let has_error =
        |entry: &&Entry| error.and_then(|i| entry.cells.get(i)).is_some_and(|c| *c != Cell::Empty);
    rows.values().filter(has_error).map(|entry| entry.index).collect()
}

/// Writes the results, their statistics and the timings of `rows`; none if another process is just doing that.
pub(super) fn write(
    sweep: &Sweep,
    directory: &Directory,
    rows: &BTreeMap<u64, Entry>,
) -> Result<Option<Vec<PathBuf>>, Failure> {
    let index = || Column::new("index", Kind::Integer);
    let columns = [vec![index()], directory.head().columns.clone()].concat();
    let timing = [index(), Column::new("wall_s", Kind::Double)];
    let by_index = |cells: fn(&Entry) -> Vec<Cell>| rows.values().map(move |row| (row.index, cells(row)));
    let ensemble = EnsembleTable::new(sweep, &directory.head().columns);
    if ensemble.is_none() {
        directory.remove_ensembles()?;
    }
    let written = || -> Result<Vec<PathBuf>, TableError> {
        let mut paths = Vec::new();
        for name in ["results.csv", "results.parquet"] {
            paths.push(table(&directory.file(name), &columns, by_index(|row| row.cells.clone()))?);
        }
        if let Some(ensemble) = &ensemble {
            let columns = [vec![index()], ensemble.columns()].concat();
            let groups = ensemble.rows(rows.values().map(|row| (row.index, row.cells.as_slice())));
            for name in ENSEMBLES {
                let groups = groups.iter().map(|(group, cells)| (*group, cells.clone()));
                paths.push(table(&directory.file(name), &columns, groups)?);
            }
        }
        let wall = by_index(|row| vec![Cell::Double(row.wall_s)]);
        paths.push(table(&directory.file("timings.csv"), &timing, wall)?);
        Ok(paths)
    };
    match written() {
        Ok(paths) => Ok(Some(paths)),
        Err(TableError::Busy { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

fn table(
    path: &Path,
    columns: &[Column],
    rows: impl Iterator<Item = (u64, Vec<Cell>)>,
) -> Result<PathBuf, TableError> {
    // the existing tables were merged from the same sweep
    let mut table = Table::create(path, columns, true)?;
    for (index, cells) in rows {
        table.integer(index);
        for cell in cells {
            table.cell(cell);
        }
        table.end_row()?;
    }
    table.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Shard;

    #[test]
    fn rows_of_points_that_the_sweep_does_not_have_do_not_count() {
        let text = "[base]\npreset = \"homogeneous\"\n[grid]\nchain.alpha = [1.5, 2.0]\n";
        let sweep = Sweep::from_toml(
            text,
            Path::new("s.toml"),
            |_| Err(std::io::ErrorKind::NotFound.into()),
            |config, _| Ok(config),
        );
        let sweep = sweep.expect("valid");
        let place = tempfile::tempdir().expect("tempdir");
        let directory = Directory::open(place.path(), &sweep, false).expect("empty");
        let mut journal = directory.journal(Shard::WHOLE).expect("ours");
        for index in [7, 1, 2, u64::MAX] {
            let cells = vec![Cell::Empty; directory.head().columns.len()];
            journal.append(&Entry { index, wall_s: 1.0, cells }).expect("disk");
        }
        let rows = rows(&directory, sweep.point_count()).expect("readable");
        assert_eq!(rows.into_keys().collect::<Vec<_>>(), [1]);
    }
}
