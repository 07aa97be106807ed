//! Simulates and observes runs, several at a time.

use super::cache::Cached;
use super::progress::{Progress, work};
use crate::determining;
use crate::display;
use crate::failure::Failure;
use anyhow::anyhow;
use consumers::determination::TOLERANCE;
use experiments::compare::compare;
use indicatif::ProgressBar;
use paper::{Observations, Observed, Run};
use schemas::manifest::RunManifest;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// Looking at a frame costs about as much as so many steps.
const STEPS_PER_FRAME_READ: f64 = 2.0;
/// A run and its twins, and looking at them, cost about as much as the run so many times.
const RUNS_PER_CHECK: f64 = 5.0;
/// Runs of more steps times beads are not checked: that takes minutes.
const MOST_CHECKED: f64 = 4e8;
const REFRESH: Duration = Duration::from_millis(200);

/// What the workers leave.
pub(crate) struct Done {
    pub(crate) observations: Observations,
    /// Runs that were simulated, because there was no whole recording of them.
    pub(crate) simulated: Vec<String>,
    /// Runs whose recordings were there.
    pub(crate) reused: Vec<String>,
    /// Until when runs are determined, by their names.
    pub(crate) determined: BTreeMap<String, String>,
}

/// Simulates what is not recorded and observes all, with `jobs` workers; nothing if `stop` was set.
pub(crate) fn observe_all(
    mut runs: Vec<Cached>,
    jobs: usize,
    stop: &AtomicBool,
) -> Result<Option<Done>, Failure> {
    // the longest first, so that the workers finish together
    runs.sort_by(|a, b| job_work(b).total_cmp(&job_work(a)));
    let progress = Progress::new(runs.iter().map(job_work).sum(), runs.len());
    let shift = Shift { next: Mutex::new(runs.into_iter()), progress, halt: AtomicBool::new(false) };
    let display = thread::current();
    let results = thread::scope(|scope| {
        let worker = || {
            let outcomes = shift.work();
            display.unpark();
            outcomes
        };
        let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(worker)).collect();
        shift.show(stop, || workers.iter().all(thread::ScopedJoinHandle::is_finished));
        let panicked = |_| Err(Failure::Failed(anyhow!("a worker panicked")));
        workers.into_iter().map(|worker| worker.join().unwrap_or_else(panicked)).collect::<Vec<_>>()
    });
    let mut done = Done {
        observations: Observations::default(),
        simulated: Vec::new(),
        reused: Vec::new(),
        determined: BTreeMap::new(),
    };
    for outcome in results {
        for Outcome { run, observed, simulated, determined } in outcome? {
            done.determined.extend(determined.map(|until| (run.name().to_owned(), until)));
            let names = if simulated { &mut done.simulated } else { &mut done.reused };
            names.push(run.name().to_owned());
            done.observations.insert(&run, observed);
        }
    }
    done.simulated.sort();
    done.reused.sort();
    Ok((!stop.load(Ordering::Relaxed)).then_some(done))
}

fn job_work(cached: &Cached) -> f64 {
    let manifest = &cached.manifest;
    let read = STEPS_PER_FRAME_READ * manifest.recorded_count() as f64 * manifest.physics.beads as f64;
    let run = work(manifest, manifest.physics.step_count);
    read + if cached.recorded { 0.0 } else { run }
        + if is_checked(cached) { RUNS_PER_CHECK * run } else { 0.0 }
}

/// Whether it is found out until when a run is determined: not of those that others are compared with.
fn is_checked(cached: &Cached) -> bool {
    let physics = &cached.manifest.physics;
    !cached.run.is_partner && (physics.step_count * physics.beads) as f64 <= MOST_CHECKED
}

struct Outcome {
    run: Run,
    observed: Observed,
    simulated: bool,
    determined: Option<String>,
}

/// What the workers share.
struct Shift {
    next: Mutex<std::vec::IntoIter<Cached>>,
    progress: Progress,
    /// Set when a worker failed or the user asked to stop: no more work is wanted.
    halt: AtomicBool,
}

impl Shift {
    /// Takes one run after the other until there are no more.
    fn work(&self) -> Result<Vec<Outcome>, Failure> {
        let mut outcomes = Vec::new();
        while !self.halt.load(Ordering::Relaxed) {
            let next = self.next.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(cached) = next else { break };
            match self.one(cached) {
                Ok(Some(outcome)) => outcomes.push(outcome),
                Ok(None) => break,
                Err(error) => {
                    self.halt.store(true, Ordering::Relaxed);
                    return Err(error);
                }
            }
        }
        Ok(outcomes)
    }

    fn one(&self, cached: Cached) -> Result<Option<Outcome>, Failure> {
        let mut simulated = false;
        if !cached.recorded {
            simulated = true;
            if !self.simulate(&cached)? {
                return Ok(None);
            }
        }
        let mut observed = cached.observe();
        if observed.is_none() && !simulated {
            // its end looked whole, its middle is not
            simulated = true;
            if !self.simulate(&cached)? {
                return Ok(None);
            }
            observed = cached.observe();
        }
        let path = cached.path().display();
        let observed = observed
            .ok_or_else(|| anyhow!("{path}: the recording just made cannot be read; is the disk sound?"))?;
        let manifest = &cached.manifest;
        let determined = if is_checked(&cached) { self.determined(manifest)? } else { None };
        self.progress.job_done();
        self.progress
            .add(STEPS_PER_FRAME_READ * manifest.recorded_count() as f64 * manifest.physics.beads as f64);
        Ok(Some(Outcome { run: cached.run, observed, simulated, determined }))
    }

    /// Until when a run is determined, in words; none if that was stopped.
    fn determined(&self, manifest: &RunManifest) -> Result<Option<String>, Failure> {
        let physics = &manifest.physics;
        let mut before = 0;
        let compared = compare(manifest, None, (physics.step_count, TOLERANCE), &self.halt, |step| {
            self.progress.add(RUNS_PER_CHECK * (work(manifest, step) - work(manifest, before)));
            before = step;
        })?;
        let outcome = compared.determination.outcome().filter(|_| !compared.stopped);
        Ok(outcome.map(|outcome| determining::verdict(physics, &outcome)))
    }

    fn simulate(&self, cached: &Cached) -> Result<bool, Failure> {
        let before = AtomicU64::new(0);
        cached.simulate(&self.halt, |step| {
            let from = before.swap(step, Ordering::Relaxed);
            self.progress.add(work(&cached.manifest, step) - work(&cached.manifest, from));
        })
    }

    /// Shows the progress until `finished`, and passes on a request to stop.
    fn show(&self, stop: &AtomicBool, finished: impl Fn() -> bool) {
        const PARTS: f64 = 1000.0;
        let bar: ProgressBar = display::progress_bar(1000, "reproduce");
        let mut tenths = 0;
        while !finished() {
            if stop.load(Ordering::Relaxed) {
                self.halt.store(true, Ordering::Relaxed);
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 1000")]
            bar.set_position((PARTS * self.progress.part()) as u64);
            let [done, left] = self.progress.parts();
            display::tell(&bar, &[&done, &left]);
            if bar.is_hidden() && self.progress.tenths() > tenths {
                tenths = self.progress.tenths();
                display::notice(format_args!("reproduce: {}", display::joined(&[&done, &left])));
            }
            thread::park_timeout(REFRESH);
        }
        bar.finish_and_clear();
    }
}
