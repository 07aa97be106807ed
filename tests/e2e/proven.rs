//! "Proven" means proven: what a file says of itself, under checksums that hold, is made again or compared, and what
//! cannot be is named.

use crate::harness::{Place, wait_until};
use consumers::energies::{Energies, default_split_bead};
use hostile::checksums;
use hostile::records::{Chunk, Parts, Record, op};
use hostile::summary::rebuilt;
use recording::{BeginRecord, Compression, RecordingSource, RecordingWriter, RowMessages, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received};
use schemas::manifest::RunManifest;
use schemas::results::{ResultColumns, ResultRow, RowValues, Topic};
use serde_json::Value;
use std::fs;

const SMALL: &str = "run --beads 60 --impurity 30=0.6e-3 --duration 0.001 --name small --force";

type States = Vec<(u64, Vec<f64>)>;
type Lie = Box<dyn Fn(&mut Parts)>;

/// The states of a run: step and `[u | v]`; and its configuration.
fn run(place: &Place, flags: &str, name: &str) -> (RunManifest, States) {
    place.run(&format!("{SMALL} {flags} --out {name}")).exits(0);
    let mut source = RecordingSource::open(&place.path(name)).unwrap();
    let (manifest, mut states) = (source.manifest().clone(), Vec::new());
    while let Received::Frame(frame) = source.receive().unwrap() {
        states.push((frame.step, [frame.u_m, frame.v_m_s].concat()));
    }
    (manifest, states)
}

fn options() -> WriteOptions {
    WriteOptions {
        force: true,
        compression: Compression::None,
        chunk_bytes: 20_000,
        ..WriteOptions::default()
    }
}

fn frame<'a>(manifest: &RunManifest, (step, doubles): &'a (u64, Vec<f64>)) -> Frame<'a> {
    let (u_m, v_m_s) = doubles.split_at(doubles.len() / 2);
    let (frame, time_s) = (manifest.frame_at(*step), manifest.physics.time_s(*step));
    Frame { frame, step: *step, time_s, u_m, v_m_s, extra: &[], active: None }
}

/// A recording of `states` that begins as `begin` says, with a row of energies for each frame that `rows` leaves.
fn write(
    place: &Place,
    name: &str,
    manifest: &RunManifest,
    (toml, begin): (Option<&str>, &BeginRecord),
    states: &[(u64, Vec<f64>)],
    mut rows: impl FnMut(u64, &mut [f64; 11]) -> bool,
    (split, end): (Option<u64>, EndReason),
) {
    let mut file =
        RecordingWriter::create_from(&place.path(name), manifest, toml, begin, &options()).unwrap();
    let names = consumers::energies::EnergyRow::COLUMNS.join(",");
    let columns = ResultColumns { width: 11, names, tolerance_m: None };
    let messages = RowMessages::new(Topic::results("energies").unwrap(), &columns, manifest).unwrap();
    let mut energies = Energies::new(manifest, split.unwrap_or_else(|| default_split_bead(manifest)));
    for state in states {
        let frame = frame(manifest, state);
        file.accept(&frame).unwrap();
        let mut values = energies.observe(&frame).values();
        if rows(frame.frame, &mut values) {
            let values = RowValues::Numbers(&values);
            let Frame { frame, step, time_s, .. } = frame;
            file.write_row(&messages, &ResultRow { frame, step, time_s, values }).unwrap();
        }
    }
    file.finish(end).unwrap();
}

fn verify(place: &Place, name: &str, code: i32) -> Value {
    place.run(&format!("verify {name} --json")).exits(code).json()
}

/// Whether a list of what was checked has an entry with these words.
fn lists(found: &Value, list: &str, words: &str) -> bool {
    let list = found["checked"][list].as_array().unwrap();
    list.iter().any(|entry| entry.as_str().unwrap().contains(words))
}

/// 5 m/s by the manifest, 9 m/s by the states, which begin with step 1.
#[test]
fn states_of_another_run_that_begin_late_are_not_proven() {
    let place = Place::new();
    let (manifest, states) = run(&place, "--dt 1e-6", "five.mcap");
    let (_, others) = run(&place, "--striker 0=9 --dt 1e-6", "nine.mcap");
    let begin = BeginRecord { first_step: 1, ..BeginRecord::default() };
    let whole = |name: &str, states: &States| {
        write(
            &place,
            name,
            &manifest,
            (None, &begin),
            &states[1..],
            |_, _| false,
            (None, EndReason::Complete),
        );
    };
    whole("late.mcap", &states);
    let found = verify(&place, "late.mcap", 0);
    assert!(lists(&found, "proven", "what the initial condition leads to in 1 step"), "{found}");
    whole("lie.mcap", &others);
    let found = verify(&place, "lie.mcap", 3);
    assert_eq!(found["difference_count"], 0, "each follows from the one before");
    assert!(found["follows"]["what"].as_str().unwrap().contains("NOT the run"), "{found}");
    assert!(found["verdict"].as_str().unwrap().contains("BEGINNING IS NOT PROVEN"), "{found}");
}

