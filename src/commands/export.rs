//! `beadline export`: states of a recording in the formats of other programs.

use crate::analysis::{check_beads, notice_of_end, window};
use crate::args::ExportArgs;
use crate::display::{self, bytes, count, counted};
use crate::failure::{BadInput, Done, Failure};
use crate::frames::{Frames, is_of_a_file};
use crate::outputs::{check_place, extension};
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use anyhow::Error;
use consumers::follow::{FollowError, FrameObserver, Tally, follow_within};
use exports::{Excerpt, Export, ExportError, Format};
use producer::resimulation::Lend;
use schemas::frame::{EndReason, Frame, FrameSource, Window};
use serde_json::json;
use source::Source;
use std::num::NonZero;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The states that are due, on their way into the file.
struct Exporting {
    export: Box<dyn Export>,
    every_steps: u64,
    states: u64,
    /// Steps of the first and the last state.
    steps: Option<(u64, u64)>,
    first_step: u64,
    progress: Progress,
}

impl FrameObserver for Exporting {
    type Error = ExportError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        if frame.step.is_multiple_of(self.every_steps) {
            self.export.frame(frame)?;
            self.states += 1;
            let first = self.steps.map_or(frame.step, |(first, _)| first);
            self.steps = Some((first, frame.step));
        }
        if self.progress.at(frame.step - self.first_step) {
            self.progress.tell(&[&counted(self.states, "state")]);
        }
        Ok(())
    }

    fn gap(&mut self) {
        self.export.gap();
    }
}

pub(crate) fn export(args: &ExportArgs) -> Result<Done, Failure> {
    let format = format(args)?;
    let from = super::recording_of(&args.file, "exported")?;
    format.files(&args.out).iter().try_for_each(|path| check_place(path, Some(&from), args.force))?;
    let stop = signals::bounded_stop_flag()?;
    let (mut frames, window) = open(args, &from, &stop)?;
    let manifest = frames.manifest().clone();
    display::notice_of_version(&manifest);
    let excerpt =
        Excerpt { beads: check_beads(&manifest, args.beads)?, manifest, window, clouds: args.clouds.get() };
    let mut exporting = Exporting::begin(format.begin(&args.out, &excerpt, args.force)?, args, &excerpt);
    let tally = follow(&mut frames, &mut exporting, window)?;
    let Exporting { mut export, states, steps, .. } = exporting;
    if tally.end == EndReason::Stopped || !assemble(&mut *export, &excerpt, &stop)? {
        return Err(Failure::stopped());
    }
    let Some(steps) = steps else { return Err(nothing_to_export(args)) };
    let paths = export.finish()?;
    tell(args, format, &excerpt, (states, steps), &tally, &paths)
}

/// The format of --to, or of the output's name.
fn format(args: &ExportArgs) -> Result<Format, Failure> {
    let end = extension(&args.out);
    let named = Format::ALL.into_iter().find(|format| format.extensions().contains(&end.as_str()));
    if let (Some(asked), Some(named)) = (args.to, named)
        && asked != named
    {
        let out = args.out.display();
        return Err(bad_input!("{out} would be taken for {named}, but --to says {asked}"));
    }
    let named = args.to.or(named);
    let names = Format::ALL.map(Format::name).join(", ");
    named.ok_or_else(|| {
        bad_input!("{}: its name does not say which format; use --to with one of {names}", args.out.display())
    })
}

/// The states that are asked for, and more.
fn open(args: &ExportArgs, from: &Path, stop: &Arc<AtomicBool>) -> Result<(Frames, Window), Failure> {
    let recorded = Source::recording(from, stop).bad_input()?;
    let window = window(args.from, args.until, recorded.manifest())?;
    let steps = window.steps(recorded.manifest());
    let first_step = *steps.start();
    let provenance = &recorded.manifest().provenance;
    let (publish, record) = (provenance.publish_every_steps, provenance.record_every_steps);
    let lend = match args.every_steps.map(NonZero::get) {
        _ if args.every_step => Some(Lend::Steps),
        // these were recorded: a gap is shown, not filled
        Some(every) if every.is_multiple_of(record) => None,
        Some(every) if every.is_multiple_of(publish) => Some(Lend::Frames),
        Some(_) => Some(Lend::Steps),
        None => None,
    };
    let mut source =
        if lend == Some(Lend::Steps) { Source::all_states(from, stop).bad_input()? } else { recorded };
    source.seek(&steps).bad_input()?;
    let frames = match lend {
        Some(lend) => Frames::recomputed(source, lend, false, first_step, args.jobs)?,
        None => Frames::as_they_come(source),
    };
    Ok((frames, window))
}

