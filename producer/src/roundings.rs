//! Roundings of a run, carried to later times by its tangent.
//!
//! Each operation of a step rounds its result, by some part of a unit in the last place. The tangent of the run tells how fast such changes
//! grow; each time that somebody looks, others are added, as large as those of the steps since. Of steps in which a bead keeps its
//! velocity, all drifts are rounded alike, and their roundings add up with the number of steps; all others do with its root.

use crate::state::ChainState;
use crate::tangents::Tangents;
use schemas::chain::Chain;
use schemas::philox::uniform;

/// Sizes of a tangent, in units of the scales, from which on nothing is left of a run; it grows no further.
const LARGEST: f64 = 1.0;

/// Adds the roundings of steps to a tangent.
#[derive(Debug, Clone)]
pub(crate) struct Roundings {
    /// Overlaps at rest (m) of the contacts at each bead, the larger: differences are rounded relative to them.
    rest_m: Vec<f64>,
    /// Velocities (m/s) when somebody looked last.
    before_m_s: Vec<f64>,
    looks: u64,
    /// L (m) and L/T (m/s).
    scales: [f64; 2],
}

impl Roundings {
    pub(crate) fn new(chain: &Chain, scales: [f64; 2]) -> Self {
        let beads = chain.bead_count();
        let walls = [&chain.walls.left, &chain.walls.right].map(|wall| wall.rest_overlap_m);
        let rests = [&walls[..1], &chain.rest_overlap_m, &walls[1..]].concat();
        let rest_m = (0..beads).map(|bead| larger(rests[bead], rests[bead + 1])).collect();
        Self { rest_m, before_m_s: vec![0.0; beads], looks: 0, scales }
    }

    /// Adds those of the `steps` steps that led to `state` to its first tangent.
    pub(crate) fn add(&mut self, tangents: &mut Tangents, state: &ChainState, steps: u64) {
        let beads = state.u_m.len();
        let mut tangent = tangents.tangent(0);
        let dimension = tangent.len() as u64;
        let numbers = state.u_m.iter().chain(state.v_m_s.iter()).chain(state.extra.iter());
        for (place, (change, number)) in tangent.iter_mut().zip(numbers).enumerate() {
            let mut size = number.abs();
            let (mut count, mut index) = ((steps as f64).sqrt(), self.looks * dimension + place as u64);
            if let Some(rest_m) = self.rest_m.get(place) {
                let v = state.v_m_s[place];
                if size > 0.0 {
                    size += rest_m;
                }
                if v == self.before_m_s[place] {
                    (count, index) = (steps as f64, v.to_bits() ^ (number.to_bits() >> 52) ^ place as u64);
                }
            }
            *change += f64::EPSILON * size * count * (2.0 * uniform(0, 0, index) - 1.0);
        }
        let mut largest = 0.0;
        for (row, scale) in tangent.chunks(beads).zip([0, 1, 0, 1].map(|row| self.scales[row])) {
            largest = row.iter().fold(largest, |most, change| larger(most, change.abs() / scale));
        }
        if largest > LARGEST {
            for change in &mut tangent {
                *change *= LARGEST / largest;
            }
        }
        tangents.set(0, &tangent);
        self.before_m_s.copy_from_slice(&state.v_m_s);
        self.looks += 1;
    }
}

fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}
