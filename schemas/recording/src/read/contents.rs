//! The contents of a recording other than its messages.

use crate::error::ReadError;
use crate::head::{self, BeginRecord, EndRecord};
use crate::proto::{CHAIN, OF_FRAMES};
use crate::read::parse::{MAX_STRUCTURE_BYTES, parse_record};
use crate::read::records::check_crc;
use mcap::records::{Metadata, Record, op};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

/// Opcodes from which on MCAP leaves records to anybody.
pub(crate) const PRIVATE: u8 = 0x80;

/// Most bytes that all schemas, channels and names of others' records of a file may take; ours take 3 kB.
const MAX_DEFINITION_BYTES: usize = 16 << 20;

/// The contents of a recording that are neither messages nor ours, as far as it was read.
#[derive(Debug, Clone, Default)]
pub struct OtherRecords {
    /// Attachments, metadata and private records by their offsets, which can be copied.
    pub whole: BTreeMap<u64, String>,
    /// Contents that have no place in another file, or are damaged.
    pub lost: BTreeSet<String>,
}

/// The contents of a file beside its messages, as far as it was read.
#[derive(Debug, Default)]
pub(crate) struct Contents {
    schemas: BTreeMap<u16, Arc<Schema>>,
    /// Size of all schemas, channels and names of others' records.
    definition_bytes: usize,
    /// Contents that are neither messages nor ours.
    pub(crate) others: OtherRecords,
    /// The channels, by the number that messages give.
    pub(crate) channels: BTreeMap<u16, Channel>,
    /// The configuration as the user gave it.
    pub(crate) run_toml: Option<String>,
    /// Beginning of the recording.
    pub(crate) begin: BeginRecord,
    /// End of the recording.
    pub(crate) end: Option<EndRecord>,
    /// True if the data section is closed.
    pub(crate) data_end: bool,
    /// Size of the chunks before compression.
    pub(crate) uncompressed_bytes: u64,
}

/// A schema in the file; without a name if the channel has none.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Schema {
    pub(crate) name: String,
    pub(crate) encoding: String,
    pub(crate) text: Arc<[u8]>,
}

/// A channel in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    pub(crate) message_encoding: String,
    pub(crate) metadata: BTreeMap<String, String>,
    /// The schema, shared by all channels that have it, however long its name is.
    pub(crate) schema: Arc<Schema>,
}

impl Contents {
    /// Takes a record that is neither a chunk nor a message.
    pub(crate) fn define(
        &mut self,
        path: &Path,
        offset: u64,
        opcode: u8,
        body: &[u8],
    ) -> Result<(), ReadError> {
        let damaged = |what| ReadError::damaged(path, offset, what);
        match opcode {
            op::SCHEMA | op::CHANNEL => {
                let record = parse_record(opcode, body);
                let record = record.map_err(|error| damaged(format!("a record that is none: {error}")))?;
                self.add(record).map_err(damaged)
            }
            op::METADATA => {
                let metadata = parse_metadata(path, offset, body)?;
                if metadata.name == head::BEGIN {
                    self.begin = BeginRecord::from_metadata(&metadata).map_err(damaged)?;
                }
                if metadata.name == head::END {
                    self.end = Some(EndRecord::from_metadata(&metadata).map_err(damaged)?);
                }
                if [head::RUN, head::BEGIN, head::END].contains(&metadata.name.as_str()) {
                    return Ok(());
                }
                self.add_other(offset, "metadata", &metadata.name).map_err(damaged)
            }
            op::ATTACHMENT => {
                let Attachment { name, data, content, crc, .. } = Attachment::parse(body)
                    .ok_or_else(|| damaged("an attachment that is none".to_owned()))?;
                let part = format!("the attachment at byte {offset}");
                let checked = check_crc(path, &part, crc, crc32fast::hash(content));
                if name != head::RUN_TOML.as_bytes() {
                    let text = String::from_utf8_lossy(name);
                    self.add_other(offset, "attachment", &text).map_err(damaged)?;
                    if checked.is_err() {
                        self.others.lost.extend(self.others.whole.remove(&offset));
                    }
                    return checked;
                }
                checked?;
                if data.len() > MAX_STRUCTURE_BYTES {
                    return Err(damaged(format!("a configuration of {} bytes", data.len())));
                }
                self.run_toml = Some(String::from_utf8_lossy(data).into_owned());
                Ok(())
            }
            PRIVATE.. => self.add_other(offset, "private record", &format!("{opcode:#04x}")).map_err(damaged),
            _ => Ok(()),
        }
    }

    fn add_other(&mut self, offset: u64, kind: &str, name: &str) -> Result<(), String> {
        let what = format!("{kind} `{}`", name.escape_debug());
        let bytes = size_of::<(u64, String)>() + what.len();
        let is_new = self.others.whole.insert(offset, what).is_none();
        if is_new { self.count(bytes) } else { Ok(()) }
    }

