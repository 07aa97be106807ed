//! Power spectral densities by Welch's method.
//!
//! # Source
//! P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70, doi:10.1109/TAU.1967.1161901; J. S. Bendat and A. G.
//! Piersol, *Random Data*, 4th ed. (Wiley 2010), chapter 6 (the estimate H₁ and the coherence).

use crate::sampling::segment_length;
use crate::segments::{Segments, Window};
use realfft::num_complex::Complex;

/// Auto spectra of several signals, and cross spectra of pairs of them, as means over segments.
pub struct Welch {
    segments: Segments,
    auto: Vec<Vec<f64>>,
    pairs: Vec<(usize, usize)>,
    cross: Vec<Vec<Complex<f64>>>,
}

/// Linear transmission from one signal to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Transmission {
    /// `|H₁|` at each frequency, `H₁ = S_ab/S_aa`; NaN where the first signal has nothing.
    pub gain: Vec<f64>,
    /// The phase of `H₁` (rad), −π to π: negative where the second signal comes later.
    pub phase_rad: Vec<f64>,
    /// `|S_ab|²/(S_aa·S_bb)`, 0 to 1: the part of the second signal that follows the first one linearly.
    pub coherence: Vec<f64>,
    /// Its mean, weighted with the second signal's power.
    pub mean_coherence: f64,
}

/// A summary of a density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DensitySummary {
    /// Its integral.
    pub mean_square: f64,
    /// The frequency (Hz) of its largest value, and that; none where all are 0.
    pub peak: Option<[f64; 2]>,
}

impl DensitySummary {
    /// Makes one for a density at evenly spaced frequencies from 0. The peak leaves out frequency 0.
    pub fn of(frequencies_hz: &[f64], density: &[f64]) -> Self {
        let step_hz = frequencies_hz.get(1).copied().unwrap_or(0.0);
        let highest = (1..density.len()).max_by(|a, b| density[*a].total_cmp(&density[*b]));
        let highest = highest.filter(|line| density[*line] > 0.0);
        Self {
            mean_square: density.iter().sum::<f64>() * step_hz,
            peak: highest.map(|line| [frequencies_hz[line], density[line]]),
        }
    }
}

impl Welch {
    /// Makes one for `signals` signals in segments of `length` samples; `pairs` of them are compared.
    pub fn new(signals: usize, length: usize, pairs: &[(usize, usize)], window: Window) -> Self {
        let segments = Segments::new(signals, length, window);
        let lines = segments.length() / 2 + 1;
        Self {
            auto: vec![vec![0.0; lines]; signals],
            pairs: pairs.to_vec(),
            cross: vec![vec![Complex::default(); lines]; pairs.len()],
            segments,
        }
    }

    /// Like [`Welch::new`], in segments of a length that suits `samples` samples: so that 4 of them, which overlap by half, fill
    /// these, or without a window one alone.
    pub fn for_samples(signals: usize, samples: u64, pairs: &[(usize, usize)], window: Window) -> Self {
        let (segments, longest) = match window {
            Window::Hann => (4, 1 << 16),
            Window::None => (1, 1 << 20),
        };
        Self::new(signals, segment_length(samples, segments, (64, longest)), pairs, window)
    }

    /// Adds a sample of each signal.
    pub fn push(&mut self, values: impl IntoIterator<Item = f64>) {
        let Some(spectra) = self.segments.push(values) else { return };
        for (sum, spectrum) in self.auto.iter_mut().zip(spectra) {
            sum.iter_mut().zip(spectrum).for_each(|(sum, x)| *sum += x.norm_sqr());
        }
        for (sum, (a, b)) in self.cross.iter_mut().zip(&self.pairs) {
            let lines = spectra[*a].iter().zip(&spectra[*b]);
            sum.iter_mut().zip(lines).for_each(|(sum, (x, y))| *sum += x.conj() * y);
        }
    }

    /// Samples are missing.
    pub fn restart(&mut self) {
        self.segments.restart();
    }

    /// The segments so far.
    pub fn segments(&self) -> &Segments {
        &self.segments
    }

    /// The frequencies (Hz) for samples at `rate_hz`.
    pub fn frequencies_hz(&self, rate_hz: f64) -> Vec<f64> {
        let length = self.segments.length();
        (0..=length / 2).map(|line| line as f64 * rate_hz / length as f64).collect()
    }

    /// The one-sided power spectral density of a signal (its unit squared, per Hz): its integral over frequency is the mean
    /// square of the signal, less its mean.
    pub fn density(&self, signal: usize, rate_hz: f64) -> Vec<f64> {
        let scale = 1.0 / (rate_hz * self.segments.window_power() * self.segments.count().max(1) as f64);
        let lines = self.auto[signal].iter().enumerate();
        lines.map(|(line, power)| power * self.segments.sides(line) * scale).collect()
    }

