//! MCAP records as bytes, appended to a buffer.
//!
//! `mcap`'s writer compresses and writes in the thread that calls it and takes no compressed chunk, so the few records
//! that our files have are framed here. A test holds them equal to those that `mcap` writes.

use crate::read::contents::Attachment;
use crate::read::parse::parse_record;
use mcap::records::{
    AttachmentIndex, ChunkIndex, MessageHeader, Metadata, MetadataIndex, Record, Statistics, op,
};
use std::collections::BTreeMap;

/// Appends a record: opcode, length, and the bytes that `body` appends.
pub(crate) fn record(bytes: &mut Vec<u8>, opcode: u8, body: impl FnOnce(&mut Vec<u8>)) {
    bytes.push(opcode);
    sized::<8>(bytes, body);
}

/// Appends a length of `N` bytes, little-endian, and the bytes that `body` appends.
fn sized<const N: usize>(bytes: &mut Vec<u8>, body: impl FnOnce(&mut Vec<u8>)) {
    let start = bytes.len();
    bytes.extend([0; N]);
    body(bytes);
    let length = (bytes.len() - start - N) as u64;
    bytes[start..start + N].copy_from_slice(&length.to_le_bytes()[..N]);
}

fn text(bytes: &mut Vec<u8>, text: &str) {
    sized::<4>(bytes, |bytes| bytes.extend(text.as_bytes()));
}

fn texts(bytes: &mut Vec<u8>, map: &BTreeMap<String, String>) {
    sized::<4>(bytes, |bytes| {
        for (key, value) in map {
            text(bytes, key);
            text(bytes, value);
        }
    });
}

/// Appends numbers by channel.
fn by_channel(bytes: &mut Vec<u8>, map: &BTreeMap<u16, u64>) {
    sized::<4>(bytes, |bytes| {
        for (channel_id, value) in map {
            bytes.extend(channel_id.to_le_bytes());
            numbers(bytes, &[*value]);
        }
    });
}

fn numbers(bytes: &mut Vec<u8>, numbers: &[u64]) {
    for number in numbers {
        bytes.extend(number.to_le_bytes());
    }
}

pub(crate) fn header(bytes: &mut Vec<u8>, profile: &str, library: &str) {
    record(bytes, op::HEADER, |bytes| {
        text(bytes, profile);
        text(bytes, library);
    });
}

pub(crate) fn schema(bytes: &mut Vec<u8>, id: u16, name: &str, encoding: &str, data: &[u8]) {
    record(bytes, op::SCHEMA, |bytes| {
        bytes.extend(id.to_le_bytes());
        text(bytes, name);
        text(bytes, encoding);
        sized::<4>(bytes, |bytes| bytes.extend(data));
    });
}

pub(crate) fn channel(
    bytes: &mut Vec<u8>,
    id: u16,
    schema_id: u16,
    topic: &str,
    message_encoding: &str,
    metadata: &BTreeMap<String, String>,
) {
    record(bytes, op::CHANNEL, |bytes| {
        bytes.extend(id.to_le_bytes());
        bytes.extend(schema_id.to_le_bytes());
        text(bytes, topic);
        text(bytes, message_encoding);
        texts(bytes, metadata);
    });
}

pub(crate) fn message(bytes: &mut Vec<u8>, head: &MessageHeader, data: &[u8]) {
    record(bytes, op::MESSAGE, |bytes| {
        bytes.extend(head.channel_id.to_le_bytes());
        bytes.extend(head.sequence.to_le_bytes());
        numbers(bytes, &[head.log_time, head.publish_time]);
        bytes.extend_from_slice(data);
    });
}

/// The fields before the contents of a chunk.
pub(crate) struct ChunkHead<'a> {
    /// Least and greatest log time of its messages (ns).
    pub(crate) times_ns: (u64, u64),
    pub(crate) uncompressed_bytes: u64,
    pub(crate) uncompressed_crc: u32,
    pub(crate) compression: &'a str,
}

pub(crate) fn chunk(bytes: &mut Vec<u8>, head: &ChunkHead<'_>, contents: &[u8]) {
    record(bytes, op::CHUNK, |bytes| {
        numbers(bytes, &[head.times_ns.0, head.times_ns.1, head.uncompressed_bytes]);
        bytes.extend(head.uncompressed_crc.to_le_bytes());
        text(bytes, head.compression);
        sized::<8>(bytes, |bytes| bytes.extend_from_slice(contents));
    });
}

/// Appends times and places of a channel's messages in the chunk before.
pub(crate) fn message_index(bytes: &mut Vec<u8>, channel_id: u16, entries: &[(u64, u64)]) {
    record(bytes, op::MESSAGE_INDEX, |bytes| {
        bytes.extend(channel_id.to_le_bytes());
        sized::<4>(bytes, |bytes| {
            for (time_ns, offset) in entries {
                numbers(bytes, &[*time_ns, *offset]);
            }
        });
    });
}

pub(crate) fn metadata(bytes: &mut Vec<u8>, metadata: &Metadata) {
    record(bytes, op::METADATA, |bytes| {
        text(bytes, &metadata.name);
        texts(bytes, &metadata.metadata);
    });
}

