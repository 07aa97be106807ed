//! The table, as it grows.

use crate::display;
use anyhow::Error;
use bench::{Audience, Floor, Group, Row};
use serde::Serialize;
use std::io::IsTerminal as _;

/// Widths of the columns: rows are printed before the others are known.
const WHAT: usize = 46;
const AGAINST: usize = 40;

/// Prints rows when they are there, and remembers them.
#[derive(Serialize)]
pub(super) struct Report {
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
    pub(super) fn new(json: bool, rounds: u32) -> Self {
        Self { json, group: "", rounds, rows: Vec::new() }
    }

    /// Whether every row keeps to its floor.
    pub(super) fn is_met(&self) -> bool {
        self.rows.iter().all(|row| row.met)
    }

    /// Ends the table.
    pub(super) fn finish(&self) -> Result<(), Error> {
        if self.json { display::print_json(&serde_json::to_value(self)?) } else { Ok(()) }
    }
}

impl Audience for Report {
    fn begin(&mut self, group: &Group) -> Result<(), Error> {
        self.group = group.name;
        if self.json {
            display::notice(format_args!("measuring {}", group.name));
            return Ok(());
        }
        let above = if self.rows.is_empty() { "" } else { "\n" };
        display::print(format_args!("{above}{}\n", group.name))
    }

    fn row(&mut self, row: Row) -> Result<(), Error> {
        if !self.json {
            display::print(line(&row))?;
        } else if std::io::stderr().is_terminal() {
            display::notice(row.what);
        }
        self.rows.push(Measured { group: self.group, met: row.is_met(), row });
        Ok(())
    }

    fn notice(&mut self, text: &str) {
        display::notice(text);
    }
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
