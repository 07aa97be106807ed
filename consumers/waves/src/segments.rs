//! Overlapping segments of several signals, windowed and transformed.

use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Weights of the samples of a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Window {
    /// By [`hann`]: for motion that lasts.
    Hann,
    /// All the same: for a pulse that comes and goes within one segment.
    None,
}

/// The periodic Hann window `½(1 − cos(2πi/n))`, `count` values: its copies at half of the length add up to 1.
pub fn hann(count: usize) -> Vec<f64> {
    (0..count).map(|i| 0.5 - 0.5 * (TAU * i as f64 / count as f64).cos()).collect()
}

/// Segments of `length` samples that overlap by half, unless they are [dense](Segments::dense). The mean of a segment is taken off; then it is multiplied by a
/// window and transformed.
pub struct Segments {
    length: usize,
    /// Samples from the beginning of a segment to that of the next one.
    hop: usize,
    window: Vec<f64>,
    transform: Arc<dyn RealToComplex<f64>>,
    /// Samples of the current segment, one list for each signal.
    samples: Vec<Vec<f64>>,
    windowed: Vec<f64>,
    spectra: Vec<Vec<Complex<f64>>>,
    scratch: Vec<Complex<f64>>,
    count: u64,
}

impl Segments {
    /// Segments of `length` samples (even, at least 4) of `signals` signals.
    pub fn new(signals: usize, length: usize, window: Window) -> Self {
        let length = (length.max(4) / 2) * 2;
        let transform = RealFftPlanner::new().plan_fft_forward(length);
        Self {
            length,
            hop: length / 2,
            window: match window {
                Window::Hann => hann(length),
                Window::None => vec![1.0; length],
            },
            samples: vec![Vec::with_capacity(length); signals],
            windowed: transform.make_input_vec(),
            spectra: vec![transform.make_output_vec(); signals],
            scratch: transform.make_scratch_vec(),
            transform,
            count: 0,
        }
    }

    /// The same with segments that overlap by 7/8.
    #[must_use]
    pub fn dense(self) -> Self {
        Self { hop: (self.length / 8).max(1), ..self }
    }

    /// Samples from the beginning of a segment to that of the next one.
    pub fn hop(&self) -> usize {
        self.hop
    }

    /// Samples in a segment.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Segments so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// `Σ w²` of the window.
    pub fn window_power(&self) -> f64 {
        self.window.iter().map(|w| w * w).sum()
    }

    /// Adds a sample of each signal. When a segment is full it gives the transform of each signal's, `length/2 + 1`
    /// values each.
    pub fn push(&mut self, values: impl IntoIterator<Item = f64>) -> Option<&[Vec<Complex<f64>>]> {
        for (samples, value) in self.samples.iter_mut().zip(values) {
            samples.push(value);
        }
        if self.samples.first().is_none_or(|samples| samples.len() < self.length) {
            return None;
        }
        for (samples, spectrum) in self.samples.iter_mut().zip(&mut self.spectra) {
            let mean = samples.iter().sum::<f64>() / self.length as f64;
            for ((windowed, sample), w) in self.windowed.iter_mut().zip(samples.iter()).zip(&self.window) {
                *windowed = (sample - mean) * w;
            }
            // it only fails for buffers of another length than those it has made
            let done = self.transform.process_with_scratch(&mut self.windowed, spectrum, &mut self.scratch);
            debug_assert!(done.is_ok());
            samples.drain(..self.hop);
        }
        self.count += 1;
        Some(&self.spectra)
    }

    /// Samples are missing: a new segment begins.
    pub fn restart(&mut self) {
        self.samples.iter_mut().for_each(Vec::clear);
    }

    /// The one-sided density of `|X|²` at `index` of a transform: twice as much where there is a negative frequency, too.
    pub fn sides(&self, index: usize) -> f64 {
        if index == 0 || index == self.length / 2 { 1.0 } else { 2.0 }
    }
}
