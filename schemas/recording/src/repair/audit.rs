//! Reads a recording from end to end, whole or damaged, and checks it against the manifest.

mod ends;
mod rows;

pub use rows::RowsFound;

use crate::error::ReadError;
use crate::head::{BeginRecord, EndRecord};
use crate::log_time_ns;
use crate::proto;
use crate::read::contents::OtherRecords;
use crate::read::decode::{self, StateHead, StateLengths};
use crate::read::messages::{MessageReader, RawMessage};
use crate::read::others::OtherMessage;
use crate::read::records::RecordReader;
use crate::read::salvage::{Damage, DamageKind, LostFrames};
use crate::read::summary::SummarySection;
use crate::results::row_messages::{RowHead, name_of_results};
use crate::write::encode;
use crate::write::schedule::Schedule;
use mcap::records::MessageHeader;
use prost::Message;
use schemas::frame::EndReason;
use schemas::manifest::{KERNEL_VERSIONS, RunManifest};
use std::collections::BTreeMap;
use std::path::Path;

/// Largest number of ranges of missing frames that are kept; more are only counted.
const MOST_RANGES: usize = 100;

/// Reads every readable message of a recording and notes everything wrong: damage to the file, and messages with
/// correct checksums that cannot be of this run. Memory is bounded by two chunks.
pub struct Audit {
    messages: MessageReader,
    manifest: RunManifest,
    lengths: StateLengths,
    /// True if the chain must be the one that this program resolves from the manifest; another version may resolve it
    /// in another way.
    is_resolved_by_us: bool,
    chain_count: u64,
    /// Step of the first checked state.
    first_step: Option<u64>,
    /// Step of the last checked state.
    last_step: Option<u64>,
    /// The step of the last state, while it has no summary, and the number of damages at that time.
    awaited: Option<(u64, usize)>,
    /// Number of damages, from the first on, whose frames are known.
    placed: usize,
    missing: Vec<(u64, u64)>,
    missing_count: u64,
    ended: bool,
    /// Messages read, by the number of their channel.
    counts: BTreeMap<u16, u64>,
    /// Smallest and largest log time (ns) of them.
    times_ns: Option<(u64, u64)>,
    longest_summary: usize,
    rows: BTreeMap<String, RowsFound>,
    has_summary_section: bool,
}

