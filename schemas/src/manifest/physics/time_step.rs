//! The time steps that resolve a run, and the default one.

mod limits;

use super::{Physics, larger, smaller};
use crate::config::{ConfigError, End, TimeConfig};
use crate::damping::Damping;
use crate::manifest::MAX_STEPS;
use crate::power::power;
use crate::scales::Scales;
pub use limits::Limit;

/// The step that one part of a chain allows.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Allowed {
    /// The default step (s), at most `longest_s`.
    usual_s: f64,
    /// The longest step (s) that a run may have, if this part sets one.
    longest_s: f64,
    by: Limit,
}

/// Contacts of one exponent.
#[derive(Debug, Clone, Copy)]
struct OneLaw {
    alpha: f64,
    /// The largest stiffness (N·m^−α) among them.
    stiffest: f64,
}

impl Physics {
    /// The step (s) with which energy is conserved as `docs/NUMERICS.md` promises, and the part of the chain that decides it, which
    /// allows the shortest step.
    ///
    /// Contacts allow `min(struck·T_struck, fraction·T_load)·min(1, 5/α)` with the fraction of [`Method::default_step_fraction`](crate::method::Method::default_step_fraction),
    /// and for `struck` what `Method::struck_step_fraction` leaves of it. With damping it is a quarter of that, or
    /// `fraction·T_settle` where that is less (0.4 of it for dashpots): the force jumps, or has a kink, where a damped
    /// contact closes, and the balance of energies is of the order of `dt/T_settle`. It is never longer than a run may have.
    ///
    /// `T_struck` is the shortest of T (of a bead of `bead_mass_kg`), of the striker's own collision time with the
    /// stiffest contact, and of `√2·T_fast` (`collision_s` of the lightest bead), which counts where a bead is less than
    /// about half as heavy as the others. `T_load` is `fastest_loaded_s`: where a load keeps contacts closed, the force
    /// is smooth and only the frequency of the stiffest contact counts. `T_settle` is `settling_s`. The larger α, the shorter the part of T in which a contact is stiff.
    ///
    /// Smooth forces allow the fraction (that of α = 2) of the shortest time of linear forces, drag four times that of the time in which it
    /// stops a bead, as does the friction of a bath, a drive a hundredth of its shortest period.
    pub fn usual_step(&self) -> (f64, Limit) {
        let shortest = self.allowed().into_iter().reduce(|a, b| if b.usual_s < a.usual_s { b } else { a });
        // every chain has a contact or a bond
        shortest.map_or((self.scales().time_s, Limit::Collision), |allowed| (allowed.usual_s, allowed.by))
    }

    fn default_dt_s(&self) -> f64 {
        self.usual_step().0
    }

    /// The steps that the parts of the chain allow.
    fn allowed(&self) -> Vec<Allowed> {
        let mut allowed = Vec::new();
        if self.bonds.is_none() {
            for law in self.laws() {
                self.by_contacts(law, &mut allowed);
            }
        }
        // smooth forces: as for α = 2
        let fraction = self.method.default_step_fraction(2.0);
        allowed.extend(self.bonds_settle_s().map(|settling_s| Allowed {
            usual_s: 0.4 * fraction * settling_s,
            // a longer one is refused where a configuration is read: recordings have some
            longest_s: f64::INFINITY,
            by: Limit::Damping,
        }));
        let linear = self.fastest_linear();
        allowed.extend(linear.map(|(time_s, by)| Allowed {
            usual_s: fraction * time_s,
            longest_s: 0.25 * time_s,
            by,
        }));
        let drag = self.fastest_drag();
        allowed.extend(drag.map(|(time_s, bead)| Allowed {
            usual_s: 4.0 * fraction * time_s,
            longest_s: 0.25 * (4.0 * time_s),
            by: Limit::Drag(bead),
        }));
        allowed.extend(self.baths.iter().zip(0..).map(|(bath, number)| Allowed {
            usual_s: 4.0 * fraction / bath.friction_per_s,
            longest_s: f64::INFINITY,
            by: Limit::Bath(number),
        }));
        allowed.extend(self.drives.iter().zip(0..).filter_map(|(drive, number)| {
            let usual_s = 0.01 / drive.waveform.highest_hz()?;
            Some(Allowed { usual_s, longest_s: f64::INFINITY, by: Limit::Drive(number) })
        }));
        for part in &mut allowed {
            part.usual_s = smaller(part.usual_s, part.longest_s);
        }
        allowed
    }

