//! Kicks, drifts and contact forces, over the part of the chain that has ever moved.
//!
//! Architecture invariant: a bead is skipped only where the full step would return the bits it already has. Outside
//! the [`Activity`] window displacement and velocity are zero, every contact has its force at rest, which is
//! subtracted in the form in which it was computed, and a kick or a drift adds exactly zero.

mod constants;
mod group;
mod held;
mod layout;
mod moving;
mod sweep;

use crate::aligned::{Aligned, with_room};
use constants::{Constants, Contacts, Springs};
pub(crate) use layout::{Along, Layout, PerLane, lanes, right};
use layout::{GROUP, narrower};
use moving::Damped;
pub(crate) use moving::Motion;
use pulp::Arch;
use schemas::chain::Chain;
use schemas::contact::{BLOCK, ContactLaw};
use schemas::simd::{ordered_sum, vectorized};
use schemas::sites::Sites;
use std::ops::Range;
use sweep::{Ends, Shaken};
pub(crate) use sweep::{Pass, Shake, TILE};

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

    /// This window, widened over `beads`.
    fn over(self, beads: &Range<usize>) -> Self {
        if beads.is_empty() { self } else { self.with(beads.start).with(beads.end - 1) }
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
    /// The instruction set of sweeps.
    arch_of_sweeps: Arch,
    law: ContactLaw,
    /// Number of beads.
    count: usize,
    /// Numbers of a bead: one, or one for each lane of a register, in which chains lie beside each other.
    width: usize,
    ends: Ends,
    inverse_mass: Aligned,
    /// Force (N) at rest of each contact.
    rest_n: Aligned,
    constants: Constants,
    /// The places of the walls (m) at each evaluation of forces in a sweep; the last entry serves for all further
    /// evaluations.
    walls_m: Vec<[PerLane; 2]>,
    /// The forces (N) of both walls at each evaluation of the last sweep; none of walls that stand still in it.
    wall_forces_n: Vec<[PerLane; 2]>,
    /// Displacements (m) at each evaluation of the last sweep, in rows, of those that it went over; zeros elsewhere. None unless they are kept.
    places_m: Aligned,
    keeps_places: bool,
    sites: Sites,
    damped: Option<Damped>,
    /// Force (N), beyond the force at rest, of each contact.
    force: Aligned,
    /// True for each group in which a contact presses more than at rest.
    presses: Vec<bool>,
    activity: Activity,
    /// Beads that baths and forces may set in motion, and their groups.
    shaken_beads: Activity,
    shaken: Shaken,
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
        Self::of(&[chain], 1, arch, tile)
    }

    /// A kernel for chains beside each other, as many as a register has lanes or fewer. They have the number of beads, the ends and the
    /// laws in common, and no forces but those of contacts and of springs at each place.
    pub(crate) fn of_many(chains: &[&Chain], arch: Arch) -> Self {
        let width = lanes(arch);
        Self::of(chains, width, arch, TILE / width)
    }

    /// A kernel for `chains` of `width` numbers a bead; the numbers of lanes without a chain are zeros.
    fn of(chains: &[&Chain], width: usize, arch: Arch, tile: usize) -> Self {
        let chain = chains[0];
        let (count, ends) = (chain.bead_count(), [0, usize::from(!chain.is_ring)]);
        let padded = |numbers: &dyn Fn(&Chain, usize) -> f64, of_each: usize| {
            let mut all = Aligned::zeros(with_room(count * width) + BLOCK);
            for (lane, chain) in chains.iter().enumerate() {
                for place in 0..of_each {
                    all[place * width + lane] = numbers(chain, place);
                }
            }
            all
        };
        // of the contact on the left of each bead, and of the one behind the last
        let beside = |contacts: &dyn Fn(&Chain) -> &[f64], of_wall: &dyn Fn(&Chain, usize) -> f64| {
            let number = |chain: &Chain, place: usize| match place {
                0 if chain.wall(ends[0]).is_there => of_wall(chain, ends[0]),
                last if last == count && chain.wall(ends[1]).is_there => of_wall(chain, ends[1]),
                place if place > 0 && place < count => contacts(chain)[place - 1],
                _ => 0.0,
            };
            padded(&number, count + 1)
        };
        let inverse_mass = padded(&|chain, bead| 1.0 / chain.mass_kg[bead], count);
        let stiffness = beside(&|chain| &chain.stiffness, &|chain, side| chain.wall(side).stiffness);
        let rest_m = beside(&|chain| &chain.rest_overlap_m, &|chain, side| chain.wall(side).rest_overlap_m);
        let rest_n = beside(&|chain| &chain.rest_force_n, &|chain, side| chain.wall(side).rest_force_n);
        let of_term = |term: usize| {
            let of_wall = |chain: &Chain, side: usize| chain.terms[term].wall_stiffness[side];
            beside(&|chain| &chain.terms[term].stiffness, &of_wall)
        };
        let laws = chain.terms.iter().map(|term| term.law.clone()).enumerate();
        let terms: Vec<_> = laws.map(|(term, law)| (law, of_term(term))).collect();
        let springs = match &chain.sites {
            // resonators pull at the same time: see `with_drives`
            sites if sites.has_resonators() || !sites.has_springs() => Springs::None,
            sites if sites.cubic_n_per_m3.is_empty() => Springs::Linear,
            _ => Springs::Cubic,
        };
        let of_springs = |constants: &dyn Fn(&Sites) -> &[f64]| match springs {
            Springs::None => Aligned::zeros(0),
            _ => padded(&|chain, bead| constants(&chain.sites).get(bead).copied().unwrap_or(0.0), count),
        };
        let (linear, cubic) =
            (of_springs(&|sites| &sites.linear_n_per_m), of_springs(&|sites| &sites.cubic_n_per_m3));
        let contacts = Contacts {
            arch,
            inverse_mass: &inverse_mass,
            stiffness: &stiffness,
            rest: [&rest_m, &rest_n],
            terms: &terms,
            springs: (springs, [&linear, &cubic]),
        };
        let constants = Constants::of(contacts);
        // a slow root of fewer numbers comes sooner, and a short chain waits for it
        let waits_for_roots = width == 1 && count <= 32 && constants.has_law && chain.law.has_slow_roots();
        Self {
            arch,
            arch_of_sweeps: if waits_for_roots { narrower(arch) } else { arch },
            law: chain.law.clone(),
            count,
            width,
            ends: Ends { is_ring: chain.is_ring, have_wall: ends.map(|side| chain.wall(side).is_there) },
            constants,
            walls_m: vec![[PerLane::same(0.0); 2]],
            wall_forces_n: Vec::new(),
            places_m: Aligned::zeros(0),
            keeps_places: false,
            sites: chain.sites.clone(),
            damped: Damped::of(chain, contacts),
            force: Aligned::zeros(inverse_mass.len()),
            presses: vec![false; with_room(count * width) / GROUP + 1],
            activity: Activity { beads: 0..0 },
            shaken_beads: Activity { beads: 0..0 },
            shaken: Shaken::default(),
            tile,
            inverse_mass,
            rest_n,
        }
    }

    /// Forgets the earlier forces and takes the beads whose numbers are in `activity` as those that may not be at rest. In a ring, which
    /// has no ends for a window, takes all beads.
    pub fn restart(&mut self, activity: Activity) {
        self.force.fill(0.0);
        self.presses.fill(false);
        self.places_m = Aligned::zeros(0);
        let Activity { beads: numbers } = activity;
        let beads = numbers.start / self.width..numbers.end.div_ceil(self.width);
        let activity = Activity { beads: if self.ends.is_ring { 0..self.count } else { beads } };
        self.activity = activity.over(&self.shaken_beads.beads);
    }

    /// Takes `beads` as those that may not be at rest at any time, from the next start on.
    pub(crate) fn shake(&mut self, beads: &Range<usize>) {
        self.shaken_beads = self.shaken_beads.clone().over(beads);
        self.shaken.add(beads.start * self.width..beads.end * self.width);
    }

    /// Does so for one bead, on which a force acts in each kick.
    pub(crate) fn push(&mut self, bead: usize) {
        self.shake(&(bead..bead + 1));
        self.shaken.in_each_kick = true;
    }

    /// Puts the walls at these places (m).
    pub(crate) fn move_walls(&mut self, walls_m: [f64; 2]) {
        self.walls_m.clear();
        self.walls_m.push(walls_m.map(PerLane::same));
        self.wall_forces_n.clear();
    }

    /// Sets the places of the walls (m) at each evaluation of forces in the next sweep, which keeps their forces.
    pub(crate) fn move_walls_along(&mut self, walls_m: impl Iterator<Item = [f64; 2]>) {
        self.walls_m.clear();
        self.walls_m.extend(walls_m.map(|walls_m| walls_m.map(PerLane::same)));
        self.wall_forces_n.clear();
        self.wall_forces_n.resize(self.walls_m.len(), [PerLane::same(0.0); 2]);
    }

    /// The forces (N) of the walls at each evaluation of the last sweep, if they [moved](Self::move_walls_along).
    pub(crate) fn wall_forces_n(&self) -> impl Fn(usize) -> [f64; 2] {
        |evaluation| self.wall_forces_n[evaluation].map(|force| force.0[0])
    }

    /// Keeps the displacements at all evaluations of each sweep.
    pub(crate) fn keep_places(&mut self) {
        self.keeps_places = true;
    }

    /// The displacements (m) at an evaluation of the last sweep, if they are kept.
    pub(crate) fn places_m(&self, evaluation: usize) -> &[f64] {
        &self.places_m[evaluation * self.force.len()..][..self.count]
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

    /// Forces (N) of the contacts at both ends, evaluated last.
    pub(crate) fn forces_at_ends(&self) -> [f64; 2] {
        [self.force[0], self.force[self.count]]
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
