//! Twins of a run: they differ from it by as much as its step and its rounding decide.
//!
//! The energy of a symplectic method stays constant while the motion itself goes wrong, so its drift does not show
//! that. Three more runs do, and the tangent of the run:
//!
//! - the *halved* twin makes two steps of `dt/2` for each step of the run, and the *quartered* twin four of `dt/4`;
//! - the *tangent* carries the roundings of all steps since the beginning, by the derivatives of the steps after them; `gear5` has none;
//! - the *moved* twin has the same step, and each velocity that is not zero at step 0 moved by one unit in its last
//!   place, away from zero.
//!
//! A bead that rests stays at rest exactly: no rounding ever moves it before the shock arrives, and one unit in the
//! last place of 0 is `2^-1074`. So it rests in the moved twin, too. (Moved by `2^-52·v0` it would drift apart from
//! its neighbours before the shock arrives, a disturbance that no computation of this run has.) In a loaded chain
//! overlaps are rounded relative to those at rest, however weak the kick is; there the unit is that of `L/T` of the
//! load, where this is the larger one. If nothing moves at first, because drives set the chain in motion, the beads
//! that the drives move first begin with one unit in the last place of `L/T`; without drives, displaced beads are displaced by one unit in
//! the last place more (of the overlap at rest, where this is larger).

use crate::integrator::Integrator;
use crate::roundings::Roundings;
use crate::state::ChainState;
use schemas::drive::{Drive, Place, Quantity, Side};
use schemas::frame::Frame;
use schemas::manifest::Physics;
use schemas::scales::Scales;

/// A run and its twins, advanced together.
#[derive(Debug, Clone)]
pub struct Twins {
    physics: Physics,
    run: Sibling,
    halved: Sibling,
    quartered: Sibling,
    moved: Sibling,
    roundings: Roundings,
    /// The tangent that they have come to, of runs that have one.
    tangent: Option<Vec<f64>>,
}

/// The states of a run and its twins at the same time, as frames of the run.
#[derive(Debug, Clone, Copy)]
pub struct Together<'a> {
    /// The run.
    pub run: Frame<'a>,
    /// The twin with half the step.
    pub halved: Frame<'a>,
    /// The twin with a quarter of the step.
    pub quartered: Frame<'a>,
    /// The twin with moved velocities or displacements.
    pub moved: Frame<'a>,
    /// Changes of the run's displacements (m), then of its velocities (m/s), by the roundings so far, if the run has a tangent.
    pub rounded: Option<&'a [f64]>,
}

/// The dynamics left the range of doubles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("bead {bead} of {which} is not finite before step {step}: {why}")]
pub struct NonFinite {
    /// The run, or the name of the twin.
    pub which: &'static str,
    /// The step of the run that was to be reached.
    pub step: u64,
    /// The first such bead.
    pub bead: usize,
    /// The likely reason, and what to do ([`Physics::why_not_finite`]).
    pub why: &'static str,
}

#[derive(Debug, Clone)]
struct Sibling {
    which: &'static str,
    integrator: Integrator,
    state: ChainState,
    /// Its steps in a step of the run.
    steps_in_step: u64,
}

impl Twins {
    /// The run that `physics` describes and its twins, at step 0.
    pub fn new(physics: &Physics) -> Self {
        let run = Sibling {
            which: "the run",
            integrator: Integrator::with_tangents(physics, 1).unwrap_or_else(|_| Integrator::new(physics)),
            state: ChainState::initial(physics),
            steps_in_step: 1,
        };
        let halved = Sibling::finer(physics, 2, "the twin with half the step");
        let quartered = Sibling::finer(physics, 4, "the twin with a quarter of the step");
        let (mut u_m, mut v_m_s) = physics.initial_state();
        if v_m_s.iter().any(|v| *v != 0.0) {
            let least_m_s = load_speed_m_s(physics);
            for v in &mut v_m_s {
                *v = moved(*v, least_m_s);
            }
        } else if physics.drives.is_empty() {
            let least_m = largest_rest_m(physics);
            for u in &mut u_m {
                *u = moved(*u, least_m);
            }
        } else {
            driven_first(physics).for_each(|bead| v_m_s[bead] = moved_by_m_s(physics));
        }
        let moved = Sibling {
            state: ChainState::starting_at(physics, &u_m, &v_m_s),
            ..Sibling::finer(physics, 1, "the twin with moved velocities")
        };
        let scales = physics.scales();
        let roundings = Roundings::new(&physics.chain(), [scales.length_m, scales.speed_m_s()]);
        Self { physics: physics.clone(), run, halved, quartered, moved, roundings, tangent: None }
    }

