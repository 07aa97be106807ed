//! Which time steps resolve a run, and which one it has by default.

use super::Physics;
use super::arrays::{larger, smaller};
use crate::config::{ConfigError, End, TimeConfig};
use crate::damping::Damping;
use crate::manifest::MAX_STEPS;
use crate::method::Method;
use crate::power::power;

impl Physics {
    /// The step (s) with which energy is conserved as `docs/NUMERICS.md` promises:
    /// `min(struck·T_struck, fraction·T_load)·min(1, 5/α)` with the fraction of [`Method::default_step_fraction`],
    /// and for `struck` what [`Physics::struck_fraction`] leaves of it. With damping it is a quarter of that, or
    /// `fraction·T_settle` where that is less (0.4 of it for dashpots): the force jumps, or has a kink, where a damped
    /// contact closes, and the balance of energies is of the order of `dt/T_settle`.
    ///
    /// `T_struck` is the shortest of T (of a bead of `bead_mass_kg`), of the striker's own collision time with the
    /// stiffest contact, and of `√2·T_fast` ([`Physics::fastest_s`]), which counts where a bead is less than about half
    /// as heavy as the others. `T_load` is [`Physics::fastest_loaded_s`]: where a load keeps contacts closed, the force
    /// is smooth and only the frequency of the stiffest contact counts. `T_settle` is [`Physics::settling_s`]. The larger α, the shorter the part of T in which a contact is stiff.
    fn default_dt_s(&self) -> f64 {
        let by_others_s = self.default_by_others_s();
        match by_others_s {
            Some(by_others_s) if self.bonds.is_some() => by_others_s,
            Some(by_others_s) => smaller(by_others_s, self.default_by_contacts_s()),
            None => self.default_by_contacts_s(),
        }
    }

    /// What contacts of one power allow.
    fn default_by_contacts_s(&self) -> f64 {
        let fraction = self.method.default_step_fraction(self.alpha);
        let usual_s = self.scales().time_s;
        let struck_s = match (self.fastest_s(), self.collision_s(self.striker_kg())) {
            (Some(fast_s), Some(striker_s)) => {
                self.struck_fraction() * smaller(usual_s, smaller(2.0_f64.sqrt() * fast_s, striker_s))
            }
            _ => fraction * usual_s,
        };
        let dt_s =
            self.fastest_loaded_s().map_or(struck_s, |loaded_s| smaller(struck_s, fraction * loaded_s));
        let dt_s = match (self.settling_s(), self.damping) {
            (Some(settling_s), Some(Damping::ViscousNSPerM(_))) => {
                smaller(0.25 * dt_s, 0.4 * fraction * settling_s)
            }
            (Some(_), Some(Damping::KuwabaraKonoS(_) | Damping::Power(_))) => 0.25 * dt_s,
            (Some(settling_s), _) => smaller(0.25 * dt_s, fraction * settling_s),
            (None, _) => dt_s,
        };
        dt_s * self.stiff_fraction()
    }

    /// What is left of [`Method::default_step_fraction`] where contacts open and close at full speed, each time with an
    /// error of the order `dt^(α+1)`.
    ///
    /// Half of it between two walls, where they do so again and again. With `rkn4` at most 0.0075 up to α = 1.5, and a
    /// straight line to 0.02 at α = 2, but for the chains of the paper. Velocity Verlet needs steps so short for its own
    /// second order that this does not matter.
    fn struck_fraction(&self) -> f64 {
        let usual = self.method.default_step_fraction(self.alpha);
        let blunt = match self.method {
            Method::VelocityVerlet => return usual,
            Method::Rkn4 if !self.is_of_the_paper() => 0.0075 + 0.025 * larger(self.alpha - 1.5, 0.0),
            Method::Rkn4 | Method::Gear5 | Method::Rk5 => usual,
        };
        let is_walled = self.ends.left == End::Fixed && self.ends.right == End::Fixed;
        smaller(usual, blunt) * if is_walled { 0.5 } else { 1.0 }
    }

