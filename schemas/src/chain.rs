//! The resolved chain: one number for each bead and each contact, and sums over them.

use crate::contact::{ContactLaw, Power, PowerUser, evaluate};
use crate::damping::ContactDamping;
use crate::drive::{Drive, Quantity};
use crate::excess::{AtRest, Excess};
use crate::functions::Moment;
use crate::rows::Rows;
use crate::simd::{ordered_sum, vectorized};
use crate::sites::Sites;
use crate::term::{Law, Term};
use pulp::Arch;
use std::ops::Range;
use std::sync::Arc;

/// Masses, stiffnesses and rest overlaps after all rules of a configuration have been applied.
///
/// Where a constant load presses the chain together, displacements are measured from its static
/// equilibrium. There every constant force is balanced by the forces of the contacts at rest, so that the
/// motion is that of the contacts' *excess* over their [`Chain::rest_force_n`], and nothing else acts.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Mass of each bead (kg), N values.
    pub mass_kg: Vec<f64>,
    /// Stiffness of each contact (N·m^−α), N − 1 values; contact `i` joins beads `i` and `i + 1`.
    pub stiffness: Vec<f64>,
    /// Overlap of each contact (m) when both displacements are 0, N − 1 values.
    pub rest_overlap_m: Vec<f64>,
    /// Force of each contact (N) at its rest overlap, N − 1 values, computed as every force is: the force at
    /// rest cancels it to the last bit.
    pub rest_force_n: Vec<f64>,
    /// Potential energy of each contact (J) at its rest overlap, N − 1 values.
    pub rest_energy_j: Vec<f64>,
    /// Contacts of the end beads with the walls.
    pub walls: Walls,
    /// Damping of the contacts, if they have any.
    pub damping: Option<ContactDamping>,
    /// The contact law of every contact.
    pub law: ContactLaw,
    /// Further terms of the force of each contact.
    pub terms: Vec<Term>,
    /// Springs, drag and resonators of each bead.
    pub sites: Sites,
    /// True if the last bead touches the first one: this contact then stands in the place of the left wall.
    pub is_ring: bool,
    /// True if bonds, which pull as well as push, take the place of contacts.
    pub is_bonded: bool,
    /// Layout of the rows of a state's `extra`.
    pub rows: Rows,
    /// The drives that move the left and the right wall, with their numbers.
    pub moved_walls: [Option<(usize, Arc<Drive>)>; 2],
    /// True if a contact between two beads has an overlap at rest; stored, because every frame asks for it.
    is_loaded: bool,
}

/// The contacts of the end beads with the walls beside them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Walls {
    /// Left of bead 0.
    pub left: Wall,
    /// Right of the last bead.
    pub right: Wall,
}

/// The contact of an end bead with a wall; all zeros at a free end.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wall {
    /// True if there is a wall.
    pub is_there: bool,
    /// Stiffness of the contact (N·m^−α), 0 at a free end.
    pub stiffness: f64,
    /// Overlap of the contact (m) when the end bead's displacement is 0.
    pub rest_overlap_m: f64,
    /// Force (N) at the rest overlap.
    pub rest_force_n: f64,
}

impl Wall {
    /// A wall whose contact has the stiffness `stiffness` and overlaps by `rest_overlap_m` at rest.
    pub fn new(law: &ContactLaw, stiffness: f64, rest_overlap_m: f64) -> Self {
        Self { is_there: true, stiffness, rest_overlap_m, rest_force_n: law.force(stiffness, rest_overlap_m) }
    }

    /// Overlap (m) when the end bead has come `approach_m` nearer than at rest.
    pub fn overlap_m(&self, approach_m: f64) -> f64 {
        approach_m + self.rest_overlap_m
    }

