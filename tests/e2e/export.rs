//! `beadline export`: states for other programs, read by what others wrote.

use crate::harness::{Place, Running, python, wait_until};
use std::fs;

/// A short chain between walls, with an impurity, so that no two of its beads and contacts are the same.
const CHAIN: &str = r#"
    [chain]
    beads = 12
    bead_mass_kg = 1e-3
    alpha = 1.5
    stiffness = 1e7
    impurities = [{ bead = 5, mass_kg = 0.6e-3 }]
    contacts = [{ contact = 3, stiffness = 2e7 }]
    [load]
    precompression_n = 2.0
    [ends]
    left = "fixed"
    right = "fixed"
    [striker]
    bead = 0
    velocity_m_s = 1.0
    [time]
    duration_s = 1e-3
    dt_s = 2e-6
    "#;

/// The last step of that run.
const LAST: u64 = 500;

/// The formats of arrays, by what their files' names end with.
const FORMATS: [&str; 3] = ["npz", "csv", "parquet"];

/// That run as `full.mcap`, every step recorded.
fn recorded() -> Place {
    let place = Place::new();
    place.write("chain.toml", CHAIN);
    place.run("run chain.toml --name full").exits(0);
    place
}

/// Compares exports with `full.mcap`: each `FILE=STEPS=BEADS`, as `check_export.py` has them.
#[track_caller]
fn compare(place: &Place, exports: &[String]) {
    let Some(python) = python() else { return };
    let script = format!("{}/tests/python/check_export.py", env!("CARGO_MANIFEST_DIR"));
    let arguments = [&[script, "full.mcap".to_owned()], exports].concat();
    let check = place.foreign(python, &arguments);
    Running::start(&arguments.join(" "), check).wait().exits(0);
}

/// Exports with the same flags to every format of arrays.
#[track_caller]
fn export(place: &Place, file: &str, to: &str, flags: &str, expected: &str) -> Vec<String> {
    let to_each = FORMATS.into_iter().map(|format| {
        place.run(&format!("export {file} --out {to}.{format} {flags}")).exits(0);
        format!("{to}.{format}={expected}")
    });
    to_each.collect()
}

#[test]
fn every_format_holds_the_states_of_the_recording() {
    let place = recorded();
    let exports = [
        export(&place, "full.mcap", "all", "", &format!("0:{LAST}:1=0:12")),
        export(&place, "full.mcap", "time", "--from 0.99e-4 --until 3.01e-4", "50:150:1=0:12"),
        export(&place, "full.mcap", "beads", "--beads 3..7", &format!("0:{LAST}:1=3:7")),
        export(&place, "full.mcap", "one", "--beads 11..", &format!("0:{LAST}:1=11:12")),
        export(
            &place,
            "full.mcap",
            "part",
            "--beads ..=5 --from 0.99e-4 --every-steps 7",
            &format!("50:{LAST}:7=0:6"),
        ),
    ];
    compare(&place, &exports.concat());
}

#[test]
fn a_sparse_recording_is_exported_as_it_is_or_with_every_step() {
    let place = recorded();
    place.run("run chain.toml --name sparse --publish-every-steps 10 --record-every-steps 40").exits(0);
    let exports = [
        export(&place, "sparse.mcap", "recorded", "", &format!("0:{LAST}:40+=0:12")),
        export(&place, "sparse.mcap", "every", "--every-step", &format!("0:{LAST}:1=0:12")),
        export(
            &place,
            "sparse.mcap",
            "part",
            "--every-step --jobs 2 --from 0.99e-4 --until 2.01e-4 --beads 4..=6",
            "50:100:1=4:7",
        ),
        // those that were recorded, frames that were not, and steps between frames
        export(&place, "sparse.mcap", "eighty", "--every-steps 80", &format!("0:{LAST}:80=0:12")),
        export(&place, "sparse.mcap", "thirty", "--every-steps 30", &format!("0:{LAST}:30=0:12")),
        export(
            &place,
            "sparse.mcap",
            "seven",
            "--every-steps 7 --from 2.99e-4",
            &format!("150:{LAST}:7=0:12"),
        ),
    ];
    compare(&place, &exports.concat());
}

#[test]
fn the_summary_says_what_was_exported() {
    let place = recorded();
    let summary =
        place.run("export full.mcap --to npz --out e.npz --until 1.01e-4 --beads 2.. --json").exits(0);
    let summary = summary.json();
    assert_eq!(summary["states"], 51);
    assert_eq!([&summary["first_step"], &summary["last_step"]], [0, 50]);
    assert_eq!([&summary["first_bead"], &summary["last_bead"]], [2, 11]);
    assert_eq!(summary["end"], "as asked");
    assert_eq!(summary["bytes"], fs::metadata(place.path("e.npz")).unwrap().len());
    let text = place.run("export full.mcap --out e.csv").exits(0).stdout();
    for word in ["501", "steps 0 to 500", "0 to 11", "e.csv, e.chain.csv, e.manifest.json"] {
        assert!(text.contains(word), "`{word}` is not in:\n{text}");
    }
}

