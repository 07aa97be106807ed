//! One chunk: decompressed, checked, and taken apart.

use crate::error::ReadError;
use crate::read::ahead::Ahead;
use crate::read::chunk_head::{ChunkHead, decompress};
use crate::read::parse::parse_record;
use crate::read::records::{RecordReader, check_crc, chunk_header_bytes};
use mcap::records::{Record, op};
use schemas::manifest::RunManifest;
use std::io::{self, Read};
use std::ops::Range;
use std::path::Path;

/// Largest chunk, before compression, that is read unless a state is larger: our writer closes one after 1 MiB.
const MOST_CHUNK_BYTES: u64 = 64 << 20;

/// The records of the current chunk. Keeps its buffer from chunk to chunk.
#[derive(Default)]
pub(crate) struct Chunk {
    /// Offset of the chunk record in the file.
    offset: u64,
    /// Number of the chunk in the file, from 0.
    number: u64,
    /// The whole chunk record if it is not compressed, so that nothing is copied.
    buffer: Vec<u8>,
    /// Length of the chunk record without opcode and length.
    record_bytes: u64,
    /// Start of the records in the buffer.
    start: usize,
    /// Start of the next record in the buffer.
    next: usize,
    /// End of the records in the buffer.
    end: usize,
    zstd: zstd::bulk::Decompressor<'static>,
    /// Size of the largest chunk that is decompressed.
    most_bytes: u64,
    pub(crate) ahead: Ahead,
}

/// A record in a chunk, by its place in the buffer.
#[derive(Debug, Clone)]
pub(crate) struct Inner {
    pub(crate) opcode: u8,
    pub(crate) body: Range<usize>,
}

impl Chunk {
    /// Makes an empty one for a recording of the run `manifest`. A state of that run may have a chunk to itself,
    /// however large it is.
    pub(crate) fn of_run(manifest: &RunManifest) -> Self {
        let two_states = 16 * manifest.frame_doubles() as u64;
        let most_bytes = MOST_CHUNK_BYTES.max(two_states); // integers
        Self { most_bytes, ahead: Ahead::within(most_bytes), ..Self::default() }
    }

    /// Replaces the contents by those of the chunk record that `records` has just read at `offset`.
    pub(crate) fn load(&mut self, offset: u64, records: &mut RecordReader) -> Result<(), ReadError> {
        let path = records.path();
        let damaged = |what: String| ReadError::damaged(path, offset, what);
        let Ok(Record::Chunk { header, data }) = parse_record(op::CHUNK, records.body()) else {
            return Err(damaged("a chunk record without a chunk header".into()));
        };
        let computed = match header.compression.as_str() {
            "" => {
                self.start = chunk_header_bytes(records.body());
                self.end = self.start + data.len();
                self.next = self.start;
                // later versions of MCAP may add fields after the records
                let only_records = self.end == records.body().len();
                if only_records { records.chunk_crc() } else { crc32fast::hash(&data) }
            }
            "zstd" => {
                let found = self.decompress(offset, &data, header.uncompressed_size, records);
                found.map_err(|error| match error.kind() {
                    // of the machine, not of the file
                    io::ErrorKind::OutOfMemory => ReadError::io(path)(error),
                    _ => damaged(error.to_string()),
                })?
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
        self.record_bytes = chunk_header_bytes(records.body()) as u64 + header.compressed_size;
        if header.compression.is_empty() {
            records.swap_body(&mut self.buffer);
        } else {
            self.ahead.request_next(offset, header.uncompressed_size, records);
        }
        Ok(())
    }

    /// Takes the records from the thread that reads ahead, or decompresses them here. Returns their CRC.
    fn decompress(&mut self, offset: u64, data: &[u8], size: u64, records: &RecordReader) -> io::Result<u32> {
        let head = ChunkHead::parse(records.body());
        let ready = head.and_then(|head| self.ahead.take(offset, &head, records, &mut self.buffer));
        let crc = if let Some(crc) = ready {
            crc
        } else {
            decompress(&mut self.zstd, data, size, self.most_bytes, &mut self.buffer)?;
            crc32fast::hash(&self.buffer)
        };
        (self.start, self.next, self.end) = (0, 0, self.buffer.len());
        Ok(crc)
    }

    /// Replaces the contents by as much as can be read of the chunk record `body`, which may be damaged or end early:
    /// the bytes that are there, or with zstd everything before the first byte that cannot be decompressed.
    /// No checksum proves any of it. False if nothing can be read.
    ///
    /// # Errors
    /// When there is no memory for it.
    pub(crate) fn load_unchecked(&mut self, offset: u64, body: &[u8]) -> io::Result<bool> {
        self.buffer.clear();
        if let Some(head) = ChunkHead::parse(body) {
            let data = body.get(head.bytes..).unwrap_or_default();
            let data =
                usize::try_from(head.compressed_bytes).ok().and_then(|end| data.get(..end)).unwrap_or(data);
            if head.is_compressed {
                stream(data, self.most_bytes, &mut self.buffer)?;
            } else {
                self.buffer.try_reserve(data.len())?;
                self.buffer.extend_from_slice(data);
            }
        }
        (self.start, self.next, self.end) = (0, 0, self.buffer.len());
        (self.offset, self.number) = (offset, self.number + 1);
        Ok(!self.buffer.is_empty())
    }

    /// True if the next record cannot be taken.
    pub(crate) fn is_stuck(&self) -> bool {
        take_record(self.buffer.get(self.next..self.end).unwrap_or_default()).is_none()
    }

    /// Length of the chunk record according to its header.
    pub(crate) fn record_bytes(&self) -> u64 {
        self.record_bytes
    }

    /// Number of the chunk that is loaded next, from 0.
    pub(crate) fn next_number(&self) -> u64 {
        self.number
    }

    /// Offset of the chunk in the file.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// Sets the number of the chunk that is loaded next.
    pub(crate) fn expect(&mut self, number: u64) {
        self.number = number;
        self.ahead.jump();
    }

    /// Goes back to the first record.
    pub(crate) fn rewind(&mut self) {
        self.next = self.start;
    }

    /// Bytes of the records that were not taken yet.
    pub(crate) fn bytes(&self) -> u64 {
        self.end.saturating_sub(self.next) as u64
    }

    /// The next record.
    pub(crate) fn next(&mut self, path: &Path) -> Result<Option<Inner>, ReadError> {
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

    /// Distance of the byte `at` of the buffer from the first record.
    pub(crate) fn place_of(&self, at: usize) -> u64 {
        at.saturating_sub(self.start) as u64
    }

    /// The buffer to which the places of records refer.
    pub(crate) fn buffer(&self) -> &[u8] {
        &self.buffer
    }
}

/// Decompresses `data` as far as it goes, to at most `most_bytes`.
fn stream(data: &[u8], most_bytes: u64, buffer: &mut Vec<u8>) -> io::Result<()> {
    let mut decoder = zstd::stream::read::Decoder::with_buffer(data)?.take(most_bytes);
    let mut part = vec![0; 1 << 17];
    while let Ok(count @ 1..) = decoder.read(&mut part) {
        buffer.try_reserve(count)?;
        buffer.extend_from_slice(part.get(..count).unwrap_or_default());
    }
    Ok(())
}

/// The record at the beginning of `bytes`, if it is whole.
fn take_record(bytes: &[u8]) -> Option<Inner> {
    let (head, rest) = bytes.split_first_chunk::<9>()?;
    let [opcode, length @ ..] = *head;
    let length = usize::try_from(u64::from_le_bytes(length)).ok()?;
    (length <= rest.len()).then(|| Inner { opcode, body: 9..9 + length })
}
