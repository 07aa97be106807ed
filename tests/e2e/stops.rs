//! Commands that are stopped at any call about the files that they read and write, and what can be done with what is left.
//!
//! `BEADLINE_CRASH_POINTS=all` tries every call with every error; see CONTRIBUTING.

use crate::harness::Ended;
use crate::starts::{Scene, Tries, User, all};
use recording::{RecordingInfo, RecordingSource};
use schemas::frame::{FrameSource, Received};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// 20 beads, 70 frames in a tenth of a second, each in a chunk of its own.
const RUN: &str = "run --preset homogeneous --beads 20 --duration 1e-4 --name run --out DIR/run.mcap --flush-period 1e-9 --pace 1e-3";

/// A kill; a disk that errs once, or from then on; one that is full; a signal; no more descriptors.
const FAULTS: [&str; 6] =
    ["signal=KILL", "error=EIO", "error=EIO+", "error=ENOSPC+", "error=EINTR", "error=EMFILE"];

/// Calls that signals do interrupt; nobody is to notice.
const RETRIED: [&str; 7] = ["read", "write", "openat", "flock", "fsync", "fdatasync", "ftruncate"];

/// Commands in a directory of files, which they find as it was each time.
struct Stage {
    scene: Scene,
    dir: PathBuf,
    before: BTreeMap<String, Vec<u8>>,
}

/// What is in a directory.
fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let paths = fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path());
    paths
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read(path).unwrap()))
        .collect()
}

/// What a line of strace calls, behind the number of the process.
fn called(line: &str) -> Option<&str> {
    let (_, call) = line.split_once(' ')?;
    let (name, _) = call.trim_start().split_once('(')?;
    name.starts_with(|first: char| first.is_ascii_lowercase()).then_some(name)
}

/// The bytes that a line of strace says were written.
fn returned_by_write(line: &str) -> Option<u64> {
    let is_write = called(line) == Some("write") || line.contains("<... write resumed>");
    line.rsplit_once(" = ").filter(|_| is_write)?.1.parse().ok()
}

/// The bits of each state.
fn states(path: &Path) -> Vec<Vec<u64>> {
    let mut source = RecordingSource::open(path).unwrap();
    let mut states = Vec::new();
    while let Received::Frame(frame) = source.receive().unwrap() {
        states.push([frame.u_m, frame.v_m_s].concat().into_iter().map(f64::to_bits).collect());
    }
    states
}

impl Stage {
    fn new() -> Option<Self> {
        let scene = Scene::new(User::Own)?;
        let dir = scene.place.path("files");
        fs::create_dir(&dir).unwrap();
        Some(Self { scene, dir, before: BTreeMap::new() })
    }

    /// `beadline WORDS`, in which DIR is the directory; strace knows files by their whole names.
    fn words(&self, words: &str) -> String {
        words.replace("DIR", self.dir.to_str().unwrap())
    }

    fn run(&self, words: &str) -> Ended {
        self.scene.run(&[], &self.words(words))
    }

    /// Puts there what was there in the beginning.
    fn reset(&self) {
        fs::remove_dir_all(&self.dir).unwrap();
        fs::create_dir(&self.dir).unwrap();
        for (name, bytes) in &self.before {
            fs::write(self.dir.join(name), bytes).unwrap();
        }
    }

    /// Stops `words` at each call about the directory and the files `names`, and has `look` see what is left.
    fn campaign(&self, words: &str, names: &[&str], look: impl Fn(&str, &Ended)) {
        let words = self.words(words);
        let paths: Vec<String> = names.iter().map(|name| self.words(&format!("DIR/{name}"))).collect();
        let mut of = vec!["-e", "trace=%file,%desc", "-P", self.dir.to_str().unwrap()];
        of.extend(paths.iter().flat_map(|path| ["-P", path.as_str()]));
        self.reset();
        self.scene.stopped("trace=%file,%desc", &of[2..], &words);
        let trace = self.scene.trace();
        let calls: BTreeSet<&str> = trace.lines().filter_map(called).collect();
        let (mut tries, mut calls_count) = (Tries::default(), 0);
        for (at, fault) in FAULTS.into_iter().enumerate() {
            for call in &calls {
                calls_count += 1;
                let stride = if all() { 1 } else { 5 };
                tries.each(call, fault, (1 + (at + calls_count) % stride, stride), |inject| {
                    self.reset();
                    let ended = self.scene.stopped(inject, &of, &words)?;
                    let is_retried = fault == "error=EINTR" && RETRIED.contains(call);
                    assert!(!is_retried || ended.code() == Some(0), "{}", ended.stderr());
                    look(fault, &ended);
                    Some(())
                });
            }
        }
        tries.end(20);
    }

