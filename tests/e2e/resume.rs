//! Runs that are resumed.

use crate::harness::{Place, wait_until};
use recording::{BeginRecord, RecordingInfo, RecordingSource, RecordingWriter, WriteOptions};
use schemas::frame::{EndReason, FrameSink, FrameSource, Received};
use std::fs;

const CHAIN: &str = "run --preset homogeneous --beads 60 --duration 4e-3 --name run";

/// Records a run and ends it by SIGINT, some time after a step.
fn interrupted(place: &Place, flags: &str, step: u64) -> RecordingInfo {
    let run = place.start(&format!("{CHAIN} --pace 1e-3 {flags}"));
    place.wait_for_run("run", |run| run.step >= step);
    run.signal("INT");
    run.wait().exits(3);
    let info = RecordingInfo::read(&place.path("run.mcap")).unwrap();
    assert_eq!(info.end.as_ref().map(|end| end.reason), Some(EndReason::Interrupted));
    info
}

/// What is in the directory, but the bus.
fn files(place: &Place) -> Vec<String> {
    let names = fs::read_dir(place.path("")).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<_> =
        names.map(|name| name.into_string().unwrap()).filter(|name| name != "bus").collect();
    names.sort();
    names
}

/// Step, frame and bits of each state.
fn states(place: &Place, file: &str) -> Vec<(u64, u64, Vec<u64>)> {
    let mut source = RecordingSource::open(&place.path(file)).unwrap();
    let mut states = Vec::new();
    while let Received::Frame(frame) = source.receive().unwrap() {
        let bits = [frame.u_m, frame.v_m_s].concat().into_iter().map(f64::to_bits).collect();
        states.push((frame.step, frame.frame, bits));
    }
    states
}

/// The last state of a run that was interrupted stands where no other run has one: it is gone on from, but is not in
/// the result.
#[test]
fn a_resumed_recording_has_the_states_of_one_that_was_never_interrupted() {
    for flags in ["", "--record-every-steps 200", "--publish-every-steps 7 --record-every-steps 91"] {
        let place = Place::new();
        place.run(&format!("{CHAIN} {flags} --out whole.mcap")).exits(0);
        let info = interrupted(&place, flags, 300);
        let resumed = place.run("run --resume run.mcap --json").exits(0).says(&["goes on after step"]).json();
        assert_eq!(
            (resumed["end"].as_str(), resumed["first_step"].as_u64()),
            (Some("complete"), info.last_step)
        );
        let run_id = info.manifest.provenance.run_id.to_string();
        assert_eq!(resumed["run_id"].as_str(), Some(run_id.as_str()));
        assert!(states(&place, "run.mcap") == states(&place, "whole.mcap"), "{flags}");
        assert_eq!(files(&place), ["run.mcap", "whole.mcap"]);
        let (resumed, whole) =
            ["run.mcap", "whole.mcap"].map(|name| RecordingInfo::read(&place.path(name)).unwrap()).into();
        assert_eq!(
            (resumed.channels, resumed.uncompressed_bytes),
            (whole.channels, whole.uncompressed_bytes)
        );
        assert_eq!(resumed.run_toml, info.run_toml);
        place.run("run --resume run.mcap").exits(0).says(&["run.mcap is complete"]);
    }
}

#[test]
fn a_run_that_is_interrupted_again_and_again_loses_nothing() {
    let place = Place::new();
    place.run(&format!("{CHAIN} --record-every-steps 300 --out whole.mcap")).exits(0);
    let mut last = interrupted(&place, "--record-every-steps 300", 400).last_step;
    for _ in 0..3 {
        let run = place.start("run --resume run.mcap --pace 1e-3");
        place.wait_for_run("run", |run| Some(run.step) > last);
        run.signal("INT");
        run.wait().exits(3);
        let info = RecordingInfo::read(&place.path("run.mcap")).unwrap();
        assert!(info.last_step > last);
        last = info.last_step;
        assert_eq!(files(&place), ["run.mcap", "whole.mcap"]);
    }
    place.run("run --resume run.mcap").exits(0);
    assert!(states(&place, "run.mcap") == states(&place, "whole.mcap"));
}

