//! The modes of a chain about its equilibrium.

use crate::eigen::{Eigen, Square};
use crate::linear::LinearChain;
use schemas::functions::sine_cosine;
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// The modes of a linear chain, by ascending frequency.
///
/// With `y = √m·u` the equations of motion are `ÿ = −D·y`, D symmetric; a mode is an eigenvector of D, and ω² its
/// eigenvalue, which is good to rounding of the largest: the lowest ω have fewer digits where masses or springs are far apart.
#[derive(Debug, Clone)]
pub struct Modes {
    omega_rad_s: Vec<f64>,
    /// A row for each mode, of unit length, with a number for each bead (and then each resonator).
    vectors: Square,
    root_mass: Vec<f64>,
    beads: usize,
    /// The bead of each resonator, in the order of the rows.
    carriers: Vec<usize>,
}

/// Reason why there are no modes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModesError {
    /// Too large for a dense matrix.
    #[error("{count} beads and resonators are too many for modes, which need N² numbers: at most {most}")]
    TooMany {
        /// Beads and resonators.
        count: usize,
        /// The largest number.
        most: usize,
    },
    /// The equilibrium is none that the chain stays at.
    #[error("the equilibrium is unstable: mode {mode} grows as exp(t·{rate_per_s:e}/s)")]
    Unstable {
        /// The mode, counted from 1.
        mode: usize,
        /// Its growth rate (1/s).
        rate_per_s: f64,
    },
    /// The eigenvalues did not converge.
    #[error("the frequencies could not be computed: the masses or springs are too far apart")]
    NotFound,
}

impl Modes {
    /// The largest number of beads and resonators; the matrix then takes 128 MiB.
    pub const MOST: usize = 4096;

    /// The number of modes of `chain`: one for each bead and each resonator.
    ///
    /// # Errors
    /// When they are more than [`Modes::MOST`].
    pub fn count_of(chain: &LinearChain) -> Result<usize, ModesError> {
        let beads = chain.bead_count();
        let count = beads + (0..beads).filter(|bead| chain.resonator(*bead).is_some()).count();
        if count > Self::MOST {
            return Err(ModesError::TooMany { count, most: Self::MOST });
        }
        Ok(count)
    }

    /// The modes of `chain`.
    ///
    /// # Errors
    /// When there are too many beads, or the equilibrium is unstable.
    pub fn of(chain: &LinearChain) -> Result<Self, ModesError> {
        let count = Self::count_of(chain)?;
        let beads = chain.bead_count();
        if chain.is_uniform_ring() {
            let root_mass = vec![chain.mass_kg[0].sqrt(); beads];
            return Self::sorted(chain, &links(chain, &[]), waves_of_ring(chain), root_mass, Vec::new());
        }
        let carriers: Vec<usize> = (0..beads).filter(|bead| chain.resonator(*bead).is_some()).collect();
        let links = links(chain, &carriers);
        let inner = carriers.iter().filter_map(|bead| chain.resonator(*bead));
        let masses = chain.mass_kg.iter().copied().chain(inner.map(|inner| inner.mass_kg));
        let root_mass: Vec<f64> = masses.map(f64::sqrt).collect();
        let mut springs = Square::zeros(count);
        for bead in 0..beads {
            *springs.at(bead, bead) += chain.tied_n_per_m(bead);
        }
        for &(one, other, k) in &links {
            *springs.at(one, one) += k;
            *springs.at(other, other) += k;
            *springs.at(one, other) -= k;
            *springs.at(other, one) -= k;
        }
        for row in 0..count {
            for column in 0..count {
                *springs.at(row, column) /= root_mass[row] * root_mass[column];
            }
        }
        let eigen = Eigen::of(springs).ok_or(ModesError::NotFound)?;
        Self::sorted(chain, &links, eigen, root_mass, carriers)
    }

