//! What `beadline spectrum` found, as tables, figures and words.

use super::{Asked, Engine, Linear, Samples};
use crate::analysis::table;
use crate::display::{self, count};
use crate::failure::Failure;
use crate::report::Rows;
use figure::Figure;
use plots::{Spectra, TransmissionCurve, WavesOver};
use schemas::manifest::RunManifest;
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::path::PathBuf;
use waves::grid::Grid;
use waves::segments::Window;
use waves::welch::{DensitySummary, Transmission};

/// What was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Spectra,
    Spectrogram,
    Map,
}

impl Kind {
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Spectra => "spectrum",
            Self::Spectrogram => "spectrogram",
            Self::Map => "wave map",
        }
    }
}

/// The densities.
pub(super) struct Found {
    pub(super) linear: Option<Linear>,
    /// The largest density in the highest tenth of the frequencies, over the largest of all.
    pub(super) at_the_end: f64,
    top_hz: f64,
    segment_length: usize,
    segment_count: u64,
    results: Results,
}

enum Results {
    Spectra { frequencies_hz: Vec<f64>, densities: Vec<Vec<f64>>, transmissions: Vec<Transmission> },
    Grid(Grid),
}

/// Turns sums into densities.
pub(super) fn found(
    asked: &Asked,
    engine: Engine,
    samples: &Samples,
    linear: Option<Linear>,
    max_hz: Option<f64>,
) -> Found {
    let (segment_length, segment_count) = (engine.segment_length(), engine.segment_count());
    let rate_hz = samples.rate_hz;
    let step_hz = rate_hz / segment_length as f64;
    let band_hz = linear.as_ref().map_or(0.0, Linear::top_hz);
    // largest density of each line, over places or times
    let over = |lists: &mut dyn Iterator<Item = &[f64]>| -> Vec<f64> {
        let mut largest = vec![0.0_f64; segment_length / 2 + 1];
        for list in lists {
            for (largest, value) in largest.iter_mut().zip(list) {
                *largest = if *value > *largest { *value } else { *largest };
            }
        }
        largest
    };
    let shown = |largest: &[f64]| max_hz.unwrap_or_else(|| shown_hz(largest, step_hz, band_hz));
    let (largest, top_hz, results) = match engine {
        Engine::Spectra(welch) => {
            let densities: Vec<_> =
                (0..asked.places.len()).map(|place| welch.density(place, rate_hz)).collect();
            let largest = over(&mut densities.iter().map(Vec::as_slice));
            let transmissions = (0..asked.pairs.len()).map(|pair| welch.transmission(pair)).collect();
            let frequencies_hz = welch.frequencies_hz(rate_hz);
            let top_hz = shown(&largest);
            (largest, top_hz, Results::Spectra { frequencies_hz, densities, transmissions })
        }
        Engine::Spectrogram(spectrogram) => {
            // the first segment has its middle half of its length after the first sample
            let empty = spectrogram.columns(rate_hz).take_while(Option::is_none).count();
            let columns: Vec<_> = spectrogram.columns(rate_hz).skip(empty).collect();
            let largest = over(&mut columns.iter().flatten().map(Vec::as_slice));
            let top_hz = shown(&largest);
            let wide_s = spectrogram.column_samples() as f64 / rate_hz;
            let from_s = samples.first_s + wide_s * empty as f64;
            let edges_s = (from_s, from_s + wide_s * columns.len() as f64);
            let at = |column: usize, line: usize| columns[column].as_ref()?.get(line).copied();
            let grid = Grid::new(edges_s, columns.len(), (step_hz, top_hz), at, largest.len());
            (largest, top_hz, Results::Grid(grid))
        }
        Engine::Map(map) => {
            let density = map.density(rate_hz);
            let highest = |row: &Vec<f64>| row.iter().fold(0.0_f64, |high, value| high.max(*value));
            let largest: Vec<f64> = density.iter().map(highest).collect();
            let top_hz = shown(&largest);
            let q = map.wavenumbers_rad();
            let half = PI / q.len() as f64;
            let edges = (q[0] - half, q[q.len() - 1] + half);
            let at = |column: usize, line: usize| density.get(line)?.get(column).copied();
            let grid = Grid::new(edges, q.len(), (step_hz, top_hz), at, largest.len());
            (largest, top_hz, Results::Grid(grid))
        }
    };
    let highest = |values: &[f64]| values.iter().fold(0.0_f64, |high, value| high.max(*value));
    let at_the_end = highest(&largest[largest.len() - largest.len() / 10..]) / highest(&largest[1..]);
    Found { linear, at_the_end, top_hz, segment_length, segment_count, results }
}

