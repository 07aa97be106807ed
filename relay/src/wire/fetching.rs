//! The far side: asks, and asks again.

use super::answers::Answers;
use super::{Connections, DONE_KEY, Endpoint, Payload, WireError, connect, unless_stopped, zenoh_error};
use crate::log::lock;
use crate::message::{
    Done, GONE, Have, MOST_USUAL_BYTES, OVER, Offer, Place, Request, Versions, Welcome, answer,
    most_message_bytes, to_json,
};
use schemas::manifest::RunManifest;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};
use zenoh::qos::CongestionControl;
use zenoh::{Session, Wait as _};

/// Messages that wait for us, each as it came.
const MOST_WAITING: usize = 4;
/// Interval of our messages to the near side.
const HEARTBEAT: Duration = Duration::from_millis(250);
/// A pause before asking again where nobody answers, or has nothing.
const PAUSE: Duration = Duration::from_millis(50);
/// Time to wait at the end for the near side's confirmation: the near side waits no longer for our question.
const LEAVE_TIME: Duration = Duration::from_secs(1);

/// Something that arrived from the near side.
#[derive(Debug)]
pub enum Arrival {
    /// A message of the run.
    Message(Place, Payload),
    /// Another near side goes on with the same run: messages after this one come. All frames are sent, or not.
    Again(Have, bool),
    /// Nothing can come any more.
    Failed(WireError),
}

/// The request of a far side, and its address.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Address of the near side.
    pub endpoint: Endpoint,
    /// Zenoh's configuration, if the user has one.
    pub config: Option<PathBuf>,
    /// Number of this far side: the same after a restart.
    pub receiver: u64,
    /// Every frame instead of states.
    pub frames: bool,
}

/// A far side that is connected.
pub struct Fetching {
    /// The run.
    pub manifest: RunManifest,
    /// Every frame is sent.
    pub frames: bool,
    shared: Arc<Shared>,
    arrivals: Receiver<Arrival>,
    _connections: Connections,
}

struct Shared {
    receiver: u64,
    manifest: RunManifest,
    state: Mutex<State>,
    change: Condvar,
    over: AtomicBool,
    frames: AtomicBool,
}

struct State {
    /// All messages up to this one have been published.
    done: Have,
    /// `done` is news to the near side.
    is_news: bool,
    /// When the near side was heard last.
    heard: Instant,
    /// The near side knows that we have everything, or nobody asks it any more.
    has_left: bool,
}

/// The thing that a far side waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Waiting {
    /// Nothing listens there.
    Nobody,
    /// The other side has no run yet.
    NoRun,
}

impl Fetching {
    /// Connects to the near side and asks for its run; waits for both until `stop` is set, which gives none.
    ///
    /// # Errors
    /// When the other side is no relay, or another version, or refuses us, or offers no possible run.
    pub fn start(
        wanted: &Wanted,
        stop: &AtomicBool,
        mut tell: impl FnMut(Waiting),
    ) -> Result<Option<Self>, WireError> {
        let Some(session) = meet(wanted, MOST_USUAL_BYTES, stop, &mut tell)? else { return Ok(None) };
        let Some(offer) = greet(&session, wanted, stop, &mut tell)? else { return Ok(None) };
        let manifest = RunManifest::from_json(offer.manifest.as_bytes())?;
        let most_bytes = most_message_bytes(&manifest);
        let session = if most_bytes > MOST_USUAL_BYTES {
            drop(session);
            let Some(session) = meet(wanted, most_bytes, stop, &mut tell)? else { return Ok(None) };
            session
        } else {
            session
        };
        let shared = Arc::new(Shared {
            receiver: wanted.receiver,
            manifest: manifest.clone(),
            state: Mutex::new(State {
                done: offer.have,
                is_news: false,
                heard: Instant::now(),
                has_left: false,
            }),
            change: Condvar::new(),
            over: AtomicBool::new(false),
            frames: AtomicBool::new(wanted.frames),
        });
        let (sender, arrivals) = sync_channel(MOST_WAITING);
        let (asking, its) = (Session::clone(&session), Arc::clone(&shared));
        thread::spawn(move || {
            let fetched = its.fetch(&asking, offer.have, &sender);
            // whoever listened is gone
            let _ = fetched.map_err(|error| sender.send(Arrival::Failed(error)));
            its.change(|state| state.has_left = true);
        });
        let (telling, its) = (Session::clone(&session), Arc::clone(&shared));
        thread::spawn(move || its.beat(&telling));
        let frames = offer.frames || wanted.frames;
        Ok(Some(Self { manifest, frames, shared, arrivals, _connections: session }))
    }

