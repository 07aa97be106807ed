//! Forces on each bead beside its contacts: springs at its place, drag, a resonator.

use crate::simd::{cut, ordered_sum};
use std::ops::Range;

/// Arrays of N values, or empty where nothing of the kind acts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sites {
    /// κ of a force −κ·u (N/m).
    pub linear_n_per_m: Vec<f64>,
    /// κ3 of a force −κ3·u³ (N/m³); never without linear ones.
    pub cubic_n_per_m3: Vec<f64>,
    /// γ of a force −γ·v (N·s/m).
    pub drag_n_s_per_m: Vec<f64>,
    /// Mass of the resonator in each bead (kg), 0 where there is none.
    pub resonator_kg: Vec<f64>,
    /// Stiffness of the spring of each resonator (N/m).
    pub resonator_n_per_m: Vec<f64>,
}

impl Sites {
    /// True if springs hold the beads.
    pub fn has_springs(&self) -> bool {
        !self.linear_n_per_m.is_empty()
    }

    /// True if beads have resonators.
    pub fn has_resonators(&self) -> bool {
        !self.resonator_kg.is_empty()
    }

    /// True if drag acts, which depends on velocities.
    pub fn has_drag(&self) -> bool {
        !self.drag_n_s_per_m.is_empty()
    }

    /// True if nothing acts.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Adds the forces (N) of springs and resonators to those of the contacts of `beads` in `net_n`, at the displacements (m) of the beads
    /// and resonators of the chain; for use in [`vectorized`](crate::simd::vectorized).
    #[inline(always)]
    pub fn add_to(&self, net_n: &mut [f64], beads: &Range<usize>, [u_m, w_m]: [&[f64]; 2]) {
        let count = net_n.len();
        if self.has_springs() && self.cubic_n_per_m3.is_empty() {
            let [k, u] = cut([&self.linear_n_per_m[beads.clone()], &u_m[beads.clone()]], count);
            for i in 0..count {
                net_n[i] -= k[i] * u[i];
            }
        } else if self.has_springs() {
            let springs = [&self.linear_n_per_m, &self.cubic_n_per_m3, u_m].map(|all| &all[beads.clone()]);
            let [k, k3, u] = cut(springs, count);
            for i in 0..count {
                net_n[i] -= k[i] * u[i] + k3[i] * (u[i] * u[i] * u[i]);
            }
        }
        if self.has_resonators() {
            let springs = [&self.resonator_n_per_m, u_m, w_m].map(|all| &all[beads.clone()]);
            let [k, u, w] = cut(springs, count);
            for i in 0..count {
                net_n[i] += k[i] * (w[i] - u[i]);
            }
        }
    }

    /// The force (N) with which the resonator of bead `i` pulls it to the right.
    #[inline(always)]
    pub fn resonator_n(&self, i: usize, u_m: f64, w_m: f64) -> f64 {
        self.resonator_n_per_m[i] * (w_m - u_m)
    }

    /// Kinetic energy (J) of the resonators of `beads`, of the velocities `w_m_s` (N values).
    pub fn kinetic_j(&self, w_m_s: &[f64], beads: Range<usize>) -> f64 {
        let mass_kg = &self.resonator_kg[beads.clone()];
        ordered_sum([mass_kg, &w_m_s[beads]], |[mass_kg, w]| 0.5 * mass_kg * (w * w))
    }

    /// Potential energy (J) of the springs of `beads`, of the displacements `u_m` (N values).
    pub fn springs_j(&self, u_m: &[f64], beads: Range<usize>) -> f64 {
        let (linear, u_m) = (&self.linear_n_per_m[beads.clone()], &u_m[beads.clone()]);
        if self.cubic_n_per_m3.is_empty() {
            return ordered_sum([linear, u_m], |[k, u]| 0.5 * k * (u * u));
        }
        let cubic = &self.cubic_n_per_m3[beads];
        ordered_sum([linear, cubic, u_m], |[k, k3, u]| 0.5 * k * (u * u) + 0.25 * k3 * ((u * u) * (u * u)))
    }

    /// Potential energy (J) of the springs of the resonators of `beads`, displaced by `w_m` (N values).
    pub fn resonators_j(&self, u_m: &[f64], w_m: &[f64], beads: Range<usize>) -> f64 {
        let stiffness = &self.resonator_n_per_m[beads.clone()];
        ordered_sum([stiffness, &u_m[beads.clone()], &w_m[beads]], |[k, u, w]| {
            let stretch_m = w - u;
            0.5 * k * (stretch_m * stretch_m)
        })
    }
}
