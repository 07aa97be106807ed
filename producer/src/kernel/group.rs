//! A group of beads in registers: moved, and their contacts evaluated.

use super::constants::{CUBIC, LINEAR, LOADED, QUADRATIC, SPRINGS, TERMS, rows};
use super::layout::{COUNTED, GROUP, Layout};
use pulp::Simd;
use schemas::contact::Power;
use schemas::simd::{Group, above, load, store};
use schemas::term::{InGroups as _, Spring, TermLaw};

/// A kick, which comes twice where a step ends and the next one begins, and a drift (s); or no motion.
#[derive(Clone, Copy)]
pub(super) struct Motion<V> {
    pub(super) kicks: u8,
    pub(super) kick_s: V,
    pub(super) drift_s: V,
}

/// The neighbours of the end beads.
#[derive(Clone, Copy)]
pub(super) struct Neighbours<V> {
    /// The register before that of the first bead.
    pub(super) left_m: V,
    /// The place of the right neighbour of the last bead.
    pub(super) right_m: V,
    /// True if there is a left and a right neighbour.
    pub(super) are_there: [bool; 2],
    /// The number behind that of the last bead.
    pub(super) behind: usize,
}

/// A group of beads: their displacements and velocities, and the forces and constants of the contacts on their left.
pub(super) struct Beads<'a> {
    pub(super) u: &'a mut [f64; GROUP],
    pub(super) v: &'a mut [f64; GROUP],
    /// The forces of the next contacts follow.
    pub(super) force: &'a mut [f64],
    pub(super) constants: &'a [[f64; GROUP]],
    /// True if a contact presses, for this group and the next one.
    pub(super) presses: &'a mut [bool],
}

/// Overlaps (m) of the contacts of a group, and those that count for a power: 0 in open ones.
struct Overlaps<V> {
    all: Group<GROUP>,
    closed: Group<GROUP>,
    /// The largest that counts, in each lane.
    most: V,
}

