//! Whole runs with a consumer, whose frames say which beads move, beside the same runs alone.

use super::super::chains::{GoOn, Nobody};
use super::super::recordings::manifest;
use super::{Process, Streams, await_join};
use crate::{Floor, Rounds, Row, timed};
use anyhow::Error;
use producer::run::run;
use schemas::frame::{EndReason, FrameSink};
use schemas::presets::PRESETS;
use std::thread::sleep;
use std::time::Duration;

/// A chain of which few beads move, and the time of its run (s).
const LONG: (u64, f64) = (100_000, 0.02);

pub(super) fn rows(streams: &Streams<'_>, rounds: u32) -> Result<Vec<Row>, Error> {
    let mut config = PRESETS[0].config();
    (config.chain.beads, config.time.duration_s) = LONG;
    let mut long = Streams { bus: streams.bus.clone(), frames: streams.frames, manifest: manifest(&config)? };
    long.manifest.provenance.name = streams.manifest.provenance.name.clone();
    let [beads, duration] = [LONG.0.to_string(), LONG.1.to_string()];
    let long_words = ["--beads", &beads, "--duration", &duration];
    let row = |what, floor, with: &dyn Fn() -> Result<Duration, Error>, alone: &dyn Fn() -> _| {
        let rounds = Rounds::alternate(rounds, with, alone)?;
        let figure = format!("{:.2} s", rounds.ours_s());
        Ok::<_, Error>(rounds.row(what, "the run alone", floor, figure))
    };
    let (one, few, latest) = (
        "`beadline run` with one lossless `energies`",
        "the same, 10^5 beads of which few move",
        "a run of these with one `--latest`",
    );
    Ok(vec![
        row(one, Floor::AtMost(1.5), &|| streams.followed(&[]), &|| streams.command(&[]))?,
        row(few, Floor::AtMost(2.0), &|| long.followed(&long_words), &|| long.command(&long_words))?,
        row(latest, Floor::AtMost(1.03), &|| long.looked_at(), &|| long.alone())?,
        streams.unheard(rounds)?,
    ])
}

impl Streams<'_> {
    /// The command that runs the first preset, with these words.
    fn command(&self, words: &[&str]) -> Result<Duration, Error> {
        let all = ["beadline", "run", "--no-record", "--json", "--name", self.name()];
        timed(|| Process::start(all.iter().chain(words))?.finish())
    }

    /// The same with a consumer that waits for it.
    fn followed(&self, words: &[&str]) -> Result<Duration, Error> {
        let consumer = self.consumer("energies", &[])?;
        // its start is no part of the time
        sleep(Duration::from_millis(200));
        let took = self.command(&[words, &["--wait-for", "1"]].concat())?;
        consumer.finish()?;
        Ok(took)
    }

    fn go_on(&self, publisher: &mut impl FrameSink<Error: Send + Sync>) -> Result<Duration, Error> {
        timed(|| Ok(run(&self.manifest, publisher, None, &mut GoOn { is_heard: true })?))
    }

    fn alone(&self) -> Result<Duration, Error> {
        let mut publisher = self.publisher()?;
        let took = self.go_on(&mut publisher)?;
        publisher.finish(EndReason::Complete)?;
        Ok(took)
    }

    fn looked_at(&self) -> Result<Duration, Error> {
        let mut publisher = self.publisher()?;
        let consumer = self.consumer("energies", &["--latest"])?;
        await_join(&mut publisher)?;
        let took = self.go_on(&mut publisher)?;
        publisher.finish(EndReason::Complete)?;
        drop(consumer);
        Ok(took)
    }

    /// A run that publishes every step to nobody, of which most are passed.
    fn unheard(&self, rounds: u32) -> Result<Row, Error> {
        let time = |every: u64, is_heard: bool| {
            let mut manifest = self.manifest.clone();
            manifest.provenance.publish_every_steps = every;
            timed(|| Ok(run(&manifest, &mut Nobody, None, &mut GoOn { is_heard })?))
        };
        let last = self.manifest.physics.step_count;
        let rounds = Rounds::alternate(rounds, || time(1, false), || time(last, true))?;
        let figure = format!("{:.2} s", rounds.ours_s());
        Ok(rounds.row("a run of which nobody hears a frame", "one that has two", Floor::AtMost(1.1), figure))
    }
}
