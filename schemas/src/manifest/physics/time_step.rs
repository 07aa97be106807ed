//! Which time steps resolve a run, and which one it has by default.

use super::Physics;
use super::arrays::smaller;
use crate::config::ConfigError;
use crate::manifest::MAX_STEPS;
use crate::power::power;

impl Physics {
    /// `fraction · min(T, 4·T_fast, T_load) · min(1, 5/α)`: the fraction of
    /// [`Method::default_step_fraction`](crate::method::Method::default_step_fraction), T of a bead of
    /// `bead_mass_kg`, [`Physics::fastest_s`], which decides only where a bead is lighter than about 1/16 of
    /// the others or the striker much heavier, and [`Physics::fastest_loaded_s`] of a loaded chain. The larger
    /// α, the shorter the part of T in which a contact is stiff.
    pub(super) fn default_dt_s(&self) -> f64 {
        let usual = self.scales().time_s;
        let struck = self.fastest_s().map_or(usual, |fast_s| smaller(usual, 4.0 * fast_s));
        let time_s = self.fastest_loaded_s().map_or(struck, |loaded_s| smaller(struck, loaded_s));
        self.method.default_step_fraction(self.alpha) * time_s * self.stiff_fraction()
    }

    /// `T_fast = √(m_light/(k·L_s^(α−1)))` (s), with the overlap scale `L_s = (m_s·v0²/k)^(1/(α+1))` of the striker and
    /// the largest k: how fast the lightest bead moves between neighbours that the shock presses together.
    /// It is T in a chain of equal beads; nothing when nothing strikes.
    fn fastest_s(&self) -> Option<f64> {
        let extremes = self.extremes();
        let ratio = self.striker_ratio(extremes.stiffest)?;
        let pressed = power(ratio, (self.alpha - 1.0) / (self.alpha + 1.0));
        Some((extremes.lightest_kg / (extremes.stiffest * pressed)).sqrt())
    }

    /// `T_load`: as [`Physics::fastest_s`], for the overlap `L_s + δ_rest` with the largest rest overlap; nothing in
    /// a chain that is not loaded.
    fn fastest_loaded_s(&self) -> Option<f64> {
        let rest_m = self.largest_rest_overlap_m();
        if rest_m == 0.0 {
            return None;
        }
        let extremes = self.extremes();
        let struck_m =
            self.striker_ratio(extremes.stiffest).map_or(0.0, |ratio| power(ratio, 1.0 / (self.alpha + 1.0)));
        let pressed = power(rest_m + struck_m, self.alpha - 1.0);
        Some((extremes.lightest_kg / (extremes.stiffest * pressed)).sqrt())
    }

    /// `m_s·v0²/k` (m^(α+1)) of the striker, if it moves.
    fn striker_ratio(&self, stiffness: f64) -> Option<f64> {
        let speed_m_s = self.striker.velocity_m_s.abs();
        let ratio = self.striker_kg() * (speed_m_s * speed_m_s) / stiffness;
        (speed_m_s > 0.0).then_some(ratio)
    }

    /// `min(1, 5/α)`.
    fn stiff_fraction(&self) -> f64 {
        if self.alpha > 5.0 { 5.0 / self.alpha } else { 1.0 }
    }

    /// The longest step (s) that a run may have: a quarter of the collision time of its lightest bead, by 5/α less
    /// above α = 5.
    pub fn longest_dt_s(&self) -> f64 {
        let fastest_s = match (self.fastest_s(), self.fastest_loaded_s()) {
            (Some(struck_s), Some(loaded_s)) => smaller(struck_s, loaded_s),
            (Some(alone_s), None) | (None, Some(alone_s)) => alone_s,
            // a chain in which nothing can move was refused before
            (None, None) => self.scales().time_s,
        };
        0.25 * fastest_s * self.stiff_fraction()
    }

    pub(super) fn check_dt(&self) -> Result<(), ConfigError> {
        let longest = self.longest_dt_s();
        if self.dt_s > 0.0 && self.dt_s <= longest {
            return Ok(());
        }
        let allowed = format!(
            "a step of more than 0 and at most {longest:.3e} s, a quarter of the collision time of the \
             lightest bead (less for α > 5); {:.3e} s is the default",
            self.default_dt_s()
        );
        Err(ConfigError::number("time.dt_s", self.dt_s, &allowed))
    }
}

/// `round(duration/dt)`, at least 1.
pub(super) fn step_count(duration_s: f64, dt_s: f64) -> Result<u64, ConfigError> {
    let steps = (duration_s / dt_s).round();
    if duration_s > 0.0 && (1.0..=MAX_STEPS as f64).contains(&steps) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        return Ok(steps as u64);
    }
    let allowed = format!("a time of at least one step of {dt_s:.6e} s and at most 2^52 steps");
    Err(ConfigError::number("time.duration_s", duration_s, &allowed))
}
