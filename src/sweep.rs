//! A sweep in a directory: rows computed by any number of threads, processes and machines, and merged.
//!
//! - [`experiments::row`]: one point, a pure function of the sweep file and an index
//! - [`directory`]: what is where
//! - [`mod@work`]: the workers of one process
//! - [`mod@merge`]: the results, the same bytes whoever computed them in whatever order

mod directory;
mod merge;
mod work;

use crate::args::Shard;
use crate::configuration::origin;
use crate::failure::Failure;
use crate::forecast::Forecast;
use consumers::journal::Entry;
use consumers::table::Cell;
use directory::Directory;
use producer::sweep::{ParameterValue, Sweep, Until};
use recording::{SpaceNeeded, WriteOptions};
use schemas::manifest::{Physics, RunManifest};
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use work::{Job, Tally, work};

/// How a sweep is to be computed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Options {
    /// Points computed at the same time.
    pub(crate) threads: usize,
    /// The points to compute.
    pub(crate) shard: Shard,
    /// Whether each point is recorded.
    pub(crate) record: bool,
    /// Whether the files of another sweep in the directory are removed.
    pub(crate) force: bool,
    /// Whether it begins without a question, however long it takes.
    pub(crate) yes: bool,
}

impl Default for Options {
    /// Every point, on all cores, not recorded, without a question.
    fn default() -> Self {
        let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
        Self { threads, shard: Shard::WHOLE, record: false, force: false, yes: true }
    }
}

/// What there is of a sweep.
#[derive(Debug, Serialize)]
pub(crate) struct Outcome {
    /// The rows, by index.
    #[serde(serialize_with = "as_count")]
    pub(crate) rows: BTreeMap<u64, Entry>,
    /// Points whose runs failed: their rows say why.
    pub(crate) failed: Vec<u64>,
    /// Points that have no row.
    pub(crate) missing: u64,
    /// Points without a row that should have been computed.
    #[serde(skip)]
    pub(crate) left: u64,
    /// What was computed now.
    #[serde(flatten)]
    pub(crate) tally: Tally,
    /// The merged tables; none while rows are missing, or if another process is just writing them.
    #[serde(rename = "results")]
    pub(crate) files: Option<Vec<PathBuf>>,
}

/// A point for who looks at a sweep.
#[derive(Debug)]
pub(crate) struct Shown {
    /// Which point.
    pub(crate) index: u64,
    /// Its parameters and, once it has a row, its results, by the names of their columns.
    pub(crate) values: Map<String, Value>,
    /// Where it was recorded.
    pub(crate) recording: Option<PathBuf>,
}

fn as_count<S: Serializer>(rows: &BTreeMap<u64, Entry>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(rows.len() as u64)
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
    let directory = Directory::open(out, sweep, options.force)?;
    let journal = directory.journal(options.shard)?;
    let jobs = pending(sweep, &directory, options)?;
    work::announce(sweep, &jobs, options.shard);
    if options.record {
        directory.make_recordings()?;
        check_space(sweep, &directory, &jobs)?;
    }
    if let (Some(job), Until::End) = (jobs.first(), sweep.until()) {
        let physics = Physics::resolve(&sweep.point(job.index)?.config)?;
        let bead_steps = jobs.iter().map(|job| job.cost() as f64).sum();
        Forecast::of_many(&physics, bead_steps, options.threads.min(jobs.len())).confirm(options.yes)?;
    }
    let tally = work((sweep, &directory), &jobs, options, journal, stop)?;
    let left = jobs.len() as u64 - tally.computed;
    outcome(sweep, &directory, tally, left, false)
}

/// Merges the existing rows in the directory `out` of `sweep`, complete or not.
///
/// # Errors
/// When the directory is not one of this sweep, or the results cannot be written.
pub(crate) fn merge(sweep: &Sweep, out: &Path) -> Result<Outcome, Failure> {
    let directory = Directory::existing(out, sweep)?;
    outcome(sweep, &directory, Tally::default(), 0, true)
}

/// The sweep file in the directory of a sweep; none in other directories.
pub(crate) fn file_in(out: &Path) -> Option<PathBuf> {
    directory::sweep_file(out)
}

/// The first points of `sweep` in its directory `out`, at most `most` of them.
///
/// # Errors
/// When the directory is not one of this sweep, or its rows cannot be read.
pub(crate) fn shown(sweep: &Sweep, out: &Path, most: usize) -> Result<Vec<Shown>, Failure> {
    let directory = Directory::existing(out, sweep)?;
    let rows = merge::rows(&directory, sweep.point_count())?;
    let columns = &directory.head().columns;
    let point = |index: u64| -> Result<Shown, Failure> {
        let parameters = sweep.point(index)?.parameters.into_iter().map(|value| match value {
            None => Value::Null,
            Some(ParameterValue::Integer(value)) => value.into(),
            Some(ParameterValue::Double(value)) => value.into(),
            Some(ParameterValue::Word(word)) => word.into(),
        });
        let cells = rows.get(&index).map(|row| row.cells.as_slice()).unwrap_or_default();
        let results = cells.iter().skip(parameters.len()).map(|cell| match cell {
            Cell::Empty => Value::Null,
            Cell::Integer(value) => (*value).into(),
            Cell::Double(value) => (*value).into(),
            Cell::Word(word) => word.as_str().into(),
        });
        let values =
            columns.iter().map(|column| column.name.clone()).zip(parameters.chain(results)).collect();
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
    merge_part: bool,
) -> Result<Outcome, Failure> {
    let rows = merge::rows(directory, sweep.point_count())?;
    let missing = sweep.point_count() - rows.len() as u64;
    let files = if missing == 0 || merge_part { merge::write(sweep, directory, &rows)? } else { None };
    let failed = merge::failed(&rows, &directory.head().columns);
    Ok(Outcome { rows, failed, missing, left, tally, files })
}

/// The points of the shard that have no row yet, or no recording where there is to be one.
fn pending(sweep: &Sweep, directory: &Directory, options: &Options) -> Result<Vec<Job>, Failure> {
    let rows = merge::rows(directory, sweep.point_count())?;
    let has_recording = |index: u64| !options.record || directory.recording(index).exists();
    let is_done = |index: &u64| rows.contains_key(index) && has_recording(*index);
    let indices = (0..sweep.point_count()).filter(|index| options.shard.has(*index) && !is_done(index));
    let job = |index| -> Result<Job, Failure> {
        let physics = Physics::resolve(&sweep.point(index)?.config)?;
        Ok(Job { index, steps: physics.step_count, beads: physics.beads })
    };
    indices.map(job).collect()
}

/// Refuses recordings that cannot all fit on their disk. Of points that end early nobody knows.
fn check_space(sweep: &Sweep, directory: &Directory, jobs: &[Job]) -> Result<(), Failure> {
    if sweep.until() == Until::Stationary {
        return Ok(());
    }
    let mut needed = SpaceNeeded { at_most_bytes: 0, at_least_bytes: 0 };
    for job in jobs {
        let manifest = RunManifest::new(&sweep.point(job.index)?.config, "point", origin())?;
        let point = SpaceNeeded::new(&manifest, WriteOptions::default().compression);
        needed.at_most_bytes = needed.at_most_bytes.saturating_add(point.at_most_bytes);
        needed.at_least_bytes = needed.at_least_bytes.saturating_add(point.at_least_bytes);
    }
    needed.check(&directory.recording(0))?;
    Ok(())
}
