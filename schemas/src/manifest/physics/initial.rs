//! The state at step 0: its checks, and its values.

use super::check::check_positive;
use super::{Physics, larger, usize_of};
use crate::bath::BOLTZMANN_J_K;
use crate::config::{ConfigError, End, Gaussian, ModeShape, PlaneWave, Thermal};
use crate::drive::{Drive, Place, Quantity};
use crate::functions::{Moment, exp, sine_cosine, two_product, two_sum};
use crate::random::normal;
use std::collections::BTreeSet;

/// The stream of random numbers of thermal velocities; those of disorder count from 0.
const THERMAL: u32 = u32::MAX;

impl Physics {
    pub(super) fn check_initial(&self) -> Result<(), ConfigError> {
        let mut struck = BTreeSet::new();
        for (i, striker) in std::iter::once(&self.striker).chain(&self.strikers).enumerate() {
            if !struck.insert(striker.bead) {
                let key = format!("striker[{i}].bead");
                return Err(ConfigError::value(&key, striker.bead, "each bead once"));
            }
        }
        let initial = &self.initial;
        if !initial.solitary.is_empty() {
            let allowed = "lists: a solitary wave is computed before a run is, by `run` and `sweep`";
            return Err(ConfigError::value("initial.solitary", "a wave", allowed));
        }
        for (key, is_there) in [
            ("initial.modes", initial.modes.is_some()),
            ("initial.energy_per_bead_j", initial.energy_per_bead_j.is_some()),
        ] {
            if is_there {
                let allowed = "lists: it is computed before a run is, by `run` and `sweep`";
                return Err(ConfigError::value(key, "a rule", allowed));
            }
        }
        self.check_lists()?;
        let (bell, wave, mode) = (initial.gaussian, initial.plane_wave, initial.mode);
        let shapes = [
            ("gaussian.bead", bell.map(|bell| bell.bead)),
            ("gaussian.displacement_m", bell.map(|bell| bell.displacement_m)),
            ("gaussian.velocity_m_s", bell.map(|bell| bell.velocity_m_s)),
            ("plane_wave.cycles", wave.map(|wave| wave.cycles)),
            ("plane_wave.displacement_m", wave.map(|wave| wave.displacement_m)),
            ("plane_wave.velocity_m_s", wave.map(|wave| wave.velocity_m_s)),
            ("plane_wave.phase_rad", wave.map(|wave| wave.phase_rad)),
            ("mode.displacement_m", mode.map(|mode| mode.displacement_m)),
            ("mode.velocity_m_s", mode.map(|mode| mode.velocity_m_s)),
        ];
        for (name, found) in shapes {
            if let Some(found) = found.filter(|found| found.is_nan() || found.abs() > 1e100) {
                let allowed = "a number of at most 1e100 in size";
                return Err(ConfigError::number(&format!("initial.{name}"), found, allowed));
            }
        }
        if let Some(bell) = bell {
            check_positive("initial.gaussian.width_beads", bell.width_beads, "beads")?;
        }
        if let Some(mode) = mode
            && !(1..=self.beads).contains(&mode.number)
        {
            let allowed = format!("modes 1 to {}", self.beads);
            return Err(ConfigError::value("initial.mode.number", mode.number, &allowed));
        }
        if let Some(thermal) = initial.thermal {
            let key = "initial.thermal";
            match (thermal.temperature_k, thermal.energy_j) {
                (Some(temperature), None) => {
                    check_positive("initial.thermal.temperature_k", temperature, "K")?;
                }
                (None, Some(energy)) => {
                    check_positive("initial.thermal.energy_j", energy, "J")?;
                }
                (temperature, _) => {
                    let found = if temperature.is_some() { "both" } else { "neither" };
                    return Err(ConfigError::value(key, found, "one of temperature_k and energy_j"));
                }
            }
        }
        if let Some(from) = &initial.from
            && initial.displacements_m.is_empty()
        {
            let allowed = "the lists of that state beside it: `run` and `sweep` read it";
            return Err(ConfigError::value("initial.from.recording", &from.recording, allowed));
        }
        Ok(())
    }

    /// Checks the lists of values for each bead.
    fn check_lists(&self) -> Result<(), ConfigError> {
        let initial = &self.initial;
        for (key, list) in [
            ("initial.displacements_m", &initial.displacements_m),
            ("initial.velocities_m_s", &initial.velocities_m_s),
            ("initial.resonator_displacements_m", &initial.resonator_displacements_m),
            ("initial.resonator_velocities_m_s", &initial.resonator_velocities_m_s),
        ] {
            if !list.is_empty() && key.contains("resonator") && self.resonators.is_none() {
                let allowed = "none without `resonators`, which it would move";
                return Err(ConfigError::value(key, format!("{} values", list.len()), allowed));
            }
            if !list.is_empty() && list.len() as u64 != self.beads {
                let allowed = format!("{} values, one for each bead", self.beads);
                return Err(ConfigError::value(key, format!("{} values", list.len()), &allowed));
            }
            if let Some(wrong) = list.iter().find(|value| value.is_nan() || value.abs() > 1e100) {
                return Err(ConfigError::number(key, *wrong, "numbers up to 1e100"));
            }
        }
        Ok(())
    }

