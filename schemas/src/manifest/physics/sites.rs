//! Springs, drag and resonators of each bead: their checks, and their values.

use super::check::{is_0_or_more, is_positive};
use super::{Physics, usize_of};
use crate::config::{ConfigError, End, Profile};
use crate::sites::Sites;

impl Physics {
    pub(super) fn check_sites(&self) -> Result<(), ConfigError> {
        let springs = [
            ("on_site.linear_n_per_m", &self.on_site.linear_n_per_m),
            ("on_site.cubic_n_per_m3", &self.on_site.cubic_n_per_m3),
            ("on_site.drag_n_s_per_m", &self.on_site.drag_n_s_per_m),
        ];
        for (key, profile) in springs {
            if let Some(profile) = profile {
                profile.check(key, self.beads, is_0_or_more, "0, or 1e-100 to 1e100")?;
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
                "masses of 0 kg, or 1e-100 to 1e100 kg",
            )?;
            let key = "resonators.stiffness_n_per_m";
            resonators.stiffness_n_per_m.check(
                key,
                self.beads,
                is_positive,
                "stiffnesses of 1e-100 to 1e100",
            )?;
        }
        Ok(())
    }

    /// The springs, drag and resonators of each bead.
    pub(super) fn sites(&self) -> Sites {
        let beads = usize_of(self.beads);
        let values = |profile: &Option<Profile>| profile.as_ref().map(|profile| profile.values(beads));
        let cubic = values(&self.on_site.cubic_n_per_m3);
        let linear = values(&self.on_site.linear_n_per_m);
        // the linear ones are there where any are
        let linear = linear.or_else(|| cubic.as_ref().map(|_| vec![0.0; beads]));
        let (resonator_kg, resonator_n_per_m) = match &self.resonators {
            None => (Vec::new(), Vec::new()),
            Some(resonators) => {
                let mass_kg = resonators.mass_kg.values(beads);
                let mut stiffness = resonators.stiffness_n_per_m.values(beads);
                for (stiffness, mass_kg) in stiffness.iter_mut().zip(&mass_kg) {
                    *stiffness = if *mass_kg > 0.0 { *stiffness } else { 0.0 };
                }
                (mass_kg, stiffness)
            }
        };
        Sites {
            linear_n_per_m: linear.unwrap_or_default(),
            cubic_n_per_m3: cubic.unwrap_or_default(),
            drag_n_s_per_m: if self.has_drag() { self.drags() } else { Vec::new() },
            resonator_kg,
            resonator_n_per_m,
        }
    }
}
