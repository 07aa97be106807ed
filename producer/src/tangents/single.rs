//! One tangent alone: its numbers lie beside each other along the chain, instead of eight tangents in a register.

use super::{Masses, Stage};
use crate::aligned::Padded;
use crate::kernel::{Along, Layout as _, right};
use pulp::{Arch, Simd, WithSimd};
use schemas::simd::{in_vectors, load, store};

/// A tangent, with the bits that it has among others.
#[derive(Debug, Clone)]
pub(super) struct Single {
    /// Changes of displacements, velocities, and those of resonators.
    pub(super) rows: [Padded; 4],
    /// Changes of the forces of springs that hold the beads, and of resonators.
    pulls: [Padded; 2],
}

/// Some stages of a tangent.
struct Alone<'a> {
    single: &'a mut Single,
    stages: &'a [Stage],
    masses: &'a Masses,
    is_ring: bool,
}

impl Single {
    pub(super) fn zero(beads: usize, resonators: usize) -> Self {
        let rows = [beads, beads, resonators, resonators].map(Padded::zeros);
        Self { rows, pulls: [beads; 2].map(Padded::zeros) }
    }

    /// Moves it through `stages`.
    pub(super) fn make(&mut self, arch: Arch, stages: &[Stage], masses: &Masses, is_ring: bool) {
        in_vectors(arch, Alone { single: self, stages, masses, is_ring });
    }
}

impl WithSimd for Alone<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for stage in self.stages {
            if stage.springs.is_empty() && self.single.rows[2].is_empty() {
                self.move_beads::<S, true>(simd, stage);
            } else {
                self.pull(stage);
                self.move_beads::<S, false>(simd, stage);
            }
        }
    }
}

impl Alone<'_> {
    /// Finds the forces of springs and resonators, and moves those.
    #[inline(always)]
    fn pull(&mut self, stage: &Stage) {
        let Single { rows, pulls } = &mut *self.single;
        let [u, _, w, w_v] = rows.each_mut().map(|row| &mut row[..]);
        let [of_springs, of_resonators] = pulls.each_mut().map(|row| &mut row[..]);
        for (i, spring) in stage.springs.iter().enumerate() {
            of_springs[i] = spring * u[i];
        }
        for i in 0..w.len() {
            let pull = self.masses.resonator_n_per_m[i] * (w[i] - u[i]);
            of_resonators[i] = pull;
            let change = (stage.kick_s * self.masses.inverse_resonator[i]) * (0.0 - pull);
            w_v[i] += change;
            if stage.is_twice {
                w_v[i] += change;
            }
            w[i] += stage.drift_s * w_v[i];
        }
    }

    /// Moves all beads through a stage; in a plain chain there are contacts alone.
    #[inline(always)]
    fn move_beads<S: Simd, const IS_PLAIN: bool>(&mut self, simd: S, stage: &Stage) {
        let Single { rows: [u, v, ..], pulls } = &mut *self.single;
        let beads = u.len();
        let (before, behind) = if self.is_ring { (u[beads - 1], u[0]) } else { (0.0, 0.0) };
        let [u, v] = [u, v].map(Padded::whole);
        let [of_springs, of_resonators] = pulls.each_mut().map(Padded::whole);
        // what follows the last bead has no mass and stays
        u[beads] = behind;
        let contacts = &stage.contacts[..u.len()];
        let push_s_per_kg = &stage.push_s_per_kg[..u.len()];
        let drift_s = simd.splat_f64s(stage.drift_s);
        let force = |at: usize, before: S::f64s, here: S::f64s| {
            simd.mul_f64s(load::<S>(contacts, at), simd.sub_f64s(Along::left(simd, before, here), here))
        };
        let mut here = load::<S>(u, 0);
        let mut left = force(0, simd.splat_f64s(before), here);
        for at in (0..u.len()).step_by(S::F64_LANES) {
            let after = at + S::F64_LANES;
            let (next, of_next) = if after < u.len() {
                let next = load::<S>(u, after);
                (next, force(after, here, next))
            } else {
                (here, simd.splat_f64s(0.0))
            };
            let mut net = simd.sub_f64s(left, right(simd, left, of_next));
            if !IS_PLAIN {
                net = simd.sub_f64s(net, load::<S>(of_springs, at));
                net = simd.add_f64s(net, load::<S>(of_resonators, at));
            }
            let change = simd.mul_f64s(load::<S>(push_s_per_kg, at), net);
            let mut velocity = simd.add_f64s(load::<S>(v, at), change);
            if stage.is_twice {
                velocity = simd.add_f64s(velocity, change);
            }
            store::<S>(velocity, v, at);
            store::<S>(simd.add_f64s(here, simd.mul_f64s(drift_s, velocity)), u, at);
            (left, here) = (of_next, next);
        }
    }
}