/// The next contents of a recording.
#[derive(Debug)]
pub enum Audited<'a> {
    /// A state of this run, after the states before.
    State(RecordedState<'a>),
    /// The summary of the last state, encoded.
    Summary(&'a [u8]),
    /// A message of another channel than those of frames.
    Other(OtherMessage<'a>),
    /// Nothing more.
    End,
}

/// A state as it is in the file.
#[derive(Debug, Clone, Copy)]
pub struct RecordedState<'a> {
    /// Its frame, or the frame before it.
    pub frame: u64,
    /// Its step.
    pub step: u64,
    /// The CRC of its chunk holds. If not, its step and its doubles may be anything.
    pub is_checked: bool,
    /// The encoded `ChainState`, whose arrays have the right lengths.
    pub message: &'a [u8],
}

/// A message by what it is, before it is lent.
enum Kind {
    State { frame: u64, step: u64, is_checked: bool },
    Summary,
    Other,
    End,
}

/// The contents found in a message.
enum Said {
    State(Result<StateHead, String>),
    Summary(Option<StateHead>),
    Chain {
        is_ours: bool,
    },
    /// A row of results, if it is one.
    Row(Option<RowHead>),
    Other,
}

impl Audit {
    /// Opens the recording `path`.
    ///
    /// # Errors
    /// When it cannot be read, is no recording, is of another major schema version, or its manifest is damaged:
    /// without the manifest nothing in the file has a meaning.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let messages = MessageReader::salvaging(path)?;
        let manifest = messages.manifest().clone();
        let physics = &manifest.physics;
        let is_resolved_by_us =
            KERNEL_VERSIONS.contains(&physics.kernel_version) && !manifest.is_newer_minor();
        Ok(Self {
            lengths: StateLengths::of(&manifest),
            longest_summary: decode::longest_summary(&manifest),
            is_resolved_by_us,
            messages,
            manifest,
            chain_count: 0,
            first_step: None,
            last_step: None,
            awaited: None,
            placed: 0,
            missing: Vec::new(),
            missing_count: 0,
            ended: false,
            counts: BTreeMap::new(),
            times_ns: None,
            rows: BTreeMap::new(),
            has_summary_section: false,
        })
    }

    /// The head of the recording `path`: its beginning, and the configuration as the user gave it.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn head(path: &Path) -> Result<(BeginRecord, Option<String>), ReadError> {
        let mut messages = MessageReader::salvaging(path)?;
        messages.read_head()?;
        let contents = messages.contents();
        Ok((contents.begin.clone(), contents.run_toml.clone()))
    }

    /// Numbers of messages that the recording `path` should have, by topic, if its summary section has them.
    pub fn expected_counts(path: &Path) -> Option<BTreeMap<String, u64>> {
        SummarySection::read(&mut RecordReader::open(path).ok()?).map(|summary| summary.counts())
    }

    /// The run.
    pub fn manifest(&self) -> &RunManifest {
        &self.manifest
    }

    /// Size of the file.
    pub fn file_bytes(&self) -> u64 {
        self.messages.file_bytes()
    }

    /// Beginning of the recording; known with the first state.
    pub fn begin(&self) -> &BeginRecord {
        &self.messages.contents().begin
    }

    /// End of the recording, if it can be read; known at the end.
    pub fn end(&self) -> Option<&EndRecord> {
        self.messages.contents().end.as_ref()
    }

    /// Why no more comes; known at the end.
    pub fn end_reason(&self) -> EndReason {
        self.messages.end_reason()
    }

    /// The damages of the file, as far as it has been read; at most [`MOST_DAMAGES`](crate::MOST_DAMAGES).
    pub fn damages(&self) -> &[Damage] {
        self.messages.damages()
    }

    /// Number of damages.
    pub fn damage_count(&self) -> u64 {
        self.messages.damage_count()
    }

    /// The rows of results by topic; known at the end.
    pub fn rows(&self) -> &BTreeMap<String, RowsFound> {
        &self.rows
    }

    /// Numbers of messages of each topic that is neither of the frames nor of results; known at the end.
    pub fn foreign_counts(&self) -> BTreeMap<String, u64> {
        self.messages.contents().by_topic(|id, topic| {
            let is_foreign = !proto::OF_FRAMES.contains(&topic) && !self.rows.contains_key(topic);
            is_foreign.then(|| self.counts.get(&id).copied().unwrap_or(0))
        })
    }

    /// The contents that are neither messages nor ours; known at the end.
    pub fn other_records(&self) -> &OtherRecords {
        &self.messages.contents().others
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.messages.path()
    }

    /// The configuration as the user gave it, if the file has it; known at the end.
    pub fn run_toml(&self) -> Option<&str> {
        self.messages.contents().run_toml.as_deref()
    }

    /// True if the file has a summary section, which was then compared with the rest; known at the end.
    pub fn has_summary_section(&self) -> bool {
        self.has_summary_section
    }

    /// The first ranges of missing frames, from and up to.
    pub fn missing(&self) -> &[(u64, u64)] {
        &self.missing
    }

    /// Number of ranges of missing frames.
    pub fn missing_count(&self) -> u64 {
        self.missing_count
    }

    /// Checks that the recording has states, or might have had some before it was damaged; known at the end.
    ///
    /// # Errors
    /// [`ReadError::NoChannel`] if it is a recording of something else.
    pub fn check_has_states(&self) -> Result<(), ReadError> {
        if self.last_step.is_some() || self.messages.contents().are_before_states() {
            return Ok(());
        }
        self.messages.check_has(proto::STATE.topic)
    }

    /// Messages of damaged chunks by topic, as far as the indexes behind them count them; known at the end.
    pub fn lost_counts(&mut self) -> BTreeMap<String, u64> {
        let lost = self.messages.salvage().map(|salvage| salvage.lost.clone()).unwrap_or_default();
        self.messages.contents().by_topic(|id, _| lost.get(&id).copied())
    }

    /// Reads on.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn read_next(&mut self) -> Result<Audited<'_>, ReadError> {
        let kind = self.advance()?;
        let Some(message) = self.messages.last() else { return Ok(Audited::End) };
        let data = message.data;
        Ok(match kind {
            Kind::State { frame, step, is_checked } => {
                Audited::State(RecordedState { frame, step, is_checked, message: data })
            }
            Kind::Summary => Audited::Summary(data),
            Kind::Other => Audited::Other(OtherMessage::new(message)),
            Kind::End => Audited::End,
        })
    }

    fn advance(&mut self) -> Result<Kind, ReadError> {
        loop {
            if self.ended {
                return Ok(Kind::End);
            }
            let Some(message) = self.messages.next()? else {
                self.ended = true;
                self.at_end();
                return Ok(Kind::End);
            };
            let RawMessage { head, is_checked, data, .. } = message;
            *self.counts.entry(head.channel_id).or_insert(0) += 1;
            let (first, last) = self.times_ns.unwrap_or((head.log_time, head.log_time));
            self.times_ns = Some((first.min(head.log_time), last.max(head.log_time)));
            let said = match message.channel.topic.as_str() {
                topic if topic == proto::STATE.topic => Said::State(decode::checked_head(data, self.lengths)),
                topic if topic == proto::SUMMARY.topic => {
                    let is_short = data.len() <= self.longest_summary;
                    Said::Summary(is_short.then(|| decode::summary_head(data)).flatten())
                }
                topic if topic == proto::CHAIN.topic => {
                    // a second one is refused in any case
                    let is_chain =
                        self.chain_count > 0 || !self.is_resolved_by_us || is_chain(&self.manifest, data);
                    Said::Chain { is_ours: is_chain }
                }
                _ if name_of_results(message.channel).is_some() => Said::Row(RowHead::decode(data).ok()),
                _ => Said::Other,
            };
            let judged =
                if is_checked { self.judge(&head, said) } else { Ok(unchecked(&self.manifest, &said)) };
            match judged {
                Ok(Some(kind)) => return Ok(kind),
                Ok(None) => {}
                Err(what) => self.messages.note_message(what),
            }
        }
    }

    /// The kind of a message with correct checksums, or the fault in it.
    fn judge(&mut self, head: &MessageHeader, said: Said) -> Result<Option<Kind>, String> {
        match said {
            Said::State(state) => self.judge_state(head, &state?).map(Some),
            Said::Summary(summary) => {
                let summary = summary.ok_or("a summary that is no Summary")?;
                let awaited = self.awaited.take().map(|(step, _)| step);
                if awaited != Some(summary.step) {
                    // of a state that is damaged or was refused
                    let is_known = self.messages.loss_count() > 0;
                    return if is_known { Ok(None) } else { Err(no_state(summary.step)) };
                }
                check_times(head, summary.time_s)?;
                check_sequence(head, self.manifest.frame_at(summary.step))?;
                Ok(Some(Kind::Summary))
            }
            Said::Chain { is_ours } => {
                self.chain_count += 1;
                check_times(head, 0.0)?;
                check_sequence(head, 0)?;
                let allowed = is_ours && self.chain_count == 1 && self.last_step.is_none();
                let what =
                    "a chain that is not the one that the manifest describes, or not once before the states";
                if allowed { Ok(None) } else { Err(what.to_owned()) }
            }
            Said::Row(row) => {
                let row = row.ok_or("a row of results that is none")?;
                check_times(head, row.time_s)?;
                check_sequence(head, row.frame)?;
                let topic = self.messages.last().map(|message| message.channel.topic.clone());
                self.rows.entry(topic.unwrap_or_default()).or_default().take(&row, &self.manifest)?;
                Ok(Some(Kind::Other))
            }
            Said::Other => Ok(Some(Kind::Other)),
        }
    }

    fn judge_state(&mut self, head: &MessageHeader, state: &StateHead) -> Result<Kind, String> {
        let StateHead { frame, step, time_s } = *state;
        let schedule = Schedule::new(&self.manifest, &self.messages.contents().begin);
        let number = schedule.check(self.last_step, state)?;
        let missed = schedule.missed(self.last_step, step, false);
        let numbered = self.manifest.is_frame(step) == frame.is_some();
        self.place_damages(missed.map(|(from, to)| (from, Some(to))));
        self.miss(missed);
        self.miss_summary();
        self.first_step.get_or_insert(step);
        self.last_step = Some(step);
        self.awaited = Some((step, self.messages.damages().len()));
        let frame = number.unwrap_or_else(|| self.manifest.frame_at(step));
        if let Err(what) = check_times(head, time_s) {
            self.messages.note_message(what);
        }
        if check_sequence(head, frame).is_err() || !numbered {
            let what = format!("the state of step {step} does not have the number of its frame, {frame}");
            self.messages.note_message(what);
        }
        Ok(Kind::State { frame, step, is_checked: true })
    }

    /// Notes missing frames.
    fn miss(&mut self, range: Option<(u64, u64)>) {
        if let Some(range) = range {
            self.missing_count += 1;
            if self.missing.len() < MOST_RANGES {
                self.missing.push(range);
            }
        }
    }

    /// Notes which frames should be where the damages since the last state are.
    fn place_damages(&mut self, range: Option<(u64, Option<u64>)>) {
        let placed = self.placed;
        let Some(salvage) = self.messages.salvage() else { return };
        let frames = range.map(|(from, to)| LostFrames { from, to });
        let damages = salvage.damages_mut();
        self.placed = damages.len();
        for damage in damages.iter_mut().skip(placed) {
            if damage.kind != DamageKind::Description {
                damage.frames = frames;
            }
        }
    }

    /// Notes that the last state has no summary, unless something was damaged since.
    fn miss_summary(&mut self) {
        if let Some((step, damages)) = self.awaited.take()
            && self.messages.damages().len() == damages
        {
            self.messages.note_message(format!("the state of step {step} has no summary after it"));
        }
    }

    fn at_end(&mut self) {
        let end = self.end().cloned();
        let is_finished = self.messages.is_finished();
        let step_count = self.manifest.physics.step_count;
        let last_step = match &end {
            Some(end) if end.reason == EndReason::Complete => Some(step_count),
            Some(end) => end.last_step.filter(|step| *step <= step_count),
            None => None,
        };
        let schedule = Schedule::new(&self.manifest, &self.messages.contents().begin);
        let missed = last_step.and_then(|step| schedule.missed(self.last_step, step, true));
        let next = schedule.frame_after(self.last_step).filter(|_| last_step.is_none());
        let unknown = next.map(|frame| (frame, None));
        self.place_damages(missed.map(|(from, to)| (from, Some(to))).or(unknown));
        self.miss(missed);
        if is_finished {
            self.miss_summary();
            self.check_end();
            self.check_summary_section();
        }
        self.check_definitions();
    }
}

