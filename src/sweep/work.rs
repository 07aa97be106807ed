//! The workers of one process.

use super::Options;
use super::directory::Directory;
use super::merge::Failed;
use super::pending::{Guess, Pending};
use crate::args::Shard;
use crate::configuration::origin;
use crate::display::{self, count, counted};
use crate::failure::Failure;
use crate::progress::REFRESH;
use consumers::journal::{Entry, Journal};
use consumers::table::Cell;
use experiments::ERROR_COLUMN;
use experiments::pool::{Told, share_batches};
use experiments::row::{self, Asked, At, Signals};
use indicatif::ProgressBar;
use producer::integrator::Lanes;
use producer::sweep::{Sweep, Until};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Most workers of one process: more than any machine has cores, fewer than the threads that systems grant.
const MAX_WORKERS: usize = 1024;

/// Steps of beads of a point, some seconds, beyond which it is computed alone: a stop loses what is not finished.
const MOST_TOGETHER: u64 = 5_000_000_000;

/// Result of the work.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Tally {
    /// Points that have a row now.
    pub(crate) computed: u64,
    /// Points at which this program went wrong; they have no row.
    pub(crate) broken: Vec<u64>,
    /// Points that had no row before.
    #[serde(skip)]
    pub(super) added: u64,
    /// Points whose rows say why they failed.
    #[serde(skip)]
    pub(super) failed: Failed,
}

/// A point that was computed.
struct Computed {
    /// Steps of beads, had it taken its whole time.
    expected: u64,
    /// Steps of beads as it was.
    steps: u64,
    failed: bool,
}

/// Announces the points to be computed.
pub(super) fn announce(sweep: &Sweep, count_to_compute: u64, shard: Shard) {
    let part = if shard == Shard::WHOLE { String::new() } else { format!(" in shard {shard}") };
    let keys: Vec<_> = sweep.parameters().iter().map(|parameter| parameter.key.as_str()).collect();
    display::notice(format_args!(
        "{} over {}; {} to compute{part}",
        counted(sweep.point_count(), "point"),
        if keys.is_empty() { "nothing".to_owned() } else { keys.join(", ") },
        count(count_to_compute),
    ));
}

/// The points that a worker computes together, of `points` for each worker: chains beside each other end later than one would alone, so
/// that no worker is to wait for another, and not much to be lost by a stop.
pub(super) fn together(guess: &Guess, points: usize) -> usize {
    if guess.cost > MOST_TOGETHER { 1 } else { Lanes::most().min(points).max(1) }
}

/// Computes the `pending` points, writing each row to `journal` when it is there, until all are done or `stop` is set. On return
/// all rows are on the disk.
///
/// # Errors
/// When a row or a recording cannot be written, or when the operating system grants no thread.
pub(super) fn work(
    (sweep, directory): (&Sweep, &Directory),
    (pending, guess): (&Pending<'_>, &Guess),
    options: &Options,
    journal: &Journal,
    stop: &AtomicBool,
) -> Result<Tally, Failure> {
    let points = usize::try_from(guess.count).unwrap_or(usize::MAX);
    let threads = options.threads.min(points).clamp(1, MAX_WORKERS);
    let most = together(guess, points.div_ceil(threads));
    let at: Vec<At> = (0..threads * most).map(|_| At::default()).collect();
    let error = directory.head().columns.iter().position(|column| column.name == ERROR_COLUMN);
    let compute = |worker: usize, batch: &[u64], computed: &mut Vec<(u64, Computed)>| {
        let asked = batch.iter().zip(&at[worker * most..]).map(|(index, at)| Asked {
            index: *index,
            recording: options.record.then(|| directory.recording(*index)),
            signals: Signals { stop, at },
        });
        let asked = asked.collect::<Vec<_>>();
        row::compute::<Failure>(sweep, &asked, &origin(), |place, cells, wall_s| {
            let (index, at) = (batch[place], asked[place].signals.at);
            let (step, steps) = (at.step.swap(0, Ordering::Relaxed), at.steps.load(Ordering::Relaxed));
            let failed = error.and_then(|place| cells.get(place)).is_some_and(|cell| *cell != Cell::Empty);
            let cost = |steps: u64| steps.saturating_mul(at.beads.load(Ordering::Relaxed));
            computed.push((index, Computed { expected: cost(steps), steps: cost(step), failed }));
            Ok(journal.append(&Entry { index, wall_s, cells })?)
        })
    };
    let mut progress = Overview::new(sweep, guess, &at);
    let mut tally = Tally::default();
    let mut synced = Ok(());
    let shared = share_batches(pending.indices(), (threads, most), stop, compute, |told| {
        match told {
            Told::Done(index, computed) => {
                tally.computed += 1;
                tally.added += u64::from(!pending.rows.has(index));
                if computed.failed {
                    tally.failed.add(index);
                }
                progress.finished(computed.expected, computed.steps, tally.computed);
            }
            Told::Broken(index) => {
                tally.broken.push(index);
                progress.finished(guess.cost, guess.cost, tally.computed);
            }
            Told::Fewer(started, error) => {
                display::notice(format_args!("{started} of {threads} workers could be started: {error}"));
            }
            Told::Nothing => progress.refresh(tally.computed),
        }
        if synced.is_ok() {
            synced = journal.sync_if_due();
            stop.fetch_or(synced.is_err(), Ordering::Relaxed);
        }
    });
    progress.bar.finish_and_clear();
    shared?;
    synced.and_then(|()| journal.sync())?;
    Ok(tally)
}

/// Progress of all workers: a bar on a terminal, a line for each tenth elsewhere. Work is counted in steps of beads.
struct Overview<'a> {
    at: &'a [At],
    /// Points in all, and the cost of one.
    guess: &'a Guess,
    /// Points that are finished.
    ended: u64,
    /// True if points end before the time of their runs.
    ends_early: bool,
    bar: ProgressBar,
    start: Instant,
    shown: Instant,
    /// Work of the finished points, had they all taken their whole time.
    expected: u64,
    /// Real work of the finished points.
    finished: u64,
    tenths: u64,
}

