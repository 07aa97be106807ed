//! Kicks, drifts and forces, all of a step, or of several, in one sweep over memory.
//!
//! A stage of a step is one loop: it kicks and drifts a group of beads and evaluates the contact on the left of each, in registers, with
//! one load and one store of each number. The forces that kick a group are those of the stage before, of which the group on its right has
//! not been evaluated again.
//!
//! Stages one after another, each over the whole chain, would fetch a long chain from memory each time. So a sweep goes along the chain in
//! tiles that fit into the cache, and takes each tile through all passes. Each pass ends a block before the one that it follows, whose
//! last forces it needs.

use super::Kernel;
use super::constants::{ANY, BARE, CUBIC, Constants, LINEAR, LOADED, QUADRATIC, SPRINGS, Springs, rows};
use super::group::{Beads, Laws, Motion};
use super::layout::{Across, Along, GROUP, Layout, PerLane};
use crate::aligned::{Aligned, with_room};
use pulp::{Simd, WithSimd};
use schemas::contact::{BLOCK, ContactLaw, Formula, Power, PowerUser};
use schemas::simd::{LANES, in_vectors, load, store};
use std::marker::PhantomData;
use std::ops::Range;

/// A pass of a sweep over every bead and contact that may not be at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Pass {
    /// A kick `v ← v + h·F/m` and a drift `u ← u + d·v`, of durations h and d (s), and the forces at its end.
    Stage { kick_s: PerLane, drift_s: PerLane },
    /// The same with two such kicks, the first of which ends a step.
    StageAfterKick { kick_s: PerLane, drift_s: PerLane },
    /// The force `F = k·δ^α` of every contact.
    Forces,
    /// A kick `v ← v + h·F/m` of duration h (s).
    Kick { kick_s: PerLane },
    /// A drift `u ← u + d·v` of duration d (s).
    Drift { drift_s: PerLane },
}

impl Pass {
    /// True if it evaluates forces.
    fn has_forces(&self) -> bool {
        !matches!(self, Self::Kick { .. } | Self::Drift { .. })
    }
}

/// Beads of a tile, whole blocks. The passes of a sweep work on two tiles at most, 200 kB, which fit into the second
/// cache.
pub(crate) const TILE: usize = 2048;

/// The most passes of a sweep over a chain that is no longer than a tile.
const MOST_PASSES: usize = 256;

impl Kernel {
    /// Takes all beads and contacts that may not be at rest through `passes`, and widens the window of active
    /// beads over those that a contact now pushes. `u_m` and `v_m_s` have room behind the last bead.
    pub(crate) fn sweep(&mut self, passes: &[Pass], u_m: &mut [f64], v_m_s: &mut [f64]) {
        self.sweep_and_shake(passes, u_m, v_m_s, None);
    }

    /// Does the same, and lets others act on the velocities (m/s) of shaken beads: after each kick if a bead is [pushed](Kernel::push), else
    /// between two kicks that meet. All beads are swept [at once](Self::fits_in_a_tile) then.
    pub(crate) fn sweep_and_shake(
        &mut self,
        passes: &[Pass],
        u_m: &mut [f64],
        v_m_s: &mut [f64],
        shake: Option<Shake<'_>>,
    ) {
        if self.activity.beads.is_empty() {
            return;
        }
        // forces reach one bead further each time they are evaluated
        let reach = passes.iter().filter(|pass| pass.has_forces()).count();
        let beads = self.reached(reach);
        assert!(passes.len() <= self.passes_of_a_sweep(), "no pass is a whole tile behind the first");
        self.sweep_over(&beads, passes, u_m, v_m_s, shake);
        self.widen(&beads, u_m, v_m_s);
    }

