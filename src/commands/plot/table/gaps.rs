//! Rows that a figure cannot show: counted, so that none is dropped in silence.

use super::columns::Values;
use crate::display::{count, counted};
use serde::Serialize;

/// The rows that a figure of one column leaves out.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Gaps {
    /// The column.
    pub(super) column: String,
    /// Rows of the table.
    rows: u64,
    /// Number of rows without a value of the column.
    without_value: u64,
    /// Rows without a number for an axis, and points that a logarithmic axis cannot show.
    off_axes: u64,
    /// Means of fewer values than others, or than there should be.
    of_fewer: u64,
}

impl Gaps {
    pub(super) fn new(column: &str, rows: usize) -> Self {
        Self { column: column.to_owned(), rows: rows as u64, ..Self::default() }
    }

    /// Adds rows that have no value.
    pub(super) fn without_value(&mut self, rows: usize) {
        self.without_value += rows as u64;
    }

    /// Adds rows or points that have no place on the axes.
    pub(super) fn off_axes(&mut self, points: usize) {
        self.off_axes += points as u64;
    }

    /// Tells of each point whether it is of fewer values than there should be, or than another, and counts these.
    pub(super) fn of_fewer(&mut self, points: &[Values]) -> Vec<bool> {
        let most = points.iter().map(|point| point.expected).max().unwrap_or(0); // integers
        let of_fewer = points.iter().map(|point| point.missing > 0 || point.expected < most);
        let of_fewer: Vec<bool> = of_fewer.collect();
        let is_marked = |(point, of_fewer): &(&Values, &bool)| **of_fewer && point.found.is_some();
        self.of_fewer += points.iter().zip(&of_fewer).filter(is_marked).count() as u64;
        of_fewer
    }

    /// The words for what is left out; nothing if nothing is.
    pub(super) fn words(&self) -> Option<String> {
        let mut said = Vec::new();
        if self.without_value > 0 {
            let (without, all) = (count(self.without_value), count(self.rows));
            said.push(format!("{without} of {all} rows have no value"));
        }
        if self.off_axes > 0 {
            said.push(format!("{} without a place on the axes", counted(self.off_axes, "point")));
        }
        if self.of_fewer > 0 {
            let means = counted(self.of_fewer, "mean");
            said.push(format!("{means} of fewer rows than others or than there should be"));
        }
        (!said.is_empty()).then(|| said.join(", "))
    }

    /// The words at the end of a panel's legend.
    pub(super) fn note(&self) -> String {
        if self.without_value == 0 {
            return String::new();
        }
        format!("{} of {} rows have no value", count(self.without_value), count(self.rows))
    }
}
