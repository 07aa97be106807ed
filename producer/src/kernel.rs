//! Kicks, drifts and contact forces, over the part of the chain that has ever moved.
//!
//! Architecture invariant: a bead is skipped only where the full step would return the bits it already has. Outside
//! the [`Activity`] window displacement and velocity are zero, every contact has its force at rest, which is
//! subtracted in the form in which it was computed, and a kick or a drift adds exactly zero.

mod constants;
mod group;
mod layout;
mod moving;
mod sweep;

use crate::aligned::with_room;
use aligned_vec::{AVec, CACHELINE_ALIGN};
use constants::{Constants, Contacts};
use layout::GROUP;
pub(crate) use layout::PerLane;
use moving::Damped;
pub(crate) use moving::Motion;
use pulp::Arch;
use schemas::chain::{Chain, Wall};
use schemas::contact::{BLOCK, ContactLaw};
use schemas::simd::{ordered_sum, vectorized};
use schemas::sites::Sites;
use schemas::term::Term;
use std::ops::Range;
use sweep::Ends;
pub(crate) use sweep::{Pass, TILE};

/// The beads that may differ from rest: all others have zero bits in `u` and `v`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Activity {
    beads: Range<usize>,
}

impl Activity {
    /// The smallest window around the beads that are not at rest at zero displacement.
    pub fn of(u_m: &[f64], v_m_s: &[f64]) -> Self {
        let active = |(u, v): (&f64, &f64)| u.to_bits() != 0 || v.to_bits() != 0;
        let pairs = || u_m.iter().zip(v_m_s);
        let first = pairs().position(active).unwrap_or(0);
        let end = pairs().rposition(active).map_or(first, |last| last + 1);
        Self { beads: first..end }
    }

    /// The beads in it.
    pub(crate) fn beads(&self) -> Range<usize> {
        self.beads.clone()
    }

    /// This window, widened over `bead`.
    pub(crate) fn with(mut self, bead: usize) -> Self {
        let beads = &self.beads;
        let (start, end) = if beads.is_empty() { (bead, bead + 1) } else { (beads.start, beads.end) };
        self.beads = if bead < start { bead } else { start }..if bead < end { end } else { bead + 1 };
        self
    }

    /// This window, widened over the beads that have one of `values` (N of them) other than zero.
    pub(crate) fn including(mut self, values: &[f64]) -> Self {
        let active = |x: &f64| x.to_bits() != 0;
        if let (Some(first), Some(last)) = (values.iter().position(active), values.iter().rposition(active)) {
            let beads = &self.beads;
            let (start, end) = if beads.is_empty() { (first, last + 1) } else { (beads.start, beads.end) };
            self.beads = if first < start { first } else { start }..if last < end { end } else { last + 1 };
        }
        self
    }
}

/// The active beads and their forces, with slices over just these beads.
#[derive(Debug, Clone)]
pub(crate) struct Pushed<'a> {
    /// The window of active beads.
    pub(crate) beads: Range<usize>,
    /// Force (N), beyond the force at rest, of the contact on the left of each bead, which pushes it to the right.
    pub(crate) left: &'a [f64],
    /// Force (N), beyond the force at rest, of the contact on the right of each bead, which pushes it to the left.
    pub(crate) right: &'a [f64],
    /// `1/m` (1/kg) of each bead.
    pub(crate) inverse_mass: &'a [f64],
}

/// The arrays of a chain in the form in which the kernel uses them. Those of contacts have at index i the contact on the left of bead i, at
/// N the one on the right of the last bead; they and those of beads are filled up with zeros.
#[derive(Debug, Clone)]
pub struct Kernel {
    arch: Arch,
    law: ContactLaw,
    /// Number of beads.
    count: usize,
    ends: Ends,
    inverse_mass: AVec<f64>,
    /// Force (N) at rest of each contact.
    rest_n: AVec<f64>,
    constants: Constants,
    /// The places of the walls (m) at each evaluation of forces in a sweep; the last entry serves for all further
    /// evaluations.
    walls_m: Vec<[PerLane; 2]>,
    /// The forces (N) of both walls at each evaluation of the last sweep.
    wall_forces_n: Vec<[PerLane; 2]>,
    sites: Sites,
    damped: Option<Damped>,
    /// Force (N), beyond the force at rest, of each contact.
    force: AVec<f64>,
    /// True for each group in which a contact presses more than at rest.
    presses: Vec<bool>,
    activity: Activity,
    /// Beads of a tile of a sweep.
    tile: usize,
}

impl Kernel {
    /// A kernel for `chain` that uses the widest SIMD instructions of this machine.
    pub fn new(chain: &Chain) -> Self {
        Self::with_arch(chain, Arch::new(), TILE)
    }

