//! What may go beyond one struck bead and one power law.

use super::Physics;
use super::beyond::{MOST_EXPONENTS, different};
use super::check::check_positive;
use crate::config::{Bonds, ConfigError, End, Gaussian, PlaneWave, Spheres};
use crate::damping::Damping;
use crate::drive::{Place, Quantity, Side};
use std::collections::{BTreeSet, HashMap};

/// Steps in the shortest period of a drive, at least.
const STEPS_OF_PERIOD: f64 = 20.0;

fn is_positive(value: f64) -> bool {
    (1e-100..=1e100).contains(&value)
}

fn is_0_or_more(value: f64) -> bool {
    value == 0.0 || is_positive(value)
}

impl Physics {
    pub(super) fn check_beyond(&self) -> Result<(), ConfigError> {
        self.check_spheres()?;
        self.check_disorder()?;
        self.check_laws()?;
        self.check_ends()?;
        self.check_sites()?;
        self.check_initial()?;
        self.check_drives()
    }

    fn check_spheres(&self) -> Result<(), ConfigError> {
        let Some(spheres) = &self.spheres else {
            if let Some(odd) = self.odd_spheres.first() {
                let allowed = "with `spheres`, from which these differ";
                return Err(ConfigError::value("chain.odd_spheres", format!("bead {}", odd.bead), allowed));
            }
            let walls = [("left", self.ends.left_material), ("right", self.ends.right_material)];
            return match walls.iter().find(|(_, material)| material.is_some()) {
                Some((side, _)) => {
                    let allowed = "with `spheres` in [chain]; else right_stiffness or left_stiffness";
                    Err(ConfigError::value(&format!("ends.{side}_material"), "a material", allowed))
                }
                None => Ok(()),
            };
        };
        let found = spheres.0.len() as u64;
        if found == 0 || found > self.beads {
            let allowed = "one sphere, or a list of 1 to one for each bead";
            return Err(ConfigError::value("chain.spheres", format!("{found} spheres"), allowed));
        }
        let mut seen = BTreeSet::new();
        for (i, odd) in self.odd_spheres.iter().enumerate() {
            let key = format!("chain.odd_spheres[{i}].bead");
            self.check_bead(&key, odd.bead)?;
            if !seen.insert(odd.bead) {
                return Err(ConfigError::value(&key, odd.bead, "each bead once"));
            }
        }
        let all = spheres.0.iter().chain(self.odd_spheres.iter().map(|odd| &odd.sphere));
        for sphere in all {
            let key = "chain.spheres";
            check_positive(key, sphere.radius_m, "m, as the radius of a sphere")?;
            sphere.material.check(key)?;
        }
        for (key, wall) in [
            ("ends.left_material", &self.ends.left_material),
            ("ends.right_material", &self.ends.right_material),
        ] {
            wall.as_ref().map_or(Ok(()), |wall| wall.0.check(key))?;
        }
        let is_else =
            !self.masses.is_uniform() || !self.stiffnesses.is_uniform() || !self.impurities.is_empty();
        if is_else || self.alpha != 1.5 {
            let allowed = "no masses, impurities, stiffnesses beside them, and alpha = 1.5: the materials say it all; \
                           `odd_spheres` for single beads";
            return Err(ConfigError::value("chain.spheres", "spheres", allowed));
        }
        Ok(())
    }

    /// Refuses a mass or a stiffness that spheres do not have. It moves no bead: a recording that has one can be read, but is not what its
    /// manifest says.
    ///
    /// # Errors
    /// With the number, and that of the spheres.
    pub fn check_scales_of_spheres(&self) -> Result<(), ConfigError> {
        let Some([mass_kg, _, stiffness]) = self.spheres.as_ref().and_then(Spheres::scales) else {
            return Ok(());
        };
        let rows = [
            ("chain.bead_mass_kg", self.bead_mass_kg, mass_kg, "kg"),
            ("chain.stiffness", self.stiffness, stiffness, "N·m^−3/2"),
        ];
        match rows.iter().find(|(_, found, usual, _)| found != usual) {
            Some((key, found, usual, unit)) => {
                let allowed = format!(
                    "none beside `spheres`, whose material and radius say it ({usual:e} {unit}): leave one of them out"
                );
                Err(ConfigError::number(key, *found, &allowed))
            }
            None => Ok(()),
        }
    }

