//! Studies: the paper by figures and claims.

use super::judgement::{Judgement, StudyError};
use super::observe::Observations;
use super::runs::Run;
use figure::Figure;

/// One figure with its claims.
#[derive(Debug, Clone, Copy)]
pub struct Study {
    /// Its name on the command line and in files.
    pub slug: &'static str,
    /// Title of the figure.
    pub title: &'static str,
    /// The label of the figure in the paper, or the passage that it stands for.
    pub place: &'static str,
    /// The runs that it needs.
    pub runs: fn() -> Vec<Run>,
    /// True if it needs the sweep of [`super::reflection_sweep`].
    pub sweep: bool,
    /// Draws the figure.
    pub draw: fn(&Observations) -> Result<Figure, StudyError>,
    /// The claims of the paper about it.
    pub claims: &'static [Claim],
}

/// A statement of the paper, and how to judge it.
#[derive(Debug, Clone, Copy)]
pub struct Claim {
    /// A short name that stays the same: `light-almost-same-amplitudes`.
    pub id: &'static str,
    /// Its place in the paper.
    pub place: &'static str,
    /// The paper's words, with its formulas in plain text.
    pub quote: &'static str,
    /// Compares the statement with the observations.
    pub judge: fn(&Observations) -> Result<Judgement, StudyError>,
}
