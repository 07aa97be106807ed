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
    /// Frames over which the quantity forgets itself: the integral of its autocorrelation from 0 on. Infinite where the error still grows with the length
    /// of the blocks: the quantity remembers longer than they tell.
    pub memory_frames: f64,
}

/// Full blocks that are put together.
const MOST: usize = 64;
/// Fewest blocks with an error.
pub const FEWEST: usize = 8;
/// Errors of its own by which an error of longer blocks has to be larger to be taken, and to say that it grows on.
const LARGER: [f64; 2] = [1.5, 2.5];

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
        let (error, grows) = error_of(of_blocks().take(full).map(|sum| sum / length).collect());
        let of_a_frame = self.squares[quantity] / frames - mean * mean;
        let memory_frames = 0.5 * error * error * count * length / of_a_frame;
        Estimate { mean, error, memory_frames: if grows { f64::INFINITY } else { memory_frames } }
    }
}

/// The standard error of the mean of `blocks`, and true if it still grows with their length: that of their scatter, or the largest of longer ones (pairs of
/// them, and of these, down to two) where that is larger by more than chance. B blocks know their error to a part of `1/√(2·(B − 1))`.
///
/// # Source
/// H. Flyvbjerg and H. G. Petersen, J. Chem. Phys. 91 (1989) 461, DOI 10.1063/1.457480.
fn error_of(mut blocks: Vec<f64>) -> (f64, bool) {
    let error = |blocks: &[f64]| {
        let count = blocks.len() as f64;
        let mean = blocks.iter().sum::<f64>() / count;
        (blocks.iter().map(|block| (block - mean).powi(2)).sum::<f64>() / (count * (count - 1.0))).sqrt()
    };
    let first = error(&blocks);
    let (mut largest, mut grows) = (first, false);
    while blocks.len() >= 4 {
        blocks = blocks.chunks_exact(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        let longer = error(&blocks);
        let above = (longer / first - 1.0) * (2.0 * (blocks.len() - 1) as f64).sqrt();
        largest = if above > LARGER[0] { largest.max(longer) } else { largest };
        grows |= above > LARGER[1];
    }
    (largest, grows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::random::normal;

    /// x ← c·x + ξ once it has come to rest, and the number 1.
    fn of_process(seed: u64, c: f64, frames: u64) -> Blocks {
        let (mut blocks, mut x) = (Blocks::new(2), normal(seed, 2, 0) / (1.0 - c * c).sqrt());
        for i in 0..frames {
            x = c * x + normal(seed, 1, i);
            blocks.push([x, 1.0]);
        }
        blocks
    }

    /// x ← c·x + ξ forgets itself in (1 + c)/(1 − c)/2 frames, and the error of its mean is √(2·memory·variance/frames). With c = 0.98 the memory is as long as a
    /// block, and the scatter of these alone tells two thirds of the error; with c = 0.9995 it is as long as the run.
    #[test]
    fn errors_are_those_of_a_process_with_memory() {
        for (c, frames, room) in [(0.9, 100_000, 0.3), (0.98, 3_000, 0.5)] {
            let (mut within, mut growing, mut squares) = (0, 0, 0.0);
            let (memory, variance) = (0.5 * (1.0 + c) / (1.0 - c), 1.0 / (1.0 - c * c));
            let expected: f64 = (2.0 * memory * variance / frames as f64).sqrt();
            for seed in 0..100 {
                let blocks = of_process(seed, c, frames);
                let Estimate { mean, error, memory_frames } = blocks.estimate(0);
                within += u32::from(mean.abs() < error);
                growing += u32::from(memory_frames.is_infinite());
                squares += error * error / 100.0;
                assert!(memory_frames > 0.1 * memory, "{memory_frames}");
                assert_eq!(blocks.estimate(1).mean, 1.0);
                assert!(blocks.means().count() >= 32 && blocks.means().all(|means| means[1] == 1.0));
            }
            assert!((58..=78).contains(&within), "{within} of 100 within one error");
            assert!((squares.sqrt() / expected - 1.0).abs() < room, "{} {expected}", squares.sqrt());
            assert!(c > 0.9 || growing < 6, "{growing} of 100 without a memory");
        }
        let grows = |seed: &u64| of_process(*seed, 0.9995, 3_000).estimate(0).memory_frames.is_infinite();
        assert!((0..100).filter(grows).count() > 90);
        let mut few = Blocks::new(1);
        few.push([3.0]);
        assert!(few.estimate(0).mean == 3.0 && few.estimate(0).error.is_nan());
    }
}
