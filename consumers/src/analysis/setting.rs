//! Options of an analysis as data, for any parser of arguments.

use std::str::FromStr;

/// An option of an analysis.
#[derive(Debug)]
pub struct Setting {
    /// Name: the flag's, without its dashes.
    pub name: &'static str,
    /// Effect and default, in one line.
    pub help: &'static str,
    /// Values that it takes.
    pub takes: Takes,
    /// It may be given several times.
    pub is_repeatable: bool,
    /// It must be given, unless one of these is.
    pub required_unless: Option<&'static [&'static str]>,
    /// Settings that it cannot be given with.
    pub excludes: &'static [&'static str],
    /// Setting that it is nothing without.
    pub belongs_to: Option<&'static str>,
}

impl Setting {
    /// An option that is given at most once and needs nothing else.
    pub const fn new(name: &'static str, takes: Takes, help: &'static str) -> Self {
        Self {
            name,
            help,
            takes,
            is_repeatable: false,
            required_unless: None,
            excludes: &[],
            belongs_to: None,
        }
    }

    /// The same, which may be given several times.
    #[must_use]
    pub const fn repeatable(self) -> Self {
        Self { is_repeatable: true, ..self }
    }

    /// The same, which must be given.
    #[must_use]
    pub const fn required(self) -> Self {
        self.required_unless(&[])
    }

    /// The same, which must be given unless one of `others` is.
    #[must_use]
    pub const fn required_unless(self, others: &'static [&'static str]) -> Self {
        Self { required_unless: Some(others), ..self }
    }

    /// The same, which is not allowed beside `others`.
    #[must_use]
    pub const fn excluding(self, others: &'static [&'static str]) -> Self {
        Self { excludes: others, ..self }
    }

    /// The same, which is nothing without `other`.
    #[must_use]
    pub const fn belonging_to(self, other: &'static str) -> Self {
        Self { belongs_to: Some(other), ..self }
    }
}

/// Values that a setting takes.
#[derive(Debug)]
pub enum Takes {
    /// None: it is given or not.
    Nothing,
    /// The number of a thing, such as a bead; the name stands for it in help.
    Whole(&'static str),
    /// A number in this unit (empty if it has none).
    Number {
        /// The unit, in the letters of a column's name: `m_s`.
        unit: &'static str,
        /// Numbers that are allowed.
        range: Allowed,
        /// The number unless one is given; none if that depends on the run.
        default: Option<&'static str>,
    },
    /// One of these words, each with its meaning; the first one unless another is given.
    Word(&'static [(&'static str, &'static str)]),
    /// A text of a form that the function checks; the name stands for it in help.
    Text(&'static str, fn(&str) -> Result<(), String>),
}

/// Numbers that a setting allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Allowed {
    /// Finite ones of 0 or more.
    NotNegative,
    /// Finite ones above 0.
    AboveZero,
}

impl Takes {
    /// A number without default.
    pub const fn number(unit: &'static str, range: Allowed) -> Self {
        Self::Number { unit, range, default: None }
    }

    /// Refuses a value that is none of this kind.
    ///
    /// # Errors
    /// The expected values.
    pub fn check(&self, text: &str) -> Result<(), String> {
        match self {
            Self::Nothing => Err("expected no value".to_owned()),
            Self::Whole(_) => {
                text.parse::<u64>().map(drop).map_err(|_| "expected a whole number, 0 or more".to_owned())
            }
            Self::Number { range, .. } => {
                let number = text.parse::<f64>().map_err(|_| "expected a number, such as 0.5 or 1e-3")?;
                match range {
                    Allowed::NotNegative if number >= 0.0 && number.is_finite() => Ok(()),
                    Allowed::AboveZero if number > 0.0 && number.is_finite() => Ok(()),
                    Allowed::NotNegative => Err("expected a number, 0 or more".to_owned()),
                    Allowed::AboveZero => Err("expected a number above 0".to_owned()),
                }
            }
            Self::Word(words) if words.iter().any(|(word, _)| *word == text) => Ok(()),
            Self::Word(words) => {
                let words: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
                Err(format!("expected {}", words.join(" or ")))
            }
            Self::Text(_, check) => check(text),
        }
    }
}

/// The settings of one analysis, with values that [`Takes::check`] has let through.
#[derive(Debug, Clone, Default)]
pub struct Settings(Vec<(&'static str, Vec<String>)>);

impl Settings {
    /// Sets `setting` to these values.
    ///
    /// # Errors
    /// The wrong value and the expected ones.
    pub fn set(&mut self, setting: &Setting, values: Vec<String>) -> Result<(), (String, String)> {
        for value in &values {
            if !matches!(setting.takes, Takes::Nothing) {
                setting.takes.check(value).map_err(|why| (value.clone(), why))?;
            }
        }
        self.0.push((setting.name, values));
        Ok(())
    }

    /// True if the setting was given.
    pub fn is_set(&self, name: &str) -> bool {
        self.0.iter().any(|(known, _)| *known == name)
    }

    /// The values of a setting, in their order.
    pub fn all<T: FromStr>(&self, name: &str) -> Vec<T> {
        let values = self.0.iter().filter(|(known, _)| *known == name).flat_map(|(_, values)| values);
        values.filter_map(|value| value.parse().ok()).collect()
    }

    /// The only value of a setting, if it was given.
    pub fn one<T: FromStr>(&self, name: &str) -> Option<T> {
        self.all(name).into_iter().next()
    }

    /// True if the setting has this value.
    pub fn says(&self, name: &str, word: &str) -> bool {
        self.0.iter().any(|(known, values)| *known == name && values.iter().any(|value| value == word))
    }
}
