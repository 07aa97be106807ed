//! Energies of all modes of a state at once: by a Fourier transform where modes are waves, by a matrix elsewhere.

use crate::linear::LinearChain;
use crate::modes::{Modes, ModesError};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Takes states apart into the modes of their chain.
pub struct Modal {
    omega_rad_s: Vec<f64>,
    parts: Parts,
}

enum Parts {
    Matrix(Box<Modes>),
    /// Equal beads and springs. Displacements and velocities are the real and imaginary parts of one transform.
    Waves {
        kind: Kind,
        /// The time (s) by which velocities are multiplied: in one transform they are of the size of the displacements, whatever the units are.
        unit_s: f64,
        /// Energies (J) of each mode for a displacement and a velocity of 1 in the transform.
        weights: Vec<[f64; 2]>,
        /// Turns by half a place, of chains with free ends.
        turns: Vec<Complex<f64>>,
        fft: Arc<dyn Fft<f64>>,
        numbers: Vec<Complex<f64>>,
        scratch: Vec<Complex<f64>>,
    },
}

/// The ends of a chain of equal beads, and its waves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Walls: sines.
    Fixed,
    /// Free ends: cosines.
    Free,
    /// A ring: cosines and sines.
    Ring,
}

impl Modal {
    /// The modes of `chain`, in the order of their frequencies; in a ring of equal beads the cosine of a wave before its sine.
    ///
    /// # Errors
    /// When there are too many beads for a matrix, or the equilibrium is unstable.
    pub fn of(chain: &LinearChain) -> Result<Self, ModesError> {
        let Some(kind) = Kind::of(chain) else {
            let modes = Modes::of(chain)?;
            return Ok(Self {
                omega_rad_s: modes.omega_rad_s().to_vec(),
                parts: Parts::Matrix(Box::new(modes)),
            });
        };
        let (beads, mass_kg) = (chain.bead_count(), chain.mass_kg[0]);
        let (stiffness, tied) = (chain.contact_n_per_m[0], chain.on_site_n_per_m[0]);
        let omega = |mode: usize| {
            let half_angle = PI * kind.wave(mode) as f64 / kind.period(beads) as f64;
            ((4.0 * stiffness * half_angle.sin().powi(2) + tied) / mass_kg).sqrt()
        };
        let period = kind.period(beads);
        let omega_rad_s: Vec<f64> = (0..beads).map(omega).collect();
        let fastest_rad_s =
            omega_rad_s.iter().fold(0.0, |most, omega| if *omega > most { *omega } else { most });
        // a power of two, which changes no digit
        let unit_s = (0.0 - fastest_rad_s.log2().round()).exp2();
        let weight = |(mode, omega): (usize, &f64)| {
            let per_square = 0.5 * mass_kg * kind.norm(mode, beads);
            [per_square * (omega * omega), per_square / (unit_s * unit_s)]
        };
        let turn = |wave: usize| Complex::from_polar(1.0, -PI * wave as f64 / period as f64);
        let fft = FftPlanner::new().plan_fft_forward(period);
        let none = Complex::new(0.0, 0.0);
        let parts = Parts::Waves {
            kind,
            unit_s,
            weights: omega_rad_s.iter().enumerate().map(weight).collect(),
            turns: (0..if kind == Kind::Free { beads } else { 0 }).map(turn).collect(),
            numbers: vec![none; period],
            scratch: vec![none; fft.get_inplace_scratch_len()],
            fft,
        };
        Ok(Self { omega_rad_s, parts })
    }

    /// Number of modes of a chain, without looking for them.
    ///
    /// # Errors
    /// When there are too many beads for a matrix.
    pub fn count_of(chain: &LinearChain) -> Result<usize, ModesError> {
        if Kind::of(chain).is_some() { Ok(chain.bead_count()) } else { Modes::count_of(chain) }
    }

