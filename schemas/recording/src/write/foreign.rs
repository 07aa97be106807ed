//! MCAP files for other people's programs: their channels, schemas and messages.

use crate::error::WriteError;
use crate::proto::DescribedTopic;
use crate::write::channel_writer::{ChannelId, ChannelWriter, Finished, WriteOptions};
use mcap::records::Metadata;
use schemas::manifest::RunManifest;
use std::path::Path;

/// Metadata record that names the exported part of a run.
const EXPORT: &str = "beadline.export";

/// Writes an MCAP file with channels of any protobuf messages, whole or not at all. The file holds the manifest of the
/// run like a recording, but is not one: our readers refuse it because it has no profile.
pub struct ForeignWriter {
    file: ChannelWriter,
    messages: u64,
}

/// A channel of a [`ForeignWriter`].
#[derive(Debug, Clone, Copy)]
pub struct ForeignChannel(ChannelId);

impl ForeignWriter {
    /// Creates `<path>.partial` with the manifest.
    ///
    /// # Errors
    /// When there is such a file or its `.partial` and `options.force` is not set, when another process
    /// writes it, when something other than a file has its name, or when the operating system refuses.
    pub fn create(path: &Path, manifest: &RunManifest, options: &WriteOptions) -> Result<Self, WriteError> {
        let file = ChannelWriter::create("", path, manifest, None, None, options)?;
        Ok(Self { file, messages: 0 })
    }

    /// Adds a channel.
    ///
    /// # Errors
    /// When there are too many, or writing fails.
    pub fn add_channel(&mut self, topic: &DescribedTopic<'_>) -> Result<ForeignChannel, WriteError> {
        self.file.add_channel(*topic).map(ForeignChannel)
    }

    /// Writes a message about the simulated time `time_s`; `sequence` numbers those of its channel.
    ///
    /// # Errors
    /// When writing this message or one before it fails; the writer then takes nothing more.
    pub fn write(
        &mut self,
        ForeignChannel(channel): ForeignChannel,
        sequence: u64,
        time_s: f64,
        message: &[u8],
    ) -> Result<(), WriteError> {
        self.messages += 1;
        self.file.write(channel, sequence, time_s, message)
    }

    /// Closes the chunk: the next message begins another one.
    ///
    /// # Errors
    /// When writing fails.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.file.flush()
    }

    /// Ends the file, with the metadata `about` the exported part of the run, and gives it its name.
    ///
    /// # Errors
    /// When writing fails, or when a file of this name appeared meanwhile.
    pub fn finish(self, about: &[(&str, String)]) -> Result<Finished, WriteError> {
        let metadata = about.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
        self.file.finish(&Metadata { name: EXPORT.to_owned(), metadata }, self.messages)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadError, RecordingInfo};
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    fn manifest() -> RunManifest {
        let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 0 };
        RunManifest::new(&PRESETS[0].config(), "test", origin).expect("preset")
    }

    #[test]
    fn a_foreign_file_is_mcap_with_our_manifest_but_no_recording() {
        let directory = tempfile::tempdir().expect("directory");
        let path = directory.path().join("test.mcap");
        let manifest = manifest();
        let mut file = ForeignWriter::create(&path, &manifest, &WriteOptions::default()).expect("new");
        let topic = DescribedTopic { topic: "/words", message: "words.Word", descriptor: b"described" };
        let channel = file.add_channel(&topic).expect("channel");
        file.write(channel, 7, 0.5, b"word").expect("written");
        file.finish(&[("states", "0".into())]).expect("finished");

        let bytes = std::fs::read(&path).expect("there");
        let messages: Vec<_> =
            mcap::MessageStream::new(&bytes).expect("MCAP").collect::<Result<_, _>>().expect("messages");
        let [message] = &messages[..] else { panic!("{messages:?}") };
        assert_eq!((message.sequence, message.log_time, &message.data[..]), (7, 500_000_000, &b"word"[..]));
        let channel = &message.channel;
        assert_eq!((channel.topic.as_str(), channel.message_encoding.as_str()), ("/words", "protobuf"));
        assert_eq!(channel.schema.as_ref().map(|schema| schema.name.as_str()), Some("words.Word"));
        assert!(matches!(RecordingInfo::read(&path), Err(ReadError::NotBeadline { .. })));
    }

    #[test]
    fn nothing_is_left_of_a_foreign_file_that_was_not_finished() {
        let directory = tempfile::tempdir().expect("directory");
        let path = directory.path().join("test.mcap");
        let mut file = ForeignWriter::create(&path, &manifest(), &WriteOptions::default()).expect("new");
        let topic = DescribedTopic { topic: "/a", message: "a", descriptor: b"" };
        let channel = file.add_channel(&topic).expect("channel");
        file.write(channel, 0, 0.0, b"a").expect("written");
        drop(file);
        assert_eq!(std::fs::read_dir(directory.path()).expect("directory").count(), 0);
    }
}
