//! A chain as a linear system about its equilibrium.

use schemas::chain::Chain;
use schemas::drive::{Place, Quantity};
use schemas::manifest::Physics;

/// Masses and the springs that contacts, walls and sites are for small motions about the equilibrium.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearChain {
    /// Mass of each bead (kg), N values.
    pub mass_kg: Vec<f64>,
    /// dF/dδ at rest of each contact (N/m), N − 1 values; contact `i` joins beads `i` and `i + 1`.
    pub contact_n_per_m: Vec<f64>,
    /// The same of the contacts with the left and the right wall (N/m); 0 at a free end.
    pub wall_n_per_m: [f64; 2],
    /// Spring that ties each bead to its site (N/m), N values; 0 for none.
    pub on_site_n_per_m: Vec<f64>,
    /// Contact of the last bead with bead 0 (N/m), where the chain is a ring; 0 otherwise.
    pub ring_n_per_m: f64,
    /// A mass on a spring in each bead, N of them, or none at all.
    pub resonators: Vec<Resonator>,
}

/// A mass on a linear spring, tied to a bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resonator {
    /// Its mass (kg); 0 for none at this bead.
    pub mass_kg: f64,
    /// Its spring (N/m).
    pub stiffness_n_per_m: f64,
}

/// Reason why a chain has no linear waves.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{place} is not pressed together at rest, so nothing is linear there: its force k·δ^α has no slope on both \
     sides of δ = 0, and small waves have no frequency of their own; load the chain ([load] precompression_n, or \
     gravity_m_s2), as the preset `precompressed` does"
)]
pub struct NotLinear {
    /// The first such contact.
    pub place: String,
}

/// Refuses a chain with a bead that a drive moves: it does not move by itself, as all beads of modes do.
///
/// # Errors
/// With the bead, and what is allowed.
pub fn check_beads_are_free(physics: &Physics) -> Result<(), String> {
    let moved = physics.drives.iter().find_map(|drive| match drive.at {
        Place::Bead(bead) if drive.prescribes != Quantity::Force => Some(bead),
        _ => None,
    });
    moved.map_or(Ok(()), |bead| {
        Err(format!("bead {bead} is moved by a drive, and modes are those of beads that move by themselves; allowed: drives that move walls, or push beads"))
    })
}

impl LinearChain {
    /// The linear system of `chain` about its equilibrium.
    ///
    /// # Errors
    /// When a contact or a wall is not compressed at rest.
    pub fn of(chain: &Chain) -> Result<Self, NotLinear> {
        let contact_n_per_m = chain.tangents_n_per_m();
        let mut wall_n_per_m = chain.wall_tangents_n_per_m();
        let refused = |place: String| Err(NotLinear { place });
        let is_open =
            |c: usize| contact_n_per_m[c] <= 0.0 && chain.rest_overlap_m[c] >= 0.0 && !chain.is_bonded;
        if let Some(contact) = (0..contact_n_per_m.len()).find(|contact| is_open(*contact)) {
            return refused(format!("contact {contact}"));
        }
        let walls = [("left", chain.walls.left), ("right", chain.walls.right)];
        for ((side, wall), tangent) in walls.into_iter().zip(wall_n_per_m) {
            if wall.is_there && tangent <= 0.0 && !chain.is_bonded {
                return refused(format!("the contact with the {side} wall"));
            }
        }
        let sites = &chain.sites;
        let ring_n_per_m = if chain.is_ring { std::mem::take(&mut wall_n_per_m[0]) } else { 0.0 };
        let on_site = &sites.linear_n_per_m;
        let resonators = sites.resonator_kg.iter().zip(&sites.resonator_n_per_m);
        let resonator = |(mass_kg, stiffness_n_per_m): (&f64, &f64)| Resonator {
            mass_kg: *mass_kg,
            stiffness_n_per_m: *stiffness_n_per_m,
        };
        Ok(Self {
            mass_kg: chain.mass_kg.clone(),
            contact_n_per_m,
            wall_n_per_m,
            on_site_n_per_m: if on_site.is_empty() { vec![0.0; chain.bead_count()] } else { on_site.clone() },
            ring_n_per_m,
            resonators: resonators.map(resonator).collect(),
        })
    }

    /// Number of beads N.
    pub fn bead_count(&self) -> usize {
        self.mass_kg.len()
    }

    /// The resonator of `bead`, if there is one.
    pub fn resonator(&self, bead: usize) -> Option<Resonator> {
        self.resonators.get(bead).copied().filter(|resonator| resonator.mass_kg > 0.0)
    }

    /// True if all beads and springs are alike, and what ties beads to their places, but for the ends.
    pub(crate) fn is_uniform(&self) -> bool {
        let is_even = |values: &[f64]| values.iter().all(|value| *value == values[0]);
        let has_resonators = (0..self.bead_count()).any(|bead| self.resonator(bead).is_some());
        !has_resonators
            && self.contact_n_per_m[0] > 0.0
            && self.on_site_n_per_m[0] >= 0.0
            && [&self.mass_kg, &self.contact_n_per_m, &self.on_site_n_per_m]
                .into_iter()
                .all(|values| is_even(values))
    }

    /// True for a ring of which all beads and springs are alike.
    pub(crate) fn is_uniform_ring(&self) -> bool {
        self.is_uniform() && self.ring_n_per_m == self.contact_n_per_m[0]
    }

