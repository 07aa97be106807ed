//! A producer: the calls of `StatePublisher`, in its order. Between any two of them others have their turns.

use super::consumer::{Consumer, Truth};
use super::transport::World;
use bus::delivery::{Full, Holding, Publishing, Repeats, Verdict};
use bus::{Delivery, Remedies, RunStatus, STATE_DONE, STATE_INTERRUPTED, StateHeader};
use schemas::frame::EndReason;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

pub(super) const STUCK_AFTER: Duration = Duration::from_millis(300);
/// By then a dead consumer is cleaned up, a stopped producer through: 100 ms and 250 ms, and what a step may take.
const CLEANED_AFTER: Duration = Duration::from_millis(250);
const STOPPED_AFTER: Duration = Duration::from_millis(400);
/// More than any schedule needs.
const MOST_STEPS: u64 = 100_000;

/// Why a producer does not go on.
pub(super) enum Halt {
    Died,
    Broken(String),
}

/// Why a send failed.
enum Failed {
    Halt(Halt),
    /// A signal came.
    Interrupted,
    /// We were asked to stop.
    GivenUp,
}

impl From<Halt> for Failed {
    fn from(halt: Halt) -> Self {
        Self::Halt(halt)
    }
}

pub(super) struct Schedule {
    pub(super) world: World,
    pub(super) consumers: Vec<Consumer>,
    /// Of each stream, and of none.
    pub(super) truths: Vec<Truth>,
    pub(super) remedies: Remedies,
    /// How many turns of others there are between two of the producer, at the most.
    bustle: u64,
    /// In how many turns it dies, is stopped, or a signal comes, on average.
    deadliness: u64,
    stop_odds: u64,
    signal_odds: u64,
    /// How many signals are still to come: each may give a stuck consumer its time anew.
    signals: u64,
    stopped_at: Option<Instant>,
    steps: u64,
}

impl Schedule {
    pub(super) fn new(seed: u64, remedies: Remedies, traced: bool) -> Self {
        let mut world = World::new(seed, traced);
        let capacity = world.random.pick(&[1, 2, 3, 8]);
        let count = 1 + world.random.below(4) as usize;
        let consumers = (0..count).map(|name| Consumer::new(name, capacity, &mut world)).collect();
        let random = &mut world.random;
        Self {
            consumers,
            truths: vec![Truth::default()],
            remedies,
            bustle: random.pick(&[2, 4, 16]),
            deadliness: random.pick(&[30, 300, u64::MAX]),
            stop_odds: random.pick(&[100, 1000, u64::MAX]),
            signal_odds: random.pick(&[3, 100, u64::MAX]),
            signals: 16,
            stopped_at: None,
            steps: 0,
            world,
        }
    }

    /// Producers of one name come and go, and then everybody reads to the end.
    pub(super) fn run(&mut self) -> Result<(), String> {
        for stream in 1..=self.world.random.pick(&[1, 1, 2, 3]) {
            match self.publish(stream) {
                Ok(()) => self.world.publisher = None,
                Err(Halt::Died) => self.world.note(|| format!("producer {stream} dies")),
                Err(Halt::Broken(what)) => return Err(what),
            }
            (self.world.alive, self.world.requests) = (None, None);
            self.rest(2000)?;
        }
        while self.consumers.iter().any(|consumer| !consumer.is_gone()) {
            self.turn(true)?;
            if !self.consumers.iter().any(|consumer| !consumer.is_gone() && consumer.is_awake(&self.world)) {
                let asleep = self.consumers.iter().filter(|consumer| !consumer.is_gone());
                self.world.now = asleep.map(|consumer| consumer.wakes_at).min().unwrap_or(self.world.now);
            }
        }
        Ok(())
    }

    /// A turn of somebody else.
    fn turn(&mut self, over: bool) -> Result<(), String> {
        self.steps += 1;
        if self.steps > MOST_STEPS {
            return Err("somebody waits for ever".into());
        }
        let who = self.world.random.below(self.consumers.len() as u64) as usize;
        let consumer = &mut self.consumers[who];
        if !consumer.is_gone() && consumer.is_awake(&self.world) {
            consumer.step(&mut self.world, &self.truths, over)?;
        }
        Ok(())
    }

    /// The producer does nothing for so many milliseconds at the most.
    fn rest(&mut self, most_ms: u64) -> Result<(), String> {
        let pause = Duration::from_millis(self.world.random.below(most_ms));
        let until = self.world.now + pause;
        while self.world.now < until {
            for _ in 0..self.bustle {
                self.turn(false)?;
            }
            self.world.now += (pause / 8).max(Duration::from_micros(100));
        }
        Ok(())
    }

