//! Densities of a spectrum, as tables, figures and words.

use super::{Asked, Engine, Linear, Samples};
use consumers::analysis::{Outlet, Words};
use consumers::table::{Cell, Column};
use figure::{Figure, FigureError};
use plots::{Spectra, TransmissionCurve, WavesOver};
use schemas::amounts::{count, counted, number, quantity, range};
use schemas::manifest::RunManifest;
use serde_json::{Value, json};
use std::f64::consts::PI;
use waves::dispersion::Band;
use waves::grid::Grid;
use waves::segments::Window;
use waves::welch::{DensitySummary, Transmission};

/// Kind of the densities.
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

/// The columns of the table of what is asked for.
pub(super) fn columns(asked: &Asked) -> Vec<Column> {
    let unit = asked.quantity.density_column();
    let mut columns = vec!["frequency_hz".to_owned()];
    match asked.kind {
        Kind::Spectra => {
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
        Kind::Map => columns.extend(["q_rad_per_bead".to_owned(), format!("psd_{unit}_rad")]),
        Kind::Spectrogram => {
            columns.extend(["time_s".to_owned(), format!("psd_{}_{unit}", asked.places[0].column())]);
        }
    }
    columns.into_iter().map(Column::from).collect()
}

/// The highest frequency worth showing: above it there is less than 1e-6 of the largest density, or less than 1e-3 where there are bands; but
/// all of these.
fn shown_hz(largest: &[f64], step_hz: f64, band_hz: f64) -> f64 {
    let high = largest[1..].iter().fold(0.0_f64, |high, value| high.max(*value));
    let least = if band_hz > 0.0 { 1e-3 } else { 1e-6 };
    let last = largest.iter().rposition(|value| *value >= least * high).unwrap_or(largest.len() - 1);
    let nyquist_hz = (largest.len() - 1) as f64 * step_hz;
    (1.2 * band_hz).max(1.1 * last as f64 * step_hz).max(8.0 * step_hz).min(nyquist_hz)
}

impl Found {
    /// Turns sums into densities. Waves travel up to `band_hz`.
    pub(super) fn new(asked: &Asked, engine: Engine, samples: &Samples, band_hz: f64) -> Self {
        let (segment_length, segment_count) = (engine.segments().length(), engine.segments().count());
        let rate_hz = samples.rate_hz;
        let step_hz = rate_hz / segment_length as f64;
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
        let highest = |values: &[f64]| values.iter().fold(0.0_f64, |high, value| high.max(*value));
        let shown = |largest: &[f64]| asked.max_hz.unwrap_or_else(|| shown_hz(largest, step_hz, band_hz));
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
                let empty = spectrogram.columns(rate_hz).take_while(Option::is_none).count();
                let columns: Vec<_> = spectrogram.columns(rate_hz).skip(empty).collect();
                let largest = over(&mut columns.iter().flatten().map(Vec::as_slice));
                let top_hz = shown(&largest);
                let wide_s = spectrogram.column_samples() as f64 / rate_hz;
                let from_s = samples.first_s + spectrogram.first_edge() / rate_hz + wide_s * empty as f64;
                let edges_s = (from_s, from_s + wide_s * columns.len() as f64);
                let at = |column: usize, line: usize| columns[column].as_ref()?.get(line).copied();
                let grid = Grid::new(edges_s, columns.len(), (step_hz, top_hz), at, largest.len());
                (largest, top_hz, Results::Grid(grid))
            }
            Engine::Map(map) => {
                let density = map.density(rate_hz);
                let largest: Vec<f64> = density.iter().map(|row| highest(row)).collect();
                let top_hz = shown(&largest);
                let q = map.wavenumbers_rad();
                let half = PI / q.len() as f64;
                let edges = (q[0] - half, q[q.len() - 1] + half);
                let at = |column: usize, line: usize| density.get(line)?.get(column).copied();
                let grid = Grid::new(edges, q.len(), (step_hz, top_hz), at, largest.len());
                (largest, top_hz, Results::Grid(grid))
            }
        };
        let at_the_end = highest(&largest[largest.len() - largest.len() / 10..]) / highest(&largest[1..]);
        Self { at_the_end, top_hz, segment_length, segment_count, results }
    }

    /// Peak and mean square at the first place.
    pub(super) fn first_summary(&self) -> Option<DensitySummary> {
        match &self.results {
            Results::Spectra { frequencies_hz, densities, .. } => {
                densities.first().map(|density| DensitySummary::of(frequencies_hz, density))
            }
            Results::Grid(_) => None,
        }
    }

    /// Writes the table.
    pub(super) fn write(&self, out: &mut dyn Outlet) {
        match &self.results {
            Results::Spectra { frequencies_hz, densities, transmissions } => {
                for (line, frequency_hz) in frequencies_hz.iter().enumerate() {
                    let mut cells = vec![Cell::Double(*frequency_hz)];
                    cells.extend(densities.iter().map(|density| Cell::Double(density[line])));
                    for Transmission { gain, phase_rad, coherence, .. } in transmissions {
                        let coherence = Some(coherence[line]).filter(|_| self.has_coherence());
                        for value in [Some(gain[line]), Some(phase_rad[line]), coherence] {
                            cells.push(value.filter(|value| value.is_finite()).into());
                        }
                    }
                    out.line(0, &cells);
                }
            }
            Results::Grid(grid) => {
                let cells = grid.frequency_hz.iter().flat_map(|f| grid.x.iter().map(move |x| (*f, *x)));
                for ((frequency_hz, x), value) in cells.zip(&grid.values) {
                    out.line(0, &[Cell::Double(frequency_hz), Cell::Double(x), (*value).into()]);
                }
            }
        }
    }

    pub(super) fn figure(
        &self,
        manifest: &RunManifest,
        asked: &Asked,
        linear: Option<&Linear>,
    ) -> Result<Figure, FigureError> {
        let bands_hz = linear.map_or(&[][..], |linear| &linear.bands_hz);
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
                let over = match (asked.kind, linear) {
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

    /// Warnings where a place does not follow another one within the segments.
    pub(super) fn incoherent(&self, asked: &Asked) -> Vec<String> {
        let mut notices = Vec::new();
        for ((from, to), found) in asked.pairs.iter().zip(self.transmissions()) {
            if self.has_coherence() && found.mean_coherence < 0.5 {
                notices.push(format!(
                    "{} follows {} with a coherence of {:.2}: segments of {} samples may be shorter than the way \
                     between them; --window none is for a pulse, a longer --segment for motion that lasts",
                    asked.places[*to],
                    asked.places[*from],
                    found.mean_coherence,
                    count(self.segment_length as u64)
                ));
            }
        }
        notices
    }

    pub(super) fn words(&self, asked: &Asked, samples: &Samples, bands_hz: &[Band]) -> Words {
        let mut words = Words::default();
        let every = match samples.interval_steps {
            1 => "every step".to_owned(),
            steps => format!("every {steps} steps"),
        };
        let rate = quantity(samples.rate_hz, "Hz");
        words.add("samples", format_args!("{} at {rate} ({every})", count(samples.count)));
        let (segments, samples_each) =
            (counted(self.segment_count, "segment"), count(self.segment_length as u64));
        let window = match (asked.kind, asked.window) {
            (Kind::Spectrogram, _) => "Hann, overlap 7/8",
            (_, Window::Hann) => "Hann, overlap 1/2",
            (_, Window::None) => "no window, overlap 1/2",
        };
        let resolution = quantity(samples.rate_hz / self.segment_length as f64, "Hz");
        words.add(
            "estimate",
            format_args!("Welch, {segments} of {samples_each} ({window}), lines {resolution} apart"),
        );
        words.each("bands", bands_hz.iter().map(|band| range(*band, "Hz")));
        if let Results::Spectra { frequencies_hz, densities, .. } = &self.results {
            for (place, density) in asked.places.iter().zip(densities) {
                let DensitySummary { mean_square, peak } = DensitySummary::of(frequencies_hz, density);
                let rms = quantity(mean_square.sqrt(), asked.quantity.unit());
                let most = peak.map_or("constant".to_owned(), |[peak_hz, peak]| {
                    let (at, squared) = (quantity(peak_hz, "Hz"), asked.quantity.squared());
                    format!("most at {at}: {} {squared}/Hz", number(peak))
                });
                words.add(place.to_string(), format_args!("rms {rms}, {most}"));
            }
        }
        words
    }

    pub(super) fn json(&self, asked: &Asked, samples: &Samples, bands_hz: Option<&[Band]>) -> Value {
        let mut places = Vec::new();
        if let Results::Spectra { frequencies_hz, densities, .. } = &self.results {
            for (place, density) in asked.places.iter().zip(densities) {
                let DensitySummary { mean_square, peak } = DensitySummary::of(frequencies_hz, density);
                places.push(json!({
                    "place": place.to_string(),
                    "mean_square": mean_square,
                    "peak_hz": peak.map(|[peak_hz, _]| peak_hz),
                    "peak_density": peak.map(|[_, peak]| peak),
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
            "unit": format!("{}/{}", asked.quantity.squared(), if asked.kind == Kind::Map { "(Hz·rad)" } else { "Hz" }),
            "window": if asked.window == Window::Hann { "Hann" } else { "none" },
            "overlap": if asked.kind == Kind::Spectrogram { 0.875 } else { 0.5 },
            "sampling_hz": samples.rate_hz,
            "sample_count": samples.count,
            "segment_samples": self.segment_length,
            "segment_count": self.segment_count,
            "resolution_hz": samples.rate_hz / self.segment_length as f64,
            "shown_to_hz": self.top_hz,
            "bands_hz": bands_hz,
            "places": places,
            "transmissions": transmissions.collect::<Vec<_>>(),
        })
    }
}
