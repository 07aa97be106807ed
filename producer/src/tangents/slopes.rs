//! Slopes of the forces along a run.

use schemas::chain::Chain;
use schemas::contact::BLOCK;
use schemas::sites::Sites;
use schemas::term::TermLaw;
use std::ops::Range;

/// Slopes dF/dδ (N/m) of all contacts, and of the springs that hold the beads, at displacements of the chain.
#[derive(Debug, Clone)]
pub(crate) struct Slopes {
    /// Each law, and its stiffness in each contact. Of `N + 1` contacts the first is that on the left of bead 0, or the one that closes a
    /// ring, which is the last one, too. This and the other arrays of contacts are filled up with zeros to whole blocks.
    laws: Vec<(TermLaw, Vec<f64>)>,
    rest_m: Vec<f64>,
    have_wall: [bool; 2],
    is_ring: bool,
    sites: Sites,
    overlap_m: Vec<f64>,
    force_n: Vec<f64>,
    /// Slopes of the contacts, `N + 1` numbers and more.
    pub(crate) contacts: Vec<f64>,
    /// Slopes of the springs that hold the beads, N numbers or none.
    pub(crate) springs: Vec<f64>,
}

impl Slopes {
    pub(crate) fn of(chain: &Chain) -> Self {
        let ends = [0, usize::from(!chain.is_ring)];
        let beside = |contacts: &[f64], walls: [f64; 2]| {
            let walls = ends.map(|side| if chain.wall(side).is_there { walls[side] } else { 0.0 });
            let mut all = [&walls[..1], contacts, &walls[1..]].concat();
            all.resize(all.len().next_multiple_of(BLOCK), 0.0);
            all
        };
        let of_walls = [0, 1].map(|side| chain.wall(side).stiffness);
        let mut laws = vec![(TermLaw::Power(chain.law.clone()), beside(&chain.stiffness, of_walls))];
        let terms = chain.terms.iter();
        laws.extend(terms.map(|term| (term.law.clone(), beside(&term.stiffness, term.wall_stiffness))));
        // bonds have no stiffness of the law
        laws.retain(|(_, stiffness)| stiffness.iter().any(|k| *k != 0.0));
        let contacts = (chain.bead_count() + 1).next_multiple_of(BLOCK);
        Self {
            laws,
            rest_m: beside(&chain.rest_overlap_m, [0, 1].map(|side| chain.wall(side).rest_overlap_m)),
            have_wall: ends.map(|side| chain.wall(side).is_there),
            is_ring: chain.is_ring,
            overlap_m: vec![0.0; contacts],
            force_n: vec![0.0; contacts],
            contacts: vec![0.0; contacts],
            springs: vec![0.0; chain.sites.linear_n_per_m.len()],
            sites: chain.sites.clone(),
        }
    }

    /// Finds those of `beads`, their contacts and the springs that hold them, and of the contacts at the ends, where the beads are at `u_m`
    /// and the walls at `walls_m` (m). Call it through [`vectorized`](schemas::simd::vectorized).
    #[inline(always)]
    pub(crate) fn find(&mut self, u_m: &[f64], walls_m: [f64; 2], beads: &Range<usize>) {
        let last = u_m.len() - 1;
        let first = if beads.start == 0 { 1 } else { beads.start };
        let between = first..if beads.end > last { last + 1 } else { beads.end + 1 };
        let (u_m, rest_m) = (&u_m[..=last], &self.rest_m[..last + 2]);
        for c in between.clone() {
            self.overlap_m[c] = (u_m[c - 1] - u_m[c]) + rest_m[c];
        }
        let approaches_m = if self.is_ring {
            [u_m[last] - u_m[0]; 2]
        } else {
            [walls_m[0] - u_m[0], u_m[last] - walls_m[1]]
        };
        for (side, contact) in [(0, 0), (1, last + 1)] {
            self.overlap_m[contact] =
                if self.have_wall[side] { approaches_m[side] + rest_m[contact] } else { 0.0 };
        }
        if between.len() == last {
            self.find_by_overlap(&(0..self.contacts.len()));
        } else {
            for part in [between, 0..1, last + 1..last + 2] {
                self.find_by_overlap(&part);
            }
        }
        let (linear, cubic) = (&self.sites.linear_n_per_m, &self.sites.cubic_n_per_m3);
        if cubic.is_empty() {
            self.springs.copy_from_slice(linear);
        } else {
            for i in beads.clone() {
                self.springs[i] = linear[i] + 3.0 * cubic[i] * (u_m[i] * u_m[i]);
            }
        }
    }

    #[inline(always)]
    fn find_by_overlap(&mut self, contacts: &Range<usize>) {
        let (slope, force_n) = (&mut self.contacts[contacts.clone()], &mut self.force_n[contacts.clone()]);
        let overlap_m = &self.overlap_m[contacts.clone()];
        slope.fill(0.0);
        for (law, stiffness) in &self.laws {
            let stiffness = &stiffness[contacts.clone()];
            law.forces(stiffness, overlap_m, force_n);
            law.add_slopes(stiffness, overlap_m, force_n, slope);
        }
    }
}
