//! A sweep as a job array of Slurm.

use super::values::{parse_directive, parse_jobs, parse_positive};
use clap::Args;
use std::num::NonZero;

/// What stands in the script of a job array. Values go to Slurm as they are: it knows what its site allows.
#[derive(Debug, Args)]
#[command(next_help_heading = "As a job array of Slurm")]
pub(crate) struct SlurmArgs {
    /// Compute nothing; write the script of a job array, DIR/slurm/array.sh
    #[arg(long, conflicts_with_all = ["shard", "merge", "jobs", "yes", "plan"])]
    pub(crate) slurm: bool,
    /// Send it with sbatch
    #[arg(long, requires = "slurm")]
    pub(crate) submit: bool,
    /// Tasks of the array, a shard of the points for each [default: 1000, if there are as many points]
    #[arg(long, value_name = "N", requires = "slurm", value_parser = parse_positive)]
    pub(crate) array_size: Option<NonZero<u64>>,
    /// Cores of a task
    #[arg(long, value_name = "N", requires = "slurm", default_value = "1", value_parser = parse_jobs)]
    pub(crate) cpus: NonZero<usize>,
    /// Time limit of a task; one that needs more begins again where it was
    #[arg(long, value_name = "D-HH:MM:SS", requires = "slurm", value_parser = parse_directive)]
    pub(crate) time: Option<String>,
    /// Memory of a task, such as 500M
    #[arg(long, value_name = "SIZE", requires = "slurm", value_parser = parse_directive)]
    pub(crate) mem: Option<String>,
    /// Partition
    #[arg(long, value_name = "NAME", requires = "slurm", value_parser = parse_directive)]
    pub(crate) partition: Option<String>,
    /// Account
    #[arg(long, value_name = "NAME", requires = "slurm", value_parser = parse_directive)]
    pub(crate) account: Option<String>,
    /// Another option of sbatch, repeatable: --sbatch=--qos=low
    #[arg(
        long,
        value_name = "OPTION",
        requires = "slurm",
        allow_hyphen_values = true,
        value_parser = parse_directive
    )]
    pub(crate) sbatch: Vec<String>,
}
