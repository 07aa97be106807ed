//! Results of analyses on the bus: one row per frame.

use super::backpressure::{Backpressure, Delivery, Remedies};
use super::delivery::LIVENESS_PERIOD;
use super::live::LATEST_BUFFER;
use super::result_watch::{Watchers, wait_for_watchers};
use super::services::{self, SliceService, attribute, check_schema, text_of};
use super::wire::{FLAG_FOLLOWS, FLAG_LAST, StateHeader, StreamId, fill};
use super::{Bus, BusError, Ipc, RoomError, room};
use iceoryx2::node::Node;
use iceoryx2::port::SendError;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{PortFactory as _, PortName, ZeroCopySend};
use iceoryx2::sample::Sample;
use schemas::frame::{EndReason, Frame};
use schemas::results::Topic;
use schemas::results::{MOST_NAMES_BYTES, ResultColumns};
use schemas::run_name::RunName;
use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const WAIT: Duration = Duration::from_millis(50);
/// How long a lossless subscriber to results may take nothing.
const STUCK_AFTER: Duration = Duration::from_secs(10);
const TAKE_OVER_PATIENCE: Duration = Duration::from_millis(500);
/// How often a publisher looks whether its subscribers have left.
const LEAVING_PERIOD: Duration = Duration::from_millis(2);
const COLUMNS_KEY: &str = "beadline.columns";
const WIDTH_KEY: &str = "beadline.width";
const TOLERANCE_KEY: &str = "beadline.tolerance_m";

/// What a row consists of: `f64` for numbers, `u8` for classes, one byte a contact.
pub trait ResultElement: Copy + Debug + ZeroCopySend + Send + Sync + 'static {
    /// Whether these are numbers, as rows of somebody else's topics must be.
    const ARE_NUMBERS: bool;
}
impl ResultElement for f64 {
    const ARE_NUMBERS: bool = true;
}
impl ResultElement for u8 {
    const ARE_NUMBERS: bool = false;
}

/// Why results cannot be published or read.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// Rows that a recording could not describe.
    #[error("{topic}: {what}")]
    Columns {
        /// Which results.
        topic: Topic,
        /// What was expected and found.
        what: String,
    },
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// Another process publishes them already; this one can go on without.
    #[error("{topic} of run {name} are already published by another process")]
    AlreadyPublished {
        /// The run.
        name: RunName,
        /// Which results.
        topic: Topic,
    },
    /// Shared memory.
    #[error(transparent)]
    Room(#[from] RoomError),
    /// Subscribers to earlier results with other columns keep the service as it was.
    #[error(
        "{topic} of run {name} had other columns before ({found}, now {expected}), and still has subscribers \
         to those; end them"
    )]
    OtherColumns {
        /// The run.
        name: RunName,
        /// Which results.
        topic: Topic,
        /// Elements in a row now.
        expected: usize,
        /// Elements in a row before.
        found: usize,
    },
    /// A row of another width.
    #[error("frame {frame}: a row of {found} elements, expected {expected}")]
    Width {
        /// The frame.
        frame: u64,
        /// Elements expected.
        expected: usize,
        /// Elements found.
        found: usize,
    },
    /// We were asked to stop while a subscriber held us back.
    #[error("stopped while a subscriber to {topic} held us back")]
    Stopped {
        /// Which results.
        topic: Topic,
    },
    /// Sending or receiving failed.
    #[error("{topic}: {cause}")]
    Port {
        /// Which results.
        topic: Topic,
        /// What iceoryx2 says.
        cause: String,
    },
}

/// Publishes one kind of result of one run. Costs next to nothing while nobody listens.
pub struct ResultPublisher<T: ResultElement> {
    publisher: Publisher<Ipc, [T], StateHeader>,
    backpressure: Arc<Backpressure<T>>,
    stream: StreamId,
    topic: Topic,
    width: usize,
    last: StateHeader,
    /// Rows were published, whether anybody got them or not.
    follows: bool,
    finished: bool,
    node: Node<Ipc>,
    _bus: Bus,
}