    /// Takes `beads`, and the contact on the left of each, through `passes`.
    pub(super) fn sweep_over(
        &mut self,
        beads: &Range<usize>,
        passes: &[Pass],
        u_m: &mut [f64],
        v_m_s: &mut [f64],
        shake: Option<Shake<'_>>,
    ) {
        let evaluations = passes.iter().filter(|pass| pass.has_forces()).count();
        let kept = if self.keeps_places { evaluations } else { 0 };
        let places = kept * self.force.len();
        if self.places_m.len() != places {
            self.places_m = Aligned::zeros(places);
        }
        let sweep = Sweep {
            passes,
            tile: if self.fits_in_a_tile() { with_room(self.count) } else { self.tile },
            beads: beads.clone(),
            count: self.count,
            width: self.width,
            u_m,
            v_m_s,
            force: &mut self.force,
            presses: &mut self.presses,
            constants: &self.constants,
            ends: self.ends,
            walls_m: &self.walls_m,
            wall_forces_n: &mut self.wall_forces_n,
            places_m: &mut self.places_m,
            law: &self.law,
            shaken: &self.shaken,
            shake: shake.map(|shake| shake as Shake<'_>),
        };
        in_vectors(self.arch_of_sweeps, sweep);
    }

    /// The most passes that one sweep can take.
    pub(crate) fn passes_of_a_sweep(&self) -> usize {
        if self.fits_in_a_tile() { MOST_PASSES } else { self.tile / BLOCK }
    }

    /// True if all beads are swept at once: in a ring the last contact joins both ends.
    pub(crate) fn fits_in_a_tile(&self) -> bool {
        self.ends.is_ring || self.count <= self.tile
    }

    /// The active beads and `reach` more at both ends, rounded outwards to whole blocks.
    pub(crate) fn reached(&self, reach: usize) -> Range<usize> {
        let active = &self.activity.beads;
        let start = active.start.saturating_sub(reach);
        let end = (active.end + reach).next_multiple_of(BLOCK);
        start - start % BLOCK..if end < self.count { end } else { self.count }
    }

    /// Widens the window of active beads over the pushed or moving ones among `beads`.
    pub(crate) fn widen(&mut self, beads: &Range<usize>, u_m: &[f64], v_m_s: &[f64]) {
        let (force, width) = (&self.force, self.width);
        let is_active = |bead: &usize| {
            let number = *bead * width;
            (number..number + width).any(|i| {
                force[i] != 0.0 || force[i + width] != 0.0 || u_m[i].to_bits() != 0 || v_m_s[i].to_bits() != 0
            })
        };
        let active = &mut self.activity.beads;
        active.start = (beads.start..active.start).find(is_active).unwrap_or(active.start);
        active.end = (active.end..beads.end).rev().find(is_active).map_or(active.end, |last| last + 1);
    }
}

/// The action of baths on velocities (m/s) between two steps, or of forces in a kick.
pub(crate) type Shake<'a> = &'a mut dyn FnMut(&mut [f64]);

/// The ends of a chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ends {
    /// True if the last bead touches the first one.
    pub(super) is_ring: bool,
    /// True for each end that has a wall.
    pub(super) have_wall: [bool; 2],
}

/// The groups with beads that baths and forces act on.
#[derive(Debug, Clone, Default)]
pub(super) struct Shaken {
    /// The numbers at which they begin and end, in turns.
    bounds: Vec<usize>,
    /// True if something acts after each kick, not between two that meet alone.
    pub(super) in_each_kick: bool,
}

impl Shaken {
    /// Adds those with one of these numbers.
    pub(super) fn add(&mut self, numbers: Range<usize>) {
        let mut ranges: Vec<_> = self.bounds.as_chunks::<2>().0.to_vec();
        ranges.push([numbers.start - numbers.start % GROUP, numbers.end.next_multiple_of(GROUP)]);
        ranges.sort_unstable();
        ranges.dedup_by(|next, last| {
            let touches = next[0] <= last[1];
            last[1] = if touches && next[1] > last[1] { next[1] } else { last[1] };
            touches
        });
        self.bounds = ranges.concat();
    }

    /// True if they have this number.
    fn has(&self, number: usize) -> bool {
        self.bounds.partition_point(|bound| *bound <= number) % 2 == 1
    }
}

