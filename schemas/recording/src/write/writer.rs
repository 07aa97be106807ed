//! The recorder: a frame sink into a file.

use crate::PROFILE;
use crate::error::WriteError;
use crate::head::{self, BeginRecord, EndRecord};
use crate::proto;
use crate::read::decode::{self, StateLengths};
use crate::results::row_messages::RowMessages;
use crate::write::channel_writer::{ChannelId, ChannelWriter, Finished, WriteOptions};
use crate::write::encode::{self, StateEncoder};
use prost::Message;
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::RunManifest;
use schemas::results::ResultRow;
use schemas::summary::Summarizer;
use schemas::whole_file::Names;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// Records the frames of one run.
///
/// The file is `<path>.partial` until [`finish`](Self::finish) gives it its name. If the writer is dropped without
/// that, the file stays as it is, a valid prefix with every frame accepted; without any frame it is removed.
pub struct RecordingWriter {
    file: ChannelWriter,
    manifest: RunManifest,
    state: ChannelId,
    summary: ChannelId,
    /// One for each kind of results received, by its topic.
    rows: BTreeMap<String, RowChannel>,
    summarizer: Summarizer,
    encoder: StateEncoder,
    message: Vec<u8>,
    begin: BeginRecord,
    first_step: Option<u64>,
    last_step: Option<u64>,
    frames: u64,
}

/// The channel of a kind of results.
struct RowChannel {
    id: ChannelId,
    messages: RowMessages,
    last_step: u64,
}

impl RecordingWriter {
    /// Starts the recording `path` of the run `manifest`, with `run_toml` as the user gave it.
    ///
    /// # Errors
    /// When there is such a file or its `.partial` and `options.force` is not set, when there is its `.interrupted`,
    /// when another process writes it, when something other than a file has its name, or when the operating system refuses.
    pub fn create(
        path: &Path,
        manifest: &RunManifest,
        run_toml: &str,
        options: &WriteOptions,
    ) -> Result<Self, WriteError> {
        Self::create_from(path, manifest, Some(run_toml), &BeginRecord::default(), options)
    }

    /// Like [`create`](Self::create), for a recording that may begin after the beginning of the run, and whose
    /// configuration may be unknown.
    ///
    /// # Errors
    /// As for [`create`](Self::create).
    pub fn create_from(
        path: &Path,
        manifest: &RunManifest,
        run_toml: Option<&str>,
        begin: &BeginRecord,
        options: &WriteOptions,
    ) -> Result<Self, WriteError> {
        let aside = Names::of_whole(path).aside;
        if aside.symlink_metadata().is_ok() {
            return Err(WriteError::InterruptedExists { path: aside });
        }
        Self::create_beside_old(path, manifest, run_toml, begin, options)
    }

    /// Like [`create_from`](Self::create_from), to resume a recording that was set aside.
    pub(crate) fn create_beside_old(
        path: &Path,
        manifest: &RunManifest,
        run_toml: Option<&str>,
        begin: &BeginRecord,
        options: &WriteOptions,
    ) -> Result<Self, WriteError> {
        let mut file = ChannelWriter::create(PROFILE, path, manifest, begin.metadata(), run_toml, options)?;
        let chain = file.add_channel(proto::CHAIN)?;
        let state = file.add_channel(proto::STATE)?;
        let summary = file.add_channel(proto::SUMMARY)?;
        file.write(chain, 0, 0.0, &encode::chain(&manifest.physics.chain()).encode_to_vec())?;
        Ok(Self {
            file,
            manifest: manifest.clone(),
            state,
            summary,
            rows: BTreeMap::new(),
            summarizer: Summarizer::new(&manifest.physics),
            encoder: StateEncoder::default(),
            message: Vec::new(),
            begin: begin.clone(),
            first_step: None,
            last_step: None,
            frames: 0,
        })
    }

    fn check(&self, frame: &Frame<'_>) -> Result<(), WriteError> {
        let physics = &self.manifest.physics;
        let beads = self.manifest.frame_doubles() - frame.extra.len();
        let what = if frame.u_m.len() != frame.v_m_s.len() || frame.u_m.len() * 2 != beads {
            format!("it has {} beads, the run {}", frame.u_m.len(), physics.beads)
        } else if let Some(last) = self.last_step.filter(|last| *last >= frame.step) {
            format!("step {last} was recorded before")
        } else if frame.step < self.begin.first_step {
            format!("the recording begins with step {}", self.begin.first_step)
        } else if frame.step > physics.step_count {
            format!("the last step of the run is {}", physics.step_count)
        } else if self.manifest.frame_at(frame.step) != frame.frame {
            format!("that step belongs to frame {}", self.manifest.frame_at(frame.step))
        } else {
            return Ok(());
        };
        let path = self.file.path().to_owned();
        Err(WriteError::Frame { path, frame: frame.frame, step: frame.step, what })
    }

    /// Gives the recording up and removes its `.partial`: for a run that never began.
    pub fn discard(self) {
        self.file.discard();
    }

