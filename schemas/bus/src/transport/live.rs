//! A consumer's side of a run on the bus.

mod attach;

use super::board::BoardReader;
use super::delivery::{Following, Turn};
use super::position::{Position, Teller};
use super::wire::{RunStatus, StateHeader};
use super::{Bus, Ipc, ResultPublisher};
use crate::{LiveError, ResultElement, ResultsError, StreamId};
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

type StateSample = Sample<Ipc, [f64], StateHeader>;
type StateSubscriber = Subscriber<Ipc, [f64], StateHeader>;

/// Ports of a source. They are dropped as soon as the stream has ended, so that they do not hold a new producer back.
struct Ports {
    subscriber: StateSubscriber,
    listener: Listener<Ipc>,
    board: BoardReader,
    _node: Node<Ipc>,
}

/// Source of the frames of a run that is being published, as they come.
pub struct LiveSource {
    // samples before ports: a sample is given back through them
    sample: Option<StateSample>,
    ports: Option<Ports>,
    bus: Bus,
    manifest: RunManifest,
    chain: Chain,
    stream: StreamId,
    following: Following,
    node_id: [u8; 16],
    first_frame: u64,
    teller: Teller,
    stop: Arc<AtomicBool>,
}

impl LiveSource {
    /// The resolved arrays that the producer published.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// Flag that ends the source when it is set.
    pub fn stop(&self) -> &Arc<AtomicBool> {
        &self.stop
    }

    /// Identity of the stream: the run, and this publishing of it.
    pub fn stream(&self) -> StreamId {
        self.stream
    }

    /// The first frame that is guaranteed to a lossless consumer; misses are counted from here.
    pub fn first_frame(&self) -> u64 {
        self.first_frame
    }

    /// Keeps the frame that was lent last in its place, beyond the next call of `receive`; none if no frame is lent.
    ///
    /// A consumer may have [`BORROWED`](crate::BORROWED) frames at a time, including the one that it receives. A consumer that
    /// holds so many can receive nothing.
    pub fn hold(&mut self) -> Option<HeldState> {
        let beads = usize::try_from(self.manifest.physics.beads).unwrap_or(usize::MAX);
        self.sample.take().map(|sample| HeldState { sample, beads })
    }

    /// Creates a publisher of results about these frames.
    ///
    /// # Errors
    /// As [`ResultPublisher::create`].
    pub fn results<T: ResultElement>(
        &self,
        topic: Topic,
        columns: &ResultColumns,
    ) -> Result<ResultPublisher<T>, ResultsError> {
        let stop = Arc::clone(&self.stop);
        ResultPublisher::create(&self.bus, &self.name(), topic, self.stream(), columns, stop)
    }

    /// Number of published frames that did not reach us.
    pub fn missed_count(&self) -> u64 {
        self.following.missed_count()
    }

    /// Number of published frames that we have not taken yet, as far as the producer has said; for a consumer that wants
    /// the newest frame. A `latest` consumer may never get some of them.
    pub fn behind(&self) -> u64 {
        let last = self.status().and_then(|status| status.last_frame());
        last.map_or(0, |last| (last + 1).saturating_sub(self.following.expected()))
    }

    /// Lets go of the sample, the ports and the position file; nothing is read any more.
    fn let_go(&mut self) {
        self.sample = None;
        self.ports = None;
        self.teller = Teller::none();
    }

    fn name(&self) -> RunName {
        self.manifest.provenance.name.clone()
    }

    /// Takes the next sample from the queue, if one is there.
    fn take(&mut self) -> Result<(), LiveError> {
        self.sample = None;
        let taken = self.ports.as_ref().map_or(Ok(None), |ports| ports.subscriber.receive());
        let failed = |e| LiveError::Receive { name: self.name(), cause: format!("{e:?}") };
        self.sample = taken.map_err(failed)?;
        self.following.took(self.sample.as_ref().map(StateSample::user_header), Instant::now());
        Ok(())
    }

    fn status(&self) -> Option<RunStatus> {
        self.ports.as_ref().and_then(|ports| ports.board.status_of(self.stream()))
    }

