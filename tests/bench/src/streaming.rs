//! Publishing and following: what the bus costs, beside the dynamics and beside bare iceoryx2.

mod latency;
mod windows;

use super::child::Process;
use super::part::{ATTACHED, READY};
use super::recordings::{Frames, simulate};
use super::{Bench, Floor, Rounds, Row, timed};
use crate::bare_bus::BarePublisher;
use crate::report::Report;
use anyhow::{Error, anyhow};
use bus::{Bus, ConsumerEvent, PublishOptions, StatePublisher, WaitOutcome};
use schemas::frame::{EndReason, Frame, FrameSink as _};
use schemas::manifest::RunManifest;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Number of times that the frames in memory are sent, so that starting and ending do not count.
const TURNS: usize = 10;

/// Longest time that a consumer may take to attach.
const PATIENCE: Duration = Duration::from_secs(30);

/// Time for which a consumer that has nothing to do is watched.
const IDLE: Duration = Duration::from_secs(1);

pub(super) fn rows(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    let streams = Streams::new(bench.frames()?)?;
    let rounds = bench.rounds;
    report.row(streams.nobody_attached(rounds)?)?;
    report.row(streams.stalled_consumer(rounds)?)?;
    report.row(streams.one_consumer(rounds)?)?;
    report.row(streams.three_consumers(rounds)?)?;
    report.row(streams.idle_consumer(rounds)?)?;
    for row in latency::rows(&streams, rounds)?.into_iter().chain(windows::rows(&streams, rounds)?) {
        report.row(row)?;
    }
    Ok(())
}

/// Runs on the bus of this user.
struct Streams<'a> {
    bus: Bus,
    frames: &'a Frames,
    manifest: RunManifest,
}

impl<'a> Streams<'a> {
    fn new(frames: &'a Frames) -> Result<Self, Error> {
        let mut manifest = frames.manifest().clone();
        let name = format!("bench-{}", std::process::id());
        manifest.provenance.name = name.parse().map_err(|error: String| anyhow!(error))?;
        Ok(Self { bus: Bus::from_env()?, frames, manifest })
    }

    fn name(&self) -> &str {
        self.manifest.provenance.name.as_str()
    }

    fn publisher(&self) -> Result<StatePublisher, Error> {
        let chain = self.manifest.physics.chain();
        Ok(StatePublisher::create(&self.bus, &self.manifest, &chain, &PublishOptions::default())?)
    }

    /// An analysis of the run, which is a process of its own.
    fn consumer(&self, analysis: &str, more: &[&str]) -> Result<Process, Error> {
        let source = format!("live:{}", self.name());
        Process::start(["beadline", analysis, &source, "--json"].iter().chain(more))
    }

    /// A publisher that these analyses are ready for.
    fn followed_by(&self, analyses: &[&str]) -> Result<(StatePublisher, Vec<Process>), Error> {
        let mut publisher = self.publisher()?;
        let started: Result<Vec<_>, _> = analyses.iter().map(|name| self.consumer(name, &[])).collect();
        let consumers = started?;
        wait(&mut publisher, consumers.len())?;
        Ok((publisher, consumers))
    }

    fn count(&self) -> usize {
        TURNS * self.frames.count()
    }

    fn per_second(&self, rounds: &Rounds) -> String {
        format!("{:.0} k frames/s", self.count() as f64 / rounds.ours_s() / 1e3)
    }

    /// Has `publish` send `count` frames to lossless analyses, none of which may lose any.
    fn send(
        &self,
        analyses: &[&str],
        count: u64,
        publish: impl FnOnce(&mut StatePublisher) -> Result<Duration, Error>,
    ) -> Result<Duration, Error> {
        let (mut publisher, consumers) = self.followed_by(analyses)?;
        let took = publish(&mut publisher)?;
        publisher.finish(EndReason::Complete)?;
        for consumer in consumers {
            got_all(consumer, count)?;
        }
        Ok(took)
    }

    /// The frames that are in memory.
    fn stream(&self, analyses: &[&str]) -> Result<Duration, Error> {
        self.send(analyses, self.count() as u64, |publisher| timed(|| self.publish(publisher)))
    }

    /// Frames as the dynamics make them.
    fn run_to(&self, analyses: &[&str]) -> Result<Duration, Error> {
        self.send(analyses, self.manifest.frame_count(), |publisher| self.run(publisher))
    }

    fn publish(&self, publisher: &mut StatePublisher) -> Result<(), Error> {
        for (number, frame) in (0..).zip(self.frames.iter().cycle().take(self.count())) {
            publisher.accept(&Frame { frame: number, step: number, ..frame })?;
        }
        Ok(())
    }

    /// The same frames through nothing but iceoryx2 to a process that sums them up.
    fn stream_bare(&self) -> Result<Duration, Error> {
        let (name, count) = (format!("bare-{}", self.name()), self.count().to_string());
        let publisher = BarePublisher::create(&self.bus, &name, self.manifest.frame_doubles())?;
        let mut consumer = Process::start(["part", "sum", &name, &count])?;
        consumer.expect(ATTACHED)?;
        publisher.connect()?;
        consumer.go_on()?;
        consumer.expect(READY)?;
        let took = timed(|| {
            let mut slices = self.frames.in_one_piece().cycle().take(self.count());
            Ok(slices.try_for_each(|doubles| publisher.send(doubles))?)
        })?;
        consumer.finish()?;
        Ok(took)
    }

