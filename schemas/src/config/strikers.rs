//! The beads that are struck: `[striker]`, or several `[[striker]]`.

use super::StrikerConfig;
use super::several::several;
use serde::de::Deserializer;
use serde::{Deserialize, Serialize, Serializer};
use std::ops::{Deref, DerefMut};

/// The beads that move at the beginning: `[striker]`, or several `[[striker]]`. It dereferences to the first one, for
/// those who need no other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Strikers {
    first: StrikerConfig,
    /// The strikers after the first.
    pub more: Vec<StrikerConfig>,
}

impl Strikers {
    /// True if nothing strikes.
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