    /// Frequency of mode `mode` (Hz), counted from 0.
    pub fn frequency_hz(&self, mode: usize) -> f64 {
        self.omega_rad_s[mode] / TAU
    }

    /// Number of modes.
    pub fn count(&self) -> usize {
        self.omega_rad_s.len()
    }

    /// The energy (J) in each mode of a state, `½(ẏ² + ω²·y²)`, into `energies_j`; of a chain with resonators their numbers stand after those of the
    /// beads.
    pub fn energies_j(&mut self, u_m: &[f64], v_m_s: &[f64], energies_j: &mut Vec<f64>) {
        energies_j.clear();
        let omega = &self.omega_rad_s;
        match &mut self.parts {
            Parts::Matrix(modes) => {
                energies_j.extend((0..omega.len()).map(|mode| modes.energy_j(mode, u_m, v_m_s)));
            }
            Parts::Waves { kind, unit_s, weights, turns, fft, numbers, scratch } => {
                kind.spread(u_m, (v_m_s, *unit_s), numbers);
                fft.process_with_scratch(numbers, scratch);
                energies_j.extend(weights.iter().enumerate().map(|(mode, [of_place, of_velocity])| {
                    let [place, velocity] = kind.parts(mode, numbers, turns);
                    of_place * (place * place) + of_velocity * (velocity * velocity)
                }));
            }
        }
    }
}

impl Kind {
    /// The waves of `chain`, if all of its beads and springs are alike.
    fn of(chain: &LinearChain) -> Option<Self> {
        if !chain.is_uniform() {
            return None;
        }
        let stiffness = chain.contact_n_per_m[0];
        match (chain.wall_n_per_m, chain.ring_n_per_m) {
            _ if chain.is_uniform_ring() => Some(Self::Ring),
            (walls, 0.0) if walls == [stiffness; 2] => Some(Self::Fixed),
            ([0.0, 0.0], 0.0) => Some(Self::Free),
            _ => None,
        }
    }

    /// Places of a period of the waves of `beads` beads.
    fn period(self, beads: usize) -> usize {
        match self {
            Self::Fixed => 2 * (beads + 1),
            Self::Free => 2 * beads,
            Self::Ring => beads,
        }
    }

    /// Waves in a period, of mode `mode`.
    fn wave(self, mode: usize) -> usize {
        match self {
            Self::Fixed => mode + 1,
            Self::Free => mode,
            Self::Ring => mode.div_ceil(2),
        }
    }

    /// Writes the state, velocities times `unit_s`, and its mirror image, if it has one, as a period.
    fn spread(self, u_m: &[f64], (v_m_s, unit_s): (&[f64], f64), numbers: &mut [Complex<f64>]) {
        let (beads, period) = (u_m.len(), numbers.len());
        let at = |bead: usize| Complex::new(u_m[bead], unit_s * v_m_s[bead]);
        if self == Self::Fixed {
            // the walls, where the transform before left its own numbers
            (numbers[0], numbers[beads + 1]) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
        }
        for bead in 0..beads {
            match self {
                Self::Fixed => (numbers[bead + 1], numbers[period - 1 - bead]) = (at(bead), -at(bead)),
                Self::Free => (numbers[bead], numbers[period - 1 - bead]) = (at(bead), at(bead)),
                Self::Ring => numbers[bead] = at(bead),
            }
        }
    }

    /// The square of the factor from [`parts`](Self::parts) to those along the unit vector of mode `mode`.
    fn norm(self, mode: usize, beads: usize) -> f64 {
        let is_alone = self != Self::Fixed && (mode == 0 || 2 * self.wave(mode) == self.period(beads));
        let places = if self == Self::Fixed { beads + 1 } else { beads };
        (if is_alone { 0.25 } else { 0.5 }) / places as f64
    }

