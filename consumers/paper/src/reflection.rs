//! Reflected energy over the mass of the impurity, for seven exponents.

use super::crossing::{Difference, wanting};
use super::judgement::StudyError;
use super::runs::until_end;
use consumers::table::{Cell, Column};
use consumers::uncertain::Uncertain;
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
    pub over_total: Uncertain,
    /// Reflected over transmitted energy.
    pub over_transmitted: Uncertain,
    /// Time (s) from which on the reflected energy is stationary; NaN if it is not.
    pub stationary_since_s: f64,
    /// Reflected energy without the energy that the struck end keeps, over the total energy.
    pub corrected_over_total: Uncertain,
    /// The same over the energy that arrives.
    pub corrected: Uncertain,
    /// Velocity (m/s) of the strongest pulse back; NaN if there is none.
    pub backward_m_s: f64,
    /// Its speed (beads/s).
    pub backward_beads_per_s: f64,
    /// Largest relative error of the energy.
    pub drift: f64,
}

/// A row with the names of its cells.
struct Row<'a> {
    columns: &'a [Column],
    cells: &'a [Cell],
}

impl Reflected {
    /// The point of a row of [`reflection_sweep`] or [`refined_sweep`].
    ///
    /// # Errors
    /// When the row has not the columns of a sweep.
    pub fn of_row(columns: &[Column], cells: &[Cell]) -> Result<Self, StudyError> {
        let row = Row { columns, cells };
        Ok(Self {
            alpha: row.double("chain.alpha")?,
            mass_g: row.double("chain.impurities[0].mass_kg")? * 1e3,
            over_total: row.uncertain("reflected_over_total")?,
            over_transmitted: row.uncertain("reflected_over_transmitted")?,
            stationary_since_s: row.double("stationary_since_s")?,
            corrected_over_total: row.uncertain("corrected_over_total")?,
            corrected: row.uncertain("corrected_over_incident")?,
            backward_m_s: row.double("backward_v_peak_m_s")?,
            backward_beads_per_s: row.double("backward_speed_beads_per_s")?,
            drift: row.double("max_abs_relative_drift")?,
        })
    }
}

impl Row<'_> {
    /// A double with its uncertainty.
    fn uncertain(&self, name: &str) -> Result<Uncertain, StudyError> {
        Ok(Uncertain::new(self.double(name)?, self.double(&format!("{name}_uncertainty"))?))
    }

    /// A double; NaN where there is none in this row.
    fn double(&self, name: &str) -> Result<f64, StudyError> {
        let place = self.columns.iter().position(|column| column.name == name);
        match place.and_then(|place| self.cells.get(place)) {
            Some(Cell::Double(value)) => Ok(*value),
            Some(Cell::Empty) => Ok(f64::NAN),
            _ => Err(StudyError::NoColumn { name: name.to_owned() }),
        }
    }
}

/// The sweep file of the points of the figures: 1000 beads, the impurity at bead 500, each until its energies are stationary.
pub fn reflection_sweep() -> String {
    sweep("# The energy figures of the paper.\nuntil = \"stationary\"\n", "", &MASSES_G)
}

/// The sweep file of the masses (g) to add, until the shock comes to the end of the chain: what may still cross the
/// impurity is least then. None if nothing in `points` asks for more.
///
/// Asked for are masses between which neighbouring curves may cross unseen, with the recoil or without.
pub fn refined_sweep(points: &[Reflected]) -> Option<String> {
    let mut masses_g = Vec::new();
    for of in [over_total, corrected_over_total] {
        for pair in ALPHAS.windows(2) {
            masses_g.extend(wanting(&differences(points, pair, of)));
        }
    }
    masses_g.sort_by(f64::total_cmp);
    masses_g.dedup();
    // energies alone are asked for, and these change little in ten steps
    let stream = "stream.publish_every_steps = 10\n";
    (!masses_g.is_empty()).then(|| sweep("# Where curves may cross unseen.\n", stream, &masses_g))
}

