//! The command line as it is written. Every mode turns its part once into validated values.

use crate::bench;
use crate::sweep::directory::Shard;
use crate::time_step::TimeStep;
use clap::{Args, Parser, Subcommand};
use schemas::method::Method;
use schemas::recording::Split;
use schemas::run_name::RunName;
use std::num::NonZero;
use std::path::PathBuf;

/// Shocks in granular chains: simulated, streamed, recorded and analysed while they run.
#[derive(Debug, Parser)]
#[command(
    name = "beadline",
    version,
    max_term_width = 100,
    allow_negative_numbers = true,
    subcommand_required = true,
    arg_required_else_help = true,
    after_help = "Exit codes: 0 done (also when a signal ended a run or a live analysis in order), 1 failed, 2 bad usage or bad input file, 3 finished, but something was lost or is missing.\n\
                  Units are SI. Runs of one user meet under $BEADLINE_ROOT (/tmp/beadline-<uid>).\n\n\
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
    /// List the ready-made configurations
    Presets,
    /// Print a ready-made configuration as TOML, to be edited and run
    Preset {
        /// Its name, see `beadline presets`
        name: String,
    },
    /// Where the energy is: left of the impurity, in it, right of it
    Energies(EnergiesArgs),
    /// The motion of the impurity, or of any beads: trajectory, contacts, turning points
    Impurity(ImpurityArgs),
    /// The space-time map of compressed, touching and open contacts
    Contacts(ContactsArgs),
    /// How the first pulse deforms a contact, beside what theory expects
    Deformation(DeformationArgs),
    /// The pulses: where and when they pass, how strong, fast and wide, where from and where to
    Pulses(PulsesArgs),
    /// Simulate a grid of runs and make a table of their results
    Sweep(SweepArgs),
    /// The paper, figure by figure, claim by claim: simulated, drawn and judged
    Reproduce(ReproduceArgs),
    /// Record a live run: its states, and the results that analyses publish
    Record(RecordArgs),
    /// Publish a recording again, so that analyses cannot tell it from the run
    Replay(ReplayArgs),
    /// Measure this machine: each figure beside its limit, as ratios
    Bench(BenchArgs),
    /// List the live runs of this user
    Ls {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Keep every K-th state of a recording; the others can be recomputed bit for bit
    Thin(ThinArgs),
    /// Recompute the states between those of a sparse recording
    Expand(ExpandArgs),
    /// Prove a recording: recompute every state from the one before and compare the bits
    Verify(VerifyArgs),
    /// Make a whole recording of a damaged or unfinished one
    Recover(RecoverArgs),
    /// Show what is in a recording
    Info {
        /// The recording
        file: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Example:\n  beadline demo --out shock   leaves everything in the directory `shock`"
)]
pub(crate) struct DemoArgs {
    /// Directory for the recording, the tables and the figures
    #[arg(long, value_name = "DIR", default_value = "beadline-demo")]
    pub(crate) out: PathBuf,
    /// Replace files of an earlier demo
    #[arg(long)]
    pub(crate) force: bool,
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
    beadline run --resume chain.mcap.partial          goes on with a run that was interrupted\n\n\
    A kill costs at most the last --flush-period of a recording, a power failure the last --sync-period. --resume\n\
    takes everything of the run from its recording, writes that again as .partial and goes on after its last\n\
    state; the result is what it would have been without the interruption. It takes .mcap.partial, or an .mcap\n\
    that ends early, and with --out leaves it as it is."
)]
pub(crate) struct RunArgs {
    /// Configuration file; see `beadline preset light-impurity` for one to start from
    #[arg(value_name = "CONFIG.toml", conflicts_with = "preset")]
    pub(crate) config: Option<PathBuf>,
    /// Ready-made configuration; see `beadline presets`
    #[arg(long, value_name = "NAME", default_value = "light-impurity")]
    pub(crate) preset: String,
    /// Name of the run on the bus: a-z, 0-9 and -
    #[arg(long, value_name = "RUN")]
    pub(crate) name: Option<String>,
    /// Recording to write [default: RUN.mcap]
    #[arg(long, value_name = "FILE.mcap", conflicts_with = "no_record")]
    pub(crate) out: Option<PathBuf>,
    /// Publish only, write no recording
    #[arg(long)]
    pub(crate) no_record: bool,
    /// Go on with an interrupted run, given its recording
    #[arg(
        long,
        value_name = "FILE.mcap.partial",
        conflicts_with_all = ["config", "preset", "name", "no_record", "Overrides"]
    )]
    pub(crate) resume: Option<PathBuf>,
    /// Replace a recording that exists
    #[arg(long)]
    pub(crate) force: bool,
    /// Start when this many lossless consumers are ready
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) wait_for: usize,
    /// How fast to go: `max`, or simulated seconds per second
    #[arg(long, value_name = "max|X", default_value = "max", value_parser = parse_pace)]
    pub(crate) pace: Pace,
    /// Drop a lossless consumer that holds the run back for this long (s)
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = parse_seconds)]
    pub(crate) stall_timeout: f64,
    /// Write what was recorded to the file at least this often (s): what a kill costs
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = parse_seconds, conflicts_with = "no_record")]
    pub(crate) flush_period: f64,
    /// Sync the file to the disk at least this often (s): what a power failure costs
    #[arg(long, value_name = "S", default_value_t = 5.0, value_parser = parse_seconds, conflicts_with = "no_record")]
    pub(crate) sync_period: f64,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) overrides: Overrides,
}

