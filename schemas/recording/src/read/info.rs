//! The contents of a recording, found without reading all of it where possible.

use crate::error::ReadError;
use crate::head::{BeginRecord, EndRecord};
use crate::proto;
use crate::read::contents::{Channel, Contents};
use crate::read::decode;
use crate::read::messages::MessageReader;
use crate::read::records::RecordReader;
use crate::read::summary::SummarySection;
use schemas::frame::EndReason;
use schemas::manifest::RunManifest;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A glance at a file without a summary reads this much of its chunks, before compression, plus a multiple of the file.
const GLANCE_BYTES: u64 = 4 << 30;
const GLANCE_TIMES: u64 = 64;

/// Contents of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingInfo {
    /// The file.
    pub path: PathBuf,
    /// The run.
    pub manifest: RunManifest,
    /// The configuration as the user gave it.
    pub run_toml: Option<String>,
    /// The channels, in the order of their numbers in the file.
    pub channels: Vec<ChannelInfo>,
    /// Step of the first recorded state, absent if there is none.
    pub first_step: Option<u64>,
    /// Step of the last recorded state, absent if there is none.
    pub last_step: Option<u64>,
    /// Size of the file.
    pub file_bytes: u64,
    /// Size of the chunks before compression.
    pub uncompressed_bytes: u64,
    /// Beginning of the recording, if it does not begin with the run.
    pub begin: BeginRecord,
    /// End of the recording, absent if it was not closed.
    pub end: Option<EndRecord>,
    /// True if the file was closed properly.
    pub finished: bool,
    /// The first damage found, if any; the numbers then hold up to it.
    pub damage: Option<String>,
}

/// A channel of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ChannelInfo {
    /// Its topic.
    pub topic: String,
    /// Full name of its schema.
    pub schema: String,
    /// Encoding of its messages, `protobuf` for ours.
    pub encoding: String,
    /// Number of its messages.
    pub messages: u64,
}

