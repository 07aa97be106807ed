//! What recordings promise: the same bits back, nothing overwritten, nothing believed unchecked.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_possible_truncation, reason = "tests")]

mod crash;
mod hostile;
mod messages;
mod others;
mod run;
mod salvage;
mod seeking;
mod writing;

use bus::{AttachError, RoomError, RootError};
use recording::{
    Compression, ContactsReader, ContactsRow, ContactsWriter, ReadError, RecordingInfo, RecordingSource,
    RecordingWriter, SpaceNeeded, WriteError, WriteOptions,
};
use run::{RUN_TOML, for_each_frame, manifest, options, read_all, temp_dir, with_causes, write_recording};
use schemas::frame::{EndReason, FrameSink, FrameSource, Received};
use schemas::manifest::{ManifestError, RunManifest};
use schemas::whole_file::WholeFileError;
use std::fs;

#[test]
fn frames_come_back_bit_for_bit() {
    for compression in [Compression::None, Compression::Zstd { level: 1 }] {
        let (_directory, path) = temp_dir();
        let manifest = manifest(57, 1, 1);
        let finished = write_recording(&path, &manifest, &WriteOptions { compression, ..options() });
        assert_eq!(finished.path, path);
        assert_eq!(finished.frames, 58);
        assert_eq!(finished.bytes, fs::metadata(&path).unwrap().len());
        let mut source = RecordingSource::open(&path).unwrap();
        assert_eq!(*source.manifest(), manifest);
        let (steps, missed, end) = read_all(&mut source);
        assert_eq!(steps, (0..=57).collect::<Vec<_>>());
        assert!(missed.is_empty());
        assert_eq!(end.unwrap(), EndReason::Complete);
        // the end is only repeated
        assert_eq!(source.receive().unwrap(), Received::End(EndReason::Complete));
    }
}

#[test]
fn a_sparse_recording_has_the_first_and_the_last_frame_and_misses_nothing() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(57, 2, 10);
    let finished = write_recording(&path, &manifest, &options());
    assert_eq!(finished.frames, manifest.recorded_count());
    let (steps, missed, end) = read_all(&mut RecordingSource::open(&path).unwrap());
    assert_eq!(steps, [0, 10, 20, 30, 40, 50, 57]);
    assert!(missed.is_empty());
    assert_eq!(end.unwrap(), EndReason::Complete);
}

#[test]
fn an_interrupted_recording_says_so_and_keeps_its_last_frame() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(57, 1, 10);
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &options()).unwrap();
    for_each_frame(&manifest, |frame| {
        if frame.step <= 34 && (manifest.is_recorded(frame.step) || frame.step == 34) {
            writer.accept(frame).unwrap();
        }
    });
    writer.finish(EndReason::Interrupted).unwrap();
    let (steps, missed, end) = read_all(&mut RecordingSource::open(&path).unwrap());
    assert_eq!(steps, [0, 10, 20, 30, 34]);
    assert!(missed.is_empty());
    assert_eq!(end.unwrap(), EndReason::Interrupted);
    let info = RecordingInfo::read(&path).unwrap();
    assert!(info.finished && !info.is_complete());
    assert_eq!(info.end.unwrap().reason, EndReason::Interrupted);
}

#[test]
fn info_is_the_same_from_the_summary_and_from_all_of_it() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(57, 1, 1);
    let finished = write_recording(&path, &manifest, &options());
    let info = RecordingInfo::read(&path).unwrap();
    assert_eq!(info.manifest, manifest);
    assert_eq!(info.run_toml.as_deref(), Some(RUN_TOML));
    let channels: Vec<_> =
        info.channels.iter().map(|c| (c.topic.as_str(), c.schema.as_str(), c.messages)).collect();
    let expected = [
        ("/chain", "beadline.v1.Chain", 1),
        ("/state", "beadline.v1.ChainState", 58),
        ("/summary", "beadline.v1.Summary", 58),
    ];
    assert_eq!(channels, expected);
    assert_eq!((info.first_step, info.last_step), (Some(0), Some(57)));
    assert_eq!(info.time_range_s(), Some((0.0, manifest.physics.time_s(57))));
    assert_eq!((info.file_bytes, info.uncompressed_bytes), (finished.bytes, finished.uncompressed_bytes));
    assert!(info.finished && info.is_complete() && info.damage.is_none());

    // without its last byte it was not closed, and everything is read
    let cut = path.with_extension("cut");
    let bytes = fs::read(&path).unwrap();
    fs::write(&cut, &bytes[..bytes.len() - 1]).unwrap();
    let scanned = RecordingInfo::read(&cut).unwrap();
    assert_eq!((&scanned.channels, &scanned.run_toml), (&info.channels, &info.run_toml));
    assert_eq!((scanned.first_step, scanned.last_step), (info.first_step, info.last_step));
    assert_eq!(scanned.uncompressed_bytes, info.uncompressed_bytes);
    assert!(!scanned.finished && scanned.end.is_none() && scanned.damage.is_none());
}

