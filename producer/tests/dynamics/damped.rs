//! What damped contacts dissipate, against collisions that are solved exactly.

use crate::chains::{config, final_state};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{DampingConfig, End, MassRule, RunConfig, StrikerConfig};
use schemas::damping::Restitution;
use schemas::manifest::Physics;
use schemas::method::Method;

/// A damped run with the default step of `rk5`, changed by `change`.
fn damped(beads: u64, alpha: f64, damping: DampingConfig, change: impl FnOnce(&mut RunConfig)) -> Physics {
    let mut config = config(beads, alpha);
    (config.damping, config.integrator.method) = (Some(damping), Method::Rk5);
    config.time.duration_s = 1e3;
    change(&mut config);
    Physics::resolve(&config).unwrap()
}

/// The same run over `times` T.
fn lasting(mut physics: Physics, times: f64) -> Physics {
    let steps = times * physics.scales().time_s / physics.dt_s;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number of steps")]
    let steps = steps as u64;
    physics.step_count = steps;
    physics
}

/// The force begins as `δ^p` with `p = (α−1)/2`, so that the first step makes an error of the order `dt^(p+1)`.
#[test]
fn beads_part_with_their_coefficient_of_restitution_at_any_speed() {
    for alpha in [1.0, 1.3, 1.5, 2.0, 3.0] {
        for coefficient in [0.01, 0.3, 0.9, 0.99] {
            let [slow, fast] = [0.02, 5.0].map(|velocity_m_s| {
                let physics = damped(2, alpha, DampingConfig::Restitution(coefficient), |config| {
                    config.chain.masses = MassRule::PatternKg(vec![1e-3, 3e-3]);
                    config.striker.velocity_m_s = velocity_m_s;
                });
                let v = final_state(&lasting(physics, 40.0)).v_m_s;
                (v[1] - v[0]) / velocity_m_s
            });
            // at any speed the same to rounding, as steps are a fraction of T
            assert!((slow / fast - 1.0).abs() < 1e-8, "α = {alpha}: {slow} and {fast}");
            // the default step is at most 0.005 T, and as blunt as α − 1: (5e-4)^1 to (5e-3)²
            assert!((fast - coefficient).abs() < 1e-4, "α = {alpha}: {fast}, not {coefficient}");
        }
    }
}

/// The error of a coefficient of restitution falls like `dt^(p+1)`.
#[test]
fn coefficients_of_restitution_converge_with_the_step() {
    for alpha in [1.0, 1.5, 2.0, 3.0] {
        let error = |halvings: i32| {
            let mut physics = damped(2, alpha, DampingConfig::Restitution(0.5), |_| {});
            physics.dt_s *= 0.5_f64.powi(halvings);
            let v = final_state(&lasting(physics, 10.0)).v_m_s;
            ((v[1] - v[0]) / 5.0 - 0.5).abs()
        };
        let order = (error(0) / error(3)).log2() / 3.0;
        // at α = 3 the step in which the force ends counts, too
        let allowed = if alpha < 3.0 { 0.03 } else { 0.3 };
        assert!((order - 0.5 * (alpha + 1.0)).abs() < allowed, "α = {alpha}: order {order}");
    }
}

#[test]
fn a_bead_leaves_a_wall_with_its_coefficient_of_restitution() {
    for alpha in [1.0, 1.5, 3.0] {
        let physics = damped(2, alpha, DampingConfig::Restitution(0.8), |config| {
            config.ends.right = End::Fixed;
            config.striker = StrikerConfig { bead: 1, velocity_m_s: 5.0 }.into();
        });
        let mut integrator = Integrator::new(&physics);
        let mut state = ChainState::initial(&physics);
        integrator.step(&mut state);
        // while the wall pushes, and until bead 0 is met
        let mut leaving_m_s = 0.0;
        while state.u_m[1] > 0.0 {
            leaving_m_s = state.v_m_s[1];
            integrator.step(&mut state);
        }
        let found = -leaving_m_s / physics.striker.velocity_m_s;
        assert!((found - 0.8).abs() < 1e-4, "α = {alpha}: {found}");
    }
}

