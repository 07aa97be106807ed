//! What a sparse recording costs and what it gives back: the table of docs/guide/4-record.md.
//!
//! ```text
//! cargo run --release -p beadline-bench --example recording_sizes              # the light-impurity run
//! cargo run --release -p beadline-bench --example recording_sizes -- 0.01      # its first 10 ms
//! ```
#![expect(clippy::print_stdout, reason = "its results go to stdout")]

use anyhow::{Context, Result, ensure};
use producer::integrator::Integrator;
use producer::resimulation::{Lend, ParallelResimulation, Resimulation};
use producer::state::ChainState;
use producer::verification::verify;
use recording::{Audit, RecordingSource, RecordingWriter, WriteOptions};
use schemas::frame::{EndReason, FrameSink, FrameSource, Received};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::Preset;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// A state of every so many steps is recorded.
const INTERVALS: [u64; 3] = [1, 100, 10_000];

/// Steps that are got back one by one from each recording.
const STEPS_BACK: u64 = 40;

/// Times that take long are measured so often, in turn; the table has their medians.
const ROUNDS: usize = 3;

/// A recording and the times (s) that it takes.
struct Measured {
    every_steps: u64,
    path: PathBuf,
    bytes: u64,
    /// To get one step back, in order.
    one_step_s: Vec<f64>,
    /// To get every step back, with one thread and with two.
    every_step_s: [Vec<f64>; 2],
    verify_s: Vec<f64>,
}

fn main() -> Result<()> {
    let mut config = Preset::find("light-impurity").context("a preset")?.config();
    if let Some(duration_s) = std::env::args().nth(1) {
        config.time.duration_s = duration_s.parse().context("a duration in seconds")?;
    }
    let origin = Origin { program: "recording_sizes".into(), host: String::new(), started_unix_ns: 0 };
    let manifest = RunManifest::new(&config, "light-impurity", origin)?;
    let directory = std::env::temp_dir().join(format!("recording-sizes-{}", std::process::id()));
    std::fs::create_dir(&directory).with_context(|| format!("{}", directory.display()))?;
    let measured = measure(&manifest, &directory);
    std::fs::remove_dir_all(&directory)?;
    let (simulate_s, recordings) = measured?;
    print(&manifest, simulate_s, recordings);
    Ok(())
}

/// The time to simulate the run, and what its recordings take.
fn measure(manifest: &RunManifest, directory: &Path) -> Result<(f64, Vec<Measured>)> {
    let mut recordings = Vec::new();
    for every_steps in INTERVALS {
        let path = directory.join(format!("every-{every_steps}.mcap"));
        let bytes = record(manifest, every_steps, &path)?;
        let one_step_s = one_by_one(manifest, &path)?;
        let (every_step_s, verify_s) = ([Vec::new(), Vec::new()], Vec::new());
        recordings.push(Measured { every_steps, path, bytes, one_step_s, every_step_s, verify_s });
    }
    let mut simulate_s = Vec::new();
    for _ in 0..ROUNDS {
        simulate_s.push(timed(|| simulate(manifest))?);
        for recording in &mut recordings {
            let open = || RecordingSource::open_all(&recording.path);
            recording.every_step_s[0]
                .push(timed(|| receive_all(&mut Resimulation::new(open()?, Lend::Steps)?, manifest))?);
            if ParallelResimulation::<RecordingSource>::pays(open()?.manifest()) {
                recording.every_step_s[1].push(timed(|| {
                    receive_all(&mut ParallelResimulation::new(open()?, Lend::Steps, two())?, manifest)
                })?);
            }
            recording.verify_s.push(timed(|| {
                let found = verify(Audit::open(&recording.path)?, two(), &AtomicBool::new(false), |_| {})?;
                ensure!(found.is_proven(), "every state follows from the one before");
                Ok(())
            })?);
        }
    }
    Ok((median(&mut simulate_s), recordings))
}

