//! Credit for a run: its author and its licence, for those who cite it.

use crate::config_error::ConfigError;
use crate::text::shown_within;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The `[provenance]` table: facts that decide no bit of a run, each of which may be left out.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Credit {
    /// The author, or several: "Ada Lovelace, Mary Somerville".
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(regex(pattern = r"\S"), length(max = LONGEST))]
    pub author: Option<String>,
    /// ORCID of the author: "0000-0002-1825-0097".
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(regex(pattern = "^([0-9]{4}-){3}[0-9]{3}[0-9X]$"))]
    pub orcid: Option<String>,
    /// Licence of the recording, an SPDX expression: "CC-BY-4.0".
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(regex(pattern = r"^[( ]*[A-Za-z0-9][A-Za-z0-9.+:-]*([) ]+(AND|OR|WITH|and|or|with)[( ]+[A-Za-z0-9][A-Za-z0-9.+:-]*)*[) ]*$"), length(max = LONGEST))]
    pub licence: Option<String>,
    /// DOI of the recording, or of the work that it belongs to: "10.5281/zenodo.1234567".
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(regex(pattern = r"^10\.[0-9]{4,9}(\.[0-9]+)*/[!-~]+$"), length(max = LONGEST))]
    pub doi: Option<String>,
}

/// Most bytes of a text.
const LONGEST: usize = 1000;

/// A key, the texts that it takes, and their description.
type Rule = (&'static str, fn(&str) -> bool, &'static str);

const RULES: [Rule; 4] = [
    ("author", is_name, "a name, or several, in one line of at most 1,000 bytes"),
    (
        "orcid",
        is_orcid,
        "an ORCID such as 0000-0002-1825-0097, whose last character is a check digit: one of the others is mistyped",
    ),
    ("licence", is_licence, "an SPDX expression such as CC-BY-4.0, CC0-1.0 or MIT OR Apache-2.0"),
    ("doi", is_doi, "a DOI that begins with 10., such as 10.5281/zenodo.1234567, without https://doi.org/"),
];

