//! Finds a run, and does the handshake with its producer.

use super::{LiveSource, Ports, StateSample, StateSubscriber};
use crate::Bus;
use crate::transport::board::BoardReader;
use crate::transport::delivery::{Following, JoinTurn, Joining};
use crate::transport::position::Teller;
use crate::transport::runs::{look_at, run_names};
use crate::transport::services::{self, check_schema, text_of};
use crate::transport::wire::{JoinRequest, STATE_RUNNING};
use crate::transport::{Ipc, chain_values};
use crate::{AttachError, AttachNotice, AttachOptions, BusError, Delivery, RunInfo, StreamId};
use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::PortName;
use schemas::chain::Chain;
use schemas::manifest::RunManifest;
use schemas::results::Topic;
use schemas::run_name::RunName;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant, SystemTime};

/// Time between two looks for changes while the run is not there yet.
const SEARCH_PERIOD: Duration = Duration::from_millis(50);
/// Time between two such looks right after the start.
const EAGER_SEARCH_PERIOD: Duration = Duration::from_millis(20);
/// Time between two looks at a service that is being made.
const UNSETTLED_PERIOD: Duration = Duration::from_millis(50);
/// Time after the start during which looks come faster.
const EAGER: Duration = Duration::from_secs(1);
/// Time between two looks of a consumer in the handshake for the answer.
const ANSWER_WAIT: Duration = Duration::from_millis(10);

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
        let (mut told, mut watch) = (false, Rescan::new(bus));
        loop {
            search.check()?;
            if watch.is_worth_a_look() {
                let found = search.find(run)?;
                if let Some(name) = &found.live
                    && let Some(source) = search.attach(name)?
                {
                    return Ok(*source);
                }
                watch.looked(&found);
            }
            if !told {
                (options.notice)(&AttachNotice::WaitingForRun { name: run.cloned() });
                told = true;
            }
            if options.timeout.is_some_and(|timeout| search.start.elapsed() >= timeout) {
                return Err(AttachError::Timeout { name: run.cloned(), waited: search.start.elapsed() });
            }
            let eager = search.start.elapsed() < EAGER;
            std::thread::sleep(if eager { EAGER_SEARCH_PERIOD } else { SEARCH_PERIOD });
        }
    }
}

/// Decides when to look for runs again: a look takes milliseconds, and changes are rare.
struct Rescan {
    services: PathBuf,
    changed: Option<SystemTime>,
    looked_at: Option<Instant>,
    /// Time for which the last look is valid if no service has come or gone since.
    good_for: Duration,
}

impl Rescan {
    /// Longest time that a new service may take until it is whole. Finishing it does not touch the directory.
    const SETTLING: Duration = Duration::from_secs(1);

    fn new(bus: &Bus) -> Self {
        Self { services: bus.services(), changed: None, looked_at: None, good_for: Duration::ZERO }
    }

    fn is_worth_a_look(&mut self) -> bool {
        // no directory: nobody was ever here
        let changed = std::fs::metadata(&self.services).and_then(|found| found.modified()).ok();
        let same = std::mem::replace(&mut self.changed, changed) == changed;
        let settled = changed.is_none_or(|at| at.elapsed().is_ok_and(|age| age >= Self::SETTLING));
        let good_for = if settled { self.good_for } else { self.good_for.min(UNSETTLED_PERIOD) };
        !same || self.looked_at.is_none_or(|at| at.elapsed() >= good_for)
    }

    /// Notes a look that saw `found`. A run that is over but still read can come to life again without a new service.
    fn looked(&mut self, found: &RunsSeen) {
        self.looked_at = Some(Instant::now());
        self.good_for = match found {
            RunsSeen { live: Some(_), .. } => UNSETTLED_PERIOD,
            RunsSeen { any: true, .. } => Duration::from_millis(500),
            RunsSeen { .. } => Duration::from_secs(2),
        };
    }
}

/// Runs that a search has seen on the bus.
struct RunsSeen {
    /// The run that was asked for, if it is being published.
    live: Option<RunName>,
    /// True if there is such a run at all.
    any: bool,
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

    /// Looks for the run to attach to.
    fn find(&self, run: Option<&RunName>) -> Result<RunsSeen, AttachError> {
        let mut names = run_names(self.bus)?;
        names.retain(|name| run.is_none_or(|run| run == name));
        if names.is_empty() {
            return Ok(RunsSeen { live: None, any: false });
        }
        for name in &names {
            check_schema(self.bus, name, Topic::Manifest)?;
            check_schema(self.bus, name, Topic::State)?;
        }
        let live = look_at(self.bus, names)?.into_iter().filter(RunInfo::is_live);
        let mut names: Vec<RunName> = live.map(|info| info.name).collect();
        if names.len() > 1 {
            return Err(AttachError::SeveralRuns { names });
        }
        Ok(RunsSeen { live: names.pop(), any: true })
    }

