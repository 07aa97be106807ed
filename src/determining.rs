//! Until when runs are determined: a run and its twins, compared; alone or beside a run that goes on.

use crate::display::{self, count};
use crate::failure::Failure;
use crate::limits;
use crate::progress::REFRESH;
use anyhow::anyhow;
use consumers::determination::{Bound, Determined, Outcome, TOLERANCE, digits, label, time};
use experiments::compare::{Compared, compare};
use producer::twins::NonFinite;
use schemas::manifest::{Physics, RunManifest};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};

/// A longer step is worth a line from this factor on.
const WORTH_LONGER: f64 = 1.5;

/// Refuses to compare a run whose twins have other noise.
pub(crate) fn check_noise(physics: &Physics) -> Result<(), Failure> {
    if physics.baths.is_empty() {
        return Ok(());
    }
    Err(bad_input!("{}", experiments::row::OTHER_NOISE))
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
            limits::compute_beside_others();
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

/// A line for each quantity under their heads.
pub(crate) fn table(physics: &Physics, outcome: &Outcome) -> String {
    let heads =
        ["", "unit", "determined", "bounded by", "digits", "error at end: step", "rounding", "largest"];
    let rows = outcome.quantities.iter().map(|each| line(physics, outcome, each)).collect();
    let lines = display::aligned(heads.map(|head| (head, 0)), rows, usize::MAX);
    lines.iter().flat_map(|line| ["  ", line.as_str()]).collect()
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
    text += "\n";
    if let Some(longer_s) = longer_step_s(physics, outcome) {
        let times = longer_s / physics.dt_s;
        // writing to a String cannot fail
        let _ = writeln!(text, "  a step {times:.1} times as long would do, --dt {longer_s:.2e}");
    }
    text
}

/// The longest step (s) with which everything would still be determined to the end, if it is at least half as long again. Errors are taken to grow
/// by the order of the method: where contacts open they grow less, and in chains that stay pressed together as much.
fn longer_step_s(physics: &Physics, outcome: &Outcome) -> Option<f64> {
    if outcome.first_lost().is_some() {
        return None;
    }
    let measured = outcome.quantities.iter().filter(|each| !each.quantity.is_count());
    let worst = measured.map(|each| each.step.worst).fold(0.0, f64::max);
    // errors that collisions multiply, and luck: a factor of 4
    let times = (outcome.tolerance / (4.0 * worst)).powf(1.0 / f64::from(physics.method.order()));
    // a step that is allowed, and not longer than the run; in three digits, rounded down
    let longest_s = physics.longest_dt_s().min(physics.time_s(physics.step_count));
    let longer_s = (times * physics.dt_s).min(longest_s);
    let digit_s = 10_f64.powf(longer_s.log10().floor() - 2.0);
    let longer_s = (longer_s / digit_s).floor() * digit_s;
    (longer_s >= WORTH_LONGER * physics.dt_s).then_some(longer_s)
}

/// The same for programs.
pub(crate) fn json(physics: &Physics, outcome: &Outcome) -> Value {
    let lost = outcome.first_lost();
    let quantities = outcome.quantities.iter().map(|each| {
        let digits = |error| (!each.quantity.is_count()).then(|| digits(error));
        json!({
            "quantity": each.quantity.as_str(),
            "unit": each.quantity.scale(),
            "determined": each.until_s.is_none(),
            "determined_until_s": each.until_s,
            "bounded_by": each.bound.map(Bound::as_str),
            "digits_at_end": digits(each.at_end()),
            "digits_at_worst": digits(each.worst()),
            "step": each.step,
            "rounding": each.rounding,
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
        "longer_dt_s": longer_step_s(physics, outcome),
        "quantities": quantities.collect::<Vec<_>>(),
    })
}
