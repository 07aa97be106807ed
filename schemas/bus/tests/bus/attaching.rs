//! Finding a run, waiting for one, and refusing what cannot be read.

use crate::foreign;
use crate::support::{
    PATIENCE, TestBus, attach_to, drain, manifest, publish, publisher, run_name, wait_until,
};
use bus::{
    AttachError, AttachNotice, AttachOptions, Bus, Delivery, LiveSource, PublishError, PublishOptions,
    StatePublisher, list_runs,
};
use iceoryx2::prelude::AttributeSpecifier;
use schemas::config::Impurity;
use schemas::frame::{EndReason, FrameSource as _, Received};
use schemas::manifest::MAX_JSON_BYTES;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[test]
fn the_only_run_is_found_and_several_are_named() {
    let test = TestBus::new();
    let options = AttachOptions { timeout: Some(PATIENCE), ..AttachOptions::default() };
    let mut one = publisher(&test.bus, "one", 10, &PublishOptions::default());
    let source = std::thread::scope(|scope| {
        let attaching = scope.spawn(|| LiveSource::attach(&test.bus, None, Delivery::Lossless, &options));
        wait_until(|| {
            one.serve().unwrap();
            attaching.is_finished()
        });
        attaching.join().unwrap().unwrap()
    });
    assert_eq!(source.manifest().provenance.name, run_name("one"));
    let _two = publisher(&test.bus, "two", 10, &PublishOptions::default());
    let Err(error) = LiveSource::attach(&test.bus, None, Delivery::Lossless, &options) else { panic!() };
    assert!(matches!(&error, AttachError::SeveralRuns { names } if names.len() == 2));
    assert!(error.to_string().contains("one, two"), "{error}");
}

#[test]
fn a_consumer_waits_for_a_run_with_a_notice() {
    let test = TestBus::new();
    let notices = Arc::new(Mutex::new(Vec::new()));
    let told = Arc::clone(&notices);
    let options = AttachOptions {
        timeout: Some(PATIENCE),
        notice: Arc::new(move |notice| told.lock().unwrap().push(notice.clone())),
        ..AttachOptions::default()
    };
    let name = run_name("soon");
    std::thread::scope(|scope| {
        let waiting =
            scope.spawn(|| LiveSource::attach(&test.bus, Some(&name), Delivery::Lossless, &options));
        wait_until(|| !notices.lock().unwrap().is_empty());
        assert_eq!(notices.lock().unwrap()[0], AttachNotice::WaitingForRun { name: Some(name.clone()) });
        let mut run = publisher(&test.bus, "soon", 10, &PublishOptions::default());
        run.wait_for(1, &AtomicBool::new(false), None).unwrap();
        publish(&mut run, 10, 0..3);
        run.finish(EndReason::Complete).unwrap();
        assert_eq!(drain(&mut waiting.join().unwrap().unwrap()).frames, 3);
    });
}

#[test]
fn waiting_ends_with_the_time_or_the_flag() {
    let test = TestBus::new();
    let name = run_name("never");
    let options = AttachOptions { timeout: Some(Duration::from_millis(1)), ..AttachOptions::default() };
    let Err(error) = LiveSource::attach(&test.bus, Some(&name), Delivery::Lossless, &options) else {
        panic!()
    };
    assert!(error.to_string().contains("no run never"), "{error}");
    let options = AttachOptions { stop: Arc::new(AtomicBool::new(true)), ..AttachOptions::default() };
    let stopped = LiveSource::attach(&test.bus, Some(&name), Delivery::Lossless, &options);
    assert!(matches!(stopped, Err(AttachError::Stopped)));
}

/// Time that this thread has had a processor.
fn busy() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    Duration::from_nanos(text.split(' ').next().unwrap().parse().unwrap())
}

