//! A run that goes into a file, and that nobody else looks at.

use producer::run::{Conductor, RunError, run};
use recording::{RecordingWriter, WriteError, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::RunManifest;
use std::convert::Infallible;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Simulates `manifest`'s run, whose configuration is `toml`, and records it in `path`, in place of what is there. Tells `progress` each
/// step that it has reached. `false` if `stop` ended it early; nothing is kept then.
///
/// # Errors
/// When a state leaves the range of doubles, or the recording cannot be written.
pub fn record(
    manifest: &RunManifest,
    toml: &str,
    path: &Path,
    stop: &AtomicBool,
    progress: impl Fn(u64),
) -> Result<bool, RunError<Infallible, WriteError>> {
    let failed = |source| RunError::Record { frame: 0, source };
    let options = WriteOptions { force: true, ..WriteOptions::default() };
    let mut recorder = RecordingWriter::create(path, manifest, toml, &options).map_err(failed)?;
    let outcome = run(manifest, &mut Unpublished, Some(&mut recorder), &mut Conduct { stop, progress })?;
    if outcome.reason != EndReason::Complete {
        recorder.discard();
        return Ok(false);
    }
    recorder.finish(outcome.reason).map_err(failed)?;
    Ok(true)
}

/// Nobody listens to these runs.
struct Unpublished;

impl FrameSink for Unpublished {
    type Error = Infallible;

    fn accept(&mut self, _: &Frame<'_>) -> Result<(), Infallible> {
        Ok(())
    }
}

struct Conduct<'a, P> {
    stop: &'a AtomicBool,
    progress: P,
}

/// Goes on until `stop` is set.
pub(crate) fn go_on(stop: &AtomicBool) -> ControlFlow<()> {
    if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

impl<P: Fn(u64)> Conductor<Unpublished, RecordingWriter> for Conduct<'_, P> {
    fn after_frame(
        &mut self,
        frame: &Frame<'_>,
        _: &mut Unpublished,
        _: Option<&mut RecordingWriter>,
    ) -> ControlFlow<()> {
        (self.progress)(frame.step);
        go_on(self.stop)
    }

    fn hears_every_frame(&self, _: &Unpublished) -> bool {
        false
    }

    fn between_steps(&mut self, _: &mut Unpublished) -> ControlFlow<()> {
        go_on(self.stop)
    }
}
