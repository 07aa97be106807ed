//! Recordings: bad ones are refused, good ones are kept.

use crate::harness::{Place, Running, skip};
use std::fs;
use std::process::Command;

/// A quick run, recorded as `run.mcap`.
fn recorded(place: &Place) -> Vec<u8> {
    place.run("run --preset homogeneous --name run --duration 2e-3").exits(0);
    fs::read(place.path("run.mcap")).unwrap()
}

#[cfg(not(feature = "remote"))]
#[test]
fn a_url_says_how_to_get_a_command_that_reads_it() {
    let ended = Place::new().run("info s3://bucket/run.mcap").exits(2);
    ended.says(&["s3://bucket/run.mcap", "`cargo install --path . --features remote`"]);
}

#[test]
fn info_shows_what_is_in_a_recording() {
    let place = Place::new();
    recorded(&place);
    let text = place.run("info run.mcap").exits(0).stdout();
    for word in [
        "finished and complete",
        "200 beads",
        "α = 1.5",
        "rkn4",
        "/state",
        "beadline.v1.ChainState",
        "/summary",
        ": 1",
    ] {
        assert!(text.contains(word), "`{word}` is not in:\n{text}");
    }
    let info = place.run("info run.mcap --json").exits(0).json();
    let states = info["manifest"]["physics"]["step_count"].as_u64().unwrap() + 1;
    for channel in info["channels"].as_array().unwrap() {
        let expected = if channel["topic"] == "/chain" { 1 } else { states };
        assert_eq!(channel["messages"], expected, "{channel}");
    }
    assert_eq!(info["file_bytes"], fs::metadata(place.path("run.mcap")).unwrap().len());
}

#[test]
fn files_that_are_no_recordings_are_refused() {
    let place = Place::new();
    let recording = recorded(&place);
    place.write("text.mcap", "this is not MCAP, but text that is long enough to be looked at");
    place.write("empty.mcap", "");
    let sinks: [(&str, &[&str]); 3] = [
        ("text.mcap", &["text.mcap", "MCAP"]),
        ("empty.mcap", &["empty.mcap"]),
        ("missing.mcap", &["missing.mcap", "No such file"]),
    ];
    for (file, says) in sinks {
        place.run(&format!("info {file}")).exits(2).says(says);
        place.run(&format!("energies {file}")).exits(2).says(says);
    }
    // an MCAP file of somebody else: only the profile tells at first
    let foreign = String::from_utf8_lossy(&recording[..40]).find("beadline").unwrap();
    let mut other = recording;
    other[foreign..foreign + 8].copy_from_slice(b"somebody");
    fs::write(place.path("other.mcap"), other).unwrap();
    place.run("energies other.mcap").exits(2).says(&["other.mcap", "Beadline"]);
}

/// What a kill or a full disk leaves: whole chunks are read, and the end is said to be missing.
#[test]
fn a_truncated_recording_gives_what_it_has() {
    let place = Place::new();
    let recording = recorded(&place);
    fs::write(place.path("cut.mcap"), &recording[..recording.len() * 3 / 4]).unwrap();
    place.run("info cut.mcap").exits(3);
    let energies = place.run("energies cut.mcap --out cut.csv --json").exits(3).says(&["not finished"]);
    let summary = energies.json();
    assert_eq!(summary["end"], "unfinished");
    place.run("energies run.mcap --out whole.csv").exits(0);
    let (cut, whole) = (place.read("cut.csv"), place.read("whole.csv"));
    assert!(whole.starts_with(&cut) && cut.lines().count() > 100, "{} rows", cut.lines().count());
}

#[test]
fn a_recording_of_a_newer_schema_version_is_refused_with_both_versions() {
    let place = Place::new();
    recorded(&place);
    // the same length, so that nothing moves; the manifest's own checksum comes after its version
    let mut bytes = fs::read(place.path("run.mcap")).unwrap();
    let at = find(&bytes, b"schema_version").expect("the manifest is not compressed");
    let digit = at + bytes[at..].iter().position(u8::is_ascii_digit).unwrap();
    bytes[digit] = b'7';
    fs::write(place.path("newer.mcap"), bytes).unwrap();
    place.run("energies newer.mcap").exits(2).says(&["7.1", "1.1"]);
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|window| window == what)
}

