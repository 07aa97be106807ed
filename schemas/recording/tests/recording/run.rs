//! A small run whose frames hold every kind of double.

use recording::{Finished, ReadError, RecordingSource, RecordingWriter, WriteOptions};
use schemas::config::StreamConfig;
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::PRESETS;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

pub(crate) const RUN_TOML: &str = "name = \"test\" # as the user wrote it: ü\n";

/// A run of `steps` steps of 40 beads.
pub(crate) fn manifest(steps: u64, publish: u64, record: u64) -> RunManifest {
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
pub(crate) fn doubles(step: u64, which: u64) -> Vec<f64> {
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
pub(crate) fn for_each_frame(manifest: &RunManifest, mut take: impl FnMut(&Frame<'_>)) {
    for frame in 0..manifest.frame_count() {
        let step = manifest.step_of_frame(frame);
        let (u_m, v_m_s) = (doubles(step, 0), doubles(step, 1));
        let time_s = manifest.physics.time_s(step);
        take(&Frame { frame, step, time_s, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None });
    }
}

/// Small chunks, so that a few frames make several.
pub(crate) fn options() -> WriteOptions {
    WriteOptions { chunk_bytes: 4000, ..WriteOptions::default() }
}

pub(crate) fn write_recording(path: &Path, manifest: &RunManifest, options: &WriteOptions) -> Finished {
    let mut writer = RecordingWriter::create(path, manifest, RUN_TOML, options).unwrap();
    for_each_frame(manifest, |frame| {
        if manifest.is_recorded(frame.step) {
            writer.accept(frame).unwrap();
        }
    });
    writer.finish(EndReason::Complete).unwrap()
}

/// An error with its causes, as the command prints it.
pub(crate) fn with_causes(error: &dyn std::error::Error) -> String {
    std::iter::successors(error.source(), |cause| cause.source())
        .fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

pub(crate) fn temp_dir() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("test.mcap");
    (directory, path)
}

/// Steps of the frames, missed frames, and the end.
type ReadAll = (Vec<u64>, Vec<(u64, u64)>, Result<EndReason, ReadError>);

/// Reads a source to its end, whose frames must be those written.
pub(crate) fn read_all(source: &mut RecordingSource) -> ReadAll {
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

/// Replaces the contents of a file. Not by truncating it: some file systems then wait for the disk.
pub(crate) fn put(path: &Path, bytes: &[u8]) {
    let mut file = OpenOptions::new().write(true).create(true).truncate(false).open(path).unwrap();
    file.write_all(bytes).unwrap();
    file.set_len(bytes.len() as u64).unwrap();
}
