//! Symplectic integrators: alternating kicks (at constant displacement) and drifts (at constant
//! velocity).
//!
//! Architecture invariant: a step is a pure function of the state. The forces that end one step and
//! begin the next are kept, but they depend on the displacements alone, so that a fresh integrator
//! started at any state goes on with the same bits.

use crate::kernel::{Activity, Kernel};
use crate::state::ChainState;
use schemas::manifest::Physics;
use schemas::method::Method;

/// The stages of a method `K(b₁) D(a₁) K(b₂) D(a₂) … K(b_last)`, as fractions of the time step.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stages {
    /// The kicks but the last, each with the drift after it: `(b, a)`.
    kick_drift: &'static [(f64, f64)],
    /// The last kick.
    last_kick: f64,
}

/// Velocity Verlet, second order.
///
/// # Source
/// W. C. Swope et al., J. Chem. Phys. 76 (1982) 637, doi:10.1063/1.442716.
const VELOCITY_VERLET: Stages = Stages { kick_drift: &[(0.5, 1.0)], last_kick: 0.5 };

const A1: f64 = 0.245_298_957_184_271;
const A2: f64 = 0.604_872_665_711_080;
const A3: f64 = 0.5 - (A1 + A2);
const B1: f64 = 0.082_984_406_417_405_2;
const B2: f64 = 0.396_309_801_498_368;
const B3: f64 = -0.039_056_304_922_348_6;
const B4: f64 = 1.0 - 2.0 * (B1 + B2 + B3);

/// Runge–Kutta–Nyström splitting with six stages, fourth order.
///
/// # Source
/// S. Blanes and P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313, table 3 (`SRKN6b`),
/// doi:10.1016/S0377-0427(01)00492-7.
const RKN4: Stages =
    Stages { kick_drift: &[(B1, A1), (B2, A2), (B3, A3), (B4, A3), (B3, A2), (B2, A1)], last_kick: B1 };

/// Advances the states of one chain.
#[derive(Debug, Clone)]
pub struct Integrator {
    kernel: Kernel,
    /// `(kick, drift)` durations (s) of the stages.
    kick_drift_s: Vec<(f64, f64)>,
    last_kick_s: f64,
    /// The step at which the kernel's forces were evaluated.
    forces_of_step: Option<u64>,
}

impl Integrator {
    /// The integrator of a run.
    pub fn new(physics: &Physics) -> Self {
        let chain = physics.chain();
        Self::with_kernel(physics.method, physics.dt_s, Kernel::new(&chain))
    }

    fn with_kernel(method: Method, dt_s: f64, kernel: Kernel) -> Self {
        let stages = match method {
            Method::VelocityVerlet => VELOCITY_VERLET,
            Method::Rkn4 => RKN4,
        };
        Self {
            kernel,
            kick_drift_s: stages.kick_drift.iter().map(|(b, a)| (b * dt_s, a * dt_s)).collect(),
            last_kick_s: stages.last_kick * dt_s,
            forces_of_step: None,
        }
    }

    /// Advances `state` by one step.
    ///
    /// The states passed in successive calls must be those that the calls left behind.
    pub fn step(&mut self, state: &mut ChainState) {
        if self.forces_of_step != Some(state.step) {
            self.kernel.restart(Activity::of(&state.u_m, &state.v_m_s));
            self.kernel.evaluate_forces(&state.u_m);
        }
        for (kick_s, drift_s) in &self.kick_drift_s {
            self.kernel.kick_drift(*kick_s, *drift_s, &mut state.u_m, &mut state.v_m_s);
            self.kernel.evaluate_forces(&state.u_m);
        }
        self.kernel.kick(self.last_kick_s, &mut state.v_m_s);
        state.step += 1;
        self.forces_of_step = Some(state.step);
    }

