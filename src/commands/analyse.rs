//! `beadline ANALYSIS`, for every analysis of the list.

use crate::analysis::{AnalysisError, Kept, Outputs, Session, check_flags, check_publishing, draw};
use crate::args::{AnalysisArgs, AskedAnalysis, FramesArgs, keeps_rows};
use crate::configuration::{origin, preset};
use crate::display::{self, count};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::{check_outputs, check_tables, extension};
use crate::report::{Rows, report};
use anyhow::{Context, anyhow};
use consumers::analysis::{Analysis, Beginning, Refusal, Report, RowValues};
use consumers::follow::FrameObserver;
use producer::resimulation::check_kernel;
use recording::{ContactsReader, RecordingInfo, RecordingSource};
use schemas::config::{ConfigError, RunConfig};
use schemas::frame::{EndReason, Frame, FrameSource};
use schemas::manifest::{Provenance, RunManifest};
use serde_json::json;
use source::Named;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Hands frames to an analysis and its rows to the outputs.
struct Following<'a> {
    analysis: &'a mut dyn Analysis,
    outputs: &'a mut Outputs,
}

impl FrameObserver for Following<'_> {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        self.analysis.observe(frame, self.outputs);
        self.outputs.check()
    }

    fn gap(&mut self) {
        self.analysis.gap();
    }
}

pub(crate) fn analyse(asked: &AskedAnalysis) -> Result<Done, Failure> {
    let files = files(asked)?;
    if let Some(rows) = kept_rows(asked)? {
        return redraw(asked, rows);
    }
    if let Some(manifest) = configured(asked)? {
        check_outputs(&asked.common, &files)?;
        let analysis = begin(asked, &manifest, 0..=manifest.physics.step_count)?;
        return without_frames(asked, &manifest, analysis);
    }
    let common = with_enough_steps(asked)?;
    let mut session = Session::open(&common, asked.offer.name, &files)?;
    let manifest = session.manifest().clone();
    let mut analysis = begin(asked, &manifest, recorded(asked, session.steps()))?;
    if !analysis.wants_frames() {
        return without_frames(asked, &manifest, analysis);
    }
    let mut outputs = Outputs::open(asked, &*analysis, &manifest, Some(&session))?;
    let tally = session.follow(&mut Following { analysis: &mut *analysis, outputs: &mut outputs })?;

    match analysis.finish(&mut outputs) {
        Ok(()) => {}
        Err(refusal) if tally.end == EndReason::Stopped => {
            return Err(Failure::Stopped(anyhow!("stopped: {refusal}")));
        }
        Err(refusal) => return Err(refused(refusal)),
    }
    let kept = outputs.finish(tally.end, tally.last_missed)?;
    draw(&common, || kept.figure(&manifest, asked.offer, &mut *analysis))?;
    let Report { title, words, results, notices, is_lossy } = kept.report(asked.offer, &mut *analysis);
    notices.iter().for_each(display::notice);
    let done = session.report(&tally, title, words, results)?;
    Ok(if is_lossy { Done::Lossy } else { done })
}

/// Those of `steps` that a recording has: one that ended early has not all that its run was to have.
fn recorded(asked: &AskedAnalysis, steps: RangeInclusive<u64>) -> RangeInclusive<u64> {
    let Named::File(path) = &asked.common.frames.source else { return steps };
    match RecordingInfo::read(path).ok().and_then(|info| info.last_step) {
        Some(last) if steps.contains(&last) => *steps.start()..=last,
        _ => steps,
    }
}

/// Begins the analysis of a run.
fn begin(
    asked: &AskedAnalysis,
    manifest: &RunManifest,
    steps: RangeInclusive<u64>,
) -> Result<Box<dyn Analysis>, Failure> {
    let (settings, is_drawn, name) = (&asked.settings, !asked.common.figure.is_empty(), asked.offer.name);
    let beginning = Beginning { name, manifest, settings, steps, is_drawn, is_trial: false };
    (asked.offer.begin)(&beginning).map_err(refused)
}

fn refused(Refusal { setting, why }: Refusal) -> Failure {
    match setting {
        Some((setting, found)) => bad_input!("--{setting} {found}: {why}"),
        None => bad_input!("{why}"),
    }
}

