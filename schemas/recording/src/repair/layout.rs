//! Compares a file's description of its layout with the file: the message indexes behind each chunk, the times in its
//! header, and the summary section, which is made again from the data.

mod chunk_indexes;

use crate::head;
use crate::read::contents::Contents;
use crate::read::parse::parse_record;
use crate::read::records::{RECORD_HEAD_BYTES, RawRecord, RecordReader};
use crate::write::channel_writer::framing;
use chunk_indexes::OpenChunk;
use mcap::records::{Footer, Record, Statistics, op};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;

/// Most kinds of records in a summary section.
const MOST_GROUPS: usize = 256;

/// The summary section that a file must have, gathered while the data section is read. It takes a few hashes and the
/// places of the messages of one chunk, however long the file is.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    chunk: OpenChunk,
    chunks: Group,
    attachments: Group,
    metadata: Group,
    /// Numbers of metadata records and attachments of ours, each of which is there once.
    seen: BTreeMap<&'static str, u64>,
    /// Start of the summary section: after Data End.
    data_end: Option<u64>,
}

/// Records of one kind in the summary section: their number, and the hash of all of them in their order.
#[derive(Debug, Clone, Default)]
struct Group {
    count: u64,
    hash: Sha256,
}

impl Group {
    /// Adds the record that `append` writes, and returns its length.
    fn add(&mut self, append: impl FnOnce(&mut Vec<u8>)) -> usize {
        let mut record = Vec::new();
        append(&mut record);
        self.count += 1;
        self.hash.update(&record);
        record.len()
    }

    fn is(&self, other: &Self) -> bool {
        self.count == other.count && self.hash.clone().finalize() == other.hash.clone().finalize()
    }
}

/// Result of comparing a summary section.
#[derive(Debug)]
pub(crate) enum SummarySection {
    /// There is no summary section.
    Absent,
    /// The faults in it; none if it agrees with the data section.
    Compared(Vec<String>),
}

impl Layout {
    /// Begins the chunk whose record `body` at `offset` has been read, and whose CRC holds.
    pub(crate) fn begin_chunk(&mut self, offset: u64, body: &[u8]) {
        self.chunk.begin(offset, body);
    }

    /// Takes a message in that chunk, whose record begins at byte `place` of the records.
    pub(crate) fn message(&mut self, channel_id: u16, log_time: u64, place: u64) {
        self.chunk.message(channel_id, log_time, place);
    }

    /// Takes the next record of the data section other than a chunk, and returns the wrong statements of this record
    /// about others.
    pub(crate) fn take(&mut self, offset: u64, opcode: u8, body: &[u8]) -> Vec<String> {
        let length = RECORD_HEAD_BYTES + body.len() as u64;
        match opcode {
            op::MESSAGE_INDEX => return self.chunk.take_index(offset, body).into_iter().collect(),
            op::ATTACHMENT => self.add_attachment(offset, length, body),
            op::METADATA => self.add_metadata(offset, length, body),
            op::DATA_END => self.data_end = Some(offset + length),
            _ => {}
        }
        let mut wrong = self.close_chunk();
        if let (op::METADATA | op::ATTACHMENT, Some(what)) = (opcode, self.repeated(opcode, body)) {
            wrong.push(what);
        }
        wrong
    }

    /// Forgets the last chunk, because nothing is known of it.
    pub(crate) fn forget_chunk(&mut self) {
        self.chunk = OpenChunk::default();
    }

    /// Closes the last chunk, which has no more message indexes, and returns the faults in those that came.
    pub(crate) fn close_chunk(&mut self) -> Vec<String> {
        let mut wrong = Vec::new();
        if let Some(index) = self.chunk.close(&mut wrong) {
            self.chunks.add(|record| framing::chunk_index(record, &index));
        }
        wrong
    }

    fn add_attachment(&mut self, offset: u64, length: u64, body: &[u8]) {
        let Some(about) = framing::index_of_attachment(offset, length, body) else { return };
        self.attachments.add(|record| framing::attachment_index(record, &about));
    }

    fn add_metadata(&mut self, offset: u64, length: u64, body: &[u8]) {
        let Some(index) = framing::index_of_metadata(offset, length, body) else { return };
        self.metadata.add(|record| framing::metadata_index(record, &index));
    }

