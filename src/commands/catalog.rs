//! `beadline catalog DIR|URL`: a table of recordings, a row for each, from their summaries.

use super::ls::{is_recording, summaries};
use crate::args::CatalogArgs;
use crate::display::count;
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::{check_free, check_tables};
use crate::progress::Progress;
use crate::report::{Rows, report};
use crate::signals;
use anyhow::{Context, anyhow};
use consumers::table::Kind::{Double, Integer, Word};
use consumers::table::{Cell, Column, Kind, Table};
use recording::{RecordingInfo, hex};
use schemas::config::StrikerConfig;
use serde::Serialize;
use serde_json::{Value, json};
use std::sync::atomic::Ordering;
use storage::{Listed, Listing, Skipped, list};

/// Rows that wait in memory for the ones before them.
const WINDOW: usize = 1024;

/// A column, and its value for a recording.
type Of = (&'static str, Kind, fn(&RecordingInfo) -> Cell);

/// After `path` and `bytes`, and before `error`. A name has its unit.
const COLUMNS: [Of; 44] = [
    ("run", Word, |it| word(it.manifest.provenance.name.as_str())),
    ("run_id", Word, |it| word(it.manifest.provenance.run_id.to_string())),
    ("part", Integer, |it| Cell::Integer(it.begin.part)),
    ("finished", Integer, |it| flag(it.finished)),
    ("complete", Integer, |it| flag(it.is_complete())),
    ("end", Word, |it| if_any(it.end.as_ref(), |end| word(end.reason.as_str()))),
    ("first_step", Integer, |it| if_any(it.first_step, Cell::Integer)),
    ("last_step", Integer, |it| if_any(it.last_step, Cell::Integer)),
    ("first_time_s", Double, |it| if_any(it.time_range_s(), |(first, _)| Cell::Double(first))),
    ("last_time_s", Double, |it| if_any(it.time_range_s(), |(_, last)| Cell::Double(last))),
    ("states", Integer, |it| if it.finished { Cell::Integer(it.frames()) } else { Cell::Empty }),
    ("publish_every_steps", Integer, |it| Cell::Integer(it.manifest.provenance.publish_every_steps)),
    ("record_every_steps", Integer, |it| Cell::Integer(it.manifest.provenance.record_every_steps)),
    ("results", Word, results),
    ("beads", Integer, |it| Cell::Integer(it.manifest.physics.beads)),
    ("bead_mass_kg", Double, |it| Cell::Double(it.manifest.physics.bead_mass_kg)),
    ("alpha", Double, |it| of_the_law(it, it.manifest.physics.alpha)),
    ("stiffness", Double, |it| of_the_law(it, it.manifest.physics.stiffness)),
    ("impurities", Integer, |it| Cell::Integer(it.manifest.physics.impurities.len() as u64)),
    ("impurity_bead", Integer, |it| {
        if_any(it.manifest.physics.impurities.first(), |first| Cell::Integer(first.bead))
    }),
    ("impurity_mass_kg", Double, |it| {
        if_any(it.manifest.physics.impurities.first(), |first| Cell::Double(first.mass_kg))
    }),
    ("strikers", Integer, |it| Cell::Integer(strikers(it).count() as u64)),
    ("striker_bead", Integer, |it| if_any(strikers(it).next(), |first| Cell::Integer(first.bead))),
    ("striker_velocity_m_s", Double, |it| {
        if_any(strikers(it).next(), |first| Cell::Double(first.velocity_m_s))
    }),
    ("left_end", Word, |it| json_word(&it.manifest.physics.ends.left)),
    ("right_end", Word, |it| json_word(&it.manifest.physics.ends.right)),
    ("precompression_n", Double, |it| Cell::Double(it.manifest.physics.load.precompression_n)),
    ("gravity_m_s2", Double, |it| Cell::Double(it.manifest.physics.load.gravity_m_s2)),
    ("damping", Word, |it| if_any(it.manifest.physics.damping.as_ref(), json_word)),
    ("disorder", Word, |it| {
        let disorder = &it.manifest.physics.disorder;
        if disorder.is_empty() { Cell::Empty } else { json_word(disorder) }
    }),
    ("seed", Integer, |it| Cell::Integer(it.manifest.physics.seed)),
    ("drives", Integer, |it| Cell::Integer(it.manifest.physics.drives.len() as u64)),
    ("besides", Word, |it| {
        let particulars = it.manifest.physics.particulars();
        if particulars.is_empty() { Cell::Empty } else { word(particulars.join(", ")) }
    }),
    ("method", Word, |it| word(it.manifest.physics.method.to_string())),
    ("dt_s", Double, |it| Cell::Double(it.manifest.physics.dt_s)),
    ("steps", Integer, |it| Cell::Integer(it.manifest.physics.step_count)),
    ("duration_s", Double, |it| Cell::Double(it.manifest.physics.time_s(it.manifest.physics.step_count))),
    ("kernel_version", Integer, |it| Cell::Integer(it.manifest.physics.kernel_version.into())),
    ("physics_sha256", Word, |it| word(hex(&it.manifest.physics.hash()))),
    ("program", Word, |it| word(&it.manifest.provenance.program)),
    ("host", Word, |it| word(&it.manifest.provenance.host)),
    ("started_unix_ns", Integer, |it| Cell::Integer(it.manifest.provenance.started_unix_ns)),
    ("schema_version", Word, |it| word(it.manifest.schema_version.to_string())),
    ("uncompressed_bytes", Integer, |it| {
        if it.finished { Cell::Integer(it.uncompressed_bytes) } else { Cell::Empty }
    }),
];

pub(crate) fn catalog(args: &CatalogArgs) -> Result<Done, Failure> {
    check_tables(&[&args.out])?;
    check_free(&args.out, args.force)?;
    let stop = signals::bounded_stop_flag()?;
    let root = || args.root.display().to_string();
    let Listing { entries, skipped, skipped_count, .. } =
        list(&args.root, is_recording).with_context(root).bad_input()?;
    let around = |name: &str, kind| Column::new(name, kind);
    let columns = COLUMNS.iter().map(|(name, kind, _)| around(name, *kind));
    let columns: Vec<_> =
        [around("path", Word), around("bytes", Integer)].into_iter().chain(columns).collect();
    let columns = [columns, vec![around("error", Word)]].concat();
    let mut table = Table::create(&args.out, &columns, args.force)?;
    let mut progress = Progress::new(entries.len() as u64, "recordings");
    let (mut done, mut error_count) = (0, 0);
    for window in entries.chunks(WINDOW) {
        let paths: Vec<_> = window.iter().map(|entry| entry.path.as_path()).collect();
        for (entry, info) in window.iter().zip(summaries(&paths)) {
            error_count += u64::from(!add_row(&mut table, entry, &info));
            table.end_row()?;
            done += 1;
            progress.at(done);
        }
        if stop.load(Ordering::Relaxed) {
            table.discard();
            return Err(Failure::Stopped(anyhow!("stopped: no table was written")));
        }
    }
    progress.finish();
    for Skipped { name, why } in &skipped {
        table.word(name).empty();
        add_error(&mut table, why);
        table.end_row()?;
    }
    done += skipped.len() as u64;
    error_count += skipped_count;
    if skipped_count > skipped.len() as u64 {
        notice!("{} are left out, of which the table names {}", count(skipped_count), skipped.len());
    }
    let path = table.finish()?;
    let text = || {
        let mut rows = Rows::default();
        rows.add("recordings", count(done));
        rows.add("with errors", count(error_count));
        rows.under(path.display())
    };
    let found = json!({ "path": path.to_string_lossy(), "recordings": done, "errors": error_count });
    report(args.json, &found, text)?;
    Ok(Done::whole_if(error_count == 0))
}

/// Adds the cells of a row; whether nothing is wrong.
fn add_row(table: &mut Table, entry: &Listed, info: &Result<RecordingInfo, String>) -> bool {
    table.word(&entry.path.to_string_lossy()).integer(entry.bytes);
    let error = match info {
        Ok(info) => {
            for (_, _, of) in &COLUMNS {
                table.cell(of(info));
            }
            info.damage.clone()
        }
        Err(error) => {
            add_error(table, error);
            return false;
        }
    };
    table.cell(error.as_deref().map_or(Cell::Empty, word));
    error.is_none()
}

/// Adds the cells of a file that cannot be read, behind its path and size.
fn add_error(table: &mut Table, error: &str) {
    for _ in &COLUMNS {
        table.empty();
    }
    table.cell(word(error));
}

/// The topics of results, in the order of the file.
fn results(info: &RecordingInfo) -> Cell {
    let own = ["/chain", "/state", "/summary"];
    let topics: Vec<_> = info
        .channels
        .iter()
        .map(|channel| channel.topic.as_str())
        .filter(|topic| !own.contains(topic))
        .collect();
    if topics.is_empty() { Cell::Empty } else { word(topics.join(" ")) }
}

/// The beads that move at first.
fn strikers(info: &RecordingInfo) -> impl Iterator<Item = &StrikerConfig> {
    let physics = &info.manifest.physics;
    std::iter::once(&physics.striker).chain(&physics.strikers).filter(|striker| striker.velocity_m_s != 0.0)
}

fn word(text: impl Into<String>) -> Cell {
    Cell::Word(text.into())
}

fn flag(is_so: bool) -> Cell {
    Cell::Integer(is_so.into())
}

fn if_any<T>(value: Option<T>, cell: impl FnOnce(T) -> Cell) -> Cell {
    value.map_or(Cell::Empty, cell)
}

/// A number of the power law, which a chain of bonds does not have.
fn of_the_law(it: &RecordingInfo, number: f64) -> Cell {
    if it.manifest.physics.bonds.is_some() { Cell::Empty } else { Cell::Double(number) }
}

/// As the manifest has it: a word as it is, anything else as JSON.
fn json_word(value: &impl Serialize) -> Cell {
    match serde_json::to_value(value) {
        Ok(Value::String(text)) => Cell::Word(text),
        Ok(value) => word(value.to_string()),
        Err(_) => Cell::Empty,
    }
}
