//! The columns of each kind of our results, in the order of the values of a row: on the bus, in tables and in recordings.

use super::ResultColumns;

/// Energies of the chain and its parts.
pub const ENERGIES: [&str; 11] = [
    "kinetic_j",
    "potential_j",
    "total_j",
    "left_j",
    "split_j",
    "right_j",
    "dissipated_j",
    "relative_drift",
    "inbound_j",
    "corrected_j",
    "driven_j",
];

/// Motion of a bead: names and units, between which the bead's number stands.
pub const MOTION: [(&str, &str); 4] =
    [("u", "m"), ("v", "m_s"), ("overlap_left", "m"), ("overlap_right", "m")];

/// The same as fields of a message, for beads that it names.
pub const MOTION_FIELDS: [&str; MOTION.len()] =
    ["displacement_m", "velocity_m_s", "overlap_left_m", "overlap_right_m"];

/// A pulse under way.
pub const PULSE: [&str; 5] = ["pulse", "bead", "v_peak_m_s", "velocity_beads_per_s", "fwhm_beads"];

impl ResultColumns {
    /// The motion of these beads, one after the other.
    pub fn motion(beads: &[u64]) -> Self {
        let names = beads.iter().flat_map(|bead| MOTION.map(|(name, unit)| format!("{name}_{bead}_{unit}")));
        let names: Vec<_> = names.collect();
        Self { width: names.len(), names: names.join(","), tolerance_m: None }
    }

    /// So many pulses; what is missing of them is NaN.
    pub fn pulses(count: usize) -> Self {
        let names = format!("for each of {count} pulses: {}; nan where there is none", PULSE.join(","));
        Self { width: count * PULSE.len(), names, tolerance_m: None }
    }

    /// The class of each of `count` contacts, of which those within the tolerance (m) are touching.
    pub fn contacts(count: usize, tolerance_m: f64) -> Self {
        let names = "one class a contact: 0 touching, 1 compressed, 2 open".to_owned();
        Self { width: count, names, tolerance_m: Some(tolerance_m) }
    }
}
