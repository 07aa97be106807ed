//! Other people's engines compute sweeps by the lines of `docs/SCALE.md`, to the bytes of one process.

use crate::harness::{Place, Running, python, skip};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

const PAGE: &str = include_str!("../../docs/SCALE.md");

/// More points than shards, of about a millisecond.
const SWEEP: &str = "\
[base]
preset = \"homogeneous\"
chain.beads = 10
time.duration_s = 5e-4
[grid]
chain.alpha = { from = 1.4, to = 2.0, count = 50 }
";

/// The first block of code in `language` under a heading of the page.
fn block(heading: &str, language: &str) -> &'static str {
    let (_, section) = PAGE.split_once(&format!("\n### {heading}\n")).unwrap();
    let (_, code) = section.split_once(&format!("```{language}\n")).unwrap();
    code.split_once("```").unwrap().0
}

/// Runs a program in whose path our command is the first one, and compares what it has made.
fn makes_the_same_bytes(program: &Path, arguments: &[&str]) {
    let place = Place::new();
    place.write("sweep.toml", SWEEP);
    let command = Path::new(env!("CARGO_BIN_EXE_beadline")).parent().unwrap();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path =
        std::env::join_paths([command.to_owned()].into_iter().chain(std::env::split_paths(&path))).unwrap();
    let mut engine = place.foreign(program, arguments);
    engine.env("PATH", path).env("HOME", place.path(""));
    Running::start(arguments[arguments.len() - 1], engine).wait().exits(0);
    assert_eq!(fs::read_dir(place.path("all/rows")).unwrap().count(), 20);
    place.run("sweep sweep.toml --out alone").exits(0);
    for name in ["results.csv", "results.parquet"] {
        let [all, alone] = ["all", "alone"].map(|dir| fs::read(place.path(dir).join(name)).unwrap());
        assert!(all == alone, "{name}");
    }
}

#[test]
fn gnu_parallel_makes_the_same_bytes() {
    let version = Command::new("parallel").arg("--version").stderr(Stdio::null()).output();
    if !version.is_ok_and(|said| said.stdout.starts_with(b"GNU parallel")) {
        skip("no GNU parallel here (see tests/setup)");
        return;
    }
    makes_the_same_bytes(Path::new("bash"), &["-c", block("GNU parallel", "sh")]);
}

/// Its server and a worker are those of its Python package, in the process that sends the job.
#[test]
fn hyperqueue_makes_the_same_bytes() {
    let Some(python) = python() else { return };
    let job = block("HyperQueue", "python").replace('\n', "\n    ");
    let script = format!(
        "from pathlib import Path\nfrom hyperqueue import LocalCluster\nfrom hyperqueue.cluster import WorkerConfig\n\
         with LocalCluster(str(Path.home() / '.hq-server'), WorkerConfig(cores=2)):\n    {job}"
    );
    makes_the_same_bytes(&python, &["-c", &script]);
}
