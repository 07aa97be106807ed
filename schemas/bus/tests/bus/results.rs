//! Results of analyses, row by row.

use crate::child::Child;
use crate::support::{TestBus, run_name, wait_until};
use bus::{
    Delivery, OwnTopicsWatch, ResultElement, ResultPublisher, ResultReceived, ResultSubscriber, ResultWatch,
    ResultsError, StreamId,
};
use schemas::frame::EndReason;
use schemas::manifest::RunId;
use schemas::results::{ResultColumns, Topic};
use std::sync::Arc;
use std::time::Duration;

fn columns(width: usize, names: &str) -> ResultColumns {
    ResultColumns { width, names: names.into(), tolerance_m: None }
}

fn create<T: ResultElement>(test: &TestBus, topic: Topic, columns: &ResultColumns) -> ResultPublisher<T> {
    let stream = StreamId::new(RunId([1; 16]));
    ResultPublisher::create(&test.bus, &run_name("run"), topic, stream, columns, Arc::default()).unwrap()
}

fn attach<T: ResultElement>(test: &TestBus, topic: Topic, delivery: Delivery) -> Option<ResultSubscriber<T>> {
    ResultSubscriber::attach(&test.bus, &run_name("run"), topic, delivery, Arc::default()).unwrap()
}

/// Frames of the rows, frames missed, and the end. Each frame between the first and the last is a row or missed.
fn read<T: ResultElement>(rows: &mut ResultSubscriber<T>) -> (Vec<u64>, u64, EndReason) {
    read_from(None, rows)
}

/// The same after rows up to the frame before `next`.
fn read_from<T: ResultElement>(
    mut next: Option<u64>,
    rows: &mut ResultSubscriber<T>,
) -> (Vec<u64>, u64, EndReason) {
    let (mut frames, mut missed) = (Vec::new(), 0);
    loop {
        match rows.receive().unwrap() {
            ResultReceived::Row(row) => {
                assert_eq!(row.frame, next.unwrap_or(row.frame));
                next = Some(row.frame + 1);
                frames.push(row.frame);
            }
            ResultReceived::Missed { from, to } => {
                assert_eq!(from, next.unwrap_or(from));
                next = Some(to + 1);
                missed += to - from + 1;
            }
            ResultReceived::End(end) => return (frames, missed, end),
        }
    }
}

#[test]
fn rows_reach_lossless_subscribers_with_their_columns() {
    let test = TestBus::new();
    assert!(attach::<f64>(&test, Topic::Energies, Delivery::Lossless).is_none());
    let mut energies = create::<f64>(&test, Topic::Energies, &columns(3, "kinetic_J,potential_J,total_J"));
    energies.publish(0, 0, 0.0, &[1.0, 2.0, 3.0]).unwrap();
    let mut rows = attach::<f64>(&test, Topic::Energies, Delivery::Lossless).unwrap();
    assert_eq!(*rows.columns(), columns(3, "kinetic_J,potential_J,total_J"));
    std::thread::scope(|scope| {
        let reading = scope.spawn(|| read(&mut rows));
        for frame in 1..1001 {
            energies.publish(frame, frame * 10, frame as f64, &[0.5; 3]).unwrap();
        }
        energies.finish().unwrap();
        let (frames, missed, end) = reading.join().unwrap();
        assert_eq!((frames, missed, end), ((1..1001).collect(), 0, EndReason::Complete));
    });
}

/// A publisher gives those who listen already the time to subscribe.
#[test]
fn who_is_there_before_the_publisher_gets_every_row_from_the_first_on() {
    for _ in 0..5 {
        let test = TestBus::new();
        let watch = ResultWatch::create(&test.bus, &run_name("run"), Topic::Energies).unwrap();
        std::thread::scope(|scope| {
            let reading = scope.spawn(|| {
                let mut rows = loop {
                    match watch.attach::<f64>(Delivery::Lossless, Arc::default()).unwrap() {
                        Some(rows) => break rows,
                        None => watch.wait(Duration::from_secs(1)),
                    }
                };
                read(&mut rows)
            });
            let mut energies = create::<f64>(&test, Topic::Energies, &columns(3, "a_J,b_J,c_J"));
            for frame in 0..2000 {
                energies.publish(frame, frame, 0.0, &[1.0; 3]).unwrap();
            }
            energies.finish().unwrap();
            assert_eq!(reading.join().unwrap(), ((0..2000).collect(), 0, EndReason::Complete));
        });
    }
}

