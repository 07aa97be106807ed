//! Reading on after damage, for readers that salvage.

use super::{MessageReader, Step};
use crate::error::ReadError;
use crate::proto;
use crate::read::chunk_head::ChunkHead;
use crate::read::contents::{Channel, Schema};
use crate::read::decode::{self, StateLengths};
use crate::read::records::{RECORD_HEAD_BYTES, RecordReader};
use crate::read::salvage::{Candidate, Damage, DamageKind, describe, find, is_zero_from};
use crate::read::summary::SummarySection;
use mcap::records::op;
use std::ops::Range;
use std::sync::Arc;

/// Number of zeros at the end of a chunk with a wrong CRC, with only zeros after it, that mean that it was never fully
/// written.
const UNWRITTEN_BYTES: usize = 8;

impl MessageReader {
    /// Notes a damage and goes on after it. Without salvaging, or if the operating system refused, returns the error.
    pub(super) fn go_on_after(&mut self, error: ReadError) -> Result<Step, ReadError> {
        if self.salvage.is_none() || matches!(error, ReadError::Io { .. }) {
            return Err(error);
        }
        let what = describe(&error);
        if self.inner_left == 0 {
            self.note_in_chunk(DamageKind::Unreadable, what);
            self.in_chunk = false;
            return Ok(self.end());
        }
        let (start, end) = (self.record_start, self.records.position());
        if self.in_chunk {
            self.go_on_in_chunk(what);
        } else if end == start {
            return self.search(start, what);
        } else {
            match self.opcode {
                op::CHUNK => self.take_damaged_chunk(start, end - start, what)?,
                // a section's end, whose CRC is wrong
                0 => return Ok(self.end_of_section(&what)),
                _ => self.note(DamageKind::Record, start, end - start, what),
            }
        }
        Ok(Step::Other)
    }

    pub(super) fn end(&mut self) -> Step {
        if let Some(salvage) = &mut self.salvage {
            salvage.ended = true;
        }
        Step::End
    }

    /// Loads the chunk that has just been read at `offset`, if it is sound.
    pub(super) fn load_chunk(&mut self, offset: u64) -> Result<(), ReadError> {
        if let Some(salvage) = &mut self.salvage {
            salvage.layout.begin_chunk(offset, self.records.body());
        }
        self.chunk.load(offset, &mut self.records)?;
        self.contents.uncompressed_bytes += self.chunk.bytes();
        (self.in_chunk, self.is_checked) = (true, true);
        if let Some(salvage) = &mut self.salvage {
            // by its header rather than by the length of its record, which no CRC covers before the end
            salvage.sound_end = offset + RECORD_HEAD_BYTES + self.chunk.record_bytes();
            salvage.counts_lost = false;
        }
        Ok(())
    }

    pub(crate) fn note(&mut self, kind: DamageKind, offset_bytes: u64, length_bytes: u64, what: String) {
        self.note_with(Damage::at(kind, None, offset_bytes, length_bytes, what));
    }

    /// Notes something about the message read last.
    pub(crate) fn note_message(&mut self, what: String) {
        if self.in_chunk {
            self.note_in_chunk(DamageKind::Message, what);
        } else {
            self.note(DamageKind::Message, self.record_start, 0, what);
        }
    }

    /// Notes a damage somewhere in the chunk loaded last.
    fn note_in_chunk(&mut self, kind: DamageKind, what: String) {
        let chunk = self.chunk.next_number().checked_sub(1);
        self.note_with(Damage::at(kind, chunk, self.chunk.offset(), 0, what));
    }

    fn note_with(&mut self, damage: Damage) {
        if let Some(salvage) = &mut self.salvage {
            salvage.note(damage);
        }
    }

    /// Notes something about the file as a whole.
    pub(crate) fn note_about_file(&mut self, what: String) {
        self.note(DamageKind::Message, self.record_start, 0, what);
    }

    /// Notes that the file describes itself wrongly, which loses no message.
    pub(crate) fn note_descriptions(&mut self, wrong: Vec<String>) {
        for what in wrong {
            self.note(DamageKind::Description, self.record_start, 0, what);
        }
    }

    /// Number of damages.
    pub(crate) fn damage_count(&self) -> u64 {
        self.salvage.as_ref().map_or(0, |salvage| salvage.count())
    }

