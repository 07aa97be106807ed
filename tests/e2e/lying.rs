//! Recordings that say of themselves what is not so, under checksums that hold, are not proven.

use crate::harness::{Place, wait_until};
use recording::{BeginRecord, Compression, RecordingSource, RecordingWriter, WriteOptions, state_hash};
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received};
use schemas::manifest::RunManifest;
use std::collections::BTreeMap;
use std::fs;

const SMALL: &str = "run --beads 60 --impurity 30=0.6e-3 --duration 0.001 --name small --out run.mcap";
const METADATA: u8 = 0x0c;
const CHUNK: u8 = 0x06;

/// The states of `run.mcap`: step and `[u | v]`.
pub(crate) fn run(place: &Place) -> (RunManifest, Vec<(u64, Vec<f64>)>) {
    place.run(SMALL).exits(0);
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let (manifest, mut states) = (source.manifest().clone(), Vec::new());
    while let Received::Frame(frame) = source.receive().unwrap() {
        states.push((frame.step, [frame.u_m, frame.v_m_s].concat()));
    }
    (manifest, states)
}

/// A recording of these states, in small uncompressed chunks.
pub(crate) fn write<'a>(
    place: &Place,
    name: &str,
    manifest: &RunManifest,
    begin: &BeginRecord,
    states: impl IntoIterator<Item = &'a (u64, Vec<f64>)>,
    end: EndReason,
) {
    let options = WriteOptions {
        force: true,
        compression: Compression::None,
        chunk_bytes: 20_000,
        ..WriteOptions::default()
    };
    let mut file =
        RecordingWriter::create_from(&place.path(name), manifest, Some(""), begin, &options).unwrap();
    for (step, doubles) in states {
        let (u_m, v_m_s) = doubles.split_at(60);
        let (frame, time_s) = (manifest.frame_at(*step), manifest.physics.time_s(*step));
        file.accept(&Frame { frame, step: *step, time_s, u_m, v_m_s, extra: &[], active: None }).unwrap();
    }
    file.finish(end).unwrap();
}

/// Opcode, offset and contents of the records of a file.
fn records(bytes: &[u8]) -> Vec<(u8, usize, &[u8])> {
    let (mut at, mut records) = (8, Vec::new());
    while at + 9 <= bytes.len() - 8 {
        let length = usize::try_from(u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap())).unwrap();
        records.push((bytes[at], at, &bytes[at + 9..at + 9 + length]));
        at += 9 + length;
    }
    records
}

fn text(bytes: &mut &[u8]) -> String {
    let (length, rest) = bytes.split_first_chunk().unwrap();
    let (text, rest) = rest.split_at(u32::from_le_bytes(*length) as usize);
    *bytes = rest;
    String::from_utf8(text.to_vec()).unwrap()
}

fn put_text(bytes: &mut Vec<u8>, text: &str) {
    bytes.extend(u32::try_from(text.len()).unwrap().to_le_bytes());
    bytes.extend(text.as_bytes());
}

fn put_record(bytes: &mut Vec<u8>, opcode: u8, body: &[u8]) {
    bytes.push(opcode);
    bytes.extend((body.len() as u64).to_le_bytes());
    bytes.extend(body);
}

/// The file with entries of its metadata changed, and without a summary section and its CRCs.
fn with_metadata(bytes: &[u8], name: &str, changes: &[(&str, &str)]) -> Vec<u8> {
    let mut changed = bytes[..8].to_vec();
    for (opcode, _, mut body) in records(bytes) {
        match opcode {
            METADATA => {
                let found = text(&mut body);
                let (mut entries, mut all) = (BTreeMap::new(), Vec::new());
                body = &body[4..];
                while !body.is_empty() {
                    entries.insert(text(&mut body), text(&mut body));
                }
                for (key, value) in changes.iter().filter(|_| found == name) {
                    assert!(entries.insert((*key).to_owned(), (*value).to_owned()).is_some());
                }
                for (key, value) in entries {
                    put_text(&mut all, &key);
                    put_text(&mut all, &value);
                }
                let mut metadata = Vec::new();
                put_text(&mut metadata, &found);
                metadata.extend(u32::try_from(all.len()).unwrap().to_le_bytes());
                metadata.extend(all);
                put_record(&mut changed, METADATA, &metadata);
            }
            0x0f => break,
            _ => put_record(&mut changed, opcode, body),
        }
    }
    put_record(&mut changed, 0x0f, &[0; 4]);
    put_record(&mut changed, 0x02, &[0; 20]);
    changed.extend(&bytes[..8]);
    changed
}

