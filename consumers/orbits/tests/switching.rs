//! Branches that are born at changes of stability, against exact relations, searches from other seeds and runs.

mod common;

use common::{find, with_born};
use producer::integrator::Integrator;
use producer::state::ChainState;

/// Steps of a period of a drive, and periods in which the old orbit is left, by 0.3 % in each, and the new one is reached.
const STEPS: u64 = 100;
const PERIODS: u64 = 20_000;

/// Two beads on springs `k·u + a·u³`, with a bond c between them, that swing against each other by A·cn. A difference between both obeys Lamé's equation
/// with n = 2, of which cn·dn is the solution at 3·a·A² = 4·c: there modes are born that draw together at one bead, with the energy k·A² + a·A⁴/2 +
/// 2·c·A² (edges of Lamé's bands: F. M. Arscott, Periodic Differential Equations, Pergamon, 1964, chapter 9).
#[test]
fn two_beads_part_where_lame_says_to_modes_that_another_seed_finds() {
    let file = |seed: [f64; 2], energy: f64, rest: &str| {
        format!(
            "chain = {{ beads = 2, bead_mass_kg = 1.0, bonds = {{ linear = 0.3 }} }}\n\
             ends = {{ left = 'free', right = 'free' }}\n\
             on_site = {{ linear_n_per_m = 1.0, cubic_n_per_m3 = 1.0 }}\n\
             initial = {{ displacements_m = {seed:?} }}\n\
             orbit = {{ energy_j = {energy}, period_s = 4.5, steps = 400 }}\n{rest}"
        )
    };
    let along = "continue = { key = 'orbit.energy_j', from = 0.4, to = 2.0, branches = true }";
    let (branch, born) = with_born(&file([0.48, -0.48], 0.4, along));
    let threshold = branch.changes[0].orbit.unknown.parameter;
    // steps of fourth order: 400 of them leave 1e-8
    assert!((threshold - 0.72).abs() < 1e-7, "{threshold}");
    // the other side is the mirror image of this one
    let [orbits] = &born[..] else { panic!("{} branches", born.len()) };
    let last = orbits.last().expect("orbits");
    assert!(last.unknown.parameter == 2.0 && last.multipliers.unstable().next().is_none());
    let large = last.state.u_m[0].abs() > last.state.u_m[1].abs();
    let seed = if large { [1.4, -0.1] } else { [-0.1, 1.4] };
    let sign = if seed[usize::from(!large)] * last.state.u_m[usize::from(!large)] > 0.0 { 1.0 } else { -1.0 };
    let other = find(&file(seed.map(|u| sign * u), 2.0, ""));
    for (found, expected) in last.state.u_m.iter().zip(other.state.u_m.iter()) {
        assert!((found - expected).abs() < 1e-10, "{found} for {expected}");
    }
    assert!((last.period_s() / other.period_s() - 1.0).abs() < 1e-11);
}

/// Beyond a period doubling the motion that stays is that of the branch born there: two shaken beads with drag come to it from rest.
#[test]
fn a_run_beyond_a_period_doubling_comes_to_the_orbit_of_twice_the_period() {
    let (branch, born) = with_born(
        "chain = { beads = 2, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0 }\n\
         ends = { left = 'fixed', right = 'fixed' }\nload = { precompression_n = 1.0 }\n\
         on_site = { drag_n_s_per_m = 0.05 }\norbit = { steps = 100 }\n\
         drive = [{ wall = 'left', displacement_m = { sine = { amplitude = 0.155, frequency_hz = 0.385 } } }]\n\
         continue = { key = 'drive[0].displacement_m.sine.amplitude', from = 0.155, to = 0.175, branches = true }",
    );
    assert_eq!(branch.changes[0].name, "period doubling");
    assert!(branch.last.multipliers.unstable().next().is_some());
    let [orbits] = &born[..] else { panic!("{} branches", born.len()) };
    let last = orbits.last().expect("orbits");
    assert_eq!((last.unknown.parameter, last.physics.step_count), (0.175, 2 * STEPS));
    assert!(last.multipliers.unstable().next().is_none());
    let mut state = ChainState::initial(&last.physics);
    let mut integrator = Integrator::new(&last.physics);
    // an orbit begins at either of its two periods
    let mut off = [0.0; 2];
    for (half, off) in off.iter_mut().enumerate() {
        let until = STEPS * (PERIODS + half as u64);
        while state.step < until {
            integrator.advance(&mut state, until);
        }
        let found = state.u_m.iter().chain(state.v_m_s.iter());
        let expected = last.state.u_m.iter().chain(last.state.v_m_s.iter());
        *off = found.zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    }
    assert!(off[0].min(off[1]) < 1e-8 && off[0].max(off[1]) > 0.1, "{off:?}");
}
