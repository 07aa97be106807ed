//! What goes on while a recording is replayed: pacing, pauses, keys, the progress line.

use crate::args::Pace;
use crate::display::{self, count, seconds};
use crate::keyboard::{Key, Keyboard};
use crate::pace::{LONGEST_NAP, Pacer};
use crate::publishing::Dropped;
use crate::source::Frames;
use indicatif::ProgressBar;
use producer::replay::{Conductor, Replay};
use schemas::bus::{PublishError, StatePublisher};
use schemas::frame::Frame;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// How often a person needs to see progress.
const REFRESH: Duration = Duration::from_millis(100);

/// What a replay leaves behind for the next one and for the summary.
pub(super) struct Left {
    /// The pace that was set last.
    pub(super) pace: Pace,
    /// Consumers that were dropped.
    pub(super) dropped: Dropped,
    /// Wall time, pauses included.
    pub(super) wall: Duration,
    /// How much of it was paused.
    pub(super) paused: Duration,
}

/// Conducts a replay.
pub(super) struct Stage<'a> {
    bar: ProgressBar,
    keyboard: Option<&'a Keyboard>,
    pacer: Pacer,
    stop: Arc<AtomicBool>,
    start: Instant,
    refreshed: Instant,
    /// Since when it is paused.
    paused_since: Option<Instant>,
    paused: Duration,
    /// Frames to publish in spite of the pause.
    steps: u64,
    /// Whether any was.
    stepped: bool,
    dropped: Dropped,
}

impl<'a> Stage<'a> {
    pub(super) fn new(
        replay: &Replay<Frames>,
        pace: Pace,
        keyboard: Option<&'a Keyboard>,
        stop: Arc<AtomicBool>,
    ) -> Self {
        let manifest = replay.manifest();
        let now = Instant::now();
        let bar = display::progress_bar(manifest.physics.step_count, manifest.provenance.name.as_str());
        Self {
            bar,
            keyboard,
            pacer: Pacer::new(pace, replay.first_time_s()),
            stop,
            start: now,
            refreshed: now,
            paused_since: None,
            paused: Duration::ZERO,
            steps: 0,
            stepped: false,
            dropped: Dropped::default(),
        }
    }

    /// Takes the progress line away.
    pub(super) fn leave(mut self, publisher: &mut StatePublisher) -> Left {
        self.bar.finish_and_clear();
        self.dropped.tell(publisher, &self.bar);
        Left {
            pace: self.pacer.pace(),
            dropped: self.dropped,
            wall: self.start.elapsed(),
            paused: self.paused + self.paused_since.map_or(Duration::ZERO, |since| since.elapsed()),
        }
    }

    /// Waits for a key, and does what it asks for; consumers are served meanwhile.
    fn nap(&mut self, at_most: Duration, frame: &Frame<'_>, publisher: &mut StatePublisher) {
        // a consumer that cannot be answered now is answered at the next frame
        let _ = publisher.serve();
        match self.keyboard {
            None => thread::sleep(at_most),
            Some(keyboard) => {
                if let Some(key) = keyboard.wait(at_most) {
                    self.obey(key, frame, publisher);
                }
            }
        }
    }

    fn obey(&mut self, key: Key, frame: &Frame<'_>, publisher: &mut StatePublisher) {
        match key {
            Key::Pause => match self.paused_since.take() {
                None => self.pause(),
                Some(since) => {
                    let pause = since.elapsed();
                    self.paused += pause;
                    self.steps = 0;
                    if std::mem::take(&mut self.stepped) {
                        self.pacer.change(self.pacer.pace(), frame.time_s);
                    } else {
                        self.pacer.leave_out(pause);
                    }
                }
            },
            Key::Step if self.paused_since.is_some() => self.steps += 1,
            Key::Step => self.pause(),
            Key::Faster => self.change_pace(2.0, frame.time_s),
            Key::Slower => self.change_pace(0.5, frame.time_s),
            Key::Suspended(pause) => self.pacer.leave_out(pause),
            // the flag is set
            Key::Quit => {}
        }
        self.show(frame, publisher);
    }

    fn pause(&mut self) {
        self.paused_since = Some(Instant::now());
    }

    /// Changes the pace by `factor`; the maximum counts as what is reached at the moment.
    fn change_pace(&mut self, factor: f64, time_s: f64) {
        let reached = match self.pacer.pace() {
            Pace::PerSecond(per_second) => per_second,
            Pace::Max if factor > 1.0 => return,
            Pace::Max => self.pacer.reached(time_s),
        };
        let wanted = reached * factor;
        if wanted > 0.0 && wanted.is_finite() {
            self.pacer.change(Pace::PerSecond(wanted), self.pacer.now_s(time_s));
        }
    }

    fn show(&mut self, frame: &Frame<'_>, publisher: &mut StatePublisher) {
        self.refreshed = Instant::now();
        self.dropped.tell(publisher, &self.bar);
        let counts = publisher.counts();
        let state = match (self.paused_since, self.pacer.pace()) {
            (Some(_), _) => "paused".to_owned(),
            (None, Pace::Max) => "max".to_owned(),
            (None, Pace::PerSecond(per_second)) => format!("{per_second:.3e} s/s"),
        };
        self.bar.set_position(frame.step);
        self.bar.set_message(format!(
            "frame {} · t = {} · {state} · {} lossless, {} latest",
            count(frame.frame),
            seconds(frame.time_s),
            counts.lossless,
            counts.latest,
        ));
    }

    /// Takes its time until `frame` may be published.
    fn hold(&mut self, frame: &Frame<'_>, publisher: &mut StatePublisher) {
        while !self.stop.load(Ordering::Relaxed) {
            if self.paused_since.is_some() {
                if self.steps > 0 {
                    self.steps -= 1;
                    self.stepped = true;
                    return;
                }
                self.nap(LONGEST_NAP, frame, publisher);
            } else if let Some(ahead) = self.pacer.ahead(frame.time_s) {
                self.nap(ahead.min(LONGEST_NAP), frame, publisher);
            } else {
                return;
            }
        }
    }
}

impl Conductor<StatePublisher> for Stage<'_> {
    fn before_frame(&mut self, frame: &Frame<'_>, publisher: &mut StatePublisher) -> ControlFlow<()> {
        while let Some(key) = self.keyboard.and_then(Keyboard::try_next) {
            self.obey(key, frame, publisher);
        }
        self.hold(frame, publisher);
        if self.refreshed.elapsed() >= REFRESH {
            self.show(frame, publisher);
        }
        self.go_on()
    }

    fn between_steps(&mut self, publisher: &mut StatePublisher) -> ControlFlow<()> {
        if self.refreshed.elapsed() >= REFRESH {
            self.refreshed = Instant::now();
            // a consumer that cannot be answered now is answered at the next frame
            let _ = publisher.serve();
        }
        self.go_on()
    }

    fn is_stop(&self, error: &PublishError) -> bool {
        matches!(error, PublishError::Stopped { .. })
    }
}

impl Stage<'_> {
    fn go_on(&self) -> ControlFlow<()> {
        if self.stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
