//! `examples/python`, as docs/python/7-without-the-package.md shows it, against real runs and recordings.

use crate::harness::{Place, Running, python};
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

const WALLS_AND_LOADS: &str = r#"
    name = "run"
    [chain]
    beads = 60
    bead_mass_kg = 1e-3
    alpha = 1.5
    stiffness = 1e7
    impurities = [{ bead = 30, mass_kg = 0.6e-3 }]
    [ends]
    left = "fixed"
    right = "fixed"
    [load]
    gravity_m_s2 = 9.81
    precompression_n = 1.0
    [striker]
    bead = 0
    velocity_m_s = 5.0
    [time]
    duration_s = 2e-3
    [integrator]
    method = "rkn4"
"#;

/// `python SCRIPT ARGUMENTS` in `place`; scripts of tests find the modules of the examples.
fn script(place: &Place, python: &Path, script: &str, arguments: &str) -> Command {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = root.join(script);
    let arguments = arguments.split_whitespace().map(AsRef::as_ref);
    let mut command = place.foreign(python, std::iter::once(path.as_os_str()).chain(arguments));
    command.env("PYTHONPATH", root.join("examples/python"));
    command
}

fn start(place: &Place, python: &Path, path: &str, arguments: &str) -> Running {
    Running::start(path, script(place, python, path, arguments))
}

/// The rows of a table of numbers, without its head.
fn rows(text: &str) -> Vec<Vec<f64>> {
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()).collect()
}

/// The energies that `live_energies.py` prints of the run that `words` start, and ours of its recording.
fn energies(place: &Place, python: &Path, words: &str) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let run = place.start(&format!("{words} --wait-for 1 --force"));
    let live = start(place, python, "examples/python/live_energies.py", "run").wait();
    run.wait().exits(0);
    let live = live.exits(0).says(&["run: complete, frames 0 to "]);
    place.run("energies run.mcap --out e.csv --force").exits(0);
    (rows(&live.stdout()), rows(&place.read("e.csv")))
}

/// A lossless consumer in Python gets every frame, and computes our energies to rounding.
#[test]
fn energies_from_python_are_ours() {
    let Some(python) = python() else { return };
    let place = Place::new();
    place.write("loaded.toml", WALLS_AND_LOADS);
    for words in
        ["run --preset homogeneous --name run --duration 4e-3 --impurity 20=0.6e-3", "run loaded.toml"]
    {
        let (live, ours) = energies(&place, &python, words);
        assert!(live.len() > 2000 && live.len() == ours.len(), "{} rows, {} rows", live.len(), ours.len());
        for (live, ours) in live.iter().zip(&ours) {
            assert_eq!(live[..3], ours[..3], "frame, step, time");
            for (live, energy) in live[3..].iter().zip(&ours[3..]) {
                assert!((live - energy).abs() <= 1e-12 * ours[5], "{words}: {live} J, {energy} J");
            }
        }
    }
}

/// What `check_live.py` expects of a consumer: each in its words, beside a run of its own.
#[test]
fn a_consumer_in_python_loses_nothing_in_silence() {
    let Some(python) = python() else { return };
    for (scenario, flags) in [
        ("missing", "--duration 1e-3 --wait-for 1"),
        ("late", "--wait-for 1 --pace 1e-3"),
        ("latest", "--duration 8e-3 --wait-for 1"),
        ("held", "--duration 8e-3 --wait-for 1"),
        ("interrupted", "--wait-for 1"),
        ("killed", "--wait-for 1"),
        ("stuck", "--wait-for 1 --stall-timeout 0.3"),
        ("stopped", "--wait-for 2"),
    ] {
        let place = Place::new();
        let run = place.start(&format!("run --preset homogeneous --name run --no-record {flags}"));
        let arguments = format!("{scenario} {}", run.id());
        start(&place, &python, "tests/python/check_live.py", &arguments).wait().exits(0);
    }
}

/// Arrays of a whole recording, of some of its beads or time, of one that was cut short or damaged; its chain; and how fast
/// they come.
#[test]
fn a_recording_becomes_arrays() {
    let Some(python) = python() else { return };
    let place = Place::new();
    place.run("run --name run --duration 8e-3").exits(0);
    place.run("impurity run.mcap --bead 0 --bead 500 --bead 999 --out motion.csv").exits(0);
    let recording = fs::read(place.path("run.mcap")).unwrap();
    fs::write(place.path("cut.mcap"), &recording[..recording.len() * 2 / 3]).unwrap();
    for (name, place_of_damage) in
        [("no-index.mcap", recording.len() - 200), ("hole.mcap", recording.len() / 2)]
    {
        let mut damaged = recording.clone();
        damaged[place_of_damage] ^= 1;
        fs::write(place.path(name), damaged).unwrap();
    }
    place.write("loaded.toml", WALLS_AND_LOADS);
    place.run("run loaded.toml --name walls").exits(0);
    let arguments = "run.mcap motion.csv cut.mcap no-index.mcap hole.mcap walls.mcap";
    let check = start(&place, &python, "tests/python/check_reading.py", arguments).wait().exits(0);
    // how fast it was is a report
    let said = std::io::stderr().write_all(check.stdout().as_bytes());
    said.unwrap();
    let shown = start(&place, &python, "examples/python/read_recording.py", "run.mcap").wait().exits(0);
    assert!(shown.stdout().contains("states of 1000 beads, complete"), "{}", shown.stdout());
    let read = start(&place, &python, "examples/python/read_recording.py", "hole.mcap").wait();
    assert_ne!(read.code(), Some(0));
}
