//! Kicks, drifts and forces, all of a step, or of several, in one sweep over memory.
//!
//! Passes one after another, each over the whole chain, would fetch a long chain from memory each time. Instead a
//! sweep goes along the chain in tiles that fit into the cache, and takes each tile through all passes. The force of a
//! contact needs the displacements of both its beads, and both beads need the force, so that each pass ends before the
//! one that it follows, by a block of beads.

use super::{Kernel, Rest};
use schemas::chain::{Wall, Walls};
use schemas::contact::{BLOCK, ContactLaw, Power, PowerUser, evaluate};
use schemas::simd::vectorized;
use schemas::term::Term;
use std::ops::Range;

/// A pass of a sweep over every bead and contact that may not be at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Pass {
    /// A kick `v ← v + h·F/m` followed by a drift `u ← u + d·v`, of durations h and d (s).
    KickDrift { kick_s: f64, drift_s: f64 },
    /// Two kicks by the same forces, the first of which ends a step, followed by a drift.
    KickKickDrift { last_kick_s: f64, kick_s: f64, drift_s: f64 },
    /// The force `F = k·δ^α` of every contact.
    Forces,
    /// A kick `v ← v + h·F/m` of duration h (s).
    Kick { kick_s: f64 },
    /// A drift `u ← u + d·v` of duration d (s).
    Drift { drift_s: f64 },
}

/// Beads of a tile, whole blocks. The passes of a sweep work on two tiles at most, 160 kB, which fit into the second
/// cache.
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
        self.wall_forces_n.clear();
        self.wall_forces_n.resize(reach, [0.0; 2]);
        let law = &self.law;
        let sweep = Sweep {
            passes,
            // the contact that closes a ring joins its ends
            tile: if self.is_ring { beads.len() } else { self.tile },
            beads: beads.clone(),
            u_m,
            v_m_s,
            force: &mut self.force,
            presses: &mut self.presses,
            inverse_mass: &self.inverse_mass,
            stiffness: &self.stiffness,
            rest: self.rest.as_ref(),
            walls: self.walls,
            walls_m: &self.walls_m,
            wall_forces_n: &mut self.wall_forces_n,
            terms: &self.terms,
            is_ring: self.is_ring,
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
    pub(crate) fn reached(&self, reach: usize) -> Range<usize> {
        let (active, count) = (&self.activity.beads, self.inverse_mass.len());
        let start = active.start.saturating_sub(reach);
        let end = (active.end + reach).next_multiple_of(BLOCK);
        start - start % BLOCK..if end < count { end } else { count }
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

struct Sweep<'a> {
    passes: &'a [Pass],
    tile: usize,
    /// The beads to sweep over, and all contacts between them.
    beads: Range<usize>,
    u_m: &'a mut [f64],
    v_m_s: &'a mut [f64],
    /// This field and the following ones are as in [`Kernel`].
    force: &'a mut [f64],
    presses: &'a mut [bool],
    inverse_mass: &'a [f64],
    stiffness: &'a [f64],
    rest: Option<&'a Rest>,
    walls: Walls,
    walls_m: &'a [[f64; 2]],
    wall_forces_n: &'a mut [[f64; 2]],
    terms: &'a [Term],
    is_ring: bool,
    law: &'a ContactLaw,
}

impl PowerUser for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self, power: impl Power) {
        let (first, last) = (self.beads.start, self.beads.end);
        let mut start = first;
        while start < last {
            let end = if start + self.tile < last { start + self.tile } else { last };
            let mut evaluations = 0;
            for pass in 0..self.passes.len() {
                let lag = pass * BLOCK;
                let from = if start == first { first } else { start - lag };
                let beads = from..if end == last { last } else { end - lag };
                match self.passes[pass] {
                    Pass::KickDrift { kick_s, drift_s } => self.kick_drift([kick_s], drift_s, beads),
                    Pass::KickKickDrift { last_kick_s, kick_s, drift_s } => {
                        self.kick_drift([last_kick_s, kick_s], drift_s, beads);
                    }
                    Pass::Forces => {
                        self.evaluate_forces(beads, power, evaluations);
                        evaluations += 1;
                    }
                    Pass::Kick { kick_s } => self.kick(kick_s, beads),
                    Pass::Drift { drift_s } => self.drift(drift_s, beads),
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

    /// True if a force acts on a bead of the block that begins with bead `start`. Without a force a kick adds zero,
    /// which changes no velocity: none is `-0`, see `Splitting::advance`.
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
                velocity += kick_s * inverse_mass[i] * force;
            }
            v[i] = velocity;
            u[i] += drift_s * velocity;
        }
    }