    fn sorted(
        chain: &LinearChain,
        links: &[(usize, usize, f64)],
        Eigen { values, vectors }: Eigen,
        root_mass: Vec<f64>,
        carriers: Vec<usize>,
    ) -> Result<Self, ModesError> {
        let (count, beads) = (values.len(), chain.bead_count());
        let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        // rounding makes the zero of a free translation one of this size
        let zero = largest * f64::EPSILON * 32.0 * count as f64;
        let free = free_pieces(chain, links, count);
        // the energy of the springs, whose rounding is that of each of them
        let by_springs = |mode: usize| {
            let parts = vectors.row(mode).iter().zip(&root_mass);
            let u: Vec<f64> = parts.map(|(part, root_kg)| part / root_kg).collect();
            let tied = (0..beads).map(|bead| chain.tied_n_per_m(bead) * u[bead].powi(2)).sum::<f64>();
            tied + links.iter().map(|&(one, other, k)| k * (u[one] - u[other]).powi(2)).sum::<f64>()
        };
        let mut omega_rad_s = Vec::with_capacity(count);
        for (index, square) in values.into_iter().enumerate() {
            if square < -zero {
                return Err(ModesError::Unstable { mode: index + 1, rate_per_s: (-square).sqrt() });
            }
            omega_rad_s.push(if square > zero {
                square.sqrt()
            } else if index < free {
                0.0
            } else {
                by_springs(index).max(0.0).sqrt()
            });
        }
        Ok(Self { omega_rad_s, vectors, root_mass, beads, carriers })
    }

    /// Number of modes.
    pub fn count(&self) -> usize {
        self.omega_rad_s.len()
    }

    /// ω of each mode (rad/s), ascending.
    pub fn omega_rad_s(&self) -> &[f64] {
        &self.omega_rad_s
    }

    /// Frequency of mode `mode` (Hz), counted from 0 here.
    pub fn frequency_hz(&self, mode: usize) -> f64 {
        self.omega_rad_s[mode] / TAU
    }

    /// Displacement of each bead in a mode, N values, the largest of them 1.
    pub fn shape(&self, mode: usize) -> Vec<f64> {
        let shape = self.unit_shape(mode);
        let farthest = shape.iter().fold(0.0_f64, |far, u| if u.abs() > far.abs() { *u } else { far });
        if farthest == 0.0 {
            return shape;
        }
        shape.into_iter().map(|u| u / farthest).collect()
    }

    /// Displacement of each bead in a mode for `ẏ = 1` along its unit vector: with velocities of this size its energy is ½ J.
    pub fn unit_shape(&self, mode: usize) -> Vec<f64> {
        let parts = self.vectors.row(mode).iter().zip(&self.root_mass).take(self.beads);
        parts.map(|(part, root_kg)| part / root_kg).collect()
    }

    /// The part of a mode's kinetic energy that is in each bead and its resonator together, N values.
    fn parts(&self, mode: usize) -> Vec<f64> {
        let part = |row: usize| self.vectors.row(mode)[row].powi(2);
        let mut parts: Vec<f64> = (0..self.beads).map(part).collect();
        for (index, bead) in self.carriers.iter().enumerate() {
            parts[*bead] += part(self.beads + index);
        }
        parts
    }

    /// The number of beads that take part in a mode: `1/Σ eᵢ²` with the part `eᵢ` of its kinetic energy that is in bead `i` and its
    /// resonator; 1 for one bead alone, N if all have the same, 2N/3 for a standing sine.
    pub fn participation_beads(&self, mode: usize) -> f64 {
        1.0 / self.parts(mode).into_iter().map(|part| part * part).sum::<f64>()
    }

    /// The bead with most of a mode's energy, with its resonator's.
    pub fn centre_bead(&self, mode: usize) -> usize {
        let parts = self.parts(mode);
        (0..self.beads).max_by(|a, b| parts[*a].total_cmp(&parts[*b])).unwrap_or(0)
    }

    /// Energy (J) in a mode, `½(ẏ² + ω²·y²)` of the state's part along it, for displacements (m) and velocities (m/s)
    /// of all beads and then resonators.
    pub fn energy_j(&self, mode: usize, u_m: &[f64], v_m_s: &[f64]) -> f64 {
        let (mut y, mut rate) = (0.0, 0.0);
        for ((part, root_mass), (u, v)) in
            self.vectors.row(mode).iter().zip(&self.root_mass).zip(u_m.iter().zip(v_m_s))
        {
            let weight = part * root_mass;
            y += weight * u;
            rate += weight * v;
        }
        let swing = self.omega_rad_s[mode] * y;
        0.5 * (rate * rate + swing * swing)
    }
}

/// The springs between beads, and those between the beads `carriers` and their resonators, as rows and N/m.
fn links(chain: &LinearChain, carriers: &[usize]) -> Vec<(usize, usize, f64)> {
    let inner = (chain.bead_count()..).zip(carriers).map(|(inner, bead)| {
        (*bead, inner, chain.resonator(*bead).map_or(0.0, |resonator| resonator.stiffness_n_per_m))
    });
    inner.chain(chain.bonds()).collect()
}

