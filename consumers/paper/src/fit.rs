//! Power laws through measured points.

/// `y = prefactor·x^exponent`, fitted to logarithms by least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PowerLaw {
    pub(super) exponent: f64,
    /// Standard error of the exponent, from the scatter of the points about the line.
    pub(super) exponent_error: f64,
    pub(super) prefactor: f64,
    /// Least and largest exponent between two neighbouring points.
    pub(super) local: (f64, f64),
}

impl PowerLaw {
    /// Through points (x, y) in the order of x, all positive; none for fewer than three.
    pub(super) fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
        if logs.len() < 3 || logs.iter().any(|(x, y)| !(x.is_finite() && y.is_finite())) {
            return None;
        }
        let count = logs.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / count;
        let (x_mean, y_mean) = (mean(|point| point.0), mean(|point| point.1));
        let spread: f64 = logs.iter().map(|(x, _)| (x - x_mean) * (x - x_mean)).sum();
        let exponent = logs.iter().map(|(x, y)| (x - x_mean) * (y - y_mean)).sum::<f64>() / spread;
        let scatter: f64 = logs.iter().map(|(x, y)| (y - y_mean - exponent * (x - x_mean)).powi(2)).sum();
        let slopes = logs.windows(2).map(|pair| (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0));
        let local = slopes.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), slope| {
            (least.min(slope), most.max(slope))
        });
        Some(Self {
            exponent,
            exponent_error: (scatter / (count - 2.0) / spread).sqrt(),
            prefactor: (y_mean - exponent * x_mean).exp(),
            local,
        })
    }

    /// The law at `x`.
    pub(super) fn at(&self, x: f64) -> f64 {
        self.prefactor * x.powf(self.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_law_is_found() {
        let points = [0.01, 0.02, 0.05, 0.1].map(|x: f64| (x, 3.0 * x.powf(-0.5)));
        let law = PowerLaw::fit(&points).unwrap();
        assert!((law.exponent + 0.5).abs() < 1e-14 && (law.prefactor - 3.0).abs() < 1e-13);
        assert!(law.exponent_error < 1e-14 && (law.local.0 + 0.5).abs() < 1e-14);
        assert!((law.at(0.04) - 15.0).abs() < 1e-12);
    }

    /// Logarithms 0, 1, 2 against 0, 1 + h, 2: the line has slope 1, residuals −h/3, 2h/3, −h/3, so that the
    /// variance of the slope is (6h²/9)/1/2 = h²/3.
    #[test]
    fn the_scatter_gives_the_error() {
        let h = 0.03_f64;
        let points = [(1.0, 1.0), (1.0_f64.exp(), (1.0 + h).exp()), (2.0_f64.exp(), 2.0_f64.exp())];
        let law = PowerLaw::fit(&points).unwrap();
        assert!((law.exponent - 1.0).abs() < 1e-14);
        assert!((law.exponent_error - h / 3.0_f64.sqrt()).abs() < 1e-14, "{law:?}");
        assert!((law.local.0 - (1.0 - h)).abs() < 1e-13 && (law.local.1 - (1.0 + h)).abs() < 1e-13);
    }

    #[test]
    fn two_points_or_none_positive_make_no_law() {
        assert_eq!(PowerLaw::fit(&[(1.0, 1.0), (2.0, 2.0)]), None);
        assert_eq!(PowerLaw::fit(&[(1.0, 1.0), (2.0, -2.0), (3.0, 1.0)]), None);
    }
}