    #[inline(always)]
    fn drift(&mut self, drift_s: f64, beads: Range<usize>) {
        for (u, v) in self.u_m[beads.clone()].iter_mut().zip(&self.v_m_s[beads]) {
            *u += drift_s * v;
        }
    }

    #[inline(always)]
    fn drift_each(&mut self, drift_s: f64, start: usize) {
        let (u, v) = (&mut self.u_m[start..][..BLOCK], &self.v_m_s[start..][..BLOCK]);
        for i in 0..BLOCK {
            u[i] += drift_s * v[i];
        }
    }

    #[inline(always)]
    fn kick_each(&mut self, kick_s: f64, start: usize, count: usize) {
        let (left, right) = (&self.force[start..][..count], &self.force[start + 1..][..count]);
        let inverse_mass = &self.inverse_mass[start..][..count];
        let v = &mut self.v_m_s[start..][..count];
        for i in 0..count {
            v[i] += kick_s * inverse_mass[i] * (left[i] - right[i]);
        }
    }

    /// Evaluates the contacts on the right of `beads`, and those of the end beads with walls.
    #[inline(always)]
    fn evaluate_forces(&mut self, beads: Range<usize>, power: impl Power, evaluation: usize) {
        let (first, count) = (beads.start, self.stiffness.len());
        let contacts = first..if beads.end < count { beads.end } else { count };
        let (left_m, right_m) = (&self.u_m[contacts.clone()], &self.u_m[first + 1..=contacts.end]);
        let stiffness = &self.stiffness[contacts.clone()];
        let force = &mut self.force[first + 1..=contacts.end];
        let presses = &mut self.presses[first / BLOCK..];
        let zero_up_to_m = self.law.zero_up_to_m();
        match self.rest {
            None => evaluate(
                [left_m, right_m, stiffness],
                force,
                power,
                zero_up_to_m,
                #[inline(always)]
                |[left, right, _]| left - right,
                #[inline(always)]
                |[_, _, stiffness], _, power| stiffness * power,
                #[inline(always)]
                |block, any_closed| {
                    presses[block] = any_closed;
                    any_closed
                },
            ),
            Some(rest) if !self.terms.is_empty() => {
                let force = &mut self.force[first + 1..=contacts.end];
                let of_contacts = (&self.u_m[first..=contacts.end], contacts.clone());
                add_up(of_contacts, stiffness, rest, self.terms, (power, zero_up_to_m), force);
                for (force, rest_n) in force.iter_mut().zip(&rest.force_n[contacts]) {
                    *force -= rest_n;
                }
                presses[..beads.len().div_ceil(BLOCK)].fill(true);
            }
            Some(rest) => {
                let (overlap_m, force_n) = (&rest.overlap_m[contacts.clone()], &rest.force_n[contacts]);
                evaluate(
                    [left_m, right_m, stiffness, overlap_m, force_n],
                    force,
                    power,
                    zero_up_to_m,
                    #[inline(always)]
                    |[left, right, _, rest, _]| (left - right) + rest,
                    #[inline(always)]
                    |[.., stiffness, _, rest], _, power| stiffness * power - rest,
                    #[inline(always)]
                    |_, _| true,
                );
                presses[..beads.len().div_ceil(BLOCK)].fill(true);
            }
        }
        self.push_by_walls(&beads, evaluation);
    }

