//! Results of analyses, row by row.

use crate::child::Child;
use crate::foreign;
use crate::support::{TestBus, run_name, wait_until};
use bus::{
    Delivery, ResultElement, ResultPublisher, ResultReceived, ResultSubscriber, ResultsError, ResultsWatch,
    StreamId,
};
use schemas::frame::EndReason;
use schemas::manifest::RunId;
use schemas::results::{ResultColumns, RowValues, Topic};
use std::sync::Arc;
use std::time::Duration;

fn columns(width: usize, names: &str) -> ResultColumns {
    ResultColumns { width, names: names.into(), tolerance_m: None }
}

fn topic(name: &str) -> Topic {
    name.strip_prefix("own/").map_or_else(|| Topic::results(name), Topic::own).unwrap()
}

fn create<T: ResultElement>(test: &TestBus, name: &str, columns: &ResultColumns) -> ResultPublisher<T> {
    let stream = StreamId::new(RunId([1; 16]));
    ResultPublisher::create(&test.bus, &run_name("run"), topic(name), stream, columns, Arc::default())
        .unwrap()
}

fn attach(test: &TestBus, name: &str, delivery: Delivery) -> Option<ResultSubscriber> {
    ResultSubscriber::attach(&test.bus, &run_name("run"), topic(name), delivery, Arc::default()).unwrap()
}

/// Frames of the rows, frames missed, and the end. Each frame between the first and the last is a row or missed.
fn read(rows: &mut ResultSubscriber) -> (Vec<u64>, u64, EndReason) {
    read_from(None, rows)
}

/// The same after rows up to the frame before `next`.
fn read_from(mut next: Option<u64>, rows: &mut ResultSubscriber) -> (Vec<u64>, u64, EndReason) {
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
    assert!(attach(&test, "energies", Delivery::Lossless).is_none());
    let mut energies = create::<f64>(&test, "energies", &columns(3, "kinetic_J,potential_J,total_J"));
    energies.publish(0, 0, 0.0, &[1.0, 2.0, 3.0]).unwrap();
    let mut rows = attach(&test, "energies", Delivery::Lossless).unwrap();
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

/// Subscribes as soon as there is a publisher, for which `wait` waits, and reads to the end.
fn read_when_there(test: &TestBus, name: &str, wait: impl Fn()) -> (Vec<u64>, u64, EndReason) {
    loop {
        match attach(test, name, Delivery::Lossless) {
            Some(mut rows) => return read(&mut rows),
            None => wait(),
        }
    }
}

/// Who watches a run gets every row of all results, ours and others, of one publisher after the other.
#[test]
fn publishers_wait_for_those_who_watch_a_run() {
    let test = TestBus::new();
    let watch = ResultsWatch::create(&test.bus, &run_name("run")).unwrap();
    for name in ["energies", "own/mine", "energies", "own/mine", "later"] {
        std::thread::scope(|scope| {
            let reading = scope.spawn(|| {
                while !watch.topics().unwrap().contains(&topic(name)) {
                    watch.wait(Duration::from_secs(1));
                }
                read_when_there(&test, name, || {
                    watch.wait(Duration::from_secs(1));
                })
            });
            let mut rows = create::<f64>(&test, name, &columns(2, "a_m,b_m"));
            for frame in 0..500 {
                rows.publish(frame, frame, 0.0, &[1.0; 2]).unwrap();
            }
            rows.finish().unwrap();
            assert_eq!(reading.join().unwrap(), ((0..500).collect(), 0, EndReason::Complete));
        });
    }
}

/// So does who listens for one topic alone, by iceoryx2 and the rules of `docs/FORMAT.md`.
#[test]
fn publishers_wait_for_those_who_listen_for_their_topic() {
    let test = TestBus::new();
    let node = foreign::node(&test.bus);
    let name = foreign::service("beadline/run/energies");
    let events = node.service_builder(&name).event().max_listeners(32).max_notifiers(32).max_nodes(64);
    let listener = events.open_or_create().unwrap().listener_builder().create().unwrap();
    std::thread::scope(|scope| {
        let reading = scope.spawn(|| {
            read_when_there(&test, "energies", || {
                listener.timed_wait(|_| {}, Duration::from_secs(1)).unwrap();
            })
        });
        let mut energies = create::<f64>(&test, "energies", &columns(3, "a_J,b_J,c_J"));
        for frame in 0..2000 {
            energies.publish(frame, frame, 0.0, &[1.0; 3]).unwrap();
        }
        energies.finish().unwrap();
        assert_eq!(reading.join().unwrap(), ((0..2000).collect(), 0, EndReason::Complete));
    });
}

/// Who publishes a topic, and then again, waits for who reads the first rows: without that, a reader that was not there in
/// time has not seen the second publisher before it is gone, and its rows are lost.
#[test]
fn a_publisher_that_begins_again_waits_for_who_still_reads() {
    for waits in [false, true] {
        let test = TestBus::new();
        let publish = |frames: std::ops::Range<u64>| {
            let mut energies = create::<f64>(&test, "energies", &columns(1, "a_J"));
            frames.for_each(|frame| energies.publish(frame, frame, 0.0, &[1.0]).unwrap());
            energies.finish_and_wait(if waits { Duration::MAX } else { Duration::ZERO }).unwrap();
        };
        let mut first = create::<f64>(&test, "energies", &columns(1, "a_J"));
        let mut rows = attach(&test, "energies", Delivery::Lossless).unwrap();
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
            let watch = ResultsWatch::create(&test.bus, &run_name("run")).unwrap();
            drop(rows);
            let wait = || {
                watch.wait(Duration::from_secs(1));
            };
            let mut again = std::iter::repeat_with(|| read_when_there(&test, "energies", wait));
            let again = again.find(|(frames, ..)| !frames.is_empty()).unwrap();
            assert_eq!(again, ((1..5).collect(), 0, EndReason::Complete));
        });
    }
}

