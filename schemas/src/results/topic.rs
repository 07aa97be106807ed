//! What is on the bus, by name.

use std::fmt;
use std::str::FromStr;

/// What a service of a run carries, the last part of its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Topic {
    /// Every frame.
    State,
    /// The resolved arrays.
    Chain,
    /// Manifest and status.
    Manifest,
    /// The handshake of consumers.
    Join,
    /// Energies per frame.
    Energies,
    /// Motion of chosen beads per frame.
    Impurity,
    /// Open and closed contacts per frame.
    Contacts,
    /// Pulses found per frame.
    Pulses,
    /// What somebody else's analysis finds per frame.
    Own(OwnTopic),
}

impl Topic {
    /// The topic of somebody's own results, called `name`.
    ///
    /// # Errors
    /// What is allowed, when that is no name.
    pub fn own(name: &str) -> Result<Self, String> {
        name.parse().map(Self::Own)
    }

    /// The last part of the service's name.
    pub fn as_str(&self) -> &str {
        match self {
            Self::State => "state",
            Self::Chain => "chain",
            Self::Manifest => "manifest",
            Self::Join => "join",
            Self::Energies => "energies",
            Self::Impurity => "impurity",
            Self::Contacts => "contacts",
            Self::Pulses => "pulses",
            Self::Own(topic) => topic.as_str(),
        }
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

const HEAD: &str = "own/";
const LONGEST_NAME: usize = 32;
const LONGEST: usize = HEAD.len() + LONGEST_NAME;

/// The topic of somebody's own results, `own/NAME`, which no topic of ours will ever meet.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct OwnTopic {
    text: [u8; LONGEST],
    length: usize,
}

impl OwnTopic {
    /// What is allowed as a name, for messages.
    pub const ALLOWED: &'static str = "1 to 32 characters of a-z, 0-9 and -, the first of them no -";

    /// `own/NAME`.
    pub fn as_str(&self) -> &str {
        // only ASCII is let in
        str::from_utf8(&self.text[..self.length]).unwrap_or_default()
    }

    /// `NAME`.
    pub fn name(&self) -> &str {
        &self.as_str()[HEAD.len()..]
    }
}

impl FromStr for OwnTopic {
    type Err = String;

    /// The topic of this name.
    fn from_str(name: &str) -> Result<Self, String> {
        let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        let fits = (1..=LONGEST_NAME).contains(&name.len()) && !name.starts_with('-');
        if !fits || !name.bytes().all(allowed) {
            return Err(format!("`{name}` is no name for results; allowed: {}", Self::ALLOWED));
        }
        let (mut text, length) = ([0; LONGEST], HEAD.len() + name.len());
        text[..HEAD.len()].copy_from_slice(HEAD.as_bytes());
        text[HEAD.len()..length].copy_from_slice(name.as_bytes());
        Ok(Self { text, length })
    }
}

impl fmt::Debug for OwnTopic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "OwnTopic({})", self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_checked_and_come_back() {
        let longest = "a".repeat(LONGEST_NAME);
        for name in ["x", "2d-map", "right-momentum", &longest] {
            let topic: OwnTopic = name.parse().expect("a name");
            assert_eq!((topic.name(), topic.as_str()), (name, &*format!("own/{name}")));
        }
        for name in ["", "-x", "Upper", "a/b", "a_b", "é", &format!("{longest}a")] {
            assert!(name.parse::<OwnTopic>().is_err(), "{name}");
        }
    }
}