    /// The states of the run.
    fn whole(&self) -> Vec<Vec<u64>> {
        self.run(RUN).exits(0);
        states(&self.dir.join("run.mcap"))
    }

    /// The files, but those on their way to a name.
    fn contents(&self) -> BTreeMap<String, Vec<u8>> {
        let names = files(&self.dir).into_keys().filter(|name| {
            self.before.contains_key(name) || !(name.ends_with(".partial") || name.ends_with(".recovered"))
        });
        names.map(|name| (name.clone(), said(&self.dir.join(name)))).collect()
    }

    /// Wherever `words` are stopped, each file is as it was before or as they make it, and they can be said again.
    fn replaces(&self, words: &str) {
        self.reset();
        let before = self.contents();
        self.run(words).exits(0);
        let after = self.contents();
        let names = ["", ".partial", ".recovered", ".recovered.partial"];
        let names: Vec<String> =
            after.keys().flat_map(|name| names.map(|ending| format!("{name}{ending}"))).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        self.campaign(words, &names, |_, ended| {
            let found = self.contents();
            let is_whole = |(name, said)| before.get(name) == Some(said) || after.get(name) == Some(said);
            assert!(found.iter().all(is_whole) && found.len() == after.len(), "{:?}", found.keys());
            assert!(ended.code() != Some(0) || found == after);
            self.run(words).exits(0);
            assert!(self.contents() == after && files(&self.dir).len() == after.len());
        });
    }

    /// What is left of `run.mcap` is proven, can be recovered, and goes on to the `whole` run; `least` of its states were
    /// there before.
    fn goes_on(&self, whole: &[Vec<u64>], least: u64, fault: &str, ended: &Ended) {
        let path = |name| self.dir.join(name);
        if ended.code() == Some(0) {
            assert!(RecordingInfo::read(&path("run.mcap")).unwrap().is_complete(), "{}", ended.stderr());
        } else if !fault.contains("KILL") {
            assert!(ended.code().is_some(), "{}", ended.stderr());
        }
        let names = ["run.mcap.interrupted", "run.mcap.partial", "run.mcap"];
        let left: Vec<_> = names.into_iter().filter(|name| path(name).exists()).collect();
        let mut furthest = 0;
        for name in &left {
            let frames = RecordingInfo::read(&path(name)).map_or(0, |info| info.frames());
            furthest = furthest.max(frames);
            if frames > 0 {
                let verified = self.run(&format!("verify DIR/{name}")).stdout();
                assert!(verified.contains("proven"), "{name}: {verified}");
                self.run(&format!("recover DIR/{name} --out DIR/other.mcap"));
                self.run("verify DIR/other.mcap").exits(0);
                assert!(states(&path("other.mcap")).len() as u64 >= frames);
                fs::remove_file(path("other.mcap")).unwrap();
            }
        }
        assert!(furthest >= least, "{furthest} of {least} states");
        let next = match left.first() {
            Some(name) if fs::metadata(path(name)).unwrap().len() > 0 => format!("run --resume DIR/{name}"),
            _ => RUN.to_owned(),
        };
        self.run(&next).exits(0);
        assert!(states(&path("run.mcap")) == whole);
        assert_eq!(files(&self.dir).into_keys().collect::<Vec<_>>(), ["run.mcap"]);
        self.run("verify DIR/run.mcap").exits(0);
    }
}

/// The bytes of a file or, since those of a recording depend on the clock, its states.
fn said(path: &Path) -> Vec<u8> {
    match RecordingInfo::read(path) {
        Ok(_) => format!("{:?}", states(path)).into_bytes(),
        Err(_) => fs::read(path).unwrap(),
    }
}

const RECORDING: [&str; 3] = ["run.mcap", "run.mcap.partial", "run.mcap.interrupted"];