    /// Whether it is a chain of equal beads and impurities with free ends that nothing loads: in these a contact
    /// opens at full speed only where the shock reaches an end, or an impurity.
    fn is_of_the_paper(&self) -> bool {
        let is_even = self.masses.is_uniform() && self.stiffnesses.is_uniform() && self.contacts.is_empty();
        is_even && self.ends.is_free() && self.load.is_none()
    }

    /// Step (s) and number of steps of a run: a step that was asked for is kept, another one divides the duration.
    pub(super) fn steps(&self, time: TimeConfig) -> Result<(f64, u64), ConfigError> {
        let Some(dt_s) = time.dt_s else { return self.whole_steps(time.duration_s, None) };
        self.check_dt(dt_s)?;
        Ok((dt_s, checked_count(time.duration_s, dt_s, (time.duration_s / dt_s).round())?))
    }

    /// Step (s) and number of steps of a run over `duration_s`: the step that divides it nearest to `wanted_s`, the
    /// default if nothing is wanted.
    ///
    /// # Errors
    /// When there is no such number of steps.
    pub fn whole_steps(&self, duration_s: f64, wanted_s: Option<f64>) -> Result<(f64, u64), ConfigError> {
        let wanted_s = wanted_s.unwrap_or_else(|| self.default_dt_s());
        let nearest = (duration_s / wanted_s).round();
        let step_count = checked_count(duration_s, wanted_s, larger(nearest, 1.0))?;
        let dt_s = duration_s / step_count as f64;
        // nearest, but not beyond what is allowed
        let step_count = step_count + u64::from(dt_s > self.longest_dt_s());
        Ok((duration_s / step_count as f64, step_count))
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
            // η·δ^p of the overlaps of the shock
            Damping::KuwabaraKonoS(_) | Damping::Power(_) => {
                let extremes = self.extremes();
                let struck = self.striker_ratio(extremes.stiffest);
                let struck_m = struck.map_or(0.0, |ratio| power(ratio, 1.0 / (self.alpha + 1.0)));
                let overlap_m = self.largest_rest_overlap_m() + struck_m;
                let eta = damping.coefficient(self.alpha, extremes.stiffest, extremes.lightest_kg);
                extremes.lightest_kg / (2.0 * eta * power(overlap_m, damping.exponent(self.alpha)))
            }
        })
    }

    /// `m_s·v0²/k` (m^(α+1)) of the striker, if it moves.
    fn striker_ratio(&self, stiffness: f64) -> Option<f64> {
        let speed_m_s = self.typical_speed_m_s();
        let mass_kg = if self.striker.velocity_m_s == 0.0 { self.bead_mass_kg } else { self.striker_kg() };
        let ratio = mass_kg * (speed_m_s * speed_m_s) / stiffness;
        (speed_m_s > 0.0).then_some(ratio)
    }

    /// What drives, bonds, springs at the beads' places, resonators and drag allow, if there are any: the fraction of
    /// [`Method::default_step_fraction`] of [`Physics::fastest_linear_s`], a quarter of that of the time in which drag stops a bead, and a
    /// hundredth of the shortest period of a drive.
    fn default_by_others_s(&self) -> Option<f64> {
        // smooth forces: as for α = 2
        let fraction = self.method.default_step_fraction(2.0);
        let linear_s = self.fastest_linear_s().map(|time_s| fraction * time_s);
        let drag_s = self.drag_s().map(|time_s| 4.0 * fraction * time_s);
        let drive_s = self.highest_drive_hz().map(|hz| 0.01 / hz);
        [linear_s, drag_s, drive_s].into_iter().flatten().reduce(smaller)
    }

    /// The time (s) in which the strongest drag slows the lightest bead down by a factor e.
    fn drag_s(&self) -> Option<f64> {
        if !self.has_drag() {
            return None;
        }
        let strongest = self.sites().drag_n_s_per_m.into_iter().fold(0.0, larger);
        (strongest > 0.0).then(|| self.extremes().lightest_kg / strongest)
    }

    /// `2/ω` (s) of the highest frequency that the lightest bead could have by all forces that are not one power of the overlap, at
    /// the largest overlap and displacement that is to be expected; nothing where there are no others.
    fn fastest_linear_s(&self) -> Option<f64> {
        let sites = self.sites();
        let is_softened = self.initial.is_none() && self.drives.is_empty();
        let is_alone = !self.is_beyond_one_power() && sites.is_none();
        if is_alone && is_softened {
            return None;
        }
        let lightest_kg = self.extremes().lightest_kg;
        let chain = self.chain();
        let speed_m_s = self.typical_speed_m_s();
        // where forces are linear a speed compresses a bond by v·√(m/k)
        let tangents = chain.tangents_n_per_m();
        let softest = tangents.iter().copied().filter(|k| *k > 0.0).reduce(smaller);
        let struck_m = match softest {
            Some(softest) => speed_m_s * (self.bead_mass_kg / softest).sqrt(),
            None => {
                self.striker_ratio(self.stiffness).map_or(0.0, |ratio| power(ratio, 1.0 / (self.alpha + 1.0)))
            }
        };
        let moved_m = larger(struck_m, self.typical_overlap_m());
        let at = |c: usize| {
            let overlap_m = larger(chain.rest_overlap_m[c], 0.0) + moved_m;
            let by_law = chain.law.tangent(chain.stiffness[c], overlap_m);
            chain.terms.iter().fold(by_law, |sum, term| sum + term.law.tangent(term.stiffness[c], overlap_m))
        };
        let mut squared = (0..chain.contact_count()).map(at).fold(0.0, larger) / lightest_kg;
        let most = |values: &[f64]| values.iter().copied().fold(0.0, larger);
        let on_site = most(&sites.linear_n_per_m) + 3.0 * most(&sites.cubic_n_per_m3) * (moved_m * moved_m);
        squared += 0.25 * on_site / lightest_kg;
        for (mass_kg, stiffness) in sites.resonator_kg.iter().zip(&sites.resonator_n_per_m) {
            if *mass_kg > 0.0 {
                squared = larger(squared, 0.25 * stiffness * (1.0 / mass_kg + 1.0 / lightest_kg) + squared);
            }
        }
        (squared > 0.0).then(|| 1.0 / squared.sqrt())
    }

    /// `min(1, 5/α)`.
    fn stiff_fraction(&self) -> f64 {
        if self.alpha > 5.0 { 5.0 / self.alpha } else { 1.0 }
    }

    /// The longest step (s) that a run may have: a quarter of the collision time of its lightest bead, or of the time in
    /// which damping settles, by 5/α less above α = 5.
    pub fn longest_dt_s(&self) -> f64 {
        let linear_s = self.fastest_linear_s();
        let others_s = match (linear_s, self.drag_s()) {
            (Some(linear_s), Some(drag_s)) => Some(smaller(linear_s, 4.0 * drag_s)),
            (linear_s, drag_s) => linear_s.or(drag_s.map(|drag_s| 4.0 * drag_s)),
        };
        let others_s = others_s.map(|time_s| 0.25 * time_s);
        match others_s {
            Some(others_s) if self.bonds.is_some() => others_s,
            Some(others_s) => smaller(others_s, self.longest_by_contacts_s()),
            None => self.longest_by_contacts_s(),
        }
    }

    fn longest_by_contacts_s(&self) -> f64 {
        let contact_s = self.fastest_contact_s();
        let fastest_s = self.settling_s().map_or(contact_s, |settling_s| smaller(contact_s, settling_s));
        0.25 * fastest_s * self.stiff_fraction()
    }

    pub(super) fn check_dt(&self, dt_s: f64) -> Result<(), ConfigError> {
        let longest = self.longest_dt_s();
        if dt_s > 0.0 && dt_s <= longest {
            return Ok(());
        }
        let allowed = format!(
            "a step of more than 0 and at most {longest:.3e} s, a quarter of the collision time of the \
             lightest bead (less for α > 5, and for strong damping); {:.3e} s is the default",
            self.default_dt_s()
        );
        Err(ConfigError::number("time.dt_s", dt_s, &allowed))
    }
}

