//! Files that are not what they should be: every one is an error or a valid prefix, none a panic.

use crate::run::{doubles, manifest, options, put, read_all, temp_dir, with_causes, write_recording};
use mcap::records::{MessageHeader, Metadata, Record, op};
use recording::{Compression, ContactsReader, ReadError, RecordingInfo, RecordingSource, WriteOptions};
use schemas::frame::{EndReason, FrameSource, Received};
use schemas::manifest::RunManifest;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// Opcode, offset and length of the contents of the top-level records of a file.
pub(crate) fn records(bytes: &[u8]) -> Vec<(u8, usize, usize)> {
    let (mut at, mut records) = (8, Vec::new());
    while at + 9 <= bytes.len() - 8 {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        records.push((bytes[at], at, length));
        at += 9 + length;
    }
    records
}

/// A state with two arrays of `length` doubles.
pub(crate) fn state(frame: Option<u64>, step: u64, time_s: f64, length: usize) -> Vec<u8> {
    let mut message = Vec::new();
    if let Some(frame) = frame {
        message.extend([0x08, frame as u8]);
    }
    message.extend([0x10, step as u8, 0x19]);
    message.extend(time_s.to_le_bytes());
    for (tag, which) in [(0x22, 0), (0x2a, 1)] {
        message.extend([tag, (8 * length % 128) as u8 | 0x80, (8 * length / 128) as u8]);
        message.extend(doubles(step, which).iter().take(length).flat_map(|x| x.to_le_bytes()));
    }
    message
}

/// The metadata `beadline.run` of `manifest`, taken from a file of ours.
pub(crate) fn run_metadata(manifest: &RunManifest) -> Metadata {
    let (_directory, path) = temp_dir();
    write_recording(&path, manifest, &options());
    let bytes = fs::read(&path).unwrap();
    let (opcode, at, length) = records(&bytes)[1];
    match mcap::parse_record(opcode, &bytes[at + 9..at + 9 + length]) {
        Ok(Record::Metadata(metadata)) => metadata,
        other => panic!("{other:?}"),
    }
}

/// Writes a file with these messages as `/state`, by the bare mcap writer.
pub(crate) fn forge(path: &Path, profile: &str, metadata: &[Metadata], states: &[Vec<u8>]) {
    let options = mcap::WriteOptions::new().profile(profile).compression(None);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    for record in metadata.iter().filter(|record| record.name != "beadline.end") {
        writer.write_metadata(record).unwrap();
    }
    let channel_id = writer.add_channel(0, "/state", "protobuf", &BTreeMap::new()).unwrap();
    for (sequence, message) in (0..).zip(states) {
        let header = MessageHeader { channel_id, sequence, log_time: 0, publish_time: 0 };
        writer.write_to_known_channel(&header, message).unwrap();
    }
    for record in metadata.iter().filter(|record| record.name == "beadline.end") {
        writer.write_metadata(record).unwrap();
    }
    writer.finish().unwrap();
    fs::write(path, writer.into_inner().into_inner()).unwrap();
}

pub(crate) fn end_metadata(reason: &str, last_step: &str) -> Metadata {
    let entries = [
        ("reason", reason),
        ("first_step", "0"),
        ("last_step", last_step),
        ("part", "1"),
        ("previous_state_hash", ""),
        ("last_state_hash", ""),
    ];
    let metadata = entries.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
    Metadata { name: "beadline.end".into(), metadata }
}

#[test]
fn files_that_are_no_recordings_are_told_apart() {
    let (directory, path) = temp_dir();
    let open = || RecordingSource::open(&path).err().unwrap();
    for bytes in [&b""[..], b"short", b"frame,step,time_s,u_m\n0,0,0,0\n"] {
        fs::write(&path, bytes).unwrap();
        assert!(matches!(open(), ReadError::NotMcap { .. }));
    }
    assert!(matches!(RecordingSource::open(directory.path()).err().unwrap(), ReadError::NotMcap { .. }));
    forge(&path, "ros2", &[], &[]);
    let error = open();
    assert!(matches!(error, ReadError::NotBeadline { .. }));
    assert!(error.to_string().ends_with("its profile is `ros2` instead of `beadline`"), "{error}");
    forge(&path, "beadline", &[], &[]);
    assert!(open().to_string().contains("not the metadata `beadline.run`"), "{}", open());
}