    /// The fault in a record of ours that is repeated, or misplaced so that readers do not find it.
    fn repeated(&mut self, opcode: u8, body: &[u8]) -> Option<String> {
        let name = match opcode {
            op::METADATA => body,
            // after two times
            _ => body.get(16..)?,
        };
        let ours: &[&'static str] =
            if opcode == op::METADATA { &[head::RUN, head::BEGIN, head::END] } else { &[head::RUN_TOML] };
        let (length, name) = name.split_first_chunk::<4>()?;
        let name = name.get(..usize::try_from(u32::from_le_bytes(*length)).ok()?)?;
        let name = *ours.iter().find(|known| known.as_bytes() == name)?;
        let count = self.seen.entry(name).or_default();
        *count += 1;
        if *count > 1 {
            return Some(format!("`{name}` a second time: readers may take either for the right one"));
        }
        let is_late = name != head::END && self.chunks.count > 0;
        is_late.then(|| format!("`{name}` after the first chunk, where readers have begun without it"))
    }

    /// Reads the summary section of a closed file, and compares it with the rest. `counts` are the numbers of messages
    /// of each channel; `times_ns` are the smallest and the largest log time.
    pub(crate) fn compare(
        &self,
        records: &mut RecordReader,
        contents: &Contents,
        counts: &BTreeMap<u16, u64>,
        times_ns: Option<(u64, u64)>,
    ) -> SummarySection {
        let Some(begin) = self.data_end else { return SummarySection::Absent };
        if records.seek_summary(begin).is_err() {
            return SummarySection::Compared(vec!["the summary section cannot be read".to_owned()]);
        }
        let mut said = Said::default();
        let mut wrong = Vec::new();
        if let Err(what) = said.read(records, begin, &mut wrong) {
            wrong.push(what);
            return SummarySection::Compared(wrong);
        }
        if said.is_empty {
            return if wrong.is_empty() { SummarySection::Absent } else { SummarySection::Compared(wrong) };
        }
        let groups = [
            ("chunk indexes", "chunks", &said.chunks, &self.chunks),
            ("attachment indexes", "attachments", &said.attachments, &self.attachments),
            ("metadata indexes", "metadata records", &said.metadata, &self.metadata),
        ];
        for (what, of, said, found) in groups {
            if !said.is(found) {
                let (said, found) = (said.count, found.count);
                wrong.push(format!("its {said} {what} are not those of its {found} {of}"));
            }
        }
        if !said.contents.has_same_definitions(contents) {
            let what = "its summary section does not repeat the schemas and channels as its chunks have them";
            wrong.push(what.to_owned());
        }
        let (schemas, channels) = (contents.schema_count() as u64, contents.channels.len() as u64);
        let of = [schemas, channels, self.attachments.count, self.metadata.count, self.chunks.count];
        let expected = framing::count_statistics(counts, times_ns, of);
        wrong.extend(wrong_statistics(said.statistics.as_ref(), &expected, contents));
        SummarySection::Compared(wrong)
    }
}

/// Contents of a summary section.
#[derive(Debug, Default)]
struct Said {
    contents: Contents,
    chunks: Group,
    attachments: Group,
    metadata: Group,
    statistics: Option<Statistics>,
    /// True if the section has no record at all.
    is_empty: bool,
}

impl Said {
    /// Reads it from `begin` up to the footer; faults in its own offsets go to `wrong`.
    fn read(
        &mut self,
        records: &mut RecordReader,
        begin: u64,
        wrong: &mut Vec<String>,
    ) -> Result<(), String> {
        // kind, offset and length of records of one kind, one behind the other; and what the file says of them
        let mut groups: Vec<(u8, u64, u64)> = Vec::new();
        let (mut offsets, mut first_offset) = (Vec::new(), None);
        loop {
            let record = records.next().map_err(|error| format!("the summary section: {error}"))?;
            let RawRecord { opcode, offset, body } =
                record.ok_or("the summary section has no footer at its end")?;
            let length = RECORD_HEAD_BYTES + body.len() as u64;
            let what = |error| format!("a record of kind {opcode:#04x} in the summary section: {error}");
            match parse_record(opcode, body).map_err(what)? {
                Record::Footer(footer) => {
                    self.is_empty = groups.is_empty() && offsets.is_empty();
                    wrong.extend(self.wrong_footer(&footer, begin, first_offset));
                    break;
                }
                Record::SummaryOffset(said) => {
                    first_offset.get_or_insert(offset);
                    // some writers name groups that have no record
                    if said.group_length > 0 && offsets.len() <= MOST_GROUPS {
                        offsets.push((said.group_opcode, said.group_start, said.group_length));
                    }
                    continue;
                }
                record => self.add(record, length).map_err(what)?,
            }
            if let Some((_, _, bytes)) = groups.last_mut().filter(|(last, ..)| *last == opcode) {
                *bytes += length;
            } else if groups.len() > MOST_GROUPS {
                return Err("the summary section is not grouped by kinds of records".to_owned());
            } else {
                groups.push((opcode, offset, length));
            }
        }
        // a file may do without summary offsets, but they may not lead elsewhere
        if !offsets.is_empty() && offsets != groups {
            wrong.push("its summary offsets are not where the groups of its summary section are".to_owned());
        }
        Ok(())
    }

