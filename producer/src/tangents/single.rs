//! One tangent alone: its numbers lie beside each other along the chain, instead of eight tangents in a register.

use super::{Masses, Stage};
use crate::aligned::Padded;
use pulp::Arch;
use schemas::simd::vectorized;

/// A tangent, with the bits that it has among others.
#[derive(Debug, Clone)]
pub(super) struct Single {
    /// Changes of displacements, velocities, and those of resonators.
    pub(super) rows: [Padded; 4],
    /// Changes of the forces of contacts, one more than beads.
    force: Padded,
}

impl Single {
    pub(super) fn zero(beads: usize, resonators: usize) -> Self {
        let rows = [beads, beads, resonators, resonators].map(Padded::zeros);
        Self { rows, force: Padded::zeros(beads + 1) }
    }

    /// Moves it through `stages`.
    pub(super) fn make(&mut self, arch: Arch, stages: &[Stage], masses: &Masses, is_ring: bool) {
        for stage in stages {
            vectorized(
                arch,
                #[inline(always)]
                || self.make_stage(stage, masses, is_ring),
            );
        }
    }

    #[inline(always)]
    fn make_stage(&mut self, stage: &Stage, masses: &Masses, is_ring: bool) {
        let [u, v, w, w_v] = self.rows.each_mut().map(|row| &mut row[..]);
        let (beads, force) = (u.len(), &mut self.force[..]);
        let (contacts, kick_s, drift_s) = (&stage.contacts[..=beads], stage.kick_s, stage.drift_s);
        let (before, behind) = if is_ring { (u[beads - 1], u[0]) } else { (0.0, 0.0) };
        force[0] = contacts[0] * (before - u[0]);
        force[beads] = contacts[beads] * (u[beads - 1] - behind);
        for c in 1..beads {
            force[c] = contacts[c] * (u[c - 1] - u[c]);
        }
        // net forces take the place of those on the left
        for i in 0..beads {
            force[i] -= force[i + 1];
        }
        for (i, spring) in stage.springs.iter().enumerate() {
            force[i] -= spring * u[i];
        }
        let resonator_n_per_m = &masses.resonator_n_per_m;
        for i in 0..w.len() {
            let pull = resonator_n_per_m[i] * (w[i] - u[i]);
            force[i] += pull;
            let change = (kick_s * masses.inverse_resonator[i]) * (0.0 - pull);
            w_v[i] += change;
            if stage.is_twice {
                w_v[i] += change;
            }
            w[i] += drift_s * w_v[i];
        }
        let (force, push_s_per_kg) = (&force[..beads], &stage.push_s_per_kg[..beads]);
        let (u, v) = (&mut u[..beads], &mut v[..beads]);
        if stage.is_twice {
            for i in 0..beads {
                let change = push_s_per_kg[i] * force[i];
                v[i] = (v[i] + change) + change;
                u[i] += drift_s * v[i];
            }
        } else {
            for i in 0..beads {
                v[i] += push_s_per_kg[i] * force[i];
                u[i] += drift_s * v[i];
            }
        }
    }
}
