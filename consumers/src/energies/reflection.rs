//! When the energy that comes back from the split bead has stopped changing, and how much of what lies
//! on that side never went there.
//!
//! # What is decided, and how
//!
//! The side of the split bead that the striker is on is the *incident* side. The energy there changes only
//! through the contact with the split bead, and that takes energy which moves towards it. So the
//! **inbound energy** is what decides: the energy of the split bead, of all beads of the incident side that move
//! towards it, and of the contacts between them whose two beads do so on average. Pulses that run away from
//! the split bead do not count, a bead that will hit it in a long while does.
//!
//! - The pulse *arrives* with the first frame in which [`ARRIVED`] of the energy is in or beyond the split bead.
//! - The reflected energy is *stationary* from when the inbound energy has fallen to [`STATIONARY`] of the
//!   total and stays there, as long as no front has met an end of the chain.
//! - A front has *met an end* with the first frame in which either end bead's velocity differs by more than
//!   [`MOVED`] of v0 from what it was on arrival.
//! - The value is that of the last frame before a front met an end, or of the last frame. Its uncertainty
//!   is the inbound energy of that frame, which may still cross, plus the range of the reflected energy over
//!   the last 50 to 100 T since it became stationary.
//!
//! A window alone would not do: a light impurity rests for tens of T between two hits, and 265 T pass before
//! a bead hits an impurity of 10 g again and takes 8e-5 of the energy back.
//!
//! # The recoil
//!
//! A struck chain of equal beads keeps some energy at the struck end: bead 0 flies off backwards. The paper
//! counts it as reflected. The **recoil** is the energy of the incident side that does not move towards the
//! split bead in the last frame before the pulse arrives; it is measured in the run itself. The *corrected*
//! reflected energy is the reflected energy without it, the *incident* energy is the total without it.

use super::window::Window;
use schemas::manifest::RunManifest;
use std::fmt;

/// Part of the total energy that has reached the split bead when a pulse has arrived. What it reflects
/// from its leading edge has then not met its rear, so that the recoil is still untouched.
pub const ARRIVED: f64 = 1e-3;

/// Part of the total energy that may still cross the split bead when the reflected energy is stationary.
pub const STATIONARY: f64 = 1e-4;

/// Part of v0 by which the velocity of an end bead changes when a front has met the end.
pub const MOVED: f64 = 1e-3;

/// Length of the window over which the reflected energy is watched, in collision times T.
const WINDOW: f64 = 50.0;

/// Length of the window over which the recoil is watched, in T: a pulse runs about its own length in it.
const RECOIL_WINDOW: f64 = 10.0;

/// A side of the split bead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Lower bead numbers.
    Left,
    /// Higher bead numbers.
    Right,
}

impl Side {
    /// `left` or `right`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// Why there is no reflected energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Undefined {
    /// The split bead is the striker.
    SplitIsStriker,
    /// The split bead is an end of the chain.
    SplitIsEnd,
    /// The striker does not move.
    StrikerRests,
    /// The striker moves away from the split bead.
    StrikerMovesAway,
    /// Contacts are compressed before anything moves: energy is everywhere.
    Loaded,
}

impl fmt::Display for Undefined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SplitIsStriker => "not defined: the split bead is the striker",
            Self::SplitIsEnd => "not defined: the split bead is an end of the chain",
            Self::StrikerRests => "not defined: the striker does not move",
            Self::StrikerMovesAway => "not defined: the striker moves away from the split bead",
            Self::Loaded => "not defined: the chain is loaded, there is energy everywhere",
        })
    }
}

/// The frame at which something happens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Number of the frame.
    pub frame: u64,
    /// Its time (s).
    pub time_s: f64,
}

/// Energy that the incident pulse has left behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recoil {
    /// The energy (J).
    pub energy_j: f64,
    /// How much it changed (J) over the last 10 to 20 T: near α = 1 the pulse leaves something behind at
    /// every bead, also while it is being reflected.
    pub uncertainty_j: f64,
    /// The frame it was measured in, the last before the pulse arrived.
    pub at: Moment,
}

