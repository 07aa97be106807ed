//! Rows of results, as analyses publish them on the bus, as messages.

use crate::error::WriteError;
use crate::proto;
use crate::results::columns::{MOTION_COLUMNS, PULSE_COLUMNS, RowHead, encode_numbers};
use crate::results::contacts::ContactsRow;
use crate::results::own_results::OwnResults;
use crate::write::channel_writer::{ChannelId, ChannelWriter};
use prost::Message as _;
use schemas::manifest::RunManifest;
use schemas::results::{ENERGIES, MOTION, PULSE, ResultColumns, Topic};

const MOTION_WIDTH: usize = MOTION.len();
const PULSE_WIDTH: usize = PULSE.len();

/// A kind of results, and what its rows mean.
#[derive(Debug, Clone, PartialEq)]
pub enum ResultKind {
    /// Energies of the chain and its parts.
    Energies,
    /// Motion of some beads.
    Impurity {
        /// Their numbers.
        beads: Vec<u64>,
    },
    /// Class of each contact.
    Contacts {
        /// Largest overlap or gap that counts as touching (m), NaN if it is not known.
        tolerance_m: f64,
    },
    /// Pulses under way.
    Pulses,
    /// What somebody else's analysis finds.
    Own(OwnResults),
}

/// One row of results.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResultRow<'a> {
    /// The frame it belongs to.
    pub frame: u64,
    /// The step of that frame.
    pub step: u64,
    /// The time of that frame (s).
    pub time_s: f64,
    /// The values, as on the bus.
    pub values: RowValues<'a>,
}

