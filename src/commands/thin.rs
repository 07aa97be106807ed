//! `beadline thin` and `beadline expand`: fewer or more of a run's states in a recording, none of them lost.

use crate::analysis::check_place;
use crate::args::{ExpandArgs, ThinArgs};
use crate::display::{self, bytes, count};
use crate::failure::{BadInput, Done, Failure};
use crate::signals;
use crate::source::Source;
use anyhow::anyhow;
use producer::resimulation::{Lend, Resimulation};
use schemas::frame::{EndReason, FrameSink, FrameSource, Received};
use schemas::manifest::RunManifest;
use schemas::recording::{Finished, RecordingInfo, RecordingWriter, SpaceNeeded, WriteOptions};
use serde_json::json;
use std::path::Path;
use std::time::{Duration, Instant};

/// A recording to be written again with other states.
struct Rewrite<'a> {
    from: &'a Path,
    to: &'a Path,
    every_steps: u64,
    force: bool,
    json: bool,
}

/// Keeps every K-th state.
pub(crate) fn thin(args: &ThinArgs) -> Result<Done, Failure> {
    let rewrite = Rewrite {
        from: &args.file,
        to: &args.output.out,
        every_steps: args.every_steps,
        force: args.output.force,
        json: args.output.json,
    };
    rewrite.run("thinned")
}

/// Keeps every `every_steps`-th state of the recording `from` in `to`, and says nothing.
pub(crate) fn thin_quietly(
    from: &Path,
    to: &Path,
    every_steps: u64,
    force: bool,
) -> Result<Finished, Failure> {
    Rewrite { from, to, every_steps, force, json: false }.write(&RecordingInfo::read(from)?)
}

/// Recomputes the states in between.
pub(crate) fn expand(args: &ExpandArgs) -> Result<Done, Failure> {
    let published = || {
        let info = RecordingInfo::read(&args.file).bad_input()?;
        Ok::<_, Failure>(info.manifest.provenance.publish_every_steps)
    };
    let rewrite = Rewrite {
        from: &args.file,
        to: &args.output.out,
        every_steps: args.every_steps.map_or_else(published, Ok)?,
        force: args.output.force,
        json: args.output.json,
    };
    rewrite.run("expanded")
}

impl Rewrite<'_> {
    fn run(&self, done: &str) -> Result<Done, Failure> {
        let info = RecordingInfo::read(self.from).bad_input()?;
        let finished = self.write(&info)?;
        self.report(done, &info, &finished)?;
        Ok(Done::Whole)
    }

    fn write(&self, info: &RecordingInfo) -> Result<Finished, Failure> {
        check_place(self.to, self.from, self.force)?;
        let stop = signals::stop_flag()?;
        let manifest = self.manifest(&info.manifest)?;
        let options = WriteOptions { force: self.force, ..WriteOptions::default() };
        SpaceNeeded::new(&manifest, options.compression).check(self.to)?;
        let toml = info.run_toml.as_deref().unwrap_or_default();
        let source = Source::open(self.from, &stop)?;
        let mut states = Resimulation::new(source, Lend::Frames).bad_input()?;
        let mut writer = RecordingWriter::create(self.to, &manifest, toml, &options)?;
        let reason = match self.copy(&mut states, &mut writer, &manifest, info.last_step) {
            Ok(reason) if reason.is_orderly() => reason,
            Ok(reason) => {
                // a part under the whole one's name would be taken for it
                writer.discard();
                let message =
                    format!("{}: its states end early ({reason}); nothing was written", self.from.display());
                return Err(Failure::Failed(anyhow!(message)));
            }
            Err(failure) => {
                writer.discard();
                return Err(failure);
            }
        };
        Ok(writer.finish(reason)?)
    }

    /// The manifest of the new recording: the same run, recorded at other steps.
    fn manifest(&self, manifest: &RunManifest) -> Result<RunManifest, Failure> {
        let published = manifest.provenance.publish_every_steps;
        manifest.clone().recorded_every(self.every_steps).map_err(|_| {
            Failure::BadInput(anyhow!(
                "--every-steps {}: expected a multiple of {published}, the steps between two frames of this run",
                self.every_steps
            ))
        })
    }

    /// Copies the states that are due, and the last one; every state of the source is proven on the way.
    fn copy(
        &self,
        states: &mut Resimulation<Source>,
        writer: &mut RecordingWriter,
        manifest: &RunManifest,
        last_step: Option<u64>,
    ) -> Result<EndReason, Failure> {
        let bar = display::progress_bar(manifest.physics.step_count, manifest.provenance.name.as_str());
        let mut refreshed = Instant::now();
        let reason = loop {
            match states.receive().map_err(|error| Failure::Failed(error.into()))? {
                Received::Frame(frame) => {
                    // an interrupted run ends with a state that is not due by its step
                    if manifest.is_recorded(frame.step) || Some(frame.step) == last_step {
                        writer.accept(&frame)?;
                    }
                    if refreshed.elapsed() >= Duration::from_millis(100) {
                        refreshed = Instant::now();
                        bar.set_position(frame.step);
                    }
                }
                Received::Missed { from, to } => {
                    let message = format!("{}: the frames {from} to {to} are missing", self.from.display());
                    return Err(Failure::BadInput(anyhow!(message)));
                }
                Received::End(reason) => break reason,
            }
        };
        bar.finish_and_clear();
        Ok(reason)
    }

    fn report(&self, done: &str, info: &RecordingInfo, finished: &Finished) -> Result<(), Failure> {
        if self.json {
            return display::print_json(&json!({
                "path": finished.path,
                "states_before": info.frames(),
                "states": finished.frames,
                "bytes_before": info.file_bytes,
                "bytes": finished.bytes,
                "every_steps": self.every_steps,
            }));
        }
        let rows = [
            ("states", format!("{} of {}", count(finished.frames), count(info.frames()))),
            ("size", format!("{} from {}", bytes(finished.bytes), bytes(info.file_bytes))),
            ("proven", "every state follows from the one before".to_owned()),
        ];
        display::print(display::rows(
            &format!("{} {done}: {}", self.from.display(), finished.path.display()),
            &rows,
        ))
    }
}