fn two() -> NonZero<usize> {
    NonZero::<usize>::MIN.saturating_add(1)
}

fn timed(work: impl FnOnce() -> Result<()>) -> Result<f64> {
    let start = Instant::now();
    work()?;
    Ok(start.elapsed().as_secs_f64())
}

fn simulate(manifest: &RunManifest) -> Result<()> {
    let (mut state, mut integrator) =
        (ChainState::initial(&manifest.physics), Integrator::new(&manifest.physics));
    while state.step < manifest.physics.step_count {
        integrator.step(&mut state);
    }
    ensure!(integrator.first_non_finite(&state).is_none(), "the run has finite states");
    Ok(())
}

/// Records every so many steps and returns the size of the file.
fn record(manifest: &RunManifest, every_steps: u64, path: &Path) -> Result<u64> {
    let manifest = manifest.clone().recorded_every(every_steps)?;
    let mut writer = RecordingWriter::create(path, &manifest, "", &WriteOptions::default())?;
    let (mut state, mut integrator) =
        (ChainState::initial(&manifest.physics), Integrator::new(&manifest.physics));
    loop {
        if manifest.is_recorded(state.step) {
            writer.accept(&state.as_frame(&manifest, manifest.frame_at(state.step)))?;
        }
        if state.step == manifest.physics.step_count {
            break;
        }
        integrator.step(&mut state);
    }
    Ok(writer.finish(EndReason::Complete)?.bytes)
}

/// Gets single steps back, each from a file that is opened for it: the times in order.
fn one_by_one(manifest: &RunManifest, path: &Path) -> Result<Vec<f64>> {
    // an LCG: any steps will do, as long as they are always the same
    let mut random = 1_u64;
    let mut times_s = Vec::new();
    for _ in 0..STEPS_BACK {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let step = (random >> 33) % (manifest.physics.step_count + 1);
        times_s.push(timed(|| {
            let mut source = RecordingSource::open_all(path)?;
            source.seek_to_step(step)?;
            let mut states = Resimulation::new(source, Lend::Steps)?.lending_from(step);
            let found = matches!(states.receive()?, Received::Frame(frame) if frame.step == step);
            ensure!(found, "step {step} of {}", path.display());
            Ok(())
        })?);
    }
    times_s.sort_by(f64::total_cmp);
    Ok(times_s)
}

/// Receives every step and does nothing with it.
fn receive_all<S>(source: &mut S, manifest: &RunManifest) -> Result<()>
where
    S: FrameSource,
{
    let mut steps = 0;
    while let Received::Frame(_) = source.receive()? {
        steps += 1;
    }
    ensure!(steps == manifest.physics.step_count + 1, "every step comes once");
    Ok(())
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn print(manifest: &RunManifest, simulate_s: f64, recordings: Vec<Measured>) {
    let steps = manifest.physics.step_count + 1;
    println!(
        "{steps} states, simulated in {simulate_s:.3} s by one thread. Times in units of that in brackets.\n"
    );
    println!(
        "| a state in | size | of the full one | one step: median | worst | every step, 1 thread | 2 threads | verify |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let full_bytes = recordings[0].bytes as f64;
    for mut recording in recordings {
        let one = &recording.one_step_s;
        let (middle_ms, worst_ms) = (one[one.len() / 2] * 1e3, one[one.len() - 1] * 1e3);
        let [single, both] = &mut recording.every_step_s;
        let times = [single, both, &mut recording.verify_s].map(|times_s| {
            if times_s.is_empty() {
                return "the same".to_owned();
            }
            let time_s = median(times_s);
            format!("{time_s:.2} s ({:.2})", time_s / simulate_s)
        });
        println!(
            "| {} | {:.2} MB | 1/{:.0} | {middle_ms:.1} ms | {worst_ms:.1} ms | {} |",
            recording.every_steps,
            recording.bytes as f64 / 1e6,
            full_bytes / recording.bytes as f64,
            times.join(" | ")
        );
    }
}