impl<T: ResultElement> ResultPublisher<T> {
    /// Publishes `topic` of `run`; `stop` ends a publish that is held back.
    ///
    /// # Errors
    /// [`ResultsError::AlreadyPublished`] when another process does so, or when the bus cannot be used.
    pub fn create(
        bus: &Bus,
        run: &RunName,
        topic: Topic,
        stream: StreamId,
        columns: &ResultColumns,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, ResultsError> {
        let text = text_of(run, topic);
        if let Topic::Own(_) = topic {
            let fields =
                if T::ARE_NUMBERS { columns.fields() } else { Err("its values are no f64".to_owned()) };
            fields.map_err(|what| ResultsError::Columns { topic, what })?;
        }
        let node = bus.node()?;
        check_schema(bus, run, topic)?;
        let mut names = columns.names.clone();
        let ends = names.char_indices().map(|(at, c)| at + c.len_utf8());
        names.truncate(ends.take_while(|end| *end <= MOST_NAMES_BYTES).last().unwrap_or(0));
        let tolerance = columns.tolerance_m.map(|m| (TOLERANCE_KEY, format!("{m:e}")));
        let columns = ResultColumns { names, ..columns.clone() };
        let more: Vec<_> = [(COLUMNS_KEY, columns.names.clone()), (WIDTH_KEY, columns.width.to_string())]
            .into_iter()
            .chain(tolerance)
            .collect();
        let lock = bus.lock()?;
        let row_bytes = (columns.width * size_of::<T>()) as u64;
        let free_bytes = room::free_bytes()?;
        let limits = room::plan(row_bytes, free_bytes);
        let service = services::slices::<T>(&node, run, topic, limits, &more)?;
        room::check(row_bytes, services::limits_of(&service), free_bytes)?;
        let found = columns_of(&service);
        if found != columns && service.dynamic_config().number_of_publishers() == 0 {
            return Err(ResultsError::OtherColumns {
                name: run.clone(),
                topic,
                expected: columns.width,
                found: found.width,
            });
        }
        let events = services::events(&node, run, topic)?;
        let notifier = events.notifier_builder().create();
        let notifier = notifier.map_err(|e| BusError::service(&text, "notify", &e))?;
        let watched = services::slices::<T>(&node, run, topic, limits, &more)?;
        let config = bus.config().clone();
        let backpressure =
            Backpressure::new(watched, config, notifier, stop, STUCK_AFTER, Remedies::default());
        let elements = columns.width.max(1); // integers
        let publisher = backpressure.publisher(bus, &node, &service, elements, TAKE_OVER_PATIENCE);
        let publisher = publisher.map_err(|e| BusError::service(&text, "publish", &e))?;
        let taken = || ResultsError::AlreadyPublished { name: run.clone(), topic };
        let publisher = publisher.ok_or_else(taken)?;
        room::reserve(bus.prefix(), publisher.id().value())?;
        drop(lock);
        backpressure.wake();
        let watchers = Watchers::call(&node, run, topic, events)?;
        wait_for_watchers(&node, &backpressure, || watchers.count());
        let last = StateHeader::of(stream);
        let width = columns.width;
        let (follows, finished) = (false, false);
        Ok(Self {
            publisher,
            backpressure,
            stream,
            topic,
            width,
            last,
            follows,
            finished,
            node,
            _bus: bus.clone(),
        })
    }

    /// Publishes the row of one frame.
    ///
    /// # Errors
    /// When the row has another width, or the bus fails.
    pub fn publish(&mut self, frame: u64, step: u64, time_s: f64, row: &[T]) -> Result<(), ResultsError> {
        if row.len() != self.width {
            return Err(ResultsError::Width { frame, expected: self.width, found: row.len() });
        }
        self.last = StateHeader {
            frame,
            step,
            time_s,
            flags: if self.follows { FLAG_FOLLOWS } else { 0 },
            ..StateHeader::of(self.stream)
        };
        self.follows = true;
        if self.backpressure.subscriber_count() == 0 {
            return Ok(());
        }
        self.send(self.last, row)?;
        self.backpressure.wake();
        Ok(())
    }

    /// Publishes the row of `frame`.
    ///
    /// # Errors
    /// As [`publish`](Self::publish).
    pub fn publish_for(&mut self, frame: &Frame<'_>, row: &[T]) -> Result<(), ResultsError> {
        self.publish(frame.frame, frame.step, frame.time_s, row)
    }

    fn send(&self, header: StateHeader, row: &[T]) -> Result<(), ResultsError> {
        let topic = self.topic;
        let send = || fill(self.publisher.loan_slice_uninit(row.len())?, header, &[row]).send();
        match self.backpressure.repeat(&mut 0, send) {
            Ok(_) => Ok(()),
            Err(SendError::UnableToDeliver) => Err(ResultsError::Stopped { topic }),
            Err(e) => Err(ResultsError::Port { topic, cause: format!("{e:?}") }),
        }
    }

    /// Tells subscribers that no more rows come: a row of length 0 with [`FLAG_LAST`].
    ///
    /// # Errors
    /// When it cannot be sent; subscribers then notice that the publisher is gone.
    pub fn finish(self) -> Result<(), ResultsError> {
        self.finish_and_wait(Duration::ZERO)
    }

    /// As [`finish`](Self::finish), but leaves the bus only when every present lossless subscriber has left, it is
    /// stopped, or `at_most` is over. Use it before publishing the same topic again, so that present subscribers can
    /// read to the end.
    ///
    /// # Errors
    /// As [`finish`](Self::finish).
    pub fn finish_and_wait(mut self, at_most: Duration) -> Result<(), ResultsError> {
        self.finished = true;
        self.backpressure.ending.store(true, Ordering::Relaxed);
        self.send(StateHeader { flags: FLAG_LAST, ..self.last }, &[])?;
        self.backpressure.wake();
        let start = Instant::now();
        // whoever comes now has nothing to read
        let mut readers = self.backpressure.consumers();
        readers.retain(|_, (delivery, _)| *delivery == Delivery::Lossless);
        while !readers.is_empty()
            && start.elapsed() < at_most
            && !self.backpressure.stop.load(Ordering::Relaxed)
        {
            std::thread::sleep(LEAVING_PERIOD);
            self.node.try_cleanup_dead_nodes();
            let here = self.backpressure.consumers();
            readers.retain(|id, _| here.contains_key(id));
        }
        Ok(())
    }
}

fn columns_of<T: ResultElement>(service: &SliceService<T>) -> ResultColumns {
    ResultColumns {
        width: attribute(service.attributes(), WIDTH_KEY).and_then(|w| w.parse().ok()).unwrap_or(0),
        names: attribute(service.attributes(), COLUMNS_KEY).unwrap_or_default(),
        tolerance_m: attribute(service.attributes(), TOLERANCE_KEY).and_then(|m| m.parse().ok()),
    }
}

/// One row of results, lent until the next call.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<'a, T> {
    /// The stream of frames it belongs to.
    pub stream: StreamId,
    /// The frame it belongs to.
    pub frame: u64,
    /// The step of that frame.
    pub step: u64,
    /// The time of that frame (s).
    pub time_s: f64,
    /// Its publisher had rows before this one, whether they reached us or not.
    pub follows: bool,
    /// The values.
    pub values: &'a [T],
}

