//! Kicks, drifts and contact forces, over the part of the chain that has ever moved.
//!
//! Architecture invariant: a bead is skipped only where the full step would return the bits it already has. Outside
//! the [`Activity`] window displacement and velocity are zero, every contact has its force at rest, which is
//! subtracted in the form in which it was computed, and a kick or a drift adds exactly zero.

mod moving;
mod sweep;

use crate::aligned::aligned;
use aligned_vec::{AVec, CACHELINE_ALIGN, avec};
use moving::Damped;
pub(crate) use moving::Motion;
use pulp::Arch;
use schemas::chain::{Chain, Walls};
use schemas::contact::{BLOCK, ContactLaw};
use schemas::simd::{ordered_sum, vectorized};
use schemas::sites::Sites;
use schemas::term::Term;
use std::ops::Range;
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

/// The static equilibrium of a loaded chain, N − 1 values each.
#[derive(Debug, Clone)]
struct Rest {
    overlap_m: Vec<f64>,
    force_n: Vec<f64>,
}

/// The arrays of a chain in the form in which the kernel uses them.
#[derive(Debug, Clone)]
pub struct Kernel {
    arch: Arch,
    law: ContactLaw,
    inverse_mass: AVec<f64>,
    stiffness: AVec<f64>,
    /// The static equilibrium, if the chain is loaded.
    rest: Option<Rest>,
    walls: Walls,
    /// The places of the walls (m) at each evaluation of forces in a sweep; the last entry serves for all further
    /// evaluations.
    walls_m: Vec<[f64; 2]>,
    /// The forces (N) of both walls at each evaluation of the last sweep.
    wall_forces_n: Vec<[f64; 2]>,
    terms: Vec<Term>,
    sites: Sites,
    is_ring: bool,
    damped: Option<Damped>,
    /// Scratch space for the evaluation of moving contacts, N + 1 values each, or none.
    scratch: [Vec<f64>; 2],
    /// Force (N), beyond the force at rest, of contact `c` at index `c + 1`; at both ends the forces of the walls.
    force: AVec<f64>,
    /// True for each block in which a contact presses more than at rest. The contact of the last bead with its wall is
    /// in the last block.
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
        let rest = || Rest { overlap_m: chain.rest_overlap_m.clone(), force_n: chain.rest_force_n.clone() };
        Self {
            arch,
            law: chain.law.clone(),
            inverse_mass: AVec::from_iter(CACHELINE_ALIGN, chain.mass_kg.iter().map(|m| 1.0 / m)),
            stiffness: aligned(&chain.stiffness),
            rest: (chain.is_loaded() || !chain.terms.is_empty()).then(rest),
            walls: chain.walls,
            walls_m: vec![[0.0; 2]],
            wall_forces_n: Vec::new(),
            terms: chain.terms.clone(),
            sites: chain.sites.clone(),
            is_ring: chain.is_ring,
            damped: Damped::of(chain),
            scratch: [Vec::new(), Vec::new()],
            force: avec![0.0; chain.bead_count() + 1],
            presses: vec![false; chain.bead_count().div_ceil(BLOCK)],
            activity: Activity { beads: 0..0 },
            tile,
        }
    }

    /// Forgets the earlier forces and takes `activity` as the beads that may not be at rest. In a ring, which has no
    /// ends for a window, takes all beads.
    pub fn restart(&mut self, activity: Activity) {
        self.force.fill(0.0);
        self.presses.fill(false);
        self.activity = if self.is_ring { Activity { beads: 0..self.inverse_mass.len() } } else { activity };
    }

    /// Puts the walls at these places (m).
    pub(crate) fn move_walls(&mut self, walls_m: [f64; 2]) {
        self.walls_m.clear();
        self.walls_m.push(walls_m);
    }

    /// Sets the places of the walls (m) at each evaluation of forces in the next sweep.
    pub(crate) fn move_walls_along(&mut self, walls_m: impl Iterator<Item = [f64; 2]>) {
        self.walls_m.clear();
        self.walls_m.extend(walls_m);
    }

    /// The forces (N) of the walls at each evaluation of the last sweep.
    pub(crate) fn wall_forces_n(&self) -> &[[f64; 2]] {
        &self.wall_forces_n
    }

    /// True if each bead depends on nothing but its two contacts, which sweeps by tiles need.
    pub(crate) fn is_local(&self) -> bool {
        self.sites.is_none() && !self.is_ring
    }

    /// The springs, drag and resonators that act on beads beside their contacts.
    pub(crate) fn sites(&self) -> &Sites {
        &self.sites
    }

    /// `1/m` (1/kg) of each bead.
    pub(crate) fn inverse_mass(&self) -> &[f64] {
        &self.inverse_mass
    }

    /// Forces (N) of the contacts on the left and on the right of bead `bead`, evaluated last.
    pub(crate) fn forces_at(&self, bead: usize) -> [f64; 2] {
        [self.force[bead], self.force[bead + 1]]
    }

    /// The beads that may not be at rest.
    pub(crate) fn active_beads(&self) -> Range<usize> {
        self.activity.beads.clone()
    }

    /// The contacts that touch one of `beads`: contact c joins beads c and c + 1.
    fn contacts_of(&self, beads: &Range<usize>) -> Range<usize> {
        beads.start.saturating_sub(1)..beads.end.min(self.stiffness.len()) // integers
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
