//! Targets of the keys that seek.

use crate::args::ReplayArgs;
use crate::failure::{BadInput, Failure};
use crate::keyboard::Seek;
use recording::RecordingInfo;
use schemas::frame::Window;
use schemas::manifest::RunManifest;

/// Part of the replayed time that one key skips.
const JUMP: u64 = 20;

/// The time (s) of the frame at which the stream after this one begins, if `seeks` were asked for behind `step`, one
/// after the other. It lies within `whole` and what was recorded.
pub(super) fn target_s(
    args: &ReplayArgs,
    manifest: &RunManifest,
    whole: Window,
    step: u64,
    seeks: &[Seek],
) -> Result<f64, Failure> {
    let info = RecordingInfo::read(&args.file).bad_input()?;
    let physics = &manifest.physics;
    let from = physics.step_at_or_after(whole.from_s).max(info.first_step.unwrap_or(0));
    let until = physics.step_at_or_before(whole.until_s).min(info.last_step.unwrap_or(0));
    // of frames, as they are published
    let first = if manifest.is_frame(from) { manifest.frame_at(from) } else { manifest.frame_at(from) + 1 };
    let last = manifest.frame_at(until).max(first);
    let jump = ((last - first) / JUMP).max(1);
    let frame = seeks.iter().fold(manifest.frame_at(step), |frame, seek| {
        let wanted = match seek {
            Seek::FrameBack => frame.saturating_sub(1),
            Seek::Back => frame.saturating_sub(jump),
            Seek::On => frame.saturating_add(jump),
            Seek::Home => first,
        };
        wanted.clamp(first, last)
    });
    Ok(physics.time_s(manifest.step_of_frame(frame)))
}
