//! The columns of each kind of our results, in the order of the values of a row: on the bus, in tables and in recordings.

use super::{ResultColumns, Things, ThingsNumbers};

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

/// A pulse under way.
pub const PULSE: [&str; 5] = ["pulse", "bead", "v_peak_m_s", "velocity_beads_per_s", "fwhm_beads"];

/// The word before the threshold of pulses, at the end of the names of their columns.
const THRESHOLD: &str = "; threshold ";

/// The rows whose messages have arrays.
static OF_THINGS: [Things; 2] = [
    Things {
        topic: "impurity",
        file: "impurity_motion",
        message: "ImpurityMotion",
        number: "bead",
        fields: &["displacement_m", "velocity_m_s", "overlap_left_m", "overlap_right_m"],
        numbers: ThingsNumbers::InNames(&MOTION),
    },
    Things {
        topic: "pulses",
        file: "pulses",
        message: "Pulses",
        number: PULSE[0],
        fields: PULSE.split_at(1).1,
        numbers: ThingsNumbers::InRows,
    },
];

impl Things {
    /// Layout of the rows of `topic`, if they are about things.
    pub fn of_topic(topic: &str) -> Option<&'static Self> {
        OF_THINGS.iter().find(|known| known.topic == topic)
    }
}

impl ResultColumns {
    /// Columns for the motion of these beads, one after the other.
    pub fn motion(beads: &[u64]) -> Self {
        let names = Things::names(&MOTION, beads);
        Self { width: beads.len() * MOTION.len(), names, tolerance_m: None }
    }

    /// Columns for `count` pulses above `threshold`, relative to L/T; a pulse that is missing is NaN.
    pub fn pulses(count: usize, threshold: f64) -> Self {
        let each = PULSE.join(",");
        let names =
            format!("for each of {count} pulses: {each}; nan where there is none{THRESHOLD}{threshold:e}");
        Self { width: count * PULSE.len(), names, tolerance_m: None }
    }

    /// The threshold of pulses, if the names tell it.
    pub fn threshold(&self) -> Option<f64> {
        self.names.rsplit_once(THRESHOLD)?.1.parse().ok()
    }

    /// Columns for the class of each of `count` contacts, of which those within the tolerance (m) are touching.
    pub fn contacts(count: usize, tolerance_m: f64) -> Self {
        let names = "one class a contact: 0 touching, 1 compressed, 2 open".to_owned();
        Self { width: count, names, tolerance_m: Some(tolerance_m) }
    }
}
