//! Plan of a sweep: some of its points computed now, and estimates from them.

use crate::configuration::origin;
use crate::display::{bytes, count, counted, left, seconds};
use crate::failure::Failure;
use crate::report::Rows;
use crate::sweep::pending::Guess;
use crate::sweep::work;
use anyhow::{Context as _, anyhow};
use consumers::journal::{self, Entry};
use consumers::table::{Cell, Column, Kind, Table};
use experiments::columns;
use experiments::row::{self, Asked, At, Signals};
use producer::sweep::{MAX_POINTS, Sweep};
use serde::Serialize;
use std::fs;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

/// Longest time for computing points, and their largest number.
const BUDGET: Duration = Duration::from_secs(2);
const MOST_TRIED: u64 = 256;

/// Time between two looks at a stop that is asked for.
const LOOK_PERIOD: Duration = Duration::from_millis(20);

/// Time for merging rows.
const MERGE_BUDGET: Duration = Duration::from_millis(300);

/// A shorter shard (s) costs more to begin than it is worth; a longer one is lost too easily, and schedulers end it.
const SHORTEST_S: f64 = 600.0;
const LONGEST_S: f64 = 86_400.0;

/// Most shards of one job array in common installations of Slurm.
const ARRAY: u64 = 1000;

/// More files in one directory are slow on the file systems of clusters.
const MOST_FILES: u64 = 10_000;

/// Cores that are planned for, besides those of this machine.
const CORES: [u64; 4] = [1, 100, 1000, 10_000];

/// The plan.
#[derive(Debug, Serialize)]
pub(crate) struct Plan {
    points: u64,
    /// Points that were computed.
    tried: usize,
    /// Time of a point (s): the least, the median, the most.
    point_s: [f64; 3],
    core_hours: f64,
    /// Time (s) to read the sweep file and check its points, in each process.
    start_s: f64,
    /// Bytes of a row.
    row_bytes: Sizes,
    /// Bytes of all rows.
    bytes: Sizes,
    merge_s: f64,
    on: Vec<OnCores>,
    /// Limits that keep more cores from being of use, the first one first.
    limits: Vec<Limit>,
}

/// Bytes of the files with the rows.
#[derive(Debug, Clone, Copy, Serialize)]
struct Sizes {
    journal: f64,
    csv: f64,
    parquet: f64,
}

/// Plan for some number of cores.
#[derive(Debug, Serialize)]
struct OnCores {
    cores: u64,
    /// Into how many parts the sweep is best divided, each for one core.
    shards: u64,
    shard_s: f64,
    /// All of it (s), with the merge.
    wall_s: f64,
}

/// Number of cores beyond which more are of no use, or need something else; and the reason.
#[derive(Debug, Serialize)]
struct Limit {
    cores: u64,
    why: String,
}

/// Rows of points, and how long each took (s).
struct Tried {
    rows: Vec<Entry>,
    times_s: Vec<f64>,
}

impl Plan {
    /// Plans `sweep`, which took `start` to read, on `cores` or some usual numbers of them.
    ///
    /// # Errors
    /// When no point can be computed, when `stop` is set, or there is no place for temporary files.
    pub(crate) fn of(
        sweep: &Sweep,
        start: Duration,
        cores: Option<u64>,
        stop: &AtomicBool,
    ) -> Result<Self, Failure> {
        let Tried { rows, mut times_s } = tried(sweep, stop)?;
        times_s.sort_by(f64::total_cmp);
        let tried = times_s.len();
        let (Some(least), Some(most)) = (times_s.first(), times_s.last()) else {
            return Err(Failure::Failed(anyhow!(
                "no point came far enough in {BUDGET:?} to tell how long it takes"
            )));
        };
        let point_s = [*least, times_s[tried / 2], *most];
        let (points, core_s) =
            (sweep.point_count(), sum(&times_s) / tried as f64 * sweep.point_count() as f64);
        let (row_bytes, row_merge_s) = written(sweep, &rows)?;
        let of_all = |bytes: f64| bytes * points as f64;
        let Sizes { journal, csv, parquet } = row_bytes;
        let merge_s = row_merge_s * points as f64;
        let here = thread::available_parallelism().map_or(1, |cores| cores.get() as u64);
        let mut numbers = cores.map_or(CORES.to_vec(), |cores| vec![cores]);
        numbers.push(here);
        numbers.sort_unstable();
        numbers.dedup();
        let on = numbers.into_iter().map(|cores| OnCores::plan(cores, points, core_s, merge_s));
        Ok(Self {
            points,
            tried,
            point_s,
            core_hours: core_s / 3600.0,
            start_s: start.as_secs_f64(),
            row_bytes,
            bytes: Sizes { journal: of_all(journal), csv: of_all(csv), parquet: of_all(parquet) },
            merge_s,
            on: on.collect(),
            limits: limits(points, core_s, merge_s),
        })
    }