#[test]
fn nothing_is_overwritten_without_force() {
    let (_directory, path) = temp_dir();
    let partial = path.with_extension("mcap.partial");
    let manifest = manifest(3, 1, 1);
    let create =
        |force| RecordingWriter::create(&path, &manifest, RUN_TOML, &WriteOptions { force, ..options() });
    fs::write(&path, "precious").unwrap();
    let error = create(false).err().unwrap();
    assert!(matches!(error, WriteError::File(WholeFileError::Exists { .. })));
    assert!(error.to_string().contains("--force"), "{error}");

    fs::rename(&path, &partial).unwrap();
    let error = create(false).err().unwrap();
    assert!(matches!(error, WriteError::PartialExists { .. }), "{error}");
    assert!(error.to_string().contains("`beadline info "), "only what there is today: {error}");
    assert_eq!(fs::read(&partial).unwrap(), b"precious");

    fs::write(&path, "precious").unwrap();
    let writer = create(true).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"precious", "it stays until there is a better one");
    // not even by force from under another recorder
    assert!(matches!(create(true).err().unwrap(), WriteError::File(WholeFileError::Busy { .. })));
    writer.finish(EndReason::Interrupted).unwrap();
    assert!(!partial.exists());
    assert_eq!(RecordingInfo::read(&path).unwrap().frames(), 0);
}

#[test]
fn a_file_that_appears_meanwhile_is_left_alone() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(3, 1, 1);
    let writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &options()).unwrap();
    let partial = path.with_extension("mcap.partial");
    assert!(!path.exists() && partial.exists());
    fs::write(&path, "precious").unwrap();
    let error = writer.finish(EndReason::Interrupted).err().unwrap();
    assert!(matches!(error, WriteError::File(WholeFileError::Appeared { .. })), "{error}");
    assert_eq!(fs::read(&path).unwrap(), b"precious");
    assert!(RecordingInfo::read(&partial).unwrap().finished);
}

/// A start that failed must not stand in the way of the next one.
#[test]
fn a_recording_without_frames_leaves_nothing_unless_it_is_finished() {
    let (directory, path) = temp_dir();
    let manifest = manifest(9, 1, 1);
    drop(RecordingWriter::create(&path, &manifest, RUN_TOML, &options()).unwrap());
    drop(ContactsWriter::create(&path, &manifest, &options()).unwrap());
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);

    let mut map = ContactsWriter::create(&path, &manifest, &options()).unwrap();
    let classes = [0; 39];
    map.write(&ContactsRow { frame: 0, step: 0, time_s: 0.0, tolerance_m: 1e-12, classes: &classes })
        .unwrap();
    drop(map);
    let mut kept = ContactsReader::open(&path.with_extension("mcap.partial")).unwrap();
    assert_eq!(kept.next_row().unwrap().unwrap().classes, classes);
}

#[test]
fn a_contacts_map_comes_back() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(9, 1, 1);
    let classes = |step: u64| (0..39).map(|contact| ((contact + step) % 3) as u8).collect::<Vec<_>>();
    let mut writer = ContactsWriter::create(&path, &manifest, &options()).unwrap();
    for step in 0..=9 {
        let time_s = manifest.physics.time_s(step);
        let row = ContactsRow { frame: step, step, time_s, tolerance_m: 1e-12, classes: &classes(step) };
        writer.write(&row).unwrap();
        assert!(matches!(writer.write(&row).err(), Some(WriteError::Frame { .. })), "in order only");
    }
    assert_eq!(writer.finish(EndReason::Complete).unwrap().frames, 10);
    let mut reader = ContactsReader::open(&path).unwrap();
    assert_eq!(*reader.manifest(), manifest);
    for step in 0..=9 {
        let row = reader.next_row().unwrap().unwrap();
        assert_eq!((row.frame, row.step, row.tolerance_m), (step, step, 1e-12));
        assert_eq!(row.classes, classes(step));
    }
    assert!(reader.next_row().unwrap().is_none());
    assert_eq!(reader.end_reason(), EndReason::Complete);
    // it is no source of frames, and a recording no map
    let error = RecordingSource::open(&path).err().unwrap();
    assert!(matches!(error, ReadError::NoChannel { .. }), "{error}");
    assert!(error.to_string().ends_with("holds no `/state` channel, only `/contacts`"), "{error}");
}

