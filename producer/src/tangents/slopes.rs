//! Slopes of the forces along a run.

use crate::aligned::Padded;
use crate::kernel::Motion;
use pulp::{Arch, Simd, WithSimd};
use schemas::chain::Chain;
use schemas::contact::BLOCK;
use schemas::damping::{ContactDamping, Factor};
use schemas::simd::{Group, in_vectors};
use schemas::sites::Sites;
use schemas::term::TermLaw;
use std::ops::Range;

/// Contacts in registers at a time.
const GROUP: usize = 16;

/// Contacts that are looked at together.
const TOGETHER: usize = 256;

/// Slopes dF/dδ (N/m) of all contacts, and of the springs that hold the beads, at displacements of the chain.
#[derive(Debug, Clone)]
pub(crate) struct Slopes {
    /// Each law, and its stiffness in each contact. Of `N + 1` contacts the first is that on the left of bead 0, or the one that closes a
    /// ring, which is the last one, too. This and the other arrays of contacts are filled up with zeros to whole blocks.
    laws: Vec<(TermLaw, Padded)>,
    beads: usize,
    rest_m: Padded,
    have_wall: [bool; 2],
    is_ring: bool,
    sites: Sites,
    overlap_m: Padded,
    /// Slopes of the contacts, `N + 1` numbers and more.
    pub(crate) contacts: Padded,
    /// Slopes of the springs that hold the beads, N numbers or none.
    pub(crate) springs: Vec<f64>,
    damped: Option<Damped>,
    /// dF/d(dδ/dt) (N·s/m) of the contacts, as many as slopes; none without damping.
    pub(crate) rates: Vec<f64>,
}

/// The damping of contacts.
#[derive(Debug, Clone)]
struct Damped {
    /// η of each contact, in the order of the slopes.
    coefficient: Padded,
    /// p of the factor δ^p.
    exponent: f64,
    factor: Factor,
    /// The law of δ^q, from which the factor is made.
    raised: TermLaw,
    raised_by: Vec<f64>,
    /// Sum of the elastic forces (N).
    elastic_n: Vec<f64>,
    /// Bonds are never cut.
    is_bonded: bool,
    zero_up_to_m: f64,
}

impl Damped {
    fn of(chain: &Chain, beside: impl Fn(&[f64], [f64; 2]) -> Padded) -> Option<Self> {
        let ContactDamping { kind, coefficient, wall_coefficient } = chain.damping.as_ref()?;
        let coefficient = beside(coefficient, *wall_coefficient);
        let zeros = vec![0.0; coefficient.len()];
        Some(Self {
            exponent: kind.exponent(chain.law.alpha()),
            factor: kind.factor(),
            raised: TermLaw::Power(kind.raised(chain.law.alpha()).unwrap_or_else(|| chain.law.clone())),
            raised_by: zeros.clone(),
            elastic_n: zeros,
            is_bonded: chain.is_bonded,
            zero_up_to_m: chain.law.zero_up_to_m(),
            coefficient,
        })
    }
}

impl Damped {
    /// Adds the damping of contact `c` to its slopes by the overlap and by its rate.
    #[inline(always)]
    fn add(&self, c: usize, overlap_m: f64, rate_m_s: f64, [slope, rate]: [&mut f64; 2]) {
        let is_closed = self.is_bonded || overlap_m > self.zero_up_to_m;
        let factor =
            if is_closed { self.coefficient[c] * self.factor.at(self.raised_by[c], overlap_m) } else { 0.0 };
        // a contact never pulls
        if !is_closed || !self.is_bonded && self.elastic_n[c] + factor * rate_m_s <= 0.0 {
            (*slope, *rate) = (0.0, 0.0);
            return;
        }
        if self.exponent > 0.0 {
            *slope += self.exponent * factor / overlap_m * rate_m_s;
        }
        *rate = factor;
    }

