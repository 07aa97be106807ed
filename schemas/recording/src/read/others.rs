//! Channels beside the frames of a run: results of analyses, messages of other programs.

use crate::error::{ReadError, WriteError};
use crate::read::contents::OtherRecords;
use crate::read::messages::{MessageReader, RawMessage};
use crate::read::records::{RawRecord, RecordReader};
use crate::write::channel_writer::{ChannelId, ChannelWriter};
use crate::write::writer::RecordingWriter;
use crate::{log_time_ns, proto};
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};

/// The messages of a recording other than its chain, states and summaries, to be copied whole into another recording,
/// whatever they are.
///
/// They are copied in the order of the file and by their log times, so that they stand in the new file
/// after the frames that they belong to. Reads the file apart from the reader of states.
pub struct OtherChannels {
    messages: MessageReader,
    copier: OtherCopier,
    /// A message that was read but not copied yet, because it is later than the time asked for.
    pending: Option<(ChannelId, MessageHeader)>,
    /// The contents of that message.
    pending_bytes: Vec<u8>,
    copied_count: u64,
    /// True if there are no more messages.
    ended: bool,
}

/// Why messages could not be copied.
#[derive(Debug, thiserror::Error)]
pub enum CopyError {
    /// The old file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The new file would lack something.
    #[error(
        "{} has {what}; `beadline recover {} --out OTHER.mcap` leaves them out",
        path.display(), path.display()
    )]
    Lost {
        /// The old file.
        path: PathBuf,
        /// The contents.
        what: String,
    },
}

impl OtherChannels {
    /// Opens the recording `path`.
    ///
    /// # Errors
    /// When it cannot be read, is no recording, or is of another major schema version.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Ok(Self {
            messages: MessageReader::open(path)?,
            copier: OtherCopier::default(),
            pending: None,
            pending_bytes: Vec::new(),
            copied_count: 0,
            ended: false,
        })
    }

    /// Copies the messages before the simulated time `time_s`. Call it before the frame of that time is written, so that
    /// results of a frame come after it.
    ///
    /// # Errors
    /// When the old file is damaged, or the new one cannot be written.
    pub fn copy_before(&mut self, time_s: f64, writer: &mut RecordingWriter) -> Result<(), CopyError> {
        self.copy(Some(log_time_ns(time_s)), writer.channels())
    }

    /// Copies what is left, and the attachments, metadata and private records of others.
    ///
    /// # Errors
    /// As [`copy_before`](Self::copy_before), and when the old file has contents that cannot be copied.
    pub fn copy_rest(&mut self, writer: &mut RecordingWriter) -> Result<(), CopyError> {
        self.copy(None, writer.channels())?;
        let (path, records) = (self.messages.path(), &self.messages.contents().others);
        match records.missing() {
            None => records.copy(path, writer),
            Some(what) => Err(CopyError::Lost { path: path.to_owned(), what }),
        }
    }

    /// Messages copied so far.
    pub fn copied_count(&self) -> u64 {
        self.copied_count
    }

    fn copy(&mut self, before_ns: Option<u64>, file: &mut ChannelWriter) -> Result<(), CopyError> {
        let is_later = |head: &MessageHeader| before_ns.is_some_and(|end_ns| head.log_time >= end_ns);
        if let Some((channel, head)) = self.pending {
            if is_later(&head) {
                return Ok(());
            }
            file.copy(channel, &head, &self.pending_bytes)?;
            self.pending = None;
            self.copied_count += 1;
        }
        while !self.ended {
            let Some(message) = self.messages.next()? else {
                // where a file is torn, the next attempt would find an error
                self.ended = true;
                break;
            };
            if proto::OF_FRAMES.contains(&message.channel.topic.as_str()) {
                continue;
            }
            let channel = self.copier.id(&message, file)?;
            if is_later(&message.head) {
                self.pending = Some((channel, message.head));
                self.pending_bytes.clear();
                self.pending_bytes.extend_from_slice(message.data);
                return Ok(());
            }
            file.copy(channel, &message.head, message.data)?;
            self.copied_count += 1;
        }
        Ok(())
    }
}

impl OtherRecords {
    /// Those that no copy has, if there are any.
    pub(crate) fn missing(&self) -> Option<String> {
        let lost: Vec<_> = self.lost.iter().map(String::as_str).collect();
        (!lost.is_empty()).then(|| format!("contents that cannot be copied: {}", lost.join(", ")))
    }

    /// All of them.
    pub fn into_names(self) -> Vec<String> {
        self.whole.into_values().chain(self.lost).collect()
    }

    /// Copies those of the file `from` that can be copied, after everything that `writer` has accepted.
    ///
    /// # Errors
    /// When the old file cannot be read, or the new one cannot be written.
    pub fn copy(&self, from: &Path, writer: &mut RecordingWriter) -> Result<(), CopyError> {
        if self.whole.is_empty() {
            return Ok(());
        }
        let mut records = RecordReader::open(from)?;
        for offset in self.whole.keys() {
            records.seek(*offset)?;
            if let Some(RawRecord { opcode, body, .. }) = records.next()? {
                writer.channels().copy_record(opcode, body)?;
            }
        }
        Ok(())
    }
}

/// A message of another channel.
#[derive(Debug)]
pub struct OtherMessage<'a> {
    message: RawMessage<'a>,
}

impl<'a> OtherMessage<'a> {
    pub(crate) fn new(message: RawMessage<'a>) -> Self {
        Self { message }
    }

    /// Its topic.
    pub fn topic(&self) -> &str {
        &self.message.channel.topic
    }

    /// True if the CRC of its chunk holds.
    pub fn is_checked(&self) -> bool {
        self.message.is_checked
    }
}

/// Copies messages of other channels into a new recording.
#[derive(Debug, Default)]
pub struct OtherCopier {
    /// Number of the channel in the new file, for each in the old one that has had a message.
    ids: BTreeMap<u16, ChannelId>,
}

impl OtherCopier {
    /// Copies `message` as it is.
    ///
    /// # Errors
    /// When writing fails.
    pub fn copy(
        &mut self,
        message: &OtherMessage<'_>,
        writer: &mut RecordingWriter,
    ) -> Result<(), WriteError> {
        let file = writer.channels();
        let RawMessage { head, data, .. } = &message.message;
        let id = self.id(&message.message, file)?;
        file.copy(id, head, data)
    }

    /// Number of the channel of `message` in the new file, where it is defined with its first message.
    fn id(&mut self, message: &RawMessage<'_>, file: &mut ChannelWriter) -> Result<ChannelId, WriteError> {
        match self.ids.entry(message.head.channel_id) {
            Entry::Occupied(known) => Ok(*known.get()),
            Entry::Vacant(new) => Ok(*new.insert(file.copy_channel(message.channel)?)),
        }
    }
}
