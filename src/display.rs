//! Output for people: progress bars, notices, results.

use crate::limits;
use anyhow::{Context as _, Error, anyhow};
use bus::Bus;
use indicatif::{ProgressBar, ProgressStyle};
pub(crate) use schemas::amounts::{
    bytes, count, counted, duration, left, number, per_second, quantity, range, seconds, typed,
};
use schemas::frame::EndReason;
use schemas::manifest::{RunManifest, SCHEMA_VERSION};
use schemas::text::shown;
use serde::Serialize;
use std::fmt::{Display, Write as _};
use std::io::{self, Write as _};
use std::path::PathBuf;
use terminal_size::{Width, terminal_size_of};

/// Prints a notice or a warning on stderr, formatted as by `format!`.
macro_rules! notice {
    ($($text:tt)*) => { $crate::display::notice(format_args!($($text)*)) };
}

/// Prints a notice or a warning on stderr.
pub(crate) fn notice(text: impl Display) {
    // a URL that was typed may hold a password; a closed stderr is no reason to fail
    let text = storage::masked(&text.to_string());
    let _ = writeln!(io::stderr(), "beadline: {}", printable(&shown(&text)));
}

/// A text without characters that a terminal obeys: names come from files, and files from other people.
pub(crate) fn printable(text: &str) -> String {
    let mut printable = String::with_capacity(text.len());
    for character in text.chars() {
        if is_obeyed(character) && !matches!(character, '\n' | '\t') {
            printable.extend(character.escape_default());
        } else {
            printable.push(character);
        }
    }
    printable
}

