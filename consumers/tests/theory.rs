//! The waves of theory against the reference numbers and against the equation they solve.

#![allow(clippy::unwrap_used, reason = "a test that cannot read its own files has failed")]

use consumers::theory::{ContinuumWave, GaussianLimit, SolitaryWave, Strength, WaveError};
use std::path::Path;

/// Rows of `tests/reference/solitary-wave.csv`: seven numbers each, in the order asserted below.
fn reference() -> Vec<[f64; 7]> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/reference/solitary-wave.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let expected = "alpha,C_V_exact,C_V_continuum,fwhm_overlap_beads,fwhm_velocity_beads,fwhm_continuum_beads,\
                    kinetic_fraction";
    assert_eq!(lines.next(), Some(expected));
    let row = |line: &str| -> Vec<f64> { line.split(',').map(|cell| cell.parse().unwrap()).collect() };
    lines.map(|line| row(line).try_into().unwrap()).collect()
}

/// The reference has ten digits and is good to 1e-9.
#[test]
fn waves_are_those_of_the_reference() {
    let rows = reference();
    assert_eq!(rows.len(), 8);
    for [alpha, speed, continuum_speed, overlap_fwhm, velocity_fwhm, continuum_fwhm, kinetic_fraction] in rows
    {
        let exact = SolitaryWave::new(alpha).unwrap().coefficients();
        let continuum = ContinuumWave::new(alpha).unwrap().coefficients();
        let near = |ours: f64, theirs: f64, what| {
            assert!((ours - theirs).abs() < 1e-9, "{what} of α = {alpha}: {ours}, expected {theirs}");
        };
        near(exact.speed, speed, "C_V");
        near(continuum.speed, continuum_speed, "C_V of the continuum");
        near(exact.overlap_fwhm_beads, overlap_fwhm, "width of the overlap");
        near(exact.velocity_fwhm_beads, velocity_fwhm, "width of the velocity");
        near(continuum.overlap_fwhm_beads, continuum_fwhm, "width of the continuum");
        near(exact.kinetic_fraction, kinetic_fraction, "kinetic fraction");
    }
}

/// `∫ weight(η)·wave^α(ξ + η) dη` over |η| ≤ reach, by Simpson's rule on either side of η = 0.
fn integral(reach: f64, weight: impl Fn(f64) -> f64, integrand: impl Fn(f64) -> f64) -> f64 {
    let cells = 2000_u32;
    let spacing = reach / f64::from(cells);
    let term = |j: u32| {
        let simpson = if j == 0 || j == cells { 1.0 } else { f64::from(2 + 2 * (j % 2)) };
        let eta = f64::from(j) * spacing;
        simpson * weight(eta) * (integrand(eta) + integrand(-eta))
    };
    spacing / 3.0 * (0..=cells).map(term).sum::<f64>()
}

/// With k, m and `v_max` of 1: `V·v = ∫δ^α` over a bead, `V²·δ = ∫(1 − |η|)·δ^α`, at places that are not on the
/// grid and with another quadrature than the one that found the wave.
#[test]
fn waves_solve_the_travelling_wave_equation() {
    for alpha in [1.004, 1.2, 1.5, 2.7, 10.0, 30.0] {
        let wave = SolitaryWave::new(alpha).unwrap();
        let scale = wave.coefficients().scaled(1.0, 1.0, Strength::PeakVelocity { m_s: 1.0 }).unwrap();
        let speed = scale.speed_beads_per_s;
        for xi in [0.0, 0.123, 0.5, 0.777, 1.9, -0.3] {
            let force = |eta: f64| (scale.overlap_m * wave.overlap(xi + eta)).powf(alpha);
            let overlap = integral(1.0, |eta| 1.0 - eta, force) / (speed * speed * scale.overlap_m);
            let velocity = integral(0.5, |_| 1.0, force) / speed;
            // Simpson: h⁴·F⁗/180 with h = 1/2000 and F⁗ of some α⁴
            let tolerance = 1e-12 + 1e-15 * alpha.powi(4);
            assert!((overlap - wave.overlap(xi)).abs() < tolerance, "δ({xi}) for α = {alpha}");
            assert!((velocity - wave.velocity(xi)).abs() < tolerance, "v({xi}) for α = {alpha}");
        }
    }
}

/// Virial relation: twice the kinetic energy is `∫F·δ`, and the stored energy is `∫F·δ/(α+1)`. It holds for the
/// fixed point only.
#[test]
fn kinetic_fraction_is_that_of_the_virial_relation() {
    for alpha in [1.000_01, 1.001, 1.004, 1.05, 1.3, 1.5, 2.0, 4.0, 20.0, 150.0, 1000.0] {
        let fraction = SolitaryWave::new(alpha).unwrap().coefficients().kinetic_fraction;
        assert!((fraction - (alpha + 1.0) / (alpha + 3.0)).abs() < 1e-13, "α = {alpha}");
    }
}

