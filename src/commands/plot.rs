//! `beadline plot`.

mod table;

use super::analyse::analyse;
use crate::analysis::{AnalysisError, Session, check_beads, window};
use crate::args::{AnalysisArgs, AskedAnalysis, ColoursArg, FramesArgs, PlotArgs, subjects};
use crate::display::{self, count};
use crate::failure::{Done, Failure};
use crate::outputs::{check_figures, check_places};
use crate::report::Rows;
use anyhow::anyhow;
use clap::builder::TypedValueParser;
use consumers::fields::Field;
use consumers::follow::{FrameObserver, Tally};
use consumers::space_time::{Extent, Picture, singles};
use plots::ColourSteps;
use schemas::beads::Beads;
use schemas::chain::Chain;
use schemas::frame::{EndReason, Frame, HeldFrame, Window};
use schemas::manifest::RunManifest;
use serde_json::json;
use source::Named;
use std::ops::Range;
use std::path::PathBuf;

pub(crate) fn plot(args: &PlotArgs) -> Result<Done, Failure> {
    if let Some(path) = table::table_of(args) {
        return table::plot(args, path);
    }
    let what = check_table_flags(args)?;
    let out = args.out.clone().unwrap_or_else(|| default_out(args, what));
    if let Some(offer) = analyses::named(what) {
        check_kind(args, what)?;
        let (frames, no_publish) = (args.frames.clone(), matches!(args.frames.source, Named::Live(_)));
        let common = AnalysisArgs { frames, figure: vec![out], look: args.look, no_publish };
        return analyse(&AskedAnalysis::figure_of(offer, common));
    }
    let field = Field::ALL.into_iter().find(|field| field.as_str() == what).unwrap_or(Field::Velocity);
    check_figures(std::slice::from_ref(&out), args.look)?;
    check_places(&[&out], &args.frames)?;
    match Moment::asked(args) {
        Some(moment) => profile(args, field, moment, &out),
        None => space_time(args, field, &out),
    }
}

/// `run-velocity.png`, `run-velocity-at-0.05s.png`, `run-velocity-frame-100.png`, in the current directory.
fn default_out(args: &PlotArgs, what: &str) -> PathBuf {
    let source = match &args.frames.source {
        Named::Live(name) => name.as_ref().map_or("live", |name| name.as_str()),
        Named::File(path) => path.file_name().and_then(|name| name.to_str()).unwrap_or("run"),
    };
    let name = source.strip_suffix(".partial").unwrap_or(source);
    let name = name.strip_suffix(".mcap").unwrap_or(name);
    let moment = match Moment::asked(args) {
        Some(Moment::Time(time_s)) => format!("-at-{time_s}s"),
        Some(Moment::Frame(frame)) => format!("-frame-{frame}"),
        None => String::new(),
    };
    format!("{name}-{what}{moment}.png").into()
}

/// The subject, of a run. Refuses flags that only have a meaning for tables.
fn check_table_flags(args: &PlotArgs) -> Result<&str, Failure> {
    let flags = [
        ("--x", args.x.is_some()),
        ("--y", !args.y.is_empty()),
        ("--by", args.by.is_some()),
        ("--heat", args.heat.is_some()),
        ("--band", args.band.is_some()),
        ("--fit", args.fit.is_some()),
        ("--slope", !args.slope.is_empty()),
        ("--log", !args.log.is_empty()),
    ];
    if let Some((flag, _)) = flags.iter().find(|(_, is_given)| *is_given) {
        let source = &args.frames.source;
        return Err(bad_input!("{flag} is for tables (.csv, .parquet); {source} is a run or a recording"));
    }
    args.what.as_deref().ok_or_else(|| {
        let subjects = subjects();
        let values = subjects.possible_values().into_iter().flatten();
        let known: Vec<String> = values.map(|value| value.get_name().to_owned()).collect();
        bad_input!("--what is missing: what to draw of the run; allowed: {}", known.join(", "))
    })
}

