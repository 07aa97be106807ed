//! Processes that are killed, stuck or interrupted. Each test also runs without its remedy.

use crate::child::Child;
use crate::support::{
    Got, TestBus, attach, attach_to, drain, manifest, publish, publish_one, publisher, wait_until,
};
use bus::{
    AttachOptions, ConsumerEvent, Delivery, LiveSource, PublishError, PublishOptions, Remedies, RunState,
    StatePublisher, WaitOutcome, list_runs,
};
use schemas::frame::{EndReason, FrameSource as _, Received};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const BEADS: u64 = 50;
const FRAMES: u64 = 500;
const SHORT: Duration = Duration::from_millis(300);

/// A lossless consumer is killed while the producer waits for it; returns what the producer saw.
fn kill_a_lossless_consumer(options: &PublishOptions) -> (u64, Vec<ConsumerEvent>) {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "killed", BEADS, options);
    let mut child = Child::start(&test.bus, "consume", "killed", &[("BL_END", "hang")]);
    run.wait_for(1, &AtomicBool::new(false), None).unwrap();
    child.expect("read");
    std::thread::scope(|scope| {
        let publishing = scope.spawn(|| publish(&mut run, BEADS, 0..FRAMES));
        child.kill();
        publishing.join().unwrap();
    });
    let events = run.take_events();
    (run.finish(EndReason::Complete).unwrap().evicted, events)
}

#[test]
fn a_lossless_consumer_that_is_killed_does_not_stop_the_run() {
    let (evicted, events) = kill_a_lossless_consumer(&PublishOptions::default());
    assert_eq!(evicted, 0);
    assert!(events.iter().any(|event| matches!(event, ConsumerEvent::CleanedUp { dead: 1 })), "{events:?}");
    // without the clean-up only the time-out helps
    let remedies = Remedies { clean_while_blocked: false, ..Remedies::default() };
    let options = PublishOptions { remedies, stuck_after: SHORT, ..PublishOptions::default() };
    assert_eq!(kill_a_lossless_consumer(&options).0, 1);
}

#[test]
fn a_stuck_lossless_consumer_is_dropped_loudly_on_both_sides() {
    let test = TestBus::new();
    let options = PublishOptions { stuck_after: SHORT, ..PublishOptions::default() };
    let mut run = publisher(&test.bus, "stuck", BEADS, &options);
    let mut stuck = attach_to(&test.bus, &mut run, "stuck", Delivery::Lossless);
    publish(&mut run, BEADS, 0..FRAMES);
    let events = run.take_events();
    assert!(
        matches!(&events[..], [ConsumerEvent::Joined { .. }, ConsumerEvent::Evicted { held, .. }] if *held >= SHORT),
        "{events:?}"
    );
    let counts = run.counts();
    assert_eq!((counts.evicted, counts.lossless), (1, 0));
    assert!(counts.held_back >= SHORT);
    run.finish(EndReason::Complete).unwrap();
    // it gets what was in its queue, hears what went by without it, and then why there is no more
    let got = drain(&mut stuck);
    assert_eq!((got.first, got.frames + got.missed, got.end), (Some(0), FRAMES, EndReason::Dropped));
    assert!(got.frames >= 2 && got.frames < FRAMES);
    assert_eq!(stuck.missed_count(), got.missed);
    assert_eq!(stuck.receive().unwrap(), Received::End(EndReason::Dropped), "the end is only repeated");
}

/// It finds a gap when there is room in its queue again; what it missed is known from the status.
#[test]
fn a_dropped_consumer_counts_what_it_missed_while_the_run_goes_on() {
    let test = TestBus::new();
    let options = PublishOptions { stuck_after: SHORT, ..PublishOptions::default() };
    let mut run = publisher(&test.bus, "gap", BEADS, &options);
    let mut stuck = attach_to(&test.bus, &mut run, "gap", Delivery::Lossless);
    publish(&mut run, BEADS, 0..FRAMES);
    let queued = (0..2).filter(|_| matches!(stuck.receive().unwrap(), Received::Frame(_))).count();
    publish(&mut run, BEADS, FRAMES..FRAMES + 100);
    run.serve().unwrap();
    let got = drain(&mut stuck);
    assert_eq!(got.end, EndReason::Dropped);
    assert_eq!(queued as u64 + got.frames + got.missed, FRAMES + 100);
}

#[test]
fn an_eviction_at_the_very_last_frame_is_told_before_the_end() {
    let test = TestBus::new();
    let options = PublishOptions { stuck_after: SHORT, ..PublishOptions::default() };
    let mut run = publisher(&test.bus, "late", BEADS, &options);
    let _stuck = attach_to(&test.bus, &mut run, "late", Delivery::Lossless);
    let mut frame = 0;
    while run.counts().evicted == 0 {
        publish(&mut run, BEADS, frame..frame + 1);
        frame += 1;
    }
    let events = run.take_events();
    assert!(matches!(events.last(), Some(ConsumerEvent::Evicted { .. })), "{events:?}");
    assert_eq!(run.finish(EndReason::Complete).unwrap().evicted, 1);
}

