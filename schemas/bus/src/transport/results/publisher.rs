//! Publishes rows of results.

use super::{attributes_of, columns_of};
use crate::Bus;
use crate::transport::backpressure::Backpressure;
use crate::transport::outlet::{Opening, wait_for_others};
use crate::transport::services::{self, EventService, text_of};
use crate::transport::wire::{FLAG_FOLLOWS, FLAG_LAST, StateHeader, fill};
use crate::transport::{Ipc, process_of};
use crate::values::Remedies;
use crate::{BusError, Delivery, ResultElement, ResultsError, StreamId};
use iceoryx2::node::Node;
use iceoryx2::port::SendError;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::{CallbackProgression, PortFactory as _};
use schemas::frame::Frame;
use schemas::results::{MOST_NAMES_BYTES, ResultColumns, Things, Topic};
use schemas::run_name::RunName;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Longest time that a lossless subscriber to results may take nothing.
const STUCK_AFTER: Duration = Duration::from_secs(10);
const TAKE_OVER_PATIENCE: Duration = Duration::from_millis(500);
/// Longest wait of a new publisher for listening processes to subscribe.
const WATCHER_PATIENCE: Duration = Duration::from_secs(10);

/// Publishes one kind of result of one run. Costs next to nothing while nobody listens.
pub struct ResultPublisher<T: ResultElement> {
    publisher: Publisher<Ipc, [T], StateHeader>,
    backpressure: Arc<Backpressure<T>>,
    stream: StreamId,
    topic: Topic,
    width: usize,
    last: StateHeader,
    /// True if rows were published, received or not.
    follows: bool,
    node: Node<Ipc>,
    _bus: Bus,
}

impl<T: ResultElement> ResultPublisher<T> {
    /// Publishes `topic` of `run`; `stop` ends a publish that is held back.
    ///
    /// # Errors
    /// [`ResultsError::AlreadyPublished`] when another process does so, [`ResultsError::Columns`] when a recording could
    /// not describe such rows, or when the bus cannot be used.
    pub fn create(
        bus: &Bus,
        run: &RunName,
        topic: Topic,
        stream: StreamId,
        columns: &ResultColumns,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, ResultsError> {
        check::<T>(topic, columns).map_err(|what| ResultsError::Columns { topic, what })?;
        let node = bus.node()?;
        let mut columns = columns.clone();
        columns.names.truncate(columns.names.floor_char_boundary(MOST_NAMES_BYTES));
        let lock = bus.lock()?;
        let opening = Opening {
            bus,
            node: &node,
            run,
            topic,
            elements: columns.width.max(1), // integers
            stop,
            stuck_after: STUCK_AFTER,
            patience: TAKE_OVER_PATIENCE,
            remedies: Remedies::default(),
        };
        let service = opening.service::<T>(&attributes_of(&columns))?;
        let found = columns_of(&service);
        if found != columns && service.dynamic_config().number_of_publishers() == 0 {
            let (name, expected, found) = (run.clone(), columns.width, found.width);
            return Err(ResultsError::OtherColumns { name, topic, expected, found });
        }
        let Some((publisher, backpressure)) = opening.publisher(service)? else {
            return Err(ResultsError::AlreadyPublished { name: run.clone(), topic });
        };
        drop(lock);
        let watchers = Watchers::call(&node, run, topic)?;
        wait_for_others(&node, &backpressure.stop, WATCHER_PATIENCE, || {
            watchers.have_subscribed(&backpressure)
        });
        Ok(Self {
            publisher,
            backpressure,
            stream,
            topic,
            width: columns.width,
            last: StateHeader::of(stream),
            follows: false,
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

    /// As [`finish`](Self::finish), and tells that the rows after the last one up to that of frame `missed` do not come.
    ///
    /// # Errors
    /// As [`finish`](Self::finish).
    pub fn finish_short_of(mut self, missed: Option<u64>) -> Result<(), ResultsError> {
        self.last.frame = self.last.frame.max(missed.unwrap_or(0));
        self.finish()
    }

    /// As [`finish`](Self::finish), but leaves the bus only when every present lossless subscriber has left, the publisher
    /// is stopped, or `at_most` is over. Use it before publishing the same topic again, so that present subscribers can
    /// read to the end.
    ///
    /// # Errors
    /// As [`finish`](Self::finish).
    pub fn finish_and_wait(self, at_most: Duration) -> Result<(), ResultsError> {
        self.backpressure.ending.store(true, Ordering::Relaxed);
        self.send(StateHeader { flags: FLAG_LAST, ..self.last }, &[])?;
        self.backpressure.wake();
        // whoever comes now has nothing to read
        let mut readers = self.backpressure.consumers();
        readers.retain(|_, (delivery, _)| *delivery == Delivery::Lossless);
        wait_for_others(&self.node, &self.backpressure.stop, at_most, || {
            let here = self.backpressure.consumers();
            readers.retain(|id, _| here.contains_key(id));
            readers.is_empty()
        });
        Ok(())
    }
}

/// Refuses rows that a recording could not describe.
fn check<T: ResultElement>(topic: Topic, columns: &ResultColumns) -> Result<(), String> {
    let Topic::Results(name) = topic else { return Err("this topic has no rows of results".to_owned()) };
    match columns.tolerance_m {
        _ if name.is_own() && T::ARE_CLASSES => Err("its values are no f64".to_owned()),
        Some(_) if !T::ARE_CLASSES => Err("numbers with a tolerance; only classes (u8) have one".to_owned()),
        None if T::ARE_CLASSES => Err("classes without a tolerance; say what counts as touching".to_owned()),
        None if Things::of_topic(name.as_str()).is_none() => columns.fields().map(|_| ()),
        _ => Ok(()),
    }
}

/// Processes that wait for publishers of one topic, or of any.
struct Watchers([EventService; 2]);

impl Watchers {
    /// Tells these processes about a new publisher of `topic`.
    fn call(node: &Node<Ipc>, run: &RunName, topic: Topic) -> Result<Self, BusError> {
        let all = [services::events(node, run, topic)?, services::announcements(node, run)?];
        for events in &all {
            let bell = events.notifier_builder().create();
            let bell = bell.map_err(|e| BusError::service(&text_of(run, topic), "announce", &e))?;
            // fails only for single listeners that are going away
            let _ = bell.notify();
        }
        Ok(Self(all))
    }

    /// True if each of these processes has a subscriber, and so gets every row.
    fn have_subscribed<T: ResultElement>(&self, backpressure: &Backpressure<T>) -> bool {
        let subscribed = backpressure.processes();
        self.0.iter().all(|events| {
            let mut all_have = true;
            events.dynamic_config().list_listeners(|listener| {
                all_have = process_of(listener.node_id).is_none_or(|process| subscribed.contains(&process));
                if all_have { CallbackProgression::Continue } else { CallbackProgression::Stop }
            });
            all_have
        })
    }
}
