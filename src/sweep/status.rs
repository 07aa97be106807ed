//! Progress of a sweep in a directory, from its journals, the traces of a job array, and squeue if
//! it is there. Memory is a bit for each point and a few words for each shard.

use super::directory::{MOST_SIGN_BYTES, SWEEP_JSON, Sign, journals_in};
use super::pending::Points;
use super::slurm::{SCRIPT, SLURM};
use crate::failure::{BadInput, Failure};
use anyhow::Context;
use consumers::journal::{self, JournalError, JournalHead};
use consumers::table::{Column, Kind};
use producer::sweep::MAX_POINTS;
use serde::Serialize;
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, SystemTime};

/// A shard stands still if it has no new row for this long, and for so many times the time of its longest point.
const STILL: Duration = Duration::from_mins(10);
const STILL_POINTS: f64 = 10.0;

/// Progress of a sweep.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Status {
    pub(crate) points: u64,
    pub(crate) done: u64,
    /// Lines of journals that are damaged.
    pub(crate) damaged: u64,
    /// Journals that cannot be read, and why.
    pub(crate) unreadable: Vec<String>,
    /// Points a second of the shards that run; none if none runs.
    pub(crate) rate: Option<f64>,
    /// Time for the rest at that rate (s).
    pub(crate) left_s: Option<f64>,
    pub(crate) shard_count: u64,
    /// Number of shards in each state.
    pub(crate) shards: HashMap<State, u64>,
    /// Number of shards that began more than once.
    pub(crate) begun_again: u64,
    /// Shards that have begun, and lack rows.
    pub(crate) begun: Vec<Shard>,
}

/// State of a shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum State {
    /// It has all its rows.
    Done,
    Running,
    /// It should run, and has had no new row for long.
    StandsStill,
    /// It began, was preempted, requeued or out of time, and is to begin again.
    Requeued,
    /// It ended before it was done: asked to, or killed with its machine. Nothing says that it begins again.
    Stopped,
    Failed,
    /// It is in Slurm's queue for the first time.
    Queued,
    NotBegun,
}

/// A shard that has begun.
#[derive(Debug, Serialize)]
pub(crate) struct Shard {
    #[serde(rename = "shard")]
    pub(crate) number: u64,
    pub(crate) state: State,
    pub(crate) points: u64,
    pub(crate) done: u64,
    /// Number of its starts; 0 if that is unknown, outside of a job array.
    pub(crate) attempts: u64,
    pub(crate) node: Option<String>,
    pub(crate) exit_code: Option<u8>,
    /// Time since its last new row, or since it began (s).
    pub(crate) quiet_s: f64,
    #[serde(skip)]
    rate: Option<f64>,
}

/// The progress of the sweep in `directory`.
///
/// # Errors
/// When it holds no sweep, or cannot be read.
pub(crate) fn status(directory: &Path) -> Result<Status, Failure> {
    let sign = sign(directory)?;
    let points = sign.points;
    let mut rows = Counted::read(directory, &sign)?;
    let count = shard_count(directory, &rows).min(points.max(1));
    let mut done = vec![0_u64; usize::try_from(count)?];
    for index in (0..points).filter(|index| rows.points.has(*index)) {
        done[usize::try_from(index % count)?] += 1;
    }
    let queue = Queue::ask(directory);
    let mut status = Status {
        points,
        done: rows.points.count(),
        damaged: rows.damaged,
        unreadable: std::mem::take(&mut rows.unreadable),
        shard_count: count,
        ..Status::default()
    };
    for (number, done) in (0..count).zip(done) {
        // how many of the points leave this remainder
        let shard =
            Shard::new(directory, (number, count), (points - number).div_ceil(count), done, &rows, &queue);
        status.begun_again += u64::from(shard.attempts > 1);
        *status.shards.entry(shard.state).or_default() += 1;
        if let (State::Running, Some(rate)) = (shard.state, shard.rate) {
            *status.rate.get_or_insert_default() += rate;
        }
        if !matches!(shard.state, State::Done | State::Queued | State::NotBegun) {
            status.begun.push(shard);
        }
    }
    let left = (points - status.done) as f64;
    status.left_s = status.rate.filter(|rate| *rate > 0.0).map(|rate| left / rate);
    Ok(status)
}

