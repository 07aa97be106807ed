//! What is left when writing stops: by a kill, by an error, in the middle of anything.

use crate::run::{
    RUN_TOML, for_each_frame, manifest, options, put, read_all, temp_dir, with_causes, write_recording,
};
use recording::{
    Compression, ReadError, RecordingInfo, RecordingSource, RecordingWriter, WriteError, WriteOptions,
};
use schemas::frame::{EndReason, FrameSink};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

#[test]
fn a_kill_costs_only_what_was_not_flushed() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(57, 1, 1);
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &WriteOptions::default()).unwrap();
    let killed = path.with_extension("killed");
    for_each_frame(&manifest, |frame| {
        writer.accept(frame).unwrap();
        if frame.step == 30 {
            writer.flush().unwrap();
            assert_eq!(
                writer.bytes_written(),
                fs::metadata(path.with_extension("mcap.partial")).unwrap().len()
            );
        }
        if frame.step == 40 {
            // what another process would find if this one were killed now
            fs::copy(path.with_extension("mcap.partial"), &killed).unwrap();
        }
    });
    let (steps, missed, end) = read_all(&mut RecordingSource::open(&killed).unwrap());
    assert_eq!(steps, (0..=30).collect::<Vec<_>>());
    assert!(missed.is_empty());
    assert_eq!(end.unwrap(), EndReason::Unfinished);
    let info = RecordingInfo::read(&killed).unwrap();
    assert_eq!((info.frames(), info.first_step, info.last_step), (31, Some(0), Some(30)));
    assert_eq!(info.run_toml.as_deref(), Some(RUN_TOML));
    assert!(!info.finished && !info.is_complete() && info.damage.is_none());

    // dropped, nothing is lost, but it is not finished either
    let partial = path.with_extension("mcap.partial");
    drop(writer);
    assert!(!path.exists());
    let (steps, _, end) = read_all(&mut RecordingSource::open(&partial).unwrap());
    assert_eq!((steps.len(), end.unwrap()), (58, EndReason::Unfinished));
}

#[test]
fn frames_do_not_wait_longer_than_the_flush_period() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(9, 1, 1);
    let at_once = WriteOptions { flush_period: Duration::ZERO, sync_period: Duration::ZERO, ..options() };
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &at_once).unwrap();
    for_each_frame(&manifest, |frame| {
        writer.accept(frame).unwrap();
        let info = RecordingInfo::read(&path.with_extension("mcap.partial")).unwrap();
        assert_eq!((info.last_step, info.frames()), (Some(frame.step), frame.frame + 1));
    });
}

/// Also when no other frame comes, and nobody asks.
#[test]
fn a_frame_is_written_when_the_flush_period_is_over() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(9, 1, 1);
    let soon = WriteOptions { flush_period: Duration::from_millis(20), ..options() };
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &soon).unwrap();
    let head_bytes = writer.bytes_written();
    for_each_frame(&manifest, |frame| {
        if frame.step < 3 {
            writer.accept(frame).unwrap();
        }
    });
    let start = Instant::now();
    while writer.bytes_written() == head_bytes {
        assert!(start.elapsed() < Duration::from_mins(1), "nothing was written");
        std::thread::yield_now();
    }
    writer.flush().unwrap();
    assert_eq!(RecordingInfo::read(&path.with_extension("mcap.partial")).unwrap().frames(), 3);
}

/// A disk that cannot keep up holds the recording thread back: nothing is lost, no more than the queue waits in
/// memory, and the time is counted.
#[test]
fn a_slow_disk_holds_the_producer_back_and_loses_nothing() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(200, 1, 1);
    let delay = Duration::from_millis(5);
    let slow = WriteOptions {
        compression: Compression::None,
        queue_bytes: 12_000,
        flush_period: Duration::from_hours(1),
        slow_disk: delay,
        ..options()
    };
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &slow).unwrap();
    let (mut accepted_bytes, mut most_waiting, mut state_bytes) = (0_u64, 0, 0);
    for_each_frame(&manifest, |frame| {
        writer.accept(frame).unwrap();
        state_bytes = 16 * frame.u_m.len() as u64;
        accepted_bytes += state_bytes;
        most_waiting = most_waiting.max(accepted_bytes.saturating_sub(writer.bytes_written()));
    });
    // the queue and the open chunk, each of which ends with a whole frame
    let bound = 12_000 + 4_000 + 2 * 2 * state_bytes;
    assert!(most_waiting > 8_000 && most_waiting < bound, "{most_waiting} bytes waited, {bound} may");
    // some 40 chunks, of which all but those that may wait were waited for
    assert!(writer.held_back() > 20 * delay, "{:?}", writer.held_back());
    let finished = writer.finish(EndReason::Complete).unwrap();
    assert!(finished.held_back > 20 * delay);
    let (steps, missed, end) = read_all(&mut RecordingSource::open(&path).unwrap());
    assert_eq!((steps.len(), missed.len(), end.unwrap()), (201, 0, EndReason::Complete));

    // a disk that keeps up holds nobody back
    let path = path.with_extension("fast.mcap");
    assert_eq!(write_recording(&path, &manifest, &WriteOptions::default()).held_back, Duration::ZERO);
}