    pub(crate) fn text(&self, sweep: &Path) -> String {
        let mut rows = Rows::default();
        let [least, median, most] = self.point_s.map(seconds);
        rows.add("points", count(self.points));
        rows.add(
            "a point",
            format_args!("{median} (from {least} to {most}, of {})", counted(self.tried as u64, "point")),
        );
        rows.add("computing", format_args!("{:.3} core-hours", self.core_hours));
        rows.add("a process", format_args!("{} to begin", seconds(self.start_s)));
        rows.add("a row", sizes(self.row_bytes));
        rows.add("all rows", sizes(self.bytes));
        rows.add("merging", left(self.merge_s));
        for OnCores { cores, shards, shard_s, wall_s } in &self.on {
            let arrays = match shards.div_ceil(ARRAY) {
                1 => String::new(),
                arrays => format!(", in {}", counted(arrays, "job array")),
            };
            let (shards, each, wall) = (counted(*shards, "shard"), left(*shard_s), left(*wall_s));
            rows.add(
                format!("on {}", counted(*cores, "core")),
                format_args!("{wall}; {shards} of {each}{arrays}"),
            );
        }
        for (place, Limit { cores, why }) in self.limits.iter().enumerate() {
            let name = if place == 0 { "first limit" } else { "then" };
            rows.add(name, format_args!("beyond {}: {why}", counted(*cores, "core")));
        }
        rows.add(
            "more points",
            format_args!("more than {} are several sweeps, such as of other seeds", count(MAX_POINTS)),
        );
        rows.under(format_args!("plan of {}", sweep.display()))
    }
}

fn sizes(Sizes { journal, csv, parquet }: Sizes) -> String {
    let [journal, csv, parquet] = [journal, csv, parquet].map(|size| bytes(whole(size)).to_string());
    format!("{journal} in the journals, {csv} as CSV, {parquet} as Parquet")
}

/// A size or a count, rounded up.
fn whole(value: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let whole = value.ceil() as u64;
    whole
}

impl OnCores {
    /// A shard for each core, but fewer if they would be short, and more if they would be long.
    fn plan(cores: u64, points: u64, core_s: f64, merge_s: f64) -> Self {
        let (most, least) = (whole((core_s / SHORTEST_S).floor()), whole(core_s / LONGEST_S));
        let used = cores.min(most.max(1)).min(points);
        // whole rounds of all cores, so that none is idle at the end
        let shards = (least.div_ceil(used) * used).max(used).min(points);
        let shard_s = core_s / shards as f64;
        Self { cores, shards, shard_s, wall_s: shard_s * shards.div_ceil(used) as f64 + merge_s }
    }
}

/// Limits that keep more cores from being of use, by their number.
fn limits(points: u64, core_s: f64, merge_s: f64) -> Vec<Limit> {
    let limit = |cores: u64, why: &str| Limit { cores: cores.max(1), why: why.to_owned() };
    let mut limits = vec![
        limit(points, "there are no more points"),
        limit(
            whole(core_s / SHORTEST_S),
            "a shard lasts less than 10 min, and its start weighs; give shards more points",
        ),
        limit(
            ARRAY,
            "a job array of Slurm has no more shards (MaxArraySize); several arrays, or fewer shards with --jobs",
        ),
        limit(
            MOST_FILES,
            "a journal for each shard makes more files than a directory should have; take --jobs in each shard",
        ),
    ];
    if merge_s > 0.0 {
        limits.push(limit(whole(core_s / merge_s), "merging, by one process, takes longer than computing"));
    }
    limits.sort_by_key(|limit| limit.cores);
    limits
}

fn sum(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |sum, value| sum + value)
}

/// Computes points that lie evenly among all, as many together as a worker does, until there are enough of them or the time is over.
/// Points under way then count with their likely time.
fn tried(sweep: &Sweep, stop: &AtomicBool) -> Result<Tried, Failure> {
    let points = sweep.point_count();
    let guess = Guess::of(sweep, points, 0..points);
    let together = work::together(&guess, usize::try_from(points).unwrap_or(usize::MAX)) as u64;
    let batches = points.div_ceil(together);
    let most = u32::try_from(MOST_TRIED.div_ceil(together).min(batches)).unwrap_or(u32::MAX);
    let over = AtomicBool::new(false);
    let (done, waits) = mpsc::channel::<()>();
    thread::scope(|scope| {
        let over = &over;
        let wait = move || {
            let start = Instant::now();
            let goes_on = || start.elapsed() < BUDGET && !stop.load(Ordering::Relaxed);
            while goes_on() && waits.recv_timeout(LOOK_PERIOD) == Err(RecvTimeoutError::Timeout) {}
            over.store(true, Ordering::Relaxed);
        };
        let watch = thread::Builder::new().spawn_scoped(scope, wait);
        watch.context(
            "no thread can be started that ends the attempt in time; allow more processes (`ulimit -u`)",
        )?;
        let mut tried = Tried { rows: Vec::new(), times_s: Vec::new() };
        for place in (0..most).map(u32::reverse_bits) {
            let first = (u128::from(place) * u128::from(batches)) >> 32;
            let first = u64::try_from(first).unwrap_or(0) * together; // below the number of points
            tried.add(sweep, first..points.min(first + together), over)?;
            if over.load(Ordering::Relaxed) {
                break;
            }
        }
        if stop.load(Ordering::Relaxed) {
            return Err(Failure::Stopped(anyhow!("stopped before there was a plan")));
        }
        drop(done);
        Ok(tried)
    })
}

