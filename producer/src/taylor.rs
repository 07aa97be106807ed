//! How gear5 begins: the higher derivatives of the motion at step 0.

use schemas::chain::{Chain, Wall};
use schemas::contact::ContactLaw;
use schemas::damping::{Damping, damped_force};

/// Terms of the force's series that are needed: those of `dt^0` to `dt^3` give the terms `q2` to `q5` of the
/// displacements.
const FORCE_TERMS: usize = 4;

/// `[q2 | q3 | q4 | q5]` (m, N values each) of the beads at the displacements `u_m` (m) and velocities `v_m_s`
/// (m/s): the exact terms `q_k = dt^k/k!·d^k u/dt^k` of the motion's Taylor series.
///
/// The series of the motion gives that of each force, which gives the next term of the motion:
/// `q_{k+2} = dt²/((k+1)(k+2))·F_k/m`. Contacts without a force add nothing: one that is about to close has no
/// derivatives there.
pub(crate) fn taylor_terms(chain: &Chain, u_m: &[f64], v_m_s: &[f64], dt_s: f64) -> Vec<f64> {
    let beads = chain.bead_count();
    // the terms q1, q2, …, one after the other
    let mut terms: Vec<Vec<f64>> = vec![v_m_s.iter().map(|v| v * dt_s).collect()];
    let mut contacts = contacts(chain, u_m);
    for order in 0..FORCE_TERMS {
        for (c, contact) in contacts.iter_mut().enumerate() {
            let last = &terms[order];
            // contact c joins beads c − 1 and c; walls do not move
            let left = if c > 0 { last[c - 1] } else { 0.0 };
            let right = if c < beads { last[c] } else { 0.0 };
            contact.push(left - right, dt_s);
        }
        let inverse = (dt_s * dt_s) / ((order + 1) * (order + 2)) as f64;
        let net_force = |i: usize| contacts[i].excess_n(order) - contacts[i + 1].excess_n(order);
        terms.push((0..beads).map(|i| (inverse / chain.mass_kg[i]) * net_force(i)).collect());
    }
    terms[1..].concat()
}

/// All contacts from left to right, first and last those with the walls, which have no stiffness at a free end.
fn contacts(chain: &Chain, u_m: &[f64]) -> Vec<Contact> {
    let [left_m, right_m] = chain.wall_approaches_m(u_m, &[]);
    let wall = |side: usize, wall: &Wall, approach_m: f64| Contact {
        stiffness: wall.stiffness,
        damping: chain.damping.as_ref().map_or(0.0, |damping| damping.wall_coefficient[side]),
        rest_force_n: wall.rest_force_n,
        ..Contact::new(chain, wall.overlap_m(approach_m))
    };
    let between = |c: usize| Contact {
        stiffness: chain.stiffness[c],
        damping: chain.damping.as_ref().map_or(0.0, |damping| damping.coefficient[c]),
        rest_force_n: chain.rest_force_n[c],
        ..Contact::new(chain, chain.overlap_m(u_m, c))
    };
    let mut contacts = vec![wall(0, &chain.walls.left, left_m)];
    contacts.extend((0..chain.contact_count()).map(between));
    contacts.push(wall(1, &chain.walls.right, right_m));
    contacts
}

/// The Taylor series of one contact over a time step, as far as they are known.
#[derive(Debug)]
struct Contact {
    law: ContactLaw,
    stiffness: f64,
    /// η (N·s·m^(−1−p)).
    damping: f64,
    /// Whether the damping grows with the overlap, `p = (α−1)/2`; else `p = 0`.
    is_by_overlap: bool,
    rest_force_n: f64,
    /// Terms (m) of the overlap `δ`, one more than of the others.
    overlap: Vec<f64>,
    /// Terms of `δ^α` and of `δ^p`.
    raised: Vec<f64>,
    raised_for_damping: Vec<f64>,
    /// Terms (N) of the force.
    force: Vec<f64>,
}

impl Contact {
    /// A contact of `chain` with this overlap (m), without stiffness.
    fn new(chain: &Chain, overlap_m: f64) -> Self {
        let kind = chain.damping.as_ref().map(|damping| damping.kind);
        Self {
            law: chain.law.clone(),
            stiffness: 0.0,
            damping: 0.0,
            is_by_overlap: matches!(kind, Some(Damping::Restitution(_))),
            rest_force_n: 0.0,
            overlap: vec![overlap_m],
            raised: Vec::new(),
            raised_for_damping: Vec::new(),
            force: Vec::new(),
        }
    }