    /// Displacements (m) and velocities (m/s) at step 0, N values each.
    pub fn initial_state(&self) -> (Vec<f64>, Vec<f64>) {
        let beads = usize_of(self.beads);
        let (mut u_m, mut v_m_s) = (vec![0.0; beads], vec![0.0; beads]);
        let initial = &self.initial;
        add(&mut u_m, initial.displacements_m.iter().copied());
        add(&mut v_m_s, initial.velocities_m_s.iter().copied());
        if let Some(bell) = &initial.gaussian {
            let shape = (0..beads).map(|i| bell_at(bell, i as f64));
            add(&mut u_m, shape.clone().map(|shape| bell.displacement_m * shape));
            add(&mut v_m_s, shape.map(|shape| bell.velocity_m_s * shape));
        }
        if let Some(wave) = &initial.plane_wave {
            let shape = (0..beads).map(|i| wave_at(wave, i as f64, beads as f64));
            add(&mut u_m, shape.clone().map(|(sine, _)| wave.displacement_m * sine));
            add(&mut v_m_s, shape.map(|(_, cosine)| wave.velocity_m_s * cosine));
        }
        if let Some(mode) = &initial.mode {
            let shape = (0..beads).map(|i| mode_at(mode, i as f64, beads as f64));
            add(&mut u_m, shape.clone().map(|shape| mode.displacement_m * shape));
            add(&mut v_m_s, shape.map(|shape| mode.velocity_m_s * shape));
        }
        if let Some(thermal) = initial.thermal {
            add(&mut v_m_s, self.thermal_m_s(thermal).into_iter());
        }
        for striker in std::iter::once(&self.striker).chain(&self.strikers) {
            v_m_s[usize_of(striker.bead)] += striker.velocity_m_s;
        }
        let start = Moment::new(0, self.dt_s, 0.0);
        for drive in &self.drives {
            if let (Place::Bead(bead), Quantity::Displacement | Quantity::Velocity) =
                (drive.at, drive.prescribes)
            {
                let bead = usize_of(bead);
                (u_m[bead], v_m_s[bead]) = starts_at(drive, start);
            }
        }
        // −0 is 0
        u_m.iter_mut().chain(&mut v_m_s).for_each(|x| *x += 0.0);
        (u_m, v_m_s)
    }

    /// The rows of `extra` at step 0 for the displacements `u_m`: resonators rest in their beads unless they have a state of their own,
    /// no work has been done. What a method carries is 0 here.
    pub fn initial_extra(&self, u_m: &[f64]) -> Vec<f64> {
        let rows = self.rows();
        let mut extra = vec![0.0; rows.count() * u_m.len()];
        let [w_m, w_m_s, _, drives] = rows.split_mut(&mut extra);
        if rows.resonators {
            w_m.copy_from_slice(u_m);
        }
        let initial = &self.initial;
        // −0 is 0
        w_m.iter_mut().zip(&initial.resonator_displacements_m).for_each(|(w, given)| *w = given + 0.0);
        w_m_s.iter_mut().zip(&initial.resonator_velocities_m_s).for_each(|(w, given)| *w = given + 0.0);
        let start = Moment::new(0, self.dt_s, 0.0);
        for (d, drive) in self.drives.iter().enumerate() {
            drives[2 * d + 1] = starts_at(drive, start).0 + 0.0;
        }
        extra
    }

