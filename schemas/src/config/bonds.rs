//! Laws of contacts beside one power: `chain.second` and `chain.bonds`.

use super::{ConfigError, Profile};
use crate::json_schema::{exponent, not_negative, positive};
use crate::term::{BondForm, Holds, TermLaw, bond_forms};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::fmt;
use std::sync::LazyLock;

/// A second power of the overlap that each contact adds to its force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SecondPower {
    /// Its exponent.
    #[schemars(transform = exponent)]
    pub alpha: f64,
    /// Its stiffness (N·m^−alpha).
    #[schemars(transform = not_negative)]
    pub stiffness: Profile,
}

/// Two-sided bonds in place of contacts: each of the laws of [`bond_forms`] at most once, in their order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Bonds(Vec<Bond>);

/// One law of all bonds.
#[derive(Debug, Clone, PartialEq)]
pub struct Bond {
    /// Its form.
    pub form: &'static BondForm,
    /// The law, with its parameter.
    pub law: TermLaw,
    /// Its stiffness (N over the unit of what the law gives).
    pub stiffness: Profile,
}

static KEYS: LazyLock<Vec<&'static str>> = LazyLock::new(|| bond_forms().map(|form| form.key).collect());

/// Laws that bonds have, each with one stiffness for all.
impl FromIterator<(TermLaw, f64)> for Bonds {
    fn from_iter<I: IntoIterator<Item = (TermLaw, f64)>>(laws: I) -> Self {
        let bonds = laws.into_iter().filter_map(|(law, stiffness)| {
            let form = bond_forms().find(|form| (form.law)(law.named().1) == law)?;
            Some(Bond { form, law, stiffness: Profile::Same(stiffness) })
        });
        Self(bonds.collect()).in_order()
    }
}

impl Bonds {
    fn in_order(mut self) -> Self {
        self.0.sort_by_key(|bond| KEYS.iter().position(|key| *key == bond.form.key));
        self
    }

    /// Each law.
    pub fn laws(&self) -> impl Iterator<Item = &Bond> {
        self.0.iter()
    }

    /// True if they have a bottom: a force without one, such as a quadratic one alone, lets beads go.
    pub(crate) fn hold(&self) -> bool {
        self.0.iter().any(|bond| bond.form.holds != Holds::None)
    }

    /// True if they do not hold as they are written, or only zeros would.
    pub(crate) fn let_go(&self) -> bool {
        !self.hold() || self.scales()[2] == Some(0.0)
    }

    /// True if one of `contacts` bonds can be pulled over the edge of its potential.
    pub(crate) fn can_break(&self, contacts: usize) -> bool {
        let acts = |holds: Holds| {
            let mut acts = vec![false; contacts];
            for bond in self.0.iter().filter(|bond| bond.form.holds == holds) {
                let stiffness = bond.stiffness.values(contacts);
                acts.iter_mut().zip(stiffness).for_each(|(acts, stiffness)| *acts |= stiffness != 0.0);
            }
            acts
        };
        acts(Holds::None).into_iter().zip(acts(Holds::All)).any(|(pulls, is_held)| pulls && !is_held)
    }

    /// No mass, and the exponent and the stiffness of the scales: those of a law with a slope at rest, or else of the power that holds all
    /// pulls.
    pub(crate) fn scales(&self) -> [Option<f64>; 3] {
        let acting = |is: fn(&BondForm) -> bool| {
            self.laws().find(|bond| is(bond.form) && bond.stiffness.largest() > 0.0)
        };
        let holds_all = |form: &BondForm| form.holds == Holds::All;
        let found = acting(|form| form.is_slope).or_else(|| acting(holds_all));
        found.or_else(|| self.laws().next()).map_or([None; 3], |bond| {
            let alpha = if holds_all(bond.form) { bond.law.named().1 } else { 1.0 };
            [None, Some(alpha), Some(bond.stiffness.largest())]
        })
    }

