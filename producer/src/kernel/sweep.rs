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
use super::layout::{Along, COUNTED, Layout, PerLane};
use crate::aligned::with_room;
use aligned_vec::{AVec, CACHELINE_ALIGN};
use pulp::{Simd, WithSimd};
use schemas::contact::{BLOCK, ContactLaw, Power, PowerUser};
use schemas::simd::{Group, LANES, above, in_vectors, load, store};
use schemas::term::{Spring, TermLaw};
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

/// Beads that a pass takes together: several registers are on their way at a time.
pub(super) const GROUP: usize = 16;

impl Kernel {
    /// Takes all beads and contacts that may not be at rest through `passes`, and widens the window of active
    /// beads over those that a contact now pushes. `u_m` and `v_m_s` have room behind the last bead.
    pub(crate) fn sweep(&mut self, passes: &[Pass], u_m: &mut [f64], v_m_s: &mut [f64]) {
        if self.activity.beads.is_empty() {
            return;
        }
        // forces reach one bead further each time they are evaluated
        let reach = passes.iter().filter(|pass| pass.has_forces()).count();
        let beads = self.reached(reach);
        debug_assert!(passes.len() <= self.passes_of_a_sweep(), "no pass is a whole tile behind the first");
        self.sweep_over(&beads, passes, u_m, v_m_s);
        self.widen(&beads, u_m, v_m_s);
    }

    /// Takes `beads`, and the contact on the left of each, through `passes`.
    pub(super) fn sweep_over(
        &mut self,
        beads: &Range<usize>,
        passes: &[Pass],
        u_m: &mut [f64],
        v_m_s: &mut [f64],
    ) {
        let evaluations = passes.iter().filter(|pass| pass.has_forces()).count();
        self.wall_forces_n.clear();
        self.wall_forces_n.resize(evaluations, [PerLane::same(0.0); 2]);
        let sweep = Sweep {
            passes,
            tile: if self.fits_in_a_tile() { with_room(self.count) } else { self.tile },
            beads: beads.clone(),
            count: self.count,
            u_m,
            v_m_s,
            force: &mut self.force,
            presses: &mut self.presses,
            constants: &self.constants,
            ends: self.ends,
            walls_m: &self.walls_m,
            wall_forces_n: &mut self.wall_forces_n,
            law: &self.law,
        };
        in_vectors(self.arch, sweep);
    }

    /// The most passes that one sweep can take.
    pub(crate) fn passes_of_a_sweep(&self) -> usize {
        if self.fits_in_a_tile() { MOST_PASSES } else { self.tile / BLOCK }
    }

    /// True if all beads are swept at once: in a ring the last contact joins both ends.
    fn fits_in_a_tile(&self) -> bool {
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
        let force = &self.force;
        let is_active = |i: &usize| {
            let i = *i;
            force[i] != 0.0 || force[i + 1] != 0.0 || u_m[i].to_bits() != 0 || v_m_s[i].to_bits() != 0
        };
        let active = &mut self.activity.beads;
        active.start = (beads.start..active.start).find(is_active).unwrap_or(active.start);
        active.end = (active.end..beads.end).rev().find(is_active).map_or(active.end, |last| last + 1);
    }
}

/// The ends of a chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ends {
    /// True if the last bead touches the first one.
    pub(super) is_ring: bool,
    /// True for each end that has a wall.
    pub(super) have_wall: [bool; 2],
}

/// Numbers of beads and contacts that never change, in groups: of each group `1/m` (1/kg) of its beads, the stiffnesses of the contacts on
/// their left, in loaded chains their overlaps (m) and forces (N) at rest, and their stiffnesses in each term.
#[derive(Debug, Clone)]
pub(super) struct Constants {
    kind: u8,
    has_law: bool,
    /// Numbers of a bead.
    rows: usize,
    numbers: AVec<f64>,
    terms: Vec<TermLaw>,
}

/// Contacts, and which of their parts there are.
const LOADED: u8 = 1;
/// Terms of any kind; the rows of loaded chains are there, too.
const TERMS: u8 = 2;
/// Springs, in this order, and no other force.
const SPRINGS: u8 = LINEAR | QUADRATIC | CUBIC;
const LINEAR: u8 = 4;
const QUADRATIC: u8 = 8;
const CUBIC: u8 = 16;

