//! Reading on after damage: the notes about it, and the place in the file where reading goes on.

use crate::error::ReadError;
use crate::head;
use crate::read::chunk_head::ChunkHead;
use crate::read::records::{RECORD_HEAD_BYTES, RecordReader};
use crate::repair::layout::Layout;
use mcap::records::op;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// Largest number of damages that are kept; more are only counted.
pub const MOST_DAMAGES: usize = 100;

/// Bytes of a file that are searched together.
const WINDOW_BYTES: usize = 1 << 16;

/// Opcode, length and the header of a chunk, or the name of metadata.
const CANDIDATE_BYTES: usize = 9 + ChunkHead::MAX_BYTES;

/// Longest metadata that a search looks for.
const MAX_METADATA_BYTES: u64 = 1 << 16;

/// A damaged place in a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Damage {
    /// Kind of the damaged place.
    pub kind: DamageKind,
    /// Number of the chunk, from 0, if it is one or is in one.
    pub chunk: Option<u64>,
    /// Offset of the damage in the file.
    pub offset_bytes: u64,
    /// Length of the damage.
    pub length_bytes: u64,
    /// The expected and the found contents.
    pub what: String,
    /// Log times (ns) of the first and the last message, as the chunk's header has them.
    pub time_range_ns: Option<(u64, u64)>,
    /// Missing frames: between the last state before and the first one after the damage. Known once the latter is
    /// read.
    pub frames: Option<LostFrames>,
}

/// Kind of a damaged place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DamageKind {
    /// A whole chunk: its CRC, its compression, its header.
    Chunk,
    /// The file ends within a record.
    Torn,
    /// Bytes in which no record is found.
    Unreadable,
    /// A record, in or beside a chunk.
    Record,
    /// Somewhere in a section of the file, by the section's CRC.
    Section,
    /// A message with correct checksums and impossible contents.
    Message,
    /// The file's description of itself: an index, its statistics, a second manifest. No message is lost with it.
    Description,
}

/// Frames that a damaged place should have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LostFrames {
    /// The first one.
    pub from: u64,
    /// The last one; unknown where a file was cut off.
    pub to: Option<u64>,
}

/// Serialized as a pair.
impl Serialize for LostFrames {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.from, self.to).serialize(serializer)
    }
}

impl DamageKind {
    /// One word for programs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Chunk => "chunk",
            Self::Torn => "torn",
            Self::Unreadable => "unreadable",
            Self::Record => "record",
            Self::Section => "section",
            Self::Message => "message",
            Self::Description => "description",
        }
    }
}

impl Damage {
    /// Makes a damage with the facts that are known at first.
    pub(crate) fn at(
        kind: DamageKind,
        chunk: Option<u64>,
        offset_bytes: u64,
        length_bytes: u64,
        what: String,
    ) -> Self {
        Self { kind, chunk, offset_bytes, length_bytes, what, time_range_ns: None, frames: None }
    }
}

impl fmt::Display for Damage {
    /// Writes the damage without its frames.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(chunk) = self.chunk {
            write!(f, "chunk {chunk} ")?;
        }
        match self.length_bytes {
            0 => write!(f, "at byte {}: {}", self.offset_bytes, self.what),
            length => write!(f, "at byte {}, {length} bytes: {}", self.offset_bytes, self.what),
        }
    }
}

/// The state of a reader that goes on after damage.
#[derive(Debug)]
pub(crate) struct Salvage {
    damages: Vec<Damage>,
    count: u64,
    /// Number of damages that concern only the file's description of itself.
    descriptions: u64,
    /// The summary section that the file must have.
    pub(crate) layout: Layout,
    /// Offset up to which everything was read, or cannot be read.
    pub(crate) sound_end: u64,
    /// Bytes that searches, and candidates that prove not to be chunks, may still read and decompress.
    work_bytes: u64,
    /// True if nothing more comes.
    pub(crate) ended: bool,
    /// True if the last chunk was damaged, so that its message indexes count the lost messages.
    pub(crate) counts_lost: bool,
    /// Messages of damaged chunks, by the number of the channel, as far as indexes count them.
    pub(crate) lost: BTreeMap<u16, u64>,
    /// True if the channels of the summary section were looked for.
    pub(crate) asked_summary: bool,
}

impl Salvage {
    /// Makes one after the head of a file of `file_bytes`.
    pub(crate) fn new(sound_end: u64, file_bytes: u64) -> Self {
        Self {
            damages: Vec::new(),
            count: 0,
            descriptions: 0,
            layout: Layout::default(),
            sound_end,
            // so that a file full of false chunks costs no more than a few times its size
            work_bytes: file_bytes.saturating_mul(2).saturating_add(64 << 20),
            ended: false,
            counts_lost: false,
            lost: BTreeMap::new(),
            asked_summary: false,
        }
    }