    /// Energy (J) beyond that at rest, less the work of the constant force that the contact balances, by the law alone.
    fn excess_energy_j(&self, law: &ContactLaw, approach_m: f64) -> f64 {
        if self.stiffness == 0.0 {
            return 0.0;
        }
        law.excess_j(self.stiffness, self.rest_overlap_m, approach_m, true)
    }
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
    /// A chain without damping of beads of `mass_kg` (N values), contacts of `stiffness` and `rest_overlap_m` (N − 1 values each).
    pub fn new(
        mass_kg: Vec<f64>,
        stiffness: Vec<f64>,
        rest_overlap_m: Vec<f64>,
        walls: Walls,
        law: ContactLaw,
    ) -> Self {
        let at_rest = |value: fn(&ContactLaw, f64, f64) -> f64| {
            stiffness.iter().zip(&rest_overlap_m).map(|(k, rest)| value(&law, *k, *rest)).collect()
        };
        let is_loaded = rest_overlap_m.iter().any(|rest| *rest != 0.0);
        let (rest_force_n, rest_energy_j) = (at_rest(ContactLaw::force), at_rest(ContactLaw::energy));
        Self {
            mass_kg,
            stiffness,
            rest_overlap_m,
            rest_force_n,
            rest_energy_j,
            walls,
            damping: None,
            law,
            terms: Vec::new(),
            sites: Sites::default(),
            is_ring: false,
            is_bonded: false,
            rows: Rows::default(),
            moved_walls: [None, None],
            is_loaded,
        }
    }

    /// The same chain with `terms` added to the forces of its contacts.
    #[must_use]
    pub fn with_terms(mut self, terms: Vec<Term>) -> Self {
        for term in &terms {
            for (c, force_n) in self.rest_force_n.iter_mut().enumerate() {
                *force_n += term.law.force(term.stiffness[c], self.rest_overlap_m[c]);
            }
            for (side, wall) in [&mut self.walls.left, &mut self.walls.right].into_iter().enumerate() {
                wall.rest_force_n += term.law.force(term.wall_stiffness[side], wall.rest_overlap_m);
            }
        }
        Self { terms, ..self }
    }

    /// True if a contact between two beads is pressed at rest.
    pub fn is_pressed(&self) -> bool {
        self.rest_overlap_m.iter().any(|rest_m| *rest_m > 0.0)
    }

    /// True if a contact between two beads has an overlap or a gap at rest.
    pub fn is_loaded(&self) -> bool {
        self.is_loaded
    }

    /// The same chain with damped contacts, if there are any.
    #[must_use]
    pub fn with_damping(self, damping: Option<ContactDamping>) -> Self {
        Self { damping, ..self }
    }

    /// Number of beads N.
    pub fn bead_count(&self) -> usize {
        self.mass_kg.len()
    }

    /// Number of contacts of a bead with the next one, N − 1.
    pub fn contact_count(&self) -> usize {
        self.stiffness.len()
    }

    /// Number of contacts, with the one that closes a ring: N in a ring.
    pub fn all_contact_count(&self) -> usize {
        self.contact_count() + usize::from(self.is_ring)
    }

    /// The value of the bead on the left of contact `contact` less that of the bead on its right: of displacements (m) how much the two are
    /// nearer than at rest, of velocities (m/s) how fast they approach. Contact N − 1 closes a ring.
    pub fn across(&self, values: &[f64], contact: usize) -> f64 {
        values[contact] - values[if contact < self.contact_count() { contact + 1 } else { 0 }]
    }

    /// Stiffness (N·m^−α) of contact `contact` by the law of the chain alone; contact N − 1 closes a ring.
    pub fn stiffness_of(&self, contact: usize) -> f64 {
        self.value_of(&self.stiffness, self.walls.left.stiffness, contact)
    }

    /// Overlap (m) of the same when the chain is at rest.
    pub fn rest_m(&self, contact: usize) -> f64 {
        self.value_of(&self.rest_overlap_m, self.walls.left.rest_overlap_m, contact)
    }

    /// Force (N) of the same when the chain is at rest.
    pub fn rest_n(&self, contact: usize) -> f64 {
        self.value_of(&self.rest_force_n, self.walls.left.rest_force_n, contact)
    }