/// Values that replace those of the configuration.
#[derive(Debug, Args)]
#[command(next_help_heading = "Instead of the configuration's values")]
pub(crate) struct Overrides {
    /// Number of beads
    #[arg(long, value_name = "N")]
    pub(crate) beads: Option<u64>,
    /// Exponent of the contact law F = k·δ^α, at least 1
    #[arg(long)]
    pub(crate) alpha: Option<f64>,
    /// Stiffness k (N·m^-α)
    #[arg(long, value_name = "K")]
    pub(crate) stiffness: Option<f64>,
    /// Mass of a bead (kg)
    #[arg(long, value_name = "KG")]
    pub(crate) bead_mass: Option<f64>,
    /// A bead of another mass (kg), repeatable; `none` for no impurity
    #[arg(long, value_name = "BEAD=KG", value_parser = parse_impurity)]
    pub(crate) impurity: Vec<Option<(u64, f64)>>,
    /// The bead that moves at first, and its velocity (m/s)
    #[arg(long, value_name = "BEAD=M_S", value_parser = parse_pair)]
    pub(crate) striker: Option<(u64, f64)>,
    /// Simulated time (s)
    #[arg(long, value_name = "S")]
    pub(crate) duration: Option<f64>,
    /// Time step (s), or `auto:TOL` to find one with max|ΔE/E| ≤ TOL [default: a fraction of the collision time T]
    #[arg(long, value_name = "S|auto:TOL", value_parser = TimeStep::parse)]
    pub(crate) dt: Option<TimeStep>,
    /// Integration method: velocity-verlet, rkn4 or gear5
    #[arg(long)]
    pub(crate) method: Option<Method>,
    /// Publish every K-th step
    #[arg(long, value_name = "K")]
    pub(crate) publish_every_steps: Option<u64>,
    /// Record every K-th step, the first and the last [default: every published one]
    #[arg(long, value_name = "K")]
    pub(crate) record_every_steps: Option<u64>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline record --out run.mcap                            the only live run, from here on\n  \
    beadline record live:long --out long.mcap --from-start    with what came before, recomputed\n  \
    beadline record --out run.mcap --split-size 500MB         run-part-0001.mcap, run-part-0002.mcap …\n  \
    beadline record --out run.mcap --split-duration 0.01      a part for each 10 ms of simulated time\n\n\
    The run waits for the recorder when it cannot keep up. A part is finished before the next one begins; each\n\
    is a recording by itself: `beadline info`, `verify` and every analysis read it. Results are those that\n\
    `beadline energies`, `impurity`, `contacts` and `pulses` publish, from the first row on if the analysis\n\
    starts after the recorder. SIGINT ends the recording in order, and the run goes on.\n\
    Exit code 3: frames or rows of results were missed, the run vanished, or the disk is nearly full."
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(crate) struct RecordArgs {
    /// `live` (the only live run) or `live:RUN`
    #[arg(value_name = "SOURCE", default_value = "live")]
    pub(crate) source: String,
    /// Recording to write; parts of it are NAME-part-0001.mcap and so on
    #[arg(long, value_name = "FILE.mcap")]
    pub(crate) out: PathBuf,
    /// Go on in a new part with the first frame after the file has this size
    #[arg(long, value_name = "BYTES|500MB", value_parser = parse_split_size)]
    pub(crate) split_size: Option<u64>,
    /// Go on in a new part at each multiple of this simulated time (s)
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    pub(crate) split_duration: Option<f64>,
    /// End in order when the disk has less left than this [default: 100 MB, or 1 % of a small disk]
    #[arg(long, value_name = "BYTES|500MB", value_parser = parse_bytes)]
    pub(crate) min_free: Option<u64>,
    /// Record every K-th step, the first and the last [default: as the run does]
    #[arg(long, value_name = "K")]
    pub(crate) record_every_steps: Option<u64>,
    /// Recompute the frames before the first one that arrives, from step 0 on
    #[arg(long)]
    pub(crate) from_start: bool,
    /// Never hold the run back: frames may be missed, and are counted
    #[arg(long)]
    pub(crate) latest: bool,
    /// Recompute frames that were missed
    #[arg(long)]
    pub(crate) fill_gaps: bool,
    /// Record states only
    #[arg(long)]
    pub(crate) no_results: bool,
    /// Write what was recorded to the file at least this often (s): what a kill costs
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = parse_seconds)]
    pub(crate) flush_period: f64,
    /// Sync the file to the disk at least this often (s): what a power failure costs
    #[arg(long, value_name = "S", default_value_t = 5.0, value_parser = parse_seconds)]
    pub(crate) sync_period: f64,
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

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    beadline thin run.mcap --every-steps 100 --out sparse.mcap\n\n\
    Every state is proven on the way: recomputed from the one before. `beadline expand` brings the others back.\n\
    Other channels, results and those of other programs, stay whole.\n\
    K is a multiple of the steps between two frames of the run.")]
