//! `beadline info FILE`: what is in a recording.

use crate::display::{self, bytes, count, seconds};
use crate::failure::{BadInput, Done, Failure};
use recording::RecordingInfo;
use schemas::frame::EndReason;
use schemas::whole_file::is_being_written;
use serde_json::json;
use std::path::Path;

pub(crate) fn info(path: &Path, as_json: bool) -> Result<Done, Failure> {
    let is_being_written = is_being_written(path);
    let info = RecordingInfo::glance(path).bad_input()?;
    display::notice_of_version(&info.manifest);
    if as_json {
        display::print_json(&to_json(&info, is_being_written))?;
    } else {
        display::print(text(&info, is_being_written))?;
    }
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

/// Steps between the first and the last state.
fn last_steps(info: &RecordingInfo) -> u64 {
    info.last_step.zip(info.first_step).map_or(0, |(last, first)| last.saturating_sub(first))
}

fn text(info: &RecordingInfo, is_being_written: bool) -> String {
    let (physics, provenance) = (&info.manifest.physics, &info.manifest.provenance);
    let impurities: Vec<_> =
        physics.impurities.iter().map(|i| format!("bead {} of {} kg", i.bead, i.mass_kg)).collect();
    let particulars = physics.particulars();
    let time = info.time_range_s().map_or("none".to_owned(), |(first, last)| {
        let every = match provenance.record_every_steps {
            _ if info.frames() == last_steps(info) + 1 => "every step".to_owned(),
            1 => "every step".to_owned(),
            steps => format!("every {} steps", count(steps)),
        };
        format!("{} to {}, {every}", seconds(first), seconds(last))
    });
    let mut rows = vec![
        ("state", state(info, is_being_written)),
        ("run", format!("{} {}", provenance.name, provenance.run_id)),
        (
            "chain",
            format!(
                "{} beads of {} kg, α = {}, k = {:e} N/m^α",
                physics.beads, physics.bead_mass_kg, physics.alpha, physics.stiffness
            ),
        ),
        ("impurities", if impurities.is_empty() { "none".to_owned() } else { impurities.join(", ") }),
        ("striker", format!("bead {} at {} m/s", physics.striker.bead, physics.striker.velocity_m_s)),
        (
            "method",
            format!(
                "{}, dt = {}, {} steps, kernel {}",
                physics.method,
                display::quantity(physics.dt_s, "s"),
                count(physics.step_count),
                physics.kernel_version
            ),
        ),
        ("made by", format!("{} on {}", provenance.program, provenance.host)),
        ("schema", info.manifest.schema_version.to_string()),
        ("time", time),
        (
            "size",
            format!(
                "{}, {} before compression, {:.2} : 1",
                bytes(info.file_bytes),
                bytes(info.uncompressed_bytes),
                info.compression_ratio()
            ),
        ),
    ];
    if !particulars.is_empty() {
        rows.insert(3, ("besides", particulars.join(", ")));
    }
    if info.begin.part > 1 || info.end.as_ref().is_some_and(|end| end.reason == EndReason::Continued) {
        rows.insert(1, ("part", count(info.begin.part).to_string()));
    }
    for channel in &info.channels {
        rows.push((
            "channel",
            format!(
                "{:10} {:24} {:>10} message{}",
                channel.topic,
                channel.schema,
                count(channel.messages).to_string(),
                if channel.messages == 1 { "" } else { "s" }
            ),
        ));
    }
    display::rows(&info.path.display().to_string(), &rows)
}

fn to_json(info: &RecordingInfo, is_being_written: bool) -> serde_json::Value {
    let channels: Vec<_> = info
        .channels
        .iter()
        .map(|c| json!({ "topic": c.topic, "schema": c.schema, "encoding": c.encoding, "messages": c.messages }))
        .collect();
    json!({
        "path": info.path,
        "schema_version": info.manifest.schema_version,
        "physics": info.manifest.physics,
        "provenance": info.manifest.provenance,
        "manifest": info.manifest,
        "run_toml": info.run_toml,
        "channels": channels,
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
