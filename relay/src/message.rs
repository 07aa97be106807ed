//! Messages between the two sides: short requests and answers as JSON, the run itself in binary.
//!
//! Architecture invariant: no side believes the other. Lengths are checked before they are used, and nothing longer
//! than the received bytes is taken.

mod bounds;

pub use bounds::{
    BEGINNINGS_PER_S, MOST_BYTES_BEFORE, MOST_ROW_BYTES, MOST_TOPICS, MOST_USUAL_BYTES, most_message_bytes,
};

use schemas::frame::{EndReason, Frame};
use schemas::manifest::{KERNEL_VERSION, RunManifest, SCHEMA_VERSION, SchemaVersion};
use schemas::results::{ResultColumns, Topic};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Version of the protocol; another one is refused.
pub const PROTOCOL_VERSION: u32 = 1;

/// Longest request (bytes).
pub const MOST_REQUEST_BYTES: usize = 4096;
/// Longest answer (bytes): a manifest as JSON within JSON, well within the longest message before a manifest is known.
const MOST_ANSWER_BYTES: usize = 16 << 20;
/// Longest head of rows (bytes).
const MOST_HEAD_BYTES: usize = 4096;

/// Refuses to go on with messages of another near side, or of another publishing of a run: the far side asks anew.
pub const GONE: &str =
    "what you had of this run is not here any more: another `beadline relay --from` has begun";
/// Answers a far side that has done with the end: the near side knows that.
pub const OVER: &[u8] = b"over";

const FRAMES: u64 = 1;
const ROWS: u64 = 2;
const END: u64 = 3;

/// Why something that was said cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MessageError {
    /// No message of a relay.
    #[error("the other side sent what no `beadline relay` of this version says: {what}")]
    Garbage {
        /// The expected and the found value.
        what: String,
    },
    /// Another version of the protocol, of the schemas or of the dynamics.
    #[error("{what}: the other side has version {found}, this one has {ours}; {remedy}")]
    Version {
        /// The thing that has versions.
        what: &'static str,
        /// The other side's.
        found: String,
        /// Ours.
        ours: String,
        /// The remedy.
        remedy: &'static str,
    },
}

pub(crate) fn garbage(what: impl fmt::Display) -> MessageError {
    MessageError::Garbage { what: what.to_string() }
}

/// The versions of one side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Versions {
    /// Version of this protocol.
    pub protocol: u32,
    /// Version of manifests and frames.
    pub schema: SchemaVersion,
    /// Version of the dynamics.
    pub kernel: u32,
}

impl Versions {
    /// This program's.
    pub const OURS: Self =
        Self { protocol: PROTOCOL_VERSION, schema: SCHEMA_VERSION, kernel: KERNEL_VERSION };

    /// Refuses another side that we would misunderstand; its kernel matters only where frames are `recomputed`.
    ///
    /// # Errors
    /// With both versions.
    pub fn check(self, recomputed: bool) -> Result<(), MessageError> {
        let ours = Self::OURS;
        let refuse = |what, found: String, ours: String, remedy| {
            Err(MessageError::Version { what, found, ours, remedy })
        };
        let same = "use the same Beadline on both sides";
        if self.protocol != ours.protocol {
            return refuse("relay protocol", self.protocol.to_string(), ours.protocol.to_string(), same);
        }
        if self.schema.major != ours.schema.major {
            return refuse("schema", self.schema.to_string(), ours.schema.to_string(), same);
        }
        if recomputed && self.kernel != ours.kernel {
            let remedy = "use the same Beadline on both sides, or `--frames`, which recomputes nothing";
            return refuse("kernel", self.kernel.to_string(), ours.kernel.to_string(), remedy);
        }
        Ok(())
    }
}

/// A request of the far side.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Request {
    /// Its versions.
    pub versions: Versions,
    /// Number of the far side: the same after a restart.
    pub receiver: u64,
    /// It wants every frame instead of states.
    pub frames: bool,
    /// Its last message, once it knows the run; without this, it asks for the run.
    pub have: Option<Have>,
    /// It has published all messages up to this one.
    pub done: u64,
}

/// The last message that a far side has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Have {
    /// Stream id of this publishing of the run.
    pub stream: u64,
    /// All messages up to this one.
    pub seq: u64,
}

/// A far side's report of the messages that it has done with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Done {
    /// Number of the far side.
    pub receiver: u64,
    /// All messages up to this one have been published there.
    pub have: Have,
}

/// The answer to a far side that asks for the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Welcome {
    /// The near side's versions.
    pub versions: Versions,
    /// The run, once it is there.
    pub run: Option<Offer>,
}

/// A run that can be had.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Offer {
    /// The manifest as JSON, byte for byte as on the bus.
    pub manifest: String,
    /// Ask for the messages after this one.
    pub have: Have,
    /// Every frame is sent.
    pub frames: bool,
}

