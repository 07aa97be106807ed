//! Whether the next chunk is decompressed ahead or not, the same is read.

use super::*;
use crate::read::ahead::Ahead;
use crate::read::index::Index;
use crate::{RecordingWriter, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::Origin;
use schemas::presets::PRESETS;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// Everything that a reader says: messages by channel, chunk, checksum and whether they are checked; damages; the end.
type Said = (Vec<(u16, u64, u32, bool)>, Vec<(u64, String)>, Result<(), String>);

/// A recording of some chunks, large enough to be decompressed ahead, and where they are.
fn recording() -> (TempDir, PathBuf, Vec<Range<usize>>) {
    let directory = tempfile::tempdir().expect("directory");
    let path = directory.path().join("test.mcap");
    let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 0 };
    let manifest = RunManifest::new(&PRESETS[0].config(), "test", origin).expect("preset");
    let options = WriteOptions { chunk_bytes: 70_000, ..WriteOptions::default() };
    let mut writer = RecordingWriter::create(&path, &manifest, "", &options).expect("new");
    let (mut u_m, v_m_s) = manifest.physics.initial_state();
    for frame in 0..40 {
        let step = manifest.step_of_frame(frame);
        let time_s = manifest.physics.time_s(step);
        u_m[500] = time_s;
        writer
            .accept(&Frame { frame, step, time_s, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None })
            .expect("accepted");
    }
    writer.finish(EndReason::Interrupted).expect("finished");
    let mut records = RecordReader::open(&path).expect("a recording");
    let mut chunks = Vec::new();
    while let Some(RawRecord { opcode, offset, body }) = records.next().expect("whole") {
        if opcode == op::CHUNK {
            let start = usize::try_from(offset).expect("small");
            chunks.push(start..start + 9 + body.len());
        }
    }
    assert!(chunks.len() > 5, "{chunks:?}");
    (directory, path, chunks)
}

/// What a reader says, and how many chunks came from ahead.
fn read(mut messages: MessageReader, ahead: Ahead) -> (Said, u64) {
    messages.chunk.ahead = ahead;
    let mut found = Vec::new();
    let end = loop {
        match messages.next() {
            Ok(Some(RawMessage { head, data, offset, is_checked, .. })) => {
                found.push((head.channel_id, offset, crc32fast::hash(data), is_checked));
            }
            Ok(None) => break Ok(()),
            Err(error) => break Err(error.to_string()),
        }
    };
    let damages =
        messages.damages().iter().map(|damage| (damage.offset_bytes, damage.what.clone())).collect();
    ((found, damages, end), messages.chunk.ahead.taken_count)
}

/// Reads `bytes` in all ways; returns what is said when reading ends at damage, and how many chunks came from ahead.
fn read_all(path: &Path, bytes: &[u8]) -> (Said, u64) {
    fs::write(path, bytes).expect("written");
    let open = || MessageReader::open(path).expect("a recording");
    let salvaging = || MessageReader::salvaging(path).expect("a recording");
    assert_eq!(read(salvaging(), Ahead::within(u64::MAX)).0, read(salvaging(), Ahead::off()).0);
    let (ahead, alone) = (read(open(), Ahead::within(u64::MAX)), read(open(), Ahead::off()));
    assert_eq!((&ahead.0, alone.1), (&alone.0, 0));
    ahead
}

#[test]
fn a_whole_file_is_the_same() {
    let (_directory, path, chunks) = recording();
    let bytes = fs::read(&path).expect("bytes");
    let ((found, damages, end), taken) = read_all(&path, &bytes);
    assert_eq!((found.len(), damages.len(), end), (81, 0, Ok(())));
    let has_second_core = std::thread::available_parallelism().is_ok_and(|cores| cores.get() > 1);
    // the last chunk is a small one, which is asked for, too
    assert_eq!(taken, if has_second_core { chunks.len() as u64 - 2 } else { 0 });
}

#[test]
fn damage_is_the_same() {
    let (_directory, path, chunks) = recording();
    let whole = fs::read(&path).expect("bytes");
    for chunk in &chunks[1..4] {
        // length, times, size, CRC, name, compressed size, first and last contents
        let places = [1, 4, 8, 10, 20, 26, 31, 34, 38, 42, 47, 50, 54, 90];
        for at in places.map(|place| chunk.start + place).into_iter().chain([chunk.end - 1, chunk.end + 3]) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x11;
            let ((_, _, end), _) = read_all(&path, &bytes);
            assert!(end.is_err(), "byte {at}");
        }
        for end in [chunk.start, chunk.start + 5, chunk.start + 30, chunk.end - 1, chunk.end] {
            let _ = read_all(&path, &whole[..end]);
        }
    }
}

#[test]
fn the_head_ends_where_damage_is_on_both_sides_of_the_first_chunk() {
    let (_directory, path, chunks) = recording();
    let mut bytes = fs::read(&path).expect("bytes");
    let mut records = RecordReader::open(&path).expect("a recording");
    let mut manifest = None;
    while manifest.is_none() {
        let record = records.next().expect("whole").expect("the manifest");
        manifest = (record.opcode == op::METADATA).then_some(record.offset + 9 + record.body.len() as u64);
    }
    let after_manifest = usize::try_from(manifest.expect("its end")).expect("small");
    assert!(after_manifest < chunks[0].start);
    for record in [after_manifest, chunks[0].end] {
        // its length, of eight bytes
        bytes[record + 8] = 0xff;
    }
    fs::write(&path, bytes).expect("written");
    let mut messages = MessageReader::salvaging(&path).expect("a recording");
    messages.read_head().expect("an end");
    assert_eq!(messages.contents().run_toml, None);
}

#[test]
fn chunks_in_another_order_are_the_same() {
    let (_directory, path, chunks) = recording();
    let whole = fs::read(&path).expect("bytes");
    for (from, to) in [(1, 2), (2, 3), (4, 2), (0, 3)] {
        let bytes =
            [&whole[..chunks[to].start], &whole[chunks[from].clone()], &whole[chunks[to].end..]].concat();
        let _ = read_all(&path, &bytes);
    }
}

#[test]
fn an_answer_to_another_request_is_not_used() {
    let (_directory, path, chunks) = recording();
    let index = Index::read(&path).expect("an index");
    // within the chunk before, behind it, and in the one that was asked for
    for frame in [0, 4, 13, 14, 16, 30] {
        let after_jump = |ahead| {
            let mut messages = MessageReader::open(&path).expect("a recording");
            messages.chunk.ahead = ahead;
            while messages.chunk.offset() < chunks[3].start as u64 {
                messages.next().expect("whole").expect("a message");
            }
            let step = messages.manifest().step_of_frame(frame);
            let time_s = messages.manifest().physics.time_s(step);
            let place = index.find(step, time_s, |_| Ok(Some(0))).expect("a place");
            messages.seek(place, &index.known).expect("a chunk");
            let mut found = Vec::new();
            while let Some(RawMessage { offset, data, .. }) = messages.next().expect("whole") {
                found.push((offset, crc32fast::hash(data)));
            }
            assert_eq!(found[0].0, place.offset);
            found
        };
        assert_eq!(after_jump(Ahead::within(u64::MAX)), after_jump(Ahead::off()));
    }
}
