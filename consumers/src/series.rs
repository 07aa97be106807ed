//! Curves of bounded size, for figures of runs of any length.

/// Samples of several quantities over time: at most [`Series::CAPACITY`] of them, evenly spread over
/// all that was offered.
///
/// When it is full, every second sample is dropped and from then on only every second one of those
/// offered is kept; the last one offered is always there.
#[derive(Debug, Clone)]
pub struct Series<const COLUMNS: usize> {
    kept: Vec<(f64, [f64; COLUMNS])>,
    last: Option<(f64, [f64; COLUMNS])>,
    stride: u64,
    offered: u64,
}

impl<const COLUMNS: usize> Default for Series<COLUMNS> {
    fn default() -> Self {
        Self { kept: Vec::new(), last: None, stride: 1, offered: 0 }
    }
}

impl<const COLUMNS: usize> Series<COLUMNS> {
    /// The largest number of samples kept.
    pub const CAPACITY: usize = 1 << 14;

    /// Offers a sample at `time_s` (s).
    pub fn push(&mut self, time_s: f64, values: [f64; COLUMNS]) {
        let due = self.offered.is_multiple_of(self.stride);
        self.offered += 1;
        if !due {
            self.last = Some((time_s, values));
            return;
        }
        self.last = None;
        if self.kept.len() == Self::CAPACITY {
            let mut position = 0;
            self.kept.retain(|_| {
                position += 1;
                position % 2 == 1
            });
            self.stride *= 2;
        }
        self.kept.push((time_s, values));
    }

    /// The times (s) of the samples.
    pub fn times_s(&self) -> Vec<f64> {
        self.samples().map(|(time_s, _)| *time_s).collect()
    }

    /// The values of one quantity.
    pub fn column(&self, column: usize) -> Vec<f64> {
        self.samples().map(|(_, values)| values[column]).collect()
    }

    /// One quantity over time (s).
    pub fn curve(&self, column: usize) -> impl Iterator<Item = (f64, f64)> {
        self.samples().map(move |(time_s, values)| (*time_s, values[column]))
    }

    fn samples(&self) -> impl Iterator<Item = &(f64, [f64; COLUMNS])> {
        self.kept.iter().chain(&self.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_series_are_kept_whole_and_long_ones_evenly() {
        for count in [10_u32, 16_384, 16_385, 300_001] {
            let mut series = Series::default();
            (0..count).for_each(|i| series.push(f64::from(i), [2.0 * f64::from(i)]));
            let times = series.times_s();
            assert!(times.len() <= Series::<1>::CAPACITY + 1);
            assert_eq!((times[0], times[times.len() - 1]), (0.0, f64::from(count - 1)));
            let gap = times[1] - times[0];
            assert!(times.windows(2).rev().skip(1).all(|pair| pair[1] - pair[0] == gap), "{count}");
            assert!(series.column(0).iter().zip(&times).all(|(value, t)| *value == 2.0 * t));
        }
    }
}
