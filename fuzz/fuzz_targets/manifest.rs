//! Manifests: JSON as on the bus, and the metadata record `beadline.run` with its checksum.
//!
//! A manifest that is accepted is written and read back the same, and can be simulated.

#![no_main]

use libfuzzer_sys::fuzz_target;
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::manifest::{Physics, RunManifest};
use recording::fuzzing;

fuzz_target!(|bytes: &[u8]| {
    let read = match bytes.split_first() {
        Some((b'{', _)) => RunManifest::from_json(bytes).ok(),
        Some((_, record)) => {
            let mut record = record.to_vec();
            hostile::checksums::correct_manifest(&mut record);
            fuzzing::manifest(&record).ok()
        }
        None => None,
    };
    if let Some(manifest) = read {
        check(&manifest);
    }
});

fn check(manifest: &RunManifest) {
    let again = RunManifest::from_json(manifest.to_json().as_bytes()).expect("what we write");
    assert_eq!(again, *manifest);
    assert_eq!(again.physics.hash(), manifest.physics.hash());
    let physics = &manifest.physics;
    let (frames, last) = (manifest.frame_count(), physics.step_count);
    assert_eq!(manifest.step_of_frame(frames - 1), last);
    assert_eq!(manifest.frame_at(last), frames - 1);
    assert!(manifest.is_recorded(0) && manifest.is_recorded(last) && manifest.is_frame(last));
    assert!(manifest.recorded_count() <= frames);
    assert!(physics.time_s(last) >= 0.0 && physics.longest_dt_s() >= physics.dt_s);
    drop(physics.particulars());
    let _ = physics.scales();
    if physics.beads <= 1000 {
        simulate(physics);
    }
}

/// A few steps, as a reader that recomputes would do them.
fn simulate(physics: &Physics) {
    let energy = physics.initial_energy();
    assert!(energy.total_j().is_finite(), "{energy:?}");
    let mut state = ChainState::initial(physics);
    let mut integrator = Integrator::new(physics);
    for _ in 0..physics.step_count.min(3) {
        integrator.step(&mut state);
    }
}
