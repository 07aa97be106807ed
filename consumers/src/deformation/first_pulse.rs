//! Keeps the first pulse at a contact, in bounded memory.

use super::Untold;
use super::curve::{self, Sample, Shape};

/// A pulse begins and ends where the overlap passes this part of the collision length L: far above
/// rounding, which is 1e-14 of it, and far below the differences of a comparison.
pub const CLOSED: f64 = 1e-9;

/// A disturbance below this part of L is not a pulse.
pub const COUNTED: f64 = 1e-6;

/// Between two pulses of a train the overlap falls below this part of the first peak …
const BETWEEN: f64 = 0.5;

/// … and then rises by this part of it.
const RISE: f64 = 0.01;

/// The first pulse at a contact, sample by sample.
#[derive(Debug, Clone)]
pub struct FirstPulse {
    closed_m: f64,
    counted_m: f64,
    /// True of a bond: what stretches it is no gap.
    is_bond: bool,
    phase: Phase,
    /// The sample before the pulse, then those of the pulse.
    samples: Vec<Sample>,
    /// Every how many samples of the pulse one is kept, and how many there were.
    stride: u64,
    offered: u64,
    peak_m: f64,
    /// The smallest overlap after the peak, and its sample.
    lowest: Option<(usize, f64)>,
    later_count: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// No sample yet, or none since a gap.
    Blind,
    /// Not closed so far.
    Before,
    /// The pulse passes.
    During,
    /// It has passed; whether another one passes.
    After { another: bool },
    /// Frames of the pulse are missing.
    Broken,
    /// A bond was stretched before a pulse pressed it.
    Stretched,
}

impl FirstPulse {
    /// The largest number of samples kept: beyond it every second one is dropped.
    pub const CAPACITY: usize = 1 << 15;

    /// Waits for a pulse, with the collision length `length_m` (m), at a contact or a bond.
    pub fn new(length_m: f64, is_bond: bool) -> Self {
        Self {
            closed_m: CLOSED * length_m,
            counted_m: COUNTED * length_m,
            is_bond,
            phase: Phase::Blind,
            samples: Vec::new(),
            stride: 1,
            offered: 0,
            peak_m: 0.0,
            lowest: None,
            later_count: 0,
        }
    }

    /// Looks at the next sample.
    pub fn push(&mut self, sample: Sample) {
        let closed = sample.overlap_m > self.closed_m;
        match self.phase {
            Phase::Blind if closed => self.phase = Phase::Broken,
            Phase::Blind | Phase::Before if self.is_bond && -sample.overlap_m > self.counted_m => {
                self.phase = Phase::Stretched;
            }
            Phase::Blind | Phase::Before if !closed => {
                self.phase = Phase::Before;
                self.samples.clear();
                self.samples.push(sample);
            }
            Phase::Blind | Phase::Before => {
                self.phase = Phase::During;
                self.peak_m = sample.overlap_m;
                self.keep(sample);
            }
            Phase::During => self.pass(sample, closed),
            Phase::After { another } => {
                let begins = !another && sample.overlap_m > self.counted_m;
                self.later_count += u64::from(begins);
                self.phase = Phase::After { another: closed && (another || begins) };
            }
            Phase::Broken | Phase::Stretched => {}
        }
    }

    /// Samples are missing before the next one.
    pub fn gap(&mut self) {
        self.phase = match self.phase {
            Phase::Blind | Phase::Before => Phase::Blind,
            Phase::During | Phase::Broken => Phase::Broken,
            told @ (Phase::After { .. } | Phase::Stretched) => told,
        };
    }

    /// The samples of the pulse, with those just before and behind it.
    pub fn samples(&self) -> &[Sample] {
        match self.phase {
            Phase::During | Phase::After { .. } => &self.samples,
            Phase::Blind | Phase::Before | Phase::Broken | Phase::Stretched => &[],
        }
    }

    /// Pulses that began later.
    pub fn later_count(&self) -> u64 {
        self.later_count
    }

    /// The shape of the pulse; `force` is the force (N) of an overlap (m).
    ///
    /// # Errors
    /// When it has not passed, or frames of it are missing.
    pub fn shape(&self, force: impl Fn(f64) -> f64) -> Result<Shape, Untold> {
        match self.phase {
            Phase::Blind | Phase::Before => Err(Untold::NoPulse),
            Phase::During => Err(Untold::Unfinished),
            Phase::Broken => Err(Untold::Gap),
            Phase::Stretched => Err(Untold::Stretched),
            Phase::After { .. } => curve::shape(&self.samples, force),
        }
    }