/// In another place, the interrupted recording stays as it is.
#[test]
fn a_run_can_be_resumed_elsewhere() {
    let place = Place::new();
    interrupted(&place, "", 300);
    let before = fs::read(place.path("run.mcap")).unwrap();
    place.run("run --resume run.mcap --out whole.mcap").exits(0);
    assert!(fs::read(place.path("run.mcap")).unwrap() == before);
    assert_eq!(files(&place), ["run.mcap", "whole.mcap"]);
    place.run("verify whole.mcap").exits(0);
    place.run("run --resume run.mcap --out whole.mcap").exits(2).says(&["whole.mcap", "--force"]);
    std::os::unix::fs::symlink("run.mcap", place.path("link.mcap")).unwrap();
    place.run("run --resume link.mcap --out linked.mcap").exits(0);
    assert!(fs::read(place.path("run.mcap")).unwrap() == before);
    fs::remove_file(place.path("link.mcap")).unwrap();
    fs::remove_file(place.path("linked.mcap")).unwrap();
    place.run("run --resume run.mcap --out ./run.mcap").exits(0);
    assert_eq!(files(&place), ["run.mcap", "whole.mcap"]);
}

/// A kill while a recording is being written again: the old one is found, or the new one, if it has come further.
#[test]
fn a_resume_that_was_killed_is_gone_on_with() {
    let place = Place::new();
    interrupted(&place, "", 300);
    let half = |from: &str, to: &str| {
        let bytes = fs::read(place.path(from)).unwrap();
        fs::write(place.path(to), &bytes[..bytes.len() / 2]).unwrap();
    };
    fs::copy(place.path("run.mcap"), place.path("old.mcap")).unwrap();
    let expected = {
        place.run(&format!("{CHAIN} --out whole.mcap")).exits(0);
        states(&place, "whole.mcap")
    };
    // during the copy
    fs::rename(place.path("run.mcap"), place.path("run.mcap.interrupted")).unwrap();
    half("old.mcap", "run.mcap.partial");
    place.run("run --resume run.mcap.partial").exits(0);
    assert!(states(&place, "run.mcap") == expected);
    assert_eq!(files(&place), ["old.mcap", "run.mcap", "whole.mcap"]);
    // before it
    fs::remove_file(place.path("run.mcap")).unwrap();
    fs::copy(place.path("old.mcap"), place.path("run.mcap.interrupted")).unwrap();
    place.run("run --resume run.mcap.partial").exits(0);
    assert!(states(&place, "run.mcap") == expected);
    // after it: the new one goes on where it was
    let info = RecordingInfo::read(&place.path("run.mcap")).unwrap();
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let options = WriteOptions::default();
    let mut further = RecordingWriter::create(&place.path("new.mcap"), &info.manifest, "", &options).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap()
        && frame.step <= 2000
    {
        further.accept(&frame).unwrap();
    }
    drop(further);
    fs::remove_file(place.path("run.mcap")).unwrap();
    fs::rename(place.path("new.mcap.partial"), place.path("run.mcap.partial")).unwrap();
    fs::copy(place.path("old.mcap"), place.path("run.mcap.interrupted")).unwrap();
    let resumed = place.run("run --resume run.mcap.interrupted --json").exits(0).json();
    assert_eq!(resumed["first_step"], 2000);
    assert!(states(&place, "run.mcap") == expected);
    assert_eq!(files(&place), ["old.mcap", "run.mcap", "whole.mcap"]);
}

/// A kill after the new recording has its name, before the old one is removed.
#[test]
fn a_resume_that_was_killed_at_its_very_end_is_no_dead_end() {
    let place = Place::new();
    interrupted(&place, "", 300);
    fs::copy(place.path("run.mcap"), place.path("old.mcap")).unwrap();
    place.run("run --resume run.mcap").exits(0);
    let whole = fs::read(place.path("run.mcap")).unwrap();
    for name in ["run.mcap", "run.mcap.partial", "run.mcap.interrupted"] {
        fs::copy(place.path("old.mcap"), place.path("run.mcap.interrupted")).unwrap();
        place.run(&format!("run --resume {name}")).exits(0).says(&["run.mcap is complete"]);
        assert!(fs::read(place.path("run.mcap")).unwrap() == whole);
        assert_eq!(files(&place), ["old.mcap", "run.mcap"], "{name}");
    }
    // finished, and ended early as well
    fs::copy(place.path("old.mcap"), place.path("run.mcap")).unwrap();
    fs::copy(place.path("old.mcap"), place.path("run.mcap.interrupted")).unwrap();
    place.run("run --resume run.mcap").exits(0).says(&["goes on after step"]);
    assert_eq!(files(&place), ["old.mcap", "run.mcap"]);
    place.run("verify run.mcap").exits(0);
}

