//! Messages of the near side, kept until every far side has done with them.
//!
//! The log decides without a transport and without a clock: times are passed in.

use std::collections::{HashMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Most bytes that wait for far sides which do not keep up.
pub const MOST_BYTES: usize = 64 << 20;
/// Most bytes that are on their way to one far side: it holds as many at a time.
pub const WINDOW_BYTES: usize = 8 << 20;
/// Most messages that are on their way to one far side.
pub const WINDOW_MESSAGES: usize = 32;
/// Most messages that wait for a far side that holds the run back.
const HOLD_MESSAGES: usize = 8;
/// Most far sides that are known at a time, more than anybody runs: beyond that the one goes that was silent for longest.
const MOST_RECEIVERS: usize = 256;
/// Time for which a far side that has done with everything may still ask for confirmation: it asks twice a second.
const FAREWELL: Duration = Duration::from_secs(1);

/// Importance of a message to far sides that come late or are slow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// It begins with a state, from which all later ones can be computed.
    Frames,
    /// So many rows of results, which nothing replaces.
    Rows(u64),
    /// The end.
    End,
}

/// One message.
#[derive(Debug, Clone)]
pub struct Entry<P> {
    /// Its number, from 1.
    pub seq: u64,
    /// Its kind.
    pub kind: Kind,
    /// Its bytes, cheap to clone.
    pub payload: P,
    /// Its size (bytes).
    pub bytes: usize,
    /// Since when it is there.
    pub at: Instant,
}

/// A far side.
#[derive(Debug, Clone, Copy)]
struct Receiver {
    /// It has done with all messages up to this one.
    done: u64,
    heard: Instant,
    /// Since when it has done with the end.
    over: Option<Instant>,
    /// It knows that we know.
    told: bool,
}

impl Receiver {
    fn new(done: u64, heard: Instant) -> Self {
        Self { done, heard, over: None, told: false }
    }
}

/// The messages of one publishing of a run.
#[derive(Debug)]
pub struct Log<P> {
    entries: VecDeque<Entry<P>>,
    next: u64,
    bytes: usize,
    receivers: HashMap<u64, Receiver>,
    /// A far side has asked for the run.
    was_joined: bool,
    /// Longest silence of a far side.
    patience: Duration,
    ended: bool,
    /// Rows that never came, or were left out because nobody fetched them in time.
    rows_lost: u64,
    /// Far sides that were given up before they had everything.
    given_up: u64,
}

impl<P: Clone> Log<P> {
    /// A log of which far sides are given up after so long a silence.
    pub fn new(patience: Duration) -> Self {
        Self {
            entries: VecDeque::new(),
            next: 1,
            bytes: 0,
            receivers: HashMap::new(),
            was_joined: false,
            patience,
            ended: false,
            rows_lost: 0,
            given_up: 0,
        }
    }

    /// Adds a message, and leaves out the oldest ones where there are too many bytes.
    pub fn push(&mut self, kind: Kind, payload: P, bytes: usize, now: Instant) {
        let seq = self.next;
        self.next += 1;
        self.ended |= kind == Kind::End;
        self.bytes += bytes;
        self.entries.push_back(Entry { seq, kind, payload, bytes, at: now });
        self.forget_done(now);
        while self.bytes > MOST_BYTES && self.entries.len() > 2 {
            let Some(oldest) = self.entries.pop_front() else { break };
            self.bytes -= oldest.bytes;
            if let Kind::Rows(count) = oldest.kind
                && !self.receivers.is_empty()
            {
                self.rows_lost += count;
            }
        }
    }

    /// Removes the messages that every far side has done with, but not the last state and the messages after it: a late
    /// far side begins there.
    fn forget_done(&mut self, now: Instant) {
        let patience = self.patience;
        let before = self.receivers.len();
        self.receivers.retain(|_, receiver| now.duration_since(receiver.heard) < patience);
        self.given_up += (before - self.receivers.len()) as u64;
        let Some(done) = self.receivers.values().map(|receiver| receiver.done).min() else { return };
        let keep = self.last_state().unwrap_or(self.next);
        while self.entries.front().is_some_and(|first| first.seq <= done && first.seq < keep) {
            if let Some(first) = self.entries.pop_front() {
                self.bytes -= first.bytes;
            }
        }
    }

    fn last_state(&self) -> Option<u64> {
        self.entries.iter().rev().find(|entry| entry.kind == Kind::Frames).map(|entry| entry.seq)
    }

    /// A far side asks for the run: its place before it asks for messages. The first one, for which the run was
    /// joined, begins with the first message, any other one with the last state.
    pub fn join(&mut self, receiver: u64, now: Instant) -> u64 {
        let first = self.entries.front().map(|first| first.seq);
        let is_first = !std::mem::replace(&mut self.was_joined, true);
        let done = first.filter(|_| is_first).or_else(|| self.last_state()).unwrap_or(self.next) - 1;
        self.make_room(receiver);
        self.receivers.insert(receiver, Receiver::new(done, now));
        done
    }

