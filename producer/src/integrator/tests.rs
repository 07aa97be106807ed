use super::*;
use crate::splitting::Stages;
use pulp::Arch;
use schemas::chain::Chain;
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
    state.u_m.iter().chain(&state.v_m_s).chain(&state.extra).map(|x| x.to_bits()).collect()
}

/// Net force (N) on each bead, contact by contact: no window, no vectors, nothing kept.
fn net_forces(chain: &Chain, u: &[f64]) -> Vec<f64> {
    let force = |c: usize| chain.law.force(chain.stiffness[c], u[c] - u[c + 1]);
    let net = |i: usize| {
        let left = if i > 0 { force(i - 1) } else { 0.0 };
        let right = if i < chain.contact_count() { force(i) } else { 0.0 };
        left - right
    };
    (0..u.len()).map(net).collect()
}

/// The definition of a step.
fn naive_step(physics: &Physics, state: &mut ChainState) {
    match physics.method {
        Method::VelocityVerlet => naive_splitting_step(physics, VELOCITY_VERLET, state),
        Method::Rkn4 => naive_splitting_step(physics, RKN4, state),
        Method::Gear5 => naive_gear_step(physics, state),
    }
    state.step += 1;
}

fn naive_splitting_step(physics: &Physics, stages: Stages, state: &mut ChainState) {
    let chain = physics.chain();
    let kick = |h: f64, u: &[f64], v: &mut [f64]| {
        for (i, force) in net_forces(&chain, u).into_iter().enumerate() {
            v[i] = (h * (1.0 / chain.mass_kg[i])).mul_add(force, v[i]);
        }
    };
    for (b, a) in stages.kick_drift {
        kick(b * physics.dt_s, &state.u_m, &mut state.v_m_s);
        for (u, v) in state.u_m.iter_mut().zip(&state.v_m_s) {
            *u = (a * physics.dt_s).mul_add(*v, *u);
        }
    }
    kick(stages.last_kick * physics.dt_s, &state.u_m, &mut state.v_m_s);
}

fn naive_gear_step(physics: &Physics, state: &mut ChainState) {
    let (chain, dt) = (physics.chain(), physics.dt_s);
    let n = chain.bead_count();
    // terms of up to 2^-900 m are zero
    let kept = |x: f64| if x.abs() > 2.0_f64.powi(-900) { x } else { 0.0 };
    let predicted: Vec<[f64; 6]> = (0..n)
        .map(|i| {
            let [q2, q3, q4, q5] = [0, 1, 2, 3].map(|k| state.extra[k * n + i]);
            let change = dt.mul_add(state.v_m_s[i], ((q5 + q4) + q3) + q2);
            let higher = 2.0_f64.mul_add(q2, 3.0_f64.mul_add(q3, 4.0_f64.mul_add(q4, 5.0 * q5)));
            [
                state.u_m[i] + change,
                (1.0 / dt).mul_add(higher, state.v_m_s[i]),
                3.0_f64.mul_add(q3, 6.0_f64.mul_add(q4, 10.0 * q5)) + q2,
                4.0_f64.mul_add(q4, 10.0 * q5) + q3,
                5.0_f64.mul_add(q5, q4),
                q5,
            ]
        })
        .collect();
    let positions: Vec<f64> = predicted.iter().map(|p| p[0]).collect();
    for (i, force) in net_forces(&chain, &positions).into_iter().enumerate() {
        let p = predicted[i];
        let q2 = (0.5 * (dt * dt) * (1.0 / chain.mass_kg[i])) * force;
        let miss = q2 - p[2];
        state.u_m[i] = (3.0_f64 / 20.0).mul_add(miss, p[0]);
        state.v_m_s[i] = (251.0_f64 / 360.0 / dt).mul_add(miss, p[1]);
        state.extra[i] = q2;
        state.extra[n + i] = kept((11.0_f64 / 18.0).mul_add(miss, p[3]));
        state.extra[2 * n + i] = kept((1.0_f64 / 6.0).mul_add(miss, p[4]));
        state.extra[3 * n + i] = kept((1.0_f64 / 60.0).mul_add(miss, p[5]));
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
    for method in Method::ALL {
        let physics = physics(|c| c.integrator.method = method);
        let chain = physics.chain();
        let momentum = |s: &ChainState| s.v_m_s.iter().zip(&chain.mass_kg).map(|(v, m)| v * m).sum::<f64>();
        let mut integrator = Integrator::new(&physics);
        let mut state = ChainState::initial(&physics);
        let before = momentum(&state);
        for _ in 0..physics.step_count {
            integrator.step(&mut state);
        }
        // one rounding of ε/2·v for each bead and kick, adding up like a random walk
        assert!((momentum(&state) / before - 1.0).abs() < 1e-12, "{method}");
    }
}

/// Energy against the initial one, with the coefficients that `shared/reference` gives for
/// velocity Verlet (0.12·(dt/T)², α = 1.5), and 1e-6 for rkn4 at its default step.
#[test]
fn energy_drift_is_what_the_reference_says() {
    for (method, bound) in
        [(Method::VelocityVerlet, 0.13 * 0.0025 * 0.0025), (Method::Rkn4, 1e-7), (Method::Gear5, 2e-7)]
    {
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
