//! Drives that jump, have kinks or are over within a step: nothing of them is lost.

use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{IntegratorConfig, RunConfig};
use schemas::manifest::Physics;
use schemas::method::Method;

/// The run of `toml` by `method`, and its last state.
fn end_of(toml: &str, method: Method) -> (Physics, ChainState) {
    let mut config = RunConfig::from_toml(toml).expect("a configuration");
    config.integrator = IntegratorConfig { method };
    let physics = Physics::resolve(&config).expect("a run");
    let (mut integrator, mut state) = (Integrator::new(&physics), ChainState::initial(&physics));
    while state.step < physics.step_count {
        integrator.advance(&mut state, physics.step_count);
    }
    (physics, state)
}

const METHODS: [Method; 3] = [Method::VelocityVerlet, Method::Rkn4, Method::Rk5];

/// The momentum of a free chain is the impulse of the forces on it. Those of straight lines are found to rounding; a sine that is
/// cut off, and half of one, as well as a method integrates a sine.
#[test]
fn the_momentum_of_a_free_chain_is_the_impulse_of_its_forces() {
    let cut = |t: f64| {
        100.0 / (2.0 * std::f64::consts::PI * 5000.0)
            * (1.0 - (2.0 * std::f64::consts::PI * 5000.0 * t).cos())
    };
    let half = 2.0 / std::f64::consts::PI;
    // waveform, its integral, and by which part a method may miss it
    let forces = [
        ("step = { amplitude = 3.0, at_s = 7.77e-5 }", 3.0 * (5e-4 - 7.77e-5), 1e-12),
        ("step = { amplitude = 3.0, at_s = 1e-4 }", 3.0 * 4e-4, 1e-12), // at the beginning of a step
        ("ramp = { amplitude = 3.0, from_s = 7.7e-5, to_s = 7.71e-5 }", 3.0 * (5e-4 - 7.705e-5), 1e-12),
        (
            "table = { times_s = [0.0, 1.003e-4, 1.0035e-4, 1.004e-4, 3e-3], values = [0.0, 0.0, 1e5, 0.0, 0.0] }",
            1e5 * 0.5e-7,
            1e-9, // times of this size have six digits left
        ),
        ("sine = { amplitude = 100.0, frequency_hz = 5000.0, until_s = 2.53e-4 }", cut(2.53e-4), 1e-4),
        ("half_sine = { amplitude = 3.0, duration_s = 5.01e-5, at_s = 3.3e-6 }", 3.0 * 5.01e-5 * half, 1e-3),
    ];
    for (waveform, impulse_ns, part) in forces {
        let toml = format!(
            "[chain]\nbeads = 8\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[[drive]]\nbead = 0\n\
             force_n = {{ {waveform} }}\n[time]\nduration_s = 5e-4\ndt_s = 1e-6\n"
        );
        for method in METHODS {
            let (physics, state) = end_of(&toml, method);
            let momentum: f64 = state.v_m_s.iter().map(|v| physics.bead_mass_kg * v).sum();
            assert!(
                (momentum / impulse_ns - 1.0).abs() < part,
                "{waveform}, {method}: {momentum:e}, {impulse_ns:e}"
            );
        }
    }
}

/// A wall that moves along straight lines has a velocity that jumps: its work is right to the order of the step all the same (off by
/// 7 % when steps did not end at kinks).
#[test]
fn the_work_of_walls_and_beads_closes_the_balance_where_velocities_jump() {
    let chain =
        "[chain]\nbeads = 8\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[ends]\nleft = \"fixed\"\n";
    let table = "{ table = { times_s = [0.0, 1e-4, 1.1e-4, 2e-3], values = [0.0, 0.0, 1e-5, 1e-5] } }";
    let (step, time) =
        ("{ step = { amplitude = 0.5, at_s = 3.333e-5 } }", "[time]\nduration_s = 1e-3\ndt_s = 3e-7\n");
    let places = [
        format!("wall = \"left\"\ndisplacement_m = {table}"),
        format!("wall = \"left\"\nvelocity_m_s = {step}"),
        format!("bead = 3\ndisplacement_m = {table}"),
        format!("bead = 3\nvelocity_m_s = {step}"),
        format!("bead = 3\nforce_n = {step}"),
    ];
    for place in places {
        for (method, bound) in [(Method::VelocityVerlet, 5e-4), (Method::Rkn4, 5e-6), (Method::Rk5, 5e-6)] {
            let (physics, state) = end_of(&format!("{chain}[[drive]]\n{place}\n{time}"), method);
            let energy = physics.chain().energy(&state.u_m, &state.v_m_s, &state.extra, &mut [0.0; 7]);
            let driven_j = physics.driven_j(&state.extra);
            let off = (energy.total_j() - driven_j).abs() / driven_j;
            println!("{place}, {method}: {off:.1e}");
            assert!(driven_j > 0.0 && off < bound, "{place}, {method}: {off:e} of {driven_j:e} J");
        }
    }
}
