//! What producers leave that were killed while they were creating things.

use crate::child::Child;
use crate::support::{TestBus, attach_to, drain, publish, publisher, wait_until};
use bus::{Bus, ConsumerEvent, Delivery, PublishOptions, list_runs};
use schemas::frame::EndReason;
use std::fs::Permissions;
use std::io::{Read as _, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::path::PathBuf;

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
    let mut finished = false;
    // in the middle of making one of its segments, or just after it; and at last when all are there
    for made in (1..).step_by(3) {
        let mut child = Child::start(&test.bus, "produce", "start", &[("BL_END", "hang")]);
        wait_until(|| {
            finished = finished || child.said("published");
            finished || segments(&test).len() > made
        });
        child.kill();
        run_through(&test, "start");
        if finished {
            break;
        }
    }
    assert_eq!(segments(&test).len(), 1, "nothing but what all share");
}

/// The segments of this bus.
fn segments(test: &TestBus) -> Vec<PathBuf> {
    let paths = std::fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path());
    let ours = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().starts_with(test.bus.prefix());
    paths.filter(ours).collect()
}

/// The one that all processes share, when there is nothing else.
fn shared_segment(test: &TestBus) -> PathBuf {
    let mut found = segments(test);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].to_string_lossy().ends_with(".global_mgmt"));
    found.remove(0)
}

/// Killed between making a segment and giving it a size. As root iceoryx2 waits for such a one for ever.
#[test]
fn segments_of_size_0_do_not_stop_the_next_run() {
    let test = TestBus::new();
    let mut tried = 0;
    loop {
        let mut child = Child::start(&test.bus, "produce", "empty", &[("BL_END", "hang")]);
        child.expect("published");
        child.kill();
        let mut made = segments(&test);
        made.sort();
        made.retain(|path| !path.to_string_lossy().ends_with(".global_mgmt"));
        let Some(path) = made.get(tried) else { break };
        let file = std::fs::File::options().write(true).open(path).unwrap();
        file.set_len(0).unwrap();
        file.set_permissions(Permissions::from_mode(0o200)).unwrap();
        list_runs(&test.bus).unwrap();
        let notice = test.bus.take_notice().unwrap().to_string();
        assert!(notice.contains("1 of them half-made"), "{notice}");
        run_through(&test, "empty");
        shared_segment(&test);
        tried += 1;
    }
    assert!(tried > 8, "{tried} segments of a run");
    run_through(&test, "empty");
}

/// The name of a segment that a process is making, as iceoryx2 forms it.
fn name_by(test: &TestBus, process: u32) -> PathBuf {
    let uptime = std::fs::read_to_string("/proc/uptime").unwrap();
    let seconds: u32 = uptime.split('.').next().unwrap().parse().unwrap();
    let id = (u128::from(process) << 64) | u128::from(seconds);
    PathBuf::from(format!("/dev/shm/{}{}_{id}.dynamic", test.bus.prefix(), "0".repeat(40)))
}

#[test]
fn what_a_living_process_is_making_is_left_alone() {
    let test = TestBus::new();
    let mut other = std::process::Command::new("sleep").arg("600").spawn().unwrap();
    let (half_made, whole) = (name_by(&test, std::process::id()), name_by(&test, other.id()));
    for (path, mode, bytes) in [(&half_made, 0o200, ""), (&whole, 0o600, "something")] {
        std::fs::write(path, bytes).unwrap();
        std::fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
    }
    run_through(&test, "living");
    list_runs(&test.bus).unwrap();
    assert!(half_made.exists() && whole.exists());
    other.kill().unwrap();
    other.wait().unwrap();
    run_through(&test, "living");
    assert!(half_made.exists() && !whole.exists(), "its creator is dead now");
    std::fs::remove_file(half_made).unwrap();
}

/// It counts nodes, and iceoryx2 would make it writable for everybody.
#[test]
fn what_all_processes_share_is_this_users_alone_and_is_put_right() {
    let test = TestBus::new();
    run_through(&test, "shared");
    let path = shared_segment(&test);
    let whole = std::fs::read(&path).unwrap();
    assert!(whole.len() == 16 && whole[8..].iter().any(|byte| *byte > 0), "iceoryx2 counts in it: {whole:?}");
    let mode = || std::fs::metadata(&path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(), 0o600);
    let spoilt: [(&[u8], u32); 5] =
        [(&[0xff; 16], 0o600), (&[], 0o600), (&[], 0o200), (&whole[..5], 0o600), (&whole, 0o666)];
    for (bytes, to_mode) in spoilt {
        std::fs::set_permissions(&path, Permissions::from_mode(0o600)).unwrap();
        std::fs::write(&path, bytes).unwrap();
        std::fs::set_permissions(&path, Permissions::from_mode(to_mode)).unwrap();
        run_through(&test, "shared");
        assert_eq!((shared_segment(&test), mode()), (path.clone(), 0o600));
        assert_eq!(std::fs::read(&path).unwrap()[..8], whole[..8]);
        assert!(test.bus.take_notice().is_some());
    }
}

