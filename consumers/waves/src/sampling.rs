//! Samples at equal times, as a Fourier transform needs them, from frames as they come.

/// Picks the frames that are samples: each a fixed number of steps after the one before. That number is the distance
/// of the first two frames; the last frame of a run, which may be nearer, is passed over.
#[derive(Debug, Clone, Default)]
pub struct Sampling {
    first: Option<u64>,
    interval_steps: Option<u64>,
    next: u64,
    count: u64,
    break_count: u64,
}

/// Role of a frame among the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Take {
    /// No sample.
    Skip,
    /// The sample after the one before.
    Next,
    /// A sample after a gap: what came before does not belong to it.
    AfterGap,
}

impl Sampling {
    /// Takes the frame at `step`, and gives its role.
    pub fn take(&mut self, step: u64) -> Take {
        let take = match (self.first, self.interval_steps) {
            (None, _) => {
                self.first = Some(step);
                Take::Next
            }
            (Some(first), None) if step > first => {
                self.interval_steps = Some(step - first);
                Take::Next
            }
            (Some(_), None) => Take::Skip,
            (Some(_), Some(_)) if step < self.next => Take::Skip,
            (Some(_), Some(_)) if step == self.next => Take::Next,
            _ => {
                self.break_count += 1;
                Take::AfterGap
            }
        };
        if take != Take::Skip {
            self.count += 1;
            self.next = step + self.interval_steps.unwrap_or(0);
        }
        take
    }

    /// Steps from a sample to the next one, as soon as there are two.
    pub fn interval_steps(&self) -> Option<u64> {
        self.interval_steps
    }

    /// Samples from the first one to `last_step`, as soon as there are two.
    pub fn expected(&self, last_step: u64) -> Option<u64> {
        Some(last_step.saturating_sub(self.first?) / self.interval_steps? + 1)
    }

    /// The step of the first sample.
    pub fn first(&self) -> Option<u64> {
        self.first
    }

    /// Number of intervals from the first sample to `step`.
    pub fn index(&self, step: u64) -> u64 {
        let since = step.saturating_sub(self.first.unwrap_or(step));
        self.interval_steps.map_or(0, |interval| since / interval)
    }

    /// Samples so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Number of gaps, each of one missing sample or more.
    pub fn break_count(&self) -> u64 {
        self.break_count
    }
}

/// The length (samples, even) of segments of which `segments` that overlap by half fill `samples`, within `least` and `most`.
pub fn segment_length(samples: u64, segments: u64, (least, most): (usize, usize)) -> usize {
    let wanted = samples.saturating_mul(2) / (segments + 1);
    let wanted = usize::try_from(wanted).unwrap_or(usize::MAX).clamp(least, most);
    wanted / 2 * 2
}

#[cfg(test)]
mod tests {
    use super::Take::{AfterGap, Next, Skip};
    use super::*;

    #[test]
    fn samples_are_equally_far_apart() {
        let mut sampling = Sampling::default();
        let steps = [0, 10, 20, 25, 30, 60, 70, 73];
        let takes = steps.map(|step| sampling.take(step));
        assert_eq!(takes, [Next, Next, Next, Skip, Next, AfterGap, Next, Skip]);
        assert_eq!((sampling.count(), sampling.break_count()), (6, 1));
        assert_eq!((sampling.interval_steps(), sampling.expected(73)), (Some(10), Some(8)));
    }

    #[test]
    fn segments_fill_the_samples_within_bounds() {
        assert_eq!(segment_length(10_001, 4, (64, 1 << 16)), 4000); // 0 to 4000, 2000 to 6000, …, 6000 to 10000
        assert_eq!(segment_length(10, 4, (64, 1 << 16)), 64);
        assert_eq!(segment_length(1 << 40, 4, (64, 1 << 16)), 1 << 16);
    }
}
