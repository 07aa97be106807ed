//! Quantities that are compared between a run and its twins.

use crate::contacts::{Contacts, default_tolerance_m};
use crate::energies::Energies;
use crate::pulses::Pulses;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::summary::Summarizer;

/// The quantities of a run that are reported and compared with its twins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Displacement of the bead that differs most, in L.
    Displacement,
    /// Velocity of the bead that differs most, in v0.
    Velocity,
    /// Velocity of the fastest bead, in v0: the peak of the strongest pulse.
    Peak,
    /// Displacement of the impurities, or of the split bead, in L.
    Position,
    /// Velocity of the impurities, or of the split bead, in v0.
    BeadVelocity,
    /// Energy of the chain, in `½·m·v0²`.
    TotalEnergy,
    /// Energy left of the split bead.
    LeftEnergy,
    /// Energy of the split bead.
    SplitEnergy,
    /// Energy right of the split bead.
    RightEnergy,
    /// The reflected part of the energy, without the recoil where that is known.
    Reflected,
    /// Contacts that are in another class.
    Contacts,
    /// The front bead.
    Front,
    /// The number of pulses so far.
    Pulses,
}

impl Quantity {
    /// Number of quantities.
    pub const COUNT: usize = 13;

    /// All of them, in the order of the report.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Displacement,
        Self::Velocity,
        Self::Peak,
        Self::Position,
        Self::BeadVelocity,
        Self::TotalEnergy,
        Self::LeftEnergy,
        Self::SplitEnergy,
        Self::RightEnergy,
        Self::Reflected,
        Self::Contacts,
        Self::Front,
        Self::Pulses,
    ];

    /// Its name in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Displacement => "displacement",
            Self::Velocity => "velocity",
            Self::Peak => "peak_velocity",
            Self::Position => "impurity_position",
            Self::BeadVelocity => "impurity_velocity",
            Self::TotalEnergy => "total_energy",
            Self::LeftEnergy => "left_energy",
            Self::SplitEnergy => "split_energy",
            Self::RightEnergy => "right_energy",
            Self::Reflected => "reflected",
            Self::Contacts => "contacts",
            Self::Front => "front_bead",
            Self::Pulses => "pulses",
        }
    }

    /// The unit of its errors; empty where they are counted.
    pub fn scale(self) -> &'static str {
        match self {
            Self::Displacement | Self::Position => "L",
            Self::Velocity | Self::Peak | Self::BeadVelocity => "v0",
            Self::TotalEnergy | Self::LeftEnergy | Self::SplitEnergy | Self::RightEnergy => "½·m·v0²",
            Self::Reflected => "1",
            Self::Contacts | Self::Front | Self::Pulses => "",
        }
    }

    /// True if it is the displacement or the velocity of beads.
    pub fn is_of_beads(self) -> bool {
        matches!(self, Self::Displacement | Self::Velocity | Self::Position | Self::BeadVelocity)
    }

    /// True if it is a whole number.
    pub fn is_count(self) -> bool {
        self.scale().is_empty()
    }
}

/// The run or a twin, and its last values.
#[derive(Debug, Clone)]
pub(super) struct Sibling {
    energies: Energies,
    contacts: Contacts,
    pulses: Pulses,
    summarizer: Summarizer,
    /// The beads whose motion is told.
    beads: Vec<usize>,
    /// L, v0 and `½·m·v0²`.
    scales: [f64; 3],
    seen: Seen,
}

/// Results of the analyses at one look.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    /// Total, left, split, right (J).
    energies_j: [f64; 4],
    reflected: Option<f64>,
    peak_m_s: f64,
    front: u64,
    pulses: u64,
}

impl Sibling {
    pub(super) fn new(manifest: &RunManifest, split_bead: u64) -> Self {
        let physics = &manifest.physics;
        let speed_m_s = physics.scales().speed_m_s();
        let threshold_m_s = Pulses::DEFAULT_THRESHOLD * Pulses::velocity_scale_m_s(manifest);
        let impurities: Vec<_> = physics.impurities.iter().map(|impurity| impurity.bead).collect();
        let beads = if impurities.is_empty() { vec![split_bead] } else { impurities };
        Self {
            energies: Energies::new(manifest, split_bead),
            contacts: Contacts::new(manifest, default_tolerance_m(manifest)),
            pulses: Pulses::new(manifest, threshold_m_s),
            summarizer: Summarizer::new(physics),
            beads: beads.into_iter().filter_map(|bead| usize::try_from(bead).ok()).collect(),
            scales: [
                physics.scales().length_m,
                speed_m_s,
                0.5 * physics.bead_mass_kg * speed_m_s * speed_m_s,
            ],
            seen: Seen::default(),
        }
    }