/// `steps` as a number of steps of `dt_s`, if there can be so many.
fn checked_count(duration_s: f64, dt_s: f64, steps: f64) -> Result<u64, ConfigError> {
    if duration_s > 0.0 && (1.0..=MAX_STEPS as f64).contains(&steps) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        return Ok(steps as u64);
    }
    let allowed = format!("a time of at least one step of {dt_s:.6e} s and at most 2^52 steps");
    Err(ConfigError::number("time.duration_s", duration_s, &allowed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{MassRule, RunConfig};
    use crate::presets::Preset;

    fn light_impurity(change: impl FnOnce(&mut RunConfig)) -> Physics {
        let mut config = Preset::find("light-impurity").expect("preset").config();
        change(&mut config);
        Physics::resolve(&config).expect("valid")
    }

    /// The time of the last step is the duration, to a unit in the last place.
    #[test]
    fn the_default_step_divides_the_duration() {
        for duration_s in [0.08, 0.0101, 1e-3, 1.0 / 3.0, 7.77e-5, 2e-6, 1e-7, 12.3] {
            let physics = light_impurity(|config| config.time.duration_s = duration_s);
            let end_s = physics.time_s(physics.step_count);
            assert!((end_s / duration_s - 1.0).abs() <= f64::EPSILON, "{end_s:e} s, not {duration_s:e} s");
            let usual_s = physics.default_dt_s();
            let nearest = physics.step_count == 1 || (physics.dt_s - usual_s).abs() <= usual_s / 2.0;
            assert!(nearest, "{:e} s, not about {usual_s:e} s", physics.dt_s);
        }
        assert_eq!(light_impurity(|_| {}).step_count, 55_189);
    }

    #[test]
    fn a_step_that_was_asked_for_is_kept() {
        let physics = light_impurity(|config| config.time.dt_s = Some(1.7e-6));
        assert_eq!((physics.dt_s, physics.step_count), (1.7e-6, 47_059));
    }

    /// 2.4 of the longest steps are two that are too long, or three.
    #[test]
    fn a_step_that_divides_is_never_longer_than_allowed() {
        let physics = light_impurity(|_| {});
        let longest_s = physics.longest_dt_s();
        let (dt_s, steps) = physics.whole_steps(2.4 * longest_s, Some(longest_s)).expect("possible");
        assert_eq!(steps, 3);
        assert!(dt_s <= longest_s);
    }

    /// Where contacts open and close at full speed, `rkn4` has 0.0075 T, half of it between walls; the chains of the paper
    /// keep their 0.02 T.
    #[test]
    fn what_opens_at_full_speed_has_shorter_steps() {
        let part_of_t = |change: fn(&mut RunConfig)| {
            let physics = light_impurity(change);
            physics.default_dt_s() / physics.scales().time_s
        };
        let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-12;
        assert!(near(part_of_t(|_| {}), 0.02));
        assert!(near(part_of_t(|c| c.ends.right = End::Fixed), 0.0075));
        assert!(near(part_of_t(|c| (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed)), 0.00375));
        assert!(near(part_of_t(|c| c.chain.masses = MassRule::PatternKg(vec![1e-3, 2e-3])), 0.0075));
        assert!(near(part_of_t(|c| (c.chain.alpha, c.ends.right) = (2.0, End::Fixed)), 0.02));
    }
}