    /// A kernel with a given instruction set that sweeps `tile` beads at a time; all instruction sets and tiles give
    /// the same bits.
    pub(crate) fn with_arch(chain: &Chain, arch: Arch, tile: usize) -> Self {
        let (count, walls) = (chain.bead_count(), [chain.wall(0), chain.wall(usize::from(!chain.is_ring))]);
        let padded = |numbers: &mut dyn Iterator<Item = f64>| {
            let room = with_room(count) + BLOCK;
            AVec::from_iter(CACHELINE_ALIGN, numbers.chain(std::iter::repeat(0.0)).take(room))
        };
        let beside = |contacts: &[f64], of_walls: [f64; 2]| {
            padded(&mut [of_walls[0]].into_iter().chain(contacts.iter().copied()).chain([of_walls[1]]))
        };
        let of_walls =
            |number: fn(&Wall) -> f64| walls.map(|wall| if wall.is_there { number(wall) } else { 0.0 });
        let inverse_mass = padded(&mut chain.mass_kg.iter().map(|m| 1.0 / m));
        let stiffness = beside(&chain.stiffness, of_walls(|wall| wall.stiffness));
        let rest_m = beside(&chain.rest_overlap_m, of_walls(|wall| wall.rest_overlap_m));
        let rest_n = beside(&chain.rest_force_n, of_walls(|wall| wall.rest_force_n));
        let of_term = |term: &Term| {
            let of_wall = |side: usize| term.wall_stiffness[if chain.is_ring { 0 } else { side }];
            let there = [0, 1].map(|side| if walls[side].is_there { of_wall(side) } else { 0.0 });
            beside(&term.stiffness, there)
        };
        let terms: Vec<_> = chain.terms.iter().map(|term| (term.law.clone(), of_term(term))).collect();
        let contacts = Contacts {
            inverse_mass: &inverse_mass,
            stiffness: &stiffness,
            rest: [&rest_m, &rest_n],
            terms: &terms,
        };
        Self {
            arch,
            law: chain.law.clone(),
            count,
            ends: Ends { is_ring: chain.is_ring, have_wall: walls.map(|wall| wall.is_there) },
            constants: Constants::of(contacts),
            walls_m: vec![[PerLane::same(0.0); 2]],
            wall_forces_n: Vec::new(),
            sites: chain.sites.clone(),
            damped: Damped::of(chain, contacts),
            force: padded(&mut std::iter::empty()),
            presses: vec![false; with_room(count) / GROUP + 1],
            activity: Activity { beads: 0..0 },
            tile,
            inverse_mass,
            rest_n,
        }
    }

    /// Forgets the earlier forces and takes `activity` as the beads that may not be at rest. In a ring, which has no
    /// ends for a window, takes all beads.
    pub fn restart(&mut self, activity: Activity) {
        self.force.fill(0.0);
        self.presses.fill(false);
        self.activity = if self.ends.is_ring { Activity { beads: 0..self.count } } else { activity };
    }

    /// Puts the walls at these places (m).
    pub(crate) fn move_walls(&mut self, walls_m: [f64; 2]) {
        self.walls_m.clear();
        self.walls_m.push(walls_m.map(PerLane::same));
    }

    /// Sets the places of the walls (m) at each evaluation of forces in the next sweep.
    pub(crate) fn move_walls_along(&mut self, walls_m: impl Iterator<Item = [f64; 2]>) {
        self.walls_m.clear();
        self.walls_m.extend(walls_m.map(|walls_m| walls_m.map(PerLane::same)));
    }

    /// The forces (N) of the walls at each evaluation of the last sweep.
    pub(crate) fn wall_forces_n(&self) -> impl Fn(usize) -> [f64; 2] {
        |evaluation| self.wall_forces_n[evaluation].map(|force| force.0[0])
    }

    /// The springs, drag and resonators that act on beads beside their contacts.
    pub(crate) fn sites(&self) -> &Sites {
        &self.sites
    }

    /// `1/m` (1/kg) of each bead.
    pub(crate) fn inverse_mass(&self) -> &[f64] {
        &self.inverse_mass[..self.count]
    }

    /// Forces (N) of the contacts on the left and on the right of bead `bead`, evaluated last.
    pub(crate) fn forces_at(&self, bead: usize) -> [f64; 2] {
        [self.force[bead], self.force[bead + 1]]
    }

    /// The beads that may not be at rest.
    pub(crate) fn active_beads(&self) -> Range<usize> {
        self.activity.beads.clone()
    }

    /// The instruction set to compile loops for.
    pub(crate) fn arch(&self) -> Arch {
        self.arch
    }

    /// The active beads, with the forces evaluated last.
    pub(crate) fn pushed(&self) -> Pushed<'_> {
        let beads = self.active_beads();
        let (left, right) = self.forces_beside(&beads);
        let inverse_mass = &self.inverse_mass[beads.clone()];
        Pushed { beads, left, right, inverse_mass }
    }

    /// The first active bead whose displacement or velocity is not finite.
    pub fn first_non_finite(&self, u_m: &[f64], v_m_s: &[f64]) -> Option<usize> {
        let beads = self.activity.beads.clone();
        let (u, v) = (&u_m[beads.clone()], &v_m_s[beads.clone()]);
        // x·0 is NaN exactly where x is not finite, and a sum keeps a NaN
        let sum = vectorized(
            self.arch,
            #[inline(always)]
            || ordered_sum([u, v], |[u, v]| u * 0.0 + v * 0.0),
        );
        if sum == 0.0 {
            return None;
        }
        let found = u.iter().zip(v).position(|(u, v)| !(u.is_finite() && v.is_finite()));
        found.map(|i| beads.start + i)
    }

    /// Forces (N) of the contacts on the left and on the right of each of `beads`.
    pub(crate) fn forces_beside(&self, beads: &Range<usize>) -> (&[f64], &[f64]) {
        (&self.force[beads.clone()], &self.force[beads.start + 1..=beads.end])
    }
}
