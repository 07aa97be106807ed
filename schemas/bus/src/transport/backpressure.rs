//! Handles consumers whose queues are full: which of them may hold a publisher back, and for how long.

use super::delivery::{Full, Holding, Repeats, Verdict};
use super::services::SliceService;
use super::wire::StateHeader;
use super::{Bus, Ipc, process_of};
use crate::values::Remedies;
use crate::{ConsumerEvent, Delivery};
use iceoryx2::node::{Node, NodeState};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::port::{BackpressureAction, BackpressureInfo, SendError};
use iceoryx2::prelude::{CallbackProgression, Config, PortFactory as _, ZeroCopySend};
use std::collections::{HashMap, HashSet};
use std::fmt::Debug;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Number of tries to send without a pause; later tries come after a pause.
const YIELDS: u64 = 50;

impl Delivery {
    pub(super) fn of_name(name: &str) -> Self {
        if name.starts_with(Self::Lossless.as_str()) { Self::Lossless } else { Self::Latest }
    }
}

/// State shared by a publisher and its handler.
pub(super) struct Backpressure<T: Debug + ZeroCopySend + 'static> {
    service: SliceService<T>,
    config: Config,
    notifier: Notifier<Ipc>,
    pub(super) stop: Arc<AtomicBool>,
    remedies: Remedies,
    blocked: AtomicBool,
    /// True if the present send has waited for a consumer.
    waited: AtomicBool,
    /// True if the present send repeats one that failed.
    resending: AtomicBool,
    evicted_count: AtomicU64,
    /// True while the end of a stream is sent: the send then waits for `latest` consumers too, briefly.
    pub(super) ending: AtomicBool,
    memory: Mutex<Memory>,
}

struct Memory {
    consumers: HashMap<u128, (Delivery, String)>,
    events: Vec<ConsumerEvent>,
    holding: Holding,
}

