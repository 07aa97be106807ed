//! Spreading of the energy of a chain, and the number of beads that share it.

use consumers::analysis::{Analysis, Beginning, Meaning, Needs, Offer, Outlet, Remake, Report};
use consumers::local_energy::bead_energies_j;
use consumers::series::Series;
use figure::{Axis, Figure, FigureError, Panel};
use schemas::amounts::{number, quantity};
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use serde::Serialize;
use serde_json::json;

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "spreading",
    about: "Spreading of the energy: second moment, and the number of beads that share it",
    help: "Examples:\n  \
        beadline spreading --figure s.png                    attach to the only live run\n  \
        beadline spreading run.mcap --out s.csv --figure s.svg\n  \
        beadline spreading sparse.mcap --every-step --from 0.04 --until 0.041 --out s.csv\n\n\
        The energy ε of bead i is its kinetic energy, half the potential energy of each contact with a bead, and all of that with a \
        wall. Second moment: m2 = Σ (i − c)²·ε/Σ ε about the centre c = Σ i·ε/Σ ε. Participation number: P = (Σ ε)²/Σ ε², 1 if one bead \
        has all the energy, N if all have the same. `beadline plot --what energy-density` maps ε.",
    columns: &COLUMNS,
    needs: Needs { last_frame_only: true, remake: Remake::OfFrame, ..Needs::FRAMES },
    begin: |beginning| Ok(Box::new(Spreading::new(beginning))),
    ..Offer::PLAIN
};

const COLUMNS: [Meaning; 4] = [
    Meaning::number("energy_j", "energy of all beads"),
    Meaning::number("centre_beads", "centre of the energy"),
    Meaning::number("second_moment_beads2", "second moment of the energy about its centre"),
    Meaning::number("participation_beads", "beads that share the energy"),
];

/// Energy along the chain in one frame, with `ε_i` the energy of bead `i` ([`bead_energies_j`]). NaN in a chain without energy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpreadingRow {
    /// `Σ ε_i` (J).
    pub energy_j: f64,
    /// The middle `ī = Σ i·ε_i/Σ ε_i` (beads).
    pub centre_beads: f64,
    /// The second moment `m2 = Σ (i − ī)²·ε_i/Σ ε_i` (beads²).
    pub second_moment_beads2: f64,
    /// The participation number `P = (Σ ε_i)²/Σ ε_i²` (beads): 1 if one bead has everything, N if all have the same.
    pub participation_beads: f64,
}

impl SpreadingRow {
    /// Makes one for beads with these energies (J). Sums are in the order of the beads.
    ///
    /// ```
    /// use analyses::spreading::SpreadingRow;
    /// let row = SpreadingRow::of(&[1.0, 0.0, 1.0]);
    /// assert_eq!((row.centre_beads, row.second_moment_beads2, row.participation_beads), (1.0, 1.0, 2.0));
    /// ```
    pub fn of(energies_j: &[f64]) -> Self {
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            (0_u32..).zip(energies_j).fold(0.0, |sum, (bead, energy)| sum + of(bead.into(), *energy))
        };
        let energy_j = sum(&|_, energy| energy);
        let centre_beads = sum(&|bead, energy| bead * energy) / energy_j;
        let second = sum(&|bead, energy| (bead - centre_beads) * (bead - centre_beads) * energy);
        Self {
            energy_j,
            centre_beads,
            second_moment_beads2: second / energy_j,
            participation_beads: energy_j * energy_j / sum(&|_, energy| energy * energy),
        }
    }

    /// The values in the order of the columns.
    pub fn values(&self) -> [f64; 4] {
        [self.energy_j, self.centre_beads, self.second_moment_beads2, self.participation_beads]
    }
}

struct Spreading {
    manifest: RunManifest,
    chain: Chain,
    last: Option<SpreadingRow>,
    /// Kept for a figure alone.
    curves: Option<Series<4>>,
}

impl Spreading {
    fn new(beginning: &Beginning<'_>) -> Self {
        let manifest = beginning.manifest.clone();
        let curves = beginning.is_drawn.then(Series::default);
        Self { chain: manifest.physics.chain(), manifest, last: None, curves }
    }
}

impl Analysis for Spreading {
    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let row = SpreadingRow::of(&bead_energies_j(&self.chain, frame));
        if let Some(curves) = &mut self.curves {
            curves.push(frame.time_s, row.values());
        }
        out.row(frame, &row.values());
        self.last = Some(row);
    }

    fn report(&mut self) -> Option<Report> {
        let mut report = Report { title: "spreading", results: json!(self.last), ..Report::default() };
        let Some(row) = self.last else { return Some(report) };
        let words = &mut report.words;
        if row.participation_beads.is_nan() {
            words.add("energy", "none: nothing can spread");
            return Some(report);
        }
        words.add("energy", quantity(row.energy_j, "J"));
        words.add("centre", format_args!("bead {}", number(row.centre_beads)));
        let (moment, width) = (row.second_moment_beads2, row.second_moment_beads2.sqrt());
        words.add("second moment", format_args!("{} beads² (width {} beads)", number(moment), number(width)));
        words.add("participation", format_args!("{} beads", number(row.participation_beads)));
        Some(report)
    }

    /// The second moment and the participation number over time, both logarithmic: a power law is a straight line.
    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let curves = self.curves.take().unwrap_or_default();
        let panel = |label: &str, column: usize| {
            let curve = curves.curve(column).map(|(t, value)| (t * 1e3, value));
            // time 0 has no logarithm, nor has the moment of a single bead
            let curve: Vec<_> = curve.filter(|(t, value)| *t > 0.0 && *value > 0.0).collect();
            Panel::new().x_axis(Axis::new("time (ms)").log()).y_axis(Axis::new(label).log()).line("", curve)
        };
        Ok(Some(
            Figure::new()
                .shared_x()
                .caption(plots::caption(&self.manifest))
                .panel(panel("second moment m_{2} (beads^{2})", 2))
                .panel(panel("participation number P (beads)", 3)),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_and_an_even_chain_have_their_numbers() {
        let one = SpreadingRow::of(&[0.0, 0.0, 3.0, 0.0]);
        assert_eq!(one.values(), [3.0, 2.0, 0.0, 1.0]);
        // N beads of one energy: (N² − 1)/12 and N
        let even = SpreadingRow::of(&[0.5; 11]);
        assert_eq!(even.values(), [5.5, 5.0, 10.0, 11.0]);
        assert!(SpreadingRow::of(&[0.0; 3]).participation_beads.is_nan());
    }
}
