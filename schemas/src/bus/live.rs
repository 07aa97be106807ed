//! A consumer's side of a run on the bus.

use super::backpressure::Delivery;
use super::board::BoardReader;
use super::runs::{RunInfo, list_runs, run_names};
use super::services::{self, Topic, check_schema, text_of};
use super::wire::{
    JOIN_CONNECT, JOIN_READY, JoinAnswer, JoinRequest, RunStatus, STATE_DONE, STATE_FAILED,
    STATE_INTERRUPTED, STATE_RUNNING, StateHeader, StreamId,
};
use super::{Bus, BusError, Ipc};
use crate::chain::Chain;
use crate::contact::ContactLaw;
use crate::frame::{EndReason, Frame, FrameSource, Received};
use crate::manifest::{ManifestError, RunId, RunManifest};
use crate::run_name::RunName;
use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::PortName;
use iceoryx2::sample::Sample;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Queue of a consumer that takes what there is: with a longer one it would see older frames.
const LATEST_BUFFER: usize = 2;
/// Longest wait for a notification.
const WAIT: Duration = Duration::from_millis(50);
/// How long nothing comes before we ask whether the producer lives.
const LIVENESS_PERIOD: Duration = Duration::from_millis(500);
/// How often we look for a run that is not there yet.
const SEARCH_PERIOD: Duration = Duration::from_millis(50);
/// How often a consumer in the handshake looks for the answer.
const ANSWER_WAIT: Duration = Duration::from_millis(10);

/// What is going on while [`LiveSource::attach`] waits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AttachNotice {
    /// No such run is being published; told once.
    WaitingForRun {
        /// Its name, if one was asked for.
        name: Option<RunName>,
    },
    /// The run is there, but its producer does not answer yet: another consumer holds it back; told once.
    WaitingForAnswer {
        /// Its name.
        name: RunName,
    },
}

/// How to attach.
#[derive(Clone)]
pub struct AttachOptions {
    /// What the consumer is called in messages, `energies` for instance; at most 30 characters count.
    pub label: String,
    /// How long to wait for a run. Default: for ever.
    pub timeout: Option<Duration>,
    /// When set, waiting ends, and the source ends with [`EndReason::Stopped`].
    pub stop: Arc<AtomicBool>,
    /// Is told what we wait for.
    pub notice: Arc<dyn Fn(&AttachNotice) + Send + Sync>,
}

impl Default for AttachOptions {
    fn default() -> Self {
        Self { label: "consumer".into(), timeout: None, stop: Arc::default(), notice: Arc::new(|_| {}) }
    }
}

/// Why we could not attach.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// Nothing came.
    #[error("no run{} was published within {waited:?}; start one with `beadline run`", named(.name.as_ref()))]
    Timeout {
        /// The run asked for.
        name: Option<RunName>,
        /// How long we waited.
        waited: Duration,
    },
    /// More than one run, and none was named.
    #[error("several runs are being published, name one: {}", join_names(.names))]
    SeveralRuns {
        /// Their names.
        names: Vec<RunName>,
    },
    /// We were asked to stop.
    #[error("stopped while waiting for a run")]
    Stopped,
    /// The manifest that the producer published.
    #[error("run {name}: {source}")]
    Manifest {
        /// The run.
        name: RunName,
        /// What is wrong with it.
        source: ManifestError,
    },
    /// No more consumers can attach.
    #[error("run {name} has all the consumers it can have; end one, or record the run and read the file")]
    Full {
        /// The run.
        name: RunName,
    },
}

fn named(name: Option<&RunName>) -> String {
    name.map(|name| format!(" {name}")).unwrap_or_default()
}

fn join_names(names: &[RunName]) -> String {
    names.iter().map(RunName::as_str).collect::<Vec<_>>().join(", ")
}

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

/// What is let go as soon as the stream has ended, so that a new producer is not held back by us.
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
    stop: Arc<AtomicBool>,
}