    /// The value of contact `contact` among `values`, or that of the contact that closes a ring.
    fn value_of(&self, values: &[f64], closing: f64, contact: usize) -> f64 {
        debug_assert!(contact < self.all_contact_count(), "no contact {contact}");
        values.get(contact).copied().unwrap_or(closing)
    }

    /// Overlap (m) of the same for the displacements `u_m` (N values, m).
    pub fn overlap_m(&self, u_m: &[f64], contact: usize) -> f64 {
        self.across(u_m, contact) + self.rest_m(contact)
    }

    /// Force (N) of contact `contact` without damping, that at rest included, at the displacements `u_m` (N values, m).
    pub fn contact_force_n(&self, u_m: &[f64], contact: usize) -> f64 {
        self.force_n(contact, self.overlap_m(u_m, contact))
    }

    /// The same at an overlap (m).
    pub fn force_n(&self, contact: usize, overlap_m: f64) -> f64 {
        let by_law = self.law.force(self.stiffness_of(contact), overlap_m);
        self.terms
            .iter()
            .fold(by_law, |sum, term| sum + term.law.force(term.stiffness_of(contact), overlap_m))
    }

    /// True if the forces of `contacts` are one power of the overlap, that of the chain's law, and no springs hold beads.
    pub fn is_one_power(&self, contacts: std::ops::Range<usize>) -> bool {
        let none = |term: &Term| term.stiffness[contacts.clone()].iter().all(|k| *k == 0.0);
        !self.is_bonded && !self.sites.has_springs() && self.terms.iter().all(none)
    }

    /// Stiffness (N·m^−α) of contact `contact`, with its own exponent α where contacts have several; contact N − 1 closes a ring.
    pub fn own_stiffness(&self, contact: usize) -> f64 {
        let powers = self.terms.iter().filter(|term| term.law.exponent().is_some());
        let of_terms = powers.map(|term| term.stiffness_of(contact));
        [self.stiffness_of(contact)].into_iter().chain(of_terms).find(|k| *k != 0.0).unwrap_or(0.0)
    }

    /// Forces (N) of the contacts with the left and the right wall, forces at rest included. In a ring the first is the force of
    /// the contact that closes it.
    pub fn wall_forces_n(&self, u_m: &[f64], extra: &[f64]) -> [f64; 2] {
        let [left_m, right_m] = self.wall_approaches_m(u_m, extra);
        [(0, left_m), (1, right_m)].map(|(side, approach_m)| {
            let wall = self.wall(side);
            let overlap_m = wall.overlap_m(approach_m);
            let by_law = self.law.force(wall.stiffness, overlap_m);
            let force_n = |sum, term: &Term| sum + term.law.force(term.wall_stiffness[side], overlap_m);
            if wall.is_there { self.terms.iter().fold(by_law, force_n) } else { 0.0 }
        })
    }

    /// Force (N) of a damped contact, force at rest included: `elastic_n` (N) is its force without damping, `overlap_m` (m) its
    /// overlap, which grows by `rate_m_s` (m/s), and `coefficient` its damping coefficient.
    pub fn damped_n(&self, elastic_n: f64, overlap_m: f64, rate_m_s: f64, coefficient: f64) -> f64 {
        let Some(damping) = &self.damping else { return elastic_n };
        if !self.is_bonded && overlap_m <= self.law.zero_up_to_m() {
            return 0.0;
        }
        let raised = damping.kind.raised(self.law.alpha());
        let raised = raised.as_ref().unwrap_or(&self.law).force(1.0, overlap_m);
        let factor = damping.kind.factor().at(raised, overlap_m);
        let force_n = elastic_n + coefficient * factor * rate_m_s;
        if self.is_bonded || force_n > 0.0 { force_n } else { 0.0 }
    }

