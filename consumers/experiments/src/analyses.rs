//! Everything that looks at the frames of a point.

use consumers::energies::{Energies, default_split_bead};
use consumers::pulses::{Direction, Happening, Measured, Pulse, Pulses};
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
    /// The last state, `[u | v | extra]`, and its step.
    pub(crate) state: Vec<f64>,
    pub(crate) step: u64,
}

impl Analyses {
    pub(crate) fn new(manifest: &RunManifest, split_bead: Option<u64>) -> Self {
        let split_bead = split_bead.unwrap_or_else(|| default_split_bead(manifest));
        let threshold_m_s = Pulses::DEFAULT_THRESHOLD * Pulses::velocity_scale_m_s(manifest);
        Self {
            energies: Energies::new(manifest, split_bead),
            pulses: Pulses::new(manifest, threshold_m_s),
            leading: [Direction::Forward, Direction::Backward].map(Leading::new),
            state: Vec::new(),
            step: 0,
        }
    }

    /// There are no more frames.
    pub(crate) fn finish(&mut self) {
        take_pulses(&mut self.leading, self.pulses.finish(), self.energies.split_bead());
    }

    /// The front of the last state.
    pub(crate) fn front_bead(&self, manifest: &RunManifest) -> u64 {
        let (u_m, rest) = self.state.split_at(manifest.physics.chain().bead_count());
        let (v_m_s, extra) = rest.split_at(u_m.len());
        let time_s = manifest.physics.time_s(self.step);
        let frame = Frame { frame: 0, step: self.step, time_s, u_m, v_m_s, extra };
        Summarizer::new(&manifest.physics).summarize(&frame).front_bead
    }
}

fn take_pulses(leading: &mut [Leading; 2], happenings: &[Happening], split_bead: u64) {
    for happening in happenings {
        if let Happening::Ended(pulse) = happening {
            for way in leading.iter_mut() {
                way.take(pulse, split_bead);
            }
        }
    }
}

impl FrameSink for Analyses {
    type Error = Infallible;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.energies.observe(frame);
        take_pulses(&mut self.leading, self.pulses.observe(frame), self.energies.split_bead());
        self.step = frame.step;
        self.state.clear();
        for part in [frame.u_m, frame.v_m_s, frame.extra] {
            self.state.extend_from_slice(part);
        }
        Ok(())
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
