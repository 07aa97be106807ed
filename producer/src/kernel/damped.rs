//! Forces that depend on velocities, and the power that they dissipate.

use super::{Kernel, Pass};
use aligned_vec::avec;
use pulp::Arch;
use schemas::chain::Chain;
use schemas::contact::{ContactLaw, Power, PowerUser, evaluate};
use schemas::damping::{ContactDamping, Damping, damped_force};
use schemas::simd::vectorized;
use std::ops::Range;

/// The damped contacts of a chain.
#[derive(Debug, Clone)]
pub(super) struct Damped {
    pub(super) contacts: ContactDamping,
    /// Whether bonds, which are never cut, take the place of contacts.
    pub(super) is_bonded: bool,
    /// The law of δ^q of a damping that is computed as δ^q/δ.
    pub(super) raised: Option<ContactLaw>,
    rest_overlap_m: Vec<f64>,
    rest_force_n: Vec<f64>,
}

/// What is evaluated of each contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    /// The force (N) beyond that at rest.
    Force,
    /// The power (W) that is dissipated.
    DissipatedPower,
}

impl Damped {
    /// The damping of `chain`, if it has one.
    pub(super) fn of(chain: &Chain) -> Option<Self> {
        chain.damping.clone().map(|contacts| Self {
            raised: contacts.kind.raised(chain.law.alpha()),
            contacts,
            is_bonded: chain.is_bonded,
            rest_overlap_m: chain.rest_overlap_m.clone(),
            rest_force_n: chain.rest_force_n.clone(),
        })
    }

    fn is_by_overlap(&self) -> bool {
        matches!(self.contacts.kind, Damping::Restitution(_))
    }
}

impl Kernel {
    /// Evaluates the force of every contact at the displacements `u_m` and velocities `v_m_s`, and widens the
    /// window over the beads that a contact now pushes.
    pub fn evaluate_forces_of_motion(&mut self, u_m: &mut [f64], v_m_s: &mut [f64]) {
        let Some(damped) = self.damped.take() else { return self.sweep(&[Pass::Forces], u_m, v_m_s) };
        let beads = self.active_beads();
        if !beads.is_empty() {
            let contacts = self.contacts_of(&beads);
            let mut force = std::mem::replace(&mut self.force, avec![]);
            let out = &mut force[contacts.start + 1..=contacts.end];
            self.evaluate_contacts(&damped, &contacts, [u_m, v_m_s], Wanted::Force, out);
            let [left, right] = self.walls_of_motion(&damped, &beads, [u_m, v_m_s], Wanted::Force);
            force[0] = left;
            force[u_m.len()] = right;
            self.force = force;
            self.widen(&self.reached(1), u_m, v_m_s);
        }
        self.damped = Some(damped);
    }

    /// Writes the power (W) that each contact dissipates at the displacements `u_m` and velocities `v_m_s` into
    /// `power_w` (N values): number `c` is that of contact `c`, the last one that of both walls. It is 0
    /// without damping.
    pub fn dissipated_power(&self, u_m: &[f64], v_m_s: &[f64], power_w: &mut [f64]) {
        power_w.fill(0.0);
        let (Some(damped), beads) = (&self.damped, self.active_beads()) else { return };
        if beads.is_empty() {
            return;
        }
        let contacts = self.contacts_of(&beads);
        let wanted = Wanted::DissipatedPower;
        self.evaluate_contacts(damped, &contacts, [u_m, v_m_s], wanted, &mut power_w[contacts.clone()]);
        let [left, right] = self.walls_of_motion(damped, &beads, [u_m, v_m_s], wanted);
        power_w[u_m.len() - 1] = left + right;
    }

    /// Evaluates the contacts `contacts` of the motion `[u, v]` into `out`.
    fn evaluate_contacts(
        &self,
        damped: &Damped,
        contacts: &Range<usize>,
        [u_m, v_m_s]: [&[f64]; 2],
        wanted: Wanted,
        out: &mut [f64],
    ) {
        let (first, end) = (contacts.start, contacts.end);
        let motion = Motion {
            u_m: &u_m[first..=end],
            v_m_s: &v_m_s[first..=end],
            stiffness: &self.stiffness[first..end],
            rest_overlap: &damped.rest_overlap_m[first..end],
            rest_force: &damped.rest_force_n[first..end],
            coefficient: &damped.contacts.coefficient[first..end],
            out,
        };
        dispatch(self.arch, &self.law, motion, damped.is_by_overlap(), wanted);
    }

    /// What the walls do to the end beads that are active: `[left, right]`.
    fn walls_of_motion(
        &self,
        damped: &Damped,
        beads: &Range<usize>,
        [u_m, v_m_s]: [&[f64]; 2],
        wanted: Wanted,
    ) -> [f64; 2] {
        let last = u_m.len() - 1;
        let [left, right] = [self.walls.left, self.walls.right];
        let ends =
            [(left, beads.start == 0, -u_m[0], -v_m_s[0]), (right, beads.end > last, u_m[last], v_m_s[last])];
        let mut found = [0.0; 2];
        for (end, (wall, is_active, approach_m, rate_m_s)) in ends.into_iter().enumerate() {
            if !is_active || wall.stiffness == 0.0 {
                continue;
            }
            // a contact between two beads of which one stands still
            let motion = Motion {
                u_m: &[approach_m, 0.0],
                v_m_s: &[rate_m_s, 0.0],
                stiffness: &[wall.stiffness],
                rest_overlap: &[wall.rest_overlap_m],
                rest_force: &[wall.rest_force_n],
                coefficient: &[damped.contacts.wall_coefficient[end]],
                out: &mut found[end..=end],
            };
            dispatch(self.arch, &self.law, motion, damped.is_by_overlap(), wanted);
        }
        found
    }
}

