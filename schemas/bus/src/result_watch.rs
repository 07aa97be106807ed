//! Subscribers that wait for publishers of results, and how publishers wait for them.

use super::backpressure::{Backpressure, Delivery};
use super::results::{ResultElement, ResultSubscriber, ResultsError, new_listener};
use super::runs::own_topics;
use super::services::{self, EventService, text_of};
use super::{Bus, BusError, Ipc};
use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::PortFactory as _;
use schemas::results::Topic;
use schemas::run_name::RunName;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How long a new publisher waits for living listeners to subscribe.
const WATCHER_PATIENCE: Duration = Duration::from_secs(10);
/// How often it checks meanwhile that they live.
const WATCHER_PERIOD: Duration = Duration::from_millis(200);

/// Waits for publishers of one kind of results. A publisher that comes meanwhile lets this subscribe before its
/// first row.
pub struct ResultWatch {
    bus: Bus,
    run: RunName,
    topic: Topic,
    /// None for somebody else's topic: its publisher counts the [`OwnTopicsWatch`]es.
    listener: Option<Arc<Listener<Ipc>>>,
    node: Node<Ipc>,
}

impl ResultWatch {
    /// Waits for publishers of `topic` of `run`. For somebody else's topic hold an [`OwnTopicsWatch`] as well, or
    /// publishers will not wait.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn create(bus: &Bus, run: &RunName, topic: Topic) -> Result<Self, ResultsError> {
        let node = bus.node()?;
        let is_own = matches!(topic, Topic::Own(_));
        let listener = if is_own { None } else { Some(new_listener(&node, run, topic)?) };
        Ok(Self { bus: bus.clone(), run: run.clone(), topic, listener, node })
    }

    /// The topic that it waits for.
    pub fn topic(&self) -> Topic {
        self.topic
    }

    /// Attaches to the publisher, if there is one.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn attach<T: ResultElement>(
        &self,
        delivery: Delivery,
        stop: Arc<AtomicBool>,
    ) -> Result<Option<ResultSubscriber<T>>, ResultsError> {
        // registering anew costs more than a look
        let found = services::find_slices::<T>(&self.node, &self.run, self.topic)?;
        if found.is_none_or(|service| service.dynamic_config().number_of_publishers() == 0) {
            return Ok(None);
        }
        let node = self.bus.node()?;
        let listener = self.listener.clone();
        ResultSubscriber::attach_with(&self.bus, node, &self.run, self.topic, delivery, stop, listener)
    }

    /// Waits until a publisher comes, or for `patience`.
    pub fn wait(&self, patience: Duration) {
        match &self.listener {
            // a signal ends the wait early; the caller looks again
            Some(listener) => drop(listener.timed_wait(|_| {}, patience)),
            None => std::thread::sleep(patience),
        }
    }
}

/// Waits for publishers of any topic of somebody else's. They let its holder subscribe
/// before their first row.
pub struct OwnTopicsWatch {
    bus: Bus,
    run: RunName,
    listener: Listener<Ipc>,
    _node: Node<Ipc>,
}

impl OwnTopicsWatch {
    /// Looks out for topics of `run`.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn create(bus: &Bus, run: &RunName) -> Result<Self, ResultsError> {
        let node = bus.node()?;
        let listener = services::announcements(&node, run)?.listener_builder().create();
        let text = format!("beadline/{run}/own");
        let listener = listener.map_err(|e| BusError::service(&text, "listen to", &e))?;
        Ok(Self { bus: bus.clone(), run: run.clone(), listener, _node: node })
    }

    /// The existing topics in order, with publishers or without.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn topics(&self) -> Result<Vec<Topic>, ResultsError> {
        Ok(own_topics(&self.bus, &self.run)?.into_iter().map(Topic::Own).collect())
    }

    /// Waits until a publisher comes, or for `patience`; returns whether one came.
    pub fn wait(&self, patience: Duration) -> bool {
        let mut came = false;
        // a signal ends the wait early; the caller looks again
        let _ = self.listener.timed_wait(|_| came = true, patience);
        came
    }
}

/// Listeners for a publisher, which must subscribe before its first row.
pub(super) struct Watchers {
    events: EventService,
    /// The listeners of the topic when its publisher came, and those of all topics of somebody else's.
    own: Option<(usize, EventService)>,
}

impl Watchers {
    /// Tells the listeners of all topics of somebody else's about this one.
    pub(super) fn call(
        node: &Node<Ipc>,
        run: &RunName,
        topic: Topic,
        events: EventService,
    ) -> Result<Self, BusError> {
        let Topic::Own(_) = topic else { return Ok(Self { events, own: None }) };
        let announcements = services::announcements(node, run)?;
        let bell = announcements.notifier_builder().create();
        let bell = bell.map_err(|e| BusError::service(&text_of(run, topic), "announce", &e))?;
        let at_first = events.dynamic_config().number_of_listeners();
        // fails only for single listeners that are going away
        let _ = bell.notify();
        Ok(Self { events, own: Some((at_first, announcements)) })
    }

    /// How many there are. Who watches all topics listens to this one, too, once it has subscribed.
    pub(super) fn count(&self) -> usize {
        let listeners = self.events.dynamic_config().number_of_listeners();
        self.own.as_ref().map_or(listeners, |(at_first, announcements)| {
            listeners.min(*at_first) + announcements.dynamic_config().number_of_listeners()
        })
    }
}

/// Waits until every present listener has subscribed, so that it gets every row.
pub(super) fn wait_for_watchers<T: ResultElement>(
    node: &Node<Ipc>,
    backpressure: &Backpressure<T>,
    watchers: impl Fn() -> usize,
) {
    let (start, mut looked) = (Instant::now(), Instant::now());
    while backpressure.subscriber_count() < watchers()
        && start.elapsed() < WATCHER_PATIENCE
        && !backpressure.stop.load(Ordering::Relaxed)
    {
        std::thread::sleep(Duration::from_millis(1));
        if looked.elapsed() >= WATCHER_PERIOD {
            // the dead listen to nothing
            node.try_cleanup_dead_nodes();
            looked = Instant::now();
        }
    }
}
