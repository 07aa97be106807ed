//! Control of frames while they are published: pace, pauses, keys, the progress line. `run` and `replay` share it.

use crate::args::Pace;
use crate::display::{self, count, seconds};
use crate::keyboard::{Key, Keyboard, Seek};
use crate::pace::{LONGEST_NAP, Pacer};
use crate::progress::REFRESH;
use crate::publishing::{Dropped, Outlet};
use crate::signals;
use indicatif::ProgressBar;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Between two looks at the clock.
const CLOCK_EVERY: Duration = Duration::from_millis(1);

/// Help about the keys, beside the progress line.
const KEYS: [&str; 4] = ["space pauses", "→ one frame", "+ - pace", "q quits"];
const KEYS_WITH_SEEK: [&str; 7] =
    ["space pauses", "→ one frame", "← back", "[ ] jump", "Home", "+ - pace", "q quits"];

/// Beginning of a stage.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Begin {
    pub(crate) pace: Pace,
    /// True if it is paused after its first frame.
    pub(crate) is_paused: bool,
    /// The step of its first frame.
    pub(crate) step: u64,
    /// True if the keys may lead to another place.
    pub(crate) can_seek: bool,
}

/// Outcome of a stage, for the next one and for the summary.
pub(crate) struct Left {
    /// The pace that was set last.
    pub(crate) pace: Pace,
    pub(crate) is_paused: bool,
    /// The seeks that keys asked for at its end, in order.
    pub(crate) seeks: Vec<Seek>,
    /// Consumers that were dropped.
    pub(crate) dropped: Dropped,
    /// Wall time, pauses included.
    pub(crate) wall: Duration,
    /// Wall time of the pauses.
    pub(crate) paused: Duration,
}

/// Holds frames back until it is their time.
pub(crate) struct Stage<'a> {
    bar: ProgressBar,
    keyboard: Option<&'a Keyboard>,
    can_seek: bool,
    stop: Arc<AtomicBool>,
    pacer: Pacer,
    start: Instant,
    clock: Clock,
    refreshed: Instant,
    first_step: u64,
    /// Start of the present pause.
    paused_since: Option<Instant>,
    paused: Duration,
    /// Simulated time (s) at which the pace counts on after the pause.
    paused_at_s: f64,
    /// Simulated seconds per second before the pause.
    speed: f64,
    /// Frames to let through in spite of the pause.
    steps: u64,
    seeks: Vec<Seek>,
    /// Step and time (s) of the frame that was published last.
    last: (u64, f64),
    /// Text at the end of the progress line.
    pub(crate) note: String,
    dropped: Dropped,
}

impl<'a> Stage<'a> {
    pub(crate) fn new(
        manifest: &RunManifest,
        begin: Begin,
        keyboard: Option<&'a Keyboard>,
        stop: Arc<AtomicBool>,
    ) -> Self {
        let now = Instant::now();
        let time_s = manifest.physics.time_s(begin.step);
        let bar = display::progress_bar(manifest.physics.step_count, manifest.provenance.name.as_str());
        if keyboard.is_some() {
            display::add_line(&bar, if begin.can_seek { &KEYS_WITH_SEEK } else { &KEYS });
        }
        Self {
            bar,
            keyboard,
            can_seek: begin.can_seek,
            stop,
            pacer: Pacer::new(begin.pace, time_s),
            start: now,
            clock: Clock::new(now),
            refreshed: now,
            first_step: begin.step,
            paused_since: begin.is_paused.then_some(now),
            paused: Duration::ZERO,
            paused_at_s: time_s,
            speed: 0.0,
            steps: u64::from(begin.is_paused),
            seeks: Vec::new(),
            last: (begin.step, time_s),
            note: String::new(),
            dropped: Dropped::default(),
        }
    }

    /// Takes the progress line away.
    pub(crate) fn leave(mut self, publisher: &mut Outlet) -> Left {
        self.bar.finish_and_clear();
        self.dropped.tell(publisher.take_events(), &self.bar);
        Left {
            pace: self.pacer.pace(),
            is_paused: self.paused_since.is_some(),
            seeks: self.seeks,
            dropped: self.dropped,
            wall: self.start.elapsed(),
            paused: self.paused + self.paused_since.map_or(Duration::ZERO, |since| since.elapsed()),
        }
    }

    /// `frame` was published.
    pub(crate) fn published(&mut self, frame: &Frame<'_>) {
        // what is there is worth an orderly end
        signals::leaves_nothing(false);
        self.last = (frame.step, frame.time_s);
    }

    /// True if it is time to show progress.
    pub(crate) fn is_due(&mut self) -> bool {
        self.clock.look().is_some_and(|now| now.duration_since(self.refreshed) >= REFRESH)
    }

