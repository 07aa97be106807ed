//! A recording as a source of frames.

use crate::error::ReadError;
use crate::head;
use crate::log_time_ns;
use crate::proto;
use crate::read::decode::{self, StateHead, StateLengths};
use crate::read::index::Index;
use crate::read::messages::{MessageReader, RawMessage};
use crate::write::schedule::Schedule;
use schemas::frame::{EndReason, Frame, FrameSource, Received};
use schemas::manifest::RunManifest;
use std::path::Path;

/// Reads the frames of a recording, finished or not, in the order of the file.
///
/// Frames come as they were recorded: one every `record_every_steps`, the first and the last. The steps between them
/// are not missing and are not reported. [`Received::Missed`] names frames that are not in the file although the
/// manifest's schedule says that they are recorded from the beginning of the file on. Frames before that beginning, in
/// other parts or in none, are not missing either. A file that was not closed ends with [`EndReason::Unfinished`]
/// after its last whole chunk. [`open`](Self::open) passes over states without a frame number, which were recomputed
/// between frames; [`open_all`](Self::open_all) lends them under the number of the frame before.
///
/// Every state is checked: CRC of its chunk, lengths, order, frame and time against the manifest; at the end
/// the CRC of the data section, unless a part of it was skipped by [`seek_to_step`](Self::seek_to_step), and the
/// hash of the last state.
pub struct RecordingSource {
    messages: MessageReader,
    lengths: StateLengths,
    /// True if states between frames are lent, too.
    all: bool,
    /// The index of the file, read when it is needed.
    index: Option<Index>,
    /// The step at which the source ends before the end of the file.
    until: Option<u64>,
    /// `[u | v | extra]` of the state read last.
    doubles: Vec<f64>,
    /// The state that was read but not lent.
    next: Pending,
    /// Step up to which everything recorded has been lent or reported.
    accounted: Option<u64>,
    /// Step of the state in `doubles`.
    read: Option<u64>,
}

#[derive(Debug, Clone, Copy)]
enum Pending {
    Unknown,
    Frame {
        frame: u64,
        step: u64,
        time_s: f64,
    },
    /// No more frames; the recording should have reached `last_step`.
    End {
        reason: EndReason,
        last_step: Option<u64>,
    },
}

