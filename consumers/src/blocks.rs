//! Averages of frames with standard errors from blocks, in memory that does not grow with the run.

/// Sums of some quantities over blocks of neighbouring frames.
///
/// Frames that follow each other are alike, so their scatter says too little. Means of long blocks are not: their scatter is that of the average. There are
/// 32 to 63 blocks once there are as many frames; when 64 are full, neighbours are put together.
#[derive(Debug, Clone)]
pub struct Blocks {
    width: usize,
    /// Sums of the blocks, one after the other; the last one may not be full.
    sums: Vec<f64>,
    /// Frames of a full block, and of all.
    length: u64,
    frames: u64,
    /// Sums of the squares of each quantity.
    squares: Vec<f64>,
}

/// A mean and its standard error; NaN where there are too few frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Its standard error.
    pub error: f64,
    /// Frames over which the quantity forgets itself: the integral of its autocorrelation from 0 on.
    pub memory_frames: f64,
}

/// Full blocks that are put together.
const MOST: usize = 64;
/// Fewest blocks with an error.
pub const FEWEST: usize = 8;

impl Blocks {
    /// No frames of `width` quantities.
    pub fn new(width: usize) -> Self {
        Self { width, sums: Vec::new(), length: 1, frames: 0, squares: vec![0.0; width] }
    }

    /// Adds a frame: a value of each quantity.
    pub fn push(&mut self, values: impl IntoIterator<Item = f64>) {
        if self.frames.is_multiple_of(self.length) {
            if self.sums.len() == MOST * self.width {
                self.halve();
            }
            self.sums.resize(self.sums.len() + self.width, 0.0);
        }
        let start = self.sums.len() - self.width;
        for ((sum, square), value) in self.sums[start..].iter_mut().zip(&mut self.squares).zip(values) {
            *sum += value;
            *square += value * value;
        }
        self.frames += 1;
    }

    fn halve(&mut self) {
        for block in 0..MOST / 2 {
            for i in 0..self.width {
                let [one, two] = [2 * block, 2 * block + 1].map(|from| self.sums[from * self.width + i]);
                self.sums[block * self.width + i] = one + two;
            }
        }
        self.sums.truncate(MOST / 2 * self.width);
        self.length *= 2;
    }

    /// Number of frames.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// The means of all quantities over each block that is full.
    pub fn means(&self) -> impl Iterator<Item = Vec<f64>> {
        let full = self
            .sums
            .chunks_exact(self.width.max(1))
            .zip(1..)
            .filter(|(_, end)| end * self.length <= self.frames);
        full.map(|(sums, _)| sums.iter().map(|sum| sum / self.length as f64).collect())
    }

    /// The average of a quantity.
    pub fn estimate(&self, quantity: usize) -> Estimate {
        let of_blocks = || self.sums.iter().skip(quantity).step_by(self.width);
        let frames = self.frames as f64;
        let mean = of_blocks().sum::<f64>() / frames;
        #[expect(clippy::cast_possible_truncation, reason = "at most 64")]
        let full = (self.frames / self.length) as usize; // integers
        if full < FEWEST {
            return Estimate { mean, error: f64::NAN, memory_frames: f64::NAN };
        }
        let (count, length) = (full as f64, self.length as f64);
        let middle = of_blocks().take(full).sum::<f64>() / (count * length);
        let scatter: f64 = of_blocks().take(full).map(|sum| (sum / length - middle).powi(2)).sum();
        let variance = scatter / (count * (count - 1.0));
        let of_a_frame = self.squares[quantity] / frames - mean * mean;
        let memory_frames = 0.5 * variance * count * length / of_a_frame;
        Estimate { mean, error: variance.sqrt(), memory_frames }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::random::normal;

    /// x ← c·x + ξ forgets itself in (1 + c)/(1 − c)/2 frames, and the error of its mean is √(2·memory·variance/frames).
    #[test]
    fn errors_are_those_of_a_process_with_memory() {
        let (c, frames) = (0.9, 100_000);
        let mut within = 0;
        for seed in 0..100 {
            let (mut blocks, mut x) = (Blocks::new(2), 0.0);
            for i in 0..frames {
                x = c * x + normal(seed, 1, i);
                blocks.push([x, 1.0]);
            }
            let Estimate { mean, error, memory_frames } = blocks.estimate(0);
            let variance = 1.0 / (1.0 - c * c);
            let expected = (2.0 * 9.5 * variance / frames as f64).sqrt();
            assert!(
                (error / expected - 1.0).abs() < 0.4 && (memory_frames / 9.5 - 1.0).abs() < 0.8,
                "{error} {memory_frames}"
            );
            within += u32::from(mean.abs() < error);
            assert_eq!(blocks.estimate(1).mean, 1.0);
            assert!(blocks.means().count() >= 32 && blocks.means().all(|means| means[1] == 1.0));
        }
        assert!((58..=78).contains(&within), "{within} of 100 within one error");
        let mut few = Blocks::new(1);
        few.push([3.0]);
        assert!(few.estimate(0).mean == 3.0 && few.estimate(0).error.is_nan());
    }
}
