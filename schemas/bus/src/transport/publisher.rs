//! The producer's side of a run on the bus.

mod opening;

use super::backpressure::Backpressure;
use super::board::{BoardWriter, unix_ns};
use super::delivery::Publishing;
use super::outlet::wait_for_others;
use super::wire::{
    FLAG_LAST, JoinAnswer, JoinRequest, STATE_DONE, STATE_FAILED, STATE_INTERRUPTED, Slots, StateHeader,
};
use super::{Bus, Ipc, services};
use crate::values::Remedies;
use crate::{ConsumerEvent, Delivery, PublishCounts, PublishError, PublishOptions, StreamId, WaitOutcome};
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::node::Node;
use iceoryx2::port::SendError;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::server::Server;
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::PortFactory as _;
use schemas::frame::{EndReason, Frame, FrameSink};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two counts of consumers for the status.
const COUNT_PERIOD: Duration = Duration::from_millis(100);
/// Longest wait of an idle producer before it looks around.
const IDLE_WAIT: Duration = Duration::from_millis(50);

impl PublishOptions {
    #[cfg(feature = "faults")]
    fn remedies(&self) -> Remedies {
        self.remedies
    }

    #[cfg(not(feature = "faults"))]
    #[expect(clippy::unused_self, reason = "all of them, whatever the options are")]
    fn remedies(&self) -> Remedies {
        Remedies::default()
    }
}

type JoinServer = Server<Ipc, JoinRequest, (), JoinAnswer, ()>;

/// Publisher of one run. Every accepted frame reaches every lossless consumer, or the end gives the reason.
///
/// Dropping it without [`StatePublisher::finish`] tells consumers that the run failed.
pub struct StatePublisher {
    publisher: Publisher<Ipc, [f64], StateHeader>,
    slots: Slots,
    chain: Publisher<Ipc, [f64], StateHeader>,
    server: JoinServer,
    join: services::JoinService,
    joiners: Listener<Ipc>,
    backpressure: Arc<Backpressure<f64>>,
    board: BoardWriter,
    publishing: Publishing,
    stream: StreamId,
    doubles: usize,
    max_consumers: usize,
    last_step: u64,
    counts: PublishCounts,
    counted_at: Instant,
    finished: bool,
    remedies: Remedies,
    told_gone: bool,
    // last, so that everything on the node goes before it
    node: Node<Ipc>,
    bus: Bus,
}

impl StatePublisher {
    /// Identity of the stream: the run, and this publishing of it. Results carry it too.
    pub fn stream(&self) -> StreamId {
        self.stream
    }

    /// Most consumers that can be attached at a time: fewer when frames are large and shared memory is short.
    pub fn max_consumers(&self) -> usize {
        self.max_consumers
    }

    /// Waits until `count` lossless consumers are ready, `stop` is set, or `timeout` is over.
    ///
    /// # Errors
    /// When so many can never be attached, or when the bus cannot be used.
    pub fn wait_for(
        &mut self,
        count: usize,
        stop: &AtomicBool,
        timeout: Option<Duration>,
    ) -> Result<WaitOutcome, PublishError> {
        if count > self.max_consumers {
            return Err(PublishError::TooManyConsumers { asked: count, most: self.max_consumers });
        }
        let start = Instant::now();
        loop {
            self.serve()?;
            if stop.load(Ordering::Relaxed) {
                return Ok(WaitOutcome::Stopped);
            }
            let is_over = timeout.is_some_and(|timeout| start.elapsed() >= timeout);
            if is_over || self.ready_count() >= count {
                // a consumer that died while it waited must not count
                self.node.try_cleanup_dead_nodes();
                match self.ready_count() {
                    ready if ready >= count => return Ok(WaitOutcome::Ready),
                    ready if is_over => return Ok(WaitOutcome::TimedOut { ready }),
                    _ => {}
                }
            }
            // a signal ends the wait early; the loop looks at the flag
            let _ = self.joiners.timed_wait(|_| {}, IDLE_WAIT);
        }
    }

