//! A group of beads in registers: moved, and their contacts evaluated.

use super::constants::{ANY, BARE, CUBIC, QUADRATIC, SPRINGS, Springs, before_terms, has_rest};
use super::layout::{GROUP, Layout};
use pulp::{Simd, WithSimd};
use schemas::contact::Power;
use schemas::simd::{Group, above, load, store};
use schemas::term::{Spring, TermLaw};

/// A kick, which comes twice where a step ends and the next one begins, and a drift (s); or no motion.
#[derive(Clone, Copy)]
pub(super) struct Motion<V> {
    pub(super) kicks: u8,
    pub(super) kick_s: V,
    pub(super) drift_s: V,
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

/// The laws of the forces on beads.
#[derive(Clone, Copy)]
pub(super) struct Laws<'a, P, V> {
    pub(super) power: P,
    /// True if contacts have overlaps and forces at rest.
    pub(super) are_loaded: bool,
    /// The overlap (m) from which on contacts press.
    pub(super) zero_up_to_m: V,
    pub(super) terms: &'a [TermLaw],
    pub(super) springs: Springs,
}

/// Overlaps (m) of the contacts of a group, and those that count for a power: 0 in open ones.
struct Overlaps<V> {
    all: Group<GROUP>,
    closed: Group<GROUP>,
    /// The largest that counts, in each lane.
    most: V,
}

/// The forces of all terms of a group: a function of its own, compiled once for all powers.
struct Terms<'a> {
    laws: &'a [TermLaw],
    stiffness: &'a [[f64; GROUP]],
    overlaps: &'a Group<GROUP>,
    sum: &'a mut Group<GROUP>,
}

impl WithSimd for Terms<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (law, stiffness) in self.laws.iter().zip(self.stiffness) {
            law.add_to(simd, stiffness, self.overlaps, self.sum);
        }
    }
}

