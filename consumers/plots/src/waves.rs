//! Spectra, modes and forces.

use super::{caption, prefix, short};
use consumers::series::Series;
use figure::{Axis, Colour, ColourScale, Curve, Figure, FigureError, Mark, Panel, Raster, Stroke};
use schemas::manifest::RunManifest;
use std::f64::consts::PI;
use waves::dispersion::{Band, UnitCell};
use waves::grid::Grid;
use waves::peaks::Peak;
use waves::place::{Place, Quantity};
use waves::welch::Transmission;

/// Most peaks that are marked: more would hide the curves.
const MOST_PEAKS: u64 = 60;

/// Colours of places that stand in two panels.
const COLOURS: [Colour; 6] =
    [Colour::Blue, Colour::Vermillion, Colour::Green, Colour::Purple, Colour::Orange, Colour::Sky];

/// Densities at places, over frequency.
#[derive(Debug)]
pub struct Spectra<'a> {
    /// The quantity.
    pub quantity: Quantity,
    /// The frequencies (Hz).
    pub frequencies_hz: &'a [f64],
    /// The places.
    pub places: &'a [Place],
    /// The density of each place, a value for each frequency.
    pub densities: &'a [Vec<f64>],
    /// Transmissions between places.
    pub transmissions: &'a [TransmissionCurve<'a>],
    /// Segments that were averaged: of one alone no coherence is known.
    pub segment_count: u64,
    /// Frequencies (Hz) at which linear waves travel.
    pub bands_hz: &'a [Band],
    /// The highest frequency that is shown (Hz).
    pub top_hz: f64,
}

impl Spectra<'_> {
    /// The coherence that two signals without any relation exceed once in a hundred lines; none if it is not known.
    ///
    /// # Source
    /// J. S. Bendat and A. G. Piersol, *Random Data*, 4th ed. (Wiley 2010), chapter 9: of n segments of such signals the
    /// coherence is above x with the probability (1 − x)^(n − 1).
    fn least_coherence(&self) -> Option<f64> {
        (self.segment_count > 1).then(|| 1.0 - 0.01_f64.powf(1.0 / (self.segment_count - 1) as f64))
    }

    /// `|H₁|` of a pair, NaN at frequencies that say nothing about it: where the coherence may be chance, or, if it is not known,
    /// above all bands, and where the first place has no density that is shown.
    fn gain(&self, TransmissionCurve { from, found, .. }: &TransmissionCurve<'_>) -> Vec<f64> {
        let first = self.places.iter().position(|place| place == from);
        let density = first.and_then(|first| self.densities.get(first)).map_or(&[][..], Vec::as_slice);
        let largest = density.iter().skip(1).fold(0.0_f64, |high, value| high.max(*value));
        let (least, top_hz) = (self.least_coherence(), self.bands_hz.last().map(|band| band[1]));
        let is_told = |line: usize, coherence: f64| match (least, top_hz) {
            (Some(least), _) => coherence > least,
            (None, Some(top_hz)) => self.frequencies_hz[line] <= top_hz,
            (None, None) => true,
        };
        let gain = found.gain.iter().zip(&found.coherence).enumerate();
        gain.map(|(line, (gain, coherence))| {
            let has_density = density.get(line).is_some_and(|value| *value >= SHOWN_DENSITY * largest);
            if has_density && is_told(line, *coherence) { *gain } else { f64::NAN }
        })
        .collect()
    }

    /// The words about the frequencies at which `|H₁|` is drawn.
    fn gain_caption(&self) -> String {
        let part = super::scientific(SHOWN_DENSITY);
        let where_dense = format!("; |H_{{1}}| where the first place has {part} of its largest density");
        match (self.least_coherence(), self.bands_hz.is_empty()) {
            (Some(least), _) => format!(
                "{where_dense}, and the coherence of {} segments is above {least:.2}, which chance exceeds in 1 % of lines",
                self.segment_count
            ),
            (None, false) => {
                format!("{where_dense}, up to the top of the band: one segment has no coherence")
            }
            (None, true) => format!("{where_dense}; one segment has no coherence"),
        }
    }
}

/// Densities below this part of the largest are rounding, or leak from other frequencies.
const SHOWN_DENSITY: f64 = 1e-10;

/// Transmission from one place to another.
#[derive(Debug)]
pub struct TransmissionCurve<'a> {
    /// The first place.
    pub from: Place,
    /// The place that follows it.
    pub to: Place,
    /// The transmission.
    pub found: &'a Transmission,
}

