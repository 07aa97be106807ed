//! Reading on after damage: what is noted, and where in the file reading goes on.

use crate::error::ReadError;
use crate::head;
use crate::read::chunk::ChunkHead;
use crate::read::records::{RECORD_HEAD_BYTES, RecordReader};
use crate::repair::layout::Layout;
use mcap::records::op;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// The damages that are kept; more are only counted.
pub const MOST_DAMAGES: usize = 100;

/// Bytes of a file that are looked at together.
const WINDOW_BYTES: usize = 1 << 16;

/// Opcode, length and the header of a chunk, or the name of metadata.
const CANDIDATE_BYTES: usize = 9 + ChunkHead::MAX_BYTES;

/// Metadata longer than this is not looked for.
const MAX_METADATA_BYTES: u64 = 1 << 16;

/// A damaged place in a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Damage {
    /// What it is a place of.
    pub kind: DamageKind,
    /// Number of the chunk, from 0, if it is one or is in one.
    pub chunk: Option<u64>,
    /// Where it begins in the file.
    pub offset_bytes: u64,
    /// How long it is.
    pub length_bytes: u64,
    /// What was expected and found.
    pub what: String,
    /// Log times (ns) of the first and the last message, as the chunk's header has them.
    pub time_range_ns: Option<(u64, u64)>,
    /// Missing frames: between the last state before and the first one after it.
    /// Known once that is read.
    pub frames: Option<LostFrames>,
}

/// What is damaged.
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
    /// The file's description of itself: an index, its statistics, a second manifest. No message is
    /// lost with it.
    Description,
}

/// Frames that should be in a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LostFrames {
    /// The first one.
    pub from: u64,
    /// The last one; not known where a file was cut off.
    pub to: Option<u64>,
}

/// As a pair.
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
    /// What is known at first.
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
    /// Without the frames.
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

/// What a reader that goes on after damage keeps.
#[derive(Debug)]
pub(crate) struct Salvage {
    damages: Vec<Damage>,
    count: u64,
    /// How many of them concern only the file's description of itself.
    descriptions: u64,
    /// What the summary section must say.
    pub(crate) layout: Layout,
    /// Everything before was read, or cannot be.
    pub(crate) sound_end: u64,
    /// Bytes that searches, and candidates that prove not to be chunks, may still read and decompress.
    work_bytes: u64,
    /// Nothing more comes.
    pub(crate) ended: bool,
    /// The last chunk was damaged, and its message indexes count what is lost.
    pub(crate) counts_lost: bool,
    /// Messages of damaged chunks, by the number of the channel, as far as indexes count them.
    pub(crate) lost: BTreeMap<u16, u64>,
    /// The channels of the summary section were looked for.
    pub(crate) asked_summary: bool,
}

impl Salvage {
    /// Begins after the head of a file of `file_bytes`.
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
    /// What looks like a chunk record.
    Chunk { offset: u64, head: ChunkHead },
    /// What looks like the metadata of the end.
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

/// What may begin with `bytes`, which the file has from `offset` on.
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

/// Whether only zeros follow `from`, as some file systems leave it after a power failure.
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
