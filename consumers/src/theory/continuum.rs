//! Nesterenko's wave in the limit of long wavelengths, and the Gaussian it becomes near α = 1.

use super::{Coefficients, WaveError};
use std::f64::consts::{FRAC_PI_2, LN_2, PI};

/// One lobe of the compact wave of the continuum: `δ(ξ) ∝ cos^(2/(α−1))(q·ξ)` for `|q·ξ| ≤ π/2`,
/// otherwise 0, with `q = (α−1)·√(6/(α(α+1)))` per bead. Velocity and overlap have the same shape.
///
/// The paper's eq. (cos) speaks of intervals that span several lobes; the wave is one of them.
///
/// ```
/// let wave = consumers::theory::ContinuumWave::new(2.0)?;
/// // q = √(6/6) = 1, δ ∝ cos² ξ: half of it at π/4, nothing beyond π/2
/// assert!((wave.overlap(std::f64::consts::FRAC_PI_4) - 0.5).abs() < 1e-15);
/// assert_eq!(wave.overlap(1.6), 0.0);
/// assert!((wave.coefficients().speed - (2.0_f64 / 3.0).cbrt()).abs() < 1e-15); // eq. (vf)
/// # Ok::<(), consumers::theory::WaveError>(())
/// ```
///
/// # Source
/// V. F. Nesterenko, J. Appl. Mech. Tech. Phys. 24 (1983) 733, doi:10.1007/BF00905892 for α = 3/2; for any
/// α as in E. Hascoët and H. J. Herrmann, eq. (cos) and (vf).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContinuumWave {
    alpha: f64,
    /// q (1/beads).
    wavenumber: f64,
}

impl ContinuumWave {
    /// The wave of the exponent `alpha`.
    ///
    /// # Errors
    /// When `alpha` is not above 1 and finite.
    pub fn new(alpha: f64) -> Result<Self, WaveError> {
        if !(alpha > 1.0 && alpha.is_finite()) {
            return Err(WaveError::Exponent { alpha, smallest: 1.0_f64.next_up(), largest: f64::MAX });
        }
        // α/(α + 1) first, for α² may leave the range of a double
        Ok(Self { alpha, wavenumber: (alpha - 1.0) * (6.0 / (alpha + 1.0) / alpha).sqrt() })
    }

    /// The overlap at `xi_beads` (beads) from the centre, relative to the largest; from 0 to 1.
    pub fn overlap(&self, xi_beads: f64) -> f64 {
        let argument = self.wavenumber * xi_beads;
        if argument.abs() >= FRAC_PI_2 {
            return 0.0;
        }
        // cos^(2/ε) = (1 − sin²)^(1/ε), without cancellation for small ε
        let sine = argument.sin();
        ((-sine * sine).ln_1p() / (self.alpha - 1.0)).exp()
    }

    /// The velocity at `xi_beads` (beads) from the centre, relative to the largest; the same as the overlap.
    pub fn velocity(&self, xi_beads: f64) -> f64 {
        self.overlap(xi_beads)
    }

    /// Half the length (beads) of the wave: it is zero at this distance from its centre and beyond.
    pub fn half_length_beads(&self) -> f64 {
        FRAC_PI_2 / self.wavenumber
    }

    /// Speed, widths, momentum and energy.
    ///
    /// With `C_V = (2/(α+1))^(1/(α+1))` and `v = V·δ`. The lobe satisfies `∫δ^(α+1) = (α+3)/(2(α+1))·∫δ²` in
    /// units of its height, so that the kinetic fraction is `2(α+1)/(3α+5)`.
    pub fn coefficients(&self) -> Coefficients {
        let alpha = self.alpha;
        let speed = (2.0 / (alpha + 1.0)).powf(1.0 / (alpha + 1.0));
        // cos^(2/ε) = ½ where tan² = 2^ε − 1
        let half_angle = ((alpha - 1.0) * LN_2).exp_m1().sqrt().atan();
        let fwhm_beads = 2.0 * half_angle / self.wavenumber;
        let lobe = |power: f64| integral_of_cosine_power(power) / self.wavenumber;
        let kinetic_fraction = 2.0 * (alpha + 1.0) / (3.0 * alpha + 5.0);
        Coefficients {
            alpha,
            speed,
            overlap: 1.0 / speed,
            momentum: lobe(2.0 / (alpha - 1.0)),
            energy: 0.5 * lobe(4.0 / (alpha - 1.0)) / kinetic_fraction,
            kinetic_fraction,
            overlap_fwhm_beads: fwhm_beads,
            velocity_fwhm_beads: fwhm_beads,
        }
    }
}

/// `∫ cos^p` over `[−π/2, π/2]`, which is `√π·Γ(p/2 + ½)/Γ(p/2 + 1)`, for `p ≥ 0`.
fn integral_of_cosine_power(power: f64) -> f64 {
    // Wallis' recurrence up to where the asymptotic series of the ratio is good to rounding
    let (mut x, mut factor) = (0.5 * power, 1.0);
    while x < 20.0 {
        factor *= (x + 1.0) / (x + 0.5);
        x += 1.0;
    }
    let w = 1.0 / (x * x);
    let series = -(1.0 / 8.0
        - w * (1.0 / 192.0 - w * (1.0 / 640.0 - w * (17.0 / 14_336.0 - w * 31.0 / 18_432.0))))
        / x;
    factor * (PI / x).sqrt() * series.exp()
}