/// The unit of frequencies up to `top_hz`, and how many of it make one Hz.
fn frequency_unit(top_hz: f64) -> (String, f64) {
    let (prefix, factor) = prefix_of_hz(top_hz);
    (format!("frequency ({prefix}Hz)"), factor)
}

/// The unit of a density as it is drawn.
fn density_unit(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Velocity => "m^{2} s^{−2} Hz^{−1}",
        Quantity::Force => "N^{2} Hz^{−1}",
        Quantity::Displacement => "m^{2} Hz^{−1}",
    }
}

/// `bead 20`, `right wall`.
fn named(place: Place) -> String {
    match place {
        Place::Bead(bead) => format!("bead {bead}"),
        Place::Contact(contact) => format!("contact {contact}"),
        Place::Wall(side) => format!("{side} wall"),
    }
}

/// Power spectral densities over frequency, with the bands of the linear chain in grey, and transmissions below.
pub fn spectra(manifest: &RunManifest, shown: &Spectra<'_>) -> Figure {
    let (label, factor) = frequency_unit(shown.top_hz);
    let x = || Axis::new(&label).limits(0.0, shown.top_hz * factor);
    let with_bands = |mut panel: Panel, named: bool| {
        for (index, [from, to]) in shown.bands_hz.iter().enumerate() {
            let name = match (named, index, shown.bands_hz.len()) {
                (true, 0, 1) => "linear band",
                (true, 0, _) => "linear bands",
                _ => "",
            };
            panel = panel.band_x(name, from * factor, to * factor);
        }
        panel
    };
    let curve = |values: &[f64]| -> Vec<(f64, f64)> {
        let points = shown.frequencies_hz.iter().zip(values).skip(1);
        points.filter(|(f, _)| **f <= shown.top_hz).map(|(f, value)| (f * factor, *value)).collect()
    };
    let highest = |values: &[f64]| curve(values).iter().fold(0.0_f64, |high, point| high.max(point.1));
    let largest = shown.densities.iter().map(|density| highest(density)).fold(0.0_f64, f64::max);
    let unit = density_unit(shown.quantity);
    let mut y = Axis::new(format!("{} PSD ({unit})", shown.quantity.name())).log();
    if largest > 0.0 {
        // what is far below is not worth the room
        let lowest = shown.densities.iter().flat_map(|density| curve(density));
        let lowest = lowest.map(|point| point.1).filter(|value| *value > 0.0).fold(largest, f64::min);
        y = y.limits(lowest.max(SHOWN_DENSITY * largest), 3.0 * largest);
    }
    let mut panel = with_bands(Panel::new().x_axis(x()).y_axis(y), true).height(1.1);
    for (place, density) in shown.places.iter().zip(shown.densities) {
        panel = panel.line(named(*place), curve(density));
    }
    let figure = Figure::new().shared_x().caption(caption(manifest)).panel(panel);
    if shown.transmissions.is_empty() {
        return figure;
    }
    let mut gain = with_bands(Panel::new().x_axis(x()), false).y_axis(Axis::new("|H_{1}|").log());
    let coherence = Panel::new().x_axis(x()).y_axis(Axis::new("coherence").limits(0.0, 1.05)).height(0.6);
    let mut coherence = with_bands(coherence, false);
    for pair in shown.transmissions {
        let TransmissionCurve { from, to, found } = pair;
        gain = gain.line(format!("{} → {}", named(*from), named(*to)), curve(&shown.gain(pair)));
        coherence = coherence.line("", curve(&found.coherence));
    }
    let text = caption(manifest) + &shown.gain_caption();
    let figure = figure.caption(text).panel(gain);
    match shown.least_coherence() {
        Some(least) => figure.panel(coherence.horizontal("least for |H_{1}|", least)),
        None => figure,
    }
}

/// Horizontal axis of a density.
pub enum WavesOver<'a> {
    /// Time, at one place.
    Time {
        /// The place.
        place: Place,
        /// Frequencies (Hz) at which linear waves travel.
        bands_hz: &'a [Band],
    },
    /// The wavenumber.
    Wavenumber {
        /// The frequencies (Hz) of linear waves of a wavenumber (rad/bead), if there are linear waves.
        dispersion: Option<&'a dyn Fn(f64) -> Vec<f64>>,
    },
}

