//! Materials of beads: the mass of a sphere, and the stiffness of contacts by Hertz's law.

use crate::config_error::ConfigError;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// An isotropic elastic material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Density ρ (kg/m³).
    pub density_kg_m3: f64,
    /// Young's modulus E (Pa).
    pub young_pa: f64,
    /// Poisson's ratio ν.
    pub poisson: f64,
}

/// A material with a name, and the source of its numbers.
#[derive(Debug, Clone, Copy)]
pub struct Named {
    /// The name in a configuration.
    pub name: &'static str,
    /// Its numbers.
    pub material: Material,
    /// The exact material, and the source of its numbers.
    pub source: &'static str,
}

const fn named(
    name: &'static str,
    density_kg_m3: f64,
    gpa: f64,
    poisson: f64,
    source: &'static str,
) -> Named {
    Named { name, material: Material { density_kg_m3, young_pa: gpa * 1e9, poisson }, source }
}

/// The materials that have a name. Real ones differ by some per cent from lot to lot, polymers by more with the speed of loading: give
/// numbers of your own where they matter.
///
/// Dowling: N. E. Dowling, Mechanical Behavior of Materials, 4th edition (2013). Callister: W. D. Callister and D. G. Rethwisch,
/// Materials Science and Engineering. `docs/CONFIGURATION.md` says where each number was looked up.
pub const MATERIALS: [Named; 9] = [
    named(
        "steel",
        8000.0,
        193.0,
        0.3,
        "stainless steel AISI 316: Callister, tables B.1 and B.2; ν: of AISI 302, which differs little",
    ),
    named(
        "chrome-steel",
        7780.0,
        203.0,
        0.3,
        "bearing steel AISI 52100, as S. Job, F. Melo, A. Sokolow and S. Sen (2008) are quoted, within the ranges of data sheets",
    ),
    named("brass", 8530.0, 101.0, 0.35, "70Cu–30Zn: Dowling, table 5.2; density: Callister, appendix B"),
    named(
        "bronze",
        8800.0,
        110.0,
        0.34,
        "tin bronze, within the ranges of J. M. Gere and S. P. Timoshenko, Mechanics of Materials, appendix H",
    ),
    named("aluminium", 2700.0, 70.3, 0.345, "pure: Dowling, table 5.2; density: Callister, appendix B"),
    named("glass", 2500.0, 69.0, 0.2, "soda-lime: Dowling, table 5.2; density: Callister, appendix B"),
    named(
        "pom",
        1410.0,
        3.0,
        0.35,
        "polyoxymethylene (Delrin): J. M. Margolis, Engineering Plastics Handbook (2006), table 5.5; ν: DuPont, Delrin design guide",
    ),
    named("nylon", 1140.0, 2.7, 0.41, "nylon 66, dry: Dowling, table 5.2; density: Callister, appendix B"),
    named("polycarbonate", 1200.0, 2.4, 0.38, "Dowling, table 5.2; density: Callister, appendix B"),
];

impl Material {
    /// The material of this name, if it has one; see [`MATERIALS`].
    pub fn named(name: &str) -> Option<Self> {
        MATERIALS.iter().find(|known| known.name == name).map(|known| known.material)
    }

    /// Refuses numbers that no elastic body has; `key` is the place of the material in the configuration.
    ///
    /// # Errors
    /// When a number is not positive, or Poisson's ratio not from −1 to ½.
    pub fn check(&self, key: &str) -> Result<(), ConfigError> {
        for (name, found) in [("density_kg_m3", self.density_kg_m3), ("young_pa", self.young_pa)] {
            if !(1e-100..=1e100).contains(&found) {
                return Err(ConfigError::number(&format!("{key}.{name}"), found, "a positive number"));
            }
        }
        if self.poisson > -1.0 && self.poisson <= 0.5 {
            return Ok(());
        }
        Err(ConfigError::number(&format!("{key}.poisson"), self.poisson, "above −1 and at most 0.5"))
    }

