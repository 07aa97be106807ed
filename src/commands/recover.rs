//! `beadline recover FILE --out FILE`: a whole recording from a damaged or unfinished one.

use crate::args::RecoverArgs;
use crate::commands::verify::run_toml::RunToml;
use crate::commands::verify::{Verified, damage_text, frames, verify_file};
use crate::display::{self, bytes, count, counted};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::check_place;
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use crate::threads;
use anyhow::{Context, anyhow};
use producer::recovery::{Recovery, RecoveryError, recover as recover_states};
use recording::{Audit, Audited, Finished, RecordingWriter, WriteOptions};
use schemas::manifest::RunManifest;
use schemas::whole_file::give_name;
use serde_json::json;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use storage::{is_url, open_file};

pub(crate) fn recover(args: &RecoverArgs) -> Result<Done, Failure> {
    let (from, to, force) = (args.file.as_path(), args.output.out.as_path(), args.output.force);
    let outcome = recover_file(from, to, !args.no_fill, force, &signals::stop_flag()?)?;
    report(args.output.json, &to_json(&outcome), || text(from, &outcome))?;
    Ok(Done::whole_if(outcome.is_whole()))
}

/// Makes the whole recording `to` of the recording `from`; frames that are lost are recomputed if `fill`.
pub(crate) fn recover_file(
    from: &Path,
    to: &Path,
    fill: bool,
    force: bool,
    stop: &Arc<AtomicBool>,
) -> Result<Outcome, Failure> {
    // held from before it is opened, so that no run begins to write it
    let locked = if from.is_file() { Some(lock(from)?) } else { None };
    let audit = Audit::open(from).bad_input()?;
    let manifest = audit.manifest().clone();
    display::notice_of_version(&manifest);
    check_place(to, Some(from), force)?;
    let (begin, mut run_toml) = Audit::head(from).bad_input()?;
    let lying_toml = match RunToml::compare(run_toml.as_deref(), &manifest) {
        RunToml::Differs(differs) => differs,
        _ => Vec::new(),
    };
    if !lying_toml.is_empty() {
        run_toml = None;
    }
    let expected = Audit::expected_counts(from);
    let there = from.canonicalize();
    let is_locked = |locked: &File| there.as_ref().is_ok_and(|there| system::is_at(locked, there));
    if !is_url(from) && !locked.as_ref().is_some_and(is_locked) {
        return Err(Failure::Failed(anyhow!(
            "{} was replaced or moved meanwhile; nothing was written",
            from.display()
        )));
    }
    let no_state =
        || bad_input!("{} has no state that can be read, so there is nothing to recover", from.display());
    // before anything is allocated in the size that the manifest claims
    if !has_a_state(from)? {
        return Err(no_state());
    }
    let place = working_place(from, to);
    let options = WriteOptions { force, ..WriteOptions::default() };
    let mut writer = RecordingWriter::create_from(&place, &manifest, run_toml.as_deref(), &begin, &options)?;
    let mut progress = Progress::of_run(&manifest);
    let mut watch = |step| {
        progress.at(step);
        !stop.load(Ordering::Relaxed)
    };
    let recovered = recover_states(audit, &begin, fill, expected.as_ref(), &mut writer, &mut watch);
    progress.finish();
    let recovery = match recovered {
        Ok(recovery) => recovery,
        Err(error) => {
            // a part under the whole one's name would be taken for it
            writer.discard();
            return Err(match error {
                RecoveryError::Stopped => Failure::stopped(),
                error => Failure::Failed(error.into()),
            });
        }
    };
    if recovery.last_step.is_none() {
        writer.discard();
        return Err(no_state());
    }
    if recovery.manifest_fits_no_state() {
        writer.discard();
        let first = recovery.differences.first().map(|first| format!(": {first}")).unwrap_or_default();
        return Err(Failure::Failed(anyhow!(
            "the manifest of {} fits none of its states after step 0{first}. Either was changed, and what the manifest leads to would be \
             another run; nothing was written",
            from.display()
        )));
    }
    let mut finished = writer.finish(recovery.end)?;
    if place != to {
        give_name(&place, to, force).with_context(|| format!("the result stays in {}", place.display()))?;
        to.clone_into(&mut finished.path);
    }
    // the file that it was made from may be wrong in more ways than can be repaired
    let verified = verify_file(&finished.path, None, threads::or_cores(None), stop)?;
    Ok(Outcome { manifest, recovery, finished, lying_toml, verified })
}

/// Result of recovering.
pub(crate) struct Outcome {
    manifest: RunManifest,
    recovery: Recovery,
    finished: Finished,
    /// Differences between the configuration in the file and its manifest; the configuration was then left out.
    lying_toml: Vec<String>,
    /// The new recording.
    verified: Verified,
}

impl Outcome {
    /// True if everything in the file was correct, and is in the new one.
    pub(crate) fn is_whole(&self) -> bool {
        self.recovery.is_whole() && self.lying_toml.is_empty() && !self.verified.is_refuted()
    }
}

/// True if a state of the run can be read in the file.
fn has_a_state(path: &Path) -> Result<bool, Failure> {
    let mut audit = Audit::open(path).bad_input()?;
    loop {
        match audit.read_next().bad_input()? {
            Audited::State(_) => return Ok(true),
            Audited::End => return Ok(false),
            Audited::Summary(_) | Audited::Other(_) => {}
        }
    }
}

