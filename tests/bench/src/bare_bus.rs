//! Measure for the bus: the same frames, and a wake-up, through nothing but iceoryx2.

use bus::{BORROWED, Bus, BusError, MAX_BUFFER};
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::{ServiceName, SignalHandlingMode, ipc};
use iceoryx2::service::port_factory::{event, publish_subscribe};
use std::fmt::Debug;
use std::thread::yield_now;
use std::time::Duration;

/// A port of a service, with the node that it is on.
pub(crate) struct Bare<P> {
    port: P,
    _node: Node<ipc::Service>,
}

/// Slices of doubles from one publisher to one subscriber; nothing is overwritten and nothing is dropped.
pub(crate) type BarePublisher = Bare<Publisher<ipc::Service, [f64], ()>>;

/// The other end.
pub(crate) type BareSubscriber = Bare<Subscriber<ipc::Service, [f64], ()>>;

/// Wakes a [`BareListener`].
pub(crate) type BareNotifier = Bare<Notifier<ipc::Service>>;

/// Sleeps until it is woken.
pub(crate) type BareListener = Bare<Listener<ipc::Service>>;

fn failed<E: Debug>(name: &str, doing: &'static str) -> impl FnOnce(E) -> BusError {
    move |cause| BusError::Service { service: name.to_owned(), doing, cause: format!("{cause:?}") }
}

fn node(bus: &Bus, name: &str) -> Result<Node<ipc::Service>, BusError> {
    let builder =
        NodeBuilder::new().config(bus.bare_config()?).signal_handling_mode(SignalHandlingMode::Disabled);
    builder.create().map_err(failed(name, "register for"))
}

fn service_name(name: &str) -> Result<ServiceName, BusError> {
    ServiceName::new(name).map_err(failed(name, "name"))
}

/// With the queue that a run has as long as its frames are not too big for that.
fn slices(
    node: &Node<ipc::Service>,
    name: &str,
) -> Result<publish_subscribe::PortFactory<ipc::Service, [f64], ()>, BusError> {
    let builder = node.service_builder(&service_name(name)?).publish_subscribe::<[f64]>();
    let builder = builder.enable_safe_overflow(false).history_size(0).max_publishers(1);
    let builder = builder.subscriber_max_buffer_size(MAX_BUFFER).subscriber_max_borrowed_samples(BORROWED);
    builder.open_or_create().map_err(failed(name, "open"))
}

fn events(node: &Node<ipc::Service>, name: &str) -> Result<event::PortFactory<ipc::Service>, BusError> {
    let builder = node.service_builder(&service_name(name)?).event();
    builder.open_or_create().map_err(failed(name, "open"))
}

impl BarePublisher {
    /// A publisher of slices of `doubles`.
    pub(crate) fn create(bus: &Bus, name: &str, doubles: usize) -> Result<Self, BusError> {
        let node = node(bus, name)?;
        let service = slices(&node, name)?;
        let builder = service.publisher_builder().initial_max_slice_len(doubles).max_loaned_samples(1);
        let publisher = builder.create();
        Ok(Self { port: publisher.map_err(failed(name, "publish"))?, _node: node })
    }

    /// Connects to the subscriber, which connects in turn when it receives for the first time.
    pub(crate) fn connect(&self) -> Result<(), BusError> {
        self.port.update_connections().map_err(failed("a bare service", "connect"))
    }

    /// Copies a slice into shared memory and hands it over, when there is room.
    pub(crate) fn send(&self, doubles: &[f64]) -> Result<(), BusError> {
        let (name, doing) = ("a bare service", "send through");
        let slot = self.port.loan_slice_uninit(doubles.len()).map_err(failed(name, doing))?;
        slot.write_from_slice(doubles).send().map_err(failed(name, doing)).map(drop)
    }
}

impl BareSubscriber {
    /// A subscriber to the publisher's slices.
    pub(crate) fn create(bus: &Bus, name: &str) -> Result<Self, BusError> {
        let node = node(bus, name)?;
        let subscriber = slices(&node, name)?.subscriber_builder().create();
        Ok(Self { port: subscriber.map_err(failed(name, "subscribe to"))?, _node: node })
    }

    /// Lends the next slice to `take`, if there is one.
    pub(crate) fn receive(&self, take: impl FnOnce(&[f64])) -> Result<bool, BusError> {
        let sample = self.port.receive().map_err(failed("a bare service", "receive from"))?;
        if let Some(sample) = &sample {
            take(sample.payload());
        }
        Ok(sample.is_some())
    }

    /// Lends the next slice to `take`; looks for it again and again, the fastest way to get it.
    pub(crate) fn await_next(&self, mut take: impl FnMut(&[f64])) -> Result<(), BusError> {
        while !self.receive(&mut take)? {
            yield_now();
        }
        Ok(())
    }
}

impl BareNotifier {
    /// A notifier of the event `name`.
    pub(crate) fn create(bus: &Bus, name: &str) -> Result<Self, BusError> {
        let node = node(bus, name)?;
        let notifier = events(&node, name)?.notifier_builder().create();
        Ok(Self { port: notifier.map_err(failed(name, "notify"))?, _node: node })
    }

    /// Wakes the listener.
    pub(crate) fn notify(&self) -> Result<(), BusError> {
        self.port.notify().map_err(failed("a bare event", "notify")).map(drop)
    }
}

impl BareListener {
    /// A listener to the event `name`.
    pub(crate) fn create(bus: &Bus, name: &str) -> Result<Self, BusError> {
        let node = node(bus, name)?;
        let listener = events(&node, name)?.listener_builder().create();
        Ok(Self { port: listener.map_err(failed(name, "listen to"))?, _node: node })
    }

    /// Sleeps until it is woken, or `timeout` is over; says whether it was woken.
    pub(crate) fn wait(&self, timeout: Duration) -> Result<bool, BusError> {
        let mut woken = false;
        let waited = self.port.timed_wait(|_| woken = true, timeout);
        waited.map_err(failed("a bare event", "wait for"))?;
        Ok(woken)
    }
}
