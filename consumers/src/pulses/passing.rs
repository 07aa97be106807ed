//! Time that a pulse takes to pass a bead, which bounds the interval between frames.

use super::Obstacles;
use super::signed;
use crate::theory::{SolitaryWave, Strength};
use schemas::chain::Chain;
use schemas::manifest::Physics;

/// The shortest time (s) that a pulse of the velocity `v_m_s` takes to pass a bead, by its full width at half maximum:
/// that of the solitary wave or, on a load, of the fastest sound if that is shorter. None where there is neither.
pub(super) fn shortest_s(physics: &Physics, v_m_s: f64) -> Option<f64> {
    let chain = physics.chain();
    let solitary = || {
        let wave = SolitaryWave::coefficients_of(physics.alpha).ok()?;
        let strength = Strength::PeakVelocity { m_s: v_m_s };
        let scale = wave.scaled(physics.bead_mass_kg, physics.stiffness, strength).ok()?;
        let nominal_s = wave.velocity_fwhm_beads / scale.speed_beads_per_s;
        Some(nominal_s * fastest(physics, &chain))
    };
    let times_s = [solitary(), shortest_of_sound_s(&chain)];
    times_s.into_iter().flatten().reduce(|a, b| if b < a { b } else { a })
}

/// Time that a pulse takes for the bead that it passes fastest, over that for a bead of the nominal mass and stiffness: it
/// goes as (m/k)^(1/(α + 1)). Impurities, which pulses do not pass, do not count.
fn fastest(physics: &Physics, chain: &Chain) -> f64 {
    let obstacles = Obstacles::of(chain);
    let nominal = physics.bead_mass_kg / physics.stiffness;
    let free = (0..chain.contact_count()).filter(|bead| !obstacles.contains(signed(*bead as u64)));
    let ratios = free.map(|bead| chain.mass_kg[bead] / chain.stiffness[bead] / nominal);
    ratios
        .fold(1.0_f64, |least, ratio| if ratio < least { ratio } else { least })
        .powf(1.0 / (physics.alpha + 1.0))
}

/// A third of the shortest period of sound in a loaded chain, 2π/(2·√(K/m)) with K = α·k·δ^(α−1): a cosine is above half
/// of its maximum for that long.
fn shortest_of_sound_s(chain: &Chain) -> Option<f64> {
    let tangents = chain.tangents_n_per_m();
    let squares = tangents.iter().zip(chain.mass_kg.windows(2)).map(|(tangent, masses)| {
        let lighter = if masses[0] < masses[1] { masses[0] } else { masses[1] };
        tangent / lighter
    });
    let fastest = squares.fold(0.0_f64, |most, square| if square > most { square } else { most });
    (fastest > 0.0).then(|| std::f64::consts::FRAC_PI_3 / fastest.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::{MassRule, RunConfig};
    use schemas::presets::Preset;

    fn physics(name: &str, change: impl FnOnce(&mut RunConfig)) -> Physics {
        let mut config = Preset::find(name).unwrap().config();
        change(&mut config);
        Physics::resolve(&config).unwrap()
    }

    /// Beads of a thousandth of the mass are passed in 1000^(−2/5) of the time, a light impurity is not passed.
    #[test]
    fn the_lightest_beads_are_passed_fastest() {
        let equal = shortest_s(&physics("homogeneous", |_| {}), 1.0).unwrap();
        let impurity = shortest_s(&physics("light-impurity", |_| {}), 1.0).unwrap();
        assert_eq!(equal, impurity);
        let dimer = |config: &mut RunConfig| {
            config.chain.masses = MassRule::PatternKg(vec![1e-3, 1e-6]);
        };
        let light = shortest_s(&physics("homogeneous", dimer), 1.0).unwrap();
        assert!((light / equal - 1e-3_f64.powf(0.4)).abs() < 1e-12, "{light} {equal}");
    }

    /// 10 N on k = 1e7: δ = 1e-4 m, K = 1.5e5 N/m, π/3·√(1e-3/K), however weak the pulse is.
    #[test]
    fn on_a_load_sound_passes() {
        let loaded = physics("precompressed", |_| {});
        let exact = std::f64::consts::FRAC_PI_3 * (1e-3_f64 / 1.5e5).sqrt();
        assert!((shortest_s(&loaded, 1e-9).unwrap() / exact - 1.0).abs() < 1e-12);
    }
}