/// Whoever holds frames is still connected when it has left, with a full queue: the producer looks who is there while it waits.
#[test]
fn a_consumer_that_leaves_with_a_frame_in_hand_holds_nobody_back() {
    let test = TestBus::new();
    let options = PublishOptions { stuck_after: Duration::MAX, ..PublishOptions::default() };
    let mut run = publisher(&test.bus, "left", BEADS, &options);
    let mut leaving = attach_to(&test.bus, &mut run, "left", Delivery::Lossless);
    publish(&mut run, BEADS, 0..1);
    assert!(matches!(leaving.receive().unwrap(), Received::Frame(_)));
    let held = leaving.hold().unwrap();
    assert_eq!(held.frame().frame, 0);
    std::thread::scope(|scope| {
        let publishing = scope.spawn(|| publish(&mut run, BEADS, 1..FRAMES));
        // the queue is full, and the producer shows no progress: it waits
        wait_until(|| list_runs(&test.bus).unwrap()[0].frame.is_some_and(|frame| frame >= 15));
        drop(leaving);
        publishing.join().unwrap();
    });
    assert_eq!(run.finish(EndReason::Complete).unwrap().evicted, 0);
    drop(held);
}

/// Without a time-out the run would stand still for as long as the consumer does: a flag ends that.
#[test]
fn a_flag_gets_out_of_a_publish_that_is_held_back() {
    let test = TestBus::new();
    let options = PublishOptions { stuck_after: Duration::MAX, ..PublishOptions::default() };
    let mut run = publisher(&test.bus, "flag", BEADS, &options);
    let mut stuck = attach_to(&test.bus, &mut run, "flag", Delivery::Lossless);
    let (mut published, mut stopped) = (0, None);
    std::thread::scope(|scope| {
        let publishing = scope.spawn(|| {
            while stopped.is_none() {
                match publish_one(&mut run, BEADS, published) {
                    Ok(()) => published += 1,
                    Err(e) => stopped = Some(e),
                }
            }
        });
        // the consumer's queue is full, and the producer shows no progress: it waits
        wait_until(|| list_runs(&test.bus).unwrap()[0].frame.is_some_and(|frame| frame >= 15));
        options.stop.store(true, Ordering::Relaxed);
        publishing.join().unwrap();
    });
    assert!(matches!(stopped, Some(PublishError::Stopped { frame }) if frame == published));
    run.finish(EndReason::Interrupted).unwrap();
    let got = drain(&mut stuck);
    assert_eq!(got, Got { first: Some(0), frames: published, missed: 0, end: EndReason::Interrupted });
}

#[test]
fn a_consumer_that_is_behind_gets_the_rest_after_the_producer_has_exited() {
    let test = TestBus::new();
    let settings = [("BL_WAIT", "1"), ("BL_FRAMES", "60")];
    let mut child = Child::start(&test.bus, "produce", "gone", &settings);
    let mut source = attach(&test.bus, "gone", Delivery::Lossless);
    child.wait();
    // other processes come and clean up meanwhile
    let _other = publisher(&test.bus, "other", BEADS, &PublishOptions::default());
    let got = drain(&mut source);
    assert_eq!(got, Got { first: Some(0), frames: 60, missed: 0, end: EndReason::Complete });
}

#[test]
fn consumers_notice_that_the_producer_was_killed_and_keep_what_was_sent() {
    let test = TestBus::new();
    let settings = [("BL_WAIT", "1"), ("BL_FRAMES", "40"), ("BL_END", "hang")];
    let mut child = Child::start(&test.bus, "produce", "lost", &settings);
    let mut lossless = attach(&test.bus, "lost", Delivery::Lossless);
    child.expect("published");
    assert_eq!(list_runs(&test.bus).unwrap()[0].state, RunState::Running);
    child.kill();
    assert_eq!(list_runs(&test.bus).unwrap()[0].state, RunState::Dead);
    let got = drain(&mut lossless);
    assert_eq!(got, Got { first: Some(0), frames: 40, missed: 0, end: EndReason::ProducerLost });
}

/// What a latest consumer missed at the end is known even when the producer was killed.
#[test]
fn a_latest_consumer_knows_what_it_missed_of_a_killed_producer() {
    let test = TestBus::new();
    let settings = [("BL_WAIT", "1"), ("BL_FRAMES", "40"), ("BL_END", "hang")];
    let mut child = Child::start(&test.bus, "produce", "lost", &settings);
    child.expect("created");
    let mut latest = attach(&test.bus, "lost", Delivery::Latest);
    let _starts_it = attach(&test.bus, "lost", Delivery::Lossless);
    child.expect("published");
    child.kill();
    let got = drain(&mut latest);
    assert_eq!(got, Got { first: Some(0), frames: 2, missed: 38, end: EndReason::ProducerLost });
}