/// Limit of the wave for α → 1: `δ(ξ) ∝ exp(−6(α−1)/(α(α+1))·ξ²)`, a Gaussian whose width grows as `(α−1)^(−1/2)`.
///
/// # Source
/// E. Hascoët and H. J. Herrmann, the equation for v after eq. (speed).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianLimit {
    /// Standard deviation σ (beads), `√(α(α+1)/(12(α−1)))`.
    pub sigma_beads: f64,
}

impl GaussianLimit {
    /// The limit for the exponent `alpha`.
    ///
    /// ```
    /// let limit = consumers::theory::GaussianLimit::new(1.5)?;
    /// assert!((limit.sigma_beads - 0.625_f64.sqrt()).abs() < 1e-15); // 1.5·2.5/(12·0.5)
    /// # Ok::<(), consumers::theory::WaveError>(())
    /// ```
    ///
    /// # Errors
    /// When `alpha` is not above 1 and finite.
    pub fn new(alpha: f64) -> Result<Self, WaveError> {
        ContinuumWave::new(alpha)?;
        Ok(Self { sigma_beads: (alpha / (alpha - 1.0) * (alpha + 1.0) / 12.0).sqrt() })
    }

    /// The overlap, and also the velocity, at `xi_beads` (beads) from the centre, relative to the largest.
    pub fn overlap(&self, xi_beads: f64) -> f64 {
        let z = xi_beads / self.sigma_beads;
        (-0.5 * z * z).exp()
    }

    /// Full width at half maximum (beads), `2·√(2 ln 2)·σ`.
    pub fn fwhm_beads(&self) -> f64 {
        2.0 * (2.0 * LN_2).sqrt() * self.sigma_beads
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrals_of_cosine_powers() {
        // ∫1 = π, ∫cos = 2, ∫cos² = π/2, ∫cos³ = 4/3, ∫cos⁴ = 3π/8
        for (power, integral) in
            [(0.0, PI), (1.0, 2.0), (2.0, PI / 2.0), (3.0, 4.0 / 3.0), (4.0, 3.0 * PI / 8.0)]
        {
            assert!((integral_of_cosine_power(power) / integral - 1.0).abs() < 1e-14, "{power}");
        }
        // the 1000th: π·(1/2)(3/4)…(999/1000)
        let product: f64 = (1..=500).map(|k| 1.0 - 0.5 / f64::from(k)).product();
        assert!((integral_of_cosine_power(1000.0) / (PI * product) - 1.0).abs() < 1e-13);
    }

    /// Momentum and energy by Simpson's rule over the lobe, against the closed forms.
    #[test]
    fn coefficients_are_the_integrals_of_the_shape() {
        for alpha in [1.01, 1.2, 1.5, 2.0] {
            let wave = ContinuumWave::new(alpha).unwrap();
            let integral = |power: f64| {
                let cells = 20_000_u32;
                let spacing = wave.half_length_beads() / f64::from(cells);
                let weight = |j: u32| {
                    if j == 0 || j == cells {
                        1.0
                    } else if j % 2 == 1 {
                        4.0
                    } else {
                        2.0
                    }
                };
                let term = |j: u32| weight(j) * wave.overlap(f64::from(j) * spacing).powf(power);
                2.0 * spacing / 3.0 * (0..=cells).map(term).sum::<f64>()
            };
            let c = wave.coefficients();
            let (kinetic, potential) = (0.5 * integral(2.0), 0.5 * integral(alpha + 1.0));
            // the shape is twice differentiable at least, at its ends: Simpson is good to h⁴ and better
            assert!((c.momentum / integral(1.0) - 1.0).abs() < 1e-11, "{alpha}");
            assert!((c.energy / (kinetic + potential) - 1.0).abs() < 1e-11, "{alpha}");
            assert!((c.kinetic_fraction - kinetic / (kinetic + potential)).abs() < 1e-11, "{alpha}");
            assert!((wave.overlap(0.5 * c.overlap_fwhm_beads) - 0.5).abs() < 1e-13, "{alpha}");
        }
    }

    #[test]
    fn near_one_the_wave_is_the_gaussian() {
        for epsilon in [1e-2, 1e-4, 1e-8] {
            let wave = ContinuumWave::new(1.0 + epsilon).unwrap();
            let limit = GaussianLimit::new(1.0 + epsilon).unwrap();
            // the next term of the logarithm of the cosine: a relative change of order ε
            assert!((wave.coefficients().overlap_fwhm_beads / limit.fwhm_beads() - 1.0).abs() < epsilon);
            for z in [0.5, 1.0, 2.0] {
                let xi = z * limit.sigma_beads;
                assert!((wave.overlap(xi) - limit.overlap(xi)).abs() < epsilon, "{epsilon} {z}");
            }
        }
    }

    #[test]
    fn exponents_without_a_wave_are_refused() {
        for alpha in [1.0, 0.5, f64::NAN, f64::INFINITY] {
            assert!(ContinuumWave::new(alpha).is_err() && GaussianLimit::new(alpha).is_err());
        }
        assert!(ContinuumWave::new(1.0_f64.next_up()).unwrap().coefficients().speed.is_finite());
    }
}