/// `δ = v/ω·e^(−βt)·sin ωt` with `β = γ/(2m*)` and `ω² = k/m* − β²`, until the force ends.
#[test]
fn a_dashpot_beside_a_linear_spring_is_a_damped_oscillator() {
    for ratio in [0.1, 0.5, 0.9] {
        let (reduced_kg, stiffness) = (0.5e-3, 1e7_f64);
        let gamma = 2.0 * ratio * (stiffness * reduced_kg).sqrt();
        let physics = damped(2, 1.0, DampingConfig::ViscousNSPerM(gamma), |_| {});
        let v0 = physics.striker.velocity_m_s;
        let beta = 0.5 * gamma / reduced_kg;
        let omega = (stiffness / reduced_kg - beta * beta).sqrt();
        let mut integrator = Integrator::new(&physics);
        let mut state = ChainState::initial(&physics);
        let mut worst: f64 = 0.0;
        loop {
            integrator.step(&mut state);
            let t = physics.time_s(state.step);
            let decay = v0 * (-beta * t).exp();
            let overlap = decay / omega * (omega * t).sin();
            let rate = decay * ((omega * t).cos() - beta / omega * (omega * t).sin());
            if stiffness * overlap + gamma * rate < 0.0 {
                break;
            }
            let (u, v) = (&state.u_m, &state.v_m_s);
            let errors = [(u[0] - u[1] - overlap) * omega, v[0] - v[1] - rate];
            worst = errors.iter().fold(worst, |worst, error| worst.max((error / v0).abs()));
        }
        // the force begins with a jump of 2ζ·v0/T: the first of the steps of 5e-4 T makes an error of their order
        assert!(worst < 1e-3, "ζ = {ratio}: {worst:e}");
        let v = final_state(&lasting(physics, 20.0)).v_m_s;
        let (found, expected) = ((v[1] - v[0]) / v0, Restitution::coefficient_of(ratio));
        assert!((found - expected).abs() < 2e-4, "ζ = {ratio}: {found}, not {expected}");
    }
}

type Change = fn(&mut RunConfig);

/// Chains between which damping makes a difference.
const CHAINS: [(&str, Change); 5] = [
    ("free", |_| {}),
    ("dimer", |c| c.chain.masses = MassRule::PatternKg(vec![1e-3, 0.3e-3])),
    ("walls", |c| (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed)),
    ("pressed", |c| c.load.precompression_n = 50.0),
    ("gravity", |c| (c.ends.right, c.load.gravity_m_s2) = (End::Fixed, 2000.0)),
];

/// The largest `|E + W − E0|/E0` of a run of 30 T, and the part of E0 that was dissipated.
fn imbalance(physics: &Physics) -> (f64, f64) {
    let chain = physics.chain();
    let initial_j = physics.initial_energy().total_j();
    let mut contact_j = vec![0.0; chain.contact_count()];
    let mut integrator = Integrator::new(physics);
    let mut state = ChainState::initial(physics);
    let (mut worst, mut dissipated) = (0.0_f64, 0.0);
    for _ in 0..physics.step_count {
        integrator.step(&mut state);
        let energy_j = chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut contact_j).total_j();
        dissipated = physics.dissipated_j(&state.extra) / initial_j;
        worst = worst.max((energy_j / initial_j + dissipated - 1.0).abs());
    }
    (worst, dissipated)
}

/// The steps in which a contact closes and damping sets in as `δ^p` make errors of the order `dt^(p+1)`.
#[test]
fn energy_and_dissipated_work_add_up() {
    for alpha in [1.1, 1.5, 3.0] {
        // a tenth of the critical damping, or so
        let time_s = Physics::resolve(&config(2, alpha)).unwrap().scales().time_s;
        let dashpot = DampingConfig::ViscousNSPerM(1e-4 / time_s);
        for (damping, allowed) in [
            (DampingConfig::Restitution(0.5), 3e-4),
            (DampingConfig::Restitution(0.95), 2e-5),
            // the force begins with a jump that is worth 0.1·v0·dt/T of velocity
            (dashpot, 1e-3),
        ] {
            for (name, change) in CHAINS {
                let name = format!("{name}, α = {alpha}, {damping:?}");
                let physics = damped(12, alpha, damping, change);
                let (coarse, dissipated) = imbalance(&lasting(physics.clone(), 30.0));
                assert!(dissipated > 0.05 && dissipated < 1.0, "{name}: W = {dissipated} E0");
                assert!(coarse < allowed, "{name}: off by {coarse:e}");
                if name.starts_with("free") {
                    // all is at rest, or touches, when damping sets in
                    assert!(coarse < 1e-9, "{name}: off by {coarse:e}");
                }
            }
        }
    }
}

/// A dashpot so strong that it moves a bead with its neighbours at once does not make the step unstable.
#[test]
fn strong_damping_has_a_step_of_its_own() {
    for alpha in [1.0, 1.5, 3.0] {
        for damping in [DampingConfig::ViscousNSPerM(1e5), DampingConfig::Restitution(1e-3)] {
            let mut physics = damped(4, alpha, damping, |_| {});
            physics.step_count = 20_000;
            let state = final_state(&physics);
            let largest = state.v_m_s.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
            assert!(largest <= 5.0, "α = {alpha}, {damping:?}: {largest} m/s");
            let mut config = config(4, alpha);
            (config.damping, config.integrator.method) = (Some(damping), Method::Rk5);
            config.time.dt_s = Some(1.01 * physics.longest_dt_s());
            let error = Physics::resolve(&config).expect_err("the step does not resolve the damping");
            assert_eq!(error.key, "time.dt_s");
        }
    }
}
