//! A recorder that attaches to a live run.

use crate::harness::{Ended, Place, wait_until};
use crate::recordings::in_a_namespace;
use bus::{AttachOptions, Delivery, LiveSource, ResultPublisher};
use mcap::MessageStream;
use schemas::frame::FrameSource as _;
use schemas::results::{ResultColumns, Topic};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::sync::Arc;

const SMALL: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 0.012 --name small";

/// The messages of a recording: topic, log time, sequence and bytes, each topic in the order of the file.
type Messages = BTreeMap<String, Vec<(u64, u32, Vec<u8>)>>;

fn messages(place: &Place, file: &str) -> Messages {
    let bytes = fs::read(place.path(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
    let mut messages = Messages::new();
    for message in MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let whole = (message.log_time, message.sequence, message.data.into_owned());
        messages.entry(message.channel.topic.clone()).or_default().push(whole);
    }
    messages
}

/// Varints and doubles of a protobuf message as bits, by their field numbers; packed ones are doubles, except for
/// field 4, which numbers beads and pulses.
fn fields(message: &[u8]) -> BTreeMap<u64, Vec<u64>> {
    fn varint(rest: &mut &[u8]) -> u64 {
        let (mut value, mut shift) = (0, 0);
        loop {
            let byte = rest[0];
            *rest = &rest[1..];
            value |= u64::from(byte & 0x7f) << shift;
            shift += 7;
            if byte < 0x80 {
                return value;
            }
        }
    }
    fn double(rest: &mut &[u8]) -> u64 {
        let (bytes, after) = rest.split_first_chunk::<8>().unwrap();
        *rest = after;
        u64::from_le_bytes(*bytes)
    }
    let (mut rest, mut fields) = (message, BTreeMap::<u64, Vec<u64>>::new());
    while !rest.is_empty() {
        let tag = varint(&mut rest);
        let values = fields.entry(tag >> 3).or_default();
        match tag & 7 {
            0 => values.push(varint(&mut rest)),
            1 => values.push(double(&mut rest)),
            2 => {
                let length = usize::try_from(varint(&mut rest)).unwrap();
                let (mut packed, after) = rest.split_at(length);
                rest = after;
                while !packed.is_empty() {
                    values.push(if tag >> 3 == 4 { varint(&mut packed) } else { double(&mut packed) });
                }
            }
            other => panic!("wire type {other}"),
        }
    }
    fields
}

/// The rows of a table as bits of doubles, after frame, step and time.
fn table(place: &Place, file: &str) -> Vec<Vec<u64>> {
    let number = |field: &str| if field.is_empty() { f64::NAN } else { field.parse().unwrap() };
    let row = |line: &str| line.split(',').skip(3).map(|field| number(field).to_bits()).collect();
    place.read(file).lines().skip(1).map(row).collect()
}

/// The parts of a recording, in order.
fn parts(ended: &Value) -> Vec<String> {
    let parts = ended["parts"].as_array().unwrap().iter();
    parts.map(|part| part["path"].as_str().unwrap().to_owned()).collect()
}

/// A recorder of `small`, started and attached.
fn attached(place: &Place, flags: &str) -> crate::harness::Running {
    let before = place.wait_for_run("small", |_| true).lossless;
    let recorder = place.start(&format!("record live:small --json {flags}"));
    place.wait_for_run("small", |run| run.lossless > before);
    recorder
}

/// The recording of `record` is that of the run itself, and has every row that stands in the tables.
#[test]
fn states_and_results_are_recorded_to_the_bit() {
    let place = Place::new();
    // the recorder comes last, with some publishers there already, and then again first
    for recorder_is_first in [true, false] {
        let run = place.start(&format!("{SMALL} --wait-for 5 --out run.mcap --force --json"));
        let record = "--out recorded.mcap --force";
        let first = recorder_is_first.then(|| attached(&place, record));
        let analyses = [
            "energies --out energies.csv --force",
            "impurity --bead 0 --bead 60 --out impurity.csv --force",
            "contacts --out map.mcap --force",
            "pulses --force",
        ]
        .map(|words| place.start(words));
        let recorder = first.unwrap_or_else(|| {
            place.wait_for_run("small", |run| run.lossless == 4);
            place.start(&format!("record live:small --json {record}"))
        });
        let frames = run.wait().exits(0).json()["frames_published"].as_u64().unwrap();
        let recorded = recorder.wait().exits(0).json();
        for analysis in analyses {
            analysis.wait().exits(0);
        }
        assert_eq!((&recorded["end"], &recorded["first_frame"]), (&"complete".into(), &0.into()));
        assert_eq!(
            (recorded["frames_received"].as_u64(), recorded["states"].as_u64()),
            (Some(frames), Some(frames))
        );
        let (ours, theirs) = (messages(&place, "recorded.mcap"), messages(&place, "run.mcap"));
        for topic in ["/chain", "/state", "/summary"] {
            assert!(ours[topic] == theirs[topic], "{topic} differs");
        }
        for topic in ["energies", "impurity", "contacts", "pulses"] {
            let rows = &recorded["results"][topic];
            assert_eq!(rows["rows"].as_u64(), Some(frames), "{recorder_is_first} {topic}: {rows}");
            assert_eq!(ours[&format!("/{topic}")].len() as u64, frames);
        }
        assert!(ours["/contacts"] == messages(&place, "map.mcap")["/contacts"], "the classes differ");
        let energies: Vec<Vec<u64>> = ours["/energies"]
            .iter()
            .map(|row| fields(&row.2).into_iter().skip_while(|f| f.0 < 4).flat_map(|f| f.1).collect())
            .collect();
        assert!(energies == table(&place, "energies.csv"), "the energies differ");
        for (row, expected) in ours["/impurity"].iter().zip(table(&place, "impurity.csv")) {
            let row = fields(&row.2);
            assert_eq!(row[&4], [0, 60]);
            let motions: Vec<u64> =
                (0..2).flat_map(|bead| [5, 6, 7, 8].map(|field| row[&field][bead])).collect();
            assert_eq!(motions, expected);
        }
        let pulses = fields(&ours["/pulses"].last().unwrap().2);
        assert!(pulses.contains_key(&4) && pulses[&4].len() == pulses[&8].len(), "{pulses:?}");
    }
    let text = place.run("verify recorded.mcap").exits(0).stdout();
    assert!(text.contains("rows of `/pulses`, by the states"), "{text}");
    place.run("energies recorded.mcap --out again.csv").exits(0);
    assert_eq!(place.read("again.csv"), place.read("energies.csv"));
}

/// Rows that were published before the recorder listened are missing from its recording, and it says so.
#[test]
fn rows_before_the_recorder_listened_are_said_to_be_missing() {
    const COLUMNS: &str = "kinetic_j,potential_j,total_j,left_j,split_j,right_j,dissipated_j,relative_drift,inbound_j,\
                           corrected_j,driven_j";
    for before in [1, 0] {
        let place = Place::new();
        let run = place.start(&format!("{SMALL} --wait-for 1 --no-record --json"));
        let name = place.wait_for_run("small", |_| true).name;
        let bus = place.bus();
        let live =
            LiveSource::attach(&bus, Some(&name), Delivery::Latest, &AttachOptions::default()).unwrap();
        let (stream, manifest) = (live.stream(), live.manifest().clone());
        drop(live);
        let columns = ResultColumns { width: 11, names: COLUMNS.into(), tolerance_m: None };
        let topic = Topic::results("energies").unwrap();
        let mut rows =
            ResultPublisher::<f64>::create(&bus, &name, topic, stream, &columns, Arc::default()).unwrap();
        let mut publish = |frame| {
            let step = manifest.step_of_frame(frame);
            rows.publish(frame, step, manifest.physics.time_s(step), &[0.0; 11]).unwrap();
        };
        (0..before).for_each(&mut publish);
        let recorder = place.start("record live:small --json --out recorded.mcap");
        // it has subscribed to the rows before it lets the run begin
        let frames = run.wait().exits(0).json()["frames_published"].as_u64().unwrap();
        (before..frames).for_each(&mut publish);
        rows.finish().unwrap();
        let recorded = recorder.wait();
        let recorded = if before > 0 {
            recorded.exits(3).says(&["energies: no rows of frames 0 to 0"])
        } else {
            recorded.exits(0)
        };
        let found = &recorded.json()["results"]["energies"];
        assert_eq!(found["rows"], frames - before, "{found}");
        let missed = if before > 0 { serde_json::json!([[0, 0]]) } else { serde_json::json!([]) };
        assert_eq!(found["missed"], missed, "{found}");
    }
}

/// What was before is said, is not missing from the file, and can be had.
#[test]
fn a_recorder_that_comes_late_says_what_it_has_not() {
    let place = Place::new();
    let run =
        place.start(&format!("{SMALL} --pace 0.004 --wait-for 1 --record-every-steps 10 --out run.mcap"));
    let early = attached(&place, "--out early.mcap");
    place.wait_for_run("small", |run| run.step > 200);
    let late = attached(&place, "--out late.mcap");
    let whole = attached(&place, "--out whole.mcap --from-start");
    run.wait().exits(0);
    early.wait().exits(0);
    let late = late.wait().exits(0).says(&["frames 0 to", "not recorded", "--from-start"]).json();
    whole.wait().exits(0);
    let first = late["first_frame"].as_u64().unwrap();
    assert!(first > 200 && late["frames_missed"] == 0, "{late}");
    let (run, late) = (messages(&place, "run.mcap"), messages(&place, "late.mcap"));
    for file in ["early.mcap", "whole.mcap"] {
        assert!(messages(&place, file) == run, "{file} differs");
    }
    // after the first one, which it has anyway
    let due = late["/state"].iter().skip(usize::from(!first.is_multiple_of(10))).collect::<Vec<_>>();
    assert!(run["/state"].iter().collect::<Vec<_>>().ends_with(&due));
    let found = place.run("verify late.mcap --json").exits(0).json();
    assert_eq!((found["first_step"].as_u64(), found["proven"].as_bool()), (Some(first), Some(true)));
    assert!(place.run("verify late.mcap").exits(0).stdout().contains("not in this file"));
    place.run("energies late.mcap --out late.csv").exits(0).says(&["begins with frame"]);
    place.run("energies late.mcap --from-start --every-step --out all.csv").exits(0);
    place.run("energies run.mcap --every-step --out run.csv").exits(0);
    assert_eq!(place.read("all.csv"), place.read("run.csv"));
}

/// Each part opens by itself, and no frame is lost or there twice.
#[test]
fn parts_of_a_recording_are_recordings_and_together_all_of_it() {
    for flags in ["--split-size 100kB", "--split-duration 0.0031"] {
        let place = Place::new();
        let run = place.start(&format!("{SMALL} --wait-for 2 --out run.mcap"));
        let energies = place.start("energies");
        let recorded = place.start(&format!("record --json --out recorded.mcap {flags}"));
        run.wait().exits(0);
        energies.wait().exits(0);
        let recorded = recorded.wait().exits(0).json();
        let parts = parts(&recorded);
        assert_eq!(parts[..2], ["recorded-part-0001.mcap", "recorded-part-0002.mcap"], "{flags}");
        let (mut all, whole) = (Messages::new(), messages(&place, "run.mcap"));
        let (mut last_step, mut hash) = (None, String::new());
        for (number, part) in parts.iter().enumerate() {
            for (topic, mut more) in messages(&place, part) {
                all.entry(topic).or_default().append(&mut more);
            }
            let found = place.run(&format!("verify {part} --json")).exits(0).json();
            assert_eq!(found["first_step"].as_u64(), Some(last_step.map_or(0, |step: u64| step + 1)));
            last_step = found["last_step"].as_u64();
            place.run(&format!("energies {part} --out {number}.csv")).exits(0);
            let info = recording::RecordingInfo::read(&place.path(part)).unwrap();
            let end = info.end.clone().unwrap();
            assert_eq!(end.part, number as u64 + 1);
            assert_eq!(end.previous_state_hash.unwrap_or_default(), hash);
            hash = end.last_state_hash.unwrap();
            let is_last = number + 1 == parts.len();
            assert_eq!(end.reason.as_str(), if is_last { "complete" } else { "continued" });
            if flags.starts_with("--split-duration") {
                let (from_s, until_s) = info.time_range_s().unwrap();
                let begins_s = 0.0031 * number as f64;
                assert!(from_s >= begins_s && until_s < begins_s + 0.0031, "{from_s} to {until_s}");
            }
        }
        for topic in ["/state", "/summary"] {
            assert!(all[topic] == whole[topic], "{flags}: {topic} differs");
        }
        assert_eq!(all["/energies"].len(), whole["/state"].len());
        assert_eq!(all["/chain"].len(), parts.len());
        let left = fs::read_dir(place.path(".")).unwrap().flatten();
        assert!(left.into_iter().all(|entry| !entry.file_name().to_string_lossy().ends_with(".partial")));
        place
            .run(&format!("record --out recorded.mcap {flags}"))
            .exits(2)
            .says(&["part-0001.mcap", "exists"]);
    }
}

/// A signal to the recorder ends the recording in order, and the run goes on.
#[test]
fn a_stopped_recorder_leaves_a_finished_recording_and_the_run_alone() {
    let place = Place::new();
    let mut run = place.start(&format!("{SMALL} --pace 1e-3 --no-record"));
    let recorder = attached(&place, "--out run.mcap");
    let energies = place.start("energies");
    place.wait_for_run("small", |run| run.lossless == 2 && run.step > 200);
    recorder.signal("INT");
    let recorded = recorder.wait().exits(3).says(&["the run goes on"]).json();
    assert_eq!(recorded["end"], "detached");
    place.wait_for_run("small", |run| run.lossless == 1);
    assert!(run.is_running());
    assert!(place.run("info run.mcap").exits(0).stdout().contains("detached"));
    place.run("verify run.mcap").exits(0);
    place.run("impurity run.mcap").exits(0).says(&["the recorder left"]);
    run.signal("INT");
    run.wait().exits(3);
    energies.wait().exits(0);
}

/// The producer vanishes: every state that it published is there, and the file says why it ends.
#[test]
fn a_recording_of_a_run_that_was_killed_is_finished() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --pace 1e-3 --no-record"));
    let recorder = attached(&place, "--out run.mcap");
    place.wait_for_run("small", |run| run.step > 200);
    run.signal("KILL");
    let recorded = recorder.wait().exits(3).says(&["producer", "gone"]).json();
    assert_eq!(recorded["end"], "producer lost");
    let info = place.run("info run.mcap --json").exits(0).json();
    assert_eq!(
        (info["end_reason"].as_str(), &info["last_step"]),
        (Some("producer lost"), &recorded["last_frame"])
    );
    assert!(place.run("verify run.mcap").exits(3).stdout().contains("proven as far as it goes"));
}

