//! Tangents of a run: small changes of its state, carried through the operations of its steps.
//!
//! A change `(δu, δv)` of a state changes all later ones, to first order by the derivative of each operation: a kick adds
//! `(h/m)·(s_left·(δu_left − δu) − s_right·(δu − δu_right))` with the slopes `s` of the contacts where the beads are, a drift adds `d·δv`.
//! So a tangent is the derivative of the computed steps, not of the motion that they stand for, and the map of a step of a symplectic
//! method is a symplectic matrix, to rounding.
//!
//! Tangents lie beside each other in the lanes of registers, eight in a block. Their bits are the same at any width, and depend neither on
//! how many there are nor on where anyone looks.

mod beside;
mod runge;
mod single;
pub(crate) mod slopes;

use crate::aligned::Padded;
use crate::drives::{Acts, Drives, Now};
use crate::kernel::Motion;
use beside::{Beside, Sources};
pub use beside::{Neighbours, NoDerivative};
use pulp::{Arch, Simd, WithSimd};
use runge::Stages;
use schemas::chain::Chain;
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::philox::uniform;
use schemas::simd::{Group, LANES, in_vectors, load, ordered_sum, store, vectorized};
use single::Single;
use slopes::Slopes;
use std::ops::Range;
use std::sync::Arc;

/// Changes of the state of a run, each of [`dimension`](Self::dimension) numbers: of the displacements of all beads (m), their velocities
/// (m/s), and, where they have resonators, of the displacements and velocities of those.
#[derive(Debug, Clone)]
pub struct Tangents {
    arch: Arch,
    count: usize,
    blocks: Vec<Block>,
    /// The tangent where it is the only one, in place of a block.
    single: Option<Single>,
    slopes: Slopes,
    masses: Masses,
    is_ring: bool,
    /// The kick (s) that ends a step and is made together with the one that begins the next; 0 if none is left.
    kick_left_s: f64,
    /// Stages that no block has made yet, of as many as are used.
    stages_left: Vec<Stage>,
    left: usize,
    /// Those of a step of the Runge–Kutta method, for its runs.
    stages: Option<Box<Stages>>,
    /// Chains beside that of the run, for tangents that are derivatives by numbers of its configuration.
    beside: Vec<Beside>,
    sources: Sources,
}

/// Numbers of beads or resonators, for eight tangents.
type Numbers = Vec<Group<LANES>>;

const NONE: Group<LANES> = Group([0.0; LANES]);

/// Factor of all numbers that are carried, a power of two: a change of one bead reaches the others with numbers so small that unscaled they
/// were subnormal, whose operations take a hundred times as long. Tangents from `2^511` on are infinite.
const SCALE: f64 = f64::from_bits((1023 + 512) << 52);

/// Eight tangents: of displacements, velocities, and those of resonators.
#[derive(Debug, Clone)]
struct Block([Numbers; 4]);

/// Masses (kg), and `1/m` (1/kg), 0 where nothing changes: where a drive prescribes the motion, or no resonator is.
#[derive(Debug, Clone)]
struct Masses {
    inverse_mass: Vec<f64>,
    mass_kg: Vec<f64>,
    /// Those of resonators, and the stiffness of their springs (N/m); N values each, or none.
    inverse_resonator: Vec<f64>,
    resonator_kg: Vec<f64>,
    resonator_n_per_m: Vec<f64>,
}

impl Masses {
    /// A kick of `kick_s` over the mass of each bead, and zeros behind the last one.
    fn pushes(&self, kick_s: f64, count: usize) -> Padded {
        let mut pushes = Padded::zeros(count);
        pushes.iter_mut().zip(&self.inverse_mass).for_each(|(push, inverse)| *push = kick_s * inverse);
        pushes
    }
}

/// Reason why a run has no tangent.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the derivatives of steps by {0} are not computed; leave [integrator] out, or choose another method")]
pub struct NoTangent(pub(crate) Method);

