//! Random disorder: `[[disorder]]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A random change, by the seed, of the masses, radii or stiffnesses that the rules give.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Disorder {
    /// The disordered quantity.
    pub of: Disordered,
    /// A factor between 1 − a and 1 + a.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 10))]
    pub uniform: Option<f64>,
    /// A factor 1 + s·z with a standard normal z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 10))]
    pub normal: Option<f64>,
    /// A factor exp(s·z).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 10))]
    pub log_normal: Option<f64>,
    /// One factor for a part of them, the others as they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub two_valued: Option<TwoValued>,
    /// The values as they are, in another order.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub permuted: bool,
}

/// A quantity that can be disordered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Disordered {
    /// The masses of the beads.
    Masses,
    /// The radii of spheres, and with them masses and stiffnesses.
    Radii,
    /// The stiffnesses of the contacts between beads.
    Stiffnesses,
}

/// Two values at random.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TwoValued {
    /// The probability of each to have the factor.
    #[schemars(range(min = 0, max = 1))]
    pub fraction: f64,
    /// The factor.
    pub factor: f64,
}