/// What `verify` finds wrong with the file.
#[track_caller]
fn damages(place: &Place, bytes: &[u8]) -> String {
    fs::write(place.path("lie.mcap"), bytes).unwrap();
    let found = place.run("verify lie.mcap --json").exits(3).json();
    found["damages"].to_string()
}

#[test]
fn an_end_that_is_not_that_of_the_states_is_damage() {
    let place = Place::new();
    let (manifest, states) = run(&place);
    write(&place, "run.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    let bytes = fs::read(place.path("run.mcap")).unwrap();
    fs::write(place.path("same.mcap"), with_metadata(&bytes, "", &[])).unwrap();
    place.run("verify same.mcap").exits(0);
    for (key, value, said) in [
        ("first_step", "777", "the first state is of step 777, but it is of step 0"),
        ("last_step", "5", "the last state is of step 5"),
        ("last_state_hash", "", "no hash of the last state"),
        ("reason", "interrupted", "ends with the last step of the run"),
        ("reason", "continued", "ends with the last step of the run"),
        ("reason", "stopped", "with which no recording ends"),
        ("reason", "unfinished", "with which no recording ends"),
        ("part", "2", "begins as part 1"),
        ("part", "0", "instead of 1 to"),
        ("part", "18446744073709551615", "instead of 1 to"),
    ] {
        let found = damages(&place, &with_metadata(&bytes, "beadline.end", &[(key, value)]));
        assert!(found.contains(said), "{key} = {value}: {found}");
    }
}

/// Also in a file that has no CRC over it yet.
#[test]
fn a_beginning_has_a_checksum_of_its_own() {
    let place = Place::new();
    let (manifest, states) = run(&place);
    let previous_state_hash = Some(state_hash(states[9].0, &states[9].1));
    let begin = BeginRecord { first_step: 10, part: 2, previous_state_hash };
    write(&place, "part.mcap", &manifest, &begin, &states[10..], EndReason::Complete);
    let bytes = fs::read(place.path("part.mcap")).unwrap();
    place.run("verify part.mcap").exits(0);
    let (_, last_chunk, _) = records(&bytes).into_iter().rfind(|record| record.0 == CHUNK).unwrap();
    let unfinished = &bytes[..last_chunk];
    assert_eq!(damages(&place, unfinished), "[]");
    for key in ["first_step", "part", "previous_state_hash"] {
        let place_of =
            |word: &str| unfinished.windows(word.len()).position(|window| window == word.as_bytes());
        let at = place_of("beadline.begin").unwrap();
        let at = at + unfinished[at..].windows(key.len()).position(|found| found == key.as_bytes()).unwrap();
        let mut flipped = unfinished.to_vec();
        // after the length of the value
        flipped[at + key.len() + 4] ^= 1;
        let found = damages(&place, &flipped);
        assert!(found.contains("checksum"), "{key}: {found}");
    }
}

/// The first and the last state are due wherever they fall.
#[test]
fn a_first_or_last_state_off_the_schedule_is_missed() {
    let place = Place::new();
    let (mut manifest, states) = run(&place);
    manifest.provenance.record_every_steps = 10;
    let begin = BeginRecord { first_step: 13, ..BeginRecord::default() };
    let of = |steps: Vec<u64>| states.iter().filter(move |(step, _)| steps.contains(step));
    write(&place, "off.mcap", &manifest, &begin, of(vec![13, 20, 30, 35]), EndReason::Interrupted);
    place.run("verify off.mcap").exits(0);
    write(&place, "off.mcap", &manifest, &begin, of(vec![20, 30, 35]), EndReason::Interrupted);
    let found = place.run("verify off.mcap --json").exits(3).json();
    assert_eq!(found["missing_frames"], serde_json::json!([[13, 13]]), "{found}");
    write(&place, "off.mcap", &manifest, &begin, of(vec![13, 20, 30]), EndReason::Interrupted);
    let bytes = fs::read(place.path("off.mcap")).unwrap();
    let late = with_metadata(&bytes, "beadline.end", &[("last_step", "35")]);
    fs::write(place.path("late.mcap"), late).unwrap();
    let found = place.run("verify late.mcap --json").exits(3).json();
    assert_eq!(found["missing_frames"], serde_json::json!([[35, 35]]), "{found}");
    // what comes next where a file was torn is the next frame that is due
    write(
        &place,
        "many.mcap",
        &manifest,
        &begin,
        of((20..=600).step_by(10).chain([13]).collect()),
        EndReason::Interrupted,
    );
    let bytes = fs::read(place.path("many.mcap")).unwrap();
    let (_, last_chunk, body) = records(&bytes).into_iter().rfind(|record| record.0 == CHUNK).unwrap();
    fs::write(place.path("torn.mcap"), &bytes[..last_chunk + 9 + body.len() - 40]).unwrap();
    let found = place.run("verify torn.mcap --json").exits(3).json();
    let due = (found["last_step"].as_u64().unwrap() / 10 + 1) * 10;
    assert_eq!(found["damages"][0]["frames"], serde_json::json!([due, null]), "{found}");
}

/// A summary with millions of empty entries takes little in a file and much in memory.
#[test]
fn a_summary_that_is_too_long_is_not_decoded() {
    let place = Place::new();
    let (manifest, states) = run(&place);
    write(&place, "run.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    let bytes = with_metadata(&fs::read(place.path("run.mcap")).unwrap(), "", &[]);
    let mut bomb = bytes[..8].to_vec();
    let mut done = false;
    for (opcode, _, body) in records(&bytes) {
        if opcode != CHUNK || done {
            put_record(&mut bomb, opcode, body);
            continue;
        }
        let (mut at, mut contents) = (40, Vec::new());
        while at < body.len() {
            let length =
                usize::try_from(u64::from_le_bytes(body[at + 1..at + 9].try_into().unwrap())).unwrap();
            let mut message = body[at + 9..at + 9 + length].to_vec();
            // with fewer than 250 bytes it is a summary
            if body[at] == 0x05 && length < 250 && !done {
                message.extend([0x4a, 0].repeat(1 << 20));
                done = true;
            }
            put_record(&mut contents, body[at], &message);
            at += 9 + length;
        }
        let size = (contents.len() as u64).to_le_bytes();
        let chunk = [&body[..16], &size, &[0; 8], &size, &contents].concat();
        put_record(&mut bomb, CHUNK, &chunk);
    }
    bomb.extend(&bytes[..8]);
    assert!(done);
    let found = damages(&place, &bomb);
    assert!(found.contains("a summary that is no Summary"), "{found}");
}

/// Whoever goes to a step finds it by the index: it must lead to the chunks of the file.
#[test]
fn an_index_that_leads_elsewhere_is_damage() {
    let place = Place::new();
    let (manifest, states) = run(&place);
    write(&place, "run.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    let bytes = fs::read(place.path("run.mcap")).unwrap();
    let all = records(&bytes);
    let of = |opcode: u8| all.iter().rfind(|record| record.0 == opcode).unwrap().1 + 9;
    let footer = of(0x02);
    for (opcode, fields, said) in [
        // times, offset and length; messages and chunks; offset and length
        (0x08, &[0, 8, 16, 24][..], "chunk indexes"),
        (0x0b, &[0, 22, 26, 34], "statistics"),
        (0x0d, &[0, 8], "metadata indexes"),
    ] {
        for field in fields {
            let mut lie = bytes.clone();
            // the CRC of the summary section, where 0 stands for none
            lie[footer + 16..footer + 20].fill(0);
            fs::write(place.path("same.mcap"), &lie).unwrap();
            place.run("verify same.mcap").exits(0);
            lie[of(opcode) + field] ^= 1;
            let found = damages(&place, &lie);
            assert!(found.contains(said), "{opcode:#x}, byte {field}: {found}");
        }
    }
}

#[test]
fn a_part_does_not_follow_one_that_ends_otherwise_or_too_early() {
    let place = Place::new();
    let (mut manifest, states) = run(&place);
    manifest.provenance.record_every_steps = 10;
    let due: Vec<_> = states.iter().filter(|(step, _)| manifest.is_recorded(*step)).cloned().collect();
    let (before, after) = due.split_at(4);
    let last = before.last().unwrap();
    let begin = |first_step| BeginRecord {
        first_step,
        part: 2,
        previous_state_hash: Some(state_hash(last.0, &last.1)),
    };
    let first = BeginRecord::default();
    for (end, from, said) in [
        (EndReason::Continued, 0, "leads to the first one"),
        (EndReason::Interrupted, 0, "does not go on: it ends `interrupted`"),
        (EndReason::Continued, 2, "states are missing between step 30 and step 60, from 40 on"),
    ] {
        write(&place, "one.mcap", &manifest, &first, before, end);
        let after = &after[from..];
        write(&place, "two.mcap", &manifest, &begin(after[0].0), after, EndReason::Complete);
        place.run("verify one.mcap").exits(0);
        place.run("verify two.mcap").exits(0);
        let code = if from == 0 && end == EndReason::Continued { 0 } else { 3 };
        let text = place.run("verify one.mcap two.mcap").exits(code).stdout();
        assert!(text.contains(said), "{text}");
    }
}

/// Two states may be days of work apart.
#[test]
fn a_stop_between_two_states_is_obeyed() {
    let place = Place::new();
    let (mut manifest, mut states) = run(&place);
    manifest.physics.step_count = 1 << 40;
    manifest.provenance.record_every_steps = 1 << 40;
    states.truncate(2);
    states[1].0 = 1 << 40;
    write(&place, "far.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    let verify = place.start("verify far.mcap --jobs 2 --json");
    // reading two states takes no time: what it does then is to compute
    wait_until("computing", || {
        let stat = fs::read_to_string(format!("/proc/{}/stat", verify.id())).ok()?;
        let ticks = stat.rsplit(')').next()?.split_whitespace().nth(11)?;
        ticks.parse().ok().filter(|ticks: &u64| *ticks > 20)
    });
    verify.signal("INT");
    let found = verify.wait().exits(3).json();
    assert_eq!((&found["proven"], &found["end"]), (&false.into(), &"stopped".into()), "{found}");
    assert_eq!((&found["stopped_after_step"], &found["steps_recomputed"]), (&0.into(), &0.into()));
    assert_eq!(found["verdict"], "STOPPED before it was proven");
}

/// No run begins with a state that was not computed by the dynamics of its recording.
#[test]
fn an_initial_state_between_recorded_ones_is_proven() {
    let place = Place::new();
    let (mut manifest, mut states) = run(&place);
    states.retain(|(step, _)| step.is_multiple_of(100));
    manifest.physics.alpha = 2.5;
    write(&place, "other.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Interrupted);
    for (step, code) in [(100, 0), (150, 2)] {
        let from = format!(
            "initial.from = {{ recording = \"other.mcap\", step = {step} }}\ntime.duration_s = 1e-4\n"
        );
        let chain = "chain = { beads = 60, bead_mass_kg = 1e-3, alpha = 1.5, stiffness = 1e7 }\n";
        place.write("from.toml", &format!("{chain}{from}"));
        let ended = place.run("run from.toml --dry-run").exits(code);
        if code != 0 {
            ended.says(&["initial.from", "the state of step 100 leads to"]);
        }
    }
}
