//! Rows of results of ours, read back.

use crate::error::ReadError;
use crate::proto;
use crate::read::messages::MessageReader;
use crate::results::columns::{ENERGY_COLUMNS, MOTION_COLUMNS};
use crate::results::contacts::{check_row, unpack};
use prost::Message;
use schemas::results::{ENERGIES, MOTION};
use std::path::Path;

/// Reads the rows of one of our topics, in the order of the file.
pub struct RecordedRows {
    messages: MessageReader,
    topic: String,
}

/// A row.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedRow {
    /// Its frame.
    pub frame: u64,
    /// The values.
    pub values: RecordedValues,
}

/// What a row says, as on the bus.
#[derive(Debug, Clone, PartialEq)]
pub enum RecordedValues {
    /// The columns of `/energies`.
    Energies([f64; ENERGIES.len()]),
    /// For each bead displacement, velocity, and overlap with both neighbours.
    Impurity {
        /// Their numbers.
        beads: Vec<u64>,
        /// The values of each.
        values: Vec<[f64; MOTION.len()]>,
    },
    /// The class of each contact.
    Contacts {
        /// Largest overlap or gap that counted as touching (m).
        tolerance_m: f64,
        /// N − 1 classes.
        classes: Vec<u8>,
    },
}

impl RecordedRows {
    /// The rows of `topic` in the recording `path`; none if they are of a kind that cannot be read back.
    ///
    /// # Errors
    /// When it cannot be read, or is no recording.
    pub fn open(path: &Path, topic: &str) -> Result<Option<Self>, ReadError> {
        if ![proto::ENERGIES.topic, proto::IMPURITY.topic, proto::CONTACTS.topic].contains(&topic) {
            return Ok(None);
        }
        Ok(Some(Self { messages: MessageReader::open(path)?, topic: topic.to_owned() }))
    }

    /// The topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// The next row; none after the last.
    ///
    /// # Errors
    /// When the file is damaged, or a message is not of the topic.
    pub fn next_row(&mut self) -> Result<Option<RecordedRow>, ReadError> {
        let contacts = self.messages.manifest().contact_count();
        while let Some(message) = self.messages.next()? {
            if message.channel.topic == self.topic {
                let (offset, row) = (message.offset, decode(&self.topic, message.data, contacts));
                return row.map(Some).map_err(|what| ReadError::damaged(self.messages.path(), offset, what));
            }
        }
        Ok(None)
    }
}

fn decode(topic: &str, message: &[u8], contacts: usize) -> Result<RecordedRow, String> {
    let not = |error| format!("a row of {topic} that is none: {error}");
    if topic == proto::ENERGIES.topic {
        let (frame, _, mut columns) = ENERGY_COLUMNS.decode(message).map_err(not)?;
        // rows of schema version 1.0 know nothing of drives
        if let Some(driven_j) = columns.last_mut() {
            driven_j.resize(1, 0.0);
        }
        let values = columns.concat().try_into();
        let values = values.map_err(|_| format!("the row of {topic} of frame {frame} lacks a value"))?;
        return Ok(RecordedRow { frame, values: RecordedValues::Energies(values) });
    }
    if topic == proto::IMPURITY.topic {
        let (frame, beads, columns) = MOTION_COLUMNS.decode(message).map_err(not)?;
        if columns.iter().any(|column| column.len() != beads.len()) {
            return Err(format!("the row of {topic} of frame {frame} has not a value for each bead"));
        }
        let of_bead = |bead: usize| std::array::from_fn(|column| columns[column][bead]);
        let values = (0..beads.len()).map(of_bead).collect();
        return Ok(RecordedRow { frame, values: RecordedValues::Impurity { beads, values } });
    }
    let row = proto::ContactClasses::decode(message).map_err(not)?;
    check_row(&row, contacts, None)?;
    let mut classes = Vec::new();
    unpack(&row.classes, contacts, &mut classes);
    let values = RecordedValues::Contacts { tolerance_m: row.tolerance_m, classes };
    Ok(RecordedRow { frame: row.frame, values })
}
