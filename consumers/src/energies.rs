//! Energies of a chain left of a bead, in it, and right of it; and the energy that this bead reflects.

pub mod reflection;
mod step_error;
mod window;

pub use reflection::{
    ARRIVED, Corrected, EXCHANGED, MOVED, Moment, OPEN, Recoil, Reflected, Reflection, STATIONARY, Undefined,
};
pub use step_error::{STEP_SAFETY, step_error_j};

use pulp::Arch;
use reflection::{Parts, ReflectionWatch, incident_side};
use schemas::active::{Active, ContactEnergies};
use schemas::chain::Chain;
use schemas::drive::Side;
use schemas::frame::Frame;
use schemas::manifest::{Physics, RunManifest};
use schemas::results::ENERGIES;
use schemas::simd::{ordered_sum, vectorized};
use schemas::summary::Drift;
use serde::Serialize;

/// Energies (J) of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EnergyRow {
    /// Kinetic energy of all beads and resonators.
    pub kinetic_j: f64,
    /// Potential energy of contacts, walls, springs of beads and resonators.
    pub potential_j: f64,
    /// Kinetic plus potential energy.
    pub total_j: f64,
    /// Beads left of the split bead, their contacts (that with a left wall included), and half the contact with
    /// the split bead. The contact that closes a ring joins both sides: half of it counts here, half on the right.
    pub left_j: f64,
    /// The split bead and half of each of its contacts.
    pub split_j: f64,
    /// Beads right of the split bead, their contacts (that with a right wall included), and half the contact with
    /// the split bead; and half the contact that closes a ring.
    pub right_j: f64,
    /// Work that damped contacts have dissipated so far; 0 without damping.
    pub dissipated_j: f64,
    /// Error of total and dissipated energy, less the work of drives, relative to those of the initial state
    /// ([`Drift`]).
    pub relative_drift: f64,
    /// Energy that may still cross the split bead: its own, and that moving towards it on the incident side. NaN
    /// where nothing is reflected; see [`Undefined`].
    pub inbound_j: f64,
    /// The reflected energy without the recoil. NaN before the pulse has arrived at the split bead, and where
    /// nothing is reflected.
    pub corrected_j: f64,
    /// Work that drives have done so far, beyond that against the forces at rest; 0 without drives.
    pub driven_j: f64,
}

impl EnergyRow {
    /// Names of the columns, with units, in the order of [`EnergyRow::values`].
    pub const COLUMNS: [&'static str; 11] = ENERGIES;

    /// The values in the order of [`EnergyRow::COLUMNS`].
    pub fn values(&self) -> [f64; 11] {
        [
            self.kinetic_j,
            self.potential_j,
            self.total_j,
            self.left_j,
            self.split_j,
            self.right_j,
            self.dissipated_j,
            self.relative_drift,
            self.inbound_j,
            self.corrected_j,
            self.driven_j,
        ]
    }
}

/// Computes the energies of the frames of one run.
#[derive(Debug, Clone)]
pub struct Energies {
    chain: Chain,
    physics: Physics,
    drift: Drift,
    split_bead: usize,
    contacts: ContactEnergies,
    watch: Result<ReflectionWatch, Undefined>,
    max_abs_drift: f64,
    /// The largest error of the balance of energies so far (J), and the largest term of that.
    balance: Balance,
    last: Option<EnergyRow>,
}

/// The balance of energies: present and dissipated energy equal the initial energy and the work of drives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[expect(clippy::struct_field_names, reason = "units stand in names")]
struct Balance {
    initial_j: f64,
    /// Its largest error (J).
    off_j: f64,
    /// Its largest term (J).
    largest_j: f64,
}

impl Balance {
    fn take(&mut self, row: &EnergyRow) {
        let kept_j = row.total_j + row.dissipated_j;
        let larger = |most: f64, j: f64| if j.abs() > most { j.abs() } else { most };
        let off_j = kept_j - row.driven_j - self.initial_j;
        self.off_j = [off_j].into_iter().fold(self.off_j, larger);
        self.largest_j = [self.initial_j, kept_j, row.driven_j].into_iter().fold(self.largest_j, larger);
    }
}

/// Result at the end of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyOutcome {
    /// The bead that divides left from right.
    pub split_bead: u64,
    /// Beads of the chain.
    pub beads: u64,
    /// Energies of the last frame.
    pub last: EnergyRow,
    /// Reflection by the split bead, or the reason why there is none.
    pub reflection: Result<Reflection, Undefined>,
    /// Largest |relative drift| of any frame.
    pub max_abs_drift: f64,
    /// Drives do work on the chain.
    pub is_driven: bool,
    /// The chain is a ring: half of the contact that closes it counts on either side.
    pub is_ring: bool,
    balance: Balance,
}

