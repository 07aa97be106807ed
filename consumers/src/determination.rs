//! Determination of a run: the time until which it is determined, and its digits. The run is compared with three twins, two
//! with half and a quarter of the step and one with initial velocities that differ in the last place, and with the tangent that
//! carries its roundings (`producer::twins` makes them).
//!
//! - The *error of the step* is taken as [`STEP_FACTOR`] times the larger difference to the twins with shorter steps,
//!   the largest of the last [`LOOKS`] looks, which is about T. Two things make one difference at one time too small.
//!   The error of a collision has a factor that depends on the places in a step at which the contact closes and opens.
//!   This factor may be small or of the other sign in a run and much the same in its twin. In a quarter of the step the
//!   error is 2^(2·(α+1)) times smaller at most, 32 times for α = 1.5, too small to hide that of the run. Also, if two
//!   states swing about each other, their differences go through zero. The estimate is 1.5 times the true error if the
//!   error falls as `dt`, and twice if it falls as `dt^(α+1)`.
//! - The *error of rounding* of displacements and velocities is the tangent: roundings of all steps, grown by the derivatives of the
//!   steps after them. Of energies and counts, and of a run without a tangent, it is the difference to the moved twin. In chaotic
//!   motion it grows exponentially, until nothing of the run is left: no step and no solver helps then.
//! - A quantity is *determined* until the last look before the sum of both errors first exceeds the tolerance. For displacements and
//!   velocities this is a prediction: the error of the step in it is that of the quartered twin, of which a sixteenth or less is left there if it
//!   falls as `dt²` or faster, and a quarter if it falls as `dt`, as it may where contacts are damped ([`UNTIL_FACTOR`], [`DAMPED_FACTOR`]).
//!   Errors are in units of a
//!   scale: L, v0, and `½·m·v0²`. A count is determined as long as all three agree, or agree at the next look: an event
//!   that comes a little earlier or later in a twin makes no other run. One in a hundred classes of contacts may differ
//!   ([`CONTACTS_APART`]): some contacts are always about to touch.
//! - *Chaos* bounds it if an exact step would win less than a quarter more time ([`WORTH_A_STEP`]); otherwise the
//!   *step* does. If the rounding error exceeds the tolerance without having grown by [`CHAOTIC`], *rounding* itself
//!   bounds it: the kick is too weak for the load that it meets.
//!
//! One pass, and memory that does not grow with the run: the [`Trail`] keeps at most [`Trail::CAPACITY`] samples.

mod course;
mod siblings;
mod trail;
mod words;

pub use course::{Bound, Course, Determined, digits};
pub use siblings::Quantity;
pub use trail::{Sample, Trail};
pub use words::{label, time, verdict};

use schemas::frame::Frame;
use schemas::manifest::{Physics, RunManifest};
use siblings::Sibling;
use std::collections::VecDeque;

/// The tolerance unless another is asked for: four digits, more than a figure shows.
pub const TOLERANCE: f64 = 1e-4;

/// The part of the contacts that may be in another class.
pub const CONTACTS_APART: f64 = 0.01;

/// The factor of the differences to the twins with shorter steps.
pub const STEP_FACTOR: f64 = 2.0;

/// The factor of the difference to the twin with a quarter of the step, in the prediction of displacements and velocities.
pub const UNTIL_FACTOR: f64 = 9.0 / 8.0;

/// The same where contacts are damped: an error that falls as `dt` itself leaves a quarter in the twin.
pub const DAMPED_FACTOR: f64 = 4.0 / 3.0;

/// Looks over which the error of the step is the largest.
pub const LOOKS: usize = 10;

/// A step so short that it does not count is worth it if it lengthens the determined time by this factor.
pub const WORTH_A_STEP: f64 = 1.25;

/// Chaos is a difference that has grown by this factor, which motion that is not chaotic does not reach.
pub const CHAOTIC: f64 = 1e6;

/// Time between two looks in units of the longest step that a run may have, a quarter of the collision time of its
/// lightest bead (or of the load): 0.1 T in a chain of equal beads, in which a pulse takes 1.5 T or more to pass one.
const LOOK_INTERVAL: f64 = 0.4;

/// Compares a run with its twins.
#[derive(Debug, Clone)]
pub struct Determination {
    physics: Physics,
    tolerance: f64,
    split_bead: u64,
    /// Initial difference of the moved twin from the run, in units of v0.
    moved_by: f64,
    /// The run, the halved, the quartered and the moved twin.
    siblings: [Sibling; 4],
    /// The errors of the step and of rounding, and both as predicted, of each quantity.
    courses: [[Course; 3]; Quantity::COUNT],
    /// The differences at the last look, to the twins with shorter steps and to the moved one.
    before: [[f64; Quantity::COUNT]; 2],
    /// Differences to the twins with shorter steps, the larger ones and those to the quartered twin, of the last looks.
    recent: VecDeque<[[f64; Quantity::COUNT]; 2]>,
    trail: Trail,
    last: Option<(u64, f64)>,
}

/// The result of the comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The tolerance, in units of the scales.
    pub tolerance: f64,
    /// The last step and its time (s) at which all three were compared.
    pub compared_until: (u64, f64),
    /// The bead that divides left from right.
    pub split_bead: u64,
    /// Each quantity that the run has.
    pub quantities: Vec<Determined>,
    /// Rate (1/s) at which the difference to the moved twin grows, where it grows exponentially.
    pub growth_per_s: Option<f64>,
}

