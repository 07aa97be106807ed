//! A few numbers about a frame, so that any plotting tool shows something useful at once.

use crate::active::{Active, ContactEnergies};
use crate::chain::{Chain, Energy};
use crate::frame::Frame;
use crate::manifest::Physics;

/// The summary of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Kinetic and potential energy of the whole chain.
    pub energy: Energy,
    /// Work (J) that damped contacts and drag have dissipated so far.
    pub dissipated_j: f64,
    /// Energy (J) that drives and baths have given so far.
    pub driven_j: f64,
    /// [`relative_drift`] against the energy of the initial state, also where a piston has most of it: this meaning is fixed,
    /// because recordings keep the number. Programs report [`Drift`].
    pub relative_drift: f64,
    /// The bead farthest along the direction of the shock that moves faster than a thousandth of
    /// the striker's initial speed.
    pub front_bead: u64,
    /// The impurities, in the order of the manifest.
    pub impurities: Vec<BeadState>,
}

/// Displacement and velocity of one bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeadState {
    /// Number of the bead.
    pub bead: u64,
    /// Displacement (m).
    pub u_m: f64,
    /// Velocity (m/s).
    pub v_m_s: f64,
}

/// Computes summaries of the frames of one run.
#[derive(Debug, Clone)]
pub struct Summarizer {
    chain: Chain,
    initial_j: f64,
    impurities: Vec<u64>,
    physics: Physics,
    /// Speed (m/s) above which a bead belongs to the shock.
    front_threshold_m_s: f64,
    contacts: ContactEnergies,
    driven_at_least_j: Option<f64>,
}

impl Summarizer {
    /// Makes one for the run that `physics` describes.
    pub fn new(physics: &Physics) -> Self {
        let chain = physics.chain();
        Self {
            initial_j: physics.initial_energy_of(&chain).total_j(),
            impurities: physics.impurities.iter().map(|impurity| impurity.bead).collect(),
            front_threshold_m_s: 1e-3 * physics.scales().speed_m_s(),
            physics: physics.clone(),
            contacts: ContactEnergies::new(&chain),
            driven_at_least_j: driven_at_least_j(physics),
            chain,
        }
    }

    /// The summary of `frame`.
    pub fn summarize(&mut self, frame: &Frame<'_>) -> Summary {
        let (chain, active) = (&self.chain, frame.with_energy(&self.chain));
        self.contacts.renew(chain, frame.u_m, active);
        let contacts_j = self.contacts.values_j();
        let contacts = active.contacts(contacts_j.len()).within(0..contacts_j.len());
        let beads = active.within(0..chain.bead_count());
        let state = (frame.u_m, frame.v_m_s, frame.extra);
        let energy = chain.energy_among(state, beads, &contacts_j[contacts]);
        let dissipated_j = self.physics.dissipated_j(frame.extra);
        let driven_j = self.physics.driven_j(frame.extra);
        let lost_j = dissipated_j - driven_j;
        Summary {
            energy,
            dissipated_j,
            driven_j,
            relative_drift: match self.driven_at_least_j {
                None => relative_drift(energy.total_j() + lost_j, self.initial_j),
                Some(least_j) => {
                    driven_drift(energy.total_j() + dissipated_j, driven_j, self.initial_j, least_j)
                }
            },
            front_bead: self.front_bead(frame),
            impurities: self.impurities.iter().map(|bead| bead_state(frame, *bead)).collect(),
        }
    }

    fn front_bead(&self, frame: &Frame<'_>) -> u64 {
        let Active { first, end } = frame.moving();
        let v_m_s = &frame.v_m_s[first..end];
        let moves = |v: &f64| v.abs() > self.front_threshold_m_s;
        let striker = &self.physics.striker;
        let is_leftward = striker.velocity_m_s < 0.0;
        let front = if is_leftward { v_m_s.iter().position(moves) } else { v_m_s.iter().rposition(moves) };
        front.map_or(striker.bead, |bead| (first + bead) as u64)
    }
}

/// `(E − E0)/E0` of an energy (J), the dissipated work included, against the initial one; 0 where both are 0,
/// in a chain that stays at rest.
pub fn relative_drift(energy_j: f64, initial_j: f64) -> f64 {
    if energy_j == initial_j { 0.0 } else { (energy_j - initial_j) / initial_j }
}

