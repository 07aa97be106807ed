//! Which states a recording should have according to its manifest, and which are missing.

use crate::head::BeginRecord;
use crate::read::decode::StateHead;
use schemas::manifest::RunManifest;

/// The states that a recording of a run holds from its beginning on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Schedule<'a> {
    manifest: &'a RunManifest,
    first_step: u64,
}

impl<'a> Schedule<'a> {
    pub(crate) fn new(manifest: &'a RunManifest, begin: &BeginRecord) -> Self {
        Self { manifest, first_step: begin.first_step }
    }

    /// The frame number of a state that is one of this run and comes after that of step `before`.
    pub(crate) fn check(&self, before: Option<u64>, state: &StateHead) -> Result<Option<u64>, String> {
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

    /// Step of the state that comes next after that of step `before`; none after the last one of the run.
    fn due_after(&self, before: Option<u64>) -> Option<u64> {
        let Self { manifest, first_step } = *self;
        let every = manifest.provenance.record_every_steps;
        let last_step = manifest.physics.step_count;
        match before {
            None => (first_step <= last_step).then_some(first_step),
            Some(step) if step >= last_step => None,
            Some(step) => Some((step / every + 1).saturating_mul(every).min(last_step)),
        }
    }

    /// The frame that comes next after the state of step `before`; none after the last one of the run.
    pub(crate) fn frame_after(&self, before: Option<u64>) -> Option<u64> {
        self.due_after(before).map(|step| self.frame_of(step))
    }

    fn frame_of(&self, step: u64) -> u64 {
        step.div_ceil(self.manifest.provenance.publish_every_steps)
    }

    /// The frames between the state of step `before` and step `next` that should be there. If `included`, the frame of
    /// `next` is one of them, wherever `next` falls.
    pub(crate) fn missed(&self, before: Option<u64>, next: u64, included: bool) -> Option<(u64, u64)> {
        let Self { manifest, .. } = *self;
        let every = manifest.provenance.record_every_steps;
        let due = self.due_after(before)?;
        if included {
            // a state between frames is not in the schedule
            let is_last =
                manifest.is_frame(next) && before.map_or(self.first_step <= next, |before| before < next);
            let due = if is_last { due.min(next) } else { due };
            return (due <= next).then(|| (self.frame_of(due), self.frame_of(next)));
        }
        // the first state is due wherever it falls
        let to = due.max(next.checked_sub(1)? / every * every);
        (due < next).then(|| (self.frame_of(due), self.frame_of(to)))
    }
}
