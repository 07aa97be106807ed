//! How long two beads, or a bead and a wall, touch:
//! `2·δ_max/v·∫ds/√(1 − s^(α+1))` over 0…1, with `δ_max = ((α+1)·m*·v²/(2k))^(1/(α+1))` and the reduced mass m*.
//!
//! # Source
//! H. Hertz, J. reine angew. Math. 92 (1882) 156, doi:10.1515/crll.1882.92.156, for α = 3/2: `2.9433·δ_max/v`.

use crate::chains::config;
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{End, MassRule, OddContact, RunConfig, StiffnessRule, StrikerConfig};
use schemas::manifest::Physics;

/// The time of contact (s) of a collision at the relative speed `speed_m_s`.
fn contact_time_s(alpha: f64, stiffness: f64, reduced_kg: f64, speed_m_s: f64) -> f64 {
    let n = alpha + 1.0;
    let deepest_m = (0.5 * n * reduced_kg * speed_m_s * speed_m_s / stiffness).powf(1.0 / n);
    // s = 1 − x² takes the singularity away; Simpson's rule
    let integrand =
        |x: f64| if x == 0.0 { 2.0 / n.sqrt() } else { 2.0 * x / (1.0 - (1.0 - x * x).powf(n)).sqrt() };
    let intervals = 20_000_u32;
    let sum: f64 = (0..=intervals)
        .map(|i| {
            let weight = if i == 0 || i == intervals { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
            weight * integrand(f64::from(i) / f64::from(intervals))
        })
        .sum();
    2.0 * deepest_m / speed_m_s * sum / (3.0 * f64::from(intervals))
}

/// Two beads of exponent `alpha`, with steps of 1/2000 T.
fn pair(alpha: f64, change: impl FnOnce(&mut RunConfig)) -> Physics {
    let mut config = config(2, alpha);
    change(&mut config);
    let mut physics = Physics::resolve(&config).unwrap();
    physics.dt_s = 5e-4 * physics.scales().time_s * (5.0 / alpha).min(1.0);
    physics
}

/// When the overlap `overlap_m(u)` is 0 again (s), from the step after it and the velocity there.
fn end_of_contact_s(physics: &Physics, overlap: impl Fn(&[f64]) -> f64) -> f64 {
    let mut integrator = Integrator::new(physics);
    let mut state = ChainState::initial(physics);
    integrator.step(&mut state);
    assert!(overlap(&state.u_m) > 0.0, "closed after the first step");
    while overlap(&state.u_m) > 0.0 {
        integrator.step(&mut state);
    }
    physics.time_s(state.step) - overlap(&state.u_m) / overlap(&state.v_m_s)
}

#[test]
fn the_integral_of_hertz_is_2_9433() {
    assert!((contact_time_s(1.5, 1.25, 1.0, 1.0) - 2.943_275_8).abs() < 1e-6);
    // half a period of a harmonic oscillator
    assert!((contact_time_s(1.0, 4.0, 1.0, 1.0) - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
}

#[test]
fn two_beads_touch_as_long_as_hertz_says() {
    for alpha in [1.0, 1.3, 1.5, 2.0, 3.0, 10.0] {
        let physics = pair(alpha, |c| c.chain.contacts = vec![OddContact { contact: 0, stiffness: 3e6 }]);
        let expected = contact_time_s(alpha, 3e6, 0.5e-3, 5.0);
        let found = end_of_contact_s(&physics, |u| u[0] - u[1]);
        // the step that meets the end of a contact misplaces it by dt^(α+2): (5e-4)³ for α = 1
        assert!((found / expected - 1.0).abs() < 1e-10, "α = {alpha}: {found} s, not {expected} s");
    }
}

/// Radii 1 and 2: `k·√(2·1·2/3)` and the reduced mass 8/9 of 1 g. Radius 2 and a plane: `k·√4` and 8 g.
#[test]
fn spheres_of_different_radii_touch_each_other_and_walls_as_long_as_hertz_says() {
    let radii = |config: &mut RunConfig| {
        config.chain.masses = MassRule::PatternKg(vec![1e-3, 8e-3]);
        config.chain.stiffnesses = StiffnessRule::Radii;
    };
    let found = end_of_contact_s(&pair(1.5, radii), |u| u[0] - u[1]);
    let expected = contact_time_s(1.5, 1e7 * (4.0_f64 / 3.0).sqrt(), 8.0 / 9.0 * 1e-3, 5.0);
    assert!((found / expected - 1.0).abs() < 1e-10, "spheres: {found} s, not {expected} s");

    let at_wall = pair(1.5, |config| {
        radii(config);
        config.ends.right = End::Fixed;
        config.striker = StrikerConfig { bead: 1, velocity_m_s: 5.0 }.into();
    });
    let found = end_of_contact_s(&at_wall, |u| u[1]);
    let expected = contact_time_s(1.5, 2e7, 8e-3, 5.0);
    assert!((found / expected - 1.0).abs() < 1e-10, "a wall: {found} s, not {expected} s");
}
