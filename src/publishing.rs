//! Shared by runs and replays: a publisher, its consumers, and the notices about them.

use crate::display::{self, counted, duration};
use crate::failure::Failure;
use bus::{Bus, ConsumerEvent, PublishCounts, PublishError, PublishOptions, StatePublisher, WaitOutcome};
use indicatif::ProgressBar;
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::RunManifest;
use std::sync::atomic::AtomicBool;

/// Consumers that listen to a run while it goes on.
pub(crate) trait Audience {
    /// Answers those who come; one that cannot be answered now is answered at the next frame.
    fn serve(&mut self);
    /// Who there is, and what came of it.
    fn counts(&self) -> PublishCounts;
    /// Events of consumers since the last call.
    fn take_events(&mut self) -> Vec<ConsumerEvent>;
}

impl Audience for StatePublisher {
    fn serve(&mut self) {
        let _ = Self::serve(self);
    }

    fn counts(&self) -> PublishCounts {
        Self::counts(self)
    }

    fn take_events(&mut self) -> Vec<ConsumerEvent> {
        Self::take_events(self)
    }
}

/// Destination of a run's frames: the bus, or none.
pub(crate) enum Outlet {
    Bus(Box<StatePublisher>),
    Nowhere,
}

impl Outlet {
    /// As [`StatePublisher::finish`].
    pub(crate) fn finish(self, reason: EndReason) -> Result<PublishCounts, PublishError> {
        match self {
            Self::Bus(publisher) => publisher.finish(reason),
            Self::Nowhere => Ok(PublishCounts::default()),
        }
    }
}

impl FrameSink for Outlet {
    type Error = PublishError;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), PublishError> {
        match self {
            Self::Bus(publisher) => publisher.accept(frame),
            Self::Nowhere => Ok(()),
        }
    }
}

impl Audience for Outlet {
    fn serve(&mut self) {
        if let Self::Bus(publisher) = self {
            Audience::serve(&mut **publisher);
        }
    }

    fn counts(&self) -> PublishCounts {
        match self {
            Self::Bus(publisher) => publisher.counts(),
            Self::Nowhere => PublishCounts::default(),
        }
    }

    fn take_events(&mut self) -> Vec<ConsumerEvent> {
        match self {
            Self::Bus(publisher) => publisher.take_events(),
            Self::Nowhere => Vec::new(),
        }
    }
}

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
    /// Prints a notice about each consumer that was dropped since the last call.
    pub(crate) fn tell(&mut self, publisher: &mut impl Audience, bar: &ProgressBar) {
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
