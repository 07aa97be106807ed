//! `beadline info FILE`: the contents of a recording.

use crate::display::{self, bytes, count, seconds};
use crate::failure::{BadInput, Done, Failure};
use crate::report::{Rows, report};
use recording::{ChannelInfo, RecordingInfo};
use schemas::config::Disordered;
use schemas::frame::EndReason;
use schemas::manifest::{Physics, Ranges};
use schemas::whole_file::is_being_written;
use serde_json::json;
use std::path::Path;

/// Impurities or strikers that are written out.
const MOST_SHOWN: usize = 8;
/// Channels that are listed: a recording of ours has seven, and a file may have 65,536.
const MOST_CHANNELS: usize = 100;

pub(crate) fn info(path: &Path, as_json: bool) -> Result<Done, Failure> {
    let is_being_written = is_being_written(path);
    let info = RecordingInfo::glance(path).bad_input()?;
    display::notice_of_version(&info.manifest);
    report(as_json, &to_json(&info, is_being_written), || text(&info, is_being_written))?;
    Ok(Done::whole_if(info.finished && info.damage.is_none()))
}

/// One line: finished, damaged or being written, and which step of the run it reaches.
fn state(info: &RecordingInfo, is_being_written: bool) -> String {
    let steps = info.manifest.physics.step_count;
    let reached = info.last_step.map_or("no step".to_owned(), |step| format!("step {}", count(step)));
    match &info.end {
        _ if info.damage.is_some() => format!("damaged: {}", info.damage.as_deref().unwrap_or_default()),
        None if is_being_written => {
            format!("being written by a running process; so far it reaches {reached} of {}", count(steps))
        }
        None => format!("unfinished: it was not closed; it reaches {reached} of {}", count(steps)),
        Some(_) if info.is_complete() => format!("finished and complete: all {} steps", count(steps)),
        Some(end) => {
            let from = match info.first_step {
                Some(first) if first > 0 => format!("goes from step {} to ", count(first)),
                _ => "reaches ".to_owned(),
            };
            let due = if info.begin.first_step == 0 && info.reaches_the_end() {
                let (found, due) = (count(info.frames()), count(info.manifest.recorded_count()));
                format!(", with {found} of {due} states")
            } else {
                String::new()
            };
            format!("finished ({}), not complete: it {from}{reached} of {}{due}", end.reason, count(steps))
        }
    }
}

fn text(info: &RecordingInfo, is_being_written: bool) -> String {
    let (physics, provenance) = (&info.manifest.physics, &info.manifest.provenance);
    let time = info.time_range_s().map_or("none".to_owned(), |(first, last)| {
        let every = match provenance.record_every_steps {
            _ if info.covered_steps() == 0 => String::new(),
            steps if steps != 1 && info.frames() != info.covered_steps() + 1 => {
                format!(", every {} steps", count(steps))
            }
            _ => ", every step".to_owned(),
        };
        format!("{} to {}{every}", seconds(first), seconds(last))
    });
    let mut rows = Rows::default();
    rows.add("state", state(info, is_being_written));
    if info.begin.part > 1 || info.end.as_ref().is_some_and(|end| end.reason == EndReason::Continued) {
        rows.add("part", count(info.begin.part));
    }
    rows.add("run", format_args!("{} {}", provenance.name, provenance.run_id));
    rows.append(of_physics(physics));
    rows.add("made by", format_args!("{} on {}", provenance.program, provenance.host));
    for (key, text) in provenance.credit.rows() {
        rows.each(key, text);
    }
    rows.add("schema", info.manifest.schema_version);
    rows.add("time", time);
    let (size, uncompressed) = (bytes(info.file_bytes), bytes(info.uncompressed_bytes));
    let ratio = info.compression_ratio();
    rows.add("size", format_args!("{size}, {uncompressed} before compression, {ratio:.2} : 1"));
    for ChannelInfo { topic, schema, messages, .. } in info.channels.iter().take(MOST_CHANNELS) {
        let (found, plural) = (count(*messages).to_string(), if *messages == 1 { "" } else { "s" });
        rows.add("channel", format_args!("{topic:10} {schema:24} {found:>10} message{plural}"));
    }
    rows.more("channel", info.channels.len() as u64, info.channels.len().min(MOST_CHANNELS), "");
    rows.under(info.path.display())
}

