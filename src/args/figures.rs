//! Figures: how they look, and one at a time.

use super::frames::FramesArgs;
use super::values::{
    ColourRange, parse_dpi, parse_range, parse_slope, parse_stretch, parse_time, parse_whole,
};
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, ValueEnum};
use consumers::fields::Field;
use figure::{Options, Size};
use schemas::beads::Beads;
use std::path::PathBuf;

const TABLES: &str = "For tables";

/// Quantities along the chain, and the analyses that draw a figure unasked.
pub(crate) fn subjects() -> PossibleValuesParser {
    let fields = Field::ALL.map(quantity);
    let analyses = analyses::all()
        .filter(|offer| offer.draws_unasked())
        .map(|offer| PossibleValue::new(offer.name).help(format!("As `beadline {} --figure`", offer.name)));
    PossibleValuesParser::new(fields.into_iter().chain(analyses))
}

/// A quantity along the chain by its name.
pub(super) fn quantity(field: Field) -> PossibleValue {
    PossibleValue::new(field.as_str()).help(field.about())
}

/// Look of figures, for all commands that draw.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct LookArgs {
    /// Size of figures: a column of a journal (86 mm), a page (178 mm), or a slide (254 mm, 16:9) [default: column]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "column|page|slide")]
    pub(crate) size: Option<SizeArg>,
    /// Resolution of PNG files, in dots per inch [default: 300; 192 for slides, which are then 1920 dots wide]
    #[arg(long, value_name = "DPI", value_parser = parse_dpi)]
    pub(crate) dpi: Option<f64>,
}

impl LookArgs {
    /// The same for the module that draws.
    pub(crate) fn options(&self) -> Options {
        let size = match self.size {
            None | Some(SizeArg::Column) => Size::Column,
            Some(SizeArg::Page) => Size::Page,
            Some(SizeArg::Slide) => Size::Slide,
        };
        let default = Options::of(size);
        Options { dpi: self.dpi.unwrap_or(default.dpi), ..default }
    }

    /// The same as command-line words, for another process.
    pub(crate) fn flags(&self) -> Vec<String> {
        let size = self.size.and_then(|size| size.to_possible_value());
        let size = size.map(|size| format!("--size={}", size.get_name()));
        size.into_iter().chain(self.dpi.map(|dpi| format!("--dpi={dpi}"))).collect()
    }
}

/// A [`Size`] by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SizeArg {
    Column,
    Page,
    Slide,
}

/// Band around a curve of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BandArg {
    /// The mean, and its standard error on both sides
    StandardError,
    /// The median, half of the values and nine tenths of them
    Quantiles,
}

/// An axis of a table's figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AxisArg {
    X,
    Y,
    /// No axis
    None,
}

