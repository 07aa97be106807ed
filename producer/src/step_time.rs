//! Time of a step, measured on some steps.

use crate::integrator::Integrator;
use crate::state::ChainState;
use schemas::manifest::Physics;
use std::time::{Duration, Instant};

/// The time (s) of a step of `physics` with every bead in motion and a third of the contacts closed, `together` steps
/// made at a time. Makes steps for about the time `budget`, one at least.
pub fn step_time_s(physics: &Physics, together: u64, budget: Duration) -> f64 {
    let scales = physics.scales();
    let (mut u_m, mut v_m_s) = physics.initial_state();
    for (bead, (u_m, v_m_s)) in u_m.iter_mut().zip(&mut v_m_s).enumerate() {
        if bead % 3 == 0 {
            *u_m = 0.1 * scales.length_m;
        }
        *v_m_s = 1e-3 * scales.speed_m_s();
    }
    let mut state = ChainState::starting_at(physics, &u_m, &v_m_s);
    let mut integrator = Integrator::new(physics);
    // the first steps also fetch the chain
    integrator.step(&mut state);
    let (first, start) = (state.step, Instant::now());
    loop {
        let last = state.step.saturating_add(together);
        integrator.advance(&mut state, last);
        let elapsed = start.elapsed();
        if elapsed >= budget {
            return elapsed.as_secs_f64() / (state.step - first) as f64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::presets::PRESETS;

    #[test]
    fn a_step_takes_some_time_and_ten_times_the_beads_more() {
        let time_s = |beads: u64| {
            let mut config = PRESETS[2].config();
            config.chain.beads = beads;
            let physics = Physics::resolve(&config).expect("valid");
            step_time_s(&physics, 1, Duration::from_millis(5))
        };
        let (few, many) = (time_s(200), time_s(20_000));
        assert!(few > 0.0 && many > few, "{few} {many}");
    }
}