impl RecordingSource {
    /// Opens the recording `path` and goes to its first state.
    ///
    /// # Errors
    /// When it cannot be read, is no recording, is of another major schema version, holds no states, or
    /// is damaged up to its first state.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::of(path, false)
    }

    /// Opens the recording `path` with all of its states, also those that were recomputed between frames.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_all(path: &Path) -> Result<Self, ReadError> {
        Self::of(path, true)
    }

    fn of(path: &Path, all: bool) -> Result<Self, ReadError> {
        let (index, records) = Index::and_reader(path)?;
        let messages = MessageReader::of(records)?;
        let mut source = Self {
            lengths: StateLengths::of(messages.manifest()),
            messages,
            all,
            index,
            until: None,
            doubles: Vec::new(),
            next: Pending::Unknown,
            accounted: None,
            read: None,
        };
        source.advance()?;
        Ok(source)
    }

    /// Ends with the first state at or after `step`, as if the recording were interrupted. The source reads ahead no
    /// further. Where each stretch of the file costs a request, it asks for all bytes up to there at once.
    pub fn end_at(&mut self, step: u64) {
        self.until = Some(step);
        if let Some(index) = &self.index {
            let stretch = index.stretch_from_the_beginning(self.time_ns(step));
            self.messages.expect(stretch, false);
        }
    }

    fn time_ns(&self, step: u64) -> u64 {
        log_time_ns(self.messages.manifest().physics.time_s(step))
    }

    /// Goes to the last state at or before `step`, or to the first state if all are after it; may be called at any
    /// time. The source reports frames missing between `step` and the next state, but none before `step`.
    ///
    /// The file's index leads to the chunk, or the headers of its chunks if the file has none, so that this costs
    /// about two chunks, wherever the state is.
    ///
    /// # Errors
    /// When the file cannot be read, or is damaged up to that state as far as it must be read.
    pub fn seek_to_step(&mut self, step: u64) -> Result<(), ReadError> {
        let index = match self.index.take() {
            Some(index) => index,
            None => Index::read(self.messages.path())?,
        };
        let mut found = self.seek_by(&index, step);
        if matches!(&found, Err(error) if !matches!(error, ReadError::Io { .. })) {
            // the index or a chunk is wrong: believe what can be read from the beginning
            found = self.seek_by(&Index::beginning(), step);
        }
        self.index = Some(index);
        if found.is_err() {
            self.next = Pending::End { reason: EndReason::Unfinished, last_step: None };
        }
        found
    }

    fn seek_by(&mut self, index: &Index, step: u64) -> Result<(), ReadError> {
        let time_s = self.messages.manifest().physics.time_s(step);
        let until_ns = self.time_ns(self.until.map_or(step, |until| until.max(step))); // integers
        let is_open = self.until.is_none();
        let place = index.find(step, time_s, |place| {
            self.messages.expect(index.stretch(place, until_ns), is_open);
            self.messages.seek(place, &index.known)?;
            self.next_head().map(|head| head.map(|head| head.step))
        })?;
        self.messages.seek(place, &index.known)?;
        let (mut before, mut last) = (0, step);
        loop {
            match self.next_head() {
                Ok(Some(head)) if head.step <= step => {
                    (before, last) = (before + 1, head.step);
                    if last == step {
                        break;
                    }
                }
                // damage after the state does not matter here
                Err(error) if before == 0 => return Err(error),
                Ok(_) | Err(_) => break,
            }
        }
        self.messages.seek(place, &index.known)?;
        for _ in 1..before {
            self.next_head()?;
        }
        let begin = self.messages.contents().begin.first_step;
        (self.accounted, self.read) = (last.checked_sub(1).filter(|before| *before >= begin), None);
        self.advance()
    }

    /// Step and frame of the next state that is to be lent, without its arrays.
    fn next_head(&mut self) -> Result<Option<StateHead>, ReadError> {
        let path = self.messages.path().to_owned();
        while let Some(message) = self.messages.next()? {
            if message.channel.topic == proto::STATE.topic {
                let head = decode::head(message.data);
                let head = head.map_err(|what| ReadError::damaged(&path, message.offset, what))?;
                if self.all || head.frame.is_some() {
                    return Ok(Some(head));
                }
            }
        }
        Ok(None)
    }

    /// Reads the next state, or the end.
    fn advance(&mut self) -> Result<(), ReadError> {
        let next = self.read_next();
        self.next = match &next {
            Ok(next) => *next,
            // what comes after damage is not trusted
            Err(_) => Pending::End { reason: EndReason::Unfinished, last_step: None },
        };
        next.map(|_| ())
    }

    fn read_next(&mut self) -> Result<Pending, ReadError> {
        while let Some(message) = self.messages.next()? {
            if message.channel.topic != proto::STATE.topic {
                continue;
            }
            let RawMessage { data, offset, .. } = message;
            let damaged = |source: &Self, what| ReadError::damaged(source.messages.path(), offset, what);
            let state =
                decode::state(data, self.lengths, &mut self.doubles).map_err(|what| damaged(self, what))?;
            if !self.all && state.frame.is_none() && self.accounted.is_some_and(|step| state.step <= step) {
                // between frames, and before the one that was sought
                continue;
            }
            let frame = self.schedule().check(self.accounted, &state).map_err(|what| damaged(self, what))?;
            self.read = Some(state.step);
            let between = || self.all.then(|| self.messages.manifest().frame_at(state.step));
            if let Some(frame) = frame.or_else(between) {
                return Ok(Pending::Frame { frame, step: state.step, time_s: state.time_s });
            }
        }
        self.read_end()
    }

    fn schedule(&self) -> Schedule<'_> {
        Schedule::new(self.messages.manifest(), &self.messages.contents().begin)
    }

    fn read_end(&self) -> Result<Pending, ReadError> {
        let (contents, manifest) = (self.messages.contents(), self.messages.manifest());
        if !contents.are_before_states() || self.messages.is_finished() {
            self.messages.check_has(proto::STATE.topic)?;
        }
        let Some(end) = contents.end.as_ref().filter(|_| self.messages.is_finished()) else {
            return Ok(Pending::End { reason: EndReason::Unfinished, last_step: None });
        };
        if let (Some(expected), Some(step)) = (&end.last_state_hash, self.read) {
            let found = head::state_hash(step, &self.doubles);
            if found != *expected {
                let what =
                    format!("the hash of the last state, of step {step}, is {found} instead of {expected}");
                return Err(ReadError::damaged(self.messages.path(), self.messages.file_bytes(), what));
            }
        }
        let last_step = match end.reason {
            EndReason::Complete => Some(manifest.physics.step_count),
            _ => end.last_step.filter(|step| *step <= manifest.physics.step_count),
        };
        Ok(Pending::End { reason: end.reason, last_step })
    }

    /// The frames that are missing before step `next` (or up to it, if `included`).
    fn missed_before(&self, next: u64, included: bool) -> Option<(u64, u64)> {
        self.schedule().missed(self.accounted, next, included)
    }
}

impl FrameSource for RecordingSource {
    type Error = ReadError;

    fn manifest(&self) -> &RunManifest {
        self.messages.manifest()
    }

    fn receive(&mut self) -> Result<Received<'_>, ReadError> {
        if matches!(self.next, Pending::Unknown) {
            // the state read last was lent
            if self.read.zip(self.until).is_some_and(|(step, until)| step >= until) {
                return Ok(Received::End(EndReason::Interrupted));
            }
            self.advance()?;
        }
        match self.next {
            Pending::Frame { frame, step, time_s } => {
                if let Some((from, to)) = self.missed_before(step, false) {
                    self.accounted = Some(step - 1);
                    return Ok(Received::Missed { from, to });
                }
                self.accounted = Some(step);
                self.next = Pending::Unknown;
                let frame = Frame::of_doubles((frame, step, time_s), self.lengths.beads, &self.doubles);
                Ok(Received::Frame(frame.searched()))
            }
            Pending::End { reason, last_step } => {
                if let Some(step) = last_step
                    && let Some((from, to)) = self.missed_before(step, true)
                {
                    self.accounted = Some(step);
                    return Ok(Received::Missed { from, to });
                }
                Ok(Received::End(reason))
            }
            Pending::Unknown => Ok(Received::End(EndReason::Unfinished)),
        }
    }
}
