//! Simulated time against the wall clock.

use crate::args::Pace;
use std::time::{Duration, Instant};

/// Whoever waits for the clock looks around after this long.
pub(crate) const LONGEST_NAP: Duration = Duration::from_millis(20);

/// Says how far simulated time is ahead of where it may be.
///
/// Times are compared with one moment at which both clocks were read, so that delays do not add up: what was held up
/// catches up.
#[derive(Debug)]
pub(crate) struct Pacer {
    pace: Pace,
    since: Instant,
    since_s: f64,
}

impl Pacer {
    /// Simulated time is `time_s` now.
    pub(crate) fn new(pace: Pace, time_s: f64) -> Self {
        Self { pace, since: Instant::now(), since_s: time_s }
    }

    pub(crate) fn pace(&self) -> Pace {
        self.pace
    }

    /// How long it takes until simulated time may be `time_s`; none if it may be now.
    pub(crate) fn ahead(&self, time_s: f64) -> Option<Duration> {
        let Pace::PerSecond(per_second) = self.pace else { return None };
        let ahead = (time_s - self.since_s) / per_second - self.since.elapsed().as_secs_f64();
        (ahead > 0.0).then(|| Duration::from_secs_f64(ahead.min(1e6)))
    }

    /// Leaves out a time in which the clock of the simulation stood still.
    pub(crate) fn leave_out(&mut self, pause: Duration) {
        self.since += pause;
    }

    /// From now on, with simulated time at `time_s`, another pace counts.
    pub(crate) fn change(&mut self, pace: Pace, time_s: f64) {
        *self = Self::new(pace, time_s);
    }

    /// Simulated seconds per second since the pace was set, with simulated time at `time_s`.
    pub(crate) fn reached(&self, time_s: f64) -> f64 {
        (time_s - self.since_s) / self.since.elapsed().as_secs_f64().max(1e-9)
    }

    /// Simulated time that the wall clock has come to, at most `time_s`.
    pub(crate) fn now_s(&self, time_s: f64) -> f64 {
        match self.pace {
            Pace::Max => time_s,
            Pace::PerSecond(per_second) => {
                let now_s = self.since_s + per_second * self.since.elapsed().as_secs_f64();
                if now_s < time_s { now_s } else { time_s }
            }
        }
    }
}
