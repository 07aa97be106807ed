//! `--dt`: a time step, or how well it has to keep the energy.

use crate::display::{self, count, seconds};
use crate::failure::{BadInput, Failure};
use indicatif::ProgressBar;
use producer::time_step::{Pilot, Progress};
use schemas::config::RunConfig;

/// Time step that `--dt` asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum TimeStep {
    /// A step in seconds.
    Seconds(f64),
    /// `auto:TOL`: the longest step that keeps max|ΔE/E| within the tolerance.
    Auto(f64),
}

impl TimeStep {
    /// Reads `auto:TOL` or a number of seconds.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let Some(tolerance) = text.strip_prefix("auto:") else {
            let expected = "expected a number of seconds, or `auto:TOL` such as auto:1e-9";
            return text.parse().map(Self::Seconds).map_err(|_| expected.to_owned());
        };
        let allowed = |tolerance: &f64| (1e-16..=0.1).contains(tolerance);
        let tolerance = tolerance.parse().ok().filter(allowed).map(Self::Auto);
        tolerance.ok_or_else(|| "expected `auto:TOL` with a relative energy error of 1e-16 to 0.1".to_owned())
    }
}

/// Finds the step for `config`, whatever step that has, and what was measured, in words.
pub(crate) fn choose(config: &RunConfig, tolerance: f64) -> Result<(f64, String), Failure> {
    let mut shown = Shown(ProgressBar::hidden());
    let chosen = producer::time_step::choose(config, tolerance, &mut shown).bad_input()?;
    let measured = format!(
        "--dt auto:{tolerance:e} took dt = {:e} s: max|ΔE/E| = {:.1e} {}",
        chosen.dt_s,
        chosen.error,
        chosen.extent()
    );
    display::notice(&measured);
    Ok((chosen.dt_s, measured))
}

/// A bar for each pilot run, and a line of what it found.
struct Shown(ProgressBar);

impl Progress for Shown {
    fn trying(&mut self, dt_s: f64, steps: u64) {
        self.0 = display::progress_bar(steps, "trying");
        display::tell(&self.0, &[&format!("dt = {}", seconds(dt_s))]);
    }

    fn at(&mut self, step: u64) {
        self.0.set_position(step);
    }

    fn tried(&mut self, pilot: &Pilot) {
        self.0.finish_and_clear();
        let (dt, steps, error) = (seconds(pilot.dt_s), count(pilot.step_count), pilot.error);
        let extent = pilot.extent();
        notice!("tried dt = {dt} ({steps} steps): max|ΔE/E| = {error:.1e} {extent}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flag_takes_seconds_or_a_tolerance() {
        assert_eq!(TimeStep::parse("1e-6"), Ok(TimeStep::Seconds(1e-6)));
        assert_eq!(TimeStep::parse("auto:1e-9"), Ok(TimeStep::Auto(1e-9)));
        for wrong in ["auto", "auto:", "auto:0", "auto:-1e-9", "auto:nan", "auto:1", "soon"] {
            assert!(TimeStep::parse(wrong).is_err(), "{wrong}");
        }
    }
}