    /// `T_settle` (s) of bonds, which have dashpots alone: it is the same whatever the law.
    fn bonds_settle_s(&self) -> Option<f64> {
        match (self.damping, &self.bonds) {
            (Some(Damping::ViscousNSPerM(coefficient)), Some(_)) => {
                Some(self.extremes().lightest_kg / (2.0 * coefficient))
            }
            _ => None,
        }
    }

    /// The steps that contacts of `law` allow.
    fn by_contacts(&self, law: OneLaw, allowed: &mut Vec<Allowed>) {
        let fraction = self.method.default_step_fraction(law.alpha);
        let (is_of_the_paper, again) = (self.is_of_the_paper(), self.opens_again_and_again());
        let struck = self.method.struck_step_fraction(law.alpha, is_of_the_paper, again);
        // what is given or driven may open contacts that a load keeps closed
        let opens = self.is_moved_otherwise()
            && self.typical_overlap_m() + self.struck_overlap_m(law) > self.smallest_rest_overlap_m(law);
        let loaded = if opens { struck } else { fraction };
        let lightest_kg = self.extremes().lightest_kg;
        let longest_s = f64::INFINITY;
        let mut by = Vec::new();
        let loaded_s = self.fastest_loaded_s(law);
        let collisions = [lightest_kg, self.striker_kg()].map(|mass_kg| self.collision_s(law, mass_kg));
        if let [Some(fast_s), Some(striker_s)] = collisions {
            let bead_s = match &self.alphas {
                Some(_) => self.collision_s(law, self.bead_mass_kg).unwrap_or(fast_s),
                None => self.scales().time_s,
            };
            by.push((struck * bead_s, longest_s, Limit::Collision));
            by.push((struck * (2.0_f64.sqrt() * fast_s), fast_s, Limit::Lightest));
            by.push((struck * striker_s, longest_s, Limit::Striker));
        } else {
            // nothing moves at first: what drives and displacements do
            let fraction = if self.load.is_none() { struck } else { loaded };
            let time_s = self.scales().time_s;
            let longest_s = if loaded_s.is_none() { time_s } else { longest_s };
            by.push((fraction * time_s, longest_s, Limit::Collision));
        }
        // beside a bath, which gives speeds, drives and displacements may press more
        let pressed_m = if self.baths.is_empty() { 0.0 } else { self.typical_overlap_m() };
        if pressed_m > self.struck_overlap_m(law) {
            let pressed = Scales::of_load(lightest_kg, pressed_m, law.stiffest, law.alpha);
            by.push((struck * pressed.time_s, f64::INFINITY, Limit::Collision));
        }
        by.extend(loaded_s.map(|time_s| (loaded * time_s, time_s, Limit::Load)));
        if let (Some(settling_s), Some(damping)) = (self.settling_s(law), self.damping) {
            for (usual_s, ..) in &mut by {
                *usual_s *= 0.25;
            }
            let usual_s =
                damping.settling_fraction().map_or(f64::INFINITY, |part| part * fraction * settling_s);
            by.push((usual_s, settling_s, Limit::Damping));
        }
        let stiff = stiff_fraction(law.alpha);
        allowed.extend(by.into_iter().map(|(usual_s, longest_s, by)| Allowed {
            usual_s: usual_s * stiff,
            longest_s: 0.25 * longest_s * stiff,
            by,
        }));
    }

