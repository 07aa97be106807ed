//! Forecasts time and disk before a long run or sweep, and asks on a terminal.

use crate::args::Pace;
use crate::display;
use crate::failure::Failure;
use producer::step_time::step_time_s;
use schemas::manifest::{Physics, RunManifest};
use std::io::{self, BufRead, IsTerminal, Write};
use std::time::Duration;

/// Bead-steps that take some seconds at most; a shorter run has no forecast.
const SHORT_WORK: f64 = 1e9;

/// Time for which a step is measured.
const PILOT: Duration = Duration::from_millis(5);

/// Work that takes longer than this (s) gets a notice.
const TOLD_S: f64 = 60.0;

/// Work that takes longer than this (s) needs a person's consent.
const ASKED_S: f64 = 3600.0;

/// Work that takes longer than this (s), a year, is a mistake.
const ABSURD_S: f64 = 365.0 * 86400.0;

/// A recording of at least this part of the free disk is asked about.
const ASKED_DISK: f64 = 0.2;

/// Least cost of a piece of work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Forecast {
    /// Wall time (s).
    wall_s: f64,
    /// Part of the free disk.
    disk: f64,
}

/// Decision about a forecast.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    GoOn,
    Ask,
    Refuse,
}

/// Wall time (s) that the run of `manifest` takes at least, found by making some steps; 0 of a short one.
pub fn computing_s(manifest: &RunManifest) -> f64 {
    Forecast::of_run(manifest, 0, Pace::Max, 0.0).wall_s
}

impl Forecast {
    /// Forecasts the steps of `manifest`'s run after `first_step` at `pace`, and a recording that takes the part `disk` of
    /// the free disk.
    pub(crate) fn of_run(manifest: &RunManifest, first_step: u64, pace: Pace, disk: f64) -> Self {
        let physics = &manifest.physics;
        let steps = physics.step_count.saturating_sub(first_step) as f64;
        let together = manifest.provenance.publish_every_steps;
        let computing_s = steps * per_step_s(physics, together, steps * work_per_step(physics));
        let paced_s = match pace {
            Pace::Max => 0.0,
            Pace::PerSecond(per_second) => steps * physics.dt_s / per_second,
        };
        Self { wall_s: computing_s.max(paced_s), disk }
    }

    /// Forecasts runs of `bead_steps` bead-steps altogether, each like that of `physics`, on `threads` cores.
    pub(crate) fn of_many(physics: &Physics, bead_steps: f64, threads: usize) -> Self {
        let work = bead_steps * f64::from(physics.method.force_evaluations_per_step());
        let per_step_s = per_step_s(physics, 1, work);
        let wall_s = bead_steps / physics.beads as f64 * per_step_s / threads.max(1) as f64;
        Self { wall_s, disk: 0.0 }
    }

    /// Prints a notice if the work is long, and asks on a terminal whether to begin, unless `yes` answers. Without a
    /// terminal a long run begins; only one of more than a year needs `yes`.
    ///
    /// # Errors
    /// When the person does not want it.
    pub(crate) fn confirm(self, yes: bool) -> Result<(), Failure> {
        let takes = format!("this takes at least {}", long_time(self.wall_s));
        if self.wall_s > TOLD_S {
            display::notice(&takes);
        }
        let is_terminal = io::stdin().is_terminal() && io::stderr().is_terminal();
        match self.verdict(yes, is_terminal) {
            Verdict::GoOn => Ok(()),
            Verdict::Ask if is_yes(&mut io::stdin().lock()) => Ok(()),
            Verdict::Ask => Err(bad_input!("not begun; --yes begins without a question")),
            Verdict::Refuse => Err(bad_input!(
                "{takes}, which looks like a mistake; take a shorter duration or fewer beads, or say --yes"
            )),
        }
    }

    fn verdict(self, yes: bool, is_terminal: bool) -> Verdict {
        let is_long = self.wall_s > ASKED_S || self.disk > ASKED_DISK;
        match (yes, is_terminal) {
            (false, true) if is_long => Verdict::Ask,
            (false, false) if self.wall_s > ABSURD_S => Verdict::Refuse,
            _ => Verdict::GoOn,
        }
    }
}

/// Force evaluations of a bead in a step of the whole chain.
fn work_per_step(physics: &Physics) -> f64 {
    physics.beads as f64 * f64::from(physics.method.force_evaluations_per_step())
}

/// Time (s) of a step, measured if there is enough `work`; else 0.
fn per_step_s(physics: &Physics, together: u64, work: f64) -> f64 {
    if work > SHORT_WORK { step_time_s(physics, together, PILOT) } else { 0.0 }
}

/// Asks whether to go on, and reads the answer from `input`; only a yes is one.
fn is_yes(input: &mut impl BufRead) -> bool {
    // an answer that cannot be read is a no
    let _ = write!(io::stderr(), "beadline: go on? [y/N] ");
    let _ = io::stderr().flush();
    let mut answer = String::new();
    let _ = input.read_line(&mut answer);
    matches!(answer.trim().to_lowercase().as_str(), "y" | "yes")
}

/// A rough time: as [`display::left`], beyond three days in days and in years.
fn long_time(seconds: f64) -> String {
    let days = seconds / 86400.0;
    match days {
        ..3.0 => display::left(seconds),
        ..1000.0 => format!("{days:.0} days"),
        _ => format!("{:.0} years", days / 365.25),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_there_is_asked_and_scripts_go_on() {
        let takes = |wall_s: f64, disk: f64| Forecast { wall_s, disk };
        let (short, long, absurd) = (takes(50.0, 0.1), takes(2.0 * ASKED_S, 0.0), takes(2.0 * ABSURD_S, 0.0));
        for (forecast, alone, at_terminal) in [
            (short, Verdict::GoOn, Verdict::GoOn),
            (takes(0.0, 0.3), Verdict::GoOn, Verdict::Ask),
            (long, Verdict::GoOn, Verdict::Ask),
            (absurd, Verdict::Refuse, Verdict::Ask),
        ] {
            assert_eq!(forecast.verdict(false, false), alone, "{forecast:?}");
            assert_eq!(forecast.verdict(false, true), at_terminal, "{forecast:?}");
            assert_eq!(forecast.verdict(true, true), Verdict::GoOn);
            assert_eq!(forecast.verdict(true, false), Verdict::GoOn);
        }
    }

    #[test]
    fn only_a_yes_is_one() {
        for (answer, expected) in
            [("y\n", true), ("Yes\n", true), ("\n", false), ("no\n", false), ("", false)]
        {
            assert_eq!(is_yes(&mut answer.as_bytes()), expected, "{answer:?}");
        }
    }

    #[test]
    fn long_times_are_told_in_days_and_years() {
        let told = [3600.0, 24.0 * 86400.0, 1e9].map(long_time);
        assert_eq!(told, ["1 h 0 min", "24 days", "32 years"]);
    }
}
