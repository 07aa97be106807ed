//! Even, smooth functions of the distance from the centre of a wave, on a grid that divides the bead.

/// Samples of an even function that vanishes beyond the last of them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct EvenProfile {
    /// Samples per bead: odd, so that a window of one bead around a sample is made of whole cells.
    per_bead: usize,
    /// `values[j]` at `j/per_bead` beads from the centre.
    values: Vec<f64>,
}

/// The mean over a cell of width h is `Σ_k MEAN[k]·D^k f` with the second difference
/// `D f = f(ξ + h) − 2f(ξ) + f(ξ − h)`: the series of `√D/(2·asinh(√D/2))`. The first term left out is
/// `5.3e-6·D⁶f`.
const MEAN: [f64; 6] = [
    1.0,
    1.0 / 24.0,
    -17.0 / 5_760.0,
    367.0 / 967_680.0,
    -27_859.0 / 464_486_400.0,
    1_295_803.0 / 122_624_409_600.0,
];

/// Samples on either side of the point in an interpolation.
const NEIGHBOURS: isize = 6;

impl EvenProfile {
    /// Samples `function` from 0 to at least `extent_beads`, with an odd number `per_bead` of samples a bead.
    pub(super) fn sample(per_bead: usize, extent_beads: f64, function: impl Fn(f64) -> f64) -> Self {
        let mut values = Vec::new();
        let mut distance_beads = 0.0;
        while distance_beads < extent_beads {
            values.push(function(distance_beads));
            distance_beads = values.len() as f64 / per_bead as f64;
        }
        Self { per_bead, values }
    }

    /// The same grid with other values, one for each of [`EvenProfile::values`].
    pub(super) fn with_values(&self, values: Vec<f64>) -> Self {
        debug_assert_eq!(values.len(), self.values.len());
        Self { per_bead: self.per_bead, values }
    }

    /// The function of the values, sample by sample.
    pub(super) fn map(&self, function: impl Fn(f64) -> f64) -> Self {
        self.with_values(self.values.iter().map(|value| function(*value)).collect())
    }

    /// Samples at 0, h, 2h, … with h of a `per_bead`-th of a bead.
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// The samples alone.
    pub(super) fn into_values(self) -> Vec<f64> {
        self.values
    }

    /// The distance (beads) from the centre at which the samples end.
    pub(super) fn extent_beads(&self) -> f64 {
        self.values.len() as f64 / self.per_bead as f64
    }

    /// `∫ f dξ` over all ξ (beads times the unit of f). The trapezoidal rule converges faster than any
    /// power of the spacing for a smooth function that has faded at the end of the grid.
    pub(super) fn integral(&self) -> f64 {
        let tail: f64 = self.values[1..].iter().rev().sum();
        (self.values[0] + 2.0 * tail) / self.per_bead as f64
    }

    /// The mean over one bead, `∫ f(η) dη` from ξ − ½ to ξ + ½.
    pub(super) fn mean_over_a_bead(&self) -> Self {
        let cells = self.with_values(cell_means(&self.values));
        let reach = (self.per_bead / 2).cast_signed();
        let mut window = Window::default();
        let mut means = vec![0.0; self.values.len()];
        // from the end inwards, so that what has been rounded is never larger than what is summed
        let last = self.values.len().cast_signed() - 1;
        (last - reach + 1..=last).rev().for_each(|j| window.add(cells.sample_at(j)));
        for j in (0..=last).rev() {
            window.add(cells.sample_at(j - reach));
            means[j.unsigned_abs()] = window.sum() / self.per_bead as f64;
            window.add(-cells.sample_at(j + reach));
        }
        self.with_values(means)
    }