/// Who watches all topics that are not ours gets every row of each, of one publisher after the other.
#[test]
fn topics_of_ones_own_wait_for_those_who_watch_all_of_them() {
    let (test, run, topic) = (TestBus::new(), run_name("run"), Topic::own("mine").unwrap());
    let watch = OwnTopicsWatch::create(&test.bus, &run).unwrap();
    let find = || watch.topics().unwrap().into_iter().find(|found| *found == topic);
    for _ in 0..3 {
        std::thread::scope(|scope| {
            let reading = scope.spawn(|| {
                let mut rows = loop {
                    match find().and_then(|topic| attach::<f64>(&test, topic, Delivery::Lossless)) {
                        Some(rows) => break rows,
                        None => watch.wait(Duration::from_secs(1)),
                    };
                };
                read(&mut rows)
            });
            let mut mine = create::<f64>(&test, topic, &columns(2, "a_m,b_m"));
            for frame in 0..500 {
                mine.publish(frame, frame, 0.0, &[1.0; 2]).unwrap();
            }
            mine.finish().unwrap();
            assert_eq!(reading.join().unwrap(), ((0..500).collect(), 0, EndReason::Complete));
        });
    }
}

/// Who publishes a topic, and then again, waits for who reads the first rows: without that, a reader that was not there in
/// time has not seen the second publisher before it is gone, and its rows are lost.
#[test]
fn a_publisher_that_begins_again_waits_for_who_still_reads() {
    for waits in [false, true] {
        let test = TestBus::new();
        let publish = |frames: std::ops::Range<u64>| {
            let mut energies = create::<f64>(&test, Topic::Energies, &columns(1, "a_J"));
            frames.for_each(|frame| energies.publish(frame, frame, 0.0, &[1.0]).unwrap());
            energies.finish_and_wait(if waits { Duration::MAX } else { Duration::ZERO }).unwrap();
        };
        let mut first = create::<f64>(&test, Topic::Energies, &columns(1, "a_J"));
        let mut rows = attach::<f64>(&test, Topic::Energies, Delivery::Lossless).unwrap();
        first.publish(0, 0, 0.0, &[1.0]).unwrap();
        std::thread::scope(|scope| {
            let publishing = scope.spawn(|| {
                first.finish_and_wait(if waits { Duration::MAX } else { Duration::ZERO }).unwrap();
                publish(1..5);
            });
            if !waits {
                publishing.join().unwrap();
                assert_eq!(read(&mut rows), (vec![0], 0, EndReason::Complete), "the others are lost");
                return;
            }
            assert_eq!(read(&mut rows), (vec![0], 0, EndReason::Complete));
            // subscribed to the second one before its first row
            let watch = ResultWatch::create(&test.bus, &run_name("run"), Topic::Energies).unwrap();
            drop(rows);
            let again = loop {
                match watch.attach::<f64>(Delivery::Lossless, Arc::default()).unwrap() {
                    Some(mut rows) => match read(&mut rows) {
                        (frames, ..) if frames.is_empty() => (),
                        found => break found,
                    },
                    None => watch.wait(Duration::from_secs(1)),
                }
            };
            assert_eq!(again, ((1..5).collect(), 0, EndReason::Complete));
        });
    }
}

/// Who comes too late for the first row is told so.
#[test]
fn a_row_says_whether_its_publisher_had_others_before() {
    let test = TestBus::new();
    let mut energies = create::<f64>(&test, Topic::Energies, &columns(1, "a_J"));
    let mut early = attach::<f64>(&test, Topic::Energies, Delivery::Latest).unwrap();
    energies.publish(4, 4, 0.0, &[1.0]).unwrap();
    let follows = |rows: &mut ResultSubscriber<f64>| match rows.receive().unwrap() {
        ResultReceived::Row(row) => (row.frame, row.follows),
        other => panic!("{other:?}"),
    };
    assert_eq!(follows(&mut early), (4, false));
    drop(early);
    energies.publish(5, 5, 0.0, &[1.0]).unwrap();
    let mut late = attach::<f64>(&test, Topic::Energies, Delivery::Latest).unwrap();
    energies.publish(6, 6, 0.0, &[1.0]).unwrap();
    assert_eq!(follows(&mut late), (6, true));
}