/// What a bead is moved by in passing is the sum of the overlaps: `∫v = V·∫δ`.
#[test]
fn momentum_is_that_of_the_overlaps() {
    for alpha in [1.1, 1.5, 3.0] {
        let wave = SolitaryWave::new(alpha).unwrap();
        let c = wave.coefficients();
        let overlaps = integral(wave.half_length_beads(), |_| 1.0, |xi| wave.overlap(xi));
        assert!((c.momentum / (c.speed * c.overlap * overlaps) - 1.0).abs() < 1e-11, "α = {alpha}");
    }
}

/// `C_V` differs from the continuum's in second order of ε = α − 1 and the widths in first, in the reference by less
/// than ε²/12 and ε/5; so do energies, and the shape from the Gaussian.
#[test]
fn near_one_all_theories_agree() {
    for epsilon in [1e-3, 1e-2, 1e-1] {
        let alpha = 1.0 + epsilon;
        let wave = SolitaryWave::new(alpha).unwrap();
        let (exact, continuum) = (wave.coefficients(), ContinuumWave::new(alpha).unwrap().coefficients());
        let limit = GaussianLimit::new(alpha).unwrap();
        assert!((exact.speed / continuum.speed - 1.0).abs() < epsilon * epsilon / 12.0);
        assert!((exact.overlap_fwhm_beads / continuum.overlap_fwhm_beads - 1.0).abs() < epsilon / 5.0);
        assert!((exact.energy / continuum.energy - 1.0).abs() < epsilon);
        for xi in [0.5, 1.0, 2.0].map(|z| z * limit.sigma_beads) {
            assert!((wave.overlap(xi) - limit.overlap(xi)).abs() < epsilon);
        }
    }
}

/// For α → ∞ beads hit each other one after the other like billiard balls: one of them moves at a time, and the
/// overlap is a triangle. Corrections are of order (ln α)/α.
#[test]
fn hard_beads_hand_the_velocity_on() {
    let wave = SolitaryWave::new(1000.0).unwrap();
    let c = wave.coefficients();
    for (coefficient, limit) in
        [(c.speed, 1.0), (c.momentum, 1.0), (c.energy, 0.5), (c.overlap_fwhm_beads, 1.0)]
    {
        assert!((coefficient - limit).abs() < 0.02, "{c:?}");
    }
    for xi in [0.1, 0.5, 0.9] {
        assert!((wave.overlap(xi) - (1.0 - xi)).abs() < 0.01, "{xi}");
    }
    assert!(wave.velocity(0.45) > 1.0 - 1e-9 && wave.velocity(0.55) < 1e-9);
}

/// For Hertz's law at twice the velocity: V by 2^(1/5), overlap by 2^(4/5), energy by 4; at half the mass and
/// sixteen times the stiffness: V by 32^(2/5) = 4, overlap by 32^(−2/5) = 1/4.
#[test]
fn waves_scale_with_mass_stiffness_and_velocity() {
    let coefficients = SolitaryWave::new(1.5).unwrap().coefficients();
    let of = |m, k, m_s| coefficients.scaled(m, k, Strength::PeakVelocity { m_s }).unwrap();
    let (wave, faster, harder) = (of(1e-3, 1e7, 3.0), of(1e-3, 1e7, 6.0), of(0.5e-3, 16e7, 3.0));
    let near = |ratio: f64, expected: f64| assert!((ratio / expected - 1.0).abs() < 1e-14, "{ratio}");
    near(faster.speed_beads_per_s / wave.speed_beads_per_s, 2.0_f64.powf(0.2));
    near(faster.overlap_m / wave.overlap_m, 2.0_f64.powf(0.8));
    near(faster.energy_j / wave.energy_j, 4.0);
    near(harder.speed_beads_per_s / wave.speed_beads_per_s, 4.0);
    near(harder.overlap_m / wave.overlap_m, 0.25);
    near(harder.momentum_kg_m_s / wave.momentum_kg_m_s, 0.5);
}

#[test]
fn exponents_out_of_reach_are_refused() {
    for alpha in [0.5, 1.0, 1.000_001, 1001.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(SolitaryWave::new(alpha), Err(WaveError::Exponent { .. })), "{alpha}");
    }
    let message = SolitaryWave::new(1.0).unwrap_err().to_string();
    assert_eq!(message, "no wave for α = 1: expected α from 1.00001 to 1000");
}