impl Beads<'_> {
    /// Moves them, and evaluates the contacts on their left. `before` is the register before them; gives their last one.
    #[inline(always)]
    pub(super) fn step<S: Simd, P: Power, L: Layout, const KIND: u8>(
        mut self,
        simd: S,
        laws: Laws<'_, P, S::f64s>,
        motion: Motion<S::f64s>,
        mut before: S::f64s,
    ) -> S::f64s {
        // Without a force a kick adds zero, which changes no velocity: none is `-0`, see `Splitting::advance`.
        let is_pushed = motion.kicks > 0 && (KIND != BARE || self.presses[0] | self.presses[1]);
        let none = simd.splat_f64s(0.0);
        let mut overlaps = Overlaps { all: Group([0.0; GROUP]), closed: Group([0.0; GROUP]), most: none };
        for at in (0..GROUP).step_by(S::F64_LANES) {
            let right = self.moved::<S, L, KIND>(simd, motion, laws.springs, is_pushed, at);
            let left = L::left(simd, before, right);
            before = right;
            let mut overlap = simd.sub_f64s(left, right);
            if has_rest(KIND) && laws.are_loaded {
                overlap = simd.add_f64s(overlap, load::<S>(&self.constants[2], at));
            }
            if KIND & SPRINGS != 0 {
                // no force of the next register is that of a contact before it
                let stiffness = |row: usize| load::<S>(&self.constants[before_terms(KIND) + row], at);
                store::<S>(of_springs::<S, KIND>(simd, stiffness, overlap), self.force, at);
                continue;
            }
            store::<S>(overlap, &mut overlaps.all.0, at);
            let closed = above(simd, overlap, laws.zero_up_to_m);
            overlaps.most = simd.max_f64s(overlaps.most, closed);
            store::<S>(closed, &mut overlaps.closed.0, at);
        }
        if KIND & SPRINGS == 0 {
            self.press::<S, P, KIND>(simd, laws, &overlaps);
        }
        before
    }

    /// Moves the beads of the register that begins at number `at`.
    #[inline(always)]
    fn moved<S: Simd, L: Layout, const KIND: u8>(
        &mut self,
        simd: S,
        motion: Motion<S::f64s>,
        springs: Springs,
        is_pushed: bool,
        at: usize,
    ) -> S::f64s {
        let place = load::<S>(self.u, at);
        if motion.kicks == 0 {
            return place;
        }
        let mut velocity = load::<S>(self.v, at);
        if is_pushed {
            let net = self.net_n::<S, L, KIND>(simd, springs, at);
            velocity = motion.kicked(simd, load::<S>(&self.constants[0], at), net, velocity);
            store::<S>(velocity, self.v, at);
        }
        let place = simd.add_f64s(place, simd.mul_f64s(motion.drift_s, velocity));
        store::<S>(place, self.u, at);
        place
    }

    /// The net force on the beads from number `at` on.
    #[inline(always)]
    pub(super) fn net_n<S: Simd, L: Layout, const KIND: u8>(
        &self,
        simd: S,
        springs: Springs,
        at: usize,
    ) -> S::f64s {
        let [left, right] = [load::<S>(self.force, at), load::<S>(self.force, at + L::stride::<S>())];
        let net = simd.sub_f64s(left, right);
        if KIND != ANY || springs == Springs::None {
            return net;
        }
        let [.., linear, cubic] = self.constants else { return net };
        simd.sub_f64s(
            net,
            springs.pull(simd, load::<S>(linear, at), load::<S>(cubic, at), load::<S>(self.u, at)),
        )
    }

    /// Writes the forces of the contacts.
    #[inline(always)]
    fn press<S: Simd, P: Power, const KIND: u8>(
        self,
        simd: S,
        Laws { power, are_loaded, terms, .. }: Laws<'_, P, S::f64s>,
        overlaps: &Overlaps<S::f64s>,
    ) {
        let Beads { force, constants, presses, .. } = self;
        if KIND == BARE {
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
        if KIND == ANY && !terms.is_empty() {
            // copies: what a function may see that is not inlined stays in memory
            let (all, mut with_terms) = (overlaps.all, sum);
            let stiffness = &constants[before_terms(KIND)..];
            simd.vectorize(Terms { laws: terms, stiffness, overlaps: &all, sum: &mut with_terms });
            sum = with_terms;
        }
        for at in (0..GROUP).step_by(S::F64_LANES) {
            let mut found = load::<S>(&sum.0, at);
            if has_rest(KIND) && are_loaded {
                found = simd.sub_f64s(found, load::<S>(&constants[3], at));
            }
            store::<S>(found, force, at);
        }
    }
}

/// The forces of a register of contacts of springs alone, whose stiffnesses stand in the rows of `stiffness`.
#[inline(always)]
pub(super) fn of_springs<S: Simd, const KIND: u8>(
    simd: S,
    stiffness: impl Fn(usize) -> S::f64s,
    overlap_m: S::f64s,
) -> S::f64s {
    // each kind has linear ones; a sum that is -0 in place of 0 changes no velocity, since none is -0
    let (mut sum, mut row) = (Spring(1).in_register(simd, stiffness(0), overlap_m), 1);
    for (bit, power) in [(QUADRATIC, 2), (CUBIC, 3)] {
        if KIND & bit != 0 {
            sum = simd.add_f64s(sum, Spring(power).in_register(simd, stiffness(row), overlap_m));
            row += 1;
        }
    }
    sum
}

impl Springs {
    /// The force `κ·u`, or `κ·u + κ3·u³`, that pulls beads at `place` back.
    #[inline(always)]
    pub(super) fn pull<S: Simd>(self, simd: S, linear: S::f64s, cubic: S::f64s, place: S::f64s) -> S::f64s {
        let pull = simd.mul_f64s(linear, place);
        if self == Self::Linear {
            return pull;
        }
        let cube = simd.mul_f64s(simd.mul_f64s(place, place), place);
        simd.add_f64s(pull, simd.mul_f64s(cubic, cube))
    }
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
