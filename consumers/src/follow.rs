//! The one loop that reads a source.

use schemas::frame::{EndReason, Frame, FrameSource, Received, Window};

/// Something that looks at frames one by one.
pub trait FrameObserver {
    /// Error of the observer, such as a disk that is full.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Looks at the next frame.
    ///
    /// # Errors
    /// When a result cannot be kept; the frame then counts as received, but not as analysed.
    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), Self::Error>;

    /// Frames are missing before the next one: nothing may be interpolated across the gap.
    fn gap(&mut self) {}
}

/// Account of a source's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tally {
    /// Frames received.
    pub frame_count: u64,
    /// Frames published or due, but not received.
    pub missed_count: u64,
    /// First frame received.
    pub first_frame: Option<u64>,
    /// Last frame received.
    pub last_frame: Option<u64>,
    /// Last frame that was missed.
    pub last_missed: Option<u64>,
    /// Reason why it ended.
    pub end: EndReason,
    /// It ended because no more was asked for: the window ends before the source does.
    pub ended_as_asked: bool,
}

impl Default for Tally {
    /// Nothing received, nothing ended.
    fn default() -> Self {
        Self {
            frame_count: 0,
            missed_count: 0,
            first_frame: None,
            last_frame: None,
            last_missed: None,
            end: EndReason::Unfinished,
            ended_as_asked: false,
        }
    }
}

/// Reason why a source could not be followed to its end.
#[derive(Debug, thiserror::Error)]
pub enum FollowError<S: std::error::Error + 'static, A: std::error::Error + 'static> {
    /// The source failed; results before stay valid.
    #[error(transparent)]
    Source(S),
    /// The analysis failed.
    #[error(transparent)]
    Analysis(A),
}

/// Feeds `source` to `observer` until the source ends, counting in `tally`. `watch` sees the tally after
/// each frame, for a progress display.
///
/// # Errors
/// When the source or the analysis fails; `tally` then says how far it came.
pub fn follow<S: FrameSource, A: FrameObserver>(
    source: &mut S,
    observer: &mut A,
    tally: &mut Tally,
    watch: impl FnMut(&Tally),
) -> Result<(), FollowError<S::Error, A::Error>> {
    follow_within(source, observer, Window::WHOLE, tally, watch)
}

/// The same with the frames of `window` only. Where it ends before the source does, the end is
/// [`EndReason::Interrupted`]: early, but in order.
///
/// # Errors
/// As [`follow`].
pub fn follow_within<S: FrameSource, A: FrameObserver>(
    source: &mut S,
    observer: &mut A,
    window: Window,
    tally: &mut Tally,
    mut watch: impl FnMut(&Tally),
) -> Result<(), FollowError<S::Error, A::Error>> {
    let manifest = source.manifest().clone();
    let steps = window.steps(&manifest);
    let is_outside = |step| step < *steps.start() || window.until_s.is_finite() && step > *steps.end();
    loop {
        let step = match source.receive().map_err(FollowError::Source)? {
            Received::Frame(frame) if is_outside(frame.step) => frame.step,
            Received::Frame(frame) => {
                observer.observe(&frame).map_err(FollowError::Analysis)?;
                tally.frame_count += 1;
                tally.first_frame.get_or_insert(frame.frame);
                tally.last_frame = Some(frame.frame);
                watch(tally);
                frame.step
            }
            Received::Missed { from, to } => {
                if let Some((from, to)) = window.clip(&manifest, from, to) {
                    tally.missed_count += to - from + 1;
                    tally.last_missed = Some(to);
                    observer.gap();
                }
                manifest.step_of_frame(to)
            }
            Received::End(end) => {
                tally.end = end;
                return Ok(());
            }
        };
        if window.ends_at(&manifest, step) {
            tally.end = EndReason::Interrupted;
            tally.ended_as_asked = true;
            return Ok(());
        }
    }
}
