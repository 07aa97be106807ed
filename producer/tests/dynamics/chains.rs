//! The runs that these tests make.

use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{Impurity, RunConfig};
use schemas::manifest::Physics;
use schemas::presets::Preset;

/// A chain of `beads` equal beads of 1 g, k = 1e7 N·m^−α, bead 0 at 5 m/s, changed by `change`, over
/// `steps` steps of `fraction` T.
pub(crate) fn physics(
    beads: u64,
    alpha: f64,
    fraction: f64,
    steps: u64,
    change: impl FnOnce(&mut RunConfig),
) -> Physics {
    let mut config = config(beads, alpha);
    change(&mut config);
    let scales = Physics::resolve(&config).unwrap().scales();
    let dt_s = fraction * scales.time_s;
    config.time.dt_s = Some(dt_s);
    config.time.duration_s = steps as f64 * dt_s;
    let physics = Physics::resolve(&config).unwrap();
    assert_eq!((physics.dt_s, physics.step_count), (dt_s, steps));
    physics
}

/// The configuration of that chain, without a time step.
pub(crate) fn config(beads: u64, alpha: f64) -> RunConfig {
    let mut config = Preset::find("homogeneous").unwrap().config();
    (config.chain.beads, config.chain.alpha) = (beads, Some(alpha));
    config
}

/// An impurity of `ratio` times the 1 g of the other beads.
pub(crate) fn impurity(bead: u64, ratio: f64) -> Impurity {
    Impurity { bead, mass_kg: ratio * 1e-3 }
}

/// The state at the last step.
pub(crate) fn final_state(physics: &Physics) -> ChainState {
    state_after(physics, ChainState::initial(physics))
}

/// The state at the last step of a run that begins with `start`.
pub(crate) fn state_after(physics: &Physics, start: ChainState) -> ChainState {
    let mut state = start;
    let mut integrator = Integrator::new(physics);
    while state.step < physics.step_count {
        integrator.step(&mut state);
    }
    state
}
