//! The near side on its bus: which states of a live run are sent, and the results about it.

mod rows;

pub use rows::RowSenders;

use crate::log::{Kind, SharedLog};
use crate::message::{EndMessage, FramesMessage};
use bus::{HeldState, LiveError, LiveSource};
use schemas::frame::{EndReason, Received};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Frames between two states are at least so many bytes: frames that wait for their proof stay in a cache.
const WINDOW_BYTES: u64 = 4 << 20;
/// Least frames between two states: they take less than 1/100 of the frames' bytes.
const LEAST_FRAMES: u64 = 128;
/// Most bytes of states in a second, where frames come slowly …
const SLOW_BYTES_PER_S: f64 = 1e6;
/// … but there are no more of them than one in this time.
const SLOW_PERIOD: Duration = Duration::from_millis(10);
/// Bytes of a message of frames.
const BATCH_BYTES: usize = 1 << 20;
/// Longest wait for more of them.
const BATCH_PERIOD: Duration = Duration::from_millis(10);
/// Longest wait for a frame.
const WAIT: Duration = Duration::from_millis(10);

/// Contents of the messages about a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sending {
    /// Every frame, not states alone.
    pub frames: bool,
    /// The run waits for its far sides.
    pub hold: bool,
    /// A state at least every so many frames, and none in between.
    pub every: Option<u64>,
}

/// Counts of sent messages and bytes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Sent {
    /// Frames that the run published meanwhile.
    pub frames: u64,
    /// Messages with states or frames.
    pub messages: u64,
    /// Their bytes.
    pub bytes: u64,
}

/// When the next state is due.
#[derive(Debug)]
struct Due {
    every: Option<u64>,
    frames: u64,
    period: Duration,
    last: Option<(u64, Instant)>,
}

impl Due {
    fn new(frame_bytes: u64, every: Option<u64>) -> Self {
        let slow = Duration::from_secs_f64(frame_bytes as f64 / SLOW_BYTES_PER_S);
        let frames = (WINDOW_BYTES / frame_bytes.max(1)).max(LEAST_FRAMES); // integers
        Self { every, frames, period: slow.max(SLOW_PERIOD), last: None }
    }

    fn is_due(&self, frame: u64, now: Instant) -> bool {
        let Some((last, at)) = self.last else { return true };
        let frames = frame - last;
        match self.every {
            Some(every) => frames >= every,
            None => frames >= self.frames || (frames > 0 && now.duration_since(at) >= self.period),
        }
    }
}

/// Sends the frames of a live run into `log` until they end, `go_on` says no, or a far side wants every frame.
pub struct Sender<'a, P> {
    log: &'a SharedLog<P>,
    sending: Sending,
    due: Due,
    batch: FramesMessage,
    batch_since: Instant,
    /// The newest frame, not sent yet.
    newest: Option<HeldState>,
    last_frame: Option<u64>,
    sent: Sent,
    stop: &'a AtomicBool,
}

/// Why a sender is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// The run has ended, or we were asked to stop.
    Run(EndReason),
    /// `go_on` said no.
    Left,
}

impl<'a, P: Clone + From<Vec<u8>>> Sender<'a, P> {
    /// Sends frames of so many doubles; `stop` ends the wait for a far side.
    pub fn new(log: &'a SharedLog<P>, sending: Sending, frame_doubles: usize, stop: &'a AtomicBool) -> Self {
        Self {
            log,
            sending,
            due: Due::new(8 * frame_doubles as u64, sending.every),
            batch: FramesMessage::default(),
            batch_since: Instant::now(),
            newest: None,
            last_frame: None,
            sent: Sent::default(),
            stop,
        }
    }

    /// The last frame that the run has published, as far as is known.
    pub fn last_frame(&self) -> u64 {
        self.last_frame.unwrap_or(0)
    }

    /// Sends every frame from now on.
    pub fn send_frames(&mut self) {
        self.sending.frames = true;
    }

    /// Counts so far.
    pub fn sent(&self) -> Sent {
        self.sent
    }