impl Determination {
    /// Makes one for `manifest`'s run, which `split_bead` divides; `moved_by_m_s` is the initial difference of the moved
    /// twin.
    pub fn new(manifest: &RunManifest, split_bead: u64, tolerance: f64, moved_by_m_s: f64) -> Self {
        let physics = &manifest.physics;
        Self {
            tolerance,
            split_bead,
            moved_by: moved_by_m_s / physics.scales().speed_m_s(),
            siblings: std::array::from_fn(|_| Sibling::new(manifest, split_bead)),
            courses: [[Course::default(); 3]; Quantity::COUNT],
            before: [[0.0; Quantity::COUNT]; 2],
            recent: VecDeque::with_capacity(LOOKS),
            trail: Trail::default(),
            last: None,
            physics: physics.clone(),
        }
    }

    /// Steps between two looks.
    pub fn look_every_steps(physics: &Physics) -> u64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let steps = (LOOK_INTERVAL * physics.longest_dt_s() / physics.dt_s).round() as u64;
        steps.max(1)
    }

    /// Compares the states of the run, of the twins with half and a quarter of its step, and of the moved twin at one time; `rounded` are the changes of
    /// displacements (m), then of velocities (m/s), by roundings, if the run has a tangent.
    pub fn look(
        &mut self,
        run: &Frame<'_>,
        [halved, quartered]: [&Frame<'_>; 2],
        moved: &Frame<'_>,
        rounded: Option<&[f64]>,
    ) {
        let [of_run, of_halved, of_quartered, of_moved] = &mut self.siblings;
        of_run.look(run);
        let differences = [(of_halved, halved), (of_quartered, quartered), (of_moved, moved)];
        let [halved, quartered, mut moved] = differences.map(|(sibling, frame)| {
            sibling.look(frame);
            of_run.differences(run, sibling, frame)
        });
        let shorter = std::array::from_fn(|i| larger(halved[i], quartered[i]));
        if let Some(rounded) = rounded {
            of_run.put_changes(rounded, &mut moved);
        }
        self.recent.truncate(LOOKS - 1);
        self.recent.push_front([shorter, quartered]);
        let of_looks =
            |which: usize, i: usize| self.recent.iter().map(|look| look[which][i]).fold(0.0, larger);
        let (mut step, mut rounding) = ([0.0; Quantity::COUNT], [0.0; Quantity::COUNT]);
        for (i, quantity) in Quantity::ALL.into_iter().enumerate() {
            (step[i], rounding[i]) = if quantity.is_count() {
                (shorter[i].min(self.before[0][i]), moved[i].min(self.before[1][i]))
            } else {
                (STEP_FACTOR * of_looks(0, i), moved[i])
            };
            let tolerance = self.tolerance_of(quantity);
            let both = match quantity {
                _ if quantity.is_count() => larger(step[i], rounding[i]),
                _ if quantity.is_of_beads() => self.until_factor() * of_looks(1, i) + rounding[i],
                _ => step[i] + rounding[i],
            };
            for (course, error) in self.courses[i].iter_mut().zip([step[i], rounding[i], both]) {
                course.take(run.time_s, error, tolerance);
            }
        }
        self.before = [shorter, moved];
        self.trail.push(Sample { time_s: run.time_s, step, rounding });
        self.last = Some((run.step, run.time_s));
    }

    /// The factor of the difference to the quartered twin in the prediction of displacements and velocities.
    fn until_factor(&self) -> f64 {
        if self.physics.damping.is_some() { DAMPED_FACTOR } else { UNTIL_FACTOR }
    }

    /// The largest error with which a quantity is determined.
    fn tolerance_of(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Contacts => CONTACTS_APART * (self.physics.beads - 1) as f64,
            _ if quantity.is_count() => 0.0,
            _ => self.tolerance,
        }
    }

    /// The course of the errors.
    pub fn trail(&self) -> &Trail {
        &self.trail
    }

    /// The result; none before the first look.
    pub fn outcome(&self) -> Option<Outcome> {
        let compared_until = self.last?;
        let rules_out =
            |quantity: &Quantity| *quantity == Quantity::Reflected && !self.siblings[0].reflects();
        let quantities = Quantity::ALL.into_iter().zip(self.courses);
        let quantities = quantities.filter(|(quantity, _)| !rules_out(quantity));
        Some(Outcome {
            tolerance: self.tolerance,
            compared_until,
            split_bead: self.split_bead,
            quantities: quantities
                .map(|(quantity, courses)| Determined::new(quantity, courses, self.moved_by))
                .collect(),
            growth_per_s: self.trail.growth_per_s(CHAOTIC * self.moved_by),
        })
    }

    /// The physics of the run.
    pub fn physics(&self) -> &Physics {
        &self.physics
    }
}

/// The larger number; `b` is not NaN.
fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

impl Outcome {
    /// The quantity that is determined for the shortest time, if one is not determined to the end.
    pub fn first_lost(&self) -> Option<&Determined> {
        let lost = self.quantities.iter().filter(|each| each.until_s.is_some());
        lost.min_by(|a, b| a.until_s.partial_cmp(&b.until_s).unwrap_or(std::cmp::Ordering::Equal))
    }

    /// The result for one quantity, if the run has it.
    pub fn of(&self, quantity: Quantity) -> Option<&Determined> {
        self.quantities.iter().find(|each| each.quantity == quantity)
    }
}

#[cfg(test)]
mod tests;
