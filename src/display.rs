//! What a person sees: progress bars, notices, numbers.

use crate::failure::Failure;
use crate::limits;
use anyhow::{Context as _, anyhow};
use indicatif::{DecimalBytes, HumanCount, ProgressBar, ProgressStyle};
use schemas::frame::EndReason;
use schemas::manifest::{RunManifest, SCHEMA_VERSION};
use serde::Serialize;
use std::fmt::{Display, Write as _};
use std::io::{self, Write as _};
use std::time::Duration;

/// Prints a notice or a warning on stderr.
pub(crate) fn notice(text: impl Display) {
    // nobody may be listening, and that is no reason to fail
    let _ = writeln!(io::stderr(), "beadline: {}", printable(&text.to_string()));
}

/// A text without what a terminal would obey: names come out of files, and files from other people.
fn printable(text: &str) -> String {
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

/// Whether a terminal does something else with a character than show it: controls, also those of 8 bits, and what
/// turns the direction of writing or shows nothing.
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

/// Prints a value as one line of JSON on stderr.
pub(crate) fn tell_json(value: &serde_json::Value) {
    // nobody may be listening, and that is no reason to fail
    let _ = writeln!(io::stderr(), "{}", printable_json(&value.to_string()));
}

/// Says so if a manifest was written by a later version than this program's.
pub(crate) fn notice_of_version(manifest: &RunManifest) {
    if manifest.is_newer_minor() {
        let found = manifest.schema_version;
        notice(format_args!(
            "schema version {found} is newer than {SCHEMA_VERSION}: what was added is not shown"
        ));
    }
}

/// Prints results on stdout.
pub(crate) fn print(text: impl Display) -> Result<(), Failure> {
    put(&printable(&text.to_string()))
}

/// Prints results on stdout for a program.
pub(crate) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    put(&printable_json(&format!("{}\n", serde_json::to_string_pretty(value)?)))
}

fn put(text: &str) -> Result<(), Failure> {
    if limits::stdout_was_closed() {
        return Err(Failure::Failed(anyhow!("results cannot be printed: stdout is closed")));
    }
    let mut out = io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    Ok(written.context("results cannot be printed on stdout")?)
}

/// A progress bar over `length` units, on a terminal only.
pub(crate) fn progress_bar(length: u64, label: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    bar.set_style(style("{prefix} {bar:20} {percent:>3} % {wide_msg}"));
    bar.set_prefix(label.to_owned());
    bar
}

/// The style of a progress bar with a line of `text` below.
pub(crate) fn with_second_line(text: &str) -> ProgressStyle {
    style(&format!("{{prefix}} {{bar:20}} {{percent:>3}} % {{wide_msg}}\n  {text}"))
}

fn style(template: &str) -> ProgressStyle {
    let style = ProgressStyle::with_template(template);
    style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("━╸ ")
}

/// Why there are no more frames; `until_s` is the time (s) up to which they were asked for, if that is why.
pub(crate) fn end(reason: EndReason, until_s: Option<f64>) -> String {
    until_s.map_or_else(|| reason.to_string(), |until_s| format!("until {until_s} s, as asked"))
}

/// The same in one word, for programs.
pub(crate) fn end_word(reason: EndReason, as_asked: bool) -> &'static str {
    if as_asked { "as asked" } else { reason.as_str() }
}

/// `1,234,567`
pub(crate) fn count(value: u64) -> HumanCount {
    HumanCount(value)
}

/// `1 frame`, `1,234 frames`
pub(crate) fn counted(value: u64, one: &str) -> String {
    let ending = if value == 1 { "" } else { "s" };
    format!("{} {one}{ending}", count(value))
}

/// `139.2 MB`
pub(crate) fn bytes(value: u64) -> DecimalBytes {
    DecimalBytes(value)
}

/// Seconds with three digits and a fitting unit.
pub(crate) fn seconds(value: f64) -> String {
    let (scaled, unit) = match value.abs() {
        0.0 => return "0 s".to_owned(),
        v if v >= 1.0 => (value, "s"),
        v if v >= 1e-3 => (value * 1e3, "ms"),
        v if v >= 1e-6 => (value * 1e6, "µs"),
        v if v >= 1e-9 => (value * 1e9, "ns"),
        _ => return format!("{value:.2e} s"),
    };
    let decimals = if scaled.abs() >= 100.0 {
        0
    } else if scaled.abs() >= 10.0 {
        1
    } else {
        2
    };
    format!("{scaled:.decimals$} {unit}")
}

/// A duration like [`seconds`].
pub(crate) fn duration(value: Duration) -> String {
    seconds(value.as_secs_f64())
}

/// A rough time: `40 s`, `3 min 20 s`, `2 h 5 min`.
pub(crate) fn left(seconds: f64) -> String {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let seconds = seconds.ceil() as u64;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

/// Rows of a name and a value, aligned.
pub(crate) fn rows(title: &str, rows: &[(&str, String)]) -> String {
    let width = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    let mut text = format!("{title}\n");
    for (name, value) in rows {
        // writing to a String cannot fail
        let _ = writeln!(text, "  {name:width$}  {value}");
    }
    text
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
}