#[test]
fn what_cannot_be_exported_is_refused_before_anything_is_written() {
    let place = recorded();
    let before = listed(&place);
    let refused = |words: &str, says: &[&str]| {
        place.run(&format!("export {words}")).exits(2).says(says);
        assert_eq!(listed(&place), before, "{words}");
    };
    refused("live --out e.npz", &["live run", "beadline record live"]);
    refused("live:full --out e.npz", &["beadline record live:full"]);
    refused("missing.mcap --out e.npz", &["missing.mcap"]);
    refused("full.mcap --out e", &["e: ", "--to", "npz, csv, parquet, foxglove"]);
    refused("full.mcap --out e.csv --to npz", &["csv", "npz"]);
    refused("full.mcap --out full.mcap --to npz", &["source itself"]);
    refused("full.mcap --out none/e.npz", &["directory"]);
    // nor by what goes with a table
    fs::copy(place.path("full.mcap"), place.path("e.chain.csv")).unwrap();
    place.run("export e.chain.csv --out e.csv --force").exits(2).says(&["source itself"]);
    fs::remove_file(place.path("e.chain.csv")).unwrap();
    refused("full.mcap --out e.npz --beads 3..13", &["--beads 3..13", "beads 0 to 11"]);
    refused("full.mcap --out e.npz --beads 3..3", &["at least one bead"]);
    refused("full.mcap --out e.npz --beads 3", &["100..200"]);
    refused("full.mcap --out e.npz --from 2e-4 --until 1e-4", &["--until"]);
    refused("full.mcap --out e.npz --from 1.003e-4 --until 1.015e-4", &["no state", "--every-step"]);
    refused("full.mcap --out e.npz --every-steps 7 --every-step", &["cannot be used with"]);
}

#[test]
fn nothing_is_replaced_without_force() {
    let place = recorded();
    for format in FORMATS {
        let words = format!("export full.mcap --out e.{format}");
        place.write(&format!("e.{format}"), "mine");
        place.run(&words).exits(2).says(&["exists already", "--force"]);
        assert_eq!(place.read(&format!("e.{format}")), "mine");
        place.run(&format!("{words} --force")).exits(0);
    }
    // also what goes with a table
    fs::remove_file(place.path("e.csv")).unwrap();
    fs::remove_file(place.path("e.chain.csv")).unwrap();
    place.run("export full.mcap --out e.csv").exits(2).says(&["e.manifest.json", "--force"]);
    assert!(!place.path("e.csv").exists() && !place.path("e.csv.partial").exists());
}

/// A recording that was cut off in its second chunk or later.
#[test]
fn what_an_unfinished_recording_holds_is_exported() {
    let place = Place::new();
    place.run("run --preset homogeneous --name full --duration 4e-3").exits(0);
    let whole = fs::read(place.path("full.mcap")).unwrap();
    fs::write(place.path("torn.mcap"), &whole[..whole.len() * 3 / 4]).unwrap();
    let mut exports = Vec::new();
    for format in FORMATS {
        let ended = place.run(&format!("export torn.mcap --out torn.{format} --beads 0..20 --json")).exits(3);
        let summary = ended.says(&["not finished, or is damaged", "the exported states end"]).json();
        let last = summary["last_step"].as_u64().unwrap();
        assert!(last > 0 && summary["end"] == "unfinished", "{summary}");
        exports.push(format!("torn.{format}=0:{last}:1=0:20"));
    }
    compare(&place, &exports);
}

#[test]
fn an_interrupt_leaves_nothing() {
    let place = Place::new();
    place.run("run --preset light-impurity --name long --record-every-steps 5000").exits(0);
    let before = listed(&place);
    for format in FORMATS {
        let running = place.start(&format!("export long.mcap --every-step --out e.{format}"));
        wait_until("the export's beginning", || {
            place.path(format!("e.{format}.partial")).exists().then_some(())
        });
        running.signal("INT");
        running.wait().exits(3).says(&["stopped: nothing was written"]);
        assert_eq!(listed(&place), before, "{format}");
    }
}

/// The same export of a run and of one that is twenty times as long.
#[test]
fn memory_does_not_grow_with_the_recording() {
    let place = Place::new();
    for (name, duration) in [("short", 4e-3), ("long", 0.08)] {
        let run = "run --preset light-impurity --record-every-steps 1000";
        place.run(&format!("{run} --name {name} --duration {duration}")).exits(0);
    }
    for format in FORMATS {
        let peak = |name: &str| {
            let beads = "--beads 0..100";
            let words =
                format!("export {name}.mcap --every-step --jobs 1 {beads} --out {name}.{format} --json");
            let (ended, peak_kb) = place.start(&words).wait_for_peak();
            assert!(ended.exits(0).json()["states"].as_u64().unwrap() > 2000);
            peak_kb
        };
        let (short, long) = (peak("short"), peak("long"));
        // the long one holds 88 MB of states, all formats keep less than 30 MB of them
        assert!(long < short + 40_000, "{format}: {short} kB, and {long} kB for the long run");
    }
}

/// The names of the files in the directory.
fn listed(place: &Place) -> Vec<String> {
    let files = fs::read_dir(place.path("")).unwrap();
    let mut names: Vec<_> = files.map(|file| file.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
