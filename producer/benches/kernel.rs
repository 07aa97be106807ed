//! What a step of the dynamics costs, and the power in its forces.

use criterion::measurement::WallTime;
use criterion::{
    BatchSize, BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group,
    criterion_main,
};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::RunConfig;
use schemas::contact::BLOCK;
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::power::{PowerTable, Powers};
use schemas::presets::PRESETS;
use schemas::simd::vectorized;
use std::hint::black_box;
use std::time::Duration;

const LENGTHS: [u64; 2] = [1000, 100_000];

/// One exponent with a power of its own, one without.
const EXPONENTS: [f64; 2] = [1.5, 1.3];

/// Steps that are measured at a time: too few for the chain to become another one.
const STEPS: u64 = 20;

/// The bead that the wave is at: more than its width away from the end, where all others rest.
const WAVE_AT: usize = 100;

/// A chain before a step, and what steps it.
#[derive(Clone)]
struct Moment {
    state: ChainState,
    integrator: Integrator,
}

impl Moment {
    /// The first step, which looks at all beads as no later one does, is made here.
    fn of(physics: &Physics, mut state: ChainState) -> Self {
        let mut integrator = Integrator::new(physics);
        integrator.step(&mut state);
        Self { state, integrator }
    }

    /// A solitary wave in a chain in which nothing else moves.
    fn wave(physics: &Physics) -> Self {
        let mut moment = Self::of(physics, ChainState::initial(physics));
        while moment.state.v_m_s[WAVE_AT] < 0.1 * physics.striker.velocity_m_s {
            moment.step();
        }
        moment
    }

    /// Every contact is closed and every bead moves: all of the work.
    fn all_closed(physics: &Physics) -> Self {
        let overlap_m = 0.1 * physics.scales().length_m;
        let u_m: Vec<f64> = (0..physics.beads).rev().map(|bead| bead as f64 * overlap_m).collect();
        let v_m_s: Vec<f64> = (0..physics.beads).map(|bead| 1e-3 * (bead % 7) as f64).collect();
        Self::of(physics, ChainState::starting_at(physics, &u_m, &v_m_s))
    }

    fn step(&mut self) {
        self.integrator.step(&mut self.state);
    }
}

/// Equal beads that are struck at one end.
fn chain(method: Method, alpha: f64, beads: u64) -> Physics {
    let homogeneous = PRESETS.iter().find(|preset| preset.name == "homogeneous");
    let mut config: RunConfig = homogeneous.expect("a preset").config();
    (config.chain.beads, config.chain.alpha, config.integrator.method) = (beads, Some(alpha), method);
    Physics::resolve(&config).expect("a chain of any length is valid")
}

/// Beads at rest count, too: that they cost nothing is what there is to see.
fn steps(criterion: &mut Criterion) {
    for method in [Method::VelocityVerlet, Method::Rkn4] {
        let mut group = criterion.benchmark_group(method.as_str());
        group.sampling_mode(SamplingMode::Flat);
        for (alpha, beads) in EXPONENTS.into_iter().flat_map(|alpha| LENGTHS.map(|beads| (alpha, beads))) {
            let physics = chain(method, alpha, beads);
            group.throughput(Throughput::Elements(beads * STEPS));
            let id = |what| BenchmarkId::new(what, format_args!("α={alpha}/N={beads}"));
            measure(&mut group, id("wave"), &Moment::wave(&physics));
            measure(&mut group, id("all closed"), &Moment::all_closed(&physics));
        }
        group.finish();
    }
}

fn measure(group: &mut BenchmarkGroup<'_, WallTime>, id: BenchmarkId, start: &Moment) {
    group.bench_with_input(id, start, |bencher, start| {
        let advance = |moment: &mut Moment| (0..STEPS).for_each(|_| moment.step());
        // one at a time: many long chains would not fit into memory
        bencher.iter_batched_ref(|| start.clone(), advance, BatchSize::PerIteration);
    });
}

fn powers(criterion: &mut Criterion) {
    let overlaps_m: Vec<f64> = (1..=1024).map(|n| 1e-8 * f64::from(n)).collect();
    let mut powers = overlaps_m.clone();
    let table = PowerTable::shared(1.3);
    let mut group = criterion.benchmark_group("power");
    group.throughput(Throughput::Elements(overlaps_m.len() as u64));
    group.bench_function("1024 overlaps", |bencher| {
        bencher.iter(|| raise(black_box(&overlaps_m), table.powers(), black_box(&mut powers)));
    });
    group.finish();
}

/// As the kernel does: by the widest instructions of this machine.
fn raise(overlaps_m: &[f64], table: Powers<'_>, powers: &mut [f64]) {
    vectorized(
        pulp::Arch::new(),
        #[inline(always)]
        || {
            let (overlaps_m, _) = overlaps_m.as_chunks::<BLOCK>();
            for (powers, overlaps_m) in powers.as_chunks_mut::<BLOCK>().0.iter_mut().zip(overlaps_m) {
                *powers = table.raise(overlaps_m);
            }
        },
    );
}

fn quickly() -> Criterion {
    let (warm_up, measurement) = (Duration::from_millis(500), Duration::from_secs(2));
    Criterion::default().sample_size(20).warm_up_time(warm_up).measurement_time(measurement)
}

criterion_group! {
    name = kernel;
    config = quickly();
    targets = steps, powers
}
criterion_main!(kernel);