    /// Adds a schema or a channel; the same number twice must be the same thing.
    pub(crate) fn add(&mut self, record: Record<'_>) -> Result<(), String> {
        match record {
            Record::Schema { header, data } => {
                if !self.schemas.contains_key(&header.id) {
                    self.count(header.name.len() + header.encoding.len() + data.len())?;
                }
                let schema = Schema { name: header.name, encoding: header.encoding, text: data[..].into() };
                insert(&mut self.schemas, header.id, Arc::new(schema), "schema")
            }
            Record::Channel(channel) => {
                if !self.channels.contains_key(&channel.id) {
                    let metadata = channel.metadata.iter().map(|(key, value)| key.len() + value.len());
                    // a list of channels names their schemas, too
                    let schema = self.schemas.get(&channel.schema_id).map_or(0, |schema| schema.name.len());
                    self.count(channel.topic.len() + metadata.sum::<usize>() + schema)?;
                }
                if !channel.metadata.is_empty() && OF_FRAMES.contains(&channel.topic.as_str()) {
                    self.others.lost.insert(format!("metadata of the channel `{}`", channel.topic));
                }
                let definition = Channel {
                    topic: channel.topic,
                    message_encoding: channel.message_encoding,
                    metadata: channel.metadata,
                    schema: self.schemas.get(&channel.schema_id).cloned().unwrap_or_default(),
                };
                insert(&mut self.channels, channel.id, definition, "channel")
            }
            _ => Ok(()),
        }
    }

    /// True if both have the same schemas and channels under the same numbers.
    pub(crate) fn has_same_definitions(&self, other: &Self) -> bool {
        self.schemas == other.schemas && self.channels == other.channels
    }

    /// Number of schemas.
    pub(crate) fn schema_count(&self) -> usize {
        self.schemas.len()
    }

    /// Takes over the schemas and channels of `other` that are new here.
    pub(crate) fn learn(&mut self, other: &Self) {
        for (id, schema) in &other.schemas {
            self.schemas.entry(*id).or_insert_with(|| schema.clone());
        }
        for (id, channel) in &other.channels {
            self.channels.entry(*id).or_insert_with(|| channel.clone());
        }
    }

    /// Counts a new schema or channel, so that a hostile file cannot fill the memory with them.
    fn count(&mut self, bytes: usize) -> Result<(), String> {
        self.definition_bytes = self.definition_bytes.saturating_add(bytes);
        let bounded = self.definition_bytes <= MAX_DEFINITION_BYTES;
        bounded
            .then_some(())
            .ok_or_else(|| format!("schemas, channels and names of more than {MAX_DEFINITION_BYTES} bytes"))
    }

    /// The sums of what `count` gives for the channels of each topic, if it gives anything.
    pub(crate) fn by_topic(&self, count: impl Fn(u16, &str) -> Option<u64>) -> BTreeMap<String, u64> {
        let mut by_topic = BTreeMap::new();
        for (id, Channel { topic, .. }) in &self.channels {
            if let Some(count) = count(*id, topic) {
                *by_topic.entry(topic.clone()).or_insert(0) += count;
            }
        }
        by_topic
    }

    /// True if nothing but the chain is known: a recording that was stopped before its states, or an empty file.
    pub(crate) fn are_before_states(&self) -> bool {
        self.channels.values().all(|channel| channel.topic == CHAIN.topic)
    }

    /// The topics, for messages.
    pub(crate) fn topics(&self) -> String {
        let topics: Vec<_> = self.channels.values().map(|channel| format!("`{}`", channel.topic)).collect();
        if topics.is_empty() { "nothing".into() } else { topics.join(", ") }
    }
}

fn insert<T: PartialEq>(map: &mut BTreeMap<u16, T>, id: u16, value: T, what: &str) -> Result<(), String> {
    match map.entry(id) {
        Entry::Occupied(known) if *known.get() != value => {
            Err(format!("two different {what}s numbered {id}"))
        }
        Entry::Occupied(_) => Ok(()),
        Entry::Vacant(place) => {
            place.insert(value);
            Ok(())
        }
    }
}

pub(crate) fn parse_metadata(path: &Path, offset: u64, body: &[u8]) -> Result<Metadata, ReadError> {
    match parse_record(op::METADATA, body) {
        Ok(Record::Metadata(metadata)) => Ok(metadata),
        _ => Err(ReadError::damaged(path, offset, "metadata that is none")),
    }
}

/// An attachment record. By hand: mcap panics on short ones.
pub(crate) struct Attachment<'a> {
    pub(crate) log_time: u64,
    pub(crate) create_time: u64,
    pub(crate) name: &'a [u8],
    pub(crate) media_type: &'a [u8],
    pub(crate) data: &'a [u8],
    /// The bytes before the CRC, and the CRC.
    content: &'a [u8],
    crc: u32,
}

impl<'a> Attachment<'a> {
    /// The attachment in the record `body`, if it is one; its CRC may be wrong.
    pub(crate) fn parse(body: &'a [u8]) -> Option<Self> {
        let (content, crc) = body.split_last_chunk::<4>()?;
        let (log_time, rest) = content.split_first_chunk::<8>()?;
        let (create_time, rest) = rest.split_first_chunk::<8>()?;
        let (name, rest) = take_string(rest)?;
        let (media_type, rest) = take_string(rest)?;
        let (length, data) = rest.split_first_chunk::<8>()?;
        let whole = usize::try_from(u64::from_le_bytes(*length)).ok()? == data.len();
        let (log_time, create_time) = (u64::from_le_bytes(*log_time), u64::from_le_bytes(*create_time));
        let crc = u32::from_le_bytes(*crc);
        whole.then_some(Self { log_time, create_time, name, media_type, data, content, crc })
    }
}

fn take_string(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}
