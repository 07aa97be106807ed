//! The time integration methods, and a table of what each can do.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A rule by which a state is advanced by one time step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Velocity Verlet.
    VelocityVerlet,
    /// Runge–Kutta–Nyström splitting of Blanes and Moan.
    Rkn4,
    /// Gear's predictor-corrector on six values.
    ///
    /// Its `extra` is `[q2 | q3 | q4 | q5]` with `q_k = dt^k/k!·d^k u/dt^k` (m), N values each: the second to the fifth derivative of the
    /// displacement, each as a term of its Taylor series over one time step. So the acceleration of bead `i` is `2·q2[i]/dt²`.
    Gear5,
    /// Dormand's and Prince's Runge–Kutta method.
    Rk5,
}

/// A feature of a run that not every method takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feature {
    /// Forces of contacts that depend on velocities.
    Damping,
    /// Forces on beads that depend on their velocities.
    Drag,
    /// Contacts of other forces than one power of one exponent.
    OtherLaws,
    /// Springs that hold beads at their places.
    OnSite,
    /// Masses that swing in the beads.
    Resonators,
    /// A last bead that touches the first one.
    Ring,
    /// Walls and beads that are moved or pushed.
    Drives,
    /// Beads that baths slow down and shake.
    Baths,
}

impl fmt::Display for Feature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Damping => "[damping]",
            Self::Drag => "drag, as absorbing ends have",
            Self::OtherLaws => "alphas, second or bonds",
            Self::OnSite => "[on_site]",
            Self::Resonators => "[resonators]",
            Self::Ring => "periodic ends",
            Self::Drives => "[[drive]]",
            Self::Baths => "[[bath]]",
        })
    }
}

/// A row of the table of methods.
#[derive(Debug)]
struct Row {
    method: Method,
    name: &'static str,
    order: u32,
    force_evaluations: u32,
    is_symplectic: bool,
    extra_per_bead: usize,
    /// True if manifests of version 1.0 do not have it.
    is_since_1_1: bool,
    takes: &'static [Feature],
    /// The feature that it took in version 1.0 and takes no more.
    took: Option<Feature>,
    /// The default step in collision times, and true if contacts that open shorten it.
    step: (f64, bool),
    /// The most of that for α = 1.5 and its growth with α, where a chain is none of the paper's and contacts open at full speed.
    blunt: Option<(f64, f64)>,
}

const FORCES_OF_POSITION: &[Feature] = &[
    Feature::OtherLaws,
    Feature::OnSite,
    Feature::Resonators,
    Feature::Ring,
    Feature::Drives,
    Feature::Baths,
];

/// Every method, in the order of the documentation. A configuration that names none has `rkn4`, or the first one that takes it.
const TABLE: [Row; 4] = [
    Row {
        method: Method::VelocityVerlet,
        name: "velocity-verlet",
        order: 2,
        force_evaluations: 1,
        is_symplectic: true,
        extra_per_bead: 0,
        is_since_1_1: false,
        takes: FORCES_OF_POSITION,
        took: None,
        step: (0.0025, false),
        blunt: None,
    },
    Row {
        method: Method::Rkn4,
        name: "rkn4",
        order: 4,
        force_evaluations: 6,
        is_symplectic: true,
        extra_per_bead: 0,
        is_since_1_1: false,
        takes: FORCES_OF_POSITION,
        took: None,
        step: (0.02, true),
        blunt: Some((0.0075, 0.025)),
    },
    Row {
        method: Method::Gear5,
        name: "gear5",
        order: 5,
        force_evaluations: 1,
        is_symplectic: false,
        extra_per_bead: 4,
        is_since_1_1: false,
        takes: &[],
        took: Some(Feature::Damping),
        step: (0.0025, true),
        blunt: None,
    },
    Row {
        method: Method::Rk5,
        name: "rk5",
        order: 5,
        force_evaluations: 6,
        is_symplectic: false,
        extra_per_bead: 0,
        is_since_1_1: true,
        takes: &[
            Feature::Damping,
            Feature::Drag,
            Feature::OtherLaws,
            Feature::OnSite,
            Feature::Resonators,
            Feature::Ring,
            Feature::Drives,
        ],
        took: None,
        step: (0.01, true),
        blunt: None,
    },
];