/// Refuses flags that only have a meaning for a quantity along the chain.
fn check_kind(args: &PlotArgs, what: &str) -> Result<(), Failure> {
    let moment = "these are drawn over time; --from and --until choose a part of it";
    let analysis = format!("`beadline {what} --figure` has what can be chosen about it");
    let flags = [
        ("--at", args.at.is_some(), moment),
        ("--frame", args.frame.is_some(), moment),
        ("--beads", args.beads.is_some(), &analysis),
        ("--colours", args.colours.is_some(), &analysis),
        ("--range", args.range.is_some(), "these have no colours for numbers"),
    ];
    match flags.iter().find(|(_, is_given, _)| *is_given) {
        Some((flag, _, why)) => Err(bad_input!("{flag} is not for --what {what}: {why}")),
        None => Ok(()),
    }
}

/// The beads or contacts that are drawn.
pub(super) fn places(
    asked: Option<Beads>,
    field: Field,
    manifest: &RunManifest,
) -> Result<Range<usize>, Failure> {
    let beads = check_beads(manifest, asked)?;
    match field {
        Field::Velocity | Field::Displacement | Field::Energy => Ok(beads),
        Field::Overlap if beads.len() > 1 => Ok(beads.start..beads.end - 1),
        Field::Overlap => {
            Err(bad_input!("--beads {}..{}: a contact is between two beads", beads.start, beads.end))
        }
    }
}

/// Time of a profile.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Moment {
    /// The first frame at or after a time (s).
    Time(f64),
    Frame(u64),
}

impl Moment {
    fn asked(args: &PlotArgs) -> Option<Self> {
        args.at.map(Self::Time).or(args.frame.map(Self::Frame))
    }

    /// The step that is drawn: a frame's, or any.
    fn step(self, manifest: &RunManifest, every_step: bool) -> Result<u64, Failure> {
        let (physics, every) = (&manifest.physics, manifest.provenance.publish_every_steps);
        match self {
            Self::Time(time_s) => {
                let end_s = physics.time_s(physics.step_count);
                // the duration as it was asked for may be a part of a step longer
                if time_s > end_s + physics.dt_s {
                    let end = display::typed(end_s);
                    return Err(bad_input!("--at {time_s}: the run ends at {end} s"));
                }
                let step = physics.step_at_or_after(time_s).min(physics.step_count);
                let frame = step.div_ceil(every);
                Ok(if every_step { step } else { manifest.step_of_frame(frame) })
            }
            Self::Frame(frame) => {
                let last = manifest.frame_count() - 1;
                if frame > last {
                    return Err(bad_input!("--frame {frame}: the run has frames 0 to {last}"));
                }
                Ok(manifest.step_of_frame(frame))
            }
        }
    }
}

/// Waits for one frame.
#[derive(Default)]
struct Waiting(Option<HeldFrame>);

impl FrameObserver for Waiting {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        self.0.get_or_insert_default().hold(frame);
        Ok(())
    }
}

/// Draws a quantity along the chain at one time.
fn profile(args: &PlotArgs, field: Field, moment: Moment, out: &PathBuf) -> Result<Done, Failure> {
    let is_file = matches!(args.frames.source, Named::File(_));
    // a recording may be sparse there; frames of a live run before this one are not needed
    let frames = FramesArgs { fill_gaps: args.frames.fill_gaps || is_file, ..args.frames.clone() };
    let mut session = Session::of_part(&frames, "plot", std::slice::from_ref(out), |manifest| {
        let time_s = manifest.physics.time_s(moment.step(manifest, frames.every_step)?);
        Ok(Window { from_s: time_s, until_s: time_s })
    })?;
    let manifest = session.manifest().clone();
    let places = places(args.beads, field, &manifest)?;
    let mut waiting = Waiting::default();
    let tally = session.follow(&mut waiting)?;
    let step = *session.steps().start();
    let held = waiting.0.ok_or_else(|| absent(&manifest, step, &tally))?;
    let frame = held.frame();
    plots::profile(&manifest, &frame, field, &places).write(out, args.look.options(), args.frames.force)?;
    let chain = manifest.physics.chain();
    let values = field.values(&chain, &frame).skip(places.start).take(places.len());
    let extremes = values.fold(None, |found, value| Some(widened(found, value))).unwrap_or_default();
    let mut rows = Rows::default();
    let (time, number, step) = (display::quantity(frame.time_s, "s"), count(frame.frame), count(frame.step));
    rows.add("time", format_args!("{time} (frame {number}, step {step})"));
    rows.add("values", display::range(extremes, field.unit()));
    let results = json!({
        "what": field.as_str(),
        "frame": frame.frame,
        "step": frame.step,
        "time_s": frame.time_s,
        "least": extremes[0],
        "largest": extremes[1],
        "unit": field.unit(),
    });
    session.report(&tally, field.as_str(), rows, results)
}

