//! Topics on the bus, by name.

use std::fmt;
use std::str::FromStr;

/// The contents of a service of a run: the last part of the service's name.
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
    /// Results of an analysis per frame.
    Results(ResultsName),
}

impl Topic {
    /// The topic of the results of our analysis `name`.
    ///
    /// # Errors
    /// When `name` is no name, or means something else; the message says what is allowed.
    pub fn results(name: &str) -> Result<Self, String> {
        ResultsName::new("", name).map(Self::Results)
    }

    /// The topic of somebody's own results, called `name`.
    ///
    /// # Errors
    /// When `name` is no name; the message says what is allowed.
    pub fn own(name: &str) -> Result<Self, String> {
        ResultsName::new(OWN, name).map(Self::Results)
    }

    /// The last part of the service's name.
    pub fn as_str(&self) -> &str {
        match self {
            Self::State => "state",
            Self::Chain => "chain",
            Self::Manifest => "manifest",
            Self::Join => "join",
            Self::Results(name) => name.as_str(),
        }
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

const OWN: &str = "own/";
const LONGEST_NAME: usize = 32;
const LONGEST: usize = OWN.len() + LONGEST_NAME;

/// Topics of runs and of recordings that carry no results, and the service by which results are announced.
const RESERVED: [&str; 6] = ["state", "chain", "manifest", "join", "summary", "own"];

/// The name of results: `NAME` of an analysis of ours, `own/NAME` of somebody's own, so that both never meet.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct ResultsName {
    text: [u8; LONGEST],
    length: usize,
}

impl ResultsName {
    /// The allowed values of `NAME`, for messages.
    const ALLOWED: &'static str = "1 to 32 characters of a-z, 0-9 and -, the first of them no -";

    fn new(head: &str, name: &str) -> Result<Self, String> {
        let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        let fits = (1..=LONGEST_NAME).contains(&name.len()) && !name.starts_with('-');
        if !fits || !name.bytes().all(allowed) {
            return Err(format!("`{name}` is no name for results; allowed: {}", Self::ALLOWED));
        }
        if head.is_empty() && RESERVED.contains(&name) {
            return Err(format!("`{name}` means something else than results; take another name"));
        }
        let (mut text, length) = ([0; LONGEST], head.len() + name.len());
        text[..head.len()].copy_from_slice(head.as_bytes());
        text[head.len()..length].copy_from_slice(name.as_bytes());
        Ok(Self { text, length })
    }

    /// `NAME` or `own/NAME`.
    pub fn as_str(&self) -> &str {
        // only ASCII is let in
        str::from_utf8(&self.text[..self.length]).unwrap_or_default()
    }

    /// True if the results are somebody's own.
    pub fn is_own(&self) -> bool {
        self.as_str().starts_with(OWN)
    }

    /// `NAME`.
    pub fn name(&self) -> &str {
        self.as_str().strip_prefix(OWN).unwrap_or(self.as_str())
    }
}

impl FromStr for ResultsName {
    type Err = String;

    /// The name that reads `NAME` or `own/NAME`.
    fn from_str(text: &str) -> Result<Self, String> {
        text.strip_prefix(OWN).map_or_else(|| Self::new("", text), |name| Self::new(OWN, name))
    }
}

impl fmt::Debug for ResultsName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ResultsName({})", self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_checked_and_come_back() {
        let longest = "a".repeat(LONGEST_NAME);
        for name in ["x", "2d-map", "right-momentum", &longest] {
            for text in [name, &format!("own/{name}")] {
                let results: ResultsName = text.parse().expect("a name");
                assert_eq!((results.name(), results.as_str()), (name, text));
                assert_eq!(results.is_own(), text != name);
            }
            assert_eq!(Topic::results(name).expect("a name").as_str(), name);
        }
        for name in ["", "-x", "Upper", "a/b", "a_b", "é", "own/x", &format!("{longest}a")] {
            assert!(Topic::own(name).is_err() && Topic::results(name).is_err(), "{name}");
        }
    }

    #[test]
    fn results_take_no_name_that_means_something_else() {
        for name in RESERVED {
            assert!(Topic::results(name).is_err() && name.parse::<ResultsName>().is_err(), "{name}");
            assert!(Topic::own(name).is_ok(), "{name}");
        }
    }
}
