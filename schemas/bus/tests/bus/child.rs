//! Processes of their own, to be killed: this test binary again, with a role in its environment.

use crate::support::{PATIENCE, attach, drain, publish_one, publisher, run_name};
use bus::{Bus, Delivery, PublishOptions, Remedies};
use schemas::frame::{EndReason, FrameSource as _};
use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, channel};

/// A child process with a role; killed when dropped.
pub(crate) struct Child {
    process: std::process::Child,
    lines: Receiver<String>,
}

impl Child {
    /// Starts `role` on `bus` for the run `name`; `settings` are read by the role.
    pub(crate) fn start(bus: &Bus, role: &str, name: &str, settings: &[(&str, &str)]) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "child::child", "--nocapture", "--test-threads=1", "--quiet"]);
        command.env("BL_ROLE", role).env("BL_ROOT", bus.root()).env("BL_NAME", name);
        command.envs(settings.iter().copied());
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut process = command.spawn().unwrap();
        let (sender, lines) = channel();
        let stdout = BufReader::new(process.stdout.take().unwrap());
        std::thread::spawn(move || {
            for line in stdout.lines().map_while(Result::ok) {
                // libtest may leave words of its own on the line before
                if let Some((_, line)) = line.split_once('@') {
                    let _ = sender.send(line.to_owned());
                }
            }
        });
        Self { process, lines }
    }

    /// Waits for a line that begins with `word`, and returns the rest of it.
    pub(crate) fn expect(&self, word: &str) -> String {
        loop {
            let line = self.lines.recv_timeout(PATIENCE);
            let line = line.unwrap_or_else(|e| panic!("the child never said {word}: {e}"));
            if let Some(rest) = line.strip_prefix(word) {
                return rest.trim().to_owned();
            }
        }
    }

    /// Whether it has said `word` by now.
    pub(crate) fn said(&self, word: &str) -> bool {
        self.lines.try_iter().any(|line| line.starts_with(word))
    }

    pub(crate) fn kill(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }

    pub(crate) fn wait(&mut self) {
        assert!(self.process.wait().unwrap().success());
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn setting(key: &str, default: u64) -> u64 {
    std::env::var(key).map_or(default, |text| text.parse().unwrap())
}

/// Not a test: what a child process does.
#[test]
fn child() {
    let Ok(role) = std::env::var("BL_ROLE") else { return };
    let bus = Bus::at(std::env::var("BL_ROOT").unwrap().as_ref()).unwrap();
    let name = std::env::var("BL_NAME").unwrap();
    match role.as_str() {
        "produce" => produce(&bus, &name),
        "consume" => consume(&bus, &name),
        "results" => results(&bus, &name),
        "signals-default" => crate::traps::wait_with_default_signals(&bus),
        "signals-bus" => signals_bus(&bus, &name),
        other => panic!("no role {other}"),
    }
}

/// Publishes `BL_FRAMES` frames once `BL_WAIT` consumers are ready, then ends or hangs as `BL_END` says.
fn produce(bus: &Bus, name: &str) {
    let beads = setting("BL_BEADS", 50);
    let remedies = Remedies {
        release_board: setting("BL_HOLD_BOARD", 0) == 0,
        pause: setting("BL_PAUSE", 1) == 1,
        ..Remedies::default()
    };
    take_signals();
    let stuck_after = std::time::Duration::from_millis(setting("BL_STUCK_MS", 30_000));
    let options = PublishOptions { remedies, stuck_after, ..PublishOptions::default() };
    let mut run = publisher(bus, name, beads, &options);
    println!("@created");
    println!("@thread {}", std::fs::read_link("/proc/thread-self").unwrap().display());
    let wait = usize::try_from(setting("BL_WAIT", 0)).unwrap();
    run.wait_for(wait, &AtomicBool::new(false), None).unwrap();
    for frame in 0..setting("BL_FRAMES", 0) {
        if let Err(e) = publish_one(&mut run, beads, frame) {
            println!("@error {e}");
            return;
        }
    }
    run.serve().unwrap();
    println!("@published");
    if std::env::var("BL_END").as_deref() == Ok("hang") {
        loop {
            std::thread::park();
        }
    }
    let counts = run.finish(EndReason::Complete).unwrap();
    println!("@resent {}", counts.resent);
}

/// Attaches, reads `BL_READ` frames (or all), says what it got, and hangs if it is to.
fn consume(bus: &Bus, name: &str) {
    let delivery = if setting("BL_LATEST", 0) == 1 { Delivery::Latest } else { Delivery::Lossless };
    let mut source = attach(bus, name, delivery);
    println!("@attached {}", source.first_frame());
    for _ in 0..setting("BL_READ", 0) {
        source.receive().unwrap();
    }
    println!("@read");
    if std::env::var("BL_END").as_deref() == Ok("hang") {
        loop {
            std::thread::park();
        }
    }
    let got = drain(&mut source);
    println!("@got {} {} {}", got.frames, got.missed, got.end);
}

/// Publishes results that nobody ends.
fn results(bus: &Bus, name: &str) {
    use bus::{ResultPublisher, StreamId};
    use schemas::results::{ResultColumns, Topic};
    let stream = StreamId::new(schemas::manifest::RunId([7; 16]));
    let columns = ResultColumns { width: 2, names: "a_J,b_J".into(), tolerance_m: None };
    let (topic, stop) = (Topic::results("energies").unwrap(), std::sync::Arc::default());
    let mut rows = ResultPublisher::create(bus, &run_name(name), topic, stream, &columns, stop).unwrap();
    println!("@created");
    for frame in 0.. {
        rows.publish(frame, frame, 0.0, &[1.0, 2.0]).unwrap();
        std::thread::yield_now();
    }
}

/// Handles SIGUSR1, which otherwise ends the process.
fn take_signals() {
    let flag = std::sync::Arc::default();
    signal_hook::flag::register(signal_hook::consts::SIGUSR1, flag).unwrap();
}

/// The signals that this process handles, as the kernel sees it.
pub(crate) fn caught_signals() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    status.lines().find(|line| line.starts_with("SigCgt")).unwrap().to_owned()
}

/// Everything a producer and a consumer do, in one process.
fn signals_bus(bus: &Bus, name: &str) {
    let before = caught_signals();
    let mut run = publisher(bus, name, 50, &PublishOptions::default());
    let mut source = crate::support::attach_to(bus, &mut run, name, Delivery::Lossless);
    crate::support::publish(&mut run, 50, 0..10);
    run.wait_for(2, &AtomicBool::new(false), Some(std::time::Duration::from_millis(1))).unwrap();
    run.finish(EndReason::Complete).unwrap();
    drain(&mut source);
    println!("@same {}", before == caught_signals());
}