/// Number of pieces of `count` beads and resonators that no spring ties to a place.
fn free_pieces(chain: &LinearChain, links: &[(usize, usize, f64)], count: usize) -> usize {
    let mut piece: Vec<usize> = (0..count).collect();
    for &(one, other, _) in links.iter().filter(|(.., k)| *k != 0.0) {
        let (kept, joined) = (piece[one], piece[other]);
        piece.iter_mut().filter(|piece| **piece == joined).for_each(|piece| *piece = kept);
    }
    let tied = (0..chain.bead_count()).filter(|bead| chain.tied_n_per_m(*bead) != 0.0);
    let held: BTreeSet<usize> = tied.map(|bead| piece[bead]).collect();
    piece.into_iter().collect::<BTreeSet<_>>().len() - held.len()
}

/// The modes of a ring of which all is alike, where two have each frequency and no matrix tells which: the cosine of a wave before its
/// sine, as [`Modal`](crate::modal::Modal) has them.
fn waves_of_ring(chain: &LinearChain) -> Eigen {
    let beads = chain.bead_count();
    let (mut values, mut vectors) = (Vec::with_capacity(beads), Square::zeros(beads));
    for mode in 0..beads {
        let wave = mode.div_ceil(2);
        let turns = |part: usize| (part % (2 * beads)) as f64 / (2 * beads) as f64;
        let (sine, _) = sine_cosine((turns(wave), 0.0));
        values.push(
            (4.0 * chain.contact_n_per_m[0] * sine * sine + chain.on_site_n_per_m[0]) / chain.mass_kg[0],
        );
        let is_alone = mode == 0 || 2 * wave == beads;
        let size = if is_alone { 1.0 } else { 2.0_f64 } / beads as f64;
        for bead in 0..beads {
            let (sine, cosine) = sine_cosine((turns(2 * wave * bead), 0.0));
            *vectors.at(mode, bead) = size.sqrt() * if mode % 2 == 1 || is_alone { cosine } else { sine };
        }
    }
    Eigen { values, vectors }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::Resonator;
    use crate::linear::tests::chain;
    use std::f64::consts::PI;

    /// N equal beads between walls of the same springs: ωₙ = 2√(K/m)·sin(nπ/(2(N + 1))); free: sin(nπ/(2N)), n from 0.
    /// The eigenvalues are good to rounding of the largest, which the smallest, (π/2N)² of it, feels most.
    #[test]
    fn a_uniform_chain_has_its_textbook_frequencies() {
        let (m, k, count) = (2.0_f64, 3.0, 60_u32);
        let top = 2.0 * (k / m).sqrt();
        let fixed = Modes::of(&chain(count as usize, &[m], k, k)).expect("modes");
        let free = Modes::of(&chain(count as usize, &[m], k, 0.0)).expect("modes");
        for n in 0..count {
            let expected = top * (f64::from(n + 1) * PI / (2.0 * f64::from(count + 1))).sin();
            let found = fixed.omega_rad_s()[n as usize];
            assert!((found / expected - 1.0).abs() < 1e-10, "{n}: {found} {expected}");
            let expected = top * (f64::from(n) * PI / (2.0 * f64::from(count))).sin();
            let found = free.omega_rad_s()[n as usize];
            assert!((found - expected).abs() < 1e-10 * expected.max(top * 1e-3), "{n}: {found} {expected}");
        }
        assert!((free.participation_beads(0) - f64::from(count)).abs() < 1e-8);
        // Σ sin⁴ is 3(N + 1)/8 exactly
        assert!((fixed.participation_beads(4) - 2.0 / 3.0 * f64::from(count + 1)).abs() < 1e-8);
    }

    /// A bead of next to no mass in the middle, where the first mode has a node, leaves its frequency as it is: 2√(K/m)·sin(π/(2N)).
    #[test]
    fn a_frequency_far_below_the_highest_is_none_of_a_free_motion() {
        let mut linear = chain(201, &[1.0], 1.0, 0.0);
        linear.mass_kg[100] = 1e-8;
        let found = Modes::of(&linear).expect("modes").omega_rad_s().to_vec();
        let expected = 2.0 * (PI / 402.0).sin();
        assert!(found[0] == 0.0 && (found[1] / expected - 1.0).abs() < 1e-3, "{:?} {expected}", &found[..3]);
        // two pieces, of which a wall holds one
        (linear.contact_n_per_m[100], linear.wall_n_per_m[0]) = (0.0, 1.0);
        let found = Modes::of(&linear).expect("modes").omega_rad_s().to_vec();
        assert!(found[0] == 0.0 && found[1] > 0.0, "{:?}", &found[..3]);
    }

    /// The waves of a ring of equal beads solve its equations, and are of unit length and at right angles to each other.
    #[test]
    fn a_ring_of_equal_beads_has_waves() {
        for beads in [3, 4, 9, 33, 64_usize] {
            let mut ring = chain(beads, &[2.0], 3.0, 0.0);
            (ring.ring_n_per_m, ring.on_site_n_per_m) = (3.0, vec![0.7; beads]);
            let modes = Modes::of(&ring).expect("modes");
            assert!(modes.omega_rad_s().is_sorted());
            for mode in 0..beads {
                let (wave, square) = (modes.vectors.row(mode), modes.omega_rad_s()[mode].powi(2));
                for bead in 0..beads {
                    let [left, right] = [beads - 1, 1].map(|away| wave[(bead + away) % beads]);
                    let pulled = (6.7 * wave[bead] - 3.0 * (left + right)) / 2.0;
                    assert!((pulled - square * wave[bead]).abs() < 1e-13, "{beads} beads, mode {mode}");
                }
                for other in 0..beads {
                    let product: f64 = wave.iter().zip(modes.vectors.row(other)).map(|(a, b)| a * b).sum();
                    assert!((product - f64::from(u8::from(mode == other))).abs() < 1e-13);
                }
            }
        }
    }

    /// All modes together have the energy of the chain.
    #[test]
    fn energies_of_the_modes_add_up() {
        let linear = chain(7, &[1.0, 3.0], 5.0, 2.0);
        let modes = Modes::of(&linear).expect("modes");
        let u: Vec<f64> = (0..7_i32).map(|i| f64::from((i * 5) % 7) - 2.5).collect();
        let v: Vec<f64> = (0..7_i32).map(|i| f64::from((i * 3) % 7) - 3.0).collect();
        let kinetic: f64 = linear.mass_kg.iter().zip(&v).map(|(m, v)| 0.5 * m * v * v).sum();
        let bonds: f64 = linear.bonds().map(|(a, b, k)| 0.5 * k * (u[a] - u[b]).powi(2)).sum();
        let walls = 0.5 * 2.0 * (u[0] * u[0] + u[6] * u[6]);
        let sum: f64 = (0..7).map(|mode| modes.energy_j(mode, &u, &v)).sum();
        assert!((sum / (kinetic + bonds + walls) - 1.0).abs() < 1e-12, "{sum}");
    }

    /// One free bead with a mass inside: 0 and √(k(1/m + 1/M)).
    #[test]
    fn a_resonator_swings_against_its_bead() {
        let mut linear = chain(1, &[2.0], 1.0, 0.0);
        linear.resonators = vec![Resonator { mass_kg: 0.5, stiffness_n_per_m: 3.0 }];
        let modes = Modes::of(&linear).expect("modes");
        let expected = (3.0 * (1.0 / 2.0 + 1.0 / 0.5_f64)).sqrt();
        assert_eq!(modes.omega_rad_s()[0], 0.0);
        assert!((modes.omega_rad_s()[1] / expected - 1.0).abs() < 1e-14);
    }

    /// Masses inside all of N equal beads make 2N modes, each of which all beads share, on a free ring of springs: a mode that
    /// turns has the same energy in every bead, and one that stands 2N/3. No mode has more than N.
    #[test]
    fn a_resonator_is_no_bead_of_its_own() {
        let mut linear = chain(12, &[2.0], 5.0, 0.0);
        linear.ring_n_per_m = 5.0;
        linear.resonators = vec![Resonator { mass_kg: 0.5, stiffness_n_per_m: 3.0 }; 12];
        let modes = Modes::of(&linear).expect("modes");
        assert_eq!(modes.count(), 24);
        // the beads together, and against the masses in them: the same in each
        let alike = (0..24).filter(|mode| (modes.participation_beads(*mode) - 12.0).abs() < 1e-9).count();
        assert!(alike >= 2, "{alike}");
        assert!((0..24).all(|mode| modes.participation_beads(mode) < 12.0 + 1e-9));
        // most of the energy of one free resonator among heavy walls is its bead's
        let mut alone = chain(3, &[1e9, 1.0, 1e9], 5.0, 0.0);
        let none = Resonator { mass_kg: 0.0, stiffness_n_per_m: 0.0 };
        alone.resonators = vec![none, Resonator { mass_kg: 100.0, stiffness_n_per_m: 3.0 }, none];
        let modes = Modes::of(&alone).expect("modes");
        assert_eq!([3, 2].map(|mode| modes.centre_bead(mode)), [1, 1]);
        assert!([3, 2].iter().all(|mode| (modes.participation_beads(*mode) - 1.0).abs() < 1e-6));
    }
}
