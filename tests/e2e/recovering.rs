//! Damaged and unfinished recordings: what is wrong is named, and what can be had is had.

use crate::harness::{Place, wait_until};
use recording::{
    BeginRecord, Compression, PartsWriter, RecordingSource, RecordingWriter, Split, WriteOptions,
};
use schemas::frame::{EndReason, FrameSink, FrameSource, Received};
use std::fs;
use std::time::Duration;

const SMALL: &str = "run --beads 60 --impurity 30=0.6e-3 --duration 0.004 --name small --out run.mcap";

/// Opcode, offset and length of the contents of the records of a file.
fn records(bytes: &[u8]) -> Vec<(u8, usize, usize)> {
    let (mut at, mut records) = (8, Vec::new());
    while at + 9 <= bytes.len() - 8 {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
        let length = usize::try_from(length).unwrap();
        records.push((bytes[at], at, length));
        at += 9 + length;
    }
    records
}

fn chunks(bytes: &[u8]) -> Vec<(usize, usize)> {
    let chunks = records(bytes).into_iter().filter(|record| record.0 == 0x06);
    chunks.map(|(_, at, length)| (at, length)).collect()
}

/// Records a small run as `run.mcap`, in small chunks.
fn record(place: &Place, flags: &str, compression: Compression) -> Vec<u8> {
    place.run(&format!("{SMALL} {flags} --force")).exits(0);
    copy(place, "run.mcap", "small.mcap", compression);
    fs::read(place.path("small.mcap")).unwrap()
}

fn copy(place: &Place, from: &str, to: &str, compression: Compression) {
    let mut source = RecordingSource::open(&place.path(from)).unwrap();
    let options = WriteOptions {
        force: true,
        compression,
        chunk_bytes: 20_000,
        flush_period: Duration::from_hours(1),
        ..WriteOptions::default()
    };
    let manifest = source.manifest().clone();
    let mut copy = RecordingWriter::create(&place.path(to), &manifest, "a = 1\n", &options).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap() {
        copy.accept(&frame).unwrap();
    }
    copy.finish(EndReason::Complete).unwrap();
}

/// Every state of a recording: its frame, step and bits.
fn states(place: &Place, file: &str) -> Vec<(u64, u64, Vec<u64>)> {
    let mut source = RecordingSource::open(&place.path(file)).unwrap();
    let mut states = Vec::new();
    while let Received::Frame(frame) = source.receive().unwrap() {
        let values = [frame.u_m, frame.v_m_s, frame.extra].concat();
        states.push((frame.frame, frame.step, values.iter().map(|value| value.to_bits()).collect()));
    }
    states
}

const BOTH: [Compression; 2] = [Compression::None, Compression::Zstd { level: 1 }];

#[test]
fn a_damaged_chunk_is_named_with_its_frames_and_brought_back() {
    let place = Place::new();
    for compression in BOTH {
        let bytes = record(&place, "", compression);
        let whole = states(&place, "small.mcap");
        let chunks = chunks(&bytes);
        assert!(chunks.len() > 5);
        for number in [0, 3, chunks.len() - 1] {
            let (at, length) = chunks[number];
            let mut damaged = bytes.clone();
            damaged[at + 9 + length / 2] ^= 0x10;
            fs::write(place.path("damaged.mcap"), &damaged).unwrap();
            let found = place.run("verify damaged.mcap --json").exits(3).json();
            assert_eq!((&found["proven"], &found["difference_count"]), (&false.into(), &0.into()));
            let damage = &found["damages"][0];
            assert_eq!((&damage["kind"], &damage["chunk"]), (&"chunk".into(), &number.into()), "{found}");
            assert_eq!(damage["offset_bytes"], at);
            // all before and all after it was read
            let lost = found["missing_frames"][0].clone();
            assert_eq!(damage["frames"], lost, "{found}");
            let lost_count = lost[1].as_u64().unwrap() - lost[0].as_u64().unwrap() + 1;
            assert_eq!(found["states"].as_u64().unwrap() + lost_count, whole.len() as u64);
            let text = place.run("verify damaged.mcap").exits(3).stdout();
            assert!(text.contains(&format!("chunk {number} at byte {at}")), "{text}");

            let recovered = place.run("recover damaged.mcap --out whole.mcap --force --json").exits(0).json();
            assert_eq!((&recovered["whole"], &recovered["end"]), (&true.into(), &"complete".into()));
            assert_eq!(recovered["damages"][0]["chunk"], number);
            place.run("verify whole.mcap").exits(0);
            assert!(states(&place, "whole.mcap") == whole, "chunk {number}");
        }
    }
}