/// Reflected and transmitted energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflected {
    /// The frame they were measured in.
    pub at: Moment,
    /// Energy of the incident side (J), with half the contact with the split bead.
    pub reflected_j: f64,
    /// Energy of the other side (J), with half the contact with the split bead.
    pub transmitted_j: f64,
    /// Energy of the chain (J).
    pub total_j: f64,
    /// What the reflected energy may yet change by (J); see the [module](self).
    pub uncertainty_j: f64,
    /// The inbound part of that (J).
    pub inbound_j: f64,
}

impl Reflected {
    /// Reflected over total energy, as the paper defines it.
    pub fn over_total(&self) -> f64 {
        self.reflected_j / self.total_j
    }

    /// Reflected over transmitted energy, as the paper defines it.
    pub fn over_transmitted(&self) -> f64 {
        self.reflected_j / self.transmitted_j
    }
}

/// Reflected energy without the recoil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corrected {
    /// Reflected energy minus recoil (J).
    pub reflected_j: f64,
    /// Its uncertainty (J): that of both.
    pub uncertainty_j: f64,
    /// Total energy minus recoil (J): what the incident pulse brings.
    pub incident_j: f64,
    /// Reflected over total energy of the chain, to be compared with [`Reflected::over_total`].
    pub over_total: f64,
    /// Reflected over incident energy: the reflectivity of the impurity.
    pub over_incident: f64,
    /// Reflected over transmitted energy.
    pub over_transmitted: f64,
}

/// What a run has shown of a reflection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflection {
    /// The incident side.
    pub incident: Side,
    /// When the pulse arrived; the first frame, if it was there already.
    pub arrival: Option<Moment>,
    /// What the pulse had left behind; none if no frame was seen before it arrived.
    pub recoil: Option<Recoil>,
    /// Since when the reflected energy is stationary, if it became so and stayed so.
    pub stationary_since: Option<Moment>,
    /// The end bead that a front met, and when.
    pub met_end: Option<(u64, Moment)>,
    /// The energies, once the pulse has arrived.
    pub energies: Option<Reflected>,
}

impl Reflection {
    /// The reflected energy without the recoil, if both are known.
    pub fn corrected(&self) -> Option<Corrected> {
        let (energies, recoil) = (self.energies?, self.recoil?);
        let reflected_j = energies.reflected_j - recoil.energy_j;
        let incident_j = energies.total_j - recoil.energy_j;
        Some(Corrected {
            reflected_j,
            uncertainty_j: energies.uncertainty_j + recoil.uncertainty_j,
            incident_j,
            over_total: reflected_j / energies.total_j,
            over_incident: reflected_j / incident_j,
            over_transmitted: reflected_j / energies.transmitted_j,
        })
    }
}

/// What the watcher needs to know of a frame: energies in J, velocities in m/s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parts {
    pub(super) at: Moment,
    pub(super) incident_j: f64,
    pub(super) split_j: f64,
    pub(super) beyond_j: f64,
    pub(super) total_j: f64,
    /// Of the incident side alone, what moves towards the split bead.
    pub(super) towards_j: f64,
    pub(super) end_velocities_m_s: [f64; 2],
}

impl Parts {
    /// What may still cross the split bead (J).
    pub(super) fn inbound_j(&self) -> f64 {
        self.split_j + self.towards_j
    }
}

/// Watches one reflection, frame by frame.
#[derive(Debug, Clone)]
pub(super) struct Watch {
    moved_m_s: f64,
    end_beads: [u64; 2],
    end_velocities_m_s: [f64; 2],
    recoil_window: Window,
    window: Window,
    found: Reflection,
}