/// Who comes too late for the first row is told so.
#[test]
fn a_row_says_whether_its_publisher_had_others_before() {
    let test = TestBus::new();
    let mut energies = create::<f64>(&test, "energies", &columns(1, "a_J"));
    let mut early = attach(&test, "energies", Delivery::Latest).unwrap();
    energies.publish(4, 4, 0.0, &[1.0]).unwrap();
    let follows = |rows: &mut ResultSubscriber| match rows.receive().unwrap() {
        ResultReceived::Row(row) => (row.frame, row.follows),
        other => panic!("{other:?}"),
    };
    assert_eq!(follows(&mut early), (4, false));
    drop(early);
    energies.publish(5, 5, 0.0, &[1.0]).unwrap();
    let mut late = attach(&test, "energies", Delivery::Latest).unwrap();
    energies.publish(6, 6, 0.0, &[1.0]).unwrap();
    assert_eq!(follows(&mut late), (6, true));
}

#[test]
fn classes_are_bytes() {
    let test = TestBus::new();
    let mut contacts = create::<u8>(&test, "contacts", &ResultColumns::contacts(25, 1e-9));
    let mut rows = attach(&test, "contacts", Delivery::Lossless).unwrap();
    contacts.publish(7, 70, 0.7, &[2; 25]).unwrap();
    let ResultReceived::Row(row) = rows.receive().unwrap() else { panic!("no row") };
    assert_eq!((row.frame, row.step, row.time_s, row.values), (7, 70, 0.7, RowValues::Classes(&[2; 25])));
    assert!(matches!(contacts.publish(8, 80, 0.8, &[0; 24]), Err(ResultsError::Width { .. })));
}

#[test]
fn a_stalled_latest_subscriber_counts_what_it_missed() {
    let test = TestBus::new();
    let mut impurity = create::<f64>(&test, "impurity", &columns(1, "u_m"));
    let mut stalled = attach(&test, "impurity", Delivery::Latest).unwrap();
    for frame in 0..100 {
        impurity.publish(frame, frame, 0.0, &[0.0]).unwrap();
    }
    std::thread::scope(|scope| {
        let ending = scope.spawn(|| impurity.finish().unwrap());
        assert_eq!(read(&mut stalled), (vec![0, 1], 98, EndReason::Complete));
        ending.join().unwrap();
    });
}

