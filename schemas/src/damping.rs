//! Damping of closed contacts.
//!
//! A damped contact pushes with `F = k·δ^α + η·δ^p·dδ/dt` while it is closed, but never pulls: `F = 0` where that is
//! negative. A dashpot has `p = 0`. With `p = (α−1)/2` the substitution `s = δ^((α+1)/2)` turns a collision
//! of two beads into that of a linear damped oscillator, whatever α is, so that its coefficient of
//! restitution does not depend on the speed.
//!
//! # Source
//! Y. Tsuji, T. Tanaka and T. Ishida, Powder Technol. 71 (1992) 239, doi:10.1016/0032-5910(92)88030-L (α = 3/2);
//! T. Schwager and T. Pöschel, Granul. Matter 9 (2007) 465, doi:10.1007/s10035-007-0065-z (the end of a
//! contact that never pulls).

use crate::config_error::ConfigError;
use crate::contact::ContactLaw;
use crate::json_schema::positive;
use crate::power::power;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::E;

/// The `[damping]` table: one of its keys.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DampingConfig {
    /// A dashpot in every closed contact: the force `γ·dδ/dt`, γ in N·s/m.
    ViscousNSPerM(#[schemars(transform = positive)] f64),
    /// Coefficient of restitution e of two beads, the same at any speed: the force `η·δ^((α−1)/2)·dδ/dt`.
    Restitution(#[schemars(range(min = 1e-3), extend("exclusiveMaximum" = 1))] f64),
    /// Kuwabara's and Kono's law of viscoelastic spheres: `k·α·A·δ^(α−1)·dδ/dt` with a time A (s).
    KuwabaraKonoS(#[schemars(transform = positive)] f64),
    /// `η·δ^p·dδ/dt` with any p.
    Power(PowerDamping),
}

/// A damping force `η·δ^p·dδ/dt`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerDamping {
    /// η (N·s·m^(−1−p)).
    #[schemars(transform = positive)]
    pub coefficient: f64,
    /// p, 0 or more.
    #[schemars(range(min = 0, max = 100))]
    pub exponent: f64,
}

/// The damping of every contact of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Damping {
    /// A dashpot: `η = γ` (N·s/m), `p = 0`.
    ViscousNSPerM(f64),
    /// A collision of two beads that does not depend on their speed: `p = (α−1)/2`.
    #[serde(rename = "restitution")]
    Restitution(Restitution),
    /// Viscoelastic spheres: `η = k·α·A`, `p = α − 1`.
    KuwabaraKonoS(f64),
    /// `η` and `p` as they are given.
    Power(PowerDamping),
}

/// A coefficient of restitution and what it means for a contact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Restitution {
    /// Relative speed after over that before a collision.
    pub coefficient: f64,
    /// The damping ratio ζ of the oscillator that has it; `η = ζ·√(2·(α+1)·k·m*)` with the reduced mass m*.
    pub damping_ratio: f64,
}

impl Restitution {
    /// Finds the damping ratio of `coefficient`, which is between 0 and 1.
    fn new(coefficient: f64) -> Self {
        // e falls from 1 at ζ = 0 to 1/(4ζ²) far beyond ζ = 1
        let (mut low, mut high) = (0.0, 2.0 / coefficient.sqrt());
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if Self::coefficient_of(middle) > coefficient {
                low = middle;
            } else {
                high = middle;
            }
        }
        Self { coefficient, damping_ratio: 0.5 * (low + high) }
    }

    /// The coefficient of restitution of the damping ratio ζ.
    ///
    /// ```
    /// use schemas::damping::Restitution;
    /// assert_eq!(Restitution::coefficient_of(0.0), 1.0);
    /// // at critical damping the force ends when β·t = 2
    /// assert!((Restitution::coefficient_of(1.0 - 1e-12) - (-2.0_f64).exp()).abs() < 1e-5);
    /// ```
    pub fn coefficient_of(damping_ratio: f64) -> f64 {
        let (below, above) = (1.0 - damping_ratio, 1.0 + damping_ratio);
        if below > 0.0 {
            // the force ends at the phase 2·acos ζ of the oscillation
            let frequency = (below * above).sqrt();
            let phase = 4.0 * arc_tangent((below / above).sqrt());
            power(E, -(damping_ratio / frequency) * phase)
        } else if below < 0.0 {
            let rate = (-below * above).sqrt();
            power(damping_ratio + rate, -2.0 * damping_ratio / rate)
        } else {
            power(E, -2.0)
        }
    }
}