/// The incident side, unless nothing is reflected at `split_bead`.
pub(super) fn incident_side(manifest: &RunManifest, split_bead: u64) -> Result<Side, Undefined> {
    let physics = &manifest.physics;
    let (striker, velocity_m_s) = (physics.striker.bead, physics.striker.velocity_m_s);
    if striker == split_bead {
        return Err(Undefined::SplitIsStriker);
    }
    if split_bead == 0 || split_bead + 1 >= physics.beads {
        return Err(Undefined::SplitIsEnd);
    }
    if velocity_m_s == 0.0 {
        return Err(Undefined::StrikerRests);
    }
    if physics.chain().is_loaded() {
        return Err(Undefined::Loaded);
    }
    match (striker < split_bead, velocity_m_s > 0.0) {
        (true, true) => Ok(Side::Left),
        (false, false) => Ok(Side::Right),
        _ => Err(Undefined::StrikerMovesAway),
    }
}

impl Watch {
    pub(super) fn new(manifest: &RunManifest, incident: Side) -> Self {
        let physics = &manifest.physics;
        let collision_s = physics.scales().time_s;
        Self {
            moved_m_s: MOVED * physics.striker.velocity_m_s.abs(),
            end_beads: [0, physics.beads - 1],
            end_velocities_m_s: [0.0; 2],
            recoil_window: Window::new(RECOIL_WINDOW * collision_s),
            window: Window::new(WINDOW * collision_s),
            found: Reflection {
                incident,
                arrival: None,
                recoil: None,
                stationary_since: None,
                met_end: None,
                energies: None,
            },
        }
    }

    /// Looks at the next frame.
    pub(super) fn push(&mut self, parts: &Parts) {
        if self.found.arrival.is_none() {
            if parts.split_j + parts.beyond_j < ARRIVED * parts.total_j {
                return self.approach(parts);
            }
            self.found.arrival = Some(parts.at);
            self.end_velocities_m_s = parts.end_velocities_m_s;
        }
        if self.found.met_end.is_none() {
            match self.end_that_moved(parts) {
                Some(bead) => self.found.met_end = Some((bead, parts.at)),
                None => self.scatter(parts),
            }
        }
    }

    /// The corrected reflected energy (J) of a frame, NaN before the pulse has arrived.
    pub(super) fn corrected_j(&self, parts: &Parts) -> f64 {
        match (self.found.arrival, self.found.recoil) {
            (Some(_), Some(recoil)) => parts.incident_j - recoil.energy_j,
            _ => f64::NAN,
        }
    }

    pub(super) fn found(&self) -> Reflection {
        self.found
    }

    fn approach(&mut self, parts: &Parts) {
        let energy_j = parts.incident_j - parts.towards_j;
        self.recoil_window.push(parts.at.time_s, energy_j);
        let uncertainty_j = self.recoil_window.range();
        self.found.recoil = Some(Recoil { energy_j, uncertainty_j, at: parts.at });
    }

    fn end_that_moved(&self, parts: &Parts) -> Option<u64> {
        let velocities = parts.end_velocities_m_s.iter().zip(&self.end_velocities_m_s);
        let moved = velocities.map(|(now, on_arrival)| (now - on_arrival).abs() > self.moved_m_s);
        self.end_beads.iter().zip(moved).find_map(|(bead, moved)| moved.then_some(*bead))
    }

    fn scatter(&mut self, parts: &Parts) {
        let inbound_j = parts.inbound_j();
        if inbound_j > STATIONARY * parts.total_j {
            self.found.stationary_since = None;
            self.window.clear();
        } else if self.found.stationary_since.is_none() {
            self.found.stationary_since = Some(parts.at);
        }
        self.window.push(parts.at.time_s, parts.incident_j);
        self.found.energies = Some(Reflected {
            at: parts.at,
            reflected_j: parts.incident_j,
            transmitted_j: parts.beyond_j,
            total_j: parts.total_j,
            uncertainty_j: inbound_j + self.window.range(),
            inbound_j,
        });
    }
}