/// What a try to attach found.
enum Attempt {
    Attached(Box<LiveSource>),
    NotYet,
}

impl LiveSource {
    /// Attaches to `run`, or to the only run there is, and waits for it if it is not there.
    ///
    /// A lossless consumer then gets every frame from [`LiveSource::first_frame`] on.
    ///
    /// # Errors
    /// When nothing comes in time, when it is not clear which run is meant, or when the run cannot be read.
    pub fn attach(
        bus: &Bus,
        run: Option<&RunName>,
        delivery: Delivery,
        options: &AttachOptions,
    ) -> Result<Self, AttachError> {
        let search = Search { bus, delivery, options, start: Instant::now() };
        let mut told = false;
        loop {
            search.check()?;
            if let Some(name) = search.find(run)?
                && let Attempt::Attached(source) = search.attach(&name)?
            {
                return Ok(*source);
            }
            if !told {
                (options.notice)(&AttachNotice::WaitingForRun { name: run.cloned() });
                told = true;
            }
            if options.timeout.is_some_and(|timeout| search.start.elapsed() >= timeout) {
                return Err(AttachError::Timeout { name: run.cloned(), waited: search.start.elapsed() });
            }
            std::thread::sleep(SEARCH_PERIOD);
        }
    }

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

    /// How many frames were published but did not reach us.
    pub fn missed_count(&self) -> u64 {
        self.missed_count
    }

    fn end(&mut self, reason: EndReason) -> Received<'static> {
        self.sample = None;
        self.stashed = None;
        self.ports = None;
        self.ended = Some(reason);
        Received::End(reason)
    }

    /// Reports that `from..=to` did not come.
    fn miss(&mut self, from: u64, to: u64) -> Received<'static> {
        self.missed_count += to - from + 1;
        self.expected = to + 1;
        Received::Missed { from, to }
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
                return Ok(self.end(EndReason::Dropped));
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
        let values = self.sample.insert(sample).payload();
        let (u_m, rest) = values.split_at(beads);
        let (v_m_s, extra) = rest.split_at(beads);
        Ok(Received::Frame(Frame { frame, step, time_s, u_m, v_m_s, extra }))
    }

    /// Called when the queue was empty: how the stream ended, if it did. What is found is believed only
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
                return self.end(EndReason::Dropped);
            }
            return self.miss(self.expected, last);
        }
        self.end(reason)
    }

    fn wait(&self) {
        if let Some(ports) = &self.ports {
            // a signal ends the wait early; the loop looks at the flag
            let _ = ports.listener.timed_wait(|_| {}, WAIT);
        }
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
                self.wait();
            }
        }
    }
}

/// One call of [`LiveSource::attach`].
struct Search<'a> {
    bus: &'a Bus,
    delivery: Delivery,
    options: &'a AttachOptions,
    start: Instant,
}

