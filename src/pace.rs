//! Simulated time against the wall clock.

use crate::args::Pace;
use std::time::{Duration, Instant};

/// Longest time to wait for the clock at once.
pub(crate) const LONGEST_NAP: Duration = Duration::from_millis(20);

/// Shorter delays are caught up; nobody sees that.
const SLACK: Duration = Duration::from_millis(100);

/// Tells how far simulated time is ahead of its pace.
///
/// Times are compared with one moment at which both clocks were read, so that small delays do not add up. A run
/// that is behind by more than [`SLACK`], after a stalled consumer or a suspended process, does not race: that moment
/// moves, and the pace counts from the present simulated time.
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

    /// Time until simulated time may be `time_s`; none if it may be now.
    pub(crate) fn ahead(&mut self, time_s: f64) -> Option<Duration> {
        self.ahead_at(Instant::now(), time_s)
    }

    fn ahead_at(&mut self, now: Instant, time_s: f64) -> Option<Duration> {
        let Pace::PerSecond(per_second) = self.pace else { return None };
        let ahead = (time_s - self.since_s) / per_second - (now - self.since).as_secs_f64();
        if -ahead > SLACK.as_secs_f64() {
            (self.since, self.since_s) = (now, time_s);
        }
        (ahead > 0.0).then(|| Duration::from_secs_f64(ahead.min(1e6)))
    }

    /// Sets another pace from now on, with simulated time at `time_s`.
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

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn who_was_held_up_goes_on_at_the_pace_from_where_it_is() {
        let mut pacer = Pacer::new(Pace::PerSecond(1.0), 0.0);
        let late = pacer.since + 60 * SECOND;
        assert_eq!(pacer.ahead_at(late, 1.0), None);
        assert_eq!(pacer.ahead_at(late, 2.0), Some(SECOND), "it does not race through 59 s");
    }

    #[test]
    fn small_delays_are_made_up_for() {
        let mut pacer = Pacer::new(Pace::PerSecond(1.0), 0.0);
        let late = pacer.since + SECOND;
        assert_eq!(pacer.ahead_at(late, 0.9375), None);
        assert_eq!(pacer.ahead_at(late, 2.0), Some(SECOND));
    }
}