#[test]
fn waiting_beside_another_run_costs_next_to_nothing() {
    let test = TestBus::new();
    let _other = publisher(&test.bus, "other", 10, &PublishOptions::default());
    let waited = Duration::from_secs(4);
    let options = AttachOptions { timeout: Some(waited), ..AttachOptions::default() };
    // while the services of the other run are new we look often
    let services = std::fs::metadata(test.bus.root().join("services")).unwrap().modified().unwrap();
    wait_until(|| services.elapsed().is_ok_and(|age| age > Duration::from_secs(1)));
    let before = busy();
    let result = LiveSource::attach(&test.bus, Some(&run_name("mine")), Delivery::Latest, &options);
    let busy = busy().saturating_sub(before);
    println!("busy for {busy:?} of {waited:?}");
    let Err(error) = result else { panic!() };
    assert!(error.to_string().contains("no run mine was published within 4.0 s"), "{error}");
    // a wait without pauses would be busy for all of it; the 1 % of a quiet machine is for a bench to show,
    // because the same work takes several times as long on one that is not
    assert!(busy < waited / 10, "{busy:?} of {waited:?}");
}

#[test]
fn a_flag_ends_an_attached_consumer() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "flag", 10, &PublishOptions::default());
    let options = AttachOptions::default();
    let mut source = std::thread::scope(|scope| {
        let name = run_name("flag");
        let (bus, options) = (&test.bus, &options);
        let attaching =
            scope.spawn(move || LiveSource::attach(bus, Some(&name), Delivery::Lossless, options));
        wait_until(|| {
            run.serve().unwrap();
            attaching.is_finished()
        });
        attaching.join().unwrap().unwrap()
    });
    std::thread::scope(|scope| {
        let reading = scope.spawn(|| source.receive().unwrap() == Received::End(EndReason::Stopped));
        options.stop.store(true, Ordering::Relaxed);
        assert!(reading.join().unwrap());
    });
}

/// The joiner keeps its own queue empty meanwhile, so that nobody waits for it.
#[test]
fn joining_while_another_consumer_holds_the_run_back_only_takes_longer() {
    let test = TestBus::new();
    let mut run = publisher(&test.bus, "held", 10, &PublishOptions::default());
    let mut slow = attach_to(&test.bus, &mut run, "held", Delivery::Lossless);
    let waiting = Arc::new(AtomicBool::new(false));
    let told = Arc::clone(&waiting);
    let options = AttachOptions {
        timeout: Some(PATIENCE),
        notice: Arc::new(move |notice| {
            if matches!(notice, AttachNotice::WaitingForAnswer { .. }) {
                told.store(true, Ordering::Relaxed);
            }
        }),
        ..AttachOptions::default()
    };
    std::thread::scope(|scope| {
        let publishing = scope.spawn(|| {
            publish(&mut run, 10, 0..500);
            run.wait_for(2, &AtomicBool::new(false), None).unwrap();
            run.finish(EndReason::Complete).unwrap();
        });
        let (bus, name) = (&test.bus, run_name("held"));
        let joining = scope.spawn(move || {
            let mut source = LiveSource::attach(bus, Some(&name), Delivery::Lossless, &options).unwrap();
            drain(&mut source).end
        });
        wait_until(|| waiting.load(Ordering::Relaxed));
        assert_eq!(drain(&mut slow).frames, 500);
        assert_eq!(joining.join().unwrap(), EndReason::Complete);
        publishing.join().unwrap();
    });
}

#[test]
fn a_second_producer_of_one_name_is_told_about_the_first() {
    let test = TestBus::new();
    let first = publisher(&test.bus, "same", 10, &PublishOptions::default());
    let other = manifest("same", 10);
    let second =
        StatePublisher::create(&test.bus, &other, &other.physics.chain(), &PublishOptions::default());
    let Err(error) = second else { panic!("two producers of one name") };
    let (text, run_id) = (error.to_string(), first.stream().run_id.to_string());
    assert!(matches!(error, PublishError::NameTaken { .. }), "{text}");
    assert!(text.contains(&run_id) && text.contains(&std::process::id().to_string()), "{text}");
    // the first is not disturbed, and the name is free again when it is done
    first.finish(EndReason::Complete).unwrap();
    publisher(&test.bus, "same", 10, &PublishOptions::default());
}