/// The failure that tells why the state of `step` did not come.
fn absent(manifest: &RunManifest, step: u64, tally: &Tally) -> Failure {
    let (frame, time_s) = (manifest.frame_at(step), manifest.physics.time_s(step));
    let wanted = format!("frame {frame} ({} s)", display::number(time_s));
    if tally.ended_as_asked {
        let why = "what was received begins after it; --from-start recomputes it";
        return bad_input!("there is no {wanted}: {why}");
    }
    match tally.end {
        EndReason::Stopped => Failure::Stopped(anyhow!("stopped before {wanted} came")),
        end => bad_input!("there is no {wanted}: the frames ended before it ({end})"),
    }
}

/// Draws a quantity over space and time.
fn space_time(args: &PlotArgs, field: Field, out: &PathBuf) -> Result<Done, Failure> {
    let frames = &args.frames;
    let part = |manifest: &_| window(frames.from, frames.until, manifest);
    let mut session = Session::of_part(frames, "plot", std::slice::from_ref(out), part)?;
    let manifest = session.manifest().clone();
    let extent = Extent { places: places(args.beads, field, &manifest)?, steps: session.steps() };
    let (chain, places, picture) = (manifest.physics.chain(), extent.places.clone(), Picture::new(extent));
    let mut map = Map { field, chain, places, picture, values: Vec::new(), extremes: None };
    let tally = session.follow(&mut map)?;
    let steps = steps_of(args.colours);
    let range = args.range.map(|range| [range.from, range.to]);
    plots::space_time(&manifest, field, &map.picture, steps, range)?.write(
        out,
        args.look.options(),
        args.frames.force,
    )?;
    let mut rows = Rows::default();
    let name = if field == Field::Overlap { "values beyond rest" } else { "values" };
    rows.each(name, map.extremes.map(|extremes| display::range(extremes, field.unit())));
    let results = json!({
        "what": field.as_str(),
        "least": map.extremes.map(|[least, _]| least),
        "largest": map.extremes.map(|[_, largest]| largest),
        "unit": field.unit(),
    });
    session.report(&tally, field.as_str(), rows, results)
}

/// The scale of colours that is asked for.
pub(super) fn steps_of(asked: Option<ColoursArg>) -> ColourSteps {
    match asked {
        None => ColourSteps::Fitting,
        Some(ColoursArg::Log) => ColourSteps::Log,
        Some(ColoursArg::Linear) => ColourSteps::Linear,
    }
}

/// A quantity over space and time, as it comes.
struct Map {
    field: Field,
    chain: Chain,
    places: Range<usize>,
    picture: Picture<f32>,
    /// Those of a frame.
    values: Vec<f64>,
    /// The least and the largest value so far, of which the picture has the farthest from 0 alone.
    extremes: Option<[f64; 2]>,
}

impl FrameObserver for Map {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        self.values.clear();
        self.values.extend(self.field.deviations(&self.chain, frame));
        let shown = &self.values[self.places.clone()];
        self.extremes = shown.iter().fold(self.extremes, |found, value| Some(widened(found, *value)));
        self.picture.push(frame.step, singles(self.values.iter().copied()));
        Ok(())
    }

    fn gap(&mut self) {
        self.picture.gap();
    }
}

/// The least and the largest value so far, with another one.
fn widened(found: Option<[f64; 2]>, value: f64) -> [f64; 2] {
    let [low, high] = found.unwrap_or([value; 2]);
    [if value < low { value } else { low }, if value > high { value } else { high }]
}