/// The files of the tables, which are of the kinds that can be written.
fn files(asked: &AskedAnalysis) -> Result<Vec<&PathBuf>, Failure> {
    for (index, (table, files)) in asked.offer.tables.iter().zip(&asked.tables).enumerate() {
        if !keeps_rows(asked.offer, index) {
            check_tables(&files.iter().collect::<Vec<_>>())?;
            continue;
        }
        let mut known = [false; 2];
        for path in files {
            let place = match extension(path).as_str() {
                "csv" | "parquet" => 0,
                "mcap" => 1,
                _ => {
                    return Err(bad_input!(
                        "--{} {}: expected .csv or .parquet for counts, .mcap for the map",
                        table.name,
                        path.display()
                    ));
                }
            };
            if std::mem::replace(&mut known[place], true) {
                return Err(bad_input!("--{} {}: one table and one map at most", table.name, path.display()));
            }
        }
    }
    Ok(asked.tables.iter().flatten().collect())
}

/// Reports what no frame was needed for.
fn without_frames(
    asked: &AskedAnalysis,
    manifest: &RunManifest,
    mut analysis: Box<dyn Analysis>,
) -> Result<Done, Failure> {
    if analysis.wants_frames() {
        return Err(bad_input!(
            "what is asked for is about what happens in a run: name a recording or a live run, not a configuration"
        ));
    }
    if let Some(flag) = of_frames(&asked.common.frames).next() {
        return Err(bad_input!(
            "--{flag} chooses frames; what is asked for is about the chain, and reads none"
        ));
    }
    let mut outputs = Outputs::open(asked, &*analysis, manifest, None)?;
    analysis.finish(&mut outputs).map_err(refused)?;
    let kept = outputs.finish(EndReason::Complete, None)?;
    draw(&asked.common, || kept.figure(manifest, asked.offer, &mut *analysis))?;
    let Report { title, words, results, notices, .. } = kept.report(asked.offer, &mut *analysis);
    notices.iter().for_each(display::notice);
    let (name, mut rows) = (&manifest.provenance.name, words);
    rows.each("figure", asked.common.figure.iter().map(|path| path.display()));
    let figures = display::texts_of(&asked.common.figure);
    let all = json!({ "run": name, "figures": figures, "results": results });
    report(asked.common.frames.json, &all, || rows.under(format_args!("{title} of {name}")))?;
    Ok(Done::Whole)
}

/// The manifest of a configuration, if one is named and the analysis takes some.
fn configured(asked: &AskedAnalysis) -> Result<Option<RunManifest>, Failure> {
    if let Some(name) = &asked.preset {
        return Ok(Some(RunManifest::new(&preset(name)?.config(), name, origin()).bad_input()?));
    }
    match &asked.common.frames.source {
        Named::File(path) if asked.offer.needs.takes_configurations && extension(path) == "toml" => {
            read(path).map(Some)
        }
        _ => Ok(None),
    }
}

fn read(path: &Path) -> Result<RunManifest, Failure> {
    let unreadable = || format!("{} cannot be read", path.display());
    let text = schemas::text::read(path).with_context(unreadable).bad_input()?;
    let located = |error: ConfigError| error.located(&text, Some(path));
    let config = RunConfig::of_chain(&text).map_err(located).bad_input()?;
    let mut config = experiments::prepared(config, path.parent()).map_err(located).bad_input()?;
    let is_moved = !config.striker.is_none() || !config.initial.is_none() || !config.drive.is_empty();
    if !is_moved && config.load.is_none() {
        // what is no run: its modes are the same whatever strikes it
        config.striker.velocity_m_s = 1.0;
    }
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let mut manifest = RunManifest::new(&config, &stem, origin()).map_err(located).bad_input()?;
    if !is_moved {
        manifest.physics.striker.velocity_m_s = 0.0;
    }
    Ok(manifest)
}