    /// True if a contact whose damping has no bounded slope there has closed or opened since `closed`, which becomes what is now.
    fn jumps(&self, overlap_m: &[f64], closed: &mut Vec<bool>) -> bool {
        if self.is_bonded || self.exponent >= 1.0 {
            return false;
        }
        let is_closed =
            |(overlap, coefficient): (&f64, &f64)| *coefficient > 0.0 && *overlap > self.zero_up_to_m;
        let now: Vec<bool> = overlap_m.iter().zip(self.coefficient.iter()).map(is_closed).collect();
        let has_jumped = !closed.is_empty() && *closed != now;
        *closed = now;
        has_jumped
    }
}

impl Slopes {
    pub(crate) fn of(chain: &Chain) -> Self {
        let ends = [0, usize::from(!chain.is_ring)];
        let beside = |contacts: &[f64], walls: [f64; 2]| {
            let walls = ends.map(|side| if chain.wall(side).is_there { walls[side] } else { 0.0 });
            let mut all = [&walls[..1], contacts, &walls[1..]].concat();
            all.resize(all.len().next_multiple_of(BLOCK), 0.0);
            Padded::of(&all)
        };
        let of_walls = [0, 1].map(|side| chain.wall(side).stiffness);
        let mut laws = vec![(TermLaw::Power(chain.law.clone()), beside(&chain.stiffness, of_walls))];
        let terms = chain.terms.iter();
        laws.extend(terms.map(|term| (term.law.clone(), beside(&term.stiffness, term.wall_stiffness))));
        // bonds have no stiffness of the law
        laws.retain(|(_, stiffness)| stiffness.iter().any(|k| *k != 0.0));
        let contacts = (chain.bead_count() + 1).next_multiple_of(BLOCK);
        let damped = Damped::of(chain, beside);
        Self {
            laws,
            beads: chain.bead_count(),
            rest_m: beside(&chain.rest_overlap_m, [0, 1].map(|side| chain.wall(side).rest_overlap_m)),
            have_wall: ends.map(|side| chain.wall(side).is_there),
            is_ring: chain.is_ring,
            overlap_m: Padded::zeros(contacts),
            contacts: Padded::zeros(contacts),
            springs: vec![0.0; chain.sites.linear_n_per_m.len()],
            sites: chain.sites.clone(),
            rates: damped.as_ref().map_or_else(Vec::new, |_| vec![0.0; contacts]),
            damped,
        }
    }

    /// Finds those of `beads`, their contacts and the springs that hold them, and of the contacts at the ends, where the beads are at `u_m`
    /// and the walls at `walls_m` (m).
    pub(crate) fn find(&mut self, arch: Arch, u_m: &[f64], walls_m: [f64; 2], beads: &Range<usize>) {
        in_vectors(arch, Find { slopes: self, u_m, walls_m, beads });
    }

