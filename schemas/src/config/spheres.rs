//! Spheres and walls by their materials.

use super::several::several;
use crate::json_schema::positive;
use crate::material::{MATERIALS, Material};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::fmt;

/// A sphere by its radius and its material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "WrittenSphere")]
#[schemars(into = "WrittenSphere")]
pub struct Sphere {
    /// Radius (m).
    pub radius_m: f64,
    /// Its material.
    #[serde(flatten)]
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

#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct WrittenSphere {
    /// Name of the material.
    #[schemars(extend("enum" = material_names()))]
    material: Option<String>,
    /// Radius (m), or `diameter_m`.
    #[schemars(transform = positive)]
    radius_m: Option<f64>,
    /// Diameter (m), or `radius_m`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    diameter_m: Option<f64>,
    /// Density ρ (kg/m³) [default: that of the material].
    #[schemars(transform = positive)]
    density_kg_m3: Option<f64>,
    /// Young's modulus E (Pa) [default: that of the material].
    #[schemars(transform = positive)]
    young_pa: Option<f64>,
    /// Poisson's ratio ν [default: that of the material].
    #[schemars(range(max = 0.5), extend("exclusiveMinimum" = -1))]
    poisson: Option<f64>,
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

/// Names of materials, for schemas.
fn material_names() -> Value {
    MATERIALS.iter().map(|named| named.name).collect()
}

/// A material by its name, or by numbers, which come before those of the name.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct WrittenMaterial {
    /// Name of the material.
    #[schemars(extend("enum" = material_names()))]
    material: Option<String>,
    /// Density ρ (kg/m³) [default: that of the material].
    #[schemars(transform = positive)]
    density_kg_m3: Option<f64>,
    /// Young's modulus E (Pa) [default: that of the material].
    #[schemars(transform = positive)]
    young_pa: Option<f64>,
    /// Poisson's ratio ν [default: that of the material].
    #[schemars(range(max = 0.5), extend("exclusiveMinimum" = -1))]
    poisson: Option<f64>,
}

impl WrittenMaterial {
    fn resolve(self) -> Result<Material, String> {
        let named = match &self.material {
            None => None,
            Some(name) => Some(Material::named(name).ok_or_else(|| {
                let known: Vec<_> = MATERIALS.iter().map(|named| named.name).collect();
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

/// The material of a wall: a name, or a table of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WallMaterial(pub Material);

impl JsonSchema for WallMaterial {
    fn schema_name() -> Cow<'static, str> {
        "WallMaterial".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let table = WrittenMaterial::json_schema(generator);
        json_schema!({ "anyOf": [{ "enum": material_names() }, table] })
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
    /// Mass (kg) of the first sphere, α, and stiffness (N·m^−3/2) of the first contact, for the scales.
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
#[serde(try_from = "WrittenOddSphere")]
pub struct OddSphere {
    /// Number of the bead, from 0.
    pub bead: u64,
    /// The sphere.
    #[serde(flatten)]
    pub sphere: Sphere,
}

/// The schema of a list of [`WrittenOddSphere`].
pub(super) fn odd_schema(generator: &mut SchemaGenerator) -> Schema {
    let mut sphere = WrittenSphere::json_schema(generator);
    if let Some(keys) = sphere.get_mut("properties") {
        keys["bead"] =
            json!({ "type": "integer", "minimum": 0, "description": "Number of the bead, from 0." });
    }
    sphere.insert("required".to_owned(), json!(["bead"]));
    json_schema!({ "type": "array", "items": sphere })
}

/// [`WrittenSphere`] with its bead: flattened, it would lose the places of its values.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenOddSphere {
    bead: u64,
    material: Option<String>,
    radius_m: Option<f64>,
    diameter_m: Option<f64>,
    density_kg_m3: Option<f64>,
    young_pa: Option<f64>,
    poisson: Option<f64>,
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