    /// Answers joining consumers, and renews the status: for a producer that has nothing to
    /// publish for a while. Never waits.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn serve(&mut self) -> Result<(), PublishError> {
        // joiners are found by their requests; their notifications only end a wait
        let _ = self.joiners.try_wait(|_| {});
        self.serve_joins()?;
        if self.publishing.has_news() {
            self.wake();
        }
        self.write_status(Instant::now())
    }

    fn serve_joins(&mut self) -> Result<(), PublishError> {
        while self.join.dynamic_config().number_of_clients() > 0 {
            let request = self.server.receive();
            let Some(request) = request.map_err(|e| self.send_error(&e))? else { break };
            self.answer(&request)?;
        }
        Ok(())
    }

    fn answer(
        &mut self,
        request: &ActiveRequest<Ipc, JoinRequest, (), JoinAnswer, ()>,
    ) -> Result<(), PublishError> {
        let id = u128::from_le_bytes(request.payload().subscriber_id);
        let mut attached = self.backpressure.consumers();
        let asked = self.publishing.asked(*request.payload(), |id| attached.contains_key(&id));
        if asked.connect && self.remedies.connect_on_join {
            self.publisher.update_connections().map_err(|e| self.send_error(&e))?;
            self.chain.update_connections().map_err(|e| self.send_error(&e))?;
        }
        if asked.joined
            && let Some((_, name)) = attached.remove(&id)
        {
            self.backpressure.joined(id, name);
        }
        // a consumer that left meanwhile needs no answer
        let _ = request.send_copy(asked.answer);
        self.backpressure.wake();
        Ok(())
    }

    fn ready_count(&self) -> usize {
        let attached = self.backpressure.consumers();
        let counts = |(id, (delivery, _)): &(&u128, &(Delivery, String))| {
            *delivery == Delivery::Lossless
                && self.publishing.ready().contains(id)
                && !self.backpressure.is_ignored(**id)
        };
        attached.iter().filter(counts).count()
    }

    /// Counts of this publisher's work so far.
    pub fn counts(&self) -> PublishCounts {
        let attached = self.backpressure.consumers();
        PublishCounts {
            lossless: self.ready_count(),
            latest: attached.values().filter(|(delivery, _)| *delivery == Delivery::Latest).count(),
            evicted: self.backpressure.evicted_count(),
            ..self.counts
        }
    }

    /// Events about consumers since the last call.
    pub fn take_events(&mut self) -> Vec<ConsumerEvent> {
        let mut events = self.backpressure.take_events();
        if self.bus.is_gone() && !std::mem::replace(&mut self.told_gone, true) {
            events.push(ConsumerEvent::BusGone { root: self.bus.root().to_owned() });
        }
        events
    }

    /// Sends a frame; returns the number of consumers that got it.
    fn send(&mut self, frame: &Frame<'_>) -> Result<usize, PublishError> {
        let header = StateHeader {
            frame: frame.frame,
            step: frame.step,
            time_s: frame.time_s,
            flags: if frame.step == self.last_step { FLAG_LAST } else { 0 },
            ..StateHeader::of(self.stream)
        };
        let (publisher, doubles, remedies) = (&self.publisher, self.doubles, self.remedies);
        let slots = &mut self.slots;
        let mut interruptions = remedies.interruptions;
        let mut send = || {
            let slot = publisher.loan_slice_uninit(doubles)?;
            // repeated: consumers that have the frame already ignore the second one
            let sent = slots.fill(slot, header, frame).send()?;
            match interruptions.checked_sub(1) {
                Some(left) => {
                    interruptions = left;
                    Err(SendError::InternalError)
                }
                None => Ok(sent),
            }
        };
        let sent =
            if remedies.resend { self.backpressure.repeat(&mut self.counts.resent, send) } else { send() };
        match sent {
            Ok(recipients) => Ok(recipients),
            Err(SendError::UnableToDeliver) => Err(PublishError::Stopped { frame: frame.frame }),
            Err(e) => Err(self.send_error(&e)),
        }
    }

    fn send_error(&self, cause: &dyn std::fmt::Debug) -> PublishError {
        PublishError::Send { frame: self.publishing.next_frame(), cause: format!("{cause:?}") }
    }

    fn wake(&mut self) {
        self.backpressure.wake();
        self.publishing.woke(Instant::now());
    }

    /// Writes the status, and now and then counts the consumers for it.
    fn write_status(&mut self, now: Instant) -> Result<(), PublishError> {
        if now.duration_since(self.counted_at) >= COUNT_PERIOD {
            let counts = self.counts();
            self.counted_at = now;
            let status = self.publishing.status();
            (status.lossless, status.latest) = (counts.lossless as u64, counts.latest as u64);
            status.evicted = counts.evicted;
        }
        Ok(self.board.write(self.publishing.status())?)
    }

    /// Tells consumers how the run ended, and leaves the bus. Consumers that are behind still get every accepted frame,
    /// also after this process has exited.
    ///
    /// # Errors
    /// When the end could not be written; consumers then notice that the producer is gone.
    pub fn finish(self, reason: EndReason) -> Result<PublishCounts, PublishError> {
        self.finish_and_wait(reason, &AtomicBool::new(true), Duration::ZERO)
    }

    /// As [`finish`](Self::finish), but leaves the bus only when every consumer has left, `stop` is set, or
    /// `at_most` is over. Use it before publishing under the same name again, so that present consumers can read to the end.
    ///
    /// # Errors
    /// As [`finish`](Self::finish).
    pub fn finish_and_wait(
        mut self,
        reason: EndReason,
        stop: &AtomicBool,
        at_most: Duration,
    ) -> Result<PublishCounts, PublishError> {
        let counts = self.counts(); // before consumers leave
        self.end(match reason {
            EndReason::Complete => STATE_DONE,
            // of a recording that is replayed, the last two: the run went on
            EndReason::Interrupted | EndReason::Stopped | EndReason::Continued | EndReason::Detached => {
                STATE_INTERRUPTED
            }
            _ => STATE_FAILED,
        })?;
        wait_for_others(&self.node, stop, at_most, || self.backpressure.subscriber_count() == 0);
        Ok(counts)
    }

    fn end(&mut self, state: u64) -> Result<(), PublishError> {
        self.finished = true;
        self.publishing.status().state = state;
        self.counted_at = Instant::now().checked_sub(COUNT_PERIOD).unwrap_or(self.counted_at);
        let written = self.write_status(Instant::now());
        self.wake();
        written
    }
}

