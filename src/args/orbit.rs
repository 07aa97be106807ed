//! Periodic orbits.

use super::figures::LookArgs;
use super::values::parse_jobs;
use clap::Args;
use std::num::NonZero;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline orbit --example > breather.toml          a file to begin with\n  \
    beadline orbit breather.toml --out breather       finds it, and follows it until it is unstable\n  \
    beadline view breather/change-1.mcap              the orbit at the first change, as any run\n\n\
    An orbit file is a configuration with a table [orbit]: period_s, energy_j or amplitude_m, and a seed: mode, [initial] or [striker]. A \
    drive gives the period itself. The step divides the period. Newton's method changes the state at the beginning until it comes back, with the exact \
    derivative of the steps. [continue] follows the orbits along a key and finds where they become unstable. [grid] makes a map of \
    stability over two keys. The same command goes on \
    with a branch or a map that was interrupted. Exit code 3: no orbit was found (at a point of a map, too), the branch ends before its last value, or a change of stability on it was not located.")]
pub(crate) struct OrbitArgs {
    /// A configuration with [orbit]
    #[arg(value_name = "ORBIT.toml", required_unless_present = "example")]
    pub(crate) file: Option<PathBuf>,
    /// Directory for the results, which is made
    #[arg(long, value_name = "DIR", required_unless_present = "example")]
    pub(crate) out: Option<PathBuf>,
    /// Print an orbit file to begin with
    #[arg(long, value_name = "breather|diode|fput|map|pair", num_args = 0..=1, default_missing_value = "breather")]
    pub(crate) example: Option<String>,
    /// Threads for the lines of a map [default: one for each core]
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Replace the results in the directory
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