fn sign(directory: &Path) -> Result<Sign, Failure> {
    let path = directory.join(SWEEP_JSON);
    if !path.exists() {
        return Err(bad_input!("{} holds no sweep", directory.display()));
    }
    let bytes = storage::read_file(&path, MOST_SIGN_BYTES)
        .with_context(|| format!("{} cannot be read", path.display()))
        .bad_input()?;
    let sign: Sign = serde_json::from_slice(&bytes)
        .with_context(|| format!("{} cannot be read", path.display()))
        .bad_input()?;
    let found = sign.points;
    if found > MAX_POINTS {
        return Err(bad_input!(
            "{} says that the sweep has {found} points, and a sweep has at most {MAX_POINTS}: it was changed or is damaged; \
             put the file of the sweep in its place",
            path.display()
        ));
    }
    Ok(sign)
}

/// Number of shards of the sweep: from its job array, else from its newest journal.
fn shard_count(directory: &Path, rows: &Counted) -> u64 {
    let script = text_of(&directory.join(SLURM).join(SCRIPT));
    let array = script.lines().find_map(|line| line.strip_prefix("#SBATCH --array=0-"));
    let last = array.map(|array| array.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default());
    let newest = || rows.journals.iter().max_by_key(|(_, journal)| journal.written);
    let count = last.and_then(|last| last.parse::<u64>().ok()?.checked_add(1));
    count.or_else(|| newest().map(|((_, count), _)| *count)).unwrap_or(1).max(1)
}