fn sweep(head: &str, stream: &str, masses_g: &[f64]) -> String {
    let masses: Vec<String> = masses_g.iter().map(|mass_g| format!("{mass_g}e-3")).collect();
    let mut text = format!(
        "{head}\n[base]\npreset = \"light-impurity\"\n{stream}\n[grid]\n\"chain.impurities[0].mass_kg\" = [{}]\n",
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

/// True if a mass (g) belongs to the figures, and was not added.
pub(super) fn is_shown(mass_g: f64) -> bool {
    MASSES_G.iter().any(|shown| (shown - mass_g).abs() < 1e-9)
}

/// Reflected over total energy.
pub(super) fn over_total(point: &Reflected) -> Uncertain {
    point.over_total
}

/// The same without the recoil.
pub(super) fn corrected_over_total(point: &Reflected) -> Uncertain {
    point.corrected_over_total
}

/// The points of an exponent, in the order of their masses.
pub(super) fn points_of(points: &[Reflected], alpha: f64) -> Vec<&Reflected> {
    let mut points: Vec<&Reflected> = points.iter().filter(|point| point.alpha == alpha).collect();
    points.sort_by(|a, b| a.mass_g.total_cmp(&b.mass_g));
    points
}

/// The curve of the first of two exponents minus that of the second.
pub(super) fn differences(
    points: &[Reflected],
    alphas: &[f64],
    of: fn(&Reflected) -> Uncertain,
) -> Vec<Difference> {
    let pairs = points_of(points, alphas[0]).into_iter().zip(points_of(points, alphas[1]));
    let difference = |(low, high): (&Reflected, &Reflected)| {
        let (a, b) = (of(low), of(high));
        Difference { mass_g: low.mass_g, value: a.value - b.value, off: a.plus_minus + b.plus_minus }
    };
    pairs.map(difference).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(alpha: f64, mass_g: f64, corrected: f64) -> Reflected {
        let known = |value| Uncertain::new(value, 1e-8);
        Reflected {
            alpha,
            mass_g,
            over_total: known(corrected + 0.1 / alpha),
            over_transmitted: known(corrected),
            stationary_since_s: 0.0,
            corrected_over_total: known(corrected),
            corrected: known(corrected),
            backward_m_s: 0.0,
            backward_beads_per_s: 0.0,
            drift: 0.0,
        }
    }

    /// `c·(m − 1)²` with c growing with α: curves touch at 1 g and cross nowhere, but that is seen only from closer by.
    #[test]
    fn masses_are_added_where_curves_meet_and_then_no_more() {
        let value = |alpha: f64, mass_g: f64| alpha * (mass_g - BEAD_G).powi(2);
        let add = |points: &mut Vec<Reflected>, masses_g: &[f64]| {
            for alpha in ALPHAS {
                points.extend(masses_g.iter().map(|mass_g| point(alpha, *mass_g, value(alpha, *mass_g))));
            }
        };
        let mut points = Vec::new();
        add(&mut points, &MASSES_G);
        for masses_g in [[0.95, 1.05], [0.975, 1.025], [0.9875, 1.0125]] {
            let text = refined_sweep(&points).unwrap();
            let listed = masses_g.map(|mass_g| format!("{mass_g}e-3")).join(", ");
            assert!(text.contains(&format!("mass_kg\" = [{listed}]\n")) && !text.contains("until"), "{text}");
            add(&mut points, &masses_g);
        }
        assert_eq!(refined_sweep(&points), None);
        assert_eq!(differences(&points, &ALPHAS[2..], corrected_over_total).len(), MASSES_G.len() + 6);
    }

    #[test]
    fn the_sweep_has_every_mass_of_the_reference() {
        for row in super::super::reference::REFLECTED.numbers().unwrap() {
            assert!(ALPHAS.contains(&row[0]) && MASSES_G.contains(&row[1]), "{row:?}");
        }
        let text = reflection_sweep();
        assert!(text.contains("\"chain.alpha\" = 1.01\n") && text.contains("[0.6e-3, 0.7e-3"), "{text}");
    }
}