impl Credit {
    /// True if nothing is said.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Each key with its text, if it has one.
    pub fn rows(&self) -> [(&'static str, Option<&str>); 4] {
        let texts = [&self.author, &self.orcid, &self.licence, &self.doi].map(Option::as_deref);
        std::array::from_fn(|i| (RULES[i].0, texts[i]))
    }

    /// Refuses a text that is none of its kind.
    ///
    /// # Errors
    /// With the key, the text and the allowed ones.
    pub fn check(&self) -> Result<(), ConfigError> {
        for ((key, is_allowed, allowed), (_, text)) in RULES.into_iter().zip(self.rows()) {
            if let Some(text) = text.filter(|text| text.len() > LONGEST || !is_allowed(text)) {
                let found = format!("{:?}", shown_within(text, 200));
                return Err(ConfigError::value(&format!("provenance.{key}"), found, allowed));
            }
        }
        Ok(())
    }
}

fn is_name(text: &str) -> bool {
    !text.trim().is_empty() && !text.chars().any(char::is_control)
}

/// True of four groups of four digits, the last of which is the check digit of the others by ISO 7064 mod 11-2; X is 10.
fn is_orcid(text: &str) -> bool {
    let groups: Vec<&str> = text.split('-').collect();
    let digits = groups.concat();
    let is_in_groups = groups.len() == 4 && groups.iter().all(|group| group.len() == 4);
    let Some((last, body)) = digits.as_bytes().split_last().filter(|_| is_in_groups) else { return false };
    let sum = body.iter().try_fold(0, |sum, digit| {
        let digit = char::from(*digit).to_digit(10)?;
        Some((sum + digit) * 2 % 11)
    });
    let due = sum.map(|sum| (12 - sum) % 11);
    let found = if *last == b'X' { Some(10) } else { char::from(*last).to_digit(10) };
    found.is_some() && found == due
}

/// True of SPDX identifiers with an operator between each two of them, and parentheses in pairs.
fn is_licence(text: &str) -> bool {
    let is_of_word = |c: char| c.is_ascii_alphanumeric() || ".+:-".contains(c);
    let is_identifier = |word: &str| word.starts_with(char::is_alphanumeric) && word.chars().all(is_of_word);
    let apart = text.replace('(', " ( ").replace(')', " ) ");
    let (mut open, mut is_due) = (0_u32, true);
    for word in apart.split(' ').filter(|word| !word.is_empty()) {
        let is_operator = ["AND", "OR", "WITH"].iter().any(|operator| word.eq_ignore_ascii_case(operator));
        match word {
            "(" if is_due => open += 1,
            ")" if !is_due && open > 0 => open -= 1,
            _ if is_operator && !is_due => is_due = true,
            _ if !is_operator && is_due && is_identifier(word) => is_due = false,
            _ => return false,
        }
    }
    open == 0 && !is_due
}

/// True of `10.`, digits in groups, a slash, and any visible characters.
fn is_doi(text: &str) -> bool {
    let Some((registrant, suffix)) = text.strip_prefix("10.").and_then(|rest| rest.split_once('/')) else {
        return false;
    };
    let mut groups = registrant.split('.');
    let is_number = |group: &str| !group.is_empty() && group.bytes().all(|byte| byte.is_ascii_digit());
    let first = groups.next().filter(|group| (4..=9).contains(&group.len()));
    first.is_some_and(is_number)
        && groups.all(is_number)
        && !suffix.is_empty()
        && suffix.bytes().all(|byte| byte.is_ascii_graphic())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(key: &str, text: &str) -> Option<String> {
        let text = Some(text.to_owned());
        let credit = match key {
            "author" => Credit { author: text, ..Credit::default() },
            "orcid" => Credit { orcid: text, ..Credit::default() },
            "licence" => Credit { licence: text, ..Credit::default() },
            _ => Credit { doi: text, ..Credit::default() },
        };
        credit.check().err().map(|error| error.to_string())
    }

    /// The two examples of ORCID's page about the structure of its identifiers, one of them with X. A check digit by ISO 7064 finds each
    /// wrong digit, and each exchange of two neighbours.
    #[test]
    fn a_mistyped_orcid_is_found() {
        for right in ["0000-0002-1825-0097", "0000-0002-1694-233X"] {
            assert_eq!(refused("orcid", right), None);
            let places: Vec<usize> = (0..right.len()).filter(|at| right.as_bytes()[*at] != b'-').collect();
            for at in &places {
                for digit in ('0'..='9').filter(|digit| *digit != char::from(right.as_bytes()[*at])) {
                    let mut wrong = right.to_owned();
                    wrong.replace_range(at..&(at + 1), &digit.to_string());
                    assert!(refused("orcid", &wrong).is_some(), "{wrong}");
                }
            }
            for pair in places.windows(2) {
                let mut wrong = right.as_bytes().to_vec();
                wrong.swap(pair[0], pair[1]);
                let wrong = String::from_utf8(wrong).expect("ASCII");
                assert!(wrong == right || refused("orcid", &wrong).is_some(), "{wrong}");
            }
        }
    }

    #[test]
    fn wrong_texts_are_refused_with_what_is_allowed() {
        for (key, text) in [
            ("author", ""),
            ("author", "Ada\nLovelace"),
            ("orcid", "0000000218250097"),
            ("orcid", "https://orcid.org/0000-0002-1825-0097"),
            ("orcid", "0000-0002-1694-233x"),
            ("licence", "free for all!"),
            ("licence", " "),
            ("licence", "CC BY"),
            ("licence", "MIT OR"),
            ("licence", "AND"),
            ("licence", "(MIT"),
            ("licence", "MIT) OR (ISC"),
            ("doi", "https://doi.org/10.5281/zenodo.1"),
            ("doi", "10.5281"),
            ("doi", "10.52/x"),
            ("doi", "10.5281/a b"),
            ("doi", "11.5281/zenodo.1"),
        ] {
            let said = refused(key, text).unwrap_or_else(|| panic!("{key} = {text:?} is taken"));
            assert!(said.starts_with(&format!("provenance.{key}: found {text:?}; allowed: a")), "{said}");
        }
        for (key, text) in [
            ("author", "Ada Lovelace, 李雷"),
            ("licence", "(MIT OR Apache-2.0) AND LicenseRef-own"),
            ("licence", "GPL-2.0+ WITH Bison-exception-2.2"),
            ("doi", "10.1016/0032-5910(92)88030-L"),
            ("doi", "10.1000.10/123456"),
        ] {
            assert_eq!(refused(key, text), None);
        }
        assert!(refused("author", &"a".repeat(LONGEST + 1)).is_some_and(|said| said.len() < 400));
    }
}
