//! `beadline thin` and `beadline expand`: fewer or more of a run's states in a recording, none of them lost.

use crate::args::{ExpandArgs, RewriteArgs, ThinArgs};
use crate::display::{self, bytes, count};
use crate::failure::{BadInput, Done, Failure};
use crate::frames::Frames;
use crate::outputs::check_place;
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use anyhow::anyhow;
use producer::resimulation::{Lend, check_kernel};
use recording::{
    Compression, Finished, OtherChannels, RecordingInfo, RecordingWriter, SpaceNeeded, WriteOptions,
};
use schemas::frame::{EndReason, FrameSink, FrameSource, Received};
use schemas::manifest::RunManifest;
use serde_json::json;
use source::Source;
use std::num::NonZero;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A recording to be written again with other states.
struct Rewrite<'a> {
    from: &'a Path,
    to: &'a Path,
    every_steps: u64,
    /// Also steps between frames.
    between_frames: bool,
    jobs: Option<NonZero<usize>>,
    force: bool,
    json: bool,
    place: Place,
    /// Words behind the bar.
    told: &'a str,
}

/// Destination of the new recording.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    File,
    /// In a page: without other channels, and without compression, which browsers do not know. States that the recording
    /// holds are kept as they are: the page proves them where somebody asks for it.
    Page,
}

impl<'a> Rewrite<'a> {
    /// A job that keeps every `every_steps`-th state.
    fn new(from: &'a Path, to: &'a Path, every_steps: u64) -> Self {
        Self {
            from,
            to,
            every_steps,
            between_frames: false,
            jobs: None,
            force: false,
            json: false,
            place: Place::File,
            told: "",
        }
    }

    /// The same as the user asks for it.
    fn asked(from: &'a Path, output: &'a RewriteArgs, every_steps: u64) -> Self {
        let RewriteArgs { ref out, jobs, force, json } = *output;
        Self { jobs, force, json, ..Self::new(from, out, every_steps) }
    }
}

/// Keeps every K-th state.
pub(crate) fn thin(args: &ThinArgs) -> Result<Done, Failure> {
    Rewrite::asked(&args.file, &args.output, args.every_steps).run("thinned")
}

/// Keeps every `every_steps`-th state of the recording `from` in `to`, silently.
pub(crate) fn thin_quietly(
    from: &Path,
    to: &Path,
    every_steps: u64,
    force: bool,
) -> Result<Finished, Failure> {
    let rewrite = Rewrite { force, ..Rewrite::new(from, to, every_steps) };
    rewrite.write(&RecordingInfo::read(from)?, &signals::stop_flag()?)
}

/// The same of the recording `info`, for a page; states between those that it holds are recomputed.
pub(crate) fn thin_for_page(
    info: &RecordingInfo,
    to: &Path,
    every_steps: u64,
    told: &str,
    stop: &Arc<AtomicBool>,
) -> Result<Finished, Failure> {
    Rewrite { place: Place::Page, told, ..Rewrite::new(&info.path, to, every_steps) }.write(info, stop)
}

/// Recomputes the states in between.
pub(crate) fn expand(args: &ExpandArgs) -> Result<Done, Failure> {
    let published = || {
        let info = RecordingInfo::read(&args.file).bad_input()?;
        Ok::<_, Failure>(info.manifest.provenance.publish_every_steps)
    };
    let every_steps = args.every_steps.map_or_else(published, Ok)?;
    let rewrite = Rewrite::asked(&args.file, &args.output, every_steps);
    Rewrite { between_frames: true, ..rewrite }.run("expanded")
}

