//! Pieces of a step: a step ends where a drive has a knot, and goes on there.
//!
//! A jump within a step, or an action that is over within it, would be seen at the moments of the stages only. So the
//! step is made of several pieces, each of the method's own kind and from one knot to the next. A state is still one
//! of the grid of steps, and a function of the one before.

use crate::drives::When;
use schemas::drive::{APART, Drive, knots_of};

/// The places at which steps are divided.
#[derive(Debug, Clone, Default)]
pub(crate) struct Knots {
    /// Knots: the step, and the time (s) after its beginning.
    knots: Vec<(u64, f64)>,
    dt_s: f64,
}

/// A part of a step, or all of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    step: u64,
    /// Beginning and end of the piece (s after the beginning of the step).
    from_s: f64,
    to_s: f64,
    /// True if the piece ends with the step.
    is_last: bool,
    /// The distances (s) from its beginning and its end at which the drives are evaluated: beside the knots.
    inward_s: [f64; 2],
}

impl Knots {
    /// Makes the knots of `drives` in a run with steps of `dt_s`, for the dynamics `kernel_version`.
    pub(crate) fn of(drives: &[Drive], dt_s: f64, kernel_version: u32) -> Self {
        let knots = if kernel_version < 3 { Vec::new() } else { knots_of(drives, dt_s) };
        Self { knots, dt_s }
    }

    /// The first step from `step` on that has a knot in it, or at its beginning or end.
    pub(crate) fn next(&self, step: u64) -> Option<u64> {
        let (found, after_s) = *self.knots.get(self.first_of(step))?;
        // a knot at the beginning of a step is the end of the one before
        Some(if after_s == 0.0 && found > step { found - 1 } else { found })
    }

    /// The pieces of step `step`, one after the other.
    pub(crate) fn pieces(&self, step: u64) -> impl Iterator<Item = Piece> {
        let of_step = &self.knots[self.first_of(step)..self.first_of(step + 1)];
        let ends = self.knots.get(self.first_of(step + 1)).is_some_and(|next| *next == (step + 1, 0.0));
        let begins = of_step.first().is_some_and(|(_, after_s)| *after_s == 0.0);
        let within = &of_step[of_step.partition_point(|(_, after_s)| *after_s == 0.0)..];
        (0..=within.len()).map(move |i| {
            let (is_first, is_last) = (i == 0, i == within.len());
            let from_s = if is_first { 0.0 } else { within[i - 1].1 };
            let to_s = if is_last { self.dt_s } else { within[i].1 };
            let (near_s, quarter_s) = (2.0 * APART * self.dt_s, 0.25 * (to_s - from_s));
            let beside_s = if quarter_s < near_s { quarter_s } else { near_s };
            let beside = |is_at_knot: bool| if is_at_knot { beside_s } else { 0.0 };
            let inward_s = [beside(!is_first || begins), beside(!is_last || ends)];
            Piece { step, from_s, to_s, is_last, inward_s }
        })
    }

    fn first_of(&self, step: u64) -> usize {
        self.knots.partition_point(|(of, _)| *of < step)
    }
}

impl Piece {
    /// All of step `step` of `dt_s`.
    pub(crate) fn whole(step: u64, dt_s: f64) -> Self {
        Self { step, from_s: 0.0, to_s: dt_s, is_last: true, inward_s: [0.0; 2] }
    }

    /// Its length (s).
    pub(crate) fn length_s(&self) -> f64 {
        self.to_s - self.from_s
    }

    /// True if the piece begins at a knot, where drives act differently from before.
    pub(crate) fn begins_at_knot(&self) -> bool {
        self.inward_s[0] > 0.0
    }

    /// Its beginning.
    pub(crate) fn start(&self) -> When {
        let Self { step, from_s, inward_s: [beside_s, _], .. } = *self;
        When { step, after_s: from_s, from_s, since_s: 0.0, is_end: false, beside_s }
    }

    /// The moment `since_s` seconds after its beginning.
    pub(crate) fn within(&self, since_s: f64) -> When {
        When { since_s, after_s: self.from_s + since_s, beside_s: 0.0, ..self.start() }
    }

    /// Its end.
    pub(crate) fn end(&self) -> When {
        let beside_s = 0.0 - self.inward_s[1];
        When { after_s: self.to_s, since_s: self.length_s(), is_end: self.is_last, beside_s, ..self.start() }
    }
}
