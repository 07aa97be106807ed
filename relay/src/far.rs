//! The far side on its bus: a run that arrives in pieces is published as if it were a run of this host.

mod results;

use crate::message::{Message, MessageError, Place};
use crate::recompute::{Recompute, initial_difference};
use bus::{Bus, PublishCounts, PublishError, StatePublisher};
use producer::resimulation::{Difference, OtherKernel};
use results::Results;
use schemas::frame::{EndReason, Frame, FrameSink as _};
use schemas::manifest::RunManifest;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Interval at which consumers are served while frames are computed.
const SERVE_PERIOD: Duration = Duration::from_millis(20);
/// States whose frames are not all published: of one they are, of one they are computed, and one is next.
const MOST_ASKED: usize = 3;
/// With messages that have waited longer than this, for so long, we are too slow to recompute.
const TOO_OLD: Duration = Duration::from_secs(10);

/// Why the far side cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum FarError {
    /// A message that arrived is wrong.
    #[error(transparent)]
    Message(#[from] MessageError),
    /// The state that arrived is not the one that was computed.
    #[error("what arrived is not what the run leads to; nothing after step {proven_step} was published")]
    Differs {
        /// The last step that was published.
        proven_step: u64,
        /// The difference.
        source: Difference,
    },
    /// Frames are missing that cannot be computed here.
    #[error(
        "the frames {from} to {to} did not arrive and cannot be recomputed here: the run has another kernel version; \
         `--hold` on the near side loses none"
    )]
    Lost {
        /// The first.
        from: u64,
        /// The last.
        to: u64,
    },
    /// The end contradicts the run, or the frames that arrived.
    #[error(
        "the other side says that the run ended `{reason}` after {frames} frames, but {but}; it is taken as failed, because not \
         both can be true"
    )]
    End {
        /// The reason that was given.
        reason: EndReason,
        /// Number of frames of the run, by its end message.
        frames: u64,
        /// The fact that contradicts it.
        but: String,
    },
    /// The run was computed by another dynamics.
    #[error("the frames of this run can only be sent, with `--frames`, not recomputed here")]
    Kernel(#[from] OtherKernel),
    /// The bus.
    #[error(transparent)]
    Publish(#[from] PublishError),
}

/// Numbers of frames that arrived, by their proof.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Arrived {
    /// Messages.
    pub messages: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Frames published.
    pub frames: u64,
    /// Recomputed frames that a later state proved.
    pub proven: u64,
    /// Frames recomputed after the last state: nothing proves them.
    pub unproven: u64,
    /// Rows of results published.
    pub rows: u64,
    /// Rows of results that were lost on the way.
    pub rows_lost: u64,
}

/// A run from elsewhere on the bus of this host.
pub struct Far {
    manifest: Arc<RunManifest>,
    publisher: StatePublisher,
    next_frame: u64,
    stop: Arc<AtomicBool>,
    /// Goes on from the last frame that arrived; none before the first.
    recompute: Option<Recompute>,
    /// The messages whose frames are computed.
    asked: VecDeque<u64>,
    /// The first frame after all that was asked for.
    next_asked: u64,
    /// Number of the message taken last.
    seq: u64,
    /// The frame after the last one that this near side has sent.
    told: u64,
    /// Frames come as they are.
    frames: bool,
    /// Another near side goes on: its first frame must follow from the published frames.
    is_again: bool,
    results: Results,
    scratch: Vec<f64>,
    arrived: Arrived,
    /// Since when messages are too old, and how long consumers had held us back then.
    late: Option<(Instant, Duration)>,
    /// Rows that earlier near sides have lost.
    lost_before: u64,
}

/// Refuses an end of a run that contradicts its manifest, or that lies before the `arrived` frames.
///
/// # Errors
/// With the end and the fact that contradicts it.
pub fn check_end(
    manifest: &RunManifest,
    (reason, last_frame): (EndReason, Option<u64>),
    arrived: u64,
) -> Result<(), FarError> {
    let (frames, all) = (last_frame.map_or(0, |last| last + 1), manifest.frame_count());
    let but = if reason == EndReason::Complete && frames != all {
        format!("its manifest has {all}")
    } else if frames < arrived {
        format!("{arrived} arrived")
    } else {
        return Ok(());
    };
    Err(FarError::End { reason, frames, but })
}

impl Far {
    /// Publishes on `bus` through `publisher`, of which `first_frame` is the first frame, until `stop` is set.
    pub fn new(
        manifest: RunManifest,
        bus: &Bus,
        publisher: StatePublisher,
        first_frame: u64,
        frames: bool,
        stop: Arc<AtomicBool>,
    ) -> Self {
        let results = Results::new(bus, &manifest, publisher.stream(), first_frame, Arc::clone(&stop));
        Self {
            manifest: Arc::new(manifest),
            publisher,
            next_frame: first_frame,
            stop,
            recompute: None,
            asked: VecDeque::new(),
            next_asked: first_frame,
            seq: 0,
            told: 0,
            frames,
            is_again: false,
            results,
            scratch: Vec::new(),
            arrived: Arrived::default(),
            late: None,
            lost_before: 0,
        }
    }