/// What was set aside and what is written in its place are two recordings: neither is removed unless the other has
/// all of it.
#[test]
fn what_a_killed_resume_left_is_not_taken_for_something_else() {
    let place = Place::new();
    interrupted(&place, "", 300);
    fs::rename(place.path("run.mcap"), place.path("run.mcap.interrupted")).unwrap();
    let old = fs::read(place.path("run.mcap.interrupted")).unwrap();
    // no other run begins there
    for flags in ["", "--force"] {
        place.run(&format!("{CHAIN} {flags}")).exits(2).says(&["run.mcap.interrupted", "run --resume"]);
        assert_eq!(files(&place), ["run.mcap.interrupted"]);
    }
    // another run, which did so elsewhere, or by another version
    place.run(&format!("{CHAIN} --out other.mcap")).exits(0);
    let other = fs::read(place.path("other.mcap")).unwrap();
    // one that came further, but is damaged
    fs::copy(place.path("run.mcap.interrupted"), place.path("further.mcap")).unwrap();
    place.run("run --resume further.mcap").exits(0);
    let mut further = fs::read(place.path("further.mcap")).unwrap();
    let middle = further.len() / 2;
    further[middle] ^= 1;
    for new in [&other[..other.len() / 2], &other, &further[..further.len() - 1000], b"something else"] {
        fs::write(place.path("run.mcap.partial"), new).unwrap();
        for name in ["run.mcap.partial", "run.mcap.interrupted"] {
            place
                .run(&format!("run --resume {name}"))
                .exits(2)
                .says(&["run.mcap.partial", "move one of them away"]);
        }
        assert!(fs::read(place.path("run.mcap.partial")).unwrap() == new);
        assert!(fs::read(place.path("run.mcap.interrupted")).unwrap() == old);
    }
    // another one under its name
    fs::remove_file(place.path("run.mcap.partial")).unwrap();
    fs::write(place.path("run.mcap"), &other).unwrap();
    for name in ["run.mcap", "run.mcap.partial", "run.mcap.interrupted"] {
        place
            .run(&format!("run --resume {name}"))
            .exits(2)
            .says(&["while run.mcap exists", "move one of them away"]);
    }
    assert!(fs::read(place.path("run.mcap")).unwrap() == other);
    fs::remove_file(place.path("run.mcap")).unwrap();
    // nothing was written yet
    fs::write(place.path("run.mcap.partial"), "").unwrap();
    place.run("run --resume run.mcap.partial").exits(0);
    assert_eq!(files(&place), ["further.mcap", "other.mcap", "run.mcap"]);
    place.run("verify run.mcap").exits(0);
}

/// Where a record seems to be longer than the file, the states after it are not given up.
#[test]
fn a_wrong_length_is_not_taken_for_the_end() {
    let place = Place::new();
    let run = place.start(&format!("{CHAIN} --pace 1e-3 --flush-period 0.01"));
    place.wait_for_run("run", |run| run.step >= 300);
    run.signal("KILL");
    run.wait();
    let partial = place.path("run.mcap.partial");
    let mut bytes = fs::read(&partial).unwrap();
    let mut chunks = Vec::new();
    let mut at = 8;
    while at + 9 <= bytes.len() {
        if bytes[at] == 0x06 {
            chunks.push(at);
        }
        at += 9 + usize::try_from(u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap())).unwrap();
    }
    let in_the_middle = chunks[chunks.len() / 2];
    let whole = bytes.clone();
    // its length, or what it is: 0 is what some file systems leave at a torn end
    for (name, offset, flipped) in [("length", in_the_middle + 5, 1), ("opcode", in_the_middle, 0x06)] {
        bytes.clone_from(&whole);
        bytes[offset] ^= flipped;
        fs::write(&partial, &bytes).unwrap();
        place.run("run --resume run.mcap.partial").exits(2).says(&["damaged", "beadline recover"]);
        assert!(fs::read(&partial).unwrap() == bytes, "{name}");
        assert_eq!(files(&place), ["run.mcap.partial"], "{name}");
    }
    let recovered = place.run("recover run.mcap.partial --out other.mcap --json");
    assert!(recovered.code().is_some_and(|code| code == 0 || code == 3));
    place.run("run --resume other.mcap").exits(0);
    place.run("verify other.mcap").exits(0);
}

