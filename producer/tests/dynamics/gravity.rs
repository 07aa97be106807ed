//! Weak pulses that run down a chain under its own weight.
//!
//! Contact i carries the weight of i + 1 beads, so that at the depth of z beads the overlap is `δ = (z·m·g/k)^(1/α)` and
//! sound crosses `c(z) = √(α·k·δ^(α−1)/m) ∝ z^((1−1/α)/2)` beads a second. The crest of a kick is the first maximum of
//! an Airy function: it is late by `0.5094·S^(1/3)` with `S = Σ 1/c³`, and its velocity falls as `c^(−1/2)`, which keeps the
//! flux of energy, times `S^(−1/3)`, by which dispersion stretches it. With `S ∝ z^(3/(2α) − 1/2)` that is the law
//! `z^(−(1/3 + 1/α)/4)` of Hong, Ji and Kim.
//!
//! # Source
//! R. S. Sinkovits and S. Sen, Phys. Rev. Lett. 74 (1995) 2686, doi:10.1103/PhysRevLett.74.2686 (`z^(1/6)` for spheres);
//! J. Hong, J.-Y. Ji and H. Kim, Phys. Rev. Lett. 82 (1999) 3058, doi:10.1103/PhysRevLett.82.3058.

use crate::chains::config;
use crate::sound::{Crest, crests};
use schemas::config::{End, StrikerConfig};
use schemas::manifest::Physics;
use std::ops::Range;

const GRAVITY_M_S2: f64 = 9.81;

/// A chain of 1 g beads that stands on its right end, weakly struck at `struck`.
struct Column {
    physics: Physics,
    /// The speed of sound (beads/s) at each contact.
    speeds: Vec<f64>,
    struck: usize,
}

impl Column {
    fn new(beads: u64, alpha: f64, struck: u64) -> Self {
        let mut config = config(beads, alpha);
        config.ends.right = End::Fixed;
        config.load.gravity_m_s2 = GRAVITY_M_S2;
        let (mass_kg, stiffness) = (config.chain.bead_mass_kg.unwrap(), config.chain.stiffness.unwrap());
        let rest_m = |depth: u64| (depth as f64 * mass_kg * GRAVITY_M_S2 / stiffness).powf(1.0 / alpha);
        let speed = |depth: u64| (alpha * stiffness * rest_m(depth).powf(alpha - 1.0) / mass_kg).sqrt();
        // overlaps change by 1e-5 of themselves
        let velocity_m_s = 1e-5 * speed(struck + 1) * rest_m(struck + 1);
        config.striker = StrikerConfig { bead: struck, velocity_m_s }.into();
        // 0.1 beads a step at the bottom; the crest is 10 beads wide
        config.time.dt_s = Some(0.1 / speed(beads));
        config.time.duration_s = (struck + 1..beads).map(|depth| 1.1 / speed(depth)).sum();
        let physics = Physics::resolve(&config).unwrap();
        let struck = usize::try_from(struck).unwrap();
        Self { physics, speeds: (1..beads).map(speed).collect(), struck }
    }

    /// The crest at every 20th bead of `beads`.
    fn crests(&self, beads: Range<usize>) -> Vec<Crest> {
        let beads: Vec<usize> = beads.step_by(20).collect();
        let crests = crests(&self.physics, self.physics.step_count, &beads);
        assert_eq!(crests.len(), beads.len(), "the front has come to the bottom");
        crests
    }

    /// `Σ 1/c^power` from the bead that is struck to bead `bead`.
    fn sum(&self, bead: usize, power: i32) -> f64 {
        self.speeds[self.struck..bead].iter().map(|speed| speed.powi(-power)).sum()
    }

    /// When the crest is expected at a bead (s).
    fn arrival_s(&self, bead: usize) -> f64 {
        self.sum(bead, 1) + 0.5094 * self.sum(bead, 3).cbrt()
    }
}

/// The exponent of the power law through points `(x, y)`.
fn exponent(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let logs: Vec<_> = points.map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logs.len() as f64;
    let x_mean = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let slope: f64 = logs.iter().map(|p| (p.0 - x_mean) * p.1).sum();
    slope / logs.iter().map(|p| (p.0 - x_mean).powi(2)).sum::<f64>()
}

