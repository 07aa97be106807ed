//! Reflection by the split bead: the time from which the energy that comes back is stationary, and the part of the
//! energy on that side that never went to the split bead.
//!
//! # Criteria
//!
//! The striker's side of the split bead is the *incident* side. The energy there changes only through the contact with
//! the split bead, which takes energy that moves towards it, if the striker alone has energy at first. So the **inbound energy** decides: the energy of the split
//! bead, of all beads of the incident side that move towards it, and of the contacts between them whose two beads do so
//! on average. Pulses that run away from the split bead do not count; a bead that will hit it in a long while counts.
//!
//! - The pulse *arrives* with the first frame in which [`ARRIVED`] of the energy is in or beyond the split bead.
//! - The reflected energy is *stationary* from when the inbound energy has fallen to [`STATIONARY`] of the
//!   total and stays there, as long as no front has met an end of the chain.
//! - A front has *met an end* with the first frame in which either end bead's velocity differs by more than
//!   [`MOVED`] of v0 from what it was on arrival.
//! - The value is that of the last frame before a front met an end, or of the last frame. Its uncertainty
//!   is the inbound energy of that frame, which may still cross, plus the range of the reflected energy over
//!   the last 50 to 100 T since it became stationary, plus the error of the time step ([`step_error_j`]).
//! - Drag, absorbing ends, baths and drives take energy from either side, or give some, which nothing reflects. The value
//!   is that of the last frame before they have exchanged [`EXCHANGED`] of the energy, which is in its uncertainty. If
//!   more than [`OPEN`] of the energy might still have crossed then, there is none ([`Undefined::Exchanged`]).
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

use super::step_error::step_error_j;
use super::window::Window;
use crate::uncertain::Uncertain;
use schemas::drive::Side;
use schemas::manifest::{Physics, RunManifest};
use serde::Serialize;
use std::fmt;

/// Part of the total energy that has reached the split bead when a pulse has arrived. The reflection of its leading
/// edge has then not met its rear, so that the recoil is still untouched.
pub const ARRIVED: f64 = 1e-3;

/// Part of the total energy that may still cross the split bead when the reflected energy is stationary.
pub const STATIONARY: f64 = 1e-4;

/// Part of v0 by which the velocity of an end bead changes when a front has met the end.
pub const MOVED: f64 = 1e-3;

/// Part of the energy that the chain may have exchanged with the outside: a hundredth of [`STATIONARY`], so that it hardly
/// adds to a ±.
pub const EXCHANGED: f64 = 1e-6;

/// Part of the total energy that may still cross the split bead when energy begins to be exchanged: what is cut off then is
/// known to a hundredth, or not told.
pub const OPEN: f64 = 1e-2;

/// Length of the window over which the reflected energy is watched, in collision times T.
const WINDOW: f64 = 50.0;

/// Length of the window over which the recoil is watched, in T: a pulse runs about its own length in it.
const RECOIL_WINDOW: f64 = 10.0;

/// Reason why there is no reflected energy.
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
    /// Something beside the striker has energy at first, which nothing needs to reflect.
    OthersMove,
    /// Contacts are compressed before anything moves: energy is everywhere.
    Loaded,
    /// Contacts dissipate: the energy of a side falls wherever anything moves.
    Damped,
    /// The pulse had arrived before the first frame that was seen, and a front may have met an end by then.
    ArrivedBefore,
    /// Energy was exchanged with the outside while much of it might still have crossed the split bead.
    Exchanged,
}

impl fmt::Display for Undefined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SplitIsStriker => "not defined: the split bead is the striker",
            Self::SplitIsEnd => "not defined: the split bead is an end of the chain",
            Self::StrikerRests => "not defined: the striker does not move",
            Self::StrikerMovesAway => "not defined: the striker moves away from the split bead",
            Self::OthersMove => "not defined: more than one striker moves, or more is pressed, at the beginning",
            Self::Loaded => "not defined: the chain is loaded, there is energy everywhere",
            Self::Damped => "not defined: contacts dissipate, the energy of a side never rests",
            Self::ArrivedBefore => "unknown: the pulse had arrived before the first frame that was looked at",
            Self::Exchanged => {
                "not defined: drag, absorbing ends, baths or drives changed the energy before the reflection was complete"
            }
        })
    }
}

