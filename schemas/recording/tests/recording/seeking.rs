//! Any state is found at once, and a wrong index costs time only.

use crate::hostile::{end_metadata, forge, records, run_metadata, state};
use crate::run::{manifest, options, put, read_all, temp_dir, write_recording};
use mcap::records::op;
use recording::{ReadError, RecordingSource};
use schemas::frame::{EndReason, FrameSource, Received};
use std::fs;

/// The steps in an order of no order, each once.
fn shuffled(steps: u64) -> impl Iterator<Item = u64> {
    // a stride that shares no factor with the number of steps
    (0..=steps).map(move |i| i * 89 % (steps + 1))
}

#[test]
fn any_step_can_be_gone_to_in_any_order() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(157, 1, 10);
    write_recording(&path, &manifest, &options());
    let bytes = fs::read(&path).unwrap();
    // with its index, and as a run leaves it that was killed
    for cut in [0, 1] {
        put(&path, &bytes[..bytes.len() - cut]);
        let mut source = RecordingSource::open(&path).unwrap();
        for step in shuffled(157) {
            source.seek_to_step(step).unwrap();
            let first = if step == 157 { 157 } else { step / 10 * 10 };
            assert!(matches!(source.receive(), Ok(Received::Frame(frame)) if frame.step == first), "{step}");
            if step % 40 == 0 {
                let (steps, missed, end) = read_all(&mut source);
                let rest: Vec<u64> = (first + 1..157).filter(|step| step % 10 == 0).chain([157]).collect();
                assert_eq!((steps, missed), (if step == 157 { vec![] } else { rest }, vec![]));
                let expected = if cut == 0 { EndReason::Complete } else { EndReason::Unfinished };
                assert_eq!(end.unwrap(), expected);
            }
        }
    }
}

/// Whatever the places and times in the index are, also under no checksum: the state is found by its step.
#[test]
fn an_index_that_lies_leads_to_the_same_state() {
    let (_directory, path) = temp_dir();
    write_recording(&path, &manifest(57, 1, 1), &options());
    let mut bytes = fs::read(&path).unwrap();
    let all = records(&bytes);
    let (_, footer, length) = *all.iter().find(|record| record.0 == op::FOOTER).unwrap();
    bytes[footer + 9 + length - 4..footer + 9 + length].fill(0);
    let indexes: Vec<_> = all.iter().filter(|record| record.0 == op::CHUNK_INDEX).collect();
    assert!(indexes.len() > 5);
    let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    for (i, (_, at, _)) in indexes.iter().enumerate() {
        // first and last time, offset, length
        for field in [0, 8, 16, 24] {
            let place = at + 9 + field;
            for value in [0, 1, 200, number(place) + 1, number(indexes[0].1 + 9 + field), 1 << 40, u64::MAX] {
                let mut changed = bytes.clone();
                changed[place..place + 8].copy_from_slice(&value.to_le_bytes());
                put(&path, &changed);
                let mut source = RecordingSource::open(&path).unwrap();
                for step in [0, 57, 3 * i as u64, 3 * i as u64 + 5] {
                    source.seek_to_step(step).unwrap();
                    let found = source.receive();
                    assert!(matches!(found, Ok(Received::Frame(frame)) if frame.step == step), "{found:?}");
                }
            }
        }
    }
}

#[test]
fn what_is_missing_after_the_step_is_reported_and_what_is_before_is_not() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(57, 1, 10);
    let metadata = [run_metadata(&manifest), end_metadata("complete", "57")];
    let at = |step: u64| state(Some(step), step, manifest.physics.time_s(step), 40);
    forge(&path, "beadline", &metadata, &[at(20), at(30), at(57)]);
    let mut source = RecordingSource::open(&path).unwrap();
    for (step, steps, missed) in [
        (0, &[20, 30, 57][..], &[(0, 10), (40, 50)][..]),
        (5, &[20, 30, 57], &[(10, 10), (40, 50)]),
        (29, &[20, 30, 57], &[(40, 50)]),
        (45, &[30, 57], &[(40, 50)]),
        (57, &[57], &[]),
    ] {
        source.seek_to_step(step).unwrap();
        let (found, gaps, end) = read_all(&mut source);
        assert_eq!((found.as_slice(), gaps.as_slice(), end.unwrap()), (steps, missed, EndReason::Complete));
    }
}