    /// Sum of the springs that tie `bead` to a place (N/m).
    pub fn tied_n_per_m(&self, bead: usize) -> f64 {
        let left = if bead == 0 { self.wall_n_per_m[0] } else { 0.0 };
        let right = if bead + 1 == self.bead_count() { self.wall_n_per_m[1] } else { 0.0 };
        self.on_site_n_per_m.get(bead).copied().unwrap_or(0.0) + left + right
    }

    /// Displacements (m) of the beads at rest while the walls are displaced by `walls_m`: elimination from the left end on, then from the right.
    pub fn at_rest_m(&self, walls_m: [f64; 2]) -> Vec<f64> {
        // a bead that nothing ties to a place stays
        let over = |value: f64, stiffness: f64| if stiffness == 0.0 { 0.0 } else { value / stiffness };
        let last = self.bead_count() - 1;
        // the spring and the force by which a bead sees all on its left
        let (mut spring, mut pull_n) = (0.0, self.wall_n_per_m[0] * walls_m[0]);
        let mut rows = Vec::with_capacity(last + 1);
        for bead in 0..=last {
            let k = self.contact_n_per_m.get(bead).copied().unwrap_or(0.0);
            let pivot = spring + self.tied_n_per_m(bead) + k;
            rows.push([pivot, pull_n, k]);
            (spring, pull_n) = (k - over(k * k, pivot), over(k * pull_n, pivot));
        }
        rows[last][1] += self.wall_n_per_m[1] * walls_m[1];
        let mut next_m = 0.0;
        for row in rows.iter_mut().rev() {
            next_m = over(row[1] + row[2] * next_m, row[0]);
            row[0] = next_m;
        }
        rows.into_iter().map(|[at_rest_m, ..]| at_rest_m).collect()
    }

    /// The speed of long waves (beads/s), `1/√(<m>·<1/K>)` by the means over beads and springs; none where beads are tied to their places or a spring has no
    /// stiffness.
    pub fn long_waves_beads_per_s(&self) -> Option<f64> {
        let resonators_kg = self.resonators.iter().map(|resonator| resonator.mass_kg).sum::<f64>();
        let mass_kg = (self.mass_kg.iter().sum::<f64>() + resonators_kg) / self.bead_count() as f64;
        let (count, softness) =
            self.bonds().fold((0.0, 0.0), |(count, sum), (.., k)| (count + 1.0, sum + 1.0 / k));
        let speed = (count / (mass_kg * softness)).sqrt();
        let is_free = self.on_site_n_per_m.iter().all(|k| *k == 0.0);
        Some(speed).filter(|speed| is_free && speed.is_finite() && *speed > 0.0)
    }

    /// The springs between beads: (a bead, another, N/m).
    pub fn bonds(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let chain = self.contact_n_per_m.iter().enumerate().map(|(contact, k)| (contact, contact + 1, *k));
        let last = self.bead_count() - 1;
        chain.chain((self.ring_n_per_m != 0.0).then_some((last, 0, self.ring_n_per_m)))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use schemas::chain::{Wall, Walls};
    use schemas::contact::ContactLaw;

    /// `count` beads that alternate between `masses`, springs of `k`, walls of `walls` or free ends.
    pub(crate) fn chain(count: usize, masses: &[f64], k: f64, walls: f64) -> LinearChain {
        LinearChain {
            mass_kg: (0..count).map(|bead| masses[bead % masses.len()]).collect(),
            contact_n_per_m: vec![k; count - 1],
            wall_n_per_m: [walls; 2],
            on_site_n_per_m: vec![0.0; count],
            ring_n_per_m: 0.0,
            resonators: Vec::new(),
        }
    }

    /// Equal springs share the way between two walls; a bead on its own spring stays behind; a chain with a free end follows its wall.
    #[test]
    fn beads_at_rest_follow_the_walls() {
        let mut held = chain(2, &[1.0], 1.0, 1.0);
        held.on_site_n_per_m = vec![1.0, 0.0];
        let mut loose = chain(3, &[1.0, 7.0], 2.0, 0.0);
        loose.wall_n_per_m[0] = 3.0;
        for (chain, walls_m, expected) in [
            (chain(3, &[1.0], 2.0, 2.0), [4.0, 8.0], vec![5.0, 6.0, 7.0]),
            // 3·u0 = u1 + 5, 2·u1 = u0
            (held, [5.0, 0.0], vec![2.0, 1.0]),
            (loose, [6.0, 0.0], vec![6.0; 3]),
        ] {
            let found = chain.at_rest_m(walls_m);
            assert!(found.iter().zip(&expected).all(|(x, exact)| (x - exact).abs() < 1e-14), "{found:?}");
        }
    }

    /// k = 4, α = 3, δ = ½: dF/dδ = 12·¼ = 3.
    #[test]
    fn a_loaded_contact_is_a_spring() {
        let law = ContactLaw::new(3.0);
        let walls = Walls { left: Wall::new(&law, 4.0, 0.5), right: Wall::default() };
        let loaded = Chain::new(vec![1.0; 2], vec![4.0], vec![0.5], walls, law.clone());
        let linear = LinearChain::of(&loaded).expect("loaded");
        assert_eq!((linear.contact_n_per_m, linear.wall_n_per_m), (vec![3.0], [3.0, 0.0]));
        let free = Chain::new(vec![1.0; 2], vec![4.0], vec![0.0], Walls::default(), law);
        let refused = LinearChain::of(&free).expect_err("not loaded").to_string();
        assert!(refused.contains("contact 0") && refused.contains("precompression_n"), "{refused}");
    }
}
