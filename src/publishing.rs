//! Shared by runs and replays: a publisher, its consumers, and the notices about them.

use crate::display::{self, counted, duration};
use crate::failure::Failure;
use crate::report::Rows;
use bus::{Bus, ConsumerEvent, PublishCounts, PublishError, PublishOptions, StatePublisher, WaitOutcome};
use indicatif::ProgressBar;
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::RunManifest;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Destination of a run's frames: the bus, or none.
pub(crate) struct Outlet(pub(crate) Option<StatePublisher>);

impl Outlet {
    /// Answers consumers who come; one that cannot be answered now is answered at the next frame.
    pub(crate) fn serve(&mut self) {
        let _ = self.0.as_mut().map(StatePublisher::serve);
    }

    /// Who there is, and what came of it.
    pub(crate) fn counts(&self) -> PublishCounts {
        self.0.as_ref().map(StatePublisher::counts).unwrap_or_default()
    }

    /// Events of consumers since the last call.
    pub(crate) fn take_events(&mut self) -> Vec<ConsumerEvent> {
        self.0.as_mut().map(StatePublisher::take_events).unwrap_or_default()
    }

    /// As [`StatePublisher::finish`].
    pub(crate) fn finish(self, reason: EndReason) -> Result<PublishCounts, PublishError> {
        self.finish_and_wait(reason, &AtomicBool::new(true), Duration::ZERO)
    }

    /// As [`StatePublisher::finish_and_wait`].
    pub(crate) fn finish_and_wait(
        self,
        reason: EndReason,
        stop: &AtomicBool,
        at_most: Duration,
    ) -> Result<PublishCounts, PublishError> {
        let finished = self.0.map(|publisher| publisher.finish_and_wait(reason, stop, at_most));
        finished.unwrap_or(Ok(PublishCounts::default()))
    }
}

impl FrameSink for Outlet {
    type Error = PublishError;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), PublishError> {
        self.0.as_mut().map_or(Ok(()), |publisher| publisher.accept(frame))
    }
}

/// Registers the run from `first_frame` on, to which `wait_for` consumers must be able to attach. One that takes nothing for
/// `stall_timeout_s` is dropped.
pub(crate) fn open(
    manifest: &RunManifest,
    first_frame: u64,
    stall_timeout_s: f64,
    wait_for: usize,
    stop: &Arc<AtomicBool>,
) -> Result<StatePublisher, Failure> {
    let bus = Bus::from_env()?;
    let options = PublishOptions {
        first_frame,
        stuck_after: Duration::from_secs_f64(stall_timeout_s),
        stop: Arc::clone(stop),
        ..PublishOptions::default()
    };
    let publisher = StatePublisher::create(&bus, manifest, &manifest.physics.chain(), &options);
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

/// Adds rows about pauses of a publisher and about dropped consumers, if there were any.
pub(crate) fn add_pauses(rows: &mut Rows, paused: Duration, dropped_count: u64) {
    if paused > Duration::ZERO {
        rows.add("paused", duration(paused));
    }
    if dropped_count > 0 {
        rows.add("consumers dropped", format_args!("{dropped_count} that took nothing for too long"));
    }
}

/// Consumers that were dropped.
#[derive(Debug, Default)]
pub(crate) struct Dropped {
    pub(crate) names: Vec<String>,
}

impl Dropped {
    /// Prints a notice about each consumer that was dropped, of these events.
    pub(crate) fn tell(&mut self, events: Vec<ConsumerEvent>, bar: &ProgressBar) {
        for event in events {
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
