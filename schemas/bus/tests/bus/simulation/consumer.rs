//! A consumer: it does what `delivery` says, a turn at a time, and compares what it is told with what is true.

use super::transport::World;
use bus::delivery::{Following, JoinTurn, Joining, Turn};
use bus::{Delivery, JoinRequest, STATE_RUNNING, StateHeader, StreamId};
use schemas::frame::EndReason;
use schemas::manifest::RunId;
use std::time::{Duration, Instant};

const WAIT: Duration = Duration::from_millis(50);

/// What became of each stream.
#[derive(Default)]
pub(super) struct Truth {
    /// Frames published, whether or not a send of the next one has begun.
    pub(super) published: u64,
    pub(super) end: Option<EndReason>,
}

enum Stage {
    Searching,
    Subscribing(StreamId),
    Joining(Joining),
    Following(Following),
    Gone,
}

pub(super) struct Consumer {
    name: usize,
    delivery: Delivery,
    capacity: usize,
    /// How long it is busy at a time, at the most: with a frame, and now and then with anything.
    slowness: Duration,
    /// In how many turns it dies, or leaves, on average.
    deadliness: u64,
    stage: Stage,
    id: usize,
    hand: Option<StateHeader>,
    /// The frame that it has to hear of next.
    next: u64,
    /// Frames were missing although it wants all: only the end may come.
    dropped: bool,
    waits: bool,
    pub(super) wakes_at: Instant,
}

pub(super) fn stream(id: u64) -> StreamId {
    StreamId { run_id: RunId([0; 16]), stream_id: id }
}

impl Consumer {
    pub(super) fn new(name: usize, capacity: usize, world: &mut World) -> Self {
        let random = &mut world.random;
        let slowness = Duration::from_millis(random.pick(&[0, 0, 1, 20, 100, 1000, 1_000_000]));
        let begins = random.pick(&[0, 0, 10, 100, 1000]);
        Self {
            name,
            delivery: random.pick(&[Delivery::Lossless, Delivery::Lossless, Delivery::Latest]),
            capacity,
            slowness,
            deadliness: random.pick(&[20, 200, u64::MAX, u64::MAX]),
            stage: Stage::Searching,
            id: 0,
            hand: None,
            next: 0,
            dropped: false,
            waits: false,
            wakes_at: world.now + Duration::from_millis(random.below(begins + 1)),
        }
    }

    pub(super) fn is_gone(&self) -> bool {
        matches!(self.stage, Stage::Gone)
    }

    pub(super) fn is_awake(&self, world: &World) -> bool {
        self.wakes_at <= world.now || (self.waits && world.subscribers[self.id].rung)
    }

    fn sleep(&mut self, world: &World, time: Duration) {
        self.wakes_at = world.now + time;
    }

    /// It is busy, or is not given the processor.
    fn dawdle(&mut self, world: &mut World) {
        let most = self.slowness.as_micros() as u64;
        let busy = Duration::from_micros(world.random.below(most + 1));
        self.sleep(world, busy);
    }

    fn wait(&mut self, world: &mut World) {
        self.waits = true;
        self.sleep(world, WAIT);
    }

    fn say(&self, world: &mut World, what: &dyn std::fmt::Debug) {
        world.note(|| format!("{} {} {what:?}", self.delivery.as_str(), self.name));
    }

    /// One turn; `over`: no producer will come any more.
    pub(super) fn step(&mut self, world: &mut World, truths: &[Truth], over: bool) -> Result<(), String> {
        if self.waits {
            self.waits = false;
            world.subscribers[self.id].rung = false;
        }
        if world.random.one_in(self.deadliness) && self.perishes(world) {
            return Ok(());
        }
        if world.random.one_in(64) {
            self.dawdle(world);
        }
        match std::mem::replace(&mut self.stage, Stage::Gone) {
            Stage::Searching => {
                let status = world.status;
                if status.state <= STATE_RUNNING && world.is_alive(&status) {
                    self.stage = Stage::Subscribing(stream(status.stream_id));
                } else if !over {
                    self.stage = Stage::Searching;
                    self.sleep(world, WAIT);
                }
            }
            Stage::Subscribing(stream) => {
                // who registers cleans up
                world.clean();
                (self.id, self.hand) = (world.subscribe(self.delivery, self.capacity), None);
                self.stage = Stage::Joining(Joining::new(stream, world.now));
            }
            Stage::Joining(joining) => self.join(joining, world)?,
            Stage::Following(following) => self.follow(following, world, truths)?,
            Stage::Gone => {}
        }
        Ok(())
    }

    /// It is killed or leaves, wherever it is.
    fn perishes(&mut self, world: &mut World) -> bool {
        let dies = world.random.one_in(2);
        match &mut self.stage {
            Stage::Following(following) if !dies => {
                following.end(EndReason::Stopped);
                false
            }
            Stage::Joining(_) | Stage::Following(_) => {
                self.say(world, &if dies { "dies" } else { "leaves" });
                self.stage = Stage::Gone;
                let (now, subscriber) = (world.now, &mut world.subscribers[self.id]);
                (subscriber.listed, subscriber.died_at) = (dies, Some(now));
                true
            }
            _ => false,
        }
    }

    fn leave(&mut self, world: &mut World) {
        world.subscribers[self.id].listed = false;
    }

