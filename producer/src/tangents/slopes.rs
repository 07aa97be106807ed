//! Slopes of the forces along a run.

use schemas::chain::Chain;
use schemas::sites::Sites;
use schemas::term::TermLaw;

/// Slopes dF/dδ (N/m) of all contacts, and of the springs that hold the beads, at displacements of the chain.
#[derive(Debug, Clone)]
pub(super) struct Slopes {
    /// Each law, and its stiffness in each contact. Of `N + 1` contacts the first is that on the left of bead 0, or the one that closes a
    /// ring, which is the last one, too.
    laws: Vec<(TermLaw, Vec<f64>)>,
    rest_m: Vec<f64>,
    have_wall: [bool; 2],
    is_ring: bool,
    sites: Sites,
    overlap_m: Vec<f64>,
    force_n: Vec<f64>,
    /// Slopes of the contacts, `N + 1` numbers.
    pub(super) contacts: Vec<f64>,
    /// Slopes of the springs that hold the beads, N numbers or none.
    pub(super) springs: Vec<f64>,
}

impl Slopes {
    pub(super) fn of(chain: &Chain) -> Self {
        let ends = [0, usize::from(!chain.is_ring)];
        let beside = |contacts: &[f64], walls: [f64; 2]| {
            let walls = ends.map(|side| if chain.wall(side).is_there { walls[side] } else { 0.0 });
            [&walls[..1], contacts, &walls[1..]].concat()
        };
        let of_walls = [0, 1].map(|side| chain.wall(side).stiffness);
        let mut laws = vec![(TermLaw::Power(chain.law.clone()), beside(&chain.stiffness, of_walls))];
        let terms = chain.terms.iter();
        laws.extend(terms.map(|term| (term.law.clone(), beside(&term.stiffness, term.wall_stiffness))));
        // bonds have no stiffness of the law
        laws.retain(|(_, stiffness)| stiffness.iter().any(|k| *k != 0.0));
        let contacts = chain.bead_count() + 1;
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

    /// Finds them where the beads are at `u_m` and the walls at `walls_m` (m). Call it through
    /// [`vectorized`](schemas::simd::vectorized).
    #[inline(always)]
    pub(super) fn find(&mut self, u_m: &[f64], walls_m: [f64; 2]) {
        let last = u_m.len() - 1;
        let (overlap_m, rest_m) = (&mut self.overlap_m[..last + 2], &self.rest_m[..last + 2]);
        for c in 0..last {
            overlap_m[c + 1] = (u_m[c] - u_m[c + 1]) + rest_m[c + 1];
        }
        let approaches_m = if self.is_ring {
            [u_m[last] - u_m[0]; 2]
        } else {
            [walls_m[0] - u_m[0], u_m[last] - walls_m[1]]
        };
        for (side, contact) in [(0, 0), (1, last + 1)] {
            overlap_m[contact] =
                if self.have_wall[side] { approaches_m[side] + rest_m[contact] } else { 0.0 };
        }
        let (slope, force_n) = (&mut self.contacts[..last + 2], &mut self.force_n[..last + 2]);
        slope.fill(0.0);
        for (law, stiffness) in &self.laws {
            law.forces(stiffness, overlap_m, force_n);
            for c in 0..slope.len() {
                slope[c] += law.tangent_by_force(stiffness[c], overlap_m[c], force_n[c]);
            }
        }
        let (linear, cubic) = (&self.sites.linear_n_per_m, &self.sites.cubic_n_per_m3);
        if cubic.is_empty() {
            self.springs.copy_from_slice(linear);
        } else {
            for i in 0..self.springs.len() {
                self.springs[i] = linear[i] + 3.0 * cubic[i] * (u_m[i] * u_m[i]);
            }
        }
    }
}
