//! `beadline verify FILE…`: whether every state of a recording is what the state before it leads to, and what else is
//! known of it.

mod lists;
pub(crate) mod rows;
pub(crate) mod run_toml;

use crate::args::VerifyArgs;
use crate::display::{self, bytes, count, seconds};
use crate::failure::{BadInput, Done, Failure};
use crate::progress::Progress;
use crate::report::Rows;
use crate::resumption::hindrance;
use crate::signals;
use crate::threads;
use lists::Lists;
use producer::verification::{Follows, Verification, follows, follows_the_run, verify as verify_states};
use recording::{Audit, Damage, DamageKind, RecordingInfo};
use rows::RowsChecked;
use run_toml::RunToml;
use schemas::frame::EndReason;
use schemas::whole_file::is_being_written;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A recording and what it was found to be.
pub(crate) struct Verified {
    path: PathBuf,
    file_bytes: u64,
    /// True if a living process goes on with it.
    is_being_written: bool,
    found: Verification,
    /// True if it was asked to stop before the rows of results were compared.
    is_stopped: bool,
    /// True if the file before it was named, too.
    is_later_part: bool,
    /// Result of comparing its begin with the end of the file before. Without a file before, and if it begins later than
    /// the run, the result of comparing its begin with the run.
    follows: Option<Follows>,
    /// The rows of results, against the states.
    rows: Vec<RowsChecked>,
    /// The configuration, against the manifest.
    toml: RunToml,
    /// Error in a part of the manifest that decides nothing.
    idle: Option<String>,
}

pub(crate) fn verify(args: &VerifyArgs) -> Result<Done, Failure> {
    let stop = signals::bounded_stop_flag()?;
    let threads = threads::or_cores(args.jobs);
    let mut files: Vec<Verified> = Vec::new();
    for path in &args.files {
        if !files.is_empty() && stop.load(Ordering::Relaxed) {
            break;
        }
        let file = verify_file(path, files.last(), threads, &stop)?;
        if !args.json {
            display::print(text(&file))?;
        }
        files.push(file);
    }
    if args.json {
        match files.as_slice() {
            [file] => display::print_json(&to_json(file))?,
            files => display::print_json(&files.iter().map(to_json).collect::<Vec<_>>())?,
        }
    }
    let all = files.len() == args.files.len() && files.iter().all(Verified::is_proven);
    Ok(Done::whole_if(all))
}

/// Verifies the recording `path`, perhaps as the part that follows `before`.
pub(crate) fn verify_file(
    path: &Path,
    before: Option<&Verified>,
    threads: NonZero<usize>,
    stop: &Arc<AtomicBool>,
) -> Result<Verified, Failure> {
    let is_being_written = is_being_written(path);
    let audit = Audit::open(path).bad_input()?;
    let manifest = audit.manifest();
    display::notice_of_version(manifest);
    let file_bytes = audit.file_bytes();
    let mut progress = Progress::of_run(manifest);
    let found = verify_states(audit, threads, stop, |step| {
        progress.at(step);
    });
    progress.finish();
    let found = found.bad_input()?;
    let follows = match before {
        Some(before) => Some(follows(&before.found, &found, stop)),
        None if found.step_range().is_some_and(|(first, _)| first > 0) => follows_the_run(&found, stop),
        None => None,
    };
    let rows = if found.rows.is_empty() || stop.load(Ordering::Relaxed) {
        Vec::new()
    } else {
        rows::check(path, &found, threads, stop)?
    };
    let toml = RunToml::compare(found.run_toml.as_deref(), &found.manifest);
    let idle = found.manifest.physics.check_scales_of_spheres().err().map(|error| error.to_string());
    let (path, is_later_part) = (path.to_owned(), before.is_some());
    let is_stopped = stop.load(Ordering::Relaxed) && !found.rows.is_empty();
    Ok(Verified {
        path,
        file_bytes,
        is_being_written,
        found,
        is_stopped,
        is_later_part,
        follows,
        rows,
        toml,
        idle,
    })
}

impl Verified {
    pub(crate) fn is_proven(&self) -> bool {
        let is_stopped = self.is_stopped;
        !is_stopped
            && self.found.is_proven()
            && self.is_sound()
            && self.follows.as_ref().is_none_or(Follows::is_proven)
    }

    /// True if this program finds nothing wrong with the file.
    fn is_sound(&self) -> bool {
        self.found.is_sound_so_far() && self.agrees_with_states()
    }

    /// True if the rows that are there, the configuration and the manifest agree with the states.
    fn agrees_with_states(&self) -> bool {
        self.rows.iter().all(|rows| rows.difference_count == 0)
            && !matches!(self.toml, RunToml::Differs(_))
            && self.idle.is_none()
    }

    fn is_proven_so_far(&self) -> bool {
        self.is_sound() && self.found.is_proven_so_far()
    }

    /// True if something in it is wrong, rather than not known.
    pub(crate) fn is_refuted(&self) -> bool {
        !self.is_sound() || matches!(self.follows, Some(Follows::Differs(_) | Follows::Not(_)))
    }

