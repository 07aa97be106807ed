//! The services of a run: their names, their limits, and opening them while others come and go.

use super::creating::Wanted;
use super::wire::{JoinAnswer, JoinRequest, StateHeader};
use super::{Bus, Ipc};
use crate::{BORROWED, BusError};
use iceoryx2::node::Node;
use iceoryx2::prelude::{
    AttributeSpecifier, MessagingPattern, PortFactory as _, SemanticString as _, Service as _, ServiceName,
    ZeroCopySend,
};
use iceoryx2::service::ServiceDetails;
use iceoryx2::service::attribute::{AttributeKey, AttributeSet, AttributeValue};
use iceoryx2::service::builder::blackboard::{BlackboardCreateError, BlackboardOpenError};
use iceoryx2::service::builder::event::{EventCreateError, EventOpenError};
use iceoryx2::service::builder::publish_subscribe::{PublishSubscribeCreateError, PublishSubscribeOpenError};
use iceoryx2::service::builder::request_response::{RequestResponseCreateError, RequestResponseOpenError};
use iceoryx2::service::port_factory::{blackboard, event, publish_subscribe, request_response};
use schemas::manifest::SCHEMA_VERSION;
use schemas::results::Topic;
use schemas::run_name::RunName;

use std::fmt::Debug;
use std::time::{Duration, Instant};

pub(super) type StateService = publish_subscribe::PortFactory<Ipc, [f64], StateHeader>;
pub(super) type SliceService<T> = publish_subscribe::PortFactory<Ipc, [T], StateHeader>;
pub(super) type EventService = event::PortFactory<Ipc>;
pub(super) type JoinService = request_response::PortFactory<Ipc, JoinRequest, (), JoinAnswer, ()>;
pub(super) type BoardService = blackboard::PortFactory<Ipc, u64>;

/// Most consumers of one topic; fewer for big frames when shared memory is short.
pub(super) const MAX_SUBSCRIBERS: usize = 16;
/// Length of the queue of a `latest` consumer; with a longer queue it would see older frames.
pub(super) const LATEST_BUFFER: usize = 2;
/// Most processes that have a service open.
const MAX_NODES: usize = 64;
/// Longest wait for a service that is being created or removed, after iceoryx2 has waited.
const PATIENCE: Duration = Duration::from_millis(200);
const SCHEMA_KEY: &str = "beadline.schema";

pub(super) fn text_of(run: &RunName, topic: Topic) -> String {
    format!("beadline/{run}/{topic}")
}

pub(super) fn service_name(run: &RunName, topic: Topic) -> Result<ServiceName, BusError> {
    let text = text_of(run, topic);
    ServiceName::new(&text).map_err(|e| BusError::service(&text, "name", &e))
}

/// Class of a failure to open or create a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Class {
    Missing,
    Exists,
    /// A signal interrupted the call.
    Interrupted,
    /// The service is being created or removed, or was left half-way.
    Broken,
    Refused,
}

pub(super) trait Classify: Debug {
    fn class(&self) -> Class;
}

macro_rules! classify {
    ($($open:ident, $create:ident $(, $hangs:ident)?;)*) => { $(
        impl Classify for $open {
            fn class(&self) -> Class {
                match self {
                    Self::DoesNotExist => Class::Missing,
                    Self::Interrupt => Class::Interrupted,
                    Self::ServiceInCorruptedState | Self::HangsInCreation
                    | Self::IsMarkedForDestruction => Class::Broken,
                    _ => Class::Refused,
                }
            }
        }
        impl Classify for $create {
            fn class(&self) -> Class {
                match self {
                    Self::AlreadyExists => Class::Exists,
                    Self::Interrupt => Class::Interrupted,
                    Self::ServiceInCorruptedState $(| Self::$hangs)?
                    | Self::IsBeingCreatedByAnotherInstance => Class::Broken,
                    _ => Class::Refused,
                }
            }
        }
    )* };
}

classify! {
    BlackboardOpenError, BlackboardCreateError, HangsInCreation;
    EventOpenError, EventCreateError;
    PublishSubscribeOpenError, PublishSubscribeCreateError, HangsInCreation;
    RequestResponseOpenError, RequestResponseCreateError, HangsInCreation;
}

