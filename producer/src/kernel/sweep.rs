//! Kicks, drifts and forces, all of a step, or of several, in one sweep over memory.
//!
//! One after another, each over the whole chain, they would fetch a long chain from memory each time. Instead
//! a sweep goes along the chain in tiles that fit into the cache, and takes each tile through all passes. The
//! force of a contact needs the displacements of both its beads, and both beads need the force, so that each
//! pass ends before the one that it follows, by a block of beads.

use super::{Kernel, Rest};
use schemas::chain::Walls;
use schemas::contact::{BLOCK, ContactLaw, Contacts, PowerUser};
use schemas::simd::vectorized;
use std::ops::Range;

/// What a sweep does to every bead and contact that may not be at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Pass {
    /// A kick `v ← v + h·F/m` followed by a drift `u ← u + d·v`, of durations h and d (s).
    KickDrift { kick_s: f64, drift_s: f64 },
    /// Two kicks by the same forces, of which the first ends a step, followed by a drift.
    KickKickDrift { last_kick_s: f64, kick_s: f64, drift_s: f64 },
    /// The force `F = k·δ^α` of every contact.
    Forces,
    /// A kick `v ← v + h·F/m` of duration h (s).
    Kick { kick_s: f64 },
}

/// Beads of a tile, whole blocks: what the passes of a sweep have in hand, two tiles at most, are 160 kB, which fit into
/// the second cache.
pub(crate) const TILE: usize = 2048;

impl Kernel {
    /// Takes all beads and contacts that may not be at rest through `passes`, and widens the window of active
    /// beads over those that a contact now pushes.
    pub(crate) fn sweep(&mut self, passes: &[Pass], u_m: &mut [f64], v_m_s: &mut [f64]) {
        if self.activity.beads.is_empty() {
            return;
        }
        // forces reach one bead further each time they are evaluated
        let reach = passes.iter().filter(|pass| **pass == Pass::Forces).count();
        let beads = self.reached(reach);
        debug_assert!(passes.len() <= self.passes_of_a_sweep(), "no pass is a whole tile behind the first");
        let law = self.law;
        let sweep = Sweep {
            passes,
            tile: self.tile,
            beads: beads.clone(),
            u_m,
            v_m_s,
            force: &mut self.force,
            presses: &mut self.presses,
            inverse_mass: &self.inverse_mass,
            stiffness: &self.stiffness,
            rest: self.rest.as_ref(),
            walls: self.walls,
            law,
        };
        vectorized(
            self.arch,
            #[inline(always)]
            || law.with_power(sweep),
        );
        self.widen(&beads, u_m, v_m_s);
    }

    /// The most passes that one sweep can take.
    pub(crate) fn passes_of_a_sweep(&self) -> usize {
        self.tile / BLOCK
    }

    /// The active beads and `reach` more at both ends, rounded outwards to whole blocks.
    pub(super) fn reached(&self, reach: usize) -> Range<usize> {
        let (active, count) = (&self.activity.beads, self.inverse_mass.len());
        let start = active.start.saturating_sub(reach);
        let end = (active.end + reach).next_multiple_of(BLOCK);
        start - start % BLOCK..if end < count { end } else { count }
    }

    /// Widens the window of active beads over the pushed or moving ones among `beads`.
    pub(super) fn widen(&mut self, beads: &Range<usize>, u_m: &[f64], v_m_s: &[f64]) {
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

struct Sweep<'a> {
    passes: &'a [Pass],
    tile: usize,
    /// The beads to sweep over, and all contacts between them.
    beads: Range<usize>,
    u_m: &'a mut [f64],
    v_m_s: &'a mut [f64],
    /// This and what follows are as in [`Kernel`].
    force: &'a mut [f64],
    presses: &'a mut [bool],
    inverse_mass: &'a [f64],
    stiffness: &'a [f64],
    rest: Option<&'a Rest>,
    walls: Walls,
    law: ContactLaw,
}

impl PowerUser for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self, zero_below_m: f64, power: impl Fn(f64) -> f64 + Copy) {
        let (first, last) = (self.beads.start, self.beads.end);
        let mut start = first;
        while start < last {
            let end = if start + self.tile < last { start + self.tile } else { last };
            for pass in 0..self.passes.len() {
                let lag = pass * BLOCK;
                let from = if start == first { first } else { start - lag };
                let beads = from..if end == last { last } else { end - lag };
                match self.passes[pass] {
                    Pass::KickDrift { kick_s, drift_s } => self.kick_drift([kick_s], drift_s, beads),
                    Pass::KickKickDrift { last_kick_s, kick_s, drift_s } => {
                        self.kick_drift([last_kick_s, kick_s], drift_s, beads);
                    }
                    Pass::Forces => self.evaluate_forces(beads, zero_below_m, power),
                    Pass::Kick { kick_s } => self.kick(kick_s, beads),
                }
            }
            start = end;
        }
    }
}

