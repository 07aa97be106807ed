//! Until when runs are determined: a run and its twins, compared; alone or beside a run that goes on.

use crate::display::{self, count, seconds};
use crate::failure::Failure;
use anyhow::anyhow;
use consumers::determination::{Bound, Determination, Determined, Outcome, Quantity, TOLERANCE, digits};
use consumers::energies::default_split_bead;
use producer::twins::{NonFinite, Together, Twins, moved_by_m_s};
use recording::state_hash;
use schemas::manifest::{Physics, RunManifest};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// How often a person needs to see progress.
const REFRESH: Duration = Duration::from_millis(100);

/// How much the thread beside a run gives way to others.
const NICENESS: i32 = 10;

/// A run that was compared with its twins.
pub(crate) struct Compared {
    pub(crate) determination: Determination,
    /// The hash of the last state of the run, as recordings have it.
    pub(crate) last_state_hash: String,
    /// Whether that was asked to stop before the last step.
    pub(crate) stopped: bool,
}

/// Makes `manifest`'s run up to `last_step`, and its twins, and compares them. `progress` is told the step.
///
/// The result is a pure function of the physics, `split_bead`, `last_step` and `tolerance`.
pub(crate) fn compare(
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
        let Together { run, halved, moved } = twins.together();
        determination.look(&run, &halved, &moved);
        progress(step);
        stopped = stopped || stop.load(Ordering::Relaxed);
        if step == last_step || stopped {
            let state = [run.u_m, run.v_m_s, run.extra].concat();
            return Ok(Compared { determination, last_state_hash: state_hash(step, &state), stopped });
        }
        step = last_step.min(step + every);
    }
}

/// A comparison in a thread of its own, beside a run.
pub(crate) struct Beside {
    thread: JoinHandle<Result<Compared, NonFinite>>,
    step: Arc<AtomicU64>,
    last_step: u64,
}

impl Beside {
    /// Begins to compare `manifest`'s run with its twins, until `stop` is set.
    pub(crate) fn start(manifest: &RunManifest, stop: &Arc<AtomicBool>) -> Result<Self, Failure> {
        let step = Arc::new(AtomicU64::new(0));
        let last_step = manifest.physics.step_count;
        let (at, stop, manifest) = (Arc::clone(&step), Arc::clone(stop), manifest.clone());
        let thread = thread::Builder::new().spawn(move || {
            // of this thread alone; where that is refused it competes with the run for a core
            let _ = rustix::process::nice(NICENESS);
            compare(&manifest, None, (last_step, TOLERANCE), &stop, |step| at.store(step, Ordering::Relaxed))
        })?;
        Ok(Self { thread, step, last_step })
    }

    /// Waits for its end.
    pub(crate) fn finish(self) -> Result<Compared, Failure> {
        let bar = display::progress_bar(self.last_step, "check");
        while !self.thread.is_finished() {
            bar.set_position(self.step.load(Ordering::Relaxed));
            bar.set_message("the run is done, its twins are not");
            thread::sleep(REFRESH);
        }
        bar.finish_and_clear();
        let ended = self.thread.join().map_err(|_| anyhow!("the check panicked, see above"))?;
        Ok(ended?)
    }
}

/// The verdict in one line.
pub(crate) fn verdict(physics: &Physics, outcome: &Outcome) -> String {
    let end = time(physics, outcome.compared_until.1);
    let tolerance = outcome.tolerance;
    match outcome.first_lost() {
        None if outcome.compared_until.0 == physics.step_count => {
            format!("to the end, {end}, within {tolerance:e}")
        }
        None => format!("as far as it was compared, {end}, within {tolerance:e}"),
        Some(lost) => format!(
            "until {} of {end} within {tolerance:e}: {}, bounded by {}",
            time(physics, lost.until_s.unwrap_or_default()),
            label(lost.quantity, physics, outcome.split_bead),
            lost.bound.map_or("", |bound| bound.as_str()),
        ),
    }
}

/// A time, also in T.
fn time(physics: &Physics, time_s: f64) -> String {
    format!("{} ({:.0} T)", seconds(time_s), time_s / physics.scales().time_s)
}

