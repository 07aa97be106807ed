//! Recording, reading and verifying, against mcap by itself and against simulating.

use super::{Bench, Floor, Rounds, Row, timed};
use crate::bare_mcap::{self, BareWriter};
use crate::report::Report;
use anyhow::{Error, anyhow};
use consumers::energies::{Energies, default_split_bead};
use producer::integrator::Integrator;
use producer::resimulation::{Lend, Resimulation};
use producer::state::ChainState;
use producer::verification::verify;
use recording::{Audit, Compression, RecordingSource, RecordingWriter, WriteOptions};
use schemas::amounts::bytes;
use schemas::config::RunConfig;
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::PRESETS;
use std::hint::black_box;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Frames that are kept in memory: 16 kB each.
const KEPT: u64 = 6000;

/// Number of times that all of them are compressed into a file: the cost to create and close one is the disk's.
const ZSTD_TIMES: usize = 4;

/// Frames of the light-impurity run from its middle, in memory, and all of it in files.
pub(crate) struct Frames {
    manifest: RunManifest,
    /// Frame, step, `[u | v]`.
    kept: Vec<(u64, u64, Vec<f64>)>,
    directory: PathBuf,
    full: PathBuf,
    sparse: PathBuf,
}

impl Frames {
    /// Records the run in `directory`, every frame and one in 100.
    pub(crate) fn record_in(directory: &Path) -> Result<Self, Error> {
        let manifest = manifest(&PRESETS[0].config())?;
        let (full, sparse) = (directory.join("full.mcap"), directory.join("sparse.mcap"));
        let half = manifest.physics.step_count / 2;
        let mut kept = Vec::new();
        simulate(&manifest, |frame| {
            if (half..half + KEPT).contains(&frame.step) {
                kept.push((frame.frame, frame.step, [frame.u_m, frame.v_m_s].concat()));
            }
            Ok(())
        })?;
        record(&manifest, &full, 1)?;
        record(&manifest, &sparse, 100)?;
        Ok(Self { manifest, kept, directory: directory.to_owned(), full, sparse })
    }

    pub(crate) fn manifest(&self) -> &RunManifest {
        &self.manifest
    }

    pub(crate) fn count(&self) -> usize {
        self.kept.len()
    }

    /// Every frame that is in memory.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Frame<'_>> + Clone {
        self.kept.iter().map(|(frame, step, doubles)| {
            let (u_m, v_m_s) = doubles.split_at(doubles.len() / 2);
            let time_s = self.manifest.physics.time_s(*step);
            Frame { frame: *frame, step: *step, time_s, u_m, v_m_s, extra: &[], active: None }
        })
    }

    /// Lends every frame that is in memory.
    pub(crate) fn each(&self, mut take: impl FnMut(&Frame<'_>)) {
        self.iter().for_each(|frame| take(&frame));
    }

    /// The same, each as `[u | v]`.
    pub(crate) fn in_one_piece(&self) -> impl Iterator<Item = &[f64]> + Clone {
        self.kept.iter().map(|(_, _, doubles)| doubles.as_slice())
    }

    fn state_bytes(&self) -> f64 {
        8.0 * self.manifest.frame_doubles() as f64 * self.count() as f64
    }
}

/// The manifest of a run of the bench.
pub(super) fn manifest(config: &RunConfig) -> Result<RunManifest, Error> {
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    Ok(RunManifest::new(config, "bench", origin)?)
}

