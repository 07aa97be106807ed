//! One chunk: decompressed, checked, and taken apart.

use super::error::ReadError;
use super::records::{MAX_RECORD_BYTES, check_crc};
use mcap::records::Record;
use std::ops::Range;
use std::path::Path;

/// The records of the current chunk. Keeps its buffer from chunk to chunk.
#[derive(Default)]
pub(super) struct Chunk {
    /// Of the chunk record in the file.
    offset: u64,
    /// Number of the chunk in the file, from 0.
    number: u64,
    records: Vec<u8>,
    next: usize,
    zstd: zstd::bulk::Decompressor<'static>,
}

/// A record in a chunk, by its place in the chunk.
#[derive(Debug, Clone)]
pub(super) struct Inner {
    pub(super) opcode: u8,
    pub(super) body: Range<usize>,
}

impl Chunk {
    /// Replaces the contents by those of the chunk record `body` at `offset`.
    pub(super) fn load(&mut self, path: &Path, offset: u64, body: &[u8]) -> Result<(), ReadError> {
        let damaged = |what: String| ReadError::damaged(path, offset, what);
        let Ok(Record::Chunk { header, data }) = mcap::parse_record(mcap::records::op::CHUNK, body) else {
            return Err(damaged("a chunk record without a chunk header".into()));
        };
        self.offset = offset;
        self.records.clear();
        self.next = 0;
        let size = header.uncompressed_size;
        let room = usize::try_from(size).ok().filter(|_| size <= MAX_RECORD_BYTES);
        let room = room.filter(|room| self.records.try_reserve(*room).is_ok()).ok_or_else(|| {
            damaged(format!("a chunk of {size} bytes, more than {MAX_RECORD_BYTES} or than there is memory"))
        })?;
        match header.compression.as_str() {
            "" => self.records.extend_from_slice(&data),
            "zstd" => {
                self.zstd
                    .decompress_to_buffer(&data, &mut self.records)
                    .map_err(|error| damaged(format!("a chunk that zstd cannot decompress: {error}")))?;
            }
            other => {
                return Err(ReadError::NotBeadline {
                    path: path.to_owned(),
                    what: format!("its chunks are compressed with `{other}` instead of zstd"),
                });
            }
        }
        if self.records.len() != room {
            return Err(damaged(format!("a chunk of {} bytes instead of {size}", self.records.len())));
        }
        let part = format!("chunk {} at byte {offset}", self.number);
        self.number += 1;
        check_crc(path, &part, header.uncompressed_crc, crc32fast::hash(&self.records))
    }

    /// Offset of the chunk in the file.
    pub(super) fn offset(&self) -> u64 {
        self.offset
    }

    /// Size before compression in bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.records.len() as u64
    }

    /// The next record.
    pub(super) fn next(&mut self, path: &Path) -> Result<Option<Inner>, ReadError> {
        let rest = self.records.get(self.next..).unwrap_or_default();
        if rest.is_empty() {
            return Ok(None);
        }
        let record = take_record(rest).ok_or_else(|| {
            ReadError::damaged(path, self.offset, format!("a record that leaves its chunk at {}", self.next))
        })?;
        let body = self.next + record.body.start..self.next + record.body.end;
        self.next = body.end;
        Ok(Some(Inner { opcode: record.opcode, body }))
    }

    /// All records, that places refer to.
    pub(super) fn records(&self) -> &[u8] {
        &self.records
    }

    /// The bytes of a record.
    pub(super) fn body(&self, record: &Inner) -> &[u8] {
        self.records.get(record.body.clone()).unwrap_or_default()
    }
}

/// The record at the beginning of `bytes`, if it is whole.
fn take_record(bytes: &[u8]) -> Option<Inner> {
    let (head, rest) = bytes.split_first_chunk::<9>()?;
    let [opcode, length @ ..] = *head;
    let length = usize::try_from(u64::from_le_bytes(length)).ok()?;
    (length <= rest.len()).then(|| Inner { opcode, body: 9..9 + length })
}