/// As a power failure leaves a chunk that was not synced, of which the last sector is missing; with more behind it.
#[test]
fn a_chunk_that_ends_in_zeros_is_not_where_the_file_ends() {
    let place = Place::new();
    let mut bytes = record(&place, "", Compression::Zstd { level: 1 });
    let whole = states(&place, "small.mcap");
    let chunks = chunks(&bytes);
    let (at, length) = chunks[3];
    bytes[at + length - 100..at + 9 + length].fill(0);
    bytes.truncate(chunks[5].0);
    fs::write(place.path("torn.mcap.partial"), &bytes).unwrap();
    let found = place.run("verify torn.mcap.partial --json").exits(3).json();
    assert_eq!(found["damages"][0]["chunk"], 3, "{found}");
    place.run("recover torn.mcap.partial --out saved.mcap").exits(0);
    let saved = states(&place, "saved.mcap");
    assert!(!saved.is_empty() && whole.starts_with(&saved));
    // the chunk after it is read
    let after = place.run("verify saved.mcap --json").exits(0).json();
    assert!(after["states"].as_u64() > found["states"].as_u64(), "{found} {after}");
}

#[test]
fn without_filling_a_gap_stays_one() {
    let place = Place::new();
    let mut bytes = record(&place, "", Compression::Zstd { level: 1 });
    let (at, length) = chunks(&bytes)[2];
    bytes[at + 9 + length / 2] ^= 1;
    fs::write(place.path("damaged.mcap"), &bytes).unwrap();
    let found = place.run("verify damaged.mcap --json").exits(3).json();
    let recovered = place.run("recover damaged.mcap --no-fill --out part.mcap --json").exits(3).json();
    assert_eq!((&recovered["whole"], &recovered["states_recomputed"]), (&false.into(), &0.into()));
    let again = place.run("verify part.mcap --json").exits(3).json();
    assert_eq!((&again["difference_count"], &again["damage_count"]), (&0.into(), &0.into()));
    // of the damaged chunk those states were taken that are what the ones before them lead to
    assert_eq!(again["missing_frames"], recovered["lost_frames"]);
    let (lost, missing) = (&recovered["lost_frames"][0], &found["missing_frames"][0]);
    assert!(lost[0].as_u64() >= missing[0].as_u64() && lost[1].as_u64() <= missing[1].as_u64(), "{lost}");
}

/// Wherever a file ends, what is in it is had, and proven.
#[test]
fn a_file_that_was_cut_anywhere_is_recovered() {
    let place = Place::new();
    for (compression, flags) in BOTH.into_iter().zip(["", "--record-every-steps 7"]) {
        let bytes = record(&place, flags, compression);
        let whole = states(&place, "small.mcap");
        let mut before = 0;
        for twentieth in 1..20 {
            let cut = bytes.len() * twentieth / 20;
            let mut part = bytes[..cut].to_vec();
            // as some file systems leave it
            part.resize(cut + (twentieth % 2) * 3000, 0);
            fs::write(place.path("run.mcap.partial"), &part).unwrap();
            fs::remove_file(place.path("run.mcap")).ok();
            let ended = place.run("recover run.mcap.partial --out run.mcap --json");
            if cut < chunks(&bytes)[1].0 {
                // there may be no state yet
                continue;
            }
            let recovered = ended.exits(0).json();
            assert!(fs::read(place.path("run.mcap.partial")).unwrap() == part, "the source was changed");
            place.run("verify run.mcap").exits(0);
            let found = states(&place, "run.mcap");
            assert!(whole.starts_with(&found) && found.len() >= before, "{recovered}");
            assert_eq!(recovered["states"], found.len());
            before = found.len();
        }
        assert!(before * 10 > whole.len() * 8, "{before} of {}", whole.len());
        // every whole message of the torn chunk was taken
        let (at, length) = chunks(&bytes)[4];
        fs::write(place.path("torn.mcap"), &bytes[..at + length * 3 / 4]).unwrap();
        let torn = place.run("recover torn.mcap --out untorn.mcap --force --json").exits(0).json();
        if compression == Compression::None {
            assert!(torn["states_proven_without_checksum"].as_u64().unwrap() > 3, "{torn}");
        }
    }
}