/// What a quantity is called in text.
fn label(quantity: Quantity, physics: &Physics, split_bead: u64) -> String {
    let bead = match &physics.impurities[..] {
        [] => format!("bead {split_bead}"),
        [only] => format!("bead {}", only.bead),
        _ => "impurities".to_owned(),
    };
    match quantity {
        Quantity::Displacement => "displacement of any bead".to_owned(),
        Quantity::Velocity => "velocity of any bead".to_owned(),
        Quantity::Peak => "peak velocity".to_owned(),
        Quantity::Position => format!("displacement of {bead}"),
        Quantity::BeadVelocity => format!("velocity of {bead}"),
        Quantity::TotalEnergy => "total energy".to_owned(),
        Quantity::LeftEnergy => format!("energy left of bead {split_bead}"),
        Quantity::SplitEnergy => format!("energy of bead {split_bead}"),
        Quantity::RightEnergy => format!("energy right of bead {split_bead}"),
        Quantity::Reflected => "reflected part".to_owned(),
        Quantity::Contacts => "classes of contacts".to_owned(),
        Quantity::Front => "front bead".to_owned(),
        Quantity::Pulses => "number of pulses".to_owned(),
    }
}

/// A line for each quantity under their heads.
pub(crate) fn table(physics: &Physics, outcome: &Outcome) -> String {
    let heads =
        ["", "unit", "determined", "bounded by", "digits", "error at end: step", "rounding", "largest"];
    let mut lines = vec![heads.map(str::to_owned)];
    lines.extend(outcome.quantities.iter().map(|each| line(physics, outcome, each)));
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..heads.len()).map(width).collect();
    let mut text = String::new();
    for line in &lines {
        let cells = line.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}"));
        // writing to a String cannot fail
        let _ = writeln!(text, "  {}", cells.collect::<Vec<_>>().join("  ").trim_end());
    }
    text
}

fn line(physics: &Physics, outcome: &Outcome, each: &Determined) -> [String; 8] {
    let is_count = each.quantity.is_count();
    let error = |error: f64| if is_count { format!("{error}") } else { format!("{error:.1e}") };
    let digits = if is_count { String::new() } else { digits(each.at_end()).to_string() };
    [
        label(each.quantity, physics, outcome.split_bead),
        each.quantity.scale().to_owned(),
        each.until_s.map_or_else(|| "to the end".to_owned(), |until_s| time(physics, until_s)),
        each.bound.map_or_else(String::new, |bound| bound.as_str().to_owned()),
        digits,
        error(each.step.at_end),
        error(each.rounding.at_end),
        error(each.worst()),
    ]
}

/// The rows beside the table: the step, how differences grow, what helps.
pub(crate) fn explanation(physics: &Physics, outcome: &Outcome) -> String {
    let collision_s = physics.scales().time_s;
    let steps = count(physics.step_count);
    let mut text =
        format!("  dt = {:e} s = {:.4} T, {steps} steps", physics.dt_s, physics.dt_s / collision_s);
    if let Some(rate) = outcome.growth_per_s {
        // writing to a String cannot fail
        let _ = write!(text, "; what differs in the last place grows as exp({:.3} t/T)", rate * collision_s);
    }
    text + "\n"
}

/// The same for programs.
pub(crate) fn json(physics: &Physics, outcome: &Outcome) -> Value {
    let lost = outcome.first_lost();
    let quantities = outcome.quantities.iter().map(|each| {
        let course = |course: consumers::determination::Course| {
            json!({
                "until_s": course.until_s,
                "at_end": course.at_end,
                "worst": course.worst,
                "worst_at_s": course.worst_at_s,
            })
        };
        let digits = |error| (!each.quantity.is_count()).then(|| digits(error));
        json!({
            "quantity": each.quantity.as_str(),
            "unit": each.quantity.scale(),
            "determined": each.until_s.is_none(),
            "determined_until_s": each.until_s,
            "bounded_by": each.bound.map(Bound::as_str),
            "digits_at_end": digits(each.at_end()),
            "digits_at_worst": digits(each.worst()),
            "step": course(each.step),
            "rounding": course(each.rounding),
        })
    });
    json!({
        "tolerance": outcome.tolerance,
        "compared_until_s": outcome.compared_until.1,
        "collision_time_s": physics.scales().time_s,
        "dt_s": physics.dt_s,
        "split_bead": outcome.split_bead,
        "determined": lost.is_none(),
        "determined_until_s": lost.and_then(|lost| lost.until_s),
        "bounded_by": lost.and_then(|lost| lost.bound).map(Bound::as_str),
        "growth_per_s": outcome.growth_per_s,
        "quantities": quantities.collect::<Vec<_>>(),
    })
}
