//! Channels of messages into an MCAP file that survives a crash at any moment.
//!
//! Records go into a chunk in memory; threads of their own compress chunks and write them, in order, each in one
//! piece. Between the two is a queue of bounded size: a slow disk holds the recording thread back, and nothing
//! is lost. The threads also look at the clock, so that a chunk is written in time when no more messages come.

mod block;
mod chunks;
pub(crate) mod framing;
mod output;
mod queue;
mod threads;

use crate::error::WriteError;
use crate::head;
use crate::log_time_ns;
use crate::proto::DescribedTopic;
use crate::read::contents::Channel;
use chunks::Chunks;
use mcap::records::{AttachmentIndex, MessageHeader, Metadata};
use output::Output;
use queue::{Queue, Refused};
use schemas::manifest::{ManifestTooLong, RunManifest};
use schemas::whole_file::WholeFile;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use threads::Threads;

/// Options of a recording's writer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriteOptions {
    /// Overwrite existing files. Default: no.
    pub force: bool,
    /// Compression of chunks. Default: zstd level 1.
    pub compression: Compression,
    /// A chunk is closed once it holds more than this, uncompressed. Default: 1 MiB.
    pub chunk_bytes: u64,
    /// Bytes that may wait for the disk beside the open chunk, uncompressed; one chunk always may. More holds the
    /// recording thread back. Default: 8 MiB.
    pub queue_bytes: u64,
    /// Longest time that a frame waits for others in its chunk: the loss in a kill. With zero every frame is in the
    /// file when it is accepted. Default: 1 s.
    pub flush_period: Duration,
    /// Longest time between two syncs to the disk: the loss in a power failure. Default: 5 s.
    pub sync_period: Duration,
    /// For tests: extra time that a disk takes for a chunk.
    #[cfg(feature = "faults")]
    pub slow_disk: Duration,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self {
            force: false,
            compression: Compression::Zstd { level: 1 },
            chunk_bytes: 1 << 20,
            queue_bytes: 8 << 20,
            flush_period: Duration::from_secs(1),
            sync_period: Duration::from_secs(5),
            #[cfg(feature = "faults")]
            slow_disk: Duration::ZERO,
        }
    }
}

/// Compression of chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compression {
    /// No compression.
    None,
    /// zstd.
    Zstd {
        /// 1 (fast) to 22.
        level: u32,
    },
}

/// A finished recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finished {
    /// Path of the recording.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// The size of its messages before compression.
    pub uncompressed_bytes: u64,
    /// Number of states, of rows of a contacts map, or of messages for other programs.
    pub frames: u64,
    /// Time that the recording thread waited for the disk.
    pub held_back: Duration,
}

/// A channel of a [`ChannelWriter`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChannelId(u16);

/// Writes messages of several channels under one manifest.
///
/// After an error the file ends with the last whole chunk, and the writer takes nothing more. Dropping it writes
/// everything that was accepted.
pub(crate) struct ChannelWriter {
    /// None once the threads have ended.
    threads: Option<Threads>,
    schemas: Definitions,
    channels: Definitions,
    position: Arc<AtomicU64>,
    // after the threads, which write to it
    file: WholeFile,
}

/// The schemas or the channels so far, numbered from 1.
#[derive(Debug, Default)]
struct Definitions {
    /// Their numbers, by their records with the number 0.
    numbers: BTreeMap<Vec<u8>, u16>,
    /// Their records with their numbers, in this order.
    records: Vec<Vec<u8>>,
}

impl ChannelWriter {
    /// Creates `<path>.partial`, for readers that look for `profile`, and syncs its head: manifest, beginning if given, and
    /// configuration.
    pub(crate) fn create(
        profile: &str,
        path: &Path,
        manifest: &RunManifest,
        begin: Option<Metadata>,
        run_toml: Option<&str>,
        options: &WriteOptions,
    ) -> Result<Self, WriteError> {
        ManifestTooLong::check(manifest.to_json().len())?;
        let file = WholeFile::create(path, options.force)?;
        let partial = file.partial().to_owned();
        let io = WriteError::io(&partial);
        let run_toml = run_toml.map(|text| (about_run_toml(manifest), text.as_bytes()));
        let metadata: Vec<_> = [head::run_metadata(manifest)].into_iter().chain(begin).collect();
        let (output, position) =
            Output::begin(Arc::clone(file.file()), profile, &metadata, run_toml).map_err(&io)?;
        file.file().sync_data().map_err(&io)?;
        file.sync_name()?;
        let queue = Queue::new(Chunks::new(*options));
        let threads = Some(Threads::start(queue, output, options).map_err(&io)?);
        let (schemas, channels) = Default::default();
        Ok(Self { threads, schemas, channels, position, file })
    }

