//! Drives and waveforms as files have them: one key of several.

use super::{
    Chirp, Drive, Gaussian, HalfSine, Interpolation, Place, Quantity, Ramp, Side, Sine, Step, Table, Waveform,
};
use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::path::PathBuf;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenDrive {
    /// The wall that is moved, or `bead`.
    wall: Option<Side>,
    /// Number of the bead that is moved or pushed, from 0, or `wall`.
    bead: Option<u64>,
    /// The force (N) on the bead, or one of the others.
    force_n: Option<Waveform>,
    /// The displacement (m), which must not jump, or one of the others.
    displacement_m: Option<Waveform>,
    /// The velocity (m/s), or one of the others.
    velocity_m_s: Option<Waveform>,
}

impl TryFrom<WrittenDrive> for Drive {
    type Error = String;

    fn try_from(written: WrittenDrive) -> Result<Self, String> {
        let at = match (written.wall, written.bead) {
            (Some(side), None) => Place::Wall(side),
            (None, Some(bead)) => Place::Bead(bead),
            (None, None) => {
                return Err(
                    "found a drive without a place; allowed: one of `wall = \"left\"`, `bead = 0`".to_owned()
                );
            }
            (Some(_), Some(_)) => {
                return Err("found `wall` and `bead`; allowed: one of them for each drive".to_owned());
            }
        };
        let given = [
            (Quantity::Force, written.force_n),
            (Quantity::Displacement, written.displacement_m),
            (Quantity::Velocity, written.velocity_m_s),
        ];
        let given = given.into_iter().filter_map(|(quantity, waveform)| Some((quantity, waveform?)));
        let [(prescribes, waveform)] = given.collect::<Vec<_>>().try_into().map_err(|given: Vec<_>| {
            let found = given.len();
            format!(
                "found {found} of `force_n`, `displacement_m`, `velocity_m_s`; allowed: one for each [[drive]]"
            )
        })?;
        if let (Place::Wall(_), Quantity::Force) = (at, prescribes) {
            return Err(
                "found `force_n` at a wall; allowed: `displacement_m` or `velocity_m_s`, or a force at the \
                        end bead and no wall"
                    .to_owned(),
            );
        }
        Ok(Self { at, prescribes, waveform })
    }
}

impl Serialize for Drive {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut written = serializer.serialize_map(Some(2))?;
        match self.at {
            Place::Wall(side) => written.serialize_entry("wall", &side)?,
            Place::Bead(bead) => written.serialize_entry("bead", &bead)?,
        }
        written.serialize_entry(self.prescribes.key(), &self.waveform)?;
        written.end()
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenWaveform {
    constant: Option<f64>,
    sine: Option<Sine>,
    chirp: Option<Chirp>,
    step: Option<Step>,
    ramp: Option<Ramp>,
    half_sine: Option<HalfSine>,
    gaussian: Option<Gaussian>,
    table: Option<Table>,
    csv: Option<PathBuf>,
    interpolation: Option<Interpolation>,
}

impl WrittenWaveform {
    fn waveform(self) -> Result<Waveform, &'static str> {
        if self.interpolation.is_some() && self.csv.is_none() {
            return Err("found `interpolation`; allowed: beside `csv`, or in `table`");
        }
        let interpolation = self.interpolation.unwrap_or_default();
        let given = [
            self.constant.map(Waveform::Constant),
            self.sine.map(Waveform::Sine),
            self.chirp.map(Waveform::Chirp),
            self.step.map(Waveform::Step),
            self.ramp.map(Waveform::Ramp),
            self.half_sine.map(Waveform::HalfSine),
            self.gaussian.map(Waveform::Gaussian),
            self.table.map(Waveform::Table),
            self.csv.map(|csv| Waveform::Csv { csv, interpolation }),
        ];
        let mut given = given.into_iter().flatten();
        match (given.next(), given.next()) {
            (Some(waveform), None) => Ok(waveform),
            _ => Err(
                "found none or several of them; allowed: a number, or one of `constant`, `sine`, `chirp`, `step`, `ramp`, `half_sine`, \
                      `gaussian`, `table`, `csv`",
            ),
        }
    }
}

impl<'de> Deserialize<'de> for Waveform {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrMap;
        impl<'de> Visitor<'de> for NumberOrMap {
            type Value = Waveform;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a number, or a waveform such as { sine = { amplitude = 1.0, frequency_hz = 100 } }",
                )
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Waveform, E> {
                Ok(Waveform::Constant(value))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Waveform, E> {
                Ok(Waveform::Constant(value as f64))
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<Waveform, E> {
                Ok(Waveform::Constant(value as f64))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Waveform, A::Error> {
                let written = WrittenWaveform::deserialize(MapAccessDeserializer::new(map))?;
                written.waveform().map_err(A::Error::custom)
            }
        }
        deserializer.deserialize_any(NumberOrMap)
    }
}
