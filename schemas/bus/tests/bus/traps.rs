//! Traps of the transport itself, shown with nothing but iceoryx2: what happens without our remedy, and
//! with it. If a later release closes a trap, its test fails and the remedy can go.

use crate::child::{Child, caught_signals};
use crate::foreign::{node, service, subscriber};
use crate::support::{TestBus, attach_to, drain, publish, publisher};
use bus::{Bus, Delivery, FLAG_LAST, PublishOptions};
use iceoryx2::port::BackpressureAction;
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::{
    AllocationStrategy, EventId, NodeBuilder, PortFactory as _, WaitSetBuilder,
    ipc_threadsafe::Service as Ipc,
};
use schemas::frame::{EndReason, FrameSource as _, Received};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Frames that arrive when a publisher of `allocation` grows from 1 to 100 values and is then dropped.
fn arrive(test: &TestBus, name: &str, allocation: AllocationStrategy, first_length: usize) -> usize {
    let node = node(&test.bus);
    let service = node.service_builder(&service(name)).publish_subscribe::<[f64]>();
    let service = service.enable_safe_overflow(false).subscriber_max_buffer_size(8).create().unwrap();
    let subscriber = service.subscriber_builder().create().unwrap();
    let publisher = service
        .publisher_builder()
        .initial_max_slice_len(first_length)
        .allocation_strategy(allocation)
        .create()
        .unwrap();
    assert!(subscriber.receive().unwrap().is_none());
    for length in [1, 10, 100] {
        publisher.loan_slice(length).unwrap().send().unwrap();
    }
    drop(publisher);
    std::iter::from_fn(|| subscriber.receive().unwrap()).count()
}

#[test]
fn slices_that_grow_are_lost_with_their_publisher_and_static_ones_are_not() {
    let test = TestBus::new();
    assert!(arrive(&test, "grow", AllocationStrategy::PowerOfTwo, 1) < 3);
    assert_eq!(arrive(&test, "static", AllocationStrategy::Static, 100), 3);
}

/// How many of 50 samples a lossless publisher believes it had to wait for, and how many arrive.
fn half_open(test: &TestBus, name: &str, connect: bool) -> (u64, usize) {
    let node = node(&test.bus);
    let service = node.service_builder(&service(name)).publish_subscribe::<u64>();
    let service = service.enable_safe_overflow(false).subscriber_max_buffer_size(8).create().unwrap();
    let subscriber = service.subscriber_builder().create().unwrap();
    let held = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&held);
    let publisher = service.publisher_builder().set_backpressure_handler(move |_| {
        counted.fetch_add(1, Ordering::Relaxed);
        BackpressureAction::DiscardData
    });
    let publisher = publisher.create().unwrap();
    if connect {
        publisher.update_connections().unwrap();
        assert!(subscriber.receive().unwrap().is_none());
    }
    for n in 0..50 {
        publisher.send_copy(n).unwrap();
    }
    (held.load(Ordering::Relaxed), std::iter::from_fn(|| subscriber.receive().unwrap()).count())
}

#[test]
fn a_half_open_connection_loses_in_silence_and_a_handshake_closes_it() {
    let test = TestBus::new();
    assert_eq!(half_open(&test, "half", false), (0, 8), "42 lost, and the publisher was never asked");
    assert_eq!(half_open(&test, "whole", true), (42, 8), "asked about each that has no room");
}

#[test]
fn a_service_overflows_by_default_and_ours_do_not() {
    let test = TestBus::new();
    let raw = node(&test.bus);
    let default = raw.service_builder(&service("default")).publish_subscribe::<u64>().create().unwrap();
    let reader = default.subscriber_builder().create().unwrap();
    let writer = default.publisher_builder().create().unwrap();
    for n in 0..10 {
        writer.send_copy(n).unwrap();
    }
    let seen: Vec<u64> = std::iter::from_fn(|| reader.receive().unwrap()).map(|sample| *sample).collect();
    assert_eq!(seen, [8, 9], "a queue of 2, and the oldest are overwritten");

    let _run = publisher(&test.bus, "ours", 10, &PublishOptions::default());
    let ours = raw.service_builder(&service("beadline/ours/state")).publish_subscribe::<[f64]>();
    let ours = ours.user_header::<bus::StateHeader>().enable_safe_overflow(false).open().unwrap();
    let config = ours.static_config();
    assert!(!config.has_safe_overflow() && config.subscriber_max_buffer_size() == 64);
}

