//! The command line as it is written. Every mode turns its part once into validated values.

mod analyses;
mod check;
mod contents;
mod export;
mod figures;
mod film;
mod frames;
mod orbit;
mod pages;
mod recordings;
mod relay;
mod slurm;
#[cfg_attr(not(feature = "live"), path = "args/absent.rs")]
mod top;
mod values;

pub(crate) use analyses::{AnalysisArgs, AskedAnalysis, keeps_rows};
pub(crate) use check::CheckArgs;
pub(crate) use contents::command;
pub(crate) use export::ExportArgs;
pub(crate) use figures::{AxisArg, BandArg, ColoursArg, LookArgs, PlotArgs, subjects};
pub(crate) use film::FilmArgs;
pub(crate) use frames::FramesArgs;
pub(crate) use orbit::OrbitArgs;
pub(crate) use pages::{ShareArgs, ViewArgs};
pub(crate) use recordings::{
    CatalogArgs, ExpandArgs, RecordArgs, RecoverArgs, ReplayArgs, RewriteArgs, ThinArgs, UploadArgs,
    VerifyArgs,
};
pub(crate) use relay::RelayArgs;
pub(crate) use slurm::SlurmArgs;
pub(crate) use top::TopArgs;
pub(crate) use values::{Pace, Shard};

use crate::time_step::TimeStep;
use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use schemas::method::Method;
use schemas::presets::PRESETS;
use std::num::NonZero;
use std::path::PathBuf;
use values::{
    parse_count, parse_impurity, parse_jobs, parse_number, parse_pace, parse_pair, parse_positive,
    parse_seconds, parse_seed, parse_shard, parse_whole,
};