    /// True if beads are sent back again and again: by two walls, in a ring, by springs at their places, by a drive that swings; or if many
    /// of them move at first.
    fn opens_again_and_again(&self) -> bool {
        let is_walled = self.ends.left == End::Fixed && self.ends.right == End::Fixed;
        let swings = self.drives.iter().any(|drive| drive.waveform.highest_hz().is_some());
        is_walled
            || self.ends.left == End::Periodic
            || swings
            || !self.baths.is_empty()
            || !self.initial.is_none()
            || !self.on_site.is_none()
    }

    /// True if it is a struck chain of equal beads and impurities, with free ends and without load. In such a chain a contact opens at full
    /// speed only where the shock reaches an end, or an impurity.
    fn is_of_the_paper(&self) -> bool {
        let is_even = self.masses.is_uniform() && self.stiffnesses.is_uniform() && self.contacts.is_empty();
        let is_even = is_even && self.disorder.is_empty() && self.odd_spheres.is_empty();
        let is_even = is_even && self.spheres.as_ref().is_none_or(|spheres| spheres.0.len() == 1);
        let is_plain = !self.has_other_laws() && self.gaps_m.is_none() && self.resonators.is_none();
        let is_struck = !self.is_moved_otherwise();
        is_even
            && is_plain
            && is_struck
            && self.ends.is_free()
            && self.load.is_none()
            && self.on_site.is_none()
    }