impl Exporting {
    fn begin(export: Box<dyn Export>, args: &ExportArgs, excerpt: &Excerpt) -> Self {
        let Excerpt { manifest, window, .. } = excerpt;
        let (first_step, last_step) = window.steps(manifest).into_inner();
        let length = last_step.saturating_sub(first_step);
        Self {
            export,
            every_steps: args.every_steps.map_or(1, NonZero::get),
            states: 0,
            steps: None,
            first_step,
            progress: Progress::new(length, manifest.provenance.name.as_str()),
        }
    }
}

/// Takes every state of `window`; states before damage are kept.
fn follow(frames: &mut Frames, exporting: &mut Exporting, window: Window) -> Result<Tally, Failure> {
    let mut tally = Tally::default();
    let followed = follow_within(frames, exporting, window, &mut tally, |_| {});
    exporting.progress.finish();
    match followed {
        Ok(()) => Ok(tally),
        Err(FollowError::Source(error)) if is_of_a_file(&error) && exporting.states > 0 => {
            notice!("{:#}", Error::new(error));
            Ok(tally)
        }
        Err(FollowError::Source(error)) => Err(error).bad_input(),
        Err(FollowError::Analysis(error)) => Err(error.into()),
    }
}

/// Does the long work after the last state; says whether it was finished.
fn assemble(export: &mut dyn Export, excerpt: &Excerpt, stop: &AtomicBool) -> Result<bool, Failure> {
    let bar = display::progress_bar(1000, excerpt.manifest.provenance.name.as_str());
    display::tell(&bar, &["putting the file together"]);
    while let Some(fraction) = export.assemble()? {
        if stop.load(Ordering::Relaxed) {
            return Ok(false);
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 1")]
        bar.set_position((fraction * 1000.0) as u64);
    }
    bar.finish_and_clear();
    Ok(true)
}

fn nothing_to_export(args: &ExportArgs) -> Failure {
    let advice = if args.every_step { "" } else { "; --every-step recomputes the steps between frames" };
    bad_input!("{}: there is no state in this part of the run{advice}", args.file)
}

/// Prints the summary and says whether anything is missing.
fn tell(
    args: &ExportArgs,
    format: Format,
    excerpt: &Excerpt,
    (states, (first, last)): (u64, (u64, u64)),
    tally: &Tally,
    paths: &[PathBuf],
) -> Result<Done, Failure> {
    let sizes =
        paths.iter().map(|path| Ok(path.metadata()?.len())).collect::<Result<Vec<_>, std::io::Error>>()?;
    let total: u64 = sizes.iter().sum();
    let Range { start, end } = excerpt.beads;
    let manifest = &excerpt.manifest;
    let found = json!({
        "run": manifest.provenance.name,
        "run_id": manifest.provenance.run_id,
        "format": format.name(),
        "paths": display::texts_of(paths),
        "bytes": total,
        "states": states,
        "first_step": first,
        "last_step": last,
        "frames_missed": tally.missed_count,
        "first_bead": start,
        "last_bead": end - 1,
        "end": display::end_word(tally.end, tally.ended_as_asked),
    });
    report(args.json, &found, || {
        let names: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
        let end_text = display::end(tally.end, args.until.filter(|_| tally.ended_as_asked));
        let mut rows = Rows::default();
        rows.add("states", format_args!("{}, steps {} to {}", count(states), count(first), count(last)));
        rows.add("time", display::range([first, last].map(|step| manifest.physics.time_s(step)), "s"));
        rows.add("beads", format_args!("{start} to {}", end - 1));
        rows.add("written", format_args!("{} as {format}, {}", names.join(", "), bytes(total)));
        rows.under(format_args!("{} exported ({end_text})", args.file))
    })?;
    if tally.missed_count > 0 {
        let missed = counted(tally.missed_count, "frame");
        notice!("{missed} of the recording are missing in it, and in the export");
    }
    notice_of_end(tally.end, args.file.file(), "the exported states");
    Ok(Done::whole_if(tally.end.is_orderly() && tally.missed_count == 0))
}
