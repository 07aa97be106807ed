//! Progress: all of the work, the part that is done, and an estimate of the time for the rest.

use schemas::amounts;
use schemas::manifest::RunManifest;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The work of a run after `step` steps, in bead-steps of a Hertz chain.
///
/// Only beads that have moved are computed: at the time t about t/T of them, for a shock passes about one bead in
/// the collision time T. Other powers than that of Hertz take longer.
pub(super) fn work(manifest: &RunManifest, step: u64) -> f64 {
    /// The beads that a shock passes in T, and the cost of a general power; both measured.
    const BEADS_PER_T: f64 = 0.9;
    const GENERAL_POWER: f64 = 3.0;
    let physics = &manifest.physics;
    let per_step = BEADS_PER_T * physics.dt_s / physics.scales().time_s;
    let (steps, beads) = (step as f64, physics.beads as f64);
    let filling = steps.min(beads / per_step);
    let bead_steps = 0.5 * per_step * filling * filling + beads * (steps - filling);
    let simple = [1.0, 1.5, 2.0, 3.0, 5.0].contains(&physics.alpha);
    bead_steps * if simple { 1.0 } else { GENERAL_POWER }
}

/// Progress of all workers.
#[derive(Debug)]
pub struct Progress {
    start: Instant,
    total: f64,
    jobs: usize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    done: f64,
    jobs_done: usize,
}

impl Progress {
    /// No progress yet on `jobs` jobs with `total` work.
    pub(super) fn new(total: f64, jobs: usize) -> Self {
        Self { start: Instant::now(), total, jobs, state: Mutex::default() }
    }

    /// Adds work done.
    pub(super) fn add(&self, work: f64) {
        self.state().done += work;
    }

    /// A job is done.
    pub(super) fn job_done(&self) {
        self.state().jobs_done += 1;
    }

    /// The part done, from 0 to 1.
    pub fn part(&self) -> f64 {
        if self.total > 0.0 { (self.state().done / self.total).clamp(0.0, 1.0) } else { 1.0 }
    }

    /// `12 of 31 runs`, and `2 min 10 s left` if that can be told.
    pub fn parts(&self) -> [String; 2] {
        let left = time_left(self.start.elapsed(), self.part());
        let left = left.map_or(String::new(), |left| format!("{} left", amounts::left(left.as_secs_f64())));
        [format!("{} of {} runs", self.state().jobs_done, self.jobs), left]
    }

    /// Tenths of the work done.
    pub fn tenths(&self) -> u32 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 10")]
        let tenths = (10.0 * self.part()) as u32;
        tenths
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // a worker that panicked while it counted leaves numbers that are still good enough for a display
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The time that the rest takes if it goes on as before; nothing before a fiftieth is done.
fn time_left(elapsed: Duration, part: f64) -> Option<Duration> {
    (part >= 0.02).then(|| elapsed.mul_f64((1.0 - part) / part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    #[test]
    fn the_rest_takes_as_long_as_what_came_before() {
        assert_eq!(time_left(Duration::from_secs(30), 0.25), Some(Duration::from_secs(90)));
        assert_eq!(time_left(Duration::from_secs(30), 1.0), Some(Duration::ZERO));
        assert_eq!(time_left(Duration::from_secs(30), 0.001), None);
    }

    #[test]
    fn a_run_has_more_work_the_farther_its_shock_has_come() {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&PRESETS[0].config(), "run", origin).expect("preset");
        let at = |step| work(&manifest, step);
        // quadratic while the chain fills, linear once it is full (after 55,556 steps of 0.02 T)
        assert!((at(20_000) / at(10_000) - 4.0).abs() < 1e-9);
        assert!((at(80_000) - at(70_000) - 1e7).abs() < 1.0);
    }

    #[test]
    fn progress_counts_jobs_and_work() {
        let progress = Progress::new(200.0, 3);
        progress.add(50.0);
        progress.job_done();
        assert_eq!(progress.part(), 0.25);
        let [done, left] = progress.parts();
        assert!(done == "1 of 3 runs" && left.ends_with(" left"), "{done}, {left}");
    }
}