/// The contacts of a chain, and `1/m` (1/kg) of its beads, each in an array of whole groups.
#[derive(Clone, Copy)]
pub(super) struct Contacts<'a> {
    pub(super) inverse_mass: &'a [f64],
    pub(super) stiffness: &'a [f64],
    /// Overlaps (m) and forces (N) at rest.
    pub(super) rest: [&'a [f64]; 2],
    pub(super) terms: &'a [(TermLaw, AVec<f64>)],
}

impl Constants {
    pub(super) fn of(contacts: Contacts<'_>) -> Self {
        let Contacts { inverse_mass, stiffness, rest, terms } = contacts;
        let has = |numbers: &[f64]| numbers.iter().any(|x| *x != 0.0);
        let (has_law, loaded) = (has(stiffness), if rest.map(has) == [false; 2] { 0 } else { LOADED });
        let springs: Option<Vec<_>> = terms
            .iter()
            .map(|(law, _)| if let TermLaw::Spring(Spring(n)) = law { Some(*n) } else { None })
            .collect();
        let kind = loaded
            | match springs.as_deref() {
                Some([]) => 0,
                Some([1]) if !has_law => LINEAR,
                Some([1, 2]) if !has_law => LINEAR | QUADRATIC,
                Some([1, 3]) if !has_law => LINEAR | CUBIC,
                Some([1, 2, 3]) if !has_law => LINEAR | QUADRATIC | CUBIC,
                _ => TERMS | LOADED,
            };
        let rest = if kind & LOADED == 0 { &[][..] } else { &rest };
        let of_terms = terms.iter().map(|(_, stiffness)| &stiffness[..]);
        let rows: Vec<_> = [inverse_mass, stiffness].iter().chain(rest).copied().chain(of_terms).collect();
        let of_group = |start: usize| rows.iter().flat_map(move |row| &row[start..start + GROUP]);
        let numbers = (0..inverse_mass.len()).step_by(GROUP).flat_map(of_group).copied();
        let numbers = AVec::from_iter(CACHELINE_ALIGN, numbers);
        let terms = terms.iter().map(|(law, _)| law.clone()).collect();
        Self { kind, has_law, rows: rows.len(), numbers, terms }
    }
}

/// Everything that a sweep takes its beads through. Arrays have room behind the last bead.
pub(super) struct Sweep<'a> {
    pub(super) passes: &'a [Pass],
    pub(super) tile: usize,
    /// The beads to sweep over, and the contact on the left of each; behind the last bead of the chain that on its right, too.
    pub(super) beads: Range<usize>,
    /// Number of beads of the chain.
    pub(super) count: usize,
    pub(super) u_m: &'a mut [f64],
    pub(super) v_m_s: &'a mut [f64],
    /// This field and the following ones are as in [`Kernel`].
    pub(super) force: &'a mut [f64],
    pub(super) presses: &'a mut [bool],
    pub(super) constants: &'a Constants,
    pub(super) ends: Ends,
    pub(super) walls_m: &'a [[PerLane; 2]],
    pub(super) wall_forces_n: &'a mut [[PerLane; 2]],
    pub(super) law: &'a ContactLaw,
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
        self.sweep.of_kind::<S, _, Along>(simd, power);
    }
}

/// A kick, which comes twice where a step ends and the next one begins, and a drift (s); or no motion.
#[derive(Clone, Copy)]
struct Motion<V> {
    kicks: u8,
    kick_s: V,
    drift_s: V,
}

/// The neighbours of the end beads.
#[derive(Clone, Copy)]
struct Neighbours<V> {
    /// The register before that of the first bead.
    left_m: V,
    /// The place of the right neighbour of the last bead.
    right_m: V,
    /// True if there is a left and a right neighbour.
    are_there: [bool; 2],
    /// The number behind that of the last bead.
    behind: usize,
}

/// A group of beads: their displacements and velocities, and the forces and constants of the contacts on their left.
struct Beads<'a> {
    u: &'a mut [f64; GROUP],
    v: &'a mut [f64; GROUP],
    /// The forces of the next contacts follow.
    force: &'a mut [f64],
    constants: &'a [[f64; GROUP]],
    /// True if a contact presses, for this group and the next one.
    presses: &'a mut [bool],
}

