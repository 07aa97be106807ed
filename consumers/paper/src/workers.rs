//! Simulates and observes runs, several at a time.

use crate::cache::Cached;
use crate::progress::{Progress, work};
use crate::{Observations, Observed};
use anyhow::{Error, anyhow};
use consumers::determination::{TOLERANCE, verdict};
use experiments::compare::compare;
use experiments::pool::{Told, share};
use schemas::manifest::RunManifest;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Looking at a frame costs about as much as so many steps.
const STEPS_PER_FRAME_READ: f64 = 2.0;
/// A run and its twins, and looking at them, cost about as much as the run so many times.
const RUNS_PER_CHECK: f64 = 5.0;
/// Runs of more steps times beads are not checked: that takes minutes.
const MOST_CHECKED: f64 = 4e8;

/// Results of the workers.
pub struct Done {
    /// Observations of the runs.
    pub observations: Observations,
    /// Runs that were simulated, because there was no whole recording of them.
    pub simulated: Vec<String>,
    /// Runs whose recordings were there.
    pub reused: Vec<String>,
    /// Times until which runs are determined, by their names.
    pub determined: BTreeMap<String, String>,
}

/// Simulates the runs without a recording and observes all runs, with `jobs` workers, and reports their progress now
/// and then; nothing if `stop` was set.
///
/// # Errors
/// When a run cannot be made, recorded or read.
pub fn observe_all(
    mut runs: Vec<Cached>,
    jobs: usize,
    stop: &AtomicBool,
    mut tell: impl FnMut(&Progress),
) -> Result<Option<Done>, Error> {
    // the longest first, so that the workers finish together
    runs.sort_by(|a, b| job_work(b).total_cmp(&job_work(a)));
    let progress = Progress::new(runs.iter().map(job_work).sum(), runs.len());
    let shift = Shift { progress, stop };
    let mut outcomes: Vec<Option<Outcome>> = runs.iter().map(|_| None).collect();
    let mut broken = false;
    share(
        0..runs.len(),
        jobs,
        stop,
        |_, run| shift.one(&runs[run]),
        |told| {
            match told {
                Told::Done(run, outcome) => outcomes[run] = Some(outcome),
                Told::Broken(_) => broken = true,
                Told::Fewer(..) | Told::Nothing => {}
            }
            tell(&shift.progress);
        },
    )?;
    if broken {
        return Err(anyhow!("a worker panicked"));
    }
    let mut done = Done {
        observations: Observations::default(),
        simulated: Vec::new(),
        reused: Vec::new(),
        determined: BTreeMap::new(),
    };
    for (cached, outcome) in runs.into_iter().zip(outcomes) {
        let Some(Outcome { observed, simulated, determined }) = outcome else { continue };
        let name = cached.run.name().to_owned();
        done.determined.extend(determined.map(|until| (name.clone(), until)));
        let names = if simulated { &mut done.simulated } else { &mut done.reused };
        names.push(name);
        done.observations.insert(&cached.run, observed);
    }
    done.simulated.sort();
    done.reused.sort();
    Ok((!stop.load(Ordering::Relaxed)).then_some(done))
}

fn reading(manifest: &RunManifest) -> f64 {
    STEPS_PER_FRAME_READ * manifest.recorded_count() as f64 * manifest.physics.beads as f64
}

fn job_work(cached: &Cached) -> f64 {
    let manifest = &cached.manifest;
    let run = work(manifest, manifest.physics.step_count);
    reading(manifest)
        + if cached.recorded { 0.0 } else { run }
        + if is_checked(cached) { RUNS_PER_CHECK * run } else { 0.0 }
}

/// True if `check` determines this run; runs that only serve for comparison are not determined.
fn is_checked(cached: &Cached) -> bool {
    let physics = &cached.manifest.physics;
    !cached.run.is_partner && (physics.step_count * physics.beads) as f64 <= MOST_CHECKED
}

struct Outcome {
    observed: Observed,
    simulated: bool,
    determined: Option<String>,
}

/// The workers' shared state.
struct Shift<'a> {
    progress: Progress,
    /// Set when a worker failed or the user asked to stop: no more work is wanted.
    stop: &'a AtomicBool,
}

impl Shift<'_> {
    fn one(&self, cached: &Cached) -> Result<Option<Outcome>, Error> {
        let mut observed = cached.recorded.then(|| cached.observe()).flatten();
        // nothing is recorded; or its end looked whole, and its middle is not
        let simulated = observed.is_none();
        if simulated {
            if !self.simulate(cached)? {
                return Ok(None);
            }
            observed = cached.observe();
        }
        let path = cached.path().display();
        let observed = observed
            .ok_or_else(|| anyhow!("{path}: the recording just made cannot be read; is the disk sound?"))?;
        let manifest = &cached.manifest;
        let determined = if is_checked(cached) { self.determined(manifest)? } else { None };
        self.progress.job_done();
        self.progress.add(reading(manifest));
        Ok(Some(Outcome { observed, simulated, determined }))
    }

    /// Time until which a run is determined, in words; none if the computation was stopped.
    fn determined(&self, manifest: &RunManifest) -> Result<Option<String>, Error> {
        let physics = &manifest.physics;
        let mut before = 0;
        let compared = compare(manifest, None, (physics.step_count, TOLERANCE), self.stop, |step| {
            self.progress.add(RUNS_PER_CHECK * (work(manifest, step) - work(manifest, before)));
            before = step;
        })?;
        let outcome = compared.determination.outcome().filter(|_| !compared.stopped);
        Ok(outcome.map(|outcome| verdict(physics, &outcome)))
    }

    fn simulate(&self, cached: &Cached) -> Result<bool, Error> {
        let before = AtomicU64::new(0);
        cached.simulate(self.stop, |step| {
            let from = before.swap(step, Ordering::Relaxed);
            self.progress.add(work(&cached.manifest, step) - work(&cached.manifest, from));
        })
    }
}
