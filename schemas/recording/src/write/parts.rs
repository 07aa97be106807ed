//! A recording in one file, or in parts that each open by themselves.

use crate::error::WriteError;
use crate::head::BeginRecord;
use crate::results::row_messages::RowMessages;
use crate::write::channel_writer::{Finished, WriteOptions};
use crate::write::writer::RecordingWriter;
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::RunManifest;
use schemas::results::ResultRow;
use schemas::whole_file::{LockedFile, WholeFileError, directory_of};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// Conditions for continuing a recording in another part.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Split {
    /// Size of a part on the disk (bytes) at which the next frame begins another one.
    pub bytes: Option<u64>,
    /// Simulated time (s) of a part: the first frame at or after each multiple of it begins another one.
    pub duration_s: Option<f64>,
}

impl Split {
    /// Smallest part: a chunk of a part must be a small piece of it.
    pub const LEAST_BYTES: u64 = 100_000;

    /// True if the recording is split into parts.
    pub fn is_split(&self) -> bool {
        *self != Self::default()
    }

    /// Number of the interval of simulated time that `time_s` is in. What rounding leaves of a multiple is one.
    fn slot(&self, time_s: f64) -> f64 {
        self.duration_s.map_or(0.0, |duration_s| (time_s / duration_s * (1.0 + 1e-12)).floor())
    }
}

/// The name of part `part` of the recording `path`: `NAME-part-0001.mcap` of `NAME.mcap`.
pub fn part_path(path: &Path, part: u64) -> PathBuf {
    let mut name = stem(path);
    name.push(format!("-part-{part:04}.mcap"));
    path.with_file_name(name)
}

fn stem(path: &Path) -> OsString {
    path.file_stem().unwrap_or_default().to_owned()
}

/// The existing parts of a recording `path`, finished or not, by their numbers.
fn parts_there(path: &Path) -> Result<Vec<(u64, PathBuf)>, WriteError> {
    let directory = directory_of(path);
    let mut parts = Vec::new();
    for entry in fs::read_dir(directory).map_err(WriteError::io(directory))? {
        let entry = entry.map_err(WriteError::io(directory))?;
        let name = entry.file_name();
        let number = name
            .to_str()
            .and_then(|name| name.strip_prefix(stem(path).to_str()?)?.strip_prefix("-part-"))
            .and_then(|rest| rest.strip_suffix(".partial").unwrap_or(rest).strip_suffix(".mcap"))
            .filter(|digits| digits.len() >= 4)
            .and_then(|digits| digits.parse().ok());
        parts.extend(number.map(|number| (number, entry.path())));
    }
    parts.sort();
    Ok(parts)
}

/// Records the frames of one run, in parts if that is asked for.
///
/// Each part has a head, a chain and an end of its own and is a recording by itself. A part is finished, on the disk
/// and under its name, before the next one has a frame. The next part is created first, so that a part that cannot be
/// continued does not claim that it is. A kill leaves one `.partial`, or in between one more that is empty. No frame
/// is in two parts. A row of results goes to the part that is open when it comes.
pub struct PartsWriter {
    path: PathBuf,
    manifest: RunManifest,
    run_toml: Option<String>,
    options: WriteOptions,
    split: Split,
    /// None once writing failed.
    open: Option<RecordingWriter>,
    begin: BeginRecord,
    /// [`Split::slot`] of the frame that the open part begins with.
    slot: f64,
    finished: Vec<Finished>,
}

impl PartsWriter {
    /// Refuses a recording `path` if one of its parts exists, unless parts may be replaced. Call it before there is
    /// anything to record.
    ///
    /// # Errors
    /// When such a part exists, or the directory cannot be read.
    pub fn check(path: &Path, split: &Split, force: bool) -> Result<(), WriteError> {
        if force || !split.is_split() {
            return Ok(());
        }
        let there = parts_there(path)?.into_iter().next();
        there.map_or(Ok(()), |(_, path)| Err(WholeFileError::Exists { path }.into()))
    }

    /// Starts the recording `path` of the run `manifest`, which begins with the state of `first_step`.
    ///
    /// # Errors
    /// As for [`RecordingWriter::create`].
    pub fn create(
        path: &Path,
        manifest: &RunManifest,
        run_toml: Option<&str>,
        first_step: u64,
        options: &WriteOptions,
        split: &Split,
    ) -> Result<Self, WriteError> {
        let mut options = *options;
        if let Some(bytes) = split.bytes {
            // what is not on the disk yet is not counted
            options.chunk_bytes = options.chunk_bytes.min(bytes / 8); // integers
            options.queue_bytes = options.queue_bytes.min(bytes / 8); // integers
        }
        let begin = BeginRecord { first_step, ..BeginRecord::default() };
        let mut parts = Self {
            path: path.to_owned(),
            manifest: manifest.clone(),
            run_toml: run_toml.map(str::to_owned),
            options,
            split: *split,
            open: None,
            begin,
            slot: 0.0,
            finished: Vec::new(),
        };
        parts.open = Some(parts.create_part(&parts.begin)?);
        Ok(parts)
    }