    /// `m = 4/3·π·ρ·r³` (kg) of a sphere of the radius `radius_m`.
    ///
    /// ```
    /// use schemas::material::Material;
    /// let steel = Material::named("steel").unwrap();
    /// assert!((steel.sphere_mass_kg(4.76e-3) - 3.614e-3).abs() < 1e-6);
    /// ```
    pub fn sphere_mass_kg(&self, radius_m: f64) -> f64 {
        4.0 / 3.0 * PI * self.density_kg_m3 * (radius_m * radius_m * radius_m)
    }

    /// `(1 − ν²)/E` (1/Pa), the compliance of one side of a contact.
    fn compliance(&self) -> f64 {
        (1.0 - self.poisson * self.poisson) / self.young_pa
    }
}

/// The k of `F = k·δ^(3/2)` between two spheres, each a material and a radius (m): `k = 4/3·E*·√(r1·r2/(r1 + r2))` (N·m^−3/2) with
/// `1/E* = (1 − ν1²)/E1 + (1 − ν2²)/E2`.
///
/// # Source
/// H. Hertz, J. reine angew. Math. 92 (1882) 156, doi:10.1515/crll.1882.92.156; K. L. Johnson, Contact Mechanics (1985), equation 4.23,
/// doi:10.1017/CBO9781139171731
///
/// ```
/// use schemas::material::{Material, hertz_spheres};
/// let steel = Material::named("steel").unwrap();
/// // equal spheres: E·√(2·r)/(3·(1 − ν²))
/// let k = hertz_spheres(&steel, 4.76e-3, &steel, 4.76e-3);
/// assert!((k / (193e9 * (2.0_f64 * 4.76e-3).sqrt() / (3.0 * 0.91)) - 1.0).abs() < 1e-15);
/// ```
pub fn hertz_spheres(one: &Material, radius_m: f64, other: &Material, other_radius_m: f64) -> f64 {
    hertz(one, other, radius_m * other_radius_m / (radius_m + other_radius_m))
}

/// The same of a sphere against a plane wall: `k = 4/3·E*·√r`.
pub fn hertz_wall(sphere: &Material, radius_m: f64, wall: &Material) -> f64 {
    hertz(sphere, wall, radius_m)
}

fn hertz(one: &Material, other: &Material, radius_m: f64) -> f64 {
    4.0 / 3.0 / (one.compliance() + other.compliance()) * radius_m.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str) -> Material {
        Material::named(name).expect("a material of the table")
    }

    #[test]
    fn every_material_is_possible_and_has_its_own_name() {
        for (index, known) in MATERIALS.iter().enumerate() {
            assert_eq!(known.material.check(known.name), Ok(()));
            assert!(MATERIALS[..index].iter().all(|other| other.name != known.name), "{}", known.name);
        }
        assert_eq!(Material::named("cheese"), None);
        for (material, key) in [
            (Material { density_kg_m3: 0.0, ..of("steel") }, "steel.density_kg_m3"),
            (Material { young_pa: f64::NAN, ..of("steel") }, "steel.young_pa"),
            (Material { poisson: 0.6, ..of("steel") }, "steel.poisson"),
        ] {
            assert_eq!(material.check("steel").expect_err("impossible").key, key);
        }
    }

    /// A wall is a sphere without end, and a rigid partner leaves one compliance.
    #[test]
    fn walls_are_spheres_without_end() {
        let (steel, pom) = (of("steel"), of("pom"));
        let wall = hertz_wall(&steel, 5e-3, &pom);
        assert!((hertz_spheres(&steel, 5e-3, &pom, 5e9) / wall - 1.0).abs() < 1e-11);
        assert_eq!(hertz_spheres(&steel, 5e-3, &pom, 3e-3), hertz_spheres(&pom, 3e-3, &steel, 5e-3));
        let rigid = Material { young_pa: 1e30, ..steel };
        let alone = 4.0 / 3.0 * 3.0e9 / (1.0 - 0.35 * 0.35) * 5e-3_f64.sqrt();
        assert!((hertz_wall(&pom, 5e-3, &rigid) / alone - 1.0).abs() < 1e-14);
    }
}