    /// Records a row of results, in the order of frames within each kind. Its channel is added with the first row.
    ///
    /// # Errors
    /// When the row is not of this run, not after the row before, or of other columns than that one, or when writing fails.
    pub fn write_row(&mut self, rows: &RowMessages, row: &ResultRow<'_>) -> Result<(), WriteError> {
        let before = self.rows.get_mut(rows.topic());
        self.message.clear();
        let encoded = if self.manifest.step_of_frame(row.frame) != row.step {
            Err(format!("that frame is step {}", self.manifest.step_of_frame(row.frame)))
        } else if let Some(last) = before.as_ref().map(|it| it.last_step).filter(|last| *last >= row.step) {
            Err(format!("the row of step {last} was recorded before"))
        } else if let Some(other) = before.as_ref().and_then(|it| it.messages.difference(rows)) {
            Err(format!("{other}; record them into a recording of their own"))
        } else {
            rows.encode(row, &mut self.message)
        };
        encoded.map_err(|what| WriteError::Frame {
            path: self.file.path().to_owned(),
            frame: row.frame,
            step: row.step,
            what: format!("a row of {}: {what}", rows.topic()),
        })?;
        let id = if let Some(channel) = before {
            channel.last_step = row.step;
            channel.id
        } else {
            let (id, messages) = (rows.add_to(&mut self.file)?, rows.clone());
            let channel = RowChannel { id, messages, last_step: row.step };
            self.rows.insert(rows.topic().to_owned(), channel);
            id
        };
        self.file.write(id, row.frame, row.time_s, &self.message)?;
        self.file.keep();
        Ok(())
    }

    /// SHA-256 of the state encoded last, in hex; none before the first.
    pub fn last_state_hash(&self) -> Option<String> {
        let step = self.last_step?;
        let mut doubles = Vec::new();
        decode::state(self.encoder.last(), StateLengths::of(&self.manifest), &mut doubles).ok()?;
        Some(head::state_hash(step, &doubles))
    }

    /// Writes the frames accepted so far, and waits until a kill costs none of them. Without this call they are
    /// written within [`WriteOptions::flush_period`].
    ///
    /// # Errors
    /// When writing fails.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.file.flush()
    }

    /// Like [`flush`](Self::flush), and waits until a power failure costs none of them either.
    ///
    /// # Errors
    /// When writing fails.
    pub fn sync(&mut self) -> Result<(), WriteError> {
        self.file.sync()
    }

    /// The channels beside those of the frames.
    pub(crate) fn channels(&mut self) -> &mut ChannelWriter {
        &mut self.file
    }

    /// Time spent waiting for the disk: frames are accepted until [`WriteOptions::queue_bytes`] wait for it.
    pub fn held_back(&self) -> Duration {
        self.file.held_back()
    }

    /// Bytes that wait in memory to be written, before compression.
    pub fn pending_bytes(&self) -> u64 {
        self.file.pending_bytes()
    }

    /// Bytes on the disk so far.
    pub fn bytes_written(&self) -> u64 {
        self.file.bytes_written()
    }

    /// Frames recorded so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Ends the recording for `reason`, on the disk and under its name.
    ///
    /// # Errors
    /// When writing fails, or when a file of this name appeared meanwhile; the `.partial` then stays.
    pub fn finish(self, reason: EndReason) -> Result<Finished, WriteError> {
        let end = EndRecord {
            reason,
            first_step: self.first_step,
            last_step: self.last_step,
            part: self.begin.part,
            previous_state_hash: self.begin.previous_state_hash.clone(),
            last_state_hash: self.last_state_hash(),
        };
        self.file.finish(&end.metadata(), self.frames)
    }
}

impl FrameSink for RecordingWriter {
    type Error = WriteError;

    /// Records `frame`, or a state that was recomputed between two frames. The caller chooses the frames that are due
    /// ([`RunManifest::is_recorded`], and the last frame of a run that is interrupted).
    ///
    /// # Errors
    /// When the frame is not one of this run or not after the frame before, or when writing this one or one
    /// before it fails; the file then ends with the last whole chunk.
    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), WriteError> {
        self.check(frame)?;
        let summary = self.summarizer.summarize(frame);
        self.message.clear();
        encode::summary(frame, &summary).encode_raw(&mut self.message);
        let is_frame = self.manifest.is_frame(frame.step);
        let messages = [(self.state, self.encoder.encode(frame, is_frame)), (self.summary, &self.message)];
        self.file.write_frame(frame.frame, frame.time_s, messages)?;
        self.frames += 1;
        self.first_step.get_or_insert(frame.step);
        self.last_step = Some(frame.step);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::messages::MessageReader;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    #[test]
    fn chain_and_summaries_are_those_of_the_run() {
        let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&PRESETS[0].config(), "test", origin).expect("preset");
        let directory = tempfile::tempdir().expect("directory");
        let path = directory.path().join("test.mcap");
        let (mut u_m, v_m_s) = manifest.physics.initial_state();
        u_m[500] = 1e-5;
        let frame =
            Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
        let mut writer =
            RecordingWriter::create(&path, &manifest, "", &WriteOptions::default()).expect("new");
        writer.accept(&frame).expect("accepted");
        writer.finish(EndReason::Interrupted).expect("finished");

        let mut reader = MessageReader::open(&path).expect("ours");
        let mut next = |topic: &str| {
            let message = reader.next().expect("readable").expect("message");
            assert_eq!(
                (message.channel.topic.as_str(), message.channel.message_encoding.as_str()),
                (topic, "protobuf")
            );
            message.data.to_vec()
        };
        let chain = proto::Chain::decode(next("/chain").as_slice()).expect("chain");
        let expected = manifest.physics.chain();
        assert_eq!(
            (chain.mass_kg, chain.stiffness, chain.rest_overlap_m, chain.alpha),
            (expected.mass_kg, expected.stiffness, expected.rest_overlap_m, 1.5)
        );
        next("/state");
        let summary = proto::Summary::decode(next("/summary").as_slice()).expect("summary");
        let expected = Summarizer::new(&manifest.physics).summarize(&frame);
        assert_eq!(
            (summary.kinetic_j, summary.total_j),
            (expected.energy.kinetic_j, expected.energy.total_j())
        );
        assert_eq!(summary.relative_drift, expected.relative_drift);
        assert_eq!((summary.impurity[0].bead, summary.impurity[0].displacement_m), (500, 1e-5));
    }
}
