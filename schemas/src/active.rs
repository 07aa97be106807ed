//! The beads that a frame may differ from rest in, so that nobody need visit the others.

use crate::chain::Chain;
use std::ops::Range;

/// Neighbouring beads, from `first` up to but without `end`, which may differ from rest: all others have displacements and velocities of +0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Active {
    /// The first of them.
    pub first: usize,
    /// The bead behind the last of them.
    pub end: usize,
}

impl Active {
    /// All of `count` beads.
    pub fn all(count: usize) -> Self {
        Self { first: 0, end: count }
    }

    /// Those of a state that nobody says them of: a search from both ends, which is faster than most of what it saves, finds them to a few dozen.
    pub fn of(u_m: &[f64], v_m_s: &[f64]) -> Self {
        const BLOCK: usize = 64;
        let rests = |(u_m, v_m_s): &(&[f64], &[f64])| {
            let bits = |values: &[f64]| values.iter().fold(0, |bits, value| bits | value.to_bits());
            bits(u_m) | bits(v_m_s) == 0
        };
        let blocks = u_m.chunks(BLOCK).zip(v_m_s.chunks(BLOCK));
        let first = blocks.clone().take_while(rests).count();
        let end = blocks.len() - blocks.rev().take_while(rests).count();
        let bead = |block: usize| (block * BLOCK).min(u_m.len()); // integers
        Self { first: bead(first), end: bead(end.max(first)) } // integers
    }

    /// The least neighbouring beads that take in these and `other`.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self { first: self.first.min(other.first), end: self.end.max(other.end) } // integers
    }

    /// The beads of `beads` that an [`ordered_sum`](crate::simd::ordered_sum) over them need visit where the others give 0: it adds the
    /// same numbers in the same order.
    pub fn within(self, beads: Range<usize>) -> Range<usize> {
        let start = beads.start + self.first.saturating_sub(beads.start) / 8 * 8;
        let start = start.min(beads.end); // integers
        start..self.end.clamp(start, beads.end) // integers
    }

    /// The contacts of these beads in a chain of `contacts` contacts, as if they were beads.
    #[must_use]
    pub fn contacts(self, contacts: usize) -> Self {
        Self { first: self.first.saturating_sub(1).min(contacts), end: self.end.min(contacts) } // integers
    }

    /// Makes these the beads of the next frame, `next`, and gives the places of values that are kept from frame to frame and may change:
    /// the values of all others were those at rest, and are.
    #[must_use]
    pub fn renew(&mut self, next: Self) -> Self {
        std::mem::replace(self, next).with(next)
    }
}

/// Potential energies of the contacts of a chain, kept from frame to frame: those at rest are not computed again.
#[derive(Debug, Clone)]
pub struct ContactEnergies {
    energy_j: Vec<f64>,
    /// The beads of the last frame.
    seen: Active,
}

impl ContactEnergies {
    /// Those of `chain` at rest: none.
    pub fn new(chain: &Chain) -> Self {
        Self { energy_j: vec![0.0; chain.contact_count()], seen: Active::all(0) }
    }

    /// Takes the displacements `u_m` (m) of the next frame, in which no beads but `active` are displaced.
    pub fn renew(&mut self, chain: &Chain, u_m: &[f64], active: Active) {
        let count = self.energy_j.len();
        let contacts = self.seen.renew(active).contacts(count).within(0..count);
        chain.energies_of_contacts_j(u_m, contacts, &mut self.energy_j);
    }

    /// The energy (J) of each contact, N − 1 values.
    pub fn values_j(&self) -> &[f64] {
        &self.energy_j
    }
}
