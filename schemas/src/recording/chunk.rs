//! One chunk: decompressed, checked, and taken apart.

use super::error::ReadError;
use super::parse::parse_record;
use super::records::{MAX_RECORD_BYTES, RecordReader, check_crc, chunk_header_bytes};
use mcap::records::{Record, op};
use std::ops::Range;
use std::path::Path;

/// Most bytes that zstd makes of one: a block of 128 KiB takes 4 bytes at least. So what is reserved for a chunk is
/// bounded by what there is of it, and not by what it claims.
const MOST_COMPRESSED: u64 = 1 << 15;

/// The records of the current chunk. Keeps its buffer from chunk to chunk.
#[derive(Default)]
pub(super) struct Chunk {
    /// Of the chunk record in the file.
    offset: u64,
    /// Number of the chunk in the file, from 0.
    number: u64,
    /// The whole chunk record if it is not compressed, so that nothing is copied.
    buffer: Vec<u8>,
    /// Where in the buffer the next record starts.
    next: usize,
    /// Where in the buffer the records end.
    end: usize,
    zstd: zstd::bulk::Decompressor<'static>,
}

/// A record in a chunk, by its place in the buffer.
#[derive(Debug, Clone)]
pub(super) struct Inner {
    pub(super) opcode: u8,
    pub(super) body: Range<usize>,
}

impl Chunk {
    /// Replaces the contents by those of the chunk record that `records` has just read at `offset`.
    pub(super) fn load(&mut self, offset: u64, records: &mut RecordReader) -> Result<(), ReadError> {
        let path = records.path();
        let damaged = |what: String| ReadError::damaged(path, offset, what);
        let Ok(Record::Chunk { header, data }) = parse_record(op::CHUNK, records.body()) else {
            return Err(damaged("a chunk record without a chunk header".into()));
        };
        let computed = match header.compression.as_str() {
            "" => {
                self.next = chunk_header_bytes(records.body());
                self.end = self.next + data.len();
                // later versions of MCAP may add fields after the records
                let only_records = self.end == records.body().len();
                if only_records { records.chunk_crc() } else { crc32fast::hash(&data) }
            }
            "zstd" => {
                self.decompress(&data, header.uncompressed_size).map_err(damaged)?;
                crc32fast::hash(&self.buffer)
            }
            other => {
                return Err(ReadError::NotBeadline {
                    path: path.to_owned(),
                    what: format!("its chunks are compressed with `{other}` instead of zstd"),
                });
            }
        };
        if self.bytes() != header.uncompressed_size {
            let (found, expected) = (self.bytes(), header.uncompressed_size);
            return Err(damaged(format!("a chunk of {found} bytes instead of {expected}")));
        }
        let part = format!("chunk {} at byte {offset}", self.number);
        check_crc(path, &part, header.uncompressed_crc, computed)?;
        (self.offset, self.number) = (offset, self.number + 1);
        if header.compression.is_empty() {
            records.swap_body(&mut self.buffer);
        }
        Ok(())
    }

    fn decompress(&mut self, data: &[u8], size: u64) -> Result<(), String> {
        self.buffer.clear();
        let most = MAX_RECORD_BYTES.min(data.len() as u64 * MOST_COMPRESSED);
        let room = usize::try_from(size).ok().filter(|_| size <= most);
        if room.is_none_or(|room| self.buffer.try_reserve(room).is_err()) {
            return Err(format!(
                "a chunk of {size} bytes, more than {MAX_RECORD_BYTES}, than its {} bytes can hold or than there is memory",
                data.len()
            ));
        }
        self.zstd
            .decompress_to_buffer(data, &mut self.buffer)
            .map_err(|error| format!("a chunk that zstd cannot decompress: {error}"))?;
        (self.next, self.end) = (0, self.buffer.len());
        Ok(())
    }

    /// Offset of the chunk in the file.
    pub(super) fn offset(&self) -> u64 {
        self.offset
    }

    /// Size of what is left of the records in bytes: of all of them, before the first is taken.
    pub(super) fn bytes(&self) -> u64 {
        self.end.saturating_sub(self.next) as u64
    }

    /// The next record.
    pub(super) fn next(&mut self, path: &Path) -> Result<Option<Inner>, ReadError> {
        let rest = self.buffer.get(self.next..self.end).unwrap_or_default();
        if rest.is_empty() {
            return Ok(None);
        }
        let record = take_record(rest).ok_or_else(|| {
            let what = format!("a record that leaves its chunk, {} bytes before the end", rest.len());
            ReadError::damaged(path, self.offset, what)
        })?;
        let body = self.next + record.body.start..self.next + record.body.end;
        self.next = body.end;
        Ok(Some(Inner { opcode: record.opcode, body }))
    }

    /// What the places of records refer to.
    pub(super) fn buffer(&self) -> &[u8] {
        &self.buffer
    }
}

/// The record at the beginning of `bytes`, if it is whole.
fn take_record(bytes: &[u8]) -> Option<Inner> {
    let (head, rest) = bytes.split_first_chunk::<9>()?;
    let [opcode, length @ ..] = *head;
    let length = usize::try_from(u64::from_le_bytes(length)).ok()?;
    (length <= rest.len()).then(|| Inner { opcode, body: 9..9 + length })
}
