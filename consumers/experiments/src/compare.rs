//! A run and its twins, compared: until when the run is determined.

use consumers::determination::Determination;
use consumers::energies::default_split_bead;
use producer::twins::{NonFinite, Together, Twins, moved_by_m_s};
use recording::state_hash;
use schemas::manifest::RunManifest;
use std::sync::atomic::{AtomicBool, Ordering};

/// A run that was compared with its twins.
pub struct Compared {
    /// Agreement of the run with its twins.
    pub determination: Determination,
    /// The hash of the last state of the run, as recordings have it.
    pub last_state_hash: String,
    /// True if the comparison was asked to stop before the last step.
    pub stopped: bool,
}

/// Makes `manifest`'s run up to `last_step`, and its twins, and compares them. `progress` is told the step.
///
/// The result is a pure function of the physics, `split_bead`, `last_step` and `tolerance`.
///
/// # Errors
/// When a state leaves the range of doubles.
pub fn compare(
    manifest: &RunManifest,
    split_bead: Option<u64>,
    (last_step, tolerance): (u64, f64),
    stop: &AtomicBool,
    mut progress: impl FnMut(u64),
) -> Result<Compared, NonFinite> {
    let physics = &manifest.physics;
    let split_bead = split_bead.unwrap_or_else(|| default_split_bead(manifest));
    let mut determination = Determination::new(manifest, split_bead, tolerance, moved_by_m_s(physics));
    let every = Determination::look_every_steps(physics);
    let mut twins = Twins::new(physics);
    let (mut step, mut stopped) = (0, false);
    loop {
        twins.advance_to(step)?;
        let Together { run, halved, quartered, moved, rounded } = twins.together();
        determination.look(&run, [&halved, &quartered], &moved, rounded);
        progress(step);
        stopped = stopped || stop.load(Ordering::Relaxed);
        if step == last_step || stopped {
            let state = [run.u_m, run.v_m_s, run.extra].concat();
            return Ok(Compared { determination, last_state_hash: state_hash(step, &state), stopped });
        }
        step = last_step.min(step + every);
    }
}