pub(crate) struct ThinArgs {
    /// The recording
    pub(crate) file: PathBuf,
    /// Keep every K-th step, the first and the last
    #[arg(long, value_name = "K")]
    pub(crate) every_steps: u64,
    #[command(flatten)]
    pub(crate) output: RewriteArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline expand sparse.mcap --out full.mcap                       every frame of the run\n  \
    beadline expand sparse.mcap --every-steps 1 --out all.mcap        also the steps between frames\n\n\
    Every state of the recording is proven on the way, and other channels stay whole. K is a multiple of the\n\
    steps between two frames of the run, or divides them: states between frames are then recorded without a\n\
    frame number, and whoever reads frames passes over them.")]
pub(crate) struct ExpandArgs {
    /// The recording
    pub(crate) file: PathBuf,
    /// Write every K-th step, the first and the last [default: every frame]
    #[arg(long, value_name = "K")]
    pub(crate) every_steps: Option<u64>,
    #[command(flatten)]
    pub(crate) output: RewriteArgs,
}

/// Where a recording is written again.
#[derive(Debug, Args)]
pub(crate) struct RewriteArgs {
    /// Recording to write
    #[arg(long, value_name = "FILE.mcap")]
    pub(crate) out: PathBuf,
    /// Threads that recompute, if the recording is sparse [default: one for each core]
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Replace a file that exists
    #[arg(long)]
    pub(crate) force: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline verify run.mcap                     `proven`, or what differs: frame, bead and quantity\n  \
    beadline verify run-part-*.mcap              each part, and that one follows from the other\n  \
    beadline verify run.mcap --json              the same for a program\n\n\
    Checked: every CRC, the manifest's checksum, every index, the order of the states, each state against the\n\
    one before by recomputing it, each summary against its state. Damage is named with its chunk and frames,\n\
    and what follows is verified all the same; `beadline recover` brings the frames back.\n\
    Exit code 3 if anything is not as it was written, frames are missing, the file is cut off, or the run was\n\
    computed by another kernel version: then nothing is wrong, but nothing is proven.")]
pub(crate) struct VerifyArgs {
    /// The recording, or consecutive parts of one
    #[arg(value_name = "FILE", required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// Threads that recompute [default: one for each core]
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline recover run.mcap.partial --out run.mcap     after a crash or a power failure\n  \
    beadline recover damaged.mcap --out whole.mcap       after a bad disk or a bad copy\n\n\
    Every whole message of the file is salvaged, from a torn last chunk, too. Frames that are lost are\n\
    recomputed from the state before, bit for bit, and proven by the next state of the file. A state without a\n\
    checksum that holds counts only if it is what the one before leads to. The file itself is left as it is.\n\
    Exit code 3 if something that was in the file is not in the new one, or was not what it must be; a last record\n\
    that was never written to its end is no loss.")]
pub(crate) struct RecoverArgs {
    /// The damaged or unfinished recording
    pub(crate) file: PathBuf,
    /// Leave out frames that are lost rather than recompute them
    #[arg(long)]
    pub(crate) no_fill: bool,
    #[command(flatten)]
    pub(crate) output: RewriteArgs,
}

/// What every analysis takes.
#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(crate) struct AnalysisArgs {
    /// `live` (the only live run), `live:RUN`, or a recording
    #[arg(value_name = "SOURCE", default_value = "live")]
    pub(crate) source: String,
    /// Draw a figure, repeatable
    #[arg(long, value_name = "FILE.svg|.png")]
    pub(crate) figure: Vec<PathBuf>,
    /// Attach without ever holding the run back: frames may be missed, and are counted
    #[arg(long)]
    pub(crate) latest: bool,
    /// Recompute the frames before the first one that arrives, from step 0 on
    #[arg(long)]
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
    /// Do not publish the results on the bus
    #[arg(long)]
    pub(crate) no_publish: bool,
    /// Replace files that exist
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline energies                                    attach to the only live run\n  \
    beadline energies run.mcap --out e.csv --figure e.svg\n  \
    beadline energies run.mcap --split 300               left and right of bead 300\n  \
    beadline energies sparse.mcap --every-step --from 0.04 --until 0.041 --out e.csv\n                                                       \
    every step of a part, also of a sparse recording"
)]
pub(crate) struct EnergiesArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// Table of the energies of each frame
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
    /// The bead that divides left from right [default: the first impurity that is not the striker, else the middle bead]
    #[arg(long, value_name = "BEAD")]
    pub(crate) split: Option<u64>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline impurity --figure trajectory.png            attach to the only live run\n  \
    beadline impurity run.mcap --out i.csv --events events.csv\n  \
    beadline impurity run.mcap --bead 499 --bead 501     other beads\n\n\
    A contact counts as closed while its overlap is above 1e-6 of the collision length L. Events are\n\
    interpolated between frames."
)]
pub(crate) struct ImpurityArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// Table of the motion in each frame
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
    /// Table of what happened: contacts that close or open, turning points
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) events: Option<PathBuf>,
    /// A bead to follow, repeatable [default: every impurity, or the middle bead]
    #[arg(long, value_name = "BEAD")]
    pub(crate) bead: Vec<u64>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline contacts --figure map.png                   attach to the only live run\n  \
    beadline contacts run.mcap --out counts.csv --out map.mcap\n  \
    beadline contacts map.mcap --figure map.svg          draw a map that was kept"
)]
pub(crate) struct ContactsArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// FILE.csv or .parquet: table of the counts in each frame; FILE.mcap: the class of every contact (repeatable)
    #[arg(long, value_name = "FILE.csv|.parquet|.mcap")]
    pub(crate) out: Vec<PathBuf>,
    /// Largest overlap or gap (m) that counts as touching [default: 1e-6 of the collision length L]
    #[arg(long, value_name = "M")]
    pub(crate) tolerance: Option<f64>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline deformation run.mcap --contact 100 --figure d.png\n  \
    beadline deformation run.mcap --contact 100 --contact 150 --out d.csv\n\n\
    Contact C joins beads C and C+1. Theories are scaled to the largest overlap; their width, speed,\n\
    impulse and shape are predictions."
)]
pub(crate) struct DeformationArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// A contact to follow, repeatable
    #[arg(long, value_name = "C", required = true)]
    pub(crate) contact: Vec<u64>,
    /// Table of the pulse: overlap, exact wave and continuum in each frame
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline pulses --figure tracks.png                  attach to the only live run\n  \
    beadline pulses run.mcap --out pulses.csv --positions tracks.csv\n  \
    beadline pulses run.mcap --threshold 0.01            only those above a hundredth of v0\n\n\
    A pulse passes a bead when |v| of the bead has a maximum in time while both of its contacts are\n\
    pressed; it counts once it has passed 5 beads, and ends where it meets an impurity or an end. Peaks\n\
    are good to 1e-4 if 8 frames fall into the time that a pulse takes to pass; a warning says when\n\
    frames are too far apart. V/V_sw is the speed over that of the exact solitary wave of the same\n\
    peak velocity: 1 for a pulse that no longer changes. asymmetry = (rear − front)/(rear + front) of\n\
    the half widths. `--json` and the tables have more: momentum, energy, width over that of the wave."
)]
pub(crate) struct PulsesArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// Table of the pulses, a row for each, in the order in which they end
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
    /// Table of their tracks: a row for each bead that a pulse passes
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) positions: Option<PathBuf>,
    /// Smallest peak velocity of a pulse, relative to the run's velocity scale (v0)
    #[arg(long, value_name = "X", default_value_t = consumers::pulses::Pulses::DEFAULT_THRESHOLD)]
    pub(crate) threshold: f64,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline sweep --example > reflection.toml           a sweep file to begin with\n  \
    beadline sweep reflection.toml --out reflection      all points, on all cores; again: goes on\n  \
    beadline sweep reflection.toml --out all --shard 3/16   one job of an array of 16\n  \
    beadline sweep reflection.toml --out all --merge     the rows that are there, as tables\n\n\
    DIR then has results.csv and results.parquet (the same bytes whatever the order, jobs, shards and\n\
    interruptions), timings.csv, the rows of each shard, and recordings/ if asked for. A run that fails\n\
    has a row that says why, and makes the exit code 3, as a signal does while points are missing."
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(crate) struct SweepArgs {
    /// What to sweep: a base, a grid, cases
    #[arg(value_name = "SWEEP.toml", required_unless_present = "example")]
    pub(crate) file: Option<PathBuf>,
    /// Directory for the results; finished points in it are not computed again
    #[arg(long, value_name = "DIR", required_unless_present = "example")]
    pub(crate) out: Option<PathBuf>,
    /// Points computed at the same time [default: the cores of this machine]
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Compute only the points whose index leaves the remainder I by N
    #[arg(long, value_name = "I/N", value_parser = parse_shard)]
    pub(crate) shard: Option<Shard>,
    /// Compute nothing; make tables of the rows that are there
    #[arg(long, conflicts_with_all = ["shard", "jobs", "force", "record"])]
    pub(crate) merge: bool,
    /// Record each point, also if the sweep file does not ask for it
    #[arg(long)]
    pub(crate) record: bool,
    /// Remove what another sweep has left in DIR
    #[arg(long, conflicts_with = "shard")]
    pub(crate) force: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Print a sweep file to begin with
    #[arg(long, exclusive = true)]
    pub(crate) example: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline reproduce                        everything, into the directory `paper`\n  \
    beadline reproduce --list                 the names of the figures\n  \
    beadline reproduce width vmax --out fits  two figures and their claims\n\n\
    DIR gets REPORT.md and report.json (each claim with our numbers and a verdict), GALLERY.md, the figures in\n\
    img/paper, and recordings, from which whatever was simulated before is taken again.\n\
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
    /// List the figures and do nothing else
    #[arg(long)]
    pub(crate) list: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline replay run.mcap                             waits for an analysis, then as fast as it can take …\n  \
    beadline energies --figure e.svg                     … which you start in another terminal\n  \
    beadline replay run.mcap --rate 0.01 --loop          100 times slower than real time, again and again\n  \
    beadline replay run.mcap --from 0.02 --until 0.03    a part of it\n  \
    beadline replay sparse.mcap --every-step             every step as a frame, recomputed bit for bit\n\n\
    Frames that a sparse recording does not hold are recomputed. On a terminal: space pauses and goes on,\n\
    → or . shows one more frame and pauses, + and - double and halve the rate, q quits.\n\
    The recording of a run that was not closed ends as a failed run does. Exit code 3: it was not closed, it is\n\
    damaged, or a consumer was dropped."
)]
pub(crate) struct ReplayArgs {
    /// The recording
    pub(crate) file: PathBuf,
    /// Name on the bus: a-z, 0-9 and - [default: that of the run]
    #[arg(long, value_name = "RUN")]
    pub(crate) name: Option<RunName>,
    /// How fast to go: `max`, or simulated seconds per second
    #[arg(long, value_name = "max|X", default_value = "max", value_parser = parse_pace)]
    pub(crate) rate: Pace,
    /// Begin with the first frame at or after this simulated time (s)
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = parse_time)]
    pub(crate) from: f64,
    /// End with the last frame at or before this simulated time (s)
    #[arg(long, value_name = "S", value_parser = parse_time)]
    pub(crate) until: Option<f64>,
    /// Begin again when it is over, as a new stream, until it is stopped
    #[arg(long = "loop")]
    pub(crate) again: bool,
    /// Publish every step as a frame of its own
    #[arg(long)]
    pub(crate) every_step: bool,
    /// Begin (each loop) when this many lossless consumers are ready [default: 1 at the rate max, else 0]
    #[arg(long, value_name = "N")]
    pub(crate) wait_for: Option<usize>,
    /// Drop a lossless consumer that holds the replay back for this long (s)
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = parse_seconds)]
    pub(crate) stall_timeout: f64,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = format!("Examples:\n  \
    beadline bench --rounds 9\n  \
    beadline bench --only recordings\n  \
    beadline bench --peers --only peers\n\n\
    {}\n\
    Both sides of a row are measured in turns; the ratio is the median over the rounds, with the least and the most.\n\
    Exit code 3: a ratio does not keep to its floor.", bench::list_of_groups()))]
