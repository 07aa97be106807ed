//! A run goes on with the bits it had from any frame, whether it comes from a recording or from the bus.

use bus::{AttachOptions, Bus, Delivery, LiveSource, PublishOptions, StatePublisher, WaitOutcome};
use producer::integrator::Integrator;
use producer::run::{Conductor, run};
use producer::state::ChainState;
use recording::{RecordingSource, RecordingWriter, WriteOptions};
use schemas::config::{DampingConfig, RunConfig, StreamConfig};
use schemas::frame::{EndReason, Frame, FrameSource, Received};
use schemas::manifest::{Origin, RunManifest};
use schemas::method::Method;
use schemas::presets::PRESETS;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use tempfile::TempDir;

/// Generous: only a test that hangs meets it.
const PATIENCE: Duration = Duration::from_mins(1);

/// A run of 300 steps of 40 beads, a frame every third step.
fn manifest(method: Method, damping: Option<DampingConfig>) -> RunManifest {
    let mut config: RunConfig = PRESETS[0].config();
    config.chain.beads = 40;
    config.chain.impurities[0].bead = 10;
    config.integrator.method = method;
    config.damping = damping;
    config.stream = StreamConfig { publish_every_steps: 3, record_every_steps: 3 };
    let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 };
    let dt_s = RunManifest::new(&config, "resumed", origin.clone()).unwrap().physics.dt_s;
    config.time.duration_s = 300.0 * dt_s;
    RunManifest::new(&config, "resumed", origin).unwrap()
}

/// Lets a run go on to its end.
struct GoOn;

impl Conductor<StatePublisher, RecordingWriter> for GoOn {
    fn after_frame(
        &mut self,
        _: &Frame<'_>,
        _: &mut StatePublisher,
        _: Option<&mut RecordingWriter>,
    ) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Publishes and records a run, and gives the frames that came over the bus and those in the recording.
fn frames_of(manifest: &RunManifest) -> [Vec<ChainState>; 2] {
    let dir = tempfile::Builder::new().prefix("bl-").tempdir_in("/tmp").unwrap();
    let bus = Bus::at(&dir.path().join("r")).unwrap();
    let path = dir.path().join("run.mcap");
    let physics = &manifest.physics;
    let mut publisher =
        StatePublisher::create(&bus, manifest, &physics.chain(), &PublishOptions::default()).unwrap();
    let mut recorder = RecordingWriter::create(&path, manifest, "", &WriteOptions::default()).unwrap();
    let live = std::thread::scope(|scope| {
        let consumer = scope.spawn(|| {
            let options = AttachOptions { timeout: Some(PATIENCE), ..AttachOptions::default() };
            let name = &manifest.provenance.name;
            let mut source = LiveSource::attach(&bus, Some(name), Delivery::Lossless, &options).unwrap();
            drain(&mut source)
        });
        let stop = AtomicBool::new(false);
        assert_eq!(publisher.wait_for(1, &stop, Some(PATIENCE)).unwrap(), WaitOutcome::Ready);
        run(manifest, &mut publisher, Some(&mut recorder), &mut GoOn).unwrap();
        recorder.finish(EndReason::Complete).unwrap();
        publisher.finish(EndReason::Complete).unwrap();
        consumer.join().unwrap()
    });
    let recorded = drain(&mut RecordingSource::open(&path).unwrap());
    remove_shared_memory(&bus, dir);
    [live, recorded]
}

/// Every frame of `source`, which misses none.
fn drain(source: &mut impl FrameSource) -> Vec<ChainState> {
    let mut states = Vec::new();
    loop {
        match source.receive().unwrap() {
            Received::Frame(frame) => states.push(ChainState::of_frame(&frame)),
            other => {
                assert_eq!(other, Received::End(EndReason::Complete));
                return states;
            }
        }
    }
}

/// Takes away the segment that iceoryx2 keeps for a bus, and its directory.
fn remove_shared_memory(bus: &Bus, dir: TempDir) {
    for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(bus.prefix()) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
    drop(dir);
}

fn bits(state: &ChainState) -> Vec<u64> {
    state.u_m.iter().chain(state.v_m_s.iter()).chain(state.extra.iter()).map(|x| x.to_bits()).collect()
}

#[test]
fn every_frame_of_the_bus_and_of_the_file_leads_to_the_next_one() {
    let undamped = Method::ALL.map(|method| (method, None));
    let damped = (Method::Rk5, Some(DampingConfig::Restitution(0.9)));
    for (method, damping) in undamped.into_iter().chain([damped]) {
        let manifest = manifest(method, damping);
        let physics = &manifest.physics;
        let [live, recorded] = frames_of(&manifest);
        for states in [&live, &recorded] {
            assert_eq!(states.len(), 101);
            assert_eq!(states[0], ChainState::initial(physics));
            for pair in states.windows(2) {
                let mut resumed = pair[0].clone();
                assert_eq!(resumed.extra.len(), physics.extra_per_bead() * 40);
                let mut integrator = Integrator::new(physics);
                while resumed.step < pair[1].step {
                    integrator.step(&mut resumed);
                }
                assert_eq!(bits(&resumed), bits(&pair[1]), "{method}, step {}", pair[1].step);
            }
        }
    }
}
