//! The far side: asks, and asks again.

use super::{ANSWER_PATIENCE, DONE_KEY, Endpoint, KEY, Payload, WireError, connect, zenoh_error};
use crate::message::{Done, Have, Offer, Place, Request, Versions, Welcome, answer, to_json};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};
use zenoh::handlers::{FifoChannel, FifoChannelHandler};
use zenoh::qos::CongestionControl;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::{Session, Wait as _};

/// Most answers that wait in Zenoh, more than the near side sends ahead.
const MOST_ANSWERS: usize = 64;
/// Messages that wait for us, each as it came.
const MOST_WAITING: usize = 4;
/// How often the near side hears from us.
const HEARTBEAT: Duration = Duration::from_millis(250);
/// A pause before asking again where nobody answers.
const PAUSE: Duration = Duration::from_millis(50);

/// What has arrived.
#[derive(Debug)]
pub enum Arrival {
    /// A message of the run.
    Message(Place, Payload),
    /// Nothing can come any more.
    Failed(WireError),
}

/// A far side that is connected.
pub struct Fetching {
    session: Session,
    /// The run.
    pub offer: Offer,
    shared: Arc<Shared>,
    arrivals: Receiver<Arrival>,
}

struct Shared {
    receiver: u64,
    stream: u64,
    /// All messages up to this one have been published.
    done: AtomicU64,
    told: Mutex<bool>,
    change: Condvar,
    over: AtomicBool,
    frames: AtomicBool,
    /// When the near side was heard last.
    heard: Mutex<Instant>,
}

/// What a far side waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Waiting {
    /// Nothing listens there.
    Nobody,
    /// The other side has no run yet.
    NoRun,
}

impl Fetching {
    /// Connects to the near side at `endpoint` and asks for its run; waits for both until `stop` is set, which gives none.
    ///
    /// # Errors
    /// When the other side is none, or another version, or refuses us.
    pub fn start(
        endpoint: &Endpoint,
        config: Option<&Path>,
        receiver: u64,
        frames: bool,
        stop: &AtomicBool,
        mut tell: impl FnMut(Waiting),
    ) -> Result<Option<Self>, WireError> {
        let mut session = None;
        let offer = loop {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let Some(session) = &session else {
                session = connect(endpoint, config)?;
                if session.is_none() {
                    tell(Waiting::Nobody);
                    thread::sleep(2 * PAUSE);
                }
                continue;
            };
            let request = Request { versions: Versions::OURS, receiver, frames, have: None, done: 0 };
            match hello(session, &request)? {
                Some(Welcome { run: Some(offer), .. }) => break offer,
                Some(Welcome { run: None, .. }) => tell(Waiting::NoRun),
                None => thread::sleep(PAUSE),
            }
        };
        let Some(session) = session else { return Ok(None) };
        let shared = Arc::new(Shared {
            receiver,
            stream: offer.have.stream,
            done: AtomicU64::new(offer.have.seq),
            told: Mutex::default(),
            change: Condvar::new(),
            over: AtomicBool::new(false),
            frames: AtomicBool::new(frames),
            heard: Mutex::new(Instant::now()),
        });
        let (sender, arrivals) = sync_channel(MOST_WAITING);
        let (asking, its) = (session.clone(), Arc::clone(&shared));
        let seq = offer.have.seq;
        thread::spawn(move || {
            let fetched = its.fetch(&asking, seq, &sender);
            // whoever listened is gone
            let _ = fetched.map_err(|error| sender.send(Arrival::Failed(error)));
        });
        let (telling, its) = (session.clone(), Arc::clone(&shared));
        thread::spawn(move || its.beat(&telling));
        Ok(Some(Self { session, offer, shared, arrivals }))
    }

    /// What arrives next, within this time.
    pub fn next(&self, patience: Duration) -> Option<Arrival> {
        match self.arrivals.recv_timeout(patience) {
            Ok(arrival) => Some(arrival),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                Some(Arrival::Failed(WireError::Zenoh("nobody asks any more".to_owned())))
            }
        }
    }

    /// All messages up to this one have been published.
    pub fn done(&self, seq: u64) {
        if self.shared.done.swap(seq, Ordering::Relaxed) != seq {
            self.shared.wake();
        }
    }

    /// Asks for every frame from now on.
    pub fn ask_for_frames(&self) {
        self.shared.frames.store(true, Ordering::Relaxed);
    }

    /// How long the near side has been silent.
    pub fn silence(&self) -> Duration {
        self.shared.heard.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
    }

    /// Leaves; the near side, if it is there, has heard what was done last.
    ///
    /// # Errors
    /// When the connection cannot be closed.
    pub fn stop(self) -> Result<(), WireError> {
        let start = Instant::now();
        let request = self.shared.request(self.shared.done.load(Ordering::Relaxed));
        while start.elapsed() < ANSWER_PATIENCE && self.silence() < ANSWER_PATIENCE {
            if get(&self.session, &request)?.iter().any(|reply| reply.result().is_ok()) {
                break;
            }
            thread::sleep(PAUSE);
        }
        self.shared.over.store(true, Ordering::Relaxed);
        self.shared.wake();
        self.session.close().wait().map_err(zenoh_error)
    }
}