    /// Takes the next term (m) of the overlap and finds the next one of the force, `k·δ^α + η·δ^p·dδ/dt`.
    ///
    /// A contact that may open or double its overlap within one step, or that is held from pulling, keeps a
    /// constant force: its series would say nothing about the end of the step.
    fn push(&mut self, overlap_term_m: f64, dt_s: f64) {
        self.overlap.push(overlap_term_m);
        let n = self.force.len();
        if n == 0 {
            self.begin(dt_s);
        } else if self.force[0] == 0.0 || self.overlap[1].abs() >= self.overlap[0] {
            self.force.push(0.0);
        } else {
            let alpha = self.law.alpha();
            let p = if self.is_by_overlap { 0.5 * (alpha - 1.0) } else { 0.0 };
            self.raised.push(next_of_power(alpha, &self.overlap, &self.raised));
            self.raised_for_damping.push(next_of_power(p, &self.overlap, &self.raised_for_damping));
            let mut force = self.stiffness * self.raised[n];
            for (i, factor) in self.raised_for_damping.iter().enumerate() {
                let rate_m_s = (n - i + 1) as f64 * self.overlap[n - i + 1] / dt_s;
                force += self.damping * factor * rate_m_s;
            }
            self.force.push(force);
        }
    }

    /// Finds the first terms, from the overlap and its rate.
    fn begin(&mut self, dt_s: f64) {
        let (overlap_m, rate_m_s) = (self.overlap[0], self.overlap[1] / dt_s);
        let elastic_n = self.law.force(self.stiffness, overlap_m);
        let raised = self.law.force(1.0, overlap_m);
        let by_overlap = if self.is_by_overlap { (raised / overlap_m).sqrt() } else { 1.0 };
        let damped = |elastic_n: f64| {
            if self.is_by_overlap {
                damped_force::<true>(elastic_n, raised, overlap_m, self.damping, rate_m_s)
            } else {
                damped_force::<false>(elastic_n, raised, overlap_m, self.damping, rate_m_s)
            }
        };
        self.force.push(if elastic_n > 0.0 { damped(elastic_n) } else { 0.0 });
        self.raised.push(raised);
        self.raised_for_damping.push(by_overlap);
    }

    /// Term `order` (N) of the force beyond that at rest.
    fn excess_n(&self, order: usize) -> f64 {
        if order == 0 { self.force[0] - self.rest_force_n } else { self.force[order] }
    }
}

