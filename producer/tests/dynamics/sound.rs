//! Weak disturbances of a uniformly pressed chain: the lattice of masses m and springs `K = α·k·δ_rest^(α−1)`, whose
//! motion is known exactly.

use crate::chains::{config, state_after};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{End, RunConfig};
use schemas::manifest::Physics;
use std::f64::consts::PI;

/// The rest overlap (m) of the chains below.
const REST_M: f64 = 2e-4;

/// A pressed chain of exponent `alpha`, in which sound crosses `speed` beads a second, and that speed.
fn pressed(beads: u64, alpha: f64) -> (RunConfig, f64) {
    let mut config = config(beads, alpha);
    let [mass_kg, _, stiffness] = config.chain.scales().expect("scales");
    config.load.precompression_n = stiffness * REST_M.powf(alpha);
    let speed = (alpha * stiffness * REST_M.powf(alpha - 1.0) / mass_kg).sqrt();
    config.striker.velocity_m_s = 0.0;
    (config, speed)
}

/// Every mode of a chain of 9 beads, with walls or free ends, has the frequency `ω = 2·c·sin(q/2)` with
/// `c = √(α·k·δ_rest^(α−1)/m)`, to 1e-9.
#[test]
fn every_mode_of_a_pressed_chain_has_its_frequency() {
    for alpha in [1.0, 1.1, 1.5, 2.0, 3.0, 10.0] {
        for walled in [true, false] {
            let beads = 9_u32;
            let (mut config, speed) = pressed(u64::from(beads), alpha);
            if walled {
                (config.ends.left, config.ends.right) = (End::Fixed, End::Fixed);
            }
            let modes = if walled { 1..=beads } else { 1..=beads - 1 };
            for mode in modes {
                let n = f64::from(beads);
                let q = PI * f64::from(mode) / if walled { n + 1.0 } else { n };
                let shape = |bead: u32| {
                    let bead = f64::from(bead);
                    if walled { (q * (bead + 1.0)).sin() } else { (q * (bead + 0.5)).cos() }
                };
                let omega = 2.0 * speed * (0.5 * q).sin();
                // 20 periods in steps of 0.02 beads; the highest mode advances by 0.04 rad in each
                config.time.dt_s = Some(0.02 / speed);
                config.time.duration_s = 20.0 * 2.0 * PI / omega;
                let physics = Physics::resolve(&config).unwrap();
                let mut start = ChainState::initial(&physics);
                // overlaps of up to 1e-6 δ_rest: what is not linear is of second order in it
                let v_max = 1e-6 * REST_M * speed;
                for bead in 0..beads {
                    start.v_m_s[bead as usize] = v_max * shape(bead);
                }
                let state = state_after(&physics, start);
                let project = |values: &[f64]| (0..beads).map(|i| values[i as usize] * shape(i)).sum::<f64>();
                let phase = (omega * project(&state.u_m)).atan2(project(&state.v_m_s));
                let expected = omega * physics.time_s(physics.step_count);
                let error = (phase - expected + PI).rem_euclid(2.0 * PI) - PI;
                let error = error.abs() / expected;
                assert!(error < 1e-9, "α = {alpha}, walled {walled}, mode {mode}: {error:e}");
            }
        }
    }
}

/// The Bessel function `J_order(x)`; the trapezoidal rule converges faster than any power of its step here.
fn bessel(order: u32, x: f64) -> f64 {
    let points = 400;
    let angle = |i: i32| PI * (f64::from(i) + 0.5) / f64::from(points);
    let integrand = |t: f64| (f64::from(order) * t - x * t.sin()).cos();
    (0..points).map(|i| integrand(angle(i))).sum::<f64>() / f64::from(points)
}

/// Bead n of a chain whose free end is struck moves with `v0·(J_2n(2ct) + J_(2n+2)(2ct))`: E. Schrödinger, Ann. Phys.
/// 349 (1914) 916, doi:10.1002/andp.19143491405, with the mirror image behind the free end.
#[test]
fn a_weak_pulse_in_a_pressed_chain_is_that_of_schroedinger() {
    for alpha in [1.1, 1.5, 3.0] {
        let (mut config, speed) = pressed(120, alpha);
        let v0 = 1e-6 * REST_M * speed;
        config.striker.velocity_m_s = v0;
        // the front is at bead 90: nothing has met the other end
        config.time.duration_s = 90.0 / speed;
        config.time.dt_s = None;
        let physics = Physics::resolve(&config).unwrap();
        let state = state_after(&physics, ChainState::initial(&physics));
        let argument = 2.0 * speed * physics.time_s(physics.step_count);
        let mut largest: f64 = 0.0;
        for (bead, v) in (0..118_u32).zip(state.v_m_s.iter()) {
            let expected = bessel(2 * bead, argument) + bessel(2 * bead + 2, argument);
            largest = largest.max((v / v0 - expected).abs());
        }
        // overlaps of 1e-6 δ_rest change the speed of sound by about as much
        assert!(largest < 2e-6, "α = {alpha}: {largest:e}");
    }
}

/// The front of a weak kick crosses the chain at the speed of sound: its crest passes bead n at
/// `c·t = n + 0.5094·n^(1/3)`, the first maximum of `J_2n`.
#[test]
fn the_front_of_a_weak_kick_has_the_speed_of_sound() {
    for alpha in [1.1, 1.5, 2.0, 3.0] {
        let (mut config, speed) = pressed(420, alpha);
        config.striker.velocity_m_s = 1e-4 * REST_M * speed;
        config.time.duration_s = 420.0 / speed;
        let mut physics = Physics::resolve(&config).unwrap();
        physics.dt_s = 0.1 / speed;
        let crests = crests(&physics, 10_000, &[100, 400]);
        let between = (400.0 - 100.0) + 0.5094 * (400.0_f64.cbrt() - 100.0_f64.cbrt());
        let found = between / (crests[1].time_s - crests[0].time_s);
        // the next term of the expansion of the maximum changes by 0.02 beads from bead 100 to bead 400
        assert!((found / speed - 1.0).abs() < 1e-4, "α = {alpha}: {found} beads/s, not {speed}");
    }
}

/// When a bead moved fastest for the first time, and how fast.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crest {
    pub(crate) bead: usize,
    pub(crate) time_s: f64,
    pub(crate) velocity_m_s: f64,
}

/// The first maximum of the velocity of each of `beads`, which the front meets in this order; fewer if it
/// does not get so far in `steps` steps.
pub(crate) fn crests(physics: &Physics, steps: u64, beads: &[usize]) -> Vec<Crest> {
    let threshold = 1e-3 * physics.striker.velocity_m_s;
    let mut integrator = Integrator::new(physics);
    let mut state = ChainState::initial(physics);
    let mut before = vec![[0.0; 2]; beads.len()];
    let mut crests = Vec::new();
    while crests.len() < beads.len() && state.step < steps {
        integrator.step(&mut state);
        for (bead, before) in beads.iter().zip(&mut before).skip(crests.len()) {
            let (velocity, [older, newer]) = (state.v_m_s[*bead], *before);
            if newer > threshold && velocity < newer && older <= newer {
                // the parabola through three velocities
                let (slope, curvature) = (0.5 * (velocity - older), older - 2.0 * newer + velocity);
                let velocity_m_s = newer - 0.5 * slope * slope / curvature;
                let time_s = physics.dt_s * (state.step as f64 - 1.0 - slope / curvature);
                crests.push(Crest { bead: *bead, time_s, velocity_m_s });
            }
            *before = [newer, velocity];
        }
    }
    crests
}
