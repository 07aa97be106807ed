//! Publishes a recording again: the frames of a source go to a publisher like those of a run.

use crate::state::ChainState;
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received, Window};
use schemas::manifest::RunManifest;
use schemas::run_name::RunName;
use std::ops::ControlFlow;

/// A conductor acts before frames and between steps of a replay: pacing, pauses, progress, a request to stop.
pub trait Conductor<P: FrameSink> {
    /// Called before each frame is published; may take its time. `Break` ends the replay with the frame before.
    fn before_frame(&mut self, frame: &Frame<'_>, publisher: &mut P) -> ControlFlow<()>;

    /// Called after each step that is not published. `Break` ends the replay with the frame before.
    fn between_steps(&mut self, _publisher: &mut P) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// True if the publisher refused a frame because the replay is to end, which is no error.
    fn is_stop(&self, _error: &P::Error) -> bool {
        false
    }
}

/// The manifest under which a recording is published: the run's, so that consumers see no difference.
///
/// With `name`, the manifest carries that name. With `every_step` each step is a frame, and has its own number.
pub fn published_manifest(recorded: &RunManifest, name: Option<RunName>, every_step: bool) -> RunManifest {
    let mut manifest = recorded.clone();
    if let Some(name) = name {
        manifest.provenance.name = name;
    }
    if every_step {
        manifest.provenance.publish_every_steps = 1;
    }
    manifest
}

/// True if `published` has frames that a whole recording of `recorded` does not hold.
pub fn is_sparse(recorded: &RunManifest, published: &RunManifest) -> bool {
    recorded.provenance.record_every_steps > published.provenance.publish_every_steps
}

/// Why a replay cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum BeginError<E: std::error::Error + 'static> {
    /// The source failed before the first frame to be published.
    #[error(transparent)]
    Source(E),
    /// Nothing was recorded in the window.
    #[error("there is no frame {}", span(.0))]
    NoFrame(Window),
    /// The caller asked to stop.
    #[error("stopped before the first frame")]
    Stopped,
}

/// A window in words; an open window has no end.
fn span(window: &Window) -> String {
    let Window { from_s, until_s } = window;
    if until_s.is_finite() {
        format!("from {from_s} s to {until_s} s")
    } else {
        format!("from {from_s} s on")
    }
}

/// A frame that the publisher refused.
#[derive(Debug, thiserror::Error)]
#[error("frame {frame} could not be published")]
pub struct PublishFailed<E: std::error::Error + 'static> {
    /// The frame.
    pub frame: u64,
    /// The publisher's error.
    pub source: E,
}

/// Why a replay ended before its source did.
#[derive(Debug, thiserror::Error)]
pub enum Broken<E: std::error::Error + 'static> {
    /// The source failed.
    #[error(transparent)]
    Source(E),
    /// Frames are missing; consumers would count them as lost.
    #[error(
        "the frames {from} to {to} are not in the recording; `beadline expand` recomputes what is missing"
    )]
    Missing {
        /// The first missing frame.
        from: u64,
        /// The last missing frame.
        to: u64,
    },
}

/// Result of a replay.
#[derive(Debug)]
pub struct ReplayOutcome<E: std::error::Error + 'static> {
    /// The end for consumers: the end of the recording; [`EndReason::Interrupted`] when the window ended
    /// before it or the conductor ended the replay; [`EndReason::Failed`] when it broke off.
    pub reason: EndReason,
    /// True if the window ended before the recording.
    pub ended_as_asked: bool,
    /// The first frame of the window.
    pub first_frame: u64,
    /// Frames published.
    pub published_count: u64,
    /// Step of the last frame published.
    pub last_step: Option<u64>,
    /// Reason why the replay broke off.
    pub broken: Option<Broken<E>>,
}

/// A source that stands at the first frame to be published.
///
/// The source may lend steps between frames; the replay passes over them.
#[derive(Debug)]
pub struct Replay<S> {
    source: S,
    manifest: RunManifest,
    /// The last step that is published.
    until: u64,
    first: ChainState,
}

