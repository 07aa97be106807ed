//! The command in a build without live streams (`--no-default-features`).

use crate::harness::Place;
use serde_json::Value;
use std::fs;

/// Each says so in one line, and leaves nothing.
#[test]
fn commands_that_need_live_streams_say_that_there_are_none() {
    let place = Place::new();
    let of_the_bus =
        ["demo --out shock", "ls", "top", "top live:a --rate 2", "record live --out a.mcap", "replay a.mcap"];
    let of_a_live_run = ["energies live", "plot live:a --what velocity --out a.svg", "view live:a"];
    let of_consumers = ["run --no-record", "run --wait-for 2", "run --stall-timeout 30"];
    for words in of_the_bus.iter().chain(&of_a_live_run).chain(&of_consumers) {
        let ended =
            place.run(words).exits(2).says(&["without live streams", "cargo install", "beadline run"]);
        assert_eq!(ended.stderr().trim_end().lines().count(), 1, "{words}: {}", ended.stderr());
        assert_eq!(ended.stdout(), "", "{words}");
    }
    assert_eq!(fs::read_dir(place.path(".")).unwrap().count(), 0, "files were left");
}

/// It records what a build with live streams records, and publishes nothing.
#[test]
fn a_run_is_recorded_and_published_nowhere() {
    let place = Place::new();
    let summary = place.run("run --preset homogeneous --duration 1e-3 --out run.mcap --json").exits(0);
    let summary: Value = summary.json();
    assert_eq!(summary["frames_published"], 0);
    assert_eq!(summary["frames_recorded"].as_u64(), summary["steps"].as_u64().map(|steps| steps + 1));
    place.run("verify run.mcap").exits(0);
    place.run("energies run.mcap --out energies.csv --figure energies.svg").exits(0);
    place.run("ls .").exits(0);
}
