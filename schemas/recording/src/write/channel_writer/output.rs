//! The growing file: whole chunks, one after the other, and at the end the records that close it.

use super::Compression;
use super::block::Block;
use super::framing::{self, ChunkHead};
use mcap::records::{AttachmentIndex, ChunkIndex, Metadata, MetadataIndex, op};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A file that ends on a record boundary, whatever fails.
#[derive(Debug)]
pub(super) struct Output {
    file: Arc<File>,
    /// Bytes handed to the operating system, readable by other threads.
    position: Arc<AtomicU64>,
    bytes: u64,
    crc: crc32fast::Hasher,
    chunk_indexes: Vec<ChunkIndex>,
    attachment_indexes: Vec<AttachmentIndex>,
    metadata_indexes: Vec<MetadataIndex>,
    message_counts: BTreeMap<u16, u64>,
    times_ns: Option<(u64, u64)>,
}

/// A chunk and its message indexes as bytes, to be written at once.
#[derive(Debug, Default)]
pub(super) struct Encoded {
    bytes: Vec<u8>,
    chunk_bytes: usize,
    compressed_bytes: u64,
    compression: &'static str,
    /// Start of the message index of each channel in `bytes`, and the number of messages that it names.
    indexes: BTreeMap<u16, (u64, u64)>,
    /// The contents, compressed by zstd.
    packed: Vec<u8>,
}

/// Compresses chunks.
pub(super) struct Encoder {
    zstd: Option<zstd::bulk::Compressor<'static>>,
}

impl Encoder {
    pub(super) fn new(compression: Compression) -> io::Result<Self> {
        let zstd = match compression {
            Compression::None => None,
            Compression::Zstd { level } => {
                // 1 to 22 fit any integer
                let level = i32::try_from(level.clamp(1, 22)).unwrap_or(1);
                Some(zstd::bulk::Compressor::new(level)?)
            }
        };
        Ok(Self { zstd })
    }

    pub(super) fn encode(&mut self, block: &Block, into: &mut Encoded) -> io::Result<()> {
        into.bytes.clear();
        into.indexes.clear();
        into.compression = if self.zstd.is_some() { "zstd" } else { "" };
        let head = ChunkHead {
            times_ns: block.times_ns().unwrap_or_default(),
            uncompressed_bytes: block.bytes(),
            uncompressed_crc: crc32fast::hash(block.records()),
            compression: into.compression,
        };
        let contents = match &mut self.zstd {
            Some(zstd) => {
                into.packed.clear();
                into.packed.reserve(zstd::compress_bound(block.records().len()));
                zstd.compress_to_buffer(block.records(), &mut into.packed)?;
                into.packed.as_slice()
            }
            None => block.records(),
        };
        into.compressed_bytes = contents.len() as u64;
        framing::chunk(&mut into.bytes, &head, contents);
        into.chunk_bytes = into.bytes.len();
        for (channel_id, places) in block.places() {
            into.indexes.insert(channel_id, (into.bytes.len() as u64, places.len() as u64));
            framing::message_index(&mut into.bytes, channel_id, places);
        }
        Ok(())
    }
}

impl Output {
    /// Begins the MCAP file of `profile` in `file`, which is empty: writes `metadata` and perhaps an attachment at
    /// once. Returns the output and its growing size. The attachment is described by an index without its place and
    /// lengths.
    pub(super) fn begin(
        file: Arc<File>,
        profile: &str,
        metadata: &[Metadata],
        attachment: Option<(AttachmentIndex, &[u8])>,
    ) -> io::Result<(Self, Arc<AtomicU64>)> {
        let position = Arc::<AtomicU64>::default();
        let mut output = Self {
            file,
            position: Arc::clone(&position),
            bytes: 0,
            crc: crc32fast::Hasher::new(),
            chunk_indexes: Vec::new(),
            attachment_indexes: Vec::new(),
            metadata_indexes: Vec::new(),
            message_counts: BTreeMap::new(),
            times_ns: None,
        };
        let mut head = mcap::MAGIC.to_vec();
        framing::header(&mut head, profile, concat!("beadline ", env!("CARGO_PKG_VERSION")));
        for record in metadata {
            output.metadata(&mut head, record);
        }
        if let Some((about, data)) = attachment {
            output.attachment(&mut head, about, data);
        }
        output.append(&head)?;
        Ok((output, position))
    }

    /// Appends whole records; if that fails, the file ends where it ended before.
    fn append(&mut self, records: &[u8]) -> io::Result<()> {
        if let Err(error) = (&*self.file).write_all(records) {
            // best effort: the user has to know of the write error
            let _ = self.file.set_len(self.bytes);
            return Err(error);
        }
        self.crc.update(records);
        self.bytes += records.len() as u64;
        self.position.store(self.bytes, Ordering::Relaxed);
        Ok(())
    }

    pub(super) fn file(&self) -> &Arc<File> {
        &self.file
    }

    /// Bytes in the file.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Appends metadata to `bytes`, which will be appended to the file.
    fn metadata(&mut self, bytes: &mut Vec<u8>, metadata: &Metadata) {
        let start = bytes.len() as u64;
        framing::metadata(bytes, metadata);
        self.metadata_indexes.push(MetadataIndex {
            offset: self.bytes + start,
            length: bytes.len() as u64 - start,
            name: metadata.name.clone(),
        });
    }