    /// Force (N) of contact `contact`, with its damping and the force at rest, at the time `time_s` in a state `[u_m, v_m_s, extra]`; contact N − 1
    /// closes a ring.
    pub fn whole_force_n(&self, state: [&[f64]; 3], time_s: f64, contact: usize) -> f64 {
        if contact == self.contact_count() {
            return self.whole_wall_forces_n(state, time_s)[0];
        }
        let [u_m, v_m_s, _] = state;
        let coefficient = self.damping.as_ref().map_or(0.0, |damping| damping.coefficient[contact]);
        let rate_m_s = v_m_s[contact] - v_m_s[contact + 1];
        self.damped_n(self.contact_force_n(u_m, contact), self.overlap_m(u_m, contact), rate_m_s, coefficient)
    }

    /// The same of both walls, 0 at free ends; in a ring the first is that of the contact that closes it.
    pub fn whole_wall_forces_n(&self, [u_m, v_m_s, extra]: [&[f64]; 3], time_s: f64) -> [f64; 2] {
        let elastic_n = self.wall_forces_n(u_m, extra);
        let approaches_m = self.wall_approaches_m(u_m, extra);
        let rates_m_s = self.wall_approach_rates_m_s(v_m_s, time_s);
        [0, 1].map(|side| match &self.damping {
            Some(damping) if self.wall(side).is_there => {
                let overlap_m = self.wall(side).overlap_m(approaches_m[side]);
                self.damped_n(elastic_n[side], overlap_m, rates_m_s[side], damping.wall_coefficient[side])
            }
            _ => elastic_n[side],
        })
    }

    /// Slope dF/dδ (N/m) of each contact at rest, N − 1 values.
    pub fn tangents_n_per_m(&self) -> Vec<f64> {
        let tangent = |c: usize| {
            let rest_m = self.rest_overlap_m[c];
            let by_law = self.law.tangent(self.stiffness[c], rest_m);
            self.terms.iter().fold(by_law, |sum, term| sum + term.law.tangent(term.stiffness[c], rest_m))
        };
        (0..self.contact_count()).map(tangent).collect()
    }

    /// The same slopes of the contacts with the walls, 0 at free ends; in a ring the first is that of the contact that closes it.
    pub fn wall_tangents_n_per_m(&self) -> [f64; 2] {
        [0, 1].map(|side| {
            let Wall { is_there, stiffness, rest_overlap_m: rest_m, .. } = *self.wall(side);
            let tangent = |sum, term: &Term| sum + term.law.tangent(term.wall_stiffness[side], rest_m);
            let by_law = self.law.tangent(stiffness, rest_m);
            if is_there { self.terms.iter().fold(by_law, tangent) } else { 0.0 }
        })
    }

    /// The left wall, or the contact that closes a ring (0), or the right wall (1).
    pub fn wall(&self, side: usize) -> &Wall {
        if side == 0 { &self.walls.left } else { &self.walls.right }
    }

    /// Kinetic energy (J) of the beads `beads` at the velocities `v_m_s` (N values, m/s), as an
    /// [`ordered_sum`] for use in [`vectorized`].
    #[inline(always)]
    pub fn kinetic_j(&self, v_m_s: &[f64], beads: Range<usize>) -> f64 {
        let (masses, v) = (&self.mass_kg[beads.clone()], &v_m_s[beads]);
        ordered_sum(
            [masses, v],
            #[inline(always)]
            |[mass, v]| 0.5 * mass * (v * v),
        )
    }

    /// Writes the potential energy (J) of every contact into `energy_j` (N − 1 values).
    ///
    /// In a loaded chain it is the excess over the static equilibrium,
    /// `U(δ) − U(δ_rest) − F_rest·(δ − δ_rest)`, which is never negative: the last term is the work of the
    /// constant forces, so that kinetic energy and excess together are conserved.
    pub fn contact_energies_j(&self, u_m: &[f64], energy_j: &mut [f64]) {
        self.energies_of_contacts_j(u_m, 0..self.contact_count(), energy_j);
    }