#[test]
fn another_major_version_is_refused_with_both_named() {
    let (_directory, path) = temp_dir();
    let mut metadata = run_metadata(&manifest(3, 1, 1));
    metadata.metadata.insert("schema_version".into(), "2.3".into());
    forge(&path, "beadline", &[metadata], &[]);
    let error = RecordingSource::open(&path).err().unwrap();
    assert!(matches!(error, ReadError::Manifest { .. }));
    let text = with_causes(&error);
    assert!(text.contains("2.3") && text.contains("1.1"), "{text}");
}

/// The metadata of a run of a later version, with its checksum: `part` says one thing more.
fn newer_metadata(part: &str) -> Metadata {
    let mut record = run_metadata(&manifest(3, 1, 1));
    let entries = &mut record.metadata;
    entries.insert("schema_version".into(), "1.2".into());
    let said = entries[part].replacen('{', "{\"walls\":2,", 1);
    entries.insert(part.to_owned(), said);
    let parts = ["schema_version", "physics", "provenance"].map(|key| format!("{}\n", entries[key]));
    let hash = Sha256::digest(format!("beadline.run\n{}", parts.concat()));
    let checksum = hash.iter().fold(String::new(), |hex, byte| hex + &format!("{byte:02x}"));
    entries.insert("checksum".into(), checksum);
    record
}

#[test]
fn a_newer_minor_version_is_read_unless_it_knows_more_of_the_physics() {
    let (_directory, path) = temp_dir();
    let ours = manifest(3, 1, 1);
    let states: Vec<_> = (0..=3).map(|n| state(Some(n), n, ours.physics.time_s(n), 40)).collect();
    forge(&path, "beadline", &[newer_metadata("provenance"), end_metadata("complete", "3")], &states);
    let mut source = RecordingSource::open(&path).unwrap();
    assert!(source.manifest().is_newer_minor());
    let (steps, missed, end) = read_all(&mut source);
    assert_eq!((steps.len(), missed.len(), end.unwrap()), (4, 0, EndReason::Complete));
    let info = RecordingInfo::read(&path).unwrap();
    assert!(info.is_complete() && info.manifest.schema_version.to_string() == "1.2");
    // what we make of it is of our version
    let copy = path.with_extension("copy.mcap");
    write_recording(&copy, source.manifest(), &options());
    assert!(!RecordingSource::open(&copy).unwrap().manifest().is_newer_minor());

    forge(&path, "beadline", &[newer_metadata("physics")], &states);
    let error = RecordingSource::open(&path).err().unwrap();
    let text = with_causes(&error);
    assert!(matches!(error, ReadError::Manifest { .. }), "{text}");
    assert!(["1.2", "1.1", "`walls`"].iter().all(|word| text.contains(word)), "{text}");
}

#[test]
fn a_changed_manifest_is_noticed_in_an_unfinished_file_too() {
    let (_directory, path) = temp_dir();
    write_recording(&path, &manifest(3, 1, 1), &options());
    let mut bytes = fs::read(&path).unwrap();
    let at = bytes.windows(11).position(|window| window == b"\"alpha\":1.5").unwrap();
    bytes[at + 10] = b'6';
    bytes.truncate(bytes.len() - 1);
    fs::write(&path, bytes).unwrap();
    let error = RecordingSource::open(&path).err().unwrap();
    assert!(matches!(error, ReadError::ManifestChecksum { .. }), "{error}");
}