/// Goes with each message of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Number of the message, from 1.
    pub seq: u64,
    /// The message that was sent before it, or that the far side has: those between were left out.
    pub after: u64,
    /// Rows of results that no far side can have any more.
    pub rows_lost: u64,
    /// Time that it has waited for the far side (ms).
    pub age_ms: u64,
}

impl Place {
    /// Writes it as bytes.
    pub fn encode(self) -> Vec<u8> {
        [self.seq, self.after, self.rows_lost, self.age_ms].iter().flat_map(|n| n.to_le_bytes()).collect()
    }

    /// Reads it from bytes.
    ///
    /// # Errors
    /// When they are none.
    pub fn decode(bytes: &[u8]) -> Result<Self, MessageError> {
        let wrong = || garbage(format_args!("a place of {} bytes, expected 32", bytes.len()));
        let mut rest = Words(bytes);
        let mut next = || rest.take().ok_or_else(wrong);
        let place = Self { seq: next()?, after: next()?, rows_lost: next()?, age_ms: next()? };
        if bytes.len() == 32 { Ok(place) } else { Err(wrong()) }
    }
}

/// Reads `u64`s, least significant byte first.
struct Words<'a>(&'a [u8]);

impl Words<'_> {
    fn take(&mut self) -> Option<u64> {
        let (word, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        Some(u64::from_le_bytes(*word))
    }
}

/// A request or an answer as JSON.
pub fn to_json(value: &impl Serialize) -> String {
    // these types have string keys only
    serde_json::to_string(value).unwrap_or_default()
}

/// A request from JSON.
///
/// # Errors
/// When it is none.
pub fn request<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, MessageError> {
    from_json(bytes, MOST_REQUEST_BYTES)
}

/// An answer from JSON.
///
/// # Errors
/// When it is none.
pub fn answer<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, MessageError> {
    from_json(bytes, MOST_ANSWER_BYTES)
}

fn from_json<T: DeserializeOwned>(bytes: &[u8], most: usize) -> Result<T, MessageError> {
    if bytes.len() > most {
        return Err(garbage(format_args!("{} bytes, at most {most} are expected", bytes.len())));
    }
    // another version may have other keys: its number comes first
    if let Ok(Versioned { versions: Numbered { protocol } }) = serde_json::from_slice(bytes)
        && protocol != PROTOCOL_VERSION
    {
        Versions { protocol, ..Versions::OURS }.check(false)?;
    }
    serde_json::from_slice(bytes).map_err(garbage)
}

#[derive(Deserialize)]
struct Versioned {
    versions: Numbered,
}

#[derive(Deserialize)]
struct Numbered {
    protocol: u32,
}

/// Successive frames on their way into one message. A state is one frame.
#[derive(Debug, Default)]
pub struct FramesMessage {
    bytes: Vec<u8>,
    next: u64,
}

impl FramesMessage {
    /// Adds a frame; the first one decides where the message begins.
    pub fn push(&mut self, frame: &Frame<'_>) {
        if self.bytes.is_empty() {
            self.bytes.extend([FRAMES, frame.frame].iter().flat_map(|n| n.to_le_bytes()));
        }
        for values in [frame.u_m, frame.v_m_s, frame.extra] {
            self.bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
        }
        self.next = frame.frame + 1;
    }

    /// True if `frame` comes right after the frames in it.
    pub fn continues_with(&self, frame: u64) -> bool {
        self.bytes.is_empty() || frame == self.next
    }

    /// Bytes so far.
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    /// True if nothing is in it.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The message.
    pub fn finish(&mut self) -> Vec<u8> {
        let room = self.bytes.len();
        std::mem::replace(&mut self.bytes, Vec::with_capacity(room))
    }
}

/// Head of rows of results: their description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RowsHead {
    /// The last part of the topic's name; somebody's own begin with `own/`.
    pub topic: String,
    /// Elements in a row.
    pub width: usize,
    /// Names of the columns.
    pub names: String,
    /// Largest overlap or gap (m) that counts as touching, for classes of contacts; none for numbers.
    pub tolerance_m: Option<f64>,
    /// No more rows come: in order, or because the publisher is gone.
    pub ended: Option<bool>,
}

impl RowsHead {
    /// The head of rows of these columns.
    pub fn new(topic: Topic, columns: &ResultColumns) -> Self {
        let ResultColumns { width, names, tolerance_m } = columns.clone();
        Self { topic: topic.as_str().to_owned(), width, names, tolerance_m, ended: None }
    }

    /// The topic.
    ///
    /// # Errors
    /// When it is none that carries results.
    pub fn topic(&self) -> Result<Topic, MessageError> {
        let name = self.topic.parse().map(Topic::Results);
        name.map_err(|why| garbage(format_args!("results called `{}`: {why}", self.topic)))
    }

