//! The modes that write, read and publish recordings.

use super::values::{
    Pace, parse_bytes, parse_count, parse_jobs, parse_pace, parse_seconds, parse_split_size, parse_time,
    parse_whole,
};
use clap::Args;
use schemas::run_name::RunName;
use source::Named;
use std::num::NonZero;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    beadline record --out run.mcap                            the only live run, from here on\n  \
    beadline record live:long --out long.mcap --from-start    with earlier frames, recomputed\n  \
    beadline record --out run.mcap --split-size 500MB         run-part-0001.mcap, …-0002.mcap …\n  \
    beadline record --out run.mcap --split-duration 0.01      a part for each 10 simulated ms\n  \
    beadline record --out s3://bucket/run.mcap                sent to a store while it is written\n\n\
    The run waits for the recorder when it cannot keep up. A part is finished before the next one begins. Each part \
    is a recording by itself: `beadline info`, `verify` and every analysis read it. The recorder also keeps the \
    results that analyses publish, from the first row on if the analysis starts after the recorder. SIGINT ends \
    the recording in order, and the run goes on.\n\
    Exit code 3: frames or rows of results were missed, the run vanished, the disk is nearly full, or a signal \
    stopped the recorder before the run ended."
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(crate) struct RecordArgs {
    /// `live` (the only live run) or `live:RUN`
    #[arg(value_name = "SOURCE", default_value = "live")]
    pub(crate) source: Named,
    /// Recording to write; parts of it are NAME-part-0001.mcap and so on
    #[arg(long, value_name = "FILE.mcap|URL")]
    pub(crate) out: PathBuf,
    /// Directory for a recording on its way to a URL [default: beadline/spool in the user's cache]
    #[arg(long, value_name = "DIR")]
    pub(crate) spool: Option<PathBuf>,
    /// Go on in a new part with the first frame after the file has this size
    #[arg(long, value_name = "BYTES|500MB", value_parser = parse_split_size)]
    pub(crate) split_size: Option<u64>,
    /// Go on in a new part at each multiple of this simulated time (s)
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    pub(crate) split_duration: Option<f64>,
    /// End in order when the disk has less left than this [default: 100 MB, or 1 % of a small disk]
    #[arg(long, value_name = "BYTES|500MB", value_parser = parse_bytes)]
    pub(crate) min_free: Option<u64>,
    /// Record every K-th step, the first and the last [default: that of the run]
    #[arg(long, value_name = "K", value_parser = parse_whole)]
    pub(crate) record_every_steps: Option<u64>,
    /// Recompute the frames before the first one that arrives, from step 0 on, and all that are missing
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
    /// Write the recorded part to the file at least this often (s): a kill costs this time
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = parse_seconds)]
    pub(crate) flush_period: f64,
    /// Sync the file to the disk at least this often (s): a power failure costs this time
    #[arg(long, value_name = "S", default_value_t = 5.0, value_parser = parse_seconds)]
    pub(crate) sync_period: f64,
    /// Give up when no run appears within this time (s) [default: wait]
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    pub(crate) timeout: Option<f64>,
    /// Replace files that exist, but no parts in a store
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
    beadline replay run.mcap                             waits for an analysis, then goes at …\n  \
    beadline energies --figure e.svg                     … the pace of this one\n  \
    beadline replay run.mcap --rate 0.01 --loop          at 1/100 of real time, again and again\n  \
    beadline replay run.mcap --from 0.02 --until 0.03    a part of it\n  \
    beadline replay sparse.mcap --every-step             every step as a frame, recomputed\n\n\
    `replay` recomputes frames that a sparse recording does not hold. On a terminal: space pauses and goes on, \
    → or . shows one more frame and pauses, + and - double and halve the rate, q quits; [ and ] go a twentieth back \
    and on, ← one frame back, Home to the first frame. Frames of a stream only go forward, so each of these four keys \
    ends the stream and begins another; consumers see an interrupted run. After a delay or a suspension the replay \
    goes on at its rate. The replay of a recording that was not closed ends as a failed run. Exit code 3: the \
    recording was not closed or is damaged, a consumer was dropped, or a signal stopped the replay; with --loop a \
    signal is the usual end, with exit code 0."
)]
pub(crate) struct ReplayArgs {
    /// The recording
    pub(crate) file: PathBuf,
    /// Name on the bus: a-z, 0-9 and - [default: that of the run]
    #[arg(long, value_name = "RUN")]
    pub(crate) name: Option<RunName>,
    /// Pace of the replay: `max`, or simulated seconds per second
    #[arg(long, value_name = "max|X", default_value = "max", value_parser = parse_pace)]
    pub(crate) rate: Pace,
    /// Begin with the first frame at or after this simulated time (s)
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = parse_time)]
    pub(crate) from: f64,
    /// End with the last frame at or before this simulated time (s)
    #[arg(long, value_name = "S", value_parser = parse_time)]
    pub(crate) until: Option<f64>,
    /// Begin again after the end, as a new stream, until a signal
    #[arg(long = "loop")]
    pub(crate) again: bool,
    /// Publish every step as a frame of its own
    #[arg(long)]
    pub(crate) every_step: bool,
    /// Begin (each loop) when this many lossless consumers are ready [default: 1 at the rate max, else 0]
    #[arg(long, value_name = "N", value_parser = parse_count)]
    pub(crate) wait_for: Option<usize>,
    /// Drop a lossless consumer that holds the replay back for this long (s)
    #[arg(long, value_name = "S", default_value_t = 30.0, value_parser = parse_seconds)]
    pub(crate) stall_timeout: f64,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    beadline thin run.mcap --every-steps 100 --out sparse.mcap\n\n\
    `thin` proves every state on the way: it recomputes the state from the one before. `beadline expand` brings the \
    others back. Other channels (results, and those of other programs), attachments and metadata stay whole. \
    K is a multiple of the steps between two frames of the run.")]
