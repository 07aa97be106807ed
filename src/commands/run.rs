//! `beadline run`: simulate, publish, record.

use crate::args::RunArgs;
use crate::commands::info::of_physics;
use crate::configuration::{Asked, Configured, configure};
use crate::determining::{self, Beside};
use crate::display::{self, bytes, count, counted, duration, seconds};
use crate::failure::{Done, Failure};
use crate::forecast::Forecast;
use crate::keyboard::Keyboard;
use crate::outputs::{check_free, check_place};
use crate::publishing::{self, Outlet};
use crate::report::{Rows, report};
use crate::resumption::{self, Begun, Resumption};
use crate::signals;
use crate::stage::{Begin, Left, Stage};
use crate::uploading::{Spool, Uploaded};
use bus::{PublishCounts, PublishError};
use consumers::determination::Outcome as Determined;
use consumers::determination::verdict;
use producer::growth::Lost;
use producer::run::{Conductor, RunError, RunOutcome};
use recording::{Finished, RecordingWriter, SpaceNeeded, WriteError, WriteOptions};
use schemas::frame::{EndReason, Frame};
use schemas::manifest::{Limit, Physics, RunManifest};
use schemas::summary::Drift;
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::slice;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Relative energy drift above which the user is told.
const LARGE_DRIFT: f64 = 1e-4;

/// The same with damping, for which the default step promises 1e-3.
const LARGE_DAMPED_DRIFT: f64 = 2e-3;

/// The angle (rad) by which a bead may swing between its neighbours in a default step before the user is told; usual ones are some hundredths.
const COARSE: f64 = 0.5;

/// Roundings that a run may add up; most of them cancel.
const MANY_ROUNDINGS: f64 = 30.0;

/// Durations that differ by less, relative, differ by rounding.
const NEARLY: f64 = 1e-12;

pub(crate) fn run(args: &RunArgs) -> Result<Done, Failure> {
    let spool = Spool::of(args.out.as_deref(), args.spool.as_deref(), false)?;
    // what waits in the spool is not in the store yet
    let force = args.force && spool.is_none();
    let Some((configured, start)) = Start::of(args, spool.as_ref(), force)? else { return Ok(Done::Whole) };
    let manifest = &configured.manifest;
    if args.dry_run {
        let name = &manifest.provenance.name;
        let chosen = chosen_step(&manifest.physics);
        let text = || {
            let mut rows = of_physics(&manifest.physics);
            rows.add("step", &chosen);
            rows.under(format_args!("run {name} would be"))
        };
        let found = json!({ "manifest": manifest, "run_toml": configured.toml, "step": &chosen });
        report(args.json, &found, text)?;
        return Ok(Done::Whole);
    }
    if args.check {
        determining::check_noise(&manifest.physics)?;
    }
    spool.as_ref().map_or(Ok(()), Spool::prepare)?;
    let out = start.check_out(&configured.inputs, force)?;
    let options = WriteOptions { force, ..write_options(args) };
    let disk = announce(&configured, out.as_deref(), &options)?;
    let first_step = start.first_frame().map_or(0, |frame| manifest.step_of_frame(frame));
    Forecast::of_run(manifest, first_step, args.pace, disk).confirm(args.yes)?;

    let expected_bytes = SpaceNeeded::new(manifest, options.compression).at_most_bytes;
    let upload = spool.as_ref().map(|spool| spool.begin(manifest, expected_bytes, args.force)).transpose()?;
    let (keyboard, stop) = Keyboard::open()?;
    // a run that others may have found, or with keys, leaves in order; one that goes on is a file that others know
    signals::leaves_nothing(
        !args.publishes() && args.resume.is_none() && spool.is_none() && keyboard.is_none(),
    );
    let prepared = start.prepare(args, &configured, &options, &stop);
    let Ok(Some((mut publisher, begun))) = prepared else {
        if let Some(upload) = upload {
            upload.give_up();
        }
        prepared?;
        notice!("stopped before the run began; nothing was recorded");
        return Ok(Done::Lossy);
    };
    let Begun { mut recorder, state, old } = begun;
    if let Some(path) = &out {
        signals::would_leave(what_stays(path, spool.as_ref()));
    }
    let sending = spool.clone().zip(upload).map(|(spool, upload)| spool.send(upload)).transpose()?;
    let beside = args.check.then(|| Beside::start(manifest, &stop)).transpose()?;
    let first_step = state.as_ref().map_or(0, |state| state.step);
    let begin = Begin { pace: args.pace, is_paused: false, step: first_step, can_seek: false };
    let mut stage = Stage::new(manifest, begin, keyboard.as_ref(), Arc::clone(&stop));
    let result = match state {
        Some(state) => producer::run::resume(manifest, state, &mut publisher, recorder.as_mut(), &mut stage),
        None => producer::run::run(manifest, &mut publisher, recorder.as_mut(), &mut stage),
    };
    let left = stage.leave(&mut publisher);
    // from here on the terminal shows messages and typed keys again
    drop(keyboard);

    let reason = result.as_ref().map_or(EndReason::Failed, |outcome| outcome.reason);
    // the recording first, so that it is there when consumers hear of the end; both are finished even if one fails
    let mut recording = recorder.map(|recorder| recorder.finish(reason)).transpose();
    if let Ok(Some(finished)) = &recording {
        signals::would_leave(format!("{} is finished", finished.path.display()));
    }
    let counts = publisher.finish(reason);
    let finished = recording.as_mut().ok().and_then(Option::as_mut).map(slice::from_mut);
    let uploaded = sending.map(|sending| sending.finish(finished.unwrap_or_default(), &stop));
    if let (Some(path), true) = (&out, failed_to_record(&result, &recording)) {
        tell_what_stays(path, spool.as_ref());
    }
    let (mut outcome, recording, counts) = (result?, recording?, counts?);
    if !args.publishes() {
        outcome.published_count = 0;
    }
    if let Some(old) = old {
        // it held the state from which the run was resumed
        old.remove()?;
    }

    let compared = beside.map(Beside::finish).transpose()?;
    let determined = compared.and_then(|compared| compared.determination.outcome());
    let is_determined = determined.as_ref().is_none_or(|determined| determined.first_lost().is_none());
    let is_sent = uploaded.as_ref().is_none_or(Uploaded::is_whole);
    let summary = Summary { manifest, outcome, first_step, counts, left, recording, uploaded, determined };
    report(args.json, &summary.json(), || summary.text())?;
    summary.uploaded.iter().for_each(Uploaded::tell);
    if let (EndReason::Interrupted, Some(recording)) = (reason, &summary.recording) {
        let path = recording.path.display();
        let copy = if spool.is_some() && is_sent { ", once it is copied to a file," } else { "" };
        notice!("`beadline run --resume {path}`{copy} goes on with it");
    }
    tell_drift(&manifest.physics, outcome.relative_drift);
    if !args.check {
        tell_growth(&manifest.physics, &outcome);
    }
    Ok(Done::whole_if(counts.evicted == 0 && reason == EndReason::Complete && is_determined && is_sent))
}

