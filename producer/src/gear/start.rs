//! The higher derivatives of the motion at step 0.

use schemas::chain::Chain;

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
    let displacements: Vec<f64> = v_m_s.iter().map(|v| v * dt_s).collect();
    // the terms q1, q2, …, one after the other
    let mut terms = vec![displacements];
    let mut contacts: Vec<Contact> =
        (0..chain.contact_count()).map(|c| Contact::new(chain, u_m, c)).collect();
    for order in 0..FORCE_TERMS {
        let force: Vec<f64> = contacts
            .iter_mut()
            .enumerate()
            .map(|(c, contact)| {
                if order > 0 {
                    let last = &terms[order - 1];
                    contact.push(last[c] - last[c + 1]);
                }
                contact.force[order]
            })
            .collect();
        let inverse = (dt_s * dt_s) / ((order + 1) * (order + 2)) as f64;
        let acceleration = |i: usize| {
            let left = if i > 0 { force[i - 1] } else { 0.0 };
            let right = if i + 1 < beads { force[i] } else { 0.0 };
            (inverse / chain.mass_kg[i]) * (left - right)
        };
        terms.push((0..beads).map(acceleration).collect());
    }
    terms[1..].concat()
}

/// The series of one contact's overlap `δ` and of its force `k·δ^α`, as far as they are known.
struct Contact {
    alpha: f64,
    /// Terms (m) of `dt^0`, `dt^1`, ….
    overlap: [f64; FORCE_TERMS],
    /// Terms (N) of `dt^0`, `dt^1`, ….
    force: [f64; FORCE_TERMS],
    known: usize,
}

impl Contact {
    fn new(chain: &Chain, u_m: &[f64], contact: usize) -> Self {
        let (mut overlap, mut force) = ([0.0; FORCE_TERMS], [0.0; FORCE_TERMS]);
        overlap[0] = chain.overlap_m(u_m, contact);
        force[0] = chain.law.force(chain.stiffness[contact], overlap[0]);
        Self { alpha: chain.law.alpha(), overlap, force, known: 1 }
    }

    /// Takes the next term of the overlap, and finds that of the force from `δ·dF/dt = α·F·dδ/dt`, term by term:
    /// `n·δ_0·F_n = Σ_{j=1…n} (j·α − (n − j))·δ_j·F_{n−j}`.
    ///
    /// A contact that may open or double its overlap within one step keeps a constant force: the series
    /// would say nothing about the end of the step.
    fn push(&mut self, overlap_term_m: f64) {
        let n = self.known;
        self.known += 1;
        self.overlap[n] = overlap_term_m;
        if self.force[0] == 0.0 || self.overlap[1].abs() >= self.overlap[0] {
            return;
        }
        let mut sum = 0.0;
        for j in 1..=n {
            let weight = (j as f64).mul_add(self.alpha, -((n - j) as f64));
            sum = (weight * self.overlap[j]).mul_add(self.force[n - j], sum);
        }
        self.force[n] = sum / (n as f64 * self.overlap[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::contact::ContactLaw;

    fn chain(alpha: f64) -> Chain {
        Chain {
            mass_kg: vec![1.0, 2.0],
            stiffness: vec![3.0],
            rest_overlap_m: vec![0.0],
            law: ContactLaw::new(alpha),
        }
    }

    /// Two masses of 1 and 2 kg on a spring of 3 N/m: the overlap is `½·cos ωt + ¼·sin ωt/ω` with
    /// `ω² = 3/1 + 3/2`, and the masses share it 2 : −1.
    #[test]
    fn a_linear_contact_gives_the_series_of_its_oscillation() {
        let found = taylor_terms(&chain(1.0), &[0.5, 0.0], &[0.25, 0.0], 1.0);
        let overlap = [-1.125, -0.1875, 0.421_875, 0.042_187_5];
        for (k, q) in overlap.into_iter().enumerate() {
            for (bead, share) in [(0, 2.0 / 3.0), (1, -1.0 / 3.0)] {
                let (is, expected) = (found[2 * k + bead], share * q);
                assert!((is - expected).abs() < 1e-13, "q{} of bead {bead}: {is}, not {expected}", k + 2);
            }
        }
    }

    /// `F = 3·δ²` at `δ = 1 + t/2 + …`, worked out by hand: `F_0 = 3`, `F_1 = 3`, and with `δ_2 = −9/4` and
    /// `δ_3 = −3/4`, `F_2 = 3·(2·δ_2 + ¼) = −51/4`, `F_3 = 3·(2·δ_3 + 2·½·δ_2) = −45/4`.
    #[test]
    fn a_square_contact_gives_the_series_of_the_square() {
        let found = taylor_terms(&chain(2.0), &[1.0, 0.0], &[0.5, 0.0], 1.0);
        let of_bead_0: Vec<f64> = found.iter().step_by(2).copied().collect();
        let expected = [3.0 / 2.0, 3.0 / 6.0, -51.0 / 4.0 / 12.0, -45.0 / 4.0 / 20.0];
        for (is, expected) in of_bead_0.iter().zip(expected) {
            assert!((is + expected).abs() < 1e-14, "{is}, not −{expected}");
        }
    }

    #[test]
    fn contacts_that_are_open_or_open_soon_have_no_derivatives() {
        assert_eq!(taylor_terms(&chain(1.5), &[0.0, 0.0], &[5.0, 0.0], 0.1), [0.0; 8]);
        let opening = taylor_terms(&chain(2.0), &[1.0, 0.0], &[-20.0, 0.0], 0.1);
        assert!(opening[0] < 0.0 && opening[2..] == [0.0; 6], "{opening:?}");
    }
}
