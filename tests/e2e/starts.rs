//! Runs that are stopped at any system call of their start and their end, and the bus after them.
//!
//! `BEADLINE_CRASH_POINTS=all` tries every call with every error; see CONTRIBUTING.

use crate::harness::{Ended, Place, Running, skip};
use crate::recordings::in_a_namespace;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_beadline");

/// 20 beads, 70 frames.
const CHAIN: &str = "run --preset homogeneous --beads 20 --duration 1e-4 --name z --no-record";

/// What a start and an end do that others can see.
const CALLS: [&str; 12] = [
    "ftruncate",
    "openat",
    "link",
    "linkat",
    "rename",
    "bind",
    "fchmod",
    "mkdir",
    "unlink",
    "flock",
    "fallocate",
    "fcntl",
];

/// What is injected: a kill, and errors as a system at its limits returns them.
const FAULTS: [&str; 5] = ["signal=KILL", "error=EIO", "error=ENOSPC", "error=EINTR", "error=EMFILE"];

/// After whatever happened, the next run of that name has begun and ended within this time; only what hangs meets it.
const BOUND: Duration = Duration::from_mins(1);

/// Who runs `beadline`: who runs the tests, or another user that these can become.
#[derive(Clone, Copy, PartialEq)]
enum User {
    Own,
    Nobody,
}

/// A directory that the user can use, with a program that they can read.
struct Scene {
    place: Place,
    user: User,
    program: PathBuf,
}

impl Scene {
    fn new(user: User) -> Self {
        let place = Place::new();
        let program = place.path("beadline");
        if user == User::Nobody {
            fs::copy(PROGRAM, &program).unwrap();
            fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).unwrap();
            fs::set_permissions(place.path("."), PermissionsExt::from_mode(0o777)).unwrap();
        } else {
            std::os::unix::fs::symlink(PROGRAM, &program).unwrap();
        }
        Self { place, user, program }
    }

    /// `beadline CHAIN`, behind these words; killed after the bound.
    fn run(&self, before: &[&str]) -> Ended {
        let mut words = vec!["timeout", "--signal=KILL"];
        let bound = BOUND.as_secs().to_string();
        words.push(&bound);
        if self.user == User::Nobody {
            words.extend(["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]);
        }
        words.extend(before);
        words.push(self.program.to_str().unwrap());
        words.extend(CHAIN.split(' '));
        Running::start(&words.join(" "), self.place.foreign(words[0], &words[1..])).wait()
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

    /// How often a run that nothing happens to makes each of the calls.
    fn counts(&self) -> BTreeMap<&'static str, usize> {
        let trace = self.place.path("trace");
        let filter = format!("trace=?{}", CALLS.join(",?"));
        self.run(&["strace", "-f", "-o", trace.to_str().unwrap(), "-e", &filter]).exits(0);
        let trace = fs::read_to_string(trace).unwrap();
        let of = |call: &str| trace.lines().filter(|line| line.contains(&format!(" {call}("))).count();
        CALLS.into_iter().map(|call| (call, of(call))).filter(|(_, count)| *count > 0).collect()
    }

    /// Injects `fault` into the call, and looks at what the next run meets and leaves.
    fn stop_at(&self, call: &str, number: usize, fault: &str, clean: &[PathBuf]) -> Result<(), String> {
        let inject = format!("inject={call}:{fault}:when={number}");
        let before = ["strace", "-f", "-o", "/dev/null", "-e", &format!("trace={call}"), "-e", &inject];
        let start = Instant::now();
        self.run(&before);
        let stopped = start.elapsed();
        let next = self.run(&[]);
        let left: Vec<_> = self.traces().into_iter().filter(|path| !clean.contains(path)).collect();
        if stopped >= BOUND {
            return Err(format!("{inject}: the run itself did not end"));
        }
        match next.code() {
            Some(0) if left.is_empty() => Ok(()),
            Some(0) => Err(format!("{inject}: left behind: {left:?}")),
            code => Err(format!("{inject}: the next run ended with {code:?}\n{}", next.stderr())),
        }
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
    let trace = ["-o", "/dev/null", "true"];
    if !there_is("strace", &trace, "no strace here: runs are not stopped at system calls (see tests/setup)") {
        return;
    }
    let scene = Scene::new(user);
    scene.run(&[]).exits(0);
    let clean = scene.traces();
    assert_eq!(clean.len(), 5, "one segment, a lock, a secret and two directories: {clean:?}");
    let counts = scene.counts();
    assert!(counts["ftruncate"] >= 12 && counts["openat"] > 50, "{counts:?}");
    let all = std::env::var("BEADLINE_CRASH_POINTS").is_ok_and(|value| value == "all");
    let (mut tries, mut failures) = (0, Vec::new());
    for (at, fault) in FAULTS.into_iter().enumerate() {
        for (call, count) in &counts {
            // kills at each of the calls that iceoryx2 trips over, a sample of the rest
            let stride = match (all, at, *call) {
                (true, ..) | (_, 0, "ftruncate" | "bind" | "rename" | "link" | "linkat" | "flock") => 1,
                (_, 0, _) => 9,
                _ => 37,
            };
            for number in (1 + at % stride..=*count).step_by(stride) {
                tries += 1;
                failures.extend(scene.stop_at(call, number, fault, &clean).err());
            }
        }
    }
    assert!(failures.is_empty(), "{tries} tries, {} failures:\n{}", failures.len(), failures.join("\n"));
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
