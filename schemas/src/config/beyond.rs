//! What a configuration can say beyond one struck bead and one power law.

use super::several::several;
use super::{ConfigError, Profile, StrikerConfig};
use crate::material::Material;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::ops::{Deref, DerefMut};

/// The beads that move at the beginning: `[striker]`, or several `[[striker]]`. It is the first one, if that is all
/// that is asked.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Strikers {
    first: StrikerConfig,
    /// Those after the first.
    pub more: Vec<StrikerConfig>,
}

impl Strikers {
    /// Whether nothing strikes.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

impl From<StrikerConfig> for Strikers {
    fn from(first: StrikerConfig) -> Self {
        Self { first, more: Vec::new() }
    }
}

impl Deref for Strikers {
    type Target = StrikerConfig;

    fn deref(&self) -> &StrikerConfig {
        &self.first
    }
}

impl DerefMut for Strikers {
    fn deref_mut(&mut self) -> &mut StrikerConfig {
        &mut self.first
    }
}

impl Serialize for Strikers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.more.is_empty() {
            return self.first.serialize(serializer);
        }
        serializer.collect_seq(std::iter::once(&self.first).chain(&self.more))
    }
}

impl<'de> Deserialize<'de> for Strikers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut all = several::<_, StrikerConfig>(deserializer)?.into_iter();
        let first = all.next().unwrap_or_default();
        Ok(Self { first, more: all.collect() })
    }
}

/// A second power of the overlap that each contact adds to its force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondPower {
    /// Its exponent.
    pub alpha: f64,
    /// Its stiffness (N·m^−alpha).
    pub stiffness: Profile,
}

/// Two-sided bonds in place of contacts: `F = linear·δ + quadratic·δ² + cubic·δ³` and Toda's exponential, also where δ < 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Bonds {
    /// N/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear: Option<Profile>,
    /// N/m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quadratic: Option<Profile>,
    /// N/m³.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cubic: Option<Profile>,
    /// Toda's law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toda: Option<Toda>,
}

/// `F = stiffness·(exp(b·δ) − 1)/b`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Toda {
    /// N/m, at small δ.
    pub stiffness: Profile,
    /// b (1/m).
    pub steepness_per_m: f64,
}

/// Springs and drag that hold each bead at its place.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OnSite {
    /// κ of a force −κ·u (N/m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear_n_per_m: Option<Profile>,
    /// κ3 of a force −κ3·u³ (N/m³).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cubic_n_per_m3: Option<Profile>,
    /// γ of a force −γ·v (N·s/m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drag_n_s_per_m: Option<Profile>,
}

impl Bonds {
    /// Whether they have a bottom: a quadratic force alone has none.
    pub(crate) fn hold(&self) -> bool {
        self.linear.is_some() || self.cubic.is_some() || self.toda.is_some()
    }

    /// Why bonds that do not hold cannot be.
    pub(crate) fn refusal() -> ConfigError {
        let allowed = "linear, cubic or toda among them: a quadratic force alone has no bottom";
        ConfigError::value("chain.bonds", "no bonds that hold", allowed)
    }
}

impl OnSite {
    /// Whether nothing holds any bead.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// A mass on a linear spring inside each bead, or beside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resonators {
    /// Mass (kg) of each, 0 where there is none.
    pub mass_kg: Profile,
    /// Stiffness (N/m) of the spring between it and its bead.
    pub stiffness_n_per_m: Profile,
}

/// A sphere by what it is made of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WrittenSphere", into = "WrittenSphere")]
pub struct Sphere {
    /// Radius (m).
    pub radius_m: f64,
    /// What it is made of.
    pub material: Material,
}

impl Sphere {
    /// Its mass (kg).
    pub fn mass_kg(&self) -> f64 {
        self.material.sphere_mass_kg(self.radius_m)
    }

    /// The stiffness (N·m^−3/2) of its contact with another sphere, by Hertz's law.
    pub fn stiffness_with(&self, other: &Self) -> f64 {
        crate::material::hertz_spheres(&self.material, self.radius_m, &other.material, other.radius_m)
    }

    /// The stiffness (N·m^−3/2) of its contact with a plane of `wall`, by Hertz's law.
    pub fn stiffness_at(&self, wall: &Material) -> f64 {
        crate::material::hertz_wall(&self.material, self.radius_m, wall)
    }
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct WrittenSphere {
    #[serde(skip_serializing_if = "Option::is_none")]
    material: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    radius_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    diameter_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    density_kg_m3: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    young_pa: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    poisson: Option<f64>,
}

impl From<Sphere> for WrittenSphere {
    fn from(sphere: Sphere) -> Self {
        let Material { density_kg_m3, young_pa, poisson } = sphere.material;
        Self {
            radius_m: Some(sphere.radius_m),
            density_kg_m3: Some(density_kg_m3),
            young_pa: Some(young_pa),
            poisson: Some(poisson),
            ..Self::default()
        }
    }
}

impl TryFrom<WrittenSphere> for Sphere {
    type Error = String;

    fn try_from(written: WrittenSphere) -> Result<Self, String> {
        let radius_m = match (written.radius_m, written.diameter_m) {
            (Some(radius_m), None) => radius_m,
            (None, Some(diameter_m)) => 0.5 * diameter_m,
            (None, None) => return Err("found no radius; allowed: one of radius_m and diameter_m".to_owned()),
            _ => return Err("found radius_m and diameter_m; allowed: one of them".to_owned()),
        };
        let of = WrittenMaterial {
            material: written.material,
            density_kg_m3: written.density_kg_m3,
            young_pa: written.young_pa,
            poisson: written.poisson,
        };
        Ok(Self { radius_m, material: of.resolve()? })
    }
}

/// A material by its name, or by numbers, which come before those of the name.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct WrittenMaterial {
    #[serde(skip_serializing_if = "Option::is_none")]
    material: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    density_kg_m3: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    young_pa: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    poisson: Option<f64>,
}