/// Beginning of a run.
enum Start {
    /// The chain at rest; where the run is recorded, if it is.
    Fresh(Option<PathBuf>),
    /// The recording of a run that was interrupted.
    Resumed(Box<Resumption>),
}

impl Start {
    /// The run of the arguments, and its beginning; none if there is nothing left to be done.
    fn of(args: &RunArgs, spool: Option<&Spool>, force: bool) -> Result<Option<(Configured, Self)>, Failure> {
        let out = spool.map(|spool| &spool.file).or(args.out.as_ref());
        if let Some(path) = &args.resume {
            if storage::is_url(path) {
                return Err(bad_input!(
                    "--resume {}: a run goes on in a file, and this is a URL; download the recording, and resume that",
                    path.display()
                ));
            }
            // beside another output nothing at the place of a link is replaced
            let target = path.canonicalize().ok().filter(|_| out.is_some() && path.is_symlink());
            let path = target.as_deref().unwrap_or(path);
            let found = Resumption::find(path, out.map(PathBuf::as_path), force)?;
            let found = found.unless_complete()?;
            return Ok(
                found.map(|found| (Configured::recorded(found.info()), Self::Resumed(Box::new(found))))
            );
        }
        let configured = configure(&Asked {
            config: args.config.as_ref(),
            preset: &args.preset,
            name: args.name.as_ref(),
            credit: Some(&args.credit),
            overrides: &args.overrides,
        })?;
        let name = &configured.manifest.provenance.name;
        let out = || out.cloned().unwrap_or_else(|| PathBuf::from(format!("{name}.mcap")));
        let out = (!args.no_record).then(out);
        Ok(Some((configured, Self::Fresh(out))))
    }

    /// The first frame that is not recorded, of a run that goes on.
    fn first_frame(&self) -> Option<u64> {
        match self {
            Self::Fresh(_) => None,
            Self::Resumed(found) => Some(found.first_frame()),
        }
    }

