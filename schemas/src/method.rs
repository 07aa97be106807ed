//! The time integration methods by name.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// How a state is advanced by one time step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Velocity Verlet: second order, one force evaluation a step.
    VelocityVerlet,
    /// Runge–Kutta–Nyström splitting of Blanes and Moan: fourth order, six force evaluations.
    Rkn4,
    /// Gear's predictor-corrector on six values: fifth order, one force evaluation. It is not symplectic, and
    /// takes forces that depend on velocities.
    Gear5,
    /// Dormand's and Prince's Runge–Kutta method: fifth order, six force evaluations. It is not symplectic, and takes forces that
    /// depend on velocities.
    Rk5,
}

impl Method {
    /// Every method, in the order of the documentation.
    pub const ALL: [Self; 4] = [Self::VelocityVerlet, Self::Rkn4, Self::Gear5, Self::Rk5];

    /// The name used in configurations and manifests.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::VelocityVerlet => "velocity-verlet",
            Self::Rkn4 => "rkn4",
            Self::Gear5 => "gear5",
            Self::Rk5 => "rk5",
        }
    }

    /// Doubles for each bead beyond displacement and velocity that a frame of this method carries.
    ///
    /// For `gear5` these are the second to the fifth derivative of the displacement, each as a term of its
    /// Taylor series over one time step: `extra = [q2 | q3 | q4 | q5]` with `q_k = dt^k/k!·d^k u/dt^k` (m),
    /// N values each. So the acceleration of bead `i` is `2·q2[i]/dt²`. With damping the work that contacts have
    /// dissipated follows ([`Physics::extra_per_bead`](crate::manifest::Physics::extra_per_bead)).
    pub fn extra_per_bead(self) -> usize {
        match self {
            Self::VelocityVerlet | Self::Rkn4 | Self::Rk5 => 0,
            Self::Gear5 => 4,
        }
    }

    /// Order of the method where the force is smooth: the error after a given time falls like `dt^order`.
    pub fn order(self) -> u32 {
        match self {
            Self::VelocityVerlet => 2,
            Self::Rkn4 => 4,
            Self::Gear5 | Self::Rk5 => 5,
        }
    }

    /// Whether the energy error stays bounded, as that of maps that conserve phase space does, instead of
    /// growing with time.
    pub fn is_symplectic(self) -> bool {
        match self {
            Self::VelocityVerlet | Self::Rkn4 => true,
            Self::Gear5 | Self::Rk5 => false,
        }
    }

    /// Evaluations of all contact forces in a step, which are what a step costs.
    pub fn force_evaluations_per_step(self) -> u32 {
        match self {
            Self::VelocityVerlet | Self::Gear5 => 1,
            Self::Rkn4 | Self::Rk5 => 6,
        }
    }

    /// Whether it keeps its order where forces depend on velocities, as those of damped contacts do.
    pub fn takes_forces_of_velocity(self) -> bool {
        match self {
            Self::VelocityVerlet | Self::Rkn4 => false,
            Self::Gear5 | Self::Rk5 => true,
        }
    }

    /// The default time step as a fraction of the collision time T, for the exponent `alpha`.
    ///
    /// `rkn4` and `gear5` keep `|ΔE/E|` below 1e-7 for α from 1.1 to 3 in the runs of the paper. Where a contact
    /// opens, `δ^α` has α derivatives, and the error made there falls like `dt^(α+1)` at best: up to α = 1.3
    /// this takes an eighth of the step that is enough from α = 1.5 on, with a straight line between.
    /// `velocity-verlet` keeps it below 3e-6 (`docs/NUMERICS.md`).
    pub fn default_step_fraction(self, alpha: f64) -> f64 {
        let smooth = if alpha < 1.3 {
            0.125
        } else if alpha < 1.5 {
            0.125 + 4.375 * (alpha - 1.3)
        } else {
            1.0
        };
        match self {
            Self::VelocityVerlet => 0.0025,
            Self::Rkn4 => 0.02 * smooth,
            Self::Gear5 => 0.0025 * smooth,
            Self::Rk5 => 0.01 * smooth,
        }
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
        Self::ALL.into_iter().find(|m| m.as_str() == name).ok_or_else(|| {
            let known: Vec<_> = Self::ALL.iter().map(|m| m.as_str()).collect();
            format!("unknown method `{name}`; known methods: {}", known.join(", "))
        })
    }
}