    /// The first bead of the `state` just stepped to whose displacement or velocity is not finite.
    pub fn first_non_finite(&self, state: &ChainState) -> Option<usize> {
        self.kernel.first_non_finite(&state.u_m, &state.v_m_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Arch;
    use schemas::config::RunConfig;
    use schemas::presets::PRESETS;

    fn physics(change: impl FnOnce(&mut RunConfig)) -> Physics {
        let mut config = PRESETS[0].config();
        config.chain.beads = 60;
        config.chain.impurities[0].bead = 30;
        config.time.duration_s = 5e-3;
        change(&mut config);
        Physics::resolve(&config).expect("valid")
    }

    fn bits(state: &ChainState) -> Vec<u64> {
        state.u_m.iter().chain(&state.v_m_s).map(|x| x.to_bits()).collect()
    }

    /// A kernel without windows, vectors or shared forces: the definition of a step.
    fn naive_step(physics: &Physics, state: &mut ChainState) {
        let chain = physics.chain();
        let law = chain.law;
        let stages = match physics.method {
            Method::VelocityVerlet => VELOCITY_VERLET,
            Method::Rkn4 => RKN4,
        };
        let n = chain.bead_count();
        let kick = |h: f64, u: &[f64], v: &mut [f64]| {
            let force = |c: usize| law.force(chain.stiffness[c], u[c] - u[c + 1]);
            for (i, v) in v.iter_mut().enumerate() {
                let left = if i > 0 { force(i - 1) } else { 0.0 };
                let right = if i + 1 < n { force(i) } else { 0.0 };
                *v = (h * (1.0 / chain.mass_kg[i])).mul_add(left - right, *v);
            }
        };
        for (b, a) in stages.kick_drift {
            kick(b * physics.dt_s, &state.u_m, &mut state.v_m_s);
            for i in 0..n {
                state.u_m[i] = (a * physics.dt_s).mul_add(state.v_m_s[i], state.u_m[i]);
            }
        }
        kick(stages.last_kick * physics.dt_s, &state.u_m, &mut state.v_m_s);
        state.step += 1;
    }

    /// `SRKN6b` is consistent: kicks and drifts add up to one step each.
    #[test]
    fn stages_add_up_to_one_step() {
        for stages in [VELOCITY_VERLET, RKN4] {
            let kicks: f64 = stages.kick_drift.iter().map(|(b, _)| b).sum::<f64>() + stages.last_kick;
            let drifts: f64 = stages.kick_drift.iter().map(|(_, a)| a).sum();
            assert!((kicks - 1.0).abs() < 1e-15 && (drifts - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn skipping_and_vectors_change_no_bit() {
        let mut archs = vec![Arch::Scalar, Arch::new()];
        #[cfg(target_arch = "x86_64")]
        archs.extend(pulp::x86::V3::try_new().map(Arch::V3));
        for method in Method::ALL {
            for alpha in [1.0, 1.01, 1.3, 1.5, 2.0, 2.5, 3.0, 10.0] {
                let physics = physics(|c| {
                    c.chain.alpha = alpha;
                    c.integrator.method = method;
                    c.time.dt_s = None;
                    c.time.duration_s = 1.0;
                });
                let mut naive = ChainState::initial(&physics);
                let mut ours: Vec<_> = archs
                    .iter()
                    .map(|arch| {
                        let kernel = Kernel::with_arch(&physics.chain(), *arch);
                        let integrator = Integrator::with_kernel(method, physics.dt_s, kernel);
                        (integrator, ChainState::initial(&physics))
                    })
                    .collect();
                for _ in 0..400 {
                    naive_step(&physics, &mut naive);
                    for (integrator, state) in &mut ours {
                        integrator.step(state);
                        assert_eq!(bits(state), bits(&naive), "{method}, α = {alpha}, step {}", naive.step);
                    }
                }
            }
        }
    }

    #[test]
    fn a_fresh_integrator_at_every_step_gives_the_same_bits() {
        for method in Method::ALL {
            let physics = physics(|c| c.integrator.method = method);
            let mut one = Integrator::new(&physics);
            let mut state = ChainState::initial(&physics);
            for _ in 0..300 {
                let mut again = state.clone();
                Integrator::new(&physics).step(&mut again);
                one.step(&mut state);
                assert_eq!(bits(&again), bits(&state), "{method}, step {}", state.step);
            }
        }
    }

    /// Momentum is conserved to rounding: every force acts on two beads with opposite signs.
    #[test]
    fn momentum_is_conserved() {
        let physics = physics(|_| {});
        let chain = physics.chain();
        let momentum = |s: &ChainState| s.v_m_s.iter().zip(&chain.mass_kg).map(|(v, m)| v * m).sum::<f64>();
        let mut integrator = Integrator::new(&physics);
        let mut state = ChainState::initial(&physics);
        let before = momentum(&state);
        for _ in 0..physics.step_count {
            integrator.step(&mut state);
        }
        // one rounding of ε/2·v for each bead and kick, adding up like a random walk
        assert!((momentum(&state) / before - 1.0).abs() < 1e-12);
    }

    /// Energy against the initial one, with the coefficients that `shared/reference` gives for
    /// velocity Verlet (0.12·(dt/T)², α = 1.5), and 1e-6 for rkn4 at its default step.
    #[test]
    fn energy_drift_is_what_the_reference_says() {
        for (method, bound) in [(Method::VelocityVerlet, 0.13 * 0.0025 * 0.0025), (Method::Rkn4, 1e-7)] {
            let physics = physics(|c| {
                c.chain.impurities.clear();
                c.integrator.method = method;
            });
            let chain = physics.chain();
            let initial = physics.initial_energy().total_j();
            let mut scratch = vec![0.0; chain.contact_count()];
            let mut integrator = Integrator::new(&physics);
            let mut state = ChainState::initial(&physics);
            let mut worst: f64 = 0.0;
            for _ in 0..physics.step_count {
                integrator.step(&mut state);
                let energy = chain.energy(&state.u_m, &state.v_m_s, &mut scratch).total_j();
                worst = worst.max((energy / initial - 1.0).abs());
            }
            assert!(worst < bound, "{method}: |ΔE/E| = {worst:e}");
            assert!(worst > bound / 1e3, "{method}: |ΔE/E| = {worst:e} is too good to be true");
        }
    }
}