/// A change under checksums that hold, as only a program could make it.
#[test]
fn summaries_and_the_chain_are_compared_with_what_they_belong_to() {
    let place = Place::new();
    let bytes = record(&place, "", Compression::None);
    let unchecked = without_checksums(&bytes);
    fs::write(place.path("unchecked.mcap"), &unchecked).unwrap();
    place.run("verify unchecked.mcap").exits(0);
    let (start, body) =
        messages(&unchecked).into_iter().find(|(_, body)| body.first() == Some(&0x0a)).unwrap();
    let mut changed = unchecked.clone();
    changed[start + body.len() / 20] ^= 1;
    fs::write(place.path("changed.mcap"), &changed).unwrap();
    let found = place.run("verify changed.mcap --json").exits(3).json();
    assert!(found["damages"][0]["what"].as_str().unwrap().contains("chain"), "{found}");

    // in the 40th summary, the kinetic energy
    let summaries = messages(&unchecked).into_iter().filter(|(_, body)| body.len() < 250);
    let (start, body) = summaries.skip(40).find(|(_, body)| body.contains(&0x21)).unwrap();
    let mut changed = unchecked.clone();
    let at = body.windows(2).position(|pair| pair[0] == 0x19).unwrap() + 9;
    assert_eq!(body[at], 0x21);
    changed[start + at + 3] ^= 1;
    fs::write(place.path("changed.mcap"), &changed).unwrap();
    let found = place.run("verify changed.mcap --json").exits(3).json();
    assert_eq!((&found["summary_difference_count"], &found["difference_count"]), (&1.into(), &0.into()));
    assert_eq!(found["summary_differences"][0]["field"], "kinetic_j", "{found}");
    let text = place.run("verify changed.mcap").exits(3).stdout();
    assert!(text.contains("kinetic_j") && text.contains("NOT PROVEN"), "{text}");
}

/// Uncompressed, with all CRCs of the data section left out.
fn without_checksums(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (opcode, at, _) in records(&bytes.clone()) {
        match opcode {
            0x06 => bytes[at + 9 + 24..at + 9 + 28].fill(0),
            0x0f => bytes[at + 9..at + 13].fill(0),
            _ => {}
        }
    }
    bytes
}

/// Offset and contents of every message of an uncompressed file.
fn messages(bytes: &[u8]) -> Vec<(usize, Vec<u8>)> {
    let mut messages = Vec::new();
    for (chunk, length) in chunks(bytes) {
        let mut at = chunk + 9 + 40;
        while at < chunk + 9 + length {
            let size = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
            let size = usize::try_from(size).unwrap();
            if bytes[at] == 0x05 {
                messages.push((at + 9 + 22, bytes[at + 9 + 22..at + 9 + size].to_vec()));
            }
            at += 9 + size;
        }
    }
    messages
}

/// Nothing in a recording can change unnoticed but what docs/FORMAT.md says.
#[test]
fn one_bit_flipped_anywhere_is_reported() {
    let place = Place::new();
    let mut random = 20_261_121_u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(random >> 33).unwrap()
    };
    for compression in BOTH {
        let bytes = record(&place, "--record-every-steps 5", compression);
        place.run("verify small.mcap").exits(0);
        for _ in 0..100 {
            let (at, bit) = (next() % bytes.len(), next() % 8);
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << bit;
            fs::write(place.path("flipped.mcap"), &flipped).unwrap();
            let ended = place.run("verify flipped.mcap");
            let code = ended.code();
            let said = format!("{}{}", ended.stdout(), ended.stderr());
            assert!(code == Some(3) || code == Some(2), "bit {bit} of byte {at}: {code:?}\n{said}");
        }
    }
}