impl RecordingInfo {
    /// Reads the summary of the recording `path` if it has a valid one, else the whole file.
    ///
    /// # Errors
    /// When it cannot be read, is not a recording, or is of another major schema version. Damage further on
    /// is in [`damage`](Self::damage).
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        Self::within(path, |_| u64::MAX)
    }

    /// Like [`read`](Self::read), in a time that is bounded by the size of the file: if the file has no summary, only
    /// 4 GiB of chunks before compression, and 64 times its size, are read.
    ///
    /// # Errors
    /// As [`read`](Self::read); [`damage`](Self::damage) names the part that was not read.
    pub fn glance(path: &Path) -> Result<Self, ReadError> {
        Self::within(path, |file_bytes| file_bytes.saturating_mul(GLANCE_TIMES).saturating_add(GLANCE_BYTES))
    }

    /// Reads only the beginning and the summary. Without a summary it reads and counts no states.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn summary(path: &Path) -> Result<Self, ReadError> {
        let mut messages = MessageReader::glance(RecordReader::open(path)?)?;
        messages.read_head()?;
        let (mut records, contents, manifest) = messages.into_parts();
        let head = Self::of_head(&records, contents, manifest);
        let Some(summary) = SummarySection::read(&mut records) else { return Ok(head) };
        Ok(Self {
            channels: channels(&summary.contents, &summary.statistics.channel_message_counts),
            first_step: summary.end.first_step,
            last_step: summary.end.last_step,
            uncompressed_bytes: summary.uncompressed_bytes,
            end: Some(summary.end),
            finished: true,
            ..head
        })
    }

    /// The information in the `head` of a file, which `records` have read.
    fn of_head(records: &RecordReader, head: Contents, manifest: RunManifest) -> Self {
        Self {
            path: records.path().to_owned(),
            manifest,
            run_toml: head.run_toml,
            channels: Vec::new(),
            first_step: None,
            last_step: None,
            file_bytes: records.file_bytes(),
            uncompressed_bytes: 0,
            begin: head.begin,
            end: None,
            finished: false,
            damage: None,
        }
    }

    fn within(path: &Path, most_bytes: impl Fn(u64) -> u64) -> Result<Self, ReadError> {
        match Self::summary(path) {
            Ok(info) if info.finished => return Ok(info),
            Err(error @ ReadError::Io { .. }) => return Err(error),
            // what can be read is read through; what not even begins is refused again
            Ok(_) | Err(_) => {}
        }
        let messages = MessageReader::glance(RecordReader::open(path)?)?;
        let most_bytes = most_bytes(messages.file_bytes());
        scan(messages.expanding_to(most_bytes))
    }

    /// Number of recorded states.
    pub fn frames(&self) -> u64 {
        self.messages(proto::STATE.topic)
    }

    /// Number of messages of a topic.
    pub fn messages(&self, topic: &str) -> u64 {
        self.channels.iter().filter(|channel| channel.topic == topic).map(|channel| channel.messages).sum()
    }

    /// True if the recording goes from the beginning of the run to its last step, with as many states as are due.
    pub fn is_complete(&self) -> bool {
        let ends =
            self.reaches_the_end() && self.end.as_ref().is_some_and(|end| end.reason == EndReason::Complete);
        ends && self.begin.first_step == 0 && self.frames() >= self.manifest.recorded_count()
    }

    /// True if the file was closed after the last step of the run.
    pub fn reaches_the_end(&self) -> bool {
        self.finished && self.last_step == Some(self.manifest.physics.step_count)
    }

    /// Simulated times (s) of the first and the last recorded state.
    pub fn time_range_s(&self) -> Option<(f64, f64)> {
        let physics = &self.manifest.physics;
        Some((physics.time_s(self.first_step?), physics.time_s(self.last_step?)))
    }

    /// Steps from the first recorded state to the last one.
    pub fn covered_steps(&self) -> u64 {
        self.last_step.zip(self.first_step).map_or(0, |(last, first)| last.saturating_sub(first))
    }

    /// Size before compression over size of the file.
    pub fn compression_ratio(&self) -> f64 {
        self.uncompressed_bytes as f64 / self.file_bytes as f64
    }
}

/// Reads all messages and counts them.
fn scan(mut messages: MessageReader) -> Result<RecordingInfo, ReadError> {
    let path = messages.path().to_owned();
    let mut counts = BTreeMap::new();
    let (mut first_step, mut last_step) = (None, None);
    let damage = loop {
        match messages.next() {
            Ok(Some(message)) => {
                *counts.entry(message.head.channel_id).or_insert(0) += 1;
                if message.channel.topic == proto::STATE.topic {
                    match decode::head(message.data) {
                        Ok(state) => {
                            first_step.get_or_insert(state.step);
                            last_step = Some(state.step);
                        }
                        Err(what) => break Some(ReadError::damaged(&path, message.offset, what)),
                    }
                }
            }
            Ok(None) => break None,
            Err(error @ ReadError::Io { .. }) => return Err(error),
            Err(error) => break Some(error),
        }
    };
    let finished = damage.is_none() && messages.is_finished();
    let (records, mut contents, manifest) = messages.into_parts();
    Ok(RecordingInfo {
        channels: channels(&contents, &counts),
        first_step,
        last_step,
        uncompressed_bytes: contents.uncompressed_bytes,
        end: contents.end.take().filter(|_| finished),
        finished,
        damage: damage.map(|error| error.to_string()),
        ..RecordingInfo::of_head(&records, contents, manifest)
    })
}

fn channels(contents: &Contents, counts: &BTreeMap<u16, u64>) -> Vec<ChannelInfo> {
    let info = |(id, channel): (&u16, &Channel)| ChannelInfo {
        topic: channel.topic.clone(),
        schema: channel.schema.name.clone(),
        encoding: channel.message_encoding.clone(),
        messages: counts.get(id).copied().unwrap_or(0),
    };
    contents.channels.iter().map(info).collect()
}
