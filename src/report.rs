//! Results of a command: rows for people, the outcome itself for programs.

use crate::display::{self, count};
use anyhow::Error;
use consumers::analysis::Words;
use schemas::text::shown;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt::Display;
use std::time::Duration;

/// Prints an outcome as JSON, with its keys in alphabetical order, or in words.
pub(crate) fn report(
    as_json: bool,
    outcome: &impl Serialize,
    words: impl FnOnce() -> String,
) -> Result<(), Error> {
    if as_json { display::print_json(&serde_json::to_value(outcome)?) } else { display::print(words()) }
}

/// Rows of a name and a value.
#[derive(Debug, Default)]
pub(crate) struct Rows(Vec<(Cow<'static, str>, String)>);

impl From<Words> for Rows {
    fn from(words: Words) -> Self {
        Self(words.lines())
    }
}

impl Rows {
    pub(crate) fn add(&mut self, name: impl Into<Cow<'static, str>>, value: impl Display) {
        // a value may be a text of a file
        self.0.push((name.into(), shown(&value.to_string()).into_owned()));
    }

    /// A row for each value, all of the same name.
    pub(crate) fn each(&mut self, name: &'static str, values: impl IntoIterator<Item: Display>) {
        values.into_iter().for_each(|value| self.add(name, value));
    }

    /// A row that says how many of `all` are not shown, if any.
    pub(crate) fn more(&mut self, name: &'static str, all: u64, shown: usize, of: &str) {
        let more = all.saturating_sub(shown as u64);
        if more > 0 {
            self.add(name, format_args!("and {} more{of}", count(more)));
        }
    }

    /// Adds rows about pauses of a publisher and about dropped consumers, if there were any.
    pub(crate) fn pauses(&mut self, paused: Duration, dropped_count: u64) {
        if paused > Duration::ZERO {
            self.add("paused", display::duration(paused));
        }
        if dropped_count > 0 {
            self.add("consumers dropped", format_args!("{dropped_count} that took nothing for too long"));
        }
    }

    pub(crate) fn append(&mut self, mut others: Self) {
        self.0.append(&mut others.0);
    }

    /// The rows, aligned under a title.
    pub(crate) fn under(&self, title: impl Display) -> String {
        display::rows(&title.to_string(), &self.0)
    }
}