/// What a subscriber to results has next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ResultReceived<'a, T> {
    /// The next row.
    Row(Row<'a, T>),
    /// Rows of the frames `from` up to and including `to` did not reach us.
    Missed {
        /// First missing frame.
        from: u64,
        /// Last missing frame.
        to: u64,
    },
    /// No more rows.
    End(EndReason),
}

/// The next thing for a subscriber, before it is lent.
#[derive(Debug, Clone, Copy)]
enum Next {
    Row,
    Missed { from: u64, to: u64 },
    End(EndReason),
}

/// Receives one kind of result of one run.
pub struct ResultSubscriber<T: ResultElement> {
    sample: Option<Sample<Ipc, [T], StateHeader>>,
    stashed: Option<Sample<Ipc, [T], StateHeader>>,
    subscriber: Subscriber<Ipc, [T], StateHeader>,
    listener: Arc<Listener<Ipc>>,
    service: SliceService<T>,
    bus: Bus,
    topic: Topic,
    columns: ResultColumns,
    stream: Option<StreamId>,
    expected: Option<u64>,
    closing: Option<EndReason>,
    ended: Option<EndReason>,
    checked_at: Instant,
    stop: Arc<AtomicBool>,
    _node: Node<Ipc>,
}

impl<T: ResultElement> ResultSubscriber<T> {
    /// Attaches to `topic` of `run`. `None`: nobody publishes it (yet).
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn attach(
        bus: &Bus,
        run: &RunName,
        topic: Topic,
        delivery: Delivery,
        stop: Arc<AtomicBool>,
    ) -> Result<Option<Self>, ResultsError> {
        let node = bus.node()?;
        Self::attach_with(bus, node, run, topic, delivery, stop, None)
    }

    pub(super) fn attach_with(
        bus: &Bus,
        node: Node<Ipc>,
        run: &RunName,
        topic: Topic,
        delivery: Delivery,
        stop: Arc<AtomicBool>,
        listener: Option<Arc<Listener<Ipc>>>,
    ) -> Result<Option<Self>, ResultsError> {
        let text = text_of(run, topic);
        let failed = |e: &dyn Debug| BusError::service(&text, "subscribe to", &format!("{e:?}"));
        check_schema(bus, run, topic)?;
        let Some(service) = services::find_slices::<T>(&node, run, topic)? else { return Ok(None) };
        if service.dynamic_config().number_of_publishers() == 0 {
            return Ok(None);
        }
        let columns = columns_of(&service);
        let name = format!("{}.results.{}", delivery.as_str(), std::process::id());
        let name = PortName::new(&name).map_err(|e| failed(&e))?;
        let mut builder = service.subscriber_builder().name(&name);
        if delivery == Delivery::Latest {
            builder = builder.buffer_size(LATEST_BUFFER);
        }
        let subscriber = builder.create().map_err(|e| failed(&e))?;
        let listener = match listener {
            Some(listener) => listener,
            None => new_listener(&node, run, topic)?,
        };
        Ok(Some(Self {
            sample: None,
            stashed: None,
            subscriber,
            listener,
            service,
            bus: bus.clone(),
            topic,
            columns,
            stream: None,
            expected: None,
            closing: None,
            ended: None,
            checked_at: Instant::now(),
            stop,
            _node: node,
        }))
    }

