//! Quantities that every bead or contact has.

use crate::local_energy::bead_energies_j;
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// A quantity along the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// Velocity of each bead (m/s).
    Velocity,
    /// Displacement of each bead (m).
    Displacement,
    /// Overlap of each contact between two beads (m); below 0 it is open.
    Overlap,
    /// Energy of each bead (J), with its share of its contacts: the energy density ([`bead_energies_j`]).
    Energy,
}

impl Field {
    /// How many values it has: one a bead or one a contact.
    pub fn place_count(self, manifest: &RunManifest) -> usize {
        let contacts = manifest.contact_count();
        if self == Self::Overlap { contacts } else { contacts + 1 }
    }

    /// What has a value: `bead` or `contact`.
    pub fn place(self) -> &'static str {
        if self == Self::Overlap { "contact" } else { "bead" }
    }

    /// The values in `frame`, in the order of the chain.
    pub fn values<'a>(self, chain: &'a Chain, frame: &Frame<'a>) -> impl Iterator<Item = f64> + use<'a> {
        let (u_m, v_m_s) = (frame.u_m, frame.v_m_s);
        let energies_j = if self == Self::Energy { bead_energies_j(chain, frame) } else { Vec::new() };
        let count = if self == Self::Overlap { chain.contact_count() } else { u_m.len() };
        (0..count).map(move |place| match self {
            Self::Velocity => v_m_s[place],
            Self::Displacement => u_m[place],
            Self::Overlap => chain.overlap_m(u_m, place),
            Self::Energy => energies_j[place],
        })
    }

    /// How far the values in `frame` are from those at rest: all of it, but for overlaps of a loaded chain.
    pub fn deviations<'a>(self, chain: &'a Chain, frame: &Frame<'a>) -> impl Iterator<Item = f64> + use<'a> {
        let u_m = frame.u_m;
        let closer = move |contact: usize| u_m[contact] - u_m[contact + 1];
        let values = self.values(chain, frame).enumerate();
        values.map(move |(place, value)| if self == Self::Overlap { closer(place) } else { value })
    }
}
