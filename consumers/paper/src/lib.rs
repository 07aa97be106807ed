//! The paper, figure by figure and claim by claim.
//!
//! A [`Study`] is one figure with the claims that go with it. It says which [`Run`]s it needs; whoever
//! simulates them feeds their frames to an [`Observer`]; from what was [`Observed`] the study draws its figure and
//! judges its claims. A [`Verdict`] is always computed: from our numbers, and from a criterion or an
//! independent reference.
//!
//! [`cache`] keeps recordings of the runs, [`workers`] simulates and observes several at a time, and [`report`] and
//! [`markdown`] say what was found.
//!
//! # Source
//! E. Hascoët and H. J. Herrmann, *Shocks in non-loaded bead chains with impurities*.

pub mod cache;
mod crossing;
mod deform;
mod energies;
mod front;
mod heavy;
mod judgement;
mod light;
mod maps;
pub mod markdown;
mod observe;
mod others;
mod passing;
mod profile;
pub mod progress;
mod rattle;
mod reference;
mod reflection;
pub mod report;
mod runs;
mod scaling;
mod speed;
mod strikers;
mod studies;
mod study;
mod transient;
pub mod workers;

pub use front::Front;
pub use judgement::{Judgement, Number, Range, Reference, StudyError, Uncertainty, Verdict};
pub use observe::{KeptFrame, Observations, Observed, Observer};
pub use reflection::{Reflected, refined_sweep, reflection_sweep};
pub use runs::{FrontBy, Run, Watch};
pub use studies::STUDIES;
pub use study::{Claim, Study};