/// A density over frequency (up) and time or wavenumber, its colours by the logarithm.
///
/// # Errors
/// When the map cannot be drawn, which is a mistake of ours.
pub fn wave_grid(
    manifest: &RunManifest,
    quantity: Quantity,
    grid: &Grid,
    over: &WavesOver<'_>,
) -> Result<Figure, FigureError> {
    let (from_hz, to_hz) = grid.frequency_edges_hz;
    let (label, factor) = frequency_unit(to_hz);
    let largest = grid.values.iter().flatten().fold(0.0_f64, |high, value| high.max(*value));
    let scale_by = if largest > 0.0 { 1.0 / largest } else { 1.0 };
    #[expect(clippy::cast_possible_truncation, reason = "seven digits are enough for a colour")]
    let cells: Vec<Option<f32>> =
        grid.values.iter().map(|value| value.map(|value| (value * scale_by) as f32)).collect();
    let (per, x_label, x_factor) = match over {
        WavesOver::Time { .. } => ("", "time (ms)", 1e3),
        WavesOver::Wavenumber { .. } => (" rad^{−1}", "wavenumber q (rad/bead)", 1.0),
    };
    let scale = ColourScale::new("PSD / largest", 0.0, 1.0).log_beyond(1e-6);
    let side = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
    let raster = Raster::values(side(grid.x.len()), side(grid.frequency_hz.len()), &cells, scale)?;
    let (x_from, x_to) = (grid.x_edges.0 * x_factor, grid.x_edges.1 * x_factor);
    let mut panel = Panel::new()
        .x_axis(Axis::new(x_label).limits(x_from, x_to))
        .y_axis(Axis::new(&label).limits(from_hz * factor, to_hz * factor))
        .raster(raster.over((x_from, x_to), (from_hz * factor, to_hz * factor)))
        .height(1.35);
    match over {
        WavesOver::Time { bands_hz, .. } => {
            let edges = bands_hz.iter().flatten().filter(|edge| **edge > from_hz && **edge < to_hz);
            for (index, edge) in edges.enumerate() {
                panel = panel.horizontal(if index == 0 { "linear band edge" } else { "" }, edge * factor);
            }
        }
        WavesOver::Wavenumber { dispersion: Some(frequencies_hz) } => {
            let wavenumbers: Vec<f64> = (-200..=200_i32).map(|i| f64::from(i) / 200.0 * PI).collect();
            let branches: Vec<Vec<f64>> = wavenumbers.iter().map(|q| frequencies_hz(*q)).collect();
            for branch in 0..branches[0].len() {
                let points = wavenumbers.iter().zip(&branches).map(|(q, all)| (*q, all[branch]));
                // a line is broken where it leaves the frame
                let is_shown = |f: f64| f <= to_hz && f >= from_hz;
                let shown = points.map(|(q, f)| (q, if is_shown(f) { f } else { f64::NAN }));
                let name = if branch == 0 { "linear dispersion relation" } else { "" };
                let curve = Curve::line(name, shown.map(|(q, f)| (q, f * factor)));
                panel = panel.curve(curve.colour(Colour::Black).stroke(Stroke::Dashed).thin());
            }
        }
        WavesOver::Wavenumber { dispersion: None } => {}
    }
    let what = match over {
        WavesOver::Time { place, .. } => format!("{} of {}", quantity.name(), named(*place)),
        WavesOver::Wavenumber { .. } => format!("{} of the beads", quantity.name()),
    };
    let peak = super::scientific(largest);
    let unit = density_unit(quantity);
    let text = format!("{}; {what}, largest density {peak}\u{a0}{unit}{per}", caption(manifest));
    Ok(Figure::new().caption(text).panel(panel))
}

/// The modes of a chain.
#[derive(Debug)]
pub struct ModesShown<'a> {
    /// Frequency of each (Hz), ascending.
    pub frequencies_hz: &'a [f64],
    /// Beads that share its energy.
    pub participation_beads: &'a [f64],
    /// Frequencies (Hz) at which linear waves travel.
    pub bands_hz: &'a [Band],
}

