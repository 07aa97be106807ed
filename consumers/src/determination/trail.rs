//! Course of the errors, in memory that does not grow.

use super::Quantity;

/// The errors of all quantities, in the order of [`Quantity::ALL`]: the largest of some looks in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The time (s) of the last of these looks.
    pub time_s: f64,
    /// Errors of the step.
    pub step: [f64; Quantity::COUNT],
    /// Errors of rounding.
    pub rounding: [f64; Quantity::COUNT],
}

impl Sample {
    /// The largest of both, until the later one.
    fn and(mut self, later: &Self) -> Self {
        self.time_s = later.time_s;
        let pairs =
            self.step.iter_mut().zip(&later.step).chain(self.rounding.iter_mut().zip(&later.rounding));
        for (largest, next) in pairs {
            *largest = if next > largest { *next } else { *largest };
        }
        self
    }
}

/// Samples evenly spread over the run; each holds the largest errors since the one before.
#[derive(Debug, Clone)]
pub struct Trail {
    kept: Vec<Sample>,
    open: Option<Sample>,
    /// Looks in the open sample, and in a whole one.
    looks: u64,
    width: u64,
}

impl Default for Trail {
    fn default() -> Self {
        Self { kept: Vec::new(), open: None, looks: 0, width: 1 }
    }
}

impl Trail {
    /// The largest number of samples kept; a figure shows no more.
    pub const CAPACITY: usize = 1024;
    /// Growth is exponential where it is a straight line on a logarithmic scale with this coefficient of
    /// determination.
    const STRAIGHT: f64 = 0.9;
    /// Error at which chaos has begun to saturate, in units of the scales.
    const SATURATED: f64 = 1e-3;

    pub(super) fn push(&mut self, sample: Sample) {
        self.open = Some(self.open.map_or(sample, |open| open.and(&sample)));
        self.looks += 1;
        if self.looks < self.width {
            return;
        }
        self.looks = 0;
        self.kept.extend(self.open.take());
        if self.kept.len() == Self::CAPACITY {
            self.kept = self.kept.chunks(2).map(|pair| pair[0].and(&pair[pair.len() - 1])).collect();
            self.width *= 2;
        }
    }

    /// The samples, in the order of time.
    pub fn samples(&self) -> impl Iterator<Item = &Sample> {
        self.kept.iter().chain(&self.open)
    }

    /// The rate λ (1/s) of `exp(λt)`, fitted by least squares to the logarithm of the difference to the moved twin (of the
    /// displacement or the velocity, whichever is larger) until it saturates. None where it is no such line, or does not reach `grown`.
    pub(super) fn growth_per_s(&self, grown: f64) -> Option<f64> {
        let difference = |sample: &Sample| sample.rounding[0].max(sample.rounding[1]);
        let differences = self.samples().map(|sample| (sample.time_s, difference(sample)));
        let points: Vec<(f64, f64)> = differences
            .take_while(|(_, difference)| *difference < Self::SATURATED)
            .filter(|(_, difference)| *difference > 0.0)
            .map(|(time_s, difference)| (time_s, difference.ln()))
            .collect();
        points.iter().find(|point| point.1 > grown.ln())?;
        let count = points.len() as f64;
        let mean = |part: fn(&(f64, f64)) -> f64| points.iter().map(part).sum::<f64>() / count;
        let (mean_t, mean_y) = (mean(|point| point.0), mean(|point| point.1));
        let sums = points.iter().fold([0.0; 3], |[tt, ty, yy], (t, y)| {
            let (t, y) = (t - mean_t, y - mean_y);
            [tt + t * t, ty + t * y, yy + y * y]
        });
        let [tt, ty, yy] = sums;
        (ty * ty >= Self::STRAIGHT * tt * yy && tt > 0.0).then(|| ty / tt)
    }
}