/// How far a file says that it is from the beginning costs nothing to say.
#[test]
fn a_beginning_that_is_years_away_is_not_computed() {
    let place = Place::new();
    let (mut manifest, states) = run(&place, "", "run.mcap");
    manifest.physics.step_count = 1 << 50;
    let first_step = (1 << 50) - 1;
    let begin = BeginRecord { first_step, ..BeginRecord::default() };
    let states = [(first_step, states[3].1.clone())];
    let end = EndReason::Interrupted;
    write(&place, "far.mcap", &manifest, (None, &begin), &states, |_, _| false, (None, end));
    let found = verify(&place, "far.mcap", 3);
    assert!(found["follows"]["what"].as_str().unwrap().contains("begins too late"), "{found}");
}

/// The file with its records as `change` leaves them, and right checksums.
fn forge(bytes: &[u8], change: impl FnOnce(&mut Parts)) -> Vec<u8> {
    let mut parts = Parts::of_file(bytes);
    change(&mut parts);
    let mut bytes = parts.put_together();
    checksums::correct(&mut bytes);
    bytes
}

/// Exchanges the numbers of two fields of `ChainState` in its descriptor.
fn exchange_fields(body: &mut [u8]) {
    let mut numbers = Vec::new();
    for name in ["displacement_m", "velocity_m_s"] {
        let at = body.windows(name.len()).position(|window| window == name.as_bytes()).unwrap() + name.len();
        // field 3 of a field: its number
        assert_eq!(body[at], 0x18);
        numbers.push(at + 1);
    }
    body.swap(numbers[0], numbers[1]);
}