#[test]
fn nothing_is_overwritten_without_force() {
    let place = Place::new();
    let recording = recorded(&place);
    place
        .run("run --preset homogeneous --name run --duration 1e-4")
        .exits(2)
        .says(&["run.mcap", "exists", "--force"]);
    assert!(fs::read(place.path("run.mcap")).unwrap() == recording);
    place.write("mine.csv", "mine");
    place.run("energies run.mcap --out mine.csv").exits(2).says(&["mine.csv", "--force"]);
    place.write("mine.svg", "mine");
    place.run("energies run.mcap --figure mine.svg").exits(2).says(&["mine.svg", "--force"]);
    assert_eq!((place.read("mine.csv"), place.read("mine.svg")), ("mine".into(), "mine".into()));
    place.run("energies run.mcap --out mine.csv --figure mine.svg --force").exits(0);
    place.run("run --preset homogeneous --name run --duration 1e-4 --force").exits(0);
    assert_ne!(place.read("mine.csv"), "mine");
}

#[test]
fn one_of_a_kind_is_no_plural() {
    let place = Place::new();
    place
        .run("run --beads 20 --impurity none --duration 1e-7 --dt 1e-7 --out one.mcap")
        .exits(0)
        .says(&["1 step of", "2 frames of"]);
    let text = place.run("info one.mcap").exits(0).stdout();
    assert!(text.contains(" 1 message\n") && text.contains(" 2 messages\n"), "{text}");
    let run =
        place.start("run --beads 20 --impurity none --duration 1e-4 --name one --no-record --wait-for 1");
    place.wait_for_run("one", |run| run.state.as_str() == "waiting");
    place.run("record --out part.mcap --split-duration 1e-6").exits(0);
    run.wait().exits(0).says(&["waiting for 1 lossless consumer\n"]);
    let text = place.run("info part-part-0001.mcap").exits(0).stdout();
    assert!(text.contains(" 0 s to 0 s\n"), "one state has no interval: {text}");
}

/// A flag that is passed over would be believed to be obeyed.
#[test]
fn flags_that_mean_nothing_to_the_source_are_refused() {
    let place = Place::new();
    recorded(&place);
    place.run("contacts run.mcap --out map.mcap").exits(0);
    for flag in ["--latest", "--timeout 5", "--no-publish"] {
        let name = flag.split(' ').next().unwrap();
        for source in ["energies run.mcap", "contacts run.mcap", "contacts map.mcap"] {
            place.run(&format!("{source} {flag}")).exits(2).says(&[name, "live run", "is a recording"]);
        }
    }
    place.run("energies --jobs 2").exits(2).says(&["--jobs", "live is a live run"]);
    for flag in ["--from 1e-5", "--until 1e-4", "--every-step", "--jobs 2", "--tolerance 1e-9"] {
        let name = flag.split(' ').next().unwrap();
        place.run(&format!("contacts map.mcap {flag}")).exits(2).says(&[name, "map of contacts"]);
    }
}

#[test]
fn outputs_that_make_no_sense_are_refused() {
    let place = Place::new();
    let recording = recorded(&place);
    place.run("energies run.mcap --out e.xlsx").exits(2).says(&["e.xlsx", ".csv"]);
    place.run("impurity run.mcap --out a.csv --events a.csv").exits(2).says(&["a.csv", "two outputs"]);
    place.run("contacts run.mcap --out run.mcap --force").exits(2).says(&["run.mcap", "source itself"]);
    fs::create_dir(place.path("dir.svg")).unwrap();
    place
        .run("energies run.mcap --figure dir.svg --force")
        .exits(2)
        .says(&["dir.svg", "no file that could be replaced"]);
    assert!(fs::read(place.path("run.mcap")).unwrap() == recording);
}