    pub(crate) fn verdict(&self) -> &'static str {
        let found = &self.found;
        if self.is_proven() {
            "proven"
        } else if self.is_sound()
            && (self.is_stopped || found.stopped_after.is_some() || self.follows == Some(Follows::Stopped))
        {
            "STOPPED before it was proven"
        } else if found.is_proven() && self.is_sound() && self.is_later_part {
            "proven by itself, but it does NOT FOLLOW the part before"
        } else if found.is_proven() && self.is_sound() {
            "proven from its first state on, but its BEGINNING IS NOT PROVEN"
        } else if self.is_proven_so_far() && self.is_being_written {
            "proven as far as it is written"
        } else if self.is_proven_so_far() {
            "proven as far as it goes, but it is NOT WHOLE"
        } else if self.is_sound() && found.end.is_orderly() {
            "whole, but it CANNOT BE PROVEN by this program"
        } else if self.is_sound() {
            "sound as far as it goes, but it is NOT WHOLE and CANNOT BE PROVEN by this program"
        } else if found.has_sound_states() && self.agrees_with_states() {
            "NOT PROVEN: rows of results are missing"
        } else {
            "NOT PROVEN"
        }
    }

    /// Adds rows about the errors of the file, for people.
    pub(crate) fn add_refutations(&self, rows: &mut Rows) {
        let found = &self.found;
        rows.each("differs", &found.differences);
        rows.more("differs", found.difference_count, found.differences.len(), " of the states");
        rows.each("differs", &found.summary_differences);
        let shown = found.summary_differences.len();
        rows.more("differs", found.summary_difference_count, shown, " of the summaries");
        if let (Some(said), Some(hash)) = (&found.wrong_end_hash, &found.last_state_hash) {
            let what = format_args!("the hash of the last state is {hash}, the end of the file says {said}");
            rows.add("differs", what);
        }
        for rows_of in &self.rows {
            rows.each("differs", &rows_of.differences);
            rows.more("differs", rows_of.difference_count, rows_of.differences.len(), " of the rows");
        }
        if let RunToml::Differs(differs) = &self.toml {
            rows.each("differs", differs);
        }
        rows.each("differs", self.idle.iter().map(|what| format!("the manifest, {what}")));
        rows.each("missing", found.missing.iter().map(|(from, to)| frames(*from, Some(*to))));
        for (topic, found) in &found.rows {
            let ranges = found.missing.iter().map(|(from, to)| frames(*from, Some(*to)));
            rows.each("missing", ranges.map(|range| format!("rows of `{topic}`: {range}")));
            rows.more("missing", found.missing_count, found.missing.len(), " of the ranges");
        }
        rows.more("missing", found.missing_count, found.missing.len(), " of the ranges");
        rows.each("damaged", self.damages().map(damage_text));
        rows.more("damaged", found.damage_count, found.damages.len(), " of the places");
    }

    /// The damages. A file that ends within a record while it is being written is not damaged.
    fn damages(&self) -> impl Iterator<Item = &Damage> {
        let is_open_end = |damage: &&Damage| self.is_being_written && damage.kind == DamageKind::Torn;
        self.found.damages.iter().filter(move |damage| !is_open_end(damage))
    }

    /// Advice about a file that is not whole.
    fn advice(&self) -> Vec<String> {
        let (found, path) = (&self.found, self.path.display());
        if self.is_being_written {
            return vec![
                "a process that lives is writing it: wait for its end, and verify it then".to_owned(),
            ];
        }
        if found.damage_count == 0 && (found.end.is_orderly() || found.stopped_after.is_some()) {
            return Vec::new();
        }
        let recover = format!("beadline recover {path} --out WHOLE.mcap");
        let resume = format!("beadline run --resume {path}, which goes on with the run");
        let can_go_on = found.damage_count == 0
            && found.end != EndReason::Failed
            && RecordingInfo::read(&self.path).is_ok_and(|info| hindrance(&info).is_none());
        match found.end {
            EndReason::Unfinished if can_go_on => vec![format!("{resume}; or"), recover],
            _ if can_go_on => vec![resume],
            // nothing would be left
            _ if found.state_count == 0 => Vec::new(),
            _ => vec![recover],
        }
    }

    /// Steps between the first and the last state.
    fn step_count(&self) -> u64 {
        let is_recomputed = self.found.other_kernel.is_none();
        let range = self.found.step_range().filter(|_| is_recomputed);
        range.map_or(0, |(first, last)| self.found.stopped_after.unwrap_or(last).saturating_sub(first))
    }
}

