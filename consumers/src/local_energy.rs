//! Energy along a chain: that of each bead, with its share of the energy of its contacts.

use schemas::chain::Chain;
use schemas::frame::Frame;

/// The energy (J) of each bead in `frame`, N values: `½·m·v²`, half the potential energy of each contact with another bead, all
/// of that of the contact with a wall, of the spring at its place, and of its resonator. In a loaded chain potential energies are those beyond rest ([`Chain::contact_energies_j`]).
/// The sum over the beads is the total energy of the chain, but for rounding.
pub fn bead_energies_j(chain: &Chain, frame: &Frame<'_>) -> Vec<f64> {
    let mut contact_j = vec![0.0; chain.contact_count()];
    chain.contact_energies_j(frame.u_m, &mut contact_j);
    let kinetic_j = |(mass_kg, v_m_s): (&f64, &f64)| 0.5 * mass_kg * (v_m_s * v_m_s);
    let mut bead_j: Vec<f64> = chain.mass_kg.iter().zip(frame.v_m_s).map(kinetic_j).collect();
    for (contact, energy_j) in contact_j.iter().enumerate() {
        bead_j[contact] += 0.5 * energy_j;
        bead_j[contact + 1] += 0.5 * energy_j;
    }
    let [left_j, right_j] = chain.wall_energies_j(frame.u_m, frame.extra);
    let last = bead_j.len() - 1;
    // the contact that closes a ring stands in the place of the left wall
    bead_j[0] += if chain.is_ring { 0.5 * left_j } else { left_j };
    bead_j[last] += if chain.is_ring { 0.5 * left_j } else { right_j };
    if !chain.sites.is_none() {
        for (bead, energy_j) in bead_j.iter_mut().enumerate() {
            *energy_j += chain.sites_energy(frame.u_m, frame.extra, bead..bead + 1).total_j();
        }
    }
    bead_j
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::chain::{Wall, Walls};
    use schemas::contact::ContactLaw;

    /// k = 4, α = 3: a contact has δ⁴. Beads of 2 kg at u = ½, 0, 0 and v = 1, 0, 2, in rest overlaps of 0, walls at both ends.
    #[test]
    fn energies_worked_out_by_hand() {
        let law = ContactLaw::new(3.0);
        let wall = Wall::new(&law, 4.0, 0.0);
        let walls = Walls { left: wall, right: wall };
        let chain = Chain::new(vec![2.0; 3], vec![4.0; 2], vec![0.0; 2], walls, law);
        let of = |u_m: &[f64], v_m_s: &[f64]| {
            bead_energies_j(
                &chain,
                &Frame { frame: 0, step: 0, time_s: 0.0, u_m, v_m_s, extra: &[], active: None },
            )
        };
        assert_eq!(of(&[0.5, 0.0, 0.0], &[1.0, 0.0, 2.0]), [1.0 + 0.5 / 16.0, 0.5 / 16.0, 4.0]);
        // the contacts with the walls are all the end beads' own
        assert_eq!(of(&[-1.0, 0.0, 0.5], &[0.0; 3]), [1.0, 0.0, 1.0 / 16.0]);
    }
}
