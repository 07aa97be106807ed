//! Sweeps on clusters: job arrays, and how far they are.

use crate::args::SweepArgs;
use crate::display::{count, counted, left, per_second, printable};
use crate::failure::{Done, Failure};
use crate::report::{Rows, report};
use crate::sweep::slurm::job_array;
use crate::sweep::status::{self, Shard, State, Status};
use producer::sweep::Sweep;
use std::path::Path;

/// Most shards that are named for one reason.
const NAMED: usize = 5;

pub(super) fn slurm(sweep: &Sweep, out: &Path, args: &SweepArgs) -> Result<Done, Failure> {
    let array = job_array(sweep, out, &args.slurm, (args.record, args.force))?;
    report(args.json, &array, || {
        let script = &array.script;
        let mut rows = Rows::default();
        rows.add("script", script);
        rows.add("points", count(sweep.point_count()));
        let points_each = sweep.point_count().div_ceil(array.array_size);
        rows.add("tasks", format_args!("{}, of {}", count(array.array_size), counted(points_each, "point")));
        if let Some(limit) = &args.slurm.time {
            // 25:00 are minutes, whatever was meant
            let words = limit.seconds.map_or_else(|| "none".to_owned(), |seconds| left(seconds as f64));
            rows.add("time limit", words);
        }
        match &array.job {
            Some(job) => rows.add("job", job),
            None => rows.add("send it", format_args!("sbatch {script}")),
        }
        rows.add("look at it", format_args!("beadline sweep --status {}", out.display()));
        rows.under("a job array of Slurm")
    })?;
    Ok(Done::Whole)
}

pub(super) fn status(directory: &Path, as_json: bool) -> Result<Done, Failure> {
    let status = status::status(directory)?;
    report(as_json, &status, || words(&status, directory))?;
    Ok(Done::whole_if(status.unreadable.is_empty()))
}

fn words(status: &Status, directory: &Path) -> String {
    let mut rows = Rows::default();
    rows.add("points", format_args!("{} of {}", count(status.done), count(status.points)));
    if status.damaged > 0 {
        rows.add("damaged rows", count(status.damaged));
    }
    rows.each("not read", status.unreadable.iter().take(NAMED).map(|line| printable(line)));
    rows.more("not read", status.unreadable.len() as u64, NAMED, "");
    if let (Some(rate), Some(left_s)) = (status.rate, status.left_s) {
        rows.add("rate", per_second(rate, "points"));
        rows.add("left", left(left_s));
    }
    let of = |state| status.shards.get(&state).copied().unwrap_or(0);
    rows.add("shards", format_args!("{} of {} done", count(of(State::Done)), count(status.shard_count)));
    for (state, name) in [
        (State::Running, "running"),
        (State::Queued, "queued"),
        (State::NotBegun, "not begun"),
        (State::Requeued, "requeued"),
        (State::Stopped, "stopped"),
        (State::Failed, "failed"),
        (State::StandsStill, "stand still"),
    ] {
        if of(state) > 0 {
            rows.add(name, count(of(state)));
        }
        let shards: Vec<_> = status.begun.iter().filter(|shard| shard.state == state).collect();
        // those that do what they should are not worth a line
        if state != State::Running && !shards.is_empty() {
            rows.each("", shards.iter().take(NAMED).map(|shard| named(shard, status.shard_count)));
            rows.more("", shards.len() as u64, NAMED, "");
        }
    }
    if status.begun_again > 0 {
        rows.add("begun again", counted(status.begun_again, "shard"));
    }
    if status.done == status.points && !directory.join("results.csv").exists() {
        rows.add("next", format_args!("beadline sweep --merge {}", directory.display()));
    }
    rows.under(format_args!("sweep in {}", directory.display()))
}

/// A shard, and what is known of it.
fn named(shard: &Shard, of: u64) -> String {
    let mut text = format!("{}/{of}: {} of {} points", shard.number, count(shard.done), count(shard.points));
    let mut add = |part: String| text.extend([", ".to_owned(), part]);
    if shard.attempts > 1 {
        add(format!("begun {} times", shard.attempts));
    }
    if let Some(code) = shard.exit_code {
        add(format!("exit code {code}"));
    }
    if let Some(node) = &shard.node {
        add(format!("on {}", printable(node)));
    }
    add(format!("no row for {}", left(shard.quiet_s)));
    if shard.state == State::Failed {
        add(format!("see slurm/{}-of-{of}.out", shard.number));
    }
    text
}
