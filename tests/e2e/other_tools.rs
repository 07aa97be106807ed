//! Recordings read by tools that others wrote.

use crate::harness::{Place, Running, python};
use std::fs;
use std::path::Path;

/// Python's `mcap` and `mcap-protobuf-support` read a recording, CRCs checked, and get the doubles that
/// stand in our table.
#[test]
fn python_reads_the_same_doubles() {
    let Some(python) = python() else { return };
    let place = Place::new();
    place.run("run --preset homogeneous --name run --duration 4e-3 --impurity 20=0.6e-3").exits(0);
    place.run("impurity run.mcap --bead 0 --bead 20 --bead 21 --bead 199 --out motion.csv").exits(0);
    let script = format!("{}/tests/python/check_recording.py", env!("CARGO_MANIFEST_DIR"));
    let check = place.foreign(&python, [script.as_str(), "run.mcap", "motion.csv"]);
    Running::start("check_recording.py", check).wait().exits(0);
}

/// The same of the results that a recorder took from the bus, and of parts of a recording.
#[test]
fn python_reads_results_and_parts() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let run = "run --preset homogeneous --name run --duration 4e-3 --impurity 20=0.6e-3 --no-record";
    let script = format!("{}/tests/python/check_recording.py", env!("CARGO_MANIFEST_DIR"));
    let check = |arguments: &[&str]| {
        let check = place.foreign(&python, [&[script.as_str()], arguments].concat());
        Running::start("check_recording.py", check).wait().exits(0)
    };
    for (flags, files) in
        [("", "run.mcap"), ("--split-duration 2e-3", "run-part-0001.mcap run-part-0002.mcap")]
    {
        let run = place.start(&format!("{run} --wait-for 5"));
        let consumers = [
            &format!("record --out run.mcap {flags}"),
            "impurity --bead 0 --bead 20 --out motion.csv --force",
            "energies",
            "contacts",
            "pulses",
        ]
        .map(|words| place.start(words));
        run.wait().exits(0);
        for consumer in consumers {
            consumer.wait().exits(0);
        }
        for file in files.split(' ') {
            let table: &[&str] = if flags.is_empty() { &["motion.csv"] } else { &[] };
            check(&[&[file], table].concat());
        }
    }
}

/// A reader that was written from docs/FORMAT.md alone, in Python without any package but `zstandard`, reads new
/// recordings and old ones; and it notices a wrong bit.
#[test]
fn a_reader_from_the_page_alone_reads_the_same_doubles() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let script = format!("{}/tests/python/read_from_the_page.py", env!("CARGO_MANIFEST_DIR"));
    let read = |files: &[&str]| {
        let arguments = [&[script.as_str()], files].concat();
        Running::start(&arguments.join(" "), place.foreign(&python, &arguments)).wait()
    };
    place.run("run --preset homogeneous --name run --duration 4e-3 --impurity 20=0.6e-3").exits(0);
    place.run("impurity run.mcap --bead 0 --bead 20 --bead 199 --out motion.csv").exits(0);
    read(&["run.mcap", "motion.csv"]).exits(0);
    place
        .run("run --preset homogeneous --name gear --duration 1e-3 --method gear5 --record-every-steps 7")
        .exits(0);
    read(&["gear.mcap"]).exits(0);

    for version in ["1.0-kernel-1", "1.0-kernel-2"] {
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(version);
        for entry in fs::read_dir(golden).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|end| end != "json") {
                read(&[path.to_str().unwrap()]).exits(0);
            }
        }
    }

    let mut recording = fs::read(place.path("gear.mcap")).unwrap();
    let middle = recording.len() / 2;
    recording[middle] ^= 1;
    fs::write(place.path("gear.mcap"), recording).unwrap();
    assert_ne!(read(&["gear.mcap"]).code(), Some(0));
}

/// `pyarrow` reads our Parquet tables, with the values of our CSV: also words with commas and values that do
/// not exist.
#[test]
fn pyarrow_reads_the_same_tables() {
    let Some(python) = python() else { return };
    let place = Place::new();
    place.write(
        "s.toml",
        "[base]\npreset = \"homogeneous\"\nchain.beads = 40\ntime.duration_s = 1e-3\n\
         [grid]\n\"chain.impurities\" = [[], [{ bead = 3, mass_kg = 2e-3 }]]\n\"chain.alpha\" = [1.5, 2]\n",
    );
    place.run("sweep s.toml --out s").exits(0);
    place.run("run --preset homogeneous --name run --duration 1e-3").exits(0);
    place.run("impurity run.mcap --bead 0 --out i.csv --events events.csv").exits(0);
    place.run("impurity run.mcap --bead 0 --out i.parquet --events events.parquet").exits(0);
    let script = format!("{}/tests/python/check_table.py", env!("CARGO_MANIFEST_DIR"));
    for table in ["s/results", "i", "events"] {
        let [parquet, csv] = ["parquet", "csv"].map(|form| format!("{table}.{form}"));
        let check = place.foreign(&python, [script.as_str(), &parquet, &csv]);
        Running::start("check_table.py", check).wait().exits(0);
    }
}