/// The values of a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RowValues<'a> {
    /// Numbers.
    Numbers(&'a [f64]),
    /// Classes of contacts.
    Classes(&'a [u8]),
}

impl ResultKind {
    /// The kind of rows that `topic` has with these columns.
    ///
    /// # Errors
    /// What was expected and found, when a recording cannot hold such rows.
    pub fn new(topic: Topic, columns: &ResultColumns, manifest: &RunManifest) -> Result<Self, String> {
        let ResultColumns { width, names, tolerance_m } = columns;
        match topic {
            Topic::Energies if *names == ENERGIES.join(",") => Ok(Self::Energies),
            Topic::Impurity => Ok(Self::Impurity { beads: beads(names, *width, manifest)? }),
            Topic::Contacts if *width == manifest.contact_count() => {
                Ok(Self::Contacts { tolerance_m: tolerance_m.unwrap_or(f64::NAN) })
            }
            Topic::Pulses if width.is_multiple_of(PULSE_WIDTH) => Ok(Self::Pulses),
            Topic::Own(own) => OwnResults::new(own, columns).map(Self::Own),
            _ => Err(format!("{width} columns that this version does not know: {names}")),
        }
    }

    /// The topic of one of our analyses, or somebody else's results.
    fn ours(&self) -> Result<proto::Topic, &OwnResults> {
        match self {
            Self::Energies => Ok(proto::ENERGIES),
            Self::Impurity { .. } => Ok(proto::IMPURITY),
            Self::Contacts { .. } => Ok(proto::CONTACTS),
            Self::Pulses => Ok(proto::PULSES),
            Self::Own(own) => Err(own),
        }
    }

    /// The topic of its channel.
    pub(crate) fn topic(&self) -> &str {
        self.ours().map_or_else(OwnResults::topic, |ours| ours.topic)
    }

    /// Adds its channel to `file`.
    pub(crate) fn add_to(&self, file: &mut ChannelWriter) -> Result<ChannelId, WriteError> {
        match self.ours() {
            Ok(topic) => file.add_channel(topic),
            Err(own) => file.add_described(own.topic(), &own.message(), &own.descriptor()),
        }
    }

    /// Encodes `row` into `message`, which is empty.
    ///
    /// # Errors
    /// What was expected and found, when the row is of another kind.
    pub(crate) fn encode(&self, row: &ResultRow<'_>, message: &mut Vec<u8>) -> Result<(), String> {
        match (self, row.values) {
            (Self::Energies, RowValues::Numbers(values)) => energies(row, values, message),
            (Self::Impurity { beads }, RowValues::Numbers(values)) => motion(row, beads, values, message),
            (Self::Contacts { tolerance_m }, RowValues::Classes(classes)) => {
                contacts(row, *tolerance_m, classes, message)
            }
            (Self::Pulses, RowValues::Numbers(values)) => pulses(row, values, message),
            (Self::Own(own), _) => own.encode(row, message),
            _ => Err("its values are of another type".to_owned()),
        }
    }
}

/// The beads of a row, from the names of its columns: `u_60_m` is the first of the four of bead 60. The bus cuts
/// the names after 256 bytes; the whole list is then that of the impurities, if it begins like it.
fn beads(names: &str, width: usize, manifest: &RunManifest) -> Result<Vec<u64>, String> {
    let number = |name: &str| name.strip_prefix("u_")?.strip_suffix("_m")?.parse().ok();
    let named: Option<Vec<u64>> = names.split(',').step_by(MOTION_WIDTH).map(number).collect();
    let impurities: Vec<u64> = manifest.physics.impurities.iter().map(|impurity| impurity.bead).collect();
    match named {
        Some(beads) if beads.len() * MOTION_WIDTH == width => Ok(beads),
        _ if impurities.len() * MOTION_WIDTH == width
            && ResultColumns::motion(&impurities).names.starts_with(names) =>
        {
            Ok(impurities)
        }
        _ => Err(format!("{width} columns whose beads the bus does not name: {names}; follow fewer beads")),
    }
}

fn energies(row: &ResultRow<'_>, values: &[f64], message: &mut Vec<u8>) -> Result<(), String> {
    if values.len() != ENERGIES.len() {
        return Err(format!("it has {} values, not {}", values.len(), ENERGIES.len()));
    }
    head(row).encode_raw(message);
    encode_numbers(values, message);
    Ok(())
}

fn motion(row: &ResultRow<'_>, beads: &[u64], values: &[f64], message: &mut Vec<u8>) -> Result<(), String> {
    let (motions, rest) = values.as_chunks::<MOTION_WIDTH>();
    if motions.len() != beads.len() || !rest.is_empty() {
        return Err(format!("it has {} values for {} beads", values.len(), beads.len()));
    }
    head(row).encode_raw(message);
    MOTION_COLUMNS.encode_arrays(beads, motions, message);
    Ok(())
}

fn contacts(
    row: &ResultRow<'_>,
    tolerance_m: f64,
    classes: &[u8],
    message: &mut Vec<u8>,
) -> Result<(), String> {
    if let Some(class) = classes.iter().find(|class| **class > crate::OPEN) {
        return Err(format!("{class} is no class of a contact"));
    }
    let ResultRow { frame, step, time_s, .. } = *row;
    let row = ContactsRow { frame, step, time_s, tolerance_m, classes };
    row.message(Vec::new()).encode_raw(message);
    Ok(())
}

/// Only existing pulses: the bus fills a row up with NaN.
fn pulses(row: &ResultRow<'_>, values: &[f64], message: &mut Vec<u8>) -> Result<(), String> {
    let (pulses, rest) = values.as_chunks::<PULSE_WIDTH>();
    if !rest.is_empty() {
        return Err(format!("it has {} values, not {PULSE_WIDTH} a pulse", values.len()));
    }
    let pulses: Vec<_> = pulses.iter().copied().filter(|pulse| !pulse[0].is_nan()).collect();
    let whole = |number: f64| number >= 0.0 && number < 2.0_f64.powi(53) && number.fract() == 0.0;
    if let Some([number, ..]) = pulses.iter().find(|pulse| !whole(pulse[0])) {
        return Err(format!("{number} is no number of a pulse"));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole numbers below 2^53")]
    let numbers: Vec<_> = pulses.iter().map(|pulse| pulse[0] as u64).collect();
    head(row).encode_raw(message);
    PULSE_COLUMNS.encode_arrays(&numbers, &pulses, message);
    Ok(())
}

fn head(row: &ResultRow<'_>) -> RowHead {
    let ResultRow { frame, step, time_s, .. } = *row;
    RowHead { frame, step, time_s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::columns::ENERGY_COLUMNS;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    fn encoded(kind: &ResultKind, values: RowValues<'_>) -> Vec<u8> {
        let mut message = Vec::new();
        let row = ResultRow { frame: 7, step: 70, time_s: 0.5, values };
        kind.encode(&row, &mut message).expect("a row of that kind");
        message
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|value| value.to_bits()).collect()
    }

    /// Every kind of double, in one row.
    const DOUBLES: [f64; 11] = [
        1e-310,
        -0.0,
        0.0,
        5e-324,
        f64::INFINITY,
        f64::from_bits(0x7ff8_dead_beef_0001),
        -1.5,
        f64::NAN,
        1e300,
        2.0,
        -0.0,
    ];

    #[test]
    fn doubles_of_results_keep_their_bits() {
        let energies = encoded(&ResultKind::Energies, RowValues::Numbers(&DOUBLES));
        let head = RowHead::decode(&*energies).expect("a row");
        assert_eq!((head.frame, head.step, head.time_s), (7, 70, 0.5));
        let (frame, _, columns) = ENERGY_COLUMNS.decode(&energies).expect("a row");
        assert_eq!((frame, bits(&columns.concat())), (7, bits(&DOUBLES)));

        let kind = ResultKind::Impurity { beads: vec![3, 5] };
        let motion = encoded(&kind, RowValues::Numbers(&DOUBLES[..8]));
        let (_, beads, columns) = MOTION_COLUMNS.decode(&motion).expect("a row");
        assert_eq!(beads, [3, 5]);
        assert_eq!(bits(&columns[0]), bits(&[DOUBLES[0], DOUBLES[4]]));
        assert_eq!(bits(&columns[3]), bits(&[DOUBLES[3], DOUBLES[7]]));

        let row = [2.0, -0.0, 5e-324, -1.5, f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN];
        let pulses = encoded(&ResultKind::Pulses, RowValues::Numbers(&row));
        let (_, numbers, columns) = PULSE_COLUMNS.decode(&pulses).expect("a row");
        assert_eq!(numbers, [2]);
        assert_eq!((bits(&columns[0]), columns[3].len()), (bits(&[-0.0]), 1));
    }

    #[test]
    fn rows_of_another_shape_are_refused() {
        let refused = |kind: &ResultKind, values| {
            let row = ResultRow { frame: 0, step: 0, time_s: 0.0, values };
            kind.encode(&row, &mut Vec::new()).is_err()
        };
        assert!(refused(&ResultKind::Energies, RowValues::Numbers(&DOUBLES[..9])));
        assert!(refused(&ResultKind::Energies, RowValues::Classes(&[0; 10])));
        assert!(refused(&ResultKind::Impurity { beads: vec![1] }, RowValues::Numbers(&DOUBLES[..8])));
        assert!(refused(&ResultKind::Contacts { tolerance_m: 0.0 }, RowValues::Classes(&[3])));
        assert!(refused(&ResultKind::Pulses, RowValues::Numbers(&[1.5, 0.0, 0.0, 0.0, 0.0])));
    }

    /// The bus cuts long lists of columns.
    #[test]
    fn the_beads_of_a_row_are_those_that_its_columns_name() {
        let mut config = PRESETS[0].config();
        config.chain.impurities =
            (300..340).map(|bead| schemas::config::Impurity { bead, mass_kg: 2e-3 }).collect();
        let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&config, "test", origin).expect("valid");
        let named = |names: &str, width| {
            let columns = ResultColumns { width, names: names.into(), tolerance_m: None };
            ResultKind::new(Topic::Impurity, &columns, &manifest)
        };
        let two = "u_3_m,v_3_m_s,overlap_left_3_m,overlap_right_3_m,u_5_m,v_5_m_s,overlap_left_5_m,overlap_right_5_m";
        assert_eq!(named(two, 8), Ok(ResultKind::Impurity { beads: vec![3, 5] }));
        let cut = "u_300_m,v_300_m_s,overlap_left_300_m,overlap_right_300_m,u_301_m,v_30";
        assert_eq!(named(cut, 160), Ok(ResultKind::Impurity { beads: (300..340).collect() }));
        assert!(named(cut, 164).is_err());
        assert!(named("u_3_m,v_3_m_s,overlap_left_3_m,overlap_right_3_m,u_301_m,v_30", 160).is_err());
    }
}