fn text(file: &Verified) -> String {
    let found = &file.found;
    let manifest = &found.manifest;
    let mut rows = Rows::default();
    rows.add("file", format_args!("{}, {}", file.path.display(), bytes(file.file_bytes)));
    rows.add("states", count(found.state_count));
    rows.add("steps recomputed", count(file.step_count()));
    if let Some((first, last)) = found.step_range() {
        rows.add("begins", begin(file, first));
        let (last, all) = (count(last), count(manifest.physics.step_count));
        let reason = if file.is_being_written { "being written" } else { found.end.as_str() };
        rows.add("ends", format_args!("at step {last} of {all} ({reason})"));
    }
    if let Some(step) = found.stopped_after {
        rows.add("stopped", format_args!("nothing is known of what comes after step {}", count(step)));
    }
    rows.each("follows", file.follows.as_ref().map(|follows| follows_text(follows, file.is_later_part)));
    let Lists { proven, compared, unknown } = Lists::of(file);
    rows.each("proven", proven);
    rows.each("compared", compared);
    rows.each("not known", unknown);
    rows.each("unproven", found.other_kernel);
    file.add_refutations(&mut rows);
    rows.each("next", file.advice());
    rows.under(format_args!("{}: {}", manifest.provenance.name, file.verdict()))
}

/// Describes the first state, and the state before it.
fn begin(file: &Verified, first: u64) -> String {
    let found = &file.found;
    if first == 0 {
        return "with the manifest's initial condition".to_owned();
    }
    let time = seconds(found.manifest.physics.time_s(first));
    let is_proven = file.follows.as_ref().is_some_and(Follows::is_proven);
    let taken = if is_proven { "" } else { ", which is taken as it is" };
    let begins = format!("with step {} ({time}){taken}", count(first));
    match &found.begin.previous_state_hash {
        Some(hash) => {
            format!("{begins}: it is part {}, which follows a state of hash {hash}", found.begin.part)
        }
        None => format!("{begins}: it follows what is not in this file"),
    }
}

fn follows_text(follows: &Follows, is_later_part: bool) -> String {
    match follows {
        Follows::Proven if !is_later_part => {
            "the run: its initial condition leads to the first state here".to_owned()
        }
        Follows::Differs(difference) if !is_later_part => format!("NOT the run: {difference}"),
        Follows::TooFar => {
            "not known: it begins too late in the run to recompute that; name the parts before it, too"
                .to_owned()
        }
        Follows::Proven => "the part before: its last state leads to the first one here".to_owned(),
        Follows::ByHash => "the part before, by the hash of its last state; not recomputed".to_owned(),
        Follows::Not(why) => format!("NOT the file before: {why}"),
        Follows::Stopped => "not known: stopped before that was computed".to_owned(),
        Follows::Differs(difference) => format!("NOT the part before: {difference}"),
    }
}

/// `frames 3 to 7`
pub(crate) fn frames(from: u64, to: Option<u64>) -> String {
    match to {
        Some(to) if to == from => format!("frame {}", count(from)),
        Some(to) => format!("frames {} to {}", count(from), count(to)),
        None => format!("frames from {} on", count(from)),
    }
}

/// A damage with its frames, and the times that its chunk's header names.
pub(crate) fn damage_text(damage: &Damage) -> String {
    // writing to a String cannot fail
    let mut text = damage.to_string();
    if let Some(lost) = damage.frames {
        let _ = write!(text, "; {}", frames(lost.from, lost.to));
    }
    if let Some((first, last)) = damage.time_range_ns {
        let at = |ns: u64| seconds(ns as f64 / 1e9);
        let _ = write!(text, " (its header says {} to {})", at(first), at(last));
    }
    text
}

fn to_json(file: &Verified) -> Value {
    let found = &file.found;
    let range = found.step_range();
    json!({
        "file": file.path.to_string_lossy(),
        "file_bytes": file.file_bytes,
        "run": found.manifest.provenance.name,
        "run_id": found.manifest.provenance.run_id,
        "proven": file.is_proven(),
        "verdict": file.verdict(),
        "states": found.state_count,
        "steps_recomputed": file.step_count(),
        "first_step": range.map(|(first, _)| first),
        "last_step": range.map(|(_, last)| last),
        "end": found.end.as_str(),
        "being_written": file.is_being_written,
        "stopped_after_step": found.stopped_after,
        "part": found.begin.part,
        "previous_state_hash": found.begin.previous_state_hash,
        "last_state_hash": found.last_state_hash,
        "end_state_hash": found.end_record.as_ref().and_then(|end| end.last_state_hash.clone()),
        "follows": file.follows.as_ref().map(|follows| json!({
            "proven": follows.is_proven(),
            "what": follows_text(follows, file.is_later_part),
        })),
        "checked": Lists::of(file),
        "rows": file.rows,
        "missing_rows": found.rows.iter().map(|(topic, rows)| (topic, &rows.missing)).collect::<BTreeMap<_, _>>(),
        "run_toml_differences": if let RunToml::Differs(differs) = &file.toml { differs.as_slice() } else { &[] },
        "manifest_difference": file.idle,
        "other_kernel": found.other_kernel.map(|other| other.found),
        "difference_count": found.difference_count,
        "differences": found.differences,
        "summary_difference_count": found.summary_difference_count,
        "summary_differences": found.summary_differences,
        "missing_count": found.missing_count,
        "missing_frames": found.missing,
        "damage_count": found.damage_count,
        "damages": found.damages,
    })
}
