//! What producers leave that were killed while they were creating things.

use crate::child::Child;
use crate::support::{TestBus, attach_to, drain, publish, publisher};
use schemas::bus::{Delivery, PublishOptions, list_runs};
use schemas::frame::EndReason;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

const BEADS: u64 = 20;

/// A run from its first moment to its last.
fn run_through(test: &TestBus, name: &str) {
    let mut run = publisher(&test.bus, name, BEADS, &PublishOptions::default());
    let mut source = attach_to(&test.bus, &mut run, name, Delivery::Lossless);
    publish(&mut run, BEADS, 0..10);
    run.finish(EndReason::Complete).unwrap();
    let got = drain(&mut source);
    assert_eq!((got.frames, got.end), (10, EndReason::Complete));
}

/// The descriptions of a run's services, while it is there.
fn descriptions(test: &TestBus, name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let _run = publisher(&test.bus, name, BEADS, &PublishOptions::default());
    let entries = std::fs::read_dir(test.bus.root().join("services")).unwrap();
    let read = |path: PathBuf| std::fs::read(&path).map(|bytes| (path, bytes));
    entries.map(|entry| read(entry.unwrap().path()).unwrap()).collect()
}

fn plant(files: &[(PathBuf, Vec<u8>)], whole: bool) {
    for (path, bytes) in files {
        std::fs::write(path, if whole { bytes } else { &[][..] }).unwrap();
        std::fs::set_permissions(path, Permissions::from_mode(if whole { 0o400 } else { 0o600 })).unwrap();
    }
}

/// Killed between creating a description and filling it.
#[test]
fn descriptions_that_were_never_filled_do_not_stop_the_next_run() {
    let test = TestBus::new();
    let files = descriptions(&test, "empty");
    assert_eq!(files.len(), 6);
    plant(&files, false);
    assert_eq!(list_runs(&test.bus).unwrap(), []);
    run_through(&test, "empty");
}

/// Killed between filling a description and creating what it describes.
#[test]
fn descriptions_of_nothing_do_not_stop_the_next_run() {
    let test = TestBus::new();
    plant(&descriptions(&test, "whole"), true);
    assert_eq!(list_runs(&test.bus).unwrap(), []);
    run_through(&test, "whole");
}

#[test]
fn a_producer_killed_at_any_moment_of_its_start_does_not_stop_the_next() {
    let test = TestBus::new();
    // a start takes about ten milliseconds; `sleep` only chooses the moment
    for at_us in [1000, 4000, 7000, 10_000, 15_000] {
        let mut child = Child::start(&test.bus, "produce", "start", &[("BL_END", "hang")]);
        std::thread::sleep(Duration::from_micros(at_us));
        child.kill();
        run_through(&test, "start");
    }
    // a port that was being made leaves a small segment that nothing refers to
    for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
        if entry.file_name().to_string_lossy().starts_with(test.bus.prefix()) {
            std::fs::remove_file(entry.path()).unwrap();
        }
    }
}

/// Killed between creating the segment that all share and filling it, by a full memory for instance.
#[test]
fn a_segment_that_was_never_filled_does_not_stop_the_next_process() {
    let test = TestBus::new();
    drop(publisher(&test.bus, "segment", BEADS, &PublishOptions::default()));
    let prefix = test.bus.prefix();
    let mut paths = std::fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path());
    let ours = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().starts_with(&prefix);
    let path = paths.find(ours).unwrap();
    assert!(path.to_string_lossy().ends_with(".global_mgmt"));
    std::fs::set_permissions(&path, Permissions::from_mode(0o200)).unwrap();
    let start = Instant::now();
    run_through(&test, "segment");
    assert!(start.elapsed() > Duration::from_secs(1), "it was in the way, and not removed while it was new");
}
