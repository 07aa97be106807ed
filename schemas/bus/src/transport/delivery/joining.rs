//! The handshake of a consumer with its producer.

use super::LIVENESS_PERIOD;
use crate::StreamId;
use crate::transport::wire::{JOIN_CONNECT, JOIN_READY, JoinAnswer, RunStatus, STATE_RUNNING};
use schemas::manifest::RunId;
use std::time::Instant;

/// Next action of a consumer in the handshake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JoinTurn {
    /// Send a request of this phase: [`Joining::requested`].
    Request(u64),
    /// Look for the answer: [`Joining::answered`].
    Answer,
    /// Let go of the sample taken last and take one from the queue, so that the producer is not held back:
    /// [`Joining::took`].
    Take,
    /// Connect to the producer: [`Joining::connected`].
    Connect,
    /// Look at the status, and ask if the process that wrote it lives: [`Joining::looked`].
    Look,
    /// Wait for a moment: [`Joining::waited`].
    Wait,
    /// The handshake is done. The sample taken last may be the first that is guaranteed.
    Joined {
        /// The first frame that is guaranteed.
        first_frame: u64,
    },
    /// The producer has left.
    Left,
}

/// A consumer in the handshake.
#[derive(Debug)]
pub struct Joining {
    stream: StreamId,
    phase: u64,
    first_frame: u64,
    checked_at: Instant,
    turn: JoinTurn,
}

impl Joining {
    /// Begins the handshake with the producer of `stream`.
    pub fn new(stream: StreamId, now: Instant) -> Self {
        let (phase, turn) = (JOIN_CONNECT, JoinTurn::Request(JOIN_CONNECT));
        Self { stream, phase, first_frame: 0, checked_at: now, turn }
    }

    /// Stream that the consumer joins.
    pub fn stream(&self) -> StreamId {
        self.stream
    }

    /// Next action of the consumer.
    pub fn turn(&self) -> JoinTurn {
        self.turn
    }

    /// Notes that the request was sent.
    pub fn requested(&mut self, now: Instant) {
        self.checked_at = now;
        self.turn = JoinTurn::Answer;
    }

    /// Notes the answer; none if it was not there. A sample that was taken just before the answer is kept.
    pub fn answered(&mut self, answer: Option<&JoinAnswer>) {
        self.turn = match answer {
            None => JoinTurn::Take,
            Some(answer) => {
                self.first_frame = answer.first_frame;
                let stream = StreamId { run_id: RunId(answer.run_id), stream_id: answer.stream_id };
                if stream == self.stream { JoinTurn::Connect } else { JoinTurn::Left }
            }
        };
    }

    /// Notes a look into the queue; `any` is true if there was a sample.
    pub fn took(&mut self, any: bool, now: Instant) {
        self.turn = if any {
            JoinTurn::Answer
        } else if now.duration_since(self.checked_at) >= LIVENESS_PERIOD {
            self.checked_at = now;
            JoinTurn::Look
        } else {
            JoinTurn::Wait
        };
    }

    /// Notes that the connection is made.
    pub fn connected(&mut self) {
        self.turn = if self.phase == JOIN_CONNECT {
            self.phase = JOIN_READY;
            JoinTurn::Request(JOIN_READY)
        } else {
            JoinTurn::Joined { first_frame: self.first_frame }
        };
    }

    /// Notes the status; `is_alive` is true if the producer that wrote it lives.
    pub fn looked(&mut self, status: &RunStatus, is_alive: bool) {
        // nobody answers a request to a producer before this one
        let goes_on = status.stream() == self.stream && status.state <= STATE_RUNNING && is_alive;
        self.turn = if goes_on { JoinTurn::Wait } else { JoinTurn::Left };
    }

    /// Notes that a moment has passed.
    pub fn waited(&mut self) {
        self.turn = JoinTurn::Answer;
    }
}