/// Makes every step of a run.
pub(super) fn simulate(
    manifest: &RunManifest,
    mut take: impl FnMut(&Frame<'_>) -> Result<(), Error>,
) -> Result<(), Error> {
    let (mut integrator, mut state) =
        (Integrator::new(&manifest.physics), ChainState::initial(&manifest.physics));
    loop {
        take(&state.as_frame(manifest, manifest.frame_at(state.step)))?;
        if state.step == manifest.physics.step_count {
            return Ok(());
        }
        integrator.step(&mut state);
    }
}

/// Simulates the run and records one frame in `every`.
fn record(manifest: &RunManifest, path: &Path, every: u64) -> Result<(), Error> {
    let manifest = manifest.clone().recorded_every(every)?;
    let options = WriteOptions { force: true, ..WriteOptions::default() };
    let mut writer = RecordingWriter::create(path, &manifest, "", &options)?;
    simulate(&manifest, |frame| {
        if manifest.is_recorded(frame.step) {
            writer.accept(frame)?;
        }
        Ok(())
    })?;
    writer.finish(EndReason::Complete)?;
    Ok(())
}

/// Recording, reading and verifying.
pub(super) fn rows(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    let (frames, rounds) = (bench.frames()?, bench.rounds);
    writing(frames, rounds, report)?;
    reading(frames, rounds, report)?;
    recomputing(frames, rounds, report)
}

/// Recording every frame, with and without compression, and one in 100.
fn writing(frames: &Frames, rounds: u32, report: &mut Report) -> Result<(), Error> {
    let message =
        |(_, _, doubles): &(u64, u64, Vec<f64>)| doubles.iter().flat_map(|x| x.to_le_bytes()).collect();
    let messages: Vec<Vec<u8>> = frames.kept.iter().map(message).collect();
    let every = |what, against, floor, compression, times| -> Result<Row, Error> {
        let path = frames.directory.join("written.mcap");
        let ours = || timed(|| write(frames, times, &path, compression));
        let theirs = || timed(|| write_bare(&messages, times, &path, compression));
        let rounds = Rounds::alternate(rounds, ours, theirs)?;
        let figure = per_second(times as f64 * frames.state_bytes(), &rounds);
        Ok(rounds.row(what, against, Floor::AtLeast(floor), figure))
    };
    let uncompressed = "record every frame, uncompressed";
    report.row(every(uncompressed, "mcap's writer, the same bytes", 0.85, Compression::None, 1)?)?;
    let zstd = Compression::Zstd { level: 1 };
    report.row(every(
        "record every frame, zstd 1",
        "mcap's writer, zstd 1, one thread",
        1.5,
        zstd,
        ZSTD_TIMES,
    )?)?;
    let sparse = frames.directory.join("again.mcap");
    let one_in_100 = Rounds::alternate(
        rounds,
        || timed(|| record(&frames.manifest, &sparse, 100)),
        || timed(|| simulate(&frames.manifest, |_| Ok(()))),
    )?;
    let figure = steps_per_s(frames, &one_in_100);
    report.row(one_in_100.row("record one frame in 100", "not recording", Floor::AtMost(1.05), figure))
}

fn per_second(size: f64, rounds: &Rounds) -> String {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let rate = (size / rounds.ours_s()) as u64;
    format!("{}/s", bytes(rate))
}

fn steps_per_s(frames: &Frames, rounds: &Rounds) -> String {
    format!("{:.0} k steps/s", frames.manifest.physics.step_count as f64 / rounds.ours_s() / 1e3)
}

/// Records all frames, and that so many `times` over.
fn write(frames: &Frames, times: usize, path: &Path, compression: Compression) -> Result<(), Error> {
    let options = WriteOptions { force: true, compression, ..WriteOptions::default() };
    let mut writer = RecordingWriter::create(path, &frames.manifest, "", &options)?;
    let again = std::iter::repeat_n(frames.iter(), times).flatten();
    for (frame, number) in again.zip(0..) {
        let time_s = frames.manifest.physics.time_s(number);
        writer.accept(&Frame { frame: number, step: number, time_s, ..frame })?;
    }
    writer.finish(EndReason::Interrupted)?;
    Ok(())
}

fn write_bare(
    messages: &[Vec<u8>],
    times: usize,
    path: &Path,
    compression: Compression,
) -> Result<(), Error> {
    let mut writer = BareWriter::create(path, compression)?;
    for message in std::iter::repeat_n(messages, times).flatten() {
        writer.write(message)?;
    }
    Ok(writer.finish()?)
}

/// Reading a full log into an analysis, and verifying it, against mcap's reader with CRCs checked.
fn reading(frames: &Frames, rounds: u32, report: &mut Report) -> Result<(), Error> {
    let size = std::fs::metadata(&frames.full)?.len() as f64;
    let bare = || timed(|| Ok(black_box(bare_mcap::read_all(&frames.full)?)));
    let row = |what, floor, read: fn(&Path) -> Result<(), Error>| -> Result<Row, Error> {
        let rounds = Rounds::alternate(rounds, || timed(|| read(&frames.full)), bare)?;
        let figure = format!("{} of the file", per_second(size, &rounds));
        Ok(rounds.row(what, "mcap's reader, CRCs checked", Floor::AtLeast(floor), figure))
    };
    report.row(row("read a full log into energies", 0.8, read_energies)?)?;
    report.row(row("verify a full log", 0.7, prove)?)
}

/// Proving and reading a log of one frame in 100, against simulating the run once on one core.
fn recomputing(frames: &Frames, rounds: u32, report: &mut Report) -> Result<(), Error> {
    let simulating = || timed(|| simulate(&frames.manifest, |_| Ok(())));
    let row = |what, floor, read: fn(&Path) -> Result<(), Error>| -> Result<Row, Error> {
        let rounds = Rounds::alternate(rounds, || timed(|| read(&frames.sparse)), simulating)?;
        let figure = steps_per_s(frames, &rounds);
        Ok(rounds.row(what, "simulating the run once", Floor::AtMost(floor), figure))
    };
    report.row(row("verify a 1:100 log on all cores", 0.65, prove)?)?;
    report.row(row("every step of a 1:100 log on one core", 1.2, read_every_step)?)
}

fn read_energies(path: &Path) -> Result<(), Error> {
    let mut source = RecordingSource::open(path)?;
    let manifest = source.manifest().clone();
    let mut energies = Energies::new(&manifest, default_split_bead(&manifest));
    for_each_frame(&mut source, |frame| {
        black_box(energies.observe(frame));
    })
}

fn read_every_step(path: &Path) -> Result<(), Error> {
    let mut steps = Resimulation::new(RecordingSource::open(path)?, Lend::Steps)?;
    for_each_frame(&mut steps, |frame| {
        black_box(frame.u_m[0]);
    })
}

fn for_each_frame<S: FrameSource>(source: &mut S, mut take: impl FnMut(&Frame<'_>)) -> Result<(), Error> {
    loop {
        match source.receive()? {
            Received::Frame(frame) => take(&frame),
            Received::Missed { from, to } => return Err(anyhow!("frames {from} to {to} are missing")),
            Received::End(_) => return Ok(()),
        }
    }
}

fn prove(path: &Path) -> Result<(), Error> {
    let threads = std::thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
    let found = verify(Audit::open(path)?, threads, &AtomicBool::new(false), |_| {})?;
    if found.is_proven() { Ok(()) } else { Err(anyhow!("a recording of the bench does not verify")) }
}