/// `atan x` for `x` from 0 to 1, with the arithmetic of the dynamics: the damping ratio decides bits, and must be the same
/// wherever a configuration is resolved.
fn arc_tangent(x: f64) -> f64 {
    // four halvings of the angle leave x below 0.05, where eight terms of the series reach rounding
    let mut small = x;
    for _ in 0..4 {
        small /= 1.0 + (small * small + 1.0).sqrt();
    }
    let square = -small * small;
    let mut sum: f64 = 0.0;
    for term in (0..8_u32).rev() {
        sum = sum * square + 1.0 / f64::from(2 * term + 1);
    }
    16.0 * (small * sum)
}

impl Damping {
    /// The damping that a configuration asks for.
    ///
    /// # Errors
    /// When a value is impossible.
    pub fn resolve(config: DampingConfig) -> Result<Self, ConfigError> {
        let damping = match config {
            DampingConfig::ViscousNSPerM(coefficient) => Self::ViscousNSPerM(coefficient),
            DampingConfig::KuwabaraKonoS(time_s) => Self::KuwabaraKonoS(time_s),
            DampingConfig::Power(damping) => Self::Power(damping),
            DampingConfig::Restitution(e) if e > 0.0 && e < 1.0 => Self::Restitution(Restitution::new(e)),
            DampingConfig::Restitution(coefficient) => {
                Self::Restitution(Restitution { coefficient, damping_ratio: 0.0 })
            }
        };
        damping.check()?;
        Ok(damping)
    }

    /// Refuses values that no run can have.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        match *self {
            Self::ViscousNSPerM(value) if (1e-100..=1e100).contains(&value) => Ok(()),
            Self::ViscousNSPerM(value) => {
                let allowed = "a positive number of N·s/m, 1e-100 to 1e100; leave [damping] out for none";
                Err(ConfigError::number("damping.viscous_n_s_per_m", value, allowed))
            }
            Self::KuwabaraKonoS(time_s) if (1e-100..=1e100).contains(&time_s) => Ok(()),
            Self::KuwabaraKonoS(time_s) => {
                let allowed =
                    "a positive time A of F = k·(δ^α + α·A·δ^(α−1)·dδ/dt) in s; leave [damping] out for none";
                Err(ConfigError::number("damping.kuwabara_kono_s", time_s, allowed))
            }
            Self::Power(PowerDamping { coefficient, exponent }) => {
                if !(0.0..=100.0).contains(&exponent) {
                    let allowed = "an exponent p of δ^p from 0 to 100";
                    return Err(ConfigError::number("damping.power.exponent", exponent, allowed));
                }
                if (1e-100..=1e100).contains(&coefficient) {
                    return Ok(());
                }
                let allowed =
                    "a positive number of N·s/m^(1+p), 1e-100 to 1e100; leave [damping] out for none";
                Err(ConfigError::number("damping.power.coefficient", coefficient, allowed))
            }
            Self::Restitution(Restitution { coefficient, damping_ratio }) => {
                let key = "damping.restitution";
                if !(1e-3..=1.0 - 1e-9).contains(&coefficient) {
                    let allowed = "a coefficient from 0.001 to below 1; leave [damping] out for 1";
                    return Err(ConfigError::number(key, coefficient, allowed));
                }
                let found = Self::coefficient_error(coefficient, damping_ratio);
                if found <= 1e-9 {
                    return Ok(());
                }
                let allowed = format!("the damping ratio of the coefficient {coefficient}");
                Err(ConfigError::number(key, damping_ratio, &allowed))
            }
        }
    }

    fn coefficient_error(coefficient: f64, damping_ratio: f64) -> f64 {
        let error = (Restitution::coefficient_of(damping_ratio) - coefficient).abs();
        if error.is_nan() { f64::INFINITY } else { error }
    }

    /// The coefficient η of a contact of stiffness `stiffness` (N·m^−α) and reduced mass `reduced_kg`
    /// (N·s·m^(−1−p)).
    pub(crate) fn coefficient(&self, alpha: f64, stiffness: f64, reduced_kg: f64) -> f64 {
        match self {
            Self::ViscousNSPerM(coefficient) | Self::Power(PowerDamping { coefficient, .. }) => *coefficient,
            Self::Restitution(restitution) => {
                restitution.damping_ratio * (2.0 * (alpha + 1.0) * stiffness * reduced_kg).sqrt()
            }
            Self::KuwabaraKonoS(time_s) => alpha * stiffness * time_s,
        }
    }

    /// The exponent p of the overlap.
    pub fn exponent(&self, alpha: f64) -> f64 {
        match self {
            Self::ViscousNSPerM(_) => 0.0,
            Self::Restitution(_) => 0.5 * (alpha - 1.0),
            Self::KuwabaraKonoS(_) => alpha - 1.0,
            Self::Power(PowerDamping { exponent, .. }) => *exponent,
        }
    }

    /// Key of the damping under `[damping]`.
    pub(crate) fn key(&self) -> &'static str {
        match self {
            Self::ViscousNSPerM(_) => "viscous_n_s_per_m",
            Self::Restitution(_) => "restitution",
            Self::KuwabaraKonoS(_) => "kuwabara_kono_s",
            Self::Power(_) => "power",
        }
    }

    /// A phrase for captions and listings.
    pub(crate) fn words(&self) -> String {
        match self {
            Self::ViscousNSPerM(coefficient) => format!("dashpots of {coefficient} N·s/m"),
            Self::Restitution(restitution) => {
                format!("coefficient of restitution {}", restitution.coefficient)
            }
            Self::KuwabaraKonoS(time_s) => format!("viscoelastic spheres, A = {time_s:e} s"),
            Self::Power(PowerDamping { coefficient, exponent }) => {
                format!("damping {coefficient}·δ^{exponent}·dδ/dt")
            }
        }
    }

    /// True if manifests of version 1.0 do not have it.
    pub(crate) fn is_since_1_1(&self) -> bool {
        matches!(self, Self::KuwabaraKonoS(_) | Self::Power(_))
    }

    /// Factor of the settling time, in which damping slows a bead down, in the usual step; none if that time does not limit it.
    pub(crate) fn settling_fraction(&self) -> Option<f64> {
        match self {
            Self::ViscousNSPerM(_) => Some(0.4),
            Self::Restitution(_) => Some(1.0),
            Self::KuwabaraKonoS(_) | Self::Power(_) => None,
        }
    }

    /// The form in which the factor δ^p of its force is computed.
    pub fn factor(&self) -> Factor {
        match self {
            Self::ViscousNSPerM(_) => Factor::One,
            Self::Restitution(_) => Factor::Root,
            Self::KuwabaraKonoS(_) | Self::Power(_) => Factor::Ratio,
        }
    }

    /// The law of δ^q with q = p + 1, for dampings that compute δ^p as `δ^q/δ`.
    pub fn raised(&self, alpha: f64) -> Option<ContactLaw> {
        match self {
            Self::ViscousNSPerM(_) | Self::Restitution(_) => None,
            Self::KuwabaraKonoS(_) => Some(ContactLaw::new(alpha)),
            Self::Power(PowerDamping { exponent, .. }) => Some(ContactLaw::new(exponent + 1.0)),
        }
    }
}

