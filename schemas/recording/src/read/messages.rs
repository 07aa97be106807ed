//! The messages of a recording in the order of the file, and the other contents of the file.

mod going_on;
#[cfg(test)]
mod tests;

use crate::PROFILE;
use crate::error::ReadError;
use crate::head;
use crate::read::chunk::{Chunk, Inner};
use crate::read::chunk_head::ChunkHead;
use crate::read::contents::{Channel, Contents, PRIVATE, parse_metadata};
use crate::read::index::ChunkPlace;
use crate::read::parse::parse_record;
use crate::read::records::{RECORD_HEAD_BYTES, RawRecord, RecordReader};
use crate::read::salvage::{Damage, Salvage};
use mcap::records::{MessageHeader, Record, op};
use schemas::frame::EndReason;
use schemas::manifest::RunManifest;
use std::ops::Range;
use std::path::Path;

/// Reads the messages of a file. Memory is bounded by two chunks, compressed and decompressed: while
/// one chunk of a compressed file is read, the next one is decompressed.
pub(crate) struct MessageReader {
    records: RecordReader,
    chunk: Chunk,
    in_chunk: bool,
    /// True if a part of the file before was skipped.
    sought: bool,
    /// Number of further records that chunks may hold: each takes some bytes of the file, if only in an index.
    inner_left: u64,
    /// Size before compression of the largest chunk that is read.
    most_expanded: u64,
    contents: Contents,
    manifest: RunManifest,
    /// Offset of the record read last.
    record_start: u64,
    /// Its opcode, 0 while that is not known.
    opcode: u8,
    /// True if the chunk's CRC holds.
    is_checked: bool,
    /// State of a reader that goes on after damage; none if the reader does not go on.
    salvage: Option<Box<Salvage>>,
    /// The message read last.
    last: Option<Place>,
}

/// A message, lent until the next call.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RawMessage<'a> {
    /// Its channel by number, sequence and times (ns).
    pub(crate) head: MessageHeader,
    pub(crate) channel: &'a Channel,
    pub(crate) data: &'a [u8],
    /// Offset of the chunk or record in the file.
    pub(crate) offset: u64,
    /// True if no checksum is known to be wrong. Otherwise the message may be anything.
    pub(crate) is_checked: bool,
}

/// Place of a message, before it is lent.
#[derive(Debug, Clone)]
struct Place {
    head: MessageHeader,
    data: Range<usize>,
    offset: u64,
}

/// Records that chunks may hold beyond one for each byte of the file.
const SPARE_RECORDS: u64 = 1 << 20;

/// Channel, sequence, log and publish time.
const MESSAGE_HEAD_BYTES: usize = 2 + 4 + 8 + 8;

