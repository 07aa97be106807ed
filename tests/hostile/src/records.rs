//! An MCAP file taken apart into its records, and put together again.

use std::collections::BTreeMap;

/// The first and the last bytes of a file.
pub const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', 0x0d, 0x0a];

/// Opcode and length.
const HEAD_BYTES: usize = 9;

/// Opcodes of the records that something here looks into.
pub mod op {
    #![allow(missing_docs, reason = "the names of the specification")]
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const CHUNK_INDEX: u8 = 0x08;
    pub const ATTACHMENT: u8 = 0x09;
    pub const ATTACHMENT_INDEX: u8 = 0x0a;
    pub const STATISTICS: u8 = 0x0b;
    pub const METADATA: u8 = 0x0c;
    pub const METADATA_INDEX: u8 = 0x0d;
    pub const SUMMARY_OFFSET: u8 = 0x0e;
    pub const DATA_END: u8 = 0x0f;
}

/// A record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Record {
    /// Which kind it is.
    pub opcode: u8,
    /// What stands after its length.
    pub body: Vec<u8>,
    /// Where it was in the file.
    pub offset: usize,
}

/// A file, or the contents of a chunk, as records.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parts {
    /// Whole records.
    pub records: Vec<Record>,
    /// Where the first of them was: after the magic of a file, 0 in a chunk.
    begin: usize,
    /// What follows the last whole record: the magic of a whole file.
    pub rest: Vec<u8>,
}

impl Parts {
    /// A file.
    pub fn of_file(bytes: &[u8]) -> Self {
        let begin = if bytes.starts_with(&MAGIC) { MAGIC.len() } else { 0 };
        Self::take_apart(bytes, begin)
    }

    /// The contents of a chunk.
    pub fn of_chunk(bytes: &[u8]) -> Self {
        Self::take_apart(bytes, 0)
    }

    fn take_apart(bytes: &[u8], begin: usize) -> Self {
        let mut records = Vec::new();
        let mut offset = begin;
        while let Some((opcode, length)) = head(bytes, offset) {
            let body = offset + HEAD_BYTES;
            records.push(Record { opcode, body: bytes[body..body + length].to_vec(), offset });
            offset = body + length;
            if opcode == op::FOOTER {
                break;
            }
        }
        Self { records, begin, rest: bytes[offset..].to_vec() }
    }

    /// The bytes again. What pointed to a record points to where it is now, and says how long it is now.
    pub fn put_together(&self) -> Vec<u8> {
        let mut moved = BTreeMap::new();
        let mut offset = self.begin;
        for record in &self.records {
            moved.entry(record.offset as u64).or_insert((offset as u64, record));
            offset += HEAD_BYTES + record.body.len();
        }
        let mut bytes = MAGIC[..self.begin].to_vec();
        for record in &self.records {
            let mut body = record.body.clone();
            if let Some(at) = pointer(record.opcode, body.len()) {
                let target = body[at..].first_chunk().map(|target| u64::from_le_bytes(*target));
                if let Some((target, of)) = target.and_then(|target| moved.get(&target)) {
                    body[at..at + 8].copy_from_slice(&target.to_le_bytes());
                    tell_lengths(record.opcode, &mut body[at + 8..], of);
                }
            }
            bytes.push(record.opcode);
            bytes.extend((body.len() as u64).to_le_bytes());
            bytes.extend(body);
        }
        bytes.extend(&self.rest);
        bytes
    }
}

/// Opcode and length of the record at `offset`, if it is whole.
fn head(bytes: &[u8], offset: usize) -> Option<(u8, usize)> {
    let (head, rest) = bytes.get(offset..)?.split_first_chunk::<HEAD_BYTES>()?;
    let [opcode, length @ ..] = *head;
    let length = usize::try_from(u64::from_le_bytes(length)).ok()?;
    (length <= rest.len()).then_some((opcode, length))
}

