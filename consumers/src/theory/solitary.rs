//! The exact solitary wave of the lattice.

use super::fixed_point::{Ended, fixed_point};
use super::profile::EvenProfile;
use super::{Coefficients, GaussianLimit, WaveError};
use std::cell::RefCell;
use std::f64::consts::LN_2;

/// Samples over the narrowest feature of the wave: the error of the differences of tenth order and that of
/// the interpolation are then below rounding.
const SAMPLES_PER_FEATURE: f64 = 20.0;

/// The wave is cut off after this many of the standard deviations of its Gaussian limit, where it has faded
/// below rounding: `e^(−9²/2)` is 3e-18, and its tails fall faster than a Gaussian's.
const EXTENT_SIGMA: f64 = 9.0;

/// The error of the wave asked for, relative to its height: the last step of Newton's method.
const ERROR: f64 = 1e-12;

/// Error from rounding in one application of the map. The direction in which the map contracts least makes the error of
/// the wave `1/(1 − 1/α)` times as large.
const ROUNDING: f64 = 2e-15;

/// Exponents whose coefficients each thread remembers.
const MOST_REMEMBERED: usize = 16;

thread_local! {
    static REMEMBERED: RefCell<Vec<(f64, Result<Coefficients, WaveError>)>> = const { RefCell::new(Vec::new()) };
}

/// The travelling wave of the lattice itself, without approximation.
///
/// A wave of speed V in `m·ü_i = F_{i−1} − F_i`, `F = k·δ^α`, satisfies, after two integrations,
///
/// ```text
///     v(ξ) = (k/(m·V)) · ∫ δ^α dη          over |η − ξ| ≤ ½
///     δ(ξ) = (1/V) · ∫ v dη                over |η − ξ| ≤ ½
/// ```
///
/// so that δ is `k/(m·V²)` times the convolution of `δ^α` with the triangle `max(0, 1 − |ξ|)`. No time is stepped:
/// the fixed point of this map is found on a grid that divides the bead, with the height of the wave
/// held at 1. Holding it removes the one direction in which the map expands (by α); all others contract,
/// the slowest by 1/α near α = 1.
///
/// Shapes and coefficients are good to 1e-12 for α from 1.004 to 1000. Closer to 1 rounding widens or narrows the
/// wave by 2e-15/(α − 1) at most, while `C_V` and the kinetic fraction keep 1e-14.
///
/// # Source
/// G. Friesecke and J. A. D. Wattis, Commun. Math. Phys. 161 (1994) 391, doi:10.1007/BF02099784 (existence);
/// J. M. English and R. L. Pego, Proc. Amer. Math. Soc. 133 (2005) 1763,
/// doi:10.1090/S0002-9939-05-07851-2 (the integral equation, and the doubly exponential tails).
#[derive(Debug, Clone, PartialEq)]
pub struct SolitaryWave {
    overlap: EvenProfile,
    velocity: EvenProfile,
    coefficients: Coefficients,
}

impl SolitaryWave {
    /// The smallest exponent; the wave is 304 beads wide. Below, Newton's method cannot tell the
    /// width of the wave to 1e-9, and [`ContinuumWave`](super::ContinuumWave) is good to 1e-5 relative.
    pub const SMALLEST_ALPHA: f64 = 1.000_01;
    /// The largest exponent; the overlap is a triangle but for a thousandth of a bead.
    pub const LARGEST_ALPHA: f64 = 1000.0;

    /// The wave of the exponent `alpha`; milliseconds of work for exponents from 1.01 to 10.
    ///
    /// ```
    /// let wave = consumers::theory::SolitaryWave::new(2.0)?;
    /// // virial relation: the kinetic fraction is (α+1)/(α+3)
    /// assert!((wave.coefficients().kinetic_fraction - 0.6).abs() < 1e-12);
    /// # Ok::<(), consumers::theory::WaveError>(())
    /// ```
    ///
    /// # Errors
    /// When `alpha` is outside [`SolitaryWave::SMALLEST_ALPHA`] to [`SolitaryWave::LARGEST_ALPHA`], or the
    /// iteration does not converge.
    pub fn new(alpha: f64) -> Result<Self, WaveError> {
        let (smallest, largest) = (Self::SMALLEST_ALPHA, Self::LARGEST_ALPHA);
        if !(smallest..=largest).contains(&alpha) {
            return Err(WaveError::Exponent { alpha, smallest, largest });
        }
        Self::with_resolution(alpha, SAMPLES_PER_FEATURE)
    }

