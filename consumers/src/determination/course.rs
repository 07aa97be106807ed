//! Course of the errors of one quantity.

use super::{CHAOTIC, Quantity, WORTH_A_STEP};
use serde::Serialize;

/// Course of one error of a quantity, in units of its scale.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Course {
    /// The time (s) of the last look before it first exceeded the tolerance; none if it never did.
    pub until_s: Option<f64>,
    /// At the last look.
    pub at_end: f64,
    /// The largest.
    pub worst: f64,
    /// When that was (s).
    pub worst_at_s: f64,
    /// The time (s) of the last look.
    #[serde(skip)]
    last_s: f64,
}

impl Course {
    /// The next look found `error`.
    pub(super) fn take(&mut self, time_s: f64, error: f64, tolerance: f64) {
        if self.until_s.is_none() && error > tolerance {
            self.until_s = Some(self.last_s);
        }
        if error > self.worst {
            (self.worst, self.worst_at_s) = (error, time_s);
        }
        (self.at_end, self.last_s) = (error, time_s);
    }
}

/// Reason for the end of the time for which a quantity is determined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// The step: a shorter one helps.
    Step,
    /// Chaos: neither a shorter step nor another solver helps.
    Chaos,
    /// Rounding, from the beginning: the disturbance is too weak for the load that it meets.
    Rounding,
}

impl Bound {
    /// The word used in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Chaos => "chaos",
            Self::Rounding => "rounding",
        }
    }
}

/// Time until which a quantity is determined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Determined {
    /// Which.
    pub quantity: Quantity,
    /// The time (s); none if it is determined to the end.
    pub until_s: Option<f64>,
    /// Reason for the end of that time, if it ends.
    pub bound: Option<Bound>,
    /// Course of the error of the step.
    pub step: Course,
    /// Course of the error of rounding.
    pub rounding: Course,
}

impl Determined {
    /// The result from the courses of the errors of step and rounding and of both; the moved twin was moved by `moved_by` v0.
    pub(super) fn new(quantity: Quantity, [step, rounding, both]: [Course; 3], moved_by: f64) -> Self {
        let bound = both.until_s.map(|until_s| match rounding.until_s {
            Some(rounding_s) if rounding_s <= WORTH_A_STEP * until_s => {
                if rounding.worst < CHAOTIC * moved_by { Bound::Rounding } else { Bound::Chaos }
            }
            _ => Bound::Step,
        });
        Self { quantity, until_s: both.until_s, bound, step, rounding }
    }

    /// The larger error at the end.
    pub fn at_end(&self) -> f64 {
        self.step.at_end.max(self.rounding.at_end)
    }

    /// The largest error at any time.
    pub fn worst(&self) -> f64 {
        self.step.worst.max(self.rounding.worst)
    }
}

/// The decimal digits, behind the point and in units of the scale, that an error leaves: all 15 of a double at most.
pub fn digits(error: f64) -> u32 {
    let digits = (-error.log10()).floor();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 15")]
    let digits = if digits.is_nan() { 0 } else { digits.clamp(0.0, 15.0) as u32 };
    digits
}