/// The arguments, with all that a recording lacks which has too few frames for the analysis: its frames if they are
/// enough, else every step.
fn with_enough_steps(asked: &AskedAnalysis) -> Result<AnalysisArgs, Failure> {
    let mut common = asked.common.clone();
    let (offer, frames) = (asked.offer, &mut common.frames);
    let (Some(longest), Named::File(path)) = (offer.needs.longest_interval_steps, &frames.source) else {
        return Ok(common);
    };
    if frames.every_step || frames.fill_gaps {
        return Ok(common);
    }
    let source = RecordingSource::open(path).bad_input()?;
    let manifest = source.manifest();
    let is_coarse = |interval: u64| longest(manifest).is_some_and(|longest| interval > longest);
    let interval = manifest.provenance.record_every_steps;
    if !is_coarse(interval) {
        return Ok(common);
    }
    let few = format!("the recording has one step in {interval}, too few to follow {}", offer.name);
    if asked.as_recorded {
        notice!("{few}; nothing is recomputed, as asked by --as-recorded");
    } else if let Err(error) = check_kernel(manifest) {
        notice!("{few}; the steps between are not recomputed: {error}");
    } else if is_coarse(manifest.provenance.publish_every_steps) {
        notice!("{few}; the steps between are recomputed");
        frames.every_step = true;
    } else {
        notice!("{few}; the frames between are recomputed");
        frames.fill_gaps = true;
    }
    Ok(common)
}

/// The rows that the analysis kept before, if the source holds them and no states. An unreadable file is reported when
/// it is opened.
fn kept_rows(asked: &AskedAnalysis) -> Result<Option<ContactsReader>, Failure> {
    let Named::File(path) = &asked.common.frames.source else { return Ok(None) };
    let topic = format!("/{}", asked.offer.name);
    let is_kept = |info: RecordingInfo| info.messages(&topic) > 0 && info.messages("/state") == 0;
    if !asked.offer.needs.takes_own_rows || !RecordingInfo::read(path).is_ok_and(is_kept) {
        return Ok(None);
    }
    check_flags(&asked.common.frames)?;
    check_publishing(&asked.common)?;
    ContactsReader::open(path).bad_input().map(Some)
}

/// The flags that choose frames, as far as they are given.
fn of_frames(frames: &FramesArgs) -> impl Iterator<Item = &'static str> {
    let flags = [
        ("from", frames.from > 0.0),
        ("until", frames.until.is_some()),
        ("from-start", frames.from_start),
        ("fill-gaps", frames.fill_gaps),
        ("every-step", frames.every_step),
        ("jobs", frames.jobs.is_some()),
    ];
    flags.into_iter().filter(|(_, is_given)| *is_given).map(|(flag, _)| flag)
}

/// Draws and counts rows that were kept.
fn redraw(asked: &AskedAnalysis, mut kept: ContactsReader) -> Result<Done, Failure> {
    let common = &asked.common;
    let frames = &common.frames;
    let what = "the source is a map of contacts";
    if asked.tables.iter().any(|files| !files.is_empty()) {
        return Err(bad_input!("--out: {what} already; give the recording of the run instead"));
    }
    let set =
        asked.offer.settings.iter().map(|setting| setting.name).filter(|name| asked.settings.is_set(name));
    if let Some(flag) = of_frames(frames).chain(set).next() {
        return Err(bad_input!("--{flag}: {what}; give the recording of the run instead"));
    }
    check_outputs(common, &[])?;
    let manifest = kept.manifest().clone();
    let mut analysis = begin(asked, &manifest, 0..=manifest.physics.step_count)?;
    let mut row_count = 0;
    while let Some(row) = kept.next_row().bad_input()? {
        analysis.recall(row.step, row.tolerance_m, RowValues::Classes(row.classes));
        row_count += 1;
    }
    let end = kept.end_reason();
    let rows = Kept::default();
    draw(common, || rows.figure(&manifest, asked.offer, &mut *analysis))?;
    let Report { words, results, .. } = rows.report(asked.offer, &mut *analysis);
    let Provenance { name, run_id, .. } = &manifest.provenance;
    let found =
        json!({ "run": name, "run_id": run_id, "rows": row_count, "end": end.as_str(), "results": results });
    report(frames.json, &found, || {
        let mut all = Rows::default();
        all.add("frames", count(row_count));
        all.append(words);
        all.each("figure", common.figure.iter().map(|path| path.display()));
        all.under(format_args!("map of contacts of {name} ({end})"))
    })?;
    Ok(Done::whole_if(end.is_orderly()))
}
