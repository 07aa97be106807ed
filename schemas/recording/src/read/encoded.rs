//! States and summaries as bytes of a file, to be decoded and compared on another thread.

use crate::proto;
use crate::read::decode::{self, StateLengths};
use crate::write::encode;
use prost::Message;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::summary::Summarizer;
use serde::Serialize;
use std::fmt;
use std::ops::Range;

/// Consecutive states of one run, encoded, with their summaries.
#[derive(Debug, Clone, Default)]
pub struct EncodedStates {
    bytes: Vec<u8>,
    entries: Vec<Encoded>,
}

#[derive(Debug, Clone)]
struct Encoded {
    frame: u64,
    step: u64,
    state: Range<usize>,
    summary: Option<Range<usize>>,
}

impl EncodedStates {
    /// Adds the state of `step`, encoded as `message`. `frame` is its number, or the number of the frame before.
    pub fn push(&mut self, frame: u64, step: u64, message: &[u8]) {
        let state = self.append(message);
        self.entries.push(Encoded { frame, step, state, summary: None });
    }

    /// Adds the encoded summary of the last state.
    pub fn push_summary(&mut self, message: &[u8]) {
        let summary = self.append(message);
        if let Some(last) = self.entries.last_mut() {
            last.summary = Some(summary);
        }
    }

    fn append(&mut self, message: &[u8]) -> Range<usize> {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(message);
        start..self.bytes.len()
    }

    /// Forgets all of them.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.entries.clear();
    }

    /// Forgets them all and begins with the last state of `before`, without its summary.
    pub fn begin_after(&mut self, before: &Self) {
        self.clear();
        if let Some(Encoded { frame, step, state, .. }) = before.entries.last() {
            self.push(*frame, *step, before.bytes.get(state.clone()).unwrap_or_default());
        }
    }

    /// Number of states.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True if there are no states.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Size of all messages.
    pub fn bytes(&self) -> usize {
        self.bytes.len()
    }

    /// Steps of the first and the last state.
    pub fn step_range(&self) -> Option<(u64, u64)> {
        Some((self.entries.first()?.step, self.entries.last()?.step))
    }

    /// The state at `index`, its arrays `[u | v | extra]` in `doubles`.
    ///
    /// # Errors
    /// When the message is invalid, with the reason.
    pub fn decode<'a>(
        &self,
        index: usize,
        manifest: &RunManifest,
        doubles: &'a mut Vec<f64>,
    ) -> Result<Frame<'a>, String> {
        let Encoded { frame, step, state, .. } = self.entries.get(index).ok_or("no such state")?;
        let lengths = StateLengths::of(manifest);
        let message = self.bytes.get(state.clone()).unwrap_or_default();
        let time_s = decode::state(message, lengths, doubles)?.time_s;
        Ok(Frame::of_doubles((*frame, *step, time_s), lengths.beads, doubles))
    }

    /// The encoded summary of the state at `index`, if it has one.
    pub fn summary(&self, index: usize) -> Option<&[u8]> {
        self.bytes.get(self.entries.get(index)?.summary.clone()?)
    }
}

/// A summary that does not match its state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SummaryDifference {
    /// Step of the state.
    pub step: u64,
    /// Its frame, or the frame before it.
    pub frame: u64,
    /// The number's name in the schema.
    pub field: String,
    /// The value in the summary.
    pub found: f64,
    /// The value computed from the state.
    pub computed: f64,
}

impl fmt::Display for SummaryDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { step, frame, field, found, computed } = self;
        write!(
            f,
            "the summary of step {step} (frame {frame}) has {field} = {found:e}, its state {computed:e}"
        )
    }
}

/// Compares summaries with their states.
#[derive(Debug, Clone)]
pub struct SummaryChecker {
    summarizer: Summarizer,
    longest: usize,
    message: Vec<u8>,
}

impl SummaryChecker {
    /// Makes one for the run `manifest`.
    pub fn new(manifest: &RunManifest) -> Self {
        Self {
            summarizer: Summarizer::new(&manifest.physics),
            longest: decode::longest_summary(manifest),
            message: Vec::new(),
        }
    }

    /// The first number in which the encoded summary `found` differs from that of `frame`.
    pub fn check(&mut self, frame: &Frame<'_>, found: &[u8]) -> Option<SummaryDifference> {
        let computed = encode::summary(frame, &self.summarizer.summarize(frame));
        self.message.clear();
        computed.encode_raw(&mut self.message);
        if self.message == found {
            return None;
        }
        let differs = |field: &str, found: f64, computed: f64| SummaryDifference {
            step: frame.step,
            frame: frame.frame,
            field: field.to_owned(),
            found,
            computed,
        };
        if found.len() > self.longest {
            return Some(differs("bytes", found.len() as f64, self.message.len() as f64));
        }
        let Ok(found) = proto::Summary::decode(found) else {
            return Some(differs("no Summary at all", f64::NAN, 0.0));
        };
        // −0 is encoded as 0
        let computed = proto::Summary::decode(self.message.as_slice()).unwrap_or(computed);
        let pairs = fields(&found).into_iter().zip(fields(&computed));
        let wrong = pairs.into_iter().find(|(a, b)| a.1.to_bits() != b.1.to_bits());
        if let Some(((field, found), (_, computed))) = wrong {
            return Some(differs(&field, found, computed));
        }
        let (a, b) = (found.impurity.len(), computed.impurity.len());
        (a != b).then(|| differs("impurities", a as f64, b as f64))
    }
}

/// The numbers of a summary by their names.
fn fields(summary: &proto::Summary) -> Vec<(String, f64)> {
    let mut fields: Vec<_> = [
        ("frame", summary.frame as f64),
        ("step", summary.step as f64),
        ("time_s", summary.time_s),
        ("kinetic_j", summary.kinetic_j),
        ("potential_j", summary.potential_j),
        ("total_j", summary.total_j),
        ("relative_drift", summary.relative_drift),
        ("front_bead", summary.front_bead as f64),
        ("dissipated_j", summary.dissipated_j),
        ("driven_j", summary.driven_j),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec();
    for impurity in &summary.impurity {
        fields.push(("impurity.bead".to_owned(), impurity.bead as f64));
        fields.push((format!("impurity.displacement_m of bead {}", impurity.bead), impurity.displacement_m));
        fields.push((format!("impurity.velocity_m_s of bead {}", impurity.bead), impurity.velocity_m_s));
    }
    fields
}