#[test]
fn what_cannot_be_recomputed_is_said_and_kept() {
    let place = Place::new();
    record(&place, "", Compression::None);
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let mut manifest = source.manifest().clone();
    manifest.physics.kernel_version = schemas::manifest::KERNEL_VERSION + 1;
    let options = WriteOptions { chunk_bytes: 20_000, ..WriteOptions::default() };
    let mut other = RecordingWriter::create(&place.path("other.mcap"), &manifest, "", &options).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap() {
        other.accept(&frame).unwrap();
    }
    other.finish(EndReason::Complete).unwrap();
    let text = place.run("verify other.mcap").exits(3).stdout();
    for words in ["CANNOT BE PROVEN", "kernel version 4", "nothing is wrong with it"] {
        assert!(text.contains(words), "{text}");
    }
    let found = place.run("verify other.mcap --json").exits(3).json();
    assert_eq!((&found["other_kernel"], &found["damage_count"]), (&4.into(), &0.into()));

    let mut bytes = fs::read(place.path("other.mcap")).unwrap();
    let (at, length) = chunks(&bytes)[2];
    bytes[at + 9 + length / 2] ^= 1;
    fs::write(place.path("damaged.mcap"), &bytes).unwrap();
    let found = place.run("verify damaged.mcap --json").exits(3).json();
    assert_eq!(found["damages"][0]["chunk"], 2, "{found}");
    let recovered = place.run("recover damaged.mcap --out rest.mcap --json").exits(3).json();
    assert_eq!(recovered["lost_frames"][0], found["missing_frames"][0]);
    assert_eq!((&recovered["states"], &recovered["states_recomputed"]), (&found["states"], &0.into()));
    let rest = place.run("verify rest.mcap --json").exits(3).json();
    assert_eq!((&rest["damage_count"], &rest["missing_frames"]), (&0.into(), &found["missing_frames"]));
}

/// Writes the states of `steps` of `run.mcap` as a recording of every tenth that begins with `first_step`.
fn begin_late(place: &Place, first_step: u64, chunk_bytes: u64, has: impl Fn(u64) -> bool) -> Vec<u8> {
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let manifest = source.manifest().clone().recorded_every(10).unwrap();
    let begin = BeginRecord { first_step, ..BeginRecord::default() };
    let compression = Compression::None;
    let flush_period = Duration::from_hours(1);
    let options =
        WriteOptions { force: true, compression, chunk_bytes, flush_period, ..WriteOptions::default() };
    let path = place.path("late.mcap");
    let mut late = RecordingWriter::create_from(&path, &manifest, None, &begin, &options).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap() {
        let is_due = frame.step == first_step || manifest.is_recorded(frame.step);
        if is_due && has(frame.step) && frame.step >= first_step {
            late.accept(&frame).unwrap();
        }
    }
    late.finish(EndReason::Complete).unwrap();
    fs::read(path).unwrap()
}

/// A step that is wrong says nothing about the states around it, however far it points.
#[test]
fn a_changed_step_spoils_no_other_state() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    // each state in its chunk, and all in one, where none has a checksum that holds
    for chunk_bytes in [1, 1 << 20] {
        let mut bytes = begin_late(&place, 103, chunk_bytes, |_| true);
        // frame and step of the second state
        let second = |(_, body): &(usize, Vec<u8>)| body.starts_with(&[0x08, 110, 0x10, 110]);
        let (at, _) = messages(&bytes).into_iter().find(second).unwrap();
        bytes[at + 3] = 126;
        fs::write(place.path("damaged.mcap"), &bytes).unwrap();
        let recovered = place.run("recover damaged.mcap --out whole.mcap --force --json");
        if chunk_bytes > 1 {
            // nothing proves the first one
            recovered.exits(2).says(&["nothing to recover"]);
            continue;
        }
        let recovered = recovered.exits(0).json();
        assert_eq!((&recovered["whole"], &recovered["difference_count"]), (&true.into(), &0.into()));
        assert_eq!(
            (&recovered["states_unproven"], &recovered["recomputed_frames"][0]),
            (&1.into(), &serde_json::json!([110, 110]))
        );
        place.run("verify whole.mcap").exits(0);
    }
}

