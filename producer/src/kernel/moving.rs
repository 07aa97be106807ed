//! Contacts of moving beads, with forces of any kind, and the power that they dissipate: for methods with forces that
//! depend on velocity.

use super::constants::{Constants, Contacts, Springs};
use super::sweep::Sweep;
use super::{Kernel, Pass};
use crate::aligned::{Aligned, with_room};
use schemas::chain::Chain;
use schemas::contact::ContactLaw;
use schemas::damping::{ContactDamping, Factor};
use schemas::simd::{in_vectors, vectorized};
use std::ops::Range;

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
        let sites = &self.sites;
        let (left, right) = self.forces_beside(beads);
        for (at, i) in beads.clone().enumerate() {
            let w = if sites.has_resonators() { w_m[i] } else { 0.0 };
            net_n[i] = sites.net_n(i, left[at] - right[at], u_m[i], w);
            if sites.has_drag() {
                net_n[i] -= sites.drag_n_s_per_m[i] * v_m_s[i];
            }
        }
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
        let (arch, last) = (self.arch, self.count - 1);
        let between = (if beads.start == 0 { 1 } else { beads.start })..beads.end;
        vectorized(
            arch,
            #[inline(always)]
            || {
                for i in between {
                    let approach_m = motion.u_m[i - 1] - motion.u_m[i];
                    let rate_m_s = motion.v_m_s[i - 1] - motion.v_m_s[i];
                    let coefficient = damped.contacts.coefficient[i - 1];
                    power_w[i - 1] = self.damp_one(damped, i, approach_m, rate_m_s, coefficient);
                }
            },
        );
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

    /// Evaluates the force of the contact on the left of bead `i`, and gives the power (W) that it dissipates.
    #[inline(always)]
    fn damp_one(
        &mut self,
        damped: &Damped,
        i: usize,
        approach_m: f64,
        rate_m_s: f64,
        coefficient: f64,
    ) -> f64 {
        let known = Known {
            elastic_n: damped.elastic_n.found[i],
            raised: damped.raised.found[i],
            overlap_m: approach_m + damped.rest_m[i],
            rate_m_s,
            coefficient,
        };
        let (damped_n, dissipated_w) =
            known.damped(damped.contacts.kind.factor(), damped.is_bonded, self.law.zero_up_to_m());
        self.force[i] = damped_n - self.rest_n[i];
        dissipated_w
    }
}

/// The state of a damped contact.
struct Known {
    elastic_n: f64,
    raised: f64,
    overlap_m: f64,
    rate_m_s: f64,
    coefficient: f64,
}

impl Known {
    /// The force (N), including the force at rest, and the dissipated power (W): 0 where the contact is not closed,
    /// except for bonds.
    #[inline(always)]
    fn damped(&self, factor: Factor, is_bonded: bool, zero_up_to_m: f64) -> (f64, f64) {
        if !is_bonded && self.overlap_m <= zero_up_to_m {
            return (0.0, 0.0);
        }
        let factor = factor.at(self.raised, self.overlap_m);
        let force_n = self.elastic_n + self.coefficient * factor * self.rate_m_s;
        let force_n = if is_bonded || force_n > 0.0 { force_n } else { 0.0 };
        (force_n, (force_n - self.elastic_n) * self.rate_m_s)
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