    /// Removes the file.
    pub(crate) fn discard(self) {
        if let Some(threads) = &self.threads {
            threads.queue().give_up();
        }
        drop(self.threads);
        self.file.discard();
    }

    /// Adds the channel of `topic`.
    pub(crate) fn add_channel(&mut self, topic: DescribedTopic<'_>) -> Result<ChannelId, WriteError> {
        let schema = self.add_schema(topic.message, "protobuf", topic.descriptor)?;
        self.define_channel(schema, topic.topic, "protobuf", &BTreeMap::new())
    }

    /// Adds a channel like `channel` of another file.
    pub(crate) fn copy_channel(&mut self, channel: &Channel) -> Result<ChannelId, WriteError> {
        let Channel { topic, message_encoding, metadata, schema } = channel;
        let schema_id = match schema.name.as_str() {
            "" => 0,
            name => self.add_schema(name, &schema.encoding, &schema.text)?,
        };
        self.define_channel(schema_id, topic, message_encoding, metadata)
    }

    pub(crate) fn add_schema(&mut self, name: &str, encoding: &str, text: &[u8]) -> Result<u16, WriteError> {
        let record = |id, bytes: &mut Vec<u8>| framing::schema(bytes, id, name, encoding, text);
        let added = self.schemas.add(record);
        self.define(added, "schemas")
    }

