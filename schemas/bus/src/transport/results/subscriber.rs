//! Receives rows of results.

use super::columns_of;
use crate::Bus;
use crate::transport::Ipc;
use crate::transport::delivery::{Following, Turn};
use crate::transport::services::{self, SliceService, check_schema, text_of};
use crate::transport::wire::{FLAG_FOLLOWS, FLAG_LAST, RunStatus, STATE_DONE, StateHeader};
use crate::{BusError, Delivery, ResultElement, ResultReceived, ResultsError, Row};
use iceoryx2::node::Node;
use iceoryx2::port::ReceiveError;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{PortFactory as _, PortName};
use iceoryx2::sample::Sample;
use schemas::frame::EndReason;
use schemas::results::{ResultColumns, RowValues, Topic};
use schemas::run_name::RunName;
use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const WAIT: Duration = Duration::from_millis(50);

/// Queue of a subscriber, for rows of any element type.
trait Queue: Send {
    /// Lets go of the row taken last and takes the next one, if there is one.
    fn take(&mut self) -> Result<Option<StateHeader>, ReceiveError>;
    /// The row taken last.
    fn row(&self) -> Option<(&StateHeader, RowValues<'_>)>;
    /// True if the topic has a publisher.
    fn has_publisher(&self) -> bool;
    /// True if the topic has a publisher in a living process.
    fn has_live_publisher(&self, bus: &Bus) -> bool;
}

struct QueueOf<T: ResultElement> {
    // before the subscriber: it is given back through that
    sample: Option<Sample<Ipc, [T], StateHeader>>,
    subscriber: Subscriber<Ipc, [T], StateHeader>,
    service: SliceService<T>,
}

impl<T: ResultElement> Queue for QueueOf<T> {
    fn take(&mut self) -> Result<Option<StateHeader>, ReceiveError> {
        self.sample = None;
        self.sample = self.subscriber.receive()?;
        Ok(self.sample.as_ref().map(|sample| *sample.user_header()))
    }

    fn row(&self) -> Option<(&StateHeader, RowValues<'_>)> {
        self.sample.as_ref().map(|sample| (sample.user_header(), T::values(sample.payload())))
    }

    fn has_publisher(&self) -> bool {
        self.service.dynamic_config().number_of_publishers() > 0
    }

    fn has_live_publisher(&self, bus: &Bus) -> bool {
        bus.has_live_publisher(&self.service)
    }
}

type Subscribed = (Box<dyn Queue>, ResultColumns);

/// Subscribes to the topic, if somebody publishes it.
fn subscribe<T: ResultElement>(
    node: &Node<Ipc>,
    run: &RunName,
    topic: Topic,
    delivery: Delivery,
) -> Result<Option<Subscribed>, ResultsError> {
    let failed = |e: &dyn Debug| BusError::service(&text_of(run, topic), "subscribe to", e);
    let Some(service) = services::find_slices::<T>(node, run, topic)? else { return Ok(None) };
    if service.dynamic_config().number_of_publishers() == 0 {
        return Ok(None);
    }
    let columns = columns_of(&service);
    let name = format!("{}.results.{}", delivery.as_str(), std::process::id());
    let name = PortName::new(&name).map_err(|e| failed(&e))?;
    let mut builder = service.subscriber_builder().name(&name);
    if delivery == Delivery::Latest {
        builder = builder.buffer_size(services::LATEST_BUFFER);
    }
    let subscriber = builder.create().map_err(|e| failed(&e))?;
    Ok(Some((Box::new(QueueOf { sample: None, subscriber, service }), columns)))
}

/// Receives one kind of result of one run.
pub struct ResultSubscriber {
    queue: Box<dyn Queue>,
    listener: Listener<Ipc>,
    bus: Bus,
    topic: Topic,
    columns: ResultColumns,
    following: Following,
    /// Status of the stream; it has the end once the row of the end has come.
    status: RunStatus,
    stop: Arc<AtomicBool>,
    _node: Node<Ipc>,
}

impl ResultSubscriber {
    /// Attaches to `topic` of `run`; none if nobody publishes it (yet).
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
        // registering costs more than a look
        let Some(element) = services::element_of(bus, run, topic)? else { return Ok(None) };
        let node = bus.node()?;
        check_schema(bus, run, topic)?;
        let subscribe = if element == "u8" { subscribe::<u8> } else { subscribe::<f64> };
        let Some((queue, columns)) = subscribe(&node, run, topic, delivery)? else { return Ok(None) };
        let listener = services::events(&node, run, topic)?.listener_builder().create();
        let listener = listener.map_err(|e| BusError::service(&text_of(run, topic), "listen to", &e))?;
        Ok(Some(Self {
            queue,
            listener,
            bus: bus.clone(),
            topic,
            columns,
            following: Following::of_results(Instant::now()),
            status: RunStatus::default(),
            stop,
            _node: node,
        }))
    }