impl Tried {
    /// Computes the points `indices`, until the time is `over`.
    fn add(&mut self, sweep: &Sweep, indices: Range<u64>, over: &AtomicBool) -> Result<(), Failure> {
        let at: Vec<At> = indices.clone().map(|_| At::default()).collect();
        let asked: Vec<_> = indices
            .zip(&at)
            .map(|(index, at)| Asked { index, recording: None, signals: Signals { stop: over, at } })
            .collect();
        let (start, mut finished_s) = (Instant::now(), 0.0);
        row::compute(sweep, &asked, &origin(), |place, cells, wall_s| {
            at[place].step.store(0, Ordering::Relaxed);
            finished_s += wall_s;
            self.times_s.push(wall_s);
            self.rows.push(Entry { index: asked[place].index, wall_s, cells });
            Ok::<_, Failure>(())
        })?;
        let left_s = start.elapsed().as_secs_f64() - finished_s;
        let come =
            at.iter().map(|at| [&at.step, &at.steps].map(|count| count.load(Ordering::Relaxed) as f64));
        let under_way: Vec<_> = come.filter(|[step, _]| *step > 0.0).collect();
        let share_s = left_s / under_way.len() as f64;
        self.times_s.extend(under_way.iter().map(|[step, steps]| share_s * steps / step));
        Ok(())
    }
}

/// Bytes of a row, and the time (s) for merging it.
fn written(sweep: &Sweep, rows: &[Entry]) -> Result<(Sizes, f64), Failure> {
    let columns = columns(sweep);
    // without a finished point a row of nothing stands for all
    let empty = [Entry { index: 0, wall_s: 0.0, cells: vec![Cell::Empty; columns.len()] }];
    let rows = if rows.is_empty() { &empty } else { rows };
    let lines: Vec<String> = rows.iter().map(journal::line_of).collect();
    let place = tempfile::tempdir()?;
    let named = [&[Column::new("index", Kind::Integer)][..], &columns].concat();
    let create = |name: &str| Table::create(&place.path().join(name), &named, true);
    let size_of = |name: &str, rows: &[Entry]| -> Result<f64, Failure> {
        let mut table = create(name)?;
        rows.iter().try_for_each(|row| super::merge::add(&mut table, row.index, &row.cells))?;
        Ok(fs::metadata(table.finish()?)?.len() as f64)
    };
    // what a table has whatever its rows is in the one as well
    let (first, others) = rows.split_at(usize::from(rows.len() > 1));
    let per_row = |name: &str| -> Result<f64, Failure> {
        Ok((size_of(name, rows)? - size_of(name, first)?) / others.len() as f64)
    };
    let journal = lines.iter().map(String::len).sum::<usize>() as f64 / rows.len() as f64;
    let sizes = Sizes { journal, csv: per_row("a.csv")?, parquet: per_row("a.parquet")? };
    let mut tables = [create("b.csv")?, create("b.parquet")?];
    let (start, mut merged) = (Instant::now(), 0_u64);
    while start.elapsed() < MERGE_BUDGET {
        for line in &lines {
            let json = line.as_bytes().get(journal::CHECKSUM_BYTES..).unwrap_or_default();
            if let Some(row) = journal::entry(json, &columns) {
                tables.iter_mut().try_for_each(|table| super::merge::add(table, row.index, &row.cells))?;
            }
            merged += 1;
        }
    }
    Ok((sizes, start.elapsed().as_secs_f64() / merged.max(1) as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_neither_short_nor_long() {
        let plan = |cores, core_s| {
            let OnCores { shards, shard_s, wall_s, .. } = OnCores::plan(cores, 1_000_000, core_s, 0.0);
            (shards, shard_s, wall_s)
        };
        // an hour in all: six shards of ten minutes, however many cores there are
        assert_eq!(plan(1000, 3600.0), (6, 600.0, 600.0));
        assert_eq!(plan(2, 3600.0), (2, 1800.0, 1800.0));
        // ten days on two cores: in parts of a day at most, as many for each core
        assert_eq!(plan(2, 10.0 * LONGEST_S), (10, LONGEST_S, 5.0 * LONGEST_S));
        assert_eq!(plan(3, 10.0 * LONGEST_S).0, 12);
        assert_eq!(plan(4, 1.0), (1, 1.0, 1.0));
    }

    #[test]
    fn the_first_limit_comes_first() {
        let first = |core_s, merge_s| limits(1_000_000, core_s, merge_s).remove(0);
        assert!(first(6000.0, 1.0).why.contains("10 min") && first(6000.0, 1.0).cores == 10);
        assert!(first(1e7, 1.0).why.contains("MaxArraySize"));
        assert!(first(1e7, 1e5).why.contains("merging") && first(1e7, 1e5).cores == 100);
    }
}