    /// Waits until simulated time may go on to `time_s`; consumers are served and keys are obeyed meanwhile. `Break`
    /// asks for the end.
    pub(crate) fn hold(&mut self, time_s: f64, publisher: &mut Outlet) -> ControlFlow<()> {
        loop {
            while let Some(key) = self.keyboard.and_then(Keyboard::try_next) {
                self.obey(key, time_s);
                self.show(publisher);
            }
            if !self.seeks.is_empty() || self.go_on().is_break() {
                return ControlFlow::Break(());
            }
            if self.paused_since.is_none() {
                match self.pacer.ahead(time_s) {
                    None => return ControlFlow::Continue(()),
                    Some(ahead) => self.nap(ahead.min(LONGEST_NAP), time_s, publisher),
                }
            } else if self.steps > 0 {
                self.steps -= 1;
                self.paused_at_s = time_s;
                return ControlFlow::Continue(());
            } else {
                self.nap(LONGEST_NAP, time_s, publisher);
            }
        }
    }

    /// True if frames wait for their time.
    pub(crate) fn holds_back(&self) -> bool {
        self.paused_since.is_some() || self.pacer.pace() != Pace::Max
    }

    /// `Break` once the end was asked for.
    pub(crate) fn go_on(&self) -> ControlFlow<()> {
        if self.stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Serves consumers and shows progress between two frames that are far apart.
    pub(crate) fn between_steps(&mut self, publisher: &mut Outlet) -> ControlFlow<()> {
        if self.is_due() {
            publisher.serve();
            self.show(publisher);
        }
        self.go_on()
    }

    /// Shows how far it is, and says who was dropped.
    pub(crate) fn show(&mut self, publisher: &mut Outlet) {
        self.refreshed = Instant::now();
        self.dropped.tell(publisher.take_events(), &self.bar);
        let counts = publisher.counts();
        let (step, time_s) = self.last;
        let pace = match (self.paused_since, self.pacer.pace()) {
            (Some(_), _) => "paused".to_owned(),
            (None, Pace::Max) => {
                let busy = self.start.elapsed().saturating_sub(self.paused);
                display::per_second((step - self.first_step) as f64 / busy.as_secs_f64(), "steps")
            }
            (None, Pace::PerSecond(per_second)) => format!("{}/s", seconds(per_second)),
        };
        let consumers = match (counts.lossless, counts.latest) {
            (0, 0) => String::new(),
            (lossless, 0) => format!("{lossless} lossless"),
            (0, latest) => format!("{latest} latest"),
            (lossless, latest) => format!("{lossless} lossless, {latest} latest"),
        };
        self.bar.set_position(step);
        let time = format!("t = {}", seconds(time_s));
        display::tell(&self.bar, &[&format!("step {}", count(step)), &time, &pace, &consumers, &self.note]);
    }

    /// Waits for a key, and does what it asks for; consumers are served meanwhile.
    fn nap(&mut self, at_most: Duration, next_s: f64, publisher: &mut Outlet) {
        publisher.serve();
        match self.keyboard {
            None => thread::sleep(at_most),
            Some(keyboard) => {
                if let Some(key) = keyboard.wait(at_most) {
                    self.obey(key, next_s);
                    self.show(publisher);
                }
            }
        }
        if self.refreshed.elapsed() >= REFRESH {
            self.show(publisher);
        }
    }

    /// Does what a key asks for, before simulated time goes on to `next_s`.
    fn obey(&mut self, key: Key, next_s: f64) {
        match (key, self.paused_since) {
            (Key::Pause, Some(since)) => {
                self.paused += since.elapsed();
                self.paused_since = None;
                self.steps = 0;
                self.pacer.change(self.pacer.pace(), self.paused_at_s);
            }
            (Key::Pause, None) => self.pause(next_s),
            (Key::Step, _) => {
                self.pause(next_s);
                self.steps += 1;
            }
            (Key::Faster, _) => self.change_pace(2.0, next_s),
            (Key::Slower, _) => self.change_pace(0.5, next_s),
            (Key::Seek(seek), _) if self.can_seek => {
                if seek == Seek::FrameBack {
                    self.pause(next_s);
                }
                self.seeks.push(seek);
            }
            // the flag is set
            (Key::Seek(_) | Key::Quit, _) => {}
        }
    }

    fn pause(&mut self, next_s: f64) {
        if self.paused_since.is_none() {
            self.speed = self.pacer.reached(self.last.1);
            self.paused_at_s = self.pacer.now_s(next_s);
            self.paused_since = Some(Instant::now());
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
        }
    }
}

/// Looks at the clock about every millisecond of work, since a look takes as long as a part of a small chain's step.
struct Clock {
    looked: Instant,
    /// Calls between two looks, and those since the last.
    every: u32,
    calls: u32,
}

impl Clock {
    /// So few that a look costs less than a hundredth of a step, and that slow frames are soon noticed.
    const MOST: u32 = 64;

    fn new(now: Instant) -> Self {
        Self { looked: now, every: 1, calls: 0 }
    }

    /// The time now, in one of several calls.
    fn look(&mut self) -> Option<Instant> {
        self.calls += 1;
        if self.calls < self.every {
            return None;
        }
        let now = Instant::now();
        let is_often = now.duration_since(self.looked) < CLOCK_EVERY;
        self.every = if is_often { (2 * self.every).min(Self::MOST) } else { (self.every / 2).max(1) };
        (self.looked, self.calls) = (now, 0);
        Some(now)
    }
}
