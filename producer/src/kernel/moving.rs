//! Contacts of moving beads, whatever their force is made of, and what they dissipate: for methods that take forces of velocity.

use super::sweep::{add_up, wall_elastic_n};
use super::{Kernel, Rest};
use schemas::contact::{ContactLaw, Power, PowerUser, evaluate};
use schemas::damping::Damping;
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

/// How the factor δ^p of a damping force is computed.
#[derive(Clone, Copy)]
enum Factor {
    /// p = 0.
    One,
    /// p = (α − 1)/2: `√(δ^α/δ)`.
    Root,
    /// Any p: `δ^q/δ` with q = p + 1.
    Ratio,
}

impl Kernel {
    /// Evaluates the forces of the contacts of `beads`, and writes the power (W) that each dissipates into `power_w` (N values), if
    /// contacts are damped. Number `c` is that of contact `c`, the last one that of both walls, or of the contact that closes a ring.
    pub(crate) fn evaluate_moving(&mut self, beads: &Range<usize>, motion: Motion<'_>, power_w: &mut [f64]) {
        let contacts = self.contacts_of(beads);
        let count = motion.u_m.len();
        for scratch in &mut self.scratch {
            scratch.resize(count + 1, 0.0);
        }
        let [elastic, raised] = &mut self.scratch;
        let elastic = &mut elastic[contacts.start + 1..=contacts.end];
        let rest = &self
            .rest
            .get_or_insert_with(|| Rest { overlap_m: vec![0.0; count - 1], force_n: vec![0.0; count - 1] });
        let (u_m, v_m_s) =
            (&motion.u_m[contacts.start..=contacts.end], &motion.v_m_s[contacts.start..=contacts.end]);
        let (law, terms) = (&self.law, &self.terms[..]);
        let stiffness = &self.stiffness[contacts.clone()];
        vectorized(
            self.arch,
            #[inline(always)]
            || {
                law.with_power(Elastic {
                    u_m,
                    contacts: contacts.clone(),
                    stiffness,
                    rest,
                    terms,
                    law,
                    elastic,
                })
            },
        );
        let force = &mut self.force[contacts.start + 1..=contacts.end];
        let rest_force = &rest.force_n[contacts.clone()];
        let Some(damped) = &self.damped else {
            for c in 0..contacts.len() {
                force[c] = elastic[c] - rest_force[c];
            }
            let approaches = self.approaches(motion, false);
            let [left, right] = [(0, self.walls.left), (1, self.walls.right)].map(|(side, wall)| {
                let elastic_n = wall_elastic_n(&wall, side, law, terms, approaches[side]);
                if wall.is_there { elastic_n - wall.rest_force_n } else { 0.0 }
            });
            self.force[0] = left;
            self.force[count] = if self.is_ring { left } else { right };
            return;
        };
        let kind = damped.contacts.kind;
        let raised_law = kind.raised(law.alpha());
        let factor = match kind {
            Damping::ViscousNSPerM(_) => Factor::One,
            Damping::Restitution(_) => Factor::Root,
            Damping::KuwabaraKonoS(_) | Damping::Power(_) => Factor::Ratio,
        };
        let raised_law = raised_law.as_ref().unwrap_or(law);
        let raised = &mut raised[contacts.start + 1..=contacts.end];
        let overlap_m = &rest.overlap_m[contacts.clone()];
        if !matches!(factor, Factor::One) {
            vectorized(
                self.arch,
                #[inline(always)]
                || {
                    raised_law.with_power(Raised {
                        u_m,
                        overlap_m,
                        raised,
                        zero_up_to_m: raised_law.zero_up_to_m(),
                    })
                },
            );
        }
        let coefficient = &damped.contacts.coefficient[contacts.clone()];
        let power = &mut power_w[contacts.clone()];
        let (is_bonded, zero_up_to_m) = (damped.is_bonded, law.zero_up_to_m());
        for c in 0..contacts.len() {
            let overlap = (u_m[c] - u_m[c + 1]) + overlap_m[c];
            let rate = v_m_s[c] - v_m_s[c + 1];
            let is_closed = is_bonded || overlap > zero_up_to_m;
            let known =
                Known { elastic: elastic[c], raised: raised[c], overlap, rate, coefficient: coefficient[c] };
            let (damped_n, power_w) = if is_closed { known.damped(factor, is_bonded) } else { (0.0, 0.0) };
            force[c] = damped_n - rest_force[c];
            power[c] = power_w;
        }
        let [approaches, rates] = [self.approaches(motion, false), self.approaches(motion, true)];
        let walls = [(0, self.walls.left), (1, self.walls.right)].map(|(side, wall)| {
            if !wall.is_there {
                return (0.0, 0.0);
            }
            let overlap = wall.overlap_m(approaches[side]);
            let known = Known {
                elastic: wall_elastic_n(&wall, side, law, terms, approaches[side]),
                raised: raised_law.force(1.0, overlap),
                overlap,
                rate: rates[side],
                coefficient: damped.contacts.wall_coefficient[side],
            };
            let is_closed = is_bonded || overlap > zero_up_to_m;
            let (damped_n, power_w) = if is_closed { known.damped(factor, is_bonded) } else { (0.0, 0.0) };
            (damped_n - wall.rest_force_n, power_w)
        });
        power_w[count - 1] = walls[0].1 + walls[1].1;
        self.force[0] = walls[0].0;
        self.force[count] = if self.is_ring { walls[0].0 } else { walls[1].0 };
    }

    /// How much nearer the end beads are to the walls, or with `OF_VELOCITIES` how fast they come nearer; of a ring, the last bead
    /// to the first.
    fn approaches(&self, motion: Motion<'_>, of_velocities: bool) -> [f64; 2] {
        let (values, walls) =
            if of_velocities { (motion.v_m_s, motion.walls_m_s) } else { (motion.u_m, motion.walls_m) };
        let last = values.len() - 1;
        if self.is_ring {
            return [values[last] - values[0], 0.0];
        }
        [walls[0] - values[0], values[last] - walls[1]]
    }
}

/// What is known of a closed contact.
struct Known {
    elastic: f64,
    raised: f64,
    overlap: f64,
    rate: f64,
    coefficient: f64,
}

impl Known {
    /// Its force (N), that at rest included, and the power (W) that it dissipates.
    #[inline(always)]
    fn damped(&self, factor: Factor, is_bonded: bool) -> (f64, f64) {
        let factor = match factor {
            Factor::One => 1.0,
            Factor::Root => (self.raised / self.overlap).sqrt(),
            Factor::Ratio => self.raised / self.overlap,
        };
        let force = self.elastic + self.coefficient * factor * self.rate;
        let force = if is_bonded || force > 0.0 { force } else { 0.0 };
        (force, (force - self.elastic) * self.rate)
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
    elastic: &'a mut [f64],
}

impl PowerUser for Elastic<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        let with = (power, self.law.zero_up_to_m());
        add_up((self.u_m, self.contacts), self.stiffness, self.rest, self.terms, with, self.elastic);
    }
}

/// δ^q of some contacts.
struct Raised<'a> {
    u_m: &'a [f64],
    overlap_m: &'a [f64],
    raised: &'a mut [f64],
    zero_up_to_m: f64,
}

impl PowerUser for Raised<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        let contacts = self.raised.len();
        evaluate(
            [&self.u_m[..contacts], &self.u_m[1..], self.overlap_m],
            self.raised,
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