/// A producer is killed while a consumer is attached, and the next one of that name starts.
fn restart(hold_board: &str) -> (TestBus, LiveSource, Result<StatePublisher, PublishError>) {
    let test = TestBus::new();
    let settings = [("BL_WAIT", "1"), ("BL_FRAMES", "40"), ("BL_END", "hang"), ("BL_HOLD_BOARD", hold_board)];
    let mut child = Child::start(&test.bus, "produce", "again", &settings);
    let old = attach(&test.bus, "again", Delivery::Lossless);
    child.expect("published");
    child.kill();
    let next = manifest("again", BEADS);
    let run = StatePublisher::create(&test.bus, &next, &next.physics.chain(), &PublishOptions::default());
    (test, old, run)
}

#[test]
fn a_killed_producers_name_can_be_used_again_while_its_consumers_are_attached() {
    let (test, mut old, run) = restart("0");
    let mut run = run.unwrap();
    let mut new = attach_to(&test.bus, &mut run, "again", Delivery::Lossless);
    assert_ne!(new.stream(), old.stream());
    assert_eq!(new.manifest().provenance.run_id, run.stream().run_id);
    // the old consumer takes nothing, and holds nobody back
    std::thread::scope(|scope| {
        let reading = scope.spawn(|| drain(&mut new));
        publish(&mut run, BEADS, 0..FRAMES);
        run.finish(EndReason::Complete).unwrap();
        let got = reading.join().unwrap();
        assert_eq!(got, Got { first: Some(0), frames: FRAMES, missed: 0, end: EndReason::Complete });
    });
    let got = drain(&mut old);
    assert_eq!(got, Got { first: Some(0), frames: 40, missed: 0, end: EndReason::ProducerLost });
}

#[test]
fn a_blackboard_entry_that_is_held_for_good_cannot_be_taken_over() {
    let (_test, old, run) = restart("1");
    let Err(error) = run else { panic!("taken over") };
    assert!(error.to_string().contains("take over"), "{error}");
    drop(old);
}

/// The old stream's orderly end is known even though a new producer has overwritten the status.
#[test]
fn an_orderly_end_is_remembered_over_a_restart() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "twice", BEADS, &PublishOptions::default());
    let mut old = attach_to(&test.bus, &mut run, "twice", Delivery::Lossless);
    publish(&mut run, BEADS, 0..20);
    run.finish(EndReason::Complete).unwrap();
    let mut run = publisher(&test.bus, "twice", BEADS, &PublishOptions::default());
    publish(&mut run, BEADS, 0..20);
    let got = drain(&mut old);
    assert_eq!(got, Got { first: Some(0), frames: 20, missed: 0, end: EndReason::Complete });
}

/// iceoryx2 gives up a send when a signal ends its sleep; who got the sample already gets it again.
#[test]
fn a_send_that_is_interrupted_is_repeated_and_seen_once() {
    let test = TestBus::new();
    let remedies = Remedies { interruptions: 1, ..Remedies::default() };
    let mut run = publisher(&test.bus, "again", BEADS, &PublishOptions { remedies, ..Default::default() });
    let mut source = attach_to(&test.bus, &mut run, "again", Delivery::Lossless);
    std::thread::scope(|scope| {
        let reading = scope.spawn(|| drain(&mut source));
        publish(&mut run, BEADS, 0..FRAMES);
        assert_eq!(run.finish(EndReason::Complete).unwrap().resent, FRAMES);
        let got = reading.join().unwrap();
        assert_eq!(got, Got { first: Some(0), frames: FRAMES, missed: 0, end: EndReason::Complete });
    });

    let remedies = Remedies { resend: false, ..remedies };
    let mut run = publisher(&test.bus, "once", BEADS, &PublishOptions { remedies, ..Default::default() });
    let _source = attach_to(&test.bus, &mut run, "once", Delivery::Lossless);
    let lost = publish_one(&mut run, BEADS, 0);
    assert!(matches!(lost, Err(PublishError::Send { frame: 0, .. })), "{lost:?}");
}

/// A failure that is none of a wait is not repeated for ever.
#[test]
fn a_send_that_always_fails_is_an_error() {
    let test = TestBus::new();
    let always = Remedies { interruptions: u32::MAX, ..Remedies::default() };
    let options = PublishOptions { remedies: always, ..PublishOptions::default() };
    let mut run = publisher(&test.bus, "never", BEADS, &options);
    let _latest = attach_to(&test.bus, &mut run, "never", Delivery::Latest);
    let failed = publish_one(&mut run, BEADS, 0);
    assert!(matches!(failed, Err(PublishError::Send { frame: 0, .. })), "{failed:?}");
    assert_eq!(run.counts().resent, 100);
    // and not at all once it was asked to stop
    options.stop.store(true, Ordering::Relaxed);
    assert!(publish_one(&mut run, BEADS, 0).is_err());
    assert_eq!(run.counts().resent, 100);
}