    /// The coefficients of the wave of the exponent `alpha`, which are remembered: a sweep asks for those of few exponents, at
    /// each point.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn coefficients_of(alpha: f64) -> Result<Coefficients, WaveError> {
        REMEMBERED.with_borrow_mut(|remembered| {
            if let Some((_, found)) = remembered.iter().find(|(known, _)| *known == alpha) {
                return *found;
            }
            let found = Self::new(alpha).map(|wave| wave.coefficients());
            remembered.truncate(MOST_REMEMBERED - 1);
            remembered.insert(0, (alpha, found));
            found
        })
    }

    /// The overlap at `xi_beads` (beads) from the centre, relative to the largest: from 0 to 1, but for rounding.
    pub fn overlap(&self, xi_beads: f64) -> f64 {
        self.overlap.at(xi_beads)
    }

    /// The velocity at `xi_beads` (beads) from the centre, relative to the largest: from 0 to 1, but for rounding.
    pub fn velocity(&self, xi_beads: f64) -> f64 {
        self.velocity.at(xi_beads)
    }

    /// Half the length (beads) over which the wave was computed; beyond it both are 0 here, and below
    /// 1e-16 in truth.
    pub fn half_length_beads(&self) -> f64 {
        self.overlap.extent_beads()
    }

    /// Speed, widths, momentum and energy.
    pub fn coefficients(&self) -> Coefficients {
        self.coefficients
    }

    /// The wave with about `samples` samples over the narrowest feature of it.
    fn with_resolution(alpha: f64, samples: f64) -> Result<Self, WaveError> {
        let start = first_guess(alpha, samples)?;
        let tolerance = ERROR.max(ROUNDING / (1.0 - 1.0 / alpha));
        let Ended { point, last_step, step_count } =
            fixed_point(start.values().to_vec(), tolerance, |overlap| {
                normalised_push(&start.with_values(overlap.to_vec()), alpha)
            });
        if last_step > tolerance || last_step.is_nan() {
            return Err(WaveError::NotConverged { alpha, last_step, tolerance, step_count });
        }
        Ok(Self::of_fixed_point(&start.with_values(point), alpha))
    }

    /// The wave of an overlap of height 1 that is the fixed point.
    fn of_fixed_point(overlap: &EvenProfile, alpha: f64) -> Self {
        let overlap = overlap.map(|delta| delta.max(0.0));
        let (once, twice) = push(&force(&overlap, alpha));
        // in units with k = m = 1 and a largest overlap of 1: V² and V·v_max
        let (speed_squared, speed_times_peak) = (twice.values()[0], once.values()[0]);
        // v_max/(V·δ_max), which the continuum has as 1
        let ratio = speed_times_peak / speed_squared;
        let velocity = once.map(|value| (value / speed_times_peak).max(0.0));
        let speed = (speed_squared * ratio.powf(1.0 - alpha)).powf(1.0 / (alpha + 1.0));
        // energies over m·v_max², where m·V²·δ_max² = v_max²/ratio²
        let kinetic = 0.5 * velocity.map(|v| v * v).integral();
        let stored = overlap.map(|delta| delta.powf(alpha + 1.0)).integral();
        let potential = stored / ((alpha + 1.0) * speed_squared * ratio * ratio);
        let coefficients = Coefficients {
            alpha,
            speed,
            overlap: 1.0 / (ratio * speed),
            momentum: velocity.integral(),
            energy: kinetic + potential,
            kinetic_fraction: kinetic / (kinetic + potential),
            overlap_fwhm_beads: overlap.full_width_at_half_maximum(),
            velocity_fwhm_beads: velocity.full_width_at_half_maximum(),
        };
        Self { overlap, velocity, coefficients }
    }
}

/// `δ^α`. Newton's steps may leave negative overlaps where the wave has faded below rounding.
fn force(overlap: &EvenProfile, alpha: f64) -> EvenProfile {
    overlap.map(|delta| delta.max(0.0).powf(alpha))
}

/// The force averaged over a bead, which is V·v, and that averaged once more, which is V²·δ, for k = m = 1.
fn push(force: &EvenProfile) -> (EvenProfile, EvenProfile) {
    let once = force.mean_over_a_bead();
    let twice = once.mean_over_a_bead();
    (once, twice)
}