/// The frame at which something happens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moment {
    /// Number of the frame.
    pub frame: u64,
    /// Its time (s).
    pub time_s: f64,
}

/// Energy that the incident pulse has left behind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Recoil {
    /// The energy (J).
    pub energy_j: f64,
    /// Its change (J) over the last 10 to 20 T, because near α = 1 the pulse leaves something behind at every bead,
    /// also while it is being reflected; and the error of the time step.
    pub uncertainty_j: f64,
    /// The frame it was measured in, the last before the pulse arrived.
    pub at: Moment,
}

/// Reflected and transmitted energy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reflected {
    /// The frame they were measured in.
    pub at: Moment,
    /// Energy of the incident side (J), with half the contact with the split bead.
    pub reflected_j: f64,
    /// Energy of the other side (J), with half the contact with the split bead.
    pub transmitted_j: f64,
    /// Energy of the chain (J).
    pub total_j: f64,
    /// Largest error (J) and future change of the reflected energy; see the [module](self).
    pub uncertainty_j: f64,
    /// The inbound part of that (J).
    pub inbound_j: f64,
    /// The part of it that the time step makes (J).
    pub step_error_j: f64,
}

impl Reflected {
    /// Reflected over total energy, as the paper defines it.
    pub fn over_total(&self) -> Uncertain {
        share(self.reflected_j, self.uncertainty_j, self.total_j)
    }

    /// Reflected over transmitted energy, as the paper defines it.
    pub fn over_transmitted(&self) -> Uncertain {
        over_rest(self.reflected_j, self.uncertainty_j, self.transmitted_j)
    }
}

/// A part (J) of a whole that is known far better.
fn share(part_j: f64, off_j: f64, whole_j: f64) -> Uncertain {
    Uncertain::new(part_j / whole_j, off_j / whole_j)
}

/// A part (J) over the rest: energy that the one lacks the other has, `d(p/r) = (dp/r)·(1 + p/r)`.
fn over_rest(part_j: f64, off_j: f64, rest_j: f64) -> Uncertain {
    let ratio = part_j / rest_j;
    Uncertain::new(ratio, off_j / rest_j * (1.0 + ratio.abs()))
}

/// Reflected energy without the recoil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corrected {
    /// Reflected energy minus recoil (J).
    pub reflected_j: f64,
    /// Its uncertainty (J): that of both.
    pub uncertainty_j: f64,
    /// Total energy minus recoil (J): the incident pulse's.
    pub incident_j: f64,
    /// Reflected over total energy of the chain, to be compared with [`Reflected::over_total`].
    pub over_total: Uncertain,
    /// Reflected over incident energy: the reflectivity of the impurity.
    pub over_incident: Uncertain,
    /// Reflected over transmitted energy.
    pub over_transmitted: Uncertain,
}

/// The reflection that a run has shown so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflection {
    /// The incident side.
    pub incident: Side,
    /// Arrival of the pulse.
    pub arrival: Option<Moment>,
    /// The energy that the pulse had left behind; none if no frame was seen in the 10 T before it arrived.
    pub recoil: Option<Recoil>,
    /// Moment from which on the reflected energy is stationary, if it became so and stayed so.
    pub stationary_since: Option<Moment>,
    /// The end bead that a front met, and when.
    pub met_end: Option<(u64, Moment)>,
    /// The first frame before which energy was exchanged with the outside, if no front had met an end by then.
    pub exchanged: Option<Moment>,
    /// The energies, once the pulse has arrived.
    pub energies: Option<Reflected>,
}

impl Reflection {
    /// The moment from which on the reflected energy is not looked at any more.
    pub fn until(&self) -> Option<Moment> {
        self.met_end.map(|(_, at)| at).or(self.exchanged)
    }

    /// The reflected energy without the recoil, if both are known.
    pub fn corrected(&self) -> Option<Corrected> {
        let (energies, recoil) = (self.energies?, self.recoil?);
        let reflected_j = energies.reflected_j - recoil.energy_j;
        let incident_j = energies.total_j - recoil.energy_j;
        let uncertainty_j = energies.uncertainty_j + recoil.uncertainty_j;
        Some(Corrected {
            reflected_j,
            uncertainty_j,
            incident_j,
            over_total: share(reflected_j, uncertainty_j, energies.total_j),
            over_incident: share(reflected_j, uncertainty_j, incident_j),
            over_transmitted: over_rest(reflected_j, uncertainty_j, energies.transmitted_j),
        })
    }
}

