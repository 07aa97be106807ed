//! Source and choice of frames.

use super::values::{parse_jobs, parse_seconds, parse_time};
use clap::Args;
use source::Named;
use std::num::NonZero;

/// Source and choice of frames, for all commands that read frames.
#[derive(Debug, Clone, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(crate) struct FramesArgs {
    /// `live` (the only live run), `live:RUN`, or a recording: a file or a URL
    #[arg(value_name = "SOURCE", default_value = "live")]
    pub(crate) source: Named,
    /// Attach without ever holding the run back: frames may be missed, and are counted
    #[arg(long)]
    pub(crate) latest: bool,
    /// Recompute the frames before the first one that arrives, from step 0 on, and all that are missing
    #[arg(long, conflicts_with = "from")]
    pub(crate) from_start: bool,
    /// Recompute frames that were missed
    #[arg(long)]
    pub(crate) fill_gaps: bool,
    /// Recompute the steps between frames (these results are not published on the bus)
    #[arg(long)]
    pub(crate) every_step: bool,
    /// Begin at this simulated time (s); a recording is opened there. What happened before is not known, as to a
    /// consumer that attaches then
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = parse_time)]
    pub(crate) from: f64,
    /// End at this simulated time (s)
    #[arg(long, value_name = "S", value_parser = parse_time)]
    pub(crate) until: Option<f64>,
    /// Threads that recompute the steps of a sparse recording [default: one for each core]
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Give up when no run appears within this time (s) [default: wait]
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    pub(crate) timeout: Option<f64>,
    /// Replace files that exist
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