/// What a killed recorder leaves is read like any unfinished recording, and the parts before it are finished.
#[test]
fn a_killed_recorder_leaves_one_unfinished_part() {
    let place = Place::new();
    let mut run = place.start(&format!("{SMALL} --pace 1e-3 --no-record"));
    let flags = "--out run.mcap --split-duration 0.001 --flush-period 0.01";
    let recorder = attached(&place, flags);
    let second = place.path("run-part-0002.mcap.partial");
    wait_until("chunks in the second part", || {
        fs::metadata(&second).is_ok_and(|file| file.len() > 30_000).then_some(())
    });
    recorder.signal("KILL");
    recorder.wait();
    place.run("verify run-part-0001.mcap").exits(0);
    let found = place.run("verify run-part-0002.mcap.partial --json").exits(3).json();
    assert_eq!(
        (found["end"].as_str(), found["missing_frames"].as_array().unwrap().len()),
        (Some("unfinished"), 0)
    );
    assert!(found["states"].as_u64().unwrap() > 0);
    assert!(run.is_running());
    run.signal("INT");
    run.wait().exits(3);
}

/// Before the disk is full the recording ends in order, and the run goes on.
#[test]
fn a_recorder_leaves_room_on_the_disk() {
    let place = Place::new();
    let refused = place.run("record --out run.mcap --min-free 1000TB");
    refused.exits(1).says(&["free", "--min-free"]);
    fs::create_dir(place.path("small")).unwrap();
    let program = env!("CARGO_BIN_EXE_beadline");
    let script = format!(
        "mount -t tmpfs -o size=40m tmpfs small && {{ {program} run --name small --no-record --wait-for 1 & \
         {program} record --out small/run.mcap --min-free 20MB --timeout 60; code=$?; wait $!; cp small/run.mcap kept.mcap; exit $code; }}"
    );
    let ended: Option<Ended> = in_a_namespace(&place, &script);
    let Some(ended) = ended else { return };
    let ended = ended.exits(3).says(&["nearly full", "the run goes on"]);
    assert!(ended.stdout().contains("small detached"), "{}", ended.stdout());
    let info = place.run("info kept.mcap --json").exits(0).json();
    assert!(info["file_bytes"].as_u64().unwrap() < 22_000_000, "{info}");
    place.run("verify kept.mcap").exits(0);
}

