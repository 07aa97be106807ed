//! Names of runs on the bus.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A run's name, `[a-z0-9-]{1,64}` without a `-` in front: it becomes part of service names and of file names, and
/// stands on command lines.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct RunName(String);

impl RunName {
    /// The allowed names, for messages.
    pub const ALLOWED: &'static str = "1 to 64 characters of a-z, 0-9 and -, the first of which is no -";

    /// Most characters.
    const LONGEST: usize = 64;

    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The name that comes closest to `text`, such as the name of a file: `Körner_3` makes `korner-3`. Latin letters
    /// lose case and accents, everything else becomes `-`; `run` if nothing is left.
    pub fn closest(text: &str) -> Self {
        let mut name = String::new();
        for character in text.chars().flat_map(char::to_lowercase) {
            match character {
                'a'..='z' | '0'..='9' => name.push(character),
                // accents that stand behind their letters
                '\u{300}'..='\u{36f}' => {}
                _ => match plain(character) {
                    Some(letters) => name.push_str(letters),
                    None if name.is_empty() || name.ends_with('-') => {}
                    None => name.push('-'),
                },
            }
        }
        name.truncate(Self::LONGEST);
        let name = name.trim_end_matches('-');
        Self(if name.is_empty() { "run" } else { name }.to_owned())
    }
}

/// Letters of a-z for a small letter of Latin-1, Latin Extended-A or Romanian.
fn plain(character: char) -> Option<&'static str> {
    const LETTERS: [(&str, &str); 24] = [
        ("a", "àáâãäåāăą"),
        ("ae", "æ"),
        ("c", "çćĉċč"),
        ("d", "ðďđ"),
        ("e", "èéêëēĕėęě"),
        ("g", "ĝğġģ"),
        ("h", "ĥħ"),
        ("i", "ìíîïĩīĭįı"),
        ("ij", "ĳ"),
        ("j", "ĵ"),
        ("k", "ķĸ"),
        ("l", "ĺļľŀł"),
        ("n", "ñńņňŉŋ"),
        ("o", "òóôõöøōŏő"),
        ("oe", "œ"),
        ("r", "ŕŗř"),
        ("s", "śŝşšſș"),
        ("ss", "ß"),
        ("t", "ţťŧț"),
        ("th", "þ"),
        ("u", "ùúûüũūŭůűų"),
        ("w", "ŵ"),
        ("y", "ýÿŷ"),
        ("z", "źżž"),
    ];
    LETTERS.iter().find(|(_, marked)| marked.contains(character)).map(|(letters, _)| *letters)
}

impl FromStr for RunName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        if (1..=Self::LONGEST).contains(&text.len()) && !text.starts_with('-') && text.bytes().all(allowed) {
            return Ok(Self(text.to_owned()));
        }
        let (allowed, closest) = (Self::ALLOWED, Self::closest(text));
        Err(format!("`{text}` is not a run name; allowed: {allowed}, such as `{closest}`"))
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
        for bad in ["", "A", "a/b", "a b", "é", "-a", "-", &"x".repeat(65)] {
            assert!(bad.parse::<RunName>().is_err(), "{bad}");
        }
    }

    #[test]
    fn names_are_made_of_any_text() {
        for (text, name) in [
            ("run_01", "run-01"),
            ("Dimer", "dimer"),
            ("Körner 3", "korner-3"),
            ("Ko\u{308}rner", "korner"),
            ("Größe.v2", "grosse-v2"),
            ("STRAẞE", "strasse"),
            ("Łódź", "lodz"),
            ("İzmir", "izmir"),
            ("Ærø × Þór", "aero-thor"),
            ("--force", "force"),
            ("a  --  b_", "a-b"),
            ("α", "run"),
            ("鎖", "run"),
            ("\u{202e}", "run"),
            ("", "run"),
        ] {
            let made = RunName::closest(text);
            assert_eq!(made.as_str(), name, "{text}");
            assert_eq!(name.parse(), Ok(made), "{text}");
        }
        let long = RunName::closest(&format!("{}-{}", "x".repeat(63), "y".repeat(9)));
        assert_eq!(long.as_str(), "x".repeat(63), "cut, and no - at its end");
    }
}