    pub(crate) fn note(&mut self, damage: Damage) {
        self.count += 1;
        self.descriptions += u64::from(damage.kind == DamageKind::Description);
        if self.damages.len() < MOST_DAMAGES {
            self.damages.push(damage);
        }
    }

    pub(crate) fn damages(&self) -> &[Damage] {
        &self.damages
    }

    pub(crate) fn damages_mut(&mut self) -> &mut [Damage] {
        &mut self.damages
    }

    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    pub(crate) fn descriptions(&self) -> u64 {
        self.descriptions
    }

    /// Pays for a search, or for reading a false chunk; false if too much was spent already.
    pub(crate) fn spend(&mut self, bytes: u64) -> bool {
        let left = self.work_bytes.checked_sub(bytes.saturating_add(WINDOW_BYTES as u64));
        self.work_bytes = left.unwrap_or(0);
        left.is_some()
    }

    /// Counts the messages that the message index `body` of a damaged chunk names.
    pub(crate) fn count_lost(&mut self, body: &[u8]) {
        const ENTRY_BYTES: usize = 16;
        if let Some((channel, entries)) = body.split_first_chunk::<2>() {
            let count = entries.len().saturating_sub(4) / ENTRY_BYTES;
            *self.lost.entry(u16::from_le_bytes(*channel)).or_insert(0) += count as u64;
        }
    }
}

/// A place where reading may go on.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Candidate {
    /// A place that looks like a chunk record.
    Chunk { offset: u64, head: ChunkHead },
    /// A place that looks like the metadata of the end.
    End { offset: u64 },
}

/// The first place at or after `from` where a chunk or the end may be. The record at `bad` may have a wrong length.
pub(crate) fn find(records: &mut RecordReader, from: u64, bad: u64) -> Result<Option<Candidate>, ReadError> {
    let file_bytes = records.file_bytes();
    let mut start = from;
    loop {
        let window = records.read_part(start, WINDOW_BYTES as u64)?;
        let is_last = start + window.len() as u64 >= file_bytes;
        let places = if is_last { window.len() } else { window.len().saturating_sub(CANDIDATE_BYTES) };
        for place in 0..places {
            let bytes = window.get(place..).unwrap_or_default();
            if let Some(found) = candidate(bytes, start + place as u64, bad, file_bytes) {
                return Ok(Some(found));
            }
        }
        if is_last || places == 0 {
            return Ok(None);
        }
        start += places as u64;
    }
}

/// The record that may begin with `bytes`, which the file has from `offset` on.
fn candidate(bytes: &[u8], offset: u64, bad: u64, file_bytes: u64) -> Option<Candidate> {
    let opcode = bytes.first()?;
    if ![op::CHUNK, op::METADATA].contains(opcode) {
        return None;
    }
    let (length, body) = bytes.get(1..)?.split_first_chunk::<8>()?;
    let length = u64::from_le_bytes(*length);
    let fits = |length: u64| length <= file_bytes.saturating_sub(offset + RECORD_HEAD_BYTES);
    if *opcode == op::METADATA {
        let name = u32::try_from(head::END.len()).ok()?.to_le_bytes();
        let is_end = body.strip_prefix(&name)?.starts_with(head::END.as_bytes());
        return (is_end && length <= MAX_METADATA_BYTES && fits(length)).then_some(Candidate::End { offset });
    }
    let head = ChunkHead::parse(body)?;
    let is_plausible = (length == head.record_bytes() || offset == bad) && fits(head.record_bytes());
    (is_plausible && head.crc != 0 && head.uncompressed_bytes > 0)
        .then_some(Candidate::Chunk { offset, head })
}

/// True if only zeros follow `from`, as some file systems leave it after a power failure.
pub(crate) fn is_zero_from(records: &mut RecordReader, from: u64) -> Result<bool, ReadError> {
    let mut start = from;
    loop {
        let window = records.read_part(start, WINDOW_BYTES as u64)?;
        if window.is_empty() {
            return Ok(true);
        }
        if window.iter().any(|byte| *byte != 0) {
            return Ok(false);
        }
        start += window.len() as u64;
    }
}

/// The message of an error about a file, without its path.
pub(crate) fn describe(error: &ReadError) -> String {
    match error {
        ReadError::Crc { found, computed, .. } => {
            format!("its CRC is {computed:08x} instead of {found:08x}")
        }
        ReadError::Damaged { what, .. } | ReadError::NotBeadline { what, .. } => what.clone(),
        other => other.to_string(),
    }
}