    /// The refusal of bonds that do not hold.
    pub(crate) fn refusal() -> ConfigError {
        let (hold, others): (Vec<_>, Vec<_>) = bond_forms().partition(|form| form.holds != Holds::None);
        let names = |forms: &[&BondForm]| forms.iter().map(|form| form.key).collect::<Vec<_>>().join(", ");
        let allowed =
            format!("one of {} above 0 among them: {} alone has no bottom", names(&hold), names(&others));
        ConfigError::value("chain.bonds", "no bonds that hold", &allowed)
    }
}

impl JsonSchema for Bonds {
    fn schema_name() -> Cow<'static, str> {
        "Bonds".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let forms = bond_forms().map(|form| {
            let mut stiffness = Profile::json_schema(generator);
            let about = format!("Stiffness of the {} force; allowed: {}.", form.words, form.allowed);
            stiffness.insert("description".to_owned(), about.into());
            if !form.has_either_sign {
                not_negative(&mut stiffness);
            }
            let value = match form.parameter {
                None => stiffness,
                Some((key, unit)) => {
                    let mut parameter = json_schema!({ "type": "number", "description": unit });
                    positive(&mut parameter);
                    json_schema!({
                        "description": format!("The {} force.", form.words),
                        "type": "object",
                        "properties": { "stiffness": stiffness, key: parameter },
                        "required": ["stiffness", key],
                        "additionalProperties": false,
                    })
                }
            };
            (form.key.to_owned(), value.into())
        });
        let keys: Map<String, Value> = forms.collect();
        json_schema!({ "type": "object", "properties": keys, "additionalProperties": false })
    }
}

impl Serialize for Bonds {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|bond| (bond.form.key, bond)))
    }
}

impl Serialize for Bond {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Some((key, _)) = self.form.parameter else { return self.stiffness.serialize(serializer) };
        let mut table = serializer.serialize_map(Some(2))?;
        table.serialize_entry("stiffness", &self.stiffness)?;
        table.serialize_entry(key, &self.law.named().1)?;
        table.end()
    }
}

impl<'de> Deserialize<'de> for Bonds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(All)
    }
}

struct All;

impl<'de> Visitor<'de> for All {
    type Value = Bonds;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Bonds, A::Error> {
        let mut bonds = Bonds::default();
        while let Some(form) = map.next_key_seed(Key)? {
            if bonds.0.iter().any(|bond| bond.form == form) {
                return Err(A::Error::duplicate_field(form.key));
            }
            bonds.0.push(map.next_value_seed(One(form))?);
        }
        Ok(bonds.in_order())
    }
}

/// A key of `chain.bonds`.
struct Key;

impl<'de> DeserializeSeed<'de> for Key {
    type Value = &'static BondForm;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<&'static BondForm, D::Error> {
        let found = String::deserialize(deserializer)?;
        bond_forms()
            .find(|form| form.key == found)
            .ok_or_else(|| D::Error::unknown_field(&found, KEYS.as_slice()))
    }
}