#[test]
fn a_summary_section_that_is_not_that_of_the_data_is_damage() {
    let place = Place::new();
    let (manifest, states) = run(&place, "", "run.mcap");
    let toml = Some("# nothing that can be resolved\n");
    let begin = BeginRecord::default();
    let ends = (None, EndReason::Complete);
    write(&place, "same.mcap", &manifest, (toml, &begin), &states, |_, _| false, ends);
    let bytes = fs::read(place.path("same.mcap")).unwrap();
    assert!(forge(&bytes, |_| ()) == bytes && rebuilt(&bytes) == bytes);
    let found = verify(&place, "same.mcap", 0);
    assert!(lists(&found, "compared", "schemas, channels, statistics, indexes, offsets"), "{found}");
    assert!(lists(&found, "not_known", "`run.toml`, of which this version makes no run"), "{found}");
    let last = |parts: &mut Parts, opcode: u8| {
        parts.records.iter().rposition(|record| record.opcode == opcode).unwrap()
    };
    let flip = |opcode: u8, at: usize| {
        move |parts: &mut Parts| {
            let record = last(parts, opcode);
            parts.records[record].body[at] ^= 1;
        }
    };
    let without = |opcode: u8| {
        move |parts: &mut Parts| {
            let record = last(parts, opcode);
            parts.records.remove(record);
        }
    };
    let lies: Vec<(&str, Lie, &str)> = vec![
        (
            "fields of a schema exchanged",
            Box::new(|parts: &mut Parts| {
                let is_state = |body: &[u8]| body.windows(10).any(|window| window == b"ChainState");
                let at = parts
                    .records
                    .iter()
                    .rposition(|record| record.opcode == op::SCHEMA && is_state(&record.body));
                exchange_fields(&mut parts.records[at.unwrap()].body);
            }),
            "does not repeat the schemas",
        ),
        ("a topic", Box::new(flip(op::CHANNEL, 10)), "does not repeat the schemas"),
        ("a channel missing", Box::new(without(op::CHANNEL)), "does not repeat the schemas"),
        ("a message index: a time", Box::new(flip(op::MESSAGE_INDEX, 6)), "a message index of channel"),
        ("a message index: a place", Box::new(flip(op::MESSAGE_INDEX, 14)), "a message index of channel"),
        ("a message index missing", Box::new(without(op::MESSAGE_INDEX)), "no message index of channel"),
        ("times in the header of a chunk", Box::new(flip(op::CHUNK, 8)), "a chunk header"),
        ("a chunk index: where a message index is", Box::new(flip(op::CHUNK_INDEX, 38)), "chunk indexes"),
        ("a chunk index missing", Box::new(without(op::CHUNK_INDEX)), "chunk indexes"),
        ("an attachment index: its place", Box::new(flip(op::ATTACHMENT_INDEX, 1)), "attachment indexes"),
        ("an attachment index: its size", Box::new(flip(op::ATTACHMENT_INDEX, 32)), "attachment indexes"),
        ("an attachment index missing", Box::new(without(op::ATTACHMENT_INDEX)), "attachment indexes"),
        ("a metadata index: its name", Box::new(flip(op::METADATA_INDEX, 20)), "metadata indexes"),
        ("a metadata index missing", Box::new(without(op::METADATA_INDEX)), "metadata indexes"),
        ("a summary offset", Box::new(flip(op::SUMMARY_OFFSET, 1)), "summary offsets"),
        ("a summary offset: its length", Box::new(flip(op::SUMMARY_OFFSET, 9)), "summary offsets"),
        ("statistics: schemas", Box::new(flip(op::STATISTICS, 8)), "statistics"),
        ("statistics: channels", Box::new(flip(op::STATISTICS, 10)), "statistics"),
        ("statistics: attachments", Box::new(flip(op::STATISTICS, 14)), "statistics"),
        ("statistics: metadata", Box::new(flip(op::STATISTICS, 18)), "statistics"),
        ("statistics: messages of a channel", Box::new(flip(op::STATISTICS, 48)), "statistics"),
        ("statistics missing", Box::new(without(op::STATISTICS)), "no statistics"),
        ("the footer: where offsets begin", Box::new(flip(op::FOOTER, 8)), "footer"),
    ];
    // the offset of a group that has no record leads nowhere
    let empty = forge(&bytes, |parts| {
        let at = last(parts, op::SUMMARY_OFFSET);
        let mut body = parts.records[at].body.clone();
        body[9..].fill(0);
        parts.records.insert(at + 1, Record { opcode: op::SUMMARY_OFFSET, body, offset: usize::MAX });
    });
    fs::write(place.path("empty.mcap"), empty).unwrap();
    verify(&place, "empty.mcap", 0);
    for (what, change, said) in lies {
        fs::write(place.path("lie.mcap"), forge(&bytes, change)).unwrap();
        let found = verify(&place, "lie.mcap", 3);
        assert!(found["damages"].to_string().contains(said), "{what}: {}", found["damages"]);
        // a lie about what there should be may be believed, but not written again
        let recovered = place.run("recover lie.mcap --out whole.mcap --force").code().unwrap();
        assert!([0, 3].contains(&recovered), "{what}");
        place.run("verify whole.mcap").exits(0);
    }
}

#[test]
fn the_number_of_a_summary_is_that_of_its_frame() {
    let place = Place::new();
    let (manifest, states) = run(&place, "", "run.mcap");
    let begin = BeginRecord::default();
    write(&place, "same.mcap", &manifest, (None, &begin), &states, |_, _| true, (None, EndReason::Complete));
    let bytes = fs::read(place.path("same.mcap")).unwrap();
    verify(&place, "same.mcap", 0);
    // summaries and rows are the short messages; the chain is the third of its size
    for nth in 0..2 {
        let lie = forge(&bytes, |parts| {
            let record = parts.records.iter_mut().rfind(|record| record.opcode == op::CHUNK).unwrap();
            let mut chunk = Chunk::unpack(&record.body).unwrap();
            let mut inner = Parts::of_chunk(&chunk.contents);
            let short = inner.records.iter_mut().filter(|record| record.opcode == op::MESSAGE);
            let message = short.filter(|record| record.body.len() < 300).nth(nth).unwrap();
            message.body[2] ^= 1;
            chunk.contents = inner.put_together();
            record.body = chunk.pack(false);
        });
        fs::write(place.path("lie.mcap"), lie).unwrap();
        let found = verify(&place, "lie.mcap", 3);
        assert!(found["damages"].to_string().contains("a message of the number"), "{found}");
    }
}

