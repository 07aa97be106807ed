//! Publishes a topic of slices whose consumers may hold it back: the common part of frames and rows of results.

use super::backpressure::Backpressure;
use super::services::{self, SliceService, check_schema, text_of};
use super::wire::StateHeader;
use super::{Bus, Ipc, room};
use crate::BusError;
use crate::values::Remedies;
use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::ZeroCopySend;
use schemas::results::Topic;
use schemas::run_name::RunName;
use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two looks at the work of others that we wait for.
const LOOK_PERIOD: Duration = Duration::from_millis(1);
/// Time between two clean-ups of dead processes during such a wait.
const CLEAN_PERIOD: Duration = Duration::from_millis(50);

/// A publisher, and the handler that decides whom it waits for.
pub(super) type Outlet<T> = (Publisher<Ipc, [T], StateHeader>, Arc<Backpressure<T>>);

/// Topic to be published. The caller keeps the bus locked until the topic has its memory.
pub(super) struct Opening<'a> {
    pub(super) bus: &'a Bus,
    pub(super) node: &'a Node<Ipc>,
    pub(super) run: &'a RunName,
    pub(super) topic: Topic,
    /// Elements of the longest slice.
    pub(super) elements: usize,
    /// Flag that ends a send that is held back.
    pub(super) stop: Arc<AtomicBool>,
    /// Longest time that a lossless consumer may take nothing.
    pub(super) stuck_after: Duration,
    /// Longest time that a dead publisher may take to vanish.
    pub(super) patience: Duration,
    pub(super) remedies: Remedies,
}

impl Opening<'_> {
    /// Opens or creates the service, with attributes `more` if it is new. A service that consumers of an earlier run still
    /// hold stays as it is.
    pub(super) fn service<T: Debug + ZeroCopySend + 'static>(
        &self,
        more: &[(&str, String)],
    ) -> Result<SliceService<T>, BusError> {
        check_schema(self.bus, self.run, self.topic)?;
        let slot_bytes = (self.elements * size_of::<T>()) as u64;
        let free_bytes = room::free_bytes()?;
        let limits = room::plan(slot_bytes, free_bytes);
        let service = services::slices(self.node, self.run, self.topic, limits, more)?;
        room::check(slot_bytes, services::limits_of(&service), free_bytes)?;
        Ok(service)
    }

    /// Creates the publisher of `service`, with all of its memory; none if a living process has one.
    pub(super) fn publisher<T: Debug + ZeroCopySend + 'static>(
        self,
        service: SliceService<T>,
    ) -> Result<Option<Outlet<T>>, BusError> {
        let text = text_of(self.run, self.topic);
        let notifier = services::events(self.node, self.run, self.topic)?.notifier_builder().create();
        let notifier = notifier.map_err(|e| BusError::service(&text, "notify", &e))?;
        let config = self.bus.config().clone();
        let backpressure =
            Backpressure::new(service, config, notifier, self.stop, self.stuck_after, self.remedies);
        // the one place where two publishers of one name are told apart
        let publisher = backpressure.publisher(self.bus, self.node, self.elements, self.patience);
        let publisher = publisher.map_err(|e| BusError::service(&text, "publish", &e))?;
        let Some(publisher) = publisher else { return Ok(None) };
        room::reserve(self.bus.prefix(), publisher.id().value())?;
        Ok(Some((publisher, backpressure)))
    }
}

/// Waits until `is_done` finds the work of other processes done, `stop` is set, or `at_most` is over. Cleans up dead
/// processes meanwhile.
pub(super) fn wait_for_others(
    node: &Node<Ipc>,
    stop: &AtomicBool,
    at_most: Duration,
    mut is_done: impl FnMut() -> bool,
) {
    let (start, mut cleaned) = (Instant::now(), Instant::now());
    while !is_done() && start.elapsed() < at_most && !stop.load(Ordering::Relaxed) {
        std::thread::sleep(LOOK_PERIOD);
        if cleaned.elapsed() >= CLEAN_PERIOD {
            node.try_cleanup_dead_nodes();
            cleaned = Instant::now();
        }
    }
}
