//! Everything that looks at the frames of a point.

use crate::measures::Measures;
use consumers::energies::{Energies, default_split_bead};
use consumers::pulses::{Direction, Happening, Measured, Pulse, Pulses};
use consumers::table::Cell;
use schemas::frame::{Frame, FrameSink};
use schemas::manifest::RunManifest;
use schemas::summary::Summarizer;
use std::convert::Infallible;

/// Everything that looks at the frames of a point.
pub(crate) struct Analyses {
    pub(crate) energies: Energies,
    pub(crate) pulses: Pulses,
    /// Forward and backward.
    pub(crate) leading: [Leading; 2],
    /// All pulses in each of these directions.
    pub(crate) ways: [Way; 2],
    /// The measures that the sweep asks for beside.
    measures: Measures,
    /// The last state, `[u | v | extra]`, and its step.
    pub(crate) state: Vec<f64>,
    pub(crate) step: u64,
}

impl Analyses {
    /// The looks at the run of `manifest`, also for the columns of other analyses that are `asked` for.
    ///
    /// # Errors
    /// As [`Measures::new`].
    pub(crate) fn new(
        manifest: &RunManifest,
        split_bead: Option<u64>,
        asked: &[String],
    ) -> Result<Self, (usize, String)> {
        let split_bead = split_bead.unwrap_or_else(|| default_split_bead(manifest));
        let threshold_m_s = Pulses::DEFAULT_THRESHOLD * Pulses::velocity_scale_m_s(manifest);
        Ok(Self {
            energies: Energies::new(manifest, split_bead),
            pulses: Pulses::new(manifest, threshold_m_s),
            leading: [Direction::Forward, Direction::Backward].map(Leading::new),
            ways: [Direction::Forward, Direction::Backward].map(Way::new),
            measures: Measures::new(asked, manifest)?,
            state: Vec::new(),
            step: 0,
        })
    }

    /// There are no more frames.
    pub(crate) fn finish(&mut self) {
        let split_bead = self.energies.split_bead();
        take_pulses(&mut self.leading, &mut self.ways, self.pulses.finish(), split_bead);
    }

    /// The values that the sweep asks for, after [`Self::finish`].
    pub(crate) fn measured(&mut self, manifest: &RunManifest) -> Vec<Cell> {
        let measures = std::mem::take(&mut self.measures);
        measures.finish(&self.last_frame(manifest), self)
    }

    /// The front of the last state.
    pub(crate) fn front_bead(&self, manifest: &RunManifest) -> u64 {
        Summarizer::new(&manifest.physics).summarize(&self.last_frame(manifest)).front_bead
    }

    fn last_frame(&self, manifest: &RunManifest) -> Frame<'_> {
        let (u_m, rest) = self.state.split_at(manifest.contact_count() + 1);
        let (v_m_s, extra) = rest.split_at(u_m.len());
        let time_s = manifest.physics.time_s(self.step);
        Frame { frame: 0, step: self.step, time_s, u_m, v_m_s, extra }
    }
}

fn take_pulses(leading: &mut [Leading; 2], ways: &mut [Way; 2], happenings: &[Happening], split_bead: u64) {
    for happening in happenings {
        if let Happening::Ended(pulse) = happening {
            for way in leading.iter_mut() {
                way.take(pulse, split_bead);
            }
            for way in ways.iter_mut() {
                way.take(pulse);
            }
        }
    }
}

impl FrameSink for Analyses {
    type Error = Infallible;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.energies.observe(frame);
        let split_bead = self.energies.split_bead();
        take_pulses(&mut self.leading, &mut self.ways, self.pulses.observe(frame), split_bead);
        self.measures.observe(frame);
        self.step = frame.step;
        self.state.clear();
        for part in [frame.u_m, frame.v_m_s, frame.extra] {
            self.state.extend_from_slice(part);
        }
        Ok(())
    }
}

/// The pulses that travel in one direction.
#[derive(Debug, Clone)]
pub(crate) struct Way {
    pub(crate) direction: Direction,
    pub(crate) count: u64,
    /// The one of the largest peak velocity.
    pub(crate) strongest: Option<Pulse>,
}

impl Way {
    fn new(direction: Direction) -> Self {
        Self { direction, count: 0, strongest: None }
    }

    fn take(&mut self, pulse: &Pulse) {
        if pulse.direction == self.direction {
            self.count += 1;
            self.strongest = Pulse::stronger(self.strongest, Some(*pulse));
        }
    }
}

/// The pulses that leave the split bead in one direction: those that are measured beyond it.
#[derive(Debug, Clone)]
pub(crate) struct Leading {
    pub(crate) direction: Direction,
    pub(crate) count: u64,
    /// The one of the largest peak velocity.
    pub(crate) strongest: Option<Measured>,
}

impl Leading {
    fn new(direction: Direction) -> Self {
        Self { direction, count: 0, strongest: None }
    }

    fn take(&mut self, pulse: &Pulse, split_bead: u64) {
        let bead = pulse.measured.point.bead;
        let is_beyond = match self.direction {
            Direction::Forward => bead > split_bead,
            Direction::Backward => bead < split_bead,
        };
        if pulse.direction != self.direction || !is_beyond {
            return;
        }
        self.count += 1;
        let peak = |measured: &Measured| measured.point.v_peak_m_s.abs();
        if self.strongest.as_ref().is_none_or(|strongest| peak(&pulse.measured) > peak(strongest)) {
            self.strongest = Some(pulse.measured);
        }
    }
}
