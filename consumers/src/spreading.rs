//! How far the energy of a chain has spread, and over how many beads.

use crate::local_energy::bead_energies_j;
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use serde::Serialize;

/// How the energy lies in one frame, with `ε_i` the energy of bead `i` ([`bead_energies_j`]). NaN in a chain without energy.
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
    /// Names of the columns, with units, in the order of [`SpreadingRow::values`].
    pub const COLUMNS: [&'static str; 4] =
        ["energy_j", "centre_beads", "second_moment_beads2", "participation_beads"];

    /// Of beads with these energies (J). Sums are in the order of the beads.
    ///
    /// ```
    /// use consumers::spreading::SpreadingRow;
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

    /// The values in the order of [`SpreadingRow::COLUMNS`].
    pub fn values(&self) -> [f64; 4] {
        [self.energy_j, self.centre_beads, self.second_moment_beads2, self.participation_beads]
    }
}

/// Computes how far the energy has spread in the frames of one run.
#[derive(Debug, Clone)]
pub struct Spreading {
    chain: Chain,
    last: Option<SpreadingRow>,
}

impl Spreading {
    /// For the frames of the run of `manifest`.
    pub fn new(manifest: &RunManifest) -> Self {
        Self { chain: manifest.physics.chain(), last: None }
    }

    /// How the energy lies in `frame`.
    pub fn observe(&mut self, frame: &Frame<'_>) -> SpreadingRow {
        let row = SpreadingRow::of(&bead_energies_j(&self.chain, frame));
        self.last = Some(row);
        row
    }

    /// The last frame's, if there was a frame.
    pub fn last(&self) -> Option<SpreadingRow> {
        self.last
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