    /// What the elements of a row mean.
    pub fn columns(&self) -> &ResultColumns {
        &self.columns
    }

    /// The stream that the rows belong to, once one has come.
    pub fn stream(&self) -> Option<StreamId> {
        self.stream
    }

    /// Waits for the next row and lends it until the next call.
    ///
    /// # Errors
    /// When rows can no longer be received.
    pub fn receive(&mut self) -> Result<ResultReceived<'_, T>, ResultsError> {
        let next = loop {
            if let Some(next) = self.advance()? {
                break next;
            }
        };
        Ok(self.lend(next))
    }

    /// Like [`receive`](Self::receive), but none if nothing comes for a moment.
    ///
    /// # Errors
    /// When rows can no longer be received.
    pub fn receive_soon(&mut self) -> Result<Option<ResultReceived<'_, T>>, ResultsError> {
        let next = self.advance()?;
        Ok(next.map(|next| self.lend(next)))
    }

    /// What is next; none after a wait in vain.
    fn advance(&mut self) -> Result<Option<Next>, ResultsError> {
        self.sample = None;
        loop {
            if let Some(reason) = self.ended {
                return Ok(Some(Next::End(reason)));
            }
            if self.stop.load(Ordering::Relaxed) {
                self.ended = Some(EndReason::Stopped);
                continue;
            }
            let next = match self.stashed.take() {
                Some(sample) => Some(sample),
                None => self.subscriber.receive().map_err(|e| self.failed(&e))?,
            };
            match next {
                Some(sample) => {
                    if let Some(next) = self.take(sample) {
                        return Ok(Some(next));
                    }
                }
                None if self.closing.is_some() => self.ended = self.closing,
                None => {
                    self.look_or_wait();
                    return Ok(None);
                }
            }
        }
    }

    fn failed(&self, cause: &dyn Debug) -> ResultsError {
        ResultsError::Port { topic: self.topic, cause: format!("{cause:?}") }
    }

    /// Classifies one sample; none if it has no news.
    fn take(&mut self, sample: Sample<Ipc, [T], StateHeader>) -> Option<Next> {
        let header = *sample.user_header();
        let stream = header.stream();
        if *self.stream.get_or_insert(stream) != stream {
            self.closing.get_or_insert(EndReason::ProducerLost);
            return None;
        }
        if header.flags & FLAG_LAST != 0 && sample.payload().is_empty() {
            self.closing = Some(EndReason::Complete);
            let missing = self.expected.filter(|expected| *expected <= header.frame);
            return missing.map(|from| Next::Missed { from, to: header.frame });
        }
        let expected = *self.expected.get_or_insert(header.frame);
        if header.frame < expected {
            return None;
        }
        if header.frame > expected {
            self.stashed = Some(sample);
            self.expected = Some(header.frame);
            return Some(Next::Missed { from: expected, to: header.frame - 1 });
        }
        self.expected = Some(header.frame + 1);
        self.sample = Some(sample);
        Some(Next::Row)
    }

    fn lend(&self, next: Next) -> ResultReceived<'_, T> {
        match (next, &self.sample) {
            (Next::Row, Some(sample)) => {
                let header = *sample.user_header();
                let StateHeader { frame, step, time_s, flags, .. } = header;
                let (stream, follows) = (header.stream(), flags & FLAG_FOLLOWS != 0);
                ResultReceived::Row(Row { stream, frame, step, time_s, follows, values: sample.payload() })
            }
            (Next::Missed { from, to }, _) => ResultReceived::Missed { from, to },
            (Next::End(reason), _) => ResultReceived::End(reason),
            (Next::Row, None) => ResultReceived::End(EndReason::ProducerLost),
        }
    }

    fn look_or_wait(&mut self) {
        let gone = self.service.dynamic_config().number_of_publishers() == 0;
        let ask = self.checked_at.elapsed() >= LIVENESS_PERIOD;
        if ask {
            self.checked_at = Instant::now();
        }
        if gone || (ask && !self.bus.has_live_publisher(&self.service)) {
            self.closing = Some(EndReason::ProducerLost);
            return;
        }
        // a signal ends the wait early; the loop looks at the flag
        let _ = self.listener.timed_wait(|_| {}, WAIT);
    }
}

pub(super) fn new_listener(
    node: &Node<Ipc>,
    run: &RunName,
    topic: Topic,
) -> Result<Arc<Listener<Ipc>>, ResultsError> {
    let created = services::events(node, run, topic)?.listener_builder().create();
    Ok(Arc::new(created.map_err(|e| BusError::service(&text_of(run, topic), "listen to", &e))?))
}
