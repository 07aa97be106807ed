//! Pulses in dimer and tapered chains.

use crate::chains::{config, final_state};
use crate::sound::crests;
use crate::table::Table;
use schemas::config::{MassRule, StiffnessRule};
use schemas::manifest::Physics;

/// A chain of Hertz contacts with beads of 1 g and of `ratio` g, struck at a bead of 1 g; steps of `fraction` of the
/// time in which a light bead moves.
fn dimer(beads: u64, ratio: f64, fraction: f64) -> Physics {
    let mut config = config(beads, 1.5);
    config.chain.masses = MassRule::PatternKg(vec![1e-3, ratio * 1e-3]);
    let mut physics = Physics::resolve(&config).unwrap();
    physics.dt_s = fraction * ratio.sqrt() * physics.scales().time_s;
    physics
}

/// Logarithm of how much weaker the pulse is after 20 pairs of beads; a light bead is 0.2 to 1 times the others.
fn attenuation(ratio: f64) -> f64 {
    let crests = crests(&dimer(90, ratio, 0.02), 50_000, &[40, 80]);
    (crests[0].velocity_m_s / crests[1].velocity_m_s).ln()
}

/// A 1:1 dimer chain has solitary waves that leave nothing behind at the mass ratios 0.3428, 0.1548, 0.0901, …, where the
/// light bead squeezed between two heavy ones oscillates a whole number of times, and loses most near 0.59 and 0.24.
///
/// # Source
/// K. R. Jayaprakash, Y. Starosvetsky and A. F. Vakakis, Phys. Rev. E 83 (2011) 036606, doi:10.1103/PhysRevE.83.036606;
/// K. R. Jayaprakash, A. F. Vakakis and Y. Starosvetsky, J. Nonlinear Sci. 23 (2013) 363, doi:10.1007/s00332-012-9155-3.
#[test]
fn a_dimer_chain_has_solitary_waves_at_the_published_mass_ratios() {
    for (ratio, aside) in [(0.3428, 0.01), (0.1548, 0.006), (0.0901, 0.004)] {
        let [below, at, above] = [ratio - aside, ratio, ratio + aside].map(attenuation);
        // the radiated wave is proportional to the distance from the ratio, its energy to the square
        let (left, right) = (below.sqrt(), above.sqrt());
        let found = ratio - aside + 2.0 * aside * left / (left + right);
        // the cubic term of the attenuation moves the estimate by a tenth of `aside`
        assert!((found - ratio).abs() < 0.1 * aside, "{ratio}: found {found}");
        assert!(at < 1e-5 && below > 1e-4 && above > 1e-4, "{ratio}: {below:e} {at:e} {above:e}");
    }
    for (ratio, aside, loss) in [(0.59, 0.09, 0.4), (0.24, 0.05, 0.05)] {
        let [below, at, above] = [ratio - aside, ratio, ratio + aside].map(attenuation);
        assert!(at > loss && at > below && at > above, "{ratio}: {below} {at} {above}");
    }
}

/// Very light beads between heavy ones hand on what pushes them: two contacts in series are one of stiffness `k/2^α`,
/// and the pulse is the solitary wave of equal beads, each with the mass of a pair.
#[test]
fn a_dimer_chain_with_very_light_beads_is_one_of_softer_contacts() {
    let table = Table::read("solitary-wave");
    let exact = table.rows().find(|row| row.number("alpha") == 1.5).unwrap().number("C_V_exact");
    for ratio in [0.03, 0.01, 0.003] {
        let crests = crests(&dimer(81, ratio, 0.02), 100_000, &[40, 60]);
        let speed = 10.0 / (crests[1].time_s - crests[0].time_s);
        let v_max = crests[1].velocity_m_s;
        let (mass_kg, stiffness) = (1e-3 * (1.0 + ratio), 1e7 / 2.0_f64.powf(1.5));
        let found = speed / ((stiffness / mass_kg).powf(0.4) * v_max.powf(0.2));
        // the inertia of a light bead delays its force by the order of its mass; 5e-6 is how stationary
        // the wave is after 20 pairs
        let error = (found / exact - 1.0).abs();
        assert!(error < 0.01 * ratio + 5e-6, "light beads of {ratio}: C_V is off by {error:e}");
    }
}

/// A gentle taper carries the solitary wave along and keeps its energy, which is `C_E·m·v_max²` whatever the stiffness is:
/// `v_max ∝ m^(−1/2)`. So does a chain of hard spheres to first order, `2/(1+q) = q^(−1/2) + O((1−q)²)`.
///
/// # Source
/// U. Harbola, A. Rosas, M. Esposito and K. Lindenberg, Phys. Rev. E 80 (2009) 031303, doi:10.1103/PhysRevE.80.031303.
#[test]
fn a_gentle_taper_conserves_the_energy_of_the_pulse() {
    for stiffnesses in [StiffnessRule::Uniform, StiffnessRule::Radii] {
        for ratio in [0.99, 0.98, 0.96, 1.01, 1.02] {
            let mut config = config(110, 1.5);
            config.chain.masses = MassRule::Taper(ratio);
            config.chain.stiffnesses = stiffnesses.clone();
            let physics = Physics::resolve(&config).unwrap();
            let crests = crests(&physics, 100_000, &[40, 90]);
            let exponent = (crests[1].velocity_m_s / crests[0].velocity_m_s).ln() / (50.0 * ratio.ln());
            // what a taper sends back is of second order in 1 − q for each bead, so of first order in the exponent
            assert!((exponent + 0.5).abs() < 0.25 * (1.0 - ratio).abs(), "{ratio}: exponent {exponent}");
        }
    }
}

/// Where contacts are very stiff, beads collide one by one: each hands `2/(1+q)` times its velocity on and keeps
/// `(1−q)/(1+q)` of it.
///
/// # Source
/// The hard-sphere approximation of R. L. Doney and S. Sen, Phys. Rev. E 72 (2005) 041304,
/// doi:10.1103/PhysRevE.72.041304.
#[test]
fn stiff_beads_of_a_strong_taper_collide_one_by_one() {
    for alpha in [30.0, 100.0] {
        for ratio in [0.8, 0.5] {
            let mut config = config(8, alpha);
            config.chain.masses = MassRule::Taper(ratio);
            config.time.duration_s = 12.0 * Physics::resolve(&config).unwrap().scales().time_s;
            let physics = Physics::resolve(&config).unwrap();
            let found = final_state(&physics).v_m_s;
            // the next contact is at δ/δ_max = ½ when its force is 2^−30 of the largest, and the beads behind part
            let mut arriving = physics.striker.velocity_m_s;
            let mut worst: f64 = 0.0;
            for (bead, v) in found.iter().enumerate() {
                let expected = if bead == 7 { arriving } else { arriving * (1.0 - ratio) / (1.0 + ratio) };
                worst = worst.max((v / expected - 1.0).abs());
                arriving *= 2.0 / (1.0 + ratio);
            }
            assert!(worst < 1e-10, "α = {alpha}, {ratio}: off by {worst:e}");
        }
    }
}