impl<S: FrameSource> Replay<S> {
    /// Reads up to the first frame of `window`. `manifest`, from [`published_manifest`], decides which steps are
    /// frames. Asks `go_on` after each state.
    ///
    /// # Errors
    /// When there is no such frame, the source fails before it, or `go_on` breaks.
    pub fn begin(
        mut source: S,
        manifest: RunManifest,
        window: Window,
        mut go_on: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Self, BeginError<S::Error>> {
        let steps = window.steps(&manifest);
        let first = loop {
            match source.receive().map_err(BeginError::Source)? {
                Received::Frame(frame) => {
                    if frame.step > *steps.end() {
                        return Err(BeginError::NoFrame(window));
                    }
                    if steps.contains(&frame.step) && manifest.is_frame(frame.step) {
                        break ChainState::of_frame(&frame);
                    }
                }
                // frames before the first one are like those before attaching
                Received::Missed { .. } => {}
                Received::End(EndReason::Stopped) => return Err(BeginError::Stopped),
                Received::End(_) => return Err(BeginError::NoFrame(window)),
            }
            if go_on().is_break() {
                return Err(BeginError::Stopped);
            }
        };
        Ok(Self { source, manifest, until: *steps.end(), first })
    }

    /// The manifest that is published.
    pub fn manifest(&self) -> &RunManifest {
        &self.manifest
    }

    /// True if the source must recompute frames that the recording does not hold.
    pub fn is_recomputed(&self) -> bool {
        is_sparse(self.source.manifest(), &self.manifest)
    }

    /// The first frame that will be published.
    pub fn first_frame(&self) -> u64 {
        self.manifest.frame_at(self.first.step)
    }

    /// Simulated time of that frame (s).
    pub fn first_time_s(&self) -> f64 {
        self.manifest.physics.time_s(self.first.step)
    }

    /// Publishes frame after frame. The publisher is not closed.
    ///
    /// # Errors
    /// When the publisher refuses a frame. If the source breaks off, the outcome says so.
    pub fn play<P: FrameSink>(
        mut self,
        publisher: &mut P,
        conductor: &mut impl Conductor<P>,
    ) -> Result<ReplayOutcome<S::Error>, PublishFailed<P::Error>> {
        let manifest = &self.manifest;
        let recorded = self.source.manifest().clone();
        let first_frame = manifest.frame_at(self.first.step);
        let first = self.first.as_frame(manifest, first_frame);
        let mut outcome = ReplayOutcome {
            reason: EndReason::Interrupted,
            ended_as_asked: false,
            first_frame,
            published_count: 0,
            last_step: None,
            broken: None,
        };
        if offer(&first, publisher, conductor, &mut outcome)?.is_break() {
            return Ok(outcome);
        }
        outcome.reason = loop {
            let frame = match self.source.receive() {
                Ok(Received::Frame(frame)) if frame.step > self.until => {
                    outcome.ended_as_asked = true;
                    break EndReason::Interrupted;
                }
                Ok(Received::Frame(frame)) => frame,
                Ok(Received::Missed { from, .. }) if recorded.step_of_frame(from) > self.until => {
                    outcome.ended_as_asked = true;
                    break EndReason::Interrupted;
                }
                Ok(Received::Missed { from, to }) => {
                    outcome.broken = Some(Broken::Missing { from, to });
                    break EndReason::Failed;
                }
                // a stop that comes with the last frame changes nothing
                Ok(Received::End(EndReason::Stopped))
                    if outcome.last_step == Some(manifest.physics.step_count) =>
                {
                    break EndReason::Complete;
                }
                Ok(Received::End(EndReason::Stopped)) => break EndReason::Interrupted,
                Ok(Received::End(reason)) => break reason,
                Err(error) => {
                    outcome.broken = Some(Broken::Source(error));
                    break EndReason::Failed;
                }
            };
            let next = if manifest.is_frame(frame.step) {
                let frame = Frame { frame: manifest.frame_at(frame.step), ..frame };
                offer(&frame, publisher, conductor, &mut outcome)?
            } else {
                conductor.between_steps(publisher)
            };
            if next.is_break() {
                break EndReason::Interrupted;
            }
        };
        Ok(outcome)
    }
}

/// Publishes one frame unless the replay is to end.
fn offer<P: FrameSink, E: std::error::Error>(
    frame: &Frame<'_>,
    publisher: &mut P,
    conductor: &mut impl Conductor<P>,
    outcome: &mut ReplayOutcome<E>,
) -> Result<ControlFlow<()>, PublishFailed<P::Error>> {
    if conductor.before_frame(frame, publisher).is_break() {
        return Ok(ControlFlow::Break(()));
    }
    match publisher.accept(frame) {
        Ok(()) => {}
        Err(error) if conductor.is_stop(&error) => return Ok(ControlFlow::Break(())),
        Err(source) => return Err(PublishFailed { frame: frame.frame, source }),
    }
    outcome.published_count += 1;
    outcome.last_step = Some(frame.step);
    Ok(ControlFlow::Continue(()))
}

#[cfg(test)]
mod tests;
