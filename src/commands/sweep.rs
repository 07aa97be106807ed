//! `beadline sweep`: a grid of runs, a row each.

use crate::args::SweepArgs;
use crate::display::{self, count, duration};
use crate::failure::{BadInput, Done, Failure};
use crate::signals;
use crate::sweep::directory::{Directory, Shard};
use crate::sweep::merge;
use crate::sweep::work::{Job, Tally, work};
use anyhow::anyhow;
use consumers::journal::Entry;
use producer::sweep::Sweep;
use schemas::manifest::Physics;
use serde_json::json;
use std::collections::BTreeMap;
use std::num::NonZero;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// A sweep file to begin with.
const EXAMPLE: &str = include_str!("sweep/example.toml");

pub(crate) fn sweep(args: &SweepArgs) -> Result<Done, Failure> {
    if args.example {
        display::print(EXAMPLE)?;
        return Ok(Done::Whole);
    }
    let (Some(file), Some(out)) = (&args.file, &args.out) else {
        return Err(Failure::BadInput(anyhow!("a sweep needs SWEEP.toml and --out DIR; see --help")));
    };
    let start = Instant::now();
    let stop = signals::stop_flag()?;
    let sweep = Sweep::read(file).bad_input()?;
    let directory = Directory::open(out, &sweep, args.force)?;
    let shard = args.shard.unwrap_or(Shard::WHOLE);
    let (tally, left) = if args.merge {
        (Tally::default(), 0)
    } else {
        let record = args.record || sweep.record();
        let (journal, _) = directory.journal(shard)?;
        let jobs = pending(&sweep, &directory, shard, record)?;
        announce(&sweep, &jobs, args);
        if record {
            directory.make_recordings()?;
        }
        let threads = args.jobs.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZero::get);
        let tally = work((&sweep, &directory), &jobs, threads, record, journal, &stop)?;
        let left = jobs.len() as u64 - tally.computed;
        (tally, left)
    };
    let rows = merge::rows(&directory)?;
    let missing = sweep.point_count() - rows.len() as u64;
    let files = if missing == 0 || args.merge { merge::write(&directory, &rows)? } else { None };
    let summary = Summary {
        sweep: &sweep,
        out,
        failed: merge::failed(&rows, &directory.head().columns),
        rows: &rows,
        tally,
        left,
        missing,
        files,
        stopped: stop.load(Ordering::Relaxed),
        wall: start.elapsed(),
    };
    display::print(if args.json { summary.json()? } else { summary.text() })?;
    summary.warn(args);
    summary.done(args)
}

/// The points of `shard` that have no row yet, or no recording where there is to be one.
fn pending(sweep: &Sweep, directory: &Directory, shard: Shard, record: bool) -> Result<Vec<Job>, Failure> {
    let rows = merge::rows(directory)?;
    let is_done =
        |index: &u64| rows.contains_key(index) && !(record && !directory.recording(*index).exists());
    let indices = (0..sweep.point_count()).filter(|index| shard.has(*index) && !is_done(index));
    let job = |index| -> Result<Job, Failure> {
        let physics = Physics::resolve(&sweep.point(index)?.config)?;
        Ok(Job { index, steps: physics.step_count, beads: physics.beads })
    };
    indices.map(job).collect()
}

fn announce(sweep: &Sweep, jobs: &[Job], args: &SweepArgs) {
    let shard =
        args.shard.map_or(String::new(), |shard| format!(" in shard {}/{}", shard.number, shard.count));
    let parameters: Vec<_> = sweep.parameters().iter().map(|parameter| parameter.key.as_str()).collect();
    display::notice(format_args!(
        "{} points over {}; {} to compute{shard}",
        count(sweep.point_count()),
        if parameters.is_empty() { "nothing".to_owned() } else { parameters.join(", ") },
        count(jobs.len() as u64),
    ));
}

/// What a sweep leaves behind, in numbers.
struct Summary<'a> {
    sweep: &'a Sweep,
    out: &'a PathBuf,
    rows: &'a BTreeMap<u64, Entry>,
    /// Points whose runs failed.
    failed: Vec<u64>,
    tally: Tally,
    /// Points that were to be computed here and have no row.
    left: u64,
    /// Points that have no row.
    missing: u64,
    files: Option<Vec<PathBuf>>,
    stopped: bool,
    wall: Duration,
}

impl Summary<'_> {
    fn text(&self) -> String {
        let points = self.sweep.point_count();
        let mut rows = vec![
            ("computed now", count(self.tally.computed).to_string()),
            ("rows", format!("{} of {}", count(self.rows.len() as u64), count(points))),
            ("failed runs", count(self.failed.len() as u64).to_string()),
            ("wall time", duration(self.wall)),
        ];
        let files = self.files.iter().flatten();
        rows.extend(files.map(|file| ("results", file.display().to_string())));
        display::rows(&format!("sweep {} in {}", self.sweep.path().display(), self.out.display()), &rows)
    }

    fn json(&self) -> Result<String, serde_json::Error> {
        let summary = json!({
            "sweep": self.sweep.path(),
            "out": self.out,
            "points": self.sweep.point_count(),
            "rows": self.rows.len(),
            "computed": self.tally.computed,
            "failed": self.failed,
            "broken": self.tally.broken,
            "missing": self.missing,
            "stopped": self.stopped,
            "results": self.files,
            "wall_s": self.wall.as_secs_f64(),
        });
        Ok(format!("{}\n", serde_json::to_string_pretty(&summary)?))
    }

    fn warn(&self, args: &SweepArgs) {
        for index in &self.tally.broken {
            display::notice(format_args!("point {index}: this program went wrong, see above; it has no row"));
        }
        if !self.failed.is_empty() {
            let failed = count(self.failed.len() as u64);
            display::notice(format_args!("{failed} run(s) failed; the column `error` says why"));
        }
        if self.stopped && self.left > 0 {
            display::notice("stopped: finished points are kept, the same command goes on with the others");
        } else if self.missing > 0 {
            let missing = count(self.missing);
            display::notice(match args.merge {
                true => format!("{missing} point(s) are missing in the results"),
                false => format!(
                    "{missing} point(s) are not there yet; whoever computes the last merges the results, or --merge"
                ),
            });
        } else if self.files.is_none() {
            display::notice("another process is merging the results");
        }
    }

    fn done(&self, args: &SweepArgs) -> Result<Done, Failure> {
        if !self.tally.broken.is_empty() {
            let message = format!("{} point(s) could not be computed", self.tally.broken.len());
            return Err(Failure::Failed(anyhow!(message)));
        }
        let whole = self.failed.is_empty() && self.left == 0 && !(args.merge && self.missing > 0);
        Ok(Done::whole_if(whole))
    }
}