    /// Displacement and velocity of mode `mode`, but for their sign and a factor, from the transform: that of displacements is imaginary between
    /// walls, and real but for a turn between free ends.
    #[inline(always)]
    fn parts(self, mode: usize, numbers: &[Complex<f64>], turns: &[Complex<f64>]) -> [f64; 2] {
        match self {
            Self::Fixed => [numbers[mode + 1].im, numbers[mode + 1].re],
            Self::Free => {
                let turned = numbers[mode] * turns[mode];
                [turned.re, turned.im]
            }
            Self::Ring => {
                let wave = self.wave(mode);
                let (here, there) =
                    (numbers[wave], numbers[if wave == 0 { 0 } else { numbers.len() - wave }]);
                let is_cosine = mode % 2 == 1 || mode == 0;
                if is_cosine {
                    [here.re + there.re, here.im + there.im]
                } else {
                    [here.im - there.im, here.re - there.re]
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::tests::chain;

    fn state(count: usize) -> [Vec<f64>; 2] {
        let of = |seed: usize| (0..count).map(|i| ((i * i * 7 + seed * i + 3) % 11) as f64 - 4.5).collect();
        [of(5), of(2)]
    }

    /// Energies of single modes, and their sum, which is all of the energy.
    #[test]
    fn waves_have_the_energies_that_the_matrix_finds() {
        for beads in [2, 3, 4, 7, 8, 16, 24, 33, 64] {
            let (fixed, mut ring) = (chain(beads, &[2.0], 3.0, 3.0), chain(beads, &[2.0], 3.0, 0.0));
            let mut held = chain(beads, &[2.0], 3.0, 0.0);
            held.on_site_n_per_m = vec![0.7; beads];
            ring.ring_n_per_m = 3.0;
            let chains = [fixed, chain(beads, &[2.0], 3.0, 0.0), held, ring];
            for chain in chains.iter().filter(|chain| chain.ring_n_per_m == 0.0 || beads > 2) {
                let (mut waves, modes) = (Modal::of(chain).expect("modes"), Modes::of(chain).expect("modes"));
                assert!(matches!(waves.parts, Parts::Waves { .. }));
                let [u, v] = state(beads);
                let mut found = Vec::new();
                // nothing is left of a state in the next one
                (0..200).for_each(|_| waves.energies_j(&u, &v, &mut found));
                let expected: Vec<f64> = (0..beads).map(|mode| modes.energy_j(mode, &u, &v)).collect();
                let total: f64 = expected.iter().sum();
                assert!((found.iter().sum::<f64>() / total - 1.0).abs() < 1e-12);
                for mode in 0..beads {
                    let gap = (waves.omega_rad_s[mode] - modes.omega_rad_s()[mode]).abs();
                    assert!(gap < 1e-7, "{beads} beads, mode {mode}: {gap:e}");
                    let gap = (found[mode] - expected[mode]).abs();
                    assert!(gap < 1e-11 * total, "{beads} beads, mode {mode}: {gap:e}");
                }
            }
        }
    }

    /// Another unit of time changes no digit that counts, however small or large velocities become.
    #[test]
    fn energies_do_not_depend_on_the_unit_of_time() {
        for powers in [-100, -40, 0, 40, 100] {
            let unit = 2.0_f64.powi(powers);
            let stiffness = 3.0 * unit * unit;
            let mut modal = Modal::of(&chain(33, &[2.0], stiffness, stiffness)).expect("modes");
            let mode: Vec<f64> = (1..=33).map(|i| (PI * f64::from(i) / 34.0).sin()).collect();
            let v: Vec<f64> = mode.iter().map(|u| 0.3 * unit * u).collect();
            let mut found = Vec::new();
            modal.energies_j(&mode, &v, &mut found);
            let rest: f64 = found[1..].iter().sum();
            assert!(rest < 1e-28 * found[0], "{powers}: {}", rest / found[0]);
        }
    }

    #[test]
    fn masses_in_turn_have_a_matrix() {
        assert!(matches!(
            Modal::of(&chain(6, &[1.0, 2.0], 1.0, 1.0)).expect("modes").parts,
            Parts::Matrix(_)
        ));
    }
}
