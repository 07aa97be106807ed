//! The summary section of a closed file.

use crate::head::{self, EndRecord};
use crate::read::contents::{Contents, parse_metadata};
use crate::read::parse::parse_record;
use crate::read::records::{RawRecord, RecordReader};
use mcap::records::{Footer, MetadataIndex, Record, Statistics, op};
use std::collections::BTreeMap;

/// Opcode, length and contents of the footer, and the magic.
const FOOTER_BYTES: u64 = 9 + 20 + 8;

/// Contents of the summary section of a closed file.
pub(crate) struct SummarySection {
    pub(crate) contents: Contents,
    pub(crate) statistics: Statistics,
    pub(crate) uncompressed_bytes: u64,
    pub(crate) end: EndRecord,
}

impl SummarySection {
    /// Reads and validates the section; none if it is missing or invalid.
    pub(crate) fn read(records: &mut RecordReader) -> Option<Self> {
        seek_summary(records)?;
        let mut contents = Contents::default();
        let (mut statistics, mut end_index) = (None, None);
        let (mut uncompressed_bytes, mut chunks) = (0_u64, 0);
        loop {
            match next_of_summary(records)? {
                Record::Footer(_) => break,
                Record::Statistics(found) => statistics = Some(found),
                Record::ChunkIndex(index) => {
                    uncompressed_bytes = uncompressed_bytes.checked_add(index.uncompressed_size)?;
                    chunks += 1;
                }
                Record::MetadataIndex(index) if index.name == head::END => end_index = Some(index),
                record => contents.add(record).ok()?,
            }
        }
        let statistics: Statistics = statistics.filter(|found: &Statistics| found.chunk_count == chunks)?;
        let end = read_end(records, &end_index?)?;
        Some(Self { contents, statistics, uncompressed_bytes, end })
    }

    /// Messages of each topic.
    pub(crate) fn counts(&self) -> BTreeMap<String, u64> {
        let count = |id| self.statistics.channel_message_counts.get(&id).copied().unwrap_or(0);
        self.contents.by_topic(|id, _| Some(count(id)))
    }
}

/// Goes to the summary section of a closed file and returns where it starts, if it has one.
pub(crate) fn seek_summary(records: &mut RecordReader) -> Option<u64> {
    if !records.is_closed() {
        return None;
    }
    let footer_offset = records.file_bytes().checked_sub(FOOTER_BYTES)?;
    records.seek(footer_offset).ok()?;
    let Record::Footer(Footer { summary_start, .. }) = next_of_summary(records)? else {
        return None;
    };
    if summary_start == 0 || summary_start > footer_offset {
        return None;
    }
    records.seek_summary(summary_start).ok()?;
    Some(summary_start)
}

/// The next record, if a summary may hold it. At the footer the section's CRC has been checked.
pub(crate) fn next_of_summary(records: &mut RecordReader) -> Option<Record<'static>> {
    let RawRecord { opcode, body, .. } = records.next().ok()??;
    // chunks do not belong here
    (opcode != op::CHUNK).then(|| parse_record(opcode, body).ok().map(Record::into_owned))?
}

fn read_end(records: &mut RecordReader, index: &MetadataIndex) -> Option<EndRecord> {
    if index.offset >= records.file_bytes() {
        return None;
    }
    records.seek(index.offset).ok()?;
    let path = records.path().to_owned();
    let RawRecord { opcode, offset, body } = records.next().ok()??;
    let metadata = (opcode == op::METADATA).then(|| parse_metadata(&path, offset, body).ok())??;
    (metadata.name == head::END).then(|| EndRecord::from_metadata(&metadata).ok())?
}