    /// Number of damages that may have lost something.
    pub(crate) fn loss_count(&self) -> u64 {
        self.salvage.as_ref().map_or(0, |salvage| salvage.count() - salvage.descriptions())
    }

    /// Goes on in a chunk after a record that is invalid or does not fit the others.
    fn go_on_in_chunk(&mut self, what: String) {
        // the records after one that leaves the chunk cannot be found
        self.in_chunk = !self.chunk.is_stuck();
        // a damaged chunk is expected to have such records
        if self.is_checked {
            self.note_in_chunk(DamageKind::Record, what);
        }
    }

    /// Takes the damaged chunk read last, whose contents are given unchecked.
    fn take_damaged_chunk(
        &mut self,
        offset_bytes: u64,
        length_bytes: u64,
        what: String,
    ) -> Result<(), ReadError> {
        let mut body = Vec::new();
        self.records.swap_body(&mut body);
        let end = self.records.position();
        let may_be_unwritten = !self.records.is_closed() && body.ends_with(&[0; UNWRITTEN_BYTES]);
        let was_never_whole = may_be_unwritten && is_zero_from(&mut self.records, end)?;
        let kind = if was_never_whole { DamageKind::Torn } else { DamageKind::Chunk };
        self.take_unchecked(kind, offset_bytes, length_bytes, what, &body)?;
        if let Some(salvage) = &mut self.salvage {
            salvage.counts_lost = true;
        }
        // what follows was looked at
        if may_be_unwritten { self.records.seek(end) } else { Ok(()) }
    }

    fn take_unchecked(
        &mut self,
        kind: DamageKind,
        offset_bytes: u64,
        length_bytes: u64,
        what: String,
        body: &[u8],
    ) -> Result<(), ReadError> {
        let chunk = Some(self.chunk.next_number());
        let time_range_ns = ChunkHead::parse(body).map(|head| head.time_range_ns);
        let damage = Damage::at(kind, chunk, offset_bytes, length_bytes, what);
        self.note_with(Damage { time_range_ns, ..damage });
        let loaded = self.chunk.load_unchecked(offset_bytes, body);
        self.in_chunk = loaded.map_err(ReadError::io(self.records.path()))?;
        self.is_checked = false;
        if let Some(salvage) = &mut self.salvage {
            salvage.sound_end = offset_bytes + RECORD_HEAD_BYTES;
            salvage.layout.forget_chunk();
        }
        Ok(())
    }

    /// Notes that the CRC of the data section or of the summary section is wrong.
    fn end_of_section(&mut self, what: &str) -> Step {
        let is_data = !self.contents.data_end;
        self.contents.data_end = true;
        let known = self.salvage.as_ref().is_some_and(|salvage| salvage.count() > 0);
        // a damaged chunk makes this CRC wrong, too
        if !(is_data && known) {
            let section = if is_data { "the data section" } else { "the summary section" };
            self.note(DamageKind::Section, self.record_start, 0, format!("the end of {section}: {what}"));
        }
        if is_data { Step::Other } else { self.end() }
    }

    /// Looks for the next chunk whose CRC holds, or for the end, because there is no record at `bad`.
    fn search(&mut self, bad: u64, what: String) -> Result<Step, ReadError> {
        if self.contents.data_end {
            let left = self.records.file_bytes() - bad;
            self.note(DamageKind::Unreadable, bad, left, format!("the summary section: {what}"));
            return Ok(self.end());
        }
        let mut from = self.salvage.as_ref().map_or(bad, |salvage| salvage.sound_end.min(bad));
        if !self.spend(0) {
            return self
                .take_tail(bad, format!("{what}; there was too much damage before to look any further"));
        }
        while let Some(candidate) = find(&mut self.records, from, bad)? {
            match candidate {
                Candidate::End { offset } => {
                    self.note_gap(bad, offset, what);
                    return self.go_on_at(offset, offset + 1);
                }
                Candidate::Chunk { offset, head } => {
                    self.records.read_chunk(offset + RECORD_HEAD_BYTES, head.record_bytes())?;
                    match self.load_chunk(offset) {
                        Ok(()) => {
                            self.note_gap(bad, offset, what);
                            let end = offset + RECORD_HEAD_BYTES + head.record_bytes();
                            return self.go_on_at(end, end);
                        }
                        Err(error @ ReadError::Io { .. }) => return Err(error),
                        Err(_) if self.spend(head.record_bytes() + head.uncompressed_bytes) => {}
                        Err(_) => break,
                    }
                    if let Some(salvage) = &mut self.salvage {
                        salvage.layout.forget_chunk();
                    }
                    from = offset + 1;
                }
            }
        }
        self.take_tail(bad, what)
    }