impl EnergyOutcome {
    /// Error (J) of the energies of the last frame from the time step, unless energy is just crossing.
    pub fn step_error_j(&self) -> f64 {
        step_error_j(self.balance.off_j, self.balance.largest_j, self.beads)
    }
}

/// The bead that divides a chain by default: the first impurity that is not the striker, otherwise
/// the middle one.
pub fn default_split_bead(manifest: &RunManifest) -> u64 {
    let physics = &manifest.physics;
    let struck = physics.striker.bead;
    let impurity = physics.impurities.iter().find(|impurity| impurity.bead != struck);
    impurity.map_or(physics.beads / 2, |impurity| impurity.bead)
}

impl Energies {
    /// Makes one for the frames of `manifest`'s run, divided at `split_bead`, a bead of the chain.
    pub fn new(manifest: &RunManifest, split_bead: u64) -> Self {
        let chain = manifest.physics.chain();
        Self {
            watch: incident_side(manifest, split_bead).map(|side| ReflectionWatch::new(manifest, side)),
            drift: Drift::new(&manifest.physics, &chain),
            split_bead: usize::try_from(split_bead).unwrap_or(usize::MAX).min(chain.bead_count() - 1),
            contacts: ContactEnergies::new(&chain),
            balance: Balance { initial_j: manifest.physics.initial_energy().total_j(), ..Balance::default() },
            physics: manifest.physics.clone(),
            max_abs_drift: 0.0,
            last: None,
            chain,
        }
    }

    /// The energies of `frame`.
    pub fn observe(&mut self, frame: &Frame<'_>) -> EnergyRow {
        let active = frame.with_energy(&self.chain);
        self.contacts.renew(&self.chain, frame.u_m, active);
        let mut row = vectorized(
            Arch::new(),
            #[inline(always)]
            || self.sums(frame, active),
        );
        self.balance.take(&row);
        if row.relative_drift.abs() > self.max_abs_drift {
            self.max_abs_drift = row.relative_drift.abs();
        }
        if let Ok(watch) = &mut self.watch {
            let max_abs_drift = self.max_abs_drift;
            let incident = watch.found().incident;
            let (chain, s, contact_j) = (&self.chain, self.split_bead, self.contacts.values_j());
            let parts = vectorized(
                Arch::new(),
                #[inline(always)]
                || Parts { max_abs_drift, ..parts(chain, (frame, active), s, contact_j, &row, incident) },
            );
            watch.push(&parts);
            row.inbound_j = parts.inbound_j();
            row.corrected_j = watch.corrected_j(&parts);
        }
        self.last = Some(row);
        row
    }