/// A finished recording that has not its name yet replaces another one only if that was asked for.
#[test]
fn a_recording_is_given_its_name_as_asked_for() {
    let place = Place::new();
    place.run(CHAIN).exits(0);
    fs::rename(place.path("run.mcap"), place.path("run.mcap.partial")).unwrap();
    let mut damaged = fs::read(place.path("run.mcap.partial")).unwrap();
    place.write("run.mcap", "mine");
    place.run("run --resume run.mcap.partial").exits(2).says(&["move one of them away"]);
    assert_eq!(place.read("run.mcap"), "mine");
    place.run("run --resume run.mcap.partial --force").exits(0).says(&["run.mcap is complete"]);
    assert_eq!(files(&place), ["run.mcap"]);
    // its summary is whole
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    fs::write(place.path("damaged.mcap.partial"), &damaged).unwrap();
    place.run("run --resume damaged.mcap.partial").exits(2).says(&["CRC", "beadline recover"]);
    assert_eq!(files(&place), ["damaged.mcap.partial", "run.mcap"]);
}

/// What `beadline record` writes has no configuration, and what goes on with it has none either.
#[test]
fn a_recording_without_a_configuration_gets_none() {
    let place = Place::new();
    interrupted(&place, "", 300);
    let info = RecordingInfo::read(&place.path("run.mcap")).unwrap();
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let (begin, options) = (BeginRecord::default(), WriteOptions::default());
    let path = place.path("recorded.mcap");
    let mut recorded = RecordingWriter::create_from(&path, &info.manifest, None, &begin, &options).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap() {
        recorded.accept(&frame).unwrap();
    }
    recorded.finish(EndReason::Detached).unwrap();
    place.run("run --resume recorded.mcap").exits(0);
    let info = RecordingInfo::read(&path).unwrap();
    assert_eq!((info.is_complete(), info.run_toml), (true, None));
}

/// A run that was killed while it waited begins anew, as the run that it was.
#[test]
fn a_recording_without_any_state_begins_with_the_run() {
    let place = Place::new();
    let run = place.start(&format!("{CHAIN} --wait-for 1"));
    let partial = place.path("run.mcap.partial");
    wait_until("the head", || fs::metadata(&partial).is_ok_and(|found| found.len() > 0).then_some(()));
    drop(run);
    let info = RecordingInfo::read(&partial).unwrap();
    assert_eq!(info.frames(), 0);
    let resumed =
        place.run("run --resume run.mcap.partial --json").exits(0).says(&["from its beginning"]).json();
    assert_eq!(resumed["run_id"].as_str().unwrap(), info.manifest.provenance.run_id.to_string());
    assert_eq!(resumed["frames_published"], resumed["frames_recorded"]);
    place.run("verify run.mcap").exits(0);
}

/// A kill after the last state, before the file has its name.
#[test]
fn a_finished_recording_that_was_not_renamed_is_given_its_name() {
    let place = Place::new();
    place.run(CHAIN).exits(0);
    let whole = fs::read(place.path("run.mcap")).unwrap();
    fs::rename(place.path("run.mcap"), place.path("run.mcap.partial")).unwrap();
    place.run("run --resume run.mcap.partial").exits(0).says(&["run.mcap is complete"]);
    assert!(fs::read(place.path("run.mcap")).unwrap() == whole);
    // all its states are there, but it was not closed
    fs::write(place.path("run.mcap.partial"), &whole[..whole.len() - 9]).unwrap();
    fs::remove_file(place.path("run.mcap")).unwrap();
    let resumed = place.run("run --resume run.mcap.partial --json").exits(0).json();
    assert_eq!((resumed["end"].as_str(), resumed["frames_published"].as_u64()), (Some("complete"), Some(0)));
    place.run("verify run.mcap").exits(0);
    assert_eq!(files(&place), ["run.mcap"]);
}

