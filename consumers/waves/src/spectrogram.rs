//! The spectrum of one place as it changes.

use crate::segments::{Segments, Window};

/// Power spectral densities of successive segments that overlap by 7/8, at most [`Spectrogram::COLUMNS`] of them: where a run has more, a
/// column is the mean over those that fall into it.
pub struct Spectrogram {
    segments: Segments,
    /// True after a gap, until a segment can begin a whole number of hops after the first sample.
    waits: bool,
    columns: Vec<Column>,
    /// Samples that a column covers, whole hops.
    column_samples: u64,
}

#[derive(Debug, Clone, Default)]
struct Column {
    power: Vec<f64>,
    count: u32,
}

impl Spectrogram {
    /// The largest number of columns.
    pub const COLUMNS: u64 = 500;

    /// Makes one for `samples` samples in segments of `length`.
    pub fn new(samples: u64, length: usize) -> Self {
        let segments = Segments::new(1, length, Window::Hann).dense();
        let column_samples = samples.div_ceil(Self::COLUMNS).next_multiple_of(segments.hop() as u64);
        Self { segments, waits: false, columns: Vec::new(), column_samples }
    }

    /// Adds the sample that is `index` samples after the first one.
    pub fn push(&mut self, index: u64, value: f64) {
        self.waits &= !index.is_multiple_of(self.segments.hop() as u64);
        if self.waits {
            return;
        }
        let begin = (index + 1).saturating_sub(self.segments.length() as u64);
        let Some(spectra) = self.segments.push([value]) else { return };
        let Ok(column) = usize::try_from(begin / self.column_samples) else { return };
        if self.columns.len() <= column {
            self.columns.resize(column + 1, Column::default());
        }
        let Column { power, count } = &mut self.columns[column];
        power.resize(spectra[0].len(), 0.0);
        power.iter_mut().zip(&spectra[0]).for_each(|(sum, x)| *sum += x.norm_sqr());
        *count += 1;
    }

    /// Samples are missing.
    pub fn restart(&mut self) {
        self.segments.restart();
        self.waits = true;
    }

    /// The segments so far.
    pub fn segments(&self) -> &Segments {
        &self.segments
    }

    /// Samples that a column covers.
    pub fn column_samples(&self) -> u64 {
        self.column_samples
    }

    /// Samples from the first one to the edge of the first column, so that the middle of a column is the mean of those of its segments.
    pub fn first_edge(&self) -> f64 {
        0.5 * (self.segments.length() as f64 - self.segments.hop() as f64)
    }

    /// The one-sided density (unit squared per Hz) of each column, one line more than half of a segment; none where no segment is.
    pub fn columns(&self, rate_hz: f64) -> impl Iterator<Item = Option<Vec<f64>>> {
        let scale = 1.0 / (rate_hz * self.segments.window_power());
        self.columns.iter().map(move |Column { power, count }| {
            let lines = power.iter().enumerate();
            let density =
                lines.map(|(line, power)| power * self.segments.sides(line) * scale / f64::from(*count));
            (*count > 0).then(|| density.collect())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A burst is where it is, whatever the lengths are, and after a gap.
    #[test]
    fn a_burst_has_its_time() {
        for (length, samples, at, gap) in [
            (614, 4000, 2000.0, 0),
            (512, 4000, 2000.0, 0),
            (64, 40_000, 21_234.0, 0),
            (100, 4000, 2500.0, 77),
        ] {
            let mut spectrogram = Spectrogram::new(samples, length);
            for i in (0..samples).filter(|i| !(1000..1000 + gap).contains(i)) {
                if gap > 0 && i == 1000 + gap {
                    spectrogram.restart();
                }
                let since = i as f64 - at;
                spectrogram.push(i, (-since * since / 4500.0).exp() * (0.9 * since).cos());
            }
            let [mut power, mut moment] = [0.0; 2];
            for (column, density) in spectrogram.columns(1.0).enumerate() {
                let middle =
                    spectrogram.first_edge() + (column as f64 + 0.5) * spectrogram.column_samples() as f64;
                let sum: f64 = density.iter().flatten().sum();
                (power, moment) = (power + sum, moment + sum * middle);
            }
            assert!((moment / power - at).abs() < 0.5, "{length}: {} for {at}", moment / power);
        }
    }

    /// A tone that doubles its frequency half way.
    #[test]
    fn a_tone_is_followed() {
        let mut spectrogram = Spectrogram::new(2048, 128);
        for i in 0..2048_u32 {
            let line = if i < 1024 { 8.0 } else { 16.0 };
            spectrogram.push(i.into(), (TAU * line * f64::from(i) / 128.0).sin());
        }
        let columns: Vec<_> = spectrogram.columns(128.0).flatten().collect();
        let peak = |column: &Vec<f64>| (0..65).max_by(|a, b| column[*a].total_cmp(&column[*b]));
        assert_eq!((peak(&columns[2]), peak(&columns[columns.len() - 2])), (Some(8), Some(16)));
        // the mean square of a sine: ½
        assert!((columns[2].iter().sum::<f64>() - 0.5).abs() < 1e-12);
    }
}