    fn check_laws(&self) -> Result<(), ConfigError> {
        let contacts = self.contacts_by_rule();
        if let Some(alphas) = &self.alphas {
            let key = "chain.alphas";
            let allowed = "exponents from 1 to 1000";
            alphas.check(key, contacts, |alpha| (1.0..=1000.0).contains(&alpha), allowed)?;
            if different(alphas.written()).len() > MOST_EXPONENTS {
                let allowed = format!("at most {MOST_EXPONENTS} different ones: each has a table of its own");
                return Err(ConfigError::value(key, "more different exponents", &allowed));
            }
        }
        if let Some(second) = &self.second {
            if !(1.0..=1000.0).contains(&second.alpha) {
                let allowed = "an exponent from 1 to 1000";
                return Err(ConfigError::number("chain.second.alpha", second.alpha, allowed));
            }
            second.stiffness.check(
                "chain.second.stiffness",
                contacts,
                is_0_or_more,
                "stiffnesses of 0 or more",
            )?;
        }
        if let Some(gaps_m) = &self.gaps_m {
            let allowed = "gaps of 0 m or more; [load] presses contacts together";
            gaps_m.check("chain.gaps_m", contacts, is_0_or_more, allowed)?;
            if !self.load.is_none() {
                let allowed = "no gaps in a chain that [load] presses together: it closes them";
                return Err(ConfigError::value("chain.gaps_m", "gaps with a load", allowed));
            }
        }
        if let Some(bonds) = &self.bonds {
            self.check_bonds(bonds)?;
        }
        match self.damping {
            Some(Damping::ViscousNSPerM(_)) | None => Ok(()),
            Some(_) if !self.is_beyond_one_power() => Ok(()),
            Some(damping) => {
                let found = match damping {
                    Damping::ViscousNSPerM(_) => "viscous_n_s_per_m",
                    Damping::Restitution(_) => "restitution",
                    Damping::KuwabaraKonoS(_) => "kuwabara_kono_s",
                    Damping::Power(_) => "power",
                };
                let allowed = "viscous_n_s_per_m where contacts are not one power of one exponent";
                Err(ConfigError::value("damping", found, allowed))
            }
        }
    }

    fn check_bonds(&self, bonds: &Bonds) -> Result<(), ConfigError> {
        let contacts = self.contacts_by_rule();
        let any = |value: f64| value == 0.0 || is_positive(value.abs());
        if let Some(linear) = &bonds.linear {
            linear.check("chain.bonds.linear", contacts, is_0_or_more, "stiffnesses of 0 or more")?;
        }
        if let Some(quadratic) = &bonds.quadratic {
            quadratic.check("chain.bonds.quadratic", contacts, any, "numbers up to 1e100")?;
        }
        if let Some(cubic) = &bonds.cubic {
            let allowed = "0 or more: else the bond would break away";
            cubic.check("chain.bonds.cubic", contacts, is_0_or_more, allowed)?;
        }
        if let Some(toda) = &bonds.toda {
            let key = "chain.bonds.toda.stiffness";
            toda.stiffness.check(key, contacts, is_0_or_more, "stiffnesses of 0 or more")?;
            check_positive("chain.bonds.toda.steepness_per_m", toda.steepness_per_m, "1/m")?;
        }
        if !bonds.hold() {
            return Err(Bonds::refusal());
        }
        let is_else = self.alphas.is_some()
            || self.second.is_some()
            || self.gaps_m.is_some()
            || self.spheres.is_some()
            || !self.stiffnesses.is_uniform()
            || !self.contacts.is_empty()
            || self.load.gravity_m_s2 != 0.0;
        if is_else {
            let allowed = "bonds alone: no alphas, second, gaps_m, spheres, stiffnesses, contacts or gravity beside them";
            return Err(ConfigError::value("chain.bonds", "bonds and contacts", allowed));
        }
        Ok(())
    }

