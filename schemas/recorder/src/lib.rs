//! Records the frames and the results of a live run into one recording: one thread for the frames, one for each topic of
//! results.

mod rows;

pub use rows::{RowTally, RowThreads};

use bus::StreamId;
use recording::{DiskWatch, Finished, PartsWriter, RowMessages, WriteError};
use schemas::frame::{EndReason, Frame, FrameSink as _, HeldFrame};
use schemas::manifest::RunManifest;
use schemas::results::ResultRow;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// State that the threads share. Rows may come before the run was joined, and after its last frame.
#[derive(Default)]
pub struct Recorder {
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    recording: Option<Recording>,
    /// Failure of a thread that records rows.
    failure: Option<WriteError>,
    end: Option<RowsEnd>,
    /// True if the disk has no room for frames or rows.
    is_full: bool,
}

/// Most bytes of the indexes that are written when a recording ends: those of many
/// small chunks.
fn end_bytes(written_bytes: u64) -> u64 {
    (64 << 10) + (written_bytes / 16).min(16 << 20) // integers
}

/// A recording under way.
struct Recording {
    parts: PartsWriter,
    manifest: RunManifest,
    stream: StreamId,
    first_frame: u64,
    /// The first frame that reached us; from there on no row may be missing.
    joined_at: u64,
    /// True if the recording has rows.
    has_rows: bool,
}

/// End of the frames; rows may still come.
#[derive(Debug, Clone, Copy)]
struct RowsEnd {
    last_frame: Option<u64>,
    since: Instant,
    /// Longest silence of a publisher.
    patience: Duration,
}

/// Fate of a row.
enum RowFate {
    /// The row is in the recording, which was joined at this frame.
    Recorded { joined_at: u64 },
    /// The row belongs to another stream, to a frame before the first or after the last one, or is there already.
    NotOurs,
    /// Nothing is being recorded yet.
    TooEarly,
}

impl Recorder {
    fn state(&self) -> MutexGuard<'_, State> {
        // a thread that panicked has said why; what was recorded stays
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a recording in `parts`, which record the frames of `stream` from `first_frame` on. The frames before
    /// `joined_at` are recomputed.
    pub fn begin(
        &self,
        parts: PartsWriter,
        manifest: &RunManifest,
        stream: StreamId,
        (first_frame, joined_at): (u64, u64),
    ) {
        let manifest = manifest.clone();
        let recording = Recording { parts, manifest, stream, first_frame, joined_at, has_rows: false };
        self.state().recording = Some(recording);
    }

    /// Notes that the frames are over. `last_frame` is the last one recorded. A publisher of results may be silent for
    /// `patience` before it is given up.
    pub fn end_frames(&self, last_frame: Option<u64>, patience: Duration) {
        self.state().end = Some(RowsEnd { last_frame, since: Instant::now(), patience });
    }

    /// Records a frame if it is due, and returns true if `disk` has room for more; all under one lock.
    fn take(&self, frame: &Frame<'_>, is_due: bool, disk: &mut DiskWatch) -> Result<bool, WriteError> {
        let mut state = self.state();
        let Some(recording) = state.recording()? else { return Ok(true) };
        if is_due {
            recording.parts.accept(frame)?;
        }
        let parts = &recording.parts;
        let pending = || parts.pending_bytes() + end_bytes(parts.bytes_written());
        let is_short = disk.is_short(parts.bytes_written(), pending)?;
        state.is_full = is_short;
        Ok(!is_short)
    }

    /// Records the last frame.
    fn take_last(&self, frame: &Frame<'_>) -> Result<(), WriteError> {
        self.state().recording()?.map_or(Ok(()), |recording| recording.parts.accept(frame))
    }

    /// Records a row of `stream` as one of `messages`, which are made with the first row.
    fn write_row(
        &self,
        stream: StreamId,
        row: &ResultRow<'_>,
        messages: &mut Option<RowMessages>,
        make: impl FnOnce(&RunManifest) -> Result<RowMessages, String>,
    ) -> Result<RowFate, String> {
        let mut state = self.state();
        let is_full = state.is_full;
        let last_frame = state.end.map_or(u64::MAX, |end| end.last_frame.unwrap_or(0));
        let Some(recording) = &mut state.recording else { return Ok(RowFate::TooEarly) };
        if is_full
            || stream != recording.stream
            || row.frame < recording.first_frame
            || row.frame > last_frame
        {
            return Ok(RowFate::NotOurs);
        }
        let messages = match messages {
            Some(messages) => messages,
            None => messages.insert(make(&recording.manifest)?),
        };
        match recording.parts.write_row(messages, row) {
            Ok(()) => {
                recording.has_rows = true;
                Ok(RowFate::Recorded { joined_at: recording.joined_at })
            }
            Err(error @ WriteError::Frame { .. }) => Err(error.to_string()),
            Err(error) => {
                let text = error.to_string();
                state.failure.get_or_insert(error);
                Err(text)
            }
        }
    }