/// The chain, its strikers, and its computation.
pub(crate) fn of_physics(physics: &Physics) -> Rows {
    let mut rows = Rows::default();
    rows.add("chain", chain_in_words(physics));
    let particulars = physics.particulars();
    if !particulars.is_empty() {
        rows.add("besides", particulars.join(", "));
    }
    if physics.spheres.is_some() || !physics.disorder.is_empty() {
        match physics.ranges_at_a_glance() {
            Some(ranges) => add_ranges(&mut rows, &ranges),
            None => rows.add("masses", "not computed for a glance at so long a chain"),
        }
    }
    let is_changed = physics.disorder.iter().any(|disorder| disorder.of != Disordered::Stiffnesses);
    let before = if is_changed { " before disorder" } else { "" };
    let impurities = physics.odd_beads().map(|i| format!("bead {} of {} kg{before}", i.bead, i.mass_kg));
    rows.add("impurities", some_of(impurities));
    let strikers = std::iter::once(&physics.striker).chain(&physics.strikers);
    let strikers = strikers
        .filter(|striker| striker.velocity_m_s != 0.0)
        .map(|striker| format!("bead {} at {} m/s", striker.bead, striker.velocity_m_s));
    rows.add("striker", some_of(strikers));
    let (dt, steps) = (display::quantity(physics.dt_s, "s"), count(physics.step_count));
    let kernel = physics.kernel_version;
    rows.add("method", format_args!("{}, dt = {dt}, {steps} steps, kernel {kernel}", physics.method));
    rows
}

/// The beads, and the numbers that decide how they move: beside spheres and bonds the manifest's mass, α and stiffness do not.
fn chain_in_words(physics: &Physics) -> String {
    let (beads, mass_kg, alpha, stiffness) =
        (physics.beads, physics.bead_mass_kg, physics.alpha, physics.stiffness);
    if physics.spheres.is_some() {
        format!("{beads} beads, spheres with Hertz's contacts (α = 1.5)")
    } else if physics.bonds.is_some() {
        format!("{beads} beads of {mass_kg} kg with bonds")
    } else {
        format!("{beads} beads of {mass_kg} kg, α = {alpha}, k = {stiffness:e} N/m^α")
    }
}

fn add_ranges(rows: &mut Rows, ranges: &Ranges) {
    rows.add("masses", range(ranges.mass_kg, "kg"));
    rows.add("stiffnesses", range(ranges.stiffness, "N/m^α"));
    for (name, stiffness) in ["left wall", "right wall"].into_iter().zip(ranges.walls) {
        rows.each(name, stiffness.map(|stiffness| format!("{stiffness:e} N/m^α")));
    }
}

/// Two numbers in words, or one that is both.
fn range([least, most]: [f64; 2], unit: &str) -> String {
    if least == most { format!("{least:e} {unit}") } else { format!("{least:e} to {most:e} {unit}") }
}

/// The first of some phrases, and how many there are; or that there are none.
fn some_of(phrases: impl Iterator<Item = String>) -> String {
    let mut phrases = phrases.peekable();
    if phrases.peek().is_none() {
        return "none".to_owned();
    }
    let mut shown: Vec<String> = phrases.by_ref().take(MOST_SHOWN).collect();
    let more = phrases.count();
    shown.extend((more > 0).then(|| format!("… and {more} more")));
    shown.join(", ")
}

fn to_json(info: &RecordingInfo, is_being_written: bool) -> serde_json::Value {
    json!({
        "path": info.path.to_string_lossy(),
        "schema_version": info.manifest.schema_version,
        "physics": info.manifest.physics,
        "provenance": info.manifest.provenance,
        "manifest": info.manifest,
        "run_toml": info.run_toml,
        "channels": info.channels,
        "part": info.begin.part,
        "begins_at_step": info.begin.first_step,
        "first_step": info.first_step,
        "last_step": info.last_step,
        "time_range_s": info.time_range_s(),
        "file_bytes": info.file_bytes,
        "uncompressed_bytes": info.uncompressed_bytes,
        "compression_ratio": info.compression_ratio(),
        "finished": info.finished,
        "being_written": is_being_written,
        "complete": info.is_complete(),
        "end_reason": info.end.as_ref().map(|end| end.reason.as_str()),
        "damage": info.damage,
    })
}