    /// Simulates all of the run and publishes every step.
    fn run(&self, publisher: &mut StatePublisher) -> Result<Duration, Error> {
        timed(|| simulate(&self.manifest, |frame| Ok(publisher.accept(frame)?)))
    }

    fn run_alone(&self) -> Result<Duration, Error> {
        let mut publisher = self.publisher()?;
        let took = self.run(&mut publisher)?;
        publisher.finish(EndReason::Complete)?;
        Ok(took)
    }

    fn steps_per_s(&self, rounds: &Rounds) -> String {
        format!("{:.0} k steps/s", self.manifest.physics.step_count as f64 / rounds.ours_s() / 1e3)
    }

    fn nobody_attached(&self, rounds: u32) -> Result<Row, Error> {
        let stepping = || timed(|| simulate(&self.manifest, |_| Ok(())));
        let rounds = Rounds::alternate(rounds, || self.run_alone(), stepping)?;
        let figure = self.steps_per_s(&rounds);
        Ok(rounds.row("step and publish, nobody attached", "step alone", Floor::AtMost(1.5), figure))
    }

    /// A consumer that takes what there is, and has stopped to take anything.
    fn stalled_consumer(&self, rounds: u32) -> Result<Row, Error> {
        let stalled = || -> Result<Duration, Error> {
            let mut publisher = self.publisher()?;
            let consumer = self.consumer("energies", &["--latest"])?;
            await_join(&mut publisher)?;
            consumer.stall()?;
            let took = self.run(&mut publisher)?;
            consumer.resume()?;
            publisher.finish(EndReason::Complete)?;
            Ok(took)
        };
        let rounds = Rounds::alternate(rounds, stalled, || self.run_alone())?;
        let figure = self.steps_per_s(&rounds);
        Ok(rounds.row(
            "the same, one stalled `latest` consumer",
            "nobody attached",
            Floor::AtMost(1.1),
            figure,
        ))
    }

    fn one_consumer(&self, rounds: u32) -> Result<Row, Error> {
        let rounds = Rounds::alternate(rounds, || self.stream(&["energies"]), || self.stream_bare())?;
        let whole = self.manifest.physics.step_count as f64 / self.run_to(&["energies"])?.as_secs_f64();
        Ok(rounds.row(
            "stream to one consumer that computes energies",
            "bare iceoryx2, the same frames summed up",
            Floor::AtLeast(0.85),
            format!("{}; a run {:.0} k", self.per_second(&rounds), whole / 1e3),
        ))
    }

    fn three_consumers(&self, rounds: u32) -> Result<Row, Error> {
        let analyses = ["energies", "impurity", "contacts"];
        let slowest_alone = || {
            analyses.iter().try_fold(Duration::ZERO, |slowest, name| Ok(slowest.max(self.stream(&[name])?)))
        };
        let rounds = Rounds::alternate(rounds, || self.stream(&analyses), slowest_alone)?;
        Ok(rounds.row(
            "stream to energies, impurity and contacts",
            "the slowest of them alone",
            Floor::AtMost(2.0),
            format!("{}, none lost", self.per_second(&rounds)),
        ))
    }

    /// A consumer that is attached while nothing is published.
    fn idle_consumer(&self, rounds: u32) -> Result<Row, Error> {
        let (mut publisher, consumers) = self.followed_by(&["energies"])?;
        let mut idle = Rounds::default();
        for _ in 0..rounds {
            publisher.serve()?;
            let (start, busy) = (Instant::now(), consumers[0].busy()?);
            std::thread::sleep(IDLE);
            idle.ours_s.push(consumers[0].busy()?.saturating_sub(busy).as_secs_f64());
            idle.theirs_s.push(start.elapsed().as_secs_f64());
        }
        publisher.finish(EndReason::Complete)?;
        let figure = format!("{:.3} % of a core", 100.0 * idle.time().median);
        Ok(idle.row("a consumer while nothing is published", "one core", Floor::AtMost(0.01), figure))
    }
}

/// Waits until so many lossless consumers are ready.
fn wait(publisher: &mut StatePublisher, count: usize) -> Result<(), Error> {
    match publisher.wait_for(count, &AtomicBool::new(false), Some(PATIENCE))? {
        WaitOutcome::Ready => Ok(()),
        _ => Err(anyhow!("{count} consumers did not attach within {} s", PATIENCE.as_secs())),
    }
}

/// Waits until a consumer of any kind has joined.
fn await_join(publisher: &mut StatePublisher) -> Result<(), Error> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        publisher.serve()?;
        if publisher.take_events().iter().any(|event| matches!(event, ConsumerEvent::Joined { .. })) {
            return Ok(());
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    Err(anyhow!("no consumer attached within {} s", PATIENCE.as_secs()))
}

/// Checks that a consumer that has ended got every frame.
fn got_all(consumer: Process, count: u64) -> Result<(), Error> {
    let summary = consumer.finish_json()?;
    if summary["frames_received"] == count && summary["frames_missed"] == 0 {
        return Ok(());
    }
    Err(anyhow!("a lossless consumer did not get all of {count} frames: {summary}"))
}
