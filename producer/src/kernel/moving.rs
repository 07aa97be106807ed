//! Contacts of moving beads, with forces of any kind, and the power that they dissipate: for methods with forces that
//! depend on velocity.

use super::constants::{Constants, Contacts, Springs};
use super::sweep::Sweep;
use super::{Kernel, Pass};
use crate::aligned::{Aligned, with_room};
use schemas::chain::Chain;
use schemas::contact::ContactLaw;
use schemas::damping::{ContactDamping, Factor};
use schemas::simd::{cut, in_vectors, vectorized};
use std::ops::Range;

/// The forms of [`Factor`], for loops that know theirs.
const ONE: u8 = Factor::One as u8;
const ROOT: u8 = Factor::Root as u8;
const RATIO: u8 = Factor::Ratio as u8;

/// The motion of the chain and its walls: displacements (m) and velocities (m/s), with room behind the last bead.
#[derive(Debug)]
pub(crate) struct Motion<'a> {
    pub(crate) u_m: &'a mut [f64],
    pub(crate) v_m_s: &'a mut [f64],
    pub(crate) walls_m: [f64; 2],
    pub(crate) walls_m_s: [f64; 2],
}

/// The damped contacts of a chain.
#[derive(Debug, Clone)]
pub(super) struct Damped {
    contacts: ContactDamping,
    /// True if bonds, which are never cut, take the place of contacts.
    is_bonded: bool,
    /// Overlap (m) at rest of each contact.
    rest_m: Aligned,
    /// The elastic force (N) of each contact, that at rest included.
    elastic_n: Part,
    /// δ^q of each contact.
    raised: Part,
}

impl Damped {
    /// The damping of `chain`, if it has one, whose arrays are `contacts`.
    pub(super) fn of(chain: &Chain, contacts: Contacts<'_>) -> Option<Self> {
        let damping = chain.damping.clone()?;
        let [rest_m, _] = contacts.rest;
        let rest = [rest_m, &vec![0.0; rest_m.len()]];
        let springs = (Springs::None, contacts.springs.1);
        let ones = vec![1.0; rest_m.len()];
        let raised_by = damping.kind.raised(chain.law.alpha()).unwrap_or_else(|| chain.law.clone());
        Some(Self {
            contacts: damping,
            is_bonded: chain.is_bonded,
            rest_m: Aligned::of(rest_m),
            elastic_n: Part::of(chain.law.clone(), Contacts { rest, springs, ..contacts }),
            raised: Part::of(raised_by, Contacts { rest, stiffness: &ones, terms: &[], springs, ..contacts }),
        })
    }
}

/// Some quantity of each contact that a sweep finds as it finds forces.
#[derive(Debug, Clone)]
struct Part {
    law: ContactLaw,
    constants: Constants,
    found: Aligned,
    presses: Vec<bool>,
}

impl Part {
    fn of(law: ContactLaw, contacts: Contacts<'_>) -> Self {
        let found = Aligned::zeros(contacts.stiffness.len());
        let presses = vec![false; found.len()];
        Self { law, constants: Constants::of(contacts), found, presses }
    }
}

impl Kernel {
    /// Evaluates the forces of the contacts of `beads`. If contacts are damped, writes the power (W) that each
    /// dissipates into `power_w` (N values). Number `c` is that of contact `c`, the last one that of both walls, or of
    /// the contact that closes a ring.
    pub(crate) fn evaluate_moving(
        &mut self,
        beads: &Range<usize>,
        motion: &mut Motion<'_>,
        power_w: &mut [f64],
    ) {
        self.move_walls(motion.walls_m);
        let Some(mut damped) = self.damped.take() else {
            return self.sweep_over(beads, &[Pass::Forces], motion.u_m, motion.v_m_s, None);
        };
        self.elastic(&mut damped, beads, motion);
        self.damp(&damped, beads, motion, power_w);
        self.damped = Some(damped);
    }

    /// Writes the net force (N) on each of `beads` into `net_n` (N values): of its contacts, evaluated last, of springs, resonators and drag,
    /// at the displacements (m) and velocities (m/s) of beads and the displacements of resonators `rows`.
    pub(crate) fn net_forces(&self, beads: &Range<usize>, [u_m, v_m_s, w_m]: [&[f64]; 3], net_n: &mut [f64]) {
        let (sites, net_n) = (&self.sites, &mut net_n[beads.clone()]);
        let (left, right) = self.forces_beside(beads);
        vectorized(
            self.arch,
            #[inline(always)]
            || {
                let count = net_n.len();
                let [left, right] = cut([left, right], count);
                for i in 0..count {
                    net_n[i] = left[i] - right[i];
                }
                sites.add_to(net_n, beads, [u_m, w_m]);
                if sites.has_drag() {
                    let drag = [&sites.drag_n_s_per_m[beads.clone()], &v_m_s[beads.clone()]];
                    let [drag, v_m_s] = cut(drag, count);
                    for i in 0..count {
                        net_n[i] -= drag[i] * v_m_s[i];
                    }
                }
            },
        );
    }

