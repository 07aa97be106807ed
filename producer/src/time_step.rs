//! `--dt auto:TOL`: the longest time step that keeps the energy well enough, found by trying.
//!
//! Pilot runs of the configured chain measure max|ΔE/E|; each step length follows from the error before it and
//! the order of the method. Nothing depends on a clock, so that the same configuration gets the same step.

use crate::energy_error::energy_error;
use schemas::config::{ConfigError, RunConfig};
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::power::power;

/// Most pilot runs of a search.
const MOST_PILOTS: u32 = 10;

/// Work of one pilot run at most, in force evaluations of one bead: some seconds.
const MOST_WORK: f64 = 2e9;

/// Shortest pilot run, in collision times, that counts if it is cut short: the first collisions make the largest
/// errors.
const SHORTEST_PILOT_T: f64 = 10.0;

/// Factor by which an accepted error must be below the tolerance to make a longer step worth a try.
const WASTEFUL: f64 = 10.0;

/// Factor by which the errors of two runs may differ because contacts open at different places of a step.
const LUCK: f64 = 3.0;

/// Receives the progress of the pilot runs.
pub trait Progress {
    /// A run of so many steps of this length (s) begins.
    fn trying(&mut self, dt_s: f64, steps: u64);
    /// The run has come to this step.
    fn at(&mut self, step: u64);
    /// The run has ended.
    fn tried(&mut self, pilot: &Pilot);
}

/// Finds the step for `config`, whose own step does not matter. Returns the pilot run with that step.
///
/// # Errors
/// When `config` is no run, or when no step keeps to the tolerance.
pub fn choose(config: &RunConfig, tolerance: f64, progress: &mut dyn Progress) -> Result<Pilot, Refusal> {
    let with_step = |dt_s: Option<f64>| {
        let mut config = config.clone();
        config.time.dt_s = dt_s;
        Physics::resolve(&config)
    };
    let by_default = with_step(None)?;
    let search = Search {
        tolerance,
        order: order(&by_default),
        method: by_default.method,
        first_s: by_default.dt_s,
        longest_s: by_default.longest_dt_s().min(config.time.duration_s),
    };
    let duration_s = config.time.duration_s;
    search.run(|dt_s: f64| {
        let (dt_s, _) = by_default.whole_steps(duration_s, Some(dt_s))?;
        Ok(measure(&with_step(Some(dt_s))?, progress))
    })
}

/// Order at which the error falls with the step: that of the method, but at most α + 1, because contacts open, and at
/// most p + 1 with damping by δ^p.
fn order(physics: &Physics) -> f64 {
    let by_contacts = f64::from(physics.method.order()).min(physics.smallest_alpha() + 1.0);
    physics.damping.map_or(by_contacts, |damping| by_contacts.min(damping.exponent(physics.alpha) + 1.0))
}

/// Result of a pilot run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pilot {
    /// Its step (s).
    pub dt_s: f64,
    /// Number of steps of the whole run with this step.
    pub step_count: u64,
    /// max|ΔE/E|, infinite where the run left the range of doubles.
    pub error: f64,
    /// The part of the run that was made.
    fraction: f64,
    /// True if that part was long enough to count.
    is_telling: bool,
}

impl Pilot {
    fn as_best(self) -> String {
        format!("the best that was found is max|ΔE/E| = {:.1e} at dt = {:e} s", self.error, self.dt_s)
    }

    /// The part of the run that was made, in words.
    pub fn extent(self) -> String {
        if self.fraction < 1.0 {
            format!("in the first {:.2} % of the run", 100.0 * self.fraction)
        } else {
            "in the whole run".to_owned()
        }
    }
}

/// Makes a pilot run: the whole run of `physics`, or as much of it as the bound on work allows.
fn measure(physics: &Physics, progress: &mut dyn Progress) -> Pilot {
    let time_s = physics.scales().time_s;
    let work_per_step = physics.beads as f64 * f64::from(physics.method.force_evaluations_per_step());
    let most_steps = whole(MOST_WORK / work_per_step);
    // a hundred looks in a collision time, which for α > 5 is shorter
    let between_looks_s = 0.01 * time_s * (5.0 / physics.alpha).min(1.0);
    let look_every = whole(between_looks_s / physics.dt_s).max(1);
    progress.trying(physics.dt_s, most_steps.min(physics.step_count));
    let found = energy_error(physics, most_steps, look_every, |step| progress.at(step));
    let fraction = found.steps as f64 / physics.step_count as f64;
    // the error of a symplectic method stays; that of others grows with time at most
    let growth = if physics.method.is_symplectic() { 1.0 } else { 1.0 / fraction };
    let is_long = found.steps as f64 * physics.dt_s >= SHORTEST_PILOT_T * time_s;
    let pilot = Pilot {
        dt_s: physics.dt_s,
        step_count: physics.step_count,
        error: found.largest * growth,
        fraction,
        is_telling: fraction == 1.0 || is_long || found.largest.is_infinite(),
    };
    progress.tried(&pilot);
    pilot
}

/// The largest whole number up to `value`.
fn whole(value: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, as wanted")]
    let whole = value as u64;
    whole
}

/// Reason why there is no step for a tolerance.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// Not a run.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Shorter steps do not help any more.
    #[error(
        "--dt auto:{tolerance:e} is out of reach: shorter steps do not help any more, because of rounding; {}; ask for auto:{:.0e}",
        .best.as_best(), 10.0 * .best.error
    )]
    Rounding {
        /// The requested tolerance.
        tolerance: f64,
        /// The best run found.
        best: Pilot,
    },
    /// The steps that would help are too many to try.
    #[error(
        "--dt auto:{tolerance:e} is out of reach: steps that short are too many to try with {method}; {}; ask for less, take \
         another --method, or give --dt in seconds",
        .best.as_best()
    )]
    TooMany {
        /// The requested tolerance.
        tolerance: f64,
        /// The method of the steps.
        method: Method,
        /// The best run found.
        best: Pilot,
    },
}

