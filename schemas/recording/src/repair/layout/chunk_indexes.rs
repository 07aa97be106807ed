//! The messages of one chunk, against its header and the message indexes behind it.

use crate::read::chunk_head::ChunkHead;
use crate::read::records::RECORD_HEAD_BYTES;
use mcap::records::ChunkIndex;
use std::collections::BTreeMap;

/// Log time (ns) and offset in the chunk of a message, as in a message index.
type MessagePlace = (u64, u64);

/// The chunk that was read last, while its message indexes may come.
#[derive(Debug, Default)]
pub(super) struct OpenChunk {
    /// Its index without the entries of its message indexes; none if there is no chunk.
    index: Option<ChunkIndex>,
    /// The messages of each channel in the order of the chunk.
    messages: BTreeMap<u16, Vec<MessagePlace>>,
}

impl OpenChunk {
    pub(super) fn begin(&mut self, offset: u64, body: &[u8]) {
        self.messages.values_mut().for_each(Vec::clear);
        self.index = ChunkHead::parse(body).map(|head| ChunkIndex {
            message_start_time: head.time_range_ns.0,
            message_end_time: head.time_range_ns.1,
            chunk_start_offset: offset,
            chunk_length: RECORD_HEAD_BYTES + body.len() as u64,
            message_index_offsets: BTreeMap::new(),
            message_index_length: 0,
            compression: if head.is_compressed { "zstd" } else { "" }.to_owned(),
            compressed_size: head.compressed_bytes,
            uncompressed_size: head.uncompressed_bytes,
        });
    }

    pub(super) fn message(&mut self, channel_id: u16, log_time: u64, place: u64) {
        self.messages.entry(channel_id).or_default().push((log_time, place));
    }

    /// Takes the message index `body` at `offset`, or returns the fault in it.
    pub(super) fn take_index(&mut self, offset: u64, body: &[u8]) -> Option<String> {
        let Some(index) = &mut self.index else {
            return Some("a message index that belongs to no chunk".to_owned());
        };
        let Some((channel_id, mut entries)) = parse(body) else {
            return Some("a message index that is none".to_owned());
        };
        index.message_index_length += RECORD_HEAD_BYTES + body.len() as u64;
        if index.message_index_offsets.insert(channel_id, offset).is_some() {
            return Some(format!("a second message index of channel {channel_id} for one chunk"));
        }
        let none = Vec::new();
        let found = self.messages.get(&channel_id).unwrap_or(&none);
        // in which order is for the writer to choose
        if entries != *found {
            entries.sort_unstable();
            let mut found = found.clone();
            found.sort_unstable();
            if entries != found {
                let (says, has) = (entries.len(), found.len());
                return Some(format!(
                    "a message index of channel {channel_id}, {says} messages, that is not that of the {has} in its chunk"
                ));
            }
        }
        None
    }

    /// The index of the chunk; none if there was no chunk. Faults in its header, and missing message indexes, go to
    /// `wrong`.
    pub(super) fn close(&mut self, wrong: &mut Vec<String>) -> Option<ChunkIndex> {
        let index = self.index.take()?;
        let times = self.messages.values().flatten().map(|(time_ns, _)| *time_ns);
        let (first, last) = (times.clone().min().unwrap_or(0), times.max().unwrap_or(0)); // integers
        let said = (index.message_start_time, index.message_end_time);
        if said != (first, last) {
            let (says_first, says_last) = said;
            wrong.push(format!(
                "a chunk header that says {says_first} ns to {says_last} ns; its messages are of {first} ns to {last} ns"
            ));
        }
        for (channel_id, messages) in &self.messages {
            if !messages.is_empty() && !index.message_index_offsets.contains_key(channel_id) {
                wrong.push(format!("no message index of channel {channel_id} behind its chunk"));
            }
        }
        Some(index)
    }
}

fn parse(body: &[u8]) -> Option<(u16, Vec<MessagePlace>)> {
    let (channel_id, rest) = body.split_first_chunk::<2>()?;
    let (length, rest) = rest.split_first_chunk::<4>()?;
    let is_whole = usize::try_from(u32::from_le_bytes(*length)).ok()? == rest.len();
    let (entries, rest) = rest.as_chunks::<16>();
    let entry = |bytes: &[u8; 16]| {
        let number = |at: usize| Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        Some((number(0)?, number(8)?))
    };
    let entries = entries.iter().map(entry).collect::<Option<Vec<_>>>()?;
    (is_whole && rest.is_empty()).then_some((u16::from_le_bytes(*channel_id), entries))
}
