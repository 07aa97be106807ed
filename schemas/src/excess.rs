//! Energy of a contact beyond that at rest, for contacts that a load presses together.
//!
//! `U(δ) − U(δ_rest) − F_rest·(δ − δ_rest)` is of second order in the approach `a = δ − δ_rest`, so that its three
//! terms cancel to nothing but rounding where a weak pulse crosses a strong load. There it is the series
//! `F_rest·a·x·Σ c_n·x^n` with `x = a/δ_rest`, `c_0 = α/2` and `c_(n+1) = c_n·(α − 1 − n)/(n + 3)`: the binomial series of
//! `(1 + x)^(α+1)` from its second power on.

use crate::contact::ContactLaw;

/// Terms of the series.
const TERMS: usize = 8;

/// A contact at rest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AtRest {
    /// Overlap (m); 0 where nothing presses.
    pub(crate) overlap_m: f64,
    /// Force (N).
    pub(crate) force_n: f64,
    /// Energy (J).
    pub(crate) energy_j: f64,
}

/// Evaluates the excess for one exponent α.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Excess {
    coefficients: [f64; TERMS],
    /// The largest |x| for the series.
    small: f64,
}

impl Excess {
    pub(crate) fn new(law: &ContactLaw) -> Self {
        let alpha = law.alpha();
        let mut coefficients = [0.5 * alpha; TERMS];
        for n in 1..TERMS {
            coefficients[n] = coefficients[n - 1] * (alpha - n as f64) / (n as f64 + 2.0);
        }
        // what the series leaves out is then below (1/16)^8·2/10! of it, and the cancellation beyond about 1e-13
        Self { coefficients, small: 1.0 / (16.0 * (alpha + 1.0)) }
    }

    /// The excess (J) of a contact whose beads have come `approach_m` nearer than at `rest` and whose energy is
    /// now `energy_j`.
    #[inline(always)]
    pub(crate) fn energy_j(&self, rest: AtRest, approach_m: f64, energy_j: f64) -> f64 {
        let x = approach_m / rest.overlap_m;
        let mut sum = self.coefficients[TERMS - 1];
        let mut n = TERMS - 1;
        while n > 0 {
            n -= 1;
            sum = sum * x + self.coefficients[n];
        }
        // not so where x is NaN, in a contact without load
        let is_small = x.abs() <= self.small;
        let difference = (energy_j - rest.energy_j) - rest.force_n * approach_m;
        if is_small { rest.force_n * approach_m * x * sum } else { difference }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALPHAS: [f64; 8] = [1.0, 1.1, 1.5, 2.0, 2.5, 3.0, 10.0, 1000.0];

    /// In units of `F_rest·δ_rest`, for `δ_rest` = 1 m.
    fn excess(alpha: f64, x: f64) -> f64 {
        let law = ContactLaw::new(alpha);
        let rest = AtRest { overlap_m: 1.0, force_n: law.force(8.0, 1.0), energy_j: law.energy(8.0, 1.0) };
        let energy_j = law.energy(8.0, 1.0 + x);
        Excess::new(&law).energy_j(rest, x, energy_j) / rest.force_n
    }

    /// Both forms where they meet: the difference has lost `1/x²` of its digits there.
    #[test]
    fn the_series_joins_the_difference() {
        for alpha in ALPHAS {
            let x = 1.0 / (16.0 * (alpha + 1.0));
            for sign in [-1.0, 1.0] {
                let (within, beyond) =
                    (excess(alpha, sign * x * (1.0 - 1e-9)), excess(alpha, sign * x * (1.0 + 1e-9)));
                // the two points are 4e-9 apart
                let jump = beyond / within - 1.0 - 4e-9;
                assert!(jump.abs() < 1e-10, "α = {alpha}: {jump:e}");
            }
        }
    }

    /// α/2·x², whatever α is: for x = 1e-9 the difference of energies would be noise.
    #[test]
    fn a_weak_approach_has_the_energy_of_a_linear_spring() {
        for alpha in ALPHAS {
            for x in [1e-9, -1e-9] {
                let ratio = excess(alpha, x) / (0.5 * alpha * x * x);
                // the next term is (α − 1)/3·x of it
                assert!((ratio - 1.0).abs() < 1e-6, "α = {alpha}: {ratio}");
            }
        }
    }

    /// `(1/4)·((17/16)⁴ − 1) − 1/16` for α = 3 and `x = 1/16`.
    #[test]
    fn an_excess_worked_out_by_hand() {
        let expected = ((17.0_f64 / 16.0).powi(4) - 1.0) / 4.0 - 1.0 / 16.0;
        assert!((excess(3.0, 1.0 / 16.0) / expected - 1.0).abs() < 1e-13);
        // by the series: 3/2·x² + x³ + x⁴/4
        let expected = 1.5 / 4096.0 + 1.0 / 262_144.0 + 0.25 / 16_777_216.0;
        assert!((excess(3.0, 1.0 / 64.0) / expected - 1.0).abs() < 1e-15);
    }
}