#[test]
fn classes_are_bytes() {
    let test = TestBus::new();
    let mut contacts = create::<u8>(&test, Topic::Contacts, &columns(25, "class"));
    let mut rows = attach::<u8>(&test, Topic::Contacts, Delivery::Lossless).unwrap();
    contacts.publish(7, 70, 0.7, &[2; 25]).unwrap();
    let ResultReceived::Row(row) = rows.receive().unwrap() else { panic!("no row") };
    assert_eq!((row.frame, row.step, row.time_s, row.values), (7, 70, 0.7, &[2; 25][..]));
    assert!(matches!(contacts.publish(8, 80, 0.8, &[0; 24]), Err(ResultsError::Width { .. })));
}

#[test]
fn a_stalled_latest_subscriber_counts_what_it_missed() {
    let test = TestBus::new();
    let mut impurity = create::<f64>(&test, Topic::Impurity, &columns(1, "u_m"));
    let mut stalled = attach::<f64>(&test, Topic::Impurity, Delivery::Latest).unwrap();
    for frame in 0..100 {
        impurity.publish(frame, frame, 0.0, &[0.0]).unwrap();
    }
    std::thread::scope(|scope| {
        let ending = scope.spawn(|| impurity.finish().unwrap());
        assert_eq!(read(&mut stalled), (vec![0, 1], 98, EndReason::Complete));
        ending.join().unwrap();
    });
}

#[test]
fn a_second_publisher_is_told_so_that_it_can_go_on_without() {
    let test = TestBus::new();
    let first = create::<f64>(&test, Topic::Energies, &columns(1, "total_J"));
    let again = || {
        ResultPublisher::<f64>::create(
            &test.bus,
            &run_name("run"),
            Topic::Energies,
            StreamId::new(RunId([2; 16])),
            &columns(1, "total_J"),
            Arc::default(),
        )
    };
    assert!(matches!(again(), Err(ResultsError::AlreadyPublished { topic: Topic::Energies, .. })));
    drop(first);
    assert!(again().is_ok());
}

#[test]
fn subscribers_notice_that_the_publisher_was_killed() {
    let test = TestBus::new();
    let mut child = Child::start(&test.bus, "results", "run", &[]);
    child.expect("created");
    let mut rows = attach::<f64>(&test, Topic::Energies, Delivery::Lossless).unwrap();
    let ResultReceived::Row(first) = rows.receive().unwrap() else { panic!("no row") };
    let next = first.frame + 1;
    child.kill();
    let (frames, missed, end) = read_from(Some(next), &mut rows);
    assert_eq!(end, EndReason::ProducerLost);
    // what was sent before the kill is in the queue, whole and in order
    assert_eq!((frames.first().copied().unwrap_or(next), missed), (next, 0));
    // and the next one can take its place
    wait_until(|| attach::<f64>(&test, Topic::Energies, Delivery::Lossless).is_none());
    create::<f64>(&test, Topic::Energies, &columns(2, "a_J,b_J"));
}

#[test]
fn rows_of_another_width_do_not_reach_subscribers_of_the_old_ones() {
    let test = TestBus::new();
    let first = create::<f64>(&test, Topic::Impurity, &columns(4, "u_m,v_m_s,left_m,right_m"));
    let rows = attach::<f64>(&test, Topic::Impurity, Delivery::Lossless).unwrap();
    drop(first);
    let (run, stream) = (run_name("run"), StreamId::new(RunId([1; 16])));
    let wider = || {
        let columns = columns(8, "two beads");
        ResultPublisher::<f64>::create(&test.bus, &run, Topic::Impurity, stream, &columns, Arc::default())
    };
    assert!(matches!(wider(), Err(ResultsError::OtherColumns { expected: 8, found: 4, .. })));
    drop(rows);
    assert!(wider().is_ok());
}
