//! What the summary section of a file says of its chunks, its messages and its end, against what is there.

use super::chunk::ChunkHead;
use super::contents::Contents;
use super::head;
use super::info::{next_of_summary, seek_summary};
use super::records::{RECORD_HEAD_BYTES, RecordReader};
use mcap::records::{ChunkIndex, Record, Statistics};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;

/// How many chunks there are and, by a sum of hashes, where they are: however many, that takes a few bytes, and it does
/// not matter in which order they are named.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Places {
    count: u64,
    sum: u128,
}

impl Places {
    /// Adds the chunk record `body` at `offset`.
    pub(super) fn add_chunk(&mut self, offset: u64, body: &[u8]) {
        let Some(head) = ChunkHead::parse(body) else { return };
        let (first_ns, last_ns) = head.time_range_ns;
        let length = RECORD_HEAD_BYTES + body.len() as u64;
        self.add([offset, length, first_ns, last_ns, head.uncompressed_bytes, head.compressed_bytes]);
    }

    fn add_index(&mut self, index: &ChunkIndex) {
        self.add([
            index.chunk_start_offset,
            index.chunk_length,
            index.message_start_time,
            index.message_end_time,
            index.uncompressed_size,
            index.compressed_size,
        ]);
    }

    fn add(&mut self, numbers: [u64; 6]) {
        let hash = Sha256::digest(numbers.map(u64::to_le_bytes).concat());
        let (half, _) = hash.as_slice().split_first_chunk().unwrap_or((&[0; 16], &[]));
        self.count += 1;
        self.sum = self.sum.wrapping_add(u128::from_le_bytes(*half));
    }
}

/// What of the summary section does not agree with `contents`, all of the file, with how many messages each channel has,
/// and with the smallest and the largest log time (ns) of them. A file may do without any of it.
pub(super) fn disagreements(
    records: &mut RecordReader,
    contents: &Contents,
    counts: &BTreeMap<u16, u64>,
    times_ns: Option<(u64, u64)>,
) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut indexed = Places::default();
    let mut statistics = None;
    if seek_summary(records).is_none() {
        return wrong;
    }
    while let Some(record) = next_of_summary(records) {
        match record {
            Record::Footer(_) => break,
            Record::Statistics(found) => statistics = Some(found),
            Record::ChunkIndex(index) => indexed.add_index(&index),
            Record::MetadataIndex(index) if index.name == head::END => {
                let (offset, length) = (index.offset, index.length);
                if contents.end_place.is_some_and(|place| place != (offset, length)) {
                    wrong.push(format!(
                        "its index has the metadata `{}` at byte {offset}, {length} bytes, where it is not",
                        head::END
                    ));
                }
            }
            _ => {}
        }
    }
    if indexed.count > 0 && indexed != contents.places {
        wrong.push(format!(
            "its {} chunk indexes are not those of its {} chunks",
            indexed.count, contents.places.count
        ));
    }
    if let Some(said) = statistics {
        wrong.extend(wrong_totals(&said, contents, counts.values().sum(), times_ns));
        wrong.extend(wrong_counts(&said, contents, counts));
    }
    wrong
}

fn wrong_totals(
    said: &Statistics,
    contents: &Contents,
    message_count: u64,
    times_ns: Option<(u64, u64)>,
) -> Option<String> {
    let found = (contents.places.count, message_count, times_ns.unwrap_or_default());
    let times_said = (said.message_start_time, said.message_end_time);
    let said = (u64::from(said.chunk_count), said.message_count, times_said);
    let text = |(chunks, messages, (first, last)): (u64, u64, (u64, u64))| {
        format!("chunks: {chunks}, messages: {messages}, from {first} ns to {last} ns")
    };
    (said != found).then(|| format!("its statistics say {}; there are {}", text(said), text(found)))
}

fn wrong_counts<'a>(
    said: &'a Statistics,
    contents: &'a Contents,
    counts: &'a BTreeMap<u16, u64>,
) -> impl Iterator<Item = String> + use<'a> {
    contents.channels.iter().filter_map(|(id, channel)| {
        let of = |counts: &BTreeMap<u16, u64>| counts.get(id).copied().unwrap_or(0);
        let (said, found) = (of(&said.channel_message_counts), of(counts));
        let topic = &channel.topic;
        (said != found).then(|| {
            format!("its statistics say {said} for the messages of `{topic}`, of which there are {found}")
        })
    })
}
