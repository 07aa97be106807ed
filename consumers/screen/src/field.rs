//! Quantities shown along the chain and over time.

use consumers::contacts::{COMPRESSED, Contacts, OPEN, default_tolerance_m};
use consumers::fields::Field as Quantity;
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// A quantity of each bead or contact.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Field {
    /// Velocity of each bead (m/s).
    #[default]
    Velocity,
    /// Displacement of each bead (m).
    Displacement,
    /// Overlap of each contact (m), beyond that at rest.
    Overlap,
    /// Energy (J) of each bead, with half of that of its contacts, and all of that with a wall.
    Energy,
    /// Classes of contacts: compressed (1), touching (0) and open (−½).
    Contacts,
}

impl Field {
    /// All fields, in the order in which they take turns.
    pub const ALL: [Self; 5] =
        [Self::Velocity, Self::Displacement, Self::Overlap, Self::Energy, Self::Contacts];

    /// The quantity that it shows, in whose order fields stand; none for classes of contacts.
    fn quantity(self) -> Option<Quantity> {
        Quantity::ALL.get(self as usize).copied()
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self.quantity() {
            Some(Quantity::Energy) => "energy",
            Some(quantity) => quantity.as_str(),
            None => "contacts",
        }
    }

    /// The one so many turns after this.
    #[must_use]
    pub fn after(self, turns: usize) -> Self {
        Self::ALL[(self as usize + turns) % Self::ALL.len()]
    }

    /// The kind of place that has a value.
    pub(crate) fn place(self) -> &'static str {
        self.quantity().map_or("contact", Quantity::place)
    }

    /// Its unit; contacts have none.
    pub(crate) fn unit(self) -> &'static str {
        self.quantity().map_or("", Quantity::unit)
    }
}

/// Computes the fields of the frames of one run.
#[derive(Debug, Clone)]
pub(crate) struct Fields {
    chain: Chain,
    contacts: Contacts,
}

impl Fields {
    pub(crate) fn new(manifest: &RunManifest) -> Self {
        let chain = manifest.physics.chain();
        let contacts = Contacts::new(manifest, default_tolerance_m(manifest));
        Self { chain, contacts }
    }

    /// The values of `field` in `frame`, in the order of the chain.
    pub(crate) fn values(&mut self, field: Field, frame: &Frame<'_>) -> Vec<f64> {
        match field.quantity() {
            Some(quantity) => quantity.deviations(&self.chain, frame).collect(),
            None => self.contacts.observe(frame).iter().copied().map(class_value).collect(),
        }
    }
}

/// Compressed contacts are farthest from 0, so that a cell with both kinds shows the compressed ones.
fn class_value(class: u8) -> f64 {
    match class {
        COMPRESSED => 1.0,
        OPEN => -0.5,
        _ => 0.0,
    }
}
