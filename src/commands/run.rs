//! `beadline run`: simulate, publish, record.

use crate::args::{Pace, RunArgs};
use crate::configuration::{Configured, configure};
use crate::display::{self, bytes, count, counted, duration, seconds};
use crate::failure::{Done, Failure};
use crate::forecast::Forecast;
use crate::outputs::check_free;
use crate::pace::{LONGEST_NAP, Pacer};
use crate::publishing::{self, Dropped};
use crate::resumption::{self, Resumption};
use crate::signals;
use anyhow::anyhow;
use indicatif::ProgressBar;
use producer::run::{Conductor, RunError, RunOutcome};
use schemas::bus::{PublishCounts, PublishError, PublishOptions, StatePublisher};
use schemas::frame::{EndReason, Frame};
use schemas::manifest::{Physics, RunManifest};
use schemas::recording::{Finished, RecordingWriter, SpaceNeeded, WriteError, WriteOptions};
use schemas::summary::Drift;
use serde_json::json;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// How often a person needs to see progress.
const REFRESH: Duration = Duration::from_millis(100);

/// A relative drift of the energy that a user should hear of.
const LARGE_DRIFT: f64 = 1e-4;

/// The same with damping, of which the default step promises 1e-3.
const LARGE_DAMPED_DRIFT: f64 = 2e-3;

/// A run may add up so many roundings, most of which cancel.
const MANY_ROUNDINGS: f64 = 30.0;

/// Durations that differ by less, relative, differ by rounding.
const NEARLY: f64 = 1e-12;

pub(crate) fn run(args: &RunArgs) -> Result<Done, Failure> {
    let resumption = match &args.resume {
        Some(path) => match Resumption::find(path, args.out.as_deref(), args.force)?.unless_complete()? {
            None => return Ok(Done::Whole),
            left => left,
        },
        None => None,
    };
    let (configured, out) = match &resumption {
        Some(found) => (Configured::recorded(found.info()), Some(found.target().to_owned())),
        None => new_run(args)?,
    };
    let manifest = &configured.manifest;
    let options = WriteOptions {
        force: args.force,
        flush_period: Duration::from_secs_f64(args.flush_period),
        sync_period: Duration::from_secs_f64(args.sync_period),
        ..WriteOptions::default()
    };
    if let Some(path) = out.as_ref().filter(|path| path.extension().is_none_or(|end| end != "mcap")) {
        let message = format!("{}: a recording is written as .mcap", path.display());
        return Err(Failure::BadInput(anyhow!(message)));
    }
    match (&resumption, &out) {
        (Some(found), _) => resumption::tell_begin(manifest, found.info()),
        (None, Some(path)) => check_free(path, args.force)?,
        (None, None) => {}
    }
    let disk = announce(&configured, out.as_ref(), &options)?;
    let first_step = resumption.as_ref().map_or(0, |found| manifest.step_of_frame(found.first_frame()));
    Forecast::of_run(manifest, first_step, args.pace, disk).confirm(args.yes)?;

    let stop = signals::stop_flag()?;
    let publish = PublishOptions {
        first_frame: resumption.as_ref().map_or(0, Resumption::first_frame),
        stuck_after: Duration::from_secs_f64(args.stall_timeout),
        stop: Arc::clone(&stop),
        ..PublishOptions::default()
    };
    let mut publisher = publishing::open(manifest, &publish, args.wait_for)?;
    let mut recorder = match &out {
        Some(path) if resumption.is_none() => {
            Some(RecordingWriter::create(path, manifest, &configured.toml, &options)?)
        }
        _ => None,
    };
    let mut stopped = !publishing::wait_for_consumers(args.wait_for, &mut publisher, &stop)?;
    let (mut state, mut old) = (None, None);
    if let Some(found) = resumption.filter(|_| !stopped) {
        match found.rebuild(&options, &mut publisher, &stop)? {
            Some(rebuilt) => (recorder, state, old) = (Some(rebuilt.recorder), rebuilt.state, rebuilt.old),
            None => stopped = true,
        }
    }
    if stopped {
        publisher.finish(EndReason::Interrupted)?;
        if let Some(recorder) = recorder {
            recorder.discard();
        }
        display::notice("stopped before the run began; nothing was recorded");
        return Ok(Done::Whole);
    }

    let mut watch = Watch::new(&configured, args.pace, state.as_ref().map_or(0, |state| state.step), stop);
    let result = match state {
        Some(state) => producer::run::resume(manifest, state, &mut publisher, recorder.as_mut(), &mut watch),
        None => producer::run::run(manifest, &mut publisher, recorder.as_mut(), &mut watch),
    };
    watch.bar.finish_and_clear();
    watch.dropped.tell(&mut publisher, &watch.bar);
    let reason = result.as_ref().map_or(EndReason::Failed, |outcome| outcome.reason);
    // in this order, so that whoever hears of the end finds the recording; neither is left out when the
    // other fails
    let recording = recorder.map(|recorder| recorder.finish(reason)).transpose();
    let counts = publisher.finish(reason);
    if let (Some(path), true) = (&out, failed_to_record(&result, &recording)) {
        let path = path.display();
        display::notice(format_args!(
            "what was recorded before stays in {path}.partial, which every analysis reads; when there is room, \
             `beadline run --resume {path}.partial` goes on, with --out in another place"
        ));
    }
    let (outcome, recording, counts) = (result?, recording?, counts?);
    if let Some(old) = old {
        // it had the state that the run was gone on from
        old.remove()?;
    }
    let Watch { start, first_step, dropped, .. } = watch;
    let summary =
        Summary { manifest, outcome, first_step, counts, dropped, recording, wall: start.elapsed() };
    display::print(if args.json { summary.json()? } else { summary.text() })?;
    if let (EndReason::Interrupted, Some(recording)) = (reason, &summary.recording) {
        let path = recording.path.display();
        display::notice(format_args!("`beadline run --resume {path}` goes on with it"));
    }
    tell_drift(&manifest.physics, outcome.relative_drift);
    Ok(Done::whole_if(counts.evicted == 0))
}

