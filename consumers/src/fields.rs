//! Quantities that every bead or contact has.

use crate::local_energy::bead_energies_j;
use schemas::chain::Chain;
use schemas::frame::Frame;

/// A quantity along the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// Velocity of each bead (m/s).
    Velocity,
    /// Displacement of each bead (m).
    Displacement,
    /// Overlap of each contact between two beads (m), in a ring with the one that closes it; below 0 it is open.
    Overlap,
    /// Energy of each bead (J), with its share of its contacts: the energy density ([`bead_energies_j`]).
    Energy,
}

impl Field {
    /// Every quantity.
    pub const ALL: [Self; 4] = [Self::Velocity, Self::Displacement, Self::Overlap, Self::Energy];

    /// Its name on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Displacement => "displacement",
            Self::Overlap => "overlap",
            Self::Energy => "energy-density",
        }
    }

    /// The quantity, in a few words.
    pub fn about(self) -> &'static str {
        match self {
            Self::Velocity => "Velocity of the beads",
            Self::Displacement => "Displacement of the beads",
            Self::Overlap => "Overlap of the contacts",
            Self::Energy => "Energy of the beads, each with half of its contacts",
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Velocity => "m/s",
            Self::Displacement | Self::Overlap => "m",
            Self::Energy => "J",
        }
    }

    /// Kind of a place that has a value: `bead` or `contact`.
    pub fn place(self) -> &'static str {
        if self == Self::Overlap { "contact" } else { "bead" }
    }

    /// The values in `frame`, in the order of the chain.
    pub fn values<'a>(self, chain: &'a Chain, frame: &Frame<'a>) -> impl Iterator<Item = f64> + use<'a> {
        let (u_m, v_m_s) = (frame.u_m, frame.v_m_s);
        let energies_j = if self == Self::Energy { bead_energies_j(chain, frame) } else { Vec::new() };
        let count = if self == Self::Overlap { chain.all_contact_count() } else { u_m.len() };
        (0..count).map(move |place| match self {
            Self::Velocity => v_m_s[place],
            Self::Displacement => u_m[place],
            Self::Overlap => chain.overlap_m(u_m, place),
            Self::Energy => energies_j[place],
        })
    }

    /// Differences between the values in `frame` and those at rest. They equal the values, but for overlaps of a loaded chain.
    pub fn deviations<'a>(self, chain: &'a Chain, frame: &Frame<'a>) -> impl Iterator<Item = f64> + use<'a> {
        let u_m = frame.u_m;
        let values = self.values(chain, frame).enumerate();
        values.map(move |(place, value)| if self == Self::Overlap { chain.across(u_m, place) } else { value })
    }
}
