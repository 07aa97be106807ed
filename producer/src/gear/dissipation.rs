//! The work that damped contacts have dissipated.

use super::Terms;
use crate::kernel::Kernel;
use crate::state::ChainState;
use schemas::simd::vectorized;

/// Nodes of Gauss's quadrature with two points over the step just made, in steps before its end: `½ ± 1/√12`. It is
/// exact for powers that are cubic in time, so the work has fourth order.
const NODES: [f64; 2] = [-0.788_675_134_594_812_9, -0.211_324_865_405_187_1];

/// Adds up dissipated power. The motion within a step is that of the polynomials at its end, so that the work
/// is a function of the state like the rest.
#[derive(Debug, Clone)]
pub(super) struct Dissipation {
    /// The motion at a node: displacements (m) and velocities (m/s), N values each; zero for beads at rest.
    u_m: Vec<f64>,
    v_m_s: Vec<f64>,
    /// Dissipated power (W) there, N values.
    power_w: Vec<f64>,
}

impl Dissipation {
    /// Of a chain of `beads` beads.
    pub(super) fn new(beads: usize) -> Self {
        Self { u_m: vec![0.0; beads], v_m_s: vec![0.0; beads], power_w: vec![0.0; beads] }
    }

    /// Forgets the motion of before.
    pub(super) fn restart(&mut self) {
        self.u_m.fill(0.0);
        self.v_m_s.fill(0.0);
    }

    /// Adds `∫ P dt` (J) over the step of `dt_s` that ended in `state` to the last N values of its `extra`.
    pub(super) fn add_work_of_step(&mut self, dt_s: f64, kernel: &Kernel, state: &mut ChainState) {
        let beads = state.u_m.len();
        let active = kernel.active_beads();
        for node in NODES {
            let terms = Terms::of(state, &active);
            let motion = [&mut self.u_m[active.clone()], &mut self.v_m_s[active.clone()]];
            vectorized(
                kernel.arch(),
                #[inline(always)]
                || motion_at(node, dt_s, terms, motion),
            );
            kernel.dissipated_power(&self.u_m, &self.v_m_s, &mut self.power_w);
            let work = state.extra.len() - beads;
            for (work_j, power_w) in state.extra[work..].iter_mut().zip(&self.power_w) {
                *work_j += 0.5 * dt_s * *power_w;
            }
        }
    }
}

/// Displacements (m) and velocities (m/s) of the polynomials `terms`, `node` steps from their origin.
#[inline(always)]
fn motion_at(node: f64, dt_s: f64, terms: Terms<'_>, [u_m, v_m_s]: [&mut [f64]; 2]) {
    let n = u_m.len();
    let Terms { u_m: q0, v_m_s: v, q2, q3, q4, q5 } = terms;
    let (q0, v, v_m_s) = (&q0[..n], &v[..n], &mut v_m_s[..n]);
    let (q2, q3, q4, q5) = (&q2[..n], &q3[..n], &q4[..n], &q5[..n]);
    let (per_dt, node_s) = (node / dt_s, node * dt_s);
    for i in 0..n {
        let higher = ((q5[i] * node + q4[i]) * node + q3[i]) * node + q2[i];
        u_m[i] = (node * node) * higher + (node_s * v[i] + q0[i]);
        let slope = (5.0 * q5[i] * node + 4.0 * q4[i]) * node + 3.0 * q3[i];
        v_m_s[i] = per_dt * (slope * node + 2.0 * q2[i]) + v[i];
    }
}