/// Rows that a publisher cannot make any more are missed, too.
#[test]
fn a_publisher_that_missed_the_last_frames_says_so() {
    for (missed, count) in [(Some(9), 5), (Some(2), 0), (None, 0)] {
        let test = TestBus::new();
        let mut energies = create::<f64>(&test, "energies", &columns(1, "a_J"));
        let mut rows = attach(&test, "energies", Delivery::Lossless).unwrap();
        (3..5).for_each(|frame| energies.publish(frame, frame, 0.0, &[1.0]).unwrap());
        energies.finish_short_of(missed).unwrap();
        assert_eq!(read(&mut rows), (vec![3, 4], count, EndReason::Complete));
    }
}

#[test]
fn a_second_publisher_is_told_so_that_it_can_go_on_without() {
    let test = TestBus::new();
    let first = create::<f64>(&test, "energies", &columns(1, "total_J"));
    let again = || {
        ResultPublisher::<f64>::create(
            &test.bus,
            &run_name("run"),
            topic("energies"),
            StreamId::new(RunId([2; 16])),
            &columns(1, "total_J"),
            Arc::default(),
        )
    };
    assert!(
        matches!(again(), Err(ResultsError::AlreadyPublished { topic: found, .. }) if found == topic("energies"))
    );
    drop(first);
    assert!(again().is_ok());
}

#[test]
fn subscribers_notice_that_the_publisher_was_killed() {
    let test = TestBus::new();
    let mut child = Child::start(&test.bus, "results", "run", &[]);
    child.expect("created");
    let mut rows = attach(&test, "energies", Delivery::Lossless).unwrap();
    let ResultReceived::Row(first) = rows.receive().unwrap() else { panic!("no row") };
    let next = first.frame + 1;
    child.kill();
    let (frames, missed, end) = read_from(Some(next), &mut rows);
    assert_eq!(end, EndReason::ProducerLost);
    // what was sent before the kill is in the queue, whole and in order
    assert_eq!((frames.first().copied().unwrap_or(next), missed), (next, 0));
    // and the next one can take its place
    wait_until(|| attach(&test, "energies", Delivery::Lossless).is_none());
    create::<f64>(&test, "energies", &columns(2, "a_J,b_J"));
}

#[test]
fn rows_of_another_width_do_not_reach_subscribers_of_the_old_ones() {
    let test = TestBus::new();
    let first = create::<f64>(&test, "impurity", &columns(4, "u_m,v_m_s,left_m,right_m"));
    let rows = attach(&test, "impurity", Delivery::Lossless).unwrap();
    drop(first);
    let (run, stream) = (run_name("run"), StreamId::new(RunId([1; 16])));
    let wider = || {
        let columns = columns(8, "two beads");
        ResultPublisher::<f64>::create(&test.bus, &run, topic("impurity"), stream, &columns, Arc::default())
    };
    assert!(matches!(wider(), Err(ResultsError::OtherColumns { expected: 8, found: 4, .. })));
    drop(rows);
    assert!(wider().is_ok());
}

/// What no recording could describe is refused before anybody has it.
#[test]
fn rows_that_nobody_could_record_are_not_published() {
    fn refused<T: ResultElement>(topic: Topic, columns: &ResultColumns) -> String {
        let (test, stream) = (TestBus::new(), StreamId::new(RunId([1; 16])));
        let created =
            ResultPublisher::<T>::create(&test.bus, &run_name("run"), topic, stream, columns, Arc::default());
        created.err().unwrap().to_string()
    }
    assert!(refused::<f64>(Topic::State, &columns(1, "a_m")).contains("no rows of results"));
    assert!(refused::<f64>(topic("new"), &columns(1, "a m")).contains("`a m` is no name of a column"));
    assert!(refused::<u8>(topic("new"), &columns(1, "a_m")).contains("classes without a tolerance"));
    assert!(
        refused::<f64>(topic("new"), &ResultColumns::contacts(1, 0.0)).contains("numbers with a tolerance")
    );
    assert!(refused::<u8>(topic("own/new"), &ResultColumns::contacts(1, 0.0)).contains("no f64"));
}