/// A search for the longest step whose error is within a tolerance, as closely as a further run is worth.
#[derive(Debug, Clone, Copy)]
struct Search {
    tolerance: f64,
    method: Method,
    /// The error is expected to fall like dt to this power.
    order: f64,
    first_s: f64,
    longest_s: f64,
}

impl Search {
    fn run(self, mut pilot: impl FnMut(f64) -> Result<Pilot, Refusal>) -> Result<Pilot, Refusal> {
        let (mut good, mut bad): (Option<Pilot>, Option<Pilot>) = (None, None);
        let mut dt_s = self.first_s;
        for _ in 0..MOST_PILOTS {
            let tried = pilot(dt_s)?;
            if !tried.is_telling {
                // what is off in a part of the run is off in the whole of it
                let part = Pilot { error: tried.error * tried.fraction, ..tried };
                if let (None, Some(best)) = (good, bad.filter(|before| self.is_rounding(*before, part))) {
                    return Err(self.rounding(best));
                }
                return good.ok_or(self.too_many(bad.unwrap_or(tried)));
            }
            if tried.error <= self.tolerance {
                good = Some(tried);
                if tried.error * WASTEFUL >= self.tolerance || dt_s >= self.longest_s {
                    return Ok(tried);
                }
            } else if let (None, Some(best)) = (good, bad.filter(|before| self.is_rounding(*before, tried))) {
                return Err(self.rounding(if tried.error < best.error { tried } else { best }));
            } else {
                bad = Some(tried);
            }
            dt_s = (dt_s * self.factor(tried.error)).min(self.longest_s);
            let (Some(good), Some(bad)) = (good, bad) else { continue };
            if bad.dt_s < 1.5 * good.dt_s {
                return Ok(good);
            }
            if dt_s <= good.dt_s || dt_s >= bad.dt_s {
                dt_s = (good.dt_s * bad.dt_s).sqrt();
            }
        }
        match (good, bad) {
            (Some(good), _) => Ok(good),
            (None, Some(bad)) => Err(self.too_many(bad)),
            (None, None) => pilot(self.first_s),
        }
    }

    fn rounding(self, best: Pilot) -> Refusal {
        Refusal::Rounding { tolerance: self.tolerance, best }
    }

    fn too_many(self, best: Pilot) -> Refusal {
        Refusal::TooMany { tolerance: self.tolerance, method: self.method, best }
    }

    /// Factor by which to change a step with this error, to come to half the tolerance.
    fn factor(self, error: f64) -> f64 {
        if error.is_infinite() {
            return 0.25;
        }
        let ratio = (0.5 * self.tolerance / error).clamp(1e-12, 1e12);
        power(ratio, 1.0 / self.order).clamp(1.0 / 32.0, 8.0)
    }

    /// True if a much shorter step gains less than half of the order promises, luck aside: then the error is not that
    /// of the method.
    fn is_rounding(self, before: Pilot, tried: Pilot) -> bool {
        let shorter = before.dt_s / tried.dt_s;
        shorter >= 2.0 && before.error / tried.error * LUCK < power(shorter, 0.5 * self.order)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEARCH: Search =
        Search { tolerance: 1e-8, order: 2.5, method: Method::Rkn4, first_s: 0.02, longest_s: 0.25 };

    /// A run whose error is `coefficient·dt^2.5`, but for a `floor` that rounding leaves.
    fn run(coefficient: f64, floor: f64, search: Search) -> (Result<Pilot, Refusal>, u32) {
        let mut pilots = 0;
        let found = search.run(|dt_s| {
            pilots += 1;
            let error = coefficient * dt_s.powf(2.5) + floor / dt_s.sqrt();
            // steps below 1e-5 are too many
            Ok(Pilot { dt_s, step_count: 1, error, fraction: 1.0, is_telling: dt_s > 1e-5 })
        });
        (found, pilots)
    }

    #[test]
    fn the_step_found_is_nearly_the_longest_that_will_do() {
        for coefficient in [1e-9, 1e-6, 7e-4, 0.1, 30.0] {
            let (found, pilots) = run(coefficient, 0.0, SEARCH);
            let longest = (1e-8_f64 / coefficient).powf(0.4).min(0.25);
            let dt_s = found.expect("reachable").dt_s;
            assert!(dt_s <= longest && dt_s > 0.39 * longest, "{coefficient}: {dt_s}, not {longest}");
            assert!(pilots <= 4, "{pilots} pilots");
        }
    }

    #[test]
    fn a_run_that_goes_astray_is_tried_with_shorter_steps() {
        let found = SEARCH.run(|dt_s| {
            let error = if dt_s > 1e-3 { f64::INFINITY } else { 1e-9 };
            Ok(Pilot { dt_s, step_count: 1, error, fraction: 1.0, is_telling: true })
        });
        let dt_s = found.expect("reachable").dt_s;
        assert!(dt_s <= 1e-3 && dt_s > 0.24e-3, "{dt_s}");
    }

    #[test]
    fn what_is_out_of_reach_is_refused_with_the_best_there_is() {
        let (rounding, _) = run(1e-3, 1e-13, Search { tolerance: 1e-15, ..SEARCH });
        let Err(Refusal::Rounding { best, .. }) = rounding else { panic!("{rounding:?}") };
        assert!(best.error < 1e-10, "{best:?}");
        let (many, _) = run(1e3, 0.0, Search { tolerance: 1e-12, ..SEARCH });
        assert!(matches!(many, Err(Refusal::TooMany { .. })), "{many:?}");
    }
}