impl Search<'_> {
    fn check(&self) -> Result<(), AttachError> {
        if self.options.stop.load(Ordering::Relaxed) { Err(AttachError::Stopped) } else { Ok(()) }
    }

    /// The name of the run to attach to, if it is being published.
    fn find(&self, run: Option<&RunName>) -> Result<Option<RunName>, AttachError> {
        for name in run_names(self.bus)?.iter().filter(|name| run.is_none_or(|run| run == *name)) {
            check_schema(self.bus, name, Topic::Manifest)?;
            check_schema(self.bus, name, Topic::State)?;
        }
        let live = list_runs(self.bus)?.into_iter().filter(RunInfo::is_live);
        let mut names: Vec<RunName> = live.map(|info| info.name).collect();
        match run {
            Some(run) => Ok(names.contains(run).then(|| run.clone())),
            None if names.len() > 1 => Err(AttachError::SeveralRuns { names }),
            None => Ok(names.pop()),
        }
    }

    /// Tries to attach to `run`; it may be over before we are done.
    fn attach(&self, run: &RunName) -> Result<Attempt, AttachError> {
        let node = self.bus.node()?;
        let Some(board) = BoardReader::find(&node, run)? else { return Ok(Attempt::NotYet) };
        let status = board.status();
        if status.state > STATE_RUNNING || !self.bus.is_alive(status.node_id) {
            return Ok(Attempt::NotYet);
        }
        let stream = status.stream();
        let Some(json) = board.manifest(stream) else { return Ok(Attempt::NotYet) };
        let manifest = RunManifest::from_json(&json)
            .map_err(|source| AttachError::Manifest { name: run.clone(), source })?;
        let Some((subscriber, listener)) = self.ports(&node, run)? else { return Ok(Attempt::NotYet) };
        let handshake = Handshake { search: self, run, node: &node, board: &board, stream };
        let Some(joined) = handshake.run(&subscriber, &listener, &manifest)? else {
            return Ok(Attempt::NotYet);
        };
        Ok(Attempt::Attached(Box::new(LiveSource {
            sample: None,
            stashed: joined.first_sample,
            ports: Some(Ports { subscriber, listener, board, _node: node }),
            bus: self.bus.clone(),
            manifest,
            chain: joined.chain,
            stream,
            node_id: status.node_id,
            delivery: self.delivery,
            first_frame: joined.first_frame,
            expected: joined.first_frame,
            missed_count: 0,
            closing: None,
            ended: None,
            checked_at: Instant::now(),
            stop: Arc::clone(&self.options.stop),
        })))
    }

    fn ports(
        &self,
        node: &Node<Ipc>,
        run: &RunName,
    ) -> Result<Option<(StateSubscriber, Listener<Ipc>)>, AttachError> {
        let text = text_of(run, Topic::State);
        let failed = |e: &dyn std::fmt::Debug| BusError::service(&text, "subscribe to", &format!("{e:?}"));
        let Some(state) = services::find_slices::<f64>(node, run, Topic::State)? else { return Ok(None) };
        let label: String = self.options.label.chars().filter(char::is_ascii_graphic).take(30).collect();
        let name = format!("{}.{label}.{}", self.delivery.as_str(), std::process::id());
        let name = PortName::new(&name).map_err(|e| failed(&e))?;
        let mut builder = state.subscriber_builder().name(&name);
        if self.delivery == Delivery::Latest {
            builder = builder.buffer_size(LATEST_BUFFER.min(services::limits_of(&state).buffer));
        }
        let subscriber = match builder.create() {
            Err(SubscriberCreateError::ExceedsMaxSupportedSubscribers) => {
                return Err(AttachError::Full { name: run.clone() });
            }
            other => other.map_err(|e| failed(&e))?,
        };
        let events = services::events(node, run, Topic::State)?;
        let listener = events.listener_builder().create().map_err(|e| failed(&e))?;
        Ok(Some((subscriber, listener)))
    }
}

/// What the handshake gave.
struct Joined {
    first_frame: u64,
    first_sample: Option<StateSample>,
    chain: Chain,
}

/// The handshake of one consumer with one producer.
struct Handshake<'a> {
    search: &'a Search<'a>,
    run: &'a RunName,
    node: &'a Node<Ipc>,
    board: &'a BoardReader,
    stream: StreamId,
}

