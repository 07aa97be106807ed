//! Resumes an interrupted run: writes its recording again up to where it ends.

use crate::display::{self, count};
use crate::failure::{BadInput, Failure};
use crate::frames::{Frames, is_of_a_file};
use crate::outputs::check_free;
use crate::progress::Progress;
use crate::publishing::Outlet;
use anyhow::anyhow;
use producer::resimulation::{Lend, check_kernel};
use producer::state::ChainState;
use recording::{
    InterruptedRecording, OtherChannels, RecordingInfo, RecordingSource, RecordingWriter, WriteOptions,
};
use schemas::frame::{EndReason, FrameSink, FrameSource, Received};
use source::Source;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most bead-steps before the last state that are computed again: some ten seconds.
const MOST_PROVEN: u64 = 1 << 34;

/// An interrupted run that can be gone on with.
pub(crate) struct Resumption {
    recording: InterruptedRecording,
}

/// A recording that is begun, with everything from the old one if there is one, and the state to go on from.
pub(crate) struct Begun {
    /// None if the run is not recorded.
    pub(crate) recorder: Option<RecordingWriter>,
    /// The last state that was recorded, if any.
    pub(crate) state: Option<ChainState>,
    /// The old recording, as long as the new one lacks one of its states.
    pub(crate) old: Option<InterruptedRecording>,
}

impl Resumption {
    /// Finds the recording `path` of a run that can be resumed, into `out` or in its place.
    pub(crate) fn find(path: &Path, out: Option<&Path>, force: bool) -> Result<Self, Failure> {
        let recording = InterruptedRecording::find(path, out, force).bad_input()?;
        if !recording.is_in_place() {
            check_free(recording.target(), force)?;
        }
        let info = recording.info();
        display::notice_of_version(&info.manifest);
        check_kernel(&info.manifest).bad_input()?;
        if let Some(what) = hindrance(info) {
            return Err(Failure::BadInput(anyhow!("{}: {what}", recording.path().display())));
        }
        Ok(Self { recording })
    }

    pub(crate) fn info(&self) -> &RecordingInfo {
        self.recording.info()
    }

    /// Gives the resumption back if steps are left to do. A complete recording may lack only its name, and gets it here.
    pub(crate) fn unless_complete(self) -> Result<Option<Self>, Failure> {
        if !(self.recording.is_in_place() && self.info().is_complete()) {
            return Ok(Some(self));
        }
        let steps = self.info().manifest.physics.step_count;
        let (path, steps) = (self.recording.give_name()?, count(steps));
        notice!("{} is complete: all {steps} steps are there, nothing is left to be done", path.display());
        Ok(None)
    }

    /// Path of the finished recording.
    pub(crate) fn target(&self) -> &Path {
        self.recording.target()
    }

    /// The first frame that is not recorded.
    pub(crate) fn first_frame(&self) -> u64 {
        let info = self.info();
        info.last_step.map_or(0, |step| info.manifest.frame_at(step) + 1)
    }

    /// Writes the recording again, answering the consumers of `publisher` meanwhile. None if `stop` was set; then, and
    /// after an error, the old one is as it was.
    pub(crate) fn rebuild(
        mut self,
        options: &WriteOptions,
        publisher: &mut Outlet,
        stop: &Arc<AtomicBool>,
    ) -> Result<Option<Begun>, Failure> {
        let manifest = self.info().manifest.clone();
        self.prove(publisher, stop)?;
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        self.recording.set_aside()?;
        let mut recorder = match self.recording.write_again(options) {
            Ok(recorder) => recorder,
            Err(error) => {
                put_back(self.recording);
                return Err(error.into());
            }
        };
        let copied = self.copy(&mut recorder, publisher, stop).and_then(|state| {
            recorder.sync()?;
            Ok(state)
        });
        let Ok(Copied::All(state)) = copied else {
            recorder.discard();
            put_back(self.recording);
            return copied.map(|_| None);
        };
        // the state of a run that was stopped between two that are due is recorded by nobody else so far
        let is_there = state.as_ref().is_none_or(|state| manifest.is_recorded(state.step));
        let old = if is_there { self.recording.remove().map(|()| None)? } else { Some(self.recording) };
        Ok(Some(Begun { recorder: Some(recorder), state, old }))
    }

    /// The failure for a damaged recording: the damage, and what to do.
    fn damaged(&self, what: &str) -> Failure {
        let path = self.recording.path().display();
        Failure::BadInput(anyhow!(
            "{what}; `beadline recover {path} --out OTHER.mcap` keeps what is whole, and that can be resumed"
        ))
    }

