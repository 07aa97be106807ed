//! Measure for the dynamics: the loop that everybody writes first.

use producer::state::ChainState;
use schemas::manifest::Physics;

/// Velocity-Verlet as a plain scalar loop over all contacts and beads, with the platform's power function.
///
/// For chains without loads, walls and damping. It computes nothing that anybody uses: the platform's `pow` may differ
/// between machines in its last bit.
#[derive(Debug, Clone)]
pub(crate) struct ScalarLoop {
    alpha: f64,
    dt_s: f64,
    inverse_mass: Vec<f64>,
    stiffness: Vec<f64>,
    acceleration: Vec<f64>,
}

impl ScalarLoop {
    /// The loop for the chain of `physics`, whose method it ignores, at the accelerations of `state`.
    pub(crate) fn new(physics: &Physics, state: &ChainState) -> Self {
        let chain = physics.chain();
        let mut this = Self {
            alpha: chain.law.alpha(),
            dt_s: physics.dt_s,
            inverse_mass: chain.mass_kg.iter().map(|m| 1.0 / m).collect(),
            stiffness: chain.stiffness,
            acceleration: vec![0.0; state.u_m.len()],
        };
        this.accelerate(&state.u_m);
        this
    }

    /// Advances `state` by one step: half a kick, a drift, the forces, half a kick.
    pub(crate) fn step(&mut self, state: &mut ChainState) {
        let half_s = 0.5 * self.dt_s;
        for i in 0..state.u_m.len() {
            state.v_m_s[i] += half_s * self.acceleration[i];
            state.u_m[i] += self.dt_s * state.v_m_s[i];
        }
        self.accelerate(&state.u_m);
        for i in 0..state.u_m.len() {
            state.v_m_s[i] += half_s * self.acceleration[i];
        }
        state.step += 1;
    }

    fn accelerate(&mut self, u_m: &[f64]) {
        self.acceleration.fill(0.0);
        for c in 0..self.stiffness.len() {
            let overlap_m = u_m[c] - u_m[c + 1];
            if overlap_m > 0.0 {
                let force_n = self.stiffness[c] * overlap_m.powf(self.alpha);
                self.acceleration[c] -= force_n * self.inverse_mass[c];
                self.acceleration[c + 1] += force_n * self.inverse_mass[c + 1];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use producer::integrator::Integrator;
    use schemas::method::Method;
    use schemas::presets::PRESETS;

    /// The baseline makes the same motion: it differs by the rounding of the power function alone.
    #[test]
    fn the_scalar_loop_makes_the_motion_of_the_kernel() {
        for alpha in [1.5, 1.3] {
            let mut config = PRESETS[0].config();
            config.chain.beads = 60;
            config.chain.impurities[0].bead = 30;
            config.chain.alpha = Some(alpha);
            config.integrator.method = Method::VelocityVerlet;
            config.time.duration_s = 2e-3;
            let physics = Physics::resolve(&config).expect("valid");
            let mut ours = ChainState::initial(&physics);
            let mut plain = ours.clone();
            let mut integrator = Integrator::new(&physics);
            let mut scalar = ScalarLoop::new(&physics, &plain);
            for _ in 0..2000 {
                integrator.step(&mut ours);
                scalar.step(&mut plain);
            }
            let v0 = physics.striker.velocity_m_s;
            let furthest =
                ours.v_m_s.iter().zip(plain.v_m_s.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // 2000 steps, each rounding a force of at most a few v0·m/T in its last bits
            assert!(furthest < 1e-10 * v0, "α = {alpha}: {furthest:e} m/s");
            assert!(ours.v_m_s[4] > 0.1 * v0, "the pulse has come this far");
        }
    }
}
