//! Contacts of moving beads, with forces of any kind, and the power that they dissipate: for methods with forces that
//! depend on velocity.

use super::sweep::{add_up, wall_elastic_n};
use super::{Kernel, Rest};
use schemas::chain::Chain;
use schemas::contact::{ContactLaw, Power, PowerUser, evaluate};
use schemas::damping::{ContactDamping, Factor};
use schemas::simd::vectorized;
use std::ops::Range;

/// The motion of the chain and its walls: displacements (m), velocities (m/s).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motion<'a> {
    pub(crate) u_m: &'a [f64],
    pub(crate) v_m_s: &'a [f64],
    pub(crate) walls_m: [f64; 2],
    pub(crate) walls_m_s: [f64; 2],
}

/// The damped contacts of a chain.
#[derive(Debug, Clone)]
pub(super) struct Damped {
    contacts: ContactDamping,
    /// True if bonds, which are never cut, take the place of contacts.
    is_bonded: bool,
    /// The law of δ^q of a damping that is computed as δ^q/δ.
    raised: Option<ContactLaw>,
}

impl Damped {
    /// The damping of `chain`, if it has one.
    pub(super) fn of(chain: &Chain) -> Option<Self> {
        chain.damping.clone().map(|contacts| Self {
            raised: contacts.kind.raised(chain.law.alpha()),
            contacts,
            is_bonded: chain.is_bonded,
        })
    }
}

impl Kernel {
    /// Evaluates the forces of the contacts of `beads`. If contacts are damped, writes the power (W) that each
    /// dissipates into `power_w` (N values). Number `c` is that of contact `c`, the last one that of both walls, or of
    /// the contact that closes a ring.
    pub(crate) fn evaluate_moving(&mut self, beads: &Range<usize>, motion: Motion<'_>, power_w: &mut [f64]) {
        let contacts = self.contacts_of(beads);
        let count = motion.u_m.len();
        let mut scratch = std::mem::take(&mut self.scratch);
        for numbers in &mut scratch {
            numbers.resize(count, 0.0);
        }
        let rest = self
            .rest
            .take()
            .unwrap_or_else(|| Rest { overlap_m: vec![0.0; count - 1], force_n: vec![0.0; count - 1] });
        let [elastic_n, raised] = &mut scratch;
        self.elastic(&contacts, motion, &rest, &mut elastic_n[contacts.clone()]);
        let damped = self.damped.take();
        match &damped {
            None => {
                let (elastic_n, rest_n) = (&elastic_n[contacts.clone()], &rest.force_n[contacts.clone()]);
                let force = &mut self.force[contacts.start + 1..=contacts.end];
                for c in 0..force.len() {
                    force[c] = elastic_n[c] - rest_n[c];
                }
            }
            Some(damped) => {
                let found = [&mut elastic_n[contacts.clone()], &mut raised[contacts.clone()]];
                self.damp(damped, &contacts, motion, &rest, found, &mut power_w[contacts.clone()]);
            }
        }
        let [left, right] = self.walls_moving(damped.as_ref(), motion);
        (self.force[0], self.force[count]) = (left.0, if self.is_ring { left.0 } else { right.0 });
        if damped.is_some() {
            power_w[count - 1] = left.1 + right.1;
        }
        (self.scratch, self.rest, self.damped) = (scratch, Some(rest), damped);
    }

    /// The elastic forces (N), those at rest included, of `contacts`.
    fn elastic(&self, contacts: &Range<usize>, motion: Motion<'_>, rest: &Rest, out_n: &mut [f64]) {
        let law = &self.law;
        let elastic = Elastic {
            u_m: &motion.u_m[contacts.start..=contacts.end],
            contacts: contacts.clone(),
            stiffness: &self.stiffness[contacts.clone()],
            rest,
            terms: &self.terms,
            law,
            out_n,
        };
        vectorized(
            self.arch,
            #[inline(always)]
            || law.with_power(elastic),
        );
    }

