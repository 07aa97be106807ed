//! Frames reach those who asked for them.

use crate::support::{Got, TestBus, attach, attach_to, drain, publish, publisher, run_name, wait_until};
use bus::{
    AttachError, AttachOptions, ConsumerEvent, Delivery, LiveSource, PublishError, PublishOptions, RunState,
    WaitOutcome, list_runs,
};
use schemas::frame::{Active, EndReason, Frame, FrameSink as _, FrameSource as _, Received};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const BEADS: u64 = 100;

fn got(first: u64, frames: u64, end: EndReason) -> Got {
    Got { first: Some(first), frames, missed: 0, end }
}

#[test]
fn a_lossless_consumer_gets_every_frame_and_the_chain() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "all", BEADS, &PublishOptions::default());
    let received = std::thread::scope(|scope| {
        let consumer = scope.spawn(|| {
            let mut source = attach(&test.bus, "all", Delivery::Lossless);
            assert_eq!(*source.chain(), source.manifest().physics.chain());
            drain(&mut source)
        });
        assert_eq!(run.wait_for(1, &AtomicBool::new(false), None).unwrap(), WaitOutcome::Ready);
        publish(&mut run, BEADS, 0..5000);
        run.finish(EndReason::Complete).unwrap();
        consumer.join().unwrap()
    });
    assert_eq!(received, got(0, 5000, EndReason::Complete));
}

/// Frames that say which beads move are whole, whatever their slots had before.
#[test]
fn a_frame_of_few_beads_is_whole() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "window", BEADS, &PublishOptions::default());
    let count = usize::try_from(BEADS).unwrap();
    let states: Vec<_> = (0..1000_usize)
        .map(|frame| {
            let (first, length) = ((frame * 7) % count, (frame * 13) % count);
            let active = Active { first, end: (first + length).min(count) };
            let value = |bead: usize| {
                if (active.first..active.end).contains(&bead) { (frame + bead) as f64 } else { 0.0 }
            };
            let values: Vec<f64> = (0..count).map(value).collect();
            (values, (frame % 9 != 8).then_some(active))
        })
        .collect();
    std::thread::scope(|scope| {
        let consumer = scope.spawn(|| {
            let mut source = attach(&test.bus, "window", Delivery::Lossless);
            for (values, active) in &states {
                let Received::Frame(frame) = source.receive().unwrap() else { panic!("a frame is missing") };
                assert!(frame.u_m == values && frame.v_m_s == values, "{active:?}");
                // an empty window at the first bead is not told from none
                assert!(frame.active == *active || *active == Some(Active::all(0)), "{active:?}");
            }
        });
        assert_eq!(run.wait_for(1, &AtomicBool::new(false), None).unwrap(), WaitOutcome::Ready);
        for (number, (values, active)) in states.iter().enumerate() {
            let (frame, time_s) = (number as u64, number as f64);
            let state =
                Frame { frame, step: frame, time_s, u_m: values, v_m_s: values, extra: &[], active: *active };
            run.accept(&state).unwrap();
        }
        run.finish(EndReason::Complete).unwrap();
        consumer.join().unwrap();
    });
}

#[test]
fn a_consumer_that_comes_late_knows_its_first_frame() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "late", BEADS, &PublishOptions::default());
    publish(&mut run, BEADS, 0..300);
    let mut source = attach_to(&test.bus, &mut run, "late", Delivery::Lossless);
    assert_eq!(source.first_frame(), 300);
    publish(&mut run, BEADS, 300..350);
    assert!(
        matches!(&run.take_events()[..], [ConsumerEvent::Joined { name }] if name.starts_with("lossless.test."))
    );
    run.finish(EndReason::Interrupted).unwrap();
    assert_eq!(drain(&mut source), got(300, 50, EndReason::Interrupted));
    // after the end it only repeats the end
    assert_eq!(source.receive().unwrap(), Received::End(EndReason::Interrupted));
}

/// Consumers come and go while frames stream past: none of the guaranteed frames is missing.
#[test]
fn joining_in_mid_run_loses_no_guaranteed_frame() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "busy", BEADS, &PublishOptions::default());
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let joining = scope.spawn(|| {
            for _ in 0..10 {
                let mut source = attach(&test.bus, "busy", Delivery::Lossless);
                let first = source.first_frame();
                for frame in first..first + 100 {
                    let received = source.receive().unwrap();
                    assert!(matches!(received, Received::Frame(f) if f.frame == frame), "{received:?}");
                }
            }
            over.store(true, Ordering::Relaxed);
        });
        let mut frame = 0;
        wait_until(|| {
            publish(&mut run, BEADS, frame..frame + 10);
            frame += 10;
            over.load(Ordering::Relaxed) || joining.is_finished()
        });
        joining.join().unwrap();
    });
    assert_eq!(run.counts().evicted, 0);
}