/// True if a terminal obeys a character instead of showing it: controls, also those of 8 bits, and characters that
/// change the direction of writing or are invisible.
fn is_obeyed(character: char) -> bool {
    let turns = matches!(character, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}');
    character.is_control() || turns || matches!(character, '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// The same for JSON, in which such characters stand in texts only.
fn printable_json(json: &str) -> String {
    let mut printable = String::with_capacity(json.len());
    for character in json.chars() {
        if is_obeyed(character) && character != '\n' {
            // all of them are in the first 65,536; writing to a String cannot fail
            let _ = write!(printable, "\\u{:04x}", u32::from(character));
        } else {
            printable.push(character);
        }
    }
    printable
}

/// Prints a line of JSON on stderr.
pub(crate) fn tell_json(line: &str) {
    // as above
    let _ = writeln!(io::stderr(), "{}", printable_json(&storage::masked(line)));
}

/// Prints a notice if a later version than this program's wrote the manifest.
pub(crate) fn notice_of_version(manifest: &RunManifest) {
    if manifest.is_newer_minor() {
        let found = manifest.schema_version;
        notice(format_args!(
            "schema version {found} is newer than {SCHEMA_VERSION}: what was added is not shown"
        ));
    }
}

/// Prints a notice about things that were removed on the bus because they were in the way.
pub(crate) fn notice_of_bus(bus: &Bus) {
    if let Some(found) = bus.take_notice() {
        notice(found);
    }
}

/// Prints results on stdout.
pub(crate) fn print(text: impl Display) -> Result<(), Error> {
    put(&printable(&text.to_string()))
}

/// Prints results on stdout for a program.
pub(crate) fn print_json(value: &impl Serialize) -> Result<(), Error> {
    put(&printable_json(&format!("{}\n", serde_json::to_string_pretty(value)?)))
}

/// Paths as JSON has them, whose texts are UTF-8.
pub(crate) fn texts_of(paths: &[PathBuf]) -> Vec<String> {
    paths.iter().map(|path| path.display().to_string()).collect()
}

fn put(text: &str) -> Result<(), Error> {
    if limits::stdout_was_closed() {
        return Err(anyhow!("cannot print results: stdout is closed"));
    }
    let mut out = io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written.context("results cannot be printed on stdout")
}

/// A progress bar over `length` units, on a terminal only.
pub(crate) fn progress_bar(length: u64, label: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    let columns = columns();
    bar.set_style(style(&bar_template(columns)));
    bar.set_prefix(shortened(label, columns / 3));
    bar
}

/// Adds a line under the bar, with as many of `parts` as the terminal has room for.
pub(crate) fn add_line(bar: &ProgressBar, parts: &[&str]) {
    let columns = columns();
    let line = fitting(parts, columns.saturating_sub(3));
    bar.set_style(style(&format!("{}\n  {line}", bar_template(columns))));
}

/// Shows `parts` behind the bar, as many of the first ones as the terminal has room for.
pub(crate) fn tell(bar: &ProgressBar, parts: &[&str]) {
    let columns = columns();
    let taken = bar.prefix().chars().count() + bar_width(columns) + PERCENT_WIDTH;
    bar.set_message(fitting(parts, columns.saturating_sub(taken)));
}

/// Columns that `bar_template` takes beside the bar: three spaces, the number, its sign, and the terminal's last column.
const PERCENT_WIDTH: usize = 9;

fn bar_template(columns: usize) -> String {
    format!("{{prefix}} {{bar:{}}} {{percent:>3}} % {{wide_msg}}", bar_width(columns))
}

fn bar_width(columns: usize) -> usize {
    if columns < 100 { 10 } else { 20 }
}

/// Columns of the terminal on stderr.
fn columns() -> usize {
    terminal_size_of(io::stderr()).map_or(80, |(Width(columns), _)| columns.into())
}

/// Columns of the terminal on stdout; unbounded if it is not one, or does not say.
pub(crate) fn columns_of_stdout() -> usize {
    terminal_size_of(io::stdout()).map_or(usize::MAX, |(Width(columns), _)| columns.into())
}

/// `parts` that are not empty, in one line.
pub(crate) fn joined(parts: &[&str]) -> String {
    fitting(parts, usize::MAX)
}

/// `parts` that are not empty, as many of the first ones as fit.
fn fitting(parts: &[&str], columns: usize) -> String {
    const BETWEEN: &str = " · ";
    let mut line = String::new();
    for part in parts.iter().filter(|part| !part.is_empty()) {
        let joined = if line.is_empty() { (*part).to_owned() } else { format!("{line}{BETWEEN}{part}") };
        if joined.chars().count() > columns {
            break;
        }
        line = joined;
    }
    line
}

/// A text of at most `columns` characters; the end is cut off where it is longer.
fn shortened(text: &str, columns: usize) -> String {
    if text.chars().count() <= columns {
        return text.to_owned();
    }
    text.chars().take(columns.saturating_sub(1)).chain(['…']).collect()
}

fn style(template: &str) -> ProgressStyle {
    let style = ProgressStyle::with_template(template);
    style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("━╸ ")
}

/// Reason why there are no more frames; `until_s` is the time (s) at which the user let them end, if that is the reason.
pub(crate) fn end(reason: EndReason, until_s: Option<f64>) -> String {
    until_s.map_or_else(|| reason.to_string(), |until_s| format!("until {until_s} s, as asked"))
}

/// The same in one word, for programs.
pub(crate) fn end_word(reason: EndReason, as_asked: bool) -> &'static str {
    if as_asked { "as asked" } else { reason.as_str() }
}

/// Things that came, of the first to the last of some frames, and the number of those that did not.
pub(crate) fn received(found: impl Display, frames: Option<(u64, u64)>, missed_count: u64) -> String {
    let range = frames.map(|(first, last)| format!(" ({} to {})", count(first), count(last)));
    format!("{found}{}, {} missed", range.unwrap_or_default(), count(missed_count))
}

/// A line of the names of columns, and one for each row, in as many of the columns as have room.
pub(crate) fn aligned<const N: usize>(
    columns: [(&str, u32); N],
    rows: Vec<[String; N]>,
    columns_of_terminal: usize,
) -> Vec<String> {
    let header = columns.map(|(name, _)| name.to_owned());
    let rows: Vec<_> = std::iter::once(header).chain(rows).collect();
    let widths: [usize; N] =
        std::array::from_fn(|column| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0));
    let total = |most: u32| -> usize {
        widths.iter().zip(columns).filter(|(_, (_, rank))| *rank <= most).map(|(width, _)| width + 2).sum()
    };
    let most = (0..=3).rev().find(|most| total(*most) - 2 <= columns_of_terminal).unwrap_or(0);
    let line = |row: &[String; N]| {
        let shown = (0..N).filter(|column| columns[*column].1 <= most);
        let cells: Vec<_> = shown.map(|column| format!("{:1$}", row[column], widths[column])).collect();
        format!("{}\n", cells.join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_escaped() {
        let text = "a\u{202e}b\u{9b}c\u{7f}d\u{1b}e\nα ±";
        assert_eq!(printable(text), "a\\u{202e}b\\u{9b}c\\u{7f}d\\u{1b}e\nα ±");
        let json = printable_json(&serde_json::json!(text).to_string());
        assert_eq!(json, "\"a\\u202eb\\u009bc\\u007fd\\u001be\\nα ±\"");
        assert_eq!(serde_json::from_str::<String>(&json).ok().as_deref(), Some(text));
    }

    #[test]
    fn what_does_not_fit_is_left_out_and_never_cut() {
        let parts = ["step 1,234", "", "t = 1.23 ms", "2 consumers"];
        assert_eq!(joined(&parts), "step 1,234 · t = 1.23 ms · 2 consumers");
        for (columns, expected) in
            [(37, "step 1,234 · t = 1.23 ms"), (24, "step 1,234 · t = 1.23 ms"), (23, "step 1,234"), (3, "")]
        {
            assert_eq!(fitting(&parts, columns), expected);
        }
        assert_eq!((shortened("abcdef", 6), shortened("abcdef", 4)), ("abcdef".into(), "abc…".into()));
    }
}
