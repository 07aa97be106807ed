//! A few numbers about a frame, so that any plotting tool shows something useful at once.

use crate::chain::{Chain, Energy};
use crate::frame::Frame;
use crate::manifest::Physics;

/// The summary of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Kinetic and potential energy of the whole chain.
    pub energy: Energy,
    /// Work (J) that damped contacts have dissipated so far.
    pub dissipated_j: f64,
    /// [`relative_drift`] against the energy of the initial state.
    pub relative_drift: f64,
    /// The bead farthest along the direction of the shock that moves faster than a thousandth of
    /// the striker's initial speed.
    pub front_bead: u64,
    /// The impurities, in the order of the manifest.
    pub impurities: Vec<BeadState>,
}

/// Displacement and velocity of one bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeadState {
    /// Which bead.
    pub bead: u64,
    /// Displacement (m).
    pub u_m: f64,
    /// Velocity (m/s).
    pub v_m_s: f64,
}

/// Computes summaries of the frames of one run.
#[derive(Debug, Clone)]
pub struct Summarizer {
    chain: Chain,
    initial_j: f64,
    impurities: Vec<u64>,
    physics: Physics,
    /// Beads that move faster belong to the shock (m/s).
    front_threshold_m_s: f64,
    contact_energy_j: Vec<f64>,
}

impl Summarizer {
    /// For the run that `physics` describes.
    pub fn new(physics: &Physics) -> Self {
        let chain = physics.chain();
        Self {
            initial_j: physics.initial_energy().total_j(),
            impurities: physics.impurities.iter().map(|impurity| impurity.bead).collect(),
            front_threshold_m_s: 1e-3 * physics.scales().speed_m_s(),
            physics: physics.clone(),
            contact_energy_j: vec![0.0; chain.contact_count()],
            chain,
        }
    }

    /// The summary of `frame`.
    pub fn summarize(&mut self, frame: &Frame<'_>) -> Summary {
        let energy = self.chain.energy(frame.u_m, frame.v_m_s, &mut self.contact_energy_j);
        let dissipated_j = self.physics.dissipated_j(frame.extra);
        Summary {
            energy,
            dissipated_j,
            relative_drift: relative_drift(energy.total_j() + dissipated_j, self.initial_j),
            front_bead: self.front_bead(frame.v_m_s),
            impurities: self.impurities.iter().map(|bead| bead_state(frame, *bead)).collect(),
        }
    }

    fn front_bead(&self, v_m_s: &[f64]) -> u64 {
        let moves = |v: &f64| v.abs() > self.front_threshold_m_s;
        let striker = &self.physics.striker;
        let is_leftward = striker.velocity_m_s < 0.0;
        let front = if is_leftward { v_m_s.iter().position(moves) } else { v_m_s.iter().rposition(moves) };
        front.map_or(striker.bead, |bead| bead as u64)
    }
}

/// `(E − E0)/E0` of an energy (J), the dissipated work included, against the initial one; 0 where both are 0,
/// in a chain that stays at rest.
pub fn relative_drift(energy_j: f64, initial_j: f64) -> f64 {
    if energy_j == initial_j { 0.0 } else { (energy_j - initial_j) / initial_j }
}

fn bead_state(frame: &Frame<'_>, bead: u64) -> BeadState {
    // beads of a validated manifest are below N, which is an index
    let i = usize::try_from(bead).unwrap_or(usize::MAX);
    BeadState { bead, u_m: frame.u_m[i], v_m_s: frame.v_m_s[i] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::presets::PRESETS;

    #[test]
    fn summary_of_the_initial_state() {
        let physics = Physics::resolve(&PRESETS[0].config()).expect("preset");
        let (u_m, v_m_s) = physics.initial_state();
        let frame = Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[] };
        let summary = Summarizer::new(&physics).summarize(&frame);
        assert_eq!(summary.energy, Energy { kinetic_j: 0.0125, potential_j: 0.0 }); // ½·1 g·(5 m/s)²
        assert_eq!(summary.relative_drift, 0.0);
        assert_eq!(summary.front_bead, 0);
        assert_eq!(summary.impurities, [BeadState { bead: 500, u_m: 0.0, v_m_s: 0.0 }]);
    }

    #[test]
    fn the_front_is_looked_for_in_the_direction_of_the_shock() {
        let mut config = PRESETS[2].config();
        config.striker.bead = 199;
        config.striker.velocity_m_s = -5.0;
        let physics = Physics::resolve(&config).expect("valid");
        let (u_m, mut v_m_s) = physics.initial_state();
        v_m_s[120] = -1.0;
        let frame = Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[] };
        assert_eq!(Summarizer::new(&physics).summarize(&frame).front_bead, 120);
    }
}
