//! Reflected energy over the mass of the impurity, for seven exponents.

use super::claim::StudyError;
use super::observe::Observations;
use super::runs::until_end;
use std::fmt::Write;

/// The exponents of the paper's figures.
pub(super) const ALPHAS: [f64; 7] = [1.01, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0];

/// Masses of the impurity (g), from 0.6 to 5 g, those of the reference among them.
pub(super) const MASSES_G: [f64; 19] =
    [0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0];

/// The mass of the other beads (g).
pub(super) const BEAD_G: f64 = 1.0;

/// One point of the figures: the energies when they are stationary, or a front is about to meet an end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflected {
    /// The exponent.
    pub alpha: f64,
    /// The mass of the impurity (g).
    pub mass_g: f64,
    /// Reflected over total energy, as the paper defines it.
    pub over_total: f64,
    /// Reflected over transmitted energy.
    pub over_transmitted: f64,
    /// What the reflected energy may yet change by, over the total energy.
    pub uncertainty: f64,
    /// Since when the reflected energy is stationary (s); NaN if it is not.
    pub stationary_since_s: f64,
    /// Energy that the struck end keeps, over the total energy.
    pub recoil: f64,
    /// What that may be off, over the total energy.
    pub recoil_uncertainty: f64,
    /// Reflected energy without the recoil, over the energy that arrives.
    pub corrected: f64,
    /// Velocity (m/s) of the strongest pulse back; NaN if there is none.
    pub backward_m_s: f64,
    /// Its speed (beads/s).
    pub backward_beads_per_s: f64,
    /// Largest relative error of the energy.
    pub drift: f64,
}

/// The sweep file of the points: 1000 beads, the impurity at bead 500, each until its energies are stationary.
pub fn reflection_sweep() -> String {
    let masses: Vec<String> = MASSES_G.iter().map(|mass_g| format!("{mass_g}e-3")).collect();
    let mut text = format!(
        "# The energy figures of the paper.\nuntil = \"stationary\"\n\n[base]\npreset = \"light-impurity\"\n\n[grid]\n\
         \"chain.impurities[0].mass_kg\" = [{}]\n",
        masses.join(", ")
    );
    for alpha in ALPHAS {
        let duration_s = until_end(alpha);
        // writing to a String cannot fail
        let _ =
            write!(text, "\n[[case]]\n\"chain.alpha\" = {alpha:?}\n\"time.duration_s\" = {duration_s:?}\n");
    }
    text
}

/// The point of an exponent and a mass (g).
pub(super) fn point(seen: &Observations, alpha: f64, mass_g: f64) -> Result<&Reflected, StudyError> {
    let same = |point: &&Reflected| point.alpha == alpha && (point.mass_g - mass_g).abs() < 1e-9;
    let missing = || StudyError::NotObserved { run: format!("α = {alpha}, impurity of {mass_g} g") };
    seen.reflected().iter().find(same).ok_or_else(missing)
}

/// A quantity over the mass (g) for one exponent.
pub(super) fn curve(
    seen: &Observations,
    alpha: f64,
    of: fn(&Reflected) -> f64,
) -> Result<Vec<(f64, f64)>, StudyError> {
    MASSES_G.iter().map(|mass_g| Ok((*mass_g, of(point(seen, alpha, *mass_g)?)))).collect()
}

/// The masses (g) at which two curves over the same masses cross, interpolated.
pub(super) fn crossings(a: &[(f64, f64)], b: &[(f64, f64)]) -> Vec<f64> {
    let difference: Vec<(f64, f64)> = a.iter().zip(b).map(|(a, b)| (a.0, a.1 - b.1)).collect();
    let crossing = |pair: &[(f64, f64)]| {
        let [(x0, d0), (x1, d1)] = [pair[0], pair[1]];
        (d0 * d1 < 0.0).then(|| x0 + (x1 - x0) * d0 / (d0 - d1))
    };
    difference.windows(2).filter_map(crossing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_are_between_points() {
        let rising = [(1.0, 0.0), (2.0, 1.0), (3.0, 2.0)];
        let falling = [(1.0, 1.5), (2.0, 0.5), (3.0, 0.0)];
        // differences −1.5, 0.5, 2: zero at 1.75
        assert_eq!(crossings(&rising, &falling), [1.75]);
        assert!(crossings(&rising, &rising).is_empty());
    }

    #[test]
    fn the_sweep_has_every_mass_of_the_reference() {
        for row in super::super::reference::REFLECTED.rows() {
            let value = |word: &str| word.parse::<f64>().unwrap();
            assert!(ALPHAS.contains(&value(row[0])) && MASSES_G.contains(&value(row[1])), "{row:?}");
        }
        let text = reflection_sweep();
        assert!(text.contains("\"chain.alpha\" = 1.01\n") && text.contains("[0.6e-3, 0.7e-3"), "{text}");
    }
}