    /// Path of the recording, if there is one; refuses a name that is taken, or that of one of `inputs`.
    fn check_out(&self, inputs: &[PathBuf], force: bool) -> Result<Option<PathBuf>, Failure> {
        let out = match self {
            Self::Fresh(out) => out.as_deref(),
            Self::Resumed(found) => Some(found.target()),
        };
        if let Some(path) = out.filter(|path| path.extension().is_none_or(|end| end != "mcap")) {
            return Err(bad_input!("{}: a recording is written as .mcap", path.display()));
        }
        match self {
            Self::Fresh(Some(path)) => {
                inputs.iter().try_for_each(|input| check_place(path, Some(input), force))?;
                check_free(path, force)?;
            }
            Self::Fresh(None) => {}
            Self::Resumed(found) => resumption::tell_begin(found.info()),
        }
        Ok(out.map(Path::to_owned))
    }

    /// Opens the run to its consumers, waits for the consumers of `--wait-for`, and begins its recording, with the part
    /// that was recorded before. None if `stop` was set meanwhile.
    fn prepare(
        self,
        args: &RunArgs,
        configured: &Configured,
        options: &WriteOptions,
        stop: &Arc<AtomicBool>,
    ) -> Result<Option<(Outlet, Begun)>, Failure> {
        let (manifest, first_frame) = (&configured.manifest, self.first_frame().unwrap_or(0));
        let open = || publishing::open(manifest, first_frame, args.stall_timeout, args.wait_for, stop);
        let mut publisher = Outlet(args.publishes().then(open).transpose()?);
        let recorder = match &self {
            Self::Fresh(Some(path)) => {
                Some(RecordingWriter::create(path, manifest, &configured.toml, options)?)
            }
            _ => None,
        };
        let is_ready = match &mut publisher.0 {
            Some(publisher) => publishing::wait_for_consumers(args.wait_for, publisher, stop)?,
            None => true,
        };
        if is_ready {
            let Self::Resumed(found) = self else {
                return Ok(Some((publisher, Begun { recorder, state: None, old: None })));
            };
            if let Some(begun) = found.rebuild(options, &mut publisher, stop)? {
                return Ok(Some((publisher, begun)));
            }
        }
        publisher.finish(EndReason::Interrupted)?;
        if let Some(recorder) = recorder {
            recorder.discard();
        }
        Ok(None)
    }
}

fn write_options(args: &RunArgs) -> WriteOptions {
    WriteOptions {
        flush_period: Duration::from_secs_f64(args.flush_period),
        sync_period: Duration::from_secs_f64(args.sync_period),
        ..WriteOptions::default()
    }
}

/// Warns if the energy has drifted far, with the cause: rounding, or the time step.
fn tell_drift(physics: &Physics, drift: f64) {
    let large = if physics.damping.is_some() { LARGE_DAMPED_DRIFT } else { LARGE_DRIFT };
    if drift.abs() <= large {
        return;
    }
    let rounding = Drift::new(physics, &physics.chain()).rounding();
    if drift.abs() <= MANY_ROUNDINGS * rounding {
        notice!(
            "the energy drifted by {drift:.1e}, from rounding: beside the load, or beside a heavy striker, so little moves that \
             one rounding makes {rounding:.1e}; a shorter --dt does not help, a faster striker does"
        );
    } else {
        notice!(
            "the energy drifted by {drift:.1e}: dt = {:e} s is too long for this chain; pass a shorter --dt",
            physics.dt_s
        );
    }
}

/// Tells if contacts have become so stiff that the default step follows them no longer.
fn tell_stiff(physics: &Physics, step: Option<f64>) {
    let Some(step) = step.filter(|step| *step > COARSE && has_default_step(physics)) else { return };
    let shorter_s = physics.dt_s * COARSE / (4.0 * step);
    notice!(
        "contacts became stiffer than the default step allows for: beads swing through {step:.1} rad in dt = {:e} s; pass --dt {shorter_s:.0e}",
        physics.dt_s
    );
}

/// Tells if a step was too long for the contacts, or roundings have grown until they count.
fn tell_growth(physics: &Physics, outcome: &RunOutcome) {
    tell_stiff(physics, outcome.stiffest_step);
    let Some(Lost { at_s, growth_per_s }) = outcome.lost else { return };
    let time_s = physics.scales().time_s;
    notice!(
        "the run is chaotic: what differs in the last place grows as exp({:.2} t/T), and from about {} ({:.0} T) on it decides where \
         some beads are; `beadline check` says until when each number is determined",
        growth_per_s * time_s,
        seconds(at_s),
        at_s / time_s,
    );
}