#[test]
fn a_wrong_crc_names_the_chunk_and_its_place() {
    let (_directory, path) = temp_dir();
    let uncompressed = WriteOptions { compression: Compression::None, ..options() };
    write_recording(&path, &manifest(57, 1, 1), &uncompressed);
    let mut bytes = fs::read(&path).unwrap();
    let chunks: Vec<_> = records(&bytes).into_iter().filter(|record| record.0 == op::CHUNK).collect();
    let (_, at, length) = chunks[3];
    bytes[at + length / 2] ^= 1;
    fs::write(&path, bytes).unwrap();
    let mut source = RecordingSource::open(&path).unwrap();
    let (steps, _, end) = read_all(&mut source);
    assert!(!steps.is_empty(), "the chunks before are good");
    let error = end.unwrap_err().to_string();
    assert!(error.contains(&format!("the CRC of chunk 3 at byte {at}")), "{error}");
    assert_eq!(read_all(&mut source).2.unwrap(), EndReason::Unfinished, "nothing after it is believed");
}

#[test]
fn states_that_are_none_of_this_run_are_refused() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(9, 1, 1);
    let time_s = |step| manifest.physics.time_s(step);
    let run = run_metadata(&manifest);
    let refused = |states: &[Vec<u8>]| {
        forge(&path, "beadline", std::slice::from_ref(&run), states);
        let error = match RecordingSource::open(&path) {
            Ok(mut source) => read_all(&mut source).2.unwrap_err(),
            Err(error) => error,
        };
        assert!(matches!(error, ReadError::Damaged { .. }));
        error.to_string()
    };
    let first = state(Some(0), 0, 0.0, 40);
    let text = refused(&[first.clone(), state(Some(1), 1, time_s(1), 39)]);
    assert!(text.contains("step 1 has 39 values of displacement_m instead of 40"), "{text}");
    let text = refused(&[first.clone(), state(Some(2), 2, time_s(2), 40), state(Some(1), 1, time_s(1), 40)]);
    assert!(text.contains("step 1 after that of step 2"), "{text}");
    let text = refused(&[first.clone(), first.clone()]);
    assert!(text.contains("step 0 after that of step 0"), "{text}");
    let text = refused(&[state(Some(1), 0, 0.0, 40)]);
    assert!(text.contains("step 0 as frame 1"), "{text}");
    let text = refused(&[state(Some(1), 1, 1.0, 40)]);
    assert!(text.contains("step 1 at 1 s instead of"), "{text}");
    let text = refused(&[state(Some(10), 10, time_s(10), 40)]);
    assert!(text.contains("step 10, the last of the run is 9"), "{text}");
    let text = refused(&[vec![0xff; 50]]);
    assert!(text.contains("no ChainState"), "{text}");
}

#[test]
fn frames_that_should_be_there_are_reported_missing_and_others_not() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(57, 1, 10);
    let metadata = [run_metadata(&manifest), end_metadata("complete", "57")];
    let at = |step: u64| state(Some(step), step, manifest.physics.time_s(step), 40);
    // 0 and 10 are missing, 25 is more than asked for, 40 and 50 are missing, 57 too
    let unframed = state(None, 33, manifest.physics.time_s(33), 40);
    forge(&path, "beadline", &metadata, &[at(20), at(25), at(30), unframed]);
    let (steps, missed, end) = read_all(&mut RecordingSource::open(&path).unwrap());
    assert_eq!(steps, [20, 25, 30]);
    assert_eq!(missed, [(0, 10), (40, 57)]);
    assert_eq!(end.unwrap(), EndReason::Complete);

    let metadata = [run_metadata(&manifest), end_metadata("interrupted", "34")];
    forge(&path, "beadline", &metadata, &[at(0), at(10), at(30), at(34)]);
    let (steps, missed, end) = read_all(&mut RecordingSource::open(&path).unwrap());
    assert_eq!((steps, missed), (vec![0, 10, 30, 34], vec![(20, 20)]));
    assert_eq!(end.unwrap(), EndReason::Interrupted);
}