    /// True if the split bead has a measurable reflection.
    pub(super) fn reflects(&self) -> bool {
        self.seen.reflected.is_some()
    }

    /// Looks at the next state.
    pub(super) fn look(&mut self, frame: &Frame<'_>) {
        let row = self.energies.observe(frame);
        self.contacts.observe(frame);
        self.pulses.observe(frame);
        let reflection = self.energies.outcome().and_then(|outcome| outcome.reflection.ok());
        let reflected = reflection.and_then(|reflection| {
            let energies = reflection.energies?;
            Some(reflection.corrected().map_or(energies.over_total(), |corrected| corrected.over_total))
        });
        self.seen = Seen {
            energies_j: [row.total_j, row.left_j, row.split_j, row.right_j],
            reflected: reflected.map(|fraction| fraction.value),
            peak_m_s: frame.v_m_s.iter().fold(0.0, |peak, v| if v.abs() > peak { v.abs() } else { peak }),
            front: self.summarizer.summarize(frame).front_bead,
            pulses: self.pulses.counts().pulses,
        };
    }

    /// Differences of a twin, in the order of [`Quantity::ALL`] and in units of their scales.
    pub(super) fn differences(
        &self,
        frame: &Frame<'_>,
        twin: &Self,
        of_twin: &Frame<'_>,
    ) -> [f64; Quantity::COUNT] {
        let [length_m, speed_m_s, energy_j] = self.scales;
        let of_beads = |a: &[f64], b: &[f64]| {
            self.beads.iter().fold(0.0_f64, |most, bead| most.max((a[*bead] - b[*bead]).abs()))
        };
        let (seen, other) = (&self.seen, &twin.seen);
        let energy = |i: usize| (seen.energies_j[i] - other.energies_j[i]).abs() / energy_j;
        let classes = self.contacts.classes().iter().zip(twin.contacts.classes());
        Quantity::ALL.map(|quantity| match quantity {
            Quantity::Displacement => largest_difference(frame.u_m, of_twin.u_m) / length_m,
            Quantity::Velocity => largest_difference(frame.v_m_s, of_twin.v_m_s) / speed_m_s,
            Quantity::Peak => (seen.peak_m_s - other.peak_m_s).abs() / speed_m_s,
            Quantity::Position => of_beads(frame.u_m, of_twin.u_m) / length_m,
            Quantity::BeadVelocity => of_beads(frame.v_m_s, of_twin.v_m_s) / speed_m_s,
            Quantity::TotalEnergy => energy(0),
            Quantity::LeftEnergy => energy(1),
            Quantity::SplitEnergy => energy(2),
            Quantity::RightEnergy => energy(3),
            Quantity::Reflected => match (seen.reflected, other.reflected) {
                (Some(a), Some(b)) => (a - b).abs(),
                (None, None) => 0.0,
                // the pulse has arrived in only one of them
                _ => 1.0,
            },
            Quantity::Contacts => classes.clone().filter(|(a, b)| a != b).count() as f64,
            Quantity::Front => seen.front.abs_diff(other.front) as f64,
            Quantity::Pulses => seen.pulses.abs_diff(other.pulses) as f64,
        })
    }

    /// Puts `changes` of the displacements (m), then of the velocities (m/s) of all beads, in the places of the differences of those.
    pub(super) fn put_changes(&self, changes: &[f64], differences: &mut [f64; Quantity::COUNT]) {
        let [length_m, speed_m_s, _] = self.scales;
        let beads = self.contacts.bead_count();
        let largest =
            |numbers: &[f64]| numbers.iter().fold(0.0, |most, x| if x.abs() > most { x.abs() } else { most });
        let of_beads =
            |numbers: &[f64]| self.beads.iter().map(|bead| numbers[*bead].abs()).fold(0.0, f64::max);
        let (u, v) = (&changes[..beads], &changes[beads..2 * beads]);
        for (quantity, error) in [
            (Quantity::Displacement, largest(u) / length_m),
            (Quantity::Velocity, largest(v) / speed_m_s),
            (Quantity::Position, of_beads(u) / length_m),
            (Quantity::BeadVelocity, of_beads(v) / speed_m_s),
        ] {
            differences[quantity as usize] = error;
        }
    }
}

/// The largest `|a − b|`.
fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |most, (a, b)| {
        let difference = (a - b).abs();
        if difference > most { difference } else { most }
    })
}