/// The kind of a message with a wrong checksum. A state may still be proven by computing it.
fn unchecked(manifest: &RunManifest, said: &Said) -> Option<Kind> {
    match said {
        Said::State(Ok(StateHead { frame, step, .. })) if *step <= manifest.physics.step_count => {
            let (frame, step) = (*frame, *step);
            let frame = frame.unwrap_or_else(|| manifest.frame_at(step));
            Some(Kind::State { frame, step, is_checked: false })
        }
        Said::State(_) | Said::Summary(_) | Said::Chain { .. } => None,
        Said::Row(_) | Said::Other => Some(Kind::Other),
    }
}

/// True if `message` is the chain of the run.
fn is_chain(manifest: &RunManifest, message: &[u8]) -> bool {
    // a message too short for the masses alone is not worth making a chain that the file may not fill
    if message.len() as u64 / 8 < manifest.physics.beads {
        return false;
    }
    let expected = encode::chain(&manifest.physics.chain()).encode_to_vec();
    // another valid encoding of the same chain is as good
    let encoded_anew = || proto::Chain::decode(message).map(|chain| chain.encode_to_vec());
    message == expected || encoded_anew().is_ok_and(|chain| chain == expected)
}

fn no_state(step: u64) -> String {
    format!("a summary of step {step} that does not follow the state of that step")
}

/// Checks that a message about a frame has the frame's number.
fn check_sequence(head: &MessageHeader, frame: u64) -> Result<(), String> {
    #[expect(clippy::cast_possible_truncation, reason = "the low bits, as the writer has them")]
    let expected = frame as u32;
    if head.sequence == expected {
        return Ok(());
    }
    Err(format!("a message of the number {} instead of {expected}, that of its frame", head.sequence))
}

/// Checks that a message of the frames has the time of its state.
fn check_times(head: &MessageHeader, time_s: f64) -> Result<(), String> {
    let expected = log_time_ns(time_s);
    let MessageHeader { log_time, publish_time, .. } = *head;
    if (log_time, publish_time) == (expected, expected) {
        return Ok(());
    }
    Err(format!(
        "a message logged at {log_time} ns and published at {publish_time} ns instead of {expected} ns"
    ))
}
