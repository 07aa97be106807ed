//! Statistics of many values of one quantity.

/// The parts of the values that lie below the [`Statistics::quantiles`].
pub const QUANTILES: [f64; 4] = [0.05, 0.25, 0.75, 0.95];

/// Mean, scatter and order of some values, in their unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statistics {
    /// Number of values.
    pub count: u64,
    /// `Σx/n`.
    pub mean: f64,
    /// `√(Σ(x − mean)²/(n − 1)/n)`, how far the mean is likely to be off; none of a single value.
    pub standard_error: Option<f64>,
    /// As many values lie above as below.
    pub median: f64,
    /// These parts of the values lie below: [`QUANTILES`].
    pub quantiles: [f64; 4],
}

impl Statistics {
    /// Makes them for those `values` that are finite; none if there is none. Sums are in the order given.
    ///
    /// ```
    /// use consumers::statistics::Statistics;
    /// let found = Statistics::of([1.0, 2.0, 3.0, 6.0]).unwrap();
    /// assert_eq!((found.mean, found.median), (3.0, 2.5));
    /// assert_eq!(found.standard_error, Some((14.0_f64 / 3.0 / 4.0).sqrt())); // 4 + 1 + 0 + 9
    /// ```
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
        if values.is_empty() {
            return None;
        }
        let count = values.len() as f64;
        let mean = values.iter().fold(0.0, |sum, value| sum + value) / count;
        let square = |value: &f64| (value - mean) * (value - mean);
        let squares = values.iter().fold(0.0, |sum, value| sum + square(value));
        let standard_error = (values.len() > 1).then(|| (squares / (count - 1.0) / count).sqrt());
        values.sort_by(f64::total_cmp);
        Some(Self {
            count: values.len() as u64,
            mean,
            standard_error,
            median: quantile(&values, 0.5),
            quantiles: QUANTILES.map(|part| quantile(&values, part)),
        })
    }
}

/// The value below which `part` of the `sorted` ones lie: at place `part·(n − 1)` from 0, linear between its neighbours.
///
/// # Source
/// R. J. Hyndman and Y. Fan, Am. Stat. 50 (1996) 361, DOI 10.1080/00031305.1996.10473566, definition 7: that of `NumPy` and R.
fn quantile(sorted: &[f64], part: f64) -> f64 {
    let place = part * (sorted.len() - 1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    let below = place.floor() as usize;
    let (low, high) = (sorted[below], sorted.get(below + 1).copied().unwrap_or(sorted[below]));
    low + (place - below as f64) * (high - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_their_neighbours() {
        // 0 to 20: part p lies at 20·p
        let found = Statistics::of((0..=20).rev().map(f64::from)).expect("values");
        assert_eq!((found.count, found.mean, found.median), (21, 10.0, 10.0));
        assert_eq!(found.quantiles, [1.0, 5.0, 15.0, 19.0]);
        // the variance of 0 to 20 is 770/20
        assert_eq!(found.standard_error, Some((770.0_f64 / 20.0 / 21.0).sqrt()));
    }

    #[test]
    fn what_is_no_number_is_left_out() {
        let one = Statistics::of([f64::NAN, 7.0, f64::INFINITY]).expect("a value");
        assert_eq!((one.count, one.mean, one.median, one.quantiles), (1, 7.0, 7.0, [7.0; 4]));
        assert_eq!(one.standard_error, None);
        assert_eq!(Statistics::of([f64::NAN]), None);
    }
}