#[test]
fn a_stalled_latest_consumer_slows_nobody_and_knows_what_it_missed() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "mixed", BEADS, &PublishOptions::default());
    let mut stalled = attach_to(&test.bus, &mut run, "mixed", Delivery::Latest);
    let mut lossless = attach_to(&test.bus, &mut run, "mixed", Delivery::Lossless);
    assert_eq!((run.counts().lossless, run.counts().latest), (1, 1));
    let received = std::thread::scope(|scope| {
        let reading = scope.spawn(|| drain(&mut lossless));
        publish(&mut run, BEADS, 0..3000);
        run.finish(EndReason::Complete).unwrap();
        reading.join().unwrap()
    });
    assert_eq!(received, got(0, 3000, EndReason::Complete));
    let seen = drain(&mut stalled);
    assert_eq!(seen, Got { first: Some(0), frames: 2, missed: 2998, end: EndReason::Complete });
    assert_eq!(stalled.missed_count(), 2998);
}

#[test]
fn a_producer_waits_for_as_many_lossless_consumers_as_it_is_told() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "wait", BEADS, &PublishOptions::default());
    let go = AtomicBool::new(false);
    let soon = Some(Duration::from_millis(1));
    assert_eq!(run.wait_for(1, &go, soon).unwrap(), WaitOutcome::TimedOut { ready: 0 });
    assert_eq!(list_runs(&test.bus).unwrap()[0].state, RunState::Waiting);
    // one that takes what there is does not count
    let _latest = attach_to(&test.bus, &mut run, "wait", Delivery::Latest);
    let first = attach_to(&test.bus, &mut run, "wait", Delivery::Lossless);
    assert_eq!(run.wait_for(1, &go, None).unwrap(), WaitOutcome::Ready);
    let _second = attach_to(&test.bus, &mut run, "wait", Delivery::Lossless);
    assert_eq!(run.wait_for(2, &go, None).unwrap(), WaitOutcome::Ready);
    // one that has left does not count any more
    drop(first);
    assert_eq!(run.wait_for(2, &go, soon).unwrap(), WaitOutcome::TimedOut { ready: 1 });
    assert_eq!(run.wait_for(2, &AtomicBool::new(true), None).unwrap(), WaitOutcome::Stopped);
}

#[test]
fn waiting_for_more_consumers_than_can_attach_is_refused() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "crowd", BEADS, &PublishOptions::default());
    let (most, go) = (run.max_consumers(), AtomicBool::new(false));
    let error = run.wait_for(most + 1, &go, None).unwrap_err();
    assert!(
        matches!(error, PublishError::TooManyConsumers { asked, most: 16 } if asked == most + 1),
        "{error}"
    );
    let consumers: Vec<_> =
        (0..most).map(|_| attach_to(&test.bus, &mut run, "crowd", Delivery::Lossless)).collect();
    assert_eq!(run.wait_for(most, &go, None).unwrap(), WaitOutcome::Ready, "so many can");
    let name = run_name("crowd");
    let another = LiveSource::attach(&test.bus, Some(&name), Delivery::Lossless, &AttachOptions::default());
    assert!(matches!(another, Err(AttachError::Full { .. })));
    drop(consumers);
}

#[test]
fn a_million_beads_fit() {
    const MANY: u64 = 1_000_000;
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "big", MANY, &PublishOptions::default());
    let mut source = attach_to(&test.bus, &mut run, "big", Delivery::Lossless);
    let received = std::thread::scope(|scope| {
        let reading = scope.spawn(|| drain(&mut source));
        publish(&mut run, MANY, 0..5);
        run.finish(EndReason::Complete).unwrap();
        reading.join().unwrap()
    });
    assert_eq!(received, got(0, 5, EndReason::Complete));
}

#[test]
fn runs_are_listed_with_their_consumers() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "listed", BEADS, &PublishOptions::default());
    let _other = publisher(&test.bus, "another", BEADS, &PublishOptions::default());
    let _source = attach_to(&test.bus, &mut run, "listed", Delivery::Lossless);
    publish(&mut run, BEADS, 0..7);
    wait_until(|| {
        run.serve().unwrap();
        let runs = list_runs(&test.bus).unwrap();
        assert_eq!((runs.len(), runs[0].name.as_str(), runs[0].frame), (2, "another", None));
        let listed = &runs[1];
        assert_eq!((listed.state, listed.pid), (RunState::Running, u64::from(std::process::id())));
        listed.frame == Some(6) && listed.lossless == 1
    });
    run.finish(EndReason::Complete).unwrap();
    // as long as somebody is still reading
    assert_eq!(list_runs(&test.bus).unwrap()[1].state, RunState::Done);
}
