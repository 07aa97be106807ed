//! The header of a chunk record, and what its bytes become.

use crate::read::records::MAX_RECORD_BYTES;
use std::io;

/// Most bytes that zstd makes of one: a block of 128 KiB takes at least 4 bytes. So the size of the compressed chunk
/// bounds the memory reserved for it, rather than the size that the chunk claims.
const MOST_COMPRESSED: u64 = 1 << 15;

/// Header of a chunk record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ChunkHead {
    /// First and last log time (ns) of the messages.
    pub(crate) time_range_ns: (u64, u64),
    pub(crate) uncompressed_bytes: u64,
    pub(crate) crc: u32,
    pub(crate) is_compressed: bool,
    /// Length of the bytes after the header.
    pub(crate) compressed_bytes: u64,
    /// Length of the header itself.
    pub(crate) bytes: usize,
}

impl ChunkHead {
    /// Longest header of a chunk that we read.
    pub(crate) const MAX_BYTES: usize = 44;

    /// The header at the beginning of the chunk record `body`; none if we cannot read such a chunk.
    pub(crate) fn parse(body: &[u8]) -> Option<Self> {
        let number = |at: usize| Some(u64::from_le_bytes(*body.get(at..)?.first_chunk()?));
        let word = |at: usize| Some(u32::from_le_bytes(*body.get(at..)?.first_chunk()?));
        let name_bytes = usize::try_from(word(28)?).ok().filter(|bytes| [0, 4].contains(bytes))?;
        let head = Self {
            time_range_ns: (number(0)?, number(8)?),
            uncompressed_bytes: number(16)?,
            crc: word(24)?,
            is_compressed: name_bytes > 0,
            compressed_bytes: number(32 + name_bytes)?,
            bytes: 40 + name_bytes,
        };
        let is_known = name_bytes == 0 || body.get(32..36)? == b"zstd";
        let is_possible = head.time_range_ns.0 <= head.time_range_ns.1
            && head.uncompressed_bytes <= MAX_RECORD_BYTES
            && head.compressed_bytes <= MAX_RECORD_BYTES;
        (is_known && is_possible).then_some(head)
    }

    /// Length of the whole record's contents.
    pub(crate) fn record_bytes(&self) -> u64 {
        self.bytes as u64 + self.compressed_bytes
    }
}

/// Replaces the contents of `buffer` by `data` decompressed, which should be `size` bytes and no more than `most_bytes`.
///
/// # Errors
/// [`io::ErrorKind::OutOfMemory`] if there is no room for it; any other kind is one of `data`.
pub(crate) fn decompress(
    zstd: &mut zstd::bulk::Decompressor<'_>,
    data: &[u8],
    size: u64,
    most_bytes: u64,
    buffer: &mut Vec<u8>,
) -> io::Result<()> {
    buffer.clear();
    let most = most_bytes.min(data.len() as u64 * MOST_COMPRESSED); // integers
    let room = usize::try_from(size).ok().filter(|_| size <= most).ok_or_else(|| {
        let bytes = data.len();
        io::Error::other(format!(
            "a chunk of {size} bytes, more than {most_bytes} or than its {bytes} bytes can hold"
        ))
    })?;
    buffer.try_reserve(room)?;
    let damaged =
        |error: io::Error| io::Error::other(format!("a chunk that zstd cannot decompress: {error}"));
    zstd.decompress_to_buffer(data, buffer).map_err(damaged)?;
    Ok(())
}