impl Beads<'_> {
    /// Moves them, and evaluates the contacts on their left. `before` is the register before
    /// them; gives their last one. At an end of the chain it is told the number at which they begin, and the neighbours there.
    #[inline(always)]
    pub(super) fn step<S: Simd, P: Power, L: Layout, const KIND: u8, const AT_END: bool>(
        mut self,
        simd: S,
        (power, zero_up_to_m, terms): (P, S::f64s, &[TermLaw]),
        motion: Motion<S::f64s>,
        mut before: S::f64s,
        place: (usize, Neighbours<S::f64s>),
    ) -> S::f64s {
        // Without a force a kick adds zero, which changes no velocity: none is `-0`, see `Splitting::advance`.
        let is_pushed = motion.kicks > 0 && (KIND != 0 || self.presses[0] | self.presses[1]);
        let none = simd.splat_f64s(0.0);
        let mut overlaps = Overlaps { all: Group([0.0; GROUP]), closed: Group([0.0; GROUP]), most: none };
        for at in (0..GROUP).step_by(S::F64_LANES) {
            let right = self.moved::<S, L>(simd, motion, is_pushed, at);
            let left = L::left(simd, before, right);
            before = right;
            let mut overlap = if AT_END {
                let (left, right) = at_end::<S, L>(simd, place, at, left, right);
                simd.sub_f64s(left, right)
            } else {
                simd.sub_f64s(left, right)
            };
            if KIND & LOADED != 0 {
                overlap = simd.add_f64s(overlap, load::<S>(&self.constants[2], at));
            }
            store::<S>(overlap, &mut overlaps.all.0, at);
            let closed = above(simd, overlap, zero_up_to_m);
            overlaps.most = simd.max_f64s(overlaps.most, closed);
            store::<S>(closed, &mut overlaps.closed.0, at);
        }
        self.press::<S, P, KIND>(simd, power, terms, &overlaps);
        before
    }

    /// Moves the beads of the register that begins at number `at`.
    #[inline(always)]
    fn moved<S: Simd, L: Layout>(
        &mut self,
        simd: S,
        motion: Motion<S::f64s>,
        is_pushed: bool,
        at: usize,
    ) -> S::f64s {
        let place = load::<S>(self.u, at);
        if motion.kicks == 0 {
            return place;
        }
        let mut velocity = load::<S>(self.v, at);
        if is_pushed {
            let net = net_n::<S, L>(simd, self.force, at);
            velocity = motion.kicked(simd, load::<S>(&self.constants[0], at), net, velocity);
            store::<S>(velocity, self.v, at);
        }
        let place = simd.add_f64s(place, simd.mul_f64s(motion.drift_s, velocity));
        store::<S>(place, self.u, at);
        place
    }

    /// Writes the forces of the contacts.
    #[inline(always)]
    fn press<S: Simd, P: Power, const KIND: u8>(
        self,
        simd: S,
        power: P,
        terms: &[TermLaw],
        overlaps: &Overlaps<S::f64s>,
    ) {
        let Beads { force, constants, presses, .. } = self;
        if KIND == 0 {
            let is_closed = simd.greater_than_f64s(overlaps.most, simd.splat_f64s(0.0));
            let any_closed = simd.first_true_m64s(is_closed) < S::F64_LANES;
            let pressed = std::mem::replace(&mut presses[0], any_closed);
            if !any_closed {
                if pressed {
                    force[..GROUP].fill(0.0);
                }
                return;
            }
        }
        let mut sum = Group([0.0; GROUP]);
        if P::IS_ANY {
            let powers = power.raise_group(simd, &overlaps.closed);
            for at in (0..GROUP).step_by(S::F64_LANES) {
                let found = simd.mul_f64s(load::<S>(&constants[1], at), load::<S>(&powers.0, at));
                store::<S>(found, &mut sum.0, at);
            }
        }
        let of_terms = &constants[rows::<KIND>(&[])..];
        if KIND & SPRINGS != 0 {
            let springs = [(LINEAR, Spring(1)), (QUADRATIC, Spring(2)), (CUBIC, Spring(3))];
            let mut row = 0;
            for (bit, spring) in springs {
                if KIND & bit != 0 {
                    spring.add_to(simd, &of_terms[row], &overlaps.all, &mut sum);
                    row += 1;
                }
            }
        }
        if KIND & TERMS != 0 {
            for (law, stiffness) in terms.iter().zip(of_terms) {
                law.add_to(simd, stiffness, &overlaps.all, &mut sum);
            }
        }
        for at in (0..GROUP).step_by(S::F64_LANES) {
            let mut found = load::<S>(&sum.0, at);
            if KIND & LOADED != 0 {
                found = simd.sub_f64s(found, load::<S>(&constants[3], at));
            }
            store::<S>(found, force, at);
        }
    }
}

/// The neighbours `left` and `right` of the contacts of a register, where the chain ends: it begins at number `at` of the group at `start`.
#[inline(always)]
fn at_end<S: Simd, L: Layout>(
    simd: S,
    (start, ends): (usize, Neighbours<S::f64s>),
    at: usize,
    left: S::f64s,
    right: S::f64s,
) -> (S::f64s, S::f64s) {
    let number = simd.add_f64s(load::<S>(&COUNTED, at), simd.splat_f64s(start as f64));
    // what touches nothing has an overlap of zero
    let there = if ends.are_there[1] { ends.right_m } else { left };
    let is_behind = simd.greater_than_or_equal_f64s(number, simd.splat_f64s(ends.behind as f64));
    let right = simd.select_f64s(is_behind, there, right);
    let first = if ends.are_there[0] { 0 } else { L::stride::<S>() };
    let is_first = simd.less_than_f64s(number, simd.splat_f64s(first as f64));
    (simd.select_f64s(is_first, right, left), right)
}

/// The net force on the beads from number `at` on.
#[inline(always)]
pub(super) fn net_n<S: Simd, L: Layout>(simd: S, force: &[f64], at: usize) -> S::f64s {
    simd.sub_f64s(load::<S>(force, at), load::<S>(force, at + L::stride::<S>()))
}

impl<V: Copy> Motion<V> {
    /// `v + (h·(1/m))·F`, once or twice.
    #[inline(always)]
    pub(super) fn kicked<S: Simd<f64s = V>>(&self, simd: S, inverse_mass: V, force: V, velocity: V) -> V {
        let change = simd.mul_f64s(simd.mul_f64s(self.kick_s, inverse_mass), force);
        let velocity = simd.add_f64s(velocity, change);
        if self.kicks == 2 { simd.add_f64s(velocity, change) } else { velocity }
    }
}