/// Sends SIGUSR1 to the thread `pid/task/tid` as it sleeps, and waits until it was taken: one after the other, not all
/// at once.
#[expect(unsafe_code, reason = "only libc can signal one thread")]
fn signal(thread: &str) {
    let status = || std::fs::read_to_string(format!("/proc/{thread}/status")).unwrap();
    wait_until(|| status().contains("State:\tS"));
    let ids: Vec<libc::pid_t> = thread.split('/').filter_map(|id| id.parse().ok()).collect();
    // SAFETY: takes and returns numbers.
    let sent = unsafe { libc::syscall(libc::SYS_tgkill, ids[0], ids[1], libc::SIGUSR1) };
    assert_eq!(sent, 0);
    wait_until(|| status().contains("SigPnd:\t0000000000000000"));
}

/// Signals rain on a producer that waits for a consumer; without its own pauses it soon sleeps in iceoryx2.
#[test]
fn signals_in_the_middle_of_a_publish_lose_no_frame() {
    for pause in ["0", "1"] {
        let test = TestBus::new();
        // on a busy machine ten signals take longer than a stuck consumer is given by default
        let patient = ("BL_STUCK_MS", "60000");
        let settings = [("BL_WAIT", "1"), ("BL_FRAMES", "200"), ("BL_PAUSE", pause), patient];
        let mut child = Child::start(&test.bus, "produce", "rain", &settings);
        let mut source = attach(&test.bus, "rain", Delivery::Lossless);
        let thread = child.expect("thread");
        // without pauses iceoryx2 looks thousands of times before it sleeps
        for _ in 0..10 {
            signal(&thread);
        }
        let got = drain(&mut source);
        assert_eq!(got, Got { first: Some(0), frames: 200, missed: 0, end: EndReason::Complete });
        child.wait();
    }
}

/// Each signal ends a wait and starts another: the time-out counts over all of them.
#[test]
fn signals_do_not_keep_a_stuck_consumer_from_being_dropped() {
    let test = TestBus::new();
    let settings = [
        ("BL_WAIT", "1"),
        ("BL_FRAMES", "200"),
        ("BL_PAUSE", "0"),
        ("BL_STUCK_MS", "300"),
        ("BL_END", "hang"),
    ];
    let mut child = Child::start(&test.bus, "produce", "storm", &settings);
    let mut stuck = attach(&test.bus, "storm", Delivery::Lossless);
    let thread = child.expect("thread");
    wait_until(|| {
        signal(&thread);
        child.said("published")
    });
    child.kill();
    assert!(drain(&mut stuck).frames < 200);
}

/// The chain is history, which arrives only when its publisher updates its connections.
#[test]
fn the_chain_arrives_because_the_handshake_updates_connections() {
    let test = TestBus::new();
    let remedies = Remedies { connect_on_join: false, ..Remedies::default() };
    let mut run = publisher(&test.bus, "deaf", BEADS, &PublishOptions { remedies, ..Default::default() });
    let options = AttachOptions { timeout: Some(Duration::from_millis(1)), ..AttachOptions::default() };
    std::thread::scope(|scope| {
        let (bus, name) = (&test.bus, "deaf".parse().unwrap());
        let attaching = scope
            .spawn(move || LiveSource::attach(bus, Some(&name), Delivery::Lossless, &options).map(|_| ()));
        wait_until(|| {
            run.serve().unwrap();
            attaching.is_finished()
        });
        assert!(attaching.join().unwrap().is_err(), "the chain came by itself");
    });
}

#[test]
fn a_process_that_dies_while_attached_leaves_nothing_behind() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "crowd", BEADS, &PublishOptions::default());
    for _ in 0..3 {
        let mut child = Child::start(&test.bus, "consume", "crowd", &[("BL_END", "hang")]);
        wait_until(|| {
            run.serve().unwrap();
            child.said("read")
        });
        child.kill();
    }
    // waiting cleans up
    let soon = Some(Duration::from_millis(1));
    wait_until(|| {
        let outcome = run.wait_for(1, &AtomicBool::new(false), soon).unwrap();
        outcome == WaitOutcome::TimedOut { ready: 0 }
    });
    let mut source = attach_to(&test.bus, &mut run, "crowd", Delivery::Lossless);
    publish(&mut run, BEADS, 0..1);
    assert!(matches!(source.receive().unwrap(), Received::Frame(_)));
}