    fn wrong_footer(&self, footer: &Footer, begin: u64, first_offset: Option<u64>) -> Option<String> {
        let start = if self.is_empty { 0 } else { begin };
        let offsets = first_offset.unwrap_or(0);
        let Footer { summary_start, summary_offset_start, .. } = *footer;
        let is_right = (summary_start == start || (self.is_empty && summary_start == begin))
            && summary_offset_start == offsets;
        (!is_right).then(|| {
            format!(
                "its footer has the summary section at byte {summary_start} and its offsets at byte \
                 {summary_offset_start} instead of {start} and {offsets}"
            )
        })
    }

    /// Takes a record of `length` bytes, unless it claims more than we know.
    fn add(&mut self, record: Record<'_>, length: u64) -> Result<(), String> {
        let again = match record {
            Record::Schema { .. } | Record::Channel(_) => return self.contents.add(record),
            Record::Statistics(found) => {
                let mut again = Vec::new();
                framing::statistics(&mut again, &found);
                if self.statistics.replace(found).is_some() {
                    return Err("there is a second one".to_owned());
                }
                again.len()
            }
            Record::ChunkIndex(index) => self.chunks.add(|record| framing::chunk_index(record, &index)),
            Record::AttachmentIndex(index) => {
                self.attachments.add(|record| framing::attachment_index(record, &index))
            }
            Record::MetadataIndex(index) => {
                self.metadata.add(|record| framing::metadata_index(record, &index))
            }
            // of a kind that nobody defined: nobody reads it
            Record::Unknown { .. } => return Ok(()),
            _ => return Err("it has no place there".to_owned()),
        };
        if again as u64 != length {
            return Err(format!("{length} bytes instead of {again}"));
        }
        Ok(())
    }
}

fn wrong_statistics(said: Option<&Statistics>, found: &Statistics, contents: &Contents) -> Vec<String> {
    let Some(said) = said else {
        return vec!["its summary section has no statistics".to_owned()];
    };
    let text = |of: &Statistics| {
        format!(
            "messages: {}, schemas: {}, channels: {}, attachments: {}, metadata: {}, chunks: {}, from {} ns to {} ns",
            of.message_count,
            of.schema_count,
            of.channel_count,
            of.attachment_count,
            of.metadata_count,
            of.chunk_count,
            of.message_start_time,
            of.message_end_time
        )
    };
    let mut wrong = Vec::new();
    if text(said) != text(found) {
        wrong.push(format!("its statistics say {}; there are {}", text(said), text(found)));
    }
    let of =
        |statistics: &Statistics, id: &u16| statistics.channel_message_counts.get(id).copied().unwrap_or(0);
    for id in said.channel_message_counts.keys().chain(contents.channels.keys()) {
        let (says, has) = (of(said, id), of(found, id));
        let topic = contents.channels.get(id).map_or("of no channel", |channel| channel.topic.as_str());
        if says != has && wrong.len() < 3 {
            wrong.push(format!(
                "its statistics say {says} for the messages of `{topic}`, of which there are {has}"
            ));
        }
    }
    wrong
}
