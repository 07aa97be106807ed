//! The near side: it answers requests.

use super::room::{Room, Turn};
use super::{
    ANSWER_TIME, Connections, DONE_KEY, Endpoint, KEY, Payload, WireError, listen, unless_stopped,
    zenoh_error,
};
use crate::log::{Log, SharedLog, lock};
use crate::message::{
    Done, GONE, Have, MessageError, OVER, Offer, Place, Request, Versions, Welcome, request, to_json,
};
use schemas::run_name::RunName;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};
use zenoh::Wait as _;
use zenoh::bytes::ZBytes;
use zenoh::query::Query;
use zenoh::sample::Sample;

/// Words about strangers that are kept until they are told: more of them say nothing new.
const MOST_TROUBLES: usize = 64;
/// Time for which an answer keeps its thread when there is nothing more to send.
const LINGER: Duration = Duration::from_millis(20);
/// Shortest wait before the requests that wait are looked at again, where all threads are taken.
const SHORTEST_LOOK: Duration = Duration::from_millis(1);
/// Longest wait before that.
const LONGEST_LOOK: Duration = Duration::from_millis(100);

/// A near side that listens.
pub struct Serving {
    shared: Arc<Shared>,
    _connections: Connections,
}

struct Shared {
    log: Arc<SharedLog<Payload>>,
    offered: Mutex<Offered>,
    /// Taken after the log, where both are.
    room: Mutex<Room<Asked>>,
    over: AtomicBool,
    /// Somebody asks for every frame.
    frames: AtomicBool,
    key: String,
}

#[derive(Default)]
struct Offered {
    run: Option<Run>,
    /// Somebody has asked.
    asked: bool,
    /// Messages that were no requests, and peers that were turned away.
    troubles: Vec<String>,
}

struct Run {
    manifest: String,
    stream: u64,
    /// It is recomputed, for which kernels must be the same.
    recomputed: bool,
}

/// A request that waits.
struct Asked {
    query: Query,
    what: What,
}

enum What {
    Run(Request),
    /// Messages after this one, for that far side.
    Messages {
        receiver: u64,
        have: Have,
    },
    /// Nothing that can be answered.
    Nonsense(String),
}

impl Serving {
    /// Listens at `endpoint` for requests for `run`, or for any run; none if `stop` is set before.
    ///
    /// # Errors
    /// When it cannot.
    pub fn start(
        endpoint: &Endpoint,
        config: Option<&Path>,
        run: Option<&RunName>,
        log: Arc<SharedLog<Payload>>,
        stop: &AtomicBool,
    ) -> Result<Option<Self>, WireError> {
        let (at, file) = (endpoint.clone(), config.map(Path::to_owned));
        let listening = unless_stopped(stop, move || listen(&at, file.as_deref()));
        let Some(session) = listening.transpose()? else { return Ok(None) };
        let key = format!("{KEY}/{}", run.map_or("any", RunName::as_str));
        let shared = Arc::new(Shared {
            log,
            offered: Mutex::default(),
            room: Mutex::new(Room::new()),
            over: AtomicBool::new(false),
            frames: AtomicBool::new(false),
            key: key.clone(),
        });
        let its = Arc::clone(&shared);
        thread::spawn(move || its.dispatch());
        let asked = Arc::clone(&shared);
        let queryable = session.declare_queryable(key).callback(move |query| asked.ask(query));
        queryable.background().wait().map_err(zenoh_error)?;
        let heard = Arc::clone(&shared);
        let subscriber = session.declare_subscriber(DONE_KEY).callback(move |sample| heard.hear(&sample));
        subscriber.background().wait().map_err(zenoh_error)?;
        Ok(Some(Self { shared, _connections: session }))
    }

    /// True if somebody has asked for the run.
    pub fn is_asked(&self) -> bool {
        lock(&self.shared.offered).asked
    }

    /// True if somebody wants every frame.
    pub fn wants_frames(&self) -> bool {
        self.shared.frames.load(Ordering::Relaxed)
    }