/// Frequencies of all modes, and how many beads share each.
pub fn modes(manifest: &RunManifest, shown: &ModesShown<'_>) -> Figure {
    let top_hz = shown.frequencies_hz.last().copied().unwrap_or(1.0);
    let (label, factor) = frequency_unit(top_hz);
    let count = shown.frequencies_hz.len();
    let numbered = shown.frequencies_hz.iter().enumerate();
    let frequencies: Vec<_> = numbered.map(|(index, f)| ((index + 1) as f64, f * factor)).collect();
    let shares = shown.frequencies_hz.iter().zip(shown.participation_beads);
    let shares: Vec<_> = shares.map(|(f, beads)| (f * factor, *beads)).collect();
    let mut ladder = Panel::new()
        .x_axis(Axis::new("mode").limits(0.0, count as f64 + 1.0))
        .y_axis(Axis::new(&label).limits(0.0, 1.06 * top_hz * factor));
    let mut shared = Panel::new()
        .x_axis(Axis::new(&label).limits(0.0, 1.06 * top_hz * factor))
        .y_axis(Axis::new("participation (beads)").log().limits(0.8, 1.3 * count as f64))
        .height(0.8);
    for (index, [from, to]) in shown.bands_hz.iter().enumerate() {
        let name = if index == 0 { "linear bands" } else { "" };
        ladder = ladder.band_y(name, from * factor, to * factor);
        shared = shared.band_x("", from * factor, to * factor);
    }
    let [ladder, shared] =
        [(ladder, frequencies), (shared, shares)].map(|(panel, points)| with_modes(panel, &points, shown));
    Figure::new().caption(caption(manifest)).panel(ladder).panel(shared)
}

/// A point for each mode; where there are many a line for those of a band, and points for the others.
fn with_modes(panel: Panel, points: &[(f64, f64)], shown: &ModesShown<'_>) -> Panel {
    let blue = |curve: Curve| curve.colour(Colour::Blue);
    if points.len() <= 60 {
        return panel.curve(blue(Curve::points("", points.iter().copied())));
    }
    let band_of =
        |f: &f64| shown.bands_hz.iter().position(|band| UnitCell::carries(std::slice::from_ref(band), *f));
    let bands: Vec<Option<usize>> = shown.frequencies_hz.iter().map(band_of).collect();
    let has_bands = !shown.bands_hz.is_empty();
    let (mut line, mut outside) = (Vec::new(), Vec::new());
    let mut last = None;
    for (point, band) in points.iter().zip(bands) {
        if has_bands && band.is_none() {
            outside.push(*point);
            continue;
        }
        if last.is_some_and(|last| last != band) {
            line.push((f64::NAN, f64::NAN));
        }
        line.push(*point);
        last = Some(band);
    }
    let panel = panel.curve(blue(Curve::line("", line)));
    if outside.is_empty() {
        return panel;
    }
    panel.curve(Curve::points("modes outside", outside).colour(Colour::Vermillion))
}

/// The shape of one mode.
#[derive(Debug, Clone, PartialEq)]
pub struct ModeShape {
    /// Its number, from 1.
    pub mode: usize,
    /// Its frequency (Hz).
    pub frequency_hz: f64,
    /// Displacement of each bead, the largest 1.
    pub shape: Vec<f64>,
}

/// The shapes of modes, each in a panel.
pub fn mode_shapes(manifest: &RunManifest, shapes: &[ModeShape]) -> Figure {
    let mut figure = Figure::new().shared_x().caption(caption(manifest));
    for ModeShape { mode, frequency_hz, shape } in shapes {
        let (prefix, factor) = prefix_of_hz(*frequency_hz);
        let number = short(three_digits(frequency_hz * factor));
        let points = shape.iter().enumerate().map(|(bead, u)| (bead as f64, *u));
        let curve = Curve::line(format!("mode {mode}: {number}\u{a0}{prefix}Hz"), points);
        let curve = if shape.len() <= 60 { curve.mark(Mark::Circle) } else { curve };
        let panel = Panel::new()
            .x_axis(Axis::new("bead").limits(-0.5, shape.len() as f64 - 0.5))
            .y_axis(Axis::new("u").limits(-1.1, 1.1))
            .curve(curve)
            .height(0.5);
        figure = figure.panel(panel);
    }
    figure
}

fn prefix_of_hz(value: f64) -> (&'static str, f64) {
    match value {
        value if value >= 1e6 => ("M", 1e-6),
        value if value >= 1e3 => ("k", 1e-3),
        _ => ("", 1.0),
    }
}

fn three_digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// The energies of modes, numbered from 1, over time.
pub fn mode_energies(manifest: &RunManifest, modes: &[usize], curves: &[Series<1>]) -> Figure {
    let all = curves.iter().flat_map(|curve| curve.column(0));
    let (prefix, factor) = prefix(all.fold(0.0_f64, f64::max));
    let mut panel = Panel::new().x_axis("time (ms)").y_axis(format!("energy ({prefix}J)")).height(1.2);
    for (mode, curve) in modes.iter().zip(curves) {
        let points = curve.curve(0).map(|(t, energy)| (t * 1e3, energy * factor));
        panel = panel.line(format!("mode {mode}"), points);
    }
    Figure::new().caption(caption(manifest)).panel(panel)
}

