//! Time of a frame to a consumer that waits for it, against a bare wake-up.

use super::super::part::{READY, now_ns};
use super::{Floor, Process, Rounds, Row, Streams, wait};
use crate::bare_bus::BareNotifier;
use anyhow::{Error, anyhow};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::frame::{EndReason, FrameSink as _};
use std::thread::sleep;
use std::time::Duration;

/// Frames, and bare wake-ups, in a round.
const POKES: usize = 1000;

/// Time between a frame and a wake-up: whoever was woken sleeps again, and each frame wakes by itself.
const GAP: Duration = Duration::from_millis(1);

pub(super) fn rows(streams: &Streams<'_>, rounds: u32) -> Result<[Row; 2], Error> {
    let (ours, theirs) = measure(streams, (rounds as usize + 1) * POKES)?;
    let row = |what, part| {
        let each_round =
            |delays: &[f64]| delays.chunks(POKES).skip(1).map(|round| quantile(round, part)).collect();
        let rounds = Rounds { ours_s: each_round(&ours), theirs_s: each_round(&theirs) };
        let figure = format!("{:.1} µs", rounds.ours_s() * 1e6);
        rounds.row(what, "a bare iceoryx2 wake-up", Floor::AtMost(1.2), figure)
    };
    Ok([row("publish to a waiting consumer, p50", 0.5), row("publish to a waiting consumer, p99", 0.99)])
}

/// `count` delays (s) of frames and of bare wake-ups, in turns, each right after a step: as in a run that
/// keeps a pace.
fn measure(streams: &Streams<'_>, count: usize) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let event = format!("wake-{}", streams.name());
    let notifier = BareNotifier::create(&streams.bus, &event)?;
    let mut publisher = streams.publisher()?;
    let receiver = Process::start(["part", "receive", streams.name()])?;
    wait(&mut publisher, 1)?;
    let mut listener = Process::start(["part", "listen", &event])?;
    listener.expect(READY)?;
    let (mut frames_ns, mut wakes_ns) = (Vec::new(), Vec::new());
    let physics = &streams.manifest.physics;
    let (mut integrator, mut state) = (Integrator::new(physics), ChainState::initial(physics));
    for number in 0..count as u64 {
        sleep(GAP);
        integrator.step(&mut state);
        frames_ns.push(now_ns()?);
        publisher.accept(&state.as_frame(&streams.manifest, number))?;
        sleep(GAP);
        integrator.step(&mut state);
        wakes_ns.push(now_ns()?);
        notifier.notify()?;
    }
    publisher.finish(EndReason::Complete)?;
    Ok((delays(&frames_ns, receiver)?, delays(&wakes_ns, listener)?))
}

/// Times from each sending to the first arrival after it, of those that the process tells.
fn delays(sent_ns: &[u64], process: Process) -> Result<Vec<f64>, Error> {
    let text = process.finish()?;
    let came_ns: Vec<u64> = text.lines().map(str::parse).collect::<Result<_, _>>()?;
    let delay = |sent: &u64| {
        let first = came_ns.partition_point(|came| came < sent);
        came_ns.get(first).map(|came| (came - sent) as f64 * 1e-9)
    };
    let delays: Option<Vec<_>> = sent_ns.iter().map(delay).collect();
    delays.ok_or_else(|| anyhow!("something was sent that did not come"))
}

fn quantile(delays: &[f64], part: f64) -> f64 {
    let mut sorted = delays.to_vec();
    sorted.sort_by(f64::total_cmp);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    let index = (part * (sorted.len() - 1) as f64).round() as usize;
    sorted[index]
}