    /// Transmission from the first signal of a pair to the second one: the estimate `H₁ = S_ab/S_aa`.
    pub fn transmission(&self, pair: usize) -> Transmission {
        let (a, b) = self.pairs[pair];
        let lines = || self.cross[pair].iter().zip(self.auto[a].iter().zip(&self.auto[b]));
        let weighted =
            lines().filter(|(_, (aa, _))| **aa > 0.0).map(|(cross, (aa, _))| cross.norm_sqr() / aa);
        Transmission {
            mean_coherence: weighted.sum::<f64>() / self.auto[b].iter().sum::<f64>(),
            gain: lines().map(|(cross, (aa, _))| cross.norm() / aa).collect(),
            phase_rad: lines().map(|(cross, _)| cross.arg()).collect(),
            coherence: lines().map(|(cross, (aa, bb))| cross.norm_sqr() / (aa * bb)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segments::hann;
    use std::f64::consts::{PI, TAU};

    /// Numbers without order, −½ to ½.
    fn noise(count: usize) -> Vec<f64> {
        let mut state = 1_u64;
        let next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / 2.0_f64.powi(53) - 0.5
        };
        std::iter::repeat_with(next).take(count).collect()
    }

    /// Parseval: the integral of the density is the mean square of the windowed signal, to rounding.
    #[test]
    fn the_density_integrates_to_the_mean_square() {
        let (length, rate_hz) = (256, 1e4);
        let samples = noise(1024);
        let mut welch = Welch::new(1, length, &[], Window::Hann);
        for sample in &samples {
            welch.push([3.0 + sample]);
        }
        assert_eq!(welch.segments().count(), 7);
        let integral: f64 = welch.density(0, rate_hz).iter().sum::<f64>() * rate_hz / length as f64;
        let window = hann(length);
        let power: f64 = window.iter().map(|w| w * w).sum();
        let of_segment = |segment: usize| {
            let part = &samples[segment * length / 2..][..length];
            let mean = part.iter().sum::<f64>() / length as f64;
            part.iter().zip(&window).map(|(x, w)| ((x - mean) * w).powi(2)).sum::<f64>() / power
        };
        let expected = (0..7).map(of_segment).sum::<f64>() / 7.0;
        assert!((integral / expected - 1.0).abs() < 1e-12, "{integral} {expected}");
    }

    /// A sine of amplitude 3 has the mean square 9/2, around its frequency.
    #[test]
    fn a_sine_is_where_it_belongs() {
        let (length, rate_hz, line) = (512, 2048.0, 40.0);
        let mut welch = Welch::new(1, length, &[], Window::Hann);
        (0..4 * 512_u32).for_each(|i| welch.push([3.0 * (TAU * line * f64::from(i) / length as f64).sin()]));
        let density = welch.density(0, rate_hz);
        let total: f64 = density.iter().sum::<f64>() * rate_hz / length as f64;
        assert!((total - 4.5).abs() < 1e-12, "{total}");
        // all of it in three lines of the Hann window
        let around: f64 = density[39..=41].iter().sum::<f64>() * rate_hz / length as f64;
        assert!((around - 4.5).abs() < 1e-12 && (welch.frequencies_hz(rate_hz)[40] - 160.0).abs() < 1e-12);
        let peak = |density: &[f64]| DensitySummary::of(&welch.frequencies_hz(rate_hz), density).peak;
        assert_eq!(peak(&density), Some([160.0, density[40]]));
        assert_eq!(peak(&vec![0.0; density.len()]), None);
    }

    /// Half of the signal, a quarter of a period later: |H| = ½ and the phase −π/2, coherent.
    #[test]
    fn transmission_has_gain_and_phase() {
        let length = 64;
        let mut welch = Welch::new(2, length, &[(0, 1)], Window::Hann);
        for i in 0..640_u32 {
            let phase = TAU * 8.0 * f64::from(i) / length as f64;
            welch.push([phase.sin(), 0.5 * (phase - PI / 2.0).sin()]);
        }
        let found = welch.transmission(0);
        assert!((found.gain[8] - 0.5).abs() < 1e-12 && (found.coherence[8] - 1.0).abs() < 1e-12);
        assert!((found.phase_rad[8] + PI / 2.0).abs() < 1e-12, "{}", found.phase_rad[8]);
    }

    /// A pulse of another shape and height later in the segment: the ratio of its transforms, whatever the time between.
    #[test]
    fn a_pulse_needs_no_window() {
        let mut welch = Welch::new(2, 512, &[(0, 1)], Window::None);
        for i in 0..512_i32 {
            let pulse = |middle: i32| (-f64::from(i - middle).powi(2) / 8.0).exp();
            welch.push([pulse(50), 0.25 * pulse(400)]);
        }
        let found = welch.transmission(0);
        assert!(found.gain[1..40].iter().all(|gain| (gain - 0.25).abs() < 1e-12), "{:?}", &found.gain[..40]);
    }

    #[test]
    fn nothing_is_transformed_across_a_gap() {
        let mut welch = Welch::new(1, 16, &[], Window::Hann);
        for _ in 0..2 {
            for sample in noise(15) {
                welch.push([sample]);
            }
            welch.restart();
        }
        assert_eq!(welch.segments().count(), 0);
    }
}