/// Scale of colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColoursArg {
    /// By the logarithm, so that weak pulses are seen beside strong ones
    Log,
    /// In proportion
    Linear,
}

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline plot run.mcap --what velocity                     all beads and times: run-velocity.png\n  \
    beadline plot run.mcap --what velocity --at 0.05           all beads at 50 ms\n  \
    beadline plot run.mcap --what overlap --frame 12000 --beads 400..600 --out gap.svg\n  \
    beadline plot run.mcap --what displacement --from 0.04 --until 0.06 --colours linear\n  \
    beadline plot run.mcap --what velocity --range 0.5 --out map.pdf   colours end at ±0.5 m/s\n  \
    beadline plot run.mcap --what pulses --size slide --out pulses.png\n  \
    beadline plot --what velocity --at 0.05                    the only live run, when it gets there\n  \
    beadline plot sweep/results.csv                            what a sweep has found\n  \
    beadline plot sweep/results.csv --x chain.alpha --y forward_v_peak_m_s --by time.dt_s\n  \
    beadline plot sweep/ensemble.csv --y total_j --band        mean ± standard error\n  \
    beadline plot sweep/ensemble-series.csv --y modal.mean_distance --fit=100.. --slope=-1\n  \
    beadline plot sweep/results.csv --heat reflected_over_total --log none\n\n\
    Velocity, displacement, overlap and energy density are drawn along the chain at one time (--at, --frame; recomputed where a \
    recording does not hold it), or over space and time; of a cell that stands for several beads or frames the \
    value farthest from 0 is shown, so that no pulse is lost. A map of a sparse recording shows what it holds; \
    --fill-gaps and --every-step recompute the rest.\n\n\
    Of a table (.csv, .parquet), such as a sweep leaves, columns are drawn over each other: rows that differ in nothing that is \
    drawn are averaged, --band shows how they scatter; samples of ranges are points. Rows without a value are counted, and means of \
    fewer rows than others are marked by a cross. --fit weights points by their standard errors where all have one. Without --x and --y these are a swept column and \
    the first result that differs from row to row."
)]
pub(crate) struct PlotArgs {
    #[command(flatten)]
    pub(crate) frames: FramesArgs,
    /// The subject, of a run or a recording
    #[arg(long, value_parser = subjects())]
    pub(crate) what: Option<String>,
    /// The column of the x axis of a table [default: the swept column with most values]
    #[arg(long, value_name = "COLUMN", help_heading = TABLES)]
    pub(crate) x: Option<String>,
    /// The column of the y axis, repeatable [default: the first result that differs from row to row]
    #[arg(long, value_name = "COLUMN", help_heading = TABLES)]
    pub(crate) y: Vec<String>,
    /// A curve for each value of this column, or `none` [default: a swept column of at most 8 values that rows share, if there is one]
    #[arg(long, value_name = "COLUMN", help_heading = TABLES)]
    pub(crate) by: Option<String>,
    /// This column in colours over two swept ones
    #[arg(long, value_name = "COLUMN", help_heading = TABLES, conflicts_with_all = ["by", "band"])]
    pub(crate) heat: Option<String>,
    /// Band around a curve: `standard-error` around the mean (as --band alone) or `quantiles` around the median
    #[arg(
        long,
        value_enum,
        hide_possible_values = true,
        value_name = "BAND",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "standard-error",
        help_heading = TABLES
    )]
    pub(crate) band: Option<BandArg>,
    /// A power law through the points of each curve, with its exponent and the error of that; --fit=1e-3..0.1 takes only points with x there
    #[arg(
        long,
        value_name = "A..B",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "0..inf",
        value_parser = parse_stretch,
        help_heading = TABLES,
        conflicts_with = "heat"
    )]
    pub(crate) fit: Option<(f64, f64)>,
    /// A power law of this exponent beside a curve; repeatable, in the order of the curves, the last for all further ones
    #[arg(long, value_name = "EXPONENT", value_parser = parse_slope, help_heading = TABLES, conflicts_with = "heat")]
    pub(crate) slope: Vec<f64>,
    /// Logarithmic axes: x, y, x,y or none [default: those of swept columns whose values follow each other by the logarithm]
    #[arg(long, value_enum, hide_possible_values = true, value_name = "x,y|none", value_delimiter = ',', help_heading = TABLES)]
    pub(crate) log: Vec<AxisArg>,
    /// Along the chain, in the first frame at or after this simulated time (s)
    #[arg(long, value_name = "S", value_parser = parse_time, conflicts_with_all = ["frame", "from", "until"])]
    pub(crate) at: Option<f64>,
    /// Along the chain, in this frame
    #[arg(long, value_name = "N", value_parser = parse_whole, conflicts_with_all = ["from", "until", "every_step"])]
    pub(crate) frame: Option<u64>,
    /// Only these beads and the contacts between them: 100..200 is without bead 200, 100..=199 with bead 199, -4.. the last four
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    pub(crate) beads: Option<Beads>,
    /// Scale of the colours of a map [default: linear for displacements, log for the others]
    #[arg(long, value_enum, conflicts_with_all = ["at", "frame"])]
    pub(crate) colours: Option<ColoursArg>,
    /// Ends of the colours of a map, in m/s, m or J, so that several maps can be compared: on both sides of 0 or, as
    /// MIN..MAX, one on each [default: with the values]
    #[arg(
        long,
        value_name = "MAX|MIN..MAX",
        value_parser = parse_range,
        allow_hyphen_values = true,
        conflicts_with_all = ["at", "frame"]
    )]
    pub(crate) range: Option<ColourRange>,
    /// Figure to write [default: named after the source and what is drawn, as run-velocity.png]
    #[arg(long, value_name = "FILE.svg|.pdf|.png")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) look: LookArgs,
}