/// Says so if the energy has drifted far, and why: rounding, or the time step.
fn tell_drift(physics: &Physics, drift: f64) {
    let large = if physics.damping.is_some() { LARGE_DAMPED_DRIFT } else { LARGE_DRIFT };
    if drift.abs() <= large {
        return;
    }
    let rounding = Drift::new(physics, &physics.chain()).rounding();
    if drift.abs() <= MANY_ROUNDINGS * rounding {
        display::notice(format_args!(
            "the energy drifted by {drift:.1e}, from rounding: beside the load, or beside a heavy striker, so little moves that \
             one rounding makes {rounding:.1e}; a shorter --dt does not help, a faster striker does"
        ));
    } else {
        display::notice(format_args!(
            "the energy drifted by {drift:.1e}: dt = {:e} s is too long for this chain; pass a shorter --dt",
            physics.dt_s
        ));
    }
}

/// A run that begins: what it is, and where it is recorded.
fn new_run(args: &RunArgs) -> Result<(Configured, Option<PathBuf>), Failure> {
    let configured = configure(args)?;
    let name = &configured.manifest.provenance.name;
    let out = || args.out.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.mcap")));
    let out = (!args.no_record).then(out);
    Ok((configured, out))
}

/// Whether a recording was begun that could not be written to its end.
fn failed_to_record<P: std::error::Error, T>(
    result: &Result<RunOutcome, RunError<P, WriteError>>,
    recording: &Result<T, WriteError>,
) -> bool {
    let lost = |error: &WriteError| matches!(error, WriteError::Io { .. } | WriteError::Lost { .. });
    matches!(result, Err(RunError::Record { .. })) || recording.as_ref().is_err_and(lost)
}

