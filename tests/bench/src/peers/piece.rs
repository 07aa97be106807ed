//! A piece of the run that everybody simulates.

use crate::dynamics::light_impurity;
use crate::recordings;
use anyhow::Error;
use producer::integrator::Integrator;
use producer::state::ChainState;
use recording::{RecordingWriter, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink as _};
use schemas::manifest::RunManifest;
use std::path::Path;
use std::time::{Duration, Instant};

/// Result of a program: the time of the steps by the program's own clock, and the last velocities.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Outcome {
    pub(super) time: Duration,
    /// Velocities of the beads (m/s).
    pub(super) v_m_s: Vec<f64>,
}

/// Steps of the light-impurity run by velocity-Verlet, and which of their states are kept.
pub(super) struct Piece {
    pub(super) manifest: RunManifest,
    pub(super) start: ChainState,
    pub(super) steps: u64,
    /// A state is kept every so many steps; none if 0.
    pub(super) every: u64,
}

impl Piece {
    pub(super) fn whole() -> Result<Self, Error> {
        let manifest = manifest(1)?;
        let (start, steps) = (ChainState::initial(&manifest.physics), manifest.physics.step_count);
        Ok(Self { manifest, start, steps, every: 0 })
    }

    /// A quarter of the run.
    pub(super) fn one_in_100() -> Result<Self, Error> {
        let manifest = manifest(100)?;
        let steps = manifest.physics.step_count / 400 * 100;
        Ok(Self { start: middle(&manifest), manifest, steps, every: 100 })
    }

    /// As many steps as others can write in some seconds.
    pub(super) fn every_state() -> Result<Self, Error> {
        let manifest = manifest(1)?;
        Ok(Self { start: middle(&manifest), manifest, steps: 4000, every: 1 })
    }

    /// Velocity (m/s) of the striker.
    pub(super) fn striker_m_s(&self) -> f64 {
        self.manifest.physics.striker.velocity_m_s
    }

    pub(super) fn bead_steps(&self) -> f64 {
        (self.manifest.physics.beads * self.steps) as f64
    }

    /// Makes the steps as a run does, recording in `directory` what is to be kept.
    pub(super) fn simulate(&self, directory: &Path) -> Result<Outcome, Error> {
        let began = Instant::now();
        let mut state = self.start.clone();
        let mut integrator = Integrator::new(&self.manifest.physics);
        let mut writer = if self.every == 0 { None } else { Some(self.recording(directory)?) };
        let last = state.step + self.steps;
        while state.step < last {
            let kept = state.step.checked_div(self.every).map(|before| (before + 1) * self.every);
            integrator.advance(&mut state, kept.filter(|kept| *kept < last).unwrap_or(last));
            if let Some(writer) = &mut writer
                && self.manifest.is_recorded(state.step)
            {
                writer.accept(&self.frame(&state))?;
            }
        }
        if let Some(writer) = writer {
            writer.finish(EndReason::Interrupted)?;
        }
        Ok(Outcome { time: began.elapsed(), v_m_s: state.v_m_s.to_vec() })
    }

    /// A recording with the first state.
    fn recording(&self, directory: &Path) -> Result<RecordingWriter, Error> {
        let options = WriteOptions { force: true, ..WriteOptions::default() };
        let mut writer =
            RecordingWriter::create(&directory.join("states.mcap"), &self.manifest, "", &options)?;
        writer.accept(&self.frame(&self.start))?;
        Ok(writer)
    }

    fn frame<'a>(&self, state: &'a ChainState) -> Frame<'a> {
        state.as_frame(&self.manifest, self.manifest.frame_at(state.step))
    }
}

fn manifest(record_every_steps: u64) -> Result<RunManifest, Error> {
    Ok(recordings::manifest(&light_impurity())?.recorded_every(record_every_steps)?)
}

/// A state from the middle of the run, when the impurity rattles and waves travel both ways.
fn middle(manifest: &RunManifest) -> ChainState {
    let (mut state, mut integrator) =
        (ChainState::initial(&manifest.physics), Integrator::new(&manifest.physics));
    while state.step < manifest.physics.step_count / 200 * 100 {
        integrator.step(&mut state);
    }
    state
}
