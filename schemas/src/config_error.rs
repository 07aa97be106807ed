//! The reason why a configuration cannot be used, and its place.

use std::fmt;
use std::path::{Path, PathBuf};

/// A way to see a whole configuration.
pub(crate) const EXAMPLE: &str = "`beadline preset light-impurity` prints a whole configuration";

/// The reason why a configuration cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigError {
    /// The file of the configuration, if it was read from a file.
    pub path: Option<PathBuf>,
    /// The line (from 1), if the value stands in a file.
    pub line: Option<usize>,
    /// The key, such as `chain.alpha`; empty if the text could not be read at all.
    pub key: String,
    /// The value found, and the values allowed.
    pub message: String,
}

impl ConfigError {
    /// An impossible value: `key`, what was found, what is allowed.
    pub fn value(key: &str, found: impl fmt::Display, allowed: &str) -> Self {
        Self::of(key, format!("found {found}; allowed: {allowed}"))
    }

    /// A key that is not there.
    pub(crate) fn missing(key: &str) -> Self {
        Self::of(key, format!("missing; {EXAMPLE}"))
    }

    fn of(key: &str, message: String) -> Self {
        Self { path: None, line: None, key: key.to_owned(), message }
    }

    /// An impossible number, written with an exponent where it is very small or very large.
    pub(crate) fn number(key: &str, found: f64, allowed: &str) -> Self {
        let plain = found == 0.0 || (1e-4..1e6).contains(&found.abs());
        if plain {
            Self::value(key, found, allowed)
        } else {
            Self::value(key, format_args!("{found:e}"), allowed)
        }
    }

    /// The same error with the line of `toml` at which its key stands, or would stand, and the file's `path`.
    #[must_use]
    pub fn located(mut self, toml: &str, path: Option<&Path>) -> Self {
        self.path = path.map(Path::to_owned);
        // of a key that is not written, the line of what it would stand in
        let mut around =
            std::iter::successors(Some(self.key.as_str()), |key| Some(key.rsplit_once(['.', '['])?.0));
        self.line = self.line.or_else(|| around.find_map(|key| line_of_key(toml, key)));
        self
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.path, self.line) {
            (Some(path), Some(line)) => write!(f, "{}:{line}: ", path.display())?,
            (Some(path), None) => write!(f, "{}: ", path.display())?,
            (None, Some(line)) => write!(f, "line {line}: ")?,
            (None, None) => {}
        }
        if self.key.is_empty() {
            write!(f, "{}", self.message)
        } else {
            write!(f, "{}: {}", self.key, self.message)
        }
    }
}

impl std::error::Error for ConfigError {}

/// The line, from 1, of byte `offset` of `text`.
pub fn line_at(text: &str, offset: usize) -> usize {
    let end = offset.min(text.len()); // integers
    text.as_bytes()[..end].split(|byte| *byte == b'\n').count()
}

/// The line (from 1) of a dotted key such as `chain.impurities[1].mass_kg` in `toml`, if it is there.
pub fn line_of_key(toml: &str, key: &str) -> Option<usize> {
    let document = toml::de::DeTable::parse(toml).ok()?;
    let mut table = Some(document.get_ref());
    let mut found = None;
    for part in key.split('.') {
        let (name, index) = match part.split_once('[') {
            Some((name, rest)) => (name, rest.strip_suffix(']').and_then(|i| i.parse().ok())),
            None => (part, None::<usize>),
        };
        let (_, value) = table?.iter().find(|(k, _)| k.get_ref().as_ref() == name)?;
        let mut value = value;
        if let (Some(index), toml::de::DeValue::Array(array)) = (index, value.get_ref()) {
            value = array.get(index)?;
        }
        found = Some(line_at(toml, value.span().start));
        table = match value.get_ref() {
            toml::de::DeValue::Table(inner) => Some(inner),
            _ => None,
        };
    }
    found
}