/// The value of a key.
struct One(&'static BondForm);

impl<'de> DeserializeSeed<'de> for One {
    type Value = Bond;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Bond, D::Error> {
        let Some((parameter, _)) = self.0.parameter else {
            let stiffness = Profile::deserialize(deserializer)?;
            return Ok(Bond { form: self.0, law: (self.0.law)(0.0), stiffness });
        };
        let (stiffness, value) = deserializer.deserialize_map(Table(parameter))?;
        Ok(Bond { form: self.0, law: (self.0.law)(value), stiffness })
    }
}

/// A table of a stiffness and a parameter of this name.
struct Table(&'static str);

impl<'de> Visitor<'de> for Table {
    type Value = (Profile, f64);

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(Profile, f64), A::Error> {
        let (mut stiffness, mut value) = (None, None);
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "stiffness" if stiffness.is_none() => stiffness = Some(map.next_value()?),
                name if name == self.0 && value.is_none() => value = Some(map.next_value()?),
                _ => {
                    let known = format!("`stiffness` or `{}`", self.0);
                    let said = format!("unknown field `{key}` or a second one, expected {known}");
                    return Err(A::Error::custom(said));
                }
            }
        }
        let missing = |name: &'static str| A::Error::missing_field(name);
        Ok((stiffness.ok_or_else(|| missing("stiffness"))?, value.ok_or_else(|| missing(self.0))?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::RunConfig;
    use crate::manifest::Physics;

    #[test]
    fn bonds_are_written_in_their_order_and_read_back() {
        let text =
            r#"{"linear":1.0,"cubic":{"pattern":[0.0,2.0]},"toda":{"stiffness":3.0,"steepness_per_m":4.0}}"#;
        let turned =
            r#"{"toda":{"steepness_per_m":4.0,"stiffness":3.0},"cubic":{"pattern":[0.0,2.0]},"linear":1.0}"#;
        for written in [text, turned] {
            let bonds: Bonds = serde_json::from_str(written).expect("bonds");
            assert_eq!(serde_json::to_string(&bonds).expect("JSON"), text);
        }
    }

    #[test]
    fn bonds_of_zeros_are_refused_where_they_stand() {
        for bonds in ["linear = 0.0", "linear = 0.0, quadratic = 1.0", "cubic = 0.0"] {
            let text = format!(
                "[time]\nduration_s = 1.0\n[chain]\nbeads = 4\nbead_mass_kg = 1.0\nbonds = {{ {bonds} }}\n"
            );
            let error = RunConfig::from_toml(&text).expect_err(bonds).located(&text, None).to_string();
            assert!(error.starts_with("line 6: chain.bonds: found no bonds that hold"), "{error}");
        }
    }

    /// `L = (m·v0²/k)^(1/4)` and the step of a cubic force alone follow its stiffness; a linear part gives `L = v0·√(m/k)`.
    #[test]
    fn scales_are_those_of_the_law_that_acts_at_rest() {
        let physics = |bonds: &str| {
            let text = format!(
                "[chain]\nbeads = 10\nbead_mass_kg = 1.0\nbonds = {bonds}\n[striker]\nbead = 0\nvelocity_m_s = 5.0\n\
                 [time]\nduration_s = 1.0\n"
            );
            Physics::resolve(&RunConfig::from_toml(&text).expect("a configuration")).expect("a run")
        };
        for (bonds, length_m) in [
            ("{ cubic = 1e8 }", 25e-8_f64.powf(0.25)),
            ("{ linear = 0.0, quadratic = -1.0, cubic = 1e12 }", 25e-12_f64.powf(0.25)),
            ("{ linear = 4.0, cubic = 1e8 }", 2.5),
        ] {
            assert!((physics(bonds).scales().length_m / length_m - 1.0).abs() < 1e-13, "{bonds}");
        }
        // with 16 times the stiffness the same motion has half the length, and takes half the time
        let steps = ["{ cubic = 1.0 }", "{ cubic = 16.0 }"].map(|bonds| physics(bonds).usual_step().0);
        assert!((steps[0] / steps[1] - 2.0).abs() < 1e-12, "{steps:?}");
        // a weak linear part, along which the speed alone would lead far, leaves that step
        let weak = physics("{ linear = 1e-6, cubic = 1.0 }").usual_step().0;
        assert!(weak > 0.5 * steps[0] && weak <= steps[0], "{weak} {steps:?}");
    }

    #[test]
    fn what_bonds_do_not_have_is_refused() {
        for (text, says) in [
            (r#"{"quartic":1.0}"#, "unknown field `quartic`, expected one of `linear`"),
            (r#"{"linear":1.0,"linear":1.0}"#, "duplicate field `linear`"),
            (r#"{"toda":{"stiffness":3.0}}"#, "missing field `steepness_per_m`"),
            (r#"{"toda":{"stiffness":3.0,"b":1.0}}"#, "unknown field `b`"),
            (r#"{"toda":3.0}"#, "expected a table"),
        ] {
            let error = serde_json::from_str::<Bonds>(text).expect_err(text).to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
