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
use schemas::manifest::Physics;
use serde::Serialize;
use serde_json::{Value, json};
use std::sync::atomic::Ordering;
use storage::{Listing, Skipped, list};

/// Rows that wait in memory for the ones before them.
const WINDOW: usize = 1024;

/// A column, and its value for a recording of a run with some physics.
type Of = (&'static str, Kind, fn(&RecordingInfo, &Physics) -> Cell);

/// After `path` and `bytes`, and before `error`. A name has its unit.
const COLUMNS: [Of; 44] = [
    ("run", Word, |it, _| word(it.manifest.provenance.name.as_str())),
    ("run_id", Word, |it, _| word(it.manifest.provenance.run_id.to_string())),
    ("part", Integer, |it, _| integer(it.begin.part)),
    ("finished", Integer, |it, _| flag(it.finished)),
    ("complete", Integer, |it, _| flag(it.is_complete())),
    ("end", Word, |it, _| it.end.as_ref().map_or(Cell::Empty, |end| word(end.reason.as_str()))),
    ("first_step", Integer, |it, _| integer(it.first_step)),
    ("last_step", Integer, |it, _| integer(it.last_step)),
    ("first_time_s", Double, |it, _| double(it.time_range_s().map(|(first, _)| first))),
    ("last_time_s", Double, |it, _| double(it.time_range_s().map(|(_, last)| last))),
    ("states", Integer, |it, _| integer(it.finished.then(|| it.frames()))),
    ("publish_every_steps", Integer, |it, _| integer(it.manifest.provenance.publish_every_steps)),
    ("record_every_steps", Integer, |it, _| integer(it.manifest.provenance.record_every_steps)),
    ("results", Word, |it, _| results(it)),
    ("beads", Integer, |_, physics| integer(physics.beads)),
    ("bead_mass_kg", Double, |_, physics| double(physics.bead_mass_kg)),
    ("alpha", Double, |_, physics| of_the_law(physics, physics.alpha)),
    ("stiffness", Double, |_, physics| of_the_law(physics, physics.stiffness)),
    ("impurities", Integer, |_, physics| integer(physics.odd_beads().count() as u64)),
    ("impurity_bead", Integer, |_, physics| integer(physics.odd_beads().next().map(|first| first.bead))),
    ("impurity_mass_kg", Double, |_, physics| double(physics.odd_beads().next().map(|first| first.mass_kg))),
    ("strikers", Integer, |_, physics| integer(strikers(physics).count() as u64)),
    ("striker_bead", Integer, |_, physics| integer(strikers(physics).next().map(|first| first.bead))),
    ("striker_velocity_m_s", Double, |_, physics| {
        double(strikers(physics).next().map(|first| first.velocity_m_s))
    }),
    ("left_end", Word, |_, physics| json_word(&physics.ends.left)),
    ("right_end", Word, |_, physics| json_word(&physics.ends.right)),
    ("precompression_n", Double, |_, physics| double(physics.load.precompression_n)),
    ("gravity_m_s2", Double, |_, physics| double(physics.load.gravity_m_s2)),
    ("damping", Word, |_, physics| physics.damping.as_ref().map_or(Cell::Empty, json_word)),
    ("disorder", Word, |_, physics| {
        let disorder = &physics.disorder;
        if disorder.is_empty() { Cell::Empty } else { json_word(disorder) }
    }),
    ("seed", Integer, |_, physics| integer(physics.seed)),
    ("drives", Integer, |_, physics| integer(physics.drives.len() as u64)),
    ("besides", Word, |_, physics| {
        let particulars = physics.particulars();
        if particulars.is_empty() { Cell::Empty } else { word(particulars.join(", ")) }
    }),
    ("method", Word, |_, physics| word(physics.method.to_string())),
    ("dt_s", Double, |_, physics| double(physics.dt_s)),
    ("steps", Integer, |_, physics| integer(physics.step_count)),
    ("duration_s", Double, |_, physics| double(physics.time_s(physics.step_count))),
    ("kernel_version", Integer, |_, physics| integer(u64::from(physics.kernel_version))),
    ("physics_sha256", Word, |_, physics| word(hex(&physics.hash()))),
    ("program", Word, |it, _| word(&it.manifest.provenance.program)),
    ("host", Word, |it, _| word(&it.manifest.provenance.host)),
    ("started_unix_ns", Integer, |it, _| integer(it.manifest.provenance.started_unix_ns)),
    ("schema_version", Word, |it, _| word(it.manifest.schema_version.to_string())),
    ("uncompressed_bytes", Integer, |it, _| integer(it.finished.then_some(it.uncompressed_bytes))),
];

pub(crate) fn catalog(args: &CatalogArgs) -> Result<Done, Failure> {
    check_tables(&[&args.out])?;
    check_free(&args.out, args.force)?;
    let stop = signals::bounded_stop_flag()?;
    let root = || args.root.display().to_string();
    let Listing { entries, skipped, skipped_count, .. } =
        list(&args.root, is_recording).with_context(root).bad_input()?;
    let before = [Column::new("path", Word), Column::new("bytes", Integer)];
    let columns = COLUMNS.iter().map(|(name, kind, _)| Column::new(*name, *kind));
    let columns = before.into_iter().chain(columns).chain([Column::new("error", Word)]);
    let mut table = Table::create(&args.out, &columns.collect::<Vec<_>>(), args.force)?;
    let mut progress = Progress::new(entries.len() as u64, "recordings");
    let (mut done, mut error_count) = (0, 0);
    for window in entries.chunks(WINDOW) {
        let paths: Vec<_> = window.iter().map(|entry| entry.path.as_path()).collect();
        for (entry, info) in window.iter().zip(summaries(&paths)) {
            let is_whole = add_row(&mut table, &entry.path.to_string_lossy(), entry.bytes, info.as_ref())?;
            error_count += u64::from(!is_whole);
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
        add_row(&mut table, name, None::<u64>, Err(why))?;
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

/// Adds the row of a file, or of the reason why it cannot be read; true if nothing is wrong with it.
fn add_row(
    table: &mut Table,
    path: &str,
    bytes: impl Into<Option<u64>>,
    info: Result<&RecordingInfo, &String>,
) -> Result<bool, Failure> {
    let cell = |(_, _, of): &Of| info.map_or(Cell::Empty, |info| of(info, &info.manifest.physics));
    let error = info.map_or_else(Some, |info| info.damage.as_ref());
    let cells = [word(path), integer(bytes)].into_iter().chain(COLUMNS.iter().map(cell));
    let cells = cells.chain([error.map_or(Cell::Empty, word)]);
    table.add_row(&cells.collect::<Vec<_>>())?;
    Ok(error.is_none())
}

/// The topics of results, in the order of the file.
fn results(info: &RecordingInfo) -> Cell {
    let own = ["/chain", "/state", "/summary"];
    let topics = info.channels.iter().map(|channel| channel.topic.as_str());
    let topics: Vec<_> = topics.filter(|topic| !own.contains(topic)).collect();
    if topics.is_empty() { Cell::Empty } else { word(topics.join(" ")) }
}

/// The beads that move at first.
fn strikers(physics: &Physics) -> impl Iterator<Item = &StrikerConfig> {
    std::iter::once(&physics.striker).chain(&physics.strikers).filter(|striker| striker.velocity_m_s != 0.0)
}

fn word(text: impl Into<String>) -> Cell {
    Cell::Word(text.into())
}

fn flag(is_so: bool) -> Cell {
    Cell::Integer(is_so.into())
}

fn integer(value: impl Into<Option<u64>>) -> Cell {
    value.into().map_or(Cell::Empty, Cell::Integer)
}

fn double(value: impl Into<Option<f64>>) -> Cell {
    value.into().map_or(Cell::Empty, Cell::Double)
}

/// A number of the power law, which a chain of bonds does not have.
fn of_the_law(physics: &Physics, number: f64) -> Cell {
    if physics.bonds.is_some() { Cell::Empty } else { Cell::Double(number) }
}

/// As the manifest has it: a word as it is, anything else as JSON.
fn json_word(value: &impl Serialize) -> Cell {
    match serde_json::to_value(value) {
        Ok(Value::String(text)) => Cell::Word(text),
        Ok(value) => word(value.to_string()),
        Err(_) => Cell::Empty,
    }
}