    /// Writes the same of some `contacts`, each to its place in `energy_j`.
    pub fn energies_of_contacts_j(&self, u_m: &[f64], contacts: Range<usize>, energy_j: &mut [f64]) {
        let (chain, is_loaded) = (self, self.is_loaded());
        let energy_j = &mut energy_j[contacts.clone()];
        vectorized(
            Arch::new(),
            #[inline(always)]
            || {
                if is_loaded {
                    chain.law.with_power(ContactEnergies::<true> {
                        chain,
                        u_m,
                        contacts: contacts.clone(),
                        energy_j,
                    });
                } else {
                    chain.law.with_power(ContactEnergies::<false> {
                        chain,
                        u_m,
                        contacts: contacts.clone(),
                        energy_j,
                    });
                }
            },
        );
        for term in &self.terms {
            for (c, energy_j) in contacts.clone().zip(energy_j.iter_mut()) {
                *energy_j += self.term_j(term, u_m, c);
            }
        }
    }

    /// The energy (J) of a term of contact `c`.
    fn term_j(&self, term: &Term, u_m: &[f64], c: usize) -> f64 {
        term.law.excess_j(term.stiffness[c], self.rest_overlap_m[c], u_m[c] - u_m[c + 1], self.is_loaded())
    }

    /// The same energy (J) of one contact.
    pub fn contact_energy_j(&self, u_m: &[f64], contact: usize) -> f64 {
        let (stiffness, rest_m) = (self.stiffness[contact], self.rest_overlap_m[contact]);
        let approach_m = u_m[contact] - u_m[contact + 1];
        let by_law_j = self.law.excess_j(stiffness, rest_m, approach_m, rest_m != 0.0);
        self.terms.iter().fold(by_law_j, |sum, term| sum + self.term_j(term, u_m, contact))
    }

    /// The same energy (J) of the contacts with the left and with the right wall, 0 at free ends, at the displacements `u_m` (m,
    /// N values) of a state with this `extra`.
    pub fn wall_energies_j(&self, u_m: &[f64], extra: &[f64]) -> [f64; 2] {
        let [left_m, right_m] = self.wall_approaches_m(u_m, extra);
        [(0, left_m), (1, right_m)].map(|(side, approach_m)| {
            let wall = self.wall(side);
            let by_law_j = wall.excess_energy_j(&self.law, approach_m);
            let energy_j = |sum: f64, term: &Term| {
                let (stiffness, rest_m) = (term.wall_stiffness[side], wall.rest_overlap_m);
                // the excess over rest takes the place of the energy at walls, whatever the rest of the chain is
                sum + term.law.excess_j(stiffness, rest_m, approach_m, true)
            };
            if wall.is_there { self.terms.iter().fold(by_law_j, energy_j) } else { 0.0 }
        })
    }

    /// Distances (m) by which the end beads are nearer to the left and the right wall than at rest; in a ring the first is that of
    /// the last bead to the first one.
    pub fn wall_approaches_m(&self, u_m: &[f64], extra: &[f64]) -> [f64; 2] {
        if self.is_ring {
            return [u_m[u_m.len() - 1] - u_m[0], 0.0];
        }
        let [left_m, right_m] = self.walls_m(extra);
        [left_m - u_m[0], u_m[u_m.len() - 1] - right_m]
    }

    /// Speeds (m/s) at which the end beads and the walls approach each other at the time `time_s`, when beads have the velocities `v_m_s`
    /// (m/s); in a ring the first is that of the last bead and the first.
    pub fn wall_approach_rates_m_s(&self, v_m_s: &[f64], time_s: f64) -> [f64; 2] {
        let (first_m_s, last_m_s) = (v_m_s[0], v_m_s[v_m_s.len() - 1]);
        if self.is_ring {
            return [last_m_s - first_m_s, 0.0];
        }
        let at = Moment::new(1, time_s, 0.0);
        let [left_m_s, right_m_s] = self.moved_walls.each_ref().map(|moved| match moved {
            Some((_, drive)) if drive.prescribes == Quantity::Displacement => drive.waveform.slope(at),
            Some((_, drive)) => drive.waveform.value(at),
            None => 0.0,
        });
        [left_m_s - first_m_s, last_m_s - right_m_s]
    }

