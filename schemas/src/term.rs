//! Further terms of the force of a contact: a second power, two-sided springs, Toda's exponential.

use crate::contact::{ContactLaw, Power, PowerUser, evaluate};
use crate::excess::{AtRest, Excess};
use crate::functions::{exp_m1, q2};

/// How the force of a term depends on the overlap δ.
#[derive(Debug, Clone, PartialEq)]
pub enum TermLaw {
    /// `k·δ^α` where the contact is closed.
    Power(ContactLaw),
    /// `k·δ^n` with n = 1, 2 or 3, also where δ < 0.
    Spring(u8),
    /// `k·(exp(b·δ) − 1)/b`, b in 1/m.
    Toda(f64),
}

/// A term of the forces of all contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// How it depends on the overlap.
    pub law: TermLaw,
    /// Stiffness of each contact (N over the unit of what the law gives), N − 1 values; 0 where a contact has no such term.
    pub stiffness: Vec<f64>,
    /// The same of the contacts with the left and the right wall; of a ring the first is that of its last contact.
    pub wall_stiffness: [f64; 2],
}

impl TermLaw {
    /// Force (N) at the overlap `overlap_m` (m).
    pub fn force(&self, stiffness: f64, overlap_m: f64) -> f64 {
        match self {
            Self::Power(law) => law.force(stiffness, overlap_m),
            Self::Spring(1) => stiffness * overlap_m,
            Self::Spring(2) => stiffness * (overlap_m * overlap_m),
            Self::Spring(_) => stiffness * (overlap_m * overlap_m * overlap_m),
            Self::Toda(b) => stiffness * (exp_m1(b * overlap_m) / b),
        }
    }

    /// Slope dF/dδ (N/m).
    pub fn tangent(&self, stiffness: f64, overlap_m: f64) -> f64 {
        match self {
            Self::Power(law) => law.tangent(stiffness, overlap_m),
            Self::Spring(1) => stiffness,
            Self::Spring(2) => 2.0 * stiffness * overlap_m,
            Self::Spring(_) => 3.0 * stiffness * (overlap_m * overlap_m),
            Self::Toda(b) => stiffness * (exp_m1(b * overlap_m) + 1.0),
        }
    }

    /// Energy (J) beyond that at rest, less the work of the force at rest, of a contact whose beads are `approach_m` nearer than
    /// at the rest overlap `rest_m`. `is_loaded`: whether any contact of the chain has a rest overlap.
    pub fn excess_j(&self, stiffness: f64, rest_m: f64, approach_m: f64, is_loaded: bool) -> f64 {
        let a = approach_m;
        match self {
            Self::Power(law) => {
                let energy_j = law.energy(stiffness, a + rest_m);
                if !is_loaded {
                    return energy_j;
                }
                let rest = AtRest {
                    overlap_m: rest_m,
                    force_n: law.force(stiffness, rest_m),
                    energy_j: law.energy(stiffness, rest_m),
                };
                Excess::new(law).energy_j(rest, a, energy_j)
            }
            Self::Spring(1) => 0.5 * stiffness * (a * a),
            Self::Spring(2) => stiffness * (a * a) * (rest_m + a / 3.0),
            Self::Spring(_) => {
                stiffness * (a * a) * ((1.5 * (rest_m * rest_m) + rest_m * a) + 0.25 * (a * a))
            }
            Self::Toda(b) => {
                let x = b * a;
                let shape = if x.abs() <= 0.34 { a * a * q2(x) } else { (exp_m1(x) / b - a) / b };
                stiffness * (exp_m1(b * rest_m) + 1.0) * shape
            }
        }
    }

    /// Writes the force (N) of neighbouring contacts into `force_n`, which has one value for each. `u_m` has the displacements of
    /// their beads, one more than there are contacts; the others are as in [`Chain`](crate::chain::Chain).
    ///
    /// Call it through [`vectorized`](crate::simd::vectorized).
    #[inline(always)]
    pub fn forces(&self, u_m: &[f64], stiffness: &[f64], rest_overlap_m: &[f64], force_n: &mut [f64]) {
        let contacts = force_n.len();
        let (left_m, right_m) = (&u_m[..contacts], &u_m[1..=contacts]);
        let (stiffness, rest_m) = (&stiffness[..contacts], &rest_overlap_m[..contacts]);
        match self {
            Self::Power(law) => law.with_power(Powers {
                known: [left_m, right_m, stiffness, rest_m],
                force_n,
                zero_up_to_m: law.zero_up_to_m(),
            }),
            Self::Spring(n) => {
                for c in 0..contacts {
                    let overlap_m = (left_m[c] - right_m[c]) + rest_m[c];
                    force_n[c] = match n {
                        1 => stiffness[c] * overlap_m,
                        2 => stiffness[c] * (overlap_m * overlap_m),
                        _ => stiffness[c] * (overlap_m * overlap_m * overlap_m),
                    };
                }
            }
            Self::Toda(b) => {
                for c in 0..contacts {
                    let overlap_m = (left_m[c] - right_m[c]) + rest_m[c];
                    force_n[c] = stiffness[c] * (exp_m1(b * overlap_m) / b);
                }
            }
        }
    }

    /// What it is called in files, and its parameter there.
    pub fn named(&self) -> (&'static str, f64) {
        match self {
            Self::Power(law) => ("power", law.alpha()),
            Self::Spring(n) => ("spring", f64::from(*n)),
            Self::Toda(b) => ("toda", *b),
        }
    }
}

struct Powers<'a> {
    known: [&'a [f64]; 4],
    force_n: &'a mut [f64],
    zero_up_to_m: f64,
}

impl PowerUser for Powers<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        evaluate(
            self.known,
            self.force_n,
            power,
            self.zero_up_to_m,
            #[inline(always)]
            |[left, right, _, rest]| (left - right) + rest,
            #[inline(always)]
            |[_, _, stiffness, _], _, power| stiffness * power,
            #[inline(always)]
            |_, any_closed| any_closed,
        );
    }
}
