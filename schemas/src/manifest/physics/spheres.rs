//! Spheres of given materials: their checks, and the stiffnesses that they give.

use super::check::check_positive;
use super::{Physics, usize_of};
use crate::config::{ConfigError, End, Impurity, OddSphere, Sphere, Spheres, WallMaterial};
use std::collections::BTreeSet;

impl Physics {
    pub(super) fn check_spheres(&self) -> Result<(), ConfigError> {
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

    /// Refuses a `bead_mass_kg` or a `stiffness` that differs from that of the spheres. Neither moves a bead: a recording with such a
    /// number can be read, but its manifest is wrong about the scales.
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

    /// The impurities, and the odd spheres with their masses, before any disorder.
    pub fn odd_beads(&self) -> impl Iterator<Item = Impurity> {
        let odd = |odd: &OddSphere| Impurity { bead: odd.bead, mass_kg: odd.sphere.mass_kg() };
        self.impurities.iter().copied().chain(self.odd_spheres.iter().map(odd))
    }

    /// The sphere of each bead, before any disorder; none in a chain of masses.
    pub(super) fn all_spheres(&self) -> Option<Vec<Sphere>> {
        let pattern = &self.spheres.as_ref()?.0;
        let mut all: Vec<Sphere> = pattern.iter().copied().cycle().take(usize_of(self.beads)).collect();
        for odd in &self.odd_spheres {
            all[usize_of(odd.bead)] = odd.sphere;
        }
        Some(all)
    }

    /// Stiffnesses (N·m^−3/2) of the contacts of `spheres` with walls.
    pub(super) fn sphere_walls(&self, spheres: &[Sphere]) -> [f64; 2] {
        let (first, last) = (&spheres[0], &spheres[spheres.len() - 1]);
        let at = |sphere: &Sphere, material: Option<WallMaterial>| match (material, self.ends.left) {
            // the contact that closes a ring joins the last sphere to the first
            (_, End::Periodic) => last.stiffness_with(first),
            (Some(wall), _) => sphere.stiffness_at(&wall.0),
            (None, _) => sphere.stiffness_at(&sphere.material),
        };
        [at(first, self.ends.left_material), at(last, self.ends.right_material)]
    }
}
