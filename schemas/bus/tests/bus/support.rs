//! Runs, frames and watchdogs for the tests.

use bus::{AttachOptions, Bus, Delivery, LiveSource, PublishOptions, StatePublisher};
use schemas::frame::{EndReason, Frame, FrameSink as _, FrameSource as _, Received};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::PRESETS;
use schemas::run_name::RunName;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Generous: only a test that hangs meets it.
pub(crate) const PATIENCE: Duration = Duration::from_mins(1);

/// Ends the whole test process when a test hangs, naming it.
pub(crate) struct Watchdog(Arc<AtomicBool>);

impl Watchdog {
    pub(crate) fn new() -> Self {
        let done = Arc::new(AtomicBool::new(false));
        let (watched, name) = (Arc::clone(&done), std::thread::current().name().unwrap_or("?").to_owned());
        std::thread::spawn(move || {
            std::thread::sleep(2 * PATIENCE);
            if !watched.load(Ordering::Relaxed) {
                println!("watchdog: {name} hangs");
                std::process::exit(101);
            }
        });
        Self(done)
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A bus of its own for one test.
pub(crate) struct TestBus {
    pub(crate) bus: Bus,
    _dir: tempfile::TempDir,
    _watchdog: Watchdog,
}

impl TestBus {
    pub(crate) fn new() -> Self {
        Self::at(tempfile::Builder::new().prefix("bl-").tempdir_in("/tmp").unwrap(), "r")
    }

    pub(crate) fn at(dir: tempfile::TempDir, name: &str) -> Self {
        Self { bus: Bus::at(&dir.path().join(name)).unwrap(), _dir: dir, _watchdog: Watchdog::new() }
    }
}

impl Drop for TestBus {
    /// Everything is gone when everybody is: except the one small segment that iceoryx2 keeps for each bus.
    fn drop(&mut self) {
        // cleans up after processes that were killed: iceoryx2 lets one thread of a process do so at a time, on all buses
        // together, and has the others go on without
        let node = crate::foreign::node(&self.bus);
        let start = Instant::now();
        while node.try_cleanup_dead_nodes().failed_cleanups > 0 && start.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(1));
        }
        drop(node);
        let prefix = self.bus.prefix();
        let names = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.file_name());
        let names = names.map(|name| name.into_string().unwrap_or_default());
        let mut left: Vec<String> = names.filter(|name| name.starts_with(prefix)).collect();
        for name in &left {
            let _ = std::fs::remove_file(std::path::Path::new("/dev/shm").join(name));
        }
        left.retain(|name| !name.ends_with(".global_mgmt"));
        assert!(left.is_empty() || std::thread::panicking(), "left behind: {left:?}");
    }
}

pub(crate) fn manifest(name: &str, beads: u64) -> RunManifest {
    let mut config = PRESETS[2].config();
    config.name = Some(name.to_owned());
    config.chain.beads = beads;
    config.time.duration_s = 10.0;
    let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 };
    RunManifest::new(&config, name, origin).unwrap()
}

pub(crate) fn run_name(name: &str) -> RunName {
    name.parse().unwrap()
}

pub(crate) fn publisher(bus: &Bus, name: &str, beads: u64, options: &PublishOptions) -> StatePublisher {
    let manifest = manifest(name, beads);
    StatePublisher::create(bus, &manifest, &manifest.physics.chain(), options).unwrap()
}

/// Frame `frame` of a run that no physics made: every value says where it belongs.
pub(crate) fn values(frame: u64, beads: u64) -> (Vec<f64>, Vec<f64>) {
    let u = (0..beads).map(|bead| frame as f64 + bead as f64 * 1e-3).collect();
    let v = (0..beads).map(|bead| -(frame as f64) - bead as f64 * 1e-3).collect();
    (u, v)
}

pub(crate) fn publish(publisher: &mut StatePublisher, beads: u64, frames: std::ops::Range<u64>) {
    for frame in frames {
        publish_one(publisher, beads, frame).unwrap();
    }
}

pub(crate) fn publish_one(
    publisher: &mut StatePublisher,
    beads: u64,
    frame: u64,
) -> Result<(), bus::PublishError> {
    let (u_m, v_m_s) = values(frame, beads);
    let time_s = frame as f64;
    publisher.accept(&Frame {
        frame,
        step: frame,
        time_s,
        u_m: &u_m,
        v_m_s: &v_m_s,
        extra: &[],
        active: None,
    })
}

/// What a consumer got until the end.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Got {
    pub(crate) first: Option<u64>,
    pub(crate) frames: u64,
    pub(crate) missed: u64,
    pub(crate) end: EndReason,
}

/// Reads to the end, and checks that every frame is whole and in order and that none vanishes unsaid.
pub(crate) fn drain(source: &mut LiveSource) -> Got {
    let beads = source.manifest().physics.beads;
    let (mut got, mut next) = (Got { first: None, frames: 0, missed: 0, end: EndReason::Stopped }, None);
    loop {
        match source.receive().unwrap() {
            Received::Frame(frame) => {
                assert_eq!(frame.frame, *next.get_or_insert(frame.frame));
                let (u, v) = values(frame.frame, beads);
                assert!(frame.u_m == u && frame.v_m_s == v, "frame {} is not whole", frame.frame);
                got.first.get_or_insert(frame.frame);
                got.frames += 1;
                next = Some(frame.frame + 1);
            }
            Received::Missed { from, to } => {
                assert_eq!(from, *next.get_or_insert(from));
                got.missed += to - from + 1;
                next = Some(to + 1);
            }
            Received::End(end) => {
                got.end = end;
                return got;
            }
        }
    }
}

pub(crate) fn attach(bus: &Bus, name: &str, delivery: Delivery) -> LiveSource {
    let options = AttachOptions { label: "test".into(), timeout: Some(PATIENCE), ..AttachOptions::default() };
    LiveSource::attach(bus, Some(&run_name(name)), delivery, &options).unwrap()
}

/// Attaches while the producer, in this thread, answers.
pub(crate) fn attach_to(
    bus: &Bus,
    publisher: &mut StatePublisher,
    name: &str,
    delivery: Delivery,
) -> LiveSource {
    std::thread::scope(|scope| {
        let attaching = scope.spawn(|| attach(bus, name, delivery));
        wait_until(|| {
            publisher.serve().unwrap();
            attaching.is_finished()
        });
        attaching.join().unwrap()
    })
}

/// Polls for a condition; the watchdog ends what never happens.
pub(crate) fn wait_until(mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < PATIENCE, "it never happened");
        std::thread::yield_now();
    }
}
