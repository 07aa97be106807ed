//! Power laws through measured points.

/// `y = prefactor·x^exponent`, fitted to logarithms by least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerLaw {
    /// The exponent.
    pub exponent: f64,
    /// Standard error of the exponent, from the scatter of the points about the line.
    pub exponent_error: f64,
    /// The y at x = 1.
    pub prefactor: f64,
    /// Least and largest exponent between two neighbouring points.
    pub local: (f64, f64),
}

/// Sums for the line through points that come one by one, each with a weight.
#[derive(Debug, Clone, Copy, Default)]
pub struct LineSums {
    count: usize,
    weight: f64,
    /// The weighted means of x and y.
    mean: [f64; 2],
    /// The weighted sums of products of the deviations from these: x with x, x with y.
    products: [f64; 2],
}

impl LineSums {
    /// Adds a point. One that is not finite, or without weight, does not count.
    pub fn add(&mut self, (x, y): (f64, f64), weight: f64) {
        if !(x.is_finite() && y.is_finite() && weight > 0.0) {
            return;
        }
        self.count += 1;
        self.weight += weight;
        let part = weight / self.weight;
        let [dx, dy] = [x - self.mean[0], y - self.mean[1]];
        self.mean = [self.mean[0] + part * dx, self.mean[1] + part * dy];
        let left = weight * (x - self.mean[0]);
        self.products = [self.products[0] + left * dx, self.products[1] + left * dy];
    }

    /// The slope, and the y at x = 0; none of fewer than three points, or of one x.
    pub fn line(&self) -> Option<[f64; 2]> {
        let [xx, xy] = self.products;
        let slope = xy / xx;
        (self.count > 2 && slope.is_finite()).then_some([slope, self.mean[1] - slope * self.mean[0]])
    }
}

impl PowerLaw {
    /// Through points (x, y) in the order of x, all positive; none for fewer than three.
    pub fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let points: Vec<_> = points.iter().map(|(x, y)| (*x, *y, None)).collect();
        Self::through(&points)
    }

    /// Through points (x, y, standard error of y), as [`fit`](Self::fit). Where each has an error above 0 these are the weights, and the error
    /// of the exponent is the larger one of that which they give and that of the scatter.
    pub fn through(points: &[(f64, f64, Option<f64>)]) -> Option<Self> {
        let weight = |(_, y, error): &(f64, f64, Option<f64>)| {
            error.map(|error| (y / error) * (y / error)).filter(|weight| weight.is_finite())
        };
        let weights: Option<Vec<f64>> = points.iter().map(weight).collect();
        let (weights, has_errors) = match weights {
            Some(weights) => (weights, true),
            None => (vec![1.0; points.len()], false),
        };
        let logs: Vec<[f64; 2]> = points.iter().map(|(x, y, _)| [x.ln(), y.ln()]).collect();
        let mut sums = LineSums::default();
        logs.iter().zip(&weights).for_each(|([x, y], weight)| sums.add((*x, *y), *weight));
        let [exponent, offset] = sums.line().filter(|_| sums.count == points.len())?;
        let rest = |[x, y]: &[f64; 2]| (y - offset - exponent * x) * (y - offset - exponent * x);
        let scatter: f64 = logs.iter().zip(&weights).map(|(point, weight)| weight * rest(point)).sum();
        let scatter = scatter / (points.len() - 2) as f64;
        let variance = if has_errors && scatter < 1.0 { 1.0 } else { scatter };
        let slopes = logs.windows(2).map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0]));
        let local = slopes.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), slope| {
            (least.min(slope), most.max(slope))
        });
        Some(Self {
            exponent,
            exponent_error: (variance / sums.products[0]).sqrt(),
            prefactor: offset.exp(),
            local,
        })
    }

    /// The law at `x`.
    pub fn at(&self, x: f64) -> f64 {
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

    /// Points with errors of 1 % and 2 % of y on an exact law: the variance of the exponent is 1/Σw(x − x̄)².
    #[test]
    fn known_errors_are_weights_and_give_the_error() {
        let errors = [0.01, 0.02, 0.01, 0.02];
        let points: Vec<_> = (0..4)
            .zip(errors)
            .map(|(i, error)| {
                let (x, y) = (f64::from(i).exp(), 2.0 * (2.0 * f64::from(i)).exp());
                (x, y, Some(error * y))
            })
            .collect();
        let law = PowerLaw::through(&points).unwrap();
        let weights = errors.map(|error| 1.0 / (error * error));
        let sum = |power: i32| (0..4).zip(weights).map(|(i, w)| w * f64::from(i).powi(power)).sum::<f64>();
        let spread = sum(2) - sum(1) * sum(1) / sum(0);
        assert!((law.exponent - 2.0).abs() < 1e-13, "{law:?}");
        assert!((law.exponent_error - spread.powf(-0.5)).abs() < 1e-12, "{law:?}");
    }

    #[test]
    fn two_points_or_none_positive_make_no_law() {
        assert_eq!(PowerLaw::fit(&[(1.0, 1.0), (2.0, 2.0)]), None);
        assert_eq!(PowerLaw::fit(&[(1.0, 1.0), (2.0, -2.0), (3.0, 1.0)]), None);
    }
}
