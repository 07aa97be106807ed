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
    The near side (--from) sends the manifest, a state now and then, results and the end, but no frames. The far side \
    (--connect) recomputes every frame, compares it with the next state bit for bit, and then publishes it under the \
    same name and run id. It begins like a consumer that attaches at this moment. A cut costs nothing: the far side asks \
    again for everything after the last proven state. It also does so when the near side starts again with the same run \
    within --silence.\n\n\
    Everybody who can connect may read the run; by default these are the programs on this host. The file of --config is \
    Zenoh's own (TLS, access control, user and password) and is used as it is, with --listen or --connect in place of its \
    endpoints. Unless this file says so, the relay listens nowhere else and searches for nobody.\n\
    Exit code 0: the run and this side ended in order. 3: something was lost, the run or the other side vanished, or a \
    signal stopped this side."
)]
pub(crate) struct RelayArgs {
    /// Near side: `live` (the only live run) or `live:RUN`
    #[arg(long, value_name = "SOURCE", conflicts_with = "connect")]
    pub(crate) from: Option<Named>,
    /// Near side: its address
    #[arg(
        long,
        value_name = "tcp/HOST:PORT",
        default_value = "tcp/127.0.0.1:7447",
        conflicts_with = "connect"
    )]
    pub(crate) listen: String,
    /// Far side: address of the near side
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
    /// Give up the other side when it is silent for this long (s)
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = parse_seconds)]
    pub(crate) silence: f64,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
