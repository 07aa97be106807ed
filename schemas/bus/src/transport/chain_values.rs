//! Values of a resolved chain on the bus: those that every chain has. The manifest gives the rest: terms of forces, and
//! everything that acts on beads beside their contacts.

use schemas::chain::{Chain, Wall, Walls};
use schemas::contact::ContactLaw;
use schemas::damping::ContactDamping;
use schemas::manifest::Physics;

/// Doubles of a wall: stiffness, rest overlap, rest force, damping coefficient.
const WALL: usize = 4;

/// Number of doubles of a chain of `beads ≥ 2` beads.
pub(super) fn length(beads: usize) -> usize {
    beads + 4 * (beads - 1) + 2 * WALL
}

/// Values of `chain`:
/// `[mass | stiffness | rest overlap | rest force | damping coefficient | left wall | right wall]`.
pub(super) fn to_values(chain: &Chain) -> Vec<f64> {
    let mut values = Vec::with_capacity(length(chain.bead_count()));
    for part in [&chain.mass_kg, &chain.stiffness, &chain.rest_overlap_m, &chain.rest_force_n] {
        values.extend_from_slice(part);
    }
    match &chain.damping {
        Some(damping) => values.extend_from_slice(&damping.coefficient),
        None => values.extend(std::iter::repeat_n(0.0, chain.contact_count())),
    }
    let at_walls = chain.damping.as_ref().map_or([0.0; 2], |damping| damping.wall_coefficient);
    for (wall, damping) in [chain.walls.left, chain.walls.right].into_iter().zip(at_walls) {
        values.extend([wall.stiffness, wall.rest_overlap_m, wall.rest_force_n, damping]);
    }
    values
}

/// Makes the chain of `physics` from the values of [`to_values`]; none if they do not fit.
pub(super) fn from_values(physics: &Physics, values: &[f64]) -> Option<Chain> {
    let beads = usize::try_from(physics.beads).ok()?;
    if values.len() != length(beads) {
        return None;
    }
    let (mass_kg, rest) = values.split_at(beads);
    let (stiffness, rest) = rest.split_at(beads - 1);
    let (rest_overlap_m, rest) = rest.split_at(beads - 1);
    // the forces at rest follow from the overlaps
    let (damping, ends) = rest[beads - 1..].split_at(beads - 1);
    let (left, right) = ends.split_at(WALL);
    let law = ContactLaw::new(physics.alpha);
    let wall = |wall: &[f64]| if wall[0] > 0.0 { Wall::new(&law, wall[0], wall[1]) } else { Wall::default() };
    let walls = Walls { left: wall(left), right: wall(right) };
    let resolved = physics.chain();
    if !resolved.terms.is_empty() || !resolved.sites.is_none() || resolved.is_ring {
        // the same bits, whoever resolves them
        let is_ours = to_values(&resolved).iter().zip(values).all(|(a, b)| a.to_bits() == b.to_bits());
        return is_ours.then_some(resolved);
    }
    let mut chain = Chain::new(mass_kg.to_vec(), stiffness.to_vec(), rest_overlap_m.to_vec(), walls, law);
    (chain.rows, chain.moved_walls) = (resolved.rows, resolved.moved_walls);
    let damping = physics.damping.map(|kind| ContactDamping {
        kind,
        coefficient: damping.to_vec(),
        wall_coefficient: [left[WALL - 1], right[WALL - 1]],
    });
    Some(chain.with_damping(damping))
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::{End, RunConfig};
    use schemas::presets::PRESETS;

    fn round_trip(change: impl FnOnce(&mut RunConfig)) {
        let mut config = PRESETS[0].config();
        change(&mut config);
        let physics = Physics::resolve(&config).expect("valid");
        let chain = physics.chain();
        assert_eq!(from_values(&physics, &to_values(&chain)), Some(chain));
    }

    #[test]
    fn chains_come_back_as_they_were() {
        round_trip(|_| {});
        round_trip(|config| {
            config.ends.right = End::Fixed;
            config.load.gravity_m_s2 = 9.81;
            config.load.precompression_n = 0.5;
        });
    }

    #[test]
    fn another_length_is_no_chain() {
        let physics = Physics::resolve(&PRESETS[0].config()).expect("valid");
        let values = to_values(&physics.chain());
        assert_eq!(from_values(&physics, &values[1..]), None);
    }
}
