//! Drives and waveforms as files have them: one key of several.

use super::{
    Chirp, Drive, Gaussian, HalfSine, Interpolation, Place, Quantity, Ramp, Side, Sine, Step, Table, Waveform,
};
use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;
use std::path::PathBuf;

#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenDrive {
    /// The wall that is moved, or `bead`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    wall: Option<Side>,
    /// Number of the bead that is moved or pushed, from 0, or `wall`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    bead: Option<u64>,
    /// The force (N) on the bead, or one of the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    force_n: Option<Waveform>,
    /// The displacement (m), which must not jump, or one of the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    displacement_m: Option<Waveform>,
    /// The velocity (m/s), or one of the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
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
        let given =
            [written.force_n.is_some(), written.displacement_m.is_some(), written.velocity_m_s.is_some()];
        let found = given.iter().filter(|is_given| **is_given).count();
        let given = [
            (Quantity::Force, written.force_n),
            (Quantity::Displacement, written.displacement_m),
            (Quantity::Velocity, written.velocity_m_s),
        ];
        let mut given = given.into_iter().filter_map(|(quantity, waveform)| Some((quantity, waveform?)));
        let (Some((prescribes, waveform)), None) = (given.next(), given.next()) else {
            return Err(format!(
                "found {found} of `force_n`, `displacement_m`, `velocity_m_s`; allowed: one for each [[drive]]"
            ));
        };
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

impl From<Drive> for WrittenDrive {
    fn from(drive: Drive) -> Self {
        let (wall, bead) = match drive.at {
            Place::Wall(side) => (Some(side), None),
            Place::Bead(bead) => (None, Some(bead)),
        };
        let mut written = Self { wall, bead, force_n: None, displacement_m: None, velocity_m_s: None };
        let place = match drive.prescribes {
            Quantity::Force => &mut written.force_n,
            Quantity::Displacement => &mut written.displacement_m,
            Quantity::Velocity => &mut written.velocity_m_s,
        };
        *place = Some(drive.waveform);
        written
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