pub(crate) struct BenchArgs {
    /// Measure only the groups whose names contain this
    #[arg(long, value_name = "WORD")]
    pub(crate) only: Option<String>,
    /// Times that each pair is measured
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) rounds: u32,
    /// Measure against LAMMPS, Numba and numpy too, as far as they are installed
    #[arg(long)]
    pub(crate) peers: bool,
    /// Print the table as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// How fast a run goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Pace {
    /// As fast as possible.
    Max,
    /// Simulated seconds per second of wall time.
    PerSecond(f64),
}

/// More threads than any machine has cores are a mistake.
fn parse_jobs(text: &str) -> Result<NonZero<usize>, String> {
    let jobs = text.parse().ok().filter(|jobs: &NonZero<usize>| jobs.get() <= 1024);
    jobs.ok_or_else(|| "expected a number of threads from 1 to 1024".to_owned())
}

fn parse_pace(text: &str) -> Result<Pace, String> {
    match text {
        "max" => Ok(Pace::Max),
        _ => parse_seconds(text).map(Pace::PerSecond).map_err(|_| {
            "expected `max` or a positive number of simulated seconds per second, such as 0.01".to_owned()
        }),
    }
}

/// `1000000`, `500kB`, `1.5GB`, `64MiB`: at most 2^53 bytes.
fn parse_bytes(text: &str) -> Result<u64, String> {
    let expected = || "expected a size such as 500MB, 2GB, 64MiB, or a number of bytes".to_owned();
    let unit_at = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(unit_at);
    let unit_bytes = match unit {
        "" | "B" => 1.0,
        "kB" | "KB" => 1e3,
        "MB" => 1e6,
        "GB" => 1e9,
        "TB" => 1e12,
        "KiB" => 1024.0,
        "MiB" => 1024.0 * 1024.0,
        "GiB" => 1024.0 * 1024.0 * 1024.0,
        _ => return Err(expected()),
    };
    let bytes = number.trim_end().parse::<f64>().map_err(|_| expected())? * unit_bytes;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole and in range")]
    let whole = (bytes >= 0.0 && bytes <= 2.0_f64.powi(53)).then_some(bytes.round() as u64);
    whole.ok_or_else(expected)
}

