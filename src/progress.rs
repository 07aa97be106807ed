//! Progress of long work: a bar on a terminal, which is written ten times a second however fast the work is.

use crate::display;
use indicatif::ProgressBar;
use schemas::manifest::RunManifest;
use std::time::{Duration, Instant};

/// Interval at which a person needs to see progress.
pub(crate) const REFRESH: Duration = Duration::from_millis(100);

/// A bar that goes away when the work is done, or when it is dropped.
pub(crate) struct Progress {
    bar: ProgressBar,
    shown: Instant,
}

impl Progress {
    /// Over `length` units.
    pub(crate) fn new(length: u64, label: &str) -> Self {
        Self { bar: display::progress_bar(length, label), shown: Instant::now() }
    }

    /// Over the steps of a run.
    pub(crate) fn of_run(manifest: &RunManifest) -> Self {
        Self::new(manifest.physics.step_count, manifest.provenance.name.as_str())
    }

    /// True if it is time to show progress again.
    pub(crate) fn is_due(&mut self) -> bool {
        let is_due = self.shown.elapsed() >= REFRESH;
        if is_due {
            self.shown = Instant::now();
        }
        is_due
    }

    /// Shows this position if it is time; whether it was.
    pub(crate) fn at(&mut self, position: u64) -> bool {
        let is_due = self.is_due();
        if is_due {
            self.bar.set_position(position);
        }
        is_due
    }

    /// Shows `parts` behind the bar, as many of the first ones as the terminal has room for.
    pub(crate) fn tell(&self, parts: &[&str]) {
        display::tell(&self.bar, parts);
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
