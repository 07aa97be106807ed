//! Judgement of a claim: a verdict with its reason and numbers.

use consumers::uncertain::Uncertain;
use serde::Serialize;
use std::fmt;

/// Verdict on a statement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It is so.
    Reproduced,
    /// It is so in kind, but a number or a condition has to be put right.
    Corrected,
    /// It is not so.
    NotSo,
}

impl Verdict {
    /// [`Reproduced`](Self::Reproduced) or [`NotSo`](Self::NotSo).
    pub(super) fn of(holds: bool) -> Self {
        if holds { Self::Reproduced } else { Self::NotSo }
    }

    /// [`Reproduced`](Self::Reproduced) if the statement holds to the letter, [`Corrected`](Self::Corrected) if only
    /// its core does.
    pub(super) fn graded(heart: bool, letter: bool) -> Self {
        match (heart, letter) {
            (true, true) => Self::Reproduced,
            (true, false) => Self::Corrected,
            (false, _) => Self::NotSo,
        }
    }

    /// The words of the report.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::Corrected => "reproduced with a correction",
            Self::NotSo => "not so",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// The outcome of judging a claim.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// Why, in one sentence.
    pub why: String,
    /// The numbers behind the verdict.
    pub numbers: Vec<Number>,
}

/// A number of ours.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Number {
    /// Name of the quantity.
    pub what: String,
    /// The value.
    pub value: f64,
    /// Its unit, empty for a ratio or a count.
    pub unit: &'static str,
    /// Its uncertainty; absent for counts, and where nobody knows it.
    pub uncertainty: Option<Uncertainty>,
    /// Values of a count in runs that ought to give the same.
    pub range: Option<Range>,
    /// The value that others computed.
    pub reference: Option<Reference>,
}

/// Uncertainty of a number, and its origin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Uncertainty {
    /// Half the width of the interval, in the unit of the number.
    pub plus_minus: f64,
    /// Its origin.
    pub from: &'static str,
}

/// A count in a run and in its partners.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Range {
    /// The least of these counts.
    pub least: f64,
    /// The largest.
    pub most: f64,
    /// The partners, in words.
    pub from: &'static str,
}

/// A number that Beadline did not compute.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reference {
    /// The value.
    pub value: f64,
    /// Its error, in the unit of the number.
    pub good_to: f64,
}

impl Number {
    /// A number of unknown uncertainty.
    pub(super) fn new(what: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self { what: what.into(), value, unit, uncertainty: None, range: None, reference: None }
    }

    /// A number from a run and from the same run with twice the step and frames half as often. The difference is the
    /// uncertainty, and overestimates it: both errors fall faster than the step. Two runs may agree by chance, so the
    /// uncertainty is at least the error of the energy in the first run, the part `drift`.
    pub(super) fn stepped(
        what: impl Into<String>,
        (fine, coarse): (f64, f64),
        unit: &'static str,
        drift: f64,
    ) -> Self {
        Self::new(what, fine, unit).give_or_take((fine - coarse).hypot(drift * fine), FROM_STEP)
    }

    /// A count in a run, and in its partners.
    pub(super) fn count(what: impl Into<String>, count: &Counted) -> Self {
        let range = Range { least: count.least as f64, most: count.most as f64, from: FROM_PARTNERS };
        Self { range: Some(range), ..Self::new(what, count.count as f64, "") }
    }

    /// A number with its uncertainty and the origin of that.
    pub(super) fn known(
        what: impl Into<String>,
        found: Uncertain,
        unit: &'static str,
        from: &'static str,
    ) -> Self {
        Self::new(what, found.value, unit).give_or_take(found.plus_minus, from)
    }

    /// Adds an uncertainty.
    pub(super) fn give_or_take(mut self, plus_minus: f64, from: &'static str) -> Self {
        self.uncertainty = Some(Uncertainty { plus_minus: plus_minus.abs(), from });
        self
    }

    /// Adds a reference that is good to the part `relative` of itself.
    pub(super) fn against(mut self, value: f64, relative: f64) -> Self {
        self.reference = Some(Reference { value, good_to: (relative * value).abs() });
        self
    }

    /// Adds a reference that is good to `good_to`, in the unit of the number.
    pub(super) fn against_within(mut self, value: f64, good_to: f64) -> Self {
        self.reference = Some(Reference { value, good_to });
        self
    }

    /// Its uncertainty as a part of it; 0 if it has none.
    pub(super) fn relative_uncertainty(&self) -> f64 {
        self.uncertainty.map_or(0.0, |found| found.plus_minus / self.value.abs())
    }

    /// True if it differs from its reference by more than three times their uncertainties.
    pub fn contradicts_reference(&self) -> bool {
        let ours = self.uncertainty.map_or(0.0, |uncertainty| uncertainty.plus_minus);
        self.reference.is_some_and(|reference| {
            let both = ours.hypot(reference.good_to);
            let difference = (self.value - reference.value).abs();
            difference > 3.0 * both || difference.is_nan()
        })
    }
}

/// Origin of the uncertainty of [`Number::stepped`].
pub(super) const FROM_STEP: &str =
    "a run with twice the step, recorded half as often, and from the error of the energy";

/// Runs that [`Counted`] compares.
pub(super) const FROM_PARTNERS: &str = "Counts are the same in this run, in one with twice the step, and in one whose striker is one unit in the last place \
     faster, unless brackets give the least and the most of them.";

/// A count in a run and in its partners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Counted {
    /// In the run itself.
    pub(super) count: usize,
    /// The least of all.
    pub(super) least: usize,
    /// The most of all.
    pub(super) most: usize,
}

