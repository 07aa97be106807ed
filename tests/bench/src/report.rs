//! The table, as it grows.

use crate::{Floor, Group, Row};
use anyhow::{Context as _, Error};
use serde::Serialize;
use std::fmt::Display;
use std::io::{self, IsTerminal as _, Write as _};

/// Widths of the columns: rows are printed before the others are known.
const WHAT: usize = 46;
const AGAINST: usize = 40;

/// Prints rows when they are there, and remembers them.
#[derive(Serialize)]
pub(crate) struct Report {
    #[serde(skip)]
    json: bool,
    #[serde(skip)]
    group: &'static str,
    rounds: u32,
    rows: Vec<Measured>,
}

#[derive(Debug, Serialize)]
struct Measured {
    group: &'static str,
    #[serde(flatten)]
    row: Row,
    met: bool,
}

impl Report {
    /// An empty table; as JSON it is printed at its end only.
    pub(crate) fn new(json: bool, rounds: u32) -> Self {
        Self { json, group: "", rounds, rows: Vec::new() }
    }

    /// True if every row keeps to its floor.
    pub(crate) fn is_met(&self) -> bool {
        self.rows.iter().all(|row| row.met)
    }

    /// Ends the table.
    pub(crate) fn finish(&self) -> Result<(), Error> {
        if self.json { print(format_args!("{}\n", serde_json::to_string_pretty(self)?)) } else { Ok(()) }
    }

    /// Begins the rows of `group`.
    pub(crate) fn begin(&mut self, group: &Group) -> Result<(), Error> {
        self.group = group.name;
        if self.json {
            notice(&format!("measuring {}", group.name));
            return Ok(());
        }
        let above = if self.rows.is_empty() { "" } else { "\n" };
        print(format_args!("{above}{}\n", group.name))
    }

    /// Takes a finished row.
    pub(crate) fn row(&mut self, row: Row) -> Result<(), Error> {
        if !self.json {
            print(line(&row))?;
        } else if std::io::stderr().is_terminal() {
            notice(row.what);
        }
        self.rows.push(Measured { group: self.group, met: row.is_met(), row });
        Ok(())
    }
}

/// Prints on stdout, at once.
pub(crate) fn print(text: impl Display) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    write!(out, "{text}").and_then(|()| out.flush()).context("results cannot be printed on stdout")
}

/// Prints something to know beside the rows on stderr.
pub(crate) fn notice(text: &str) {
    // a closed stderr is no reason to fail
    let _ = writeln!(io::stderr(), "beadline-bench: {text}");
}

fn line(row: &Row) -> String {
    let mark = if row.is_met() { "met" } else { "NOT met" };
    let (floor, mark) = match row.floor {
        Floor::AtLeast(floor) => (format!("≥ {floor}"), mark),
        Floor::AtMost(floor) => (format!("≤ {floor}"), mark),
        Floor::Any => (String::new(), ""),
    };
    let [median, least, most] = [row.ratio.median, row.ratio.least, row.ratio.most].map(short);
    let spread = format!("({least} to {most})");
    format!(
        "  {:WHAT$}  {:AGAINST$}  {median:>6} {spread:16} {floor:7} {mark:8} {}\n",
        row.what, row.against, row.figure
    )
}

/// Two decimals, or more where they would all be 0.
fn short(ratio: f64) -> String {
    if ratio.abs() < 0.05 { format!("{ratio:.4}") } else { format!("{ratio:.2}") }
}
