//! Tangents of steps by the Runge–Kutta method, which takes damping and drag.
//!
//! A stage finds the derivative of the motion where the state is: slopes of the contacts' forces by overlap and by its rate, springs, drag. When all
//! stages of a step are known, each block of tangents is carried through them, while it is in the cache.

use super::beside::Sources;
use super::{Block, Masses, NONE};
use crate::kernel::Motion;
use crate::tangents::slopes::Slopes;
use pulp::{Arch, Simd, WithSimd};
use schemas::chain::Chain;
use schemas::simd::{LANES, in_vectors, load, store};

/// The derivatives of the motion at the stages of a step.
#[derive(Debug, Clone)]
pub(super) struct Stages {
    /// Weights of the earlier derivatives at each stage but the first, and at the end of a step.
    weights: Vec<Vec<f64>>,
    slopes: Vec<Slopes>,
    /// Parts of the accelerations that are not by the tangents.
    sources: Vec<Sources>,
    /// γ (N·s/m) of each bead, or none.
    drag_n_s_per_m: Vec<f64>,
    /// Changes at a stage, and their derivatives by time at all stages, of the block that is carried.
    at: Block,
    derivatives: Vec<Block>,
    /// True for each contact that was closed when somebody looked last.
    closed: Vec<bool>,
    has_jumped: bool,
}

impl Stages {
    pub(super) fn of<const N: usize>(chain: &Chain, slopes: &Slopes, weights: &[[f64; N]; N]) -> Self {
        let [beads, resonators] =
            [chain.bead_count(), chain.sites.resonator_kg.len()].map(|count| vec![NONE; count]);
        let block = Block([beads.clone(), beads, resonators.clone(), resonators]);
        Self {
            weights: weights.iter().map(|row| row.to_vec()).collect(),
            slopes: vec![slopes.clone(); N],
            sources: vec![Sources::new(); N],
            drag_n_s_per_m: chain.sites.drag_n_s_per_m.clone(),
            at: block.clone(),
            derivatives: vec![block; N],
            closed: Vec::new(),
            has_jumped: false,
        }
    }

    /// True if the force of a contact, or its slope without bound, has jumped where it closed or opened.
    pub(super) fn has_jumped(&self) -> bool {
        self.has_jumped
    }

    /// Finds the derivative of the motion at `stage`.
    pub(super) fn look(&mut self, arch: Arch, stage: usize, motion: &Motion<'_>) {
        let (slopes, closed) = (&mut self.slopes[stage], &mut self.closed);
        self.has_jumped |= slopes.find_moving(arch, motion, closed);
    }

    /// The parts of the accelerations at `stage` that are not by the tangents.
    pub(super) fn sources(&mut self, stage: usize) -> &mut Sources {
        &mut self.sources[stage]
    }

    /// Carries `block`, that of this `number`, through a step of `dt_s`.
    pub(super) fn carry(
        &mut self,
        arch: Arch,
        (number, block): (usize, &mut Block),
        masses: &Masses,
        is_ring: bool,
        dt_s: f64,
    ) {
        in_vectors(arch, Step { stages: self, block, number, masses, is_ring, dt_s });
    }
}

/// A step of a block.
struct Step<'a> {
    stages: &'a mut Stages,
    block: &'a mut Block,
    number: usize,
    masses: &'a Masses,
    is_ring: bool,
    dt_s: f64,
}

impl WithSimd for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let stages = self.stages.weights.len();
        for at in (0..LANES).step_by(S::F64_LANES) {
            for stage in 0..stages {
                self.come_to::<S>(simd, at, stage);
                self.differentiate::<S>(simd, at, stage);
            }
            self.come_to::<S>(simd, at, stages);
        }
    }
}

