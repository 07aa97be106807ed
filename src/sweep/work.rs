//! The workers of one process.

use super::Options;
use super::directory::Directory;
use crate::args::Shard;
use crate::configuration::origin;
use crate::display::{self, count, counted};
use crate::failure::Failure;
use consumers::journal::{Entry, Journal};
use experiments::pool::{Told, share};
use experiments::row::{self, Signals};
use indicatif::ProgressBar;
use producer::sweep::{Sweep, Until};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Most workers of one process: more than any machine has cores, fewer than the threads that systems grant.
const MAX_WORKERS: usize = 1024;

/// A point to be computed, and what it costs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Job {
    pub(super) index: u64,
    /// Steps of the run, unless it ends early.
    pub(super) steps: u64,
    pub(super) beads: u64,
}

impl Job {
    /// In steps of beads.
    pub(super) fn cost(self) -> u64 {
        self.steps.saturating_mul(self.beads)
    }
}

/// How the work went.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Tally {
    /// Points that have a row now.
    pub(crate) computed: u64,
    /// Points at which this program went wrong; they have no row.
    pub(crate) broken: Vec<u64>,
}

/// The step that a worker has reached, and how many beads it steps.
type At = (AtomicU64, AtomicU64);

/// Says what is about to be computed.
pub(super) fn announce(sweep: &Sweep, jobs: &[Job], shard: Shard) {
    let part = if shard == Shard::WHOLE { String::new() } else { format!(" in shard {shard}") };
    let keys: Vec<_> = sweep.parameters().iter().map(|parameter| parameter.key.as_str()).collect();
    display::notice(format_args!(
        "{} over {}; {} to compute{part}",
        counted(sweep.point_count(), "point"),
        if keys.is_empty() { "nothing".to_owned() } else { keys.join(", ") },
        count(jobs.len() as u64),
    ));
}

/// Computes `jobs`, writing each row to `journal` when it is there, until all are done or `stop` is set.
///
/// # Errors
/// When a row or a recording cannot be written, or when the operating system grants no thread.
pub(super) fn work(
    (sweep, directory): (&Sweep, &Directory),
    jobs: &[Job],
    options: &Options,
    journal: Journal,
    stop: &AtomicBool,
) -> Result<Tally, Failure> {
    let threads = options.threads.min(jobs.len()).clamp(1, MAX_WORKERS);
    let at: Vec<At> = (0..threads).map(|_| At::default()).collect();
    let journal = Mutex::new(journal);
    // the number of steps; none if it was stopped
    let compute = |worker: usize, job: usize| -> Result<Option<u64>, Failure> {
        let (Job { index, beads, .. }, (step, stepped_beads)) = (jobs[job], &at[worker]);
        stepped_beads.store(beads, Ordering::Relaxed);
        let start = Instant::now();
        let recording = options.record.then(|| directory.recording(index));
        let row =
            row::compute::<Failure>(sweep, index, origin(), recording.as_deref(), &Signals { stop, step })?;
        let steps = step.swap(0, Ordering::Relaxed);
        let Some(cells) = row else { return Ok(None) };
        let entry = Entry { index, wall_s: start.elapsed().as_secs_f64(), cells };
        // whoever panicked while holding it has not written half a row that the next would not notice
        let mut journal = journal.lock().unwrap_or_else(PoisonError::into_inner);
        journal.append(&entry)?;
        Ok(Some(steps))
    };
    let mut progress = Overview::new(sweep, jobs, &at);
    let mut tally = Tally::default();
    let shared = share(jobs.len(), threads, stop, compute, |told| match told {
        Told::Done(job, steps) => {
            tally.computed += 1;
            progress.finished(jobs[job], steps, tally.computed);
        }
        Told::Broken(job) => {
            tally.broken.push(jobs[job].index);
            progress.finished(jobs[job], jobs[job].steps, tally.computed);
        }
        Told::Fewer(started, error) => {
            display::notice(format_args!("{started} of {threads} workers could be started: {error}"));
        }
        Told::Nothing => progress.refresh(tally.computed),
    });
    progress.bar.finish_and_clear();
    shared.map(|()| tally)
}

/// How far all workers are: a bar on a terminal, a line for each tenth elsewhere. Work is counted in steps of
/// beads.
struct Overview<'a> {
    at: &'a [At],
    /// Points in all.
    points: u64,
    /// Whether points end before the time of their runs.
    ends_early: bool,
    bar: ProgressBar,
    start: Instant,
    /// Of the points that are not finished, if they all took their whole time.
    unfinished: u64,
    /// Of the finished points, had they all taken their whole time.
    expected: u64,
    /// Of the finished points, as it was.
    finished: u64,
    tenths: u64,
}

impl<'a> Overview<'a> {
    fn new(sweep: &Sweep, jobs: &[Job], at: &'a [At]) -> Self {
        let unfinished = jobs.iter().fold(0_u64, |sum, job| sum.saturating_add(job.cost()));
        Self {
            at,
            points: jobs.len() as u64,
            ends_early: sweep.until() == Until::Stationary,
            bar: display::progress_bar(unfinished, "sweep"),
            start: Instant::now(),
            unfinished,
            expected: 0,
            finished: 0,
            tenths: 0,
        }
    }

    fn finished(&mut self, job: Job, steps: u64, computed: u64) {
        self.unfinished = self.unfinished.saturating_sub(job.cost());
        self.expected = self.expected.saturating_add(job.cost());
        self.finished = self.finished.saturating_add(Job { steps, ..job }.cost());
        self.refresh(computed);
        let tenths = 10 * computed / self.points.max(1);
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

    /// What is done, and what there is in all: points to come end as early as those before did.
    fn work(&self) -> (u64, u64) {
        let under_way = self
            .at
            .iter()
            .map(|(step, beads)| step.load(Ordering::Relaxed).saturating_mul(beads.load(Ordering::Relaxed)));
        let done = under_way.fold(self.finished, u64::saturating_add);
        let part = if self.expected == 0 { 1.0 } else { self.finished as f64 / self.expected as f64 };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, is an estimate"
        )]
        let to_come = (self.unfinished as f64 * part) as u64;
        (done, done.max(self.finished.saturating_add(to_come)))
    }

    fn parts(&self, computed: u64) -> [String; 2] {
        let points = format!("{} of {}", count(computed), counted(self.points, "point"));
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