    /// Offers a run; `recomputed` where the other side's kernel matters.
    pub fn offer(&self, manifest: String, stream: u64, recomputed: bool) {
        lock(&self.shared.offered).run = Some(Run { manifest, stream, recomputed });
        self.shared.wake();
    }

    /// Messages that were no requests, and peers that were turned away, since the last call.
    pub fn take_troubles(&self) -> Vec<String> {
        std::mem::take(&mut lock(&self.shared.offered).troubles)
    }

    /// Leaves when the answers under way have ended, or `stop` is set.
    pub fn stop(self, stop: &AtomicBool) {
        let start = Instant::now();
        while lock(&self.shared.room).answering() > 0
            && start.elapsed() < ANSWER_TIME
            && !stop.load(Ordering::Relaxed)
        {
            thread::sleep(Duration::from_millis(5));
        }
        self.shared.over.store(true, Ordering::Relaxed);
        self.shared.wake();
    }
}

impl Shared {
    /// Wakes the answers that wait for a message.
    fn wake(&self) {
        self.log.change(|_| ());
    }

    /// Lets a request wait; in a thread of Zenoh's, which must not.
    fn ask(&self, query: Query) {
        let bytes = query.payload().map(ZBytes::to_bytes).unwrap_or_default();
        let what =
            match request::<Request>(&bytes).and_then(|asked| asked.versions.check(false).map(|()| asked)) {
                Ok(request) => match request.have {
                    None => {
                        self.frames.fetch_or(request.frames, Ordering::Relaxed);
                        lock(&self.offered).asked = true;
                        What::Run(request)
                    }
                    Some(have) => {
                        self.hear_of(request.receiver, request.frames, Have { seq: request.done, ..have });
                        What::Messages { receiver: request.receiver, have }
                    }
                },
                Err(error) => What::Nonsense(error.to_string()),
            };
        // whoever gives way asks again
        let given_way = lock(&self.room).enter(Asked { query, what }, Instant::now() + ANSWER_TIME);
        self.wake();
        drop(given_way);
    }

    /// A far side is there, and has done with all messages up to that one.
    fn hear_of(&self, receiver: u64, frames: bool, done: Have) {
        if self.stream() == Some(done.stream) {
            self.frames.fetch_or(frames, Ordering::Relaxed);
            self.log.change(|log| log.hear(receiver, Some(done.seq), Instant::now()));
        }
    }

    fn stream(&self) -> Option<u64> {
        lock(&self.offered).run.as_ref().map(|run| run.stream)
    }

    /// Answers requests when there is something to say, or their time is over.
    fn dispatch(self: Arc<Self>) {
        while !self.over.load(Ordering::Relaxed) {
            let end = lock(&self.room).first_end();
            let at_most = end.map_or(LONGEST_LOOK, |end| end.saturating_duration_since(Instant::now()));
            let turn = self.log.wait_for(at_most.clamp(SHORTEST_LOOK, LONGEST_LOOK), |log| {
                let stream = self.stream();
                lock(&self.room).next(Instant::now(), |asked| asked.what.has_news(log, stream))
            });
            let Some(turn) = turn else { continue };
            let it = Arc::clone(&self);
            let started = thread::Builder::new().name("relay".into()).spawn(move || {
                let left = it.answer(turn);
                let mut room = lock(&it.room);
                room.answered();
                let given_way = left.and_then(|turn| room.enter(turn.asked, turn.until));
                drop(room);
                it.wake();
                drop(given_way);
            });
            if started.is_err() {
                // whoever asked asks again
                lock(&self.room).answered();
            }
        }
    }