    /// Evaluates the elastic forces of the contacts of `beads`, those at rest included, and δ^q where it is needed.
    fn elastic(&self, damped: &mut Damped, beads: &Range<usize>, motion: &mut Motion<'_>) {
        let has_factor = !matches!(damped.contacts.kind.factor(), Factor::One);
        for part in
            [Some(&mut damped.elastic_n), has_factor.then_some(&mut damped.raised)].into_iter().flatten()
        {
            let sweep = Sweep {
                passes: &[Pass::Forces],
                tile: with_room(self.count),
                beads: beads.clone(),
                count: self.count,
                width: self.width,
                u_m: motion.u_m,
                v_m_s: motion.v_m_s,
                force: &mut part.found,
                presses: &mut part.presses,
                constants: &part.constants,
                ends: self.ends,
                walls_m: &self.walls_m,
                wall_forces_n: &mut [],
                places_m: &mut [],
                law: &part.law,
                shaken: &self.shaken,
                shake: None,
            };
            in_vectors(self.arch, sweep);
        }
    }

    /// Evaluates the forces of damped contacts, and the power (W) that each dissipates, from their elastic forces.
    fn damp(&mut self, damped: &Damped, beads: &Range<usize>, motion: &Motion<'_>, power_w: &mut [f64]) {
        let last = self.count - 1;
        let first = if beads.start == 0 { 1 } else { beads.start };
        let between = first..if beads.end > first { beads.end } else { first };
        match damped.contacts.kind.factor() {
            Factor::One => self.damp_between::<ONE>(damped, between, motion, power_w),
            Factor::Root => self.damp_between::<ROOT>(damped, between, motion, power_w),
            Factor::Ratio => self.damp_between::<RATIO>(damped, between, motion, power_w),
        }
        let approaches = |values: &[f64], walls: [f64; 2]| {
            let round = values[last] - values[0];
            if self.ends.is_ring { [round; 2] } else { [walls[0] - values[0], values[last] - walls[1]] }
        };
        let approaches_m = approaches(motion.u_m, motion.walls_m);
        let rates_m_s = approaches(motion.v_m_s, motion.walls_m_s);
        let mut walls_w = [0.0; 2];
        for (side, contact) in [(0, 0), (1, self.count)] {
            if self.ends.have_wall[side] {
                let coefficient = damped.contacts.wall_coefficient[if self.ends.is_ring { 0 } else { side }];
                walls_w[side] =
                    self.damp_one(damped, contact, approaches_m[side], rates_m_s[side], coefficient);
            }
        }
        power_w[last] = walls_w[0] + if self.ends.is_ring { 0.0 } else { walls_w[1] };
    }

    /// Does so for the contacts on the left of the beads `between`, with a loop for each form of the factor.
    fn damp_between<const FACTOR: u8>(
        &mut self,
        damped: &Damped,
        between: Range<usize>,
        motion: &Motion<'_>,
        power_w: &mut [f64],
    ) {
        let (is_bonded, zero_up_to_m) = (damped.is_bonded, self.law.zero_up_to_m());
        let before = between.start - 1..between.end - 1;
        let beside = [
            &motion.u_m[before.clone()],
            &motion.u_m[between.clone()],
            &motion.v_m_s[before.clone()],
            &motion.v_m_s[between.clone()],
            &damped.elastic_n.found[between.clone()],
            &damped.raised.found[between.clone()],
            &damped.rest_m[between.clone()],
            &damped.contacts.coefficient[before.clone()],
            &self.rest_n[between.clone()],
        ];
        let [force_n, power_w] = [&mut self.force[between], &mut power_w[before]];
        vectorized(
            self.arch,
            #[inline(always)]
            || {
                let count = force_n.len();
                let power_w = &mut power_w[..count];
                let [u, to_u, v, to_v, elastic_n, raised, rest_m, coefficient, rest_n] = cut(beside, count);
                let factor = match FACTOR {
                    ONE => Factor::One,
                    ROOT => Factor::Root,
                    _ => Factor::Ratio,
                };
                for i in 0..count {
                    let overlap_m = u[i] - to_u[i] + rest_m[i];
                    let known = Known {
                        elastic_n: elastic_n[i],
                        overlap_m,
                        rate_m_s: v[i] - to_v[i],
                        coefficient: coefficient[i] * factor.at(raised[i], overlap_m),
                    };
                    let damped_n;
                    (damped_n, power_w[i]) = known.damped(is_bonded, zero_up_to_m);
                    force_n[i] = damped_n - rest_n[i];
                }
            },
        );
    }