    fn check_ends(&self) -> Result<(), ConfigError> {
        let ends = &self.ends;
        let sides = [("left", ends.left, ends.right), ("right", ends.right, ends.left)];
        if let (End::Periodic, Some(stiffness), 3..) = (ends.right, ends.right_stiffness, self.kernel_version)
        {
            let allowed = "nothing in a ring, whose ends are one contact: chain.contacts, with the number of the last bead";
            return Err(ConfigError::number("ends.right_stiffness", stiffness, allowed));
        }
        if let Some((side, ..)) =
            sides.iter().find(|(_, this, other)| *this == End::Periodic && this != other)
        {
            let allowed = "left = \"periodic\" and right = \"periodic\": the last bead touches the first one";
            return Err(ConfigError::value(&format!("ends.{side}"), "periodic at one end", allowed));
        }
        if ends.left == End::Periodic && self.beads < 3 {
            return Err(ConfigError::value("chain.beads", self.beads, "3 beads or more in a ring"));
        }
        let is_absorbing = [ends.left, ends.right].contains(&End::Absorbing);
        let beads = ends.absorbing_beads.map(|beads| beads as f64);
        for (key, number) in [
            ("ends.absorbing_beads", beads),
            ("ends.absorbing_drag_n_s_per_m", ends.absorbing_drag_n_s_per_m),
        ] {
            if let (Some(number), false) = (number, is_absorbing) {
                return Err(ConfigError::number(key, number, "left or right = \"absorbing\" with it"));
            }
        }
        if let Some(beads) = ends.absorbing_beads
            && !(1..=self.beads).contains(&beads)
        {
            let allowed = format!("1 to {} beads of this chain", self.beads);
            return Err(ConfigError::value("ends.absorbing_beads", beads, &allowed));
        }
        if let Some(drag) = ends.absorbing_drag_n_s_per_m {
            check_positive("ends.absorbing_drag_n_s_per_m", drag, "N·s/m")?;
        }
        Ok(())
    }

    fn check_sites(&self) -> Result<(), ConfigError> {
        let springs = [
            ("on_site.linear_n_per_m", &self.on_site.linear_n_per_m),
            ("on_site.cubic_n_per_m3", &self.on_site.cubic_n_per_m3),
            ("on_site.drag_n_s_per_m", &self.on_site.drag_n_s_per_m),
        ];
        for (key, profile) in springs {
            if let Some(profile) = profile {
                profile.check(key, self.beads, is_0_or_more, "0 or more")?;
            }
        }
        let holds = self.on_site.linear_n_per_m.is_some() || self.on_site.cubic_n_per_m3.is_some();
        if holds && self.ends.left == End::Periodic && self.load.precompression_n != 0.0 {
            let allowed = "no load: the springs hold the beads of a ring at their places, and it could not drift to carry one";
            return Err(ConfigError::value("on_site", "springs in a loaded ring", allowed));
        }
        if holds && self.load.gravity_m_s2 != 0.0 {
            let allowed = "no gravity beside springs that hold the beads: displacements count from where the springs pull";
            return Err(ConfigError::value("on_site", "springs with gravity", allowed));
        }
        if let Some(resonators) = &self.resonators {
            resonators.mass_kg.check(
                "resonators.mass_kg",
                self.beads,
                is_0_or_more,
                "masses of 0 kg or more",
            )?;
            let key = "resonators.stiffness_n_per_m";
            resonators.stiffness_n_per_m.check(key, self.beads, is_positive, "stiffnesses above 0")?;
        }
        Ok(())
    }