    fn create_part(&self, begin: &BeginRecord) -> Result<RecordingWriter, WriteError> {
        let path = self.path_of_part(begin.part);
        RecordingWriter::create_from(&path, &self.manifest, self.run_toml.as_deref(), begin, &self.options)
    }

    fn path_of_part(&self, part: u64) -> PathBuf {
        if self.split.is_split() { part_path(&self.path, part) } else { self.path.clone() }
    }

    /// The name of the open part.
    fn part_path(&self) -> PathBuf {
        self.path_of_part(self.begin.part)
    }

    fn open(&mut self) -> Result<&mut RecordingWriter, WriteError> {
        let path = self.part_path();
        self.open.as_mut().ok_or(WriteError::GivenUp { path })
    }

    /// Begins another part with the state of `step`, and finishes the open one. If that fails, the open part stays open.
    fn next_part(&mut self, step: u64) -> Result<(), WriteError> {
        let previous_state_hash = self.open()?.last_state_hash();
        let begin = BeginRecord { first_step: step, part: self.begin.part + 1, previous_state_hash };
        // first: a part says that it is continued only if it is
        let next = self.create_part(&begin)?;
        let part = self.open.replace(next);
        self.begin = begin;
        self.finished.extend(part.map(|part| part.finish(EndReason::Continued)).transpose()?);
        Ok(())
    }

    /// Records a row of results.
    ///
    /// # Errors
    /// As for [`RecordingWriter::write_row`].
    pub fn write_row(&mut self, rows: &RowMessages, row: &ResultRow<'_>) -> Result<(), WriteError> {
        self.open()?.write_row(rows, row)
    }

    /// Bytes on the disk so far, in all parts.
    pub fn bytes_written(&self) -> u64 {
        let finished: u64 = self.finished.iter().map(|part| part.bytes).sum();
        finished + self.open.as_ref().map_or(0, RecordingWriter::bytes_written)
    }

    /// Frames recorded so far, in all parts.
    pub fn frames(&self) -> u64 {
        let finished: u64 = self.finished.iter().map(|part| part.frames).sum();
        finished + self.open.as_ref().map_or(0, RecordingWriter::frames)
    }

    /// The parts that are finished.
    pub fn finished(&self) -> &[Finished] {
        &self.finished
    }

    /// Bytes that wait in memory to be written, before compression.
    pub fn pending_bytes(&self) -> u64 {
        self.open.as_ref().map_or(0, RecordingWriter::pending_bytes)
    }

    /// Removes the open part, for a recorder that got no frame.
    pub fn discard(mut self) {
        if let Some(part) = self.open.take() {
            part.discard();
        }
    }

    /// Ends the recording for `reason`: all of its parts, in order. With `--force` parts of an earlier recording that go
    /// further than these are removed, unless another process writes them.
    ///
    /// # Errors
    /// When writing fails; the parts finished before stay.
    pub fn finish(mut self, reason: EndReason) -> Result<Vec<Finished>, WriteError> {
        let path = self.part_path();
        let part = self.open.take().ok_or(WriteError::GivenUp { path })?;
        self.finished.push(part.finish(reason)?);
        if self.split.is_split() && self.options.force {
            let there = parts_there(&self.path)?;
            for (_, path) in there.into_iter().filter(|(part, _)| *part > self.begin.part) {
                match LockedFile::open(&path) {
                    Ok(file) => file.remove()?,
                    // of a recorder that lives
                    Err(WholeFileError::Busy { .. }) => {}
                    Err(error) => return Err(error.into()),
                }
            }
        }
        Ok(self.finished)
    }
}

impl FrameSink for PartsWriter {
    type Error = WriteError;

    /// Records `frame`, in a new part if it is time for one.
    ///
    /// # Errors
    /// As for [`RecordingWriter`]; the parts finished before stay.
    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), WriteError> {
        let (split, slot) = (self.split, self.split.slot(frame.time_s));
        let part = self.open()?;
        let is_full = split.bytes.is_some_and(|bytes| part.bytes_written() >= bytes);
        if part.frames() == 0 {
            self.slot = slot;
        } else if is_full || slot > self.slot {
            self.next_part(frame.step)?;
            self.slot = slot;
        }
        self.open()?.accept(frame)
    }
}
