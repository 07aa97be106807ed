//! Frames reach those who asked for them.

use crate::support::{Got, TestBus, attach, attach_to, drain, publish, publisher};
use schemas::bus::{Delivery, PublishOptions, RunState, WaitOutcome, list_runs};
use schemas::frame::{EndReason, FrameSource as _};
use std::sync::atomic::AtomicBool;

const BEADS: u64 = 100;

#[test]
fn a_lossless_consumer_gets_every_frame_and_the_chain() {
    let test = TestBus::new();
    let mut producer = publisher(&test.bus, "all", BEADS, &PublishOptions::default());
    let got = std::thread::scope(|scope| {
        let consumer = scope.spawn(|| {
            let mut source = attach(&test.bus, "all", Delivery::Lossless);
            assert_eq!(*source.chain(), source.manifest().physics.chain());
            drain(&mut source)
        });
        let stop = AtomicBool::new(false);
        assert_eq!(producer.wait_for(1, &stop, None).unwrap(), WaitOutcome::Ready);
        publish(&mut producer, BEADS, 0..5000);
        producer.finish(EndReason::Complete).unwrap();
        consumer.join().unwrap()
    });
    assert_eq!(got, Got { first: Some(0), frames: 5000, missed: 0, end: EndReason::Complete });
}

#[test]
fn a_consumer_that_comes_late_knows_its_first_frame() {
    let test = TestBus::new();
    let mut producer = publisher(&test.bus, "late", BEADS, &PublishOptions::default());
    publish(&mut producer, BEADS, 0..300);
    let mut source = attach_to(&test.bus, &mut producer, "late", Delivery::Lossless);
    assert_eq!(source.first_frame(), 300);
    publish(&mut producer, BEADS, 300..350);
    let runs = list_runs(&test.bus).unwrap();
    assert_eq!((runs.len(), runs[0].state, runs[0].lossless), (1, RunState::Running, 0));
    producer.finish(EndReason::Interrupted).unwrap();
    let got = drain(&mut source);
    assert_eq!(got, Got { first: Some(300), frames: 50, missed: 0, end: EndReason::Interrupted });
}
