//! The natural length and time of a collision.

use crate::power::power;

/// The scales with which every result of a run scales exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// `L = (m·v0²/k)^(1/(α+1))` (m).
    pub length_m: f64,
    /// `T = L/v0` (s).
    pub time_s: f64,
}

impl Scales {
    /// Scales of a bead of mass `mass_kg` that hits with the speed `speed_m_s > 0` a chain of stiffness
    /// `stiffness` (N·m^−α) and exponent `alpha`.
    ///
    /// ```
    /// let s = schemas::scales::Scales::new(1e-3, 5.0, 1e7, 1.5);
    /// assert!((s.length_m - 0.36238983e-3).abs() < 1e-11); // shared reference, 8 digits
    /// assert!((s.time_s - 72.477966e-6).abs() < 1e-12);
    /// ```
    pub fn new(mass_kg: f64, speed_m_s: f64, stiffness: f64, alpha: f64) -> Self {
        let length_m = power(mass_kg * (speed_m_s * speed_m_s) / stiffness, 1.0 / (alpha + 1.0));
        Self { length_m, time_s: length_m / speed_m_s }
    }

    /// Scales of a bead of mass `mass_kg` between contacts that a load presses together by `overlap_m > 0`: that
    /// overlap, and `√(m/(k·δ^(α−1)))`, in which a small disturbance moves by about one bead.
    ///
    /// ```
    /// let s = schemas::scales::Scales::of_load(4.0, 0.25, 1.0, 3.0);
    /// assert_eq!((s.length_m, s.time_s, s.speed_m_s()), (0.25, 8.0, 0.03125)); // √(4/0.25²)
    /// ```
    pub fn of_load(mass_kg: f64, overlap_m: f64, stiffness: f64, alpha: f64) -> Self {
        let time_s = (mass_kg / (stiffness * power(overlap_m, alpha - 1.0))).sqrt();
        Self { length_m: overlap_m, time_s }
    }

    /// `L/T` (m/s): the speed of the striker, if there is one.
    pub fn speed_m_s(&self) -> f64 {
        self.length_m / self.time_s
    }
}
