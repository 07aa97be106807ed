//! Which time steps resolve a run, and which one it has by default.

use super::Physics;
use super::arrays::smaller;
use crate::config::{ConfigError, End};
use crate::damping::Damping;
use crate::manifest::MAX_STEPS;
use crate::method::Method;
use crate::power::power;

impl Physics {
    /// The step (s) with which the energy of the usual chains is conserved to 1e-7 for α from 1.1 to 3: the fraction
    /// of [`Method::default_step_fraction`] of
    /// `min(T_struck·walled, T_load, 4·T_settle)·min(1, 5/α)`.
    ///
    /// `T_struck` is the shortest of T (of a bead of `bead_mass_kg`), of the striker's own collision time with the
    /// stiffest contact, and of `√2·T_fast` ([`Physics::fastest_s`]), which counts where a bead is less than about half
    /// as heavy as the others. `walled` is [`Physics::walled_fraction`], and `T_load` is
    /// [`Physics::fastest_loaded_s`]: where a load keeps contacts closed, the force is smooth and only the
    /// frequency of the stiffest contact counts. `T_settle` is [`Physics::settling_s`] of damped contacts. The larger α,
    /// the shorter the part of T in which a contact is stiff.
    pub(super) fn default_dt_s(&self) -> f64 {
        let usual_s = self.scales().time_s;
        let struck_s = match (self.fastest_s(), self.collision_s(self.striker_kg())) {
            (Some(fast_s), Some(striker_s)) => {
                self.walled_fraction() * smaller(usual_s, smaller(2.0_f64.sqrt() * fast_s, striker_s))
            }
            _ => usual_s,
        };
        let time_s = self.fastest_loaded_s().map_or(struck_s, |loaded_s| smaller(struck_s, loaded_s));
        let time_s = self.settling_s().map_or(time_s, |settling_s| smaller(time_s, 4.0 * settling_s));
        self.method.default_step_fraction(self.alpha) * time_s * self.stiff_fraction()
    }

    /// Half between two walls, where beads close and open contacts again and again, each time with an error of the
    /// order `dt^(α+1)`. Velocity Verlet needs steps so short for its own second order that this does not matter.
    fn walled_fraction(&self) -> f64 {
        let is_walled = self.ends.left == End::Fixed && self.ends.right == End::Fixed;
        if is_walled && self.method != Method::VelocityVerlet { 0.5 } else { 1.0 }
    }

    /// `T_fast = √(m_light/(k·L_s^(α−1)))` (s), with the overlap scale `L_s = (m_s·v0²/k)^(1/(α+1))` of the striker and
    /// the largest k: how fast the lightest bead moves between neighbours that the shock presses together.
    /// It is T in a chain of equal beads; nothing when nothing strikes.
    fn fastest_s(&self) -> Option<f64> {
        self.collision_s(self.extremes().lightest_kg)
    }

    /// The same for a bead of `mass_kg`.
    fn collision_s(&self, mass_kg: f64) -> Option<f64> {
        let stiffest = self.extremes().stiffest;
        let ratio = self.striker_ratio(stiffest)?;
        let pressed = power(ratio, (self.alpha - 1.0) / (self.alpha + 1.0));
        Some((mass_kg / (stiffest * pressed)).sqrt())
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

    /// The shorter of the times of [`Physics::fastest_s`] and [`Physics::fastest_loaded_s`].
    fn fastest_contact_s(&self) -> f64 {
        match (self.fastest_s(), self.fastest_loaded_s()) {
            (Some(struck_s), Some(loaded_s)) => smaller(struck_s, loaded_s),
            (Some(alone_s), None) | (None, Some(alone_s)) => alone_s,
            // a chain in which nothing can move was refused before
            (None, None) => self.scales().time_s,
        }
    }

    /// `T_settle` (s): in it damping between two neighbours at rest slows the lightest bead down by a factor e. For
    /// dashpots that is `m_light/(2γ)`; for a coefficient of restitution `η·δ^p` is less than
    /// `ζ·√(2·(α+1))·m_light/T`, with the T of [`Physics::fastest_contact_s`].
    fn settling_s(&self) -> Option<f64> {
        self.damping.map(|damping| match damping {
            Damping::ViscousNSPerM(coefficient) => self.extremes().lightest_kg / (2.0 * coefficient),
            Damping::Restitution(restitution) => {
                let rates = 2.0 * restitution.damping_ratio * (2.0 * (self.alpha + 1.0)).sqrt();
                self.fastest_contact_s() / rates
            }
        })
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

    /// The longest step (s) that a run may have: a quarter of the collision time of its lightest bead, or of the time in
    /// which damping settles, by 5/α less above α = 5.
    pub fn longest_dt_s(&self) -> f64 {
        let contact_s = self.fastest_contact_s();
        let fastest_s = self.settling_s().map_or(contact_s, |settling_s| smaller(contact_s, settling_s));
        0.25 * fastest_s * self.stiff_fraction()
    }

    pub(super) fn check_dt(&self) -> Result<(), ConfigError> {
        let longest = self.longest_dt_s();
        if self.dt_s > 0.0 && self.dt_s <= longest {
            return Ok(());
        }
        let allowed = format!(
            "a step of more than 0 and at most {longest:.3e} s, a quarter of the collision time of the \
             lightest bead (less for α > 5, and for strong damping); {:.3e} s is the default",
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