/// The decision about the step, in words.
fn chosen_step(physics: &Physics) -> String {
    let (usual_s, limit) = physics.usual_step();
    let words = physics.limit_words(limit);
    if has_default_step(physics) {
        format!("as it is by default, {words}")
    } else {
        format!("as asked; {} would be the default, {words}", seconds(usual_s))
    }
}

/// True if the step is the one that a run over its time has by default.
fn has_default_step(physics: &Physics) -> bool {
    let default = physics.whole_steps(physics.time_s(physics.step_count), None);
    default.is_ok_and(|(dt_s, _)| (dt_s / physics.dt_s - 1.0).abs() <= NEARLY)
}

/// Message about the recording `path` for the case that the process ends at once.
fn what_stays(path: &Path, spool: Option<&Spool>) -> String {
    let path = path.display();
    format!(
        "{path}.partial has what was recorded: `beadline run --resume {path}.partial` goes on with it, and every \
         analysis reads it{}",
        advice(spool)
    )
}

/// Command that sends the recording, if it was to be sent.
fn advice(spool: Option<&Spool>) -> String {
    spool.map_or_else(String::new, |spool| format!("; {}", spool.advice()))
}

/// Reports the place of the recording, and the way to go on, when the rest could not be written.
fn tell_what_stays(path: &Path, spool: Option<&Spool>) {
    let path = path.display();
    notice!(
        "what was recorded before stays in {path}.partial, which every analysis reads; when there is room, \
         `beadline run --resume {path}.partial` goes on, with --out in another place{}",
        advice(spool)
    );
}

/// True if a recording was begun that could not be written to its end.
fn failed_to_record<P: std::error::Error, T>(
    result: &Result<RunOutcome, RunError<P, WriteError>>,
    recording: &Result<T, WriteError>,
) -> bool {
    let lost = |error: &WriteError| matches!(error, WriteError::Io { .. } | WriteError::Lost { .. });
    matches!(result, Err(RunError::Record { .. })) || recording.as_ref().is_err_and(lost)
}

/// Announces the bytes that the run will write, and refuses what cannot fit; returns the least part of the free disk
/// that it needs.
fn announce(configured: &Configured, out: Option<&Path>, options: &WriteOptions) -> Result<f64, Failure> {
    let manifest = &configured.manifest;
    let frame_bytes = 8 * manifest.frame_doubles() as u64;
    let frames = format!(
        "{}: {} of {}, {} of {}",
        manifest.provenance.name,
        counted(manifest.physics.step_count, "step"),
        step_in_words(&manifest.physics),
        counted(manifest.frame_count(), "frame"),
        bytes(frame_bytes),
    );
    let Some(path) = out else {
        notice!("{frames}; no recording");
        tell_end(configured);
        return Ok(0.0);
    };
    let needed = SpaceNeeded::new(manifest, options.compression);
    let free = needed.check(path)?;
    notice!(
        "{frames}; {} recorded in {}: {} to {}, {} free",
        count(manifest.recorded_count()),
        path.display(),
        bytes(needed.at_least_bytes),
        bytes(needed.at_most_bytes),
        bytes(free),
    );
    tell_end(configured);
    Ok(needed.at_least_bytes as f64 / free.max(1) as f64)
}

/// The step, and the part of the chain that decided it if that is not T.
fn step_in_words(physics: &Physics) -> String {
    let (dt, (_, limit)) = (seconds(physics.dt_s), physics.usual_step());
    if limit == Limit::Collision || !has_default_step(physics) {
        return dt.clone();
    }
    format!("{dt} ({})", physics.limit_words(limit))
}

/// Warns if the given step does not divide the duration.
fn tell_end(configured: &Configured) {
    let physics = &configured.manifest.physics;
    let (asked_s, end_s) = (configured.duration_s, physics.time_s(physics.step_count));
    if (end_s - asked_s).abs() > NEARLY * asked_s {
        notice!(
            "the last of these steps ends at {end_s:e} s, not at {asked_s:e} s; a step that is left to Beadline divides the \
             duration"
        );
    }
}

