//! The spectrum of a whole chain over frequency and wavenumber.

use crate::segments::{Segments, Window, hann};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::PI;
use std::sync::Arc;

/// Power over ω ≥ 0 and q from −π to π (rad per bead) of a field over all beads; waves `cos(q·j − ωt)` to the right
/// have q > 0. Both directions have a Hann window; times are segments as in [`Segments`].
pub struct WaveMap {
    segments: Segments,
    beads: usize,
    window: Vec<f64>,
    transform: Arc<dyn Fft<f64>>,
    row: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    /// Power at each frequency: `beads` values, in the order of the transform.
    power: Vec<f64>,
}

impl WaveMap {
    /// Most samples in a segment times beads, so that a map takes less than 128 MiB.
    pub const MOST: usize = 1 << 22;

    /// The longest segment (samples) for `beads` beads.
    pub fn longest(beads: usize) -> usize {
        (Self::MOST / beads.max(1)).max(16)
    }

    /// Makes one for `beads` beads in segments of `length` samples.
    pub fn new(beads: usize, length: usize) -> Self {
        let segments = Segments::new(beads, length, Window::Hann);
        let transform = FftPlanner::new().plan_fft_forward(beads);
        Self {
            window: hann(beads + 1).split_off(1),
            row: vec![Complex::default(); beads],
            scratch: vec![Complex::default(); transform.get_inplace_scratch_len()],
            power: vec![0.0; beads * (segments.length() / 2 + 1)],
            transform,
            beads,
            segments,
        }
    }

    /// Adds the values of all beads at the next sample.
    pub fn push(&mut self, values: impl IntoIterator<Item = f64>) {
        let Some(spectra) = self.segments.push(values) else { return };
        for (line, power) in self.power.chunks_exact_mut(self.beads).enumerate() {
            for ((cell, spectrum), w) in self.row.iter_mut().zip(spectra).zip(&self.window) {
                *cell = spectrum[line] * *w;
            }
            self.transform.process_with_scratch(&mut self.row, &mut self.scratch);
            power.iter_mut().zip(&self.row).for_each(|(sum, x)| *sum += x.norm_sqr());
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

    /// The density (unit squared per Hz and rad/bead) with one row for each frequency from 0 on and a value for each of
    /// [`WaveMap::wavenumbers_rad`]: its integral over both is the mean square of the field under the windows.
    pub fn density(&self, rate_hz: f64) -> Vec<Vec<f64>> {
        let in_space: f64 = self.window.iter().map(|w| w * w).sum();
        let all = rate_hz * self.segments.window_power() * in_space * 2.0 * PI;
        let scale = 1.0 / (all * self.segments.count().max(1) as f64);
        let rows = self.power.chunks_exact(self.beads).enumerate();
        rows.map(|(line, power)| {
            let sides = self.segments.sides(line);
            self.order().map(|index| power[index] * sides * scale).collect()
        })
        .collect()
    }

    /// The wavenumbers (rad per bead), ascending.
    pub fn wavenumbers_rad(&self) -> Vec<f64> {
        let step = 2.0 * PI / self.beads as f64;
        let least = (self.beads - 1) / 2;
        (0..self.beads).map(|index| (index as f64 - least as f64) * step).collect()
    }

    /// The indices of the transform by ascending q: with frequencies from `exp(+iωt)` a wave to the right is at −q.
    fn order(&self) -> impl Iterator<Item = usize> {
        let (beads, least) = (self.beads, (self.beads - 1) / 2);
        (0..beads).map(move |index| (beads + least - index) % beads)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A wave to the right: all of its power at +q and its frequency, and its mean square ½ in total.
    #[test]
    fn a_wave_to_the_right_has_a_positive_wavenumber() {
        for beads in [31_u32, 32] {
            let (length, q_line, line) = (64, 5.0, 12.0);
            let count = beads as usize;
            let mut map = WaveMap::new(count, length);
            for i in 0..256_u32 {
                let t = TAU * line * f64::from(i) / length as f64;
                map.push((0..beads).map(|j| (TAU * q_line * f64::from(j) / f64::from(beads) - t).cos()));
            }
            let density = map.density(64.0);
            let q = map.wavenumbers_rad();
            assert!(q.is_sorted() && q[0] > -PI && q[count - 1] <= PI + 1e-12);
            let row = &density[12];
            let peak = (0..count).max_by(|a, b| row[*a].total_cmp(&row[*b])).expect("a peak");
            assert!((q[peak] - TAU * q_line / f64::from(beads)).abs() < 1e-12, "{}", q[peak]);
            let sum: f64 =
                density.iter().flatten().sum::<f64>() * (64.0 / length as f64) * (TAU / f64::from(beads));
            assert!((sum - 0.5).abs() < 1e-9, "{sum}");
        }
    }
}