impl<'a> Overview<'a> {
    fn new(sweep: &Sweep, guess: &'a Guess, at: &'a [At]) -> Self {
        Self {
            at,
            guess,
            ended: 0,
            ends_early: sweep.until() == Until::Stationary,
            bar: display::progress_bar(guess.count.saturating_mul(guess.cost), "sweep"),
            start: Instant::now(),
            shown: Instant::now(),
            expected: 0,
            finished: 0,
            tenths: 0,
        }
    }

    /// Another point is there.
    fn finished(&mut self, expected: u64, steps: u64, computed: u64) {
        self.ended += 1;
        self.expected = self.expected.saturating_add(expected);
        self.finished = self.finished.saturating_add(steps);
        // points may be many a millisecond
        if self.shown.elapsed() >= REFRESH {
            self.shown = Instant::now();
            self.refresh(computed);
        }
        let tenths = 10 * computed / self.guess.count.max(1);
        if self.bar.is_hidden() && tenths > self.tenths {
            self.tenths = tenths;
            let [points, left] = self.parts(computed);
            display::notice(format_args!("sweep: {}", display::joined(&[&points, &left])));
        }
    }

    fn refresh(&self, computed: u64) {
        let (done, total) = self.work();
        self.bar.set_length(total);
        self.bar.set_position(done);
        let [points, left] = self.parts(computed);
        display::tell(&self.bar, &[&points, &left]);
    }

    /// Steps of beads of the points that are not finished, if they all take their whole time.
    fn unfinished(&self) -> u64 {
        self.guess.cost.saturating_mul(self.guess.count.saturating_sub(self.ended))
    }

    /// The work that is done, and all of it: points to come are assumed to end as early as those before.
    fn work(&self) -> (u64, u64) {
        let steps =
            |at: &At| at.step.load(Ordering::Relaxed).saturating_mul(at.beads.load(Ordering::Relaxed));
        let under_way = self.at.iter().map(steps);
        let done = under_way.fold(self.finished, u64::saturating_add);
        let part = if self.expected == 0 { 1.0 } else { self.finished as f64 / self.expected as f64 };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, is an estimate"
        )]
        let to_come = (self.unfinished() as f64 * part) as u64;
        (done, done.max(self.finished.saturating_add(to_come)))
    }

    fn parts(&self, computed: u64) -> [String; 2] {
        let points = format!("{} of {}", count(computed), counted(self.guess.count, "point"));
        let (done, total) = self.work();
        // before the first point that ends early nobody knows how early
        let unknown = self.expected == 0 && self.ends_early;
        if done == 0 || done == total || unknown {
            return [points, String::new()];
        }
        let left = self.start.elapsed().as_secs_f64() * (total - done) as f64 / done as f64;
        [points, format!("{} left", display::left(left))]
    }
}