    /// Appends an attachment to `bytes`, which will be appended to the file.
    fn attachment(&mut self, bytes: &mut Vec<u8>, about: AttachmentIndex, data: &[u8]) {
        let start = bytes.len() as u64;
        framing::attachment(bytes, &about, data);
        self.attachment_indexes.push(AttachmentIndex {
            offset: self.bytes + start,
            length: bytes.len() as u64 - start,
            data_size: data.len() as u64,
            ..about
        });
    }

    /// Appends a record of another file, which may be an attachment, metadata or of a kind that we do not know.
    pub(super) fn copy(&mut self, opcode: u8, body: &[u8]) -> io::Result<()> {
        let mut bytes = Vec::new();
        framing::record(&mut bytes, opcode, |bytes| bytes.extend(body));
        let (offset, length) = (self.bytes, bytes.len() as u64);
        self.append(&bytes)?;
        match opcode {
            op::ATTACHMENT => {
                self.attachment_indexes.extend(framing::index_of_attachment(offset, length, body));
            }
            op::METADATA => self.metadata_indexes.extend(framing::index_of_metadata(offset, length, body)),
            _ => {}
        }
        Ok(())
    }

    /// Appends the chunk that `block` became.
    pub(super) fn chunk(&mut self, block: &Block, encoded: &Encoded) -> io::Result<()> {
        let start = self.bytes;
        self.append(&encoded.bytes)?;
        let (first, last) = block.times_ns().unwrap_or_default();
        if block.times_ns().is_some() {
            let (least, most) = self.times_ns.unwrap_or((first, last));
            self.times_ns = Some((least.min(first), most.max(last)));
        }
        for (channel_id, (_, messages)) in &encoded.indexes {
            *self.message_counts.entry(*channel_id).or_default() += messages;
        }
        let places = encoded.indexes.iter().map(|(channel_id, (place, _))| (*channel_id, start + place));
        self.chunk_indexes.push(ChunkIndex {
            message_start_time: first,
            message_end_time: last,
            chunk_start_offset: start,
            chunk_length: encoded.chunk_bytes as u64,
            message_index_offsets: places.collect(),
            message_index_length: (encoded.bytes.len() - encoded.chunk_bytes) as u64,
            compression: encoded.compression.to_owned(),
            compressed_size: encoded.compressed_bytes,
            uncompressed_size: block.bytes(),
        });
        Ok(())
    }

    /// Size of the chunks before compression.
    pub(super) fn uncompressed_bytes(&self) -> u64 {
        self.chunk_indexes.iter().map(|index| index.uncompressed_size).sum()
    }

    /// Closes the file with the metadata `end` and a summary of `schemas` and `channels`, the records that
    /// define them.
    pub(super) fn close(
        &mut self,
        end: &Metadata,
        schemas: &[Vec<u8>],
        channels: &[Vec<u8>],
    ) -> io::Result<()> {
        let mut bytes = Vec::new();
        self.metadata(&mut bytes, end);
        let mut crc = self.crc.clone();
        crc.update(&bytes);
        framing::data_end(&mut bytes, crc.finalize());
        self.summary(&mut bytes, schemas, channels);
        bytes.extend(mcap::MAGIC);
        self.append(&bytes)
    }

    /// Appends the summary section and the footer to `bytes`, which will be appended to the file.
    fn summary(&self, bytes: &mut Vec<u8>, schemas: &[Vec<u8>], channels: &[Vec<u8>]) {
        let section = bytes.len();
        let at = |bytes: &Vec<u8>| self.bytes + bytes.len() as u64;
        let mut groups = Vec::new();
        let mut group = |bytes: &mut Vec<u8>, opcode: u8, append: &dyn Fn(&mut Vec<u8>)| {
            let start = at(bytes);
            append(bytes);
            if at(bytes) > start {
                groups.push((opcode, start, at(bytes) - start));
            }
        };
        let (attachments, metadata) = (&self.attachment_indexes, &self.metadata_indexes);
        let counts =
            [schemas.len(), channels.len(), attachments.len(), metadata.len(), self.chunk_indexes.len()];
        let counts = counts.map(|count| count as u64);
        let statistics = framing::count_statistics(&self.message_counts, self.times_ns, counts);
        group(bytes, op::SCHEMA, &|bytes| bytes.extend(schemas.concat()));
        group(bytes, op::CHANNEL, &|bytes| bytes.extend(channels.concat()));
        group(bytes, op::STATISTICS, &|bytes| framing::statistics(bytes, &statistics));
        group(bytes, op::CHUNK_INDEX, &|bytes| {
            self.chunk_indexes.iter().for_each(|index| framing::chunk_index(bytes, index));
        });
        group(bytes, op::ATTACHMENT_INDEX, &|bytes| {
            self.attachment_indexes.iter().for_each(|index| framing::attachment_index(bytes, index));
        });
        group(bytes, op::METADATA_INDEX, &|bytes| {
            self.metadata_indexes.iter().for_each(|index| framing::metadata_index(bytes, index));
        });
        let summary_offset_start = at(bytes);
        for (opcode, start, length) in groups {
            framing::summary_offset(bytes, opcode, start, length);
        }
        framing::footer(bytes, section, self.bytes + section as u64, summary_offset_start);
    }
}
