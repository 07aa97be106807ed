//! One run, as far as it was seen.

use crate::field::{Field, Fields};
use crate::strip::Strip;
use consumers::energies::{Energies, EnergyOutcome, default_split_bead};
use schemas::frame::{EndReason, Frame};
use schemas::manifest::RunManifest;

/// The newest state of a run, its energies, and maps of the states before.
#[derive(Debug, Clone)]
pub struct Watched {
    pub(crate) name: String,
    pub(crate) step_count: u64,
    pub(crate) step: u64,
    pub(crate) time_s: f64,
    energies: Energies,
    fields: Fields,
    shown: [(Vec<f64>, Strip); Field::ALL.len()],
    pub(crate) dt_s: f64,
    pub(crate) end: Option<EndReason>,
}

impl Watched {
    /// Nothing of it was seen yet.
    pub fn new(manifest: &RunManifest) -> Self {
        let strip = |field: Field| {
            Strip::new(match field {
                Field::Overlap | Field::Contacts => manifest.all_contact_count(),
                _ => manifest.contact_count() + 1,
            })
        };
        Self {
            name: manifest.provenance.name.to_string(),
            step_count: manifest.physics.step_count,
            step: 0,
            time_s: 0.0,
            energies: Energies::new(manifest, default_split_bead(manifest)),
            fields: Fields::new(manifest),
            shown: Field::ALL.map(|field| (Vec::new(), strip(field))),
            dt_s: manifest.physics.dt_s,
            end: None,
        }
    }

    /// Takes a state of the run, later than those before.
    pub fn observe(&mut self, frame: &Frame<'_>) {
        (self.step, self.time_s) = (frame.step, frame.time_s);
        self.energies.observe(frame);
        for (field, (values, strip)) in Field::ALL.into_iter().zip(&mut self.shown) {
            *values = self.fields.values(field, frame);
            strip.push(frame.step, values);
        }
    }

    /// No more states come. The last one stays.
    pub fn end(&mut self, reason: EndReason) {
        self.end = Some(reason);
    }

    /// Reason why no more states come, if so.
    pub fn ended(&self) -> Option<EndReason> {
        self.end
    }

    /// The energies of the newest state.
    pub(crate) fn outcome(&self) -> Option<EnergyOutcome> {
        self.energies.outcome()
    }

    /// The values of the newest state, and the map.
    pub(crate) fn shown(&self, field: Field) -> (&[f64], &Strip) {
        let (values, strip) = &self.shown[field as usize];
        (values, strip)
    }
}