    fn spend(&mut self, bytes: u64) -> bool {
        self.salvage.as_mut().is_some_and(|salvage| salvage.spend(bytes))
    }

    fn go_on_at(&mut self, offset: u64, sound_end: u64) -> Result<Step, ReadError> {
        if let Some(salvage) = &mut self.salvage {
            salvage.sound_end = sound_end;
        }
        self.records.seek(offset)?;
        Ok(Step::Other)
    }

    /// Notes that there are no records from `bad` to `next`, which may lie before it.
    fn note_gap(&mut self, bad: u64, next: u64, what: String) {
        let (from, bytes) = (bad.min(next), bad.abs_diff(next));
        let what = if bytes == 0 { format!("a wrong length of its record: {what}") } else { what };
        self.note(DamageKind::Unreadable, from, bytes, what);
    }

    /// Takes the rest of the file from `bad`, where no record follows: it may be the beginning of a chunk.
    fn take_tail(&mut self, bad: u64, what: String) -> Result<Step, ReadError> {
        let file_bytes = self.records.file_bytes();
        let left = file_bytes - bad;
        let kind = if self.records.is_closed() { DamageKind::Unreadable } else { DamageKind::Torn };
        if let Some(salvage) = &mut self.salvage {
            salvage.ended = true;
        }
        if is_zero_from(&mut self.records, bad)? {
            self.note(kind, bad, left, "nothing but zeros up to the end of the file".to_owned());
            return Ok(Step::Other);
        }
        let head = self.records.read_part(bad, RECORD_HEAD_BYTES)?;
        if head.first() != Some(&op::CHUNK) {
            self.note(kind, bad, left, what);
            return Ok(Step::Other);
        }
        let body_bytes = left.saturating_sub(RECORD_HEAD_BYTES);
        self.records.read_part(bad + RECORD_HEAD_BYTES, body_bytes)?;
        let mut body = Vec::new();
        self.records.swap_body(&mut body);
        let what = match ChunkHead::parse(&body) {
            Some(head) => format!("the file ends in it, after {body_bytes} of {} bytes", head.record_bytes()),
            None => what,
        };
        self.take_unchecked(kind, bad, left, what, &body)?;
        Ok(Step::Other)
    }

    /// Identifies a channel whose definition was in a damaged chunk: by the summary section, or by a message of it that
    /// is a state of this run. False if it stays unknown.
    pub(super) fn learn_channel(&mut self, id: u16, message: Range<usize>) -> bool {
        let Some(salvage) = &mut self.salvage else { return false };
        if !std::mem::replace(&mut salvage.asked_summary, true)
            && let Ok(mut records) = RecordReader::open(self.records.path())
            && let Some(known) = SummarySection::read(&mut records)
        {
            for (id, channel) in known.contents.channels {
                self.contents.channels.entry(id).or_insert(channel);
            }
        }
        if self.contents.channels.contains_key(&id) {
            return true;
        }
        let body = if self.in_chunk { self.chunk.buffer() } else { self.records.body() };
        let lengths = StateLengths::of(&self.manifest);
        let is_state = decode::is_canonical(body.get(message).unwrap_or_default(), lengths);
        if is_state {
            self.contents.channels.insert(id, state_channel());
        }
        is_state
    }
}

/// Our channel of states.
fn state_channel() -> Channel {
    let encoding = || "protobuf".to_owned();
    Channel {
        topic: proto::STATE.topic.to_owned(),
        message_encoding: encoding(),
        metadata: std::collections::BTreeMap::new(),
        schema: Arc::new(Schema {
            name: proto::STATE.message.to_owned(),
            encoding: encoding(),
            text: proto::STATE.descriptor.into(),
        }),
    }
}
