//! One number for all places, or one for each.

use super::ConfigError;
use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, Error as _, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Numbers for the beads, or the contacts, of a chain.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Profile {
    /// Values that repeat along the chain.
    Pattern(Vec<f64>),
    /// One value for each.
    List(Vec<f64>),
    /// The same everywhere.
    #[serde(untagged)]
    Same(f64),
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Written {
    pattern: Option<Vec<f64>>,
    list: Option<Vec<f64>>,
}

impl Profile {
    /// The values at `count` places.
    pub fn values(&self, count: usize) -> Vec<f64> {
        match self {
            Self::Same(value) => vec![*value; count],
            Self::Pattern(pattern) => pattern.iter().copied().cycle().take(count).collect(),
            Self::List(list) => list.clone(),
        }
    }

    /// The values as they are written, each at least once.
    pub fn written(&self) -> &[f64] {
        match self {
            Self::Same(value) => std::slice::from_ref(value),
            Self::Pattern(values) | Self::List(values) => values,
        }
    }

    /// The largest of the values.
    pub fn largest(&self) -> f64 {
        self.written().iter().fold(0.0, |most, value| if *value > most { *value } else { most })
    }

    /// Refuses a profile whose number of values does not fit `count` places, or that has a value outside of `range`.
    pub(crate) fn check(
        &self,
        key: &str,
        count: u64,
        range: impl Fn(f64) -> bool,
        allowed: &str,
    ) -> Result<(), ConfigError> {
        let found = self.written().len() as u64;
        let fits = match self {
            Self::Same(_) => true,
            Self::Pattern(_) => (1..=count).contains(&found),
            Self::List(_) => found == count,
        };
        if !fits {
            let allowed = match self {
                Self::List(_) => format!("{count} values, one for each place"),
                _ => "1 value to one for each place".to_owned(),
            };
            return Err(ConfigError::value(key, format!("{found} values"), &allowed));
        }
        match self.written().iter().find(|value| !range(**value)) {
            Some(value) => Err(ConfigError::number(key, *value, allowed)),
            None => Ok(()),
        }
    }
}

impl<'de> Deserialize<'de> for Profile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Reader;
        impl<'de> Visitor<'de> for Reader {
            type Value = Profile;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, { pattern = […] } or { list = […] }")
            }

            fn visit_f64<E>(self, value: f64) -> Result<Profile, E> {
                Ok(Profile::Same(value))
            }

            #[expect(
                clippy::cast_precision_loss,
                reason = "as any whole number that is written for a double"
            )]
            fn visit_i64<E>(self, value: i64) -> Result<Profile, E> {
                Ok(Profile::Same(value as f64))
            }

            #[expect(
                clippy::cast_precision_loss,
                reason = "as any whole number that is written for a double"
            )]
            fn visit_u64<E>(self, value: u64) -> Result<Profile, E> {
                Ok(Profile::Same(value as f64))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Profile, A::Error> {
                let Written { pattern, list } = Written::deserialize(MapAccessDeserializer::new(map))?;
                match (pattern, list) {
                    (Some(values), None) => Ok(Profile::Pattern(values)),
                    (None, Some(values)) => Ok(Profile::List(values)),
                    (None, None) => Err(A::Error::custom("found {}; allowed: `pattern` or `list`")),
                    _ => Err(A::Error::custom("found `pattern` and `list`; allowed: one of them")),
                }
            }
        }
        deserializer.deserialize_any(Reader)
    }
}
