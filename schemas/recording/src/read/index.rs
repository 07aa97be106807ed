//! The places of a file's chunks, to find a state without reading the file up to it.
//!
//! Places are hints: a state is found by its step, and every chunk and message is checked when it is read, so a place
//! that is wrong by accident only costs time. A forged place may lead to bytes that look like chunks of the run,
//! in an attachment for example. Only reading the whole file shows that, as an [`Audit`](crate::Audit) does.

use crate::error::ReadError;
use crate::log_time_ns;
use crate::read::contents::Contents;
use crate::read::records::RecordReader;
use crate::read::summary::{next_of_summary, seek_summary};
use mcap::records::{ChunkIndex, Record, op};
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;
use storage::Reader;

/// Most places, 12 MiB of them; more are thinned out. A reader goes through everything between two of them.
const MOST_PLACES: usize = 1 << 19;

/// A place in a file where reading may begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ChunkPlace {
    /// Offset of a chunk record, or of the first record.
    pub(crate) offset: u64,
    /// Number of the next chunk from there on.
    pub(crate) number: u64,
    /// Smallest log time in that chunk (ns).
    start_ns: u64,
    /// End of that chunk, and of the chunks after it that have no place.
    end: u64,
    /// Largest log time in them (ns).
    end_ns: u64,
}

/// The places of a file in its order; at least the beginning of the file.
#[derive(Debug)]
pub(crate) struct Index {
    places: Vec<ChunkPlace>,
    /// The channels of the file, if it has a summary.
    pub(crate) known: Contents,
    /// Number of chunks from one place to the next.
    every: u64,
}

impl Index {
    /// Reads the index of the file `path`: from its summary section if it has a valid one, else from the headers of
    /// its chunks, which are not decompressed.
    pub(crate) fn read(path: &Path) -> Result<Self, ReadError> {
        let mut records = RecordReader::at_end(path)?;
        match Self::from_summary(&mut records) {
            Some(index) => Ok(index),
            None => Self::from_headers(path, records.file_bytes()).map_err(ReadError::io(path)),
        }
    }

    /// A reader of the file `path` at its first record; and the index if each stretch of the file costs a request. One
    /// request then brings everything that a reader of states begins with, up to the end of the first chunk.
    pub(crate) fn and_reader(path: &Path) -> Result<(Option<Self>, RecordReader), ReadError> {
        let mut records = RecordReader::at_end(path)?;
        let mut index = None;
        if records.is_remote() {
            index = Self::from_summary(&mut records);
            let first = index.as_ref().and_then(|index| Some(index.stretch(*index.places.get(1)?, 0)));
            records.expect(0..first.map_or(0, |first| first.end), true);
        }
        records.begin()?;
        Ok((index, records))
    }

    /// Makes an index with only the beginning of the file: a reader goes through the whole file.
    pub(crate) fn beginning() -> Self {
        let first =
            ChunkPlace { offset: mcap::MAGIC.len() as u64, number: 0, start_ns: 0, end: 0, end_ns: 0 };
        Self { places: vec![first], known: Contents::default(), every: 1 }
    }

    fn from_summary(records: &mut RecordReader) -> Option<Self> {
        let summary_start = seek_summary(records)?;
        let mut index = Self::beginning();
        let (mut chunks, mut statistics, mut end) = (0, None, 0);
        loop {
            match next_of_summary(records)? {
                Record::Footer(_) => break,
                Record::Statistics(found) => statistics = Some(found.chunk_count),
                Record::ChunkIndex(chunk) => {
                    end = checked_end(&chunk, end, summary_start)?;
                    let (offset, number) = (chunk.chunk_start_offset, chunks);
                    let (start_ns, end_ns) = (chunk.message_start_time, chunk.message_end_time);
                    index.add(ChunkPlace { offset, number, start_ns, end, end_ns });
                    chunks += 1;
                }
                record => index.known.add(record).ok()?,
            }
        }
        (statistics == u32::try_from(chunks).ok()).then_some(index)
    }

