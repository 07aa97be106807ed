//! `beadline replay FILE`: publish a recording again.

mod seek;
mod summary;

use crate::args::{Pace, ReplayArgs};
use crate::display::{self, count, seconds};
use crate::failure::{BadInput, Done, Failure};
use crate::frames::{Frames, FramesError};
use crate::keyboard::Keyboard;
use crate::publishing::{self, Outlet};
use crate::stage::{Begin, Stage};
use anyhow::Context as _;
use bus::PublishError;
use producer::replay::{BeginError, Conductor, Replay, ReplayOutcome, is_sparse, published_manifest};
use producer::resimulation::{Lend, check_kernel};
use recording::RecordingInfo;
use schemas::frame::{EndReason, Frame, FrameSource, Window};
use source::Source;
use std::num::NonZero;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use summary::Summary;

pub(crate) fn replay(args: &ReplayArgs) -> Result<Done, Failure> {
    let whole = window(args)?;
    let (keyboard, stop) = Keyboard::open()?;
    let mut summary = Summary::new(args);
    let mut window = whole;
    loop {
        let Some(replay) = begin(args, window, &stop)? else { break };
        if summary.streams == 0 {
            summary.name(replay.manifest());
        }
        let manifest = replay.manifest().clone();
        let first_step = manifest.step_of_frame(replay.first_frame());
        let Some(outcome) = publish(args, replay, keyboard.as_ref(), &stop, &mut summary)? else { break };
        let (broken, step) = (outcome.broken.is_some(), outcome.last_step.unwrap_or(first_step));
        summary.add(outcome);
        if broken || stop.load(Ordering::Relaxed) {
            break;
        }
        window = match (summary.seeks.as_slice(), args.again) {
            ([], false) => break,
            ([], true) => whole,
            (seeks, _) => Window { from_s: seek::target_s(args, &manifest, whole, step, seeks)?, ..whole },
        };
    }
    // from here on the terminal shows messages and typed keys again
    drop(keyboard);
    summary.report(args, stop.load(Ordering::Relaxed))
}

/// The part to publish.
fn window(args: &ReplayArgs) -> Result<Window, Failure> {
    let window = Window { from_s: args.from, until_s: args.until.unwrap_or(f64::INFINITY) };
    if window.from_s > window.until_s {
        return Err(bad_input!("--from {} is after --until {}", window.from_s, window.until_s));
    }
    Ok(window)
}

/// The recording at the first frame to publish; none if stopped before.
fn begin(
    args: &ReplayArgs,
    window: Window,
    stop: &Arc<AtomicBool>,
) -> Result<Option<Replay<Frames>>, Failure> {
    let mut source = Source::recording(&args.file, stop).bad_input()?;
    let manifest = published_manifest(source.manifest(), args.name.clone(), args.every_step);
    let first_step = manifest.physics.step_at_or_after(window.from_s);
    // its end is that of a stream, and not an interruption
    source.seek(&(first_step..=u64::MAX)).bad_input()?;
    let frames = if is_sparse(source.manifest(), &manifest) {
        let context = || format!("{} does not hold every frame to be published", args.file.display());
        check_kernel(&manifest).with_context(context).bad_input()?;
        // each step, so that there is something to do between frames; by this thread, because others would
        // compute ahead, and hold more in memory than a chunk
        Frames::recomputed(source, Lend::Steps, false, first_step, Some(NonZero::<usize>::MIN))?
    } else {
        Frames::as_they_come(source)
    };
    let go_on =
        || if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    match Replay::begin(frames, manifest, window, go_on) {
        Ok(replay) => Ok(Some(replay)),
        Err(BeginError::Stopped) => Ok(None),
        Err(error @ BeginError::NoFrame(_)) => {
            let range = RecordingInfo::read(&args.file).bad_input()?.time_range_s();
            let range = range.map_or("nothing".to_owned(), |(first_s, last_s)| {
                format!("{} s to {} s", display::number(first_s), display::number(last_s))
            });
            Err(bad_input!("{}: {error}; recorded is {range}", args.file.display()))
        }
        Err(error) => Err(error).bad_input(),
    }
}

/// Announces the replay.
fn announce(args: &ReplayArgs, replay: &Replay<Frames>) {
    let manifest = replay.manifest();
    display::notice_of_version(manifest);
    let from = match replay.first_frame() {
        0 => String::new(),
        frame => format!(" from frame {} ({})", count(frame), seconds(replay.first_time_s())),
    };
    let recomputed =
        if replay.is_recomputed() { "; frames that it does not hold are recomputed" } else { "" };
    let (file, name) = (args.file.display(), &manifest.provenance.name);
    notice!("{file} is published as {name}{from}{recomputed}");
}

/// Publishes it once, as a stream of its own; none if we were stopped before the first frame.
fn publish(
    args: &ReplayArgs,
    replay: Replay<Frames>,
    keyboard: Option<&Keyboard>,
    stop: &Arc<AtomicBool>,
    summary: &mut Summary,
) -> Result<Option<ReplayOutcome<FramesError>>, Failure> {
    let wait_for = if summary.seeks.is_empty() {
        args.wait_for.unwrap_or(usize::from(args.rate == Pace::Max))
    } else {
        // consumers have left with the stream before, and the person at the keys is still there
        0
    };
    let first_frame = replay.first_frame();
    let mut publisher = publishing::open(replay.manifest(), first_frame, args.stall_timeout, wait_for, stop)?;
    if summary.streams == 0 {
        announce(args, &replay);
    }
    if wait_for > 0 && args.wait_for.is_none() && summary.streams == 0 {
        let name = &replay.manifest().provenance.name;
        notice!(
            "start an analysis, such as `beadline energies live:{name}`; `--wait-for 0` does not wait for one"
        );
    }
    if !publishing::wait_for_consumers(wait_for, &mut publisher, stop)? {
        publisher.finish(EndReason::Interrupted)?;
        return Ok(None);
    }
    let manifest = replay.manifest().clone();
    let begin = Begin {
        pace: summary.pace,
        is_paused: summary.is_paused,
        step: manifest.step_of_frame(first_frame),
        can_seek: true,
    };
    let mut stage = Stage::new(&manifest, begin, keyboard, Arc::clone(stop));
    stage.note = summary.number();
    let mut publisher = Outlet(Some(publisher));
    let played = replay.play(&mut publisher, &mut stage);
    let reason = played.as_ref().map_or(EndReason::Failed, |outcome| outcome.reason);
    summary.take(stage.leave(&mut publisher));
    let counts = if args.again || !summary.seeks.is_empty() {
        // the next stream must not take the name from those that still read this one
        publisher.finish_and_wait(reason, stop, Duration::from_secs_f64(args.stall_timeout))
    } else {
        publisher.finish(reason)
    };
    let outcome = played?;
    summary.count(&counts?);
    Ok(Some(outcome))
}

impl Conductor<Outlet> for Stage<'_> {
    fn before_frame(&mut self, frame: &Frame<'_>, publisher: &mut Outlet) -> ControlFlow<()> {
        let go_on = self.hold(frame.time_s, publisher);
        if go_on.is_continue() {
            self.published(frame);
            if self.is_due() {
                self.show(publisher);
            }
        }
        go_on
    }

    fn between_steps(&mut self, publisher: &mut Outlet) -> ControlFlow<()> {
        Stage::between_steps(self, publisher)
    }

    fn is_stop(&self, error: &PublishError) -> bool {
        matches!(error, PublishError::Stopped { .. })
    }
}