/// The highest frequency worth showing: above it there is less than 1e-6 of the largest density; but all of the bands.
fn shown_hz(largest: &[f64], step_hz: f64, band_hz: f64) -> f64 {
    let high = largest[1..].iter().fold(0.0_f64, |high, value| high.max(*value));
    let last = largest.iter().rposition(|value| *value >= 1e-6 * high).unwrap_or(largest.len() - 1);
    let nyquist_hz = (largest.len() - 1) as f64 * step_hz;
    let wanted_hz = if band_hz > 0.0 { 1.2 * band_hz } else { 1.1 * last as f64 * step_hz };
    wanted_hz.max(8.0 * step_hz).min(nyquist_hz)
}

impl Found {
    /// Writes the table.
    pub(super) fn write(&self, asked: &Asked, path: &PathBuf, force: bool) -> Result<(), Failure> {
        let unit = asked.quantity.density_column();
        let mut columns = Vec::new();
        match &self.results {
            Results::Spectra { .. } => {
                columns.push("frequency_hz".to_owned());
                columns.extend(asked.places.iter().map(|place| format!("psd_{}_{unit}", place.column())));
                for (from, to) in &asked.pairs {
                    let pair = format!("{}_{}", asked.places[*from].column(), asked.places[*to].column());
                    columns.extend([
                        format!("gain_{pair}"),
                        format!("phase_{pair}_rad"),
                        format!("coherence_{pair}"),
                    ]);
                }
            }
            Results::Grid(_) if asked.kind == Kind::Map => {
                columns.extend(["frequency_hz", "q_rad_per_bead"].map(str::to_owned));
                columns.push(format!("psd_{unit}_rad"));
            }
            Results::Grid(_) => {
                columns.extend(["frequency_hz", "time_s"].map(str::to_owned));
                columns.push(format!("psd_{}_{unit}", asked.places[0].column()));
            }
        }
        let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
        let Some(mut table) = table(Some(path), &columns, force)? else { return Ok(()) };
        match &self.results {
            Results::Spectra { frequencies_hz, densities, transmissions } => {
                for (line, frequency_hz) in frequencies_hz.iter().enumerate() {
                    table.double(*frequency_hz);
                    for density in densities {
                        table.double(density[line]);
                    }
                    for Transmission { gain, phase_rad, coherence, .. } in transmissions {
                        let coherence = Some(coherence[line]).filter(|_| self.has_coherence());
                        for value in [Some(gain[line]), Some(phase_rad[line]), coherence] {
                            table.optional(value.filter(|value| value.is_finite()));
                        }
                    }
                    table.end_row()?;
                }
            }
            Results::Grid(grid) => {
                let cells = grid.frequency_hz.iter().flat_map(|f| grid.x.iter().map(move |x| (*f, *x)));
                for ((frequency_hz, x), value) in cells.zip(&grid.values) {
                    table.double(frequency_hz).double(x).optional(*value);
                    table.end_row()?;
                }
            }
        }
        table.finish()?;
        Ok(())
    }

    pub(super) fn figure(&self, manifest: &RunManifest, asked: &Asked) -> Result<Figure, Failure> {
        let bands_hz = self.linear.as_ref().map_or(&[][..], |linear| &linear.bands_hz);
        let named = |index: &usize| asked.places[*index];
        Ok(match &self.results {
            Results::Spectra { frequencies_hz, densities, transmissions } => {
                let pairs = asked.pairs.iter().zip(transmissions);
                let transmissions = pairs.map(|((from, to), found)| TransmissionCurve {
                    from: named(from),
                    to: named(to),
                    found,
                });
                let transmissions: Vec<_> = transmissions.collect();
                plots::spectra(
                    manifest,
                    &Spectra {
                        quantity: asked.quantity,
                        frequencies_hz,
                        places: &asked.places,
                        densities,
                        transmissions: &transmissions,
                        segment_count: self.segment_count,
                        bands_hz,
                        top_hz: self.top_hz,
                    },
                )
            }
            Results::Grid(grid) => {
                let over = match (asked.kind, &self.linear) {
                    (Kind::Map, Some(linear)) => {
                        WavesOver::Wavenumber { dispersion: Some(&|q| linear.cell.frequencies_hz(q)) }
                    }
                    (Kind::Map, None) => WavesOver::Wavenumber { dispersion: None },
                    _ => WavesOver::Time { place: asked.places[0], bands_hz },
                };
                plots::wave_grid(manifest, asked.quantity, grid, &over)?
            }
        })
    }