#[test]
fn what_is_there_once_is_there_once() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out run.mcap")).exits(0);
    let bytes = fs::read(place.path("run.mcap")).unwrap();
    for (opcode, said) in
        [(op::METADATA, "`beadline.run` a second time"), (op::ATTACHMENT, "`run.toml` a second time")]
    {
        let lie = forge(&bytes, |parts| {
            let first = parts.records.iter().position(|record| record.opcode == opcode).unwrap();
            let mut second = parts.records[first].clone();
            second.offset = usize::MAX;
            let end = parts.records.iter().rposition(|record| record.opcode == op::METADATA).unwrap();
            parts.records.insert(end, second);
        });
        fs::write(place.path("lie.mcap"), rebuilt(&lie)).unwrap();
        let found = verify(&place, "lie.mcap", 3);
        assert!(found["damages"].to_string().contains(said), "{found}");
    }
}

#[test]
fn rows_of_results_are_those_of_the_states() {
    let place = Place::new();
    let (manifest, states) = run(&place, "", "run.mcap");
    let begin = (None, &BeginRecord::default());
    let ends = (None, EndReason::Complete);
    write(&place, "same.mcap", &manifest, begin, &states, |_, _| true, ends);
    let found = verify(&place, "same.mcap", 0);
    let count = states.len();
    assert!(lists(&found, "proven", &format!("{count} rows of `/energies`")), "{found}");
    // one bit of any of them
    for column in 0..10 {
        let change = |frame: u64, values: &mut [f64; 11]| {
            if frame == 100 {
                values[column] = f64::from_bits(values[column].to_bits() ^ 1);
            }
            true
        };
        write(&place, "lie.mcap", &manifest, begin, &states, change, ends);
        let is_nan = column >= 8 && verify_code(&place, "lie.mcap") == 0;
        // one NaN is as good as another
        assert!(
            is_nan || verify(&place, "lie.mcap", 3)["rows"][0]["difference_count"] == 1,
            "column {column}"
        );
    }
    write(&place, "lie.mcap", &manifest, begin, &states, |frame, _| frame != 100, ends);
    let found = verify(&place, "lie.mcap", 3);
    assert_eq!(found["missing_rows"]["/energies"], serde_json::json!([[100, 100]]), "{found}");
    assert_eq!(found["verdict"], "NOT PROVEN: rows of results are missing");
    assert!(lists(&found, "proven", &format!("{} rows of `/energies`", count - 1)), "{found}");
    // at the ends nobody can know
    write(&place, "lie.mcap", &manifest, begin, &states, |frame, _| (10..50).contains(&frame), ends);
    let found = verify(&place, "lie.mcap", 0);
    assert!(lists(&found, "not_known", "whether `/energies` had rows before frame 10 or after frame 49"));
    // of another bead, which is found
    write(&place, "split.mcap", &manifest, begin, &states, |_, _| true, (Some(4), EndReason::Complete));
    let found = verify(&place, "split.mcap", 0);
    assert!(lists(&found, "proven", &format!("{count} rows of `/energies`")), "{found}");
    // doubled
    let bytes = fs::read(place.path("same.mcap")).unwrap();
    let lie = forge(&bytes, |parts| {
        let record = parts.records.iter_mut().rfind(|record| record.opcode == op::CHUNK).unwrap();
        let mut chunk = Chunk::unpack(&record.body).unwrap();
        let mut inner = Parts::of_chunk(&chunk.contents);
        let is_row =
            |record: &&hostile::records::Record| record.opcode == op::MESSAGE && record.body.len() < 300;
        let row = inner.records.iter().rfind(is_row).unwrap().clone();
        inner.records.push(row);
        chunk.contents = inner.put_together();
        record.body = chunk.pack(false);
    });
    fs::write(place.path("lie.mcap"), rebuilt(&lie)).unwrap();
    let found = verify(&place, "lie.mcap", 3);
    assert!(found["damages"].to_string().contains("the row of frame"), "{found}");
}

fn verify_code(place: &Place, name: &str) -> i32 {
    place.run(&format!("verify {name}")).code().unwrap()
}

