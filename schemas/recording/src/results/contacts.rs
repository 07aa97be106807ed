//! The space-time map of the contacts: one row of classes for each frame.

use crate::PROFILE;
use crate::error::{ReadError, WriteError};
use crate::head::EndRecord;
use crate::proto;
use crate::read::messages::MessageReader;
use crate::write::channel_writer::{ChannelId, ChannelWriter, Finished, WriteOptions};
use prost::Message;
use schemas::frame::EndReason;
use schemas::manifest::RunManifest;
use std::ops::RangeInclusive;
use std::path::Path;

/// Class of a contact without overlap or gap beyond the tolerance.
pub const TOUCHING: u8 = 0;
/// Class of a contact with an overlap above the tolerance.
pub const COMPRESSED: u8 = 1;
/// Class of a contact with a gap above the tolerance.
pub const OPEN: u8 = 2;

/// One row of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactsRow<'a> {
    /// Number of the frame.
    pub frame: u64,
    /// Its step.
    pub step: u64,
    /// Its simulated time (s).
    pub time_s: f64,
    /// Largest overlap, and largest gap, that counts as touching (m).
    pub tolerance_m: f64,
    /// Class of each contact: [`TOUCHING`], [`COMPRESSED`] or [`OPEN`]; in a ring the last is the one that closes it.
    pub classes: &'a [u8],
}

impl ContactsRow<'_> {
    /// Makes a message of the row, in the memory of `packed`.
    pub(crate) fn message(&self, mut packed: Vec<u8>) -> proto::ContactClasses {
        let Self { frame, step, time_s, tolerance_m, classes } = *self;
        pack(classes, &mut packed);
        let contact_count = u32::try_from(classes.len()).unwrap_or(u32::MAX);
        proto::ContactClasses { frame, step, time_s, contact_count, tolerance_m, classes: packed }
    }
}

/// Writes a map to a file of its own, `.partial` until it is finished like a recording. If the writer is dropped
/// without that, the file stays as it is, unless it has no row.
pub struct ContactsWriter {
    file: ChannelWriter,
    channel: ChannelId,
    contacts: usize,
    /// Reused from row to row; its frame means nothing before the first row.
    row: proto::ContactClasses,
    message: Vec<u8>,
    first_step: Option<u64>,
    rows: u64,
}

impl ContactsWriter {
    /// Starts the map `path` of the run `manifest`.
    ///
    /// # Errors
    /// When there is such a file or its `.partial` and `options.force` is not set, when another process
    /// writes it, when something other than a file has its name, or when the operating system refuses.
    pub fn create(path: &Path, manifest: &RunManifest, options: &WriteOptions) -> Result<Self, WriteError> {
        let mut file = ChannelWriter::create(PROFILE, path, manifest, None, None, options)?;
        let channel = file.add_channel(proto::CONTACTS)?;
        let contacts = manifest.all_contact_count();
        let row = proto::ContactClasses::default();
        Ok(Self { file, channel, contacts, row, message: Vec::new(), first_step: None, rows: 0 })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// When the row is not one of this run or not after the row before, or when writing fails.
    pub fn write(&mut self, row: &ContactsRow<'_>) -> Result<(), WriteError> {
        self.check(row)?;
        let ContactsRow { frame, step, time_s, .. } = *row;
        self.row = row.message(std::mem::take(&mut self.row.classes));
        self.message.clear();
        self.row.encode_raw(&mut self.message);
        self.file.write_frame(frame, time_s, [(self.channel, &self.message)])?;
        self.first_step.get_or_insert(step);
        self.rows += 1;
        Ok(())
    }

    fn check(&self, row: &ContactsRow<'_>) -> Result<(), WriteError> {
        let what = if row.classes.len() != self.contacts {
            format!("it has {} contacts, the run {}", row.classes.len(), self.contacts)
        } else if let Some(class) = row.classes.iter().find(|class| **class > OPEN) {
            format!("{class} is no class of a contact")
        } else if self.rows > 0 && self.row.step >= row.step {
            format!("the row of step {} was written before", self.row.step)
        } else {
            return Ok(());
        };
        let path = self.file.path().to_owned();
        Err(WriteError::Frame { path, frame: row.frame, step: row.step, what })
    }

    /// Bytes on the disk so far.
    pub fn bytes_written(&self) -> u64 {
        self.file.bytes_written()
    }

    /// Ends the map for `reason`, on the disk and under its name.
    ///
    /// # Errors
    /// When writing fails, or when a file of this name appeared meanwhile; the `.partial` then stays.
    pub fn finish(self, reason: EndReason) -> Result<Finished, WriteError> {
        let end = EndRecord {
            reason,
            first_step: self.first_step,
            last_step: self.first_step.map(|_| self.row.step),
            part: 1,
            previous_state_hash: None,
            last_state_hash: None,
        };
        self.file.finish(&end.metadata(), self.rows)
    }
}

/// Reads the `/contacts` channel of any recording.
pub struct ContactsReader {
    messages: MessageReader,
    widths: RangeInclusive<usize>,
    classes: Vec<u8>,
    last_step: Option<u64>,
}

impl ContactsReader {
    /// Opens the file `path`.
    ///
    /// # Errors
    /// When it cannot be read, is no recording, or is of another major schema version.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let messages = MessageReader::open(path)?;
        let widths = widths(messages.manifest());
        Ok(Self { messages, widths, classes: Vec::new(), last_step: None })
    }

