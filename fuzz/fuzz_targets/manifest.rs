//! Manifests: JSON as on the bus, and the metadata record `beadline.run` with its checksum; changed by their structure, and by bytes.
//!
//! A manifest that is accepted is written and read back the same; a glance at it takes no array of the chain; and nothing that is done
//! with the run trips over it: its words, its chain, its step, the first steps, a recording of it, and the proof of that.

#![no_main]

use beadline_fuzz::Place;
use hostile::random::Random;
use hostile::structure;
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};
use producer::integrator::Integrator;
use producer::state::ChainState;
use producer::verification::verify;
use recording::{Audit, BeginRecord, Compression, RecordingInfo, RecordingWriter, WriteOptions, fuzzing};
use schemas::frame::{EndReason, FrameSink};
use schemas::manifest::{Physics, RunManifest};
use serde_json::Value;
use std::cell::LazyCell;
use std::num::NonZero;
use std::sync::atomic::AtomicBool;

/// Beads of a run that is computed here.
const MOST_BEADS: u64 = 200;

thread_local! {
    static PLACE: LazyCell<Place> = LazyCell::new(Place::new);
    static RUNS: LazyCell<Vec<Value>> = LazyCell::new(structure::runs);
}

fuzz_mutator!(|bytes: &mut [u8], size: usize, most: usize, seed: u32| {
    let mut random = Random::new(u64::from(seed));
    let manifest = serde_json::from_slice::<Value>(&bytes[..size]).ok().filter(|_| !random.one_in(4));
    let text = manifest.map(|manifest| RUNS.with(|runs| structure::mutate(&manifest, runs, &mut random)));
    match text.filter(|text| text.len() <= most) {
        Some(text) => {
            bytes[..text.len()].copy_from_slice(text.as_bytes());
            text.len()
        }
        None => fuzzer_mutate(bytes, size, most),
    }
});

fuzz_target!(|bytes: &[u8]| {
    let read = match bytes.split_first() {
        Some((b'{', _)) => RunManifest::glance(bytes).ok(),
        Some((_, record)) => {
            let mut record = record.to_vec();
            hostile::checksums::correct_manifest(&mut record);
            fuzzing::manifest(&record).ok()
        }
        None => None,
    };
    if let Some(manifest) = read {
        look_at(&manifest);
        if manifest.physics.beads <= MOST_BEADS && manifest.check_whole().is_ok() && manifest.physics.retired().is_none() {
            compute(&manifest);
        }
    }
});

/// What a glance at a file asks.
fn look_at(manifest: &RunManifest) {
    let again = RunManifest::glance(manifest.to_json().as_bytes()).expect("what we write");
    assert_eq!(again, *manifest);
    assert_eq!(again.physics.hash(), manifest.physics.hash());
    let physics = &manifest.physics;
    let (frames, last) = (manifest.frame_count(), physics.step_count);
    assert_eq!(manifest.step_of_frame(frames - 1), last);
    assert_eq!(manifest.frame_at(last), frames - 1);
    assert!(manifest.is_recorded(0) && manifest.is_recorded(last) && manifest.is_frame(last));
    assert!(manifest.recorded_count() <= frames);
    assert!(physics.time_s(last) >= 0.0);
    drop(physics.particulars());
    let _ = physics.ranges_at_a_glance();
}

/// What is done with the run.
fn compute(manifest: &RunManifest) {
    let physics = &manifest.physics;
    assert!(physics.longest_dt_s() >= physics.dt_s);
    let _ = physics.scales();
    let (_, limit) = physics.usual_step();
    drop(physics.limit_words(limit));
    let energy = physics.initial_energy();
    assert!(energy.total_j().is_finite(), "{energy:?}");
    let states = first_states(physics);
    // threads and files take far longer than the rest
    if physics.step_count.is_multiple_of(16) {
        record(manifest, &states);
    }
}

/// The states of step 0 and of some more.
fn first_states(physics: &Physics) -> Vec<ChainState> {
    let mut state = ChainState::initial(physics);
    let mut integrator = Integrator::new(physics);
    let mut states = vec![state.clone()];
    for _ in 0..physics.step_count.min(3) {
        integrator.step(&mut state);
        states.push(state.clone());
    }
    states
}

/// Records `states` and proves what was recorded.
fn record(manifest: &RunManifest, states: &[ChainState]) {
    let path = PLACE.with(|place| place.path("manifest.mcap"));
    let options = WriteOptions { force: true, compression: Compression::None, ..WriteOptions::default() };
    let begin = BeginRecord::default();
    let mut writer = RecordingWriter::create_from(&path, manifest, None, &begin, &options).expect("a writer");
    for state in states.iter().filter(|state| manifest.is_recorded(state.step)) {
        writer.accept(&state.as_frame(manifest, manifest.frame_at(state.step))).expect("written");
    }
    writer.finish(EndReason::Interrupted).expect("a whole recording");
    let info = RecordingInfo::glance(&path).expect("what was written");
    assert_eq!(info.manifest.physics, manifest.physics);
    let audit = Audit::open(&path).expect("what was written");
    let found = verify(audit, NonZero::<usize>::MIN, &AtomicBool::new(false), |_| {}).expect("states");
    assert!(found.is_sound_so_far(), "{found:?}");
}
