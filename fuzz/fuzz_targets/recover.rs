//! What `beadline recover` does: whatever the file is, the new recording can be read and is proven.

#![no_main]

use beadline_fuzz::{Place, mutate_recording};
use libfuzzer_sys::{fuzz_mutator, fuzz_target};
use producer::recovery::recover;
use schemas::frame::{FrameSource, Received};
use recording::{Audit, Compression, RecordingSource, RecordingWriter, WriteOptions};
use std::cell::LazyCell;
use std::path::Path;

/// States that are recomputed for one input; a person waits longer.
const MOST_STATES: u64 = 20_000;

thread_local! {
    static PLACE: LazyCell<Place> = LazyCell::new(Place::new);
}

fuzz_mutator!(|bytes: &mut [u8], size: usize, most: usize, seed: u32| {
    mutate_recording(bytes, size, most, seed)
});

fuzz_target!(|bytes: &[u8]| {
    let (from, to) = PLACE.with(|place| (place.put("fuzzed.mcap", bytes), place.path("recovered.mcap")));
    if let Some(loses) = recover_file(&from, &to) {
        check(&to, loses);
    }
});

/// If there is a new recording, whether it is said to lack frames.
fn recover_file(from: &Path, to: &Path) -> Option<bool> {
    let audit = Audit::open(from).ok()?;
    let manifest = audit.manifest().clone();
    if manifest.physics.beads > 1000 {
        return None;
    }
    let (begin, run_toml) = Audit::head(from).ok()?;
    let expected = Audit::expected_counts(from);
    let options = WriteOptions { force: true, compression: Compression::None, ..WriteOptions::default() };
    let mut writer =
        RecordingWriter::create_from(to, &manifest, run_toml.as_deref(), &begin, &options).expect("a writer");
    let mut states = 0;
    let mut watch = |_| {
        states += 1;
        states < MOST_STATES
    };
    let recovered = recover(audit, &begin, true, expected.as_ref(), &mut writer, &mut watch);
    let recovery = recovered.ok().filter(|recovery| recovery.last_step.is_some());
    let Some(recovery) = recovery else {
        writer.discard();
        return None;
    };
    writer.finish(recovery.end).expect("a whole recording");
    Some(recovery.lost_count > 0)
}

/// What was written is read again, from its first to its last state, and nothing is missing but what was said.
fn check(path: &Path, loses: bool) {
    let mut source = RecordingSource::open(path).expect("what was recovered");
    let mut count = 0;
    loop {
        match source.receive().expect("what was recovered") {
            Received::Frame(_) => count += 1,
            Received::Missed { .. } if loses => {}
            Received::Missed { from, to } => panic!("frames {from} to {to} are missing"),
            Received::End(_) => break,
        }
    }
    assert!(count > 0);
}
