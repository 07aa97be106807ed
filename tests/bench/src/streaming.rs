//! Publishing and following: what the bus costs, beside the dynamics and beside bare iceoryx2.

mod latency;

use super::child::Process;
use super::part::{ATTACHED, READY};
use super::recordings::{Frames, simulate};
use super::{Audience, Bench, Floor, Rounds, Row, timed};
use crate::bare_bus::BarePublisher;
use anyhow::{Error, anyhow};
use bus::{Bus, ConsumerEvent, PublishOptions, StatePublisher, WaitOutcome};
use schemas::frame::{EndReason, Frame, FrameSink as _};
use schemas::manifest::RunManifest;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// How often the frames in memory are sent, so that starting and ending do not count.
const TURNS: usize = 10;

/// Longest time that a consumer may take to attach.
const PATIENCE: Duration = Duration::from_secs(30);

/// How long a consumer is watched that has nothing to do.
const IDLE: Duration = Duration::from_secs(1);

pub(super) fn rows(bench: &Bench, report: &mut dyn Audience) -> Result<(), Error> {
    let streams = Streams::new(bench.frames(report)?)?;
    let rounds = bench.rounds;
    report.row(streams.nobody_attached(rounds)?)?;
    report.row(streams.stalled_consumer(rounds)?)?;
    report.row(streams.one_consumer(rounds)?)?;
    report.row(streams.three_consumers(rounds)?)?;
    report.row(streams.idle_consumer(rounds)?)?;
    for row in latency::rows(&streams, rounds)? {
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
        Process::start([analysis, &source, "--json"].iter().chain(more))
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

    /// Publishes the frames that are in memory to lossless analyses, none of which may lose any.
    fn stream(&self, analyses: &[&str]) -> Result<Duration, Error> {
        let (mut publisher, consumers) = self.followed_by(analyses)?;
        let took = timed(|| self.publish(&mut publisher))?;
        publisher.finish(EndReason::Complete)?;
        for consumer in consumers {
            got_all(consumer, self.count() as u64)?;
        }
        Ok(took)
    }

    /// The same with frames as the dynamics make them.
    fn run_to(&self, analyses: &[&str]) -> Result<Duration, Error> {
        let (mut publisher, consumers) = self.followed_by(analyses)?;
        let took = self.run(&mut publisher)?;
        publisher.finish(EndReason::Complete)?;
        for consumer in consumers {
            got_all(consumer, self.manifest.frame_count())?;
        }
        Ok(took)
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
        let mut consumer = Process::start(["bench-part", "sum", &name, &count])?;
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
        Ok(Row {
            what: "step and publish, nobody attached",
            against: "step alone",
            floor: Floor::AtMost(1.5),
            ratio: rounds.time(),
            figure: self.steps_per_s(&rounds),
        })
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
        Ok(Row {
            what: "the same, one stalled `latest` consumer",
            against: "nobody attached",
            floor: Floor::AtMost(1.1),
            ratio: rounds.time(),
            figure: self.steps_per_s(&rounds),
        })
    }

    fn one_consumer(&self, rounds: u32) -> Result<Row, Error> {
        let rounds = Rounds::alternate(rounds, || self.stream(&["energies"]), || self.stream_bare())?;
        let whole = self.manifest.physics.step_count as f64 / self.run_to(&["energies"])?.as_secs_f64();
        Ok(Row {
            what: "stream to one consumer that computes energies",
            against: "bare iceoryx2, the same frames summed up",
            floor: Floor::AtLeast(0.85),
            ratio: rounds.speed(),
            figure: format!("{}; a run {:.0} k", self.per_second(&rounds), whole / 1e3),
        })
    }

    fn three_consumers(&self, rounds: u32) -> Result<Row, Error> {
        let analyses = ["energies", "impurity", "contacts"];
        let slowest_alone = || -> Result<Duration, Error> {
            let mut slowest = Duration::ZERO;
            for analysis in analyses {
                slowest = slowest.max(self.stream(&[analysis])?);
            }
            Ok(slowest)
        };
        let rounds = Rounds::alternate(rounds, || self.stream(&analyses), slowest_alone)?;
        Ok(Row {
            what: "stream to energies, impurity and contacts",
            against: "the slowest of them alone",
            floor: Floor::AtMost(2.0),
            ratio: rounds.time(),
            figure: format!("{}, none lost", self.per_second(&rounds)),
        })
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
        Ok(Row {
            what: "a consumer while nothing is published",
            against: "one core",
            floor: Floor::AtMost(0.01),
            ratio: idle.time(),
            figure: format!("{:.3} % of a core", 100.0 * idle.time().median),
        })
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

/// Whether a consumer that has ended got every frame.
fn got_all(consumer: Process, count: u64) -> Result<(), Error> {
    let summary = consumer.finish_json()?;
    if summary["frames_received"] == count && summary["frames_missed"] == 0 {
        return Ok(());
    }
    Err(anyhow!("a lossless consumer did not get all of {count} frames: {summary}"))
}