    /// Follows the run.
    ///
    /// # Errors
    /// When its frames can no longer be received.
    pub fn follow(
        &mut self,
        live: &mut LiveSource,
        mut go_on: impl FnMut(&Sent) -> bool,
    ) -> Result<Ended, LiveError> {
        loop {
            let mut came = false;
            match live.receive_soon(WAIT)? {
                Some(Received::Frame(frame)) => {
                    came = true;
                    self.count(frame.frame);
                    if self.sending.frames {
                        if !self.batch.continues_with(frame.frame) {
                            self.flush();
                        }
                        if self.batch.is_empty() {
                            self.batch_since = Instant::now();
                        }
                        self.batch.push(&frame);
                    }
                }
                Some(Received::Missed { to, .. }) => self.count(to),
                Some(Received::End(reason)) => {
                    self.flush();
                    return Ok(Ended::Run(reason));
                }
                None => {}
            }
            if came && !self.sending.frames {
                self.newest = live.hold();
            }
            self.send_what_is_due();
            if !go_on(&self.sent) {
                self.flush();
                return Ok(Ended::Left);
            }
        }
    }

    fn count(&mut self, frame: u64) {
        let first = self.last_frame.map_or(frame, |last| last + 1);
        self.sent.frames += (frame + 1).saturating_sub(first);
        self.last_frame = Some(frame);
    }

    fn send_what_is_due(&mut self) {
        if self.sending.frames {
            let is_due = self.batch.len() >= BATCH_BYTES || self.batch_since.elapsed() >= BATCH_PERIOD;
            if is_due && !self.batch.is_empty() {
                self.flush();
            }
        } else if let Some(held) = &self.newest {
            let (frame, now) = (held.frame().frame, Instant::now());
            if self.due.is_due(frame, now) {
                self.due.last = Some((frame, now));
                self.flush();
            }
        }
    }

    /// Sends the frames that have waited.
    fn flush(&mut self) {
        if let Some(held) = self.newest.take() {
            self.batch.push(&held.frame());
        }
        if !self.batch.is_empty() {
            let bytes = self.batch.finish();
            self.push(Kind::Frames, bytes);
        }
    }

    fn push(&mut self, kind: Kind, bytes: Vec<u8>) {
        let count = bytes.len();
        if self.sending.hold {
            // a far side that is silent for too long holds nobody back
            let has_room =
                || self.log.wait_for(WAIT, |log| log.has_room(Instant::now()).then_some(())).is_some();
            while !has_room() && !self.stop.load(Ordering::Relaxed) {}
        }
        self.log.change(|log| log.push(kind, bytes.into(), count, Instant::now()));
        self.sent.messages += 1;
        self.sent.bytes += count as u64;
    }

    /// Ends the messages about the run.
    pub fn end(&mut self, reason: EndReason) {
        let end = EndMessage { reason: reason.as_str().to_owned(), last_frame: self.last_frame };
        self.push(Kind::End, end.encode());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_few_where_frames_are_fast_and_soon_where_they_are_slow() {
        let start = Instant::now();
        let mut due = Due::new(16_000, None);
        assert!(due.is_due(5, start), "the first one");
        due.last = Some((5, start));
        let after = |frames: u64, ms| due.is_due(5 + frames, start + Duration::from_millis(ms));
        assert!(!after(200, 1) && after(262, 1), "4 MiB of frames");
        assert!(!after(1, 15) && after(1, 16), "1 MB/s");
        assert!(!after(0, 1000), "nothing new");
    }

    #[test]
    fn large_states_are_less_than_a_hundredth() {
        let start = Instant::now();
        let mut due = Due::new(16_000_000, None);
        due.last = Some((0, start));
        assert!(!due.is_due(127, start + Duration::from_secs(1)) && due.is_due(128, start));
    }

    #[test]
    fn a_given_distance_is_kept() {
        let start = Instant::now();
        let mut due = Due::new(16_000, Some(1000));
        due.last = Some((0, start));
        assert!(!due.is_due(999, start + Duration::from_secs(9)) && due.is_due(1000, start));
    }
}
