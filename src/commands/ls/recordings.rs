//! `beadline ls DIR|URL`: the recordings there, from their beginnings and summaries.

use crate::display::{self, aligned, bytes, count, counted, seconds};
use crate::failure::{BadInput, Done, Failure, words_of};
use crate::threads;
use anyhow::Context as _;
use recording::RecordingInfo;
use schemas::frame::EndReason;
use schemas::whole_file::is_being_written;
use serde_json::json;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use storage::{Listed, Listing, Skipped};

/// Recordings that are looked at together: each waits for its disk, or for a store.
const AT_ONCE: usize = 16;

/// Columns, and whether one is left out where the terminal is too narrow: the highest number first.
const COLUMNS: [(&str, u32); 8] = [
    ("FILE", 0),
    ("RUN", 1),
    ("BEADS", 2),
    ("STEPS", 0),
    ("STATES", 1),
    ("TIME", 3),
    ("SIZE", 0),
    ("STATE", 0),
];

/// A recording, or why it cannot be read.
type Glanced = Result<RecordingInfo, String>;

pub(super) fn ls(place: &Path, as_json: bool, names_only: bool) -> Result<Done, Failure> {
    let Listing { entries, skipped, skipped_count, seen_count } =
        recordings(place).with_context(|| format!("cannot list {}", place.display())).bad_input()?;
    tell_skipped(&skipped, skipped_count);
    let paths: Vec<_> = entries.into_iter().map(|entry| entry.path).collect();
    if names_only {
        paths.iter().try_for_each(|path| display::print(format_args!("{}\n", in_a_line(path))))?;
        return Ok(Done::whole_if(skipped_count == 0));
    }
    let found = summaries(&paths.iter().map(PathBuf::as_path).collect::<Vec<_>>());
    let is_whole = found.iter().all(Result::is_ok) && skipped_count == 0;
    found.iter().filter_map(|found| found.as_ref().err()).for_each(|why| notice!("{why}"));
    let rows = paths.iter().zip(&found);
    if as_json {
        display::print_json(&rows.map(|(path, found)| to_json(path, found)).collect::<Vec<_>>())?;
    } else if found.is_empty() {
        notice!("no recordings among the {} in {}", counted(seen_count, "file"), place.display());
    } else {
        let rows = rows.map(|(path, found)| cells(path, found, place)).collect();
        display::print(aligned(COLUMNS, rows, display::columns_of_stdout()).concat())?;
    }
    Ok(Done::whole_if(is_whole))
}

/// Everything at `place` that has the name of a recording.
fn recordings(place: &Path) -> std::io::Result<Listing> {
    if is_recording(place) && !place.is_dir() {
        let entries = vec![Listed { path: place.to_owned(), bytes: 0 }];
        return Ok(Listing { entries, seen_count: 1, ..Listing::default() });
    }
    storage::list(place, is_recording)
}

/// Reports the paths that cannot be read, with their reasons.
pub(crate) fn tell_skipped(skipped: &[Skipped], skipped_count: u64) {
    for Skipped { name, why } in skipped {
        notice!("{name} is left out: {why}");
    }
    let more = skipped_count - skipped.len() as u64;
    if more > 0 {
        notice!("{} more are left out for such reasons", count(more));
    }
}

/// True if `path` has the name of a recording, finished or not.
pub(crate) fn is_recording(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.ends_with(".mcap") || name.ends_with(".mcap.partial")
}

/// Summaries of recordings, in the order of `paths`, read several at a time.
pub(crate) fn summaries(paths: &[&Path]) -> Vec<Glanced> {
    threads::each(paths, AT_ONCE, |path| glance(path, RecordingInfo::summary))
}

/// The result of `look` at the recording at `path`, or a sentence for its row: one file's failure does not affect
/// others.
pub(crate) fn glance<T, E>(path: &Path, look: impl FnOnce(&Path) -> Result<T, E>) -> Result<T, String>
where
    E: std::error::Error + Send + Sync + 'static,
{
    match catch_unwind(AssertUnwindSafe(|| look(path))) {
        Ok(found) => found.map_err(|error| format!("{:#}", anyhow::Error::new(error))),
        Err(panic) => Err(format!(
            "{}: the reader went wrong ({}): that is a defect of Beadline, please report it with this file",
            path.display(),
            words_of(&*panic)
        )),
    }
}

/// Its end, in a word or two.
fn state(info: &RecordingInfo) -> String {
    match &info.end {
        None if is_being_written(&info.path) => "being written".to_owned(),
        None => "not closed".to_owned(),
        Some(_) if info.is_complete() => "complete".to_owned(),
        Some(end) if end.reason == EndReason::Continued || info.begin.part > 1 => {
            format!("part {}", info.begin.part)
        }
        Some(end) if end.reason == EndReason::Complete => match info.begin.first_step {
            0 => "not whole".to_owned(),
            first => format!("from step {}", count(first)),
        },
        Some(end) => end.reason.to_string(),
    }
}

/// A path in one line, whatever is in it.
fn in_a_line(path: &Path) -> String {
    path.display().to_string().replace('\n', "\\n")
}

fn cells(path: &Path, found: &Glanced, place: &Path) -> [String; COLUMNS.len()] {
    let shown = path.strip_prefix(place).ok().filter(|path| !path.as_os_str().is_empty()).unwrap_or(path);
    let Ok(info) = found else {
        // the reason, which is longer than a row, is told beside the table
        let mut cells = [const { String::new() }; COLUMNS.len()];
        (cells[0], cells[COLUMNS.len() - 1]) = (in_a_line(shown), "cannot be read".to_owned());
        return cells;
    };
    let (physics, provenance) = (&info.manifest.physics, &info.manifest.provenance);
    let all = count(physics.step_count);
    let steps = match info.last_step {
        Some(last) if last == physics.step_count => all.to_string(),
        Some(last) => format!("{} of {all}", count(last)),
        None => format!("? of {all}"),
    };
    let every = match provenance.record_every_steps {
        1 => "every step".to_owned(),
        every => format!("every {}", counted(every, "step")),
    };
    [
        in_a_line(shown),
        provenance.name.to_string(),
        count(physics.beads).to_string(),
        steps,
        every,
        info.time_range_s().map_or_else(|| "–".to_owned(), |(_, last_s)| seconds(last_s)),
        bytes(info.file_bytes).to_string(),
        state(info),
    ]
}

fn to_json(path: &Path, found: &Glanced) -> serde_json::Value {
    let info = match found {
        Ok(info) => info,
        Err(why) => return json!({ "path": path.to_string_lossy(), "error": why }),
    };
    let (physics, provenance) = (&info.manifest.physics, &info.manifest.provenance);
    json!({
        "path": info.path.to_string_lossy(),
        "name": provenance.name,
        "run_id": provenance.run_id,
        "beads": physics.beads,
        "step_count": physics.step_count,
        "first_step": info.first_step,
        "last_step": info.last_step,
        "time_range_s": info.time_range_s(),
        "states": info.finished.then(|| info.frames()),
        "record_every_steps": provenance.record_every_steps,
        "file_bytes": info.file_bytes,
        "part": info.begin.part,
        "finished": info.finished,
        "complete": info.is_complete(),
        "being_written": is_being_written(&info.path),
        "end_reason": info.end.as_ref().map(|end| end.reason.as_str()),
    })
}
