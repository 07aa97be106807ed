//! Channels of messages into an MCAP file that survives a crash at any moment.

use super::PROFILE;
use super::contents::Channel;
use super::error::WriteError;
use super::head;
use super::log_time_ns;
use super::proto::Topic;
use super::sink::{Position, Sink};
use super::sync::BackgroundSync;
use crate::manifest::RunManifest;
use crate::whole_file::WholeFile;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapError, McapResult};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How a recording is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriteOptions {
    /// Overwrite existing files. Default: no.
    pub force: bool,
    /// Compression of chunks. Default: zstd level 1.
    pub compression: Compression,
    /// A chunk is closed once it holds more than this, uncompressed. Default: 1 MiB.
    pub chunk_bytes: u64,
    /// Longest time that a frame waits in memory: what a kill costs. Default: 1 s.
    pub flush_period: Duration,
    /// Longest time between two syncs to the disk: what a power failure costs. Default: 5 s.
    pub sync_period: Duration,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self {
            force: false,
            compression: Compression::Zstd { level: 1 },
            chunk_bytes: 1 << 20,
            flush_period: Duration::from_secs(1),
            sync_period: Duration::from_secs(5),
        }
    }
}

/// How chunks are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compression {
    /// Not at all.
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
    /// Where it is.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// The size of its messages before compression.
    pub uncompressed_bytes: u64,
    /// Number of states, or of rows of a contacts map.
    pub frames: u64,
}

/// A channel of a [`ChannelWriter`].
#[derive(Debug, Clone, Copy)]
pub(super) struct ChannelId(u16);

/// Writes messages of several channels under one manifest.
///
/// After an error the file ends with the last whole record, and nothing more is taken.
pub(super) struct ChannelWriter {
    writer: OpenWriter,
    sync: BackgroundSync,
    file: WholeFile,
    position: Position,
    flush_period: Duration,
    sync_period: Duration,
    flushed: Instant,
    synced: Instant,
}

impl ChannelWriter {
    /// Creates `<path>.partial` with its head: manifest and configuration, on the disk.
    pub(super) fn create(
        path: &Path,
        manifest: &RunManifest,
        run_toml: Option<&str>,
        options: &WriteOptions,
    ) -> Result<Self, WriteError> {
        let file = WholeFile::create(path, options.force)?;
        let (sink, position) = Sink::new(Arc::clone(file.file()));
        let writer = mcap_options(options).create(sink).map_err(|error| mcap_error(&file, error))?;
        let now = Instant::now();
        let mut this = Self {
            writer: OpenWriter(Some(writer)),
            sync: BackgroundSync::default(),
            file,
            position,
            flush_period: options.flush_period,
            sync_period: options.sync_period,
            flushed: now,
            synced: now,
        };
        this.write_head(manifest, run_toml)?;
        Ok(this)
    }

    fn write_head(&mut self, manifest: &RunManifest, run_toml: Option<&str>) -> Result<(), WriteError> {
        self.write_with(|writer| {
            writer.write_metadata(&head::run_metadata(manifest))?;
            match run_toml {
                Some(text) => writer.attach(&attachment(manifest, text)),
                None => Ok(()),
            }
        })?;
        self.file.file().sync_data().map_err(WriteError::io(self.file.partial()))?;
        Ok(self.file.sync_name()?)
    }

    /// Writes a metadata record.
    pub(super) fn write_metadata(&mut self, record: &Metadata) -> Result<(), WriteError> {
        self.write_with(|writer| writer.write_metadata(record))
    }

    /// Something was recorded: without [`finish`](Self::finish) the file stays as it is, else it goes.
    pub(super) fn keep(&mut self) {
        self.file.keep();
    }

    /// Removes the file.
    pub(super) fn discard(self) {
        self.file.discard();
    }

    /// Adds the channel of `topic`.
    pub(super) fn add_channel(&mut self, topic: Topic) -> Result<ChannelId, WriteError> {
        self.write_with(|writer| {
            let schema = writer.add_schema(topic.message, "protobuf", topic.descriptor)?;
            writer.add_channel(schema, topic.topic, "protobuf", &BTreeMap::new()).map(ChannelId)
        })
    }

    /// Adds a channel like `channel` of another file.
    pub(super) fn copy_channel(&mut self, channel: &Channel) -> Result<ChannelId, WriteError> {
        let Channel { topic, message_encoding, metadata, schema } = channel;
        self.write_with(|writer| {
            let schema_id = match schema.name.as_str() {
                "" => 0,
                name => writer.add_schema(name, &schema.encoding, &schema.text)?,
            };
            writer.add_channel(schema_id, topic, message_encoding, metadata).map(ChannelId)
        })
    }

    /// Writes a message of another file, with the times and the number in its `head`, to a channel of this one.
    pub(super) fn copy(
        &mut self,
        ChannelId(channel_id): ChannelId,
        head: &MessageHeader,
        message: &[u8],
    ) -> Result<(), WriteError> {
        let header = MessageHeader { channel_id, ..*head };
        self.write_with(|writer| writer.write_to_known_channel(&header, message))
    }

