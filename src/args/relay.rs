//! A live run on another host.

use super::values::{parse_count, parse_seconds, parse_whole};
use clap::{ArgGroup, Args};
use source::Named;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    group = ArgGroup::new("side").required(true).args(["from", "connect"]),
    after_help = "Examples:\n  \
    beadline relay --from live:shock --listen tcp/10.0.0.1:7447     where the run is …\n  \
    beadline relay --connect tcp/10.0.0.1:7447                      … and on the other host\n  \
    beadline energies live:shock                                    there, as if the run were local\n  \
    beadline relay --from live --hold                               the run waits for consumers there\n  \
    beadline relay --connect tls/lab.example:7447 --config zenoh.json5\n\n\
    The near side (--from) sends the run, not its frames: the manifest, a state now and then, results, the end. The \
    far side (--connect) recomputes every frame, compares with the next state bit for bit, and then publishes it under \
    the same name and run id. It begins with the frame that a consumer would begin with that attached when the far side \
    asked. Nothing is lost over a cut: the far side asks for what follows the last proven state. So it does when a near side that went \
    is begun again with the same run within --silence.\n\n\
    Who connects may read the run; by default that is who can reach this host's loopback. The file of --config is Zenoh's own \
    (TLS, access control, user and password) and is used as it is, with --listen or --connect in place of its endpoints; \
    nothing else is listened to and nobody is searched for unless it says so.\n\
    Exit code 0: the run ended in order, and so did this side. 3: something was lost, the run or the other side vanished, or \
    it was asked to stop."
)]
pub(crate) struct RelayArgs {
    /// Near side: `live` (the only live run) or `live:RUN`
    #[arg(long, value_name = "SOURCE", conflicts_with = "connect")]
    pub(crate) from: Option<Named>,
    /// Near side: where it is met
    #[arg(
        long,
        value_name = "tcp/HOST:PORT",
        default_value = "tcp/127.0.0.1:7447",
        conflicts_with = "connect"
    )]
    pub(crate) listen: String,
    /// Far side: where the near side is met
    #[arg(long, value_name = "tcp/HOST:PORT")]
    pub(crate) connect: Option<String>,
    /// Zenoh's own configuration, for TLS, access control, user and password
    #[arg(long, value_name = "FILE.json5")]
    pub(crate) config: Option<PathBuf>,
    /// Send every frame instead of states: for a far side that is too slow to recompute, or has another kernel version
    #[arg(long)]
    pub(crate) frames: bool,
    /// Near side: the run waits for its far sides, and so for their lossless consumers
    #[arg(long, conflicts_with = "connect")]
    pub(crate) hold: bool,
    /// Near side: send a state every K frames [default: every 4 MiB of frames, at least 128, sooner where frames are slow]
    #[arg(long, value_name = "K", value_parser = parse_whole, conflicts_with_all = ["connect", "frames"])]
    pub(crate) every: Option<u64>,
    /// Far side: publish the first frame when this many lossless consumers are ready
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_count, conflicts_with = "from")]
    pub(crate) wait_for: usize,
    /// Far side: drop a lossless consumer that takes nothing for this long (s)
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = parse_seconds, conflicts_with = "from")]
    pub(crate) stall_timeout: f64,
    /// Give the other side up when it is silent for this long (s)
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = parse_seconds)]
    pub(crate) silence: f64,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
