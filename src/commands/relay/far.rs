//! The far side of a relay: the other host.

use super::{endpoint, of_wire};
use crate::args::RelayArgs;
use crate::display::{self, bytes, count, counted, per_second};
use crate::failure::{Done, Failure};
use crate::progress::Progress;
use crate::publishing::{self, Dropped};
use crate::report::{Rows, report};
use crate::signals;
use bus::{Bus, PublishError};
use indicatif::ProgressBar;
use relay::far::{Arrived, Far, FarError, check_end};
use relay::message::{MOST_BYTES_BEFORE, Message, Place};
use relay::wire::{Arrival, Fetching, Payload, Waiting, Wanted};
use schemas::frame::EndReason;
use schemas::manifest::RunManifest;
use serde_json::json;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time of waiting for a message before consumers are served.
const PATIENCE: Duration = Duration::from_millis(50);

pub(super) fn far(args: &RelayArgs, connect: &str) -> Result<Done, Failure> {
    let endpoint = endpoint("--connect", connect)?;
    let stop = signals::stop_flag()?;
    let bus = Bus::from_env()?;
    // the same for each start on this bus, so that the near side waits for no earlier one
    let mut hasher = DefaultHasher::new();
    bus.prefix().hash(&mut hasher);
    let wanted =
        Wanted { endpoint, config: args.config.clone(), receiver: hasher.finish(), frames: args.frames };
    let Some(fetching) = meet(&wanted, &stop)? else {
        notice!("stopped before there was a run at {}", wanted.endpoint);
        return Ok(Done::Lossy);
    };
    display::notice_of_version(&fetching.manifest);
    let session = Session { args, manifest: &fetching.manifest, fetching: &fetching, stop: &stop };
    let summary = session.publish(&bus);
    if summary.is_err() {
        // there is nothing to wait for
        stop.store(true, Ordering::Relaxed);
    }
    fetching.stop(&stop);
    summary?.report(args.json)
}

/// Connects, and waits for a run to be offered.
fn meet(wanted: &Wanted, stop: &AtomicBool) -> Result<Option<Fetching>, Failure> {
    let mut told = None;
    let tell = |waiting| {
        if told.replace(waiting) != Some(waiting) {
            match waiting {
                Waiting::Nobody => notice!("nothing listens at {} yet: waiting", wanted.endpoint),
                Waiting::NoRun => notice!("connected to {}: waiting for its run", wanted.endpoint),
            }
        }
    };
    Fetching::start(wanted, stop, tell).map_err(of_wire)
}

/// Beginning of a run on this side.
enum Begin {
    /// With this message, whose first frame has this number.
    At(Place, Payload, u64),
    /// It has ended, or we were asked to stop.
    Never(EndReason),
}

/// One run that is fetched.
struct Session<'a> {
    args: &'a RelayArgs,
    manifest: &'a RunManifest,
    fetching: &'a Fetching,
    stop: &'a Arc<AtomicBool>,
}

