//! The page.

use super::values::parse_whole;
use clap::Args;
use source::Named;
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline view                          the live runs of this user\n  \
    beadline view run.mcap --open          a recording, in the browser\n  \
    beadline view run.mcap other.mcap      two recordings and their difference\n  \
    beadline view results/                 the recordings in a folder, or the points of a sweep\n  \
    ssh -L 8080:localhost:8080 host beadline view --port 8080      on another machine\n\n\
    Both ports of a tunnel must be equal: the page answers at its own port alone.\n\n\
    Only those who know the printed address can see the page, and they see everything: a part of the address is random. \
    The page never holds a run back. Ctrl-C ends `view`.")]
pub(crate) struct ViewArgs {
    /// `live` (the live runs of this user), `live:RUN`, a recording or several, a folder of recordings, or the directory of a
    /// sweep
    #[arg(value_name = "SOURCE", default_value = "live", num_args = 1..)]
    pub(crate) sources: Vec<Named>,
    /// Port to listen at [default: a free one]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(crate) port: u16,
    /// Address of this machine to listen at; without encryption
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    pub(crate) host: IpAddr,
    /// Open it in the browser
    #[arg(long)]
    pub(crate) open: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline share run.mcap            run.html, at most 2 MB\n  \
    beadline share run.mcap --every-steps 100 --out talk.html\n  \
    beadline share                     beadline.html, which waits for a recording\n\n\
    A double click opens the page, without a network and without Beadline. It holds every step: it carries some \
    states of the recording, and recomputes the states between, bit for bit. K is a multiple of the steps between two \
    frames of the run.")]
pub(crate) struct ShareArgs {
    /// The recording [default: none, the page waits for one]
    pub(crate) file: Option<PathBuf>,
    /// Page to write [default: named after the recording, as run.html]
    #[arg(long, value_name = "FILE.html")]
    pub(crate) out: Option<PathBuf>,
    /// Carry every K-th step, the first and the last [default: as many as 2 MB hold]
    #[arg(long, value_name = "K", value_parser = parse_whole, requires = "file")]
    pub(crate) every_steps: Option<u64>,
    /// Find the pulses, however long it takes [default: only for short chains or runs]
    #[arg(long, requires = "file")]
    pub(crate) pulses: bool,
    /// Replace a file that exists, and make pages of more than 200 MB
    #[arg(long)]
    pub(crate) force: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}
