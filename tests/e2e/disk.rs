//! Disks that fill up, that refuse, that fail.

use crate::harness::{Ended, Place, Running};
use crate::recordings::in_a_namespace;
use recording::RecordingInfo;
use schemas::frame::EndReason;
use std::fs;

/// Some 20 MB of recording, which is not refused for less.
const CHAIN: &str = "run --beads 300 --impurity 150=0.6e-3 --duration 0.03 --name run";

const PROGRAM: &str = env!("CARGO_BIN_EXE_beadline");

/// Runs `script` in a shell whose files cannot be larger than 8 MiB: writing beyond that fails as on a full disk.
fn with_small_files(place: &Place, script: &str) -> Running {
    let script = format!("trap '' XFSZ; ulimit -f 8192; {script}");
    Running::start(&script, place.foreign("bash", ["-c", &script]))
}

fn fails(ended: Ended, what: &str) {
    ended.exits(1).says(&["run.mcap.partial", what, "accepted frames are not in it", "--resume"]);
}

/// What is left after the disk was full is valid and goes on elsewhere.
#[test]
fn a_full_disk_costs_nothing_that_was_written() {
    let place = Place::new();
    fs::create_dir(place.path("small")).unwrap();
    let script = format!(
        "mount -t tmpfs -o size=8m tmpfs small && {{ {PROGRAM} {CHAIN} --out small/run.mcap; code=$?; \
         {PROGRAM} info small/run.mcap.partial >info.txt; \
         {PROGRAM} run --resume small/run.mcap.partial && exit 100; \
         {PROGRAM} run --resume small/run.mcap.partial --out run.mcap || exit 101; \
         ls small; exit $code; }}"
    );
    let Some(ended) = in_a_namespace(&place, &script) else { return };
    assert_eq!(ended.stdout().lines().last(), Some("run.mcap.partial"), "what the failed resume left");
    fails(ended, "No space left");
    assert!(place.read("info.txt").contains("unfinished"));
    place.run("verify run.mcap").exits(0);
    assert!(RecordingInfo::read(&place.path("run.mcap")).unwrap().is_complete());
}

/// The error comes with the frames that it costs, consumers hear of it, and the run goes on when it is told to.
#[test]
fn an_error_in_mid_run_is_told_to_everybody() {
    let place = Place::new();
    let run = with_small_files(&place, &format!("exec {PROGRAM} {CHAIN} --wait-for 1"));
    let consumer = place.start("energies live:run --json");
    fails(run.wait(), "File too large");
    let consumer = consumer.wait().exits(3).json();
    assert_eq!(consumer["end"], "failed");
    let info = RecordingInfo::read(&place.path("run.mcap.partial")).unwrap();
    assert!(info.damage.is_none() && !info.finished && info.frames() > 1000, "{info:?}");
    let verified = place.run("verify run.mcap.partial").exits(3).stdout();
    assert!(verified.contains("proven as far as it goes"), "{verified}");
    place.run("run --resume run.mcap.partial").exits(0);
    let info = RecordingInfo::read(&place.path("run.mcap")).unwrap();
    assert_eq!(info.end.map(|end| end.reason), Some(EndReason::Complete));
}

#[test]
fn a_directory_that_cannot_be_written_is_a_clear_error() {
    let place = Place::new();
    fs::create_dir(place.path("fixed")).unwrap();
    let script = format!(
        "mount -t tmpfs -o ro tmpfs fixed && exec {PROGRAM} run --preset homogeneous --duration 1e-4 --out fixed/run.mcap"
    );
    let Some(ended) = in_a_namespace(&place, &script) else { return };
    ended.exits(1).says(&["fixed/run.mcap.partial", "Read-only file system"]);
}
