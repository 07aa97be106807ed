//! Shared by runs and replays: a publisher, its consumers, and the notices about them.

use crate::display::{self, counted, duration};
use crate::failure::Failure;
use bus::{Bus, ConsumerEvent, PublishOptions, StatePublisher, WaitOutcome};
use indicatif::ProgressBar;
use schemas::manifest::RunManifest;
use std::sync::atomic::AtomicBool;

/// Registers the run, to which `wait_for` consumers must be able to attach.
pub(crate) fn open(
    manifest: &RunManifest,
    options: &PublishOptions,
    wait_for: usize,
) -> Result<StatePublisher, Failure> {
    let bus = Bus::from_env()?;
    let publisher = StatePublisher::create(&bus, manifest, &manifest.physics.chain(), options);
    display::notice_of_bus(&bus);
    let publisher = publisher?;
    let most = publisher.max_consumers();
    if wait_for > most {
        return Err(bad_input!("--wait-for {wait_for}: this run can have at most {most} consumers"));
    }
    Ok(publisher)
}

/// Waits for `count` consumers. False if a signal came meanwhile.
pub(crate) fn wait_for_consumers(
    count: usize,
    publisher: &mut StatePublisher,
    stop: &AtomicBool,
) -> Result<bool, Failure> {
    if count == 0 {
        return Ok(true);
    }
    notice!("waiting for {}", counted(count as u64, "lossless consumer"));
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
            match event {
                ConsumerEvent::Evicted { name, held } => {
                    let held = duration(held);
                    bar.suspend(|| {
                        notice!("consumer {name} took nothing for {held} and was dropped");
                    });
                    self.names.push(name);
                }
                ConsumerEvent::BusGone { root } => bar.suspend(|| {
                    notice!(
                        "the bus directory {} was removed: consumers that are attached read on, but no other can \
                         attach to this run; if some are to, end the run and start it again, and set BEADLINE_ROOT \
                         to a directory that nothing cleans",
                        root.display()
                    );
                }),
                ConsumerEvent::Joined { .. } | ConsumerEvent::CleanedUp { .. } => {}
            }
        }
    }
}