    /// Lends the sample that was taken last.
    fn frame(&mut self) -> Result<Received<'_>, LiveError> {
        self.tell(self.following.came_at());
        let Some(sample) = &self.sample else { return Ok(Received::End(EndReason::ProducerLost)) };
        let header = sample.user_header();
        let StateHeader { frame, step, time_s, .. } = *header;
        let beads = usize::try_from(self.manifest.physics.beads).unwrap_or(usize::MAX);
        let (expected, found) = (self.manifest.frame_doubles(), sample.payload().len());
        if found != expected {
            return Err(LiveError::Shape { name: self.name(), frame, expected, found });
        }
        let active = header.active(beads);
        let frame = Frame::of_doubles((frame, step, time_s), beads, sample.payload());
        Ok(Received::Frame(Frame { active, ..frame }))
    }

    /// Tells other processes the position of this consumer.
    fn tell(&mut self, now: Instant) {
        let Some(ports) = &self.ports else { return };
        let (next_frame, missed) = (self.following.expected(), self.following.missed_count());
        self.teller.tell(now, || {
            let last = ports.board.status_of(self.stream).and_then(|status| status.last_frame());
            let behind = last.map_or(0, |last| (last + 1).saturating_sub(next_frame));
            Position { next_frame, behind, missed }
        });
    }

    fn wait(&self, patience: Duration) {
        let Some(ports) = self.ports.as_ref().filter(|_| !patience.is_zero()) else { return };
        // a signal ends the wait early; the loop looks at the flag
        let _ = ports.listener.timed_wait(|_| {}, patience.min(WAIT)); // integers
    }

    /// As `receive`, but waits at most for `patience` (and never longer than 50 ms); none if nothing came.
    ///
    /// After the end the source stays attached, so that held frames stay as they are until the source is dropped.
    ///
    /// # Errors
    /// As `receive`.
    pub fn receive_soon(&mut self, patience: Duration) -> Result<Option<Received<'_>>, LiveError> {
        match self.next_turn()? {
            Turn::Wait => {
                self.tell(Instant::now());
                self.wait(patience);
                self.following.waited();
                Ok(None)
            }
            Turn::Missed { from, to } => Ok(Some(Received::Missed { from, to })),
            Turn::End(reason) => Ok(Some(Received::End(reason))),
            _ => self.frame().map(Some),
        }
    }

    /// Takes turns until there is something to tell or to wait for.
    fn next_turn(&mut self) -> Result<Turn, LiveError> {
        loop {
            if self.stop.load(Ordering::Relaxed) {
                self.following.end(EndReason::Stopped);
            }
            match self.following.turn() {
                Turn::Take => self.take()?,
                Turn::Read => self.following.read(self.status().as_ref(), Instant::now()),
                Turn::Ask => self.following.heard(self.bus.is_alive(self.node_id)),
                turn => return Ok(turn),
            }
        }
    }
}

/// Frame in shared memory that stays as it is while this value is kept and its source is attached.
///
/// A producer that goes on without this consumer takes the memory back.
pub struct HeldState {
    sample: StateSample,
    beads: usize,
}

impl HeldState {
    /// The frame.
    pub fn frame(&self) -> Frame<'_> {
        let header = self.sample.user_header();
        let StateHeader { frame, step, time_s, .. } = *header;
        let frame = Frame::of_doubles((frame, step, time_s), self.beads, self.sample.payload());
        Frame { active: header.active(self.beads), ..frame }
    }
}

impl FrameSource for LiveSource {
    type Error = LiveError;

    fn manifest(&self) -> &RunManifest {
        &self.manifest
    }

    fn receive(&mut self) -> Result<Received<'_>, LiveError> {
        loop {
            let turn = self.next_turn()?;
            if self.following.is_over() {
                self.let_go();
            }
            match turn {
                Turn::Wait => {
                    self.tell(Instant::now());
                    self.wait(WAIT);
                    self.following.waited();
                }
                Turn::Missed { from, to } => return Ok(Received::Missed { from, to }),
                Turn::End(reason) => return Ok(Received::End(reason)),
                _ => return self.frame(),
            }
        }
    }
}
