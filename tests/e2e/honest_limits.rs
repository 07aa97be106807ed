//! Limits that honest users meet: numbers that no clock or memory has, pipes among files, a system that grants no thread.

use crate::harness::{Ended, Place, Running, skip};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::process::Command;

/// A sweep of four points that take nothing.
const SWEEP: &str = "\
[base]
preset = \"homogeneous\"
chain.beads = 10
time.duration_s = 1e-5
[grid]
chain.alpha = [1.5, 1.6, 1.7, 1.8]
";

/// A place with the sweep in `sweep`, computed.
fn swept() -> Place {
    let place = Place::new();
    place.write("sweep.toml", SWEEP);
    place.run("sweep sweep.toml --out sweep").exits(0);
    place
}

fn pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

#[test]
fn a_sweep_of_more_points_than_there_are_is_refused() {
    let place = swept();
    let json = place.read("sweep/sweep.json");
    place.write("sweep/sweep.json", &json.replace("\"points\": 4", "\"points\": 1000000000000000000"));
    for words in ["sweep --status sweep", "sweep --status sweep --json"] {
        place.run(words).exits(2).says(&["1000000000000000000 points", "at most 10000000"]);
    }
}

#[test]
fn times_that_no_clock_has_are_not_believed() {
    let place = swept();
    fs::create_dir(place.path("sweep/slurm")).unwrap();
    let journal = place.read("sweep/rows/0-of-1.rows");
    // rows are missing, so that the shard is looked at
    place.write("sweep/rows/0-of-1.rows", journal.lines().next().unwrap());
    for time in ["1e300", "-1e300", "nan", "inf", "1.8446744073709552e19"] {
        place.write("sweep/slurm/0-of-1.trace", &format!("{time} begun 0 node\n"));
        let status = place.run("sweep --status sweep --json").exits(0).json();
        assert_eq!(status["begun"][0]["attempts"], 1, "{time}: {status}");
        place.run("sweep --status sweep").exits(0);
    }
}

#[test]
fn rows_of_another_sweep_are_not_counted() {
    let place = swept();
    let journal = place.read("sweep/rows/0-of-1.rows");
    place.write("other.toml", &SWEEP.replace("beads = 10", "beads = 11"));
    place.run("sweep other.toml --out other").exits(0);
    place.write("sweep/rows/0-of-1.rows", &place.read("other/rows/0-of-1.rows"));
    let status = place.run("sweep --status sweep --json").exits(3).json();
    assert_eq!(status["done"], 0, "{status}");
    assert!(status["unreadable"][0].as_str().unwrap().contains("belongs to another table"), "{status}");
    place.write("sweep/rows/0-of-1.rows", &journal);
    place.run("sweep --status sweep").exits(0);
}

#[test]
fn a_pipe_among_the_files_of_a_sweep_is_named_and_not_waited_for() {
    let place = swept();
    pipe(&place.path("sweep/rows/1-of-2.rows"));
    let status = place.run("sweep --status sweep --json").exits(3).json();
    assert_eq!((&status["done"], &status["points"]), (&4.into(), &4.into()));
    let unreadable = status["unreadable"][0].as_str().unwrap();
    assert!(unreadable.contains("1-of-2.rows") && unreadable.contains("a pipe (FIFO)"), "{status}");
    let text = place.run("sweep --status sweep").exits(3).stdout();
    assert!(text.contains("not read") && text.contains("1-of-2.rows"), "{text}");
    for words in ["sweep sweep.toml --out sweep", "sweep --merge sweep"] {
        place.run(words).exits(1).says(&["1-of-2.rows", "a pipe (FIFO)"]);
    }
    fs::remove_file(place.path("sweep/sweep.json")).unwrap();
    pipe(&place.path("sweep/sweep.json"));
    place.run("sweep --status sweep").exits(2).says(&["sweep.json", "a pipe (FIFO)"]);
}