    /// The next arrival, within this time.
    pub fn next(&self, patience: Duration) -> Option<Arrival> {
        match self.arrivals.recv_timeout(patience) {
            Ok(Arrival::Again(have, frames)) => {
                self.shared.change(|state| state.done = have);
                Some(Arrival::Again(have, frames))
            }
            Ok(arrival) => Some(arrival),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                Some(Arrival::Failed(WireError::Zenoh("nobody asks any more".to_owned())))
            }
        }
    }

    /// All messages up to this one have been published, of those that `next` gave.
    pub fn done(&self, seq: u64) {
        self.shared.change(|state| {
            state.is_news |= state.done.seq != seq;
            state.done.seq = seq;
        });
    }

    /// Asks for every frame from now on.
    pub fn ask_for_frames(&self) {
        self.shared.frames.store(true, Ordering::Relaxed);
    }

    /// Time since the near side's last sign of life.
    pub fn silence(&self) -> Duration {
        self.shared.state().heard.elapsed()
    }

    /// Leaves; the near side, if it is there, has heard that everything was done, unless `stop` is set.
    pub fn stop(self, stop: &AtomicBool) {
        let start = Instant::now();
        let mut state = self.shared.state();
        let is_there = |state: &State| !state.has_left && state.heard.elapsed() < LEAVE_TIME;
        while is_there(&state) && start.elapsed() < LEAVE_TIME && !stop.load(Ordering::Relaxed) {
            state = self.shared.wait(state, PAUSE);
        }
        drop(state);
        self.shared.over.store(true, Ordering::Relaxed);
        self.shared.change(|state| state.is_news = true);
    }
}

/// Connects as soon as somebody listens; none if `stop` is set before.
fn meet(
    wanted: &Wanted,
    most_bytes: usize,
    stop: &AtomicBool,
    tell: &mut impl FnMut(Waiting),
) -> Result<Option<Connections>, WireError> {
    while !stop.load(Ordering::Relaxed) {
        let Wanted { endpoint, config, .. } = wanted.clone();
        let connecting = move || connect(&endpoint, config.as_deref().map(Path::new), most_bytes);
        match unless_stopped(stop, connecting).transpose()? {
            Some(Some(session)) => return Ok(Some(session)),
            Some(None) => {
                tell(Waiting::Nobody);
                thread::sleep(2 * PAUSE);
            }
            None => break,
        }
    }
    Ok(None)
}

/// Asks for the run until it is there; none if `stop` is set before.
fn greet(
    session: &Session,
    wanted: &Wanted,
    stop: &AtomicBool,
    tell: &mut impl FnMut(Waiting),
) -> Result<Option<Offer>, WireError> {
    while !stop.load(Ordering::Relaxed) {
        match hello(session, wanted.receiver, wanted.frames, stop)? {
            Some(Welcome { run: Some(offer), .. }) => return Ok(Some(offer)),
            Some(Welcome { run: None, .. }) => tell(Waiting::NoRun),
            None => {}
        }
        thread::sleep(PAUSE);
    }
    Ok(None)
}

/// Asks for the run once; none if nobody answers.
fn hello(
    session: &Session,
    receiver: u64,
    frames: bool,
    stop: &AtomicBool,
) -> Result<Option<Welcome>, WireError> {
    let request = Request { versions: Versions::OURS, receiver, frames, have: None, done: 0 };
    let answers = Answers::ask(session, &request)?;
    let mut found = None;
    while let Some(reply) = answers.next(stop)? {
        let welcome: Welcome = match reply.result() {
            Ok(sample) => answer(&sample.payload().to_bytes())?,
            Err(refused) if is_of_zenoh(&refused.payload().to_bytes()) => continue,
            Err(refused) => return Err(turned(&refused.payload().to_bytes())),
        };
        let recomputed = welcome.run.as_ref().is_some_and(|offer| !offer.frames) && !frames;
        welcome.versions.check(recomputed)?;
        if found.replace(welcome).is_some() {
            let many = "expected one run, found more than one that is relayed there; connect to one of them";
            return Err(WireError::Turned(many.to_owned()));
        }
    }
    Ok(found)
}

fn turned(said: &[u8]) -> WireError {
    // short, whoever says it
    WireError::Turned(String::from_utf8_lossy(said).chars().take(400).collect())
}