impl Step<'_> {
    /// Finds the changes at `stage`, or those at the end of the step, in the lanes of a register from `at` on.
    #[inline(always)]
    fn come_to<S: Simd>(&mut self, simd: S, at: usize, stage: usize) {
        let Stages { weights, at: changes, derivatives, .. } = &mut *self.stages;
        let is_end = stage == weights.len();
        let weights = if stage == 0 { &[][..] } else { &weights[stage - 1] };
        for row in 0..self.block.0.len() {
            for i in 0..self.block.0[row].len() {
                let mut sum = load::<S>(&self.block.0[row][i].0, at);
                for (weight, derivative) in weights.iter().zip(&*derivatives) {
                    if *weight != 0.0 {
                        let part = load::<S>(&derivative.0[row][i].0, at);
                        sum = simd.add_f64s(sum, simd.mul_f64s(simd.splat_f64s(self.dt_s * weight), part));
                    }
                }
                let to = if is_end { &mut self.block.0[row][i] } else { &mut changes.0[row][i] };
                store::<S>(sum, &mut to.0, at);
            }
        }
    }

    /// Finds the derivatives of the changes at `stage` by time.
    #[inline(always)]
    fn differentiate<S: Simd>(&mut self, simd: S, at: usize, stage: usize) {
        let Stages { slopes, sources, drag_n_s_per_m, at: changes, derivatives, .. } = &mut *self.stages;
        let sources = sources[stage].get(self.number);
        let with = |change: S::f64s, row: usize, i: usize| match sources {
            Some(rows) => simd.add_f64s(change, load::<S>(&rows[row][i].0, at)),
            None => change,
        };
        let (slopes, Masses { inverse_mass, inverse_resonator, resonator_n_per_m, .. }) =
            (&slopes[stage], self.masses);
        let ([u, v, w, w_v], [du, dv, dw, dw_v]) = (&changes.0, &mut derivatives[stage].0);
        let beads = u.len();
        let get = |group: &schemas::simd::Group<LANES>| load::<S>(&group.0, at);
        let splat = |x: f64| simd.splat_f64s(x);
        let (contacts, rates) = (&slopes.contacts[..=beads], &slopes.rates[..]);
        let force = |contact: usize, before: [S::f64s; 2], here: [S::f64s; 2]| {
            let elastic = simd.mul_f64s(splat(contacts[contact]), simd.sub_f64s(before[0], here[0]));
            match rates.get(contact) {
                Some(rate) => {
                    simd.add_f64s(elastic, simd.mul_f64s(splat(*rate), simd.sub_f64s(before[1], here[1])))
                }
                None => elastic,
            }
        };
        let of = |i: usize| [get(&u[i]), get(&v[i])];
        let none = [splat(0.0); 2];
        let (before, behind) = if self.is_ring { (of(beads - 1), of(0)) } else { (none, none) };
        let mut here = of(0);
        let mut left = force(0, before, here);
        for i in 0..beads {
            let next = if i + 1 < beads { of(i + 1) } else { behind };
            let right = force(i + 1, here, next);
            let mut net = simd.sub_f64s(left, right);
            if let Some(spring) = slopes.springs.get(i) {
                net = simd.sub_f64s(net, simd.mul_f64s(splat(*spring), here[0]));
            }
            if i < w.len() {
                let pull = simd.mul_f64s(splat(resonator_n_per_m[i]), simd.sub_f64s(get(&w[i]), here[0]));
                net = simd.add_f64s(net, pull);
                let change = simd.mul_f64s(splat(inverse_resonator[i]), simd.sub_f64s(none[0], pull));
                store::<S>(get(&w_v[i]), &mut dw[i].0, at);
                store::<S>(with(change, 1, i), &mut dw_v[i].0, at);
            }
            if let Some(drag) = drag_n_s_per_m.get(i) {
                net = simd.sub_f64s(net, simd.mul_f64s(splat(*drag), here[1]));
            }
            store::<S>(here[1], &mut du[i].0, at);
            let change = simd.mul_f64s(splat(inverse_mass[i]), net);
            store::<S>(with(change, 0, i), &mut dv[i].0, at);
            (left, here) = (right, next);
        }
    }
}
