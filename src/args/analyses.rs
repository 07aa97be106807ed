//! The analyses.

use super::figures::LookArgs;
use super::values::{parse_jobs, parse_number, parse_seconds, parse_time, parse_whole};
use clap::Args;
use source::Named;
use std::num::NonZero;
use std::path::PathBuf;

/// Where frames come from, and which of them: for all commands that read frames.
#[derive(Debug, Clone, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(crate) struct FramesArgs {
    /// `live` (the only live run), `live:RUN`, or a recording: a file or a URL
    #[arg(value_name = "SOURCE", default_value = "live")]
    pub(crate) source: Named,
    /// Attach without ever holding the run back: frames may be missed, and are counted
    #[arg(long)]
    pub(crate) latest: bool,
    /// Recompute the frames before the first one that arrives, from step 0 on
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

/// What every analysis takes.
#[derive(Debug, Clone, Args)]
pub(crate) struct AnalysisArgs {
    #[command(flatten)]
    pub(crate) frames: FramesArgs,
    /// Draw a figure, repeatable
    #[arg(long, value_name = "FILE.svg|.pdf|.png")]
    pub(crate) figure: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    /// Do not publish the results on the bus
    #[arg(long)]
    pub(crate) no_publish: bool,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline energies                                    attach to the only live run\n  \
    beadline energies run.mcap --out e.csv --figure e.svg\n  \
    beadline energies run.mcap --split 300               left and right of bead 300\n  \
    beadline energies sparse.mcap --every-step --from 0.04 --until 0.041 --out e.csv\n\n\
    The last one has every step of a part, although the recording is sparse."
)]
pub(crate) struct EnergiesArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// Table of the energies of each frame
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
    /// The bead that divides left from right [default: the first impurity that is not the striker, else the middle bead]
    #[arg(long, value_name = "BEAD", value_parser = parse_whole)]
    pub(crate) split: Option<u64>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline impurity --figure trajectory.png            attach to the only live run\n  \
    beadline impurity run.mcap --out i.csv --events events.csv\n  \
    beadline impurity run.mcap --bead 499 --bead 501     other beads\n\n\
    A contact counts as closed while its overlap is above 1e-6 of the collision length L. Events are \
    interpolated between frames."
)]
pub(crate) struct ImpurityArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// Table of the motion in each frame
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
    /// Table of events: contacts that close or open, turning points
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) events: Option<PathBuf>,
    /// A bead to follow, repeatable [default: every impurity, or the middle bead]
    #[arg(long, value_name = "BEAD", value_parser = parse_whole)]
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
    #[arg(long, value_name = "M", value_parser = parse_number)]
    pub(crate) tolerance: Option<f64>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline deformation run.mcap --contact 100 --figure d.png\n  \
    beadline deformation run.mcap --contact 100 --contact 150 --out d.csv\n\n\
    Contact C joins beads C and C+1. Theories are scaled to the largest overlap; their width, speed, \
    impulse and shape are predictions."
)]
pub(crate) struct DeformationArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// A contact to follow, repeatable
    #[arg(long, value_name = "C", required = true, value_parser = parse_whole)]
    pub(crate) contact: Vec<u64>,
    /// Table of the pulse: overlap, exact wave and continuum in each frame
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline spreading --figure s.png                    attach to the only live run\n  \
    beadline spreading run.mcap --out s.csv --figure s.svg\n  \
    beadline spreading sparse.mcap --every-step --from 0.04 --until 0.041 --out s.csv\n\n\
    The energy ε of bead i is its kinetic energy, half the potential energy of each contact with a bead, and all of that with a \
    wall. Second moment: m2 = Σ (i − c)²·ε/Σ ε about the centre c = Σ i·ε/Σ ε. Participation number: P = (Σ ε)²/Σ ε², 1 if one bead \
    has all the energy, N if all have the same. `beadline plot --what energy-density` maps ε."
)]
pub(crate) struct SpreadingArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// Table of the numbers in each frame
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
    A pulse passes a bead when |v| of the bead has a maximum in time while both of its contacts are \
    pressed; it counts once it has passed 5 beads, and ends where it meets an impurity or an end. Where \
    light and heavy beads alternate, the maximum is that of the mean velocity around. How many weak \
    pulses there are depends on the threshold: the count says how many would be found at twice of it. \
    Peaks are good to 1e-4 if 8 frames fall into the time that a pulse takes to pass; what a recording \
    with fewer lacks is recomputed, unless --as-recorded. What moved along the chain and is in no pulse, \
    above all a front that no pulse leads, is told, and the exit code is 3 then. V/V_sw is the speed over that of the exact solitary wave of the same \
    peak velocity: 1 for a pulse that no longer changes. asymmetry = (rear − front)/(rear + front) of \
    the half widths. `--json` and the tables have more: momentum, energy, width over that of the wave."
)]
pub(crate) struct PulsesArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// Recompute nothing, also where a recording has too few states to follow pulses
    #[arg(long, conflicts_with_all = ["every_step", "fill_gaps", "from_start"])]
    pub(crate) as_recorded: bool,
    /// Table of the pulses, a row for each, in the order in which they end
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
    /// Table of their tracks: a row for each bead that a pulse passes
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) positions: Option<PathBuf>,
    /// Smallest peak velocity of a pulse, relative to the run's velocity scale (v0)
    #[arg(long, value_name = "X", default_value_t = consumers::pulses::Pulses::DEFAULT_THRESHOLD, value_parser = parse_number)]
    pub(crate) threshold: f64,
}