/// From its first byte to its name; what a write returned is there.
#[test]
fn a_recording_that_is_stopped_at_any_call_goes_on() {
    let Some(stage) = Stage::new() else { return };
    let whole = stage.whole();
    stage.campaign(RUN, &RECORDING, |fault, ended| {
        let left: u64 = files(&stage.dir).values().map(|bytes| bytes.len() as u64).sum();
        let trace = stage.scene.trace();
        let written: Vec<u64> = trace.lines().filter_map(returned_by_write).collect();
        // before any state stand the head and definitions, some 2.3 kB and more the more often they are flushed
        let sum: u64 = written.iter().sum();
        assert!(left >= sum || left == 0 && sum < 3000, "{left} of {written:?} bytes");
        stage.goes_on(&whole, 0, fault, ended);
    });
}

/// What a run and its consumers call between two frames, and when they meet and part.
const BETWEEN: [&str; 9] =
    ["sendto", "recvfrom", "futex", "clock_nanosleep", "sched_yield", "mmap", "munmap", "close", "unlink"];

/// Its consumer hears of the end.
#[test]
fn a_run_that_is_killed_between_two_frames_goes_on() {
    let Some(stage) = Stage::new() else { return };
    let whole = stage.whole();
    let words = stage.words(&format!("{RUN} --wait-for 1"));
    let mut tries = Tries::default();
    for call in BETWEEN {
        let stride = if all() { 1 } else { 17 };
        tries.each(call, "signal=KILL", (1, stride), |inject| {
            stage.reset();
            let consumer = stage.scene.place.start("energies live:run");
            let ended = stage.scene.stopped(inject, &["-e", &format!("trace={call}")], &words)?;
            // it waits for a run that never was there, or has seen the end of this one
            consumer.signal("INT");
            let consumer = consumer.wait();
            assert!([Some(0), Some(3), None].contains(&consumer.code()), "{}", consumer.stderr());
            stage.goes_on(&whole, 0, "signal=KILL", &ended);
            Some(())
        });
    }
    tries.end(8);
}

#[test]
fn a_consumer_that_is_killed_at_any_call_costs_the_others_nothing() {
    let Some(stage) = Stage::new() else { return };
    let words = stage.words(&format!("{RUN} --wait-for 1").replace("--pace 1e-3", "--pace 4e-4"));
    let mut tries = Tries::default();
    for call in BETWEEN {
        let stride = if all() { 1 } else { 17 };
        tries.each(call, "signal=KILL", (1, stride), |inject| {
            stage.reset();
            let run = stage.scene.place.start(&words);
            let other = stage.scene.place.start("energies live:run --json");
            let of = ["-e", &format!("trace={call}")];
            let stopped = stage.scene.stopped(inject, &of, "energies live:run --timeout 5");
            let other = other.wait().exits(0).json();
            assert_eq!((&other["end"], &other["frames_missed"]), (&"complete".into(), &0.into()));
            run.wait().exits(0);
            stopped.map(drop)
        });
    }
    tries.end(8);
}

/// Half a recording, whose run goes on in its place.
#[test]
fn going_on_that_is_stopped_at_any_call_goes_on() {
    let Some(mut stage) = Stage::new() else { return };
    let whole = stage.whole();
    let bytes = fs::read(stage.dir.join("run.mcap")).unwrap();
    stage.before = [("run.mcap.partial".to_owned(), bytes[..bytes.len() / 2].to_vec())].into();
    stage.reset();
    let least = RecordingInfo::read(&stage.dir.join("run.mcap.partial")).unwrap().frames();
    assert!(least > 10, "{least}");
    stage.campaign("run --resume DIR/run.mcap.partial", &RECORDING, |fault, ended| {
        stage.goes_on(&whole, least, fault, ended);
    });
}

#[test]
fn what_is_replaced_is_there_as_it_was_or_as_it_is_to_be() {
    let Some(mut stage) = Stage::new() else { return };
    stage.whole();
    let recording = fs::read(stage.dir.join("run.mcap")).unwrap();
    let half = recording[..recording.len() / 2].to_vec();
    let mine = || b"mine".to_vec();
    for (words, before) in [
        (RUN, vec![("run.mcap", mine())]),
        (
            "recover DIR/run.mcap.partial --out DIR/run.mcap",
            vec![("run.mcap", mine()), ("run.mcap.partial", half)],
        ),
        (
            "energies DIR/run.mcap --out DIR/table.csv --figure DIR/figure.svg",
            vec![("run.mcap", recording), ("table.csv", mine()), ("figure.svg", mine())],
        ),
    ] {
        stage.before = before.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect();
        stage.replaces(&format!("{words} --force"));
    }
}