impl MessageReader {
    /// Opens the recording `path` and reads its manifest.
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        Self::of(RecordReader::open(path)?)
    }

    /// Makes a reader of `records`, which is at its first record, and reads the manifest.
    pub(crate) fn of(records: RecordReader) -> Result<Self, ReadError> {
        let messages = Self::glance(records)?;
        let wrong = |source| ReadError::Manifest { path: messages.path().to_owned(), source };
        messages.manifest.check_whole().map_err(wrong)?;
        Ok(messages)
    }

    /// Like [`of`](Self::of), for a caller that computes nothing: see [`RunManifest::glance`].
    pub(crate) fn glance(mut records: RecordReader) -> Result<Self, ReadError> {
        let path = &records.path().to_owned();
        check_profile(path, records.next()?)?;
        let manifest = match records.next()? {
            Some(RawRecord { opcode: op::METADATA, body, offset }) => {
                let metadata = parse_metadata(path, offset, body)?;
                Some(metadata).filter(|metadata| metadata.name == head::RUN)
            }
            _ => None,
        };
        let manifest = manifest.ok_or_else(|| ReadError::NotBeadline {
            path: path.to_owned(),
            what: format!("its first record is not the metadata `{}`", head::RUN),
        })?;
        let manifest = head::read_run(path, &manifest)?;
        Ok(Self {
            chunk: Chunk::of_run(&manifest),
            manifest,
            inner_left: records.file_bytes().saturating_add(SPARE_RECORDS),
            most_expanded: u64::MAX,
            records,
            in_chunk: false,
            sought: false,
            contents: Contents::default(),
            record_start: 0,
            opcode: 0,
            is_checked: true,
            salvage: None,
            last: None,
        })
    }

    /// Opens the recording `path` to read as much of it as possible, however damaged it is after its manifest.
    /// Damage is noted, see [`damages`](Self::damages), and reading goes on after it; only an error of the
    /// operating system ends it. Takes time in proportion to the size of the file.
    pub(crate) fn salvaging(path: &Path) -> Result<Self, ReadError> {
        let mut messages = Self::open(path)?;
        let records = &messages.records;
        let mut salvage = Box::new(Salvage::new(records.position(), records.file_bytes()));
        // the manifest was read last
        let run = records.body();
        let offset = records.position() - RECORD_HEAD_BYTES - run.len() as u64;
        salvage.layout.take(offset, op::METADATA, run);
        messages.salvage = Some(salvage);
        Ok(messages)
    }

    /// The first damages found so far by a reader that goes on.
    pub(crate) fn damages(&self) -> &[Damage] {
        self.salvage.as_ref().map(|salvage| salvage.damages()).unwrap_or_default()
    }

    /// The state of a reader that goes on after damage.
    pub(crate) fn salvage(&mut self) -> Option<&mut Salvage> {
        self.salvage.as_deref_mut()
    }

    /// Reads chunks up to `most_bytes` before compression, and no more.
    pub(crate) fn expanding_to(self, most_bytes: u64) -> Self {
        Self { most_expanded: most_bytes, ..self }
    }

    pub(crate) fn path(&self) -> &Path {
        self.records.path()
    }

    pub(crate) fn file_bytes(&self) -> u64 {
        self.records.file_bytes()
    }

    pub(crate) fn manifest(&self) -> &RunManifest {
        &self.manifest
    }

    pub(crate) fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Takes the reader apart, for reading on by other means.
    pub(crate) fn into_parts(self) -> (RecordReader, Contents, RunManifest) {
        (self.records, self.contents, self.manifest)
    }

    /// True if the file was closed properly; known at its end.
    pub(crate) fn is_finished(&self) -> bool {
        self.records.is_closed() && self.contents.data_end && self.contents.end.is_some()
    }

    /// Why no more messages come; known at the end.
    pub(crate) fn end_reason(&self) -> EndReason {
        let end = self.contents.end.as_ref().filter(|_| self.is_finished());
        end.map_or(EndReason::Unfinished, |end| end.reason)
    }

    /// Fails if there is no channel of `topic`; known at the end.
    pub(crate) fn check_has(&self, topic: &'static str) -> Result<(), ReadError> {
        if self.contents.channels.values().any(|channel| channel.topic == topic) {
            return Ok(());
        }
        let (path, found) = (self.path().to_owned(), self.contents.topics());
        Err(ReadError::NoChannel { path, topic, found })
    }

    /// Goes on reading at `place`. `known` has the channels known to be defined before it; messages of other channels
    /// are then passed over.
    pub(crate) fn seek(&mut self, place: ChunkPlace, known: &Contents) -> Result<(), ReadError> {
        self.sought = true;
        // whoever goes back and forth reads them again
        self.inner_left = self.records.file_bytes().saturating_add(SPARE_RECORDS);
        self.contents.learn(known);
        (self.contents.data_end, self.contents.end) = (false, None);
        if self.in_chunk && self.chunk.offset() == place.offset {
            self.chunk.rewind();
            return Ok(());
        }
        self.in_chunk = false;
        self.chunk.expect(place.number);
        self.records.seek(place.offset)
    }

    /// Announces the bytes of the file that will be read, and whether more may follow after them.
    pub(crate) fn expect(&mut self, bytes: Range<u64>, and_more: bool) {
        self.records.expect(bytes, and_more);
    }

    /// The next message of any channel; none at the end or where an unfinished file is torn.
    pub(crate) fn next(&mut self) -> Result<Option<RawMessage<'_>>, ReadError> {
        loop {
            match self.step().or_else(|error| self.go_on_after(error))? {
                Step::Message(place) => {
                    self.last = Some(place.clone());
                    return self.lend(place).map(Some);
                }
                Step::Other => {}
                Step::End => return Ok(None),
            }
        }
    }

    /// The message that [`next`](Self::next) lent last, again.
    pub(crate) fn last(&self) -> Option<RawMessage<'_>> {
        self.last.clone().and_then(|place| self.lend(place).ok())
    }

    fn step(&mut self) -> Result<Step, ReadError> {
        let step = if self.in_chunk { self.next_in_chunk()? } else { self.next_in_file()? };
        if let Step::Message(Place { head, data, offset }) = &step
            && !self.contents.channels.contains_key(&head.channel_id)
            && !self.learn_channel(head.channel_id, data.clone())
        {
            if self.sought {
                // defined in a chunk that was not read
                return Ok(Step::Other);
            }
            let what = format!("a message of the unknown channel {}", head.channel_id);
            return Err(ReadError::damaged(self.path(), *offset, what));
        }
        Ok(step)
    }

    /// Reads up to the first chunk: the attachment with the configuration comes before it.
    pub(crate) fn read_head(&mut self) -> Result<(), ReadError> {
        // a search after damage has loaded the chunk that it found
        while !self.in_chunk && self.records.peek() != Some(op::CHUNK) {
            match self.next_in_file().or_else(|error| self.go_on_after(error))? {
                Step::Other => {}
                Step::Message(_) | Step::End => break,
            }
        }
        Ok(())
    }

    fn next_in_chunk(&mut self) -> Result<Step, ReadError> {
        let path = self.records.path();
        let Some(inner) = self.chunk.next(path)? else {
            self.in_chunk = false;
            return Ok(Step::Other);
        };
        let Inner { opcode, body: place } = inner;
        let Some(left) = self.inner_left.checked_sub(1) else {
            let what = "its chunks claim more records than a file of this size can hold";
            return Err(ReadError::damaged(path, self.chunk.offset(), what));
        };
        self.inner_left = left;
        let start = place.start;
        let body = self.chunk.buffer().get(place).unwrap_or_default();
        let offset = self.chunk.offset();
        match opcode {
            op::MESSAGE => {
                let place = message(path, offset, body)?;
                if let Some(salvage) = self.salvage.as_mut().filter(|_| self.is_checked) {
                    let at = self.chunk.place_of(start).saturating_sub(RECORD_HEAD_BYTES);
                    salvage.layout.message(place.head.channel_id, place.head.log_time, at);
                }
                Ok(Step::Message(place.within(start)))
            }
            op::SCHEMA | op::CHANNEL => {
                self.contents.define(path, offset, opcode, body)?;
                Ok(Step::Other)
            }
            PRIVATE.. if self.is_checked => {
                self.contents.others.lost.insert(format!("private records `{opcode:#04x}` in chunks"));
                Ok(Step::Other)
            }
            _ => Ok(Step::Other),
        }
    }

    fn next_in_file(&mut self) -> Result<Step, ReadError> {
        if self.salvage.as_ref().is_some_and(|salvage| salvage.ended) {
            return Ok(Step::End);
        }
        let path = self.records.path().to_owned();
        (self.record_start, self.opcode) = (self.records.position(), 0);
        let Some(RawRecord { opcode, offset, body }) = self.records.next()? else {
            return self.end_of_records();
        };
        self.opcode = opcode;
        if self.salvage.is_some() && !is_expected(opcode, body, self.contents.data_end) {
            let what = format!("a record of kind {opcode:#04x}, {} bytes, which none is there", body.len());
            self.records.seek(offset)?;
            return Err(ReadError::damaged(&path, offset, what));
        }
        if let Some(salvage) = self.salvage.as_mut().filter(|_| !self.contents.data_end) {
            let wrong = match opcode {
                op::CHUNK => salvage.layout.close_chunk(),
                _ => salvage.layout.take(offset, opcode, body),
            };
            if opcode == op::MESSAGE_INDEX && salvage.counts_lost {
                salvage.count_lost(body);
            } else {
                self.note_descriptions(wrong);
            }
        }
        let body = self.records.body();
        match opcode {
            op::FOOTER => return Ok(self.end()),
            // the summary, which repeats what was read
            _ if self.contents.data_end => {}
            op::CHUNK => {
                let expanded = ChunkHead::parse(body).map_or(0, |head| head.uncompressed_bytes);
                if self.contents.uncompressed_bytes.saturating_add(expanded) > self.most_expanded {
                    let what = format!(
                        "a chunk with which its chunks are more than {} bytes before compression",
                        self.most_expanded
                    );
                    return Err(ReadError::damaged(&path, offset, what));
                }
                self.load_chunk(offset)?;
            }
            op::MESSAGE => return message(&path, offset, body).map(Step::Message),
            op::DATA_END => self.contents.data_end = true,
            op::MESSAGE_INDEX => {}
            _ => self.contents.define(&path, offset, opcode, body)?,
        }
        Ok(Step::Other)
    }

    /// Ends the file after the last record that can be read.
    fn end_of_records(&mut self) -> Result<Step, ReadError> {
        let left = self.records.file_bytes() - self.record_start;
        if self.salvage.is_some() && left > 0 {
            let what = "it ends within a record".to_owned();
            return Err(ReadError::damaged(self.path(), self.record_start, what));
        }
        Ok(self.end())
    }

    fn lend(&self, place: Place) -> Result<RawMessage<'_>, ReadError> {
        let Place { head, data, offset } = place;
        let channel_id = head.channel_id;
        let body = if self.in_chunk { self.chunk.buffer() } else { self.records.body() };
        let data = body.get(data).unwrap_or_default();
        let channel = self.contents.channels.get(&channel_id).ok_or_else(|| {
            ReadError::damaged(self.path(), offset, format!("a message of the unknown channel {channel_id}"))
        })?;
        Ok(RawMessage { head, channel, data, offset, is_checked: self.is_checked || !self.in_chunk })
    }
}

