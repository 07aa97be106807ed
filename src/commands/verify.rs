//! `beadline verify FILE`: whether every state of a recording is what the state before it leads to.

use crate::args::VerifyArgs;
use crate::display::{self, count, seconds};
use crate::failure::{Done, Failure};
use crate::signals;
use crate::source::{Source, SourceFailure};
use producer::resimulation::Difference;
use producer::verification::{Verification, verify as verify_states};
use schemas::frame::FrameSource;
use schemas::manifest::RunManifest;
use serde_json::{Value, json};
use std::num::NonZero;
use std::time::{Duration, Instant};

pub(crate) fn verify(args: &VerifyArgs) -> Result<Done, Failure> {
    let stop = signals::stop_flag()?;
    let mut source = Source::open_all(&args.file, &stop)?;
    let manifest = source.manifest().clone();
    display::notice_of_version(&manifest);
    let cores = || std::thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
    let threads = args.jobs.unwrap_or_else(cores);
    let bar = display::progress_bar(manifest.physics.step_count, manifest.provenance.name.as_str());
    let mut refreshed = Instant::now();
    let found = verify_states(&mut source, threads, |step| {
        if refreshed.elapsed() >= Duration::from_millis(100) {
            refreshed = Instant::now();
            bar.set_position(step);
        }
    });
    bar.finish_and_clear();
    let found = found?;
    if args.json {
        display::print_json(&to_json(&manifest, &found))?;
    } else {
        display::print(text(&manifest, &found))?;
    }
    Ok(Done::whole_if(found.is_proven()))
}

/// Steps between the first and the last state.
fn step_count(found: &Verification<SourceFailure>) -> u64 {
    found.last_step.zip(found.first_step).map_or(0, |(last, first)| last - first)
}

fn text(manifest: &RunManifest, found: &Verification<SourceFailure>) -> String {
    let verdict = if found.is_proven() {
        "proven"
    } else if found.is_proven_so_far() {
        "proven as far as it goes, but it is NOT WHOLE"
    } else {
        "NOT PROVEN"
    };
    let mut rows = vec![
        ("states", count(found.state_count).to_string()),
        ("steps recomputed", count(step_count(found)).to_string()),
    ];
    if let Some(first) = found.first_step {
        rows.push(("begins", begin(manifest, first)));
    }
    if let Some(last) = found.last_step {
        let end = format!("step {} of {}", count(last), count(manifest.physics.step_count));
        rows.push(("ends", format!("at {end} ({})", found.end)));
    }
    rows.extend(found.differences.iter().map(|difference| ("differs", difference.to_string())));
    let more = found.difference_count - found.differences.len() as u64;
    if more > 0 {
        rows.push(("differs", format!("and {} states more", count(more))));
    }
    let missing = |(from, to): &(u64, u64)| format!("frames {} to {}", count(*from), count(*to));
    rows.extend(found.missing.iter().map(|range| ("missing", missing(range))));
    if let Some(failure) = &found.failure {
        rows.push(("damaged", message(failure)));
    }
    display::rows(&format!("{}: {verdict}", manifest.provenance.name), &rows)
}

/// What the first state follows.
fn begin(manifest: &RunManifest, first: u64) -> String {
    if first == 0 {
        return "with the manifest's initial condition".to_owned();
    }
    let time = seconds(manifest.physics.time_s(first));
    format!(
        "with step {} ({time}), which is taken as it is: it follows what is not in this file",
        count(first)
    )
}

/// An error with its causes.
fn message(failure: &SourceFailure) -> String {
    let mut text = failure.to_string();
    let mut cause = std::error::Error::source(failure);
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}

fn to_json(manifest: &RunManifest, found: &Verification<SourceFailure>) -> Value {
    json!({
        "run": manifest.provenance.name,
        "run_id": manifest.provenance.run_id,
        "proven": found.is_proven(),
        "states": found.state_count,
        "steps_recomputed": step_count(found),
        "first_step": found.first_step,
        "last_step": found.last_step,
        "end": found.end.as_str(),
        "difference_count": found.difference_count,
        "differences": found.differences.iter().map(difference).collect::<Vec<_>>(),
        "missing_frames": found.missing,
        "damage": found.failure.as_ref().map(message),
    })
}

fn difference(difference: &Difference) -> Value {
    json!({
        "step": difference.step,
        "frame": difference.frame,
        "from_step": difference.from_step,
        "bead": difference.bead,
        "quantity": difference.quantity.to_string(),
        "found": difference.found,
        "computed": difference.computed,
    })
}