/// Shocks in granular chains: simulated, streamed, recorded and analysed while they run.
#[derive(Debug, Parser)]
#[command(
    name = "beadline",
    version,
    max_term_width = 100,
    allow_negative_numbers = true,
    subcommand_required = true,
    arg_required_else_help = true,
    after_help = "Exit codes: 0 done, 1 failed, 2 bad usage, a bad input file or an output that is in the way, 3 finished, but something was lost or is missing, or a signal (Ctrl-C, SIGTERM, SIGHUP) stopped the command early; a second Ctrl-C ends at once, with 1.\n\
                  With --json a failure is one line of JSON, the last one on stderr: {\"error\": {\"message\": …, \"causes\": […], \"exit_code\": N}}.\n\
                  Units are SI. Runs of one user meet under $BEADLINE_ROOT (else $XDG_RUNTIME_DIR/beadline or /tmp/beadline-<uid>).\n\n\
                  Examples:\n  \
                  beadline demo                         the whole pipeline once, with figures\n  \
                  beadline run --wait-for 1             a run that waits for an analysis …\n  \
                  beadline energies --figure e.svg      … which you start in another terminal\n  \
                  beadline energies light-impurity.mcap the same from the recording"
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run the whole pipeline once: a producer, three analyses, a recording, figures
    Demo(DemoArgs),
    /// Simulate a chain, publish every step, record it
    Run(Box<RunArgs>),
    /// Find the time until which a run is determined, and its digits: the step, chaos
    Check(Box<CheckArgs>),
    /// List the ready-made configurations
    Presets,
    /// Print a ready-made configuration as TOML, to be edited and run
    #[command(
        after_help = "Example:\n  beadline preset heavy-impurity > mine.toml && beadline run mine.toml"
    )]
    Preset {
        /// Its name, see `beadline presets`
        #[arg(value_parser = presets())]
        name: String,
    },
    /// Print the JSON Schema of a kind of file, for editors that know such schemas
    #[command(after_help = "Examples:\n  \
        beadline schema > beadline-run.schema.json          beside the files that name it\n  \
        beadline schema sweep > beadline-sweep.schema.json")]
    Schema {
        /// The kind of file
        #[arg(default_value = "run", value_parser = ["run", "sweep", "orbit"])]
        kind: String,
    },
    /// List the analyses: their columns, and the numbers that sweeps may keep
    #[command(after_help = "Examples:\n  beadline analyses\n  beadline analyses --json | jq '.[].numbers'")]
    Analyses {
        /// Print JSON, with the options of each
        #[arg(long)]
        json: bool,
    },
    /// Draw one figure: what the chain does at one time, over space and time, or what a sweep has found
    Plot(PlotArgs),
    /// Make a film of a recording: the map, the chain at one moment after the other, the energies
    Film(FilmArgs),
    /// Show a live run, a recording, a folder or a sweep in a browser
    View(ViewArgs),
    /// Make one HTML file of a recording that anyone can open, with every step in it
    Share(ShareArgs),
    /// Find a periodic orbit and its multipliers, or follow orbits along a parameter
    Orbit(Box<OrbitArgs>),
    /// Simulate a grid of runs and make a table of their results
    Sweep(SweepArgs),
    /// Reproduce the paper, figure by figure, claim by claim: simulate, draw and judge
    Reproduce(ReproduceArgs),
    /// Record a live run: its states, and the results that analyses publish
    Record(RecordArgs),
    /// Publish a recording again, so that analyses cannot tell it from the run
    Replay(ReplayArgs),
    /// Bring a live run to another host, recomputed there and proven
    Relay(RelayArgs),
    /// List the live runs of this user with their ends and consumers; or the recordings of a place
    #[command(after_help = "Examples:\n  \
        beadline ls --json | jq '.[].consumers'\n  \
        beadline ls results                         the recordings in a directory and below\n  \
        beadline ls s3://bucket/2026                the same in a store, two requests for each at most\n\n\
        `ls` reads only the beginnings and summaries of recordings. Exit code 3: one of them cannot be read.")]
    Ls {
        /// A directory or a URL with recordings [default: live runs]
        #[arg(value_name = "DIR|URL")]
        place: Option<PathBuf>,
        /// Print JSON
        #[arg(long)]
        json: bool,
        /// Print the names alone, one a line: for scripts
        #[arg(long, conflicts_with = "json")]
        names: bool,
    },
    /// Watch live runs in this terminal: rates, consumers, energies, profile, map
    Top(TopArgs),
    /// Keep every K-th state of a recording; the others can be recomputed bit for bit
    Thin(ThinArgs),
    /// Recompute the states between those of a sparse recording
    Expand(ExpandArgs),
    /// Write states in the formats of other programs
    Export(ExportArgs),
    /// Prove a recording: recompute every state from the one before and compare the bits
    Verify(VerifyArgs),
    /// Make a whole recording of a damaged or unfinished one
    Recover(RecoverArgs),
    /// Send a recording to a store, such as S3
    Upload(UploadArgs),
    /// Make a table of the recordings in a directory or behind a URL
    Catalog(CatalogArgs),
    /// Show the contents of a recording
    #[command(after_help = "Examples:\n  \
        beadline info run.mcap\n  \
        beadline info run.mcap.partial         also of a live or a killed run\n  \
        beadline info s3://bucket/run.mcap     in a store; all commands that read take URLs\n  \
        beadline info run.mcap --json | jq .physics")]
    Info {
        /// The recording: a file, or a URL (s3://, gs://, az://, http://, https://)
        file: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Print the completions of these commands for a shell
    #[command(after_help = "Examples:\n  \
        beadline completions bash > ~/.local/share/bash-completion/completions/beadline\n  \
        beadline completions zsh > ~/.zfunc/_beadline      # a directory in $fpath\n  \
        beadline completions fish > ~/.config/fish/completions/beadline.fish")]
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Print these pages for `man`, or write all of them
    Man(ManArgs),
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline man run | man -l -                         read one\n  \
    beadline man --out ~/.local/share/man/man1          then `man beadline-run` finds it")]
pub(crate) struct ManArgs {
    /// The command of the page [default: beadline itself]
    pub(crate) command: Option<String>,
    /// Write the pages of all commands into this directory, which is created if missing
    #[arg(long, value_name = "DIR", conflicts_with = "command")]
    pub(crate) out: Option<PathBuf>,
    /// Replace pages that exist
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Example:\n  beadline demo --out shock   writes everything into the directory `shock`"
)]
pub(crate) struct DemoArgs {
    /// Directory for the recording, the tables and the figures
    #[arg(long, value_name = "DIR", default_value = "beadline-demo")]
    pub(crate) out: PathBuf,
    /// Replace files of an earlier demo
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) look: LookArgs,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline run                                      the light-impurity run of the paper\n  \
    beadline run --preset homogeneous --alpha 1.2     a preset, one value changed\n  \
    beadline run chain.toml --out chain.mcap          a configuration of your own\n  \
    beadline run --no-record --wait-for 2             starts when two analyses are ready\n  \
    beadline run --impurity 400=2e-3 --impurity 600=0.5e-3 --duration 0.1\n  \
    beadline run --striker 0=5 --striker 999=-5       two pulses that meet\n  \
    beadline run chain.toml --seed 7 --dry-run        only its description, disordered anew\n  \
    beadline run chain.toml --author 'Ada Lovelace' --licence CC-BY-4.0\n  \
    beadline run --resume chain.mcap.partial          goes on with a run that was interrupted\n  \
    beadline run chain.toml --out s3://bucket/chain.mcap   sent to a store while it is written\n\n\
    A kill costs at most the last --flush-period of a recording, a power failure the last --sync-period. --resume \
    reads everything about the run from its recording, writes the recording again as .partial, and goes on after \
    the last state. The result is the same as without the interruption. --resume takes .mcap.partial, or an .mcap \
    that ends early, and with --out leaves this file unchanged.\n\n\
    On a terminal: space pauses and goes on, → or . makes one more frame and pauses, + and - double and halve the \
    pace, q ends the run in order. Consumers of a paused run stay attached and wait."
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(crate) struct RunArgs {
    /// Configuration file; see `beadline preset light-impurity` for one to start from
    #[arg(value_name = "CONFIG.toml", conflicts_with = "preset")]
    pub(crate) config: Option<PathBuf>,
    /// Ready-made configuration; see `beadline presets`
    #[arg(long, value_name = "NAME", default_value = "light-impurity", value_parser = presets())]
    pub(crate) preset: String,
    /// Name of the run on the bus: a-z, 0-9 and -
    #[arg(long, value_name = "RUN")]
    pub(crate) name: Option<String>,
    /// Recording to write [default: RUN.mcap]
    #[arg(long, value_name = "FILE.mcap|URL", conflicts_with = "no_record")]
    pub(crate) out: Option<PathBuf>,
    /// Directory for a recording on its way to a URL [default: beadline/spool in the user's cache]
    #[arg(long, value_name = "DIR", conflicts_with = "no_record")]
    pub(crate) spool: Option<PathBuf>,
    /// Publish only, write no recording
    #[arg(long, conflicts_with = "record_every_steps")]
    pub(crate) no_record: bool,
    /// Record only: the run needs no shared memory, and no consumer can follow it
    #[arg(long, conflicts_with_all = ["wait_for", "stall_timeout", "no_record"])]
    pub(crate) no_publish: bool,
    /// Go on with an interrupted run, given its recording
    #[arg(
        long,
        value_name = "FILE.mcap.partial",
        conflicts_with_all = ["config", "preset", "name", "no_record", "CreditArgs", "Overrides"]
    )]
    pub(crate) resume: Option<PathBuf>,
    /// Replace a recording that exists
    #[arg(long)]
    pub(crate) force: bool,
    /// Start when this many lossless consumers are ready
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_count)]
    pub(crate) wait_for: usize,
    /// Pace of the run: `max`, or simulated seconds per second
    #[arg(long, value_name = "max|X", default_value = "max", value_parser = parse_pace)]
    pub(crate) pace: Pace,
    /// Drop a lossless consumer that holds the run back for this long (s)
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = parse_seconds)]
    pub(crate) stall_timeout: f64,
    /// Write the recorded part to the file at least this often (s): a kill costs this time
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = parse_seconds, conflicts_with = "no_record")]
    pub(crate) flush_period: f64,
    /// Sync the file to the disk at least this often (s): a power failure costs this time
    #[arg(long, value_name = "S", default_value_t = 5.0, value_parser = parse_seconds, conflicts_with = "no_record")]
    pub(crate) sync_period: f64,
    /// Check the run on the side, as `beadline check` does; exit code 3 if it is not determined to its end
    #[arg(long)]
    pub(crate) check: bool,
    /// Describe the run, with the masses and stiffnesses of materials, and run nothing
    #[arg(long, conflicts_with_all = ["resume", "check"])]
    pub(crate) dry_run: bool,
    /// Begin without a question, however long it takes
    #[arg(long)]
    pub(crate) yes: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) credit: CreditArgs,
    #[command(flatten)]
    pub(crate) overrides: Overrides,
}

