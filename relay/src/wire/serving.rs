//! The near side: answers those who ask.

use super::{ANSWER_TIME, DONE_KEY, Endpoint, KEY, Payload, WireError, listen, zenoh_error};
use crate::log::SharedLog;
use crate::message::{Done, Have, MessageError, Offer, Place, Request, Versions, Welcome, request, to_json};
use schemas::run_name::RunName;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};
use zenoh::bytes::ZBytes;
use zenoh::query::Query;
use zenoh::sample::Sample;
use zenoh::{Session, Wait as _};

/// Most requests that are answered at a time.
const MOST_REQUESTS: usize = 16;

/// A near side that listens.
pub struct Serving {
    shared: Arc<Shared>,
    session: Session,
}

struct Shared {
    log: Arc<SharedLog<Payload>>,
    offered: Mutex<Offered>,
    under_way: AtomicUsize,
    /// Somebody asks for every frame.
    frames: AtomicBool,
    key: String,
}

#[derive(Default)]
struct Offered {
    run: Option<Run>,
    /// Somebody has asked.
    asked: bool,
    /// What came that was no request, and who was turned away.
    troubles: Vec<String>,
}

struct Run {
    manifest: String,
    stream: u64,
    /// It is recomputed, for which kernels must be the same.
    recomputed: bool,
}

impl Serving {
    /// Listens at `endpoint`, for those who ask for `run`, or for whatever run there is.
    ///
    /// # Errors
    /// When it cannot.
    pub fn start(
        endpoint: &Endpoint,
        config: Option<&Path>,
        run: Option<&RunName>,
        log: Arc<SharedLog<Payload>>,
    ) -> Result<Self, WireError> {
        let session = listen(endpoint, config)?;
        let key = format!("{KEY}/{}", run.map_or("any", RunName::as_str));
        let shared = Arc::new(Shared {
            log,
            offered: Mutex::default(),
            under_way: AtomicUsize::new(0),
            frames: AtomicBool::new(false),
            key: key.clone(),
        });
        let asked = Arc::clone(&shared);
        let queryable = session.declare_queryable(key).callback(move |query| Shared::ask(&asked, query));
        queryable.background().wait().map_err(zenoh_error)?;
        let heard = Arc::clone(&shared);
        let subscriber = session.declare_subscriber(DONE_KEY).callback(move |sample| heard.hear(&sample));
        subscriber.background().wait().map_err(zenoh_error)?;
        Ok(Self { shared, session })
    }

    /// Whether somebody has asked for the run.
    pub fn is_asked(&self) -> bool {
        self.shared.offered().asked
    }

    /// Whether somebody wants every frame.
    pub fn wants_frames(&self) -> bool {
        self.shared.frames.load(Ordering::Relaxed)
    }

    /// Offers a run; `recomputed` where the other side's kernel matters.
    pub fn offer(&self, manifest: String, stream: u64, recomputed: bool) {
        self.shared.offered().run = Some(Run { manifest, stream, recomputed });
    }

    /// What came that was no request, and who was turned away, since the last call.
    pub fn take_troubles(&self) -> Vec<String> {
        std::mem::take(&mut self.shared.offered().troubles)
    }

    /// Leaves.
    ///
    /// # Errors
    /// When the connections cannot be closed.
    pub fn stop(self) -> Result<(), WireError> {
        let start = Instant::now();
        while self.shared.under_way.load(Ordering::Relaxed) > 0 && start.elapsed() < 2 * ANSWER_TIME {
            thread::sleep(Duration::from_millis(5));
        }
        self.session.close().wait().map_err(zenoh_error)
    }
}

impl Shared {
    fn offered(&self) -> MutexGuard<'_, Offered> {
        // a thread that panicked has said why
        self.offered.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Answers in a thread of its own: Zenoh's must not wait.
    fn ask(self: &Arc<Self>, query: Query) {
        if self.under_way.fetch_add(1, Ordering::Relaxed) >= MOST_REQUESTS {
            self.under_way.fetch_sub(1, Ordering::Relaxed);
            return; // whoever asks asks again
        }
        let it = Arc::clone(self);
        let started = thread::Builder::new().name("relay".into()).spawn(move || {
            it.answer(&query);
            it.under_way.fetch_sub(1, Ordering::Relaxed);
        });
        if started.is_err() {
            self.under_way.fetch_sub(1, Ordering::Relaxed);
        }
    }

    fn answer(&self, query: &Query) {
        let bytes = query.payload().map(ZBytes::to_bytes).unwrap_or_default();
        let refused = match request::<Request>(&bytes) {
            Ok(request) => match request.have {
                None => self.welcome(query, &request),
                Some(have) => {
                    self.send(query, &request, have);
                    Ok(())
                }
            },
            Err(error) => Err(error),
        };
        if let Err(error) = refused {
            // the other side is told what it looks like from here
            let _ = query.reply_err(error.to_string()).wait();
            self.offered().troubles.push(error.to_string());
        }
    }

    /// Waits a while for the run, and offers it.
    fn welcome(&self, query: &Query, request: &Request) -> Result<(), MessageError> {
        request.versions.check(false)?;
        if request.frames {
            self.frames.store(true, Ordering::Relaxed);
        }
        self.offered().asked = true;
        let start = Instant::now();
        let run = loop {
            if let Some(run) = &self.offered().run {
                request.versions.check(run.recomputed && !request.frames)?;
                break Some((run.manifest.clone(), run.stream, !run.recomputed));
            }
            if start.elapsed() >= ANSWER_TIME {
                break None;
            }
            thread::sleep(Duration::from_millis(5));
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

    /// Sends what comes after `have`, for a while.
    fn send(&self, query: &Query, request: &Request, have: Have) {
        if request.frames {
            self.frames.store(true, Ordering::Relaxed);
        }
        let stream = self.offered().run.as_ref().map(|run| run.stream);
        if stream != Some(have.stream) {
            let _ = query.reply_err("what you had of this run is not here any more: another `beadline relay --from` has begun").wait();
            return;
        }
        let receiver = request.receiver;
        self.log.change(|log| log.hear(receiver, Some(request.done), Instant::now()));
        let until = Instant::now() + ANSWER_TIME;
        let mut seq = have.seq;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let next = self.log.wait_for(left, |log| match log.next_for(receiver, seq) {
                Some(entry) => Some(Some((entry, log.rows_lost()))),
                None => log.is_done_with(receiver).then_some(None),
            });
            let Some((entry, rows_lost)) = next.flatten() else { break };
            let age_ms = u64::try_from(entry.at.elapsed().as_millis()).unwrap_or(u64::MAX);
            let place = Place { seq: entry.seq, after: seq, rows_lost, age_ms };
            let reply = query.reply(&self.key, entry.payload).attachment(place.encode());
            if reply.wait().is_err() {
                return;
            }
            seq = entry.seq;
        }
        // nothing new: the other side sees that we live
        let alive = Place { seq, after: seq, rows_lost: self.log.look().rows_lost(), age_ms: 0 };
        let _ = query.reply(&self.key, ZBytes::new()).attachment(alive.encode()).wait();
    }

    /// A far side says what it has done with.
    fn hear(&self, sample: &Sample) {
        let Ok(done) = request::<Done>(&sample.payload().to_bytes()) else { return };
        if self.offered().run.as_ref().is_some_and(|run| run.stream == done.have.stream) {
            self.log.change(|log| log.hear(done.receiver, Some(done.have.seq), Instant::now()));
        }
    }
}
