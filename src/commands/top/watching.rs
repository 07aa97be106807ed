//! Threads that read the bus, so that keys are obeyed at once.

use crate::display;
use crate::failure::Failure;
use bus::{AttachError, AttachOptions, Bus, BusError, Delivery, LiveError, LiveSource, RunInfo, list_runs};
use producer::integrator::Integrator;
use producer::resimulation::check_kernel;
use producer::state::ChainState;
use schemas::frame::{EndReason, Frame, FrameSource as _, HeldFrame, Received};
use schemas::manifest::RunManifest;
use schemas::run_name::RunName;
use screen::Watched;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Interval between two lists of the runs.
const LIST_PERIOD: Duration = Duration::from_millis(500);

/// Longest time between two states that are taken from a run: the screen is not older than this.
const LONGEST_PAUSE: Duration = Duration::from_millis(50);

/// The runs on the bus, again and again.
pub(super) struct List {
    found: Receiver<Result<Vec<RunInfo>, BusError>>,
    _task: Task,
}

impl List {
    pub(super) fn start(bus: &Bus) -> io::Result<Self> {
        let bus = bus.clone();
        let (sender, found) = sync_channel(1);
        let list = move |end: &Receiver<()>| {
            while sender.send(list_runs(&bus)).is_ok() && !has_ended(end, LIST_PERIOD) {}
        };
        Ok(Self { found, _task: Task::start("runs", Arc::default(), list)? })
    }

    /// The newest list, if there is one since the last call.
    pub(super) fn take(&self) -> Option<Result<Vec<RunInfo>, BusError>> {
        self.found.try_iter().last()
    }
}

/// The newest state of one run.
pub(super) struct Watch {
    name: RunName,
    news: Arc<Mutex<News>>,
    _task: Task,
    is_over: bool,
}

/// News since the last look.
#[derive(Default)]
struct News {
    manifest: Option<Box<RunManifest>>,
    state: HeldFrame,
    has_state: bool,
    end: Option<Result<EndReason, WatchError>>,
}

impl News {
    fn hold(&mut self, frame: &Frame<'_>) {
        self.state.hold(frame);
        self.has_state = true;
    }
}

/// Reason why a run can no longer be watched.
#[derive(Debug, thiserror::Error)]
enum WatchError {
    #[error(transparent)]
    Attach(#[from] AttachError),
    #[error(transparent)]
    Live(#[from] LiveError),
}

impl Watch {
    /// Attaches to a run as soon as it is there, and takes a state each `period` or more often.
    pub(super) fn start(bus: &Bus, name: &RunName, period: Duration) -> io::Result<Self> {
        let news = Arc::new(Mutex::new(News::default()));
        let (its_news, its_name, bus) = (Arc::clone(&news), name.clone(), bus.clone());
        let stop = Arc::new(AtomicBool::new(false));
        let options =
            AttachOptions { label: "top".into(), stop: Arc::clone(&stop), ..AttachOptions::default() };
        let watch = move |end: &Receiver<()>| {
            let ended =
                follow(&bus, &its_name, &options, &its_news, || has_ended(end, period.min(LONGEST_PAUSE)));
            lock(&its_news).end = Some(ended);
        };
        Ok(Self { name: name.clone(), news, _task: Task::start("states", stop, watch)?, is_over: false })
    }

    /// True if no more states come.
    pub(super) fn is_over(&self) -> bool {
        self.is_over
    }

    /// Hands over the news; an attachment that fails has a message.
    pub(super) fn take(&mut self, watched: &mut Option<Watched>) -> Result<Option<String>, Failure> {
        let mut news = lock(&self.news);
        if let Some(manifest) = news.manifest.take() {
            *watched = Some(Watched::new(&manifest));
        }
        if let Some(watched) = watched.as_mut().filter(|_| news.has_state) {
            watched.observe(&news.state.frame());
        }
        news.has_state = false;
        let ended = news.end.take();
        self.is_over |= ended.is_some();
        match ended {
            Some(Ok(reason)) => watched.iter_mut().for_each(|watched| watched.end(reason)),
            Some(Err(WatchError::Attach(error))) => return Ok(Some(display::printable(&error.to_string()))),
            Some(Err(error)) => return Err(error.into()),
            None if watched.is_none() && !self.is_over => {
                return Ok(Some(format!("joining run {} …", self.name)));
            }
            None => {}
        }
        Ok(None)
    }
}

/// States taken one after the other: those in the queue are as old as the last pause, the one behind them is new.
const STATES_AT_A_TIME: usize = 3;

/// Holds the newest state of the run until it ends, or `pause` says that nobody looks any more.
fn follow(
    bus: &Bus,
    name: &RunName,
    options: &AttachOptions,
    news: &Mutex<News>,
    pause: impl Fn() -> bool,
) -> Result<EndReason, WatchError> {
    let mut live = LiveSource::attach(bus, Some(name), Delivery::Latest, options)?;
    let manifest = live.manifest().clone();
    lock(news).manifest = Some(Box::new(manifest.clone()));
    let (mut taken, mut missed_to) = (0, None);
    loop {
        match live.receive()? {
            Received::Frame(frame) => lock(news).hold(&frame),
            Received::Missed { to, .. } => {
                missed_to = Some(to);
                continue;
            }
            Received::End(reason) => {
                if let Some(to) = missed_to {
                    complete(news, &manifest, to);
                }
                return Ok(reason);
            }
        }
        (taken, missed_to) = (taken + 1, None);
        if taken % STATES_AT_A_TIME == 0 && pause() {
            return Ok(EndReason::Stopped);
        }
    }
}

/// Goes on to the last frame, which came while the queue was full: those are few steps.
fn complete(news: &Mutex<News>, manifest: &RunManifest, frame: u64) {
    if check_kernel(manifest).is_err() {
        return;
    }
    let mut state = ChainState::of_frame(&lock(news).state.frame());
    if state.u_m.is_empty() {
        return;
    }
    let (mut integrator, last) = (Integrator::new(&manifest.physics), manifest.step_of_frame(frame));
    while state.step < last {
        integrator.advance(&mut state, last);
    }
    lock(news).hold(&state.as_frame(manifest, frame));
}

fn lock(news: &Mutex<News>) -> std::sync::MutexGuard<'_, News> {
    news.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A thread that ends when this is dropped.
struct Task {
    stop: Arc<AtomicBool>,
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Task {
    fn start(
        name: &str,
        stop: Arc<AtomicBool>,
        work: impl FnOnce(&Receiver<()>) + Send + 'static,
    ) -> io::Result<Self> {
        let (end, ended) = channel();
        let thread = thread::Builder::new().name(name.into()).spawn(move || work(&ended))?;
        Ok(Self { stop, end: Some(end), thread: Some(thread) })
    }
}

impl Drop for Task {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.end = None;
        if let Some(thread) = self.thread.take() {
            // a panic was told when it came
            let _ = thread.join();
        }
    }
}

/// Waits, and says whether the task is to end.
fn has_ended(end: &Receiver<()>, wait: Duration) -> bool {
    end.recv_timeout(wait) != Err(RecvTimeoutError::Timeout)
}