/// Credit in place of that of the configuration.
#[derive(Debug, Args)]
#[command(next_help_heading = "For those who cite the run, as in [provenance] of the configuration")]
pub(crate) struct CreditArgs {
    /// The author, or several
    #[arg(long, value_name = "NAME")]
    pub(crate) author: Option<String>,
    /// ORCID of the author
    #[arg(long, value_name = "0000-0000-0000-0000")]
    pub(crate) orcid: Option<String>,
    /// Licence of the recording, such as CC-BY-4.0
    #[arg(long, value_name = "SPDX")]
    pub(crate) licence: Option<String>,
    /// DOI of the recording, or of the work that it belongs to
    #[arg(long, value_name = "10.…")]
    pub(crate) doi: Option<String>,
}

impl RunArgs {
    /// True if others can follow the run.
    pub(crate) fn publishes(&self) -> bool {
        bus::IS_THERE && !self.no_publish
    }
}

/// Values that replace those of the configuration.
#[derive(Debug, Args)]
#[command(next_help_heading = "Instead of the configuration's values")]
pub(crate) struct Overrides {
    /// Number of beads
    #[arg(long, value_name = "N", value_parser = parse_whole)]
    pub(crate) beads: Option<u64>,
    /// Exponent of the contact law F = k·δ^α, at least 1
    #[arg(long, value_parser = parse_number)]
    pub(crate) alpha: Option<f64>,
    /// Stiffness k (N·m^-α)
    #[arg(long, value_name = "K", value_parser = parse_number)]
    pub(crate) stiffness: Option<f64>,
    /// Mass of a bead (kg)
    #[arg(long, value_name = "KG", value_parser = parse_number)]
    pub(crate) bead_mass: Option<f64>,
    /// A bead of another mass (kg), repeatable; `none` for no impurity
    #[arg(long, value_name = "BEAD=KG", value_parser = parse_impurity)]
    pub(crate) impurity: Vec<Option<(u64, f64)>>,
    /// A bead that moves at first, and its velocity (m/s), repeatable
    #[arg(long, value_name = "BEAD=M_S", value_parser = parse_pair)]
    pub(crate) striker: Vec<(u64, f64)>,
    /// Seed of disorder, thermal velocities, random phases and baths
    #[arg(long, value_name = "N", value_parser = parse_seed)]
    pub(crate) seed: Option<u64>,
    /// Simulated time (s)
    #[arg(long, value_name = "S", value_parser = parse_number)]
    pub(crate) duration: Option<f64>,
    /// Time step (s), or `auto:TOL` to find one with max|ΔE/E| ≤ TOL [default: a fraction of the collision time T]
    #[arg(long, value_name = "S|auto:TOL", value_parser = TimeStep::parse)]
    pub(crate) dt: Option<TimeStep>,
    #[arg(long, help = format!("Integration method: {}", Method::names()))]
    pub(crate) method: Option<Method>,
    /// Publish every K-th step
    #[arg(long, value_name = "K", value_parser = parse_whole)]
    pub(crate) publish_every_steps: Option<u64>,
    /// Record every K-th step, the first and the last [default: every published one]
    #[arg(long, value_name = "K", value_parser = parse_whole)]
    pub(crate) record_every_steps: Option<u64>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline sweep --example > reflection.toml           a sweep file to start from\n  \
    beadline sweep reflection.toml --out reflection      all points, on all cores; or goes on\n  \
    beadline sweep reflection.toml --out all --shard 3/16   one job of an array of 16\n  \
    beadline sweep --merge all                           tables of the rows that are there\n  \
    beadline sweep reflection.toml --plan --cores 1000   an estimate from a few of its points\n  \
    beadline sweep reflection.toml --out all --slurm --time 4:00:00 --submit   a job array of Slurm\n  \
    beadline sweep --status all                          its progress, on any machine that sees DIR\n\n\
    DIR gets results.csv and results.parquet, for a sweep over seeds also ensemble.csv and .parquet (the same bytes for any \
    order, jobs, shards and interruptions), timings.csv, the rows of each shard, and recordings/ if asked for. A run that fails \
    has a row with the reason, and makes the exit code 3. A signal does so, too, while points are missing."
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(crate) struct SweepArgs {
    /// Sweep file: a base, a grid, cases
    #[arg(value_name = "SWEEP.toml", required_unless_present_any = ["example", "status"])]
    pub(crate) file: Option<PathBuf>,
    /// Directory for the results; its finished points are not computed again
    #[arg(long, value_name = "DIR", required_unless_present_any = ["example", "plan", "status", "merge"])]
    pub(crate) out: Option<PathBuf>,
    /// Points computed at the same time [default: the cores of this machine]
    #[arg(long, value_name = "N", value_parser = parse_jobs, conflicts_with = "SlurmArgs")]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Compute only the points whose index leaves the remainder I by N
    #[arg(long, value_name = "I/N", value_parser = parse_shard, conflicts_with = "SlurmArgs")]
    pub(crate) shard: Option<Shard>,
    /// Compute nothing; make tables of the existing rows: `--merge DIR`, or with SWEEP.toml and --out
    #[arg(long, conflicts_with_all = ["shard", "jobs", "force", "record", "yes", "SlurmArgs"])]
    pub(crate) merge: bool,
    /// Record each point, even if the sweep file does not ask for it
    #[arg(long)]
    pub(crate) record: bool,
    /// Remove the files of another sweep in DIR; with --slurm: replace its script, and keep the rows
    #[arg(long, conflicts_with = "shard")]
    pub(crate) force: bool,
    /// Begin without a question, however long it takes
    #[arg(long, conflicts_with = "SlurmArgs")]
    pub(crate) yes: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Compute a few points for two seconds, and print an estimate for all: time, disk, shards, first limit
    #[arg(long, conflicts_with_all = ["out", "shard", "jobs", "force", "record", "yes", "merge", "SlurmArgs"])]
    pub(crate) plan: bool,
    /// Cores to plan for, beside those of this machine [default: 1, 100, 1,000 and 10,000]
    #[arg(
        long,
        value_name = "N",
        requires = "plan",
        value_parser = parse_positive,
        // clap does not ask for an argument that another one rules out
        conflicts_with_all = ["out", "shard", "jobs", "force", "record", "yes", "merge", "status", "SlurmArgs"]
    )]
    pub(crate) cores: Option<NonZero<u64>>,
    /// Print a sweep file to start from
    #[arg(
        long,
        exclusive = true,
        value_name = "reflection|equipartition|diatomic|conductivity|disorder",
        num_args = 0..=1,
        default_missing_value = "reflection"
    )]
    pub(crate) example: Option<String>,
    /// Print the progress of the sweep in DIR, and the shards that failed, were requeued, have not begun or stand still
    #[arg(long, value_name = "DIR", conflicts_with_all = ["file", "out", "merge", "shard", "jobs", "record", "force", "yes", "SlurmArgs", "plan"])]
    pub(crate) status: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) slurm: SlurmArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline reproduce                        everything, into the directory `paper`\n  \
    beadline reproduce --list                 the names of the figures\n  \
    beadline reproduce width vmax --out fits  two figures and their claims\n\n\
    DIR gets REPORT.md and report.json (each claim with our numbers and a verdict), GALLERY.md, the figures in \
    img/paper, and recordings. A run that has a recording there is not simulated again.\n\
    Exit code 3: a number contradicts its independently computed reference.")]
pub(crate) struct ReproduceArgs {
    /// Figures to reproduce, see --list [default: all]
    #[arg(value_name = "FIGURE")]
    pub(crate) figures: Vec<String>,
    /// Directory for the report, the figures and the recordings
    #[arg(long, value_name = "DIR", default_value = "paper")]
    pub(crate) out: PathBuf,
    /// Runs simulated at the same time [default: the cores of this machine]
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Replace a report that exists
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    /// List the figures and do nothing else
    #[arg(long)]
    pub(crate) list: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// The names of the ready-made configurations, which shells can complete.
fn presets() -> PossibleValuesParser {
    PossibleValuesParser::new(PRESETS.map(|preset| preset.name))
}
