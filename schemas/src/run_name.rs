//! Names of runs on the bus.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A run's name, `[a-z0-9-]{1,64}`: it becomes part of service names and of file names.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct RunName(String);

impl RunName {
    /// What is allowed, for messages.
    pub const ALLOWED: &'static str = "1 to 64 characters of a-z, 0-9 and -";

    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for RunName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        if (1..=64).contains(&text.len()) && text.bytes().all(allowed) {
            return Ok(Self(text.to_owned()));
        }
        Err(format!("`{text}` is not a run name; allowed: {}", Self::ALLOWED))
    }
}

impl TryFrom<String> for RunName {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<RunName> for String {
    fn from(name: RunName) -> Self {
        name.0
    }
}

impl fmt::Display for RunName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_safe_names_are_names() {
        assert!("light-impurity-2".parse::<RunName>().is_ok());
        for bad in ["", "A", "a/b", "a b", "é", &"x".repeat(65)] {
            assert!(bad.parse::<RunName>().is_err(), "{bad}");
        }
    }
}