    fn join(&mut self, mut joining: Joining, world: &mut World) -> Result<(), String> {
        let (turn, now) = (joining.turn(), world.now);
        self.say(world, &turn);
        match turn {
            JoinTurn::Request(phase) => {
                world.subscribers[self.id].answer = None;
                let subscriber_id = (self.id as u128).to_le_bytes();
                if let Some(requests) = &mut world.requests {
                    requests.push_back(JoinRequest { subscriber_id, phase, reserved: 0 });
                }
                joining.requested(now);
            }
            JoinTurn::Answer => joining.answered(world.subscribers[self.id].answer.take().as_ref()),
            JoinTurn::Take => {
                self.hand = world.take(self.id);
                joining.took(self.hand.is_some(), now);
            }
            JoinTurn::Connect => {
                world.connect(self.id);
                joining.connected();
            }
            JoinTurn::Look => {
                joining.looked(&world.status, world.is_alive(&world.status));
                let is_there = world.alive == Some(joining.stream().stream_id);
                self.check(is_there || joining.turn() == JoinTurn::Left, || {
                    "waits for a producer that is gone".into()
                })?;
            }
            JoinTurn::Wait => {
                joining.waited();
                self.wait(world);
            }
            JoinTurn::Left => {
                self.leave(world);
                self.stage = Stage::Searching;
                return Ok(());
            }
            JoinTurn::Joined { first_frame } => {
                self.check(world.subscribers[self.id].has_chain, || "joined without the chain".into())?;
                self.next = first_frame;
                let mut following = Following::new(joining.stream(), self.delivery, first_frame, now);
                if self.hand.is_some() {
                    following.took(self.hand.as_ref(), now);
                }
                self.stage = Stage::Following(following);
                return Ok(());
            }
        }
        self.stage = Stage::Joining(joining);
        Ok(())
    }

    fn follow(
        &mut self,
        mut following: Following,
        world: &mut World,
        truths: &[Truth],
    ) -> Result<(), String> {
        let (turn, now) = (following.turn(), world.now);
        let stream = following.stream().ok_or("frames of no stream")?;
        self.say(world, &turn);
        match turn {
            Turn::Take => {
                self.hand = world.take(self.id);
                following.took(self.hand.as_ref(), now);
            }
            Turn::Read => following.read(world.status_of(stream).as_ref(), now),
            Turn::Ask => following.heard(world.alive == Some(stream.stream_id)),
            Turn::Wait => {
                following.waited();
                self.wait(world);
            }
            Turn::Frame => {
                let hand = self.hand.take().ok_or("a frame without a sample")?;
                let (got, due) = ((hand.stream_id, hand.frame), (stream.stream_id, self.next));
                self.check(got == due, || format!("got {got:?} instead of {due:?}"))?;
                self.check(!self.dropped, || "got a frame after it was dropped".into())?;
                self.next += 1;
                self.dawdle(world);
            }
            Turn::Missed { from, to } => {
                self.check_missed(from, to, stream, world, truths)?;
                self.next = to + 1;
                self.dropped = self.delivery == Delivery::Lossless;
            }
            Turn::End(reason) => {
                self.check_end(reason, stream, world, truths)?;
                self.leave(world);
                return Ok(());
            }
        }
        self.stage = Stage::Following(following);
        Ok(())
    }

    fn check(&self, holds: bool, what: impl FnOnce() -> String) -> Result<(), String> {
        if holds { Ok(()) } else { Err(format!("{} {}: {}", self.delivery.as_str(), self.name, what())) }
    }

    /// What is missed was published, begins where the last frame ended, and never reached us.
    fn check_missed(
        &self,
        from: u64,
        to: u64,
        stream: StreamId,
        world: &mut World,
        truths: &[Truth],
    ) -> Result<(), String> {
        let published = truths[stream.stream_id as usize].published;
        let bits = |from: u64, to: u64| (1_u128 << (to + 1)) - (1_u128 << from);
        let evicted = world.subscribers[self.id].evicted;
        let pushed = world.queue(self.id, stream.stream_id).pushed;
        // who was dropped hears of no frame after the first that is missing
        let lost = if self.delivery == Delivery::Lossless { bits(from, from) } else { bits(from, to) };
        let is_right = from == self.next
            && from <= to
            && to <= published
            && pushed & lost == 0
            && (evicted || self.delivery == Delivery::Latest);
        self.check(is_right, || {
            format!("told to have missed {from} to {to}; next {}, evicted {evicted}, {published} published, in the queue were {pushed:b}", self.next)
        })
    }

    /// The end is the one that there was, and nothing before it is unsaid.
    fn check_end(
        &self,
        reason: EndReason,
        stream: StreamId,
        world: &mut World,
        truths: &[Truth],
    ) -> Result<(), String> {
        let Truth { published, end } = truths[stream.stream_id as usize];
        let evicted = world.subscribers[self.id].evicted;
        let queue = world.queue(self.id, stream.stream_id);
        let (left, last) = (queue.samples.len(), 128 - u64::from(queue.pushed.leading_zeros()));
        let next = self.next;
        // a frame whose sending was given up may have reached some
        let all = next == published || next == published + 1;
        let is_right = match reason {
            EndReason::Stopped => true,
            EndReason::Dropped => evicted,
            // what was sent last by a producer that was killed may stand in no status
            EndReason::ProducerLost if end.is_none() || world.status_of(stream).is_none() => {
                left == 0
                    && next >= last
                    && (evicted || self.delivery == Delivery::Latest || next >= published)
            }
            _ => Some(reason) == end && left == 0 && all,
        };
        self.check(is_right, || {
            format!("told {reason:?} after frame {next}; it was {end:?}, {published} published, {left} in the queue, evicted {evicted}")
        })
    }
}