#[test]
fn the_configuration_is_that_of_the_manifest() {
    let place = Place::new();
    let (manifest, states) = run(&place, "", "run.mcap");
    let found = verify(&place, "run.mcap", 0);
    assert!(lists(&found, "compared", "`run.toml`, resolved"), "{found}");
    place.run(&format!("{SMALL} --stiffness 1e9 --out other.mcap")).exits(0);
    let info = recording::RecordingInfo::read(&place.path("other.mcap")).unwrap();
    let other = (info.run_toml.as_deref(), &BeginRecord::default());
    write(&place, "lie.mcap", &manifest, other, &states, |_, _| false, (None, EndReason::Complete));
    let found = verify(&place, "lie.mcap", 3);
    assert!(found["run_toml_differences"].to_string().contains("stiffness is"), "{found}");
    // rows that are missing do not hide it
    let missing = |frame, _: &mut [f64; 11]| frame != 100;
    write(&place, "rows.mcap", &manifest, other, &states, missing, (None, EndReason::Complete));
    assert_eq!(verify(&place, "rows.mcap", 3)["verdict"], "NOT PROVEN");
    let info = recording::RecordingInfo::read(&place.path("run.mcap")).unwrap();
    let own = (info.run_toml.as_deref(), &BeginRecord::default());
    let mut credited = manifest.clone();
    credited.provenance.credit.author = Some("Mallory".to_owned());
    write(&place, "author.mcap", &credited, own, &states, |_, _| false, (None, EndReason::Complete));
    let found = verify(&place, "author.mcap", 3);
    let said = "author is not given by run.toml, \"Mallory\" by the manifest";
    assert_eq!(found["run_toml_differences"], serde_json::json!([said]));
    let rarer = manifest.clone().recorded_every(7).unwrap();
    write(&place, "rarer.mcap", &rarer, own, &states, |_, _| false, (None, EndReason::Complete));
    let found = verify(&place, "rarer.mcap", 0);
    assert!(lists(&found, "not_known", "why there are more states than one every 7 steps"), "{found}");
    // it is left out of what is recovered
    let found = place.run("recover lie.mcap --out whole.mcap --json").exits(3).json();
    assert_eq!((&found["whole"], &found["verified"]["proven"]), (&true.into(), &true.into()), "{found}");
    let found = verify(&place, "whole.mcap", 0);
    assert!(lists(&found, "not_known", "there is no `run.toml`"), "{found}");
    assert!(lists(&found, "not_known", "whose it is: author"), "{found}");
}

/// One bit of a state, under checksums that hold.
#[test]
fn a_run_does_not_go_on_from_a_state_that_is_wrong() {
    let place = Place::new();
    let (manifest, mut states) = run(&place, "", "run.mcap");
    let at = states.len() / 2;
    states.truncate(at + 20);
    let begin = (Some(""), &BeginRecord::default());
    let ends = (None, EndReason::Interrupted);
    write(&place, "same.mcap", &manifest, begin, &states, |_, _| false, ends);
    place.run("run --resume same.mcap").exits(0);
    states[at].1[7] = f64::from_bits(states[at].1[7].to_bits() ^ 1);
    write(&place, "lie.mcap", &manifest, begin, &states, |_, _| false, ends);
    let bytes = fs::read(place.path("lie.mcap")).unwrap();
    place.run("run --resume lie.mcap").exits(2).says(&["the displacement of bead 7", "beadline recover"]);
    assert!(fs::read(place.path("lie.mcap")).unwrap() == bytes, "it is as it was");
    assert!(!place.path("lie.mcap.partial").exists() && !place.path("lie.mcap.interrupted").exists());
    place.run("recover lie.mcap --out whole.mcap").exits(3);
    place.run("run --resume whole.mcap").exits(0);
    place.run("verify whole.mcap").exits(0);
}

/// 2^52 steps by the manifest and by the end, 207 of them there.
#[test]
fn a_claim_of_steps_that_are_not_there_is_no_work() {
    let place = Place::new();
    let (mut manifest, mut states) = run(&place, "", "run.mcap");
    manifest.physics.step_count = 1 << 52;
    states.truncate(208);
    let begin = (Some(""), &BeginRecord::default());
    write(&place, "lie.mcap", &manifest, begin, &states, |_, _| false, (None, EndReason::Complete));
    for command in [
        "info lie.mcap",
        "verify lie.mcap",
        "energies lie.mcap",
        "energies lie.mcap --every-step",
        "energies lie.mcap --every-step --jobs 1",
        "pulses lie.mcap --every-step",
        "contacts lie.mcap --every-step --out contacts.csv",
        "contacts lie.mcap --fill-gaps --out map.mcap",
        "export lie.mcap --every-step --out all.csv",
        "recover lie.mcap --out saved.mcap",
    ] {
        let mut running = place.start(command);
        wait_until(command, || (!running.is_running()).then_some(()));
        let ended = running.wait();
        assert!([0, 2, 3].contains(&ended.code().unwrap_or(-1)), "{command}: {}", ended.stderr());
    }
    let rows = place.read("contacts.csv").lines().count();
    assert_eq!(rows, 209, "a head, and the states that are there");
}