fn parse_split_size(text: &str) -> Result<u64, String> {
    let least = Split::LEAST_BYTES;
    let large_enough = |bytes: &u64| *bytes >= least;
    Some(parse_bytes(text)?).filter(large_enough).ok_or_else(|| format!("expected at least {least} bytes"))
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    let allowed = seconds > 0.0 && seconds <= 1e9;
    if allowed { Ok(seconds) } else { Err("expected a positive number, at most 1e9".to_owned()) }
}

fn parse_time(text: &str) -> Result<f64, String> {
    let time_s = text.parse().ok().filter(|time_s: &f64| time_s.is_finite() && *time_s >= 0.0);
    time_s.ok_or_else(|| "expected a simulated time in seconds, 0 or more".to_owned())
}

fn parse_pair(text: &str) -> Result<(u64, f64), String> {
    let expected = || "expected BEAD=VALUE, such as 500=0.6e-3".to_owned();
    let (bead, value) = text.split_once('=').ok_or_else(expected)?;
    Ok((bead.parse().map_err(|_| expected())?, value.parse().map_err(|_| expected())?))
}

fn parse_impurity(text: &str) -> Result<Option<(u64, f64)>, String> {
    if text == "none" { Ok(None) } else { parse_pair(text).map(Some) }
}

fn parse_shard(text: &str) -> Result<Shard, String> {
    let parsed = text
        .split_once('/')
        .and_then(|(number, count)| Some(Shard { number: number.parse().ok()?, count: count.parse().ok()? }));
    let expected = "expected I/N with I from 0 to N - 1, such as 0/2".to_owned();
    parsed.filter(|shard| shard.number < shard.count).ok_or(expected)
}