    /// The forces of the walls on those end beads that are among `beads`.
    #[inline(always)]
    fn push_by_walls(&mut self, beads: &Range<usize>, evaluation: usize) {
        let count = self.u_m.len();
        let Walls { left, right } = self.walls;
        if self.is_ring {
            // all beads are swept at once
            self.force[0] = wall_force_n(&left, 0, self.law, self.terms, self.u_m[count - 1] - self.u_m[0]);
            self.force[count] = self.force[0];
            self.presses[(count - 1) / BLOCK] |= self.force[count] != 0.0;
            return;
        }
        let last = self.walls_m.len() - 1;
        let [left_m, right_m] = self.walls_m[if evaluation < last { evaluation } else { last }];
        if left.is_there && beads.start == 0 {
            self.force[0] = wall_force_n(&left, 0, self.law, self.terms, left_m - self.u_m[0]);
            self.wall_forces_n[evaluation][0] = self.force[0];
        }
        if right.is_there && beads.end == count {
            let approach_m = self.u_m[count - 1] - right_m;
            self.force[count] = wall_force_n(&right, 1, self.law, self.terms, approach_m);
            self.wall_forces_n[evaluation][1] = self.force[count];
            self.presses[(count - 1) / BLOCK] |= self.force[count] != 0.0;
        }
    }
}

/// Force (N) of a wall beyond that at rest when its bead has come `approach_m` nearer.
#[inline(always)]
fn wall_force_n(wall: &Wall, side: usize, law: &ContactLaw, terms: &[Term], approach_m: f64) -> f64 {
    if terms.is_empty() {
        return wall.excess_force_n(law, approach_m);
    }
    wall_elastic_n(wall, side, law, terms, approach_m) - wall.rest_force_n
}

/// Force (N) of a wall, including the force at rest.
#[inline(always)]
pub(super) fn wall_elastic_n(
    wall: &Wall,
    side: usize,
    law: &ContactLaw,
    terms: &[Term],
    approach_m: f64,
) -> f64 {
    let overlap_m = wall.overlap_m(approach_m);
    let by_law = law.force(wall.stiffness, overlap_m);
    terms.iter().fold(by_law, |sum, term| sum + term.law.force(term.wall_stiffness[side], overlap_m))
}

/// Writes the force (N), including the force at rest, of some neighbouring contacts into `force`. `u_m` are the
/// displacements of their beads, `contacts` their numbers, `stiffness` their stiffness of the law.
#[inline(always)]
pub(super) fn add_up(
    (u_m, contacts): (&[f64], Range<usize>),
    stiffness: &[f64],
    rest: &Rest,
    terms: &[Term],
    (power, zero_up_to_m): (impl Power, f64),
    force: &mut [f64],
) {
    let count = contacts.len();
    let overlap_m = &rest.overlap_m[contacts.clone()];
    evaluate(
        [&u_m[..count], &u_m[1..], stiffness, overlap_m],
        force,
        power,
        zero_up_to_m,
        #[inline(always)]
        |[left, right, _, rest]| (left - right) + rest,
        #[inline(always)]
        |[_, _, stiffness, _], _, power| stiffness * power,
        #[inline(always)]
        |_, any_closed| any_closed,
    );
    let mut more = [0.0; TILE];
    for term in terms {
        let of_term = &term.stiffness[contacts.clone()];
        let mut start = 0;
        while start < count {
            let end = if start + TILE < count { start + TILE } else { count };
            let more = &mut more[..end - start];
            term.law.forces(&u_m[start..=end], &of_term[start..end], &overlap_m[start..end], more);
            for (force, more) in force[start..end].iter_mut().zip(more) {
                *force += *more;
            }
            start = end;
        }
    }
}

/// The first beads of the whole blocks of `beads`, and the beads after them.
#[inline(always)]
fn in_blocks(beads: Range<usize>) -> (impl Iterator<Item = usize>, Range<usize>) {
    let rest = beads.end - beads.len() % BLOCK;
    ((beads.start..rest).step_by(BLOCK), rest..beads.end)
}