#[test]
fn a_file_torn_anywhere_gives_what_was_whole() {
    let (_directory, path) = temp_dir();
    let whole = manifest(30, 1, 1);
    write_recording(&path, &whole, &WriteOptions { compression: Compression::None, ..options() });
    let bytes = fs::read(&path).unwrap();
    let torn = path.with_extension("torn");
    let mut frames_before = 0;
    for length in (0..bytes.len()).step_by(97).chain(bytes.len() - 60..bytes.len()) {
        put(&torn, &bytes[..length]);
        match RecordingSource::open(&torn) {
            Ok(mut source) => {
                let (steps, missed, end) = read_all(&mut source);
                assert_eq!(steps, (0..steps.len() as u64).collect::<Vec<_>>());
                assert!(missed.is_empty());
                assert_eq!(end.unwrap(), EndReason::Unfinished, "{length} bytes");
                assert!(steps.len() >= frames_before);
                frames_before = steps.len();
                assert_eq!(RecordingInfo::read(&torn).unwrap().frames(), steps.len() as u64);
            }
            // torn before the manifest ends
            Err(ReadError::NotMcap { .. } | ReadError::NotBeadline { .. }) => assert!(length < 1000),
            Err(error) => panic!("{length} bytes: {error}"),
        }
    }
    assert_eq!(frames_before, 31);
}

/// Set for the process that records with little space.
const LITTLE_SPACE: &str = "BEADLINE_TEST_LITTLE_SPACE";

#[test]
fn a_full_disk_is_an_error_and_what_was_recorded_stays() {
    if let Some(directory) = std::env::var_os(LITTLE_SPACE) {
        return record_with_little_space(Path::new(&directory));
    }
    let (directory, _) = temp_dir();
    // a limit on the size of files fails like a full disk, in the middle of a write
    let limited = "trap '' XFSZ; ulimit -f 60; exec \"$0\" \"$@\"";
    let test = "crash::a_full_disk_is_an_error_and_what_was_recorded_stays";
    let output = Command::new("sh")
        .args(["-c", limited])
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", test])
        .env(LITTLE_SPACE, directory.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    assert!(directory.path().join("failed-as-it-should").exists());
}

fn record_with_little_space(directory: &Path) {
    let path = directory.join("test.mcap");
    let manifest = manifest(300, 1, 1);
    // nothing but a chunk may wait, so that the error comes while there are frames to come
    let options = WriteOptions { queue_bytes: 0, ..options() };
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &options).unwrap();
    let (mut accepted, mut errors) = (0, Vec::new());
    for_each_frame(&manifest, |frame| match writer.accept(frame) {
        Ok(()) => accepted += 1,
        Err(error) => errors.push(error),
    });
    let WriteError::Lost { lost_frames, .. } = errors[0] else { panic!("{}", errors[0]) };
    let message = with_causes(&errors[0]);
    for word in ["test.mcap.partial", "File too large", &format!("the last {lost_frames}")] {
        assert!(message.contains(word), "{message}");
    }
    assert!(errors[1..].iter().all(|error| matches!(error, WriteError::GivenUp { .. })));
    assert!(matches!(writer.finish(EndReason::Failed), Err(WriteError::GivenUp { .. })));
    assert!(!path.exists());
    let partial = path.with_extension("mcap.partial");
    let (steps, _, end) = read_all(&mut RecordingSource::open(&partial).unwrap());
    assert_eq!(end.unwrap(), EndReason::Unfinished);
    // what did not fit, and what was waiting behind it, is counted
    assert_eq!(steps.len() as u64 + lost_frames, accepted, "{} are there", steps.len());
    assert!(steps.len() > 20 && lost_frames < 30, "{lost_frames} of {accepted}");
    fs::write(directory.join("failed-as-it-should"), "").unwrap();
}

#[test]
fn errors_of_the_operating_system_come_with_the_path() {
    let (directory, _) = temp_dir();
    let path = directory.path().join("no").join("such.mcap");
    let error = RecordingWriter::create(&path, &manifest(3, 1, 1), RUN_TOML, &options()).err().unwrap();
    assert!(error.to_string().contains("no/such.mcap.partial"), "{error}");
    let error = RecordingSource::open(&path).err().unwrap();
    assert!(matches!(error, ReadError::Io { .. }) && error.to_string().contains("no/such.mcap"), "{error}");
}

#[test]
fn a_run_that_never_began_leaves_nothing() {
    let (directory, path) = temp_dir();
    let writer = RecordingWriter::create(&path, &manifest(3, 1, 1), RUN_TOML, &options()).unwrap();
    writer.discard();
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
}