    /// Turns of others, between two steps of the producer.
    fn others(&mut self) -> Result<(), Halt> {
        for _ in 0..self.world.random.below(self.bustle) {
            self.turn(false).map_err(Halt::Broken)?;
        }
        self.world.pass();
        if self.stopped_at.is_none() && self.world.random.one_in(self.stop_odds) {
            self.stopped_at = Some(self.world.now);
            self.world.note(|| "producer is asked to stop".into());
        }
        if self.world.random.one_in(self.deadliness) { Err(Halt::Died) } else { Ok(()) }
    }

    /// One producer, from its start to its end.
    fn publish(&mut self, stream: u64) -> Result<(), Halt> {
        self.stopped_at = None;
        self.truths.push(Truth::default());
        self.world.alive = Some(stream);
        self.world.clean();
        let mut producer = Producer::new(stream, self);
        producer.holding.ignore(self.world.listed().into_iter().map(|id| id as u128));
        self.others()?;
        self.world.publisher = Some(stream);
        self.world.requests = Some(VecDeque::new());
        self.others()?;
        self.world.previous = self.world.status;
        self.others()?;
        self.world.status = *producer.publishing.status();
        for _ in 0..self.world.random.below(8) {
            self.rest(20).map_err(Halt::Broken)?;
            producer.serve_joins(self)?;
        }
        let frames = self.world.random.below(40);
        let mut end = EndReason::Complete;
        for frame in 0..frames {
            if self.stopped_at.is_some() || !producer.accept(frame, frame + 1 == frames, self)? {
                end = EndReason::Interrupted;
                break;
            }
            if self.world.random.one_in(8) {
                let most_ms = self.world.random.pick(&[1, 10, 700]);
                self.rest(most_ms).map_err(Halt::Broken)?;
                producer.serve(self)?;
            }
        }
        producer.finish(end, self)
    }
}

struct Producer {
    stream: u64,
    publishing: Publishing,
    holding: Holding,
    /// The subscribers that have joined it.
    joined: Vec<usize>,
    /// Subscribers before this one were there before it.
    first_own: usize,
}

impl Producer {
    fn new(stream: u64, schedule: &Schedule) -> Self {
        let status = RunStatus { stream_id: stream, ..RunStatus::default() };
        Self {
            stream,
            publishing: Publishing::new(status, schedule.world.now),
            holding: Holding::new(STUCK_AFTER),
            joined: Vec::new(),
            first_own: schedule.world.subscribers.len(),
        }
    }

    fn serve_joins(&mut self, on: &mut Schedule) -> Result<(), Halt> {
        while let Some(request) = on.world.requests.as_mut().and_then(VecDeque::pop_front) {
            let id = u128::from_le_bytes(request.subscriber_id) as usize;
            let asked = self.publishing.asked(request, |id| on.world.subscribers[id as usize].listed);
            let remembered = self.publishing.ready().len();
            if remembered > on.consumers.len() {
                return Err(Halt::Broken(format!("{remembered} consumers are remembered")));
            }
            on.world.note(|| format!("producer answers {id}: {asked:?}"));
            if asked.connect && on.remedies.connect_on_join {
                on.others()?;
                on.world.subscribers[id].has_chain = true;
            }
            if asked.joined {
                self.holding.joined(id as u128);
                on.world.subscribers[id].evicted = false;
                self.joined.push(id);
                if asked.answer.first_frame != on.truths[self.stream as usize].published {
                    return Err(Halt::Broken("another first frame than the next".into()));
                }
            }
            on.others()?;
            on.world.subscribers[id].answer = Some(asked.answer);
            on.world.ring();
        }
        Ok(())
    }

    /// As `StatePublisher::serve`.
    fn serve(&mut self, on: &mut Schedule) -> Result<(), Halt> {
        self.serve_joins(on)?;
        if self.publishing.has_news() {
            on.world.ring();
            self.publishing.woke(on.world.now);
        }
        on.others()?;
        on.world.status = *self.publishing.status();
        Ok(())
    }

    /// As `StatePublisher::accept`; whether the frame was sent.
    fn accept(&mut self, frame: u64, is_last: bool, on: &mut Schedule) -> Result<bool, Halt> {
        self.serve_joins(on)?;
        let now = on.world.now;
        let rings = self.publishing.rings(now);
        if self.publishing.offers(on.world.listed().len(), is_last, now) {
            on.world.note(|| format!("producer sends {frame}"));
            match self.send(frame, on) {
                Ok(recipients) => self.publishing.offered(recipients, now),
                Err(Failed::Halt(halt)) => return Err(halt),
                Err(Failed::GivenUp) => return Ok(false),
                Err(Failed::Interrupted) => return Err(Halt::Broken("a signal ended the run".into())),
            }
        }
        self.publishing.published(frame, 0.0);
        on.truths[self.stream as usize].published = self.publishing.next_frame();
        if rings {
            on.others()?;
            on.world.ring();
            self.publishing.woke(on.world.now);
            on.others()?;
            on.world.status = *self.publishing.status();
        }
        Ok(true)
    }

