//! The columns of a table that is drawn.

use crate::failure::Failure;
use consumers::statistics::Statistics;
use consumers::table::Cell;
use consumers::table::read::{self, ReadTableError};
use std::path::Path;

/// Prefix of the first column of each result in an ensemble's table.
const MEAN: &str = "mean_";

/// The name of a value that there is not.
pub(super) const NOT_SET: &str = "not set";

/// A table in memory.
#[derive(Debug)]
pub(super) struct Columns(Vec<read::Values>);

/// The different values of a column, in their order, and which of them each row has.
#[derive(Debug)]
pub(super) struct Keys {
    pub(super) known: Vec<String>,
    pub(super) of: Vec<usize>,
}

/// A result: a number for each row, or its statistics as an ensemble's table has them.
#[derive(Debug)]
pub(super) enum Column {
    Numbers(Vec<Option<f64>>),
    Statistics(Vec<Option<Statistics>>, Vec<Members>),
}

/// Points of which a row of an ensemble's table is made.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Members {
    count: u64,
    /// Number of points without a value.
    missing: u64,
}

/// The values of some rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Values {
    /// None if no row has one.
    pub(super) found: Option<Statistics>,
    /// The number of values there should be.
    pub(super) expected: u64,
    /// The number of those that are not there.
    pub(super) missing: u64,
}

impl Columns {
    pub(super) fn read(path: &Path) -> Result<Self, ReadTableError> {
        read::read(path).map(Self)
    }

    pub(super) fn row_count(&self) -> usize {
        self.0.first().map_or(0, |column| column.cells.len())
    }

    /// The names of the columns that were swept, or else, in a table of another origin, of the first.
    pub(super) fn swept(&self) -> Vec<&str> {
        let names = || self.0.iter().map(|column| column.name.as_str());
        let is_sweep = names().next() == Some("index");
        if is_sweep && names().any(is_first_result) {
            return names().skip(1).take_while(|name| !is_first_result(name)).collect();
        }
        // rows over time
        if let Some(time) = names().position(|name| name == "time_s").filter(|_| is_sweep) {
            return names().take(time + 1).skip(1).collect();
        }
        names().filter(|name| *name != "index").take(1).collect()
    }

    /// The names of the results: those that are averaged, of an ensemble.
    pub(super) fn results(&self) -> Vec<&str> {
        let swept = self.swept();
        let names = self.0.iter().map(|column| column.name.as_str());
        let results: Vec<&str> =
            names.filter(|name| *name != "index" && *name != "count" && !swept.contains(name)).collect();
        if self.is_ensemble() {
            return results.iter().filter_map(|name| name.strip_prefix(MEAN)).collect();
        }
        results
    }

    /// True if the rows are statistics.
    pub(super) fn is_ensemble(&self) -> bool {
        self.find("count").is_some() && self.0.iter().any(|column| column.name.starts_with(MEAN))
    }

    fn find(&self, name: &str) -> Option<&read::Values> {
        self.0.iter().find(|column| column.name == name)
    }

    /// The column of this name, as `flag` asks for.
    pub(super) fn check(&self, flag: &str, name: &str) -> Result<String, Failure> {
        let is_known = self.find(name).is_some() || self.find(&format!("{MEAN}{name}")).is_some();
        if is_known {
            return Ok(name.to_owned());
        }
        let known: Vec<&str> = self.swept().into_iter().chain(self.results()).collect();
        Err(bad_input!("{flag} {name}: the table has no such column; it has {}", known.join(", ")))
    }

    /// The numbers of a column.
    pub(super) fn numbers(&self, name: &str) -> Result<Vec<Option<f64>>, Failure> {
        let Some(column) = self.find(name) else {
            return Err(bad_input!("{name}: the table has no such column with one number for each row"));
        };
        if let Some(word) = column.cells.iter().find_map(word) {
            return Err(bad_input!(
                "{name} has words, such as `{word}`; an axis needs numbers: {}",
                self.of_numbers().join(", ")
            ));
        }
        Ok(column.cells.iter().map(number).collect())
    }

    /// The names of the columns without words that have numbers.
    fn of_numbers(&self) -> Vec<&str> {
        let names = self.swept().into_iter().chain(self.results());
        names.filter(|name| self.is_numeric(name)).collect()
    }

    /// True if a column has numbers and no words.
    pub(super) fn is_numeric(&self, name: &str) -> bool {
        let column = self.find(name).or_else(|| self.find(&format!("{MEAN}{name}")));
        column.is_some_and(|column| {
            column.cells.iter().all(|cell| word(cell).is_none())
                && column.cells.iter().any(|cell| number(cell).is_some())
        })
    }

