//! What the paper is taken apart into.

use super::judgement::{Judgement, StudyError};
use super::observe::Observations;
use super::runs::Run;
use figure::Figure;

/// One figure with its claims.
#[derive(Debug, Clone, Copy)]
pub struct Study {
    /// Its name on the command line and in files.
    pub slug: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// The label of the figure in the paper, or the passage that it stands for.
    pub place: &'static str,
    /// The runs that it needs.
    pub runs: fn() -> Vec<Run>,
    /// Whether it needs the sweep of [`super::reflection_sweep`].
    pub sweep: bool,
    /// Draws the figure.
    pub draw: fn(&Observations) -> Result<Figure, StudyError>,
    /// What the paper says about it.
    pub claims: &'static [Claim],
}

/// A statement of the paper, and how to judge it.
#[derive(Debug, Clone, Copy)]
pub struct Claim {
    /// A short name that stays the same: `light-almost-same-amplitudes`.
    pub id: &'static str,
    /// Where in the paper it stands.
    pub place: &'static str,
    /// The paper's words, with its formulas in plain text.
    pub quote: &'static str,
    /// Compares the statement with the observations.
    pub judge: fn(&Observations) -> Result<Judgement, StudyError>,
}