impl Sweep<'_> {
    #[inline(always)]
    fn of_kind<S: Simd, P: Power, L: Layout>(&mut self, simd: S, power: P) {
        /// One copy of the loops for each kind.
        macro_rules! run {
            ($($power:literal: $($kind:expr),+;)+) => {
                match self.constants.kind {
                    $($(kind if kind == $kind && P::IS_ANY == $power => self.run::<S, P, L, { $kind }>(simd, power),)+)+
                    _ => self.run::<S, P, L, { TERMS | LOADED }>(simd, power),
                }
            };
        }
        run! {
            true: 0, LOADED;
            false: LINEAR, LINEAR | QUADRATIC, LINEAR | CUBIC, SPRINGS;
        }
    }

    #[inline(always)]
    fn run<S: Simd, P: Power, L: Layout, const KIND: u8>(&mut self, simd: S, power: P) {
        let stride = L::stride::<S>();
        let (first, is_to_end) = (self.beads.start * stride, self.beads.end == self.count);
        // the contact on the right of the last bead is evaluated, too
        let last = ((self.beads.end + usize::from(is_to_end)) * stride).next_multiple_of(GROUP);
        let (tile, lag) = (self.tile * stride, BLOCK * stride);
        let mut start = first;
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
                    Pass::Stage { kick_s, drift_s } => motion(1, kick_s, drift_s),
                    Pass::StageAfterKick { kick_s, drift_s } => motion(2, kick_s, drift_s),
                    Pass::Forces => motion(0, &none, &none),
                    Pass::Kick { kick_s } => {
                        self.kick::<S, L, KIND>(simd, kick_s.load::<S>(), part);
                        continue;
                    }
                    Pass::Drift { drift_s } => {
                        self.drift::<S>(simd, drift_s.load::<S>(), part);
                        continue;
                    }
                };
                self.stage::<S, P, L, KIND>(simd, power, motion, part, evaluations);
                evaluations += 1;
            }
            start = end;
        }
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
        let ends = self.neighbours::<S, L>(simd, motion, evaluation);
        let mut before = if part.start == 0 { ends.left_m } else { L::before(simd, self.u_m, part.start) };
        let last = ends.behind - ends.behind % GROUP;
        let (mut start, constants) = (part.start, self.constants);
        let laws = (power, simd.splat_f64s(self.law.zero_up_to_m()), &constants.terms[..]);
        while start < part.end {
            if start == 0 || start == last {
                let beads = self.group(start);
                before = beads.step::<S, P, L, KIND, true>(simd, laws, motion, before, (start, ends));
                start += GROUP;
                continue;
            }
            let end = if last < part.end { last } else { part.end };
            let (u, v) = (&mut self.u_m[start..end], &mut self.v_m_s[start..end]);
            let force = &mut self.force[start..end + LANES];
            let presses = &mut self.presses[start / GROUP..=end / GROUP];
            let rows = rows::<KIND>(&constants.terms);
            let constants = constants.numbers[start * rows..end * rows].chunks_exact(rows * GROUP);
            let groups = u.as_chunks_mut().0.iter_mut().zip(v.as_chunks_mut().0).zip(constants);
            for (group, ((u, v), constants)) in groups.enumerate() {
                let beads = Beads {
                    u,
                    v,
                    force: &mut force[group * GROUP..(group + 1) * GROUP + LANES],
                    constants: constants.as_chunks().0,
                    presses: if KIND == 0 { &mut presses[group..group + 2] } else { &mut [] },
                };
                before = beads.step::<S, P, L, KIND, false>(simd, laws, motion, before, (start, ends));
            }
            start = end;
        }
        let wall = &mut self.wall_forces_n[evaluation];
        if part.start == 0 {
            wall[0].0[..stride].copy_from_slice(&self.force[..stride]);
        }
        if part.contains(&ends.behind) {
            wall[1].0[..stride].copy_from_slice(&self.force[ends.behind..ends.behind + stride]);
        }
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

    /// The neighbours of the end beads where this stage ends.
    #[inline(always)]
    fn neighbours<S: Simd, L: Layout>(
        &mut self,
        simd: S,
        motion: Motion<S::f64s>,
        evaluation: usize,
    ) -> Neighbours<S::f64s> {
        let stride = L::stride::<S>();
        let (behind, are_there) = (self.count * stride, self.ends.have_wall);
        if !self.ends.is_ring {
            let last = self.walls_m.len() - 1;
            let [left, right] = &self.walls_m[if evaluation < last { evaluation } else { last }];
            return Neighbours { left_m: left.load::<S>(), right_m: right.load::<S>(), are_there, behind };
        }
        let left_m = self.place_of::<S, L>(simd, motion, self.count - 1);
        let right_m = self.place_of::<S, L>(simd, motion, 0);
        Neighbours { left_m, right_m, are_there, behind }
    }

    /// The place of `bead` where this stage ends, as its own group will find it.
    #[inline(always)]
    fn place_of<S: Simd, L: Layout>(&mut self, simd: S, motion: Motion<S::f64s>, bead: usize) -> S::f64s {
        let stride = L::stride::<S>();
        let at = bead * stride % GROUP;
        let Beads { u, v, force, constants, .. } = self.group(bead * stride - at);
        let place = L::before::<S>(simd, u, at + stride);
        if motion.kicks == 0 {
            return place;
        }
        let [left_n, right_n] =
            [L::before::<S>(simd, force, at + stride), L::before::<S>(simd, force, at + 2 * stride)];
        let inverse_mass = L::before::<S>(simd, &constants[0], at + stride);
        let velocity = L::before::<S>(simd, v, at + stride);
        let velocity = motion.kicked(simd, inverse_mass, simd.sub_f64s(left_n, right_n), velocity);
        simd.add_f64s(place, simd.mul_f64s(motion.drift_s, velocity))
    }

    #[inline(always)]
    fn kick<S: Simd, L: Layout, const KIND: u8>(&mut self, simd: S, kick_s: S::f64s, part: Range<usize>) {
        let motion = Motion { kicks: 1, kick_s, drift_s: kick_s };
        for start in part.step_by(GROUP) {
            let Beads { v, force, constants, presses, .. } = self.group(start);
            if KIND == 0 && !(presses[0] | presses[1]) {
                continue;
            }
            for at in (0..GROUP).step_by(S::F64_LANES) {
                let net = net_n::<S, L>(simd, force, at);
                let inverse_mass = load::<S>(&constants[0], at);
                store::<S>(motion.kicked(simd, inverse_mass, net, load::<S>(v, at)), v, at);
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

/// Numbers of a bead among the constants.
#[inline(always)]
fn rows<const KIND: u8>(terms: &[TermLaw]) -> usize {
    let rest = if KIND & LOADED == 0 { 0 } else { 2 };
    if KIND & (SPRINGS | TERMS) == 0 { 2 + rest } else { 2 + rest + terms.len() }
}

impl Beads<'_> {
    /// Moves them, and evaluates the contacts on their left. `before` is the register before
    /// them; gives their last one. At an end of the chain it is told the number at which they begin, and the neighbours there.
    #[inline(always)]
    fn step<S: Simd, P: Power, L: Layout, const KIND: u8, const AT_END: bool>(
        self,
        simd: S,
        (power, zero_up_to_m, terms): (P, S::f64s, &[TermLaw]),
        motion: Motion<S::f64s>,
        mut before: S::f64s,
        (start, ends): (usize, Neighbours<S::f64s>),
    ) -> S::f64s {
        let Beads { u, v, force, constants, presses } = self;
        let (lanes, stride) = (S::F64_LANES, L::stride::<S>());
        // Without a force a kick adds zero, which changes no velocity: none is `-0`, see `Splitting::advance`.
        let is_pushed = motion.kicks > 0 && (KIND != 0 || presses[0] | presses[1]);
        let (mut overlaps, mut closed) = (Group([0.0; GROUP]), Group([0.0; GROUP]));
        let mut most = simd.splat_f64s(0.0);
        for at in (0..GROUP).step_by(lanes) {
            let mut right = load::<S>(u, at);
            if motion.kicks > 0 {
                let mut velocity = load::<S>(v, at);
                if is_pushed {
                    let net = net_n::<S, L>(simd, force, at);
                    let inverse_mass = load::<S>(&constants[0], at);
                    velocity = motion.kicked(simd, inverse_mass, net, velocity);
                    store::<S>(velocity, v, at);
                }
                right = simd.add_f64s(right, simd.mul_f64s(motion.drift_s, velocity));
                store::<S>(right, u, at);
            }
            let mut left = L::left(simd, before, right);
            before = right;
            if AT_END {
                let number = simd.add_f64s(load::<S>(&COUNTED, at), simd.splat_f64s(start as f64));
                // what touches nothing has an overlap of zero
                let behind = simd.splat_f64s(ends.behind as f64);
                let there = if ends.are_there[1] { ends.right_m } else { left };
                right = simd.select_f64s(simd.greater_than_or_equal_f64s(number, behind), there, right);
                let first = simd.splat_f64s(if ends.are_there[0] { 0.0 } else { stride as f64 });
                left = simd.select_f64s(simd.less_than_f64s(number, first), right, left);
            }
            let mut overlap = simd.sub_f64s(left, right);
            if KIND & LOADED != 0 {
                overlap = simd.add_f64s(overlap, load::<S>(&constants[2], at));
            }
            if KIND & SPRINGS != 0 {
                let mut sum = simd.splat_f64s(0.0);
                let mut row = rows::<KIND>(&[]);
                for (bit, spring) in [(LINEAR, Spring(1)), (QUADRATIC, Spring(2)), (CUBIC, Spring(3))] {
                    if KIND & bit != 0 {
                        sum = simd
                            .add_f64s(sum, spring.force_in(simd, load::<S>(&constants[row], at), overlap));
                        row += 1;
                    }
                }
                if KIND & LOADED != 0 {
                    sum = simd.sub_f64s(sum, load::<S>(&constants[3], at));
                }
                store::<S>(sum, &mut overlaps.0, at);
                continue;
            }
            if KIND & TERMS != 0 {
                store::<S>(overlap, &mut overlaps.0, at);
            }
            let overlap = above(simd, overlap, zero_up_to_m);
            if KIND == 0 {
                most = simd.max_f64s(most, overlap);
            }
            store::<S>(overlap, &mut closed.0, at);
        }
        if KIND == 0 {
            let is_closed = simd.greater_than_f64s(most, simd.splat_f64s(0.0));
            let pressed = std::mem::replace(&mut presses[0], simd.first_true_m64s(is_closed) < lanes);
            if !presses[0] {
                if pressed {
                    force[..GROUP].fill(0.0);
                }
                return before;
            }
        }
        if KIND & SPRINGS != 0 {
            for at in (0..GROUP).step_by(lanes) {
                store::<S>(load::<S>(&overlaps.0, at), force, at);
            }
            return before;
        }
        let mut sum = Group([0.0; GROUP]);
        if P::IS_ANY {
            let powers = power.raise_group(simd, &closed);
            for at in (0..GROUP).step_by(lanes) {
                let found = simd.mul_f64s(load::<S>(&constants[1], at), load::<S>(&powers.0, at));
                store::<S>(found, &mut sum.0, at);
            }
        }
        if KIND & TERMS != 0 {
            for (law, stiffness) in terms.iter().zip(&constants[rows::<KIND>(&[])..]) {
                law.add_to(simd, stiffness, &overlaps, &mut sum);
            }
        }
        for at in (0..GROUP).step_by(lanes) {
            let mut found = load::<S>(&sum.0, at);
            if KIND & LOADED != 0 {
                found = simd.sub_f64s(found, load::<S>(&constants[3], at));
            }
            store::<S>(found, force, at);
        }
        before
    }
}

/// The net force on the beads from number `at` on.
#[inline(always)]
fn net_n<S: Simd, L: Layout>(simd: S, force: &[f64], at: usize) -> S::f64s {
    simd.sub_f64s(load::<S>(force, at), load::<S>(force, at + L::stride::<S>()))
}

impl<V: Copy> Motion<V> {
    /// `v + (h·(1/m))·F`, once or twice.
    #[inline(always)]
    fn kicked<S: Simd<f64s = V>>(&self, simd: S, inverse_mass: V, force: V, velocity: V) -> V {
        let change = simd.mul_f64s(simd.mul_f64s(self.kick_s, inverse_mass), force);
        let velocity = simd.add_f64s(velocity, change);
        if self.kicks == 2 { simd.add_f64s(velocity, change) } else { velocity }
    }
}
