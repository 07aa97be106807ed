//! A sweep in a directory: rows computed by any number of threads, processes and machines, and merged.
//!
//! - [`experiments::row`]: one point, a pure function of the sweep file and an index
//! - [`directory`]: what is where
//! - [`pending`]: what is left to compute
//! - [`plan`]: what all of it will take
//! - [`mod@work`]: the workers of one process
//! - [`mod@merge`], [`sorted`]: the results, the same bytes whoever computed them in whatever order
//! - [`slurm`], [`status`]: the job array of a sweep, and how far it is

mod directory;
mod merge;
mod pending;
pub(crate) mod plan;
pub(crate) mod slurm;
mod sorted;
pub(crate) mod status;
mod work;

use crate::args::Shard;
use crate::configuration::origin;
use crate::display::{self, count, counted};
use crate::failure::Failure;
use crate::forecast::Forecast;
use crate::links::check_inside;
use crate::threads;
use anyhow::anyhow;
use consumers::journal::{self, Entry};
use consumers::table::Cell;
use directory::Directory;
use experiments::parameter_cell;
use experiments::series::Lines;
use pending::{Guess, Pending, Points};
use producer::sweep::{Sweep, Until};
use recording::{SpaceNeeded, WriteOptions};
use schemas::manifest::RunManifest;
use serde::Serialize;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use work::{Tally, work};

/// Names of the tables of a sweep: rows and statistics, as they are and over time.
pub(crate) const TABLES: [[&str; 2]; 2] = [directory::RESULTS, directory::ENSEMBLES];

/// Most points that are recorded: each is a file.
const MOST_RECORDED: u64 = 10_000;

/// Bytes of journals that every shard reads at its end, to merge them if all rows are there.
const READ_BY_ALL: u64 = 1 << 28;

/// Options of computing a sweep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Options {
    /// Points computed at the same time.
    pub(crate) threads: usize,
    /// The points to compute.
    pub(crate) shard: Shard,
    /// True if each point is recorded.
    pub(crate) record: bool,
    /// True if the files of another sweep in the directory are removed.
    pub(crate) force: bool,
    /// True if it begins without a question, however long it takes.
    pub(crate) yes: bool,
}

impl Default for Options {
    /// Every point, on all cores, not recorded, without a question.
    fn default() -> Self {
        let threads = threads::or_cores(None).get();
        Self { threads, shard: Shard::WHOLE, record: false, force: false, yes: true }
    }
}

/// State of a sweep.
#[derive(Debug, Serialize)]
pub(crate) struct Outcome {
    /// Number of rows; of a stopped sweep, or one whose other shards were not looked at, the rows that this process
    /// knows.
    pub(crate) rows: u64,
    /// Points whose runs failed: their rows say why. The first thousand.
    pub(crate) failed: Vec<u64>,
    /// Number of failed points.
    pub(crate) failed_count: u64,
    /// Points that have no row, as far as is known.
    pub(crate) missing: u64,
    /// True if rows of other shards were looked for.
    #[serde(skip)]
    pub(crate) all_seen: bool,
    /// Points without a row that should have been computed.
    #[serde(skip)]
    pub(crate) left: u64,
    /// Work of this process.
    #[serde(flatten)]
    pub(crate) tally: Tally,
    /// The merged tables; none while rows are missing, or if another process is just writing them.
    #[serde(rename = "results")]
    pub(crate) files: Option<Vec<String>>,
}

/// A point for the page.
#[derive(Debug)]
pub(crate) struct Shown {
    /// The point.
    pub(crate) index: u64,
    /// Its parameters and, once it has a row, its results, by the names of their columns.
    pub(crate) values: Map<String, Value>,
    /// Path of its recording.
    pub(crate) recording: Option<PathBuf>,
}

/// Computes the points of `sweep` that have no row in the directory `out`, and merges the results when all
/// have one.
///
/// # Errors
/// When the directory belongs to something else or to another process, or when rows or recordings cannot be
/// written.
pub(crate) fn compute(
    sweep: &Sweep,
    out: &Path,
    options: &Options,
    stop: &AtomicBool,
) -> Result<Outcome, Failure> {
    let points = sweep.point_count();
    if options.record && points > MOST_RECORDED {
        return Err(Failure::BadInput(anyhow!(
            "a recording is a file for each of {}, at most {} are recorded; sweep without recordings, and record the points \
             that matter in a sweep of their own, with the same values: a run has the same bits wherever it is computed",
            counted(points, "point"),
            count(MOST_RECORDED)
        )));
    }
    let directory = Directory::open(out, sweep, options.force)?;
    let mut rows = Points::none_of(points);
    let journal = directory.journal(options.shard, |index| rows.add(index))?;
    for path in directory.journals_beside(options.shard)? {
        journal::read(&path, directory.head(), |index, _| {
            rows.add(index);
            Ok::<_, Failure>(())
        })?;
    }
    let pending =
        Pending { directory: &directory, rows: &rows, shard: options.shard, record: options.record };
    let guess = Guess::of(sweep, pending.indices().count() as u64, pending.indices());
    work::announce(sweep, guess.count, options.shard);
    if options.record {
        directory.make_recordings()?;
        check_space(sweep, &pending)?;
    }
    forecast(sweep, &guess, options)?;
    let tally = work((sweep, &directory), (&pending, &guess), options, &journal, stop)?;
    let left = guess.count - tally.computed;
    drop(journal);
    let is_whole = options.shard == Shard::WHOLE;
    // a process that is told to stop has no time, and of many shards not each reads what all have written
    let is_stopped = left > 0 && stop.load(Ordering::Relaxed);
    let all_seen = !is_stopped && (is_whole || directory.journal_bytes()? <= READ_BY_ALL);
    let present = all_seen.then(|| merge::present(&directory, points)).transpose()?;
    let is_lost = match &present {
        Some(rows) => Pending { rows, record: false, ..pending }.indices().count() as u64 > left,
        None => !directory.journal_path(options.shard).exists(),
    };
    if is_lost {
        return Err(Failure::Failed(anyhow!(
            "{} was moved or deleted while it was being written, and its rows are not there: put it back where it was; without \
             it, the same command computes its points again",
            directory.journal_path(options.shard).display()
        )));
    }
    let Some(present) = present else {
        let known = rows.count() + tally.added;
        return Ok(Outcome {
            rows: known,
            failed: tally.failed.first.clone(),
            failed_count: tally.failed.count,
            missing: points - known,
            all_seen: is_whole,
            left,
            tally,
            files: None,
        });
    };
    outcome(sweep, &directory, tally, left, present.count() == points)
}