    /// Gives up the far side that was silent for longest if there is no room for one more.
    fn make_room(&mut self, receiver: u64) {
        if self.receivers.len() < MOST_RECEIVERS || self.receivers.contains_key(&receiver) {
            return;
        }
        let oldest =
            self.receivers.iter().min_by_key(|(_, known)| known.heard).map(|(receiver, _)| *receiver);
        if oldest.is_some_and(|oldest| self.receivers.remove(&oldest).is_some()) {
            self.given_up += 1;
        }
    }

    /// A far side is there, and has done with the messages up to `done`, if it says so. One that was given up is back.
    pub fn hear(&mut self, receiver: u64, done: Option<u64>, now: Instant) {
        let first = self.entries.front().map_or(self.next, |first| first.seq) - 1;
        self.make_room(receiver);
        let known = self.receivers.entry(receiver).or_insert(Receiver::new(first, now));
        known.heard = now;
        known.done = known.done.max(done.unwrap_or(0).min(self.next - 1)); // integers
        if self.ended && known.done + 1 == self.next {
            known.over.get_or_insert(now);
        }
        self.forget_done(now);
    }

    /// The message for a far side that has those up to `have`, if it may have more now.
    pub fn next_for(&self, receiver: u64, have: u64) -> Option<Entry<P>> {
        let done = self.receivers.get(&receiver)?.done;
        let at = self.entries.partition_point(|entry| entry.seq <= have);
        let entry = self.entries.get(at)?;
        let from = self.entries.partition_point(|entry| entry.seq <= done);
        let under_way = at.saturating_sub(from);
        let bytes: usize = self.entries.range(from.min(at)..at).map(|entry| entry.bytes).sum(); // integers
        let fits = under_way < WINDOW_MESSAGES && bytes + entry.bytes <= WINDOW_BYTES;
        (fits || under_way == 0).then(|| entry.clone())
    }

    /// True if a run that waits for its far sides may go on.
    pub fn has_room(&mut self, now: Instant) -> bool {
        self.forget_done(now);
        let done = self.receivers.values().map(|receiver| receiver.done).min().unwrap_or(self.next - 1);
        let waiting = self.entries.iter().filter(|entry| entry.seq > done && entry.kind == Kind::Frames);
        waiting.count() < HOLD_MESSAGES
    }

    /// Number of far sides.
    pub fn receiver_count(&self) -> usize {
        self.receivers.len()
    }

    /// True if this far side has done with everything.
    pub fn is_done_with(&self, receiver: u64) -> bool {
        self.ended && self.receivers.get(&receiver).is_some_and(|known| known.done + 1 == self.next)
    }

    /// A far side that has done with everything was told that we know.
    pub fn told_over(&mut self, receiver: u64) {
        if let Some(known) = self.receivers.get_mut(&receiver) {
            known.told = true;
        }
    }

    /// True if the end was said and every far side has it and has heard that we know, or was given up.
    pub fn is_over(&mut self, now: Instant) -> bool {
        self.forget_done(now);
        let has_left = |known: &Receiver| {
            known.told || known.over.is_some_and(|since| now.duration_since(since) >= FAREWELL)
        };
        self.ended && self.receivers.values().all(has_left)
    }

    /// Counts rows that do not come.
    pub fn lose_rows(&mut self, count: u64) {
        self.rows_lost += count;
    }

    /// Rows that never came, or were left out because nobody fetched them in time.
    pub fn rows_lost(&self) -> u64 {
        self.rows_lost
    }

    /// Far sides that were given up.
    pub fn given_up(&self) -> u64 {
        self.given_up
    }
}

/// The value of a mutex; a thread that panicked has said why.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A log that threads share.
#[derive(Debug)]
pub struct SharedLog<P> {
    log: Mutex<Log<P>>,
    changed: Condvar,
}

impl<P: Clone> SharedLog<P> {
    /// As [`Log::new`].
    pub fn new(patience: Duration) -> Self {
        Self { log: Mutex::new(Log::new(patience)), changed: Condvar::new() }
    }

