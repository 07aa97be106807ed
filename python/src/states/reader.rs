//! Reads states one after the other, from a file or from memory.

use producer::state::ChainState;
use recording::{ReadError, RecordingSource};
use schemas::frame::{EndReason, FrameSource, Received};
use schemas::manifest::RunManifest;
use std::sync::Arc;

/// Reads states in their order.
pub(super) enum Reader {
    File(Box<RecordingSource>),
    Memory { run: Arc<RunManifest>, states: Arc<Vec<ChainState>>, next: usize },
}

impl Reader {
    /// Goes to the last state at or before `step`.
    pub(super) fn seek(&mut self, step: u64) -> Result<(), ReadError> {
        match self {
            Self::File(file) => file.seek_to_step(step),
            Self::Memory { states, next, .. } => {
                *next = states.partition_point(|state| state.step <= step).saturating_sub(1);
                Ok(())
            }
        }
    }
}

impl FrameSource for Reader {
    type Error = ReadError;

    fn manifest(&self) -> &RunManifest {
        match self {
            Self::File(file) => file.manifest(),
            Self::Memory { run, .. } => run,
        }
    }

    fn receive(&mut self) -> Result<Received<'_>, ReadError> {
        match self {
            Self::File(file) => file.receive(),
            Self::Memory { run, states, next } => {
                *next += 1;
                let state = states.get(*next - 1).map(|state| state.as_frame(run, run.frame_at(state.step)));
                Ok(state.map_or(Received::End(EndReason::Complete), Received::Frame))
            }
        }
    }
}
