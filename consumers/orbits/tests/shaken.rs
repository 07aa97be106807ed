//! States of shaken chains with losses against what runs of such chains come to by themselves.

mod common;

use common::find;
use orbits::multipliers::Multiplier;
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::manifest::Physics;

/// Most periods in which a run comes to the motion that stays.
const MOST_PERIODS: f64 = 1000.0;
const STEPS: u64 = 100;

const LOSSES: [(&str, &str); 5] = [
    ("drag", "on_site.drag_n_s_per_m = 8.0"),
    ("dashpots", "damping.viscous_n_s_per_m = 8.0"),
    ("restitution", "damping.restitution = 0.6"),
    ("viscoelastic spheres", "damping.kuwabara_kono_s = 8e-6"),
    (
        "a power of damping, and drag",
        "damping.power = { coefficient = 300.0, exponent = 0.7 }\non_site.drag_n_s_per_m = 4.0",
    ),
];

const DRIVES: [(&str, &str); 4] = [
    (
        "a wall",
        "wall = 'left', displacement_m = { sine = { amplitude = 2e-6, frequency_hz = 2000.0, phase_rad = 0.4 } }",
    ),
    ("a bead that is pushed", "bead = 1, force_n = { sine = { amplitude = 2.0, frequency_hz = 2000.0 } }"),
    (
        "a bead that is moved",
        "bead = 1, displacement_m = { sine = { amplitude = 2e-6, frequency_hz = 2000.0 } }",
    ),
    (
        "a velocity",
        "bead = 0, velocity_m_s = { sine = { amplitude = 0.02, frequency_hz = 2000.0, phase_rad = 1.5707963267948966 } }",
    ),
];

const CHAINS: [(&str, &str); 4] = [
    ("one power", "alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0"),
    (
        "two masses and powers",
        "masses = { pattern_kg = [1e-3, 3e-3] }, second = { alpha = 2.5, stiffness = 1e10 }, alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0",
    ),
    (
        "springs and resonators",
        "alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0 | on_site.linear_n_per_m = 1e5 | resonators = { mass_kg = 4e-4, stiffness_n_per_m = 3e5 }",
    ),
    ("bonds", "bonds = { linear = 1e5, cubic = 1e14 } | "),
];

#[test]
fn a_run_comes_to_the_orbit_that_is_found() {
    let (mut tried, mut largest) = (0, 0.0);
    for (chain_name, chain) in CHAINS {
        for (loss_name, loss) in LOSSES {
            for (drive_name, drive) in DRIVES {
                for beads in [2, 5] {
                    let what = format!("{chain_name}, {loss_name}, {drive_name}, {beads} beads");
                    // bonds and several powers have dashpots, or drag
                    let is_one_power = chain.starts_with("alpha");
                    if !is_one_power && !["drag", "dashpots"].contains(&loss_name) {
                        continue;
                    }
                    let mut parts = chain.split(" | ");
                    let arrays = parts.next().expect("a chain");
                    let toml = format!(
                        "chain = {{ beads = {beads}, bead_mass_kg = 1e-3, {arrays} }}\nends = {{ left = 'fixed', right = 'fixed' }}\n{}\n\
                         {loss}\ndrive = [{{ {drive} }}]\norbit = {{ steps = {STEPS} }}",
                        parts.collect::<Vec<_>>().join("\n")
                    );
                    let orbit = find(&toml);
                    // differences fade by the largest multiplier in each period; some hardly do, as those of a resonator between
                    // beads that are moved
                    let size = orbit.multipliers.largest().map_or(0.0, Multiplier::size);
                    let periods = (1e-10_f64.ln() / size.ln()).ceil();
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "up to a thousand, below"
                    )]
                    let whole = periods as u64;
                    if size >= 1.0 || periods > MOST_PERIODS {
                        continue;
                    }
                    let expected = settled(&orbit.physics, whole);
                    let numbers = |state: &ChainState| {
                        let resonators = if orbit.physics.resonators.is_some() { 2 * beads } else { 0 };
                        let extra = state.extra.iter().take(resonators);
                        state.u_m.iter().chain(state.v_m_s.iter()).chain(extra).copied().collect::<Vec<f64>>()
                    };
                    let (found, expected) = (numbers(&orbit.state), numbers(&expected));
                    let units = |place: usize| if (place / beads).is_multiple_of(2) { 2e-6 } else { 0.02 };
                    for (place, (found, expected)) in found.iter().zip(&expected).enumerate() {
                        let error = (found - expected).abs() / units(place);
                        largest = larger(largest, error);
                        assert!(error < 1e-8, "{what}, {place}: {found} for {expected}");
                    }
                    tried += 1;
                }
            }
        }
    }
    println!("{tried} chains, off by {largest:e} of the drive at most");
    assert!(tried > 80, "{tried}");
}

fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The state of a run from rest after so many periods of its drive, at the beginning of one.
fn settled(physics: &Physics, periods: u64) -> ChainState {
    let mut state = ChainState::initial(physics);
    let (mut integrator, last) = (Integrator::new(physics), periods * STEPS);
    while state.step < last {
        integrator.advance(&mut state, last);
    }
    state
}

#[test]
fn damping_without_a_derivative_is_refused_where_contacts_open() {
    for damping in ["viscous_n_s_per_m = 8.0", "restitution = 0.9", "kuwabara_kono_s = 1e-6"] {
        let toml = format!(
            "chain = {{ beads = 5, bead_mass_kg = 1e-3, alpha = 1.5, stiffness = 1e7 }}\nends = {{ left = 'fixed', right = 'fixed' }}\n\
             damping.{damping}\nload.precompression_n = 0.1\norbit = {{}}\n\
             drive = [{{ wall = 'left', displacement_m = {{ sine = {{ amplitude = 2e-4, frequency_hz = 2000.0 }} }} }}]"
        );
        let refused = common::tried(&toml).expect_err("a jump").to_string();
        assert!(refused.contains("its force jumps"), "{damping}: {refused}");
    }
}

/// A slow drive has a long period, whose steps are no longer than those of a run.
#[test]
fn steps_that_no_run_may_have_are_refused() {
    let toml = |steps: u64| {
        format!(
            "chain = {{ beads = 3, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0 }}\nends = {{ left = 'fixed', right = 'fixed' }}\n\
             load.precompression_n = 1.0\non_site.drag_n_s_per_m = 0.002\norbit = {{ steps = {steps} }}\n\
             drive = [{{ wall = 'left', displacement_m = {{ sine = {{ amplitude = 0.05, frequency_hz = 0.004 }} }} }}]"
        )
    };
    let refused = common::tried(&toml(400)).expect_err("long steps").to_string();
    assert!(refused.contains("orbit.steps: found 400, of 625.000 ms"), "{refused}");
    // drag shrinks volumes by exp(−T·Σγ/m) of 6 multipliers, all of the same size
    let size = common::find(&toml(6000)).multipliers.largest().map_or(0.0, Multiplier::size);
    assert!((size - (-250.0 * 0.002 / 2.0_f64).exp()).abs() < 1e-6, "{size}");
}
