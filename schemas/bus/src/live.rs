//! A consumer's side of a run on the bus.

mod attach;

pub use attach::{AttachError, AttachNotice, AttachOptions};

use super::backpressure::Delivery;
use super::board::BoardReader;
use super::position::{Position, Teller};
use super::wire::{RunStatus, STATE_DONE, STATE_FAILED, STATE_INTERRUPTED, StateHeader, StreamId};
use super::{Bus, Ipc, ResultElement, ResultPublisher, ResultsError};
use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::sample::Sample;
use schemas::chain::Chain;
use schemas::frame::{EndReason, Frame, FrameSource, Received};
use schemas::manifest::RunManifest;
use schemas::results::{ResultColumns, Topic};
use schemas::run_name::RunName;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest wait for a notification.
const WAIT: Duration = Duration::from_millis(50);
/// How long nothing comes before we ask whether the producer lives.
const LIVENESS_PERIOD: Duration = Duration::from_millis(500);

/// Why frames can no longer be received.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// iceoryx2 could not receive.
    #[error("run {name}: frames can no longer be received: {cause}")]
    Receive {
        /// The run.
        name: RunName,
        /// What iceoryx2 says.
        cause: String,
    },
    /// A frame of another length than the manifest's.
    #[error("run {name}: frame {frame} has {found} values, its manifest says {expected}")]
    Shape {
        /// The run.
        name: RunName,
        /// The frame.
        frame: u64,
        /// Values expected.
        expected: usize,
        /// Values found.
        found: usize,
    },
}

type StateSample = Sample<Ipc, [f64], StateHeader>;
type StateSubscriber = Subscriber<Ipc, [f64], StateHeader>;

/// Dropped as soon as the stream has ended, so that we do not hold a new producer back.
struct Ports {
    subscriber: StateSubscriber,
    listener: Listener<Ipc>,
    board: BoardReader,
    _node: Node<Ipc>,
}

/// The frames of a run that is being published, as they come.
pub struct LiveSource {
    // samples before ports: a sample is given back through them
    sample: Option<StateSample>,
    stashed: Option<StateSample>,
    ports: Option<Ports>,
    bus: Bus,
    manifest: RunManifest,
    chain: Chain,
    stream: StreamId,
    node_id: [u8; 16],
    delivery: Delivery,
    first_frame: u64,
    expected: u64,
    missed_count: u64,
    closing: Option<EndReason>,
    ended: Option<EndReason>,
    checked_at: Instant,
    teller: Teller,
    stop: Arc<AtomicBool>,
}

impl LiveSource {
    /// The resolved arrays that the producer published.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// Which publishing of which run this is.
    pub fn stream(&self) -> StreamId {
        self.stream
    }

    /// The first frame that is guaranteed to a lossless consumer; misses are counted from here.
    pub fn first_frame(&self) -> u64 {
        self.first_frame
    }

    /// A publisher of results about these frames.
    ///
    /// # Errors
    /// As [`ResultPublisher::create`].
    pub fn results<T: ResultElement>(
        &self,
        topic: Topic,
        columns: &ResultColumns,
    ) -> Result<ResultPublisher<T>, ResultsError> {
        let stop = Arc::clone(&self.stop);
        ResultPublisher::create(&self.bus, &self.name(), topic, self.stream, columns, stop)
    }

    /// How many published frames did not reach us.
    pub fn missed_count(&self) -> u64 {
        self.missed_count
    }