impl Tangents {
    /// Makes `count` tangents, all zero, of a run of `physics` and `chain`.
    pub(crate) fn of(physics: &Physics, chain: &Chain, count: usize, arch: Arch) -> Self {
        let sites = &chain.sites;
        let inverse = |mass_kg: &f64| if *mass_kg > 0.0 { 1.0 / mass_kg } else { 0.0 };
        let mut masses = Masses {
            inverse_mass: chain.mass_kg.iter().map(inverse).collect(),
            mass_kg: chain.mass_kg.clone(),
            inverse_resonator: sites.resonator_kg.iter().map(inverse).collect(),
            resonator_kg: sites.resonator_kg.clone(),
            resonator_n_per_m: sites.resonator_n_per_m.clone(),
        };
        if let Some(drives) = Drives::of(&physics.drives, physics.dt_s) {
            for d in 0..drives.count() {
                if let Acts::Moves(bead) = drives.acts(d) {
                    masses.inverse_mass[bead] = 0.0;
                }
            }
        }
        let (slopes, is_ring) = (Slopes::of(chain), chain.is_ring);
        let stages_left = vec![Stage::of(&slopes); TOGETHER];
        let (blocks, single, kick_left_s, left, stages) = (Vec::new(), None, 0.0, 0, None);
        let (beside, sources) = (Vec::new(), Vec::new());
        let mut none = Self {
            arch,
            count: 0,
            blocks,
            slopes,
            masses,
            is_ring,
            kick_left_s,
            stages_left,
            left,
            stages,
            single,
            beside,
            sources,
        };
        none.resize(count);
        none
    }

    /// Carries them through the stages of a Runge–Kutta method with these weights, in a run of `chain`.
    pub(crate) fn in_stages<const N: usize>(self, chain: &Chain, weights: &[[f64; N]; N]) -> Self {
        let stages = Some(Box::new(Stages::of(chain, &self.slopes, weights)));
        let wanted = self.count;
        let mut these = Self { stages, single: None, count: 0, ..self };
        these.resize(wanted);
        these
    }