    /// The displacements (m) of the left and of the right wall in a state with this `extra`: 0 if nothing moves them.
    pub fn walls_m(&self, extra: &[f64]) -> [f64; 2] {
        let drives = self.rows.drives_of(extra);
        let place_m = |(d, _): &(usize, _)| drives.get(2 * d + 1).copied();
        self.moved_walls.each_ref().map(|moved| moved.as_ref().and_then(place_m).unwrap_or(0.0))
    }

    /// Energy of the springs and resonators of the beads `beads`, in a state with this `extra`.
    pub fn sites_energy(&self, u_m: &[f64], extra: &[f64], beads: Range<usize>) -> Energy {
        self.with_sites(Energy::default(), u_m, extra, beads)
    }

    /// Adds the energies of the springs and of the resonators of the beads `beads` to `energy`, one kind after the other.
    fn with_sites(&self, mut energy: Energy, u_m: &[f64], extra: &[f64], beads: Range<usize>) -> Energy {
        if self.sites.has_springs() {
            energy.potential_j += self.sites.springs_j(u_m, beads.clone());
        }
        if self.sites.has_resonators() {
            let [w_m, w_m_s] = self.rows.resonators_of(extra);
            energy.kinetic_j += self.sites.kinetic_j(w_m_s, beads.clone());
            energy.potential_j += self.sites.resonators_j(u_m, w_m, beads);
        }
        energy
    }

    /// Kinetic and potential energy of the whole chain in a state with this `extra`. `scratch` holds N − 1 values.
    pub fn energy(&self, u_m: &[f64], v_m_s: &[f64], extra: &[f64], scratch: &mut [f64]) -> Energy {
        self.contact_energies_j(u_m, scratch);
        self.energy_among((u_m, v_m_s, extra), 0..self.bead_count(), scratch)
    }

    /// The same, where no beads but `beads` have energy, and no contacts but those with the energies `contacts_j` (J). Both begin at
    /// places for an [`ordered_sum`].
    pub fn energy_among(
        &self,
        (u_m, v_m_s, extra): (&[f64], &[f64], &[f64]),
        beads: Range<usize>,
        contacts_j: &[f64],
    ) -> Energy {
        let [left, right] = self.wall_energies_j(u_m, extra);
        let energy = vectorized(
            Arch::new(),
            #[inline(always)]
            || Energy {
                kinetic_j: self.kinetic_j(v_m_s, beads.clone()),
                potential_j: ordered_sum([contacts_j], |[energy_j]| energy_j) + (left + right),
            },
        );
        self.with_sites(energy, u_m, extra, beads)
    }
}

/// The loop behind [`Chain::contact_energies_j`], one copy for each form of the power.
struct ContactEnergies<'a, const LOADED: bool> {
    chain: &'a Chain,
    u_m: &'a [f64],
    contacts: Range<usize>,
    energy_j: &'a mut [f64],
}

