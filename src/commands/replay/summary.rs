//! Summary of a replay, in numbers.

use crate::args::{Pace, ReplayArgs};
use crate::display::{self, count, duration};
use crate::failure::{Done, Failure};
use crate::frames::FramesError;
use crate::keyboard::Seek;
use crate::publishing::add_pauses;
use crate::report::{Rows, report};
use crate::stage::Left;
use bus::PublishCounts;
use producer::replay::ReplayOutcome;
use schemas::frame::EndReason;
use schemas::manifest::{RunId, RunManifest};
use schemas::run_name::RunName;
use serde_json::json;
use std::time::Duration;

/// All streams of a replay.
pub(super) struct Summary {
    /// Streams published: one a loop, and one more after each seek.
    pub(super) streams: u64,
    seek_count: u64,
    /// Targets of the keys from the end of the last stream.
    pub(super) seeks: Vec<Seek>,
    /// The pace for the next stream.
    pub(super) pace: Pace,
    /// True if the next stream begins with a pause.
    pub(super) is_paused: bool,
    run: Option<(RunName, RunId)>,
    first_frame: Option<u64>,
    published_count: u64,
    /// Outcome of the last stream.
    last: Option<ReplayOutcome<FramesError>>,
    held_back: Duration,
    evicted: u64,
    dropped: Vec<String>,
    wall: Duration,
    paused: Duration,
}

impl Summary {
    pub(super) fn new(args: &ReplayArgs) -> Self {
        Self {
            streams: 0,
            seek_count: 0,
            seeks: Vec::new(),
            pace: args.rate,
            is_paused: false,
            run: None,
            first_frame: None,
            published_count: 0,
            last: None,
            held_back: Duration::ZERO,
            evicted: 0,
            dropped: Vec::new(),
            wall: Duration::ZERO,
            paused: Duration::ZERO,
        }
    }

    /// Notes the run.
    pub(super) fn name(&mut self, manifest: &RunManifest) {
        self.run = Some((manifest.provenance.name.clone(), manifest.provenance.run_id));
    }

    /// Number of times it was published from its beginning.
    fn loops(&self) -> u64 {
        self.streams - self.seek_count
    }

    /// Number of the loop of the next stream, if there are several.
    pub(super) fn number(&self) -> String {
        let number = self.loops() + u64::from(self.seeks.is_empty());
        if number > 1 { format!("loop {number}") } else { String::new() }
    }

    pub(super) fn take(&mut self, left: Left) {
        self.seek_count += u64::from(!self.seeks.is_empty());
        (self.pace, self.is_paused, self.seeks) = (left.pace, left.is_paused, left.seeks);
        self.dropped.extend(left.dropped.names);
        self.wall += left.wall;
        self.paused += left.paused;
    }

    pub(super) fn count(&mut self, counts: &PublishCounts) {
        self.held_back += counts.held_back;
        self.evicted += counts.evicted;
    }

    pub(super) fn add(&mut self, outcome: ReplayOutcome<FramesError>) {
        self.streams += 1;
        self.first_frame.get_or_insert(outcome.first_frame);
        self.published_count += outcome.published_count;
        self.last = Some(outcome);
    }

    /// Prints it, and says whether anything was lost, or left out because it was `stopped`: being stopped is the only
    /// end of a loop.
    pub(super) fn report(mut self, args: &ReplayArgs, stopped: bool) -> Result<Done, Failure> {
        let Some(last) = self.last.take() else {
            notice!("stopped before the replay began");
            return Ok(Done::Lossy);
        };
        let cut_short =
            stopped && !args.again && !last.ended_as_asked && last.reason == EndReason::Interrupted;
        report(args.json, &self.json(args, &last), || self.text(args, &last))?;
        if let Some(broken) = last.broken {
            notice!("{:#}: consumers were told that the run failed", anyhow::Error::new(broken));
        } else if last.reason == EndReason::Unfinished {
            notice!("the recording was not closed: consumers were told that the run failed where it ends");
        }
        Ok(Done::whole_if(last.reason.is_orderly() && self.evicted == 0 && !cut_short))
    }

    fn text(&self, args: &ReplayArgs, last: &ReplayOutcome<FramesError>) -> String {
        let mut rows = Rows::default();
        if self.loops() > 1 {
            rows.add("loops", count(self.loops()));
        }
        if self.seek_count > 0 {
            rows.add("jumps", format_args!("{}, each to a new stream", count(self.seek_count)));
        }
        rows.add("frames published", count(self.published_count));
        rows.add("wall time", duration(self.wall));
        rows.add("held back by consumers", duration(self.held_back));
        add_pauses(&mut rows, self.paused, self.evicted);
        let end = display::end(last.reason, args.until.filter(|_| last.ended_as_asked));
        rows.under(format_args!("{} replayed: {end}", args.file.display()))
    }

    fn json(&self, args: &ReplayArgs, last: &ReplayOutcome<FramesError>) -> serde_json::Value {
        json!({
            "run": self.run.as_ref().map(|(name, _)| name),
            "run_id": self.run.as_ref().map(|(_, id)| id),
            "path": args.file.to_string_lossy(),
            "end": display::end_word(last.reason, last.ended_as_asked),
            "loops": self.loops(),
            "jumps": self.seek_count,
            "first_frame": self.first_frame,
            "last_step": last.last_step,
            "frames_published": self.published_count,
            "wall_s": self.wall.as_secs_f64(),
            "paused_s": self.paused.as_secs_f64(),
            "held_back_s": self.held_back.as_secs_f64(),
            "consumers_dropped": self.dropped,
            "failure": last.broken.as_ref().map(ToString::to_string),
        })
    }
}