/// `c ∝ z^((1−1/α)/2)`: `z^(1/6)` for spheres.
#[test]
fn the_front_of_a_weak_kick_runs_down_at_the_local_speed_of_sound() {
    for alpha in [1.5, 2.0, 3.0] {
        let column = Column::new(3000, alpha, 0);
        let crests = column.crests(500..2900);
        let times = |crest: &Crest| (crest.time_s, column.arrival_s(crest.bead));
        let (first, last) = (times(&crests[0]), times(&crests[crests.len() - 1]));
        let error = (last.0 - first.0) / (last.1 - first.1) - 1.0;
        // the next term of the lag changes by less than 0.02 beads on the way
        assert!(error.abs() < 1e-4, "α = {alpha}: arrival times are off by {error:e}");
        let speeds = crests.windows(2).map(|pair| {
            let depth = 0.5 * (pair[0].bead + pair[1].bead) as f64 + 1.0;
            (depth, 20.0 / (pair[1].time_s - pair[0].time_s))
        });
        let found = exponent(speeds);
        let expected = 0.5 * (1.0 - 1.0 / alpha);
        // the lag of the crest makes it gain speed: 0.34·S^(−2/3)·dS/dt, 1e-3 of it at this depth
        assert!((found - expected).abs() < 1.5e-3, "α = {alpha}: exponent {found}, not {expected}");
    }
}

/// Struck at the top, over depths of 100 to 2900 beads.
///
/// The power of z in `S` is its leading term: at α = 3 it is 0 and `S ∝ ln z`, so that the law is met only at depths
/// where ln z no longer changes. What is compared there is `c^(−1/2)·S^(−1/3)` itself.
///
/// A kick of the top itself differs from one within by a factor `S^(−μ/3)`, `μ = ½ − 1/(α+1)`: the wave equation with
/// `c² ∝ z^(1−1/α)` has modes `z^(1/(2α))·J_(−1/(α+1))`, which take up a frequency ω at z = 0 as `ω^μ`. Fully grown it
/// would add −0.017 and −0.014 to the exponents for α = 1.5 and 2; hence the tolerances.
#[test]
fn the_crest_falls_by_the_law_of_hong_ji_and_kim() {
    for alpha in [1.5, 2.0, 3.0] {
        let column = Column::new(3000, alpha, 0);
        let crests = column.crests(100..2900);
        let found = exponent(crests.iter().map(|crest| (crest.bead as f64 + 1.0, crest.velocity_m_s)));
        let law = -0.25 * (1.0 / 3.0 + 1.0 / alpha);
        let finite = exponent(crests.iter().map(|crest| {
            let falling = column.speeds[crest.bead].sqrt() * column.sum(crest.bead, 3).cbrt();
            (crest.bead as f64 + 1.0, 1.0 / falling)
        }));
        assert!((found - finite).abs() < 0.02, "α = {alpha}: exponent {found}, not {finite}");
        assert!(alpha > 2.0 || (found - law).abs() < 0.006, "α = {alpha}: exponent {found}, not {law}");
    }
}

/// A bead struck deep below the top sends a crest of `0.5357·v0/√(c·c_0)·S^(−1/3)` down, with the first maximum
/// 0.5357·n^(−1/3) of `J_2n` for equal contacts.
#[test]
fn a_crest_from_within_keeps_its_energy_and_widens() {
    for alpha in [1.5, 2.0, 3.0] {
        let column = Column::new(2000, alpha, 300);
        for crest in column.crests(500..1900).iter().step_by(10) {
            let speeds = column.speeds[crest.bead] * column.speeds[300];
            let expected = 0.5357 / speeds.sqrt() / column.sum(crest.bead, 3).cbrt();
            let found = crest.velocity_m_s / column.physics.striker.velocity_m_s;
            // 0.15·n^(−2/3) of it, the next term of the maximum of J_2n, and 0.01·n/300 as c changes within the crest
            let error = found / expected - 1.0;
            assert!(error.abs() < 3e-3, "α = {alpha}, bead {}: off by {error:e}", crest.bead);
        }
    }
}