    /// The value at any distance `xi_beads` (beads) from the centre: the polynomial of degree 11 through the
    /// twelve nearest samples.
    pub(super) fn at(&self, xi_beads: f64) -> f64 {
        let position = xi_beads.abs() * self.per_bead as f64;
        if position.is_nan() || position >= self.values.len() as f64 {
            return if position.is_nan() { f64::NAN } else { 0.0 };
        }
        #[expect(clippy::cast_possible_truncation, reason = "below the number of samples")]
        let cell = position.floor() as isize;
        let offset = position - cell as f64;
        if offset == 0.0 {
            return self.sample_at(cell);
        }
        // barycentric formula; the weights of equidistant points are alternating binomials
        let (mut weight, mut weights, mut weighted) = (1.0, 0.0, 0.0);
        let count = 2 * NEIGHBOURS;
        for k in 0..count {
            let neighbour = k - (NEIGHBOURS - 1);
            let share = weight / (offset - neighbour as f64);
            weights += share;
            weighted += share * self.sample_at(cell + neighbour);
            weight *= -((count - 1 - k) as f64) / (k + 1) as f64;
        }
        weighted / weights
    }

    /// Full width (beads) where the function, which falls from the centre outwards, has half its maximum.
    pub(super) fn full_width_at_half_maximum(&self) -> f64 {
        let half = 0.5 * self.values[0];
        let below = self.values.iter().position(|value| *value <= half).unwrap_or(self.values.len());
        let spacing_beads = 1.0 / self.per_bead as f64;
        let (mut outside, mut inside) = (below as f64 * spacing_beads, (below as f64 - 1.0) * spacing_beads);
        for _ in 0..60 {
            let middle = 0.5 * (inside + outside);
            if self.at(middle) > half { inside = middle } else { outside = middle }
        }
        inside + outside
    }

    /// Sample number `j`, by symmetry also left of the centre.
    fn sample_at(&self, j: isize) -> f64 {
        self.values.get(j.unsigned_abs()).copied().unwrap_or(0.0)
    }
}

/// Means over the cells of one grid spacing around the samples at 0, h, 2h, ….
fn cell_means(values: &[f64]) -> Vec<f64> {
    let mut difference = values.to_vec();
    let mut means = values.to_vec();
    for coefficient in &MEAN[1..] {
        let mut inner = difference.get(1).copied().unwrap_or(0.0); // f(−h) = f(h)
        for j in 0..difference.len() {
            let here = difference[j];
            let outer = difference.get(j + 1).copied().unwrap_or(0.0);
            difference[j] = inner - 2.0 * here + outer;
            inner = here;
        }
        means.iter_mut().zip(&difference).for_each(|(mean, d)| *mean += coefficient * d);
    }
    means
}

/// A running sum in two doubles: adding and removing millions of terms leaves no drift.
#[derive(Debug, Default)]
struct Window {
    high: f64,
    low: f64,
}

impl Window {
    fn add(&mut self, term: f64) {
        let sum = self.high + term;
        let part = sum - self.high;
        self.low += (self.high - (sum - part)) + (term - part);
        self.high = sum;
    }

    fn sum(&self) -> f64 {
        self.high + self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussian(per_bead: usize) -> EvenProfile {
        EvenProfile::sample(per_bead, 9.0, |xi| (-xi * xi).exp())
    }

    /// The mean of e^(−ξ²) over |ξ| ≤ ½ is √π·erf(½); over all ξ it integrates to √π.
    #[test]
    fn integrals_of_a_gaussian() {
        let root_pi = std::f64::consts::PI.sqrt();
        assert!((gaussian(5).integral() - root_pi).abs() < 1e-15 * 4.0);
        let erf_half = 0.520_499_877_813_046_5;
        // the first term left out, h¹²·5.3e-6·f⁗⁗⁗(0) = 5.3e-6·12!/6!·h¹²: 3.5 h¹²
        for (per_bead, tolerance) in [(5, 2e-8), (9, 2e-11), (21, 1e-15), (65, 1e-15)] {
            let mean = gaussian(per_bead).mean_over_a_bead();
            assert!((mean.values()[0] - root_pi * erf_half).abs() < tolerance, "{per_bead}");
        }
    }

    #[test]
    fn between_samples() {
        let profile = gaussian(21);
        for xi in [0.0, 0.01, 0.3, -0.3, 1.234, 3.3] {
            assert!((profile.at(xi) - (-xi * xi).exp()).abs() < 1e-14, "{xi}");
        }
        assert_eq!((profile.at(9.5), profile.at(f64::INFINITY)), (0.0, 0.0));
        let width = 2.0 * std::f64::consts::LN_2.sqrt();
        assert!((profile.full_width_at_half_maximum() - width).abs() < 1e-13);
    }
}