    /// One segment alone is coherent with everything.
    fn has_coherence(&self) -> bool {
        self.segment_count > 1
    }

    fn transmissions(&self) -> &[Transmission] {
        match &self.results {
            Results::Spectra { transmissions, .. } => transmissions,
            Results::Grid(_) => &[],
        }
    }

    /// Says so if a place does not follow another one within the segments.
    pub(super) fn warn_of_incoherence(&self, asked: &Asked) {
        for ((from, to), found) in asked.pairs.iter().zip(self.transmissions()) {
            if self.has_coherence() && found.mean_coherence < 0.5 {
                notice!(
                    "{} follows {} with a coherence of {:.2}: segments of {} samples may be shorter than the way \
                     between them; --window none is for a pulse, a longer --segment for motion that lasts",
                    asked.places[*to],
                    asked.places[*from],
                    found.mean_coherence,
                    count(self.segment_length as u64)
                );
            }
        }
    }

    pub(super) fn rows(&self, asked: &Asked, samples: &Samples) -> Rows {
        let mut rows = Rows::default();
        let every = match samples.interval_steps {
            1 => "every step".to_owned(),
            steps => format!("every {steps} steps"),
        };
        let rate = display::quantity(samples.rate_hz, "Hz");
        rows.add("samples", format_args!("{} at {rate} ({every})", count(samples.count)));
        let (segments, samples_each) =
            (display::counted(self.segment_count, "segment"), count(self.segment_length as u64));
        let window = match (asked.kind, asked.window) {
            (Kind::Spectrogram, _) => "Hann, overlap 7/8",
            (_, Window::Hann) => "Hann, overlap 1/2",
            (_, Window::None) => "no window, overlap 1/2",
        };
        let resolution = display::quantity(samples.rate_hz / self.segment_length as f64, "Hz");
        rows.add(
            "estimate",
            format_args!("Welch, {segments} of {samples_each} ({window}), lines {resolution} apart"),
        );
        if let Some(linear) = &self.linear {
            rows.each("bands", linear.bands_hz.iter().map(|band| display::range(*band, "Hz")));
        }
        if let Results::Spectra { frequencies_hz, densities, .. } = &self.results {
            for (place, density) in asked.places.iter().zip(densities) {
                let DensitySummary { mean_square, peak_hz, peak } =
                    DensitySummary::of(frequencies_hz, density);
                let (rms, at) = (
                    display::quantity(mean_square.sqrt(), asked.quantity.unit()),
                    display::quantity(peak_hz, "Hz"),
                );
                let squared = asked.quantity.squared();
                rows.add(
                    place.to_string(),
                    format_args!("rms {rms}, most at {at}: {} {squared}/Hz", display::number(peak)),
                );
            }
        }
        rows
    }

    pub(super) fn json(&self, asked: &Asked, samples: &Samples) -> Value {
        let mut places = Vec::new();
        if let Results::Spectra { frequencies_hz, densities, .. } = &self.results {
            for (place, density) in asked.places.iter().zip(densities) {
                let DensitySummary { mean_square, peak_hz, peak } =
                    DensitySummary::of(frequencies_hz, density);
                places.push(json!({
                    "place": place.to_string(),
                    "mean_square": mean_square,
                    "peak_hz": peak_hz,
                    "peak_density": peak,
                }));
            }
        }
        let pair = |((from, to), found): (&(usize, usize), &Transmission)| {
            json!({
                "from": asked.places[*from].to_string(),
                "to": asked.places[*to].to_string(),
                "estimate": "H1",
                "mean_coherence": self.has_coherence().then_some(found.mean_coherence),
            })
        };
        let transmissions = asked.pairs.iter().zip(self.transmissions()).map(pair);
        json!({
            "kind": asked.kind.title(),
            "of": asked.quantity.name(),
            "unit": format!("{}/Hz", asked.quantity.squared()),
            "window": if asked.window == Window::Hann { "Hann" } else { "none" },
            "overlap": if asked.kind == Kind::Spectrogram { 0.875 } else { 0.5 },
            "sampling_hz": samples.rate_hz,
            "sample_count": samples.count,
            "segment_samples": self.segment_length,
            "segment_count": self.segment_count,
            "resolution_hz": samples.rate_hz / self.segment_length as f64,
            "shown_to_hz": self.top_hz,
            "bands_hz": self.linear.as_ref().map(|linear| &linear.bands_hz),
            "places": places,
            "transmissions": transmissions.collect::<Vec<_>>(),
        })
    }
}
