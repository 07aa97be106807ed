//! Runs that are stopped at any system call of their start and their end, and the bus after them.
//!
//! `BEADLINE_CRASH_POINTS=all` tries every call with every error; see CONTRIBUTING.

use crate::harness::{Ended, Place, Running, skip};
use crate::recordings::in_a_namespace;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_beadline");

/// 20 beads, 70 frames.
const CHAIN: &str = "run --preset homogeneous --beads 20 --duration 1e-4 --name z --no-record";

/// What a start and an end do that others can see; those with a `?` are not everywhere.
const CALLS: [&str; 12] = [
    "ftruncate",
    "openat",
    "?link",
    "linkat",
    "?rename",
    "bind",
    "fchmod",
    "?mkdir",
    "?unlink",
    "flock",
    "fallocate",
    "fcntl",
];

/// What is injected: a kill, and errors as a system at its limits returns them.
const FAULTS: [&str; 5] = ["signal=KILL", "error=EIO", "error=ENOSPC", "error=EINTR", "error=EMFILE"];

/// Whatever happens, a command ends within this time; only what hangs meets it.
const BOUND: Duration = Duration::from_mins(1);

/// Who runs `beadline`: who runs the tests, or another user that these can become.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum User {
    Own,
    Nobody,
}

/// A directory that the user can use, with a program that they can read.
pub(crate) struct Scene {
    pub(crate) place: Place,
    user: User,
    program: PathBuf,
}

