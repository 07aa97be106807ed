//! Memory of a producer and its consumers, along the length of the run and of the chain.

use super::child::Process;
use super::{Bench, Floor, Rounds};
use crate::report::Report;
use anyhow::Error;
use schemas::amounts::{bytes, count};
use std::time::Duration;

/// Steps of the short and of the long run, each a frame.
const SHORT: u64 = 100_000;
const LONG: u64 = 10_000_000;

/// Beads of both: what would grow is kept per frame, whatever its size.
const BEADS: u64 = 20;

/// Beads of the long chain, and its steps.
const MANY_BEADS: u64 = 1_000_000;
const FEW: u64 = 20;

/// Time step (s): any that is short enough.
const DT_S: f64 = 1e-6;

const ANALYSES: [&str; 3] = ["energies", "impurity", "contacts"];

/// Interval at which a process is asked for its peak memory.
const LOOK: Duration = Duration::from_millis(5);

pub(super) fn rows(_: &Bench, report: &mut Report) -> Result<(), Error> {
    let (long, short) = (Followed::run(BEADS, LONG)?, Followed::run(BEADS, SHORT)?);
    let what = [
        "producer's peak memory, 10,000,000 frames",
        "that of `energies`",
        "that of `impurity`",
        "that of `contacts`",
    ];
    for (what, (long, short)) in what.into_iter().zip(long.peaks_bytes.into_iter().zip(short.peaks_bytes)) {
        let figure = bytes(long).to_string();
        report.row(once(long, short).row(what, "100,000 frames", Floor::AtMost(1.05), figure))?;
    }
    let big = Followed::run(MANY_BEADS, FEW)?;
    let peaks = big.peaks_bytes.map(|peak| bytes(peak).to_string()).join(", ");
    // the more the better: a speed
    report.row(once(FEW + 1, big.fewest_received).row(
        "frames of 1,000,000 beads to three analyses",
        "frames published",
        Floor::AtLeast(1.0),
        format!("{} frames; {peaks}", count(big.fewest_received)),
    ))
}

/// Measured once: neither a count nor a peak depends on what else the machine does.
fn once(ours: u64, theirs: u64) -> Rounds {
    Rounds { ours_s: vec![ours as f64], theirs_s: vec![theirs as f64] }
}

/// A run that three analyses have followed, four processes.
struct Followed {
    /// Peaks of the producer, then of the analyses.
    peaks_bytes: [u64; 1 + ANALYSES.len()],
    /// Frames that reached every analysis.
    fewest_received: u64,
}

impl Followed {
    fn run(beads: u64, steps: u64) -> Result<Self, Error> {
        let name = format!("bench-{}", std::process::id());
        let words = format!(
            "beadline run --no-record --json --wait-for {} --preset homogeneous --name {name} --beads {beads} \
             --impurity {}=2e-3 --method velocity-verlet --dt {DT_S:e} --duration {:e}",
            ANALYSES.len(),
            beads / 2,
            steps as f64 * DT_S,
        );
        let producer = Process::start(words.split_whitespace())?;
        let source = format!("live:{name}");
        let [first, second, third] =
            ANALYSES.map(|analysis| Process::start(["beadline", analysis, &source, "--json"]));
        let processes = [producer, first?, second?, third?];
        let mut peaks_bytes = [0; 4];
        let mut running = true;
        while running {
            running = false;
            for (peak, process) in peaks_bytes.iter_mut().zip(&processes) {
                let now = process.peak_bytes();
                running |= now.is_some();
                *peak = now.unwrap_or(*peak);
            }
            std::thread::sleep(LOOK);
        }
        let [producer, consumers @ ..] = processes;
        producer.finish()?;
        let mut fewest_received = u64::MAX;
        for consumer in consumers {
            let received = consumer.finish_json()?["frames_received"].as_u64().unwrap_or(0);
            fewest_received = fewest_received.min(received);
        }
        Ok(Self { peaks_bytes, fewest_received })
    }
}