/// Whatever the bytes are: no panic, and only frames that were recorded, in order.
fn survive(path: &Path, bytes: &[u8]) -> Option<EndReason> {
    put(path, bytes);
    let _ = RecordingInfo::read(path);
    if let Ok(mut reader) = ContactsReader::open(path) {
        while let Ok(Some(_)) = reader.next_row() {}
    }
    let (steps, _, end) = read_all(&mut RecordingSource::open(path).ok()?);
    assert!(steps.is_sorted());
    end.ok()
}

#[test]
fn no_change_of_bytes_makes_a_reader_panic_or_believe_it() {
    for compression in [Compression::None, Compression::Zstd { level: 1 }] {
        let (_directory, path) = temp_dir();
        let manifest = manifest(20, 1, 1);
        write_recording(&path, &manifest, &WriteOptions { compression, ..options() });
        let bytes = fs::read(&path).unwrap();
        let other = path.with_extension("other");
        let mut random = 1_u64;
        for _ in 0..400 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let at = (random >> 33) as usize % bytes.len();
            let mut changed = bytes.clone();
            changed[at] ^= 1 << (random >> 29 & 7);
            let end = survive(&other, &changed);
            assert_ne!(end, Some(EndReason::Complete), "one bit at byte {at} went unnoticed");
            // and a few more
            for count in 0..random >> 60 {
                let more = (random.rotate_left(count as u32) >> 20) as usize % bytes.len();
                changed[more] = (random >> count) as u8;
            }
            survive(&other, &changed);
        }
    }
}

#[test]
fn no_length_makes_a_reader_panic_or_allocate_what_is_not_there() {
    let (_directory, path) = temp_dir();
    let uncompressed = WriteOptions { compression: Compression::None, ..options() };
    write_recording(&path, &manifest(9, 1, 1), &uncompressed);
    let bytes = fs::read(&path).unwrap();
    let other = path.with_extension("other");
    let mut seen = Vec::new();
    for (opcode, at, length) in records(&bytes) {
        if seen.contains(&opcode) {
            continue;
        }
        seen.push(opcode);
        let lengths = [0, 1, 3, length as u64 - 1, length as u64 + 1, 1 << 31, 1 << 62, u64::MAX];
        // the record's own length, and every number within its first bytes
        for place in std::iter::once(at + 1).chain(at + 9..(at + 60).min(bytes.len() - 8)) {
            for length in lengths {
                let mut changed = bytes.clone();
                changed[place..place + 8].copy_from_slice(&length.to_le_bytes());
                // CRCs left out, so that what they protect is looked at, too
                if opcode == op::CHUNK && place >= at + 37 {
                    changed[at + 33..at + 37].fill(0);
                }
                survive(&other, &changed);
            }
        }
    }
}

#[test]
fn records_within_a_chunk_are_not_believed_either() {
    let (_directory, path) = temp_dir();
    let uncompressed = WriteOptions { compression: Compression::None, ..options() };
    write_recording(&path, &manifest(9, 1, 1), &uncompressed);
    let mut bytes = fs::read(&path).unwrap();
    let chunk = records(&bytes).into_iter().find(|record| record.0 == op::CHUNK).unwrap();
    bytes[chunk.1 + 33..chunk.1 + 37].fill(0);
    let other = path.with_extension("other");
    let mut random = 7_u64;
    for at in (chunk.1 + 49..chunk.1 + 9 + chunk.2).step_by(11) {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let mut changed = bytes.clone();
        changed[at] = (random >> 40) as u8;
        put(&other, &changed);
        let _ = RecordingInfo::read(&other);
        let Ok(mut source) = RecordingSource::open(&other) else { continue };
        // a wrong double is a double: only the shape is looked at here
        while let Ok(Received::Frame(frame)) = source.receive() {
            assert_eq!((frame.u_m.len(), frame.v_m_s.len()), (40, 40));
        }
    }
}