impl Handshake<'_> {
    /// `None`: the producer left meanwhile.
    fn run(
        &self,
        subscriber: &StateSubscriber,
        listener: &Listener<Ipc>,
        manifest: &RunManifest,
    ) -> Result<Option<Joined>, AttachError> {
        let text = text_of(self.run, Topic::Join);
        let failed = |e: &dyn std::fmt::Debug| BusError::service(&text, "join through", &format!("{e:?}"));
        let Some(join) = services::find_join(self.node, self.run)? else { return Ok(None) };
        let client = join.client_builder().create().map_err(|e| failed(&e))?;
        let events = services::events(self.node, self.run, Topic::Join)?;
        let bell = events.notifier_builder().create().map_err(|e| failed(&e))?;
        let chains = services::chain(self.node, self.run)?;
        let chains = chains.subscriber_builder().create().map_err(|e| failed(&e))?;

        let mut joined = None;
        for phase in [JOIN_CONNECT, JOIN_READY] {
            let request =
                JoinRequest { subscriber_id: subscriber.id().value().to_le_bytes(), phase, reserved: 0 };
            let pending = client.send_copy(request).map_err(|e| failed(&e))?;
            let _ = bell.notify();
            let answered = || -> Result<Option<JoinAnswer>, BusError> {
                Ok(pending.receive().map_err(|e| failed(&e))?.map(|answer| *answer.payload()))
            };
            let Some((answer, sample)) = self.answer(answered, subscriber, listener)? else {
                return Ok(None);
            };
            if (StreamId { run_id: RunId(answer.run_id), stream_id: answer.stream_id }) != self.stream {
                return Ok(None);
            }
            subscriber.update_connections().map_err(|e| failed(&e))?;
            joined = Some((answer.first_frame, sample));
        }
        let Some((first_frame, first_sample)) = joined else { return Ok(None) };
        let Some(chain) = self.chain(&chains, manifest).map_err(|e| failed(&e))? else { return Ok(None) };
        Ok(Some(Joined { first_frame, first_sample, chain }))
    }

    /// Waits for the answer, and keeps the queue empty so that the producer is not held back. A sample
    /// that was taken from the queue when the answer is there already is handed on: it may be the first
    /// that is guaranteed.
    fn answer(
        &self,
        answered: impl Fn() -> Result<Option<JoinAnswer>, BusError>,
        subscriber: &StateSubscriber,
        listener: &Listener<Ipc>,
    ) -> Result<Option<(JoinAnswer, Option<StateSample>)>, AttachError> {
        let text = text_of(self.run, Topic::State);
        let (mut checked_at, mut told) = (Instant::now(), false);
        loop {
            self.search.check()?;
            if let Some(answer) = answered()? {
                return Ok(Some((answer, None)));
            }
            let taken = subscriber.receive().map_err(|e| BusError::service(&text, "receive from", &e))?;
            if let Some(sample) = taken {
                if let Some(answer) = answered()? {
                    return Ok(Some((answer, Some(sample))));
                }
                continue;
            }
            if checked_at.elapsed() >= LIVENESS_PERIOD {
                checked_at = Instant::now();
                let status = self.board.status();
                if status.state > STATE_RUNNING || !self.search.bus.is_alive(status.node_id) {
                    return Ok(None);
                }
                if !told {
                    told = true;
                    (self.search.options.notice)(&AttachNotice::WaitingForAnswer { name: self.run.clone() });
                }
            }
            let _ = listener.timed_wait(|_| {}, ANSWER_WAIT);
        }
    }

    /// The chain, which the producer's answer to the first request has delivered.
    fn chain(
        &self,
        chains: &StateSubscriber,
        manifest: &RunManifest,
    ) -> Result<Option<Chain>, iceoryx2::port::ReceiveError> {
        let beads = usize::try_from(manifest.physics.beads).unwrap_or(usize::MAX);
        while let Some(sample) = chains.receive()? {
            let (header, values) = (sample.user_header(), sample.payload());
            if header.stream_id != self.stream.stream_id || values.len() != 3 * beads - 2 {
                continue;
            }
            let (mass_kg, rest) = values.split_at(beads);
            let (stiffness, rest_overlap_m) = rest.split_at(beads - 1);
            return Ok(Some(Chain {
                mass_kg: mass_kg.to_vec(),
                stiffness: stiffness.to_vec(),
                rest_overlap_m: rest_overlap_m.to_vec(),
                law: ContactLaw::new(manifest.physics.alpha),
            }));
        }
        Ok(None)
    }
}
