//! A source that an analysis is opened on: follow it, report.

mod outputs;

pub(crate) use outputs::{Kept, Outputs};

use crate::args::{AnalysisArgs, FramesArgs};
use crate::display::{self, count, counted};
use crate::failure::{BadInput as _, Done, Failure};
use crate::frames::{Frames, FramesError, attach, is_of_a_file, tell};
use crate::outputs::check_outputs;
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use anyhow::Error;
use bus::{Bus, ResultElement, ResultPublisher, ResultsError, StreamId};
use consumers::analysis::Offer;
use consumers::follow::{FollowError, FrameObserver, Tally, follow_within};
use consumers::table::TableError;
use figure::{Figure, FigureError};
use recording::WriteError;
use schemas::beads::Beads;
use schemas::frame::{EndReason, FrameSource, Window};
use schemas::manifest::{Provenance, RunManifest};
use schemas::results::{ResultColumns, Topic};
use schemas::whole_file::is_being_written;
use serde::Serialize;
use serde_json::json;
use source::{Named, Source, SourceError};
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// An open source and what goes with it.
pub(crate) struct Session<'a> {
    args: &'a FramesArgs,
    /// The figures that are drawn.
    figures: &'a [PathBuf],
    /// True if results are published, provided that the source is live.
    publishes: bool,
    source: Frames,
    window: Window,
    /// The bus and the stream, if the source is live.
    live: Option<(Bus, StreamId)>,
    stop: Arc<AtomicBool>,
}