#[test]
fn what_is_no_file_among_recordings_is_named_and_not_waited_for() {
    let place = Place::new();
    fs::create_dir(place.path("runs")).unwrap();
    let run = "run --preset striker-3g --duration 1e-3 --record-every-steps 100 --out runs/run.mcap";
    place.run(run).exits(0);
    pipe(&place.path("runs/pipe.mcap"));
    let _socket = UnixListener::bind(place.path("runs/socket.mcap")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", place.path("runs/zero.mcap")).unwrap();
    std::os::unix::fs::symlink("nothing", place.path("runs/gone.mcap")).unwrap();
    let what = ["a pipe (FIFO)", "a socket", "a device", "leads to no file"];
    let ended = place.run("ls runs --json").exits(3).says(&what);
    assert_eq!(ended.json().as_array().unwrap().len(), 1);
    let made = place.run("catalog runs --out catalog.csv --json").exits(3).json();
    assert_eq!((&made["recordings"], &made["errors"]), (&5.into(), &4.into()));
    let table = place.read("catalog.csv");
    assert!(what.iter().all(|what| table.contains(what)), "{table}");
    for words in [
        "info {}",
        "verify {}",
        "recover {} --out a.mcap",
        "energies {}",
        "plot {} --what velocity --out a.png",
        "export {} --to csv --out a.csv",
        "thin {} --every-steps 10 --out a.mcap",
        "expand {} --out a.mcap",
        "share {}",
        "replay {}",
        "view {}",
        "upload {} s3://bucket/key",
        "run --resume {}",
    ] {
        for (name, what) in [("pipe", what[0]), ("zero", what[2])] {
            let words = words.replace("{}", &format!("runs/{name}.mcap"));
            let ended = place.run(&words);
            assert!(matches!(ended.code(), Some(1 | 2)), "{words}: {:?} {}", ended.code(), ended.stderr());
            let said = ended.stderr();
            // what replaces files has words of its own
            let others = ["a device, pipe or socket", "is a link"];
            let is_named = said.contains(what) || others.iter().any(|other| said.contains(other));
            assert!(is_named, "{words}: {said}");
        }
    }
    // a folder shows what it cannot read
    let mut running = place.start("view runs");
    assert!(running.line().starts_with("http"));
    running.signal("INT");
    running.wait().exits(0);
}

/// A place that a user of no other process can use, with the command.
fn place_of_another_user() -> Option<Place> {
    let as_nobody = ["--reuid=65533", "--regid=65533", "--clear-groups", "prlimit", "--nproc=1:1", "true"];
    if !Command::new("setpriv").args(as_nobody).status().is_ok_and(|status| status.success()) {
        skip("only root can become a user who may start no thread (`setpriv`, `prlimit`)");
        return None;
    }
    let place = Place::new();
    fs::copy(env!("CARGO_BIN_EXE_beadline"), place.path("beadline")).unwrap();
    place.run("run --preset striker-3g --duration 1e-2 --record-every-steps 100 --out run.mcap").exits(0);
    fs::create_dir(place.path("runs")).unwrap();
    fs::copy(place.path("run.mcap"), place.path("runs/run.mcap")).unwrap();
    for (name, mode) in [("beadline", 0o755), ("run.mcap", 0o644), ("runs", 0o755), (".", 0o777)] {
        fs::set_permissions(place.path(name), PermissionsExt::from_mode(mode)).unwrap();
    }
    Some(place)
}

/// `beadline WORDS` of a user who may have so many threads and processes.
fn with_threads(place: &Place, threads: u32, words: &str) -> Ended {
    let limit = format!("--nproc={threads}:{threads}");
    let program = place.path("beadline");
    let before =
        ["--reuid=65533", "--regid=65533", "--clear-groups", "prlimit", &limit, program.to_str().unwrap()];
    let mut command = place.foreign("setpriv", before);
    command.args(words.split_whitespace()).env("BEADLINE_ROOT", place.path("own"));
    Running::start(words, command).wait()
}

#[test]
fn without_threads_the_one_that_is_there_does_the_work() {
    let Some(place) = place_of_another_user() else { return };
    for threads in [1, 2, 3, 9] {
        for (words, code) in [
            ("verify run.mcap", 0),
            ("verify run.mcap --jobs 4", 0),
            ("recover run.mcap --out recovered.mcap --force", 0),
            ("ls runs --json", 0),
            ("catalog runs --out catalog.csv --force", 0),
            ("energies run.mcap --every-step --out energies.csv --force", 0),
            ("pulses run.mcap --every-step --out pulses.csv --force", 0),
        ] {
            let ended = with_threads(&place, threads, words);
            let said = ended.stderr();
            assert!(!said.contains("panicked") && !said.contains("is a bug"), "{threads}: {words}: {said}");
            // who writes a recording needs a thread beside those that read
            if words.starts_with("recover") && ended.code() != Some(0) {
                ended.exits(1).says(&["no thread can be started", "ulimit -u"]);
            } else {
                ended.exits(code);
            }
        }
    }
    let proven = with_threads(&place, 1, "verify run.mcap --json").exits(0).json();
    assert_eq!(proven, place.run("verify run.mcap --json").exits(0).json());
    let ended = with_threads(&place, 1, "info http://127.0.0.1:1/x.mcap");
    assert!(ended.code() != Some(0) && !ended.stderr().contains("panicked"), "{}", ended.stderr());
}