    /// Evaluates the force of the contact on the left of bead `i`, and gives the power (W) that it dissipates.
    fn damp_one(
        &mut self,
        damped: &Damped,
        i: usize,
        approach_m: f64,
        rate_m_s: f64,
        coefficient: f64,
    ) -> f64 {
        let overlap_m = approach_m + damped.rest_m[i];
        let factor = damped.contacts.kind.factor().at(damped.raised.found[i], overlap_m);
        let elastic_n = damped.elastic_n.found[i];
        let known = Known { elastic_n, overlap_m, rate_m_s, coefficient: coefficient * factor };
        let (damped_n, dissipated_w) = known.damped(damped.is_bonded, self.law.zero_up_to_m());
        self.force[i] = damped_n - self.rest_n[i];
        dissipated_w
    }
}

/// The state of a damped contact.
struct Known {
    elastic_n: f64,
    overlap_m: f64,
    rate_m_s: f64,
    /// The coefficient times δ^p.
    coefficient: f64,
}

impl Known {
    /// The force (N), including the force at rest, and the dissipated power (W): 0 where the contact is not closed,
    /// except for bonds.
    #[inline(always)]
    fn damped(&self, is_bonded: bool, zero_up_to_m: f64) -> (f64, f64) {
        // no branch, so that contacts fit into vectors: what an open one has is not taken
        let force_n = self.elastic_n + self.coefficient * self.rate_m_s;
        let force_n = if is_bonded || force_n > 0.0 { force_n } else { 0.0 };
        let power_w = (force_n - self.elastic_n) * self.rate_m_s;
        let is_open = !is_bonded && self.overlap_m <= zero_up_to_m;
        [force_n, power_w].map(|value| if is_open { 0.0 } else { value }).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aligned::Padded;
    use schemas::chain::{Wall, Walls};
    use schemas::damping::{Damping, Restitution};

    /// Force and dissipated power of two beads between walls, k = 4, α = 3, η = 2, at rest overlaps of ½ (force ½).
    fn forces_and_power(kind: Damping, v_m_s: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let law = ContactLaw::new(3.0);
        let wall = Wall::new(&law, 4.0, 0.5);
        let walls = Walls { left: wall, right: wall };
        let contacts = ContactDamping { kind, coefficient: vec![2.0], wall_coefficient: [2.0, 2.0] };
        let chain = Chain::new(vec![1.0; 2], vec![4.0], vec![0.5], walls, law);
        let mut kernel = Kernel::new(&chain.with_damping(Some(contacts)));
        let mut power_w = vec![1.0; 2];
        let (mut u_m, mut v_m_s) = (Padded::zeros(2), Padded::of(v_m_s));
        let mut motion =
            Motion { u_m: u_m.whole(), v_m_s: v_m_s.whole(), walls_m: [0.0; 2], walls_m_s: [0.0; 2] };
        kernel.evaluate_moving(&(0..2), &mut motion, &mut power_w);
        (kernel.force[..3].to_vec(), power_w)
    }

    #[test]
    fn rest_is_exact() {
        let found = forces_and_power(Damping::ViscousNSPerM(2.0), &[0.0; 2]);
        assert_eq!(found, (vec![0.0; 3], vec![0.0; 2]));
    }

    /// Bead 0 moves right at ¼ m/s. Dashpots: the contact is pressed with 2·¼ N more; the left wall, left
    /// behind, would pull with ½ N and pushes with ½ − ½ = 0 N. With `η·δ^1` the damping is halved at an overlap of ½.
    #[test]
    fn damped_contacts_worked_out_by_hand() {
        let (force, power_w) = forces_and_power(Damping::ViscousNSPerM(2.0), &[0.25, 0.0]);
        assert_eq!((&force[..], &power_w[..]), (&[-0.5, 0.5, 0.0][..], &[0.125, 0.125][..]));
        let restitution = Restitution { coefficient: 0.5, damping_ratio: 0.2 };
        let (force, power_w) = forces_and_power(Damping::Restitution(restitution), &[0.25, 0.0]);
        assert_eq!((&force[..], &power_w[..]), (&[-0.25, 0.25, 0.0][..], &[0.0625, 0.0625][..]));
    }
}