impl Conductor<Outlet, RecordingWriter> for Stage<'_> {
    fn after_frame(
        &mut self,
        frame: &Frame<'_>,
        publisher: &mut Outlet,
        recorder: Option<&mut RecordingWriter>,
    ) -> ControlFlow<()> {
        self.published(frame);
        if self.is_due() {
            self.note =
                recorder.map_or(String::new(), |recorder| bytes(recorder.bytes_written()).to_string());
            self.show(publisher);
        }
        self.hold(frame.time_s, publisher)
    }

    fn hears_every_frame(&self, publisher: &Outlet) -> bool {
        publisher.0.is_some() || self.holds_back()
    }

    fn between_steps(&mut self, publisher: &mut Outlet) -> ControlFlow<()> {
        Stage::between_steps(self, publisher)
    }

    fn watches_growth(&self) -> bool {
        true
    }

    fn is_stop(&self, error: &PublishError) -> bool {
        matches!(error, PublishError::Stopped { .. })
    }
}

/// Summary of a run, in numbers.
struct Summary<'a> {
    manifest: &'a RunManifest,
    outcome: RunOutcome,
    /// The step that this begins with.
    first_step: u64,
    counts: PublishCounts,
    left: Left,
    recording: Option<Finished>,
    /// Result of sending it, if it goes to a URL.
    uploaded: Option<Uploaded>,
    /// Time until which the run is determined, if asked.
    determined: Option<Determined>,
}

impl Summary<'_> {
    /// Frames in the recording, also those from before the run was interrupted.
    fn recorded_count(&self) -> u64 {
        self.recording.as_ref().map_or(0, |recording| recording.frames)
    }

    fn text(&self) -> String {
        let outcome = &self.outcome;
        let busy = self.left.wall.saturating_sub(self.left.paused);
        let steps_per_s = (outcome.last_step - self.first_step) as f64 / busy.as_secs_f64();
        let (last, all) = (count(outcome.last_step), count(self.manifest.physics.step_count));
        let mut rows = Rows::default();
        rows.add("steps", format_args!("{last} of {all}"));
        rows.add("frames published", count(outcome.published_count));
        rows.add("frames recorded", count(self.recorded_count()));
        rows.add("energy drift ΔE/E", format_args!("{:.2e}", outcome.relative_drift));
        let wall = duration(self.left.wall);
        rows.add("wall time", format_args!("{wall} ({})", display::per_second(steps_per_s, "steps")));
        rows.add("held back by consumers", duration(self.counts.held_back));
        let determined = self.determined.as_ref();
        rows.each("determined", determined.map(|determined| verdict(&self.manifest.physics, determined)));
        publishing::add_pauses(&mut rows, self.left.paused, self.counts.evicted);
        if let Some(Finished { path, bytes: size, uncompressed_bytes, held_back, .. }) = &self.recording {
            let ratio = *uncompressed_bytes as f64 / *size as f64;
            rows.add("held back by the disk", duration(*held_back));
            rows.add("recording", format_args!("{}, {} ({ratio:.2} : 1)", path.display(), bytes(*size)));
        }
        self.uploaded.iter().for_each(|uploaded| uploaded.add_to(&mut rows));
        rows.under(format_args!("{} {}", self.manifest.provenance.name, outcome.reason))
    }

    fn json(&self) -> Value {
        let (provenance, outcome) = (&self.manifest.provenance, &self.outcome);
        let recording = self.recording.as_ref().map(|recording| {
            json!({
                "path": recording.path.to_string_lossy(),
                "bytes": recording.bytes,
                "uncompressed_bytes": recording.uncompressed_bytes,
                "held_back_s": recording.held_back.as_secs_f64(),
            })
        });
        json!({
            "run": provenance.name,
            "run_id": provenance.run_id,
            "end": outcome.reason.as_str(),
            "first_step": self.first_step,
            "steps": outcome.last_step,
            "frames_published": outcome.published_count,
            "frames_recorded": self.recorded_count(),
            "relative_drift": outcome.relative_drift,
            "lost_at_s": outcome.lost.map(|lost| lost.at_s),
            "growth_per_s": outcome.lost.map(|lost| lost.growth_per_s),
            "wall_s": self.left.wall.as_secs_f64(),
            "paused_s": self.left.paused.as_secs_f64(),
            "held_back_s": self.counts.held_back.as_secs_f64(),
            "consumers_dropped": self.left.dropped.names,
            "recording": recording,
            "upload": self.uploaded.as_ref().map(Uploaded::json),
            "check": self.determined.as_ref().map(|it| determining::json(&self.manifest.physics, it)),
        })
    }
}