/// The map whose fixed point is the wave, `δ ↦ Λ*δ^α` divided by its height, and its derivative there, a
/// function of a direction `η`: `(Λ*(α·δ^(α−1)·η) − image·(the same at 0))/height`.
fn normalised_push(overlap: &EvenProfile, alpha: f64) -> (Vec<f64>, impl Fn(&[f64]) -> Vec<f64> + use<>) {
    let (_, twice) = push(&force(overlap, alpha));
    let height = twice.values()[0];
    let image = twice.map(|value| value / height).into_values();
    let stiffness = overlap.map(|delta| alpha * delta.max(0.0).powf(alpha - 1.0) / height);
    let at = image.clone();
    let derivative = move |direction: &[f64]| {
        let force = stiffness.values().iter().zip(direction).map(|(s, d)| s * d).collect();
        let (_, twice) = push(&stiffness.with_values(force));
        let growth = twice.values()[0];
        twice.values().iter().zip(&at).map(|(change, image)| change - growth * image).collect()
    };
    (image, derivative)
}

/// A Gaussian of about the right width, on a grid that suits the wave.
fn first_guess(alpha: f64, samples: f64) -> Result<EvenProfile, WaveError> {
    // from α = 2 on the wave stays as wide as it is, while the force at its centre narrows as 1/α
    let sigma_beads = GaussianLimit::new(alpha.min(2.0))?.sigma_beads;
    let feature_beads = sigma_beads.min(1.2 / alpha);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 12,000")]
    let half = (0.5 * samples / feature_beads).ceil() as usize;
    // from bead to bead the logarithm of the tail grows by the factor α, from α = 2 on faster than for a Gaussian
    let extent_beads = 2.0 + EXTENT_SIGMA * sigma_beads * (LN_2 / alpha.ln()).min(1.0);
    let shape = |xi: f64| (-0.5 * (xi / sigma_beads).powi(2)).exp();
    Ok(EvenProfile::sample(2 * half.max(2) + 1, extent_beads, shape))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The differences, the interpolation and the cut-off all show in one number or another.
    #[test]
    fn another_grid_gives_the_same_wave() {
        for alpha in [1.0001, 1.001, 1.01, 1.1, 1.5, 2.0, 3.0, 10.0, 100.0] {
            let coarse = SolitaryWave::with_resolution(alpha, SAMPLES_PER_FEATURE).unwrap();
            let fine = SolitaryWave::with_resolution(alpha, 2.0 * SAMPLES_PER_FEATURE).unwrap();
            // the last step of Newton's method is exact to rounding times the least contraction
            let tolerance = 1e-13_f64.max(ROUNDING / (1.0 - 1.0 / alpha));
            let (a, b) = (coarse.coefficients, fine.coefficients);
            let ratios = [
                a.speed / b.speed,
                a.overlap / b.overlap,
                a.momentum / b.momentum,
                a.energy / b.energy,
                a.overlap_fwhm_beads / b.overlap_fwhm_beads,
                a.velocity_fwhm_beads / b.velocity_fwhm_beads,
            ];
            assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < tolerance), "{alpha}: {ratios:?}");
            for xi in [0.01, 0.2, 0.47, 0.6, 1.1, 2.3] {
                assert!((coarse.overlap(xi) - fine.overlap(xi)).abs() < tolerance, "δ({xi}), α = {alpha}");
                assert!((coarse.velocity(xi) - fine.velocity(xi)).abs() < tolerance, "v({xi}), α = {alpha}");
            }
        }
    }

    /// The method is of twelfth order: twice as many samples, an error less by 2^12.
    #[test]
    fn refinement_converges_at_the_order_of_the_differences() {
        let width =
            |samples| SolitaryWave::with_resolution(10.0, samples).unwrap().coefficients.overlap_fwhm_beads;
        let exact = width(40.0);
        let (error, halved) = ((width(3.0) - exact).abs(), (width(6.0) - exact).abs());
        // 2^12 or so: the numbers of samples are rounded to odd ones
        assert!(error < 1e-8 && halved > 1e-13, "{error:e}, {halved:e}");
        assert!((10.0..14.0).contains(&(error / halved).log2()), "{error:e}, {halved:e}");
    }

    #[test]
    fn every_exponent_converges() {
        let (smallest, largest) = (SolitaryWave::SMALLEST_ALPHA - 1.0, SolitaryWave::LARGEST_ALPHA - 1.0);
        for j in 0..=100_u8 {
            let epsilon = smallest * (largest / smallest).powf(f64::from(j) / 100.0);
            let alpha = (1.0 + epsilon).clamp(SolitaryWave::SMALLEST_ALPHA, SolitaryWave::LARGEST_ALPHA);
            let wave = SolitaryWave::new(alpha).unwrap();
            for profile in [&wave.overlap, &wave.velocity] {
                let falls = profile.values().windows(2).all(|pair| pair[1] <= pair[0] + 1e-14);
                let last = profile.values()[profile.values().len() - 1];
                assert!(falls && profile.values()[0] == 1.0 && last < 1e-16, "α = {alpha}: {last:e}");
            }
        }
    }
}