    /// Bytes on the disk, and number of finished parts.
    pub fn size(&self) -> (u64, usize) {
        self.state()
            .recording
            .as_ref()
            .map_or((0, 0), |recording| (recording.parts.bytes_written(), recording.parts.finished().len()))
    }

    /// Ends the recording for `reason`; discards it if it has no frame and no row.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn finish(&self, reason: EndReason) -> Result<Vec<Finished>, WriteError> {
        let mut state = self.state();
        state.recording()?;
        match state.recording.take() {
            Some(recording) if recording.has_rows || recording.parts.frames() > 0 => {
                recording.parts.finish(reason)
            }
            Some(recording) => {
                recording.parts.discard();
                Ok(Vec::new())
            }
            None => Ok(Vec::new()),
        }
    }
}

impl State {
    /// The recording under way, unless a thread that records rows has failed: each failure is reported once.
    fn recording(&mut self) -> Result<Option<&mut Recording>, WriteError> {
        self.failure.take().map_or(Ok(self.recording.as_mut()), Err)
    }
}

/// Records the frames of a run that are due, and the first and the last one.
pub struct DueFrames<'a> {
    recorder: &'a Recorder,
    manifest: &'a RunManifest,
    disk: DiskWatch,
    /// The last frame that was not due, in reused memory.
    passed: HeldFrame,
    /// True if `passed` is the last frame so far.
    ends_with_passed: bool,
    first: Option<u64>,
    last: Option<u64>,
}

impl<'a> DueFrames<'a> {
    /// Makes one for the run of `manifest`, which records as long as `disk` has room.
    pub fn new(recorder: &'a Recorder, manifest: &'a RunManifest, disk: DiskWatch) -> Self {
        Self {
            recorder,
            manifest,
            disk,
            passed: HeldFrame::default(),
            ends_with_passed: false,
            first: None,
            last: None,
        }
    }

    /// Takes the next frame, and returns true if the disk has room for more.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn take(&mut self, frame: &Frame<'_>) -> Result<bool, WriteError> {
        let is_due = self.first.is_none() || self.manifest.is_recorded(frame.step);
        self.ends_with_passed = !is_due;
        if !is_due {
            self.passed.hold(frame);
        }
        self.first.get_or_insert(frame.frame);
        self.last = Some(frame.frame);
        self.recorder.take(frame, is_due, &mut self.disk)
    }

    /// Records the last frame, if it was not due, and returns the first and the last one.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn finish(self) -> Result<Option<(u64, u64)>, WriteError> {
        if self.ends_with_passed {
            self.recorder.take_last(&self.passed.frame())?;
        }
        Ok(self.first.zip(self.last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::{Split, WriteOptions};
    use schemas::manifest::{Origin, RunId};
    use schemas::presets::PRESETS;
    use schemas::results::{ResultColumns, RowValues, Topic};

    /// Rows may come before the first frame, and are kept if none comes.
    #[test]
    fn a_recording_with_rows_alone_is_kept() {
        let dir = tempfile::tempdir().unwrap();
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&PRESETS[2].config(), "run", origin).unwrap();
        for has_row in [true, false] {
            let path = dir.path().join(format!("{has_row}.mcap"));
            let (options, split) = (WriteOptions::default(), Split { bytes: None, duration_s: None });
            let parts = PartsWriter::create(&path, &manifest, None, 0, &options, &split).unwrap();
            let stream = StreamId::new(RunId([1; 16]));
            let recorder = Recorder::default();
            recorder.begin(parts, &manifest, stream, (0, 0));
            if has_row {
                let row = ResultRow { frame: 0, step: 0, time_s: 0.0, values: RowValues::Numbers(&[0.0]) };
                let make = |run: &_| RowMessages::new(Topic::own("x")?, &ResultColumns::named(&["a_m"]), run);
                let fate = recorder.write_row(stream, &row, &mut None, make).unwrap();
                assert!(matches!(fate, RowFate::Recorded { joined_at: 0 }));
            }
            let finished = recorder.finish(EndReason::Detached).unwrap();
            assert_eq!((finished.len(), path.exists()), (usize::from(has_row), has_row));
        }
    }
}