fn get(session: &Session, request: &Request) -> Result<FifoChannelHandler<Reply>, WireError> {
    let asked = session
        .get(format!("{KEY}/*"))
        .payload(to_json(request))
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .congestion_control(CongestionControl::Block)
        .timeout(ANSWER_PATIENCE)
        .with(FifoChannel::new(MOST_ANSWERS));
    asked.wait().map_err(zenoh_error)
}

/// Asks for the run; none if nobody answers.
fn hello(session: &Session, request: &Request) -> Result<Option<Welcome>, WireError> {
    let mut welcomes = Vec::new();
    for reply in get(session, request)? {
        let welcome: Welcome = match reply.result() {
            Ok(sample) => answer(&sample.payload().to_bytes())?,
            Err(refused) if is_of_zenoh(&refused.payload().to_bytes()) => continue,
            Err(refused) => return Err(turned(&refused.payload().to_bytes())),
        };
        let recomputed = welcome.run.as_ref().is_some_and(|offer| !offer.frames) && !request.frames;
        welcome.versions.check(recomputed)?;
        welcomes.push(welcome);
    }
    if welcomes.len() > 1 {
        let many = format!("{} runs are relayed there; connect to one of them", welcomes.len());
        return Err(WireError::Turned(many));
    }
    Ok(welcomes.pop())
}

fn turned(said: &[u8]) -> WireError {
    // short, whoever says it
    WireError::Turned(String::from_utf8_lossy(said).chars().take(400).collect())
}

impl Shared {
    /// Asks for what comes after `seq`, again and again, until nobody wants it.
    fn fetch(
        &self,
        session: &Session,
        mut seq: u64,
        arrivals: &SyncSender<Arrival>,
    ) -> Result<(), WireError> {
        while !self.over.load(Ordering::Relaxed) {
            let mut answered = false;
            for reply in get(session, &self.request(seq))? {
                let sample = match reply.into_result() {
                    Ok(sample) => sample,
                    Err(refused) if is_of_zenoh(&refused.payload().to_bytes()) => break,
                    Err(refused) => return Err(turned(&refused.payload().to_bytes())),
                };
                let place =
                    Place::decode(&sample.attachment().map(|bytes| bytes.to_bytes()).unwrap_or_default())?;
                if place.after != seq && place.seq != seq {
                    break; // something before it was lost on the way: ask again
                }
                answered = true;
                *self.heard.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
                if place.seq == seq {
                    continue; // nothing new
                }
                seq = place.seq;
                if arrivals.send(Arrival::Message(place, sample.payload().clone())).is_err() {
                    return Ok(());
                }
            }
            if !answered {
                thread::sleep(PAUSE);
            }
        }
        Ok(())
    }

    /// Asks for what comes after `seq`.
    fn request(&self, seq: u64) -> Request {
        Request {
            versions: Versions::OURS,
            receiver: self.receiver,
            frames: self.frames.load(Ordering::Relaxed),
            have: Some(Have { stream: self.stream, seq }),
            done: self.done.load(Ordering::Relaxed),
        }
    }

    /// Tells the near side what is done, when it changes and now and then.
    fn beat(&self, session: &Session) {
        while !self.over.load(Ordering::Relaxed) {
            // one that does not get through is followed by others
            let _ = put_done(session, self);
            let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
            if !*told {
                told = self.change.wait_timeout(told, HEARTBEAT).unwrap_or_else(PoisonError::into_inner).0;
            }
            *told = false;
        }
    }

    fn wake(&self) {
        *self.told.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.change.notify_one();
    }
}

/// Zenoh's own words for an answer that did not come in time.
fn is_of_zenoh(said: &[u8]) -> bool {
    said == b"Timeout"
}

fn put_done(session: &Session, shared: &Shared) -> Result<(), WireError> {
    let have = Have { stream: shared.stream, seq: shared.done.load(Ordering::Relaxed) };
    let done = to_json(&Done { receiver: shared.receiver, have });
    session.put(DONE_KEY, done).congestion_control(CongestionControl::Drop).wait().map_err(zenoh_error)
}