/// Opens a service that others may be creating or removing; none if there is no whole one.
pub(super) fn open<T, E: Classify>(
    text: &str,
    open: impl Fn() -> Result<T, E>,
) -> Result<Option<T>, BusError> {
    let start = Instant::now();
    loop {
        let waited = start.elapsed();
        match open() {
            Ok(service) => return Ok(Some(service)),
            Err(e) => match e.class() {
                Class::Missing => return Ok(None),
                // its creator may have been killed; the next creator removes it
                Class::Broken if waited >= PATIENCE => return Ok(None),
                Class::Broken => {}
                Class::Interrupted if waited < 10 * PATIENCE => {}
                _ => return Err(BusError::service(text, "open", &e)),
            },
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn key(text: &str) -> Result<AttributeKey, BusError> {
    AttributeKey::new(text.as_bytes()).map_err(|e| BusError::service(text, "describe", &e))
}

/// Attributes of a new service: the schema version and `more`.
pub(super) fn attributes(more: &[(&str, String)]) -> Result<AttributeSpecifier, BusError> {
    let mut attributes = AttributeSpecifier::new();
    let version = (SCHEMA_KEY, SCHEMA_VERSION.to_string());
    for (name, text) in std::iter::once(&version).chain(more) {
        let value =
            AttributeValue::new(text.as_bytes()).map_err(|e| BusError::service(name, "describe", &e))?;
        attributes =
            attributes.define(&key(name)?, &value).map_err(|e| BusError::service(name, "describe", &e))?;
    }
    Ok(attributes)
}

/// The value of attribute `name`.
pub(super) fn attribute(attributes: &AttributeSet, name: &str) -> Option<String> {
    let value = attributes.key_value(&key(name).ok()?, 0)?;
    String::from_utf8(value.as_bytes().to_vec()).ok()
}

/// Refuses a service of another major schema version. Call it before opening the service, because its types may differ.
pub(super) fn check_schema(bus: &Bus, run: &RunName, topic: Topic) -> Result<(), BusError> {
    let pattern = match topic {
        Topic::Manifest => MessagingPattern::Blackboard,
        Topic::Join => MessagingPattern::RequestResponse,
        _ => MessagingPattern::PublishSubscribe,
    };
    let Ok(Some(details)) = Ipc::details(&service_name(run, topic)?, bus.config(), pattern) else {
        return Ok(()); // opening it says what is wrong
    };
    let found = attribute(details.static_details.attributes(), SCHEMA_KEY).unwrap_or_else(|| "none".into());
    let major = found.split('.').next().and_then(|major| major.parse::<u32>().ok());
    if major == Some(SCHEMA_VERSION.major) {
        return Ok(());
    }
    Err(BusError::Version { service: text_of(run, topic), found, expected: SCHEMA_VERSION })
}

/// Type of the elements of a topic of slices, if the topic is there.
pub(super) fn element_of(bus: &Bus, run: &RunName, topic: Topic) -> Result<Option<String>, BusError> {
    let details = Ipc::details(&service_name(run, topic)?, bus.config(), MessagingPattern::PublishSubscribe);
    let types = |details: &ServiceDetails<Ipc>| {
        details.static_details.publish_subscribe().message_type_details().payload.type_name().to_string()
    };
    // one that is being made is there later
    Ok(details.ok().flatten().as_ref().map(types))
}

impl BusError {
    pub(super) fn service(service: &str, doing: &'static str, cause: &dyn Debug) -> Self {
        Self::Service { service: service.to_owned(), doing, cause: format!("{cause:?}") }
    }
}

/// Limits of a `/state` or results service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Limits {
    pub(super) subscribers: usize,
    pub(super) buffer: usize,
}

/// Opens or creates a topic of slices that never overflows: the publisher's handler decides whom a send waits for.
pub(super) fn slices<T: Debug + ZeroCopySend>(
    node: &Node<Ipc>,
    run: &RunName,
    topic: Topic,
    limits: Limits,
    more: &[(&str, String)],
) -> Result<SliceService<T>, BusError> {
    let (text, name, attributes) = (text_of(run, topic), service_name(run, topic)?, attributes(more)?);
    let builder = || node.service_builder(&name).publish_subscribe::<[T]>().user_header::<StateHeader>();
    let create = || {
        builder()
            .enable_safe_overflow(false)
            .history_size(0)
            .max_publishers(1)
            .max_subscribers(limits.subscribers)
            .subscriber_max_buffer_size(limits.buffer)
            .subscriber_max_borrowed_samples(BORROWED)
            .max_nodes(MAX_NODES)
            .create_with_attributes(&attributes)
    };
    let wanted = Wanted { node, text: &text, name: &name, pattern: MessagingPattern::PublishSubscribe };
    Ok(wanted.open_or_create(|| builder().enable_safe_overflow(false).open(), create)?.0)
}

/// Opens a topic of slices, if it is there.
pub(super) fn find_slices<T: Debug + ZeroCopySend>(
    node: &Node<Ipc>,
    run: &RunName,
    topic: Topic,
) -> Result<Option<SliceService<T>>, BusError> {
    let name = service_name(run, topic)?;
    let builder = || node.service_builder(&name).publish_subscribe::<[T]>().user_header::<StateHeader>();
    open(&text_of(run, topic), || builder().enable_safe_overflow(false).open())
}

/// Opens or creates `/chain`: one sample, kept as history for consumers that come later.
pub(super) fn chain(node: &Node<Ipc>, run: &RunName) -> Result<StateService, BusError> {
    let (text, name, attributes) =
        (text_of(run, Topic::Chain), service_name(run, Topic::Chain)?, attributes(&[])?);
    let builder = || node.service_builder(&name).publish_subscribe::<[f64]>().user_header::<StateHeader>();
    let create = || {
        builder()
            .enable_safe_overflow(true)
            .history_size(1)
            .max_publishers(1)
            .max_subscribers(MAX_SUBSCRIBERS)
            .subscriber_max_buffer_size(1)
            .subscriber_max_borrowed_samples(1)
            .max_nodes(MAX_NODES)
            .create_with_attributes(&attributes)
    };
    let wanted = Wanted { node, text: &text, name: &name, pattern: MessagingPattern::PublishSubscribe };
    Ok(wanted.open_or_create(|| builder().open(), create)?.0)
}

/// Opens or creates the event service that goes with `topic`.
pub(super) fn events(node: &Node<Ipc>, run: &RunName, topic: Topic) -> Result<EventService, BusError> {
    event_service(node, &text_of(run, topic))
}

/// Opens or creates the event service by which publishers of results announce themselves.
pub(super) fn announcements(node: &Node<Ipc>, run: &RunName) -> Result<EventService, BusError> {
    event_service(node, &format!("beadline/{run}/own"))
}

fn event_service(node: &Node<Ipc>, text: &str) -> Result<EventService, BusError> {
    let name = ServiceName::new(text).map_err(|e| BusError::service(text, "name", &e))?;
    let attributes = attributes(&[])?;
    let create = || {
        let builder = node.service_builder(&name).event();
        builder
            .max_listeners(2 * MAX_SUBSCRIBERS)
            .max_notifiers(2 * MAX_SUBSCRIBERS)
            .max_nodes(MAX_NODES)
            .create_with_attributes(&attributes)
    };
    let wanted = Wanted { node, text, name: &name, pattern: MessagingPattern::Event };
    Ok(wanted.open_or_create(|| node.service_builder(&name).event().open(), create)?.0)
}

/// Opens or creates `/join`.
pub(super) fn join(node: &Node<Ipc>, run: &RunName) -> Result<JoinService, BusError> {
    let (text, name, attributes) =
        (text_of(run, Topic::Join), service_name(run, Topic::Join)?, attributes(&[])?);
    let builder = || node.service_builder(&name).request_response::<JoinRequest, JoinAnswer>();
    let create = || {
        builder()
            .max_servers(1)
            .max_clients(MAX_SUBSCRIBERS)
            .max_active_requests_per_client(2)
            .max_nodes(MAX_NODES)
            .create_with_attributes(&attributes)
    };
    let wanted = Wanted { node, text: &text, name: &name, pattern: MessagingPattern::RequestResponse };
    Ok(wanted.open_or_create(|| builder().open(), create)?.0)
}

/// Opens `/join`, if it is there.
pub(super) fn find_join(node: &Node<Ipc>, run: &RunName) -> Result<Option<JoinService>, BusError> {
    let name = service_name(run, Topic::Join)?;
    let builder = || node.service_builder(&name).request_response::<JoinRequest, JoinAnswer>();
    open(&text_of(run, Topic::Join), || builder().open())
}

/// Limits of a service.
pub(super) fn limits_of<T: Debug + ZeroCopySend>(service: &SliceService<T>) -> Limits {
    let config = service.static_config();
    Limits { subscribers: config.max_subscribers(), buffer: config.subscriber_max_buffer_size() }
}
