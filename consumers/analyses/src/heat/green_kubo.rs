//! Conductivity from the fluctuations of the current in equilibrium.

use consumers::analysis::Refusal;
use consumers::blocks::{Blocks, Estimate, FEWEST};
use consumers::statistics::Statistics;
use figure::{Axis, Curve, Panel};
use waves::correlation::Autocorrelation;
use waves::sampling::{Sampling, Take};

/// Most samples of the longest lag, if it is told and if not. Each takes 1 kB.
const MOST_LAGS: [u64; 2] = [1 << 18, 1 << 14];
/// Fewest windows: the square of the mean over one is as large as what it has to tell.
const FEWEST_WINDOWS: u64 = 2;

/// Sums for `κ(τ) = ∫_0^τ <J(0)·J(t)> dt/(n·T²)`, with the current J of n contacts and the temperature T (J): the autocorrelation of windows of the run, and its integral, by trapezia.
pub(super) struct GreenKubo {
    lag_s: Option<f64>,
    dt_s: f64,
    last_step: u64,
    sampling: Sampling,
    /// The first sample (W), until there is a second one.
    first_w: f64,
    windows: Option<Autocorrelation>,
    /// Means over each window: the autocorrelation (W²), its integral (W²s), the current (W).
    blocks: Blocks,
}

/// A lag (s), the autocorrelation there (W²) and the conductivity up to it (1/s), each with its error.
pub(super) type Point = (f64, [f64; 2], [f64; 2]);

impl GreenKubo {
    pub(super) fn new(lag_s: Option<f64>, dt_s: f64, last_step: u64) -> Self {
        let (sampling, blocks) = (Sampling::default(), Blocks::new(0));
        Self { lag_s, dt_s, last_step, sampling, first_w: 0.0, windows: None, blocks }
    }

    /// Time between samples (s).
    fn interval_s(&self) -> f64 {
        self.sampling.interval_steps().unwrap_or(1) as f64 * self.dt_s
    }

    /// The longest lag, in samples of a run that has so many.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "above 0; what is too large is bounded"
    )]
    fn lags(&self, samples: u64) -> u64 {
        let told = self.lag_s.map(|lag_s| ((lag_s / self.interval_s()).round() as u64).max(1));
        told.unwrap_or_else(|| (samples / 20).clamp(1, MOST_LAGS[1]))
    }

    /// Takes the current of the frame at `step`.
    pub(super) fn push(&mut self, step: u64, current_w: f64) {
        let take = self.sampling.take(step);
        if take == Take::Skip {
            return;
        }
        if self.windows.is_none() {
            let Some(samples) = self.sampling.expected(self.last_step) else {
                self.first_w = current_w;
                return;
            };
            let lags = usize::try_from(self.lags(samples).min(MOST_LAGS[0])).unwrap_or(1);
            self.windows = Some(Autocorrelation::new(lags));
            self.blocks = Blocks::new(2 * lags + 3);
            self.add(self.first_w);
        }
        if let Some(windows) = self.windows.as_mut().filter(|_| take == Take::AfterGap) {
            windows.restart();
        }
        self.add(current_w);
    }

    fn add(&mut self, current_w: f64) {
        let interval_s = self.interval_s();
        let Some(windows) = &mut self.windows else { return };
        let Some((products, mean)) = windows.push(current_w) else { return };
        let integrals = products.windows(2).scan(0.0, |sum, pair| {
            *sum += 0.5 * (pair[0] + pair[1]) * interval_s;
            Some(*sum)
        });
        self.blocks.push(products.iter().copied().chain([0.0]).chain(integrals).chain([mean]));
    }

    /// Refuses a lag that takes too much memory, or is too long for the time that was looked at, once samples have come.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        let lags = self.lags(0);
        if let Some(lag_s) =
            self.lag_s.filter(|_| self.windows.is_some() && self.blocks.frames() < FEWEST_WINDOWS)
        {
            let why = "too long for the frames in one piece; allowed: at most a third of the time that is looked at, such as a twentieth";
            return Err(Refusal::of("lag", lag_s.to_string(), why.to_owned()));
        }
        if lags <= MOST_LAGS[0] {
            return Ok(());
        }
        let why = format!("{lags} frames; allowed: at most {}. Choose a shorter one", MOST_LAGS[0]);
        Err(Refusal::of("lag", self.lag_s.unwrap_or_default().to_string(), why))
    }

    /// The points from the lag 0 on, of a current through `contacts` contacts at this temperature (J); none where too few windows were full.
    pub(super) fn points(&self, contacts: usize, temperature: Estimate) -> Vec<Point> {
        let lags = self.windows.as_ref().map_or(0, Autocorrelation::lags);
        if self.blocks.frames() < FEWEST_WINDOWS {
            return Vec::new();
        }
        let (interval_s, longest_s) = (self.interval_s(), lags as f64 * self.interval_s());
        let factor = 1.0 / (contacts as f64 * temperature.mean * temperature.mean);
        let (parts, last) = (self.blocks.means().collect::<Vec<_>>(), 2 * lags + 2);
        let means: Vec<f64> = (0..=last).map(|place| self.blocks.estimate(place).mean).collect();
        // the variance of a mean over windows that overlap by half, of a current that forgets itself within one
        let windows = self.blocks.frames() as f64;
        let variance = (2.0 * windows - 1.0) / ((windows - 1.0) * (windows - 1.0) * longest_s);
        // less the square of the mean, to first order in each block, which on average is larger by that variance
        let less_mean = |values: &[f64], place: usize, weight: f64| {
            let square = means[last] * (2.0 * values[last] - means[last]);
            let square = square - variance * (values[last - 1] - longest_s * square);
            values[place] - weight * square
        };
        let less = |place: usize, weight: f64| {
            let found = Statistics::of(parts.iter().map(|part| less_mean(part, place, weight)));
            let error = found.filter(|_| parts.len() >= FEWEST).and_then(|found| found.standard_error);
            [less_mean(&means, place, weight), error.unwrap_or(f64::NAN)]
        };
        let of = |lag: usize| {
            let lag_s = lag as f64 * interval_s;
            let (product, [integral, error]) = (less(lag, 1.0), less(lags + 1 + lag, lag_s));
            let of_temperature = 2.0 * factor * integral * temperature.error / temperature.mean;
            (lag_s, product, [factor * integral, (factor * error).hypot(of_temperature)])
        };
        (0..=lags).map(of).collect()
    }
}