impl Session<'_> {
    fn publish(&self, bus: &Bus) -> Result<Republished, Failure> {
        let name = &self.manifest.provenance.name;
        let (place, message, first) = match self.first()? {
            Begin::At(place, message, first) => (place, message, first),
            Begin::Never(reason) => {
                notice!("there is no frame of {name}");
                return Ok(Republished::new(self.manifest, reason));
            }
        };
        let RelayArgs { stall_timeout, wait_for, .. } = *self.args;
        let mut publisher = publishing::open(self.manifest, first, stall_timeout, wait_for, self.stop)?;
        notice!("{name} is published here from frame {} on", count(first));
        if !publishing::wait_for_consumers(wait_for, &mut publisher, self.stop)? {
            publisher.finish(EndReason::Interrupted)?;
            return Ok(Republished::new(self.manifest, EndReason::Stopped));
        }
        let frames = self.fetching.frames;
        let far = Far::new(self.manifest.clone(), bus, publisher, first, frames, Arc::clone(self.stop));
        self.follow(far, first, (place, message))
    }

    /// The first message with a frame; none if there is none.
    fn first(&self) -> Result<Begin, Failure> {
        let mut bytes_before = 0;
        while !self.stop.load(Ordering::Relaxed) && !self.is_given_up() {
            match self.fetching.next(PATIENCE) {
                Some(Arrival::Message(place, payload)) => {
                    match Message::decode(&payload.to_bytes(), self.manifest)? {
                        Message::Frames { first, .. } => return Ok(Begin::At(place, payload, first)),
                        Message::End { reason, last_frame } => {
                            check_end(self.manifest, (reason, last_frame), 0)?;
                            self.fetching.done(place.seq);
                            return Ok(Begin::Never(reason));
                        }
                        Message::Rows { .. } => self.fetching.done(place.seq),
                    }
                    bytes_before += payload.len();
                    if bytes_before > MOST_BYTES_BEFORE {
                        return Err(anyhow::anyhow!(
                            "the other side sent {} and no state, expected one within {}",
                            bytes(bytes_before as u64),
                            bytes(MOST_BYTES_BEFORE as u64)
                        )
                        .into());
                    }
                }
                Some(Arrival::Again(..)) => bytes_before = 0,
                Some(Arrival::Failed(error)) => return Err(of_wire(error)),
                None => {}
            }
        }
        Ok(Begin::Never(EndReason::Stopped))
    }

    fn is_given_up(&self) -> bool {
        let silent = self.fetching.silence() >= Duration::from_secs_f64(self.args.silence);
        if silent {
            notice!("the near side has been silent for {} s: the connection is lost", self.args.silence);
        }
        silent
    }

    /// Publishes what arrives until the run ends.
    fn follow(
        &self,
        mut far: Far,
        first_frame: u64,
        first: (Place, Payload),
    ) -> Result<Republished, Failure> {
        let (start, mut progress) = (Instant::now(), Progress::of_run(self.manifest));
        let (mut dropped, quiet) = (Dropped::default(), ProgressBar::hidden());
        let mut next = Some(Arrival::Message(first.0, first.1));
        let reason = loop {
            if self.stop.load(Ordering::Relaxed) {
                break EndReason::Stopped;
            }
            match self.take(&mut far, next) {
                Ok(None) => self.fetching.done(far.done()),
                Ok(Some(reason)) => {
                    self.fetching.done(far.done());
                    break reason;
                }
                Err(Failure::Failed(error)) if is_stop(&error) => break EndReason::Stopped,
                Err(error) => return Err(end_failed(far, error)),
            }
            if progress.at(far.step()) {
                let arrived = far.arrived();
                let parts = [counted(arrived.frames, "frame"), bytes(arrived.bytes).to_string()];
                progress.tell(&parts.each_ref().map(String::as_str));
                dropped.tell(far.publisher().take_events(), &quiet);
            }
            for trouble in far.take_troubles() {
                notice!("results that came along are not published here: {trouble}");
            }
            next = self.fetching.next(if far.is_recomputing() { Duration::ZERO } else { PATIENCE });
        };
        progress.finish();
        dropped.tell(far.publisher().take_events(), &quiet);
        let arrived = far.arrived();
        let counts = far.finish(reason)?;
        Ok(Republished {
            first_frame,
            arrived,
            evicted: counts.evicted,
            seconds: start.elapsed().as_secs_f64(),
            ..Republished::new(self.manifest, reason)
        })
    }

    /// Takes what arrived, if anything did; gives the end of the run, if that has come.
    fn take(&self, far: &mut Far, arrival: Option<Arrival>) -> Result<Option<EndReason>, Failure> {
        match arrival {
            Some(Arrival::Message(place, payload)) => {
                let taken = far.take(place, &payload.to_bytes())?;
                if far.is_too_slow(place) {
                    notice!("this host is too slow to recompute: it asks for the frames themselves");
                    self.fetching.ask_for_frames();
                    far.expect_frames();
                }
                return Ok(taken);
            }
            Some(Arrival::Again(have, frames)) => {
                notice!(
                    "another near side has the run: it goes on after step {} if what comes follows from it",
                    count(far.step())
                );
                far.again(have.seq, frames);
            }
            Some(Arrival::Failed(error)) => return Err(of_wire(error)),
            None if far.is_recomputing() => far.publish_next()?,
            None if self.is_given_up() => return Ok(Some(EndReason::ProducerLost)),
            None => far.serve()?,
        }
        Ok(None)
    }
}

/// True if this process was asked to stop while a frame was published.
fn is_stop(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(FarError::Publish(PublishError::Stopped { .. })))
}

/// Tells consumers that the run failed here.
fn end_failed(far: Far, error: Failure) -> Failure {
    // the first error says more than one about the end
    let _ = far.finish(EndReason::Failed);
    error
}

/// Numbers about a run that was published here.
struct Republished {
    run: String,
    reason: EndReason,
    first_frame: u64,
    arrived: Arrived,
    evicted: u64,
    frame_bytes: u64,
    seconds: f64,
}

impl Republished {
    fn new(manifest: &RunManifest, reason: EndReason) -> Self {
        Self {
            run: manifest.provenance.name.to_string(),
            reason,
            first_frame: 0,
            arrived: Arrived::default(),
            evicted: 0,
            frame_bytes: 8 * manifest.frame_doubles() as u64,
            seconds: 0.0,
        }
    }

    fn report(&self, as_json: bool) -> Result<Done, Failure> {
        let Arrived {
            messages,
            bytes: arrived_bytes,
            frames,
            proven,
            unproven,
            rows: result_rows,
            rows_lost,
        } = self.arrived;
        let json = json!({
            "run": self.run,
            "end": self.reason.as_str(),
            "first_frame": self.first_frame,
            "frames": frames,
            "frames_proven": proven,
            "frames_unproven": unproven,
            "frames_bytes": self.frame_bytes * frames,
            "messages": messages,
            "arrived_bytes": arrived_bytes,
            "rows": result_rows,
            "rows_lost": rows_lost,
            "consumers_dropped": self.evicted,
            "seconds": self.seconds,
        });
        report(as_json, &json, || {
            let mut rows = Rows::default();
            let rate = per_second(frames as f64 / self.seconds, "frames");
            rows.add("frames", format_args!("{} from {} on, {rate}", count(frames), count(self.first_frame)));
            rows.add("recomputed", format_args!("{} and proven by the states that arrived", count(proven)));
            if unproven > 0 {
                rows.add("unproven", format_args!("{}, after the last state that arrived", count(unproven)));
            }
            rows.add("arrived", format_args!("{} in {}", bytes(arrived_bytes), counted(messages, "message")));
            if result_rows + rows_lost > 0 {
                rows.add(
                    "results",
                    format_args!("{}, {} lost", counted(result_rows, "row"), count(rows_lost)),
                );
            }
            rows.under(format_args!("{} {}", self.run, self.reason))
        })?;
        Ok(Done::whole_if(self.reason.is_orderly() && rows_lost == 0 && self.evicted == 0))
    }
}