/// Result of reading on.
enum Step {
    Message(Place),
    Other,
    End,
}

impl Place {
    /// Turns a place in a record into one in the chunk; the record starts at `start`.
    fn within(self, start: usize) -> Self {
        Self { data: start + self.data.start..start + self.data.end, ..self }
    }
}

/// True if a record may stand in this place, in the data section or after it.
fn is_expected(opcode: u8, body: &[u8], data_end: bool) -> bool {
    match opcode {
        op::SCHEMA | op::CHANNEL | PRIVATE.. => true,
        op::MESSAGE | op::CHUNK | op::MESSAGE_INDEX | op::ATTACHMENT | op::METADATA => !data_end,
        op::DATA_END => !data_end && body.len() == 4,
        op::CHUNK_INDEX | op::ATTACHMENT_INDEX | op::STATISTICS | op::METADATA_INDEX | op::SUMMARY_OFFSET => {
            data_end
        }
        op::FOOTER => data_end && body.len() == 20,
        _ => false,
    }
}

fn check_profile(path: &Path, first: Option<RawRecord<'_>>) -> Result<(), ReadError> {
    let not_ours = |what: String| ReadError::NotBeadline { path: path.to_owned(), what };
    let header = first.filter(|record| record.opcode == op::HEADER);
    match header.map(|record| parse_record(record.opcode, record.body)) {
        Some(Ok(Record::Header(header))) if header.profile == PROFILE => Ok(()),
        Some(Ok(Record::Header(header))) => {
            Err(not_ours(format!("its profile is `{}` instead of `{PROFILE}`", header.profile)))
        }
        _ => Err(not_ours("it has no header".into())),
    }
}

/// The place of the contents in the message record `body`.
fn message(path: &Path, offset: u64, body: &[u8]) -> Result<Place, ReadError> {
    let head =
        message_head(body).ok_or_else(|| ReadError::damaged(path, offset, "a message without its header"))?;
    Ok(Place { head, data: MESSAGE_HEAD_BYTES..body.len(), offset })
}

fn message_head(body: &[u8]) -> Option<MessageHeader> {
    let (channel_id, rest) = body.split_first_chunk::<2>()?;
    let (sequence, rest) = rest.split_first_chunk::<4>()?;
    let (log_time, rest) = rest.split_first_chunk::<8>()?;
    let (publish_time, _) = rest.split_first_chunk::<8>()?;
    Some(MessageHeader {
        channel_id: u16::from_le_bytes(*channel_id),
        sequence: u32::from_le_bytes(*sequence),
        log_time: u64::from_le_bytes(*log_time),
        publish_time: u64::from_le_bytes(*publish_time),
    })
}
