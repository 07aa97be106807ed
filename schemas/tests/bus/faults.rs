//! Processes that are killed, stuck or interrupted. Each test also runs without its remedy.

use crate::child::Child;
use crate::support::{
    Got, TestBus, attach, attach_to, drain, manifest, publish, publish_one, publisher, wait_until,
};
use schemas::bus::{
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
    // it gets what was in its queue, and then hears why there is no more
    let got = drain(&mut stuck);
    assert_eq!((got.first, got.missed, got.end), (Some(0), 0, EndReason::Dropped));
    assert!(got.frames >= 2 && got.frames < FRAMES);
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

/// Sends SIGUSR1 to the thread `pid/task/tid` if it sleeps: the publish there is then interrupted. `None`:
/// the thread has ended.
#[expect(unsafe_code, reason = "only libc can signal one thread")]
fn signal_if_asleep(pid: u32, thread: &str) -> Option<bool> {
    let stat = std::fs::read_to_string(format!("/proc/{thread}/stat")).ok()?;
    let (_, tid) = thread.rsplit_once('/').unwrap();
    let asleep = stat.rsplit_once(") ").unwrap().1.starts_with('S');
    if asleep {
        let tid: libc::pid_t = tid.parse().unwrap();
        // SAFETY: takes and returns numbers.
        unsafe { libc::syscall(libc::SYS_tgkill, libc::pid_t::try_from(pid).unwrap(), tid, libc::SIGUSR1) };
    }
    Some(asleep)
}

/// A producer waits for a stuck consumer while signals rain on it; returns how it ended.
fn rain_signals(resend: &str) -> (String, Got) {
    let test = TestBus::new();
    let settings = [("BL_WAIT", "1"), ("BL_FRAMES", "200"), ("BL_PAUSE", "0"), ("BL_RESEND", resend)];
    let child = Child::start(&test.bus, "produce", "rain", &settings);
    let mut source = attach(&test.bus, "rain", Delivery::Lossless);
    let thread = child.expect("thread");
    let mut hits = 0;
    wait_until(|| {
        let hit = signal_if_asleep(child.id(), &thread);
        hits += u32::from(hit == Some(true));
        hits == 30 || hit.is_none()
    });
    let got = drain(&mut source);
    let word = if resend == "1" { "resent" } else { "error" };
    (child.expect(word), got)
}

#[test]
fn a_signal_in_the_middle_of_a_publish_loses_no_frame() {
    let (resent, got) = rain_signals("1");
    assert_eq!(got, Got { first: Some(0), frames: 200, missed: 0, end: EndReason::Complete });
    assert_ne!(resent, "0", "no signal hit a publish");
    let (error, got) = rain_signals("0");
    assert!(error.contains("InternalError"), "{error}");
    assert_eq!(got.end, EndReason::Failed);
}

/// A consumer waits for a wake-up while the producer waits for room in its queue.
#[test]
fn a_full_queue_wakes_its_consumer() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "wake", BEADS, &PublishOptions::default());
    let mut source = attach_to(&test.bus, &mut run, "wake", Delivery::Lossless);
    std::thread::scope(|scope| {
        let reading = scope.spawn(|| drain(&mut source));
        publish(&mut run, BEADS, 0..FRAMES);
        run.finish(EndReason::Complete).unwrap();
        assert_eq!(reading.join().unwrap().frames, FRAMES);
    });
}

/// The chain is history, which arrives only when its publisher updates its connections.
#[test]
fn the_chain_arrives_because_the_handshake_updates_connections() {
    let test = TestBus::new();
    let remedies = Remedies { connect_on_join: false, ..Remedies::default() };
    let mut run = publisher(&test.bus, "deaf", BEADS, &PublishOptions { remedies, ..Default::default() });
    let options = AttachOptions { timeout: Some(Duration::from_millis(1)), ..AttachOptions::default() };
    std::thread::scope(|scope| {
        let name = "deaf".parse().unwrap();
        let attaching = scope.spawn(move || {
            LiveSource::attach(&test.bus, Some(&name), Delivery::Lossless, &options).map(|_| ())
        });
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