impl Counted {
    /// The first of `counts` is that of the run itself.
    pub(super) fn of(counts: &[usize]) -> Self {
        let least = counts.iter().copied().min().unwrap_or(0);
        let most = counts.iter().copied().max().unwrap_or(0);
        Self { count: counts.first().copied().unwrap_or(0), least, most }
    }

    /// Two flags. The first is true if counts grow from the first to the last, and from each to the next as far as
    /// their ranges tell them apart. The second is true if they grow from each to the next in every combination of the
    /// runs.
    pub(super) fn grow(counts: &[Self]) -> (bool, bool) {
        let pairs = || counts.windows(2);
        let overlap = |pair: &[Self]| pair[0].least <= pair[1].most && pair[0] != pair[1];
        let in_all = counts.first().zip(counts.last()).is_some_and(|(first, last)| first.count < last.count);
        let grow = in_all && pairs().all(|pair| pair[0].count < pair[1].count || overlap(pair));
        (grow, pairs().all(|pair| pair[0].most < pair[1].least))
    }
}

/// `21`, or `21 (20–22)` where it is not the same in all runs.
impl fmt::Display for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.count)?;
        if self.least < self.most { write!(f, " ({}–{})", self.least, self.most) } else { Ok(()) }
    }
}

/// Gives each of several numbers of one kind the largest relative uncertainty of them: two runs may agree in one
/// number by chance.
pub(super) fn pool_uncertainty(numbers: &mut [Number]) {
    let largest = numbers.iter().map(Number::relative_uncertainty).fold(0.0, f64::max);
    for number in numbers {
        if let Some(found) = &mut number.uncertainty {
            found.plus_minus = largest * number.value.abs();
        }
    }
}

/// Reason why a study cannot be made from the observations.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// A run of the study was not observed.
    #[error("the run `{run}` was not observed")]
    NotObserved {
        /// The run.
        run: String,
    },
    /// The quantity of the study does not occur in the run.
    #[error("{run}: there is no {what} to be measured")]
    Absent {
        /// The run.
        run: String,
        /// The missing quantity.
        what: String,
    },
    /// A theory has no answer.
    #[error(transparent)]
    Wave(#[from] consumers::theory::WaveError),
    /// A wave cannot be scaled.
    #[error(transparent)]
    Scale(#[from] consumers::theory::ScaleError),
    /// A reference file of ours is broken.
    #[error("the reference {file} has no row {row}")]
    NoReference {
        /// The file.
        file: &'static str,
        /// The row.
        row: String,
    },
    /// The rows of a sweep are not those of this program.
    #[error("a sweep's rows have no column `{name}` of doubles; this is a fault of ours")]
    NoColumn {
        /// The column.
        name: String,
    },
    /// A figure's raster is broken.
    #[error("the figure cannot be drawn: {reason}")]
    Figure {
        /// The reason that the drawing gave.
        reason: String,
    },
}

impl StudyError {
    /// There is no such thing in that run.
    pub(super) fn absent(run: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Absent { run: run.into(), what: what.into() }
    }
}

impl From<figure::FigureError> for StudyError {
    fn from(error: figure::FigureError) -> Self {
        Self::Figure { reason: error.to_string() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_contradicts_a_reference_that_is_too_far_for_both() {
        let number =
            |value: f64| Number::new("v", value, "m/s").give_or_take(3e-3, "test").against(2.0, 2e-3);
        // √(3² + 4²) = 5 thousandths, three times
        assert!(!number(2.0149).contradicts_reference() && !number(1.9851).contradicts_reference());
        assert!(number(2.0151).contradicts_reference() && number(f64::NAN).contradicts_reference());
        assert!(!Number::new("n", 7.0, "").contradicts_reference());
    }

    /// Two runs that agree by chance do not make a number exact.
    #[test]
    fn no_agreement_is_better_than_the_energy() {
        let by_chance = Number::stepped("v", (2.0, 2.0), "m/s", 4e-8);
        assert_eq!(by_chance.uncertainty.unwrap().plus_minus, 8e-8);
        let apart = Number::stepped("v", (2.0, 2.3), "m/s", 0.2);
        assert!((apart.uncertainty.unwrap().plus_minus - 0.5).abs() < 1e-15);
    }

    #[test]
    fn a_count_says_what_it_is_in_other_runs() {
        let [same, other] = [Counted::of(&[6, 6, 6]), Counted::of(&[21, 20, 22])];
        assert_eq!((same.to_string().as_str(), other.to_string().as_str()), ("6", "21 (20–22)"));
        assert_eq!(Counted::grow(&[same, other]), (true, true));
        assert_eq!(Counted::grow(&[other, Counted::of(&[22, 22, 23])]), (true, false));
        assert_eq!(Counted::grow(&[same, same]), (false, false));
        // 18 to 19 and 17 to 18 may be the same, 6 and 6 are
        let [more, fewer] = [Counted::of(&[18, 19]), Counted::of(&[17, 18])];
        assert_eq!(Counted::grow(&[same, more, fewer]), (true, false));
        assert_eq!(Counted::grow(&[more, same, fewer]), (false, false));
    }

    #[test]
    fn verdicts_are_graded() {
        assert_eq!(Verdict::graded(true, true), Verdict::Reproduced);
        assert_eq!(Verdict::graded(true, false), Verdict::Corrected);
        assert_eq!(Verdict::graded(false, true), Verdict::NotSo);
    }
}