    fn pass(&mut self, sample: Sample, closed: bool) {
        self.keep(sample);
        if !closed {
            self.end(sample);
            return;
        }
        if sample.overlap_m > self.peak_m {
            self.peak_m = sample.overlap_m;
            self.lowest = None;
        } else if self.lowest.is_none_or(|(_, lowest_m)| sample.overlap_m <= lowest_m) {
            self.lowest = Some((self.samples.len(), sample.overlap_m));
        }
        let between = self.lowest.filter(|(_, lowest_m)| {
            *lowest_m < BETWEEN * self.peak_m && sample.overlap_m > lowest_m + RISE * self.peak_m
        });
        if let Some((length, _)) = between {
            // the next pulse has begun where the overlap was smallest
            self.samples.truncate(length);
            self.later_count = 1;
            self.phase = Phase::After { another: true };
        }
    }

    /// Ends the pulse with an open contact; anything smaller is forgotten.
    fn end(&mut self, sample: Sample) {
        if self.peak_m > self.counted_m {
            self.phase = Phase::After { another: false };
            return;
        }
        let length_m = self.closed_m / CLOSED;
        *self = Self { phase: Phase::Before, samples: vec![sample], ..Self::new(length_m, self.is_bond) };
    }

    fn keep(&mut self, sample: Sample) {
        let due = self.offered.is_multiple_of(self.stride);
        self.offered += 1;
        if !due {
            return;
        }
        if self.samples.len() == Self::CAPACITY {
            let mut stays = [true, false].into_iter().cycle();
            self.samples.retain(|_| stays.next() == Some(true));
            self.stride *= 2;
            self.lowest = self.lowest.map(|(length, lowest_m)| (length.div_ceil(2), lowest_m));
        }
        self.samples.push(sample);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn push_all(pulse: &mut FirstPulse, overlaps_m: impl IntoIterator<Item = f64>) {
        for overlap_m in overlaps_m {
            let time_s = pulse.offered as f64;
            pulse.push(Sample { time_s, overlap_m, rate_m_s: 0.0 });
        }
    }

    #[test]
    fn a_train_is_cut_where_the_overlap_is_smallest() {
        let mut pulse = FirstPulse::new(1.0, false);
        push_all(&mut pulse, [0.0, 0.5, 2.0, 1.5, 0.6, 0.5, 0.505, 0.6, 1.0, 0.0, 0.0, 0.3, 0.0]);
        let overlaps: Vec<_> = pulse.samples().iter().map(|sample| sample.overlap_m).collect();
        assert_eq!(overlaps, [0.0, 0.5, 2.0, 1.5, 0.6, 0.5]);
        assert_eq!(pulse.later_count(), 2);
    }

    #[test]
    fn what_hardly_closes_a_contact_is_no_pulse() {
        let mut pulse = FirstPulse::new(1.0, false);
        push_all(&mut pulse, [0.0, 2e-9, 5e-8, 0.0, 1e-10, 0.3, 0.0, 3e-8, 0.0]);
        let overlaps: Vec<_> = pulse.samples().iter().map(|sample| sample.overlap_m).collect();
        assert_eq!((overlaps, pulse.later_count()), (vec![1e-10, 0.3, 0.0], 0));
    }

    #[test]
    fn what_was_not_seen_whole_is_not_told() {
        let told = |pulse: &FirstPulse| pulse.shape(|_| 0.0).map(|_| ());
        let mut pulse = FirstPulse::new(1.0, false);
        assert_eq!(told(&pulse), Err(Untold::NoPulse));
        push_all(&mut pulse, [0.0, 1.0]);
        assert_eq!(told(&pulse), Err(Untold::Unfinished));
        pulse.gap();
        push_all(&mut pulse, [0.5, 0.0]);
        assert_eq!(told(&pulse), Err(Untold::Gap));
        // attached while it passes
        let mut pulse = FirstPulse::new(1.0, false);
        push_all(&mut pulse, [1.0, 0.0, 0.0]);
        assert_eq!(told(&pulse), Err(Untold::Gap));
    }

    #[test]
    fn a_bond_that_is_stretched_first_has_no_first_pulse() {
        let mut pulse = FirstPulse::new(1.0, true);
        push_all(&mut pulse, [0.0, -1e-9, -0.5, 0.0, 0.3, 0.0]);
        assert_eq!((pulse.shape(|_| 0.0), pulse.samples()), (Err(Untold::Stretched), &[][..]));
        let mut pulse = FirstPulse::new(1.0, true);
        push_all(&mut pulse, [0.0, -1e-9, 0.1, 0.5, 0.1, 0.0, -0.5]);
        assert_eq!(pulse.samples().len(), 5);
    }

    #[test]
    fn memory_is_bounded() {
        let mut pulse = FirstPulse::new(1.0, false);
        push_all(&mut pulse, [0.0]);
        push_all(&mut pulse, (0..200_000_u32).map(|i| 1.0 + f64::from(i)));
        assert!(pulse.samples().len() <= FirstPulse::CAPACITY);
        assert!(pulse.samples().last().expect("kept").overlap_m > 199_000.0);
    }
}