impl Rewrite<'_> {
    fn run(&self, done: &str) -> Result<Done, Failure> {
        let info = RecordingInfo::read(self.from).bad_input()?;
        display::notice_of_version(&info.manifest);
        let finished = self.write(&info, &signals::stop_flag()?)?;
        self.report(done, &info, &finished)?;
        Ok(Done::Whole)
    }

    fn write(&self, info: &RecordingInfo, stop: &Arc<AtomicBool>) -> Result<Finished, Failure> {
        check_place(self.to, Some(self.from), self.force)?;
        let Some(end) = info.end.as_ref().filter(|_| info.finished) else {
            return Err(self.unfinished(info));
        };
        let manifest = self.manifest(&info.manifest)?;
        let mut options = WriteOptions { force: self.force, ..WriteOptions::default() };
        if self.place == Place::Page {
            options.compression = Compression::None;
        }
        SpaceNeeded::new(&manifest, options.compression).check(self.to)?;
        let source = Source::all_states(self.from, stop).bad_input()?;
        // a recovered one may begin or end between frames
        let is_of_frames =
            [info.first_step, info.last_step].into_iter().flatten().all(|step| manifest.is_frame(step));
        let is_between = self.is_between_frames(&manifest) || !is_of_frames;
        let lend = if is_between { Lend::Steps } else { Lend::Frames };
        let holds = self.every_steps.is_multiple_of(info.manifest.provenance.record_every_steps);
        let mut states = if self.place == Place::Page && (holds || check_kernel(&manifest).is_err()) {
            Frames::as_they_come(source)
        } else {
            Frames::recomputed(source, lend, false, 0, self.jobs)?
        };
        let toml = info.run_toml.as_deref();
        let mut writer = RecordingWriter::create_from(self.to, &manifest, toml, &info.begin, &options)?;
        let copied = self.copy(&mut states, &mut writer, &manifest, info.last_step);
        let is_less = self.between_frames && writer.frames() < info.frames();
        let failure = match copied {
            Ok(reason) if reason == end.reason && !is_less => return Ok(writer.finish(reason)?),
            Ok(reason) if reason == end.reason => bad_input!(
                "--every-steps {}: only {} of the {} states of the recording would be kept; --every-steps 1 keeps all, \
                 `beadline thin` makes fewer",
                self.every_steps,
                count(writer.frames()),
                count(info.frames())
            ),
            Ok(_) if stop.load(Ordering::Relaxed) => Failure::stopped(),
            Ok(reason) => Failure::Failed(anyhow!(
                "{}: its states end early ({reason}); nothing was written",
                self.from.display()
            )),
            Err(failure) => failure,
        };
        // a part under the whole one's name would be taken for it
        writer.discard();
        Err(failure)
    }

    /// The failure for a recording that was not closed.
    fn unfinished(&self, info: &RecordingInfo) -> Failure {
        let from = self.from.display();
        let why = info.damage.as_ref().map_or_else(String::new, |damage| format!(" ({damage})"));
        let advice = format!("`beadline recover {from} --out FILE.mcap` makes one of it that was");
        bad_input!("{from} was not closed, or is damaged{why}: {advice}")
    }

    /// The manifest of the new recording: the same run, recorded at other steps. Between frames nothing is due by
    /// the manifest; the frames are.
    fn manifest(&self, manifest: &RunManifest) -> Result<RunManifest, Failure> {
        let provenance = &manifest.provenance;
        let (published, before) = (provenance.publish_every_steps, provenance.record_every_steps);
        if self.between_frames && !before.is_multiple_of(self.every_steps) {
            return Err(bad_input!(
                "--every-steps {}: expected a divisor of {before}, the steps between two states of this recording, which keeps \
                 them all; `beadline thin` makes fewer",
                self.every_steps
            ));
        }
        let recorded = if self.is_between_frames(manifest) { published } else { self.every_steps };
        manifest.clone().recorded_every(recorded).map_err(|_| {
            let or = if self.between_frames { "a divisor or " } else { "" };
            let steps = self.every_steps;
            bad_input!(
                "--every-steps {steps}: expected {or}a multiple of {published}, the steps between two frames of this run"
            )
        })
    }

    /// True if states between frames are asked for: several from one frame to the next.
    fn is_between_frames(&self, manifest: &RunManifest) -> bool {
        let published = manifest.provenance.publish_every_steps;
        self.between_frames && self.every_steps < published && published.is_multiple_of(self.every_steps)
    }

    /// Copies the states that are due, and the last one, and between them the other contents of the file; every state
    /// of the source is proven on the way.
    fn copy(
        &self,
        states: &mut Frames,
        writer: &mut RecordingWriter,
        manifest: &RunManifest,
        last_step: Option<u64>,
    ) -> Result<EndReason, Failure> {
        let mut progress = Progress::of_run(manifest);
        progress.tell(&[self.told]);
        let mut others = (self.place == Place::File).then(|| OtherChannels::open(self.from)).transpose()?;
        let reason = loop {
            match states.receive().bad_input()? {
                Received::Frame(frame) => {
                    let step = frame.step;
                    if let Some(others) = &mut others {
                        others.copy_before(frame.time_s, writer)?;
                    }
                    // a recording need not begin, nor end, with a state that is due by its step
                    let is_first = writer.frames() == 0;
                    let is_due = step.is_multiple_of(self.every_steps) || step == manifest.physics.step_count;
                    if is_due || is_first || Some(step) == last_step {
                        writer.accept(&frame)?;
                    }
                    progress.at(step);
                }
                Received::Missed { from, to } => {
                    return Err(bad_input!("{}: the frames {from} to {to} are missing", self.from.display()));
                }
                Received::End(reason) => break reason,
            }
        };
        progress.finish();
        if let (Some(mut others), true) = (others, reason != EndReason::Stopped) {
            others.copy_rest(writer)?;
        }
        Ok(reason)
    }

    fn report(&self, done: &str, info: &RecordingInfo, finished: &Finished) -> Result<(), anyhow::Error> {
        let rewritten = json!({
            "path": finished.path.to_string_lossy(),
            "states_before": info.frames(),
            "states": finished.frames,
            "bytes_before": info.file_bytes,
            "bytes": finished.bytes,
            "every_steps": self.every_steps,
        });
        report(self.json, &rewritten, || {
            let mut rows = Rows::default();
            rows.add("states", format_args!("{} from {}", count(finished.frames), count(info.frames())));
            rows.add("size", format_args!("{} from {}", bytes(finished.bytes), bytes(info.file_bytes)));
            rows.add("proven", "every state follows from the one before");
            rows.under(format_args!("{} {done}: {}", self.from.display(), finished.path.display()))
        })
    }
}