/// Errors while frames are analysed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AnalysisError {
    #[error(transparent)]
    Table(#[from] TableError),
    #[error(transparent)]
    Map(#[from] WriteError),
    #[error(transparent)]
    Results(#[from] ResultsError),
}

impl<'a> Session<'a> {
    /// Opens the source that `args` name; `label` is this consumer's name for the producer.
    pub(crate) fn open(args: &'a AnalysisArgs, label: &str, outputs: &[&PathBuf]) -> Result<Self, Failure> {
        check_outputs(args, outputs)?;
        check_publishing(args)?;
        // a row of results belongs to a frame
        let publishes = !args.no_publish && !args.frames.every_step;
        let part = |manifest: &_| window(args.frames.from, args.frames.until, manifest);
        Ok(Self { publishes, ..Self::of_part(&args.frames, label, &args.figure, part)? })
    }

    /// Opens the source that `args` name, to look at the part of the run that `part` chooses.
    pub(crate) fn of_part(
        args: &'a FramesArgs,
        label: &str,
        figures: &'a [PathBuf],
        part: impl FnOnce(&RunManifest) -> Result<Window, Failure>,
    ) -> Result<Self, Failure> {
        check_flags(args)?;
        let stop = signals::bounded_stop_flag()?;
        let (source, live) = match &args.source {
            Named::Live(name) => {
                let bus = Bus::from_env()?;
                let asked = (args.latest, args.timeout);
                let live = attach(&bus, name.as_ref(), label, asked, &stop, tell)?;
                display::notice_of_bus(&bus);
                let stream = live.stream();
                (Source::Live(Box::new(live)), Some((bus, stream)))
            }
            Named::File(path) if args.every_step => (Source::all_states(path, &stop).bad_input()?, None),
            Named::File(path) => (Source::recording(path, &stop).bad_input()?, None),
        };
        display::notice_of_version(source.manifest());
        let window = part(source.manifest())?;
        Ok(Self {
            args,
            figures,
            publishes: false,
            source: Frames::of(source, args, window)?,
            window,
            live,
            stop,
        })
    }

    pub(crate) fn manifest(&self) -> &RunManifest {
        self.source.manifest()
    }

    /// The steps that are looked at.
    pub(crate) fn steps(&self) -> RangeInclusive<u64> {
        self.window.steps(self.manifest())
    }

    /// True if the user has asked for an end.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// A publisher of the results of an analysis, if the source is live and nobody else publishes them.
    fn results<T: ResultElement>(
        &self,
        offer: &Offer,
        columns: &ResultColumns,
    ) -> Result<Option<ResultPublisher<T>>, Failure> {
        let Some((bus, stream)) = self.live.as_ref().filter(|_| self.publishes) else {
            return Ok(None);
        };
        let name = offer.name;
        let topic = if analyses::is_added(offer) { Topic::own(name) } else { Topic::results(name) };
        let topic = topic.map_err(Error::msg)?;
        let run = &self.manifest().provenance.name;
        match ResultPublisher::create(bus, run, topic, *stream, columns, Arc::clone(&self.stop)) {
            Ok(publisher) => Ok(Some(publisher)),
            Err(error @ (ResultsError::AlreadyPublished { .. } | ResultsError::OtherColumns { .. })) => {
                notice!("{error}: these results are not published");
                Ok(None)
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Feeds every frame to `analysis`, with a progress bar.
    pub(crate) fn follow(
        &mut self,
        analysis: &mut impl FrameObserver<Error: Into<Error>>,
    ) -> Result<Tally, Failure> {
        let manifest = self.source.manifest();
        let mut progress = Progress::of_run(manifest);
        let publish_every = manifest.provenance.publish_every_steps;
        let mut seen = 0_u64;
        let mut tally = Tally::default();
        let followed = follow_within(&mut self.source, analysis, self.window, &mut tally, |tally| {
            seen += 1;
            // a look at the clock costs as much as an analysis of a few beads
            if seen.is_multiple_of(64) && progress.at(tally.last_frame.unwrap_or(0) * publish_every) {
                let missed = format!("{} missed", count(tally.missed_count));
                progress.tell(&[&counted(tally.frame_count, "frame"), &missed]);
            }
        });
        progress.finish();
        match followed {
            Ok(()) => Ok(tally),
            // results before the damage are kept, as with a file that was cut short
            Err(FollowError::Source(error)) if is_of_a_file(&error) && tally.frame_count > 0 => {
                notice!("{:#}", Error::new(error));
                Ok(tally)
            }
            Err(FollowError::Source(error @ FramesError::Source(SourceError::File(_)))) => {
                Err(Failure::BadInput(error.into()))
            }
            Err(FollowError::Source(error)) => Err(error.into()),
            Err(FollowError::Analysis(error)) => Err(Failure::Failed(error.into())),
        }
    }

    /// Prints the summary and says whether anything was lost.
    pub(crate) fn report(
        &self,
        tally: &Tally,
        title: &str,
        rows: Rows,
        results: impl Serialize,
    ) -> Result<Done, Failure> {
        let Provenance { name, run_id, .. } = &self.manifest().provenance;
        let all = json!({
            "run": name,
            "run_id": run_id,
            "frames_received": tally.frame_count,
            "frames_missed": tally.missed_count,
            "first_frame": tally.first_frame,
            "last_frame": tally.last_frame,
            "end": display::end_word(tally.end, tally.ended_as_asked),
            "figures": display::texts_of(self.figures),
            "results": results,
        });
        report(self.args.json, &all, || {
            let mut all = Rows::default();
            let frames = tally.first_frame.zip(tally.last_frame);
            all.add("frames", display::received(count(tally.frame_count), frames, tally.missed_count));
            all.append(rows);
            all.each("figure", self.figures.iter().map(|path| path.display()));
            let Window { from_s, until_s } = self.window;
            let end = match tally.ended_as_asked {
                true if from_s == until_s => format!("at {}", display::quantity(from_s, "s")),
                as_asked => display::end(tally.end, as_asked.then_some(until_s)),
            };
            all.under(format_args!("{title} of {name} ({end})"))
        })?;
        self.warn(tally);
        Ok(Done::whole_if(tally.end.is_orderly() && tally.missed_count == 0))
    }

    fn warn(&self, tally: &Tally) {
        if tally.frame_count == 0 && self.window != Window::WHOLE {
            notice!(
                "there is no frame between --from and --until; --every-step recomputes the steps between frames",
            );
        }
        if tally.missed_count > 0 {
            let missed = counted(tally.missed_count, "published frame");
            notice!("{missed} did not arrive");
        }
        match tally.end {
            EndReason::ProducerLost => {
                notice!("the producer is gone without a word; results end there");
            }
            EndReason::Dropped => display::notice(
                "the producer dropped this consumer because it held the run back for too long; \
                 use --latest, or a longer --stall-timeout of `beadline run`",
            ),
            EndReason::Stopped if self.live.is_none() => {
                notice!("stopped: results end before the recording does");
            }
            EndReason::Stopped => notice!("stopped: results end here, the run goes on"),
            end => notice_of_end(end, self.args.source.file(), "results"),
        }
        let from = self.manifest().physics.step_at_or_after(self.window.from_s);
        let due = from.div_ceil(self.manifest().provenance.publish_every_steps);
        let Some(first) = tally.first_frame.filter(|first| *first > due) else { return };
        let first = count(first);
        if self.live.is_some() {
            notice!("attached to a run under way: results begin with frame {first}");
        } else if due == 0 && tally.missed_count == 0 {
            notice!("the recording begins with frame {first}, and so do the results");
        }
    }
}

/// Prints a notice about the end of the run or recording `source`: its meaning for the things `made` from it, such
/// as results.
pub(crate) fn notice_of_end(end: EndReason, recording: Option<&Path>, made: &str) {
    match end {
        EndReason::Failed => notice!("the run failed; {made} end at its last frame"),
        EndReason::Unfinished if recording.is_some_and(is_being_written) => {
            notice!("the recording is being written; {made} end where it did");
        }
        EndReason::Unfinished => {
            notice!("the recording was not finished, or is damaged; {made} end where it does");
        }
        EndReason::Continued => notice!("the recording goes on in its next part"),
        EndReason::Detached => {
            notice!("the recorder left the run before its end; {made} end where it did");
        }
        EndReason::Complete
        | EndReason::Interrupted
        | EndReason::ProducerLost
        | EndReason::Dropped
        | EndReason::Stopped => {}
    }
}

/// Refuses flags that have no meaning for this kind of source.
pub(crate) fn check_flags(args: &FramesArgs) -> Result<(), Failure> {
    let of_live_runs = [
        ("--latest", args.latest, "attaches to a live run without holding it back"),
        ("--timeout", args.timeout.is_some(), "ends the wait for a live run"),
    ];
    let of_recordings =
        [("--jobs", args.jobs.is_some(), "says how many threads recompute the steps of a recording")];
    let (flags, found) = match args.source {
        Named::File(_) => (&of_live_runs[..], "a recording"),
        Named::Live(_) => (&of_recordings[..], "a live run"),
    };
    match flags.iter().find(|(_, is_given, _)| *is_given) {
        Some((flag, _, what_for)) => Err(bad_input!("{flag} {what_for}; {} is {found}", args.source)),
        None => Ok(()),
    }
}

/// The same for the flag of analyses.
pub(crate) fn check_publishing(args: &AnalysisArgs) -> Result<(), Failure> {
    let source = &args.frames.source;
    match source {
        Named::File(_) if args.no_publish => {
            Err(bad_input!("--no-publish keeps results of a live run off the bus; {source} is a recording"))
        }
        _ => Ok(()),
    }
}

/// The part of the run from the time `from_s` until `until_s`, as given.
pub(crate) fn window(from_s: f64, until_s: Option<f64>, manifest: &RunManifest) -> Result<Window, Failure> {
    let window = Window { from_s, until_s: until_s.unwrap_or(f64::INFINITY) };
    let end_s = manifest.physics.time_s(manifest.physics.step_count);
    let refuse = |what: String| Err(bad_input!("--from {}: {what}", window.from_s));
    if window.from_s > window.until_s {
        return refuse(format!("expected a time before --until {}", window.until_s));
    }
    if window.from_s > end_s {
        return refuse(format!("the run ends at {} s", display::typed(end_s)));
    }
    Ok(window)
}

/// Draws the figures that were asked for.
pub(crate) fn draw(
    args: &AnalysisArgs,
    figure: impl FnOnce() -> Result<Figure, FigureError>,
) -> Result<(), Failure> {
    if args.figure.is_empty() {
        return Ok(());
    }
    let figure = figure()?;
    for path in &args.figure {
        figure.write(path, args.look.options(), args.frames.force)?;
    }
    Ok(())
}

/// The beads that are asked for.
pub(crate) fn check_beads(manifest: &RunManifest, asked: Option<Beads>) -> Result<Range<usize>, Failure> {
    let beads = asked.unwrap_or_default().of(manifest.physics.beads);
    beads.map_err(|why| bad_input!("--beads {why}"))
}