/// Damage in the middle: the rows before it are kept, under the table's own name, and the exit code says
/// that something is missing.
#[test]
fn a_damaged_recording_gives_what_stands_before_the_damage() {
    let place = Place::new();
    let mut recording = recorded(&place);
    let middle = recording.len() / 2;
    recording[middle] ^= 1;
    fs::write(place.path("damaged.mcap"), recording).unwrap();
    place.run("energies damaged.mcap --out damaged.csv").exits(3).says(&["damaged.mcap", "CRC"]);
    place.run("energies run.mcap --out whole.csv").exits(0);
    let (damaged, whole) = (place.read("damaged.csv"), place.read("whole.csv"));
    assert!(whole.starts_with(&damaged) && damaged.lines().count() > 100, "{} rows", damaged.lines().count());
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_any_work() {
    let place = Place::new();
    recorded(&place);
    let nowhere = "no/such/place.mcap";
    let taken = "taken.mcap";
    place.write(taken, "mine");
    for command in
        ["run", "record", "record --split-duration 1", "thin run.mcap --every-steps 10", "expand run.mcap"]
    {
        place.run(&format!("{command} --out {nowhere}")).exits(2).says(&[nowhere]);
    }
    for command in ["run", "record", "thin run.mcap --every-steps 10", "expand run.mcap", "recover run.mcap"]
    {
        place.run(&format!("{command} --out {taken}")).exits(2).says(&[taken, "exists", "--force"]);
    }
    place.run(&format!("recover run.mcap --out {nowhere}")).exits(2).says(&[nowhere]);
    place.run("contacts run.mcap --figure no/such/place.svg").exits(2).says(&["no/such/place.svg"]);
    for analysis in ["energies", "impurity", "contacts", "pulses", "deformation --contact 5"] {
        place
            .run(&format!("{analysis} run.mcap --out no/such/place.csv"))
            .exits(2)
            .says(&["no/such/place.csv"]);
        place.write("taken.csv.partial", "mine");
        place.run(&format!("{analysis} run.mcap --out taken.csv")).exits(2).says(&["taken.csv.partial"]);
    }
    // what another command left unfinished is in the way as well
    place.write("next.mcap.partial", "mine");
    place.run("run --out next.mcap").exits(2).says(&["next.mcap.partial", "--force"]);
    assert_eq!((place.read(taken), place.read("next.mcap.partial")), ("mine".into(), "mine".into()));
    place.write("s.toml", &place.run("sweep --example").exits(0).stdout());
    for command in ["sweep s.toml", "demo"] {
        place.run(&format!("{command} --out {taken}")).exits(2).says(&[taken]);
    }
}

#[test]
fn a_run_says_what_it_will_write_and_refuses_what_cannot_fit() {
    let place = Place::new();
    place.run("run --preset homogeneous --duration 1e-4").exits(0).says(&[
        "frames",
        "free",
        "homogeneous.mcap",
    ]);
    let refused = place.run("run --beads 10000000 --duration 100 --impurity none");
    refused.exits(1).says(&["free", "record_every_steps"]);
    assert!(!place.path("light-impurity.mcap.partial").exists());
}

/// A disk that fills up in the middle: a clear error, and what was recorded stays readable.
#[test]
fn a_full_disk_leaves_a_readable_part() {
    let place = Place::new();
    fs::create_dir(place.path("small")).unwrap();
    let program = env!("CARGO_BIN_EXE_beadline");
    let script = format!(
        "mount -t tmpfs -o size=30m tmpfs small && {{ {program} run --beads 300 --impurity 150=0.6e-3 --out small/run.mcap; \
         code=$?; cp small/run.mcap.partial part.mcap; exit $code; }}"
    );
    let Some(ended) = in_a_namespace(&place, &script) else { return };
    ended.exits(1).says(&["run.mcap.partial", "No space left", "stays in"]);
    place.run("energies part.mcap --out part.csv").exits(3);
    assert!(place.read("part.csv").lines().count() > 1000);
}

/// Runs a shell script with mounts of its own, if this machine allows that.
pub(crate) fn in_a_namespace(place: &Place, script: &str) -> Option<crate::harness::Ended> {
    let allowed = Command::new("unshare").args(["-rm", "true"]).output();
    if !allowed.is_ok_and(|output| output.status.success()) {
        skip(
            "`unshare -rm` is not allowed here (root may, and user namespaces allow it): no disk can be full",
        );
        return None;
    }
    Some(Running::start(script, place.foreign("unshare", ["-rm", "sh", "-c", script])).wait())
}
