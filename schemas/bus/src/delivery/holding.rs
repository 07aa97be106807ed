//! Whom a frame waits for, and for how long.

use crate::Delivery;
use std::collections::{HashMap, HashSet};
use std::time::{Duration, Instant};

const CLEAN_AFTER: Duration = Duration::from_millis(50);
const CLEAN_PERIOD: Duration = Duration::from_millis(100);
/// What a healthy consumer needs to make room, once we were asked to stop.
const STOP_GRACE: Duration = Duration::from_millis(250);
/// How often in a row a send may fail in the transport although it did not wait for anybody.
const MAX_FAILURES: u32 = 100;

/// A consumer that has no room for what is being sent.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "independent facts")]
pub struct Full {
    /// Its subscriber.
    pub id: u128,
    /// What it wants; none if it has just left.
    pub delivery: Option<Delivery>,
    /// It is asked about for the first time in this send.
    pub is_first: bool,
    /// This send repeats one that failed.
    pub repeats: bool,
    /// We were asked to stop.
    pub stopping: bool,
    /// The end of a stream of results is being sent, for which `latest` consumers are waited for, too, briefly.
    pub ending: bool,
}

/// What to do about a consumer that has no room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It goes without.
    LeaveOut,
    /// The same, from now on whenever it has no room: it took nothing for so long.
    Evict(Duration),
    /// Wait until it has room.
    Wait {
        /// Look for dead processes first: it may be one.
        clean: bool,
    },
    /// It goes without, and the send fails: we were asked to stop.
    GiveUp,
}

/// Who holds a publisher back.
#[derive(Debug)]
pub struct Holding {
    stuck_after: Duration,
    /// Lossless consumers that nobody waits for (any more).
    ignored: HashSet<u128>,
    /// Since when consumers hold back what is being sent, over all its repetitions.
    held_since: HashMap<u128, Instant>,
    /// Who is asked about in this repetition.
    asked: Option<u128>,
    cleaned_at: Option<Instant>,
    stopped_at: Option<Instant>,
}

impl Holding {
    /// Of a publisher that drops a lossless consumer which takes nothing for `stuck_after`.
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

    /// What to do about `full`.
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

    /// A send failed, and is repeated: all but the one that it waited for may have taken what was sent.
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

    /// Whoever is attached already belongs to an earlier producer of this name, and holds back this one
    /// only after it has joined it.
    pub fn ignore(&mut self, present: impl IntoIterator<Item = u128>) {
        self.ignored.extend(present);
    }

    /// A consumer has joined; from now on it is waited for.
    pub fn joined(&mut self, id: u128) {
        self.ignored.remove(&id);
    }

    /// Whether nobody waits for this one.
    pub fn ignores(&self, id: u128) -> bool {
        self.ignored.contains(&id)
    }
}

/// How often one send is repeated.
///
/// A signal that ends a wait for a consumer fails the send. Such a one is repeated for as long as the
/// consumer may hold us back: [`Holding::judge`] bounds that over all repetitions. Any other
/// failure is repeated a hundred times in a row, and not at all once we were asked to stop.
#[derive(Debug, Default)]
pub struct Repeats {
    failures: u32,
}

impl Repeats {
    /// A send failed, and had `waited` for a consumer or not: whether to send again.
    pub fn once_more(&mut self, waited: bool, stopping: bool) -> bool {
        self.failures = if waited { 0 } else { self.failures + 1 };
        self.failures <= MAX_FAILURES && (self.failures == 0 || !stopping)
    }
}