/// The text of a small file; none if there is none that can be read.
fn text_of(path: &Path) -> String {
    let bytes = storage::read_file(path, MOST_SIGN_BYTES).unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The points that have a row, and the journals that say so.
struct Counted {
    points: Points,
    journals: HashMap<(u64, u64), JournalFile>,
    damaged: u64,
    unreadable: Vec<String>,
    longest_s: f64,
    /// There is a job array, whose tasks leave traces.
    has_traces: bool,
}

/// The journal of a shard.
struct JournalFile {
    rows: u64,
    created: Option<SystemTime>,
    written: SystemTime,
}

impl Counted {
    fn read(directory: &Path, sign: &Sign) -> Result<Self, Failure> {
        // their names decide
        let columns = sign.columns.iter().map(|name| Column::new(name, Kind::Double)).collect();
        let head = JournalHead { identity: sign.identity(), columns };
        let points = Points::none_of(sign.points);
        let (journals, unreadable) = (HashMap::new(), Vec::new());
        let has_traces = directory.join(SLURM).is_dir();
        let mut rows = Self { points, journals, damaged: 0, unreadable, longest_s: 0.0, has_traces };
        for path in journals_in(directory)? {
            let mut count = 0;
            let metadata = fs::metadata(&path).with_context(|| path.display().to_string())?;
            let scanned = check_head(&path, &head).and_then(|()| {
                journal::scan(&path, |index, wall_s| {
                    count += 1;
                    rows.longest_s = if wall_s > rows.longest_s { wall_s } else { rows.longest_s };
                    rows.points.add(index);
                })
            });
            match scanned {
                Ok(damaged) => rows.damaged += damaged,
                Err(error) => {
                    rows.unreadable.push(format!("{:#}", anyhow::Error::new(error)));
                    continue;
                }
            }
            if let Some(shard) = shard_of(&path) {
                let (created, written) = (metadata.created().ok(), metadata.modified()?);
                rows.journals.insert(shard, JournalFile { rows: count, created, written });
            }
        }
        Ok(rows)
    }

    fn still(&self) -> Duration {
        STILL.max(Duration::try_from_secs_f64(STILL_POINTS * self.longest_s).unwrap_or(Duration::MAX))
    }
}

/// Refuses a journal of another table.
fn check_head(path: &Path, head: &JournalHead) -> Result<(), JournalError> {
    // its first row comes after the check
    match journal::read(path, head, |_, _| Err(None)) {
        Err(Some(error)) => Err(error),
        Ok(_) | Err(None) => Ok(()),
    }
}

/// Number and count of `I-of-N.rows`.
fn shard_of(path: &Path) -> Option<(u64, u64)> {
    let (number, count) = path.file_stem()?.to_str()?.split_once("-of-")?;
    Some((number.parse().ok()?, count.parse().ok()?))
}

/// Trace of a task of a job array.
#[derive(Debug, Default, PartialEq)]
struct Trace {
    attempts: u64,
    begun_s: f64,
    /// Rows before the last attempt.
    rows_before: u64,
    node: Option<String>,
    exit_code: Option<u8>,
    requeued: bool,
}

impl Trace {
    fn parse(text: &str) -> Self {
        let mut trace = Self::default();
        for line in text.lines() {
            match *line.split_whitespace().collect::<Vec<_>>() {
                [at, "begun", lines, ref node @ ..] => {
                    // the first line of a journal is no row
                    let rows_before = lines.parse::<u64>().unwrap_or(0).saturating_sub(1);
                    let node = node.first().map(|node| (*node).to_owned());
                    let begun_s = at.parse().unwrap_or(0.0);
                    trace =
                        Self { attempts: trace.attempts + 1, begun_s, rows_before, node, ..Self::default() };
                }
                [_, "ended", code] => trace.exit_code = code.parse().ok(),
                [_, "requeued"] => trace.requeued = true,
                _ => {}
            }
        }
        trace
    }

    /// Time at which the last attempt began; none if no clock can have said so.
    fn begun(&self) -> Option<SystemTime> {
        SystemTime::UNIX_EPOCH.checked_add(Duration::try_from_secs_f64(self.begun_s).ok()?)
    }
}

impl Shard {
    fn new(
        directory: &Path,
        (number, count): (u64, u64),
        points: u64,
        done: u64,
        rows: &Counted,
        queue: &Queue,
    ) -> Self {
        let now = SystemTime::now();
        let path = directory.join(SLURM).join(format!("{number}-of-{count}.trace"));
        // of a sweep without a job array there are none to look for, and its shards may be millions
        let trace = if rows.has_traces { Trace::parse(&text_of(&path)) } else { Trace::default() };
        let journal = rows.journals.get(&(number, count));
        let begun = (trace.attempts > 0)
            .then(|| trace.begun())
            .flatten()
            .or_else(|| journal.and_then(|journal| journal.created));
        let last = begun.max(journal.map(|journal| journal.written));
        let since = |time: SystemTime| now.duration_since(time).unwrap_or_default();
        let quiet = last.map(since).unwrap_or_default();
        let has_begun = trace.attempts > 0 || journal.is_some();
        let state = if done == points {
            State::Done
        } else {
            state(has_begun, &trace, queue.state_of(number), quiet > rows.still())
        };
        let new_rows = journal.map_or(0, |journal| journal.rows.saturating_sub(trace.rows_before));
        // until a whole second has gone by nobody knows
        let rate = begun.map(since).filter(|since| since.as_secs() > 0);
        let rate = rate.map(|since| new_rows as f64 / since.as_secs_f64());
        let Trace { attempts, node, exit_code, .. } = trace;
        Self { number, state, points, done, attempts, node, exit_code, quiet_s: quiet.as_secs_f64(), rate }
    }
}

/// State, in a word, of a shard that lacks rows.
fn state(has_begun: bool, trace: &Trace, queued: Queued, is_still: bool) -> State {
    let going_on = if is_still { State::StandsStill } else { State::Running };
    if trace.attempts == 0 {
        return match queued {
            Queued::Waits => State::Queued,
            Queued::Runs => State::Running,
            _ if has_begun => going_on,
            _ => State::NotBegun,
        };
    }
    match (queued, trace.exit_code) {
        (Queued::Waits, _) => State::Requeued,
        (Queued::Unknown, _) if trace.requeued => State::Requeued,
        (Queued::Runs | Queued::Unknown, None) => going_on,
        (_, None | Some(0 | 3)) => State::Stopped,
        (_, Some(_)) => State::Failed,
    }
}

/// State of a task in Slurm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Queued {
    /// There is no Slurm here, it does not answer, or it is just cleaning up.
    Unknown,
    Waits,
    Runs,
    /// It knows of no such task.
    Gone,
}

