//! Results of a command: rows for people, the outcome itself for programs.

use crate::display;
use anyhow::Error;
pub(crate) use consumers::analysis::Words as Rows;
use serde::Serialize;

/// Prints an outcome as JSON, with its keys in alphabetical order, or in words.
pub(crate) fn report(
    as_json: bool,
    outcome: &impl Serialize,
    words: impl FnOnce() -> String,
) -> Result<(), Error> {
    if as_json { display::print_json(&serde_json::to_value(outcome)?) } else { display::print(words()) }
}
