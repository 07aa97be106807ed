//! Progress of a run, the consumers that have joined it, and the choice of the frames that they are offered.

use super::offering::Offering;
use crate::transport::wire::{JOIN_CONNECT, JOIN_READY, JoinAnswer, JoinRequest, RunStatus, STATE_RUNNING};
use std::collections::HashSet;
use std::time::{Duration, Instant};

/// Frames between two wake-ups of consumers, when frames come fast.
const WAKE_EVERY_FRAMES: u32 = 16;
/// Longest time between two wake-ups while frames come.
const WAKE_PERIOD: Duration = Duration::from_millis(1);

/// Response to a request to join.
#[derive(Debug, Clone, Copy)]
pub struct Asked {
    /// Answer to send once the rest is done.
    pub answer: JoinAnswer,
    /// True to update the connections to all subscribers.
    pub connect: bool,
    /// True to wait for this consumer from now on.
    pub joined: bool,
}

/// A run that is being published.
#[derive(Debug)]
pub struct Publishing {
    status: RunStatus,
    next_frame: u64,
    ready: HashSet<u128>,
    offering: Offering,
    since_wake: u32,
    woke_at: Instant,
}

impl Publishing {
    /// Makes one for a run that begins with this status.
    pub fn new(status: RunStatus, now: Instant) -> Self {
        Self {
            next_frame: status.first_frame,
            status,
            ready: HashSet::new(),
            offering: Offering::default(),
            since_wake: 0,
            woke_at: now,
        }
    }

    /// The frame to be published next.
    pub fn next_frame(&self) -> u64 {
        self.next_frame
    }

    /// Progress of the run.
    pub fn status(&mut self) -> &mut RunStatus {
        &mut self.status
    }

    /// Decides about a consumer's request; `is_attached` is true for a subscriber that is there.
    ///
    /// Call it between two frames: a frame that is being sent does not belong to a consumer that joins meanwhile.
    pub fn asked(&mut self, request: JoinRequest, is_attached: impl Fn(u128) -> bool) -> Asked {
        let mut answer = JoinAnswer {
            run_id: self.status.run_id,
            stream_id: self.status.stream_id,
            phase: request.phase,
            ..JoinAnswer::default()
        };
        let (connect, ready) = (request.phase == JOIN_CONNECT, request.phase == JOIN_READY);
        if connect || ready {
            // frames are not left out for whom has just come
            self.offering = Offering::default();
        }
        if ready {
            answer.first_frame = self.next_frame;
        }
        let id = u128::from_le_bytes(request.subscriber_id);
        let joined = ready && is_attached(id);
        if joined {
            self.ready.retain(|id| is_attached(*id));
            self.ready.insert(id);
        }
        Asked { answer, connect, joined }
    }

    /// Consumers that have joined; some may have left since the last one came.
    pub fn ready(&self) -> &HashSet<u128> {
        &self.ready
    }

    /// True if the next frame is to be sent: a frame that nobody takes need not be written.
    pub fn offers(&mut self, subscribers: usize, is_last: bool, now: Instant) -> bool {
        subscribers > 0 && (self.offering.is_due(now) || is_last)
    }

    /// Notes that the next frame was sent, and that `recipients` consumers took it.
    pub fn offered(&mut self, recipients: usize, now: Instant) {
        self.offering.offered(recipients, now);
    }

    /// Notes that the next frame is out.
    pub fn published(&mut self, step: u64, time_s: f64) {
        self.next_frame += 1;
        self.since_wake += 1;
        self.status.state = STATE_RUNNING;
        self.status.frames += 1;
        (self.status.step, self.status.time_s) = (step, time_s);
    }

    /// True if consumers are to be woken, and the status is to be written, after the next frame.
    pub fn rings(&self, now: Instant) -> bool {
        self.since_wake + 1 >= WAKE_EVERY_FRAMES || now.duration_since(self.woke_at) >= WAKE_PERIOD
    }

    /// True if consumers have not been woken since the last frame.
    pub fn has_news(&self) -> bool {
        self.since_wake > 0
    }

    /// Notes that consumers were woken.
    pub fn woke(&mut self, now: Instant) {
        (self.since_wake, self.woke_at) = (0, now);
    }
}