    /// Answers a request; gives it back if more may be said before its time is over.
    fn answer(&self, turn: Turn<Asked>) -> Option<Turn<Asked>> {
        let query = &turn.asked.query;
        match &turn.asked.what {
            What::Run(request) => {
                if let Err(error) = self.welcome(query, request) {
                    self.refuse(query, error.to_string());
                }
                None
            }
            What::Messages { receiver, have } => {
                let (receiver, have) = (*receiver, *have);
                let have = self.send(query, receiver, have, turn.until)?;
                let asked = Asked { query: turn.asked.query, what: What::Messages { receiver, have } };
                Some(Turn { asked, until: turn.until })
            }
            What::Nonsense(said) => {
                self.refuse(query, said.clone());
                None
            }
        }
    }

    /// Tells the other side its state as seen from here.
    fn refuse(&self, query: &Query, said: String) {
        let _ = query.reply_err(said.clone()).wait();
        let mut offered = lock(&self.offered);
        if offered.troubles.len() < MOST_TROUBLES {
            offered.troubles.push(said);
        }
    }

    /// Offers the run, if it is there.
    fn welcome(&self, query: &Query, request: &Request) -> Result<(), MessageError> {
        let run = match &lock(&self.offered).run {
            Some(run) => {
                request.versions.check(run.recomputed && !request.frames)?;
                Some((run.manifest.clone(), run.stream, !run.recomputed))
            }
            None => None,
        };
        let asked = self.frames.load(Ordering::Relaxed);
        let run = run.map(|(manifest, stream, sent)| {
            let frames = sent || asked;
            let seq = self.log.change(|log| log.join(request.receiver, Instant::now()));
            Offer { manifest, have: Have { stream, seq }, frames }
        });
        let welcome = Welcome { versions: Versions::OURS, run };
        // whoever asked is gone, or asks again
        let _ = query.reply(&self.key, to_json(&welcome)).wait();
        Ok(())
    }

    /// Sends the messages after `have`; returns the last message that the far side then has, if more may come.
    fn send(&self, query: &Query, receiver: u64, have: Have, until: Instant) -> Option<Have> {
        if self.stream() != Some(have.stream) {
            let _ = query.reply_err(GONE).wait();
            return None;
        }
        let mut seq = have.seq;
        let is_over = loop {
            let next = self.log.wait_for(LINGER, |log| match log.next_for(receiver, seq) {
                Some(entry) => Some(Some((entry, log.rows_lost()))),
                None => log.is_done_with(receiver).then_some(None),
            });
            let now = Instant::now();
            match next {
                Some(Some((entry, rows_lost))) => {
                    let age_ms = u64::try_from(entry.at.elapsed().as_millis()).unwrap_or(u64::MAX);
                    let place = Place { seq: entry.seq, after: seq, rows_lost, age_ms };
                    let reply = query.reply(&self.key, entry.payload).attachment(place.encode());
                    reply.wait().ok()?;
                    seq = entry.seq;
                    // others wait for a thread, too
                    if now >= until {
                        break false;
                    }
                }
                Some(None) => break true,
                None if now >= until => break false,
                None => return Some(Have { seq, ..have }),
            }
        };
        // nothing new: the other side sees that we live
        let alive = Place { seq, after: seq, rows_lost: self.log.look().rows_lost(), age_ms: 0 };
        let word = if is_over { ZBytes::from(OVER) } else { ZBytes::new() };
        let said = query.reply(&self.key, word).attachment(alive.encode()).wait().is_ok();
        if is_over && said {
            self.log.change(|log| log.told_over(receiver));
        }
        None
    }

    /// A far side reports the messages that it has done with.
    fn hear(&self, sample: &Sample) {
        if let Ok(done) = request::<Done>(&sample.payload().to_bytes()) {
            self.hear_of(done.receiver, false, done.have);
        }
    }
}

impl What {
    /// True if there is something to say.
    fn has_news(&self, log: &Log<Payload>, stream: Option<u64>) -> bool {
        match self {
            Self::Run(_) => stream.is_some(),
            Self::Messages { receiver, have } => {
                stream != Some(have.stream)
                    || log.next_for(*receiver, have.seq).is_some()
                    || log.is_done_with(*receiver)
            }
            Self::Nonsense(_) => true,
        }
    }
}