/// How many stale frames a `latest` consumer reads before it sees the present again.
#[test]
fn a_latest_consumer_with_a_long_queue_looks_far_into_the_past() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "past", 10, &PublishOptions::default());
    let raw = node(&test.bus);
    let long = subscriber(&raw, "past", "latest.long", None);
    let mut short = attach_to(&test.bus, &mut run, "past", Delivery::Latest);
    publish(&mut run, 10, 0..1000);
    let (mut stale_short, mut next) = (0, 1000);
    while matches!(short.receive().unwrap(), Received::Frame(frame) if frame.frame < 999) {
        stale_short += 1;
        // the run goes on, and offers frames again to whom had no room
        publish(&mut run, 10, next..next + 40);
        next += 40;
    }
    let stale_long = std::iter::from_fn(|| long.receive().unwrap()).count();
    assert_eq!((stale_short, stale_long), (2, 64));
}

#[test]
fn the_last_frames_flag_may_never_arrive_and_the_end_does() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "flag", 10, &PublishOptions::default());
    let raw = subscriber(&node(&test.bus), "flag", "latest.raw", Some(2));
    let mut ours = attach_to(&test.bus, &mut run, "flag", Delivery::Latest);
    publish(&mut run, 10, 0..10);
    run.finish(EndReason::Complete).unwrap();
    let frames: Vec<_> = std::iter::from_fn(|| raw.receive().unwrap())
        .map(|sample| (sample.user_header().frame, sample.user_header().flags & FLAG_LAST))
        .collect();
    assert_eq!(frames, [(0, 0), (1, 0)], "neither the last frame nor its flag");
    let got = drain(&mut ours);
    assert_eq!((got.frames, got.missed, got.end), (2, 8, EndReason::Complete));
}

#[test]
fn notifications_carry_no_identity_so_consumers_are_counted_by_requests() {
    let test = TestBus::new();
    let events = node(&test.bus).service_builder(&service("ready")).event().create().unwrap();
    let listener = events.listener_builder().create().unwrap();
    let notifiers = [(); 3].map(|()| events.notifier_builder().create().unwrap());
    for notifier in &notifiers {
        notifier.notify_with_custom_event_id(EventId::new(1)).unwrap();
    }
    let mut heard = 0;
    listener.try_wait(|_| heard += 1).unwrap();
    assert_eq!(heard, 1, "three said they are ready, one was heard");

    let mut run = publisher(&test.bus, "count", 10, &PublishOptions::default());
    let _consumers = [(); 3].map(|()| attach_to(&test.bus, &mut run, "count", Delivery::Lossless));
    assert_eq!(run.counts().lossless, 3);
}

#[test]
fn two_publishers_of_one_service_are_normal_elsewhere() {
    let test = TestBus::new();
    let raw = node(&test.bus);
    let default = raw.service_builder(&service("default")).publish_subscribe::<u64>().create().unwrap();
    let first = default.publisher_builder().create().unwrap();
    let second = default.publisher_builder().create().unwrap();
    let reader = default.subscriber_builder().create().unwrap();
    first.send_copy(1).unwrap();
    second.send_copy(2).unwrap();
    assert_eq!(std::iter::from_fn(|| reader.receive().unwrap()).count(), 2, "a mixture");
}

/// The role of a child: one wait with iceoryx2's defaults.
pub(crate) fn wait_with_default_signals(bus: &Bus) {
    let before = caught_signals();
    let config = node(bus).config().clone();
    let node = NodeBuilder::new().config(&config).create::<Ipc>().unwrap();
    let events = node.service_builder(&service("signals")).event().open_or_create().unwrap();
    let listener = events.listener_builder().create().unwrap();
    let waiting = WaitSetBuilder::new().create::<Ipc>().unwrap();
    let _guard = waiting.attach_notification(&listener).unwrap();
    let wait = waiting.wait_and_process_once_with_timeout(
        |_| iceoryx2::prelude::CallbackProgression::Continue,
        Duration::from_millis(1),
    );
    wait.unwrap();
    println!("@same {}", before == caught_signals());
}

#[test]
fn waiting_takes_over_signals_by_default_and_ours_does_not() {
    let test = TestBus::new();
    let same = |role| {
        let mut child = Child::start(&test.bus, role, "signals", &[]);
        let said = child.expect("same");
        child.wait();
        said
    };
    assert_eq!(same("signals-default"), "false");
    assert_eq!(same("signals-bus"), "true");
}
