//! Error of a run's energy, found by making the run.

use crate::integrator::Integrator;
use crate::state::ChainState;
use schemas::manifest::Physics;
use schemas::summary::Drift;

/// Result of [`energy_error`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyError {
    /// The largest |ΔE/E| ([`Drift`]) of the states looked at, dissipated work included in E; infinite where a state
    /// left the range of doubles.
    pub largest: f64,
    /// Steps made.
    pub steps: u64,
}

/// Makes the first `steps` steps of a run (at most all of them), looking at the energy after every
/// `look_every`-th and after the last. `progress` is called with the step at each look.
pub fn energy_error(
    physics: &Physics,
    steps: u64,
    look_every: u64,
    mut progress: impl FnMut(u64),
) -> EnergyError {
    let steps = if steps < physics.step_count { steps } else { physics.step_count };
    let chain = physics.chain();
    let drift = Drift::new(physics, &chain);
    let mut contact_energy_j = vec![0.0; chain.contact_count()];
    let mut integrator = Integrator::new(physics);
    let mut state = ChainState::initial(physics);
    let mut largest = 0.0;
    while state.step < steps {
        let look = (state.step / look_every + 1) * look_every;
        let look = if look < steps { look } else { steps };
        while state.step < look {
            integrator.advance(&mut state, look);
        }
        progress(state.step);
        let energy_j = chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut contact_energy_j).total_j();
        let (dissipated_j, driven_j) = (physics.dissipated_j(&state.extra), physics.driven_j(&state.extra));
        let error = drift.of(energy_j + dissipated_j, driven_j, &state.v_m_s).abs();
        if !error.is_finite() {
            return EnergyError { largest: f64::INFINITY, steps: state.step };
        }
        largest = if error > largest { error } else { largest };
    }
    EnergyError { largest, steps }
}
