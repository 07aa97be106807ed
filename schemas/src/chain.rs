//! The resolved chain: one number for each bead and each contact, and sums over them.

use crate::contact::{ContactLaw, PowerUser};
use std::ops::Range;

/// Masses, stiffnesses and rest overlaps after all rules of a configuration have been applied.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Mass of each bead (kg), N values.
    pub mass_kg: Vec<f64>,
    /// Stiffness of each contact (N·m^−α), N − 1 values; contact `i` joins beads `i` and `i + 1`.
    pub stiffness: Vec<f64>,
    /// Overlap of each contact (m) when both displacements are 0, N − 1 values.
    pub rest_overlap_m: Vec<f64>,
    /// The contact law of every contact.
    pub law: ContactLaw,
}

/// Kinetic and potential energy (J) of a part of a chain.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energy {
    /// Σ ½·m·v² (J).
    pub kinetic_j: f64,
    /// Σ k·δ^(α+1)/(α+1) (J).
    pub potential_j: f64,
}

impl Energy {
    /// Kinetic plus potential energy (J).
    pub fn total_j(&self) -> f64 {
        self.kinetic_j + self.potential_j
    }
}

impl Chain {
    /// Number of beads N.
    pub fn bead_count(&self) -> usize {
        self.mass_kg.len()
    }

    /// Number of contacts, N − 1.
    pub fn contact_count(&self) -> usize {
        self.stiffness.len()
    }

    /// Overlap (m) of contact `contact` for the displacements `u_m` (N values, m).
    pub fn overlap_m(&self, u_m: &[f64], contact: usize) -> f64 {
        u_m[contact] - u_m[contact + 1] + self.rest_overlap_m[contact]
    }

    /// Kinetic energy (J) of the beads `beads` at the velocities `v_m_s` (N values, m/s), as an
    /// [`ordered_sum`].
    pub fn kinetic_j(&self, v_m_s: &[f64], beads: Range<usize>) -> f64 {
        let (masses, v) = (&self.mass_kg[beads.clone()], &v_m_s[beads]);
        ordered_sum(masses.len(), |i| 0.5 * masses[i] * (v[i] * v[i]))
    }

    /// Writes the potential energy (J) of every contact into `energy_j` (N − 1 values).
    pub fn contact_energies_j(&self, u_m: &[f64], energy_j: &mut [f64]) {
        let chain = self;
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || chain.law.with_power(ContactEnergies { chain, u_m, energy_j }),
        );
    }

    /// Kinetic and potential energy of the whole chain. `scratch` holds N − 1 values.
    pub fn energy(&self, u_m: &[f64], v_m_s: &[f64], scratch: &mut [f64]) -> Energy {
        self.contact_energies_j(u_m, scratch);
        Energy {
            kinetic_j: self.kinetic_j(v_m_s, 0..self.bead_count()),
            potential_j: ordered_sum(scratch.len(), |c| scratch[c]),
        }
    }
}

/// `Σ term(i)` for `i < count` in an order that is the same at any SIMD width: eight interleaved
/// partial sums, added up in pairs.
///
/// ```
/// assert_eq!(schemas::chain::ordered_sum(10, |i| i as f64), 45.0);
/// ```
#[inline(always)]
pub fn ordered_sum(count: usize, term: impl Fn(usize) -> f64) -> f64 {
    let mut partial = [0.0; 8];
    let whole = count - count % 8;
    for base in (0..whole).step_by(8) {
        for (lane, sum) in partial.iter_mut().enumerate() {
            *sum += term(base + lane);
        }
    }
    for (lane, i) in (whole..count).enumerate() {
        partial[lane] += term(i);
    }
    let [a, b, c, d, e, f, g, h] = partial;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// The loop behind [`Chain::contact_energies_j`], one copy for each form of the power.
struct ContactEnergies<'a> {
    chain: &'a Chain,
    u_m: &'a [f64],
    energy_j: &'a mut [f64],
}

impl PowerUser for ContactEnergies<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, zero_below_m: f64, power: impl Fn(f64) -> f64 + Copy) {
        let contacts = self.chain.contact_count();
        let (left, right) = (&self.u_m[..contacts], &self.u_m[1..=contacts]);
        let (stiffness, rest) = (&self.chain.stiffness[..contacts], &self.chain.rest_overlap_m[..contacts]);
        let energy_j = &mut self.energy_j[..contacts];
        let exponent = self.chain.law.alpha() + 1.0;
        for c in 0..contacts {
            let overlap = left[c] - right[c] + rest[c];
            let closed = overlap > zero_below_m;
            let d = if closed { overlap } else { 1.0 };
            let energy = stiffness[c] * power(d) * d / exponent;
            energy_j[c] = if closed { energy } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(alpha: f64) -> Chain {
        Chain {
            mass_kg: vec![1.0, 2.0, 4.0],
            stiffness: vec![10.0, 10.0],
            rest_overlap_m: vec![0.0, 0.0],
            law: ContactLaw::new(alpha),
        }
    }

    #[test]
    fn energies_worked_out_by_hand() {
        let chain = chain(3.0);
        // overlaps 0.5 (closed) and −0.5 (open): 10·0.5⁴/4; ½(1·4 + 2·1 + 4·0)
        let energy = chain.energy(&[0.5, 0.0, 0.5], &[2.0, -1.0, 0.0], &mut [0.0; 2]);
        assert_eq!(energy, Energy { kinetic_j: 3.0, potential_j: 0.15625 });
        assert_eq!(energy.total_j(), 3.15625);
    }

    #[test]
    fn vectorised_energies_equal_the_law_bit_for_bit() {
        for alpha in [1.0, 1.3, 1.5, 2.0, 3.0, 5.0, 10.0] {
            let law = ContactLaw::new(alpha);
            let u_m: Vec<f64> = (0..40_u32).map(|i| f64::from((i * 37) % 17) * 1e-5).collect();
            let chain = Chain {
                mass_kg: vec![1.0; 40],
                stiffness: vec![1e7; 39],
                rest_overlap_m: vec![0.0; 39],
                law,
            };
            let mut energy_j = vec![0.0; 39];
            chain.contact_energies_j(&u_m, &mut energy_j);
            for (c, energy) in energy_j.iter().enumerate() {
                assert_eq!(*energy, law.energy(1e7, chain.overlap_m(&u_m, c)), "α = {alpha}");
            }
        }
    }
}
