//! `beadline ls`: the runs on this user's bus.

use crate::display;
use crate::failure::{Done, Failure};
use schemas::bus::{Bus, RunInfo, list_runs};
use serde_json::json;

pub(crate) fn ls(as_json: bool, names_only: bool) -> Result<Done, Failure> {
    let runs = list_runs(&Bus::from_env()?)?;
    if names_only {
        for run in &runs {
            display::print(format_args!("{}\n", run.name))?;
        }
    } else if as_json {
        display::print_json(&runs.iter().map(to_json).collect::<Vec<_>>())?;
    } else if runs.is_empty() {
        display::notice("no runs; start one with `beadline run`");
    } else {
        display::print(table(&runs))?;
    }
    Ok(Done::Whole)
}

fn table(runs: &[RunInfo]) -> String {
    let header = ["NAME", "STATE", "STEP", "TIME", "AGE", "LOSSLESS", "LATEST", "PID", "RUN ID"];
    let mut rows = vec![header.map(str::to_owned)];
    rows.extend(runs.iter().map(|run| {
        [
            run.name.to_string(),
            run.state.to_string(),
            display::count(run.step).to_string(),
            display::seconds(run.time_s),
            display::duration(run.age),
            run.lossless.to_string(),
            run.latest.to_string(),
            run.pid.to_string(),
            run.run_id.to_string(),
        ]
    }));
    let widths: Vec<usize> =
        (0..header.len()).map(|c| rows.iter().map(|row| row[c].chars().count()).max().unwrap_or(0)).collect();
    let line = |row: &[String; 9]| {
        let cells: Vec<_> = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        format!("{}\n", cells.join("  ").trim_end())
    };
    rows.iter().map(line).collect()
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
    })
}
