//! Correlations by Fourier transforms: of rows of values over distance, and of a signal with itself over time.

use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

pub use realfft::num_complex::Complex;

/// Correlates rows of one length: `c_d = Σ_i a_(i+d)·b_i`, with indices modulo the length. Products of transforms may be added up
/// before they are transformed back.
pub struct Correlator {
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    values: Vec<f64>,
    scratch: Vec<Complex<f64>>,
}

impl Correlator {
    /// For rows of `length` values, 1 or more.
    pub fn new(length: usize) -> Self {
        let mut planner = RealFftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
        let scratch = forward.get_scratch_len().max(inverse.get_scratch_len());
        let none = Complex::new(0.0, 0.0);
        Self { values: forward.make_input_vec(), forward, inverse, scratch: vec![none; scratch] }
    }

    /// The transform of a row: `length/2 + 1` numbers. Values that are missing at its end are 0.
    pub fn transform(&mut self, row: impl IntoIterator<Item = f64>) -> Vec<Complex<f64>> {
        self.values.fill(0.0);
        self.values.iter_mut().zip(row).for_each(|(value, of_row)| *value = of_row);
        let mut found = self.forward.make_output_vec();
        // it only fails for buffers of another length than those it has made
        let done = self.forward.process_with_scratch(&mut self.values, &mut found, &mut self.scratch);
        debug_assert!(done.is_ok());
        found
    }

    /// The correlation whose transform is a sum of products `A·B*`, which is used up: that at the distance `−d` stands at `length − d`.
    pub fn correlation(&mut self, products: &mut [Complex<f64>]) -> &[f64] {
        // rows are real, and so are the products of their sums
        let done = self.inverse.process_with_scratch(products, &mut self.values, &mut self.scratch);
        debug_assert!(done.is_ok());
        let length = self.values.len() as f64;
        self.values.iter_mut().for_each(|value| *value /= length);
        &self.values
    }
}

/// The autocorrelation of a signal up to a lag, from windows of twice as many samples that overlap by half: each sample is the earlier one of a
/// pair for each lag.
pub struct Autocorrelation {
    lags: usize,
    correlator: Correlator,
    samples: Vec<f64>,
}

impl Autocorrelation {
    /// For lags up to `lags` samples, 1 or more.
    pub fn new(lags: usize) -> Self {
        Self { lags, correlator: Correlator::new(2 * lags), samples: Vec::with_capacity(2 * lags) }
    }

    /// The longest lag, in samples.
    pub fn lags(&self) -> usize {
        self.lags
    }

    /// Adds a sample. When a window is full it gives the mean of `x_i·x_(i+lag)` over the first half of its samples, for each lag from 0 to the longest one, and
    /// the mean of all of them.
    pub fn push(&mut self, value: f64) -> Option<(&[f64], f64)> {
        self.samples.push(value);
        if self.samples.len() < 2 * self.lags {
            return None;
        }
        let mean = self.samples.iter().sum::<f64>() / self.samples.len() as f64;
        let all = self.correlator.transform(self.samples.iter().copied());
        let mut products = self.correlator.transform(self.samples.drain(..self.lags));
        products.iter_mut().zip(all).for_each(|(earlier, later)| *earlier = later * earlier.conj());
        self.correlator.correlation(&mut products);
        let found = &mut self.correlator.values[..=self.lags];
        for sum in &mut *found {
            *sum /= self.lags as f64;
        }
        Some((found, mean))
    }

    /// Samples are missing: a new window begins.
    pub fn restart(&mut self) {
        self.samples.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(length: usize, seed: usize) -> Vec<f64> {
        (0..length).map(|i| ((i * i * 7 + seed * i + 3) % 11) as f64 - 4.5).collect()
    }

    #[test]
    fn rows_are_correlated_as_by_their_sum() {
        for length in [1, 2, 3, 4, 7, 16, 31] {
            let (mut correlator, a, b) = (Correlator::new(length), row(length, 5), row(length, 2));
            let (of_a, of_b) = (correlator.transform(a.clone()), correlator.transform(b.clone()));
            let mut products: Vec<_> = of_a.iter().zip(&of_b).map(|(a, b)| a * b.conj()).collect();
            let found = correlator.correlation(&mut products);
            for (d, found) in found.iter().enumerate() {
                let sum: f64 = (0..length).map(|i| a[(i + d) % length] * b[i]).sum();
                assert!((found - sum).abs() < 1e-11, "{length}, {d}: {found} {sum}");
            }
        }
    }

    #[test]
    fn a_window_pairs_its_first_half_with_later_samples() {
        for lags in [1, 2, 5] {
            let (x, mut signal, mut windows) = (row(8 * lags, 5), Autocorrelation::new(lags), 0);
            for (i, value) in x.iter().enumerate() {
                let Some((found, mean)) = signal.push(*value) else { continue };
                let first = i + 1 - 2 * lags;
                for (lag, found) in found.iter().enumerate() {
                    let sum: f64 = (first..first + lags).map(|i| x[i] * x[i + lag]).sum();
                    assert!((found - sum / lags as f64).abs() < 1e-11, "{lags}, {lag}");
                }
                let sum: f64 = x[first..=i].iter().sum();
                assert!((mean - sum / (2 * lags) as f64).abs() < 1e-14);
                windows += 1;
            }
            assert_eq!(windows, 7);
        }
    }
}
