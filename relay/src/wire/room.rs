//! Requests that wait until there is something to say. The room is bounded: the request that waits in vain for longest
//! gives way, so that silent ones keep nobody out.
//!
//! Decided without a transport and without a clock: times are passed in.

use std::collections::VecDeque;
use std::time::Instant;

/// Most requests that wait; each takes some kilobytes.
const MOST_WAITING: usize = 1024;
/// Most requests that are being answered at a time; each takes a thread.
const MOST_ANSWERING: usize = 64;

/// Requests of a near side.
#[derive(Debug)]
pub(super) struct Room<T> {
    /// With the end of its time, the one that waits for longest first.
    waiting: VecDeque<(T, Instant)>,
    answering: usize,
}

/// A request whose turn it is.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Turn<T> {
    /// The request.
    pub(super) asked: T,
    /// The end of its time.
    pub(super) until: Instant,
}

impl<T> Room<T> {
    pub(super) fn new() -> Self {
        Self { waiting: VecDeque::new(), answering: 0 }
    }

    /// Lets a request wait until then; gives the one that gives way, if there is no room for both.
    pub(super) fn enter(&mut self, asked: T, until: Instant) -> Option<T> {
        let oldest = if self.waiting.len() >= MOST_WAITING { self.waiting.pop_front() } else { None };
        self.waiting.push_back((asked, until));
        oldest.map(|(asked, _)| asked)
    }

    /// The first request for which there is something to say or whose time is over, if one more can be answered.
    pub(super) fn next(&mut self, now: Instant, mut has_news: impl FnMut(&T) -> bool) -> Option<Turn<T>> {
        if self.answering >= MOST_ANSWERING {
            return None;
        }
        let at = self.waiting.iter().position(|(asked, until)| *until <= now || has_news(asked))?;
        let (asked, until) = self.waiting.remove(at)?;
        self.answering += 1;
        Some(Turn { asked, until })
    }

    /// When the first request's time is over.
    pub(super) fn first_end(&self) -> Option<Instant> {
        self.waiting.iter().map(|(_, until)| *until).min()
    }

    /// A request was answered.
    pub(super) fn answered(&mut self) {
        self.answering -= 1;
    }

    /// Number of requests that are being answered.
    pub(super) fn answering(&self) -> usize {
        self.answering
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const TIME: Duration = Duration::from_millis(500);

    #[test]
    fn whoever_waits_in_vain_for_longest_gives_way() {
        let now = Instant::now();
        let mut room = Room::new();
        for n in 0..MOST_WAITING {
            assert_eq!(room.enter(n, now + TIME), None);
        }
        assert_eq!(room.enter(7777, now + TIME), Some(0));
        let turn = room.next(now, |n| *n == 7777).unwrap();
        assert_eq!(turn, Turn { asked: 7777, until: now + TIME });
    }

    #[test]
    fn a_turn_comes_with_news_or_with_the_end_of_the_time() {
        let now = Instant::now();
        let mut room = Room::new();
        room.enter("late", now + 2 * TIME);
        room.enter("soon", now + TIME);
        assert_eq!(room.first_end(), Some(now + TIME));
        assert!(room.next(now, |_| false).is_none());
        assert_eq!(room.next(now + TIME, |_| false).unwrap().asked, "soon");
        assert_eq!(room.next(now + TIME, |_| true).unwrap().asked, "late");
    }

    #[test]
    fn no_more_are_answered_at_a_time_than_there_are_threads_for() {
        let now = Instant::now();
        let mut room = Room::new();
        (0..=MOST_ANSWERING).for_each(|n| assert!(room.enter(n, now).is_none()));
        (0..MOST_ANSWERING).for_each(|n| assert_eq!(room.next(now, |_| true).unwrap().asked, n));
        assert!(room.next(now, |_| true).is_none());
        room.answered();
        assert_eq!(room.next(now, |_| true).unwrap().asked, MOST_ANSWERING);
    }
}