impl Drop for StatePublisher {
    fn drop(&mut self) {
        if !self.finished {
            // consumers that cannot be told find out by themselves
            let _ = self.end(STATE_FAILED);
        }
    }
}

impl FrameSink for StatePublisher {
    type Error = PublishError;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), PublishError> {
        let found = frame.u_m.len() + frame.v_m_s.len() + frame.extra.len();
        if found != self.doubles {
            return Err(PublishError::Shape { frame: frame.frame, expected: self.doubles, found });
        }
        let expected = self.publishing.next_frame();
        if frame.frame != expected {
            return Err(PublishError::Order { expected, found: frame.frame });
        }
        self.serve_joins()?;
        let start = Instant::now();
        let mut now = start;
        let rings = self.publishing.rings(start);
        let is_last = frame.step == self.last_step;
        if self.publishing.offers(self.backpressure.subscriber_count(), is_last, start) {
            let sent = self.send(frame);
            if self.backpressure.was_blocked() {
                now = Instant::now();
                self.counts.held_back += now.duration_since(start);
            }
            self.publishing.offered(sent?, start);
        }
        self.publishing.published(frame.step, frame.time_s);
        self.counts.frames += 1;
        let status = self.publishing.status();
        if status.began_unix_ns == 0 {
            status.began_unix_ns = unix_ns();
        }
        if rings {
            // after the frame: a consumer that wakes up earlier reads the memory being written, and slows the writing down
            self.wake();
            self.write_status(now)?;
        }
        Ok(())
    }
}