/// The least energy (J) that the drift of a driven chain is relative to: that of a bead at the speed `L/T`; none without drives and baths.
fn driven_at_least_j(physics: &Physics) -> Option<f64> {
    let speed_m_s = physics.scales().speed_m_s();
    physics.is_driven().then_some(0.5 * physics.bead_mass_kg * (speed_m_s * speed_m_s))
}

/// Error of the energy of a driven chain: the energy that it has and has dissipated, `kept_j`, less the initial energy and the work
/// of the drives, relative to the largest of `kept_j`, `initial_j` and `least_j` (J).
fn driven_drift(kept_j: f64, driven_j: f64, initial_j: f64, least_j: f64) -> f64 {
    let largest_j = [initial_j, least_j].into_iter().fold(kept_j, |most, j| if j > most { j } else { most });
    (kept_j - driven_j - initial_j) / largest_j
}

/// Strikers that are this many times as heavy as the median bead are pistons.
const PISTON_RATIO: f64 = 100.0;

/// Error ΔE of the energy of a run, relative to the energy that its chain has.
///
/// ΔE is relative to the initial energy E0, but for pistons and drives. A piston is a striker of at least 100 times the mass of the
/// median bead. It keeps most of E0 to itself, beside which any error would look small. With a piston, ΔE is relative to the energy
/// without the piston's kinetic energy, dissipated work included, or to the `½·m·v0²` of the median bead if that is more. In a driven
/// chain, ΔE is relative to the largest of three: the energy that it has and has dissipated, E0, and that of a bead at the speed `L/T`.
#[derive(Debug, Clone)]
pub struct Drift {
    initial_j: f64,
    rounding: f64,
    piston: Option<Piston>,
    driven_at_least_j: Option<f64>,
}

/// A heavy striker.
#[derive(Debug, Clone, Copy)]
struct Piston {
    bead: usize,
    mass_kg: f64,
    /// Energy (J) of the median bead at the piston's initial speed.
    median_j: f64,
}

impl Drift {
    /// Makes one for the run of `physics`, whose chain is `chain`.
    pub fn new(physics: &Physics, chain: &Chain) -> Self {
        let striker = physics.striker;
        // beads of a validated manifest are below N, which is an index
        let bead = usize::try_from(striker.bead).unwrap_or(usize::MAX);
        let mass_kg = chain.mass_kg[bead];
        let mut masses = chain.mass_kg.clone();
        let middle = (masses.len() - 1) / 2;
        let (_, median_kg, _) = masses.select_nth_unstable_by(middle, f64::total_cmp);
        let median_j = 0.5 * *median_kg * (striker.velocity_m_s * striker.velocity_m_s);
        let piston = Piston { bead, mass_kg, median_j };
        let piston = (mass_kg >= PISTON_RATIO * *median_kg).then_some(piston);
        let initial_j = physics.initial_energy_of(chain).total_j();
        let at_rest_j = (chain.rest_force_n.iter().zip(&chain.rest_overlap_m))
            .map(|(force_n, overlap_m)| force_n * overlap_m)
            .fold(0.0, |largest: f64, energy_j| if energy_j > largest { energy_j } else { largest });
        // a wave of the energy E0 changes the overlap δ of a contact under the force F by √(2·E0·δ/(α·F))
        let driven_at_least_j = driven_at_least_j(physics);
        let measure_j = driven_at_least_j
            .map_or(initial_j, |least_j| if least_j > initial_j { least_j } else { initial_j });
        let of_wave = (physics.alpha * at_rest_j / (2.0 * measure_j)).sqrt();
        let of_piston = piston.map_or(1.0, |piston| initial_j / piston.median_j);
        Self { initial_j, rounding: 0.5 * f64::EPSILON * (of_wave + of_piston), piston, driven_at_least_j }
    }

    /// Effect of one rounding on ΔE/E: half a unit in the last place, times the sum of two ratios. They are the overlap of the
    /// most loaded contact over its change by the wave, and the energy of a piston over that of its chain, 1 without a piston.
    /// A run adds up some of these effects, whatever its time step is.
    pub fn rounding(&self) -> f64 {
        self.rounding
    }

