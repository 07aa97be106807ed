//! Decides whom a frame waits for, and for how long.

use crate::Delivery;
use std::collections::{HashMap, HashSet};
use std::time::{Duration, Instant};

const CLEAN_AFTER: Duration = Duration::from_millis(50);
const CLEAN_PERIOD: Duration = Duration::from_millis(100);
/// Time that a healthy consumer needs to make room, once we were asked to stop.
const STOP_GRACE: Duration = Duration::from_millis(250);
/// Most failures in a row of a send that waited for nobody.
const MAX_FAILURES: u32 = 100;

/// A consumer that has no room for the sample that is being sent.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "independent facts")]
pub struct Full {
    /// Id of the consumer's subscriber.
    pub id: u128,
    /// Delivery that the consumer wants; none if it has just left.
    pub delivery: Option<Delivery>,
    /// True if this send asks about the consumer for the first time.
    pub is_first: bool,
    /// True if this send repeats one that failed.
    pub repeats: bool,
    /// True if we were asked to stop.
    pub stopping: bool,
    /// True if the end of a stream of results is being sent; that send waits for `latest` consumers too, briefly.
    pub ending: bool,
}

/// Decision about a consumer that has no room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The consumer does not get the sample.
    LeaveOut,
    /// The consumer does not get the sample, nor any later one for which it has no room: it took nothing for this long.
    Evict(Duration),
    /// The send waits until the consumer has room.
    Wait {
        /// True to look for dead processes first: the consumer may be one.
        clean: bool,
    },
    /// The consumer does not get the sample, and the send fails: we were asked to stop.
    GiveUp,
}

/// Consumers that hold a publisher back.
#[derive(Debug)]
pub struct Holding {
    stuck_after: Duration,
    /// Lossless consumers that no send waits for (any more).
    ignored: HashSet<u128>,
    /// Time since which each consumer holds back the present send, over all its repetitions.
    held_since: HashMap<u128, Instant>,
    /// Consumer that this repetition asked about last.
    asked: Option<u128>,
    cleaned_at: Option<Instant>,
    stopped_at: Option<Instant>,
}

impl Holding {
    /// Makes one for a publisher that drops a lossless consumer which takes nothing for `stuck_after`.
    pub fn new(stuck_after: Duration) -> Self {
        Self {
            stuck_after,
            ignored: HashSet::new(),
            held_since: HashMap::new(),
            asked: None,
            cleaned_at: None,
            stopped_at: None,
        }
    }

    /// Decides about the consumer `full`.
    pub fn judge(&mut self, full: &Full, now: Instant) -> Verdict {
        if full.is_first && !full.repeats {
            self.held_since.clear();
        }
        self.asked = Some(full.id);
        let held = now.duration_since(*self.held_since.entry(full.id).or_insert(now));
        match full.delivery {
            Some(Delivery::Latest) if full.ending && held < STOP_GRACE => Verdict::Wait { clean: false },
            None | Some(Delivery::Latest) => Verdict::LeaveOut,
            Some(Delivery::Lossless) if self.ignored.contains(&full.id) => Verdict::LeaveOut,
            Some(Delivery::Lossless) if held >= self.stuck_after => {
                self.ignored.insert(full.id);
                Verdict::Evict(held)
            }
            Some(Delivery::Lossless) if full.stopping && self.stops(now) => Verdict::GiveUp,
            Some(Delivery::Lossless) => Verdict::Wait { clean: held >= CLEAN_AFTER && self.cleans(now) },
        }
    }

    /// Notes that a send failed and is repeated. All consumers but the one that it waited for may have taken the sample.
    pub fn repeats(&mut self) {
        let asked = self.asked.take();
        self.held_since.retain(|id, _| asked == Some(*id));
    }

    fn stops(&mut self, now: Instant) -> bool {
        now.duration_since(*self.stopped_at.get_or_insert(now)) >= STOP_GRACE
    }

    fn cleans(&mut self, now: Instant) -> bool {
        let is_due = self.cleaned_at.is_none_or(|at| now.duration_since(at) >= CLEAN_PERIOD);
        if is_due {
            self.cleaned_at = Some(now);
        }
        is_due
    }

    /// Ignores the consumers that are attached already: they belong to an earlier producer of this name. One of them
    /// holds this producer back only after joining it.
    pub fn ignore(&mut self, present: impl IntoIterator<Item = u128>) {
        self.ignored.extend(present);
    }

    /// Notes that a consumer has joined; sends wait for it from now on.
    pub fn joined(&mut self, id: u128) {
        self.ignored.remove(&id);
    }

    /// True if no send waits for this consumer.
    pub fn ignores(&self, id: u128) -> bool {
        self.ignored.contains(&id)
    }
}

/// Bounds the repetitions of one send.
///
/// A signal that ends a wait for a consumer makes the send fail. Such a send is repeated for as long as the
/// consumer may hold us back; [`Holding::judge`] bounds that over all repetitions. After any other failure
/// the send is repeated up to a hundred times in a row, and not at all once we were asked to stop.
#[derive(Debug, Default)]
pub struct Repeats {
    failures: u32,
}

impl Repeats {
    /// Returns true if a failed send is to be repeated. `waited` is true if the send had waited for a consumer.
    pub fn once_more(&mut self, waited: bool, stopping: bool) -> bool {
        self.failures = if waited { 0 } else { self.failures + 1 };
        self.failures <= MAX_FAILURES && (self.failures == 0 || !stopping)
    }
}