/// States that were recomputed between frames are frames to nobody, but all that is there can be had.
#[test]
fn states_between_frames_are_lent_to_who_asks_for_them() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(12, 4, 4);
    let metadata = [run_metadata(&manifest), end_metadata("complete", "12")];
    let states: Vec<_> = (0..=12)
        .map(|step| state((step % 4 == 0).then_some(step / 4), step, manifest.physics.time_s(step), 40))
        .collect();
    forge(&path, "beadline", &metadata, &states);
    let frames = |source: &mut RecordingSource| read_all(source).0;
    assert_eq!(frames(&mut RecordingSource::open(&path).unwrap()), [0, 4, 8, 12]);
    let mut all = RecordingSource::open_all(&path).unwrap();
    for first in [0, 7, 12] {
        all.seek_to_step(first).unwrap();
        for step in first..=12 {
            let lent = all.receive().unwrap();
            assert!(matches!(lent, Received::Frame(frame) if (frame.step, frame.frame) == (step, step / 4)));
        }
        assert_eq!(all.receive().unwrap(), Received::End(EndReason::Complete));
    }
}

/// A damaged chunk hides its own states and nothing before or after it; the end is still checked.
#[test]
fn damage_elsewhere_does_not_matter() {
    let (_directory, path) = temp_dir();
    write_recording(&path, &manifest(57, 1, 1), &options());
    let mut bytes = fs::read(&path).unwrap();
    let chunks: Vec<_> = records(&bytes).into_iter().filter(|record| record.0 == op::CHUNK).collect();
    let (_, at, length) = chunks[5];
    bytes[at + 9 + length - 20] ^= 1;
    put(&path, &bytes);
    let mut source = RecordingSource::open(&path).unwrap();
    let (steps, _, end) = read_all(&mut source);
    let damaged = end.unwrap_err().to_string();
    assert!(damaged.contains(&format!("byte {at}")), "{damaged}");
    let last = *steps.last().unwrap();
    // the damaged chunk cannot be read: one comes as near as can be, and is told why
    source.seek_to_step(last + 1).unwrap();
    assert!(matches!(source.receive(), Ok(Received::Frame(frame)) if frame.step == last));
    assert!(matches!(source.receive(), Err(ReadError::Crc { .. } | ReadError::Damaged { .. })));
    source.seek_to_step(50).unwrap();
    let (after, missed, end) = read_all(&mut source);
    assert_eq!((after, missed.len(), end.unwrap()), ((50..=57).collect(), 0, EndReason::Complete));
}

/// A time is that of a step if it has its bits, however the division of the two rounds, or is written in its last digits otherwise.
#[test]
fn steps_are_found_by_their_times() {
    let physics = manifest(1000, 1, 1).physics;
    for step in 0..=1000 {
        let time_s = physics.time_s(step);
        assert_eq!((physics.step_at_or_before(time_s), physics.step_at_or_after(time_s)), (step, step));
        for same_s in [time_s * (1.0 + 1e-14), time_s * (1.0 - 1e-14)] {
            assert_eq!((physics.step_at_or_before(same_s), physics.step_at_or_after(same_s)), (step, step));
        }
        let later_s = time_s + 1e-6 * physics.dt_s;
        assert_eq!((physics.step_at_or_before(later_s), physics.step_at_or_after(later_s)), (step, step + 1));
    }
    for (time_s, before, after) in [(0.0, 0, 0), (1e9, 1000, 1001), (f64::INFINITY, 1000, 1001)] {
        assert_eq!((physics.step_at_or_before(time_s), physics.step_at_or_after(time_s)), (before, after));
    }
}