    /// Advances all four to step `step` of the run, if they are not there yet, and adds the roundings of the steps to the tangent.
    ///
    /// # Errors
    /// When a state is not finite.
    pub fn advance_to(&mut self, step: u64) -> Result<(), NonFinite> {
        let steps = step.saturating_sub(self.run.state.step); // integers
        let Self { physics, run, halved, quartered, moved, .. } = &mut *self;
        for sibling in [run, halved, quartered, moved] {
            if let Some(bead) = sibling.advance_to(step) {
                return Err(NonFinite { which: sibling.which, step, bead, why: physics.why_not_finite() });
            }
        }
        if let Some(tangents) = self.run.integrator.tangents() {
            self.roundings.add(tangents, &self.run.state, steps);
            self.tangent = Some(tangents.tangent(0));
        }
        Ok(())
    }

    /// The states of all four at the present step.
    pub fn together(&self) -> Together<'_> {
        let step = self.run.state.step;
        let time_s = self.physics.time_s(step);
        let all = [&self.run, &self.halved, &self.quartered, &self.moved];
        let [run, halved, quartered, moved] = all.map(|each| each.at(step, time_s));
        Together { run, halved, quartered, moved, rounded: self.tangent.as_deref() }
    }
}

impl Sibling {
    /// A twin that makes `parts` steps for each step of the run.
    fn finer(physics: &Physics, parts: u64, which: &'static str) -> Self {
        let mut finer = physics.clone();
        finer.dt_s /= parts as f64;
        finer.step_count *= parts;
        Self {
            which,
            integrator: Integrator::new(&finer),
            state: ChainState::initial(&finer),
            steps_in_step: parts,
        }
    }

    /// Its state as that of step `step` of the run.
    fn at(&self, step: u64, time_s: f64) -> Frame<'_> {
        let ChainState { u_m, v_m_s, extra, .. } = &self.state;
        Frame { frame: step, step, time_s, u_m, v_m_s, extra, active: None }
    }

    /// Advances to step `step` of the run; the first bead that is not finite there.
    fn advance_to(&mut self, step: u64) -> Option<usize> {
        let last = step * self.steps_in_step;
        if self.state.step >= last {
            return None;
        }
        while self.state.step < last {
            self.integrator.advance(&mut self.state, last);
        }
        self.integrator.first_non_finite(&self.state)
    }
}

/// `v` moved away from zero by one unit in the last place of `v` or of `least`; zero stays zero.
fn moved(v: f64, least: f64) -> f64 {
    let size = if v.abs() > least { v.abs() } else { least };
    if v == 0.0 { v } else { v + (size.next_up() - size).copysign(v) }
}

/// Difference of the moved twin of `physics` from the run at step 0 (m/s).
pub fn moved_by_m_s(physics: &Physics) -> f64 {
    let (v, load_m_s) = (physics.striker.velocity_m_s, load_speed_m_s(physics));
    let v = if v == 0.0 { physics.scales().speed_m_s() } else { v };
    (moved(v, load_m_s) - v).abs()
}

/// The beads that drives move first: those with a force on them, and the neighbours of what has a prescribed motion.
fn driven_first(physics: &Physics) -> impl Iterator<Item = usize> {
    let last = physics.beads - 1;
    let first = move |drive: &Drive| match (drive.at, drive.prescribes) {
        (Place::Wall(Side::Left), _) => 0,
        (Place::Wall(Side::Right), _) => last,
        (Place::Bead(bead), Quantity::Force) => bead,
        (Place::Bead(bead), _) => {
            if bead < last {
                bead + 1
            } else {
                bead - 1
            }
        }
    };
    physics.drives.iter().map(first).filter_map(|bead| usize::try_from(bead).ok())
}

/// The largest overlap (m) at rest, 0 in an unloaded chain.
fn largest_rest_m(physics: &Physics) -> f64 {
    let chain = physics.chain();
    let walls = [chain.walls.left.rest_overlap_m, chain.walls.right.rest_overlap_m];
    let rests_m = chain.rest_overlap_m.iter().chain(&walls);
    rests_m.fold(0.0, |largest, rest_m| if *rest_m > largest { *rest_m } else { largest })
}