#[test]
fn other_programs_find_every_message_by_our_indexes() {
    use mcap::sans_io::{IndexedReadEvent, IndexedReader, SummaryReadEvent, SummaryReader};
    use std::io::{Read, Seek, SeekFrom};
    let (_directory, path) = temp_dir();
    write_recording(&path, &manifest(57, 1, 1), &options());
    let mut file = fs::File::open(&path).unwrap();
    let mut summary = SummaryReader::new();
    while let Some(event) = summary.next_event() {
        match event.unwrap() {
            SummaryReadEvent::ReadRequest(need) => {
                let read = file.read(summary.insert(need)).unwrap();
                summary.notify_read(read);
            }
            SummaryReadEvent::SeekRequest(to) => summary.notify_seeked(file.seek(to).unwrap()),
        }
    }
    let summary = summary.finish().unwrap();
    assert!(summary.chunk_indexes.len() > 5);
    let mut reader = IndexedReader::new(&summary).unwrap();
    let mut messages = 0;
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            IndexedReadEvent::ReadChunkRequest { offset, length } => {
                let mut chunk = vec![0; length];
                file.seek(SeekFrom::Start(offset)).unwrap();
                file.read_exact(&mut chunk).unwrap();
                reader.insert_chunk_record_data(offset, &chunk).unwrap();
            }
            IndexedReadEvent::Message { header, .. } => {
                assert_eq!(header.log_time, header.publish_time);
                messages += 1;
            }
        }
    }
    assert_eq!(messages, 1 + 2 * 58);
}

#[test]
fn the_estimate_is_an_upper_bound_and_close() {
    for (publish, record) in [(1, 1), (1, 10)] {
        let (_directory, path) = temp_dir();
        let manifest = manifest(2000, publish, record);
        let uncompressed = WriteOptions { compression: Compression::None, ..WriteOptions::default() };
        let bytes = write_recording(&path, &manifest, &uncompressed).bytes;
        let needed = SpaceNeeded::new(&manifest, Compression::None);
        assert!((needed.at_least_bytes..=needed.at_most_bytes).contains(&bytes), "{needed:?} {bytes}");
        assert!(needed.at_most_bytes < bytes + bytes / 5 + 40_000, "{needed:?} {bytes}");
        let compressed = SpaceNeeded::new(&manifest, Compression::Zstd { level: 1 });
        assert!(compressed.at_least_bytes < needed.at_least_bytes / 8);
    }
}

#[test]
fn what_cannot_fit_is_refused_with_what_to_do() {
    let (_directory, path) = temp_dir();
    let mut manifest = manifest(57, 1, 1);
    let needed = SpaceNeeded::new(&manifest, Compression::None);
    assert!(needed.check(&path).unwrap() > needed.at_most_bytes);
    // 640 MB a step for 2^50 steps
    manifest.physics.step_count = 1 << 50;
    let error = SpaceNeeded::new(&manifest, Compression::None).check(&path).err().unwrap();
    assert!(matches!(error, WriteError::NoSpace { .. }));
    let text = error.to_string();
    assert!(text.contains("at least") && text.contains("record_every_steps"), "{text}");
}

/// The command prints an error with its causes, so a text that repeats its cause says it twice.
#[test]
fn a_cause_is_said_once_and_is_not_lost() {
    let (_directory, path) = temp_dir();
    let io = || std::io::Error::other("the cause");
    let json = || RunManifest::from_json(b"the cause").unwrap_err();
    let value = || {
        let json = manifest(3, 1, 1).to_json().replace("\"alpha\":1.5", "\"alpha\":0.5");
        RunManifest::from_json(json.as_bytes()).unwrap_err()
    };
    assert!(matches!(json(), ManifestError::Json(_)) && matches!(value(), ManifestError::Value(_)));
    let name = || "run".parse().unwrap();
    let errors: [(Box<dyn std::error::Error>, &str); 9] = [
        (Box::new(WriteError::Io { path: path.clone(), source: io() }), "the cause"),
        (Box::new(WriteError::File(WholeFileError::io(&path)(io()))), "the cause"),
        (Box::new(WholeFileError::io(&path)(io())), "the cause"),
        (Box::new(ReadError::Io { path: path.clone(), source: io() }), "the cause"),
        (Box::new(ReadError::Manifest { path: path.clone(), source: json() }), "line 1"),
        (Box::new(ReadError::Manifest { path: path.clone(), source: value() }), "chain.alpha"),
        (Box::new(AttachError::Manifest { name: name(), source: value() }), "chain.alpha"),
        (Box::new(RootError::Io { path: path.clone(), source: io() }), "the cause"),
        (Box::new(RoomError::Io { path: path.clone(), source: io() }), "the cause"),
    ];
    for (error, cause) in errors {
        let text = with_causes(error.as_ref());
        assert_eq!(text.matches(cause).count(), 1, "{text}");
    }
}

#[test]
fn recorders_and_sources_can_go_to_other_threads() {
    fn is_send<T: Send>() {}
    is_send::<RecordingWriter>();
    is_send::<RecordingSource>();
    is_send::<ContactsWriter>();
    is_send::<ContactsReader>();
}