    /// Normal velocities (m/s), without total momentum.
    fn thermal_m_s(&self, thermal: Thermal) -> Vec<f64> {
        let mean_j = thermal.energy_j.unwrap_or(0.5 * BOLTZMANN_J_K * thermal.temperature_k.unwrap_or(0.0));
        let mass_kg = self.chain_masses_kg();
        let of = |(i, mass_kg): (usize, &f64)| {
            normal(self.seed, THERMAL, i as u64) * (2.0 * mean_j / mass_kg).sqrt()
        };
        let mut v_m_s: Vec<f64> = mass_kg.iter().enumerate().map(of).collect();
        let sum = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |sum, x| sum + x);
        let momentum = sum(&mut v_m_s.iter().zip(&mass_kg).map(|(v, m)| v * m));
        let drift_m_s = momentum / sum(&mut mass_kg.iter().copied());
        for v in &mut v_m_s {
            *v -= drift_m_s;
        }
        v_m_s
    }

    /// The largest speed (m/s) that strikers, initial velocities, baths or drives give beads; an estimate for scales. 0 if only
    /// displacements are given.
    pub(super) fn typical_speed_m_s(&self) -> f64 {
        let mut most = 0.0;
        let mut with = |speed_m_s: f64| most = larger(most, speed_m_s.abs());
        std::iter::once(&self.striker).chain(&self.strikers).for_each(|striker| with(striker.velocity_m_s));
        let initial = &self.initial;
        initial.velocities_m_s.iter().for_each(|v| with(*v));
        self.of_resonators(&initial.resonator_velocities_m_s).for_each(|(_, v)| with(*v));
        initial.gaussian.iter().for_each(|bell| with(bell.velocity_m_s));
        initial.plane_wave.iter().for_each(|wave| with(wave.velocity_m_s));
        initial.mode.iter().for_each(|mode| with(mode.velocity_m_s));
        if let Some(thermal) = initial.thermal {
            let mean_j =
                thermal.energy_j.unwrap_or(0.5 * BOLTZMANN_J_K * thermal.temperature_k.unwrap_or(0.0));
            // three standard deviations
            with(3.0 * (2.0 * mean_j / self.bead_mass_kg).sqrt());
        }
        // the same of beads in a bath
        self.baths.iter().for_each(|bath| with(3.0 * (bath.hottest_j() / self.bead_mass_kg).sqrt()));
        for drive in &self.drives {
            if drive.prescribes == Quantity::Velocity {
                with(drive.waveform.largest());
            }
        }
        most
    }

    /// The values of a list that are of resonators, each with the place of its bead.
    pub(super) fn of_resonators<'a>(
        &self,
        list: &'a [f64],
    ) -> impl Iterator<Item = (usize, &'a f64)> + use<'a> {
        let mass_kg = self.resonators.as_ref().map(|resonators| resonators.mass_kg.values(list.len()));
        let with_masses = list.iter().enumerate().zip(mass_kg.unwrap_or_default());
        with_masses.filter(|(_, mass_kg)| *mass_kg > 0.0).map(|(value, _)| value)
    }

    /// The largest overlap (m) that initial displacements, drives by displacement, or drives by force give a contact; an estimate.
    pub(super) fn typical_overlap_m(&self) -> f64 {
        let (mut most, mut pushed_n) = (0.0, 0.0);
        let mut with = |overlap_m: f64| most = larger(most, overlap_m.abs());
        let initial = &self.initial;
        let u_m = &initial.displacements_m;
        u_m.windows(2).for_each(|pair| with(pair[0] - pair[1]));
        if let (Some(first), Some(last)) = (u_m.first(), u_m.last()) {
            match (self.ends.left, self.ends.right) {
                // springs pull every bead that is not at its place
                _ if !self.on_site.is_none() => u_m.iter().for_each(|u| with(*u)),
                (End::Periodic, _) => with(last - first),
                (left, right) => [(left, first), (right, last)]
                    .into_iter()
                    .filter(|(end, _)| *end == End::Fixed)
                    .for_each(|(_, u)| with(*u)),
            }
        }
        initial.gaussian.iter().for_each(|bell| with(bell.displacement_m));
        initial.plane_wave.iter().for_each(|wave| with(wave.displacement_m));
        initial.mode.iter().for_each(|mode| with(mode.displacement_m));
        for drive in &self.drives {
            match drive.prescribes {
                Quantity::Displacement => with(drive.waveform.largest()),
                Quantity::Force => pushed_n = larger(pushed_n, drive.waveform.largest()),
                Quantity::Velocity => {}
            }
        }
        if let Some(resonators) = &self.resonators {
            let stiffest = resonators.stiffness_n_per_m.largest();
            for (i, w) in self.of_resonators(&initial.resonator_displacements_m) {
                let stretch_m = w - u_m.get(i).copied().unwrap_or(0.0);
                pushed_n = larger(pushed_n, stiffest * stretch_m.abs());
            }
        }
        // a power takes microseconds, and there may be a force on every other bead
        with(self.overlap_under(pushed_n, self.stiffness));
        most
    }
}

/// Initial displacement (m) and velocity (m/s) of the wall or bead that a drive moves.
fn starts_at(drive: &Drive, start: Moment) -> (f64, f64) {
    match drive.prescribes {
        Quantity::Force => (0.0, 0.0),
        Quantity::Displacement => drive.waveform.value_and_slope(start),
        Quantity::Velocity => (0.0, drive.waveform.value(start)),
    }
}

fn add(values: &mut [f64], more: impl Iterator<Item = f64>) {
    for (value, more) in values.iter_mut().zip(more) {
        *value += more;
    }
}

fn bell_at(bell: &Gaussian, bead: f64) -> f64 {
    let x = (bead - bell.bead) / bell.width_beads;
    exp(-0.5 * (x * x))
}

/// Sine and cosine of the phase of a plane wave.
fn wave_at(wave: &PlaneWave, bead: f64, beads: f64) -> (f64, f64) {
    let (turns, rest) = two_product(wave.cycles / beads, bead);
    reduced(turns + wave.phase_rad / std::f64::consts::TAU, rest)
}

/// Sine and cosine of any number of turns.
fn reduced(turns: f64, rest: f64) -> (f64, f64) {
    sine_cosine(two_sum(turns - (turns + 0.5).floor(), rest))
}

fn mode_at(mode: &ModeShape, bead: f64, beads: f64) -> f64 {
    // half a turn for each half wave
    let number = mode.number as f64;
    reduced(0.5 * (number * (bead + 1.0) / (beads + 1.0)), 0.0).0
}
