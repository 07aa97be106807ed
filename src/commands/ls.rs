//! `beadline ls`: the runs on this user's bus with their progress and consumers; or the recordings of a place.

mod recordings;

pub(super) use recordings::{glance, is_recording, summaries};

use crate::display;
use crate::failure::{Done, Failure};
use bus::{Bus, ConsumerInfo, RunInfo, list_runs};
use serde_json::json;
use std::path::Path;

pub(crate) fn ls(place: Option<&Path>, as_json: bool, names_only: bool) -> Result<Done, Failure> {
    if let Some(place) = place {
        return recordings::ls(place, as_json, names_only);
    }
    let bus = Bus::from_env()?;
    let runs = list_runs(&bus)?;
    display::notice_of_bus(&bus);
    if names_only {
        for run in &runs {
            display::print(format_args!("{}\n", run.name))?;
        }
    } else if as_json {
        display::print_json(&runs.iter().map(to_json).collect::<Vec<_>>())?;
    } else if runs.is_empty() {
        notice!("no runs; start one with `beadline run`");
    } else {
        display::print(table(&runs, display::columns_of_stdout()))?;
    }
    Ok(Done::Whole)
}

/// A column, and whether it is left out where the terminal is too narrow: the highest number first.
const COLUMNS: [(&str, u32); 8] =
    [("NAME", 0), ("STATE", 0), ("STEP", 0), ("", 0), ("TIME", 1), ("ENDS IN", 0), ("PID", 2), ("RUN ID", 3)];

/// A line for each run, and below it one for each of its consumers.
fn table(runs: &[RunInfo], columns: usize) -> String {
    let mut lines = display::aligned(COLUMNS, runs.iter().map(cells).collect(), columns).into_iter();
    let mut text = lines.next().unwrap_or_default();
    for (run, line) in runs.iter().zip(lines) {
        text.push_str(&line);
        for consumer in &run.consumers {
            text.push_str(&consumer_line(consumer, &run.consumers));
        }
    }
    text
}

/// Cells of a run in the list.
pub(super) fn cells(run: &RunInfo) -> [String; COLUMNS.len()] {
    let (step, part) = match run.step_count {
        Some(steps) => {
            // rounded down, so that 100 % is the end
            let percent = 100 * u128::from(run.step) / u128::from(steps.max(1));
            (format!("{} of {}", display::count(run.step), display::count(steps)), format!("{percent} %"))
        }
        None => (display::count(run.step).to_string(), String::new()),
    };
    [
        run.name.to_string(),
        run.state.to_string(),
        step,
        format!("{part:>5}"),
        display::seconds(run.time_s),
        run.ends_in.map_or_else(|| "–".to_owned(), |left| display::left(left.as_secs_f64())),
        run.pid.to_string(),
        run.run_id.to_string(),
    ]
}

/// `lossless  energies  5 frames behind  (process 4711)`
fn consumer_line(consumer: &ConsumerInfo, all: &[ConsumerInfo]) -> String {
    let width = all.iter().map(|other| other.label.chars().count()).max().unwrap_or(0);
    let lag = lag_in_words(consumer, consumer.lag_frames.map(|lag| display::counted(lag, "frame")));
    let process = consumer.pid.map_or_else(String::new, |pid| format!("  (process {pid})"));
    let (delivery, label) = (consumer.delivery.as_str(), display::printable(&consumer.label));
    format!("  {delivery:8}  {label:width$}  {lag}{process}\n")
}

/// The `lag` of a consumer, and the frames that it missed.
pub(super) fn lag_in_words(consumer: &ConsumerInfo, lag: Option<String>) -> String {
    let lag = lag.map_or_else(|| "lag not told".to_owned(), |lag| format!("{lag} behind"));
    let missed = consumer.missed.filter(|missed| *missed > 0);
    let missed = missed.map_or_else(String::new, |missed| format!(", {} missed", display::count(missed)));
    lag + &missed
}

fn to_json(run: &RunInfo) -> serde_json::Value {
    json!({
        "name": run.name,
        "run_id": run.run_id,
        "state": run.state.as_str(),
        "alive": run.is_live(),
        "frame": run.frame,
        "step": run.step,
        "time_s": run.time_s,
        "age_s": run.age.as_secs_f64(),
        "lossless": run.lossless,
        "latest": run.latest,
        "evicted": run.evicted,
        "pid": run.pid,
        "step_count": run.step_count,
        "ends_in_s": run.ends_in.map(|left| left.as_secs_f64()),
        "consumers": run.consumers.iter().map(consumer_json).collect::<Vec<_>>(),
    })
}

pub(super) fn consumer_json(consumer: &ConsumerInfo) -> serde_json::Value {
    json!({
        "label": consumer.label,
        "delivery": consumer.delivery.as_str(),
        "pid": consumer.pid,
        "lag_frames": consumer.lag_frames,
        "frames_missed": consumer.missed,
    })
}