#[test]
fn what_cannot_be_gone_on_with_is_refused_and_stays() {
    let place = Place::new();
    interrupted(&place, "", 300);
    let recording = fs::read(place.path("run.mcap")).unwrap();
    let refused = |arguments: &str, says: &[&str]| {
        place.run(&format!("run --resume {arguments}")).exits(2).says(says);
    };
    refused("run.mcap --beads 30", &["--resume", "--beads"]);
    refused("run.mcap --name other", &["--resume", "--name"]);
    refused("run.mcap --no-record", &["--resume", "--no-record"]);
    refused("missing.mcap.partial", &["missing.mcap.partial"]);
    refused("https://example.org/run.mcap", &["a URL", "download the recording"]);

    let mut damaged = recording.clone();
    damaged[recording.len() / 2] ^= 1;
    fs::write(place.path("damaged.mcap.partial"), &damaged[..recording.len() - 1000]).unwrap();
    refused("damaged.mcap.partial", &["damaged.mcap.partial", "CRC", "beadline recover"]);
    // not found before it is copied: the summary is whole
    fs::write(place.path("inside.mcap"), &damaged).unwrap();
    refused("inside.mcap", &["inside.mcap", "CRC", "beadline recover"]);

    place.write("contacts.txt", "no recording");
    place.run("contacts run.mcap --out map.mcap").exits(0);
    refused("map.mcap", &["map.mcap", "states of a run"]);

    fs::write(place.path("run.mcap.partial"), &recording[..recording.len() / 2]).unwrap();
    refused("run.mcap", &["run.mcap.partial", "move one of them away"]);
    refused("run.mcap.partial", &["while run.mcap exists", "move one of them away"]);
    fs::remove_file(place.path("run.mcap.partial")).unwrap();

    let info = RecordingInfo::read(&place.path("run.mcap")).unwrap();
    let mut other = info.manifest;
    other.physics.kernel_version = schemas::manifest::KERNEL_VERSION + 1;
    RecordingWriter::create(&place.path("made.mcap"), &other, "", &WriteOptions::default())
        .and_then(|writer| writer.finish(EndReason::Interrupted))
        .unwrap();
    // a child that another test is just starting may still hold the lock of a file that this process has written
    fs::copy(place.path("made.mcap"), place.path("kernel.mcap")).unwrap();
    fs::remove_file(place.path("made.mcap")).unwrap();
    place.run("run --resume kernel.mcap").exits(3).says(&["kernel version 4"]);

    assert!(fs::read(place.path("run.mcap")).unwrap() == recording);
    assert!(fs::read(place.path("inside.mcap")).unwrap() == damaged);
    let expected =
        ["contacts.txt", "damaged.mcap.partial", "inside.mcap", "kernel.mcap", "map.mcap", "run.mcap"];
    assert_eq!(files(&place), expected);
}

#[test]
fn a_recording_that_is_being_written_is_not_taken_away() {
    let place = Place::new();
    let run = place.start(&format!("{CHAIN} --pace 1e-4 --flush-period 0.01"));
    place.wait_for_run("run", |run| run.step > 3);
    place.run("run --resume run.mcap.partial").exits(2).says(&["run.mcap.partial", "another process"]);
    run.signal("INT");
    run.wait().exits(3);
    assert_eq!(files(&place), ["run.mcap"]);
}

/// On the bus a resumed run is the same run; whoever wants all of it computes what came before.
#[test]
fn consumers_of_a_resumed_run_can_have_all_of_it() {
    let place = Place::new();
    place.run(&format!("{CHAIN} --out whole.mcap")).exits(0);
    place.run("energies whole.mcap --out whole.csv").exits(0);
    let info = interrupted(&place, "--record-every-steps 200", 300);
    let run = place.start("run --resume run.mcap --wait-for 2 --json");
    let all = place.start("energies live:run --from-start --out all.csv --json");
    let new = place.start("impurity live:run --bead 3 --json");
    let frames = run.wait().exits(0).json()["frames_published"].as_u64();
    assert_eq!(frames, info.last_step.map(|step| info.manifest.physics.step_count - step));
    assert_eq!(new.wait().json()["frames_received"].as_u64(), frames);
    all.wait().exits(0);
    assert_eq!(place.read("all.csv"), place.read("whole.csv"));
}
