//! Films.

use super::ColoursArg;
use super::figures::quantity;
use super::values::{
    ColourRange, one_of, parse_film_seconds, parse_jobs, parse_range, parse_size, parse_time,
};
use clap::Args;
use consumers::fields::Field;
use schemas::beads::Beads;
use source::Named;
use std::num::NonZero;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline film run.mcap --out run.mp4                    ten seconds, encoded by ffmpeg\n  \
    beadline film run.mcap --out run.gif --size 800x450     a GIF for a page or a message\n  \
    beadline film run.mcap --out run.apng --seconds 4       all colours, without ffmpeg\n  \
    beadline film run.mcap --out hit.webm --from 0.02 --until 0.03 --beads 400..600\n  \
    beadline film run.mcap --out energy.mp4 --field energy-density --size 1920x1080\n\n\
    A picture has the map of `plot` with a line at the moment, the chain at that moment, and the energies over time. There \
    are 25 pictures a second, and the last one shows the last step. Frames that the recording lacks are recomputed; where a \
    part has fewer frames than the film has pictures, so are the steps between. Exit code 3: the recording was not \
    finished, or is damaged; the film ends where it does."
)]
pub(crate) struct FilmArgs {
    /// A recording: a file or a URL
    #[arg(value_name = "SOURCE")]
    pub(crate) source: Named,
    /// Film to write; .mp4 and .webm need ffmpeg
    #[arg(long, value_name = "FILE.mp4|.webm|.gif|.apng")]
    pub(crate) out: PathBuf,
    /// Length of the film (s), at most 120
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = parse_film_seconds)]
    pub(crate) seconds: f64,
    /// Width and height in dots: even numbers
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse_size)]
    pub(crate) size: (u32, u32),
    /// Quantity of the map and of the chain
    #[arg(long, default_value = "velocity", value_parser = one_of(Field::ALL, quantity))]
    pub(crate) field: Field,
    /// Begin at this simulated time (s)
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = parse_time)]
    pub(crate) from: f64,
    /// End at this simulated time (s)
    #[arg(long, value_name = "S", value_parser = parse_time)]
    pub(crate) until: Option<f64>,
    /// Look at every step, also between frames: no fast swing is lost in the map and the energies
    #[arg(long)]
    pub(crate) every_step: bool,
    /// Only these beads and the contacts between them: 100..200 is without bead 200, 100..=199 with bead 199, -4.. the last four
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    pub(crate) beads: Option<Beads>,
    /// Scale of the colours of the map [default: linear for displacements, log for the others]
    #[arg(long, value_enum)]
    pub(crate) colours: Option<ColoursArg>,
    /// Ends of the colours of the map, as for `plot` [default: with the values]
    #[arg(long, value_name = "MAX|MIN..MAX", value_parser = parse_range, allow_hyphen_values = true)]
    pub(crate) range: Option<ColourRange>,
    /// Threads that recompute and draw [default: one for each core]
    #[arg(long, value_name = "N", value_parser = parse_jobs)]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Replace a file that exists
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