impl<const LOADED: bool> PowerUser for ContactEnergies<'_, LOADED> {
    type Output = ();

    #[inline(always)]
    fn run(self, power: impl Power) {
        let Self { chain, u_m, contacts, energy_j } = self;
        let (left_m, right_m) = (&u_m[contacts.clone()], &u_m[contacts.start + 1..=contacts.end]);
        let stiffness = &chain.stiffness[contacts.clone()];
        let (zero_up_to_m, exponent) = (chain.law.zero_up_to_m(), chain.law.alpha() + 1.0);
        if !LOADED {
            return evaluate(
                [left_m, right_m, stiffness],
                energy_j,
                power,
                zero_up_to_m,
                #[inline(always)]
                |[left, right, _]| left - right,
                #[inline(always)]
                |[_, _, stiffness], overlap, power| stiffness * power * overlap / exponent,
                #[inline(always)]
                |_, any_closed| any_closed,
            );
        }
        let excess = Excess::new(&chain.law);
        // without what the terms have
        let by_law: Vec<f64>;
        let (rest_m, rest_j) =
            (&chain.rest_overlap_m[contacts.clone()], &chain.rest_energy_j[contacts.clone()]);
        let force_n = if chain.terms.is_empty() {
            &chain.rest_force_n[contacts]
        } else {
            let at_rest = stiffness.iter().zip(rest_m);
            by_law = at_rest.map(|(k, rest_m)| chain.law.force(*k, *rest_m)).collect();
            &by_law
        };
        evaluate(
            [left_m, right_m, stiffness, rest_m, force_n, rest_j],
            energy_j,
            power,
            zero_up_to_m,
            #[inline(always)]
            |[left, right, _, rest, ..]| (left - right) + rest,
            #[inline(always)]
            |[left, right, stiffness, overlap_m, force_n, energy_j], overlap, power| {
                let energy = stiffness * power * overlap / exponent;
                excess.energy_j(AtRest { overlap_m, force_n, energy_j }, left - right, energy)
            },
            #[inline(always)]
            |_, _| true,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(alpha: f64) -> Chain {
        let law = ContactLaw::new(alpha);
        Chain::new(vec![1.0, 2.0, 4.0], vec![10.0, 10.0], vec![0.0, 0.0], Walls::default(), law)
    }

    #[test]
    fn energies_worked_out_by_hand() {
        let chain = chain(3.0);
        // overlaps 0.5 (closed) and −0.5 (open): 10·0.5⁴/4; ½(1·4 + 2·1 + 4·0)
        let energy = chain.energy(&[0.5, 0.0, 0.5], &[2.0, -1.0, 0.0], &[], &mut [0.0; 2]);
        assert_eq!(energy, Energy { kinetic_j: 3.0, potential_j: 0.15625 });
        assert_eq!(energy.total_j(), 3.15625);
    }

    #[test]
    fn vectorised_energies_equal_the_law_bit_for_bit() {
        for alpha in [1.0, 1.3, 1.5, 2.0, 3.0, 5.0, 10.0] {
            let law = ContactLaw::new(alpha);
            let u_m: Vec<f64> = (0..40_u32).map(|i| f64::from((i * 37) % 17) * 1e-5).collect();
            let (mass_kg, stiffness) = (vec![1.0; 40], vec![1e7; 39]);
            let chain = Chain::new(mass_kg, stiffness, vec![0.0; 39], Walls::default(), law.clone());
            let mut energy_j = vec![0.0; 39];
            chain.contact_energies_j(&u_m, &mut energy_j);
            for (c, energy) in energy_j.iter().enumerate() {
                assert_eq!(*energy, law.energy(1e7, chain.overlap_m(&u_m, c)), "α = {alpha}");
            }
        }
    }

    /// k = 4, α = 3, rest overlaps ½: U = δ⁴, F = 4·δ³, at rest 1/16 and ½. Beads displaced by ½
    /// and 0 between walls: overlaps 0 (left wall, open), 1 (contact), ½ (right wall).
    #[test]
    fn the_energy_of_a_loaded_chain_is_its_excess_over_rest() {
        let law = ContactLaw::new(3.0);
        let wall = Wall::new(&law, 4.0, 0.5);
        let walls = Walls { left: wall, right: wall };
        let chain = Chain::new(vec![1.0; 2], vec![4.0], vec![0.5], walls, law);
        assert_eq!(chain.energy(&[0.0; 2], &[0.0; 2], &[], &mut [0.0]).total_j(), 0.0);
        let mut contact_j = [0.0];
        chain.contact_energies_j(&[0.5, 0.0], &mut contact_j);
        assert_eq!(contact_j, [1.0 - 1.0 / 16.0 - 0.5 * 0.5]);
        // the left wall gives back what it stored, and its constant force is worked against
        assert_eq!(chain.wall_energies_j(&[0.5, 0.0], &[]), [-1.0 / 16.0 + 0.5 * 0.5, 0.0]);
    }
}