impl Sweep<'_> {
    #[inline(always)]
    fn kick_drift<const K: usize>(&mut self, kicks_s: [f64; K], drift_s: f64, beads: Range<usize>) {
        let (blocks, rest) = in_blocks(beads);
        for start in blocks {
            if self.is_pushed(start) {
                self.kick_drift_each(kicks_s, drift_s, start, BLOCK);
            } else {
                self.drift_each(drift_s, start);
            }
        }
        self.kick_drift_each(kicks_s, drift_s, rest.start, rest.len());
    }

    #[inline(always)]
    fn kick(&mut self, kick_s: f64, beads: Range<usize>) {
        let (blocks, rest) = in_blocks(beads);
        for start in blocks {
            if self.is_pushed(start) {
                self.kick_each(kick_s, start, BLOCK);
            }
        }
        self.kick_each(kick_s, rest.start, rest.len());
    }

    /// Whether a force acts on a bead of the block that begins with bead `start`. Without a force a kick adds zero, which
    /// changes no velocity: none is `-0`, see [`Splitting::step`](crate::splitting::Splitting::step).
    #[inline(always)]
    fn is_pushed(&self, start: usize) -> bool {
        self.presses[start / BLOCK] || self.force[start] != 0.0
    }

    #[inline(always)]
    fn kick_drift_each<const K: usize>(
        &mut self,
        kicks_s: [f64; K],
        drift_s: f64,
        start: usize,
        count: usize,
    ) {
        let (left, right) = (&self.force[start..][..count], &self.force[start + 1..][..count]);
        let inverse_mass = &self.inverse_mass[start..][..count];
        let (u, v) = (&mut self.u_m[start..][..count], &mut self.v_m_s[start..][..count]);
        for i in 0..count {
            let (mut velocity, force) = (v[i], left[i] - right[i]);
            for kick_s in kicks_s {
                velocity = (kick_s * inverse_mass[i]).mul_add(force, velocity);
            }
            v[i] = velocity;
            u[i] = drift_s.mul_add(velocity, u[i]);
        }
    }

    #[inline(always)]
    fn drift_each(&mut self, drift_s: f64, start: usize) {
        let (u, v) = (&mut self.u_m[start..][..BLOCK], &self.v_m_s[start..][..BLOCK]);
        for i in 0..BLOCK {
            u[i] = drift_s.mul_add(v[i], u[i]);
        }
    }

    #[inline(always)]
    fn kick_each(&mut self, kick_s: f64, start: usize, count: usize) {
        let (left, right) = (&self.force[start..][..count], &self.force[start + 1..][..count]);
        let inverse_mass = &self.inverse_mass[start..][..count];
        let v = &mut self.v_m_s[start..][..count];
        for i in 0..count {
            v[i] = (kick_s * inverse_mass[i]).mul_add(left[i] - right[i], v[i]);
        }
    }

    /// Evaluates the contacts on the right of `beads`, and those of the end beads with walls.
    #[inline(always)]
    fn evaluate_forces(&mut self, beads: Range<usize>, zero_below_m: f64, power: impl Fn(f64) -> f64 + Copy) {
        let (first, count) = (beads.start, self.stiffness.len());
        let end = if beads.end < count { beads.end } else { count };
        let contacts = Contacts {
            left_m: &self.u_m[first..end],
            right_m: &self.u_m[first + 1..=end],
            stiffness: &self.stiffness[first..end],
            values: &mut self.force[first + 1..=end],
        };
        let presses = &mut self.presses[first / BLOCK..];
        match self.rest {
            None => contacts.evaluate_closed(
                zero_below_m,
                #[inline(always)]
                |overlap_m, stiffness| stiffness * power(overlap_m),
                #[inline(always)]
                |block, any_closed| presses[block] = any_closed,
            ),
            Some(rest) => {
                evaluate_loaded(contacts, rest, first, zero_below_m, power);
                presses[..beads.len().div_ceil(BLOCK)].fill(true);
            }
        }
        self.push_by_walls(&beads);
    }

    /// The forces of the walls on those end beads that are among `beads`.
    #[inline(always)]
    fn push_by_walls(&mut self, beads: &Range<usize>) {
        let count = self.u_m.len();
        if self.walls.left.stiffness > 0.0 && beads.start == 0 {
            self.force[0] = self.walls.left.excess_force_n(self.law, -self.u_m[0]);
        }
        if self.walls.right.stiffness > 0.0 && beads.end == count {
            self.force[count] = self.walls.right.excess_force_n(self.law, self.u_m[count - 1]);
            self.presses[(count - 1) / BLOCK] |= self.force[count] != 0.0;
        }
    }
}

/// The first beads of the whole blocks of `beads`, and the beads after them.
#[inline(always)]
fn in_blocks(beads: Range<usize>) -> (impl Iterator<Item = usize>, Range<usize>) {
    let rest = beads.end - beads.len() % BLOCK;
    ((beads.start..rest).step_by(BLOCK), rest..beads.end)
}

/// The forces of `contacts` in a loaded chain: overlaps count from those at rest, forces beyond those at rest. `first`
/// is the number of the first contact.
#[inline(always)]
fn evaluate_loaded(
    contacts: Contacts<'_>,
    rest: &Rest,
    first: usize,
    zero_below_m: f64,
    power: impl Fn(f64) -> f64 + Copy,
) {
    let Contacts { left_m, right_m, stiffness, values } = contacts;
    let count = values.len();
    let (left, right) = (&left_m[..count], &right_m[..count]);
    let (stiffness, force) = (&stiffness[..count], &mut values[..count]);
    let rest_overlap = &rest.overlap_m[first..][..count];
    let rest_force = &rest.force_n[first..][..count];
    for c in 0..count {
        let overlap = (left[c] - right[c]) + rest_overlap[c];
        let closed = overlap > zero_below_m;
        let f = stiffness[c] * power(if closed { overlap } else { 1.0 });
        force[c] = (if closed { f } else { 0.0 }) - rest_force[c];
    }
}