impl Method {
    /// Every method, in the order of the documentation.
    pub const ALL: [Self; TABLE.len()] = {
        let mut all = [Self::Rkn4; TABLE.len()];
        let mut at = 0;
        while at < all.len() {
            assert!(TABLE[at].method as usize == at, "rows are in the order of the methods");
            all[at] = TABLE[at].method;
            at += 1;
        }
        all
    };

    fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// The name used in configurations and manifests.
    pub fn as_str(self) -> &'static str {
        self.row().name
    }

    /// Doubles for each bead in a frame of this method, beyond displacement and velocity. Damping and other features add more.
    pub fn extra_per_bead(self) -> usize {
        self.row().extra_per_bead
    }

    pub(crate) fn is_since_1_1(self) -> bool {
        self.row().is_since_1_1
    }

    /// Order of the method where the force is smooth: the error after a given time falls like `dt^order`.
    pub fn order(self) -> u32 {
        self.row().order
    }

    /// True if the energy error stays bounded, as that of maps that conserve phase space does, instead of
    /// growing with time.
    pub fn is_symplectic(self) -> bool {
        self.row().is_symplectic
    }

    /// Evaluations of all contact forces in a step, which are the cost of a step.
    pub fn force_evaluations_per_step(self) -> u32 {
        self.row().force_evaluations
    }

    /// True if it keeps its order in a run that has `feature`.
    pub fn takes(self, feature: Feature) -> bool {
        self.row().takes.contains(&feature)
    }

    /// The feature that it took in version 1.0 and takes no more.
    pub(crate) fn took(self) -> Option<Feature> {
        self.row().took
    }

    /// The method of a configuration that names none and has `features`.
    pub(crate) fn default_for(features: &[Feature]) -> Self {
        let takes_all = |method: &Self| features.iter().all(|feature| method.takes(*feature));
        [Self::Rkn4].into_iter().chain(Self::ALL).find(takes_all).unwrap_or(Self::Rkn4)
    }

    /// The names of all methods, in the order of the documentation.
    pub fn names() -> String {
        TABLE.map(|row| row.name).join(", ")
    }

    /// The names of the methods that take `feature`.
    pub(crate) fn names_with(feature: Feature) -> String {
        let names: Vec<_> =
            Self::ALL.iter().filter(|method| method.takes(feature)).map(|method| method.as_str()).collect();
        names.join(", ")
    }

    /// The default time step as a fraction of the collision time T, for the exponent `alpha`.
    ///
    /// `rkn4` and `gear5` keep `|ΔE/E|` below 1e-7 for α from 1.1 to 3 in the runs of the paper. Where a contact
    /// opens, `δ^α` has α derivatives, and the error made there falls like `dt^(α+1)` at best: up to α = 1.3
    /// this takes an eighth of the step that is enough from α = 1.5 on, with a straight line between.
    /// `velocity-verlet` keeps it below 3e-6 (`docs/NUMERICS.md`): its steps are so short for its own second order that openings do not
    /// matter.
    pub fn default_step_fraction(self, alpha: f64) -> f64 {
        let (step, minds_openings) = self.row().step;
        if !minds_openings || alpha >= 1.5 {
            step
        } else if alpha < 1.3 {
            step * 0.125
        } else {
            step * (0.125 + 4.375 * (alpha - 1.3))
        }
    }

    /// The part of [`Self::default_step_fraction`] that is left where contacts open and close at full speed, each time with an error of the order
    /// `dt^(α+1)`; half of it where they do so `again_and_again`.
    ///
    /// With `rkn4` it is at most 0.0075 up to α = 1.5, and a straight line to 0.02 at α = 2, but for the chains of the paper.
    pub(crate) fn struck_step_fraction(
        self,
        alpha: f64,
        is_of_the_paper: bool,
        again_and_again: bool,
    ) -> f64 {
        let usual = self.default_step_fraction(alpha);
        if !self.row().step.1 {
            return usual;
        }
        let most = match self.row().blunt {
            Some((most, growth)) if !is_of_the_paper => {
                most + growth * if alpha > 1.5 { alpha - 1.5 } else { 0.0 }
            }
            _ => usual,
        };
        (if most < usual { most } else { usual }) * if again_and_again { 0.5 } else { 1.0 }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let unknown = || format!("unknown method `{name}`; known methods: {}", Self::names());
        Self::ALL.into_iter().find(|m| m.as_str() == name).ok_or_else(unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_of_the_table_are_those_of_manifests() {
        for method in Method::ALL {
            assert_eq!(serde_json::to_value(method).expect("a name"), method.as_str());
        }
    }
}