#[test]
fn another_schema_version_is_refused_naming_both() {
    let test = TestBus::new();
    let node = foreign::node(&test.bus);
    let version = AttributeSpecifier::new()
        .define(&"beadline.schema".try_into().unwrap(), &"2.0".try_into().unwrap())
        .unwrap();
    let _newer = node
        .service_builder(&foreign::service("beadline/newer/manifest"))
        .blackboard_creator::<u64>()
        .add::<u64>(0, 0)
        .create_with_attributes(&version)
        .unwrap();
    let options = AttachOptions::default();
    let attached = LiveSource::attach(&test.bus, Some(&run_name("newer")), Delivery::Lossless, &options);
    let Err(error) = attached else { panic!("attached to a newer schema") };
    assert!(error.to_string().contains("2.0") && error.to_string().contains("1.1"), "{error}");
    let ours = manifest("newer", 10);
    let created = StatePublisher::create(&test.bus, &ours, &ours.physics.chain(), &PublishOptions::default());
    let Err(error) = created else { panic!("published over a newer schema") };
    assert!(error.to_string().contains("2.0") && error.to_string().contains("1.1"), "{error}");
}

/// A manifest of 80 kB, which lies in a file, also for those who only look.
#[test]
fn a_long_manifest_is_read_by_everybody_and_leaves_nothing() {
    let test = TestBus::new();
    let mut long = manifest("long", 5000);
    long.physics.impurities = (0..3000).map(|bead| Impurity { bead, mass_kg: 1.234_567_8e-3 }).collect();
    assert!(long.to_json().len() > 65_504);
    let chain = long.physics.chain();
    let mut run = StatePublisher::create(&test.bus, &long, &chain, &PublishOptions::default()).unwrap();
    let mut source = attach_to(&test.bus, &mut run, "long", Delivery::Lossless);
    assert_eq!((source.manifest(), source.chain()), (&long, &chain));
    let listed = list_runs(&test.bus).unwrap();
    assert_eq!(listed[0].step_count, Some(long.physics.step_count));
    let again = StatePublisher::create(&test.bus, &long, &chain, &PublishOptions::default());
    assert!(matches!(again, Err(PublishError::NameTaken { run_id, .. }) if run_id == long.provenance.run_id));
    publish(&mut run, 5000, 0..3);
    run.finish(EndReason::Complete).unwrap();
    assert_eq!(drain(&mut source).frames, 3);
    let files = std::fs::read_dir(test.bus.root()).unwrap().map(|entry| entry.unwrap().file_name());
    let mut left = files.filter(|name| name.to_string_lossy().ends_with(".manifest"));
    assert_eq!(left.next(), None);
}

#[test]
fn what_cannot_be_published_is_refused() {
    let test = TestBus::new();
    let mut long = manifest("long", 10);
    long.provenance.program = "x".repeat(MAX_JSON_BYTES);
    let created = StatePublisher::create(&test.bus, &long, &long.physics.chain(), &PublishOptions::default());
    let Err(error @ PublishError::ManifestTooLong(_)) = created else { panic!("it is too long") };
    assert!(error.to_string().contains("at most 67104768"), "{error}");

    let mut run = publisher(&test.bus, "shape", 10, &PublishOptions::default());
    let wrong = crate::support::publish_one(&mut run, 11, 0);
    assert!(matches!(wrong, Err(PublishError::Shape { expected: 20, found: 22, .. })));
    let wrong = crate::support::publish_one(&mut run, 10, 1);
    assert!(matches!(wrong, Err(PublishError::Order { expected: 0, found: 1 })));
    drop(attach_to(&test.bus, &mut run, "shape", Delivery::Lossless));
    let mut orphan = attach_to(&test.bus, &mut run, "shape", Delivery::Lossless);
    drop(run); // without finish
    assert_eq!(drain(&mut orphan).end, EndReason::Failed);
}

/// Sockets lie in the root, and the kernel limits their paths.
#[test]
fn a_root_as_long_as_is_allowed_works() {
    let dir = tempfile::Builder::new().prefix("bl-").tempdir_in("/tmp").unwrap();
    let pad = "x".repeat(44 - dir.path().as_os_str().len() - 1);
    let test = TestBus::at(dir, &pad);
    let mut run = publisher(&test.bus, &"n".repeat(64), 10, &PublishOptions::default());
    let mut source = attach_to(&test.bus, &mut run, &"n".repeat(64), Delivery::Lossless);
    publish(&mut run, 10, 0..3);
    run.finish(EndReason::Complete).unwrap();
    assert_eq!(drain(&mut source).frames, 3);
    assert!(Bus::at(&test.bus.root().with_file_name("x".repeat(40))).is_err());
}
