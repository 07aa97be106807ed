//! The beginning of gear5: the higher derivatives of the motion at step 0.

use schemas::chain::{Chain, Wall};
use schemas::contact::ContactLaw;

/// Terms of the force's series that are needed: those of `dt^0` to `dt^3` give the terms `q2` to `q5` of the
/// displacements.
const FORCE_TERMS: usize = 4;

/// `[q2 | q3 | q4 | q5]` (m, N values each) of the beads at the displacements `u_m` (m) and velocities `v_m_s`
/// (m/s): the exact terms `q_k = dt^k/k!·d^k u/dt^k` of the motion's Taylor series.
///
/// The series of the motion gives the series of each force, which gives the next term of the motion:
/// `q_{k+2} = dt²/((k+1)(k+2))·F_k/m`. Contacts without a force add nothing: a contact that is about to close has no
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
            contact.push(order, left - right);
        }
        let inverse = (dt_s * dt_s) / ((order + 1) * (order + 2)) as f64;
        let net_force = |i: usize| contacts[i].excess_n(order) - contacts[i + 1].excess_n(order);
        terms.push((0..beads).map(|i| (inverse / chain.mass_kg[i]) * net_force(i)).collect());
    }
    terms[1..].concat()
}

/// All contacts from left to right. The first and the last are those with the walls, which have no stiffness at a free
/// end.
fn contacts(chain: &Chain, u_m: &[f64]) -> Vec<Contact> {
    let [left_m, right_m] = chain.wall_approaches_m(u_m, &[]);
    let wall = |wall: &Wall, approach_m: f64| {
        Contact::new(&chain.law, wall.stiffness, wall.rest_force_n, wall.overlap_m(approach_m))
    };
    let between = |c: usize| {
        Contact::new(&chain.law, chain.stiffness[c], chain.rest_force_n[c], chain.overlap_m(u_m, c))
    };
    let mut contacts = vec![wall(&chain.walls.left, left_m)];
    contacts.extend((0..chain.contact_count()).map(between));
    contacts.push(wall(&chain.walls.right, right_m));
    contacts
}

/// The Taylor series of one contact over a time step, up to the known terms.
#[derive(Debug)]
struct Contact {
    alpha: f64,
    stiffness: f64,
    rest_force_n: f64,
    /// Terms (m) of the overlap `δ`, one more than of the other series.
    overlap: Vec<f64>,
    /// Terms of `δ^α`.
    raised: Vec<f64>,
    /// Terms (N) of the force.
    force: Vec<f64>,
}

impl Contact {
    /// A contact with this overlap (m).
    fn new(law: &ContactLaw, stiffness: f64, rest_force_n: f64, overlap_m: f64) -> Self {
        Self {
            alpha: law.alpha(),
            stiffness,
            rest_force_n,
            overlap: vec![overlap_m],
            raised: vec![law.force(1.0, overlap_m)],
            force: vec![law.force(stiffness, overlap_m)],
        }
    }

    /// Takes the term (m) of the overlap of the order `order` + 1, and finds the next term of the force if
    /// `order` > 0.
    ///
    /// A contact that may open or double its overlap within one step keeps a constant force: its series would not
    /// describe the end of the step.
    fn push(&mut self, order: usize, overlap_term_m: f64) {
        self.overlap.push(overlap_term_m);
        if order == 0 {
            return;
        }
        if self.force[0] == 0.0 || self.overlap[1].abs() >= self.overlap[0] {
            return self.force.push(0.0);
        }
        self.raised.push(next_of_power(self.alpha, &self.overlap, &self.raised));
        self.force.push(self.stiffness * self.raised[order]);
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
