//! A map of stability: orbits at all points of a grid, line by line.

use super::{JournalHead, Place, failure};
use crate::display::{count, counted};
use crate::failure::{BadInput, Done, Failure};
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use crate::threads;
use anyhow::Error;
use consumers::journal::{self, Entry, Journal, JournalError};
use consumers::table::{Cell, Table};
use experiments::pool::{self, Told};
use orbits::file::Grid;
use orbits::{MapError, NoOrbit, shown};
use serde_json::json;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The journal of a map.
pub(super) const JOURNAL: &str = "map.journal";

/// Looks for the orbits of all lines that the journal does not have yet, and writes the results.
pub(super) fn map(place: &Place<'_>, grid: &Grid, stop: &AtomicBool) -> Result<Done, Failure> {
    let identity = concat!("map of orbits, beadline ", env!("CARGO_PKG_VERSION")).to_owned();
    let head = JournalHead { identity, columns: shown::map_columns(&grid.keys) };
    let along = grid.values[1].len();
    let mut rows = come(place, &head)?;
    let is_whole = |line: &usize| (0..along).all(|point| rows.contains_key(&(line * along + point)));
    let open: Vec<usize> = (0..grid.values[0].len()).filter(|line| !is_whole(line)).collect();
    place.make()?;
    let journal = Journal::open(&place.path(JOURNAL), &head, |_| ())?;
    signals::would_leave(format!(
        "whole lines of the map are kept in {}, the same command goes on",
        place.out.display()
    ));
    let threads = threads::or_cores(place.args.jobs).get().min(open.len());
    let mut progress = Progress::new(grid.points() as u64, "map");
    let done = AtomicU64::new((grid.points() - open.len() * along) as u64);
    let mut failed = None;
    let work = |_: usize, line: usize| match grid.rows(line, stop, || {
        done.fetch_add(1, Ordering::Relaxed);
    }) {
        Ok(rows) => Ok(Some(rows)),
        Err(NoOrbit::Map(MapError::Stopped)) => Ok(None),
        Err(why) => Err(Error::from(why)),
    };
    pool::share(open.iter().copied(), threads, stop, work, |told| {
        if let Told::Done(line, found) = told {
            for (point, cells) in found.into_iter().enumerate() {
                let index = line * along + point;
                let entry = Entry { index: index as u64, wall_s: 0.0, cells };
                failed = failed.take().or(journal.append(&entry).err());
                rows.insert(index, entry.cells);
            }
            if failed.is_some() {
                stop.store(true, Ordering::Relaxed);
            }
        }
        if progress.at(done.load(Ordering::Relaxed)) {
            progress.tell(&[&counted(done.load(Ordering::Relaxed), "point")]);
        }
    })?;
    progress.finish();
    failed.map_or(Ok(()), Err)?;
    journal.sync()?;
    if rows.len() < grid.points() {
        return Err(failure(MapError::Stopped.into()));
    }
    finish(place, grid, &rows.into_values().collect::<Vec<_>>(), &head)
}

/// The rows that the journal has, by the numbers of their points.
fn come(place: &Place<'_>, head: &JournalHead) -> Result<BTreeMap<usize, Vec<Cell>>, Failure> {
    let path = place.path(JOURNAL);
    let mut rows = BTreeMap::new();
    if !place.args.force && path.exists() {
        journal::read::<JournalError>(&path, head, |index, line| {
            if let (Some(Entry { cells, .. }), Ok(index)) =
                (journal::entry(line, &head.columns), index.try_into())
            {
                rows.insert(index, cells);
            }
            Ok(())
        })
        .bad_input()?;
    }
    Ok(rows)
}

/// Writes the results of the map.
fn finish(place: &Place<'_>, grid: &Grid, rows: &[Vec<Cell>], head: &JournalHead) -> Result<Done, Failure> {
    let mut table = Table::create(&place.path("map.csv"), &head.columns, true)?;
    let mut kinds = BTreeMap::new();
    for row in rows {
        *kinds.entry(shown::stability(row).to_owned()).or_insert(0_u64) += 1;
        table.add_row(row)?;
    }
    table.finish()?;
    let [across, along] = &grid.keys;
    let caption = format!("map of stability, {}", counted(rows.len() as u64, "point"));
    place.draw("map.png", &shown::map(caption, &grid.keys, &grid.values, rows)?)?;
    let told = json!({ "keys": grid.keys, "points": rows.len(), "stability": kinds });
    place.write_report(&told)?;
    report(place.args.json, &told, || {
        let mut listed = Rows::default();
        listed.each("points", kinds.iter().map(|(name, points)| format!("{}: {name}", count(*points))));
        listed.each("results", place.results(&["map.csv", "map.png", super::REPORT]));
        listed.under(format_args!("map over {across} and {along}, {}", counted(rows.len() as u64, "point")))
    })?;
    let of_missed = kinds.iter().filter(|(name, _)| name.starts_with(shown::NOT_FOUND));
    let missed: u64 = of_missed.map(|(_, points)| points).sum();
    if missed > 0 {
        notice!(
            "no orbit was found at {}: beyond folds there may be none; finer steps along {along}, more steps of a period (orbit.steps) or parts of it (orbit.segments) help elsewhere",
            counted(missed, "point")
        );
    }
    Ok(Done::whole_if(missed == 0))
}