/// The conductivity over the longest lag that it takes in.
pub(super) fn panel(points: &[Point]) -> Panel {
    let band = points.iter().map(|(t, _, [k, error])| (*t, k - 2.0 * error, k + 2.0 * error));
    let curve = Curve::line("", points.iter().map(|(t, _, [k, _])| (*t, *k))).band(band);
    Panel::new()
        .x_axis(Axis::new("longest lag τ (s)"))
        .y_axis(Axis::new("conductivity κ(τ) (1/s)"))
        .curve(curve)
        .note("Green and Kubo")
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::random::normal;

    /// x ← c·x + ξ has the autocorrelation c^lag/(1 − c²).
    #[test]
    fn a_process_with_memory_has_its_integral() {
        let (c, contacts, frames) = (0.8_f64, 5, 200_000);
        let temperature = Estimate { mean: 2.0, error: 0.0, memory_frames: 0.0 };
        for mean in [0.0, 3.0] {
            let (mut sums, mut x) = (GreenKubo::new(Some(10.0), 0.25, frames - 1), 0.0);
            for step in (0..frames).filter(|step| !(500..700).contains(step)) {
                x = c * x + normal(7, 1, step);
                sums.push(step, x + mean);
            }
            let points = sums.points(contacts, temperature);
            assert_eq!(points.len(), 41);
            let (mut integral, mut off) = (0.0, 0);
            for (lag, (lag_s, product, conductivity)) in (0_i32..).zip(&points) {
                assert_eq!(*lag_s, 0.25 * f64::from(lag));
                let exact = |lag| c.powi(lag) / (1.0 - c * c);
                if lag > 0 {
                    integral += 0.125 * (exact(lag - 1) + exact(lag)) / (5.0 * 4.0);
                    off += u32::from((conductivity[0] - integral).abs() > 2.0 * conductivity[1]);
                    assert!((conductivity[0] - integral).abs() < 4.0 * conductivity[1], "{lag}");
                }
                assert!((product[0] - exact(lag)).abs() < 4.0 * product[1], "{lag} {product:?}");
            }
            assert!(points[40].2[1] < 0.05 * points[40].2[0] && off < 12, "{:?} {off}", points[40]);
        }
    }

    /// The square of a run's own mean is taken off with its expectation: the default lag tells the integral of short runs, too.
    #[test]
    fn the_mean_of_a_run_takes_nothing_off() {
        let (c, frames, seeds) = (0.8_f64, 800, 2_000);
        let temperature = Estimate { mean: 1.0, error: 0.0, memory_frames: 0.0 };
        for lag_s in [None, Some(80.0)] {
            let found = (0..seeds).map(|seed| {
                let (mut sums, mut x) = (GreenKubo::new(lag_s, 1.0, frames - 1), 0.0);
                for step in 0..frames + 100 {
                    x = c * x + normal(seed, 1, step);
                    if step >= 100 {
                        sums.push(step - 100, x + 2.0);
                    }
                }
                sums.points(1, temperature).last().unwrap().2[0]
            });
            let found = Statistics::of(found).unwrap();
            let exact = (0.5 + c / (1.0 - c)) / (1.0 - c * c);
            let error = found.standard_error.unwrap();
            assert!((found.mean - exact).abs() < 3.0 * error && error < 0.03 * exact, "{found:?} {exact}");
        }
    }
}