/// Says what the run will write, and refuses what cannot fit; the part of the free disk that it needs at least.
fn announce(configured: &Configured, out: Option<&PathBuf>, options: &WriteOptions) -> Result<f64, Failure> {
    let manifest = &configured.manifest;
    let frame_bytes = 8 * manifest.frame_doubles() as u64;
    let frames = format!(
        "{}: {} of {}, {} of {}",
        manifest.provenance.name,
        counted(manifest.physics.step_count, "step"),
        seconds(manifest.physics.dt_s),
        counted(manifest.frame_count(), "frame"),
        bytes(frame_bytes),
    );
    let Some(path) = out else {
        display::notice(format_args!("{frames}; no recording"));
        tell_end(configured);
        return Ok(0.0);
    };
    let needed = SpaceNeeded::new(manifest, options.compression);
    let free = needed.check(path)?;
    display::notice(format_args!(
        "{frames}; {} recorded in {}: {} to {}, {} free",
        count(manifest.recorded_count()),
        path.display(),
        bytes(needed.at_least_bytes),
        bytes(needed.at_most_bytes),
        bytes(free),
    ));
    tell_end(configured);
    Ok(needed.at_least_bytes as f64 / free.max(1) as f64)
}

/// Says so if a step that was asked for does not divide the duration.
fn tell_end(configured: &Configured) {
    let physics = &configured.manifest.physics;
    let (asked_s, end_s) = (configured.duration_s, physics.time_s(physics.step_count));
    if (end_s - asked_s).abs() > NEARLY * asked_s {
        display::notice(format_args!(
            "the last of these steps ends at {end_s:e} s, not at {asked_s:e} s; a step that is left to Beadline divides the \
             duration"
        ));
    }
}

/// Progress, pacing and the request to stop.
struct Watch {
    bar: ProgressBar,
    pacer: Pacer,
    stop: Arc<AtomicBool>,
    start: Instant,
    refreshed: Instant,
    /// Steps between two looks at the clock: about a tenth of a millisecond of work.
    clock_every: u64,
    /// Steps since the last look at the clock.
    unclocked: u64,
    /// The step that this begins with.
    first_step: u64,
    dropped: Dropped,
}

impl Watch {
    fn new(configured: &Configured, pace: Pace, first_step: u64, stop: Arc<AtomicBool>) -> Self {
        let physics = &configured.manifest.physics;
        let now = Instant::now();
        Self {
            bar: display::progress_bar(physics.step_count, configured.manifest.provenance.name.as_str()),
            pacer: Pacer::new(pace, physics.time_s(first_step)),
            stop,
            start: now,
            refreshed: now,
            clock_every: (100_000 / physics.beads).max(1),
            unclocked: 0,
            first_step,
            dropped: Dropped::default(),
        }
    }

    fn refresh(
        &mut self,
        frame: &Frame<'_>,
        publisher: &mut StatePublisher,
        recorder: Option<&mut RecordingWriter>,
    ) {
        self.dropped.tell(publisher, &self.bar);
        let counts = publisher.counts();
        let rate = (frame.step - self.first_step) as f64 / self.start.elapsed().as_secs_f64();
        let recorded = recorder.map_or(String::new(), |r| format!(" · {}", bytes(r.bytes_written())));
        self.bar.set_position(frame.step);
        self.bar.set_message(format!(
            "step {} · t = {} · {:.0} k steps/s · {} lossless, {} latest{recorded}",
            count(frame.step),
            seconds(frame.time_s),
            rate / 1e3,
            counts.lossless,
            counts.latest,
        ));
    }

    /// Whether it is time to show progress.
    fn is_due(&mut self) -> bool {
        self.unclocked += 1;
        if self.unclocked < self.clock_every {
            return false;
        }
        self.unclocked = 0;
        let due = self.refreshed.elapsed() >= REFRESH;
        if due {
            self.refreshed = Instant::now();
        }
        due
    }