    fn end(&mut self, reason: EndReason) -> Received<'static> {
        self.sample = None;
        self.stashed = None;
        self.ports = None;
        self.teller = Teller::none();
        self.ended = Some(reason);
        Received::End(reason)
    }

    /// Reports that `from..=to` did not come.
    fn miss(&mut self, from: u64, to: u64) -> Received<'static> {
        self.missed_count += to - from + 1;
        self.expected = to + 1;
        Received::Missed { from, to }
    }

    /// The producer has dropped us. The frames that it is known to have published without us are missed, at
    /// least up to `last`; then comes the end.
    fn dropped(&mut self, last: u64) -> Received<'static> {
        let status = self.ports.as_ref().and_then(|ports| ports.board.status_of(self.stream));
        let known = status.as_ref().and_then(RunStatus::last_frame);
        let _ = self.end(EndReason::Dropped);
        self.miss(self.expected, known.map_or(last, |known| known.max(last)))
    }

    fn name(&self) -> RunName {
        self.manifest.provenance.name.clone()
    }

    /// The next sample of our stream that we do not have yet, if one is there.
    fn next_sample(&mut self) -> Result<Option<StateSample>, LiveError> {
        let Some(ports) = &self.ports else { return Ok(None) };
        loop {
            let sample = match self.stashed.take() {
                Some(sample) => sample,
                None => match ports.subscriber.receive() {
                    Err(e) => return Err(LiveError::Receive { name: self.name(), cause: format!("{e:?}") }),
                    Ok(None) => return Ok(None),
                    Ok(Some(sample)) => sample,
                },
            };
            let header = sample.user_header();
            if header.stream_id != self.stream.stream_id || header.run_id != self.stream.run_id.0 {
                // a new producer has this name, and ours is over
                self.closing.get_or_insert_with(|| {
                    let status = ports.board.status_of(self.stream);
                    status.and_then(|status| end_of(&status)).unwrap_or(EndReason::ProducerLost)
                });
            } else if header.frame >= self.expected {
                return Ok(Some(sample));
            }
        }
    }

    /// What to say about `sample`, the next one.
    fn take(&mut self, sample: StateSample) -> Result<Received<'_>, LiveError> {
        let StateHeader { frame, step, time_s, .. } = *sample.user_header();
        if frame > self.expected {
            if self.delivery == Delivery::Lossless {
                // the producer skips frames only for a consumer that it has dropped
                drop(sample);
                return Ok(self.dropped(frame));
            }
            self.stashed = Some(sample);
            return Ok(self.miss(self.expected, frame - 1));
        }
        let beads = usize::try_from(self.manifest.physics.beads).unwrap_or(usize::MAX);
        let (expected, found) = (self.manifest.frame_doubles(), sample.payload().len());
        if found != expected {
            return Err(LiveError::Shape { name: self.name(), frame, expected, found });
        }
        self.expected = frame + 1;
        self.checked_at = Instant::now();
        self.tell(self.checked_at);
        let values = self.sample.insert(sample).payload();
        let (u_m, rest) = values.split_at(beads);
        let (v_m_s, extra) = rest.split_at(beads);
        Ok(Received::Frame(Frame { frame, step, time_s, u_m, v_m_s, extra }))
    }

    /// Called when the queue was empty: how the stream ended, if it did. The result is believed only
    /// after the queue was emptied once more.
    fn look_for_the_end(&mut self) -> Option<EndReason> {
        let ports = self.ports.as_ref()?;
        let Some(status) = ports.board.status_of(self.stream) else { return Some(EndReason::ProducerLost) };
        if let Some(end) = end_of(&status) {
            return Some(end);
        }
        if self.checked_at.elapsed() >= LIVENESS_PERIOD {
            self.checked_at = Instant::now();
            if !self.bus.is_alive(self.node_id) {
                return Some(EndReason::ProducerLost);
            }
        }
        None
    }

    /// The queue is empty and the stream has ended: what is missing at its end, then the reason.
    fn close(&mut self, reason: EndReason) -> Received<'static> {
        let status = self.ports.as_ref().and_then(|ports| ports.board.status_of(self.stream));
        let last = status.as_ref().and_then(RunStatus::last_frame);
        if let Some(last) = last.filter(|last| *last >= self.expected) {
            if self.delivery == Delivery::Lossless && reason != EndReason::ProducerLost {
                return self.dropped(last);
            }
            return self.miss(self.expected, last);
        }
        self.end(reason)
    }

    /// Tells others how far we are.
    fn tell(&mut self, now: Instant) {
        let Some(ports) = &self.ports else { return };
        let (next_frame, missed, stream) = (self.expected, self.missed_count, self.stream);
        self.teller.tell(now, || {
            let last = ports.board.status_of(stream).and_then(|status| status.last_frame());
            let behind = last.map_or(0, |last| (last + 1).saturating_sub(next_frame));
            Position { next_frame, behind, missed }
        });
    }

    fn wait(&self) {
        let Some(ports) = &self.ports else { return };
        // a signal ends the wait early; the loop looks at the flag
        let _ = ports.listener.timed_wait(|_| {}, WAIT);
    }
}

/// How a stream of this status ended, if its producer said so.
fn end_of(status: &RunStatus) -> Option<EndReason> {
    match status.state {
        STATE_DONE => Some(EndReason::Complete),
        STATE_INTERRUPTED => Some(EndReason::Interrupted),
        STATE_FAILED => Some(EndReason::Failed),
        _ => None,
    }
}

impl FrameSource for LiveSource {
    type Error = LiveError;

    fn manifest(&self) -> &RunManifest {
        &self.manifest
    }

    fn receive(&mut self) -> Result<Received<'_>, LiveError> {
        self.sample = None;
        if let Some(reason) = self.ended {
            return Ok(Received::End(reason));
        }
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(self.end(EndReason::Stopped));
            }
            if let Some(sample) = self.next_sample()? {
                return self.take(sample);
            }
            if let Some(reason) = self.closing {
                return Ok(self.close(reason));
            }
            self.closing = self.look_for_the_end();
            if self.closing.is_none() {
                self.tell(Instant::now());
                self.wait();
            }
        }
    }
}
