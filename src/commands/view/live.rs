//! Live runs for viewers: one consumer a run, which never holds it back, however many look at it.

use crate::commands::ls;
use bus::{AttachOptions, Bus, Delivery, LiveSource, RunInfo, list_runs};
use page::{LiveFeed, LiveWriter};
use schemas::chain::{Chain, Wall};
use schemas::frame::{FrameSource as _, Received};
use schemas::run_name::RunName;
use schemas::term::Term;
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// A state is shown at most so often.
const FRAME_PERIOD: Duration = Duration::from_nanos(1_000_000_000 / 60);
/// Interval at which viewers get the status of the run.
const STATUS_PERIOD: Duration = Duration::from_millis(250);
/// Interval at which we check for viewers.
const LOOK_PERIOD: Duration = Duration::from_millis(50);
/// Statuses over which the speed is measured.
const SPEED_SPAN: usize = 5;
/// Frames that are passed over at a time to come to the newest one: as many as our queue holds.
const MOST_PASSED: u32 = 2;

/// The runs that are looked at.
pub(super) struct Watches {
    bus: Bus,
    watched: Mutex<BTreeMap<RunName, LiveFeed>>,
    threads: Mutex<Vec<JoinHandle<()>>>,
    stop: Arc<AtomicBool>,
}

/// Frames of a stream that were shown, and that were not.
#[derive(Default)]
struct Counts {
    seen: AtomicU64,
    skipped: AtomicU64,
}

impl Watches {
    pub(super) fn new(bus: Bus, stop: &Arc<AtomicBool>) -> Self {
        Self { bus, watched: Mutex::default(), threads: Mutex::default(), stop: Arc::clone(stop) }
    }

    pub(super) fn bus(&self) -> &Bus {
        &self.bus
    }

    /// The feed of the run for a viewer; the first viewer starts a consumer, which waits for the run if need be.
    pub(super) fn feed(self: &Arc<Self>, run: &RunName) -> LiveFeed {
        let mut watched = lock(&self.watched);
        if let Some(feed) = watched.get(run) {
            return feed.clone();
        }
        let (writer, feed) = LiveWriter::new();
        let (watches, name) = (Arc::clone(self), run.clone());
        let started =
            thread::Builder::new().name(format!("view {run}")).spawn(move || watches.watch(&name, &writer));
        // without a thread the viewer is told nothing, and its connection ends
        if let Ok(started) = started {
            watched.insert(run.clone(), feed.clone());
            let mut threads = lock(&self.threads);
            threads.retain(|thread| !thread.is_finished());
            threads.push(started);
        }
        feed
    }

    /// Waits until all consumers have left their runs, after the stop flag was set.
    pub(super) fn wait(&self) {
        for thread in lock(&self.threads).drain(..) {
            // what it panicked about was told
            let _ = thread.join();
        }
    }

    /// Shows a run until it ends or nobody looks any more.
    fn watch(&self, run: &RunName, writer: &LiveWriter) {
        let (counts, stop) = (Counts::default(), Arc::new(AtomicBool::new(false)));
        thread::scope(|scope| {
            let show = || self.show_frames(run, writer, &counts, &stop);
            // without a thread the viewer is told nothing, and its connection ends
            let Ok(frames) = thread::Builder::new().spawn_scoped(scope, show) else { return };
            let (mut speed, mut due) = (Speed::default(), Instant::now());
            while !frames.is_finished() {
                if self.stop.load(Ordering::Relaxed) || self.is_left(run, writer) {
                    stop.store(true, Ordering::Relaxed);
                    break;
                }
                if due.elapsed() >= STATUS_PERIOD || speed.0.is_empty() {
                    due = Instant::now();
                    if let Some(found) = self.look_at(run) {
                        writer.status(&status(&found, speed.at(found.step), &counts));
                    }
                }
                thread::sleep(LOOK_PERIOD);
            }
        });
        lock(&self.watched).remove(run);
    }

    fn look_at(&self, run: &RunName) -> Option<RunInfo> {
        list_runs(&self.bus).ok()?.into_iter().find(|found| found.name == *run)
    }

    /// True if the last viewer has left; the next one starts anew.
    fn is_left(&self, run: &RunName, writer: &LiveWriter) -> bool {
        let mut watched = lock(&self.watched);
        // the feed that is kept here for the next viewer is one, too
        let is_left = writer.feed_count() <= usize::from(watched.contains_key(run));
        if is_left {
            watched.remove(run);
        }
        is_left
    }