/// Appends an attachment, described by an index whose offset and length mean nothing yet.
pub(crate) fn attachment(bytes: &mut Vec<u8>, about: &AttachmentIndex, data: &[u8]) {
    record(bytes, op::ATTACHMENT, |bytes| {
        let start = bytes.len();
        numbers(bytes, &[about.log_time, about.create_time]);
        text(bytes, &about.name);
        text(bytes, &about.media_type);
        sized::<8>(bytes, |bytes| bytes.extend(data));
        let crc = crc32fast::hash(&bytes[start..]);
        bytes.extend(crc.to_le_bytes());
    });
}

/// The index of the attachment record `body`.
pub(crate) fn index_of_attachment(offset: u64, length: u64, body: &[u8]) -> Option<AttachmentIndex> {
    let Attachment { log_time, create_time, name, media_type, data, .. } = Attachment::parse(body)?;
    let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
    let (name, media_type, data_size) = (text(name), text(media_type), data.len() as u64);
    Some(AttachmentIndex { offset, length, log_time, create_time, data_size, name, media_type })
}

/// The index of the metadata record `body`.
pub(crate) fn index_of_metadata(offset: u64, length: u64, body: &[u8]) -> Option<MetadataIndex> {
    let Ok(Record::Metadata(metadata)) = parse_record(op::METADATA, body) else { return None };
    Some(MetadataIndex { offset, length, name: metadata.name })
}

pub(crate) fn data_end(bytes: &mut Vec<u8>, data_section_crc: u32) {
    record(bytes, op::DATA_END, |bytes| bytes.extend(data_section_crc.to_le_bytes()));
}

/// Statistics of a file: the messages by channel, their log times (ns), and the numbers of schemas, channels, attachments,
/// metadata records and chunks.
pub(crate) fn count_statistics(
    messages: &BTreeMap<u16, u64>,
    times_ns: Option<(u64, u64)>,
    [schemas, channels, attachments, metadata, chunks]: [u64; 5],
) -> Statistics {
    let count = |count: u64| u32::try_from(count).unwrap_or(u32::MAX);
    let (message_start_time, message_end_time) = times_ns.unwrap_or_default();
    Statistics {
        message_count: messages.values().sum(),
        schema_count: u16::try_from(schemas).unwrap_or(u16::MAX),
        channel_count: count(channels),
        attachment_count: count(attachments),
        metadata_count: count(metadata),
        chunk_count: count(chunks),
        message_start_time,
        message_end_time,
        channel_message_counts: messages.clone(),
    }
}

pub(crate) fn statistics(bytes: &mut Vec<u8>, found: &Statistics) {
    record(bytes, op::STATISTICS, |bytes| {
        numbers(bytes, &[found.message_count]);
        bytes.extend(found.schema_count.to_le_bytes());
        for count in [found.channel_count, found.attachment_count, found.metadata_count, found.chunk_count] {
            bytes.extend(count.to_le_bytes());
        }
        numbers(bytes, &[found.message_start_time, found.message_end_time]);
        by_channel(bytes, &found.channel_message_counts);
    });
}

pub(crate) fn chunk_index(bytes: &mut Vec<u8>, index: &ChunkIndex) {
    record(bytes, op::CHUNK_INDEX, |bytes| {
        numbers(bytes, &[index.message_start_time, index.message_end_time]);
        numbers(bytes, &[index.chunk_start_offset, index.chunk_length]);
        by_channel(bytes, &index.message_index_offsets);
        numbers(bytes, &[index.message_index_length]);
        text(bytes, &index.compression);
        numbers(bytes, &[index.compressed_size, index.uncompressed_size]);
    });
}

pub(crate) fn attachment_index(bytes: &mut Vec<u8>, index: &AttachmentIndex) {
    record(bytes, op::ATTACHMENT_INDEX, |bytes| {
        numbers(bytes, &[index.offset, index.length, index.log_time, index.create_time, index.data_size]);
        text(bytes, &index.name);
        text(bytes, &index.media_type);
    });
}

pub(crate) fn metadata_index(bytes: &mut Vec<u8>, index: &MetadataIndex) {
    record(bytes, op::METADATA_INDEX, |bytes| {
        numbers(bytes, &[index.offset, index.length]);
        text(bytes, &index.name);
    });
}

/// Appends the place of the records of one kind in the summary section.
pub(crate) fn summary_offset(bytes: &mut Vec<u8>, opcode: u8, start: u64, length: u64) {
    record(bytes, op::SUMMARY_OFFSET, |bytes| {
        bytes.push(opcode);
        numbers(bytes, &[start, length]);
    });
}

/// Appends the footer of a summary section, which is the end of `bytes` from `section` on.
pub(crate) fn footer(bytes: &mut Vec<u8>, section: usize, summary_start: u64, summary_offset_start: u64) {
    record(bytes, op::FOOTER, |bytes| {
        numbers(bytes, &[summary_start, summary_offset_start]);
        // the length is not patched in yet, but counts
        let at = bytes.len() - 16 - 8;
        bytes[at..at + 8].copy_from_slice(&20_u64.to_le_bytes());
        let crc = crc32fast::hash(&bytes[section..]);
        bytes.extend(crc.to_le_bytes());
    });
}