/// The next term of `δ^a`, from `δ·d(δ^a)/dt = a·δ^a·dδ/dt` term by term:
/// `n·δ_0·P_n = Σ_{j=1…n} (j·a − (n − j))·δ_j·P_{n−j}`.
fn next_of_power(exponent: f64, overlap: &[f64], known: &[f64]) -> f64 {
    let n = known.len();
    let mut sum = 0.0;
    for j in 1..=n {
        let weight = j as f64 * exponent - (n - j) as f64;
        sum += weight * overlap[j] * known[n - j];
    }
    sum / (n as f64 * overlap[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::chain::Walls;
    use schemas::damping::ContactDamping;

    /// Two beads of 1 and 2 kg, k = 3.
    fn chain(alpha: f64) -> Chain {
        let law = ContactLaw::new(alpha);
        Chain::new(vec![1.0, 2.0], vec![3.0], vec![0.0], Walls::default(), law)
    }

    #[track_caller]
    fn assert_terms(found: &[f64], bead: usize, expected: [f64; 4]) {
        for (k, expected) in expected.into_iter().enumerate() {
            let is = found[2 * k + bead];
            assert!((is - expected).abs() < 1e-14, "q{} of bead {bead}: {is}, not {expected}", k + 2);
        }
    }

    /// On a linear contact the overlap is `½·cos ωt + ¼·sin ωt/ω` with `ω² = 3/1 + 3/2`, and the masses share
    /// it 2 : −1.
    #[test]
    fn a_linear_contact_gives_the_series_of_its_oscillation() {
        let found = taylor_terms(&chain(1.0), &[0.5, 0.0], &[0.25, 0.0], 1.0);
        let overlap = [-1.125, -0.1875, 0.421_875, 0.042_187_5];
        assert_terms(&found, 0, overlap.map(|q| q * 2.0 / 3.0));
        assert_terms(&found, 1, overlap.map(|q| -q / 3.0));
    }

    /// `F = 3·δ²` at `δ = 1 + t/2 + …`, worked out by hand: `F_0 = 3`, `F_1 = 3`, and with `δ_2 = −9/4` and
    /// `δ_3 = −3/4`, `F_2 = 3·(2·δ_2 + ¼) = −51/4`, `F_3 = 3·(2·δ_3 + 2·½·δ_2) = −45/4`.
    #[test]
    fn a_square_contact_gives_the_series_of_the_square() {
        let found = taylor_terms(&chain(2.0), &[1.0, 0.0], &[0.5, 0.0], 1.0);
        assert_terms(&found, 0, [-3.0 / 2.0, -3.0 / 6.0, 51.0 / 4.0 / 12.0, 45.0 / 4.0 / 20.0]);
    }

    /// A bead of 1 kg on a linear damped contact with a wall, `a = −4·u − 2·v` from u = 1, v = ½: a = −5, its
    /// derivatives −4·½ + 2·5 = 8, 4·5 − 2·8 = 4 and −4·8 − 2·4 = −40. The other bead does not touch it.
    #[test]
    fn a_dashpot_at_a_wall_gives_the_series_of_the_damped_oscillation() {
        let law = ContactLaw::new(1.0);
        let walls = Walls { left: Wall::default(), right: Wall::new(&law, 4.0, 0.5) };
        let contacts = ContactDamping {
            kind: Damping::ViscousNSPerM(2.0),
            coefficient: vec![0.0],
            wall_coefficient: [0.0, 2.0],
        };
        let chain = Chain::new(vec![1.0; 2], vec![3.0], vec![0.0], walls, law);
        let chain = chain.with_damping(Some(contacts));
        let found = taylor_terms(&chain, &[0.0, 1.0], &[0.0, 0.5], 1.0);
        assert_terms(&found, 1, [-5.0 / 2.0, 8.0 / 6.0, 4.0 / 24.0, -40.0 / 120.0]);
        assert_terms(&found, 0, [0.0; 4]);
    }

    /// With α = 3 the damping is by δ: `F = δ³ + δ·dδ/dt` at `δ = 1 + t/2` is `1 + ½` and rises by
    /// `3·½ + ½·½ + δ''`, where the overlap of beads of 2 and 2 kg has `δ'' = −F`.
    #[test]
    fn damping_by_overlap_is_differentiated_too() {
        let restitution = schemas::damping::Restitution { coefficient: 0.5, damping_ratio: 0.2 };
        let kind = Damping::Restitution(restitution);
        let contacts = ContactDamping { kind, coefficient: vec![1.0], wall_coefficient: [0.0; 2] };
        let law = ContactLaw::new(3.0);
        let chain = Chain::new(vec![2.0; 2], vec![1.0], vec![0.0], Walls::default(), law);
        let chain = chain.with_damping(Some(contacts));
        let found = taylor_terms(&chain, &[1.0, 0.0], &[0.5, 0.0], 1.0);
        assert_eq!(found[0], -1.5 / 2.0 / 2.0);
        assert!((found[2] + (1.75 - 1.5) / 2.0 / 6.0).abs() < 1e-15, "{}", found[2]);
    }

    #[test]
    fn contacts_that_are_open_or_open_soon_have_no_derivatives() {
        assert_eq!(taylor_terms(&chain(1.5), &[0.0, 0.0], &[5.0, 0.0], 0.1), [0.0; 8]);
        let opening = taylor_terms(&chain(2.0), &[1.0, 0.0], &[-20.0, 0.0], 0.1);
        assert!(opening[0] < 0.0 && opening[2..] == [0.0; 6], "{opening:?}");
    }

    /// A loaded chain at rest stays exactly there.
    #[test]
    fn a_loaded_chain_at_rest_has_no_derivatives() {
        let law = ContactLaw::new(1.5);
        let wall = Wall::new(&law, 3.0, 0.3);
        let chain = Chain::new(vec![1.0; 2], vec![3.0], vec![0.3], Walls { left: wall, right: wall }, law);
        let found = taylor_terms(&chain, &[0.0; 2], &[0.0; 2], 0.1);
        assert!(found.iter().all(|q| q.to_bits() == 0), "{found:?}");
    }
}
