//! A chunk before it is compressed.

use super::framing;
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::time::Instant;

/// The records of a chunk, and the places of its messages. Cleared and used again, so that it keeps its buffers.
#[derive(Debug, Default)]
pub(super) struct Block {
    /// Definitions of channels, and messages.
    records: Vec<u8>,
    /// Log time (ns) and place of each message, by channel. A channel without messages may be there.
    places: BTreeMap<u16, Vec<(u64, u64)>>,
    /// Least and greatest log time of the messages (ns).
    times_ns: Option<(u64, u64)>,
    /// Number of frames whose messages are in here.
    frames: u64,
    /// Time when the first record came.
    opened: Option<Instant>,
}

impl Block {
    pub(super) fn bytes(&self) -> u64 {
        self.records.len() as u64
    }

    pub(super) fn records(&self) -> &[u8] {
        &self.records
    }

    /// Channels with messages here, with log time (ns) and place of each.
    pub(super) fn places(&self) -> impl Iterator<Item = (u16, &[(u64, u64)])> {
        self.places
            .iter()
            .map(|(id, places)| (*id, places.as_slice()))
            .filter(|(_, places)| !places.is_empty())
    }

    pub(super) fn times_ns(&self) -> Option<(u64, u64)> {
        self.times_ns
    }

    pub(super) fn frames(&self) -> u64 {
        self.frames
    }

    /// Time when the first record came; none as long as there is none.
    pub(super) fn opened(&self) -> Option<Instant> {
        self.opened
    }

    pub(super) fn define(&mut self, record: &[u8], now: Instant) {
        self.opened.get_or_insert(now);
        self.records.extend_from_slice(record);
    }

    pub(super) fn message(&mut self, head: &MessageHeader, data: &[u8], now: Instant) {
        self.opened.get_or_insert(now);
        let time_ns = head.log_time;
        let (first, last) = self.times_ns.unwrap_or((time_ns, time_ns));
        self.times_ns = Some((first.min(time_ns), last.max(time_ns)));
        let place = self.bytes();
        self.places.entry(head.channel_id).or_default().push((time_ns, place));
        framing::message(&mut self.records, head, data);
    }

    /// Counts the messages since the last call as those of a frame.
    pub(super) fn end_frame(&mut self) {
        self.frames += 1;
    }

    pub(super) fn clear(&mut self) {
        let Self { records, places, times_ns, frames, opened } = self;
        records.clear();
        places.values_mut().for_each(Vec::clear);
        (*times_ns, *frames, *opened) = (None, 0, None);
    }
}