/// Tells how long the points take, if that is long, and asks.
fn forecast(sweep: &Sweep, guess: &Guess, options: &Options) -> Result<(), Failure> {
    let (Some(physics), Until::End) = (&guess.like, sweep.until()) else { return Ok(()) };
    let bead_steps = guess.count as f64 * guess.cost as f64;
    let threads = options.threads.min(usize::try_from(guess.count).unwrap_or(usize::MAX));
    Forecast::of_many(physics, bead_steps, threads).confirm(options.yes)
}

/// Merges the existing rows in the directory `out` of `sweep`, complete or not.
///
/// # Errors
/// When the directory is not one of this sweep, or the results cannot be written.
pub(crate) fn merge(sweep: &Sweep, out: &Path) -> Result<Outcome, Failure> {
    let directory = Directory::existing(out, sweep)?;
    outcome(sweep, &directory, Tally::default(), 0, true)
}

/// Tells `take` each existing row in the directory `out` of `sweep`, in the order of the points.
///
/// # Errors
/// When the directory is not one of this sweep, its rows cannot be read, or `take` fails.
pub(crate) fn each_row(
    sweep: &Sweep,
    out: &Path,
    mut take: impl FnMut(&Entry) -> Result<(), Failure>,
) -> Result<(), Failure> {
    merge::rows(&Directory::existing(out, sweep)?, sweep, |row, _| take(row))
}

/// The sweep file in the directory of a sweep; none in other directories.
pub(crate) fn file_in(out: &Path) -> Option<PathBuf> {
    directory::sweep_file(out)
}

/// The first points of `sweep` in its directory `out`, at most `most` of them.
///
/// # Errors
/// When the directory is not one of this sweep, or its rows cannot be read or are somewhere else.
pub(crate) fn shown(sweep: &Sweep, out: &Path, most: usize) -> Result<Vec<Shown>, Failure> {
    let directory = Directory::existing(out, sweep)?;
    let columns = &directory.head().columns;
    let lines = Lines::of(sweep, columns);
    let named = lines.as_ref().map_or(columns.as_slice(), |lines| lines.fixed(columns));
    let mut rows: BTreeMap<u64, Entry> = BTreeMap::new();
    for path in directory.journals()? {
        check_inside(&path, out)?;
        journal::read(&path, directory.head(), |index, json| {
            if index < most as u64 {
                rows.extend(journal::entry(json, columns).map(|row| (index, row)));
            }
            Ok::<_, Failure>(())
        })?;
    }
    let value = |cell: Cell| match cell {
        Cell::Empty => Value::Null,
        Cell::Integer(value) => value.into(),
        Cell::Double(value) => value.into(),
        Cell::Word(word) => word.into(),
    };
    let point = |index: u64| -> Result<Shown, Failure> {
        let parameters = sweep.parameters_of(index)?;
        let cells = rows.get(&index).map(|row| row.cells.as_slice()).unwrap_or_default();
        let results = cells.iter().skip(parameters.len()).cloned();
        let cells = parameters.iter().map(|parameter| parameter_cell(parameter.as_ref())).chain(results);
        let values = named.iter().map(|column| column.name.clone()).zip(cells.map(value)).collect();
        let recording = Some(directory.recording(index)).filter(|path| path.is_file());
        Ok(Shown { index, values, recording })
    };
    (0..sweep.point_count()).take(most).map(point).collect()
}

fn outcome(
    sweep: &Sweep,
    directory: &Directory,
    tally: Tally,
    left: u64,
    write: bool,
) -> Result<Outcome, Failure> {
    let merged = merge::merge(sweep, directory, write)?;
    Ok(Outcome {
        rows: merged.rows,
        failed: merged.failed.first,
        failed_count: merged.failed.count,
        missing: sweep.point_count() - merged.rows,
        all_seen: true,
        left,
        tally,
        files: merged.files.as_deref().map(display::texts_of),
    })
}

/// Refuses recordings that cannot all fit on their disk. The size of points that end early is unknown.
fn check_space(sweep: &Sweep, pending: &Pending<'_>) -> Result<(), Failure> {
    if sweep.until() == Until::Stationary {
        return Ok(());
    }
    let mut needed = SpaceNeeded { at_most_bytes: 0, at_least_bytes: 0 };
    for index in pending.indices() {
        let point = sweep.point(index)?;
        let manifest = RunManifest::of(point.physics, &point.config, "point", origin())?;
        let point = SpaceNeeded::new(&manifest, WriteOptions::default().compression);
        needed.at_most_bytes = needed.at_most_bytes.saturating_add(point.at_most_bytes);
        needed.at_least_bytes = needed.at_least_bytes.saturating_add(point.at_least_bytes);
    }
    needed.check(&pending.directory.recording(0))?;
    Ok(())
}