/// Where in a record of `length` bytes the offset of another one stands.
fn pointer(opcode: u8, length: usize) -> Option<usize> {
    let at = match opcode {
        op::FOOTER | op::ATTACHMENT_INDEX | op::METADATA_INDEX => 0,
        // after the times of its first and last message
        op::CHUNK_INDEX => 16,
        op::SUMMARY_OFFSET => 1,
        _ => return None,
    };
    (at + 8 <= length).then_some(at)
}

/// Puts the lengths of the record `of` into what stands after the pointer of an index to it.
fn tell_lengths(opcode: u8, after: &mut [u8], of: &Record) {
    if ![op::CHUNK_INDEX, op::METADATA_INDEX, op::ATTACHMENT_INDEX].contains(&opcode) {
        return;
    }
    if let Some(length) = after.first_chunk_mut::<8>() {
        *length = ((HEAD_BYTES + of.body.len()) as u64).to_le_bytes();
    }
    // an index of a chunk ends with the sizes of its records, compressed and not
    let sizes = (opcode == op::CHUNK_INDEX).then(|| after.last_chunk_mut::<16>()).flatten();
    if let (Some(sizes), Some((compressed, uncompressed))) = (sizes, chunk_sizes(&of.body)) {
        sizes[..8].copy_from_slice(&compressed);
        sizes[8..].copy_from_slice(&uncompressed);
    }
}

/// Sizes of the records of the chunk in the record `body`, compressed and not.
fn chunk_sizes(body: &[u8]) -> Option<([u8; 8], [u8; 8])> {
    let (uncompressed, rest) = body.get(16..)?.split_first_chunk::<8>()?;
    let (_crc, rest) = rest.split_first_chunk::<4>()?;
    let (_compression, rest) = take_string(rest)?;
    Some((*rest.first_chunk::<8>()?, *uncompressed))
}

/// A chunk record: its header and what it holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chunk {
    /// Times of the first and the last message.
    times: [u8; 16],
    compression: Vec<u8>,
    /// The records, not compressed.
    pub contents: Vec<u8>,
}

/// Most that a chunk is unpacked to here.
const MOST_BYTES: usize = 1 << 24;

impl Chunk {
    /// The chunk in the record `body`, if it is one and can be unpacked.
    pub fn unpack(body: &[u8]) -> Option<Self> {
        let (times, rest) = body.split_first_chunk::<16>()?;
        let (_size_and_crc, rest) = rest.split_first_chunk::<12>()?;
        let (compression, rest) = take_string(rest)?;
        let (length, records) = rest.split_first_chunk::<8>()?;
        let records = records.get(..usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        let contents = match compression {
            b"" => records.to_vec(),
            b"zstd" => zstd::bulk::decompress(records, MOST_BYTES).ok()?,
            _ => return None,
        };
        Some(Self { times: *times, compression: compression.to_vec(), contents })
    }

    /// The record's body, with the right sizes and CRC; `compressed` with zstd or not at all.
    pub fn pack(&self, compressed: bool) -> Vec<u8> {
        // compressing into memory does not fail
        let packed = if compressed { zstd::bulk::compress(&self.contents, 1).ok() } else { None };
        let name: &[u8] = if packed.is_some() { b"zstd" } else { b"" };
        let records = packed.as_deref().unwrap_or(&self.contents);
        let mut body = self.times.to_vec();
        body.extend((self.contents.len() as u64).to_le_bytes());
        body.extend(crc32fast::hash(&self.contents).to_le_bytes());
        body.extend(u32::try_from(name.len()).unwrap_or_default().to_le_bytes());
        body.extend(name);
        body.extend((records.len() as u64).to_le_bytes());
        body.extend(records);
        body
    }

    /// Whether it was compressed.
    pub fn is_compressed(&self) -> bool {
        !self.compression.is_empty()
    }
}

/// A string with its length before it, and what follows.
pub(crate) fn take_string(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}