/// Locks the source against writers; fails while one lives.
fn lock(path: &Path) -> Result<File, Failure> {
    let file = open_file(path).with_context(|| path.display().to_string()).map_err(Failure::BadInput)?;
    match file.try_lock_shared() {
        Err(TryLockError::WouldBlock) => Err(Failure::Failed(anyhow!(
            "{} is being written by a process that lives; wait for its end",
            path.display()
        ))),
        // file systems without locks do without
        _ => Ok(file),
    }
}

/// Path at which the new recording is written: its own name, unless its `.partial` would be the source.
fn working_place(from: &Path, to: &Path) -> PathBuf {
    let with = |suffix: &str| {
        let mut name = OsString::from(to);
        name.push(suffix);
        PathBuf::from(name)
    };
    let is_source = from.canonicalize().is_ok_and(|from| with(".partial").canonicalize().ok() == Some(from));
    if is_source { with(".recovered") } else { to.to_owned() }
}

fn text(from: &Path, outcome: &Outcome) -> String {
    let Outcome { manifest, recovery, finished, lying_toml, verified } = outcome;
    let mut rows = Rows::default();
    rows.add("states", states(recovery));
    if let Some(last) = recovery.last_step {
        let (last, all) = (count(last), count(manifest.physics.step_count));
        rows.add("ends", format_args!("at step {last} of {all} ({})", recovery.end));
    }
    rows.each("damaged", recovery.damages.iter().map(damage_text));
    rows.more("damaged", recovery.damage_count, recovery.damages.len(), "");
    rows.each("recomputed", recovery.recomputed.iter().map(|(from, to)| frames(*from, Some(*to))));
    rows.each("differed", &recovery.differences);
    rows.more("differed", recovery.difference_count, recovery.differences.len(), "");
    if recovery.unproven_count > 0 {
        let what = "states without a checksum that do not follow from the one before: not used";
        rows.add("unproven", format_args!("{} {what}", count(recovery.unproven_count)));
    }
    rows.each("unproven", recovery.other_kernel);
    for (topic, counts) in &recovery.others {
        let lost = if counts.lost > 0 { format!(", {} LOST", count(counts.lost)) } else { String::new() };
        rows.add("channel", format_args!("{topic}: {} kept{lost}", counted(counts.kept, "message")));
    }
    rows.each("kept", &recovery.kept_records);
    rows.each("LOST", &recovery.lost_records);
    rows.each("LOST", recovery.lost.iter().map(|(from, to)| frames(*from, *to)));
    rows.more("LOST", recovery.lost_count, recovery.lost.len(), "");
    if recovery.is_whole() {
        rows.add("lost", "nothing that was in the file");
    }
    rows.each("left out", lying_toml.iter().map(|what| format!("run.toml: {what}")));
    rows.add("size", bytes(finished.bytes));
    rows.add("verified", verified.verdict());
    verified.add_refutations(&mut rows);
    rows.under(format_args!("{} recovered: {}", from.display(), finished.path.display()))
}

fn states(recovery: &Recovery) -> String {
    // writing to a String cannot fail
    let mut text = format!("{} kept", count(recovery.kept_count));
    if recovery.proven_without_checksum_count > 0 {
        let proven = count(recovery.proven_without_checksum_count);
        let _ = write!(text, " ({proven} of them from a damaged chunk, proven)");
    }
    if recovery.recomputed_count > 0 {
        let _ = write!(text, ", {} recomputed bit for bit", count(recovery.recomputed_count));
    }
    text
}

fn to_json(outcome: &Outcome) -> serde_json::Value {
    let Outcome { manifest, recovery, finished, lying_toml, verified } = outcome;
    let others = recovery.others.iter();
    let others = others.map(|(topic, counts)| (topic, json!({ "kept": counts.kept, "lost": counts.lost })));
    json!({
        "path": finished.path.to_string_lossy(),
        "bytes": finished.bytes,
        "run": manifest.provenance.name,
        "run_id": manifest.provenance.run_id,
        "whole": recovery.is_whole(),
        "states": finished.frames,
        "states_kept": recovery.kept_count,
        "states_proven_without_checksum": recovery.proven_without_checksum_count,
        "states_recomputed": recovery.recomputed_count,
        "recomputed_frames": recovery.recomputed,
        "states_unproven": recovery.unproven_count,
        "difference_count": recovery.difference_count,
        "differences": recovery.differences,
        "lost_count": recovery.lost_count,
        "lost_frames": recovery.lost,
        "other_channels": others.collect::<BTreeMap<_, _>>(),
        "other_records": { "kept": recovery.kept_records, "lost": recovery.lost_records },
        "damage_count": recovery.damage_count,
        "damages": recovery.damages,
        "other_kernel": recovery.other_kernel.map(|other| other.found),
        "last_step": recovery.last_step,
        "end": recovery.end.as_str(),
        "end_was_read": recovery.end_was_read,
        "run_toml_differences": lying_toml,
        "verified": { "proven": verified.is_proven(), "verdict": verified.verdict() },
    })
}
