//! What it costs to make messages and records of frames, and frames of them again: without compression and disk.

use criterion::measurement::WallTime;
use criterion::{
    BatchSize, BenchmarkGroup, Criterion, SamplingMode, Throughput, criterion_group, criterion_main,
};
use recording::{Compression, RecordingSource, RecordingWriter, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink as _, FrameSource as _, Received};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::PRESETS;
use std::hint::black_box;
use std::path::Path;

/// Frames of 1000 beads that fill a chunk.
const FRAMES: u64 = 65;

/// Chunks that are written and read.
const CHUNKS: u64 = 8;

/// A state of a chain of 1000 beads, as every frame of a recording.
struct Run {
    manifest: RunManifest,
    u_m: Vec<f64>,
    v_m_s: Vec<f64>,
}

impl Run {
    fn new() -> Self {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&PRESETS[0].config(), "framing", origin).expect("a preset is valid");
        let (u_m, v_m_s) = (0..1000).map(f64::from).map(|bead| (1e-6 * bead.sin(), bead.cos())).unzip();
        Self { manifest, u_m, v_m_s }
    }

    /// Starts `path` anew.
    fn writer(&self, path: &Path) -> RecordingWriter {
        let (force, compression) = (true, Compression::None);
        // room for all of it, so that nothing waits for the disk
        let options = WriteOptions { force, compression, queue_bytes: 64 << 20, ..WriteOptions::default() };
        RecordingWriter::create(path, &self.manifest, "", &options).expect("created")
    }

    fn write(&self, writer: &mut RecordingWriter, frames: u64) {
        for number in 0..frames {
            let time_s = self.manifest.physics.time_s(number);
            let (u_m, v_m_s) = (self.u_m.as_slice(), self.v_m_s.as_slice());
            let frame = Frame { frame: number, step: number, time_s, u_m, v_m_s, extra: &[], active: None };
            writer.accept(&frame).expect("accepted");
        }
    }

    fn record(&self, path: &Path, frames: u64) {
        let mut writer = self.writer(path);
        self.write(&mut writer, frames);
        writer.finish(EndReason::Interrupted).expect("finished");
    }

    fn bytes(&self, frames: u64) -> Throughput {
        Throughput::Bytes(8 * self.manifest.frame_doubles() as u64 * frames)
    }
}

fn framing(criterion: &mut Criterion) {
    let (run, directory) = (Run::new(), tempfile::tempdir().expect("a directory"));
    let mut group = criterion.benchmark_group("framing");
    group.sampling_mode(SamplingMode::Flat);
    encode(&mut group, &run, &directory.path().join("encoded.mcap"));
    read(&mut group, &run, &directory.path().join("read.mcap"));
    group.finish();
}

/// What the recording thread does; another one writes its chunks meanwhile.
fn encode(group: &mut BenchmarkGroup<'_, WallTime>, run: &Run, path: &Path) {
    group.throughput(run.bytes(CHUNKS * FRAMES));
    group.bench_function("encode chunks", |bencher| {
        let accept = |writer: &mut RecordingWriter| run.write(writer, CHUNKS * FRAMES);
        // one at a time: they have the same file
        bencher.iter_batched_ref(|| run.writer(path), accept, BatchSize::PerIteration);
    });
}

/// Reading and checking, from the page cache.
fn read(group: &mut BenchmarkGroup<'_, WallTime>, run: &Run, path: &Path) {
    run.record(path, CHUNKS * FRAMES);
    group.throughput(run.bytes(CHUNKS * FRAMES));
    group.bench_function("read chunks", |bencher| {
        let open = || RecordingSource::open(path).expect("ours");
        bencher.iter_batched_ref(open, read_all, BatchSize::PerIteration);
    });
}

fn read_all(source: &mut RecordingSource) {
    let mut frames = 0;
    while let Received::Frame(frame) = source.receive().expect("readable") {
        black_box(frame.u_m[0]);
        frames += 1;
    }
    assert_eq!(frames, CHUNKS * FRAMES);
}

criterion_group!(benches, framing);
criterion_main!(benches);