    /// Step (s) and number of steps of a run: a step that was asked for is kept, the default step divides the duration.
    pub(super) fn steps(&self, time: TimeConfig) -> Result<(f64, u64), ConfigError> {
        let Some(dt_s) = time.dt_s else { return self.whole_steps(time.duration_s, None) };
        self.check_dt(dt_s)?;
        if let Some(settling_s) = self.bonds_settle_s().filter(|settling_s| dt_s > 0.25 * settling_s) {
            let longest_s = 0.25 * settling_s;
            let allowed = format!(
                "at most {longest_s:.3e} s, a quarter of the time in which dashpots slow a bead down"
            );
            return Err(ConfigError::number("time.dt_s", dt_s, &allowed));
        }
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

    /// The laws of the contacts. Where there is one only, this takes no array.
    fn laws(&self) -> Vec<OneLaw> {
        if !self.has_other_laws() {
            return vec![OneLaw { alpha: self.alpha, stiffest: self.extremes().stiffest }];
        }
        let chain = self.chain();
        let walls = [&chain.walls.left, &chain.walls.right].map(|wall| wall.stiffness);
        let of = |alpha: f64, stiffness: &[f64], walls: [f64; 2]| OneLaw {
            alpha,
            stiffest: stiffness.iter().chain(&walls).copied().fold(0.0, larger),
        };
        let further = chain.terms.iter().filter_map(|term| {
            term.law.exponent().map(|alpha| of(alpha, &term.stiffness, term.wall_stiffness))
        });
        let all = std::iter::once(of(chain.law.alpha(), &chain.stiffness, walls)).chain(further);
        all.filter(|law| law.stiffest > 0.0).collect()
    }

    /// The smallest exponent of any contact; infinite if there are only bonds, which are smooth.
    pub fn smallest_alpha(&self) -> f64 {
        if self.bonds.is_some() {
            return f64::INFINITY;
        }
        let alphas = self.alphas.as_ref().map_or(vec![self.alpha], |alphas| alphas.written().to_vec());
        alphas.into_iter().chain(self.second.iter().map(|second| second.alpha)).fold(f64::INFINITY, smaller)
    }

    /// `√(m/(k·L_s^(α−1)))` (s), with the overlap scale `L_s = (m_s·v0²/k)^(1/(α+1))` of the striker and the largest k of `law`: the time
    /// in which a bead of `mass_kg` moves between neighbours that the shock presses together. It is T in a chain of equal beads, and
    /// `T_fast` for the lightest; none if nothing strikes.
    fn collision_s(&self, law: OneLaw, mass_kg: f64) -> Option<f64> {
        let ratio = self.striker_ratio(law.stiffest)?;
        let pressed = power(ratio, (law.alpha - 1.0) / (law.alpha + 1.0));
        Some((mass_kg / (law.stiffest * pressed)).sqrt())
    }

    /// `T_load` (s): like `T_fast`, for the overlap `L_s + δ_rest` with the largest rest overlap; none in a chain that is not loaded.
    fn fastest_loaded_s(&self, law: OneLaw) -> Option<f64> {
        let rest_m = match &self.alphas {
            // each contact is pressed as its own law says
            Some(_) if !self.load.is_none() => {
                power(self.extreme_loads_n().1 / law.stiffest, 1.0 / law.alpha)
            }
            _ => self.largest_rest_overlap_m(),
        };
        if rest_m == 0.0 {
            return None;
        }
        let struck_m = self.struck_overlap_m(law);
        let pressed = power(rest_m + struck_m, law.alpha - 1.0);
        Some((self.extremes().lightest_kg / (law.stiffest * pressed)).sqrt())
    }

    /// The overlap (m) of the stiffest contact of `law` under the smallest load, 0 in a chain that is not loaded.
    fn smallest_rest_overlap_m(&self, law: OneLaw) -> f64 {
        if self.load.is_none() {
            0.0
        } else {
            power(self.extreme_loads_n().0 / law.stiffest, 1.0 / law.alpha)
        }
    }

    /// The overlap scale `L_s` of the striker and the stiffest contact of `law`, 0 where nothing strikes.
    fn struck_overlap_m(&self, law: OneLaw) -> f64 {
        self.striker_ratio(law.stiffest).map_or(0.0, |ratio| power(ratio, 1.0 / (law.alpha + 1.0)))
    }

    /// `T_settle` (s): the time in which damping between two neighbours at rest slows the lightest bead down by a factor e.
    /// For dashpots it is `m_light/(2γ)`. For a coefficient of restitution `η·δ^p` is less than `ζ·√(2·(α+1))·m_light/T`, with the
    /// shorter of `T_fast` and `T_load`. For others `η·δ^p` is that of the expected overlap.
    fn settling_s(&self, law: OneLaw) -> Option<f64> {
        let lightest_kg = self.extremes().lightest_kg;
        self.damping.map(|damping| match damping {
            Damping::ViscousNSPerM(coefficient) => lightest_kg / (2.0 * coefficient),
            Damping::Restitution(restitution) => {
                let rates = 2.0 * restitution.damping_ratio * (2.0 * (law.alpha + 1.0)).sqrt();
                let times = [self.collision_s(law, lightest_kg), self.fastest_loaded_s(law)];
                let contact_s = times.into_iter().flatten().reduce(smaller);
                contact_s.unwrap_or_else(|| self.scales().time_s) / rates
            }
            // η·δ^p of the overlaps of the shock
            Damping::KuwabaraKonoS(_) | Damping::Power(_) => {
                let pressed_m = self.largest_rest_overlap_m() + self.struck_overlap_m(law);
                let overlap_m = if pressed_m > 0.0 { pressed_m } else { self.typical_overlap_m() };
                let eta = damping.coefficient(law.alpha, law.stiffest, lightest_kg);
                lightest_kg / (2.0 * eta * power(overlap_m, damping.exponent(law.alpha)))
            }
        })
    }

    /// `m_s·v0²/k` (m^(α+1)) of the striker, or of a bead at the speed that drives give; none if nothing moves.
    fn striker_ratio(&self, stiffness: f64) -> Option<f64> {
        let speed_m_s = self.typical_speed_m_s();
        let mass_kg = if self.striker.velocity_m_s == 0.0 { self.bead_mass_kg } else { self.striker_kg() };
        let ratio = mass_kg * (speed_m_s * speed_m_s) / stiffness;
        (speed_m_s > 0.0).then_some(ratio)
    }

    /// The longest step (s) that a run may have: a quarter of the collision time of its lightest bead, or of the time in
    /// which damping settles, by 5/α less above α = 5.
    pub fn longest_dt_s(&self) -> f64 {
        self.allowed().into_iter().map(|allowed| allowed.longest_s).fold(f64::INFINITY, smaller)
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

/// `min(1, 5/α)`.
fn stiff_fraction(alpha: f64) -> f64 {
    if alpha > 5.0 { 5.0 / alpha } else { 1.0 }
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

    /// However strong the damping is, the manifest of a run with the default step is a possible one.
    #[test]
    fn the_default_step_is_allowed() {
        let of = |kind: usize, strength: f64, power: f64| match kind {
            0 => format!("viscous_n_s_per_m = {strength:e}"),
            1 => format!("restitution = {:e}", 1.0 / (1.0 + strength)),
            2 => format!("kuwabara_kono_s = {strength:e}"),
            _ => format!("power = {{ coefficient = {strength:e}, exponent = {power} }}"),
        };
        for (kind, tens) in (0..4).flat_map(|kind| (-8..3).map(move |tens| (kind, tens))) {
            for (duration_s, load_n, alpha) in
                [(1e-2, 0.0, 1.5), (3e-7, 0.0, 1.5), (1e-4, 5.0, 3.0), (1e-4, 0.0, 7.0)]
            {
                let text = format!(
                    "chain = {{ beads = 5, bead_mass_kg = 1e-3, alpha = {alpha}, stiffness = 1e7 }}\n\
                     striker = {{ bead = 0, velocity_m_s = 5.0 }}\nload.precompression_n = {load_n}\n\
                     time.duration_s = {duration_s}\ndamping.{}\n",
                    of(kind, 10.0_f64.powi(tens), alpha)
                );
                let physics = Physics::resolve(&RunConfig::from_toml(&text).expect("TOML")).expect("valid");
                physics.check_dt(physics.dt_s).unwrap_or_else(|why| panic!("{text}: {why}"));
            }
        }
    }

    /// A duration of 2.4 longest steps takes three steps: two would be too long.
    #[test]
    fn a_step_that_divides_is_never_longer_than_allowed() {
        let physics = light_impurity(|_| {});
        let longest_s = physics.longest_dt_s();
        let (dt_s, steps) = physics.whole_steps(2.4 * longest_s, Some(longest_s)).expect("possible");
        assert_eq!(steps, 3);
        assert!(dt_s <= longest_s);
    }

    /// The bead of a resonator of 0 kg has none: its values change neither the scales nor the step.
    #[test]
    fn only_resonators_with_a_mass_decide() {
        let found = |lists: &str| {
            let text = format!(
                "[chain]\nbeads = 2\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[resonators]\n\
                 mass_kg = {{ pattern = [5e-4, 0.0] }}\nstiffness_n_per_m = 1e5\n[initial]\nvelocities_m_s = [0.1, 0.0]\n{lists}\n\
                 [time]\nduration_s = 1e-3\n"
            );
            let physics = Physics::resolve(&RunConfig::from_toml(&text).expect("valid")).expect("valid");
            (physics.scales(), physics.dt_s)
        };
        for list in ["resonator_displacements_m", "resonator_velocities_m_s"] {
            assert_eq!(found(&format!("{list} = [0.0, 10.0]")), found(""));
            assert_ne!(found(&format!("{list} = [10.0, 0.0]")), found(""));
        }
    }

    /// The step of `rkn4` is 0.0075 T where contacts open and close at full speed, and half of that between walls; the chains of the
    /// paper keep 0.02 T.
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
        assert!(near(part_of_t(|c| (c.chain.alpha, c.ends.right) = (Some(2.0), End::Fixed)), 0.02));
    }
}