/// Slurm's queue of a sweep's tasks; none where it cannot be asked.
struct Queue(Option<HashMap<u64, Queued>>);

impl Queue {
    fn ask(directory: &Path) -> Self {
        let Ok(directory) = fs::canonicalize(directory) else { return Self(None) };
        // state, number in the array, working directory
        let output = Command::new("squeue").args(["--noheader", "--array", "--format=%T %K %Z"]).output();
        let said = output.ok().filter(|output| output.status.success()).map(|output| output.stdout);
        Self(said.map(|said| Self::parse(&String::from_utf8_lossy(&said), &directory)))
    }

    fn parse(said: &str, directory: &Path) -> HashMap<u64, Queued> {
        let task = |line: &str| {
            let mut words = line.splitn(3, ' ');
            let (state, number, place) = (words.next()?, words.next()?, words.next()?);
            let queued = match state {
                "PENDING" | "REQUEUED" | "REQUEUE_HOLD" | "SPECIAL_EXIT" => Queued::Waits,
                "RUNNING" | "CONFIGURING" | "SUSPENDED" | "STOPPED" => Queued::Runs,
                _ => Queued::Unknown,
            };
            (Path::new(place.trim_end()) == directory).then_some((number.parse().ok()?, queued))
        };
        said.lines().filter_map(task).collect()
    }

    fn state_of(&self, number: u64) -> Queued {
        let Some(tasks) = &self.0 else { return Queued::Unknown };
        tasks.get(&number).copied().unwrap_or(Queued::Gone)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trace_says_how_the_last_attempt_went() {
        let trace = Trace::parse("5 begun 0 a\n9 ended 3\n9 requeued\n12 begun 4 b\n");
        let node = Some("b".to_owned());
        let begun = Trace { attempts: 2, begun_s: 12.0, rows_before: 3, node, ..Trace::default() };
        assert_eq!(trace, begun);
        assert_eq!(Trace::parse("5 begun 0\n7 ended 137\ntorn").exit_code, Some(137));
    }

    #[test]
    fn times_that_no_clock_says_are_none() {
        let begun = |text| Trace::parse(text).begun();
        assert!(begun("5 begun 0 a\n").is_some());
        for text in ["1e300 begun 0\n", "-1 begun 0\n", "nan begun 0\n", "inf begun 0\n", "1.8e19 begun 0\n"]
        {
            assert_eq!(begun(text), None, "{text}");
        }
    }

    #[test]
    fn what_a_shard_does_is_known_from_its_trace_and_the_queue() {
        let trace = |text| Trace::parse(text);
        let begun = "5 begun 0 a\n";
        for (text, queued, expected) in [
            ("", Queued::Waits, State::Queued),
            ("", Queued::Gone, State::NotBegun),
            (begun, Queued::Runs, State::Running),
            // killed with its node, and not in the queue any more
            (begun, Queued::Gone, State::Stopped),
            (begun, Queued::Waits, State::Requeued),
            ("5 begun 0 a\n6 ended 3\n6 requeued\n", Queued::Unknown, State::Requeued),
            ("5 begun 0 a\n6 ended 3\n", Queued::Unknown, State::Stopped),
            ("5 begun 0 a\n6 ended 137\n", Queued::Gone, State::Failed),
        ] {
            assert_eq!(state(text == begun, &trace(text), queued, false), expected, "{text:?} {queued:?}");
        }
        assert_eq!(state(true, &trace(begun), Queued::Runs, true), State::StandsStill);
        assert_eq!(state(true, &trace(""), Queued::Gone, true), State::StandsStill);
    }

    #[test]
    fn tasks_of_other_directories_do_not_count() {
        let said = "PENDING 3 /a b\nRUNNING 4 /a b\nRUNNING 5 /a\nCOMPLETING 6 /a b\nRUNNING N/A /a b\n";
        let tasks = Queue(Some(Queue::parse(said, Path::new("/a b"))));
        let found = [3, 4, 5, 6].map(|number| tasks.state_of(number));
        assert_eq!(found, [Queued::Waits, Queued::Runs, Queued::Gone, Queued::Unknown]);
    }
}