    fn finish(mut self, end: EndReason, on: &mut Schedule) -> Result<(), Halt> {
        on.others()?;
        let state = if end == EndReason::Complete { STATE_DONE } else { STATE_INTERRUPTED };
        self.publishing.status().state = state;
        on.world.status = *self.publishing.status();
        on.truths[self.stream as usize].end = Some(end);
        on.world.note(|| format!("producer ends: {end:?}"));
        on.others()?;
        on.world.ring();
        Ok(())
    }

    /// As `Backpressure::repeat`.
    fn send(&mut self, frame: u64, on: &mut Schedule) -> Result<usize, Failed> {
        let (mut repeats, mut repeated) = (Repeats::default(), false);
        loop {
            let mut waited = false;
            let sent = self.send_once(frame, repeated, &mut waited, on);
            let interrupted = matches!(sent, Err(Failed::Interrupted)) && on.remedies.resend;
            if !interrupted || !repeats.once_more(waited, on.stopped_at.is_some()) {
                return sent;
            }
            repeated = true;
            self.holding.repeats();
        }
    }

    /// As iceoryx2: to one connection after the other.
    fn send_once(
        &mut self,
        frame: u64,
        repeats: bool,
        waited: &mut bool,
        on: &mut Schedule,
    ) -> Result<usize, Failed> {
        let sample = StateHeader { stream_id: self.stream, frame, ..StateHeader::default() };
        let (mut recipients, mut failed) = (0, false);
        for id in on.world.listed() {
            let mut is_first = true;
            loop {
                on.others()?;
                if !on.world.subscribers[id].listed {
                    break;
                }
                if on.world.push(id, sample) {
                    recipients += 1;
                    break;
                }
                if !on.world.is_connected(id, self.stream) {
                    break;
                }
                match self.judge(id, is_first, repeats, on)? {
                    Verdict::Wait { clean } => {
                        *waited = true;
                        if clean && on.remedies.clean_while_blocked {
                            on.world.clean();
                        }
                        if is_first {
                            on.world.ring();
                        }
                        if on.signals > 0 && on.world.random.one_in(on.signal_odds) {
                            on.signals -= 1;
                            return Err(Failed::Interrupted);
                        }
                        is_first = false;
                    }
                    verdict => {
                        failed |= verdict == Verdict::GiveUp;
                        on.others()?;
                        // there may be room by now
                        recipients += usize::from(verdict != Verdict::GiveUp && on.world.push(id, sample));
                        break;
                    }
                }
            }
        }
        if failed { Err(Failed::GivenUp) } else { Ok(recipients) }
    }

    /// As `Backpressure::decide`: nobody is waited for who need not be.
    fn judge(
        &mut self,
        id: usize,
        is_first: bool,
        repeats: bool,
        on: &mut Schedule,
    ) -> Result<Verdict, Halt> {
        let now = on.world.now;
        let subscriber = &mut on.world.subscribers[id];
        let (delivery, died_at, took_at) = (subscriber.delivery, subscriber.died_at, subscriber.took_at);
        let stopping = on.stopped_at.is_some();
        let full =
            Full { id: id as u128, delivery: Some(delivery), is_first, repeats, stopping, ending: false };
        let verdict = self.holding.judge(&full, now);
        subscriber.evicted |= matches!(verdict, Verdict::Evict(_));
        on.world.note(|| format!("producer finds no room at {id}: {verdict:?}"));
        let since = |at: Option<Instant>| at.map_or(Duration::ZERO, |at| now.duration_since(at));
        let wrong = match verdict {
            Verdict::Evict(_) if since(died_at) >= CLEANED_AFTER => {
                "a dead consumer was dropped, not cleaned up"
            }
            Verdict::Evict(_) if since(Some(took_at)) < STUCK_AFTER => {
                "a consumer was dropped that takes frames"
            }
            Verdict::Wait { .. } if id < self.first_own && !self.joined.contains(&id) => {
                "a consumer of an earlier producer holds the run back"
            }
            Verdict::Wait { .. } if delivery == Delivery::Latest => "a latest consumer holds the run back",
            Verdict::Wait { .. } if since(on.stopped_at) >= STOPPED_AFTER => "a stopped producer waits",
            Verdict::GiveUp if !stopping => "a producer gives up that nobody stopped",
            _ => return Ok(verdict),
        };
        Err(Halt::Broken(format!("{wrong}: {} {id}", delivery.as_str())))
    }
}