/// `L/T` (m/s) of the load, 0 in an unloaded chain.
fn load_speed_m_s(physics: &Physics) -> f64 {
    let largest_m = largest_rest_m(physics);
    if largest_m == 0.0 {
        return 0.0;
    }
    Scales::of_load(physics.bead_mass_kg, largest_m, physics.stiffness, physics.alpha).speed_m_s()
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::RunConfig;
    use schemas::method::Method;
    use schemas::presets::Preset;

    fn physics(preset: &str, change: impl FnOnce(&mut RunConfig)) -> Physics {
        let mut config = Preset::find(preset).expect("preset").config();
        config.chain.beads = 20;
        config.time.duration_s = 2e-3;
        change(&mut config);
        Physics::resolve(&config).expect("valid")
    }

    /// The run has the bits of the run alone, and each twin those of a run of its own.
    #[test]
    fn twins_are_runs() {
        for method in [Method::Rkn4, Method::VelocityVerlet, Method::Gear5] {
            let physics = physics("homogeneous", |config| config.integrator.method = method);
            let mut twins = Twins::new(&physics);
            for step in [0, 7, physics.step_count] {
                twins.advance_to(step).expect("finite");
            }
            let alone = |physics: &Physics, velocity_m_s: f64| {
                let (u_m, mut v_m_s) = physics.initial_state();
                v_m_s[0] = velocity_m_s;
                let mut state = ChainState::starting_at(physics, &u_m, &v_m_s);
                let mut integrator = Integrator::new(physics);
                for _ in 0..physics.step_count {
                    integrator.step(&mut state);
                }
                state
            };
            let finer = |parts: u64| {
                let mut finer = physics.clone();
                (finer.dt_s, finer.step_count) = (physics.dt_s / parts as f64, physics.step_count * parts);
                alone(&finer, 5.0)
            };
            let expected = [alone(&physics, 5.0), finer(2), finer(4), alone(&physics, 5.0_f64.next_up())];
            let Together { run, halved, quartered, moved, rounded } = twins.together();
            assert_eq!(rounded.is_some(), method != Method::Gear5);
            for (found, expected) in [run, halved, quartered, moved].into_iter().zip(&expected) {
                assert_eq!((found.u_m, found.v_m_s), (&expected.u_m[..], &expected.v_m_s[..]), "{method}");
                assert_eq!(
                    (found.step, found.time_s),
                    (physics.step_count, physics.time_s(physics.step_count))
                );
            }
            assert!(halved.u_m != run.u_m && quartered.u_m != halved.u_m && moved.u_m != run.u_m);
        }
    }

    #[test]
    fn only_what_moves_is_moved() {
        assert_eq!(moved(0.0, 1.0), 0.0);
        assert_eq!((moved(1.0, 0.0), moved(-1.0, 0.0)), (1.0 + f64::EPSILON, -1.0 - f64::EPSILON));
        assert_eq!(moved(1e-10, 1.0), 1e-10 + f64::EPSILON);
        let struck = physics("walls", |_| ());
        assert_eq!(moved_by_m_s(&struck), 4.0 * f64::EPSILON); // 5 m/s, between 4 and 8
        let twins = Twins::new(&struck);
        let Together { run, moved, .. } = twins.together();
        assert_eq!(run.v_m_s.iter().zip(moved.v_m_s).filter(|(run, moved)| run != moved).count(), 1);
    }

    /// A chain that a drive or displacements set in motion has a rounding error, too.
    #[test]
    fn what_a_drive_moves_first_or_is_displaced_is_moved() {
        let drive = "[[drive]]\nbead = 2\nforce_n = { half_sine = { amplitude = 1.0, duration_s = 1e-4 } }\n";
        let displaced =
            "[load]\nprecompression_n = 1.0\n[initial]\ndisplacements_m = [1e-6, 0.0, 0.0, 0.0, 0.0, 0.0]\n";
        for moves in [drive, displaced] {
            let text = format!(
                "[chain]\nbeads = 6\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n{moves}[striker]\nbead = 0\nvelocity_m_s = 0\n\
                 [time]\nduration_s = 1e-3\n"
            );
            let config = RunConfig::from_toml(&text).expect("a configuration");
            let physics = Physics::resolve(&config).expect("valid");
            let mut twins = Twins::new(&physics);
            twins.advance_to(physics.step_count).expect("finite");
            let Together { run, moved, .. } = twins.together();
            assert!(run.u_m != moved.u_m, "{moves}");
            assert!(moved_by_m_s(&physics) > 0.0);
        }
    }

    /// Under 100 N overlaps are some 0.46 mm: a kick of 1e-13 m/s changes them by little more than their rounding.
    #[test]
    fn a_weak_kick_under_load_is_moved_by_what_rounding_moves_it() {
        let weak = physics("precompressed", |config| {
            config.load.precompression_n = 100.0;
            config.striker.velocity_m_s = 1e-13;
        });
        let speed_m_s = 464e-6 / (1e-3 / (1e7 * 464e-6_f64.sqrt())).sqrt(); // L/T of the load
        let ulps = moved_by_m_s(&weak) / (speed_m_s * f64::EPSILON);
        assert!((0.5..=1.0).contains(&ulps), "{ulps}");
    }
}