    /// The bus, to look at its consumers.
    pub fn publisher(&mut self) -> &mut StatePublisher {
        &mut self.publisher
    }

    /// Numbers of frames that arrived so far.
    pub fn arrived(&self) -> Arrived {
        let (rows, lost) = self.results.counts();
        Arrived { rows, rows_lost: self.lost_before + self.arrived.rows_lost + lost, ..self.arrived }
    }

    /// The last step published.
    pub fn step(&self) -> u64 {
        self.manifest.step_of_frame(self.next_frame.saturating_sub(1))
    }

    /// Results that could not be published, in words, since the last call.
    pub fn take_troubles(&mut self) -> Vec<String> {
        self.results.take_troubles()
    }

    /// True if frames arrive faster than we recompute them: messages wait for us for long, though hardly any consumer
    /// holds us back.
    pub fn is_too_slow(&mut self, place: Place) -> bool {
        if self.frames || Duration::from_millis(place.age_ms) < TOO_OLD {
            self.late = None;
            return false;
        }
        let held_back = self.publisher.counts().held_back;
        let (since, before) = *self.late.get_or_insert((Instant::now(), held_back));
        since.elapsed() >= TOO_OLD && 2 * held_back.saturating_sub(before) < since.elapsed()
    }

    /// Another near side goes on with the run, whose messages after `seq` come. Consumers hear nothing of it: frames
    /// are published if they follow from the published ones.
    pub fn again(&mut self, seq: u64, frames: bool) {
        self.asked.iter_mut().for_each(|asked| *asked = seq + 1);
        (self.seq, self.told) = (seq, 0);
        (self.frames, self.is_again, self.late) = (frames, true, None);
        self.lost_before += std::mem::take(&mut self.arrived.rows_lost);
        self.results.again();
    }

    /// Frames come as they are from now on.
    pub fn expect_frames(&mut self) {
        self.frames = true;
    }