    /// Makes them the derivatives by the numbers in which `neighbours` differ from the run.
    pub(crate) fn follow(&mut self, neighbours: &[Neighbours<'_>]) {
        self.beside = neighbours.iter().map(|pair| Beside::of(pair, self.arch)).collect();
        self.resize(neighbours.len());
        for (number, pair) in neighbours.iter().enumerate() {
            self.set(number, &pair.first());
        }
    }

    /// Finds the parts of the accelerations that are not by the tangents, at `stage` of a Runge–Kutta method, at
    /// displacements and velocities of beads and the displacements of resonators `rows`, while drives act as `now`.
    pub(crate) fn look_beside(&mut self, stage: usize, rows: [&[f64]; 3], now: &[Now]) {
        if !self.beside.is_empty() {
            let inverse = [&self.masses.inverse_mass[..], &self.masses.inverse_resonator];
            let sources = self.stages.as_mut().map_or(&mut self.sources, |stages| stages.sources(stage));
            beside::find(&mut self.beside, rows, now, inverse, sources);
        }
    }

    /// Makes them so many; new ones are zero.
    pub fn resize(&mut self, count: usize) {
        let [beads, resonators] = [&self.masses.inverse_mass, &self.masses.inverse_resonator]
            .map(|numbers| vec![NONE; numbers.len()]);
        let kept: Vec<_> = (0..count.min(self.count)).map(|number| self.tangent(number)).collect(); // integers
        let is_single = count == 1 && self.stages.is_none() && self.beside.is_empty();
        self.single = is_single.then(|| Single::zero(beads.len(), resonators.len()));
        let block = Block([beads.clone(), beads, resonators.clone(), resonators]);
        self.blocks = vec![block; if is_single { 0 } else { count.div_ceil(LANES) }];
        self.count = count;
        kept.iter().enumerate().for_each(|(number, numbers)| self.put(number, numbers));
    }

    /// Number of tangents.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Numbers of a tangent: 2N, or 4N with resonators.
    pub fn dimension(&self) -> usize {
        2 * (self.masses.inverse_mass.len() + self.masses.inverse_resonator.len())
    }

    /// The tangent of that number.
    ///
    /// # Panics
    /// When there are not so many.
    pub fn tangent(&self, number: usize) -> Vec<f64> {
        assert!(number < self.count, "{number} of {} tangents", self.count);
        if let Some(single) = &self.single {
            return single.rows.iter().flat_map(|row| row.iter().map(|x| x / SCALE)).collect();
        }
        let rows = &self.blocks[number / LANES].0;
        rows.iter().flatten().map(|group| group.0[number % LANES] / SCALE).collect()
    }

    /// Makes `numbers` the tangent of that number. Changes of what drives prescribe are none.
    ///
    /// # Panics
    /// When there are not so many tangents, or numbers.
    pub fn set(&mut self, number: usize, numbers: &[f64]) {
        assert!(number < self.count && numbers.len() == self.dimension(), "no tangent of this chain");
        let free = self.free();
        let numbers: Vec<f64> =
            numbers.iter().zip(free).map(|(x, free)| if free { *x } else { 0.0 }).collect();
        self.put(number, &numbers);
    }

    fn put(&mut self, number: usize, numbers: &[f64]) {
        if let Some(single) = &mut self.single {
            single
                .rows
                .iter_mut()
                .flat_map(|row| row.iter_mut())
                .zip(numbers)
                .for_each(|(to, x)| *to = SCALE * *x);
            return;
        }
        let rows = &mut self.blocks[number / LANES].0;
        for (group, x) in rows.iter_mut().flatten().zip(numbers) {
            group.0[number % LANES] = SCALE * *x;
        }
    }

    /// True for each number of a tangent that can be other than zero.
    pub fn free(&self) -> Vec<bool> {
        let [beads, resonators] = [&self.masses.inverse_mass, &self.masses.inverse_resonator];
        [beads, beads, resonators, resonators].into_iter().flatten().map(|inverse| *inverse > 0.0).collect()
    }

    /// Weights of the numbers of a tangent in its norm `|w|² = Σ m·((δu/T)² + δv²)`, with a time `T` (s).
    pub fn weights(&self, time_s: f64) -> Vec<f64> {
        let per_square = 1.0 / (time_s * time_s);
        let [beads, resonators] = [&self.masses.mass_kg, &self.masses.resonator_kg];
        let rows = [(beads, per_square), (beads, 1.0), (resonators, per_square), (resonators, 1.0)];
        rows.into_iter().flat_map(|(masses, factor)| masses.iter().map(move |mass| mass * factor)).collect()
    }

    /// Begins with tangents of no direction in particular that are orthogonal to each other, of norm 1 by `weights`. If there is one for each
    /// free number, they pair exactly, the first with the last: each is the other with velocities in the place of displacements, and turned round.
    pub fn spread(&mut self, weights: &[f64]) {
        let free = self.free();
        let dimension = free.len();
        let (beads, resonators) = (self.masses.inverse_mass.len(), self.masses.inverse_resonator.len());
        let pairs = (0..beads).map(|u| (u, u + beads));
        let pairs = pairs.chain((2 * beads..2 * beads + resonators).map(|w| (w, w + resonators)));
        let pairs: Vec<(usize, usize)> = pairs.filter(|(place, _)| free[*place]).collect();
        let have_pairs = self.count == 2 * pairs.len();
        let mut all: Vec<Vec<f64>> = Vec::new();
        for number in 0..if have_pairs { pairs.len() } else { self.count } {
            // as far in each direction by the norm, whatever the units are
            let chance = |place: usize| {
                (uniform(0, 0, (number * dimension + place) as u64) - 0.5) / weights[place].sqrt()
            };
            let mut one: Vec<f64> = (0..dimension).map(chance).collect();
            if have_pairs {
                one.iter_mut().zip(&free).filter(|(_, free)| !**free).for_each(|(x, _)| *x = 0.0);
                for _ in 0..2 {
                    for before in all.iter().flat_map(|other| [other.clone(), turned(other, &pairs, weights)])
                    {
                        let part = dot(weights, &before, &one);
                        one.iter_mut().zip(&before).for_each(|(x, y)| *x -= part * y);
                    }
                }
                let factor = 1.0 / dot(weights, &one, &one).sqrt();
                for x in &mut one {
                    *x *= factor;
                }
            }
            all.push(one);
        }
        if have_pairs {
            let others: Vec<_> = all.iter().rev().map(|one| turned(one, &pairs, weights)).collect();
            all.extend(others);
        }
        all.iter().enumerate().for_each(|(number, one)| self.set(number, one));
        self.orthonormalise(weights);
    }

    /// Makes each tangent orthogonal to those before it and of norm 1 (Gram and Schmidt). Gives for each the parts that it had along those
    /// before it, as they are now, and along itself.
    pub fn orthonormalise(&mut self, weights: &[f64]) -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> = (0..self.count).map(|number| self.tangent(number)).collect();
        let arch = self.arch;
        let parts = (0..all.len()).map(|number| {
            let (before, rest) = all.split_at_mut(number);
            let one = &mut rest[0];
            vectorized(
                arch,
                #[inline(always)]
                || {
                    let mut parts = Vec::with_capacity(number + 1);
                    for other in before {
                        let part = dot(weights, other, one);
                        one.iter_mut().zip(other).for_each(|(x, y)| *x -= part * *y);
                        parts.push(part);
                    }
                    let norm = dot(weights, one, one).sqrt();
                    let factor = 1.0 / norm;
                    for x in one.iter_mut() {
                        *x *= factor;
                    }
                    parts.push(norm);
                    parts
                },
            )
        });
        let parts = parts.collect();
        for (number, numbers) in all.iter().enumerate() {
            self.put(number, numbers);
        }
        parts
    }