/// Values of a frame that the watcher needs: energies in J, velocities in m/s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parts {
    pub(super) at: Moment,
    pub(super) incident_j: f64,
    pub(super) split_j: f64,
    pub(super) beyond_j: f64,
    pub(super) total_j: f64,
    /// The energy of the incident side that moves towards the split bead.
    pub(super) towards_j: f64,
    pub(super) end_velocities_m_s: [f64; 2],
    /// The largest relative error of the total energy so far.
    pub(super) max_abs_drift: f64,
    /// The energy that came from outside or went there so far.
    pub(super) exchanged_j: f64,
}

impl Parts {
    /// Energy (J) that may still cross the split bead.
    pub(super) fn inbound_j(&self) -> f64 {
        self.split_j + self.towards_j
    }
}

/// Watches one reflection, frame by frame.
#[derive(Debug, Clone)]
pub(super) struct ReflectionWatch {
    moved_m_s: f64,
    end_beads: [u64; 2],
    end_velocities_m_s: [f64; 2],
    recoil_within_s: f64,
    recoil_window: Window,
    window: Window,
    /// True if the pulse had arrived before the first frame.
    is_late: bool,
    found: Reflection,
}

/// The incident side, unless nothing is reflected at `split_bead`.
pub(super) fn incident_side(manifest: &RunManifest, split_bead: u64) -> Result<Side, Undefined> {
    let physics = &manifest.physics;
    let (striker, velocity_m_s) = (physics.striker.bead, striker_m_s(physics));
    if physics.striker.velocity_m_s == 0.0 || velocity_m_s == 0.0 {
        return Err(Undefined::StrikerRests);
    }
    if striker == split_bead {
        return Err(Undefined::SplitIsStriker);
    }
    if split_bead == 0 || split_bead + 1 >= physics.beads {
        return Err(Undefined::SplitIsEnd);
    }
    let chain = physics.chain();
    if chain.is_pressed() {
        return Err(Undefined::Loaded);
    }
    if chain.damping.is_some() {
        return Err(Undefined::Damped);
    }
    let mass_kg = usize::try_from(striker).ok().and_then(|bead| chain.mass_kg.get(bead));
    let striker_j = mass_kg.map_or(0.0, |mass_kg| 0.5 * mass_kg * (velocity_m_s * velocity_m_s));
    if (physics.initial_energy().total_j() - striker_j).abs() > EXCHANGED * striker_j {
        return Err(Undefined::OthersMove);
    }
    match (striker < split_bead, velocity_m_s > 0.0) {
        (true, true) => Ok(Side::Left),
        (false, false) => Ok(Side::Right),
        _ => Err(Undefined::StrikerMovesAway),
    }
}

/// The velocity (m/s) with which the bead of the striker begins.
fn striker_m_s(physics: &Physics) -> f64 {
    let (_, v_m_s) = physics.initial_state();
    usize::try_from(physics.striker.bead).ok().and_then(|bead| v_m_s.get(bead).copied()).unwrap_or(0.0)
}

impl ReflectionWatch {
    pub(super) fn new(manifest: &RunManifest, incident: Side) -> Self {
        let physics = &manifest.physics;
        let collision_s = physics.scales().time_s;
        Self {
            moved_m_s: MOVED * striker_m_s(physics).abs(),
            end_beads: [0, physics.beads - 1],
            end_velocities_m_s: [0.0; 2],
            recoil_within_s: RECOIL_WINDOW * collision_s,
            recoil_window: Window::new(RECOIL_WINDOW * collision_s),
            window: Window::new(WINDOW * collision_s),
            is_late: false,
            found: Reflection {
                incident,
                arrival: None,
                recoil: None,
                stationary_since: None,
                met_end: None,
                exchanged: None,
                energies: None,
            },
        }
    }