/// Everything that a sweep takes its beads through. Arrays have room behind the last bead.
pub(super) struct Sweep<'a> {
    pub(super) passes: &'a [Pass],
    pub(super) tile: usize,
    /// The beads to sweep over, and the contact on the left of each; behind the last bead of the chain that on its right, too.
    pub(super) beads: Range<usize>,
    /// Number of beads of a chain.
    pub(super) count: usize,
    /// This field and the following ones are as in [`Kernel`]. Arrays of numbers are `width` times as long as there are beads.
    pub(super) width: usize,
    pub(super) u_m: &'a mut [f64],
    pub(super) v_m_s: &'a mut [f64],
    pub(super) force: &'a mut [f64],
    pub(super) presses: &'a mut [bool],
    pub(super) constants: &'a Constants,
    pub(super) ends: Ends,
    pub(super) walls_m: &'a [[PerLane; 2]],
    pub(super) wall_forces_n: &'a mut [[PerLane; 2]],
    pub(super) places_m: &'a mut [f64],
    pub(super) law: &'a ContactLaw,
    pub(super) shaken: &'a Shaken,
    pub(super) shake: Option<Shake<'a>>,
}

impl WithSimd for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let law = self.law;
        if self.constants.has_law {
            law.with_power(In { simd, sweep: self });
        } else {
            ContactLaw::with_no_power(In { simd, sweep: self });
        }
    }
}

/// A sweep in the vectors of an instruction set.
struct In<'a, S> {
    simd: S,
    sweep: Sweep<'a>,
}

impl<S: Simd> PowerUser for In<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(mut self, power: impl Power) {
        let simd = self.simd;
        if self.sweep.width == 1 {
            self.sweep.of_kind::<S, _, Along>(simd, power);
        } else {
            self.sweep.of_kind::<S, _, Across>(simd, power);
        }
    }
}

/// A kick, or a drift, without forces: a function of its own, compiled once for all laws.
struct Simple<'s, 'a, L> {
    sweep: &'s mut Sweep<'a>,
    is_kick: bool,
    time_s: &'s PerLane,
    part: Range<usize>,
    layout: PhantomData<L>,
}

impl<L: Layout> WithSimd for Simple<'_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let time_s = self.time_s.load::<S>();
        if self.is_kick {
            self.sweep.kick::<S, L>(simd, time_s, self.part);
        } else {
            self.sweep.drift::<S>(simd, time_s, self.part);
        }
    }
}