/// Runs the loop over contacts that `by_overlap` and `wanted` ask for.
fn dispatch(arch: Arch, law: &ContactLaw, motion: Motion<'_>, by_overlap: bool, wanted: Wanted) {
    let zero_up_to_m = law.zero_up_to_m();
    vectorized(
        arch,
        #[inline(always)]
        || match (by_overlap, wanted) {
            (true, Wanted::Force) => law.with_power(DampedContacts::<true, false> { motion, zero_up_to_m }),
            (true, Wanted::DissipatedPower) => {
                law.with_power(DampedContacts::<true, true> { motion, zero_up_to_m });
            }
            (false, Wanted::Force) => law.with_power(DampedContacts::<false, false> { motion, zero_up_to_m }),
            (false, Wanted::DissipatedPower) => {
                law.with_power(DampedContacts::<false, true> { motion, zero_up_to_m });
            }
        },
    );
}

/// Some neighbouring contacts and the motion of their beads, of which there is one more.
struct Motion<'a> {
    u_m: &'a [f64],
    v_m_s: &'a [f64],
    stiffness: &'a [f64],
    rest_overlap: &'a [f64],
    rest_force: &'a [f64],
    coefficient: &'a [f64],
    out: &'a mut [f64],
}

/// The loop over contacts: their forces, or with `POWER` the power that they dissipate.
struct DampedContacts<'a, const BY_OVERLAP: bool, const POWER: bool> {
    motion: Motion<'a>,
    zero_up_to_m: f64,
}

impl<const BY_OVERLAP: bool, const POWER: bool> PowerUser for DampedContacts<'_, BY_OVERLAP, POWER> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        let Motion { u_m, v_m_s, stiffness, rest_overlap, rest_force, coefficient, out } = self.motion;
        let contacts = out.len();
        evaluate(
            [
                &u_m[..contacts],
                &u_m[1..],
                &v_m_s[..contacts],
                &v_m_s[1..],
                stiffness,
                rest_overlap,
                rest_force,
                coefficient,
            ],
            out,
            power,
            self.zero_up_to_m,
            #[inline(always)]
            |[left, right, _, _, _, rest, ..]| (left - right) + rest,
            #[inline(always)]
            |[_, _, v_left, v_right, stiffness, _, rest_force, coefficient], overlap, raised| {
                let (rate, elastic) = (v_left - v_right, stiffness * raised);
                // of 0/0 in an open contact nothing is taken
                let force = damped_force::<BY_OVERLAP>(elastic, raised, overlap, coefficient, rate);
                let is_closed = overlap != 0.0;
                if POWER {
                    if is_closed { (force - elastic) * rate } else { 0.0 }
                } else {
                    (if is_closed { force } else { 0.0 }) - rest_force
                }
            },
            #[inline(always)]
            |_, _| true,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Activity;
    use schemas::chain::{Wall, Walls};

    /// Two beads between walls, k = 4, α = 3, η = 2, at rest overlaps of ½ (force ½).
    fn chain(kind: Damping) -> Chain {
        let law = ContactLaw::new(3.0);
        let wall = Wall::new(&law, 4.0, 0.5);
        let walls = Walls { left: wall, right: wall };
        let contacts = ContactDamping { kind, coefficient: vec![2.0], wall_coefficient: [2.0, 2.0] };
        let chain = Chain::new(vec![1.0; 2], vec![4.0], vec![0.5], walls, law);
        chain.with_damping(Some(contacts))
    }

    fn forces_and_power(kind: Damping, u_m: &[f64], v_m_s: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut kernel = Kernel::new(&chain(kind));
        kernel.restart(Activity::of(u_m, v_m_s));
        kernel.evaluate_forces_of_motion(&mut u_m.to_vec(), &mut v_m_s.to_vec());
        let mut power_w = vec![1.0; 2];
        kernel.dissipated_power(u_m, v_m_s, &mut power_w);
        (kernel.force.to_vec(), power_w)
    }

    #[test]
    fn rest_is_exact() {
        let (force, power_w) = forces_and_power(Damping::ViscousNSPerM(2.0), &[0.0; 2], &[0.0; 2]);
        assert_eq!((force, power_w), (vec![0.0; 3], vec![0.0; 2]));
    }

    /// Bead 0 moves right at ¼ m/s. Dashpots: the contact is pressed with 2·¼ N more; the left wall, left
    /// behind, would pull with ½ N and pushes with ½ − ½ = 0 N.
    #[test]
    fn dashpots_worked_out_by_hand() {
        let (force, power_w) = forces_and_power(Damping::ViscousNSPerM(2.0), &[0.0; 2], &[0.25, 0.0]);
        assert_eq!(force, [-0.5, 0.5, 0.0]);
        assert_eq!(power_w, [0.125, 0.125]);
    }

    /// With `η·δ^1` the damping is halved at an overlap of ½.
    #[test]
    fn damping_by_overlap_worked_out_by_hand() {
        let restitution = schemas::damping::Restitution { coefficient: 0.5, damping_ratio: 0.2 };
        let (force, power_w) = forces_and_power(Damping::Restitution(restitution), &[0.0; 2], &[0.25, 0.0]);
        assert_eq!(force, [-0.25, 0.25, 0.0]);
        assert_eq!(power_w, [0.0625, 0.0625]);
    }
}