    /// Serves consumers while nothing arrives.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn serve(&mut self) -> Result<(), FarError> {
        Ok(self.publisher.serve()?)
    }

    /// True if frames are computed that have not been published.
    pub fn is_recomputing(&self) -> bool {
        !self.asked.is_empty()
    }

    /// All messages up to this one have been published.
    pub fn done(&self) -> u64 {
        self.asked.front().map_or(self.seq, |seq| seq.saturating_sub(1))
    }

    /// Takes a message; gives the end of the run, if it is that, when everything has been published.
    ///
    /// # Errors
    /// When it is none, does not follow from the one before, or cannot be published.
    pub fn take(&mut self, place: Place, bytes: &[u8]) -> Result<Option<EndReason>, FarError> {
        self.seq = place.seq;
        self.arrived.messages += 1;
        self.arrived.bytes += bytes.len() as u64;
        self.arrived.rows_lost = place.rows_lost;
        match Message::decode(bytes, &self.manifest)? {
            Message::Frames { first, doubles } => self.take_frames(first, doubles)?,
            Message::Rows { head, rows } => {
                self.results.take(&head, rows)?;
                self.results.publish_up_to(self.next_frame);
            }
            Message::End { reason, last_frame } => {
                check_end(&self.manifest, (reason, last_frame), self.told)?;
                if let Some(last) = last_frame.filter(|last| *last >= self.next_asked) {
                    let Some(recompute) = &self.recompute else {
                        return Err(FarError::Lost { from: self.next_frame, to: last });
                    };
                    recompute.run_on(last);
                    self.asks_up_to(last);
                }
                self.publish_asked(0)?;
                return Ok(Some(reason));
            }
        }
        Ok(None)
    }

    fn take_frames(&mut self, first: u64, doubles: &[u8]) -> Result<(), FarError> {
        let (manifest, beads) = (Arc::clone(&self.manifest), self.beads());
        let mut scratch = std::mem::take(&mut self.scratch);
        let last = first + (doubles.len() / (8 * manifest.frame_doubles())) as u64 - 1;
        self.told = self.told.max(last + 1); // integers
        for (number, bytes) in (first..).zip(doubles.chunks_exact(8 * manifest.frame_doubles())) {
            if number < self.next_asked {
                continue; // again, after a cut
            }
            scratch.clear();
            scratch
                .extend(bytes.chunks_exact(8).map(|x| f64::from_le_bytes(x.try_into().unwrap_or_default())));
            let step = manifest.step_of_frame(number);
            let frame = Frame::of_doubles((number, step, manifest.physics.time_s(step)), beads, &scratch);
            self.take_frame(&manifest, &frame)?;
            if number == last
                && let Some(recompute) = self.recompute.as_ref().filter(|_| self.frames)
            {
                recompute.believe(&frame);
            }
        }
        self.scratch = scratch;
        Ok(())
    }

    fn take_frame(&mut self, manifest: &RunManifest, frame: &Frame<'_>) -> Result<(), FarError> {
        let is_next = frame.frame == self.next_asked;
        match &self.recompute {
            Some(_) if self.frames && is_next && !self.is_again => {}
            Some(recompute) => {
                self.is_again = false;
                recompute.reach(frame);
                self.asks_up_to(frame.frame);
                return self.publish_asked(MOST_ASKED - 1);
            }
            None if is_next => match Recompute::begin(manifest, frame) {
                Ok(recompute) => {
                    if let Some(source) = initial_difference(manifest, frame) {
                        return Err(FarError::Differs { proven_step: 0, source });
                    }
                    self.recompute = Some(recompute);
                }
                Err(error) if !self.frames => return Err(error.into()),
                Err(_) => {}
            },
            None => return Err(FarError::Lost { from: self.next_asked, to: frame.frame - 1 }),
        }
        self.publish_asked(0)?;
        self.publish(frame)?;
        self.next_asked = self.next_frame;
        self.results.publish_up_to(self.next_frame);
        Ok(())
    }

    fn asks_up_to(&mut self, last: u64) {
        self.asked.push_back(self.seq);
        self.next_asked = last + 1;
    }

    /// Publishes computed frames until no more than this many states are left that lead to more.
    fn publish_asked(&mut self, most_left: usize) -> Result<(), FarError> {
        while self.asked.len() > most_left {
            self.publish_next()?;
        }
        Ok(())
    }

    /// Publishes the next frames that have been computed, or serves consumers for a while.
    ///
    /// # Errors
    /// When they do not lead to the state that arrived, or cannot be published.
    pub fn publish_next(&mut self) -> Result<(), FarError> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(PublishError::Stopped { frame: self.next_frame }.into());
        }
        let Some(recompute) = &mut self.recompute else { return Ok(()) };
        let proven_step = self.manifest.step_of_frame(self.next_frame.saturating_sub(1));
        let found =
            recompute.next(SERVE_PERIOD).map_err(|source| FarError::Differs { proven_step, source })?;
        let Some(window) = found else { return self.serve() };
        let before = self.next_frame;
        let manifest = Arc::clone(&self.manifest);
        window.frames(&manifest).try_for_each(|frame| self.publish(&frame))?;
        let counted = if window.is_proven { &mut self.arrived.proven } else { &mut self.arrived.unproven };
        *counted += self.next_frame - before;
        if window.is_last {
            self.asked.pop_front();
        }
        if let Some(recompute) = &self.recompute {
            recompute.reuse(window);
        }
        self.results.publish_up_to(self.next_frame);
        Ok(())
    }

    fn publish(&mut self, frame: &Frame<'_>) -> Result<(), FarError> {
        self.publisher.accept(frame)?;
        self.next_frame = frame.frame + 1;
        self.arrived.frames += 1;
        Ok(())
    }

    fn beads(&self) -> usize {
        usize::try_from(self.manifest.physics.beads).unwrap_or(usize::MAX)
    }

    /// Ends the run on this bus as the other one ended.
    ///
    /// # Errors
    /// When the end could not be written.
    pub fn finish(mut self, reason: EndReason) -> Result<PublishCounts, FarError> {
        self.results.finish();
        Ok(self.publisher.finish(reason)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    #[test]
    fn an_end_is_that_of_the_manifest_and_of_what_arrived() {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&PRESETS[0].config(), "run", origin).unwrap();
        let last = manifest.frame_count() - 1;
        let check = |reason, last, arrived| check_end(&manifest, (reason, last), arrived);
        for (reason, last, arrived) in [
            (EndReason::Complete, Some(last), 7),
            (EndReason::Interrupted, Some(300), 301),
            (EndReason::Failed, None, 0),
        ] {
            check(reason, last, arrived).unwrap();
        }
        for (reason, last, arrived, said) in [
            (EndReason::Complete, Some(300), 0, "`complete` after 301 frames, but its manifest has 55190"),
            (EndReason::Complete, None, 0, "after 0 frames, but its manifest has 55190"),
            (EndReason::Interrupted, Some(300), 302, "after 301 frames, but 302 arrived"),
        ] {
            let found = check(reason, last, arrived).unwrap_err().to_string();
            assert!(found.contains(said), "{found}");
        }
    }
}