impl Sweep<'_> {
    #[inline(always)]
    fn of_kind<S: Simd, P: Power, L: Layout>(&mut self, simd: S, power: P) {
        // the vectors of machines that have no better ones: see `Constants::of`
        if S::F64_LANES == 2 && cfg!(not(target_arch = "aarch64")) {
            return self.run::<S, P, L, ANY>(simd, power);
        }
        /// One copy of the loops for each kind.
        macro_rules! run {
            ($($power:literal: $($kind:expr),+;)+) => {
                match self.constants.kind {
                    $($(kind if kind == $kind && P::IS_ANY == $power => self.run::<S, P, L, { $kind }>(simd, power),)+)+
                    _ => self.run::<S, P, L, ANY>(simd, power),
                }
            };
        }
        run! {
            true: BARE, LOADED;
            false: LINEAR, LINEAR | QUADRATIC, LINEAR | CUBIC, SPRINGS;
        }
    }

    #[inline(always)]
    fn run<S: Simd, P: Power, L: Layout, const KIND: u8>(&mut self, simd: S, power: P) {
        let has_springs_alone = KIND & SPRINGS != 0;
        let formula = if has_springs_alone { Some(Formula::Linear) } else { power.formula() };
        if L::IS_ALONG
            && KIND != ANY
            && let Some(formula) = formula
            && self.shake.is_none()
            && self.passes.len() > 1
            && self.hold::<S, KIND>(simd, formula)
        {
            return;
        }
        let stride = L::stride::<S>();
        let (first, is_to_end) = (self.beads.start * stride, self.beads.end == self.count);
        // the contact on the right of the last bead is evaluated, too
        let last = ((self.beads.end + usize::from(is_to_end)) * stride).next_multiple_of(GROUP);
        let (tile, lag) = (self.tile * stride, BLOCK * stride);
        let (mut start, shaken) = (first, self.shaken);
        while start < last {
            let end = if start + tile < last { start + tile } else { last };
            let mut evaluations = 0;
            for (number, pass) in self.passes.iter().enumerate() {
                let behind = number * lag;
                let from = if start == first { first } else { start - behind };
                let part = from..if end == last { last } else { end - behind };
                let motion = |kicks, kick_s: &PerLane, drift_s: &PerLane| Motion {
                    kicks,
                    kick_s: kick_s.load::<S>(),
                    drift_s: drift_s.load::<S>(),
                };
                let none = PerLane::same(0.0);
                let motion = match pass {
                    Pass::Stage { kick_s, drift_s } => {
                        self.shake::<S, L>(simd, 1, kick_s);
                        motion(1, kick_s, drift_s)
                    }
                    Pass::StageAfterKick { kick_s, drift_s } => {
                        self.shake::<S, L>(simd, 2, kick_s);
                        motion(2, kick_s, drift_s)
                    }
                    Pass::Forces => motion(0, &none, &none),
                    Pass::Kick { kick_s: time_s } | Pass::Drift { drift_s: time_s } => {
                        let is_kick = matches!(pass, Pass::Kick { .. });
                        self.simple::<S, L>(simd, is_kick, time_s, part);
                        if let Some(push) = self.shake.as_mut().filter(|_| is_kick && shaken.in_each_kick) {
                            push(self.v_m_s);
                        }
                        continue;
                    }
                };
                self.stage::<S, P, L, KIND>(simd, power, motion, part.clone(), evaluations);
                let row = evaluations * self.force.len();
                if !self.places_m.is_empty() {
                    self.places_m[row..][part.clone()].copy_from_slice(&self.u_m[part]);
                }
                evaluations += 1;
            }
            start = end;
        }
    }

    /// Makes a kick, or a drift, without forces.
    #[inline(always)]
    fn simple<S: Simd, L: Layout>(&mut self, simd: S, is_kick: bool, time_s: &PerLane, part: Range<usize>) {
        simd.vectorize(Simple { sweep: self, is_kick, time_s, part, layout: PhantomData::<L> });
    }

    /// Kicks of a stage with `kicks` that shaken groups make before it, as others act on them in between.
    #[inline(always)]
    fn kicks_before(&self, kicks: u8) -> u8 {
        let most = if self.shaken.in_each_kick { kicks } else { kicks.saturating_sub(1) }; // integers
        if self.shake.is_some() { most } else { 0 }
    }

    /// Makes the kicks that shaken groups make before a stage with `kicks`, and lets others act after each.
    #[inline(always)]
    fn shake<S: Simd, L: Layout>(&mut self, simd: S, kicks: u8, kick_s: &PerLane) {
        let before = self.kicks_before(kicks);
        let Some(shake) = self.shake.take() else { return };
        let shaken = self.shaken;
        for _ in 0..before {
            for bounds in shaken.bounds.as_chunks::<2>().0 {
                self.simple::<S, L>(simd, true, kick_s, bounds[0]..bounds[1]);
            }
            shake(self.v_m_s);
        }
        self.shake = Some(shake);
    }

    /// The motion of shaken groups in a stage of `motion`, if it is another one.
    #[inline(always)]
    fn after_shakes<S: Simd>(&self, simd: S, motion: Motion<S::f64s>) -> Option<Motion<S::f64s>> {
        let before = self.kicks_before(motion.kicks);
        // a kick of no duration adds zero
        let kick_s = if before == motion.kicks { simd.splat_f64s(0.0) } else { motion.kick_s };
        (before > 0).then_some(Motion { kicks: 1, kick_s, ..motion })
    }

    /// Moves the beads that begin at the numbers `part`, and evaluates the contacts on their left.
    #[inline(always)]
    fn stage<S: Simd, P: Power, L: Layout, const KIND: u8>(
        &mut self,
        simd: S,
        power: P,
        motion: Motion<S::f64s>,
        part: Range<usize>,
        evaluation: usize,
    ) {
        let stride = L::stride::<S>();
        let (behind, is_ring) = (self.count * stride, self.ends.is_ring);
        let part = if is_ring { part.start..behind.next_multiple_of(GROUP) } else { part };
        let left_m = self.before_first::<S, L, KIND>(simd, motion, evaluation);
        let mut before = if part.start == 0 { left_m } else { L::before(simd, self.u_m, part.start) };
        let constants = self.constants;
        let laws = Laws {
            power,
            are_loaded: KIND == LOADED || constants.are_loaded,
            zero_up_to_m: simd.splat_f64s(self.law.zero_up_to_m()),
            terms: &constants.terms,
            springs: constants.springs,
        };
        let (shaken, of_shaken) = (self.shaken, self.after_shakes(simd, motion));
        let bounds = if of_shaken.is_some() { &shaken.bounds[..] } else { &[] };
        let mut start = part.start;
        for piece in 0..=bounds.len() {
            let numbers = start..bounds.get(piece).copied().unwrap_or(part.end);
            start = numbers.end;
            let motion = of_shaken.filter(|_| piece % 2 == 1).unwrap_or(motion);
            before = self.groups::<S, P, L, KIND>(simd, laws, motion, before, numbers);
        }
        if is_ring {
            // the contact behind the last bead is the first one, whatever was found there
            let (first, of_behind) = self.force.split_at_mut(behind);
            of_behind[..stride].copy_from_slice(&first[..stride]);
            if KIND == BARE {
                self.presses[behind / GROUP] |= first[..stride].iter().any(|force| *force != 0.0);
            }
        }
        for (side, number) in [(0, 0), (1, behind)] {
            if part.contains(&number) || is_ring {
                let force = &mut self.force[number..number + stride];
                if !self.ends.have_wall[side] {
                    // whatever was found of a contact with nothing
                    force.fill(0.0);
                }
                if let Some(walls_n) = self.wall_forces_n.get_mut(evaluation) {
                    walls_n[side].0[..stride].copy_from_slice(force);
                }
            }
        }
    }

    /// Moves the beads that begin at the numbers `part`, whole groups, after the register `before`; gives their last one.
    #[inline(always)]
    fn groups<S: Simd, P: Power, L: Layout, const KIND: u8>(
        &mut self,
        simd: S,
        laws: Laws<'_, P, S::f64s>,
        motion: Motion<S::f64s>,
        mut before: S::f64s,
        part: Range<usize>,
    ) -> S::f64s {
        let constants = self.constants;
        let (u, v) = (&mut self.u_m[part.clone()], &mut self.v_m_s[part.clone()]);
        let force = &mut self.force[part.start..part.end + LANES];
        let presses = &mut self.presses[part.start / GROUP..=part.end / GROUP];
        let rows = rows::<KIND>(constants);
        let constants = constants.numbers[part.start * rows..part.end * rows].chunks_exact(rows * GROUP);
        let groups = u.as_chunks_mut().0.iter_mut().zip(v.as_chunks_mut().0).zip(constants);
        for (group, ((u, v), constants)) in groups.enumerate() {
            let beads = Beads {
                u,
                v,
                force: &mut force[group * GROUP..(group + 1) * GROUP + LANES],
                constants: constants.as_chunks().0,
                presses: if KIND == BARE { &mut presses[group..group + 2] } else { &mut [] },
            };
            before = beads.step::<S, P, L, KIND>(simd, laws, motion, before);
        }
        before
    }

    /// The group that begins at the number `start`.
    #[inline(always)]
    fn group(&mut self, start: usize) -> Beads<'_> {
        let (group, rows) = (start / GROUP, self.constants.rows);
        Beads {
            u: &mut self.u_m.as_chunks_mut().0[group],
            v: &mut self.v_m_s.as_chunks_mut().0[group],
            force: &mut self.force[start..start + GROUP + LANES],
            constants: &self.constants.numbers.as_chunks().0[group * rows..(group + 1) * rows],
            presses: &mut self.presses[group..group + 2],
        }
    }

    /// The register before the first bead where this stage ends. The wall on the right takes the place of beads behind the last one, which are
    /// too heavy to move.
    #[inline(always)]
    fn before_first<S: Simd, L: Layout, const KIND: u8>(
        &mut self,
        simd: S,
        motion: Motion<S::f64s>,
        evaluation: usize,
    ) -> S::f64s {
        if self.ends.is_ring {
            return self.place_of::<S, L, KIND>(simd, motion, self.count - 1);
        }
        let last = self.walls_m.len() - 1;
        let [left, right] = &self.walls_m[if evaluation < last { evaluation } else { last }];
        if evaluation <= last {
            let stride = L::stride::<S>();
            let behind = self.count * stride;
            let room = &mut self.u_m[behind..(behind + stride).next_multiple_of(GROUP)];
            room.chunks_mut(stride).for_each(|places| places.copy_from_slice(&right.0[..stride]));
        }
        left.load::<S>()
    }

    /// The place of `bead` where this stage ends, as its own group will find it.
    #[inline(always)]
    fn place_of<S: Simd, L: Layout, const KIND: u8>(
        &mut self,
        simd: S,
        motion: Motion<S::f64s>,
        bead: usize,
    ) -> S::f64s {
        let stride = L::stride::<S>();
        let (at, springs) = (bead * stride % GROUP, self.constants.springs);
        let of_shaken = self.after_shakes(simd, motion);
        let Beads { u, v, force, constants, .. } = self.group(bead * stride - at);
        let place = L::before::<S>(simd, u, at + stride);
        if motion.kicks == 0 {
            return place;
        }
        let [left_n, right_n] =
            [L::before::<S>(simd, force, at + stride), L::before::<S>(simd, force, at + 2 * stride)];
        let inverse_mass = L::before::<S>(simd, &constants[0], at + stride);
        let velocity = L::before::<S>(simd, v, at + stride);
        let mut net = simd.sub_f64s(left_n, right_n);
        if KIND == ANY && springs != Springs::None {
            let row = |row: &[f64; GROUP]| L::before::<S>(simd, row, at + stride);
            if let [.., linear, cubic] = constants {
                net = simd.sub_f64s(net, springs.pull(simd, row(linear), row(cubic), place));
            }
        }
        let motion = of_shaken.filter(|_| self.shaken.has(bead * stride)).unwrap_or(motion);
        let velocity = motion.kicked(simd, inverse_mass, net, velocity);
        simd.add_f64s(place, simd.mul_f64s(motion.drift_s, velocity))
    }

    #[inline(always)]
    fn kick<S: Simd, L: Layout>(&mut self, simd: S, kick_s: S::f64s, part: Range<usize>) {
        let motion = Motion { kicks: 1, kick_s, drift_s: kick_s };
        let (is_bare, springs) = (self.constants.kind == BARE, self.constants.springs);
        for start in part.step_by(GROUP) {
            let group = self.group(start);
            if is_bare && !(group.presses[0] | group.presses[1]) {
                continue;
            }
            for at in (0..GROUP).step_by(S::F64_LANES) {
                let net = group.net_n::<S, L, ANY>(simd, springs, at);
                let inverse_mass = load::<S>(&group.constants[0], at);
                let velocity = motion.kicked(simd, inverse_mass, net, load::<S>(group.v, at));
                store::<S>(velocity, group.v, at);
            }
        }
    }

    #[inline(always)]
    fn drift<S: Simd>(&mut self, simd: S, drift_s: S::f64s, part: Range<usize>) {
        let (u, v) = (&mut self.u_m[part.clone()], &self.v_m_s[part]);
        for (u, v) in u.as_chunks_mut::<GROUP>().0.iter_mut().zip(v.as_chunks::<GROUP>().0) {
            for at in (0..GROUP).step_by(S::F64_LANES) {
                let way = simd.mul_f64s(drift_s, load::<S>(v, at));
                store::<S>(simd.add_f64s(load::<S>(u, at), way), u, at);
            }
        }
    }
}
