//! Turns of a consumer that has joined.

use super::LIVENESS_PERIOD;
use crate::transport::wire::{RunStatus, STATE_DONE, STATE_FAILED, STATE_INTERRUPTED, StateHeader};
use crate::{Delivery, StreamId};
use schemas::frame::EndReason;
use std::time::Instant;

/// Next action of a consumer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// Let go of the sample taken last and take one from the queue: [`Following::took`].
    Take,
    /// Read the status of the stream: [`Following::read`].
    Read,
    /// Ask if the producer lives: [`Following::heard`].
    Ask,
    /// Wait for a moment: [`Following::waited`].
    Wait,
    /// Tell that the sample taken last is the next frame.
    Frame,
    /// Tell that frames did not come.
    Missed {
        /// The first of them.
        from: u64,
        /// The last of them.
        to: u64,
    },
    /// Tell that no more frames come.
    End(EndReason),
}

/// State of a consumer between two turns.
#[derive(Debug, Clone, Copy)]
enum At {
    /// There may be something in the queue.
    Queue,
    /// A sample of this frame is in hand.
    Sample(u64),
    /// A sample of this frame is in hand, and frames before it are missing for good: we were dropped.
    Gap(u64),
    /// The queue was empty.
    Empty,
    /// The queue was empty after the end was found.
    Emptied(EndReason),
    /// Nothing has come for a long time.
    Silence,
    Waiting,
    /// Frames up to this one are missing; the end comes after them.
    Lost(u64, EndReason),
    Over(EndReason),
}

/// A consumer that has joined a stream, or subscribed to results.
#[derive(Debug)]
pub struct Following {
    /// Stream of the consumer. Results have none before the first row.
    stream: Option<StreamId>,
    delivery: Delivery,
    expected: u64,
    missed_count: u64,
    /// True if a new producer has this name, and ours is over.
    succeeded: bool,
    /// End of the stream; believed only after the queue was emptied once more.
    closing: Option<EndReason>,
    /// The last frame published, as far as is known: later producers push our status out.
    last: Option<u64>,
    checked_at: Instant,
    at: At,
}

impl Following {
    /// Makes one for a consumer that is guaranteed frames from `first_frame` on.
    pub fn new(stream: StreamId, delivery: Delivery, first_frame: u64, now: Instant) -> Self {
        Self { stream: Some(stream), delivery, expected: first_frame, ..Self::of_results(now) }
    }

    /// Makes one for a subscriber to results. Results begin with the first row that comes, and go on after a gap, as not
    /// each frame has a row.
    pub fn of_results(now: Instant) -> Self {
        Self {
            stream: None,
            delivery: Delivery::Latest,
            expected: 0,
            missed_count: 0,
            succeeded: false,
            closing: None,
            last: None,
            checked_at: now,
            at: At::Queue,
        }
    }

    /// Stream of the consumer, once it is known.
    pub fn stream(&self) -> Option<StreamId> {
        self.stream
    }

    /// The first frame that we neither have nor know to be missing.
    pub fn expected(&self) -> u64 {
        self.expected
    }

    /// Number of missed frames.
    pub fn missed_count(&self) -> u64 {
        self.missed_count
    }

    /// Time when the producer was last known to live: when the last frame came, or later.
    pub fn came_at(&self) -> Instant {
        self.checked_at
    }

    /// True if only the end is left to tell.
    pub fn is_over(&self) -> bool {
        matches!(self.at, At::Over(_))
    }

    /// Ends the stream for the consumer, if it has not ended.
    pub fn end(&mut self, reason: EndReason) {
        if !self.is_over() {
            self.at = At::Over(reason);
        }
    }

    /// Decides the next action.
    pub fn turn(&mut self) -> Turn {
        match self.at {
            At::Queue => Turn::Take,
            At::Sample(frame) if frame > self.expected => self.miss(frame - 1),
            At::Sample(_) => {
                self.expected += 1;
                self.at = At::Queue;
                Turn::Frame
            }
            At::Gap(_) | At::Empty | At::Emptied(_) => Turn::Read,
            At::Silence => Turn::Ask,
            At::Waiting => Turn::Wait,
            At::Lost(last, reason) => {
                self.at = At::Over(reason);
                self.miss(last)
            }
            At::Over(reason) => Turn::End(reason),
        }
    }

    fn miss(&mut self, to: u64) -> Turn {
        let from = std::mem::replace(&mut self.expected, to + 1);
        self.missed_count += to - from + 1;
        Turn::Missed { from, to }
    }

    /// Notes the sample that was in the queue; none if the queue was empty.
    pub fn took(&mut self, header: Option<&StateHeader>, now: Instant) {
        let Some(header) = header else {
            self.at = self.closing.map_or(At::Empty, At::Emptied);
            return;
        };
        if self.stream.is_none() {
            (self.stream, self.expected) = (Some(header.stream()), header.frame);
        }
        if self.stream != Some(header.stream()) {
            self.succeeded = true;
        } else if header.frame >= self.expected {
            self.checked_at = now;
            // the producer skips frames of a lossless consumer only if it has dropped it
            let is_gap = header.frame > self.expected && self.delivery == Delivery::Lossless;
            self.at = if is_gap { At::Gap(header.frame) } else { At::Sample(header.frame) };
        }
    }

    /// Notes the status of our stream; none if the status is no longer known.
    pub fn read(&mut self, status: Option<&RunStatus>, now: Instant) {
        let (last, end) = (status.and_then(RunStatus::last_frame), status.and_then(end_of));
        self.last = self.last.max(last);
        self.at = match self.at {
            // what was published without us is missed as far as that is known
            At::Gap(frame) => At::Lost(self.last.map_or(frame, |last| last.max(frame)), EndReason::Dropped),
            At::Emptied(reason) => {
                // one that is not alive any more may have ended in order just before
                let reason = end.unwrap_or(reason);
                match self.last.filter(|last| *last >= self.expected) {
                    None => At::Over(reason),
                    Some(last)
                        if self.delivery == Delivery::Lossless && reason != EndReason::ProducerLost =>
                    {
                        At::Lost(last, EndReason::Dropped)
                    }
                    Some(last) => At::Lost(last, reason),
                }
            }
            _ => {
                let lost = (status.is_none() || self.succeeded).then_some(EndReason::ProducerLost);
                self.closing = end.or(lost);
                if self.closing.is_some() {
                    At::Queue
                } else if now.duration_since(self.checked_at) >= LIVENESS_PERIOD {
                    self.checked_at = now;
                    At::Silence
                } else {
                    At::Waiting
                }
            }
        };
    }

    /// Notes the answer: `is_alive` is true if the producer lives.
    pub fn heard(&mut self, is_alive: bool) {
        if is_alive {
            self.at = At::Waiting;
        } else {
            self.closing = Some(EndReason::ProducerLost);
            self.at = At::Queue;
        }
    }

    /// Notes that a moment has passed.
    pub fn waited(&mut self) {
        self.at = At::Queue;
    }
}

/// End of a stream with this status, if its producer told one.
fn end_of(status: &RunStatus) -> Option<EndReason> {
    match status.state {
        STATE_DONE => Some(EndReason::Complete),
        STATE_INTERRUPTED => Some(EndReason::Interrupted),
        STATE_FAILED => Some(EndReason::Failed),
        _ => None,
    }
}