impl<T: Debug + ZeroCopySend + 'static> Backpressure<T> {
    pub(super) fn new(
        service: SliceService<T>,
        config: Config,
        notifier: Notifier<Ipc>,
        stop: Arc<AtomicBool>,
        stuck_after: Duration,
        remedies: Remedies,
    ) -> Arc<Self> {
        Arc::new(Self {
            service,
            config,
            notifier,
            stop,
            remedies,
            blocked: AtomicBool::new(false),
            waited: AtomicBool::new(false),
            resending: AtomicBool::new(false),
            evicted_count: AtomicU64::new(0),
            ending: AtomicBool::new(false),
            memory: Mutex::new(Memory {
                consumers: HashMap::new(),
                events: Vec::new(),
                holding: Holding::new(stuck_after),
            }),
        })
    }

    /// Creates a publisher of rows of up to `most` elements, with this value as its handler; none if a living process has one.
    /// The publisher of a dead process may take `patience` to vanish.
    pub(super) fn publisher(
        self: &Arc<Self>,
        bus: &Bus,
        node: &Node<Ipc>,
        most: usize,
        patience: Duration,
    ) -> Result<Option<Publisher<Ipc, [T], StateHeader>>, PublisherCreateError> {
        let start = Instant::now();
        loop {
            let handler = Arc::clone(self);
            let builder = self.service.publisher_builder().initial_max_slice_len(most).max_loaned_samples(1);
            match builder.set_backpressure_handler(move |info| handler.decide(info)).create() {
                Err(PublisherCreateError::ExceedsMaxSupportedPublishers) => {
                    node.try_cleanup_dead_nodes();
                    if start.elapsed() >= patience || bus.has_live_publisher(&self.service) {
                        return Ok(None);
                    }
                    std::thread::sleep(Duration::from_millis(2));
                }
                created => return created.map(Some),
            }
        }
    }

    /// Decides about a consumer whose queue is full. iceoryx2 calls it in the middle of a send.
    pub(super) fn decide(&self, info: &BackpressureInfo) -> BackpressureAction {
        let mut memory = self.memory();
        let id = info.receiver_port_id;
        // one that has left while it held frames is still connected, and takes nothing any more
        if !memory.consumers.contains_key(&id) || info.retries > YIELDS {
            memory.consumers = self.consumers();
        }
        let full = Full {
            id,
            delivery: memory.consumers.get(&id).map(|(delivery, _)| *delivery),
            is_first: info.retries == 0,
            repeats: self.resending.load(Ordering::Relaxed),
            stopping: self.stop.load(Ordering::Relaxed),
            ending: self.ending.load(Ordering::Relaxed),
        };
        let verdict = memory.holding.judge(&full, Instant::now());
        if full.delivery == Some(Delivery::Lossless) && verdict != Verdict::LeaveOut {
            self.blocked.store(true, Ordering::Relaxed);
        }
        match verdict {
            Verdict::LeaveOut => BackpressureAction::DiscardData,
            Verdict::Evict(held) => {
                self.evict(&mut memory, id, held);
                BackpressureAction::DiscardData
            }
            Verdict::GiveUp => BackpressureAction::DiscardDataAndFail,
            Verdict::Wait { clean } => {
                if clean && self.remedies.clean_while_blocked {
                    self.clean(&mut memory);
                }
                drop(memory);
                self.retry(info)
            }
        }
    }

    fn evict(&self, memory: &mut Memory, id: u128, held: Duration) {
        let name = memory.consumers.get(&id).map(|(_, name)| name.clone()).unwrap_or_default();
        memory.events.push(ConsumerEvent::Evicted { name, held });
        self.evicted_count.fetch_add(1, Ordering::Relaxed);
    }

    /// Ignores the consumers attached now: they belong to an earlier producer of this name. One of them
    /// holds this producer back only after joining it.
    pub(super) fn ignore_present(&self) {
        let present = self.consumers().into_keys();
        self.memory().holding.ignore(present);
    }

    /// Notes that a consumer has joined; sends wait for it from now on.
    pub(super) fn joined(&self, id: u128, name: String) {
        let mut memory = self.memory();
        memory.holding.joined(id);
        memory.events.push(ConsumerEvent::Joined { name });
    }

    /// Wakes the consumer that has to make room, and lets it run.
    fn retry(&self, info: &BackpressureInfo) -> BackpressureAction {
        self.waited.store(true, Ordering::Relaxed);
        if info.retries == 0 {
            self.wake();
        }
        if info.retries > YIELDS && self.remedies.pause {
            // iceoryx2 itself only yields at first, which keeps a core busy
            std::thread::sleep(Duration::from_micros(if info.retries > 500 { 1000 } else { 50 }));
        }
        BackpressureAction::Retry
    }

    /// Calls `send` until it does not fail inside iceoryx2 or [`Repeats`] allows no more; adds the repetitions to `repeated`.
    pub(super) fn repeat<R>(
        &self,
        repeated: &mut u64,
        mut send: impl FnMut() -> Result<R, SendError>,
    ) -> Result<R, SendError> {
        let mut repeats = Repeats::default();
        self.resending.store(false, Ordering::Relaxed);
        loop {
            self.waited.store(false, Ordering::Relaxed);
            let sent = send();
            if !matches!(sent, Err(SendError::InternalError)) {
                return sent;
            }
            if !repeats.once_more(self.waited.load(Ordering::Relaxed), self.stop.load(Ordering::Relaxed)) {
                return sent;
            }
            self.resending.store(true, Ordering::Relaxed);
            self.memory().holding.repeats();
            *repeated += 1;
        }
    }

    fn clean(&self, memory: &mut Memory) {
        let dead = clean_dead(&self.config);
        if dead > 0 {
            memory.events.push(ConsumerEvent::CleanedUp { dead });
        }
    }

    /// Wakes every consumer that waits.
    pub(super) fn wake(&self) {
        // fails only for single listeners that are going away
        let _ = self.notifier.notify();
    }

    /// Every consumer attached now, by the id of its subscriber.
    pub(super) fn consumers(&self) -> HashMap<u128, (Delivery, String)> {
        let mut consumers = HashMap::new();
        self.service.dynamic_config().list_subscribers(|subscriber| {
            let name = subscriber.subscriber_name.as_str();
            consumers.insert(subscriber.subscriber_id.value(), (Delivery::of_name(name), name.to_owned()));
            CallbackProgression::Continue
        });
        consumers
    }

    pub(super) fn is_ignored(&self, id: u128) -> bool {
        self.memory().holding.ignores(id)
    }

    pub(super) fn evicted_count(&self) -> u64 {
        self.evicted_count.load(Ordering::Relaxed)
    }

    /// The processes that have consumers attached.
    pub(super) fn processes(&self) -> HashSet<i32> {
        let mut processes = HashSet::new();
        self.service.dynamic_config().list_subscribers(|subscriber| {
            processes.extend(process_of(subscriber.node_id));
            CallbackProgression::Continue
        });
        processes
    }

    pub(super) fn subscriber_count(&self) -> usize {
        self.service.dynamic_config().number_of_subscribers()
    }

    /// True if a lossless consumer held the publisher back since the last call.
    pub(super) fn was_blocked(&self) -> bool {
        self.blocked.load(Ordering::Relaxed) && self.blocked.swap(false, Ordering::Relaxed)
    }

    pub(super) fn take_events(&self) -> Vec<ConsumerEvent> {
        std::mem::take(&mut self.memory().events)
    }

    fn memory(&self) -> std::sync::MutexGuard<'_, Memory> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Removes the remains of dead processes on this bus; returns the number of these processes.
pub(super) fn clean_dead(config: &Config) -> u64 {
    let mut dead = 0;
    // a list that is incomplete is completed the next time
    let _ = Node::<Ipc>::list(config, |node| {
        if let NodeState::Dead(node) = node {
            dead += u64::from(node.try_remove_stale_resources().is_ok());
        }
        CallbackProgression::Continue
    });
    dead
}