    /// The sums over the beads and contacts of `frame`, without the reflection. All but `active` beads rest.
    #[inline(always)]
    fn sums(&self, frame: &Frame<'_>, active: Active) -> EnergyRow {
        let (chain, s, contact_j) = (&self.chain, self.split_bead, self.contacts.values_j());
        let v = frame.v_m_s;
        // contact s − 1 is left of the split bead, contact s right of it
        let left_contact = if s > 0 { contact_j[s - 1] } else { 0.0 };
        let right_contact = contact_j.get(s).copied().unwrap_or(0.0);

        let kinetic_left = chain.kinetic_j(v, active.within(0..s));
        let kinetic_split = chain.kinetic_j(v, s..s + 1);
        let kinetic_right = chain.kinetic_j(v, active.within(s + 1..chain.bead_count()));
        let (pressed, contacts) = (active.contacts(contact_j.len()), contact_j.len());
        let potential_left = total(&contact_j[pressed.within(0..s.saturating_sub(1))]);
        let potential_right = total(&contact_j[pressed.within((s + 1).min(contacts)..contacts)]);

        // the totals do not depend on where the chain is divided
        let kinetic_j = chain.kinetic_j(v, active.within(0..chain.bead_count()));
        let [left_wall, right_wall] = chain.wall_energies_j(frame.u_m, frame.extra);
        let walls_j = left_wall + right_wall;
        let [left_wall, closing_split, right_wall] =
            if chain.is_ring { self.closing_j(left_wall) } else { [left_wall, 0.0, right_wall] };
        let sites = |beads| chain.sites_energy(frame.u_m, frame.extra, active.within(beads));
        let (left, right) = (sites(0..s), sites(s + 1..chain.bead_count()));
        let (all, split) = (sites(0..chain.bead_count()), sites(s..s + 1));
        let kinetic_j = kinetic_j + all.kinetic_j;
        let potential_j = total(&contact_j[pressed.within(0..contacts)]) + walls_j + all.potential_j;
        let total_j = kinetic_j + potential_j;
        let dissipated_j = self.physics.dissipated_j(frame.extra);
        let driven_j = self.physics.driven_j(frame.extra);
        EnergyRow {
            kinetic_j,
            potential_j,
            total_j,
            left_j: kinetic_left + potential_left + 0.5 * left_contact + left_wall + left.total_j(),
            split_j: kinetic_split + 0.5 * (left_contact + right_contact) + closing_split + split.total_j(),
            right_j: kinetic_right + potential_right + 0.5 * right_contact + right_wall + right.total_j(),
            dissipated_j,
            driven_j,
            relative_drift: self.drift.of(total_j + dissipated_j, driven_j, v),
            inbound_j: f64::NAN,
            corrected_j: f64::NAN,
        }
    }

    /// The energy (J) of the contact that closes a ring, half of it where bead 0 is and half where the last one is: left of the
    /// split bead, in it, right of it.
    fn closing_j(&self, energy_j: f64) -> [f64; 3] {
        let half_j = 0.5 * energy_j;
        match self.split_bead {
            0 => [0.0, half_j, half_j],
            last if last + 1 == self.chain.bead_count() => [half_j, half_j, 0.0],
            _ => [half_j, 0.0, half_j],
        }
    }

    /// The bead that divides left from right.
    pub fn split_bead(&self) -> u64 {
        self.split_bead as u64
    }

    /// The outcome, if there was a frame.
    pub fn outcome(&self) -> Option<EnergyOutcome> {
        self.last.map(|last| EnergyOutcome {
            split_bead: self.split_bead(),
            beads: self.chain.bead_count() as u64,
            last,
            reflection: self.watch.as_ref().map_err(|undefined| *undefined).and_then(ReflectionWatch::told),
            max_abs_drift: self.max_abs_drift,
            is_driven: self.physics.is_driven(),
            is_ring: self.chain.is_ring,
            balance: self.balance,
        })
    }
}

/// The sum of energies (J), inlined where it is used.
#[inline(always)]
fn total(energies_j: &[f64]) -> f64 {
    ordered_sum(
        [energies_j],
        #[inline(always)]
        |[energy_j]| energy_j,
    )
}