#[test]
fn somebody_elses_file_in_its_place_is_refused_with_the_owners_name() {
    let test = TestBus::new();
    run_through(&test, "other");
    let path = shared_segment(&test);
    if std::os::unix::fs::chown(&path, Some(65534), None).is_err() {
        // past the test harness, which hides what a test prints unless it fails
        std::io::stderr().write_all(b"\nSKIPPED: only root can give a file away\n").unwrap();
        return;
    }
    let error = list_and_publish(&test).to_string();
    for word in ["65534", "global_mgmt", "secret", "remove"] {
        assert!(error.contains(word), "{word}: {error}");
    }
    // what the message says to do
    std::fs::remove_file(test.bus.root().join("secret")).unwrap();
    let again = Bus::at(test.bus.root()).unwrap();
    assert_ne!(again.prefix(), test.bus.prefix());
    drop(publisher(&again, "other", BEADS, &PublishOptions::default()));
    for name in std::fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path()) {
        if name.to_string_lossy().contains(again.prefix()) {
            std::fs::remove_file(name).unwrap();
        }
    }
    std::os::unix::fs::chown(&path, Some(0), None).unwrap();
    std::fs::write(test.bus.root().join("secret"), &test.bus.prefix()[8..16]).unwrap();
}

fn list_and_publish(test: &TestBus) -> bus::PublishError {
    let manifest = crate::support::manifest("other", BEADS);
    let chain = manifest.physics.chain();
    let made = bus::StatePublisher::create(&test.bus, &manifest, &chain, &PublishOptions::default());
    made.map(drop).unwrap_err()
}

/// Who is attached reads on, the producer says what happened, and the next process on a new root of the same path
/// takes away what belonged to the old one.
#[test]
fn a_bus_that_is_removed_under_a_run_is_noticed_and_cleaned_up_later() {
    let test = TestBus::new();
    let mut killed = Child::start(&test.bus, "produce", "killed", &[("BL_END", "hang")]);
    killed.expect("published");
    let mut run = publisher(&test.bus, "gone", BEADS, &PublishOptions::default());
    let mut source = attach_to(&test.bus, &mut run, "gone", Delivery::Lossless);
    publish(&mut run, BEADS, 0..5);
    std::fs::remove_dir_all(test.bus.root()).unwrap();
    let gone = ConsumerEvent::BusGone { root: test.bus.root().to_owned() };
    wait_until(|| run.take_events().contains(&gone));
    publish(&mut run, BEADS, 5..10);
    run.finish(EndReason::Complete).unwrap();
    let got = drain(&mut source);
    assert_eq!((got.frames, got.end), (10, EndReason::Complete));
    drop(source);
    killed.kill();

    let before = segments(&test).len();
    let again = Bus::at(test.bus.root()).unwrap();
    assert!(before > 1 && again.prefix() != test.bus.prefix());
    drop(publisher(&again, "gone", BEADS, &PublishOptions::default()));
    let left = segments(&test);
    assert_eq!(left.len(), 0, "{left:?}");
    std::fs::write(test.bus.root().join("secret"), &test.bus.prefix()[8..16]).unwrap();
    let family = &test.bus.prefix()[..8];
    for path in std::fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path()) {
        if path.file_name().unwrap().to_string_lossy().starts_with(family) {
            std::fs::remove_file(path).unwrap();
        }
    }
}

/// A process that was stopped (Ctrl-Z) while it was creating something holds the lock, maybe for ever.
#[test]
fn a_stopped_process_does_not_keep_others_from_starting() {
    let test = TestBus::new();
    run_through(&test, "before");
    let lock = test.bus.root().join("creating.lock");
    let mut holder = std::process::Command::new("flock")
        .args(["-x", "--no-fork", lock.to_str().unwrap(), "cat"])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // what it gives back it has got while it held the lock
    holder.stdin.as_mut().unwrap().write_all(b"x").unwrap();
    holder.stdout.as_mut().unwrap().read_exact(&mut [0]).unwrap();
    let stopped =
        std::process::Command::new("kill").args(["-STOP", &holder.id().to_string()]).status().unwrap();
    assert!(stopped.success());
    run_through(&test, "beside");
    holder.kill().unwrap();
    holder.wait().unwrap();
}