    fn go_on(&self) -> ControlFlow<()> {
        if self.stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Waits until the wall clock has caught up with the simulated time.
    fn keep_pace(&self, frame: &Frame<'_>, publisher: &mut StatePublisher) {
        while let Some(ahead) = self.pacer.ahead(frame.time_s)
            && !self.stop.load(Ordering::Relaxed)
        {
            // a consumer that cannot be answered now is answered at the next frame
            let _ = publisher.serve();
            thread::sleep(ahead.min(LONGEST_NAP));
        }
    }
}

impl Conductor<StatePublisher, RecordingWriter> for Watch {
    fn after_frame(
        &mut self,
        frame: &Frame<'_>,
        publisher: &mut StatePublisher,
        recorder: Option<&mut RecordingWriter>,
    ) -> ControlFlow<()> {
        self.keep_pace(frame, publisher);
        if self.is_due() {
            self.refresh(frame, publisher, recorder);
        }
        self.go_on()
    }

    fn between_steps(&mut self, publisher: &mut StatePublisher) -> ControlFlow<()> {
        if self.is_due() {
            // a consumer that cannot be answered now is answered at the next frame
            let _ = publisher.serve();
        }
        self.go_on()
    }

    fn is_stop(&self, error: &PublishError) -> bool {
        matches!(error, PublishError::Stopped { .. })
    }
}

/// What a run leaves behind, in numbers.
struct Summary<'a> {
    manifest: &'a RunManifest,
    outcome: RunOutcome,
    /// The step that this begins with.
    first_step: u64,
    counts: PublishCounts,
    dropped: Dropped,
    recording: Option<Finished>,
    wall: Duration,
}

impl Summary<'_> {
    /// Frames in the recording, also those from before the run was interrupted.
    fn recorded_count(&self) -> u64 {
        self.recording.as_ref().map_or(0, |recording| recording.frames)
    }

    fn text(&self) -> String {
        let outcome = &self.outcome;
        let steps_per_s = (outcome.last_step - self.first_step) as f64 / self.wall.as_secs_f64();
        let mut rows = vec![
            ("steps", format!("{} of {}", count(outcome.last_step), count(self.manifest.physics.step_count))),
            ("frames published", count(outcome.published_count).to_string()),
            ("frames recorded", count(self.recorded_count()).to_string()),
            ("energy drift ΔE/E", format!("{:.2e}", outcome.relative_drift)),
            ("wall time", format!("{} ({:.0} k steps/s)", duration(self.wall), steps_per_s / 1e3)),
            ("held back by consumers", duration(self.counts.held_back)),
        ];
        if self.counts.evicted > 0 {
            rows.push((
                "consumers dropped",
                format!("{} that took nothing for too long", self.counts.evicted),
            ));
        }
        if let Some(recording) = &self.recording {
            let ratio = recording.uncompressed_bytes as f64 / recording.bytes as f64;
            let size = format!("{}, {} ({ratio:.2} : 1)", recording.path.display(), bytes(recording.bytes));
            rows.push(("held back by the disk", duration(recording.held_back)));
            rows.push(("recording", size));
        }
        display::rows(&format!("{} {}", self.manifest.provenance.name, outcome.reason), &rows)
    }

    fn json(&self) -> Result<String, serde_json::Error> {
        let (provenance, outcome) = (&self.manifest.provenance, &self.outcome);
        let recording = self.recording.as_ref().map(|recording| {
            json!({
                "path": recording.path,
                "bytes": recording.bytes,
                "uncompressed_bytes": recording.uncompressed_bytes,
                "held_back_s": recording.held_back.as_secs_f64(),
            })
        });
        let summary = json!({
            "run": provenance.name,
            "run_id": provenance.run_id,
            "end": outcome.reason.as_str(),
            "first_step": self.first_step,
            "steps": outcome.last_step,
            "frames_published": outcome.published_count,
            "frames_recorded": self.recorded_count(),
            "relative_drift": outcome.relative_drift,
            "wall_s": self.wall.as_secs_f64(),
            "held_back_s": self.counts.held_back.as_secs_f64(),
            "consumers_dropped": self.dropped.names,
            "recording": recording,
        });
        Ok(format!("{}\n", serde_json::to_string_pretty(&summary)?))
    }
}