    /// Looks at the next frame.
    pub(super) fn push(&mut self, parts: &Parts) {
        if self.found.met_end.is_none() && parts.exchanged_j > EXCHANGED * parts.total_j {
            self.found.exchanged.get_or_insert(parts.at);
        }
        if self.is_late || self.found.exchanged.is_some() {
            return;
        }
        if self.found.arrival.is_none() {
            if parts.split_j + parts.beyond_j < ARRIVED * parts.total_j {
                return self.approach(parts);
            }
            if self.found.recoil.is_none() && parts.at.time_s > 0.0 {
                self.is_late = true;
                return;
            }
            self.found.arrival = Some(parts.at);
            // the first kick, and what a pulse leaves behind on a long way that nobody saw
            let seen = |recoil: &Recoil| {
                recoil.at.time_s > 0.0 && parts.at.time_s - recoil.at.time_s <= self.recoil_within_s
            };
            self.found.recoil = self.found.recoil.filter(seen);
            self.end_velocities_m_s = parts.end_velocities_m_s;
        }
        if self.found.met_end.is_none() {
            match self.end_that_moved(parts) {
                Some(bead) => self.found.met_end = Some((bead, parts.at)),
                None => self.scatter(parts),
            }
        }
    }

    /// The corrected reflected energy (J) of a frame, NaN before the pulse has arrived and where nothing is told.
    pub(super) fn corrected_j(&self, parts: &Parts) -> f64 {
        match (self.found.arrival, self.found.recoil) {
            (Some(_), Some(recoil)) if self.told().is_ok() => parts.incident_j - recoil.energy_j,
            _ => f64::NAN,
        }
    }

    pub(super) fn found(&self) -> Reflection {
        self.found
    }

    /// The reflection, unless its begin was not seen, or energy was exchanged with the outside before it was complete.
    pub(super) fn told(&self) -> Result<Reflection, Undefined> {
        if self.is_late {
            return Err(Undefined::ArrivedBefore);
        }
        let is_open = |energies: Reflected| energies.inbound_j > OPEN * energies.total_j;
        if self.found.exchanged.is_some() && self.found.energies.is_none_or(is_open) {
            return Err(Undefined::Exchanged);
        }
        Ok(self.found)
    }

    fn approach(&mut self, parts: &Parts) {
        let energy_j = parts.incident_j - parts.towards_j;
        self.recoil_window.push(parts.at.time_s, energy_j);
        let uncertainty_j = self.recoil_window.range() + self.step_error_j(parts) + parts.exchanged_j;
        self.found.recoil = Some(Recoil { energy_j, uncertainty_j, at: parts.at });
    }