    /// A result, as a number or as its statistics.
    pub(super) fn result(&self, name: &str) -> Result<Column, Failure> {
        if self.find(name).is_some() || self.find(&format!("{MEAN}{name}")).is_none() {
            return self.numbers(name).map(Column::Numbers);
        }
        let of = |what: &str| self.numbers(&format!("{what}{name}"));
        let (mean, error, median) = (of(MEAN)?, of("standard_error_")?, of("median_")?);
        let quantiles = [of("q05_")?, of("q25_")?, of("q75_")?, of("q95_")?];
        let (count, missing) = (self.numbers("count")?, of("missing_")?);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let whole = |numbers: &[Option<f64>], row: usize| numbers[row].unwrap_or(0.0) as u64;
        let members = |row: usize| Members { count: whole(&count, row), missing: whole(&missing, row) };
        let row = |row: usize| {
            let [q05, q25, q75, q95] = &quantiles;
            let Members { count, missing } = members(row);
            Some(Statistics {
                count: count.saturating_sub(missing),
                mean: mean[row]?,
                standard_error: error[row],
                median: median[row]?,
                quantiles: [q05[row]?, q25[row]?, q75[row]?, q95[row]?],
            })
        };
        let rows = || 0..self.row_count();
        Ok(Column::Statistics(rows().map(row).collect(), rows().map(members).collect()))
    }

    /// The different values of a column: numbers by size, words by their letters, and what is empty last.
    pub(super) fn keys(&self, name: &str) -> Result<Keys, Failure> {
        let Some(column) = self.find(name) else {
            return Err(bad_input!("{name}: the table has no such column with one value for each row"));
        };
        let mut known: Vec<&Cell> = column.cells.iter().collect();
        known.sort_by(|a, b| match (number(a), number(b)) {
            (Some(a), Some(b)) => a.total_cmp(&b),
            (Some(_), None) => std::cmp::Ordering::Less,
            (None, Some(_)) => std::cmp::Ordering::Greater,
            (None, None) => word(b).is_some().cmp(&word(a).is_some()).then(word(a).cmp(&word(b))),
        });
        known.dedup_by(|a, b| text(a) == text(b));
        let known: Vec<String> = known.into_iter().map(text).collect();
        let places: std::collections::HashMap<&str, usize> =
            known.iter().enumerate().map(|(place, value)| (value.as_str(), place)).collect();
        let of = column.cells.iter().map(|cell| places.get(text(cell).as_str()).copied().unwrap_or(0));
        Ok(Keys { of: of.collect(), known: known.clone() })
    }
}

impl Column {
    /// The mean of each row.
    pub(super) fn means(&self) -> Vec<Option<f64>> {
        match self {
            Self::Numbers(numbers) => numbers.clone(),
            Self::Statistics(found, _) => found.iter().map(|found| Some((*found)?.mean)).collect(),
        }
    }

    /// The values of these rows; of several ensembles their means.
    pub(super) fn values(&self, rows: &[usize]) -> Values {
        let mean = |row: &usize| match self {
            Self::Numbers(numbers) => numbers[*row],
            Self::Statistics(found, _) => Some(found[*row]?.mean),
        };
        let found = match (self, rows) {
            (Self::Statistics(found, _), [row]) => found[*row],
            _ => Statistics::of(rows.iter().filter_map(mean)),
        };
        let (mut expected, mut missing) = (0, 0);
        for row in rows {
            let members = match self {
                Self::Numbers(numbers) => Members { count: 1, missing: u64::from(numbers[*row].is_none()) },
                Self::Statistics(_, members) => members[*row],
            };
            expected += members.count;
            missing += members.missing;
        }
        Values { found, expected, missing }
    }
}

/// True if the results begin with this column.
fn is_first_result(name: &str) -> bool {
    name == "end" || name == "count"
}

fn number(cell: &Cell) -> Option<f64> {
    match cell {
        Cell::Integer(value) => Some(*value as f64),
        Cell::Double(value) => Some(*value).filter(|value| value.is_finite()),
        Cell::Word(_) | Cell::Empty => None,
    }
}

fn word(cell: &Cell) -> Option<&str> {
    match cell {
        Cell::Word(word) => Some(word),
        _ => None,
    }
}

/// A value as it is named in a legend.
fn text(cell: &Cell) -> String {
    match cell {
        Cell::Integer(value) => value.to_string(),
        Cell::Double(value) if value.abs() >= 1e6 || value.abs() < 1e-4 && *value != 0.0 => {
            format!("{value:e}")
        }
        Cell::Double(value) => value.to_string(),
        Cell::Word(word) => word.clone(),
        Cell::Empty => NOT_SET.to_owned(),
    }
}