    /// Looks at it without changing anything that others wait for.
    pub fn look(&self) -> MutexGuard<'_, Log<P>> {
        lock(&self.log)
    }

    /// Changes it, and wakes those who wait.
    pub fn change<R>(&self, change: impl FnOnce(&mut Log<P>) -> R) -> R {
        let changed = change(&mut self.look());
        self.changed.notify_all();
        changed
    }

    /// Waits until `look` gives something, or for `at_most`.
    pub fn wait_for<R>(
        &self,
        at_most: Duration,
        mut look: impl FnMut(&mut Log<P>) -> Option<R>,
    ) -> Option<R> {
        let until = Instant::now() + at_most;
        let mut log = self.look();
        loop {
            if let Some(found) = look(&mut log) {
                return Some(found);
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return None;
            }
            log = self.changed.wait_timeout(log, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATIENCE: Duration = Duration::from_secs(30);

    fn log(states: u64, now: Instant) -> Log<u64> {
        let mut log = Log::new(PATIENCE);
        (1..=states).for_each(|n| log.push(Kind::Frames, n, 100, now));
        log
    }

    fn fetch(log: &Log<u64>, receiver: u64, mut have: u64) -> Vec<u64> {
        let mut all = Vec::new();
        while let Some(entry) = log.next_for(receiver, have) {
            have = entry.seq;
            all.push(have);
        }
        all
    }

    #[test]
    fn the_first_far_side_begins_with_the_first_state_a_later_one_with_the_last() {
        let now = Instant::now();
        let mut log = log(3, now);
        log.push(Kind::Rows(5), 4, 10, now);
        assert_eq!(log.join(7, now), 0);
        assert_eq!(fetch(&log, 7, 0), [1, 2, 3, 4]);
        assert_eq!(log.join(8, now), 2);
        assert_eq!(fetch(&log, 8, 2), [3, 4]);
    }

    #[test]
    fn what_was_sent_stays_until_it_is_done_with() {
        let now = Instant::now();
        let mut log = log(0, now);
        log.join(7, now);
        (1..=5).for_each(|n| log.push(Kind::Frames, n, 100, now));
        assert_eq!(fetch(&log, 7, 0), [1, 2, 3, 4, 5]);
        log.hear(7, Some(2), now);
        assert_eq!(fetch(&log, 7, 2), [3, 4, 5], "again, after a cut");
        log.hear(7, Some(5), now);
        assert_eq!(log.join(8, now), 4, "the last state stays for others");
    }

    #[test]
    fn no_more_than_a_window_is_under_way() {
        let now = Instant::now();
        let mut log = log(0, now);
        log.join(7, now);
        (1..=100).for_each(|n| log.push(Kind::Frames, n, 100, now));
        assert_eq!(fetch(&log, 7, 0).len(), WINDOW_MESSAGES);
        log.hear(7, Some(10), now);
        assert_eq!(fetch(&log, 7, 32).last(), Some(&42));
        log.push(Kind::Frames, 101, 2 * WINDOW_BYTES, now);
        log.hear(7, Some(99), now);
        assert_eq!(fetch(&log, 7, 99), [100], "what is larger than the window goes alone");
        log.hear(7, Some(100), now);
        assert_eq!(fetch(&log, 7, 100), [101]);
    }

    #[test]
    fn too_many_bytes_cost_states_first_come_and_rows_are_counted() {
        let now = Instant::now();
        let mut log = log(0, now);
        log.join(7, now);
        log.push(Kind::Rows(3), 1, 10, now);
        (2..=4).for_each(|n| log.push(Kind::Frames, n, MOST_BYTES / 2, now));
        assert_eq!(log.rows_lost(), 3);
        assert_eq!(log.next_for(7, 0).map(|entry| entry.seq), Some(3), "the next one that is there");
    }

    #[test]
    fn only_a_living_far_side_holds_a_run_back() {
        let now = Instant::now();
        let mut log = log(0, now);
        assert!(log.has_room(now));
        log.join(7, now);
        (1..=8).for_each(|n| log.push(Kind::Frames, n, 100, now));
        assert!(!log.has_room(now));
        log.hear(7, Some(1), now);
        assert!(log.has_room(now));
        log.push(Kind::Frames, 9, 100, now);
        assert!(!log.has_room(now) && log.has_room(now + PATIENCE));
        assert_eq!(log.given_up(), 1);
    }

    #[test]
    fn a_far_side_that_starts_again_holds_nothing_back_for_what_it_was() {
        let now = Instant::now();
        let mut log = log(0, now);
        log.join(7, now);
        (1..=8).for_each(|n| log.push(Kind::Frames, n, 100, now));
        assert_eq!(log.join(7, now), 7);
        assert!(log.has_room(now) && log.receiver_count() == 1);
    }

    #[test]
    fn it_is_over_when_everyone_has_the_end() {
        let now = Instant::now();
        let mut log = log(1, now);
        log.join(7, now);
        log.join(8, now);
        log.push(Kind::End, 2, 10, now);
        log.hear(8, Some(1), now);
        log.hear(7, Some(2), now);
        log.told_over(7);
        assert!(!log.is_over(now));
        log.hear(8, Some(2), now);
        assert!(!log.is_over(now), "8 has not heard that we know");
        assert!(log.is_over(now + FAREWELL), "it has left");
        log.told_over(8);
        assert!(log.is_over(now));
    }

    #[test]
    fn far_sides_beyond_the_room_cost_the_one_that_was_silent_for_longest() {
        let now = Instant::now();
        let mut log = log(1, now);
        log.join(7, now);
        log.join(8, now + Duration::from_millis(1));
        log.hear(7, None, now + Duration::from_millis(2));
        for stranger in 0..MOST_RECEIVERS as u64 - 1 {
            log.hear(100 + stranger, None, now + Duration::from_millis(3));
        }
        assert_eq!((log.receiver_count(), log.given_up()), (MOST_RECEIVERS, 1));
        assert!(log.receivers.contains_key(&7) && !log.receivers.contains_key(&8));
    }
}
