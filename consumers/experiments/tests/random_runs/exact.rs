//! Runs without roundings: the steps of a run in pairs of doubles, which hold 106 bits.

use schemas::chain::Chain;
use schemas::manifest::Physics;
use schemas::method::Method;
use std::ops::{Add, Mul, Sub};

/// A number as the sum of two doubles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pair(pub(crate) f64, pub(crate) f64);

impl Pair {
    /// `a + b`, without an error.
    fn sum(a: f64, b: f64) -> Self {
        let sum = a + b;
        let of_b = sum - a;
        Self(sum, (a - (sum - of_b)) + (b - of_b))
    }

    fn sqrt(self) -> Self {
        let root = self.0.sqrt();
        let square = Self(root * root, root.mul_add(root, -(root * root)));
        Self::sum(root, (self - square).0 / (2.0 * root))
    }
}

impl From<f64> for Pair {
    fn from(number: f64) -> Self {
        Self(number, 0.0)
    }
}

impl Add for Pair {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let Self(high, low) = Self::sum(self.0, other.0);
        let Self(lower, lowest) = Self::sum(self.1, other.1);
        let Self(high, low) = Self::sum(high, low + lower);
        Self::sum(high, low + lowest)
    }
}

impl Sub for Pair {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + Self(-other.0, -other.1)
    }
}

impl Mul for Pair {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let high = self.0 * other.0;
        let low = self.0.mul_add(other.0, -high) + (self.0 * other.1 + self.1 * other.0);
        Self::sum(high, low)
    }
}

/// Kicks and drifts of a step of `rkn4`, as `docs/KERNEL.md` has them, but for the last kick.
const RKN4: [(f64, f64); 6] = {
    const A: [f64; 2] = [0.245_298_957_184_271, 0.604_872_665_711_080];
    const B: [f64; 3] = [0.082_984_406_417_405_2, 0.396_309_801_498_368, -0.039_056_304_922_348_6];
    const A3: f64 = 0.5 - (A[0] + A[1]);
    const B4: f64 = 1.0 - 2.0 * (B[0] + B[1] + B[2]);
    [(B[0], A[0]), (B[1], A[1]), (B[2], A3), (B4, A3), (B[2], A[1]), (B[1], A[0])]
};

/// A run of a chain of one power between walls or free ends.
pub(crate) struct Exact {
    chain: Chain,
    /// Kicks and drifts (s) of a step, and the last kick.
    stages: Vec<(f64, f64)>,
    last_s: f64,
    pub(crate) u_m: Vec<Pair>,
    v_m_s: Vec<Pair>,
    step: u64,
}

impl Exact {
    pub(crate) fn new(physics: &Physics) -> Self {
        let (stages, last) = match physics.method {
            Method::VelocityVerlet => (&[(0.5, 1.0)][..], 0.5),
            _ => (&RKN4[..], RKN4[0].0),
        };
        let dt_s = physics.dt_s;
        let (u_m, v_m_s) = physics.initial_state();
        let [u_m, v_m_s] = [u_m, v_m_s].map(|numbers| numbers.into_iter().map(Pair::from).collect());
        let stages = stages.iter().map(|(kick, drift)| (dt_s * kick, dt_s * drift)).collect();
        Self { chain: physics.chain(), stages, last_s: dt_s * last, u_m, v_m_s, step: 0 }
    }

    /// Goes on to `step`.
    pub(crate) fn advance_to(&mut self, step: u64) {
        while self.step < step {
            for (kick_s, drift_s) in self.stages.clone() {
                self.kick(kick_s);
                self.u_m.iter_mut().zip(&self.v_m_s).for_each(|(u, v)| *u = *u + *v * drift_s.into());
            }
            self.kick(self.last_s);
            self.step += 1;
        }
    }

    fn kick(&mut self, kick_s: f64) {
        let (chain, last) = (&self.chain, self.u_m.len() - 1);
        let force = |contact: usize| -> Pair {
            let (overlap, stiffness) = match contact {
                0 if chain.walls.left.is_there => {
                    let wall = &chain.walls.left;
                    (Pair::from(wall.rest_overlap_m) - self.u_m[0], wall.stiffness)
                }
                _ if contact == last + 1 && chain.walls.right.is_there => {
                    let wall = &chain.walls.right;
                    (self.u_m[last] + wall.rest_overlap_m.into(), wall.stiffness)
                }
                _ if contact == 0 || contact == last + 1 => return 0.0.into(),
                _ => {
                    let rest = Pair::from(chain.rest_overlap_m[contact - 1]);
                    (self.u_m[contact - 1] - self.u_m[contact] + rest, chain.stiffness[contact - 1])
                }
            };
            if overlap.0 <= 0.0 {
                return 0.0.into();
            }
            let alpha = chain.law.alpha();
            let power = if alpha == 1.5 { overlap * overlap.sqrt() } else { overlap * overlap };
            let power = if alpha == 3.0 { power * overlap } else { power };
            power * stiffness.into()
        };
        let forces: Vec<_> = (0..=last + 1).map(force).collect();
        for (bead, v) in self.v_m_s.iter_mut().enumerate() {
            let inverse = Pair::from(1.0 / chain.mass_kg[bead]);
            let inverse = inverse + inverse * (Pair::from(1.0) - inverse * chain.mass_kg[bead].into());
            *v = *v + (forces[bead] - forces[bead + 1]) * Pair::from(kick_s) * inverse;
        }
    }
}