    /// Evaluates the forces of damped `contacts`, and the power (W) that each dissipates. The elastic force (N) of
    /// each is given; where δ^q is needed, there is room for it.
    fn damp(
        &mut self,
        damped: &Damped,
        contacts: &Range<usize>,
        motion: Motion<'_>,
        rest: &Rest,
        [elastic_n, raised]: [&mut [f64]; 2],
        power_w: &mut [f64],
    ) {
        let (u_m, v_m_s) =
            (&motion.u_m[contacts.start..=contacts.end], &motion.v_m_s[contacts.start..=contacts.end]);
        let (overlap_m, rest_n) = (&rest.overlap_m[contacts.clone()], &rest.force_n[contacts.clone()]);
        let factor = damped.contacts.kind.factor();
        if !matches!(factor, Factor::One) {
            let law = damped.raised.as_ref().unwrap_or(&self.law);
            let raised = Raised { u_m, overlap_m, zero_up_to_m: law.zero_up_to_m(), out: &mut *raised };
            vectorized(
                self.arch,
                #[inline(always)]
                || law.with_power(raised),
            );
        }
        let coefficient = &damped.contacts.coefficient[contacts.clone()];
        let (is_bonded, zero_up_to_m) = (damped.is_bonded, self.law.zero_up_to_m());
        let force = &mut self.force[contacts.start + 1..=contacts.end];
        for c in 0..force.len() {
            let known = Known {
                elastic_n: elastic_n[c],
                raised: raised[c],
                overlap_m: (u_m[c] - u_m[c + 1]) + overlap_m[c],
                rate_m_s: v_m_s[c] - v_m_s[c + 1],
                coefficient: coefficient[c],
            };
            let (damped_n, dissipated_w) = known.damped(factor, is_bonded, zero_up_to_m);
            (force[c], power_w[c]) = (damped_n - rest_n[c], dissipated_w);
        }
    }

    /// Force (N) beyond that at rest and dissipated power (W) of the contacts with the left and with the right wall.
    /// In a ring, the first is that of the contact that closes it.
    fn walls_moving(&self, damped: Option<&Damped>, motion: Motion<'_>) -> [(f64, f64); 2] {
        let approaches = self.approaches(motion.u_m, motion.walls_m);
        let rates = self.approaches(motion.v_m_s, motion.walls_m_s);
        [(0, self.walls.left), (1, self.walls.right)].map(|(side, wall)| {
            if !wall.is_there {
                return (0.0, 0.0);
            }
            let elastic_n = wall_elastic_n(&wall, side, &self.law, &self.terms, approaches[side]);
            let Some(damped) = damped else { return (elastic_n - wall.rest_force_n, 0.0) };
            let overlap_m = wall.overlap_m(approaches[side]);
            let known = Known {
                elastic_n,
                raised: damped.raised.as_ref().unwrap_or(&self.law).force(1.0, overlap_m),
                overlap_m,
                rate_m_s: rates[side],
                coefficient: damped.contacts.wall_coefficient[side],
            };
            let (damped_n, power_w) =
                known.damped(damped.contacts.kind.factor(), damped.is_bonded, self.law.zero_up_to_m());
            (damped_n - wall.rest_force_n, power_w)
        })
    }

    /// Approach of the end beads of displacements `values` to walls displaced by `walls`; in a ring, the approach of
    /// the last bead to the first. For velocities, the rate of approach.
    fn approaches(&self, values: &[f64], walls: [f64; 2]) -> [f64; 2] {
        let last = values.len() - 1;
        if self.is_ring {
            return [values[last] - values[0], 0.0];
        }
        [walls[0] - values[0], values[last] - walls[1]]
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

/// The elastic forces of some contacts.
struct Elastic<'a> {
    u_m: &'a [f64],
    contacts: Range<usize>,
    stiffness: &'a [f64],
    rest: &'a Rest,
    terms: &'a [schemas::term::Term],
    law: &'a ContactLaw,
    out_n: &'a mut [f64],
}

impl PowerUser for Elastic<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        let with = (power, self.law.zero_up_to_m());
        add_up((self.u_m, self.contacts), self.stiffness, self.rest, self.terms, with, self.out_n);
    }
}

/// δ^q of some contacts.
struct Raised<'a> {
    u_m: &'a [f64],
    overlap_m: &'a [f64],
    out: &'a mut [f64],
    zero_up_to_m: f64,
}

impl PowerUser for Raised<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        let contacts = self.out.len();
        evaluate(
            [&self.u_m[..contacts], &self.u_m[1..], self.overlap_m],
            self.out,
            power,
            self.zero_up_to_m,
            #[inline(always)]
            |[left, right, rest]| (left - right) + rest,
            #[inline(always)]
            |_, _, power| power,
            #[inline(always)]
            |_, any_closed| any_closed,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
        let motion = Motion { u_m: &[0.0; 2], v_m_s, walls_m: [0.0; 2], walls_m_s: [0.0; 2] };
        kernel.evaluate_moving(&(0..2), motion, &mut power_w);
        (kernel.force.to_vec(), power_w)
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