    /// Computes the run's last states again and compares bits, as far back as some seconds allow: everything that
    /// follows from a wrong state is wrong, and the old recording will be gone.
    fn prove(&self, publisher: &mut Outlet, stop: &Arc<AtomicBool>) -> Result<(), Failure> {
        let manifest = &self.info().manifest;
        let Some(last_step) = self.info().last_step else { return Ok(()) };
        let from = last_step.saturating_sub(MOST_PROVEN / manifest.physics.beads);
        let mut source = Source::recording(self.recording.path(), stop).bad_input()?;
        source.seek(&(from..=u64::MAX)).bad_input()?;
        let mut frames = Frames::recomputed(source, Lend::Frames, from == 0, from, None)?;
        let mut progress = Progress::new(last_step, "proving");
        loop {
            match frames.receive() {
                Ok(Received::Frame(frame)) => {
                    if progress.at(frame.step) {
                        publisher.serve();
                    }
                }
                // copying finds what is missing
                Ok(Received::Missed { .. } | Received::End(_)) => break,
                Err(error) if is_of_a_file(&error) => return Err(self.damaged(&error.to_string())),
                Err(error) => return Err(error.into()),
            }
        }
        progress.finish();
        if from > 0 {
            let from = count(from);
            display::notice(format_args!(
                "the states from step {from} on were recomputed and proven; `beadline verify` proves all of them"
            ));
        }
        Ok(())
    }

    /// Copies the states that are due, and the messages that belong to them.
    fn copy(
        &self,
        recorder: &mut RecordingWriter,
        publisher: &mut Outlet,
        stop: &AtomicBool,
    ) -> Result<Copied, Failure> {
        let path = self.recording.path();
        let damaged = |what: String| self.damaged(&what);
        let mut others = OtherChannels::open(path).bad_input()?;
        let mut states = RecordingSource::open(path).map_err(|error| damaged(error.to_string()))?;
        let manifest = states.manifest().clone();
        // of the last frame: states between frames were added by somebody else
        let last_step = self.info().last_step.map(|step| manifest.step_of_frame(manifest.frame_at(step)));
        let mut progress = Progress::new(last_step.unwrap_or(0), "copying");
        let mut last = None;
        loop {
            match states.receive().map_err(|error| damaged(error.to_string()))? {
                Received::Frame(frame) => {
                    others.copy_before(frame.time_s, recorder)?;
                    if manifest.is_recorded(frame.step) {
                        recorder.accept(&frame)?;
                    }
                    if Some(frame.step) == last_step {
                        last = Some(ChainState::of_frame(&frame));
                    }
                    if progress.at(frame.step) {
                        publisher.serve();
                    }
                    if stop.load(Ordering::Relaxed) {
                        return Ok(Copied::Stopped);
                    }
                }
                Received::Missed { from, to } => {
                    return Err(damaged(format!(
                        "{}: the frames {from} to {to} are missing",
                        path.display()
                    )));
                }
                Received::End(_) => break,
            }
        }
        others.copy_rest(recorder)?;
        progress.finish();
        if let (Some(step), None) = (last_step, &last) {
            return Err(damaged(format!("{}: its last state, of step {step}, is not there", path.display())));
        }
        Ok(Copied::All(last))
    }
}

/// Makes the old recording what it was, or says where it is.
fn put_back(recording: InterruptedRecording) {
    let path = recording.path().to_owned();
    if let Err(error) = recording.put_back() {
        display::notice(format_args!("{error}; the recording is still {}", path.display()));
    }
}

enum Copied {
    /// Everything, up to this state.
    All(Option<ChainState>),
    /// We were asked to stop.
    Stopped,
}

/// Reason why a recording cannot be resumed.
pub(crate) fn hindrance(info: &RecordingInfo) -> Option<String> {
    let no_states = info.frames() == 0;
    let first_step = info.first_step.unwrap_or(0);
    if let Some(damage) = &info.damage {
        let path = info.path.display();
        Some(format!(
            "{damage}; `beadline recover {path} --out OTHER.mcap` keeps what is whole, and that can be resumed"
        ))
    } else if no_states && (info.run_toml.is_none() || info.messages("/contacts") > 0) {
        Some("it holds no states of a run: only a recording of states can be resumed".to_owned())
    } else if info.begin.first_step > 0 || info.begin.part > 1 || first_step > 0 {
        let step = count(info.begin.first_step.max(first_step)).to_string();
        Some(format!("it begins with step {step}: only a recording from step 0 can be resumed"))
    } else if info.end.as_ref().is_some_and(|end| end.reason == EndReason::Continued) {
        Some("it goes on in its next part: only a recording in one part can be resumed".to_owned())
    } else if info.frames() > most_states(info) {
        let path = info.path.display().to_string();
        // what was not closed is not thinned
        let (first, path) = if info.end.is_none() {
            (format!("`beadline recover {path} --out WHOLE.mcap` and then "), "WHOLE.mcap".to_owned())
        } else {
            (String::new(), path)
        };
        Some(format!(
            "it holds states between frames, which nobody would write from here on; {first}`beadline thin {path} --every-steps {} \
             --out OTHER.mcap` makes one without",
            info.manifest.provenance.publish_every_steps
        ))
    } else {
        None
    }
}

/// States that the recording of a run has up to the last one of this file: those that are due, and that one.
fn most_states(info: &RecordingInfo) -> u64 {
    info.last_step.map_or(0, |step| step.div_ceil(info.manifest.provenance.record_every_steps) + 1)
}

/// Prints a notice about the place where a run goes on.
pub(crate) fn tell_begin(info: &RecordingInfo) {
    let manifest = &info.manifest;
    let step = info.last_step.map_or_else(
        || "from its beginning: no state was recorded".to_owned(),
        |step| format!("after step {} of {}", count(step), count(manifest.physics.step_count)),
    );
    display::notice(format_args!("{} goes on {step}", manifest.provenance.name));
}
