//! Costs of the analyses of a frame. They are in this package because only it sees both the dynamics and the analyses.

use consumers::contacts::{Contacts, default_tolerance_m};
use consumers::energies::{Energies, default_split_bead};
use consumers::impurity::Followed;
use consumers::pulses::Pulses;
use criterion::measurement::WallTime;
use criterion::{
    BatchSize, BenchmarkGroup, Criterion, SamplingMode, Throughput, criterion_group, criterion_main,
};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::frame::Frame;
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::PRESETS;
use std::hint::black_box;

/// Frames in a row that are looked at: 16 kB each.
const FRAMES: usize = 500;

/// Frames from the middle of the light-impurity run.
struct Middle {
    manifest: RunManifest,
    states: Vec<ChainState>,
}

impl Middle {
    fn simulate() -> Self {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&PRESETS[0].config(), "middle", origin).expect("a preset is valid");
        let physics = &manifest.physics;
        let (mut integrator, mut state) = (Integrator::new(physics), ChainState::initial(physics));
        while state.step < physics.step_count / 2 {
            integrator.step(&mut state);
        }
        let next = |_| {
            integrator.step(&mut state);
            state.clone()
        };
        let states = (0..FRAMES).map(next).collect();
        Self { manifest, states }
    }

    fn frames(&self) -> impl Iterator<Item = Frame<'_>> {
        self.states.iter().map(|state| state.as_frame(&self.manifest, self.manifest.frame_at(state.step)))
    }
}

fn analyses(criterion: &mut Criterion) {
    let middle = Middle::simulate();
    let manifest = &middle.manifest;
    let split_bead = default_split_bead(manifest);
    let threshold_m_s = Pulses::DEFAULT_THRESHOLD * Pulses::velocity_scale_m_s(manifest);
    let mut group = criterion.benchmark_group("analyses");
    group.sampling_mode(SamplingMode::Flat).throughput(Throughput::Elements(FRAMES as u64));
    measure(
        &mut group,
        "energies",
        &middle,
        || Energies::new(manifest, split_bead),
        |energies, frame| {
            black_box(energies.observe(frame));
        },
    );
    measure(
        &mut group,
        "impurity",
        &middle,
        || Followed::new(manifest, &[split_bead]),
        |followed, frame| {
            black_box(followed.observe(frame));
        },
    );
    measure(
        &mut group,
        "contacts",
        &middle,
        || Contacts::new(manifest, default_tolerance_m(manifest)),
        |contacts, frame| {
            black_box(contacts.observe(frame));
        },
    );
    measure(
        &mut group,
        "pulses",
        &middle,
        || Pulses::new(manifest, threshold_m_s),
        |pulses, frame| {
            black_box(pulses.observe(frame));
        },
    );
    group.finish();
}

/// Shows all frames to an analysis that begins with them, since none takes frames that go back in time.
fn measure<A>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    middle: &Middle,
    begin: impl Fn() -> A,
    observe: impl Fn(&mut A, &Frame<'_>),
) {
    group.bench_function(name, |bencher| {
        let look = |analysis: &mut A| middle.frames().for_each(|frame| observe(analysis, &frame));
        bencher.iter_batched_ref(&begin, look, BatchSize::LargeInput);
    });
}

criterion_group!(benches, analyses);
criterion_main!(benches);
