//! Curves of bounded size, for figures of runs of any length.

/// Several quantities over time, in at most [`Series::CAPACITY`] points a curve.
///
/// As long as there is room, every sample is kept. Then neighbours are put together: of each stretch of samples the least and
/// the largest value of each quantity stay, at their own times, so that no swing is lost and none looks slower than it is.
/// Stretches have the same number of samples, a power of two; the first and the last sample are always there.
#[derive(Debug, Clone)]
pub struct Series<const COLUMNS: usize> {
    stretches: Vec<Stretch<COLUMNS>>,
    ends: Option<[Sample<COLUMNS>; 2]>,
    /// Samples in a stretch that is full.
    length: u64,
}

/// A time (s) and the values there.
type Sample<const COLUMNS: usize> = (f64, [f64; COLUMNS]);

/// The least and the largest value of some samples, with their times (s).
#[derive(Debug, Clone)]
struct Stretch<const COLUMNS: usize> {
    samples: u64,
    least: [(f64, f64); COLUMNS],
    largest: [(f64, f64); COLUMNS],
}

impl<const COLUMNS: usize> Stretch<COLUMNS> {
    fn of((time_s, values): Sample<COLUMNS>) -> Self {
        let points = values.map(|value| (time_s, value));
        Self { samples: 1, least: points, largest: points }
    }

    /// Puts those of a later stretch to these. What is no number gives way.
    fn extend(&mut self, later: &Self) {
        self.samples += later.samples;
        for column in 0..COLUMNS {
            let (least, largest) = (&mut self.least[column], &mut self.largest[column]);
            if least.1.is_nan() || later.least[column].1 < least.1 {
                *least = later.least[column];
            }
            if largest.1.is_nan() || later.largest[column].1 > largest.1 {
                *largest = later.largest[column];
            }
        }
    }

    /// Both in the order of their times; one point of a single sample. All quantities have equally many.
    fn points(&self, column: usize) -> impl Iterator<Item = (f64, f64)> {
        let (least, largest) = (self.least[column], self.largest[column]);
        let [first, second] = if least.0 <= largest.0 { [least, largest] } else { [largest, least] };
        std::iter::once(first).chain((self.samples > 1).then_some(second))
    }
}

impl<const COLUMNS: usize> Default for Series<COLUMNS> {
    fn default() -> Self {
        Self { stretches: Vec::new(), ends: None, length: 1 }
    }
}

impl<const COLUMNS: usize> Series<COLUMNS> {
    /// The largest number of points of a curve, but for its ends.
    pub const CAPACITY: usize = 1 << 14;

    /// Offers a sample at `time_s` (s).
    pub fn push(&mut self, time_s: f64, values: [f64; COLUMNS]) {
        let sample = (time_s, values);
        self.ends = Some([self.ends.map_or(sample, |[first, _]| first), sample]);
        let new = Stretch::of(sample);
        match self.stretches.last_mut() {
            Some(last) if last.samples < self.length => last.extend(&new),
            _ => {
                self.make_room();
                self.stretches.push(new);
            }
        }
    }

    /// Puts stretches together, two by two, where one more would be too many.
    fn make_room(&mut self) {
        let most = |length| if length == 1 { Self::CAPACITY } else { Self::CAPACITY / 2 };
        while self.stretches.len() >= most(self.length) {
            self.length *= 2;
            let mut kept: Vec<Stretch<COLUMNS>> = Vec::with_capacity(Self::CAPACITY / 2);
            for stretch in self.stretches.drain(..) {
                match kept.last_mut() {
                    Some(last) if last.samples < self.length => last.extend(&stretch),
                    _ => kept.push(stretch),
                }
            }
            self.stretches = kept;
        }
    }

    /// The times (s) of the first and the last sample.
    pub fn span_s(&self) -> Option<(f64, f64)> {
        self.ends.map(|[(first_s, _), (last_s, _)]| (first_s, last_s))
    }

    /// The values of one quantity.
    pub fn column(&self, column: usize) -> Vec<f64> {
        self.curve(column).map(|(_, value)| value).collect()
    }

    /// One quantity over time (s).
    pub fn curve(&self, column: usize) -> impl Iterator<Item = (f64, f64)> {
        let [first, last] = match self.ends.filter(|_| self.length > 1) {
            Some(ends) => ends.map(|(time_s, values)| Some((time_s, values[column]))),
            None => [None, None],
        };
        let middle = self.stretches.iter().flat_map(move |stretch| stretch.points(column));
        first.into_iter().chain(middle).chain(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_series_are_kept_whole() {
        for count in [1_u32, 10, 16_384] {
            let mut series = Series::default();
            (0..count).for_each(|i| series.push(f64::from(i), [2.0 * f64::from(i)]));
            let expected: Vec<_> = (0..count).map(|i| (f64::from(i), 2.0 * f64::from(i))).collect();
            assert_eq!(series.curve(0).collect::<Vec<_>>(), expected);
        }
    }

    /// Every 16th sample of a swing of 16 samples is the same: that would be a straight line.
    #[test]
    fn a_fast_swing_keeps_its_height_however_long_the_series_is() {
        for count in [16_385_u32, 40_000, 300_001, 1_000_000] {
            let mut series = Series::default();
            for i in 0..count {
                let phase = f64::from(i % 16);
                series.push(f64::from(i), [(phase - 8.0).abs(), if i == 12_345 { 1.0 } else { 0.0 }]);
            }
            let points: Vec<_> = series.curve(0).collect();
            assert!(points.len() <= Series::<2>::CAPACITY + 2, "{} points", points.len());
            assert!(points.windows(2).all(|pair| pair[0].0 <= pair[1].0), "in the order of times");
            assert_eq!(series.span_s(), Some((0.0, f64::from(count - 1))));
            assert_eq!((points[0].0, points[points.len() - 1].0), (0.0, f64::from(count - 1)));
            for part in points.chunks(64).filter(|part| part.len() == 64) {
                let (low, high) = part
                    .iter()
                    .fold((9.0_f64, 0.0_f64), |(low, high), (_, value)| (low.min(*value), high.max(*value)));
                assert_eq!((low, high), (0.0, 8.0), "{count} samples");
            }
            assert!(series.curve(1).any(|point| point == (12_345.0, 1.0)), "a single peak of {count}");
            assert_eq!(series.column(1).len(), points.len(), "quantities go together");
        }
    }
}
