//! What a run and a replay have in common: a publisher, its consumers, and what is said about them.

use crate::display::{self, counted, duration};
use crate::failure::Failure;
use anyhow::anyhow;
use indicatif::ProgressBar;
use schemas::bus::{Bus, ConsumerEvent, PublishOptions, StatePublisher, WaitOutcome};
use schemas::manifest::RunManifest;
use std::sync::atomic::AtomicBool;

/// Registers the run, to which `wait_for` consumers must be able to attach.
pub(crate) fn open(
    manifest: &RunManifest,
    options: &PublishOptions,
    wait_for: usize,
) -> Result<StatePublisher, Failure> {
    let publisher = StatePublisher::create(&Bus::from_env()?, manifest, &manifest.physics.chain(), options)?;
    let most = publisher.max_consumers();
    if wait_for > most {
        let message = format!("--wait-for {wait_for}: this run can have at most {most} consumers");
        return Err(Failure::BadInput(anyhow!(message)));
    }
    Ok(publisher)
}

/// Whether frames may be published: `count` consumers are ready, and no signal came meanwhile.
pub(crate) fn wait_for_consumers(
    count: usize,
    publisher: &mut StatePublisher,
    stop: &AtomicBool,
) -> Result<bool, Failure> {
    if count == 0 {
        return Ok(true);
    }
    display::notice(format_args!("waiting for {}", counted(count as u64, "lossless consumer")));
    Ok(publisher.wait_for(count, stop, None)? == WaitOutcome::Ready)
}

/// Consumers that were dropped.
#[derive(Debug, Default)]
pub(crate) struct Dropped {
    pub(crate) names: Vec<String>,
}

impl Dropped {
    /// Says which consumers were dropped since the last call.
    pub(crate) fn tell(&mut self, publisher: &mut StatePublisher, bar: &ProgressBar) {
        for event in publisher.take_events() {
            if let ConsumerEvent::Evicted { name, held } = event {
                let held = duration(held);
                bar.suspend(|| {
                    display::notice(format_args!("consumer {name} took nothing for {held} and was dropped"));
                });
                self.names.push(name);
            }
        }
    }
}
