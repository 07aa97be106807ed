//! What recordings promise: the same bits back, nothing overwritten, nothing believed unchecked.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use schemas::config::StreamConfig;
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::PRESETS;
use schemas::recording::{
    Compression, ContactsReader, ContactsRow, ContactsWriter, Finished, ReadError, RecordingInfo,
    RecordingSource, RecordingWriter, WriteError, WriteOptions,
};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const RUN_TOML: &str = "name = \"test\" # as the user wrote it: ü\n";

/// A run of `steps` steps of 40 beads.
fn manifest(steps: u64, publish: u64, record: u64) -> RunManifest {
    let mut config = PRESETS[0].config();
    config.chain.beads = 40;
    config.chain.impurities[0].bead = 20;
    config.stream = StreamConfig { publish_every_steps: publish, record_every_steps: record };
    let origin = Origin { program: "test 1.0".into(), host: "here".into(), started_unix_ns: 7 };
    let dt_s = RunManifest::new(&config, "test", origin.clone()).unwrap().physics.dt_s;
    config.time.duration_s = dt_s * steps as f64;
    let manifest = RunManifest::new(&config, "test", origin).unwrap();
    assert_eq!(manifest.physics.step_count, steps);
    manifest
}

/// Doubles of every kind, different for each step: recordings keep bits, not numbers.
fn doubles(step: u64, which: u64) -> Vec<f64> {
    let special = [0.0, -0.0, 5e-324, f64::INFINITY, f64::from_bits(0x7ff8_dead_beef_0001), -1.5];
    (0..40)
        .map(|bead| {
            let hash = (step * 1000 + bead * 2 + which).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            match hash >> 61 {
                0 => special[(hash % 6) as usize],
                1 => f64::from_bits(hash.rotate_left(17)),
                _ => (hash >> 11) as f64 * 1e-12,
            }
        })
        .collect()
}

/// Calls `take` with every published frame of the run.
fn for_each_frame(manifest: &RunManifest, mut take: impl FnMut(&Frame<'_>)) {
    for frame in 0..manifest.frame_count() {
        let step = manifest.step_of_frame(frame);
        let (u_m, v_m_s) = (doubles(step, 0), doubles(step, 1));
        let time_s = manifest.physics.time_s(step);
        take(&Frame { frame, step, time_s, u_m: &u_m, v_m_s: &v_m_s, extra: &[] });
    }
}

/// Small chunks, so that a few frames make several.
fn options() -> WriteOptions {
    WriteOptions { chunk_bytes: 4000, ..WriteOptions::default() }
}

fn write_recording(path: &Path, manifest: &RunManifest, options: &WriteOptions) -> Finished {
    let mut writer = RecordingWriter::create(path, manifest, RUN_TOML, options).unwrap();
    for_each_frame(manifest, |frame| writer.accept(frame).unwrap());
    writer.finish(EndReason::Complete).unwrap()
}

fn temp_dir() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("test.mcap");
    (directory, path)
}

/// Steps of the frames, missed frames, and the end of a source whose frames must be those written.
fn read_all(source: &mut RecordingSource) -> (Vec<u64>, Vec<(u64, u64)>, Result<EndReason, ReadError>) {
    let manifest = source.manifest().clone();
    let (mut steps, mut missed) = (Vec::new(), Vec::new());
    loop {
        match source.receive() {
            Ok(Received::Frame(frame)) => {
                let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(frame.u_m), bits(&doubles(frame.step, 0)));
                assert_eq!(bits(frame.v_m_s), bits(&doubles(frame.step, 1)));
                assert!(frame.extra.is_empty());
                assert_eq!(manifest.step_of_frame(frame.frame), frame.step);
                steps.push(frame.step);
            }
            Ok(Received::Missed { from, to }) => missed.push((from, to)),
            Ok(Received::End(reason)) => return (steps, missed, Ok(reason)),
            Err(error) => return (steps, missed, Err(error)),
        }
    }
}

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
        if frame.step < 34 {
            writer.accept(frame).unwrap();
        }
        if frame.step == 34 {
            writer.record(frame).unwrap();
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
    assert!(matches!(error, WriteError::Exists { .. }));
    assert!(error.to_string().contains("--force"), "{error}");

    fs::rename(&path, &partial).unwrap();
    let error = create(false).err().unwrap();
    assert!(matches!(error, WriteError::PartialExists { .. }), "{error}");
    assert_eq!(fs::read(&partial).unwrap(), b"precious");

    fs::write(&path, "precious").unwrap();
    let writer = create(true).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"precious", "it stays until there is a better one");
    // not even by force from under another recorder
    assert!(matches!(create(true).err().unwrap(), WriteError::Busy { .. }));
    writer.finish(EndReason::Interrupted).unwrap();
    assert!(!partial.exists());
    assert_eq!(RecordingInfo::read(&path).unwrap().frames(), 0);
}

#[test]
fn a_file_that_appears_meanwhile_is_left_alone() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(3, 1, 1);
    let writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &options()).unwrap();
    let partial = writer.partial_path().to_owned();
    assert!(!path.exists() && partial.exists());
    fs::write(&path, "precious").unwrap();
    let error = writer.finish(EndReason::Interrupted).err().unwrap();
    assert!(matches!(error, WriteError::Appeared { .. }), "{error}");
    assert_eq!(fs::read(&path).unwrap(), b"precious");
    assert!(RecordingInfo::read(&partial).unwrap().finished);
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