    fn check_initial(&self) -> Result<(), ConfigError> {
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
        let lists =
            [("displacements_m", &initial.displacements_m), ("velocities_m_s", &initial.velocities_m_s)];
        for (name, list) in lists {
            let key = format!("initial.{name}");
            if !list.is_empty() && list.len() as u64 != self.beads {
                let allowed = format!("{} values, one for each bead", self.beads);
                return Err(ConfigError::value(&key, format!("{} values", list.len()), &allowed));
            }
            if let Some(wrong) = list.iter().find(|value| value.is_nan() || value.abs() > 1e100) {
                return Err(ConfigError::number(&key, *wrong, "numbers up to 1e100"));
            }
        }
        let shapes = initial.gaussian.iter().flat_map(|bell| {
            let Gaussian { bead, displacement_m, velocity_m_s, width_beads: _ } = *bell;
            [
                ("gaussian.bead", bead),
                ("gaussian.displacement_m", displacement_m),
                ("gaussian.velocity_m_s", velocity_m_s),
            ]
        });
        let shapes = shapes.chain(initial.plane_wave.iter().flat_map(|wave| {
            let PlaneWave { cycles, displacement_m, velocity_m_s, phase_rad } = *wave;
            [
                ("plane_wave.cycles", cycles),
                ("plane_wave.displacement_m", displacement_m),
                ("plane_wave.velocity_m_s", velocity_m_s),
                ("plane_wave.phase_rad", phase_rad),
            ]
        }));
        let shapes = shapes.chain(initial.mode.iter().flat_map(|mode| {
            [("mode.displacement_m", mode.displacement_m), ("mode.velocity_m_s", mode.velocity_m_s)]
        }));
        for (name, found) in shapes {
            if found.is_nan() || found.abs() > 1e100 {
                return Err(ConfigError::number(
                    &format!("initial.{name}"),
                    found,
                    "a number of at most 1e100 in size",
                ));
            }
        }
        if let Some(bell) = initial.gaussian {
            check_positive("initial.gaussian.width_beads", bell.width_beads, "beads")?;
        }
        if let Some(mode) = initial.mode
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

    fn check_drives(&self) -> Result<(), ConfigError> {
        if self.drives.len() as u64 > self.beads / 2 {
            let allowed = format!("at most {} drives: one for each two beads", self.beads / 2);
            return Err(ConfigError::value("drive", format!("{} drives", self.drives.len()), &allowed));
        }
        let strikers = std::iter::once(&self.striker).chain(&self.strikers);
        let struck: BTreeSet<u64> =
            strikers.filter(|striker| striker.velocity_m_s != 0.0).map(|striker| striker.bead).collect();
        let mut places = HashMap::new();
        for (i, drive) in self.drives.iter().enumerate() {
            let key = format!("drive[{i}]");
            // its numbers decide the step, on which the rest of what is checked depends
            drive.check(&key, 0.0)?;
            match drive.at {
                Place::Bead(bead) => self.check_bead(&format!("{key}.bead"), bead)?,
                Place::Wall(side) => {
                    let end = if side == Side::Left { self.ends.left } else { self.ends.right };
                    if end != End::Fixed {
                        let allowed =
                            format!("a wall that is there: {side} = \"fixed\" in [ends]; or bead = …");
                        return Err(ConfigError::value(&format!("{key}.wall"), side, &allowed));
                    }
                    if drive.prescribes == Quantity::Force {
                        let allowed = "displacement_m or velocity_m_s of a wall; force_n of a bead";
                        return Err(ConfigError::value(
                            &format!("{key}.force_n"),
                            "a force on a wall",
                            allowed,
                        ));
                    }
                }
            }
            if let Some(other) = places.insert(drive.at, i) {
                let allowed = format!("one drive at a place; drive[{other}] is at {} already", drive.at);
                return Err(ConfigError::value(&key, format!("another drive at {}", drive.at), &allowed));
            }
            let is_struck = matches!(drive.at, Place::Bead(bead) if struck.contains(&bead));
            if drive.prescribes != Quantity::Force && is_struck {
                let allowed = "a bead that is not struck: its motion is prescribed";
                return Err(ConfigError::value(&format!("{key}.bead"), drive.at, allowed));
            }
        }
        Ok(())
    }

    /// What can be said of the drives only when the steps are known.
    pub(super) fn check_drive_times(&self) -> Result<(), ConfigError> {
        for (i, drive) in self.drives.iter().enumerate() {
            let key = format!("drive[{i}]");
            drive.check(&key, self.time_s(self.step_count))?;
            let Some(hz) = drive.waveform.highest_hz() else { continue };
            let steps = 1.0 / (hz * self.dt_s);
            if steps < STEPS_OF_PERIOD {
                let key = format!("{key}.{}", drive.prescribes.key());
                let found = format!("{hz} Hz, a period of {steps:.3} steps");
                let longest_s = 1.0 / (STEPS_OF_PERIOD * hz);
                let allowed = format!(
                    "a period of at least {STEPS_OF_PERIOD} steps: time.dt_s of at most {longest_s:.3e} s, or a lower frequency"
                );
                return Err(ConfigError::value(&key, found, &allowed));
            }
        }
        Ok(())
    }
}