    /// Meaning of the elements of a row.
    pub fn columns(&self) -> &ResultColumns {
        &self.columns
    }

    /// Waits for the next row and lends it until the next call.
    ///
    /// # Errors
    /// When rows can no longer be received.
    pub fn receive(&mut self) -> Result<ResultReceived<'_>, ResultsError> {
        loop {
            match self.next_turn()? {
                Turn::Wait => self.wait(),
                turn => return Ok(self.lend(turn)),
            }
        }
    }

    /// Like [`receive`](Self::receive), but none if nothing comes for a moment.
    ///
    /// # Errors
    /// When rows can no longer be received.
    pub fn receive_soon(&mut self) -> Result<Option<ResultReceived<'_>>, ResultsError> {
        match self.next_turn()? {
            Turn::Wait => {
                self.wait();
                Ok(None)
            }
            turn => Ok(Some(self.lend(turn))),
        }
    }

    /// Takes turns until there is something to tell or to wait for.
    fn next_turn(&mut self) -> Result<Turn, ResultsError> {
        loop {
            if self.stop.load(Ordering::Relaxed) {
                self.following.end(EndReason::Stopped);
            }
            match self.following.turn() {
                Turn::Take => self.take()?,
                Turn::Read => {
                    // without a publisher there is no status
                    let is_known = self.status.state == STATE_DONE || self.queue.has_publisher();
                    self.following.read(is_known.then_some(&self.status), Instant::now());
                }
                Turn::Ask => self.following.heard(self.queue.has_live_publisher(&self.bus)),
                turn => return Ok(turn),
            }
        }
    }

    fn take(&mut self) -> Result<(), ResultsError> {
        let failed = |e| ResultsError::Port { topic: self.topic, cause: format!("{e:?}") };
        let header = self.queue.take().map_err(failed)?;
        if let Some(end) = header.filter(|header| self.is_end(header)) {
            let frames = u64::from(self.following.stream().is_some());
            self.status = RunStatus { state: STATE_DONE, first_frame: end.frame, frames, ..self.status };
        } else {
            self.following.took(header.as_ref(), Instant::now());
        }
        Ok(())
    }

    /// True if the row taken last tells that no more rows come.
    fn is_end(&self, header: &StateHeader) -> bool {
        let is_empty = self.queue.row().is_some_and(|(_, values)| values.is_empty());
        let is_ours = self.following.stream().is_none_or(|stream| stream == header.stream());
        header.flags & FLAG_LAST != 0 && is_empty && is_ours
    }

    fn lend(&self, turn: Turn) -> ResultReceived<'_> {
        match (turn, self.queue.row()) {
            (Turn::Missed { from, to }, _) => ResultReceived::Missed { from, to },
            (Turn::End(reason), _) => ResultReceived::End(reason),
            (_, None) => ResultReceived::End(EndReason::ProducerLost),
            (_, Some((header, values))) => {
                let StateHeader { frame, step, time_s, flags, .. } = *header;
                let (stream, follows) = (header.stream(), flags & FLAG_FOLLOWS != 0);
                ResultReceived::Row(Row { stream, frame, step, time_s, follows, values })
            }
        }
    }

    fn wait(&mut self) {
        // a signal ends the wait early; the loop looks at the flag
        let _ = self.listener.timed_wait(|_| {}, WAIT);
        self.following.waited();
    }
}