/// What a recording begins with is due by no schedule, and is missed all the same.
#[test]
fn a_first_state_that_is_missing_is_reported() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    begin_late(&place, 103, 20_000, |step| step > 103);
    let recovered = place.run("recover late.mcap --out rest.mcap --json").exits(3).json();
    assert_eq!((&recovered["whole"], &recovered["difference_count"]), (&false.into(), &0.into()));
    assert_eq!(recovered["lost_frames"], serde_json::json!([[103, 103]]));
}

#[test]
fn what_is_no_recording_is_not_recovered_and_nothing_is_replaced() {
    let place = Place::new();
    let bytes = record(&place, "", Compression::Zstd { level: 1 });
    place.write("table.mcap", "time,energy\n");
    place.run("recover table.mcap --out out.mcap").exits(2).says(&["not an MCAP file"]);
    place.run("recover small.mcap --out small.mcap --force").exits(2).says(&["the source itself"]);
    place.write("mine.mcap", "mine");
    place.run("recover small.mcap --out mine.mcap").exits(2).says(&["exists", "--force"]);
    assert_eq!(place.read("mine.mcap"), "mine");
    // without its manifest nothing in a file means anything
    let mut headless = bytes.clone();
    let at = bytes.windows(11).position(|window| window == b"\"alpha\":1.5").unwrap();
    headless[at + 10] = b'6';
    fs::write(place.path("headless.mcap"), headless).unwrap();
    place.run("recover headless.mcap --out out.mcap").exits(2).says(&["manifest's checksum"]);
    // only the head was written
    fs::write(place.path("empty.mcap"), &bytes[..chunks(&bytes)[0].0]).unwrap();
    place.run("recover empty.mcap --out out.mcap").exits(2).says(&["nothing to recover"]);
    assert!(!place.path("out.mcap").exists() && !place.path("out.mcap.partial").exists());
}

/// Where the result would be in the way of its source, it is written beside it: nothing is replaced there, either.
#[test]
fn what_stands_beside_the_source_is_not_replaced() {
    let place = Place::new();
    let bytes = record(&place, "", Compression::Zstd { level: 1 });
    fs::write(place.path("torn.mcap.partial"), &bytes[..bytes.len() / 2]).unwrap();
    for name in ["torn.mcap.recovered", "torn.mcap.recovered.partial"] {
        place.write(name, "mine");
        place.run("recover torn.mcap.partial --out torn.mcap").exits(2).says(&[name, "--force"]);
        assert_eq!(place.read(name), "mine");
        assert!(!place.path("torn.mcap").exists());
        fs::remove_file(place.path(name)).unwrap();
    }
    place.write("torn.mcap.recovered.partial", "mine");
    let recovered = place.run("recover torn.mcap.partial --out torn.mcap --force");
    assert!(recovered.code().is_some_and(|code| code == 0 || code == 3), "{}", recovered.stderr());
    assert!(place.path("torn.mcap").exists() && place.path("torn.mcap.partial").exists());
}

/// With `--force` the parts that an earlier recording had more are removed, but not that of a recorder that lives.
#[test]
fn a_part_that_is_being_written_is_not_removed() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let manifest = source.manifest().clone();
    let options = WriteOptions { force: true, ..WriteOptions::default() };
    let split = Split { bytes: None, duration_s: Some(0.0015) };
    let parts = [7, 8, 9].map(|part| place.path(format!("split-part-{part:04}.mcap")));
    fs::write(&parts[0], "earlier").unwrap();
    fs::write(place.path("split-part-0008.mcap.partial"), "earlier").unwrap();
    let mut living = RecordingWriter::create(&parts[2], &manifest, "", &options).unwrap();
    let path = place.path("split.mcap");
    let mut writer = PartsWriter::create(&path, &manifest, None, 0, &options, &split).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap() {
        writer.accept(&frame).unwrap();
        living.accept(&frame).unwrap();
    }
    assert_eq!(writer.finish(EndReason::Complete).unwrap().len(), 3);
    living.finish(EndReason::Complete).unwrap();
    assert!(!parts[0].exists() && !place.path("split-part-0008.mcap.partial").exists());
    place.run("verify split-part-0009.mcap").exits(0);
}

