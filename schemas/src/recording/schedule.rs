//! Which states a recording has: what the manifest says of each, and which ones are missing.

use super::decode::StateHead;
use super::head::BeginRecord;
use crate::manifest::RunManifest;

/// The states that a recording of a run holds from its beginning on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Schedule<'a> {
    manifest: &'a RunManifest,
    first_step: u64,
}

impl<'a> Schedule<'a> {
    pub(super) fn new(manifest: &'a RunManifest, begin: &BeginRecord) -> Self {
        Self { manifest, first_step: begin.first_step }
    }

    /// Step of the first state.
    pub(super) fn first_step(&self) -> u64 {
        self.first_step
    }

    /// The frame number of a state that is one of this run and comes after that of step `before`.
    pub(super) fn check(&self, before: Option<u64>, state: &StateHead) -> Result<Option<u64>, String> {
        let Self { manifest, first_step } = *self;
        let StateHead { frame, step, time_s } = *state;
        let last_step = manifest.physics.step_count;
        if step < first_step {
            return Err(format!("a state of step {step}, the recording begins with step {first_step}"));
        }
        if step > last_step {
            return Err(format!("a state of step {step}, the last of the run is {last_step}"));
        }
        if let Some(before) = before.filter(|before| *before >= step) {
            return Err(format!("the state of step {step} after that of step {before}"));
        }
        let expected_s = manifest.physics.time_s(step);
        if time_s.to_bits() != expected_s.to_bits() {
            return Err(format!("the state of step {step} at {time_s} s instead of {expected_s} s"));
        }
        match frame {
            Some(frame) if manifest.step_of_frame(frame) != step || frame >= manifest.frame_count() => {
                Err(format!("the state of step {step} as frame {frame}, which it is not"))
            }
            frame => Ok(frame),
        }
    }

    /// The frames between the state of step `before` and step `next` that should be there; with `next` itself, if
    /// `included`.
    pub(super) fn missed(&self, before: Option<u64>, next: u64, included: bool) -> Option<(u64, u64)> {
        let Self { manifest, first_step } = *self;
        let every = manifest.provenance.record_every_steps;
        let last_step = manifest.physics.step_count;
        let due = match before {
            None => first_step,
            Some(step) if step >= last_step => return None,
            Some(step) => (step / every + 1).saturating_mul(every).min(last_step),
        };
        let to = match (included, next.checked_sub(1)) {
            (true, _) => next,
            (false, Some(before)) => before / every * every,
            (false, None) => return None,
        };
        let frame_of = |step: u64| step.div_ceil(manifest.provenance.publish_every_steps);
        (due <= to).then(|| (frame_of(due), frame_of(to)))
    }
}
