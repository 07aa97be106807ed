//! Springs, drag and resonators of each bead: `[on_site]` and `[resonators]`.

use super::Profile;
use crate::json_schema::{not_negative, positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Springs and drag that hold each bead at its place.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OnSite {
    /// κ of a force −κ·u (N/m).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = not_negative)]
    pub linear_n_per_m: Option<Profile>,
    /// κ3 of a force −κ3·u³ (N/m³).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = not_negative)]
    pub cubic_n_per_m3: Option<Profile>,
    /// γ of a force −γ·v (N·s/m).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = not_negative)]
    pub drag_n_s_per_m: Option<Profile>,
}

impl OnSite {
    /// True if there are no springs and no drag.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// A mass on a linear spring inside each bead, or beside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resonators {
    /// Mass (kg) of each, 0 where there is none.
    #[schemars(transform = not_negative)]
    pub mass_kg: Profile,
    /// Stiffness (N/m) of the spring between it and its bead.
    #[schemars(transform = positive)]
    pub stiffness_n_per_m: Profile,
}