    /// Shows the newest frame, again and again.
    fn show_frames(&self, run: &RunName, writer: &LiveWriter, counts: &Counts, stop: &Arc<AtomicBool>) {
        let options =
            AttachOptions { label: "view".into(), stop: Arc::clone(stop), ..AttachOptions::default() };
        let mut live = match LiveSource::attach(&self.bus, Some(run), Delivery::Latest, &options) {
            Ok(live) => live,
            Err(error) => return writer.end(&error.to_string(), None),
        };
        writer.begin(&json!({ "manifest": live.manifest(), "chain": chain(live.chain()) }));
        let (mut seen, mut passed_all, mut last_step) = (0, 0, None);
        loop {
            let began = Instant::now();
            let mut passed = 0;
            loop {
                // what waits in our queue came when we had taken the last frame; what follows it is new
                let is_old = passed < MOST_PASSED && live.behind() > 1;
                let skipped = live.missed_count() + passed_all;
                match live.receive() {
                    // the source has counted them when the next frame comes
                    Ok(Received::Missed { to, .. }) => last_step = Some(live.manifest().step_of_frame(to)),
                    Ok(Received::Frame(_)) if is_old => {
                        passed += 1;
                        passed_all += 1;
                    }
                    Ok(Received::Frame(frame)) => {
                        seen += 1;
                        last_step = Some(frame.step);
                        counts.seen.store(seen, Ordering::Relaxed);
                        counts.skipped.store(skipped, Ordering::Relaxed);
                        writer.state(&frame, seen, skipped);
                        break;
                    }
                    Ok(Received::End(reason)) => return writer.end(reason.as_str(), last_step),
                    Err(error) => return writer.end(&error.to_string(), last_step),
                }
            }
            thread::sleep(FRAME_PERIOD.saturating_sub(began.elapsed()));
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Steps at the last statuses.
#[derive(Default)]
struct Speed(VecDeque<(Instant, u64)>);

impl Speed {
    /// Steps a second up to `step`, which is reached now.
    fn at(&mut self, step: u64) -> f64 {
        let now = Instant::now();
        self.0.push_back((now, step));
        if self.0.len() > SPEED_SPAN {
            self.0.pop_front();
        }
        let (since, first) = self.0.front().copied().unwrap_or((now, step));
        let seconds = (now - since).as_secs_f64();
        if seconds > 0.0 { step.saturating_sub(first) as f64 / seconds } else { 0.0 }
    }
}

/// `LiveStatus` of the page.
fn status(run: &RunInfo, steps_per_s: f64, counts: &Counts) -> Value {
    json!({
        "state": run.state.as_str(),
        "step": run.step,
        "steps_per_s": steps_per_s,
        "frames_seen": counts.seen.load(Ordering::Relaxed),
        "frames_skipped": counts.skipped.load(Ordering::Relaxed),
        "consumers": run.consumers.iter().map(ls::consumer_json).collect::<Vec<_>>(),
    })
}

/// `Chain` of the page.
pub(super) fn chain(chain: &Chain) -> Value {
    let damping = chain.damping.as_ref();
    let wall = |wall: Wall, side: usize| {
        wall.is_there.then(|| {
            json!({
                "stiffness": wall.stiffness,
                "restOverlap": wall.rest_overlap_m,
                "restForce": wall.rest_force_n,
                "damping": damping.map_or(0.0, |damping| damping.wall_coefficient[side]),
            })
        })
    };
    let term = |term: &Term| {
        let (kind, parameter) = term.law.named();
        let [left, right] = term.wall_stiffness;
        json!({
            "kind": kind, "parameter": parameter, "stiffness": term.stiffness,
            "leftWall": left, "rightWall": right, "ring": left,
        })
    };
    let raised = damping.and_then(|damping| damping.kind.raised(chain.law.alpha()));
    let sites = &chain.sites;
    let mut all = json!({
        "mass": chain.mass_kg,
        "stiffness": chain.stiffness,
        "restOverlap": chain.rest_overlap_m,
        "restForce": chain.rest_force_n,
        "damping": damping.map(|damping| damping.coefficient.as_slice()).unwrap_or_default(),
        "dampingPower": raised.map_or(0.0, |law| law.alpha()),
        "terms": chain.terms.iter().map(term).collect::<Vec<_>>(),
        "onSite": sites.linear_n_per_m,
        "onSiteCubic": sites.cubic_n_per_m3,
        "drag": sites.drag_n_s_per_m,
        "resonatorMass": sites.resonator_kg,
        "resonatorStiffness": sites.resonator_n_per_m,
    });
    let (left, right) = (wall(chain.walls.left, 0), wall(chain.walls.right, 1));
    let ends = if chain.is_ring {
        [("ring", left), ("rightWall", None)]
    } else {
        [("leftWall", left), ("rightWall", right)]
    };
    for (name, wall) in ends {
        if let Some(wall) = wall {
            all[name] = wall;
        }
    }
    all
}
