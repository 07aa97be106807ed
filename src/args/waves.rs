//! What the waves of a chain say.

use super::analyses::AnalysisArgs;
use super::presets;
use super::values::{BeadRange, parse_above_zero, parse_beads, parse_segment, parse_whole};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use waves::place::{Place, Quantity};
use waves::segments::Window;

/// A [`Quantity`] by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OfArg {
    /// Velocity of a bead, or the rate at which an overlap grows
    Velocity,
    /// Force of a contact or wall; at a bead the mean of those on its two sides
    Force,
    /// Displacement of a bead, or the overlap of a contact
    Displacement,
}

impl OfArg {
    pub(crate) fn quantity(self) -> Quantity {
        match self {
            Self::Velocity => Quantity::Velocity,
            Self::Force => Quantity::Force,
            Self::Displacement => Quantity::Displacement,
        }
    }
}

/// A [`Window`] by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum WindowArg {
    /// Hann: for motion that lasts
    Hann,
    /// None, and one segment for all: for a pulse that has come and gone at the end
    None,
}

impl WindowArg {
    pub(crate) fn window(self) -> Window {
        match self {
            Self::Hann => Window::Hann,
            Self::None => Window::None,
        }
    }
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline spectrum run.mcap --at bead:20 --at bead:100 --figure psd.png\n  \
    beadline spectrum --at wall:right --of force --out f.csv   attach to the only live run\n  \
    beadline spectrum run.mcap --transmission bead:10,bead:90 --window none --figure t.svg\n  \
    beadline spectrum run.mcap --at bead:50 --spectrogram --figure s.png\n  \
    beadline spectrum run.mcap --map --figure map.png      all of the chain over ω and q\n  \
    beadline spectrum sparse.mcap --at bead:50 --every-step\n\n\
    Densities are one-sided, by Welch's method: means over segments that overlap by half, less their mean, under a \
    Hann window (by 7/8 in the spectrogram). Their integral over frequency is the mean square. Samples are those of frames; the sampling \
    frequency is told, and a warning where the recording is too sparse for it. Transmission is the estimate \
    H1 = S_ab/S_aa, with its phase, and its coherence if there are several segments: a figure has |H1| where that is above chance, and of one \
    segment up to the top of the band; a pulse that passes both places \
    wants --window none, motion that lasts wants segments much longer than the way between them. The map has q in rad per bead, above 0 for waves to the right; the \
    dispersion relation of a chain that is linear about its equilibrium is drawn over it. --out and --figure are of \
    what was asked for: spectra, the spectrogram or the map, which is no finer in the table than in the figure."
)]
pub(crate) struct SpectrumArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// A place, repeatable: bead:20, contact:7, wall:left, wall:right
    #[arg(long, value_name = "PLACE")]
    pub(crate) at: Vec<Place>,
    /// The quantity
    #[arg(long, value_enum, default_value = "velocity")]
    pub(crate) of: OfArg,
    /// How the second place follows the first one, repeatable
    #[arg(long, value_name = "PLACE,PLACE", value_parser = parse_places, conflicts_with_all = ["spectrogram", "map"])]
    pub(crate) transmission: Vec<(Place, Place)>,
    /// The spectrum of one place over time
    #[arg(long, conflicts_with = "map")]
    pub(crate) spectrogram: bool,
    /// The velocity (or displacement) of all beads over frequency and wavenumber
    #[arg(long, conflicts_with = "at")]
    pub(crate) map: bool,
    /// Only these beads in the map
    #[arg(long, value_name = "A..B", value_parser = parse_beads, requires = "map")]
    pub(crate) beads: Option<BeadRange>,
    /// Samples in a segment, even: more of them resolve more, fewer of them average more [default: so that 4 fill the
    /// run (overlapping by half), 12 for the spectrogram, 2 for the map, as far as memory allows]
    #[arg(long, value_name = "SAMPLES", value_parser = parse_segment)]
    pub(crate) segment: Option<usize>,
    /// How the samples of a segment are weighted
    #[arg(long, value_enum, default_value = "hann", conflicts_with_all = ["spectrogram", "map"])]
    pub(crate) window: WindowArg,
    /// Highest frequency (Hz) of figures, and of tables over two axes [default: where nothing is above]
    #[arg(long, value_name = "HZ", value_parser = parse_above_zero)]
    pub(crate) max_frequency: Option<f64>,
    /// Table of what was asked for
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline modes --preset precompressed --figure modes.png\n  \
    beadline modes chain.toml --out modes.csv            of a configuration\n  \
    beadline modes run.mcap --shapes --mode 1 --mode 50 --figure shapes.svg\n  \
    beadline modes run.mcap --energy --out energies.csv --figure energies.png\n\n\
    Modes are those of small motions about the equilibrium, counted from 1 by ascending frequency. The chain has to \
    be pressed together: a contact without load has no linear motion. participation is the number of beads that \
    share a mode's energy, 1/Σ e². Bands and gaps are those of the unit that the chain repeats, if it repeats one; a \
    mode outside of them is held by an impurity or an end. --out and --figure are of what was asked for: the list \
    of modes, their shapes, or the energy in each over time."
)]
pub(crate) struct ModesArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// The modes of a ready-made configuration instead of SOURCE, which may be a CONFIG.toml, too
    #[arg(long, value_name = "NAME", value_parser = presets(), conflicts_with_all = ["source", "energy"])]
    pub(crate) preset: Option<String>,
    /// The shapes of modes
    #[arg(long, conflicts_with = "energy")]
    pub(crate) shapes: bool,
    /// The energy in modes over time
    #[arg(long)]
    pub(crate) energy: bool,
    /// A mode for --shapes or --energy, repeatable [default: the lowest 4 for shapes, 8 for energies]
    #[arg(long, value_name = "MODE", value_parser = parse_whole)]
    pub(crate) mode: Vec<u64>,
    /// Table of what was asked for
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline forces run.mcap --at wall:right --at bead:20 --figure forces.png\n  \
    beadline forces --at contact:7 --out forces.csv --peaks peaks.csv    attach to the only live run\n\n\
    A contact or a wall has its force, with what damping adds. A bead has the mean of the forces on its two sides, as \
    a sensor embedded in a bead reads it; a free side has none. Peaks are above the force at rest; two maxima are two \
    peaks if the force falls below half of the first one and doubles again. width is the full width at half of the \
    height, where that is above the threshold; above is the time above the threshold."
)]
pub(crate) struct ForcesArgs {
    #[command(flatten)]
    pub(crate) common: AnalysisArgs,
    /// A place, repeatable: bead:20, contact:7, wall:left, wall:right
    #[arg(long, value_name = "PLACE", required = true)]
    pub(crate) at: Vec<Place>,
    /// Least height of a peak (N) above the force at rest [default: 1e-2 of the run's force scale m·L/T²]
    #[arg(long, value_name = "N", value_parser = parse_above_zero)]
    pub(crate) threshold: Option<f64>,
    /// Table of the overlaps and forces in each frame
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) out: Option<PathBuf>,
    /// Table of the peaks
    #[arg(long, value_name = "FILE.csv|.parquet")]
    pub(crate) peaks: Option<PathBuf>,
}

fn parse_places(text: &str) -> Result<(Place, Place), String> {
    let expected = "expected two places, such as bead:10,bead:90";
    let (from, to) = text.split_once(',').ok_or(expected)?;
    Ok((from.parse()?, to.parse()?))
}