pub(crate) struct ThinArgs {
    /// The recording
    pub(crate) file: PathBuf,
    /// Keep every K-th step, the first and the last
    #[arg(long, value_name = "K", value_parser = parse_whole)]
    pub(crate) every_steps: u64,
    #[command(flatten)]
    pub(crate) output: RewriteArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline expand sparse.mcap --out full.mcap                       every frame of the run\n  \
    beadline expand sparse.mcap --every-steps 1 --out all.mcap        also the steps between frames\n\n\
    `expand` proves every state of the recording on the way, and other channels, attachments and metadata stay \
    whole. K is a multiple of the steps between two frames of the run, or divides them, and those between two states \
    of the recording. States between frames then have no frame number, and readers of frames skip them.")]
pub(crate) struct ExpandArgs {
    /// The recording
    pub(crate) file: PathBuf,
    /// Write every K-th step, the first and the last [default: every frame]
    #[arg(long, value_name = "K", value_parser = parse_whole)]
    pub(crate) every_steps: Option<u64>,
    #[command(flatten)]
    pub(crate) output: RewriteArgs,
}

/// Destination of a recording that is written again.
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
    beadline verify run.mcap                     `proven`, or the difference: frame, bead, quantity\n  \
    beadline verify run-part-*.mcap              each part, and the links between parts\n  \
    beadline verify run.mcap --json              the same for a program\n\n\
    `verify` prints three lists. It proved the first by computing it again: each state from the one before, the first \
    state from the manifest, summaries, rows of our analyses. It compared the second: every checksum, index and \
    number, schemas, `run.toml`. It cannot know the third: who made the file, channels and attachments of other programs. It names \
    damage with its chunk and frames, and verifies the rest; `beadline recover` brings the frames back.\n\
    Exit code 3 if any content has changed, frames or rows are missing, the file is cut off, its beginning is not \
    proven, or another kernel version computed the run. In the last case nothing is wrong, but nothing is proven.")]
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
    `recover` salvages every whole message of the file, also from a torn last chunk. It recomputes lost frames from \
    the state before, bit for bit, and the next state of the file proves them. A state without a valid checksum \
    counts only if it follows from the one before. The file itself stays unchanged.\n\
    Exit code 3 if some content of the file is missing in the new one, or was wrong. A last record that was never \
    written to its end is no loss. `recover` then verifies the new recording, and prints the result.")]
pub(crate) struct RecoverArgs {
    /// The damaged or unfinished recording
    pub(crate) file: PathBuf,
    /// Leave out lost frames, do not recompute them
    #[arg(long)]
    pub(crate) no_fill: bool,
    #[command(flatten)]
    pub(crate) output: RewriteArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline upload run.mcap s3://bucket/run.mcap\n  \
    beadline upload run.mcap.partial s3://bucket/run.mcap     recovers run.mcap first, and sends that\n\n\
    The object exists only when all of it was sent. `upload` then compares its size, and FILE stays. Parts that an \
    earlier attempt with this FILE has sent to s3:// are not sent again; other parts are removed. Credentials and \
    endpoints come from the environment (AWS_*, GOOGLE_*, AZURE_*). Exit code 3: a signal stopped the upload, or the \
    recording could not be recovered without loss.")]
pub(crate) struct UploadArgs {
    /// The recording
    pub(crate) file: PathBuf,
    /// Destination: a URL (s3://, gs://, az://)
    pub(crate) url: PathBuf,
    /// Replace an object that exists
    #[arg(long)]
    pub(crate) force: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    beadline catalog runs --out catalog.parquet\n  \
    beadline catalog s3://bucket/runs --out catalog.csv\n  \
    duckdb -c \"SELECT path, alpha, steps FROM 'catalog.parquet' WHERE complete = 1\"\n\n\
    The table has a row for each .mcap and .mcap.partial, in the order of their names, from their summaries alone. \
    `docs/SCALE.md` has the columns. A file that cannot be read has the reason in its column `error`, and makes the \
    exit code 3.")]
pub(crate) struct CatalogArgs {
    /// A directory or a URL
    #[arg(value_name = "DIR|URL")]
    pub(crate) root: PathBuf,
    /// The table
    #[arg(long, value_name = "FILE.parquet|.csv")]
    pub(crate) out: PathBuf,
    /// Replace a table that exists
    #[arg(long)]
    pub(crate) force: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}