impl WrittenMaterial {
    fn resolve(self) -> Result<Material, String> {
        let named = match &self.material {
            None => None,
            Some(name) => Some(Material::named(name).ok_or_else(|| {
                let known: Vec<_> = crate::material::MATERIALS.iter().map(|named| named.name).collect();
                format!(
                    "found the unknown material `{name}`; allowed: {}; or density_kg_m3, young_pa and poisson in its place",
                    known.join(", ")
                )
            })?),
        };
        let number = |written: Option<f64>, of: fn(&Material) -> f64, key: &str| {
            written.or_else(|| named.as_ref().map(of)).ok_or_else(|| {
                format!(
                    "found no {key}; allowed: a `material`, or all of density_kg_m3, young_pa and poisson"
                )
            })
        };
        Ok(Material {
            density_kg_m3: number(self.density_kg_m3, |m| m.density_kg_m3, "density_kg_m3")?,
            young_pa: number(self.young_pa, |m| m.young_pa, "young_pa")?,
            poisson: number(self.poisson, |m| m.poisson, "poisson")?,
        })
    }
}

/// What a wall is made of: a name, or a table of numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallMaterial(pub Material);

impl Serialize for WallMaterial {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Material { density_kg_m3, young_pa, poisson } = self.0;
        let written = WrittenMaterial {
            material: None,
            density_kg_m3: Some(density_kg_m3),
            young_pa: Some(young_pa),
            poisson: Some(poisson),
        };
        written.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for WallMaterial {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Reader;
        impl<'de> Visitor<'de> for Reader {
            type Value = WrittenMaterial;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a material, or a table of its numbers")
            }

            fn visit_str<E>(self, name: &str) -> Result<WrittenMaterial, E> {
                Ok(WrittenMaterial { material: Some(name.to_owned()), ..WrittenMaterial::default() })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<WrittenMaterial, A::Error> {
                WrittenMaterial::deserialize(MapAccessDeserializer::new(map))
            }
        }
        let written = deserializer.deserialize_any(Reader)?;
        written.resolve().map(Self).map_err(serde::de::Error::custom)
    }
}

/// The spheres of a chain: one for all, or several in turn.
#[derive(Debug, Clone, PartialEq)]
pub struct Spheres(pub Vec<Sphere>);

impl Spheres {
    /// Mass (kg) of the first, α, and stiffness (N·m^−3/2) of the first contact: what the scales are made of.
    pub fn scales(&self) -> Option<[f64; 3]> {
        let first = self.0.first()?;
        let second = self.0.get(1).unwrap_or(first);
        Some([first.mass_kg(), 1.5, first.stiffness_with(second)])
    }
}

impl Serialize for Spheres {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0[..] {
            [only] => only.serialize(serializer),
            several => serializer.collect_seq(several),
        }
    }
}

impl<'de> Deserialize<'de> for Spheres {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        several(deserializer).map(Self)
    }
}

/// One sphere that differs from the others.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WrittenOddSphere", into = "WrittenOddSphere")]
pub struct OddSphere {
    /// Which bead, from 0.
    pub bead: u64,
    /// What it is.
    pub sphere: Sphere,
}

/// [`WrittenSphere`] with its bead: flattened, it would lose the places of its values.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenOddSphere {
    bead: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    radius_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    diameter_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    density_kg_m3: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    young_pa: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    poisson: Option<f64>,
}

impl From<OddSphere> for WrittenOddSphere {
    fn from(odd: OddSphere) -> Self {
        let sphere = WrittenSphere::from(odd.sphere);
        let WrittenSphere { material, radius_m, diameter_m, density_kg_m3, young_pa, poisson } = sphere;
        Self { bead: odd.bead, material, radius_m, diameter_m, density_kg_m3, young_pa, poisson }
    }
}

impl TryFrom<WrittenOddSphere> for OddSphere {
    type Error = String;

    fn try_from(written: WrittenOddSphere) -> Result<Self, String> {
        let WrittenOddSphere { bead, material, radius_m, diameter_m, density_kg_m3, young_pa, poisson } =
            written;
        let sphere = WrittenSphere { material, radius_m, diameter_m, density_kg_m3, young_pa, poisson };
        Ok(Self { bead, sphere: sphere.try_into()? })
    }
}

/// What a seed makes of the masses, radii or stiffnesses that the rules give.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Disorder {
    /// What is disordered.
    pub of: Disordered,
    /// A factor between 1 − a and 1 + a.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uniform: Option<f64>,
    /// A factor 1 + s·z with a standard normal z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<f64>,
    /// A factor exp(s·z).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_normal: Option<f64>,
    /// One factor for a part of them, the others as they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub two_valued: Option<TwoValued>,
    /// The values as they are, in another order.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub permuted: bool,
}

/// What a seed disorders.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Disordered {
    /// The masses of the beads.
    Masses,
    /// The radii of spheres, and with them masses and stiffnesses.
    Radii,
    /// The stiffnesses of the contacts between beads.
    Stiffnesses,
}

/// Two values at random.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TwoValued {
    /// The probability of each to have the factor.
    pub fraction: f64,
    /// The factor.
    pub factor: f64,
}
