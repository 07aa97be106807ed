//! The dimensionless numbers of a wave, and the wave in units.

/// Coefficients of a wave of exponent α in terms of the mass m (kg) of a bead, the stiffness k (N·m^−α) and the largest
/// velocity `v_max` (m/s) that a bead reaches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// The exponent α of the contact law.
    pub alpha: f64,
    /// `C_V`: the speed is `V = C_V·(k/m)^(1/(α+1))·v_max^((α−1)/(α+1))` (beads/s).
    pub speed: f64,
    /// `C_δ`: the largest overlap is `C_δ·(m·v_max²/k)^(1/(α+1))` (m).
    pub overlap: f64,
    /// `C_p`: the momentum of the wave is `C_p·m·v_max` (kg·m/s).
    pub momentum: f64,
    /// `C_E`: the energy of the wave is `C_E·m·v_max²` (J).
    pub energy: f64,
    /// Kinetic part of the energy, averaged over the positions of the wave on the lattice.
    pub kinetic_fraction: f64,
    /// Full width (beads) where the overlap is half its largest.
    pub overlap_fwhm_beads: f64,
    /// Full width (beads) where the velocity is half its largest.
    pub velocity_fwhm_beads: f64,
}

/// A known quantity of a wave, which scales it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Strength {
    /// The largest velocity of a bead.
    PeakVelocity {
        /// `v_max` (m/s).
        m_s: f64,
    },
    /// The speed of the wave. Near α = 1 it hardly depends on how strong the wave is, so that a small
    /// error in it is a large one in everything else, `(α+1)/(α−1)` times as large for `v_max`.
    Speed {
        /// V (beads/s).
        beads_per_s: f64,
    },
    /// The energy of the wave.
    Energy {
        /// E (J).
        j: f64,
    },
}

/// A wave in units: its shape times these.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaveScale {
    /// The largest velocity of a bead (m/s).
    pub velocity_m_s: f64,
    /// The largest overlap of a contact (m).
    pub overlap_m: f64,
    /// Speed of the wave (beads/s).
    pub speed_beads_per_s: f64,
    /// Momentum of the wave (kg·m/s).
    pub momentum_kg_m_s: f64,
    /// Energy of the wave (J).
    pub energy_j: f64,
}

/// A mass, a stiffness or a strength that no wave has.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the {quantity} of a wave must be positive and finite, but it is {value}")]
pub struct ScaleError {
    /// The quantity.
    pub quantity: &'static str,
    /// Its value, in the unit that [`Coefficients::scaled`] takes or [`WaveScale`] gives.
    pub value: f64,
}

impl Coefficients {
    /// The wave in beads of mass `mass_kg` (kg) whose contacts have the stiffness `stiffness` (N·m^−α).
    ///
    /// ```
    /// use consumers::theory::{ContinuumWave, Strength};
    /// let coefficients = ContinuumWave::new(3.0)?.coefficients();
    /// // C_V = (2/4)^(1/4); with k/m = 16 and v_max = 4: V = C_V·16^(1/4)·4^(2/4)
    /// let scale = coefficients.scaled(0.5, 8.0, Strength::PeakVelocity { m_s: 4.0 })?;
    /// assert!((scale.speed_beads_per_s - 0.5_f64.powf(0.25) * 4.0).abs() < 1e-14);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When something given is not positive and finite, or the result is not because it leaves the range
    /// of a double.
    pub fn scaled(&self, mass_kg: f64, stiffness: f64, strength: Strength) -> Result<WaveScale, ScaleError> {
        let mass_kg = positive("bead mass", mass_kg)?;
        let ratio = positive("stiffness", stiffness)? / mass_kg;
        let power = 1.0 / (self.alpha + 1.0);
        let unit_speed = self.speed * ratio.powf(power);
        let velocity_m_s = match strength {
            Strength::PeakVelocity { m_s } => m_s,
            Strength::Speed { beads_per_s } => {
                (positive("speed", beads_per_s)? / unit_speed).powf((self.alpha + 1.0) / (self.alpha - 1.0))
            }
            Strength::Energy { j } => (positive("energy", j)? / (self.energy * mass_kg)).sqrt(),
        };
        let velocity_m_s = positive("peak velocity", velocity_m_s)?;
        let squared = velocity_m_s * velocity_m_s;
        Ok(WaveScale {
            velocity_m_s,
            overlap_m: positive("overlap", self.overlap * (squared / ratio).powf(power))?,
            speed_beads_per_s: positive("speed", unit_speed * velocity_m_s.powf((self.alpha - 1.0) * power))?,
            momentum_kg_m_s: positive("momentum", self.momentum * mass_kg * velocity_m_s)?,
            energy_j: positive("energy", self.energy * mass_kg * squared)?,
        })
    }
}

fn positive(quantity: &'static str, value: f64) -> Result<f64, ScaleError> {
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err(ScaleError { quantity, value }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COEFFICIENTS: Coefficients = Coefficients {
        alpha: 1.5,
        speed: 0.9,
        overlap: 1.2,
        momentum: 1.6,
        energy: 1.5,
        kinetic_fraction: 0.55,
        overlap_fwhm_beads: 1.7,
        velocity_fwhm_beads: 1.6,
    };

    #[test]
    fn whatever_is_given_gives_the_same_wave() {
        let of = |strength| COEFFICIENTS.scaled(3e-3, 2e8, strength).unwrap();
        let wave = of(Strength::PeakVelocity { m_s: 0.7 });
        let speed = of(Strength::Speed { beads_per_s: wave.speed_beads_per_s });
        let energy = of(Strength::Energy { j: wave.energy_j });
        for other in [speed, energy] {
            // five powers and roots of rounded numbers, one of them the fifth power
            assert!((other.velocity_m_s / wave.velocity_m_s - 1.0).abs() < 1e-14);
            assert!((other.overlap_m / wave.overlap_m - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn what_no_wave_has_is_refused_by_name() {
        let of = |m, k, strength| COEFFICIENTS.scaled(m, k, strength).unwrap_err().quantity;
        let one = Strength::PeakVelocity { m_s: 1.0 };
        assert_eq!(of(0.0, 1.0, one), "bead mass");
        assert_eq!(of(1.0, f64::INFINITY, one), "stiffness");
        assert_eq!(of(1.0, 1.0, Strength::PeakVelocity { m_s: -1.0 }), "peak velocity");
        assert_eq!(of(1.0, 1.0, Strength::Speed { beads_per_s: f64::NAN }), "speed");
        assert_eq!(of(1.0, 1.0, Strength::Energy { j: 0.0 }), "energy");
        assert_eq!(of(1.0, 1.0, Strength::PeakVelocity { m_s: 1e200 }), "overlap");
    }
}