    /// `ΔE/E` of a state with the velocities `v_m_s` and the energy `energy_j` (J), dissipated work included, to which drives have
    /// given `driven_j` (J).
    pub fn of(&self, energy_j: f64, driven_j: f64, v_m_s: &[f64]) -> f64 {
        if let Some(least_j) = self.driven_at_least_j {
            return driven_drift(energy_j, driven_j, self.initial_j, least_j);
        }
        let Some(Piston { bead, mass_kg, median_j }) = self.piston else {
            return relative_drift(energy_j, self.initial_j);
        };
        let v = v_m_s[bead];
        let chain_j = energy_j - 0.5 * mass_kg * (v * v);
        (energy_j - self.initial_j) / if chain_j > median_j { chain_j } else { median_j }
    }
}

fn bead_state(frame: &Frame<'_>, bead: u64) -> BeadState {
    // beads of a validated manifest are below N, which is an index
    let i = usize::try_from(bead).unwrap_or(usize::MAX);
    BeadState { bead, u_m: frame.u_m[i], v_m_s: frame.v_m_s[i] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::presets::PRESETS;

    #[test]
    fn summary_of_the_initial_state() {
        let physics = Physics::resolve(&PRESETS[0].config()).expect("preset");
        let (u_m, v_m_s) = physics.initial_state();
        let frame =
            Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
        let summary = Summarizer::new(&physics).summarize(&frame);
        assert_eq!(summary.energy, Energy { kinetic_j: 0.0125, potential_j: 0.0 }); // ½·1 g·(5 m/s)²
        assert_eq!(summary.relative_drift, 0.0);
        assert_eq!(summary.front_bead, 0);
        assert_eq!(summary.impurities, [BeadState { bead: 500, u_m: 0.0, v_m_s: 0.0 }]);
    }

    /// 1 kg at 5 m/s has 12.5 J, and a bead of 1 g at 10 m/s that it has thrown 0.05 J.
    #[test]
    fn a_piston_s_own_energy_is_no_measure() {
        let mut config = PRESETS[2].config();
        config.chain.impurities = vec![crate::config::Impurity { bead: 0, mass_kg: 1.0 }];
        let physics = Physics::resolve(&config).expect("valid");
        let drift = Drift::new(&physics, &physics.chain());
        let (_, mut v_m_s) = physics.initial_state();
        assert_eq!(drift.of(12.5, 0.0, &v_m_s), 0.0);
        // the chain has nothing yet: one bead at 5 m/s is the measure
        assert!((drift.of(12.5 + 1e-6, 0.0, &v_m_s) - 1e-6 / 0.0125).abs() < 1e-12);
        v_m_s[1] = 10.0;
        assert!((drift.of(12.5 + 0.05, 0.0, &v_m_s) - 1.0).abs() < 1e-9);
        assert!(drift.rounding() > 1e-13 && drift.rounding() < 2e-13);
        // a striker of ten times the mass is none
        config.chain.impurities[0].mass_kg = 1e-2;
        let physics = Physics::resolve(&config).expect("valid");
        assert_eq!(Drift::new(&physics, &physics.chain()).of(0.25, 0.0, &v_m_s), 1.0);
    }

    /// 100 N on 1e7 N·m^−3/2 overlap by 46 µm; at 1e-13 m/s they change by 3e-19 m.
    #[test]
    fn a_weak_wave_under_load_is_lost_in_rounding() {
        let rounding = |velocity_m_s: f64| {
            let mut config = PRESETS[2].config();
            config.load.precompression_n = 100.0;
            config.striker.velocity_m_s = velocity_m_s;
            config.time.duration_s = 1e-3;
            let physics = Physics::resolve(&config).expect("valid");
            Drift::new(&physics, &physics.chain()).rounding()
        };
        assert!(rounding(1e-13) > 1e-3 && rounding(1e-13) < 1e-1);
        assert!((rounding(1e-9) / rounding(1e-13) * 1e4 - 1.0).abs() < 1e-3);
        assert!(rounding(5.0) < 1e-15);
    }

    #[test]
    fn the_front_is_looked_for_in_the_direction_of_the_shock() {
        let mut config = PRESETS[2].config();
        config.striker.bead = 199;
        config.striker.velocity_m_s = -5.0;
        let physics = Physics::resolve(&config).expect("valid");
        let (u_m, mut v_m_s) = physics.initial_state();
        v_m_s[120] = -1.0;
        let frame =
            Frame { frame: 0, step: 0, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
        assert_eq!(Summarizer::new(&physics).summarize(&frame).front_bead, 120);
    }
}