/// A part says that it is continued only if there is a next one.
#[test]
fn a_part_that_cannot_be_continued_does_not_say_so() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let manifest = source.manifest().clone();
    let split = Split { bytes: None, duration_s: Some(0.0015) };
    let path = place.path("split.mcap");
    let options = WriteOptions::default();
    let mut writer = PartsWriter::create(&path, &manifest, None, 0, &options, &split).unwrap();
    fs::create_dir(place.path("split-part-0002.mcap")).unwrap();
    let refused = loop {
        let Received::Frame(frame) = source.receive().unwrap() else { panic!("all was recorded") };
        if let Err(error) = writer.accept(&frame) {
            break error.to_string();
        }
    };
    assert!(refused.contains("split-part-0002.mcap"), "{refused}");
    assert_eq!(writer.finish(EndReason::Detached).unwrap().len(), 1);
    let found = place.run("verify split-part-0001.mcap --json").exits(0).json();
    assert_eq!(found["end"], "detached", "{found}");
    assert!(!place.path("split-part-0002.mcap.partial").exists());
}

/// A recording that a living process writes is left to it.
#[test]
fn a_living_run_is_left_alone() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --pace 2e-4 --flush-period 0.001"));
    wait_for_states(&place, "run.mcap.partial");
    place.run("recover run.mcap.partial --out out.mcap").exits(1).says(&["process that lives"]);
    assert!(!place.path("out.mcap").exists());
    // what is being written is not broken
    let said = place.run("info run.mcap.partial").exits(3).stdout();
    assert!(said.contains("being written by a running process; so far it reaches step"), "{said}");
    let said = place.run("verify run.mcap.partial").exits(3).stdout();
    assert!(said.contains("proven as far as it is written") && said.contains("wait for its end"), "{said}");
    assert!(!said.contains("NOT WHOLE") && !said.contains("recover"), "{said}");
    place.run("energies run.mcap.partial").exits(3).says(&["is being written"]);
    assert_eq!(place.run("info run.mcap.partial --json").exits(3).json()["being_written"], true);
    run.signal("KILL");
    run.wait();
    let said = place.run("info run.mcap.partial").exits(3).stdout();
    assert!(said.contains("unfinished: it was not closed"), "{said}");
    assert!(place.run("verify run.mcap.partial").exits(3).stdout().contains("NOT WHOLE"));
    let recovered = place.run("recover run.mcap.partial --out run.mcap --json").exits(0).json();
    assert_eq!((&recovered["end"], &recovered["end_was_read"]), (&"interrupted".into(), &false.into()));
    assert!(recovered["states"].as_u64().unwrap() > 10, "{recovered}");
    place.run("verify run.mcap").exits(0);
}

/// Waits until some states of a recording that is being written are in its file.
fn wait_for_states(place: &Place, file: &str) {
    wait_until(file, || {
        let mut source = RecordingSource::open(&place.path(file)).ok()?;
        source.seek_to_step(10).ok()?;
        matches!(source.receive(), Ok(Received::Frame(frame)) if frame.step == 10).then_some(())
    });
}

