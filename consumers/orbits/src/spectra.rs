//! Runs whose spectra are compared with a branch: before and beyond an instability.

use crate::{Asked, MapError, Problem};
use producer::integrator::Integrator;
use producer::state::ChainState;
use std::sync::atomic::{AtomicBool, Ordering};
use waves::segments::Window;
use waves::welch::{DensitySummary, Welch};

/// Samples of a period.
const SAMPLES: u64 = 16;

/// The motion of a bead in the second half of a run.
#[derive(Debug, Clone)]
pub struct Spectrum {
    /// The value of the key.
    pub parameter: f64,
    /// Number of the bead.
    pub bead: usize,
    /// Frequency (Hz) of the orbits.
    pub orbit_hz: f64,
    /// Frequencies (Hz).
    pub frequencies_hz: Vec<f64>,
    /// Density of the velocity (m² s⁻² Hz⁻¹) at these.
    pub density: Vec<f64>,
}

impl Spectrum {
    /// The motion of `bead` in a run of `problem`, the problem at `parameter`, over `duration_s`.
    pub(crate) fn of(
        problem: &Problem,
        (parameter, bead, duration_s): (f64, usize, f64),
        stop: &AtomicBool,
    ) -> Result<Self, MapError> {
        let physics = &problem.physics;
        let dt_s = physics.dt_s;
        let period_s = match problem.asked {
            Asked::PeriodS(period_s) => period_s,
            _ => dt_s * physics.step_count as f64,
        };
        let steps = |time_s: f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
            let steps = (time_s / dt_s) as u64;
            steps
        };
        let (every, last) = (steps(period_s / SAMPLES as f64).max(1), steps(duration_s));
        let (mut integrator, mut state) = (Integrator::new(physics), ChainState::initial(physics));
        let mut welch = Welch::for_samples(1, last / 2 / every, &[], Window::Hann);
        while state.step + every <= last {
            let next = state.step + every;
            while state.step < next {
                integrator.advance(&mut state, next);
            }
            if integrator.first_non_finite(&state).is_some() {
                return Err(MapError::NotFinite { steps: state.step });
            }
            if stop.load(Ordering::Relaxed) {
                return Err(MapError::Stopped);
            }
            if 2 * state.step > last {
                welch.push([state.v_m_s[bead]]);
            }
        }
        let rate_hz = 1.0 / (dt_s * every as f64);
        let (frequencies_hz, density) = (welch.frequencies_hz(rate_hz), welch.density(0, rate_hz));
        Ok(Self { parameter, bead, orbit_hz: 1.0 / period_s, frequencies_hz, density })
    }

    /// Root of the mean square of the velocity (m/s).
    pub fn rms_m_s(&self) -> f64 {
        DensitySummary::of(&self.frequencies_hz, &self.density).mean_square.sqrt()
    }
}