    /// Attaches to `run`; none if the run is over before we are done.
    fn attach(&self, run: &RunName) -> Result<Option<Box<LiveSource>>, AttachError> {
        let node = self.bus.node()?;
        let Some(board) = BoardReader::find(&node, run)? else { return Ok(None) };
        let status = board.status();
        if status.state > STATE_RUNNING || !self.bus.is_alive(status.node_id) {
            return Ok(None);
        }
        let stream = status.stream();
        let Some(json) = board.manifest(stream) else { return Ok(None) };
        let manifest = RunManifest::from_json(&json)
            .map_err(|source| AttachError::Manifest { name: run.clone(), source })?;
        (self.options.notice)(&AttachNotice::Joining { name: run.clone() });
        let Some((subscriber, listener)) = self.ports(&node, run)? else { return Ok(None) };
        let handshake = Handshake { search: self, run, node: &node, board: &board, stream };
        let Some(joined) = handshake.run(&subscriber, &listener, &manifest)? else {
            return Ok(None);
        };
        let now = Instant::now();
        let mut following = Following::new(stream, self.delivery, joined.first_frame, now);
        if let Some(sample) = &joined.first_sample {
            following.took(Some(sample.user_header()), now);
        }
        let teller = Teller::new(self.bus.root(), subscriber.id().value());
        Ok(Some(Box::new(LiveSource {
            sample: joined.first_sample,
            ports: Some(Ports { subscriber, listener, board, _node: node }),
            bus: self.bus.clone(),
            manifest,
            chain: joined.chain,
            stream,
            following,
            node_id: status.node_id,
            first_frame: joined.first_frame,
            teller,
            stop: Arc::clone(&self.options.stop),
        })))
    }

    fn ports(
        &self,
        node: &Node<Ipc>,
        run: &RunName,
    ) -> Result<Option<(StateSubscriber, Listener<Ipc>)>, AttachError> {
        let text = text_of(run, Topic::State);
        let failed = |e: &dyn std::fmt::Debug| BusError::service(&text, "subscribe to", e);
        let Some(state) = services::find_slices::<f64>(node, run, Topic::State)? else { return Ok(None) };
        let label: String = self.options.label.chars().filter(char::is_ascii_graphic).take(30).collect();
        let name = format!("{}.{label}.{}", self.delivery.as_str(), std::process::id());
        let name = PortName::new(&name).map_err(|e| failed(&e))?;
        let mut builder = state.subscriber_builder().name(&name);
        if self.delivery == Delivery::Latest {
            builder = builder.buffer_size(services::LATEST_BUFFER.min(services::limits_of(&state).buffer));
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

/// Result of the handshake.
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
    /// Does the handshake; none if the producer left meanwhile.
    fn run(
        &self,
        subscriber: &StateSubscriber,
        listener: &Listener<Ipc>,
        manifest: &RunManifest,
    ) -> Result<Option<Joined>, AttachError> {
        let text = text_of(self.run, Topic::Join);
        let failed = |e: &dyn std::fmt::Debug| BusError::service(&text, "join through", e);
        let Some(join) = services::find_join(self.node, self.run)? else { return Ok(None) };
        let client = join.client_builder().create().map_err(|e| failed(&e))?;
        let events = services::events(self.node, self.run, Topic::Join)?;
        let bell = events.notifier_builder().create().map_err(|e| failed(&e))?;
        let chains = services::chain(self.node, self.run)?;
        let chains = chains.subscriber_builder().create().map_err(|e| failed(&e))?;

        let state = text_of(self.run, Topic::State);
        let mut joining = Joining::new(self.stream, Instant::now());
        let (mut pending, mut sample, mut told) = (None, None, false);
        let first_frame = loop {
            self.search.check()?;
            match joining.turn() {
                JoinTurn::Request(phase) => {
                    let subscriber_id = subscriber.id().value().to_le_bytes();
                    let request = JoinRequest { subscriber_id, phase, reserved: 0 };
                    pending = Some(client.send_copy(request).map_err(|e| failed(&e))?);
                    let _ = bell.notify();
                    joining.requested(Instant::now());
                    told = false;
                }
                JoinTurn::Answer => {
                    let answer = match &pending {
                        Some(pending) => pending.receive().map_err(|e| failed(&e))?,
                        None => None,
                    };
                    joining.answered(answer.as_deref());
                }
                JoinTurn::Take => {
                    drop(sample.take());
                    let taken = subscriber.receive();
                    sample = taken.map_err(|e| BusError::service(&state, "receive from", &e))?;
                    joining.took(sample.is_some(), Instant::now());
                }
                JoinTurn::Connect => {
                    subscriber.update_connections().map_err(|e| failed(&e))?;
                    joining.connected();
                }
                JoinTurn::Look => {
                    let status = self.board.status();
                    joining.looked(&status, self.search.bus.is_alive(status.node_id));
                    if joining.turn() == JoinTurn::Wait && !std::mem::replace(&mut told, true) {
                        let notice = AttachNotice::WaitingForAnswer { name: self.run.clone() };
                        (self.search.options.notice)(&notice);
                    }
                }
                JoinTurn::Wait => {
                    let _ = listener.timed_wait(|_| {}, ANSWER_WAIT);
                    joining.waited();
                }
                JoinTurn::Joined { first_frame } => break first_frame,
                JoinTurn::Left => return Ok(None),
            }
        };
        let Some(chain) = self.chain(&chains, manifest).map_err(|e| failed(&e))? else { return Ok(None) };
        Ok(Some(Joined { first_frame, first_sample: sample, chain }))
    }

    /// Receives the chain, which the producer's answer to the first request has delivered.
    fn chain(
        &self,
        chains: &StateSubscriber,
        manifest: &RunManifest,
    ) -> Result<Option<Chain>, iceoryx2::port::ReceiveError> {
        while let Some(sample) = chains.receive()? {
            let is_ours = sample.user_header().stream_id == self.stream.stream_id;
            let chain = is_ours.then(|| chain_values::from_values(&manifest.physics, sample.payload()));
            if let Some(chain) = chain.flatten() {
                return Ok(Some(chain));
            }
        }
        Ok(None)
    }
}