    /// Goes from record to record, as long as they are whole.
    fn from_headers(path: &Path, size: u64) -> io::Result<Self> {
        let mut file = Reader::with_buffer(path, 4096)?;
        let (mut index, mut chunks) = (Self::beginning(), 0);
        let mut offset = file.seek(SeekFrom::Start(mcap::MAGIC.len() as u64))?;
        // opcode, length, and of a chunk its smallest log time
        while size.saturating_sub(offset) >= 9 + 8 {
            let mut head = [0; 9 + 8];
            file.read_exact(&mut head)?;
            let [opcode, l0, l1, l2, l3, l4, l5, l6, l7, start_ns @ ..] = head;
            let length = u64::from_le_bytes([l0, l1, l2, l3, l4, l5, l6, l7]);
            let next = offset.saturating_add(9).saturating_add(length);
            if next > size || opcode == 0 || opcode == op::DATA_END {
                break;
            }
            if opcode == op::CHUNK {
                let start_ns = u64::from_le_bytes(start_ns);
                index.add(ChunkPlace { offset, number: chunks, start_ns, end: next, end_ns: u64::MAX });
                chunks += 1;
            }
            // both are within the file, so the difference fits
            file.seek_relative(next.wrapping_sub(offset + 9 + 8).cast_signed())?;
            offset = next;
        }
        Ok(index)
    }

    /// Adds a chunk; if there are too many, every second is dropped.
    fn add(&mut self, place: ChunkPlace) {
        let add_to = |kept: &mut ChunkPlace, other: &ChunkPlace| {
            (kept.end, kept.end_ns) = (other.end, kept.end_ns.max(other.end_ns)); // integers
        };
        if self.places.len() == MOST_PLACES {
            self.every *= 2;
            let every = self.every;
            self.places.dedup_by(|place, kept| {
                let is_dropped = !place.number.is_multiple_of(every);
                if is_dropped {
                    add_to(kept, place);
                }
                is_dropped
            });
        }
        match self.places.last_mut() {
            Some(kept) if !place.number.is_multiple_of(self.every) => add_to(kept, &place),
            _ => self.places.push(place),
        }
    }

    /// The bytes from `place` up to the end of the chunk with the first state at or after the time `until_ns`, by the log times
    /// of the chunks.
    pub(crate) fn stretch(&self, place: ChunkPlace, until_ns: u64) -> Range<u64> {
        let from = self.places.partition_point(|other| other.offset < place.offset);
        let later = self.places.get(from..).unwrap_or_default();
        let last = later.iter().find(|other| other.end_ns >= until_ns).or(later.last());
        place.offset..last.map_or(place.offset, |last| last.end)
    }

    /// Like [`stretch`](Self::stretch), from the beginning of the file on.
    pub(crate) fn stretch_from_the_beginning(&self, until_ns: u64) -> Range<u64> {
        self.places.first().map_or(0..0, |first| self.stretch(*first, until_ns))
    }

    /// The last place whose first state, as `first_step` finds it, is not after `step`; or the beginning. With correct
    /// log times the first try succeeds.
    pub(crate) fn find(
        &self,
        step: u64,
        time_s: f64,
        mut first_step: impl FnMut(ChunkPlace) -> Result<Option<u64>, ReadError>,
    ) -> Result<ChunkPlace, ReadError> {
        let time_ns = log_time_ns(time_s);
        let guess = self.places.iter().rposition(|place| place.start_ns <= time_ns).unwrap_or(0);
        if guess > 0 && is_before(first_step(self.places[guess])?, step) {
            return Ok(self.places[guess]);
        }
        // the beginning is at or before every step
        let (mut from, mut to) = (0, guess);
        while from + 1 < to {
            let middle = usize::midpoint(from, to);
            if is_before(first_step(self.places[middle])?, step) {
                from = middle;
            } else {
                to = middle;
            }
        }
        Ok(self.places[from])
    }
}

fn is_before(first_step: Option<u64>, step: u64) -> bool {
    first_step.is_some_and(|first| first <= step)
}

/// The end of a chunk that lies between `start` and `limit`.
fn checked_end(chunk: &ChunkIndex, start: u64, limit: u64) -> Option<u64> {
    let end = chunk.chunk_start_offset.checked_add(chunk.chunk_length)?;
    let in_order = chunk.chunk_start_offset >= start && end <= limit;
    (in_order && chunk.message_start_time <= chunk.message_end_time).then_some(end)
}