    /// Finds the slopes of a state that they have not come to, where the beads are at `u_m` and the walls at `walls_m` (m).
    pub(crate) fn look_at_all(&mut self, u_m: &[f64], walls_m: [f64; 2]) {
        self.settle();
        self.look(u_m, walls_m, &(0..u_m.len()));
        for stage in &mut self.stages_left {
            stage.contacts.copy_from_slice(&self.slopes.contacts);
        }
    }

    /// Finds the slopes at `beads`, those that have moved since a look at all of them, where the beads are at `u_m` and the walls at `walls_m` (m).
    pub(crate) fn look(&mut self, u_m: &[f64], walls_m: [f64; 2], beads: &Range<usize>) {
        self.slopes.find(self.arch, u_m, walls_m, beads);
    }

    /// True if a damped contact has closed or opened where its force jumps, as that of a dashpot does, or has a slope without bound, as `δ^p` with
    /// p below 1: tangents are no derivatives of the motion after it, or but to `dt^p`.
    pub fn has_jumped(&self) -> bool {
        self.stages.as_ref().is_some_and(|stages| stages.has_jumped())
    }

    /// Finds the derivative of `motion` at a stage of a step by the Runge–Kutta method.
    pub(crate) fn look_at(&mut self, stage: usize, motion: &Motion<'_>) {
        if let Some(stages) = &mut self.stages {
            stages.look(self.arch, stage, motion);
        }
    }

    /// Makes a step of `dt_s` through the stages that were looked at.
    pub(crate) fn step(&mut self, dt_s: f64) {
        let Some(stages) = &mut self.stages else { return };
        for (number, block) in self.blocks.iter_mut().enumerate() {
            stages.carry(self.arch, (number, block), &self.masses, self.is_ring, dt_s);
        }
    }

    /// Makes a kick of `kick_s` and a drift of `drift_s`, when enough stages have come together or somebody looks.
    pub(crate) fn stage(&mut self, kick_s: f64, drift_s: f64) {
        let is_twice = self.kick_left_s == kick_s;
        if is_twice {
            self.kick_left_s = 0.0;
        } else {
            self.make_kick_left();
        }
        // the look that follows finds slopes where they may have changed since this stage was made last
        std::mem::swap(&mut self.stages_left[self.left].contacts, &mut self.slopes.contacts);
        self.add_stage(kick_s, drift_s, is_twice);
    }

    /// Adds the next stage, which has the slopes of its contacts.
    fn add_stage(&mut self, kick_s: f64, drift_s: f64, is_twice: bool) {
        if self.stages_left[self.left].kick_s != kick_s {
            let other = self.stages_left.iter().find(|stage| stage.kick_s == kick_s);
            let push_s_per_kg = other.map_or_else(
                || Arc::new(self.masses.pushes(kick_s, self.slopes.contacts.len())),
                |stage| Arc::clone(&stage.push_s_per_kg),
            );
            self.stages_left[self.left].push_s_per_kg = push_s_per_kg;
        }
        let stage = &mut self.stages_left[self.left];
        (stage.kick_s, stage.drift_s, stage.is_twice) = (kick_s, drift_s, is_twice);
        stage.springs.clone_from(&self.slopes.springs);
        stage.sources.clone_from(&self.sources);
        self.left += 1;
        if self.left == TOGETHER {
            self.make_stages_left();
        }
    }

