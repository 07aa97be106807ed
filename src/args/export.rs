//! States for other programs.

use super::values::{one_of, parse_jobs, parse_positive, parse_time};
use clap::Args;
use exports::Format;
use schemas::beads::Beads;
use source::Named;
use std::num::NonZero;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline export run.mcap --out run.npz                    numpy.load(\"run.npz\")[\"velocity_m_s\"]\n  \
    beadline export run.mcap --out part.npz --from 0.02 --until 0.03 --beads 400..600\n  \
    beadline export sparse.mcap --out all.npz --every-step    also steps that were not recorded\n  \
    beadline export run.mcap --out few.csv --every-steps 100  the steps 0, 100, 200 …, for pandas\n  \
    beadline export run.mcap --out run.parquet                for pandas, Polars, DuckDB\n  \
    beadline export run.mcap --to foxglove --out shown.mcap   for Foxglove, Lichtblick, Rerun\n\n\
    Exit code 3: the recording was not finished or is damaged; what it holds is exported."
)]
pub(crate) struct ExportArgs {
    /// The recording
    #[arg(value_name = "FILE")]
    pub(crate) file: Named,
    /// Format [default: the one that the name of PATH ends with]
    #[arg(long, value_name = "FORMAT", value_parser = one_of(Format::ALL, |format| format.name().into()))]
    pub(crate) to: Option<Format>,
    /// File to write
    #[arg(long, value_name = "PATH")]
    pub(crate) out: PathBuf,
    /// Begin at this simulated time (s)
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = parse_time)]
    pub(crate) from: f64,
    /// End at this simulated time (s)
    #[arg(long, value_name = "S", value_parser = parse_time)]
    pub(crate) until: Option<f64>,
    /// Only these beads: 100..200 is without bead 200, 100..=199 with bead 199, -4.. the last four
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    pub(crate) beads: Option<Beads>,
    /// Only the steps that are a multiple of K; those that were not recorded are recomputed
    #[arg(long, value_name = "K", value_parser = parse_positive)]
    pub(crate) every_steps: Option<NonZero<u64>>,
    /// Every step, recomputed from the recorded states, which are proven by it
    #[arg(long, conflicts_with = "every_steps")]
    pub(crate) every_step: bool,
    /// Point clouds of the chain, spread over that time, for `--to foxglove`
    #[arg(long, value_name = "N", default_value = "300", value_parser = parse_positive)]
    pub(crate) clouds: NonZero<u64>,
    /// Threads that recompute, if the recording is sparse [default: one for each core]
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Replace a file that exists
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