    #[inline(always)]
    fn find_in<S: Simd>(&mut self, simd: S, u_m: &[f64], walls_m: [f64; 2], beads: &Range<usize>) {
        let last = u_m.len() - 1;
        let first = if beads.start == 0 { 1 } else { beads.start };
        let between = first..if beads.end > last { last + 1 } else { beads.end + 1 };
        let approaches_m = if self.is_ring {
            [u_m[last] - u_m[0]; 2]
        } else {
            [walls_m[0] - u_m[0], u_m[last] - walls_m[1]]
        };
        for (side, contact) in [(0, 0), (1, last + 1)] {
            self.overlap_m[contact] =
                if self.have_wall[side] { approaches_m[side] + self.rest_m[contact] } else { 0.0 };
        }
        let mut start = between.start;
        while start < between.end {
            // what is together in the first cache, from a whole group on
            let end = (start + 1).next_multiple_of(TOGETHER);
            let part = start..if end < between.end { end } else { between.end };
            let (of_left, of_right) = (&u_m[part.start - 1..part.end - 1], &u_m[part.clone()]);
            let (rest_m, overlap_m) = (&self.rest_m[part.clone()], &mut self.overlap_m[part.clone()]);
            for (c, overlap_m) in overlap_m.iter_mut().enumerate() {
                *overlap_m = (of_left[c] - of_right[c]) + rest_m[c];
            }
            start = part.end;
            self.find_by_overlap(simd, &part);
        }
        for part in [0..1, last + 1..last + 2] {
            let found = between.start / GROUP..between.end.div_ceil(GROUP);
            if between.is_empty() || !found.contains(&(part.start / GROUP)) {
                self.find_by_overlap(simd, &part);
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

    /// Finds those of the whole chain in this motion, with the rates of damped contacts. `closed` remembers which of these are
    /// closed; true if one has closed or opened since, where its force jumps or its slope has no bound.
    pub(crate) fn find_moving(&mut self, arch: Arch, motion: &Motion<'_>, closed: &mut Vec<bool>) -> bool {
        let (u_m, v_m_s) = (&motion.u_m[..self.beads], &motion.v_m_s[..self.beads]);
        self.find(arch, u_m, motion.walls_m, &(0..self.beads));
        let Some(damped) = &mut self.damped else { return false };
        let overlap_m = &self.overlap_m[..];
        in_vectors(arch, Elastic { damped, laws: &self.laws, overlap_m });
        let last = self.beads - 1;
        let ends_m_s = if self.is_ring {
            [v_m_s[last] - v_m_s[0]; 2]
        } else {
            [motion.walls_m_s[0] - v_m_s[0], v_m_s[last] - motion.walls_m_s[1]]
        };
        for c in 0..=self.beads {
            let rate_m_s = match c {
                0 => ends_m_s[0],
                _ if c == self.beads => ends_m_s[1],
                _ => v_m_s[c - 1] - v_m_s[c],
            };
            damped.add(c, overlap_m[c], rate_m_s, [&mut self.contacts[c], &mut self.rates[c]]);
        }
        damped.jumps(overlap_m, closed)
    }

    /// Finds those of the groups that have one of `contacts`.
    #[inline(always)]
    fn find_by_overlap<S: Simd>(&mut self, simd: S, contacts: &Range<usize>) {
        let groups = contacts.start / GROUP..contacts.end.div_ceil(GROUP);
        let overlap_m = &self.overlap_m.as_chunks::<GROUP>().0[groups.clone()];
        let slopes = &mut self.contacts.as_chunks_mut().0[groups.clone()];
        slopes.as_flattened_mut().fill(0.0);
        for (law, stiffness) in &self.laws {
            law.add_slopes(simd, [&stiffness.as_chunks().0[groups.clone()], overlap_m], slopes);
        }
    }
}

/// Slopes to be found: see [`Slopes::find`].
struct Find<'a> {
    slopes: &'a mut Slopes,
    u_m: &'a [f64],
    walls_m: [f64; 2],
    beads: &'a Range<usize>,
}

impl WithSimd for Find<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.slopes.find_in(simd, self.u_m, self.walls_m, self.beads);
    }
}

/// The forces of damped contacts without their damping, and the power that their damping is made of.
struct Elastic<'a> {
    damped: &'a mut Damped,
    laws: &'a [(TermLaw, Padded)],
    overlap_m: &'a [f64],
}

impl WithSimd for Elastic<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Damped { elastic_n, raised_by, raised, .. } = self.damped;
        let found = elastic_n.as_chunks_mut().0.iter_mut().zip(raised_by.as_chunks_mut().0);
        for (group, (overlap_m, found)) in self.overlap_m.as_chunks().0.iter().zip(found).enumerate() {
            let (overlap_m, mut sums) = (Group::<GROUP>(*overlap_m), [Group([0.0; GROUP]); 2]);
            for (law, stiffness) in self.laws {
                law.add_to(simd, &stiffness.as_chunks().0[group], &overlap_m, &mut sums[0]);
            }
            raised.add_to(simd, &[1.0; GROUP], &overlap_m, &mut sums[1]);
            (*found.0, *found.1) = (sums[0].0, sums[1].0);
        }
    }
}