    /// Makes the kick of `kick_s` that ends a step, when it is needed.
    pub(crate) fn kick_at_the_end(&mut self, kick_s: f64) {
        self.kick_left_s = kick_s;
    }

    /// Makes what is left, so that the tangents are those of the state.
    pub(crate) fn settle(&mut self) {
        self.make_kick_left();
        self.make_stages_left();
    }

    /// Slows the velocity of the first of `beads` by the factor `decay`; or with `shares` the velocity of both relative to each other, of whose
    /// change each has its share. The tangents are settled.
    pub(crate) fn slow(&mut self, [left, right]: [usize; 2], shares: Option<[f64; 2]>, decay: f64) {
        let slowed = |v: f64, w: f64| match shares {
            None => [decay * v; 2],
            Some([of_left, of_right]) => {
                let change = decay * (v - w) - (v - w);
                [v + of_left * change, w - of_right * change]
            }
        };
        if let Some(Single { rows: [_, v, ..], .. }) = &mut self.single {
            [v[left], v[right]] = slowed(v[left], v[right]);
        }
        for Block([_, v, ..]) in &mut self.blocks {
            for lane in 0..LANES {
                [v[left].0[lane], v[right].0[lane]] = slowed(v[left].0[lane], v[right].0[lane]);
            }
        }
    }

    fn make_kick_left(&mut self) {
        let left_s = std::mem::take(&mut self.kick_left_s);
        if left_s == 0.0 {
            return;
        }
        // nobody looks before the next stage, which has the same slopes
        self.stages_left[self.left].contacts.copy_from_slice(&self.slopes.contacts);
        self.add_stage(left_s, 0.0, false);
    }

    fn make_stages_left(&mut self) {
        let stages = &self.stages_left[..std::mem::take(&mut self.left)];
        if stages.is_empty() {
            return;
        }
        if let Some(single) = &mut self.single {
            single.make(self.arch, stages, &self.masses, self.is_ring);
        }
        for (number, block) in self.blocks.iter_mut().enumerate() {
            let (masses, is_ring) = (&self.masses, self.is_ring);
            in_vectors(self.arch, Together { block, number, stages, masses, is_ring });
        }
    }
}

/// A tangent in which displacements and velocities, at the places of `pairs`, have changed places: at right angles to it, and as long.
fn turned(tangent: &[f64], pairs: &[(usize, usize)], weights: &[f64]) -> Vec<f64> {
    let mut turned = vec![0.0; tangent.len()];
    for (u, v) in pairs {
        let ratio = (weights[*v] / weights[*u]).sqrt();
        (turned[*u], turned[*v]) = (0.0 - ratio * tangent[*v], tangent[*u] / ratio);
    }
    turned
}

/// `Σ weight·a·b`.
#[inline(always)]
fn dot(weights: &[f64], a: &[f64], b: &[f64]) -> f64 {
    ordered_sum([weights, a, b], |[weight, a, b]| weight * (a * b))
}

/// Stages that a block makes while it is in the cache.
pub(crate) const TOGETHER: usize = 12;

/// A kick, which is made twice where a step ends and the next one begins, and a drift, with the slopes at the kick.
#[derive(Debug, Clone)]
struct Stage {
    kick_s: f64,
    /// The kick over the mass of each bead, and zeros behind the last one.
    push_s_per_kg: Arc<Padded>,
    drift_s: f64,
    is_twice: bool,
    contacts: Padded,
    springs: Vec<f64>,
    sources: Sources,
}

impl Stage {
    fn of(slopes: &Slopes) -> Self {
        Self {
            kick_s: 0.0,
            push_s_per_kg: Arc::new(Padded::zeros(slopes.contacts.len())),
            drift_s: 0.0,
            is_twice: false,
            contacts: slopes.contacts.clone(),
            springs: Vec::new(),
            sources: Sources::new(),
        }
    }
}

/// Some stages of a block, and its number.
struct Together<'a> {
    block: &'a mut Block,
    number: usize,
    stages: &'a [Stage],
    masses: &'a Masses,
    is_ring: bool,
}

