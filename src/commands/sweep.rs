//! `beadline sweep`: a grid of runs, a row each.

mod cluster;

use crate::args::SweepArgs;
use crate::display::{self, count, counted, duration};
use crate::failure::{BadInput, Done, Failure};
use crate::report::{Rows, report};
use crate::signals;
use crate::sweep::plan::Plan;
use crate::sweep::{self, Options, Outcome};
use anyhow::anyhow;
use producer::sweep::Sweep;
use serde::Serialize;
use std::borrow::Cow;
use std::num::NonZero;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Sweep files to begin with.
const EXAMPLES: [(&str, &str); 5] = [
    ("reflection", include_str!("sweep/reflection.toml")),
    ("equipartition", include_str!("sweep/equipartition.toml")),
    ("diatomic", include_str!("sweep/diatomic.toml")),
    ("conductivity", include_str!("sweep/conductivity.toml")),
    ("disorder", include_str!("sweep/disorder.toml")),
];

pub(crate) fn sweep(args: &SweepArgs) -> Result<Done, Failure> {
    if let Some(asked) = &args.example {
        return super::print_example("sweep", &EXAMPLES, asked);
    }
    if let (Some(file), true) = (&args.file, args.plan) {
        return plan(file, args);
    }
    if let Some(directory) = &args.status {
        return cluster::status(directory, args.json);
    }
    // a directory has the file that it was made of
    let merged = args.file.as_ref().filter(|_| args.merge && args.out.is_none());
    let merged = merged.and_then(|directory| Some((sweep::file_in(directory)?, directory.clone())));
    let Some((file, out)) = merged.or_else(|| args.file.clone().zip(args.out.clone())) else {
        return Err(Failure::BadInput(anyhow!("a sweep needs SWEEP.toml and --out DIR; see --help")));
    };
    let (file, out) = (file.as_path(), out.as_path());
    let start = Instant::now();
    let stop = signals::stop_flag()?;
    signals::would_leave(format!(
        "the finished points are kept in {}, the same command goes on with the others",
        out.display()
    ));
    let sweep = Sweep::read(file, experiments::HOOKS).bad_input()?;
    if args.slurm.slurm {
        return cluster::slurm(&sweep, out, args);
    }
    let outcome = if args.merge {
        sweep::merge(&sweep, out)?
    } else {
        let default = Options::default();
        let options = Options {
            threads: args.jobs.map_or(default.threads, NonZero::get),
            shard: args.shard.unwrap_or(default.shard),
            record: args.record || sweep.record(),
            force: args.force,
            yes: args.yes,
        };
        sweep::compute(&sweep, out, &options, &stop)?
    };
    let summary = Summary {
        sweep: sweep.path().to_string_lossy(),
        out: out.to_string_lossy(),
        points: sweep.point_count(),
        outcome,
        stopped: stop.load(Ordering::Relaxed),
        wall_s: start.elapsed().as_secs_f64(),
    };
    report(args.json, &summary, || summary.text())?;
    summary.warn(args);
    summary.done(args)
}

fn plan(file: &Path, args: &SweepArgs) -> Result<Done, Failure> {
    let start = Instant::now();
    let stop = signals::stop_flag()?;
    let sweep = Sweep::read(file, experiments::HOOKS).bad_input()?;
    let plan = Plan::of(&sweep, start.elapsed(), args.cores.map(NonZero::get), &stop)?;
    report(args.json, &plan, || plan.text(file))?;
    Ok(Done::Whole)
}

/// Numbers about a sweep that has ended.
#[derive(Serialize)]
struct Summary<'a> {
    /// The sweep file.
    sweep: Cow<'a, str>,
    out: Cow<'a, str>,
    points: u64,
    #[serde(flatten)]
    outcome: Outcome,
    stopped: bool,
    wall_s: f64,
}

impl Summary<'_> {
    fn text(&self) -> String {
        let mut rows = Rows::default();
        rows.add("computed now", count(self.outcome.tally.computed));
        rows.add("rows", format_args!("{} of {}", count(self.outcome.rows), count(self.points)));
        rows.add("failed runs", count(self.outcome.failed_count));
        rows.add("wall time", duration(Duration::from_secs_f64(self.wall_s)));
        rows.each("results", self.outcome.files.iter().flatten());
        rows.under(format_args!("sweep {} in {}", self.sweep, self.out))
    }

    fn warn(&self, args: &SweepArgs) {
        for index in &self.outcome.tally.broken {
            notice!("point {index}: the program panicked, see above; the point has no row");
        }
        if !self.outcome.failed.is_empty() {
            let failed = counted(self.outcome.failed_count, "run");
            display::notice(format_args!("{failed} failed; the column `error` says why"));
        }
        if self.stopped && self.outcome.left > 0 {
            display::notice("stopped: finished points are kept, the same command goes on with the others");
        } else if !self.outcome.all_seen {
            display::notice(
                "nothing is merged, as the shards have much to read; when all are done, --merge makes the tables",
            );
        } else if self.outcome.missing > 0 {
            let missing = counted(self.outcome.missing, "point");
            display::notice(if args.merge {
                format!("missing in the results: {missing}")
            } else {
                format!("not there yet: {missing}; whoever computes the last merges the results, or --merge")
            });
        } else if self.outcome.files.is_none() {
            display::notice("another process is merging the results");
        }
    }

    fn done(&self, args: &SweepArgs) -> Result<Done, Failure> {
        if !self.outcome.tally.broken.is_empty() {
            let broken = counted(self.outcome.tally.broken.len() as u64, "point");
            let message = format!("{broken} could not be computed");
            return Err(Failure::Failed(anyhow!(message)));
        }
        let whole = self.outcome.failed.is_empty()
            && self.outcome.left == 0
            && !(args.merge && self.outcome.missing > 0);
        Ok(Done::whole_if(whole))
    }
}