/// The energies of `frame` as the reflection sees them, from the `incident` side of bead `s`.
#[inline(always)]
fn parts(
    chain: &Chain,
    (frame, active): (&Frame<'_>, Active),
    s: usize,
    contact_j: &[f64],
    row: &EnergyRow,
    incident: Side,
) -> Parts {
    // beads and contacts of the incident side, those with the split bead left out, and what points to it
    let (beads, contacts, direction, near, beyond_j) = match incident {
        Side::Left => (0..s, 0..s - 1, 1.0, s - 1, row.right_j),
        Side::Right => (s + 1..chain.bead_count(), s + 1..contact_j.len(), -1.0, s, row.left_j),
    };
    let (beads, contacts) = (active.within(beads), active.contacts(contact_j.len()).within(contacts));
    let v = frame.v_m_s;
    let (mass_kg, velocity) = (&chain.mass_kg[beads.clone()], &v[beads]);
    let moving_j = ordered_sum(
        [mass_kg, velocity],
        #[inline(always)]
        |[mass_kg, v]| {
            let energy_j = 0.5 * mass_kg * (v * v);
            if direction * v > 0.0 { energy_j } else { 0.0 }
        },
    );
    let towards = |left: f64, right: f64| direction * (left + right) > 0.0;
    let pressed_j = ordered_sum(
        [&contact_j[contacts.clone()], &v[contacts.clone()], &v[contacts.start + 1..=contacts.end]],
        #[inline(always)]
        |[energy_j, left, right]| if towards(left, right) { energy_j } else { 0.0 },
    );
    let shared_j = if towards(v[near], v[near + 1]) { 0.5 * contact_j[near] } else { 0.0 };
    Parts {
        at: Moment { frame: frame.frame, time_s: frame.time_s },
        incident_j: if incident == Side::Left { row.left_j } else { row.right_j },
        split_j: row.split_j,
        beyond_j,
        total_j: row.total_j,
        towards_j: moving_j + pressed_j + shared_j,
        end_velocities_m_s: [v[0], v[v.len() - 1]],
        max_abs_drift: 0.0,
        exchanged_j: row.dissipated_j.abs() + row.driven_j.abs(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::Impurity;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    fn manifest(beads: u64, split: u64) -> RunManifest {
        let mut config = PRESETS[0].config();
        config.chain.beads = beads;
        config.chain.alpha = Some(3.0);
        config.chain.stiffness = Some(64.0);
        config.chain.bead_mass_kg = Some(2.0);
        config.chain.impurities = vec![Impurity { bead: split, mass_kg: 4.0 }];
        config.striker.velocity_m_s = 1.0;
        config.time.duration_s = 100.0;
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        RunManifest::new(&config, "run", origin).expect("valid")
    }

    /// Overlaps 0.5, 0.5, open, 0.25 with k·δ⁴/4 = 16·δ⁴: energies 1, 1, 0, 1/16.
    #[test]
    fn energies_worked_out_by_hand() {
        let m = manifest(5, 2);
        let u_m = [1.0, 0.5, 0.0, 0.25, 0.0];
        let v_m_s = [1.0, 2.0, -1.0, 3.0, 0.0];
        let frame =
            Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
        let mut energies = Energies::new(&m, default_split_bead(&m));
        let row = energies.observe(&frame);
        assert_eq!(row.kinetic_j, 1.0 + 4.0 + 2.0 + 9.0);
        assert_eq!(row.potential_j, 2.0625);
        assert_eq!(row.left_j, 5.0 + 1.0 + 0.5);
        assert_eq!(row.split_j, 2.0 + 0.5);
        assert_eq!(row.right_j, 9.0 + 0.0625);
        assert_eq!(row.total_j, row.left_j + row.split_j + row.right_j);
        assert_eq!(row.relative_drift, (18.0625 - 1.0) / 1.0); // E0 = ½·2 kg·(1 m/s)²
        let outcome = energies.outcome().expect("one frame");
        let reflection = outcome.reflection.expect("bead 0 strikes towards bead 2");
        let energies = reflection.energies.expect("bead 2 has energy in the first frame");
        assert_eq!(energies.over_transmitted().value, 6.5 / 9.0625);
        // beads 0 and 1 and their contact move to the right, and so does contact 1 on average, ½·(2 − 1) m/s
        assert_eq!(row.inbound_j, row.split_j + 5.0 + 1.0 + 0.5);
        // the pulse was there in the first frame: the energy that it left behind is unknown
        assert!(row.corrected_j.is_nan() && reflection.recoil.is_none());
    }

    /// The contact that closes a ring of 5 has 16·½⁴ = 1 J: half of it where bead 0 is, half where bead 4 is.
    #[test]
    fn the_contact_that_closes_a_ring_is_on_both_sides() {
        let u_m = [0.0, 0.0, 0.0, 0.0, 0.5];
        let frame =
            Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &[0.0; 5], extra: &[], active: None };
        for (split, expected) in [(2, [0.5, 0.0, 0.5]), (0, [0.0, 0.5, 0.5]), (4, [0.5, 0.5, 0.0])] {
            let mut m = manifest(5, 2);
            let ends = &mut m.physics.ends;
            (ends.left, ends.right) = (schemas::config::End::Periodic, schemas::config::End::Periodic);
            let row = Energies::new(&m, split).observe(&frame);
            assert_eq!(([row.left_j, row.split_j, row.right_j], row.total_j), (expected, 1.0), "{split}");
        }
    }

    /// Sums that visit only what moves have the same bits, also where the window is wider than it need be, and where it begins anew.
    #[test]
    fn beads_at_rest_need_not_be_visited() {
        let bits = |row: &EnergyRow| row.values().map(f64::to_bits);
        for beads in [3, 8, 9, 40, 67] {
            for split in [1, 2, beads - 1, beads / 2] {
                let manifest = manifest(beads as u64, split as u64);
                let (mut whole, mut within) =
                    (Energies::new(&manifest, split as u64), Energies::new(&manifest, split as u64));
                for number in 0..400_usize {
                    let (first, length) = ((number * 7) % beads, 1 + (number * 5) % beads);
                    let end = (first + length).min(beads);
                    let moving = |i: &usize| (first..end).contains(i);
                    let value = |i: usize, of: usize| ((i * i * of + number) % 11) as f64 * 0.1 - 0.4;
                    let values =
                        |of| (0..beads).map(|i| if moving(&i) { value(i, of) } else { 0.0 }).collect();
                    let (u_m, v_m_s): (Vec<f64>, Vec<f64>) = (values(3), values(5));
                    let frame = number as u64;
                    let time_s = number as f64;
                    let frame = Frame {
                        frame,
                        step: frame,
                        time_s,
                        u_m: &u_m,
                        v_m_s: &v_m_s,
                        extra: &[],
                        active: None,
                    };
                    let wider = Active {
                        first: first.saturating_sub(number % 3),
                        end: (end + number % 4).min(beads),
                    };
                    let told = Frame { active: (number % 5 != 4).then_some(wider), ..frame };
                    let (one, other) = (whole.observe(&frame), within.observe(&told));
                    assert_eq!(bits(&one), bits(&other), "{beads} beads, split {split}, {wider:?}");
                }
            }
        }
    }

    /// A chain at rest to which drives have given 1 J and that has 1 J and 2⁻²⁰ J more: that is what the balance is off by.
    #[test]
    fn a_driven_chain_that_began_with_nothing_is_not_exact() {
        let balance = |given_j: f64, total_j: f64| {
            let mut balance = Balance::default();
            let row = Energies::new(&manifest(5, 2), 2).observe(&Frame {
                frame: 0,
                step: 0,
                time_s: 0.0,
                u_m: &[0.0; 5],
                v_m_s: &[0.0; 5],
                extra: &[],
                active: None,
            });
            balance.take(&EnergyRow { total_j, driven_j: given_j, ..row });
            balance.take(&row);
            (balance.off_j, balance.largest_j)
        };
        let off_j = (2.0_f64).powi(-20);
        assert_eq!(balance(1.0, 1.0 + off_j), (off_j, 1.0 + off_j));
        assert_eq!(balance(3.0, 1.0), (2.0, 3.0), "the work is a term of its own");
    }

    #[test]
    fn either_end_may_divide_the_chain() {
        for split in [0, 4] {
            let m = manifest(5, 2);
            let u_m = [1.0, 0.5, 0.0, 0.25, 0.0];
            let v_m_s = [1.0, 2.0, -1.0, 3.0, 0.0];
            let frame =
                Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
            let row = Energies::new(&m, split).observe(&frame);
            assert_eq!(row.left_j + row.split_j + row.right_j, row.total_j);
            assert_eq!(if split == 0 { row.left_j } else { row.right_j }, 0.0);
            assert!(row.inbound_j.is_nan() && row.corrected_j.is_nan());
        }
    }
}