impl WithSimd for Together<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for stage in self.stages {
            let [_, _, resonators, _] = &self.block.0;
            let is_plain = stage.springs.is_empty() && resonators.is_empty() && stage.sources.is_empty();
            for at in (0..LANES).step_by(S::F64_LANES) {
                match (is_plain, stage.is_twice) {
                    (true, true) => self.move_lanes::<S, true, true>(simd, stage, at),
                    (true, false) => self.move_lanes::<S, true, false>(simd, stage, at),
                    (false, true) => self.move_lanes::<S, false, true>(simd, stage, at),
                    (false, false) => self.move_lanes::<S, false, false>(simd, stage, at),
                }
            }
        }
    }
}

impl Together<'_> {
    /// Moves the tangents of a register, which begins at number `at` of a group, through a stage; in a plain chain there are contacts alone.
    #[inline(always)]
    fn move_lanes<S: Simd, const IS_PLAIN: bool, const IS_TWICE: bool>(
        &mut self,
        simd: S,
        stage: &Stage,
        at: usize,
    ) {
        let [u, v, w, w_v] = &mut self.block.0;
        let beads = u.len();
        let Masses { inverse_resonator, resonator_n_per_m, .. } = self.masses;
        let (u, v, push_s_per_kg) = (&mut u[..beads], &mut v[..beads], &stage.push_s_per_kg[..beads]);
        let (contacts, springs) = (&stage.contacts[..=beads], &stage.springs[..]);
        let (w, w_v) = (&mut w[..], &mut w_v[..]);
        let kick_s = stage.kick_s;
        let get = |group: &Group<LANES>| load::<S>(&group.0, at);
        let splat = |x: f64| simd.splat_f64s(x);
        let sources = stage.sources.get(self.number);
        let [of_beads, of_resonators] = sources.map_or([&[][..]; 2], |rows| [&rows[0][..], &rows[1][..]]);
        let with = |change: S::f64s, sources: &[Group<LANES>], i: usize| match sources.get(i) {
            Some(source) => simd.add_f64s(change, simd.mul_f64s(splat(kick_s), get(source))),
            None => change,
        };
        let (none, drift) = (splat(0.0), splat(stage.drift_s));
        let kicked = |velocity: S::f64s, change: S::f64s| {
            let velocity = simd.add_f64s(velocity, change);
            if IS_TWICE { simd.add_f64s(velocity, change) } else { velocity }
        };
        let (before, behind) = if self.is_ring { (get(&u[beads - 1]), get(&u[0])) } else { (none, none) };
        let mut here = get(&u[0]);
        let mut left = simd.mul_f64s(splat(contacts[0]), simd.sub_f64s(before, here));
        /// Moves a bead; gives the change of the force of the contact on its right. The last one stands alone: a loop without a choice.
        macro_rules! moved {
            ($i:ident, $next:ident) => {{
                let (i, next) = ($i, $next);
                let right = simd.mul_f64s(splat(contacts[i + 1]), simd.sub_f64s(here, next));
                let mut net = simd.sub_f64s(left, right);
                if !IS_PLAIN && i < springs.len() {
                    net = simd.sub_f64s(net, simd.mul_f64s(splat(springs[i]), here));
                }
                if !IS_PLAIN && i < w.len() {
                    let pull = simd.mul_f64s(splat(resonator_n_per_m[i]), simd.sub_f64s(get(&w[i]), here));
                    net = simd.add_f64s(net, pull);
                    let change =
                        simd.mul_f64s(splat(kick_s * inverse_resonator[i]), simd.sub_f64s(none, pull));
                    let velocity = kicked(get(&w_v[i]), with(change, of_resonators, i));
                    store::<S>(velocity, &mut w_v[i].0, at);
                    store::<S>(simd.add_f64s(get(&w[i]), simd.mul_f64s(drift, velocity)), &mut w[i].0, at);
                }
                let change = simd.mul_f64s(splat(push_s_per_kg[i]), net);
                let change = if IS_PLAIN { change } else { with(change, of_beads, i) };
                let velocity = kicked(get(&v[i]), change);
                store::<S>(velocity, &mut v[i].0, at);
                store::<S>(simd.add_f64s(here, simd.mul_f64s(drift, velocity)), &mut u[i].0, at);
                right
            }};
        }
        for i in 0..beads - 1 {
            let next = get(&u[i + 1]);
            (left, here) = (moved!(i, next), next);
        }
        let last = beads - 1;
        moved!(last, behind);
    }
}
