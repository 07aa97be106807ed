//! Energy along a chain: that of each bead, with its share of the energy of its contacts.

use schemas::active::{Active, ContactEnergies};
use schemas::chain::Chain;
use schemas::frame::Frame;
use std::ops::Range;

/// The energy (J) of each bead in `frame`, N values: `½·m·v²`, half the potential energy of each contact with another bead, all
/// of that of the contact with a wall, of the spring at its place, and of its resonator. In a loaded chain potential energies are those beyond rest ([`Chain::contact_energies_j`]).
/// The sum over the beads is the total energy of the chain, but for rounding.
pub fn bead_energies_j(chain: &Chain, frame: &Frame<'_>) -> Vec<f64> {
    let mut energies = BeadEnergies::new(chain);
    energies.of(chain, frame);
    energies.bead_j
}

/// The same for one frame after the other: beads that stay at rest are not visited.
#[derive(Debug, Clone)]
pub struct BeadEnergies {
    contacts: ContactEnergies,
    bead_j: Vec<f64>,
    /// The beads that may have had energy in the last frame.
    seen: Active,
}

impl BeadEnergies {
    /// Those of `chain` at rest: none.
    pub fn new(chain: &Chain) -> Self {
        let (contacts, bead_j) = (ContactEnergies::new(chain), vec![0.0; chain.bead_count()]);
        Self { contacts, bead_j, seen: Active::all(0) }
    }

    /// The beads that may have energy in the next frame, and the energy (J) of each bead, N values.
    pub fn of(&mut self, chain: &Chain, frame: &Frame<'_>) -> (Range<usize>, &[f64]) {
        let (beads, active) = (self.bead_j.len(), frame.with_energy(chain));
        self.contacts.renew(chain, frame.u_m, active);
        let contact_j = self.contacts.values_j();
        let [left_j, right_j] = chain.wall_energies_j(frame.u_m, frame.extra);
        // the contact that closes a ring stands in the place of the left wall
        let ends_j = if chain.is_ring { [0.5 * left_j; 2] } else { [left_j, right_j] };
        // a contact gives half of its energy to each of its beads
        let first = if ends_j[0] == 0.0 { active.first.saturating_sub(1) } else { 0 };
        let end = if ends_j[1] == 0.0 && active.end < beads { active.end + 1 } else { beads };
        let active = Active { first, end };
        let Range { start, end } = self.seen.renew(active).within(0..beads);
        let bead_j = &mut self.bead_j;
        let moving = chain.mass_kg[start..end].iter().zip(&frame.v_m_s[start..end]);
        for (energy_j, (mass_kg, v_m_s)) in bead_j[start..end].iter_mut().zip(moving) {
            *energy_j = 0.5 * mass_kg * (v_m_s * v_m_s);
        }
        let mut add = |beads: Range<usize>, left: usize| {
            let contacts = &contact_j[beads.start - left..beads.end - left];
            bead_j[beads].iter_mut().zip(contacts).for_each(|(bead_j, contact_j)| *bead_j += 0.5 * contact_j);
        };
        add(start.max(1)..end, 1); // integers
        add(start..end.min(beads - 1), 0); // integers
        if start == 0 {
            bead_j[0] += ends_j[0];
        }
        if end == beads {
            bead_j[beads - 1] += ends_j[1];
        }
        if !chain.sites.is_none() {
            for (bead, energy_j) in (start..end).zip(&mut bead_j[start..end]) {
                *energy_j += chain.sites_energy(frame.u_m, frame.extra, bead..bead + 1).total_j();
            }
        }
        (active.within(0..beads), bead_j)
    }
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