impl Scene {
    /// None if there is no strace, and that is said.
    pub(crate) fn new(user: User) -> Option<Self> {
        let trace = ["-o", "/dev/null", "true"];
        if !there_is("strace", &trace, "no strace here: nothing is stopped at system calls (see tests/setup)")
        {
            return None;
        }
        let place = Place::new();
        let program = place.path("beadline");
        if user == User::Nobody {
            fs::copy(PROGRAM, &program).unwrap();
            fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).unwrap();
            fs::set_permissions(place.path("."), PermissionsExt::from_mode(0o777)).unwrap();
        } else {
            std::os::unix::fs::symlink(PROGRAM, &program).unwrap();
        }
        Some(Self { place, user, program })
    }

    /// `beadline WORDS`, behind these words.
    pub(crate) fn run(&self, before: &[&str], words: &str) -> Ended {
        let bound = BOUND.as_secs().to_string();
        let mut all = vec!["timeout", "--signal=KILL", &bound];
        if self.user == User::Nobody {
            all.extend(["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]);
        }
        all.extend(before);
        all.push(self.program.to_str().unwrap());
        all.extend(words.split(' '));
        let start = Instant::now();
        let ended = Running::start(&all.join(" "), self.place.foreign(all[0], &all[1..])).wait();
        assert!(start.elapsed() < BOUND, "{words}: did not end");
        ended
    }

    /// `beadline WORDS` with `inject` among the calls that `of` selects, both as strace has them; none if it made no such call.
    pub(crate) fn stopped(&self, inject: &str, of: &[&str], words: &str) -> Option<Ended> {
        let trace = self.place.path("trace");
        let before = [&["strace", "-f", "-o", trace.to_str().unwrap(), "-e", inject], of].concat();
        let ended = self.run(&before, words);
        let trace = self.trace();
        (trace.contains("(INJECTED)") || trace.contains("killed by SIGKILL")).then_some(ended)
    }

    /// The calls of what was stopped last.
    pub(crate) fn trace(&self) -> String {
        String::from_utf8_lossy(&fs::read(self.place.path("trace")).unwrap()).into_owned()
    }

    /// What there is of this bus in shared memory, and in its root.
    fn traces(&self) -> Vec<PathBuf> {
        let root = self.place.path("bus");
        let secret = fs::read_to_string(root.join("secret")).unwrap_or_else(|_| "no secret".to_owned());
        let mut found: Vec<PathBuf> = Vec::new();
        for directory in ["/dev/shm".into(), root.clone(), root.join("nodes"), root.join("services")] {
            let paths = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
            found.extend(
                paths.filter(|path| path.starts_with(&root) || path.to_str().unwrap().contains(&secret)),
            );
        }
        found.sort();
        found
    }
}

/// Whether all calls are tried.
pub(crate) fn all() -> bool {
    std::env::var("BEADLINE_CRASH_POINTS").is_ok_and(|value| value == "all")
}

/// What was tried, and what failed.
#[derive(Default)]
pub(crate) struct Tries {
    count: usize,
    failures: Vec<String>,
}

impl Tries {
    /// Has `attempt` meet `fault` at every `stride`-th of these calls, until it says that there are no more; a `+` is for
    /// a fault that stays.
    pub(crate) fn each(
        &mut self,
        calls: &str,
        fault: &str,
        (first, stride): (usize, usize),
        attempt: impl Fn(&str) -> Option<()>,
    ) {
        let (fault, stays) = fault.strip_suffix('+').map_or((fault, ""), |fault| (fault, "+"));
        for number in (first..).step_by(stride) {
            if self.failures.len() > 99 {
                break; // nothing works here
            }
            let inject = format!("inject={calls}:{fault}:when={number}{stays}");
            match catch_unwind(AssertUnwindSafe(|| attempt(&inject))) {
                Ok(None) => break,
                Ok(Some(())) => {}
                Err(panic) => {
                    let said = panic.downcast_ref().map_or("", String::as_str);
                    self.failures.push(format!("{inject}: {said}"));
                }
            }
            self.count += 1;
        }
    }

    /// Nothing failed, and at least so much was tried.
    #[expect(clippy::print_stdout, reason = "the numbers of a campaign, with --nocapture")]
    pub(crate) fn end(self, least: usize) {
        let Self { count, failures } = self;
        println!("{count} tries, {} failures", failures.len());
        assert!(failures.is_empty(), "{count} tries, {} failures:\n{}", failures.len(), failures.join("\n"));
        assert!(count >= least, "{count} tries");
    }
}

/// Whether there is what a test needs.
fn there_is(command: &str, arguments: &[&str], what: &str) -> bool {
    let there = Command::new(command).args(arguments).output().is_ok_and(|output| output.status.success());
    if !there {
        skip(what);
    }
    there
}

fn campaign(user: User) {
    let Some(scene) = Scene::new(user) else { return };
    scene.run(&[], CHAIN).exits(0);
    let clean = scene.traces();
    assert_eq!(clean.len(), 5, "one segment, a lock, a secret and two directories: {clean:?}");
    let mut tries = Tries::default();
    for (at, fault) in FAULTS.into_iter().enumerate() {
        for call in CALLS {
            // kills at each of the calls that iceoryx2 trips over, a sample of the rest
            let stride = match (all(), at, call) {
                (true, ..) | (_, 0, "ftruncate" | "bind" | "?rename" | "?link" | "linkat" | "flock") => 1,
                (_, 0, _) => 9,
                _ => 37,
            };
            let traced = format!("trace={call}");
            tries.each(call, fault, (1 + at % stride, stride), |inject| {
                scene.stopped(inject, &["-e", &traced], CHAIN)?;
                let next = scene.run(&[], CHAIN).exits(0);
                let left: Vec<_> = scene.traces().into_iter().filter(|path| !clean.contains(path)).collect();
                assert!(left.is_empty(), "left behind: {left:?}\n{}", next.stderr());
                Some(())
            });
        }
    }
    tries.end(40);
}

/// As root a segment that a killed process left without a size was waited for, for ever.
#[test]
fn a_run_stopped_at_any_call_leaves_nothing_in_the_way_of_the_next() {
    campaign(User::Own);
}

#[test]
fn the_same_for_another_user() {
    let become_nobody = ["--reuid=65534", "--regid=65534", "--clear-groups", "true"];
    if there_is(
        "setpriv",
        &become_nobody,
        "only root can become another user: only one user's starts are stopped",
    ) {
        campaign(User::Nobody);
    }
}

/// However many begin at once, nobody is refused, and none of them is in the others' way once they are there. `BEADLINE_STARTS` says how
/// many.
#[test]
fn many_starts_at_once_succeed() {
    let count: usize = std::env::var("BEADLINE_STARTS").map_or(60, |count| count.parse().unwrap());
    let place = Place::new();
    let start = Instant::now();
    let words =
        |number| format!("run --preset homogeneous --beads 20 --no-record --wait-for 1 --name r{number}");
    let mut runs: Vec<Running> = (0..count).map(|number| place.start(&words(number))).collect();
    for run in &mut runs {
        run.wait_until_it_says("waiting for 1 lossless");
        assert!(run.is_running(), "a start was refused");
    }
    println!("{count} starts at once: {:.1} s", start.elapsed().as_secs_f64());
    let start = Instant::now();
    place.run("run --preset homogeneous --beads 20 --duration 1e-4 --no-record --name one-more").exits(0);
    println!("one more beside them: {:.2} s", start.elapsed().as_secs_f64());
    let start = Instant::now();
    for run in &runs {
        run.signal("INT");
    }
    for run in runs {
        run.wait().exits(3);
    }
    println!("their ends: {:.1} s", start.elapsed().as_secs_f64());
}

/// Whoever waits for the lock of a bus knows for whom, and need not wait.
#[test]
fn who_waits_for_others_that_start_is_told_and_can_be_stopped() {
    let place = Place::new();
    let bus = place.bus();
    let lock =
        fs::File::options().write(true).create(true).truncate(false).open(bus.root().join("creating.lock"));
    let lock = lock.unwrap();
    lock.lock().unwrap();
    let mut run = place.start("run --preset homogeneous --no-record");
    run.wait_until_it_says(&format!(
        "waiting for others that start on this bus, now process {}",
        std::process::id()
    ));
    run.signal("INT");
    run.wait().exits(3);
    drop(lock);
    place.run("run --preset homogeneous --duration 1e-4 --no-record").exits(0);
}

/// The memory of a container. Each run that begins has all the memory that it can ever need.
#[test]
fn runs_that_do_not_fit_are_refused_and_none_dies_of_it() {
    let place = Place::new();
    let script = format!(
        "mount -t tmpfs -o size=64m tmpfs /dev/shm || exit 100
         for i in 1 2 3 4 5 6 7 8 9 10; do
             {PROGRAM} run --beads 100000 --duration 2e-5 --no-record --name r$i --wait-for 1 2>r$i.err &
             eval p$i=$!
         done
         # those that wait for a consumer have begun
         until [ $(grep -l -e waiting -e shm-size r*.err | wc -l) -eq 10 ]; do sleep 0.05; done
         for i in $(grep -l waiting r*.err | tr -dc '0-9\\n'); do
             timeout 60 {PROGRAM} energies live:r$i --json >r$i.json || exit 101
         done
         for i in 1 2 3 4 5 6 7 8 9 10; do eval wait \\$p$i; echo $?; done"
    );
    let Some(ended) = in_a_namespace(&place, &script) else { return };
    let ended = ended.exits(0);
    let stdout = ended.stdout();
    let codes: Vec<&str> =
        stdout.lines().filter(|line| line.len() <= 3 && line.parse::<u8>().is_ok()).collect();
    let of = |code: &str| codes.iter().filter(|found| **found == code).count();
    assert!(of("0") >= 1 && of("0") + of("1") == 10, "{stdout}");
    for number in 1..=10 {
        let said = place.read(&format!("r{number}.err"));
        assert!(
            said.contains("waiting for") || (said.contains("35706368") && said.contains("are free")),
            "{said}"
        );
    }
}
