//! What goes on while a recording is replayed: pacing, pauses, keys, the progress line.

use super::summary::Summary;
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

/// What a person may want to know.
const KEYS: &str = "space pauses and goes on · → one frame · + - faster, slower · q quits";

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
    /// Which loop this is, for the progress line.
    number: String,
    keyboard: Option<&'a Keyboard>,
    pacer: Pacer,
    stop: Arc<AtomicBool>,
    start: Instant,
    refreshed: Instant,
    /// Since when it is paused.
    paused_since: Option<Instant>,
    paused: Duration,
    /// Simulated seconds per second before the pause.
    speed: f64,
    /// Frames to publish in spite of the pause.
    steps: u64,
    /// Whether the pace counts anew after the pause.
    anew: bool,
    /// Frame, step and time (s) published last.
    last: Option<(u64, u64, f64)>,
    dropped: Dropped,
}

impl<'a> Stage<'a> {
    pub(super) fn new(
        replay: &Replay<Frames>,
        summary: &Summary,
        keyboard: Option<&'a Keyboard>,
        stop: Arc<AtomicBool>,
    ) -> Self {
        let manifest = replay.manifest();
        let now = Instant::now();
        let bar = display::progress_bar(manifest.physics.step_count, manifest.provenance.name.as_str());
        if keyboard.is_some() {
            bar.set_style(display::with_second_line(KEYS));
        }
        Self {
            bar,
            number: if summary.loops > 0 { format!(" · loop {}", summary.loops + 1) } else { String::new() },
            keyboard,
            pacer: Pacer::new(summary.pace, replay.first_time_s()),
            stop,
            start: now,
            refreshed: now,
            paused_since: None,
            paused: Duration::ZERO,
            speed: 0.0,
            steps: 0,
            anew: false,
            last: None,
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
    fn nap(&mut self, at_most: Duration, next: &Frame<'_>, publisher: &mut StatePublisher) {
        // a consumer that cannot be answered now is answered at the next frame
        let _ = publisher.serve();
        match self.keyboard {
            None => thread::sleep(at_most),
            Some(keyboard) => {
                if let Some(key) = keyboard.wait(at_most) {
                    self.obey(key, next);
                    self.show(publisher);
                }
            }
        }
        if self.refreshed.elapsed() >= REFRESH {
            self.show(publisher);
        }
    }

    /// Does what a key asks for, before the frame `next` is published.
    fn obey(&mut self, key: Key, next: &Frame<'_>) {
        match (key, self.paused_since) {
            (Key::Pause, None) => self.pause(),
            (Key::Pause, Some(since)) => self.go_on_after(since, next),
            (Key::Step, paused) => {
                if paused.is_none() {
                    self.pause();
                }
                self.steps += 1;
            }
            (Key::Faster, _) => self.change_pace(2.0, next.time_s),
            (Key::Slower, _) => self.change_pace(0.5, next.time_s),
            (Key::Suspended(pause), None) => self.pacer.leave_out(pause),
            // the pause goes on; the flag is set
            (Key::Suspended(_), Some(_)) | (Key::Quit, _) => {}
        }
    }

    fn pause(&mut self) {
        self.speed = self.last.map_or(0.0, |(_, _, time_s)| self.pacer.reached(time_s));
        self.paused_since = Some(Instant::now());
    }

    fn go_on_after(&mut self, since: Instant, next: &Frame<'_>) {
        let pause = since.elapsed();
        self.paused += pause;
        self.paused_since = None;
        self.steps = 0;
        if std::mem::take(&mut self.anew) {
            self.pacer.change(self.pacer.pace(), next.time_s);
        } else {
            self.pacer.leave_out(pause);
        }
    }

    /// Changes the pace by `factor`; the maximum counts as what is reached at the moment.
    fn change_pace(&mut self, factor: f64, next_s: f64) {
        let reached = match (self.pacer.pace(), self.paused_since) {
            (Pace::PerSecond(per_second), _) => per_second,
            (Pace::Max, _) if factor > 1.0 => return,
            (Pace::Max, None) => self.pacer.reached(next_s),
            (Pace::Max, Some(_)) => self.speed,
        };
        let wanted = reached * factor;
        if wanted.is_normal() {
            self.pacer.change(Pace::PerSecond(wanted), self.pacer.now_s(next_s));
            self.anew = self.paused_since.is_some();
        }
    }

    fn show(&mut self, publisher: &mut StatePublisher) {
        self.refreshed = Instant::now();
        self.dropped.tell(publisher, &self.bar);
        let counts = publisher.counts();
        let (frame, step, time_s) = self.last.unwrap_or_default();
        let pace = match (self.paused_since, self.pacer.pace()) {
            (Some(_), _) => "paused".to_owned(),
            (None, Pace::Max) => format!("{}/s", seconds(self.pacer.reached(time_s))),
            (None, Pace::PerSecond(per_second)) => format!("{}/s", seconds(per_second)),
        };
        let consumers = match counts.lossless + counts.latest {
            1 => "1 consumer".to_owned(),
            consumers => format!("{consumers} consumers"),
        };
        self.bar.set_position(step);
        // in this order because a narrow terminal shows only the beginning
        self.bar.set_message(format!(
            "frame {} · t = {}{} · {pace} · {consumers}",
            count(frame),
            seconds(time_s),
            self.number,
        ));
    }

    /// Takes its time until `frame` may be published.
    fn hold(&mut self, frame: &Frame<'_>, publisher: &mut StatePublisher) {
        while !self.stop.load(Ordering::Relaxed) {
            if self.paused_since.is_some() {
                if self.steps > 0 {
                    self.steps -= 1;
                    self.anew = true;
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
            self.obey(key, frame);
        }
        self.hold(frame, publisher);
        self.last = Some((frame.frame, frame.step, frame.time_s));
        if self.refreshed.elapsed() >= REFRESH {
            self.show(publisher);
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