/// Forces on a sensor at one place.
#[derive(Debug)]
pub struct SensedForces<'a> {
    /// The place.
    pub place: Place,
    /// Force (N) and overlap (m, NaN at a bead) over time.
    pub curve: &'a Series<2>,
    /// The force at rest (N).
    pub rest_n: f64,
    /// Its first peaks.
    pub peaks: &'a [Peak],
    /// Number of all.
    pub peak_count: u64,
}

/// Forces over time with their peaks, and the overlaps of contacts and walls below.
pub fn forces(manifest: &RunManifest, sensors: &[SensedForces<'_>]) -> Figure {
    let x = || Axis::new("time (ms)");
    let largest = |column: usize| {
        let values = sensors.iter().flat_map(|sensor| sensor.curve.column(column));
        values.filter(|value| value.is_finite()).fold(0.0_f64, |high, value| high.max(value.abs()))
    };
    let (force_prefix, force_factor) = if largest(0) >= 2e3 { ("k", 1e-3) } else { prefix(largest(0)) };
    let (overlap_prefix, overlap_factor) = prefix(largest(1));
    let mut force = Panel::new().x_axis(x()).y_axis(format!("force ({force_prefix}N)"));
    let mut overlap = Panel::new().x_axis(x()).y_axis(format!("overlap ({overlap_prefix}m)")).height(0.7);
    let mut has_overlap = false;
    for (index, SensedForces { place, curve, .. }) in sensors.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let forces = curve.curve(0).map(|(t, n)| (t * 1e3, n * force_factor));
        force = force.curve(Curve::line(named(*place), forces).colour(colour));
        if !matches!(place, Place::Bead(_)) {
            has_overlap = true;
            let overlaps = curve.curve(1).map(|(t, m)| (t * 1e3, m * overlap_factor));
            overlap = overlap.curve(Curve::line("", overlaps).colour(colour));
        }
    }
    let count: u64 = sensors.iter().map(|sensor| sensor.peak_count).sum();
    if count > MOST_PEAKS {
        force = force.note(format!("{count} peaks"));
    } else {
        let of = |sensor: &SensedForces<'_>| -> Vec<(f64, f64)> {
            let points = sensor.peaks.iter();
            points.map(|peak| (peak.time_s * 1e3, (peak.force_n + sensor.rest_n) * force_factor)).collect()
        };
        let points: Vec<_> = sensors.iter().flat_map(of).collect();
        force = force.curve(Curve::points("peaks", points).colour(Colour::Black));
    }
    let figure = Figure::new().shared_x().caption(caption(manifest)).panel(force);
    if has_overlap { figure.panel(overlap) } else { figure }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five segments: chance exceeds 1 − 0.01^(1/4) = 0.68.
    #[test]
    fn a_gain_is_drawn_where_it_means_something() {
        let found = Transmission {
            gain: vec![1.0; 4],
            phase_rad: vec![0.0; 4],
            coherence: vec![1.0, 0.9, 0.6, 1.0],
            mean_coherence: 0.9,
        };
        let pair = TransmissionCurve { from: Place::Bead(1), to: Place::Bead(2), found: &found };
        let mut shown = Spectra {
            quantity: Quantity::Velocity,
            frequencies_hz: &[0.0, 1.0, 2.0, 3.0],
            places: &[Place::Bead(2), Place::Bead(1)],
            densities: &[vec![1.0; 4], vec![1.0, 1.0, 1.0, 1e-12]],
            transmissions: &[],
            segment_count: 5,
            bands_hz: &[],
            top_hz: 3.0,
        };
        let is_drawn =
            |shown: &Spectra<'_>| shown.gain(&pair).iter().map(|gain| !gain.is_nan()).collect::<Vec<_>>();
        assert_eq!(is_drawn(&shown), [true, true, false, false]);
        assert!(shown.gain_caption().contains("above 0.68"), "{}", shown.gain_caption());
        // one segment has no coherence: what leaks above the band is not drawn
        shown.segment_count = 1;
        assert_eq!(is_drawn(&shown), [true, true, true, false]);
        shown.bands_hz = &[[0.0, 1.5]];
        assert_eq!(is_drawn(&shown), [true, true, false, false]);
    }
}