/// The parts of a split recording: each by itself, and one after the other.
#[test]
fn parts_are_verified_by_themselves_and_in_their_order() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let manifest = source.manifest().clone();
    let split = Split { bytes: None, duration_s: Some(0.0015) };
    let path = place.path("split.mcap");
    let flush_period = Duration::from_hours(1);
    let options = WriteOptions { chunk_bytes: 20_000, flush_period, ..WriteOptions::default() };
    let mut parts = PartsWriter::create(&path, &manifest, None, 0, &options, &split).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap() {
        parts.accept(&frame).unwrap();
    }
    assert_eq!(parts.finish(EndReason::Complete).unwrap().len(), 3);
    let [one, two, three] = [1, 2, 3].map(|part| format!("split-part-{part:04}.mcap"));
    let found = place.run(&format!("verify {two} --json")).exits(0).json();
    assert_eq!((&found["part"], &found["end"]), (&2.into(), &"continued".into()));
    assert!(place.run(&format!("verify {two}")).exits(0).stdout().contains("it is part 2, which follows"));
    let found = place.run(&format!("verify {one} {two} {three} --json")).exits(0).json();
    assert_eq!(found[1]["previous_state_hash"], found[0]["last_state_hash"]);
    assert!(
        found.as_array().unwrap().iter().skip(1).all(|part| part["follows"]["proven"] == true),
        "{found}"
    );
    let text = place.run(&format!("verify {one} {three}")).exits(3).stdout();
    assert!(text.contains("part 3 does not follow part 1") && text.contains("NOT FOLLOW"), "{text}");

    // a part is recovered as the part that it is
    let mut bytes = fs::read(place.path(&two)).unwrap();
    let (at, length) = chunks(&bytes)[1];
    bytes[at + 9 + length - 5] ^= 1;
    fs::write(place.path("damaged.mcap"), &bytes).unwrap();
    place.run("recover damaged.mcap --out two.mcap --json").exits(0);
    assert!(states(&place, "two.mcap") == states(&place, &two));
    let found = place.run(&format!("verify {one} two.mcap {three} --json")).exits(0).json();
    assert_eq!((&found[1]["part"], &found[1]["end"]), (&2.into(), &"continued".into()), "{found}");

    // what it begins with follows from nothing in it: without a checksum that holds it is lost
    let mut bytes = fs::read(place.path(&two)).unwrap();
    let (at, length) = chunks(&bytes)[0];
    bytes[at + 9 + length - 5] ^= 1;
    fs::write(place.path("damaged.mcap"), &bytes).unwrap();
    let recovered = place.run("recover damaged.mcap --out rest.mcap --json").exits(3).json();
    let all = states(&place, &two);
    let kept = recovered["states"].as_u64().unwrap();
    let (first, last) = (all[0].0, all.last().unwrap().0);
    assert!(kept > 0 && first + kept <= last, "{recovered}");
    assert_eq!(recovered["lost_frames"], serde_json::json!([[first, last - kept]]));
}

/// Advice of `verify` can be followed: a part of a recording is not gone on with, nor is a file recovered of which nothing would be left.
#[test]
fn verify_advises_what_can_be_done() {
    let place = Place::new();
    let golden = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/1.0-kernel-2/");
    let part = fs::read(format!("{golden}results-part-0002.mcap")).unwrap();
    fs::write(place.path("late.mcap.partial"), &part[..part.len() * 9 / 10]).unwrap();
    let told = place.run("verify late.mcap.partial").exits(3).stdout();
    assert!(!told.contains("--resume") && told.contains("beadline recover"), "{told}");
    place.run("run --resume late.mcap.partial").exits(2);
    fs::copy(format!("{golden}partial.mcap.partial"), place.path("begun.mcap.partial")).unwrap();
    let told = place.run("verify begun.mcap.partial").exits(3).stdout();
    assert!(
        told.contains("beadline run --resume begun.mcap.partial") && told.contains("beadline recover"),
        "{told}"
    );
    for (duration, chunk_count) in [("0.00002", 1), ("0.0005", 2)] {
        let run =
            format!("run --preset light-impurity --duration {duration} --no-publish --force --out one.mcap");
        place.run(&run).exits(0);
        let mut bytes = fs::read(place.path("one.mcap")).unwrap();
        let all = chunks(&bytes);
        assert!(all.len() >= chunk_count && (all.len() == 1) == (chunk_count == 1), "{}", all.len());
        let (at, length) = all[0];
        bytes[at + length / 2] ^= 1;
        fs::write(place.path("flipped.mcap"), &bytes).unwrap();
        let told = place.run("verify flipped.mcap").exits(3).stdout();
        let is_lost = chunk_count == 1;
        assert!(told.contains("beadline recover") != is_lost && !told.contains("--resume"), "{told}");
        place.run("recover flipped.mcap --out kept.mcap").exits(if is_lost { 2 } else { 0 });
    }
}
