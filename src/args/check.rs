//! The check of the time until which a run is determined.

use super::Overrides;
use super::figures::LookArgs;
use super::values::parse_tolerance;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline check run.mcap                           a recording: simulates its run again\n  \
    beadline check --preset walls --figure growth.png draws the growth of errors\n  \
    beadline check chain.toml --dt 2e-7               a configuration, as for `beadline run`\n  \
    beadline check --beads 1200 --impurity 0=10e-3 --tolerance 1e-3\n\n\
    A run that conserves energy can still be wrong. `check` computes three twins beside the run: one with half and one with \
    a quarter of the step, and one with initial velocities that differ in the last place; and it carries the roundings of the \
    run by its tangent. The error of the step is twice the larger difference to the first two, the largest of about the last T. \
    The error of rounding is the tangent, or of energies and counts, and with gear5, the difference to the third. Each quantity \
    is determined until both together first exceed the tolerance, in units of L, v0 and ½·m·v0²; counts until they differ (1 in \
    100 contacts may). For displacements and velocities, where 9/8 of the difference to a quarter of the step counts (4/3 with \
    damping), this time is a prediction: of 200 random runs it was too late in none, and too early by a factor of 2 or more in 4. \
    The step (a shorter one helps) or chaos (nothing helps) ends it.\n\
    `check` takes ten to twenty times as long as the run. Exit code 3: something is not determined to the end."
)]
pub(crate) struct CheckArgs {
    /// A recording, or a configuration file
    #[arg(value_name = "FILE.mcap|CONFIG.toml", conflicts_with = "preset")]
    pub(crate) source: Option<PathBuf>,
    /// Ready-made configuration; see `beadline presets`
    #[arg(long, value_name = "NAME", default_value = "light-impurity")]
    pub(crate) preset: String,
    /// Largest error of a determined quantity, in units of L, v0 and ½·m·v0²
    #[arg(long, value_name = "X", default_value_t = consumers::determination::TOLERANCE, value_parser = parse_tolerance)]
    pub(crate) tolerance: f64,
    /// Draw the growth of the errors, repeatable
    #[arg(long, value_name = "FILE.svg|.png|.pdf")]
    pub(crate) figure: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    /// Table of the errors over time
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) overrides: Overrides,
}