/// The form in which the factor δ^p of a damping force is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Factor {
    /// p = 0.
    One,
    /// p = (α − 1)/2: `√(δ^α/δ)`.
    Root,
    /// Any p: `δ^q/δ` with q = p + 1.
    Ratio,
}

impl Factor {
    /// δ^p at the overlap `overlap_m`, with `raised` = δ^α, or δ^q.
    #[inline(always)]
    pub fn at(self, raised: f64, overlap_m: f64) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Root => (raised / overlap_m).sqrt(),
            Self::Ratio => raised / overlap_m,
        }
    }
}

/// The damping of the contacts of a chain.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactDamping {
    /// Kind of damping.
    pub kind: Damping,
    /// η of each contact (N·s·m^(−1−p)), N − 1 values.
    pub coefficient: Vec<f64>,
    /// η of the contacts with the left and the right wall; 0 at a free end.
    pub wall_coefficient: [f64; 2],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damping_ratio_has_the_coefficient_that_was_asked_for() {
        for coefficient in [0.001, 0.05, 0.135, 0.5, 0.9, 0.999_999] {
            let Restitution { damping_ratio, .. } = Restitution::new(coefficient);
            let back = Restitution::coefficient_of(damping_ratio);
            // near ζ = 1 both branches lose half of the digits of 1 − ζ²
            assert!((back - coefficient).abs() < 1e-9, "{coefficient}: {back} at ζ = {damping_ratio}");
        }
    }

    #[test]
    fn the_arc_tangent_is_that_of_the_platform_to_rounding() {
        for i in 0..=1000_u32 {
            let x = f64::from(i) / 1000.0;
            assert!((arc_tangent(x) - x.atan()).abs() <= 4.0 * f64::EPSILON * x, "{x}");
        }
    }

    #[test]
    fn impossible_dampings_are_refused() {
        for config in [
            DampingConfig::ViscousNSPerM(0.0),
            DampingConfig::ViscousNSPerM(f64::NAN),
            DampingConfig::Restitution(0.0),
            DampingConfig::Restitution(1.0),
            DampingConfig::Restitution(-0.5),
        ] {
            let error = Damping::resolve(config).expect_err("impossible");
            assert!(error.key.starts_with("damping.") && error.message.contains("allowed"), "{error}");
        }
        let wrong = Damping::Restitution(Restitution { coefficient: 0.5, damping_ratio: 0.1 });
        assert!(wrong.check().is_err());
    }
}
