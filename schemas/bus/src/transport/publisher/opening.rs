//! Registers a run on the bus.

use super::{JoinServer, StatePublisher};
use crate::Bus;
use crate::transport::board::{BoardReader, BoardWriter};
use crate::transport::delivery::Publishing;
use crate::transport::outlet::Opening;
use crate::transport::services::{self, check_schema, text_of};
use crate::transport::wire::{RunStatus, STATE_WAITING, Slots, StateHeader, fill};
use crate::transport::{Ipc, chain_values, node_bytes, room};
use crate::{BusError, PublishCounts, PublishError, PublishOptions, StreamId};
use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::publisher::Publisher;
use schemas::chain::Chain;
use schemas::manifest::{ManifestTooLong, RunId, RunManifest};
use schemas::results::Topic;
use schemas::run_name::RunName;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// Longest time that a producer of the same name may take to vanish.
const TAKE_OVER_PATIENCE: Duration = Duration::from_secs(1);

impl StatePublisher {
    /// Registers the run under its name; consumers can attach from now on.
    ///
    /// # Errors
    /// When the name is taken, shared memory is short, or the bus cannot be used.
    pub fn create(
        bus: &Bus,
        manifest: &RunManifest,
        chain: &Chain,
        options: &PublishOptions,
    ) -> Result<Self, PublishError> {
        let (run, json) = (&manifest.provenance.name, manifest.to_json());
        ManifestTooLong::check(json.len())?;
        let stream = StreamId::new(manifest.provenance.run_id);
        let doubles = manifest.frame_doubles();
        bus.prepare()?;
        // until everything has its memory, so that nobody else takes the free space that we found
        let _lock = bus.lock()?;
        let node = bus.prepared_node()?;
        check_schema(bus, run, Topic::Manifest)?;
        let opening = Opening {
            bus,
            node: &node,
            run,
            topic: Topic::State,
            elements: doubles,
            stop: Arc::clone(&options.stop),
            stuck_after: options.stuck_after,
            patience: TAKE_OVER_PATIENCE,
            remedies: options.remedies(),
        };
        let state = opening.service::<f64>(&[])?;
        let max_consumers = services::limits_of(&state).subscribers;
        let Some((publisher, backpressure)) = opening.publisher(state)? else {
            return Err(name_taken(&node, run)?);
        };
        backpressure.ignore_present();

        let mut status = RunStatus {
            run_id: stream.run_id.0,
            stream_id: stream.stream_id,
            state: STATE_WAITING,
            first_frame: options.first_frame,
            pid: u64::from(std::process::id()),
            node_id: node_bytes(&node),
            ..RunStatus::default()
        };
        let (server, join, joiners) = join_server(&node, run)?;
        let chain = publish_chain(bus, &node, run, chain, stream)?;
        let mut board = BoardWriter::create(bus, &node, run, json.as_bytes(), status)?;
        if !options.remedies().release_board {
            board.hold()?;
        }
        board.write(&mut status)?;
        let now = Instant::now();
        Ok(Self {
            publisher,
            slots: Slots::default(),
            chain,
            server,
            join,
            joiners,
            backpressure,
            board,
            publishing: Publishing::new(status, now),
            stream,
            doubles,
            max_consumers,
            last_step: manifest.physics.step_count,
            counts: PublishCounts::default(),
            counted_at: now,
            finished: false,
            remedies: options.remedies(),
            told_gone: false,
            node,
            bus: bus.clone(),
        })
    }
}

fn name_taken(node: &Node<Ipc>, run: &RunName) -> Result<PublishError, BusError> {
    let board = BoardReader::find(node, run)?;
    let status = board.as_ref().map(BoardReader::status).unwrap_or_default();
    let manifest = board.and_then(|board| board.manifest(status.stream()));
    let manifest = manifest.and_then(|json| RunManifest::glance(&json).ok());
    let started_unix_ns = manifest.map_or(status.written_unix_ns, |found| found.provenance.started_unix_ns);
    Ok(PublishError::NameTaken {
        name: run.clone(),
        run_id: RunId(status.run_id),
        pid: status.pid,
        started: SystemTime::UNIX_EPOCH + Duration::from_nanos(started_unix_ns),
    })
}

fn join_server(
    node: &Node<Ipc>,
    run: &RunName,
) -> Result<(JoinServer, services::JoinService, Listener<Ipc>), BusError> {
    let text = text_of(run, Topic::Join);
    let join = services::join(node, run)?;
    let server = join.server_builder().create().map_err(|e| BusError::service(&text, "serve", &e))?;
    let events = services::events(node, run, Topic::Join)?;
    let joiners = events.listener_builder().create().map_err(|e| BusError::service(&text, "listen", &e))?;
    Ok((server, join, joiners))
}

/// Publishes the chain once; the history keeps it for later consumers.
fn publish_chain(
    bus: &Bus,
    node: &Node<Ipc>,
    run: &RunName,
    chain: &Chain,
    stream: StreamId,
) -> Result<Publisher<Ipc, [f64], StateHeader>, BusError> {
    let text = text_of(run, Topic::Chain);
    let failed = |e: &dyn std::fmt::Debug| BusError::service(&text, "publish", e);
    let values = chain_values::to_values(chain);
    let service = services::chain(node, run)?;
    let builder = service.publisher_builder().initial_max_slice_len(values.len()).max_loaned_samples(1);
    // it sends a single sample, and takes memory for one
    let publisher = builder.override_sample_preallocation(|_| 1).create().map_err(|e| failed(&e))?;
    room::reserve(bus.prefix(), publisher.id().value())?;
    let slot = publisher.loan_slice_uninit(values.len()).map_err(|e| failed(&e))?;
    fill(slot, StateHeader::of(stream), &[&values]).send().map_err(|e| failed(&e))?;
    Ok(publisher)
}
