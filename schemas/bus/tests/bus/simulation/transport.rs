//! What iceoryx2 does, as far as delivery depends on it: queues of bounded size that are connected from both sides,
//! requests and answers, a board, wake-ups that may be missed, and a registry in which the dead stay until they are
//! cleaned up. `traps.rs` shows the same of iceoryx2 itself.

use bus::{Delivery, JoinAnswer, JoinRequest, RunStatus, StateHeader, StreamId};
use std::collections::VecDeque;
use std::fmt::Write as _;
use std::time::{Duration, Instant};

/// Numbers that a seed decides: splitmix64.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % n
    }

    pub(super) fn one_in(&mut self, n: u64) -> bool {
        self.below(n) == 0
    }

    pub(super) fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len() as u64) as usize]
    }
}

/// What one producer has sent to one subscriber.
pub(super) struct Queue {
    pub(super) stream: u64,
    /// The subscriber has connected its side; until then what does not fit is lost in silence.
    connected: bool,
    pub(super) samples: VecDeque<StateHeader>,
    /// The frames that were ever put into it, a bit each.
    pub(super) pushed: u128,
}

pub(super) struct Subscriber {
    pub(super) delivery: Delivery,
    capacity: usize,
    /// In the registry: the dead are until they are cleaned up.
    pub(super) listed: bool,
    pub(super) died_at: Option<Instant>,
    /// When it last took a sample.
    pub(super) took_at: Instant,
    pub(super) evicted: bool,
    pub(super) answer: Option<JoinAnswer>,
    /// The chain comes when the producer updates its connections.
    pub(super) has_chain: bool,
    /// A notification has come.
    pub(super) rung: bool,
    queues: Vec<Queue>,
}

/// What processes share, and what is true of it.
pub(super) struct World {
    pub(super) random: Random,
    pub(super) now: Instant,
    begin: Instant,
    pub(super) subscribers: Vec<Subscriber>,
    /// The stream whose producer lives, and the one whose publisher is in the registry.
    pub(super) alive: Option<u64>,
    pub(super) publisher: Option<u64>,
    /// The requests that the server has not taken; none without a server.
    pub(super) requests: Option<VecDeque<JoinRequest>>,
    pub(super) status: RunStatus,
    pub(super) previous: RunStatus,
    /// When, what, and how often in a row.
    trace: Option<Vec<(Duration, String, u32)>>,
}

impl World {
    pub(super) fn new(seed: u64, traced: bool) -> Self {
        let begin = Instant::now();
        Self {
            random: Random(seed),
            now: begin,
            begin,
            subscribers: Vec::new(),
            alive: None,
            publisher: None,
            requests: None,
            status: RunStatus::default(),
            previous: RunStatus::default(),
            trace: traced.then(Vec::new),
        }
    }

    pub(super) fn note(&mut self, what: impl FnOnce() -> String) {
        let Some(trace) = &mut self.trace else { return };
        let what = what();
        match trace.last_mut() {
            Some((_, before, count)) if *before == what => *count += 1,
            _ => trace.push((self.now.duration_since(self.begin), what, 1)),
        }
    }

    pub(super) fn trace(self) -> String {
        let mut text = String::new();
        for (at, what, count) in self.trace.unwrap_or_default() {
            let times = if count > 1 { format!(" ({count} times)") } else { String::new() };
            let _ = writeln!(text, "{:>9} us  {what}{times}", at.as_micros());
        }
        text
    }

    /// Time passes, once in a while a lot of it.
    pub(super) fn pass(&mut self) {
        let most_us = if self.random.one_in(16) { 20_000 } else { 50 };
        self.now += Duration::from_micros(self.random.below(most_us));
    }

    pub(super) fn is_alive(&self, status: &RunStatus) -> bool {
        self.alive == Some(status.stream_id)
    }

    pub(super) fn status_of(&self, stream: StreamId) -> Option<RunStatus> {
        [self.status, self.previous].into_iter().find(|status| status.stream_id == stream.stream_id)
    }

    pub(super) fn subscribe(&mut self, delivery: Delivery, capacity: usize) -> usize {
        self.subscribers.push(Subscriber {
            delivery,
            capacity: if delivery == Delivery::Latest { capacity.min(2) } else { capacity },
            listed: true,
            died_at: None,
            took_at: self.now,
            evicted: false,
            answer: None,
            has_chain: false,
            rung: false,
            queues: Vec::new(),
        });
        self.subscribers.len() - 1
    }

    pub(super) fn listed(&self) -> Vec<usize> {
        (0..self.subscribers.len()).filter(|id| self.subscribers[*id].listed).collect()
    }

    /// Takes the dead out of the registry.
    pub(super) fn clean(&mut self) {
        for subscriber in &mut self.subscribers {
            subscriber.listed &= subscriber.died_at.is_none();
        }
        if self.publisher != self.alive {
            self.publisher = None;
        }
    }

    /// Notifies every subscriber; some do not hear it.
    pub(super) fn ring(&mut self) {
        for subscriber in &mut self.subscribers {
            subscriber.rung |= !self.random.one_in(4);
        }
    }

    pub(super) fn queue(&mut self, id: usize, stream: u64) -> &mut Queue {
        let queues = &mut self.subscribers[id].queues;
        let at = queues.iter().position(|queue| queue.stream == stream).unwrap_or_else(|| {
            queues.push(Queue { stream, connected: false, samples: VecDeque::new(), pushed: 0 });
            queues.len() - 1
        });
        &mut queues[at]
    }

    /// The subscriber's side of a connection.
    pub(super) fn connect(&mut self, id: usize) {
        if let Some(stream) = self.publisher {
            self.queue(id, stream).connected = true;
        }
    }

    pub(super) fn take(&mut self, id: usize) -> Option<StateHeader> {
        self.connect(id);
        let subscriber = &mut self.subscribers[id];
        // what an earlier producer has left comes first
        let taken = subscriber
            .queues
            .iter_mut()
            .filter(|queue| queue.connected)
            .find_map(|queue| queue.samples.pop_front());
        if taken.is_some() {
            subscriber.took_at = self.now;
        }
        taken
    }

    /// Puts a sample into a queue, if there is room.
    pub(super) fn push(&mut self, id: usize, sample: StateHeader) -> bool {
        let capacity = self.subscribers[id].capacity;
        let queue = self.queue(id, sample.stream_id);
        let fits = queue.samples.len() < capacity;
        if fits {
            queue.samples.push_back(sample);
            queue.pushed |= 1 << sample.frame;
        }
        fits
    }

    /// Whether a publisher that finds no room asks what to do.
    pub(super) fn is_connected(&mut self, id: usize, stream: u64) -> bool {
        self.subscribers[id].listed && self.queue(id, stream).connected
    }
}