    pub(crate) fn define_channel(
        &mut self,
        schema_id: u16,
        topic: &str,
        message_encoding: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<ChannelId, WriteError> {
        let record = |id, bytes: &mut Vec<u8>| {
            framing::channel(bytes, id, schema_id, topic, message_encoding, metadata);
        };
        let added = self.channels.add(record);
        self.define(added, "channels").map(ChannelId)
    }

    /// Writes the record of a definition, if it is a new one, and returns its number.
    fn define(&self, added: Option<(u16, Option<Vec<u8>>)>, what: &str) -> Result<u16, WriteError> {
        let too_many = || io::Error::other(format!("more {what} than a file can have"));
        let (id, new) = added.ok_or_else(too_many).map_err(WriteError::io(self.path()))?;
        if let Some(record) = new {
            self.record(|chunks, now| chunks.open().define(&record, now))?;
        }
        Ok(id)
    }

    /// Writes a message of another file, with the times and the number in its `head`, to a channel of this one.
    pub(crate) fn copy(
        &mut self,
        ChannelId(channel_id): ChannelId,
        head: &MessageHeader,
        message: &[u8],
    ) -> Result<(), WriteError> {
        let head = MessageHeader { channel_id, ..*head };
        self.record(|chunks, now| chunks.open().message(&head, message, now))
    }

    /// Writes a record of another file that is no message, after everything accepted so far.
    pub(crate) fn copy_record(&mut self, opcode: u8, body: &[u8]) -> Result<(), WriteError> {
        self.flush()?;
        let threads = self.threads.as_ref().ok_or_else(|| self.refused(Refused::GivenUp))?;
        threads.copy(opcode, body).map_err(WriteError::io(self.path()))
    }

    /// Writes a message about frame `frame` at the simulated time `time_s`.
    pub(crate) fn write(
        &mut self,
        channel: ChannelId,
        frame: u64,
        time_s: f64,
        message: &[u8],
    ) -> Result<(), WriteError> {
        let head = message_head(channel, frame, time_s);
        self.record(|chunks, now| chunks.open().message(&head, message, now))
    }

    /// Writes the messages that frame `frame` consists of, which stay together.
    pub(crate) fn write_frame<const N: usize>(
        &mut self,
        frame: u64,
        time_s: f64,
        messages: [(ChannelId, &[u8]); N],
    ) -> Result<(), WriteError> {
        self.record(|chunks, now| {
            let open = chunks.open();
            for (channel, message) in messages {
                open.message(&message_head(channel, frame, time_s), message, now);
            }
            chunks.end_frame();
        })?;
        self.keep();
        Ok(())
    }

    /// Keeps the file even without [`finish`](Self::finish), because something was recorded.
    pub(crate) fn keep(&mut self) {
        self.file.keep();
    }

    fn record(&self, append: impl FnOnce(&mut Chunks, Instant)) -> Result<(), WriteError> {
        self.queue()?.record(append).map_err(|refused| self.refused(refused))
    }

    fn queue(&self) -> Result<&Queue, WriteError> {
        self.threads.as_ref().map(Threads::queue).ok_or_else(|| self.refused(Refused::GivenUp))
    }

    fn refused(&self, refused: Refused) -> WriteError {
        let path = self.path().to_owned();
        match refused {
            Refused::Failed { source, lost_frames: 0 } => WriteError::Io { path, source },
            Refused::Failed { source, lost_frames } => WriteError::Lost { path, source, lost_frames },
            Refused::GivenUp => WriteError::GivenUp { path },
        }
    }

    /// Writes everything accepted so far, and waits until it is in the file.
    pub(crate) fn flush(&mut self) -> Result<(), WriteError> {
        self.queue()?.flush().map_err(|refused| self.refused(refused))
    }

    /// Writes everything accepted so far, and waits until it is on the disk.
    pub(crate) fn sync(&mut self) -> Result<(), WriteError> {
        self.flush()?;
        let threads = self.threads.as_ref().ok_or_else(|| self.refused(Refused::GivenUp))?;
        threads.sync().map_err(WriteError::io(self.path()))
    }

    /// Bytes in the file so far.
    pub(crate) fn bytes_written(&self) -> u64 {
        self.position.load(Ordering::Relaxed)
    }

    /// Bytes accepted and not yet in the file, before compression.
    pub(crate) fn pending_bytes(&self) -> u64 {
        self.queue().map_or(0, Queue::pending_bytes)
    }

    /// Time spent waiting for the disk.
    pub(crate) fn held_back(&self) -> Duration {
        self.queue().map_or(Duration::ZERO, Queue::held_back)
    }

    /// Path of the file that is being written.
    pub(crate) fn path(&self) -> &Path {
        self.file.partial()
    }

    /// Ends the file with the metadata `end` and gives it its name.
    pub(crate) fn finish(mut self, end: &Metadata, frames: u64) -> Result<Finished, WriteError> {
        let held_back = self.held_back();
        let threads = self.threads.take().ok_or_else(|| self.refused(Refused::GivenUp))?;
        let (mut output, mut sync) = threads.end().map_err(|refused| self.refused(refused))?;
        let Self { schemas, channels, position, file, .. } = self;
        let partial = file.partial().to_owned();
        let io = WriteError::io(&partial);
        output.close(end, &schemas.records, &channels.records).map_err(&io)?;
        sync.finish().map_err(&io)?;
        let uncompressed_bytes = output.uncompressed_bytes();
        let path = file.publish()?;
        let bytes = position.load(Ordering::Relaxed);
        Ok(Finished { path, bytes, uncompressed_bytes, frames, held_back })
    }
}

impl Definitions {
    /// The number of the definition that `record` writes, and its record if it is new. None if there are too many.
    fn add(&mut self, record: impl Fn(u16, &mut Vec<u8>)) -> Option<(u16, Option<Vec<u8>>)> {
        let mut key = Vec::new();
        record(0, &mut key);
        if let Some(number) = self.numbers.get(&key) {
            return Some((*number, None));
        }
        let number = u16::try_from(self.records.len() + 1).ok()?;
        let mut numbered = Vec::new();
        record(number, &mut numbered);
        self.numbers.insert(key, number);
        self.records.push(numbered.clone());
        Some((number, Some(numbered)))
    }
}

fn message_head(ChannelId(channel_id): ChannelId, frame: u64, time_s: f64) -> MessageHeader {
    let time_ns = log_time_ns(time_s);
    #[expect(clippy::cast_possible_truncation, reason = "the low bits: the message has it all")]
    let sequence = frame as u32;
    MessageHeader { channel_id, sequence, log_time: time_ns, publish_time: time_ns }
}

fn about_run_toml(manifest: &RunManifest) -> AttachmentIndex {
    AttachmentIndex {
        offset: 0,
        length: 0,
        log_time: 0,
        create_time: manifest.provenance.started_unix_ns,
        data_size: 0,
        name: head::RUN_TOML.to_owned(),
        media_type: "application/toml".to_owned(),
    }
}

#[cfg(test)]
mod tests;
