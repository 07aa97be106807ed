//! Decides when to offer frames although no consumer has room.

use std::time::{Duration, Instant};

/// Most frames left out between two that are offered.
const MOST_LEFT_OUT: u32 = 31;
/// Longest time without an offer.
const LONGEST: Duration = Duration::from_millis(1);

/// Spares the writing of frames while nobody takes any.
///
/// A frame that reached nobody was for `latest` consumers only, all of them with full queues: a lossless one
/// would have got it, or held it back. After each such frame twice as many frames are left out, until one is
/// taken again. So a stuck consumer costs next to nothing, and a slow one misses hardly more than it would
/// anyway.
#[derive(Debug, Default)]
pub(super) struct Offering {
    /// Frames to leave out after one that nobody took.
    pause: u32,
    /// Frames that are still to be left out.
    left: u32,
    refused_at: Option<Instant>,
}

impl Offering {
    /// True if the next frame is to be offered.
    pub(super) fn is_due(&mut self, now: Instant) -> bool {
        if self.left > 0 && self.refused_at.is_some_and(|at| now.duration_since(at) < LONGEST) {
            self.left -= 1;
            return false;
        }
        true
    }

    /// Notes that a frame was offered, and that `recipients` consumers took it.
    pub(super) fn offered(&mut self, recipients: usize, now: Instant) {
        if recipients > 0 {
            (self.pause, self.left) = (0, 0);
            return;
        }
        let longer = 2 * self.pause + 1;
        self.pause = if longer < MOST_LEFT_OUT { longer } else { MOST_LEFT_OUT };
        (self.left, self.refused_at) = (self.pause, Some(now));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of the frames that are offered, among the first `frames`, while nobody takes any.
    fn offered(offering: &mut Offering, frames: u32, now: Instant) -> Vec<u32> {
        let mut offer = |_: &u32| {
            let due = offering.is_due(now);
            if due {
                offering.offered(0, now);
            }
            due
        };
        (0..frames).filter(&mut offer).collect()
    }

    #[test]
    fn fewer_and_fewer_frames_are_offered_to_whom_takes_none() {
        let (mut offering, now) = (Offering::default(), Instant::now());
        assert_eq!(offered(&mut offering, 130, now), [0, 2, 6, 14, 30, 62, 94, 126]);
    }

    #[test]
    fn every_frame_is_offered_once_one_is_taken() {
        let (mut offering, now) = (Offering::default(), Instant::now());
        offered(&mut offering, 95, now);
        offering.offered(1, now);
        assert!((0..10).all(|_| offering.is_due(now)));
    }

    #[test]
    fn slow_frames_are_all_offered() {
        let (mut offering, now) = (Offering::default(), Instant::now());
        offered(&mut offering, 95, now);
        assert!(!offering.is_due(now));
        assert!(offering.is_due(now + LONGEST));
    }
}