/// Result of a question.
enum Asked {
    /// The near side lives.
    Answered,
    /// Nobody is there, or the answer does not follow our last message.
    Nothing,
    /// Another near side is there.
    Gone,
    /// The near side knows that we have everything.
    Over,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.state());
        self.change.notify_all();
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>, at_most: Duration) -> MutexGuard<'a, State> {
        self.change.wait_timeout(state, at_most).unwrap_or_else(PoisonError::into_inner).0
    }

    /// Asks for the messages after `have`, again and again, until nobody wants them.
    fn fetch(
        &self,
        session: &Session,
        mut have: Have,
        arrivals: &SyncSender<Arrival>,
    ) -> Result<(), WireError> {
        while !self.over.load(Ordering::Relaxed) {
            match self.ask(session, &mut have, arrivals)? {
                Asked::Answered => {}
                Asked::Nothing => thread::sleep(PAUSE),
                Asked::Over => return Ok(()),
                Asked::Gone => {
                    let frames = self.frames.load(Ordering::Relaxed);
                    let Some(Welcome { run: Some(offer), .. }) =
                        hello(session, self.receiver, frames, &self.over)?
                    else {
                        thread::sleep(PAUSE);
                        continue;
                    };
                    self.check_same_run(&offer)?;
                    have = offer.have;
                    if arrivals.send(Arrival::Again(have, offer.frames || frames)).is_err() {
                        return Ok(());
                    }
                    self.change(|state| state.heard = Instant::now());
                }
            }
        }
        Ok(())
    }

    /// Asks once for the messages after `have`.
    fn ask(
        &self,
        session: &Session,
        have: &mut Have,
        arrivals: &SyncSender<Arrival>,
    ) -> Result<Asked, WireError> {
        let answers = Answers::ask(session, &self.request(*have))?;
        let mut asked = Asked::Nothing;
        while let Some(reply) = answers.next(&self.over)? {
            let sample = match reply.into_result() {
                Ok(sample) => sample,
                Err(refused) => match &*refused.payload().to_bytes() {
                    said if is_of_zenoh(said) => break,
                    said if said == GONE.as_bytes() => return Ok(Asked::Gone),
                    said => return Err(turned(said)),
                },
            };
            let place =
                Place::decode(&sample.attachment().map(|bytes| bytes.to_bytes()).unwrap_or_default())?;
            if place.after != have.seq && place.seq != have.seq {
                break; // something before it was lost on the way: ask again
            }
            asked = Asked::Answered;
            if place.seq != have.seq {
                have.seq = place.seq;
                if arrivals.send(Arrival::Message(place, sample.payload().clone())).is_err() {
                    return Ok(Asked::Over);
                }
            } else if &*sample.payload().to_bytes() == OVER {
                return Ok(Asked::Over);
            }
            // after the wait for whoever takes it, which is no silence of the other side
            self.change(|state| state.heard = Instant::now());
        }
        Ok(asked)
    }

    /// Refuses to go on with another run than the one that was begun.
    fn check_same_run(&self, offer: &Offer) -> Result<(), WireError> {
        let found = RunManifest::from_json(offer.manifest.as_bytes())?;
        if found == self.manifest {
            return Ok(());
        }
        let (expected, found) = (self.manifest.provenance.run_id, found.provenance.run_id);
        let differs = if expected == found { " with another manifest" } else { "" };
        Err(WireError::OtherRun { expected, found, differs })
    }

    /// Asks for what comes after `have`.
    fn request(&self, have: Have) -> Request {
        let done = Some(self.state().done).filter(|done| done.stream == have.stream);
        Request {
            versions: Versions::OURS,
            receiver: self.receiver,
            frames: self.frames.load(Ordering::Relaxed),
            have: Some(have),
            done: done.map_or(0, |done| done.seq),
        }
    }

    /// Tells the near side the last message that is done, when it changes and now and then.
    fn beat(&self, session: &Session) {
        while !self.over.load(Ordering::Relaxed) {
            let done = self.state().done;
            let told = to_json(&Done { receiver: self.receiver, have: done });
            // one that does not get through is followed by others
            let put = session.put(DONE_KEY, told).congestion_control(CongestionControl::Drop).wait();
            let _ = put.map_err(zenoh_error);
            let mut state = self.state();
            let until = Instant::now() + HEARTBEAT;
            while !state.is_news && Instant::now() < until {
                state = self.wait(state, until.saturating_duration_since(Instant::now()));
            }
            state.is_news = false;
        }
    }
}

/// Zenoh's own words for an answer that did not come in time.
fn is_of_zenoh(said: &[u8]) -> bool {
    said == b"Timeout"
}