    fn step_error_j(&self, parts: &Parts) -> f64 {
        step_error_j(parts.total_j * parts.max_abs_drift, parts.total_j, self.end_beads[1] + 1)
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
        } else {
            self.found.stationary_since.get_or_insert(parts.at);
            self.window.push(parts.at.time_s, parts.incident_j);
        }
        let step_error_j = self.step_error_j(parts);
        self.found.energies = Some(Reflected {
            at: parts.at,
            reflected_j: parts.incident_j,
            transmitted_j: parts.beyond_j,
            total_j: parts.total_j,
            uncertainty_j: inbound_j + self.window.range() + step_error_j + parts.exchanged_j,
            inbound_j,
            step_error_j,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::{RunConfig, StrikerConfig};
    use schemas::manifest::Origin;
    use schemas::presets::Preset;

    fn manifest(change: impl FnOnce(&mut RunConfig)) -> RunManifest {
        let mut config = Preset::find("homogeneous").expect("preset").config();
        change(&mut config);
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        RunManifest::new(&config, "run", origin).expect("valid")
    }

    /// A frame `collisions` T after the start, of 1 J in all, with these parts on the incident side, in the split bead,
    /// and on the incident side moving towards the split bead.
    fn frame(watch: &ReflectionWatch, collisions: u64, [incident_j, split_j, towards_j]: [f64; 3]) -> Parts {
        Parts {
            at: Moment {
                frame: collisions,
                time_s: collisions as f64 * watch.recoil_within_s / RECOIL_WINDOW,
            },
            incident_j,
            split_j,
            beyond_j: 1.0 - incident_j - split_j,
            total_j: 1.0,
            towards_j,
            end_velocities_m_s: [-0.35, 0.0],
            max_abs_drift: 0.0,
            exchanged_j: 0.0,
        }
    }

    fn watched(frames: &[(u64, [f64; 3])]) -> ReflectionWatch {
        let mut watch = ReflectionWatch::new(&manifest(|_| {}), Side::Left);
        for (collisions, parts) in frames {
            watch.push(&frame(&watch, *collisions, *parts));
        }
        watch
    }

    /// 1/16 is left behind, 1/4 comes back; 1/64 of that returns and crosses 40 T later.
    #[test]
    fn a_rest_is_not_stationary_while_something_returns() {
        let mut frames = vec![(5, [1.0, 0.0, 0.9375]), (9, [1.0, 0.0, 0.9375]), (12, [0.75, 0.25, 0.25])];
        frames.extend((13..53).map(|at| (at, [0.25, 0.0, 0.015_625])));
        let resting = watched(&frames).found();
        let energies = resting.energies.expect("arrived");
        assert_eq!(resting.arrival.map(|arrival| arrival.frame), Some(12));
        assert_eq!((energies.reflected_j, energies.inbound_j), (0.25, 0.015_625));
        assert_eq!(resting.stationary_since, None);
        let corrected = resting.corrected().expect("seen at 9 T");
        assert_eq!((corrected.reflected_j, corrected.incident_j), (0.1875, 0.9375));
        assert_eq!(corrected.over_incident.value, 0.2);

        frames.extend((53..60).map(|at| (at, [0.234_375, 0.0, 0.0])));
        let done = watched(&frames).found();
        assert_eq!(done.stationary_since.map(|since| since.frame), Some(53));
        let energies = done.energies.expect("arrived");
        // nothing is on its way, nothing has changed: rounding is left
        let rounding = 200.0 * f64::EPSILON;
        assert_eq!(
            (energies.at.frame, energies.reflected_j, energies.uncertainty_j),
            (59, 0.234_375, rounding)
        );
    }

    #[test]
    fn the_error_of_the_step_is_part_of_every_uncertainty() {
        let mut watch = ReflectionWatch::new(&manifest(|_| {}), Side::Left);
        for (collisions, parts, max_abs_drift) in [
            (9, [1.0, 0.0, 0.9375], (2.0_f64).powi(-20)),
            (12, [0.25, 0.0, 0.0], (2.0_f64).powi(-19)),
            (13, [0.25, 0.0, 0.0], (2.0_f64).powi(-18)),
        ] {
            watch.push(&Parts { max_abs_drift, ..frame(&watch, collisions, parts) });
        }
        let found = watch.found();
        let (energies, recoil) = (found.energies.expect("arrived"), found.recoil.expect("seen at 9 T"));
        assert_eq!(energies.step_error_j, step_error_j((2.0_f64).powi(-18), 1.0, 200));
        assert_eq!(energies.uncertainty_j, energies.step_error_j);
        assert_eq!(recoil.uncertainty_j, step_error_j((2.0_f64).powi(-20), 1.0, 200));
        let corrected = found.corrected().expect("both are known");
        assert_eq!(corrected.uncertainty_j, energies.uncertainty_j + recoil.uncertainty_j);
        // what the one side lacks the other has: dr/t·(1 + r/t), with r = 1/4 and t = 3/4
        let expected = energies.uncertainty_j / 0.75 * (1.0 + 1.0 / 3.0);
        assert!((energies.over_transmitted().plus_minus / expected - 1.0).abs() < 1e-15);
    }

    #[test]
    fn nothing_counts_after_a_front_has_met_an_end() {
        let mut watch = watched(&[(9, [1.0, 0.0, 0.9]), (12, [0.5, 0.5, 0.0]), (13, [0.5, 0.0, 0.0])]);
        let mut late = frame(&watch, 14, [0.4, 0.0, 0.0]);
        late.end_velocities_m_s = [-0.35, 0.006];
        watch.push(&late);
        let found = watch.found();
        assert_eq!(found.met_end.map(|(bead, at)| (bead, at.frame)), Some((199, 14)));
        assert_eq!(found.stationary_since.map(|since| since.frame), Some(13));
        assert_eq!(found.energies.map(|energies| energies.reflected_j), Some(0.5));
    }

    /// Before a frame that counts 2⁻²⁰ J of 1 J are exchanged, before one that does not 2⁻¹⁰ J, with what is inbound in the last
    /// frame before.
    #[test]
    fn what_comes_from_outside_is_no_reflection() {
        let exchanging = |inbound_j: f64| {
            let mut watch = watched(&[(9, [1.0, 0.0, 0.9]), (12, [0.5, 0.25, 0.25])]);
            for (collisions, incident_j, exchanged_j) in
                [(13, 0.25, (2.0_f64).powi(-20)), (14, 0.125, (2.0_f64).powi(-10)), (15, 0.0, 0.0)]
            {
                let parts = frame(&watch, collisions, [incident_j, 0.0, inbound_j]);
                watch.push(&Parts { exchanged_j, ..parts });
            }
            watch
        };
        let found = exchanging(0.0).told().expect("complete");
        let energies = found.energies.expect("arrived");
        assert_eq!((energies.at.frame, energies.reflected_j), (13, 0.25));
        // beside the rounding of 200 beads
        assert_eq!(energies.uncertainty_j, 200.0 * f64::EPSILON + (2.0_f64).powi(-20));
        assert_eq!((found.until().map(|at| at.frame), found.met_end), (Some(14), None));
        assert!(exchanging(0.008).told().is_ok_and(|found| found.stationary_since.is_none()));
        assert_eq!(exchanging(0.016).told(), Err(Undefined::Exchanged));
        // before the pulse has arrived
        let mut watch = watched(&[(9, [1.0, 0.0, 0.9])]);
        watch.push(&Parts { exchanged_j: 0.5, ..frame(&watch, 12, [0.5, 0.0, 0.0]) });
        assert_eq!(watch.told(), Err(Undefined::Exchanged));
    }

    /// The first frame, in which nothing is left behind yet, tells nothing, nor does one of long ago.
    #[test]
    fn what_was_not_seen_is_unknown() {
        let arrived = (20, [0.5, 0.5, 0.5]);
        let late = watched(&[arrived, (21, [0.25, 0.0, 0.0]), (22, [1.0, 0.0, 1.0]), (23, [0.25, 0.0, 0.0])]);
        assert_eq!(late.told(), Err(Undefined::ArrivedBefore));
        assert!(watched(&[(0, [0.5, 0.5, 0.5])]).told().is_ok_and(|found| found.recoil.is_none()));
        assert!(watched(&[(0, [1.0, 0.0, 1.0]), (4, [0.5, 0.5, 0.5])]).found().recoil.is_none());
        assert!(watched(&[(9, [1.0, 0.0, 0.9]), arrived]).found().recoil.is_none());
        assert!(watched(&[(11, [1.0, 0.0, 0.9]), arrived]).found().recoil.is_some());
    }

    #[test]
    fn a_side_is_incident_only_if_the_striker_comes_from_it() {
        let of = |split: u64, bead: u64, velocity_m_s: f64| {
            let m = manifest(|config| {
                config.striker.bead = bead;
                config.striker.velocity_m_s = velocity_m_s;
            });
            incident_side(&m, split)
        };
        assert_eq!(of(100, 0, 5.0), Ok(Side::Left));
        assert_eq!(of(100, 199, -5.0), Ok(Side::Right));
        assert_eq!(of(100, 0, -5.0), Err(Undefined::StrikerMovesAway));
        assert_eq!(of(100, 150, 5.0), Err(Undefined::StrikerMovesAway));
        assert_eq!(of(100, 100, 5.0), Err(Undefined::SplitIsStriker));
        assert_eq!(of(199, 0, 5.0), Err(Undefined::SplitIsEnd));
    }

    #[test]
    fn nothing_but_one_striker_has_energy_at_first() {
        let of = |change: fn(&mut RunConfig)| incident_side(&manifest(change), 100);
        assert_eq!(of(|config| config.striker.bead = 50), Ok(Side::Left));
        let other = StrikerConfig { bead: 199, velocity_m_s: -5.0 };
        let two = manifest(|config| config.striker.more = vec![other]);
        assert_eq!(incident_side(&two, 100), Err(Undefined::OthersMove));
        assert_eq!(of(|config| config.initial.velocities_m_s = vec![-3.0; 200]), Err(Undefined::OthersMove));
        let faster =
            |config: &mut RunConfig| config.initial.velocities_m_s = [vec![1.0], vec![0.0; 199]].concat();
        assert_eq!(of(faster), Ok(Side::Left));
        let unstruck = |config: &mut RunConfig| {
            (config.striker.bead, config.striker.velocity_m_s) = (100, 0.0);
            config.initial.velocities_m_s = vec![1.0; 200];
        };
        assert_eq!(of(unstruck), Err(Undefined::StrikerRests));
        let pressed = |config: &mut RunConfig| {
            config.initial.displacements_m = (0..200).map(|bead| -1e-5 * f64::from(bead)).collect();
        };
        assert_eq!(of(pressed), Err(Undefined::OthersMove));
    }
}