    /// Writes a message about frame `frame` at the simulated time `time_s`.
    pub(super) fn write(
        &mut self,
        ChannelId(channel_id): ChannelId,
        frame: u64,
        time_s: f64,
        message: &[u8],
    ) -> Result<(), WriteError> {
        let time_ns = log_time_ns(time_s);
        #[expect(clippy::cast_possible_truncation, reason = "the low bits: the message has it all")]
        let sequence = frame as u32;
        let header = MessageHeader { channel_id, sequence, log_time: time_ns, publish_time: time_ns };
        self.write_with(|writer| writer.write_to_known_channel(&header, message))
    }

    /// Closes the open chunk if the flush period is over, and has it synced if the sync period is.
    pub(super) fn flush_if_due(&mut self) -> Result<(), WriteError> {
        let now = Instant::now();
        let sync_is_due = now.duration_since(self.synced) >= self.sync_period;
        if sync_is_due || now.duration_since(self.flushed) >= self.flush_period {
            self.flush()?;
        }
        if sync_is_due {
            self.sync.request(self.file.file()).map_err(WriteError::io(self.file.partial()))?;
            self.synced = now;
        }
        Ok(())
    }

    /// Closes the open chunk.
    pub(super) fn flush(&mut self) -> Result<(), WriteError> {
        self.write_with(mcap::Writer::flush)?;
        self.flushed = Instant::now();
        Ok(())
    }

    /// Bytes on the disk so far.
    pub(super) fn bytes_written(&self) -> u64 {
        self.position.get()
    }

    /// Where the bytes are.
    pub(super) fn path(&self) -> &Path {
        self.file.partial()
    }

    /// Ends the file with the metadata `end` and gives it its name.
    pub(super) fn finish(mut self, end: &Metadata, frames: u64) -> Result<Finished, WriteError> {
        let summary = self.write_with(|writer| {
            writer.write_metadata(end)?;
            writer.finish()
        })?;
        let bytes = self.bytes_written();
        let uncompressed_bytes = summary.chunk_indexes.iter().map(|index| index.uncompressed_size).sum();
        let Self { mut writer, mut sync, file, .. } = self;
        drop(writer.0.take());
        sync.finish().map_err(WriteError::io(file.partial()))?;
        let path = file.publish()?;
        Ok(Finished { path, bytes, uncompressed_bytes, frames })
    }

    /// Does `work`; if it fails, the file ends where it ended before, on a record boundary.
    fn write_with<T>(
        &mut self,
        work: impl FnOnce(&mut mcap::Writer<Sink>) -> McapResult<T>,
    ) -> Result<T, WriteError> {
        let whole_bytes = self.bytes_written();
        let Some(writer) = &mut self.writer.0 else {
            return Err(WriteError::GivenUp { path: self.file.partial().to_owned() });
        };
        work(writer).map_err(|error| {
            // without the end that dropping it would write
            drop(self.writer.0.take().map(mcap::Writer::into_inner));
            // at best: the write error is what the user has to know
            let _ = self.file.file().set_len(whole_bytes);
            mcap_error(&self.file, error)
        })
    }
}

/// A writer that, left without an end, writes its open chunk and nothing more. None once writing failed.
struct OpenWriter(Option<mcap::Writer<Sink>>);

impl Drop for OpenWriter {
    fn drop(&mut self) {
        if let Some(mut writer) = self.0.take() {
            // whoever wants to know calls `finish`
            let _ = writer.flush();
            drop(writer.into_inner());
        }
    }
}

fn mcap_options(options: &WriteOptions) -> mcap::WriteOptions {
    let (compression, level) = match options.compression {
        Compression::None => (None, 0),
        Compression::Zstd { level } => (Some(mcap::Compression::Zstd), level.clamp(1, 22)),
    };
    mcap::WriteOptions::new()
        .profile(PROFILE)
        .library(concat!("beadline ", env!("CARGO_PKG_VERSION")))
        .compression(compression)
        .compression_level(level)
        // none beyond the caller's: chunks are too small to share out, and a run has its own use for cores
        .compression_threads(0)
        .chunk_size(Some(options.chunk_bytes))
        // a chunk is written whole or not at all
        .disable_seeking(true)
}

fn attachment<'a>(manifest: &RunManifest, run_toml: &'a str) -> Attachment<'a> {
    Attachment {
        log_time: 0,
        create_time: manifest.provenance.started_unix_ns,
        name: head::RUN_TOML.to_owned(),
        media_type: "application/toml".to_owned(),
        data: Cow::Borrowed(run_toml.as_bytes()),
    }
}

fn mcap_error(file: &WholeFile, error: McapError) -> WriteError {
    let source = match error {
        McapError::Io(source) => source,
        other => std::io::Error::other(other),
    };
    WriteError::Io { path: file.partial().to_owned(), source }
}