    /// Bytes of a row with the number of its frame: numbers have 8 each, classes 1.
    pub fn row_bytes(&self) -> usize {
        let each = if self.tolerance_m.is_some() { 1 } else { 8 };
        self.width.saturating_mul(each).saturating_add(8)
    }

    /// The columns.
    pub fn columns(&self) -> ResultColumns {
        ResultColumns { width: self.width, names: self.names.clone(), tolerance_m: self.tolerance_m }
    }
}

/// Rows of results on their way into one message.
#[derive(Debug, Default)]
pub struct RowsMessage {
    rows: Vec<u8>,
}

impl RowsMessage {
    /// Adds the row of `frame`, as bytes.
    pub fn push(&mut self, frame: u64, values: impl Iterator<Item = u8>) {
        self.rows.extend(frame.to_le_bytes());
        self.rows.extend(values);
    }

    /// Bytes so far.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// True if nothing is in it.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The message.
    pub fn finish(&mut self, head: &RowsHead) -> Vec<u8> {
        let head = to_json(head);
        let mut bytes: Vec<u8> = [ROWS, head.len() as u64].iter().flat_map(|n| n.to_le_bytes()).collect();
        bytes.extend(head.as_bytes());
        bytes.append(&mut self.rows);
        bytes
    }
}

/// End of the run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct EndMessage {
    /// The word for it.
    pub reason: String,
    /// The last frame that was published, if any.
    pub last_frame: Option<u64>,
}

impl EndMessage {
    /// The message.
    pub fn encode(&self) -> Vec<u8> {
        END.to_le_bytes().into_iter().chain(to_json(self).into_bytes()).collect()
    }

    /// The reason, if it is one that a live run ends for.
    pub fn reason(&self) -> Option<EndReason> {
        use EndReason::{Complete, Dropped, Failed, Interrupted, ProducerLost, Stopped};
        [Complete, Interrupted, Failed, ProducerLost, Dropped, Stopped]
            .into_iter()
            .find(|reason| reason.as_str() == self.reason)
    }
}

/// A message of the run.
#[derive(Debug, Clone, PartialEq)]
pub enum Message<'a> {
    /// Successive frames.
    Frames {
        /// The first.
        first: u64,
        /// Their doubles, `[u | v | extra]` of each.
        doubles: &'a [u8],
    },
    /// Rows of results.
    Rows {
        /// Their head.
        head: RowsHead,
        /// The number of the frame and the values of each.
        rows: &'a [u8],
    },
    /// No more comes.
    End {
        /// Why.
        reason: EndReason,
        /// The last frame that was published, if any.
        last_frame: Option<u64>,
    },
}

impl<'a> Message<'a> {
    /// Reads it from bytes, about the run of `manifest`.
    ///
    /// # Errors
    /// When they are no message about it.
    pub fn decode(bytes: &'a [u8], manifest: &RunManifest) -> Result<Self, MessageError> {
        bounds::check_length(bytes, manifest)?;
        let mut words = Words(bytes);
        let short = || garbage(format_args!("a message of {} bytes", bytes.len()));
        match words.take().ok_or_else(short)? {
            FRAMES => {
                let first = words.take().ok_or_else(short)?;
                let (doubles, each) = (words.0, 8 * manifest.frame_doubles());
                let count = (doubles.len() / each) as u64;
                let is_whole = count > 0 && doubles.len().is_multiple_of(each);
                if !is_whole || first >= manifest.frame_count() || count > manifest.frame_count() - first {
                    let (found, all) = (doubles.len(), manifest.frame_count());
                    return Err(garbage(format_args!(
                        "{found} bytes from frame {first} on, expected a multiple of {each} within {all} frames"
                    )));
                }
                Ok(Self::Frames { first, doubles })
            }
            ROWS => {
                let length =
                    words.take().and_then(|length| usize::try_from(length).ok()).ok_or_else(short)?;
                let (head, rows) = words.0.split_at_checked(length).ok_or_else(short)?;
                let head: RowsHead = from_json(head, MOST_HEAD_BYTES)?;
                head.topic()?;
                bounds::check_rows(rows, head.row_bytes(), manifest)?;
                Ok(Self::Rows { head, rows })
            }
            END => {
                let end: EndMessage = from_json(words.0, MOST_HEAD_BYTES)?;
                let reason = end.reason().ok_or_else(|| garbage(format_args!("the end `{}`", end.reason)))?;
                if end.last_frame.is_some_and(|last| last >= manifest.frame_count()) {
                    return Err(garbage(format_args!("the end {end:?}")));
                }
                Ok(Self::End { reason, last_frame: end.last_frame })
            }
            kind => Err(garbage(format_args!("a message of kind {kind}"))),
        }
    }
}

#[cfg(test)]
mod tests;