    /// The run that the map belongs to.
    pub fn manifest(&self) -> &RunManifest {
        self.messages.manifest()
    }

    /// The next row, lent until the next call; none at the end.
    ///
    /// # Errors
    /// When the file is damaged, cannot be read, or holds no map.
    pub fn next_row(&mut self) -> Result<Option<ContactsRow<'_>>, ReadError> {
        while let Some(message) = self.messages.next()? {
            if message.channel.topic != proto::CONTACTS.topic {
                continue;
            }
            let offset = message.offset;
            let row = proto::ContactClasses::decode(message.data)
                .map_err(|error| format!("a row that is no ContactClasses: {error}"))
                .and_then(|row| check_row(&row, &self.widths, self.last_step).map(|()| row))
                .map_err(|what| ReadError::damaged(self.messages.path(), offset, what))?;
            unpack(&row, &mut self.classes);
            self.last_step = Some(row.step);
            let proto::ContactClasses { frame, step, time_s, tolerance_m, .. } = row;
            return Ok(Some(ContactsRow { frame, step, time_s, tolerance_m, classes: &self.classes }));
        }
        self.messages.check_has(proto::CONTACTS.topic).map(|()| None)
    }

    /// End of the map, known after its last row: unfinished if the file was not closed.
    pub fn end_reason(&self) -> EndReason {
        self.messages.end_reason()
    }
}

/// Contacts that a row of the run `manifest` may have: maps of rings were once made without the one that closes them.
pub(crate) fn widths(manifest: &RunManifest) -> RangeInclusive<usize> {
    manifest.contact_count()..=manifest.all_contact_count()
}

/// Refuses a row that is none of a run of these [`widths`], or comes too early.
pub(crate) fn check_row(
    row: &proto::ContactClasses,
    widths: &RangeInclusive<usize>,
    last_step: Option<u64>,
) -> Result<(), String> {
    let (step, contacts) = (row.step, widths.end());
    let count = row.contact_count as usize;
    if !widths.contains(&count) || row.classes.len() != count.div_ceil(4) {
        let (found, bytes) = (row.contact_count, row.classes.len());
        return Err(format!(
            "the row of step {step} has {found} contacts in {bytes} bytes, the run {contacts}"
        ));
    }
    if let Some(before) = last_step.filter(|before| *before >= step) {
        return Err(format!("the row of step {step} after that of step {before}"));
    }
    // class 3: both bits of a pair
    if row.classes.iter().any(|byte| byte & (byte >> 1) & 0x55 != 0) {
        return Err(format!("the row of step {step} has a class that is none"));
    }
    Ok(())
}

/// Packs four classes into a byte, the first in the lowest bits.
fn pack(classes: &[u8], packed: &mut Vec<u8>) {
    packed.clear();
    packed.extend(classes.chunks(4).map(|four| four.iter().rev().fold(0, |byte, class| byte << 2 | class)));
}

pub(crate) fn unpack(row: &proto::ContactClasses, classes: &mut Vec<u8>) {
    classes.clear();
    classes.extend(row.classes.iter().flat_map(|byte| [0, 2, 4, 6].map(|shift| (byte >> shift) & 3)));
    classes.truncate(row.contact_count as usize);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_packed_from_the_lowest_bits() {
        let (mut packed, mut classes) = (Vec::new(), Vec::new());
        pack(&[COMPRESSED, OPEN, TOUCHING, COMPRESSED, OPEN], &mut packed);
        assert_eq!(packed, [0b01_00_10_01, 0b10]);
        unpack(
            &proto::ContactClasses { contact_count: 5, classes: packed, ..Default::default() },
            &mut classes,
        );
        assert_eq!(classes, [1, 2, 0, 1, 2]);
    }
}