#[test]
fn what_cannot_be_recorded_is_refused() {
    let place = Place::new();
    place.run("record run.mcap --out other.mcap").exits(2).says(&["run.mcap", "live"]);
    place.run("record --out run.txt").exits(2).says(&["run.txt", ".mcap"]);
    place.run("record --out run.mcap --split-size 1").exits(2).says(&["100000"]);
    place.run("record --out run.mcap --split-size 5furlongs").exits(2).says(&["500MB"]);
    place.run("record --out no/such/place.mcap").exits(2).says(&["no/such"]);
    place.run("record --out run.mcap --timeout 0.1").exits(1).says(&["waiting for a run"]);
    assert!(!place.path("run.mcap.partial").exists());
}

/// Every analysis of the list that publishes rows is recorded, and `verify` makes its rows again.
#[test]
fn rows_of_any_analysis_are_recorded_and_proven() {
    let place = Place::new();
    let run = "run --preset precompressed --beads 30 --duration 0.001 --name all --publish-every-steps 5 --no-record";
    let run = place.start(&format!("{run} --wait-for 5"));
    let recorder = place.start("record live:all --out all.mcap");
    let analyses =
        ["spreading", "forces --at bead:3 --at contact:7", "modes --energy --mode 2", "impurity --bead 4"]
            .map(|words| place.start(&format!("{words} live:all")));
    run.wait().exits(0);
    for analysis in analyses {
        analysis.wait().exits(0);
    }
    recorder.wait().exits(0);
    let proof = place.run("verify all.mcap --json").exits(0).json().to_string();
    for topic in ["/spreading", "/forces", "/modes", "/impurity"] {
        assert!(proof.contains(&format!("\"topic\":\"{topic}\"")), "{topic} is not in {proof}");
    }
    // a row that is another is found
    let mut bytes = std::fs::read(place.path("all.mcap")).unwrap();
    assert!(bytes.len() > 1000 && place.run("info all.mcap").exits(0).stdout().contains("/modes"));
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(place.path("bad.mcap"), bytes).unwrap();
    assert!(matches!(place.run("verify bad.mcap").code(), Some(2 | 3)));
}
