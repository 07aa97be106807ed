//! The table of an ensemble: a row for the points that differ in one key alone, such as the seed.

use crate::series::Lines;
use consumers::statistics::{QUANTILES, Statistics};
use consumers::table::{Cell, Column, Kind};
use producer::sweep::{Ensemble, Sweep};
use std::collections::BTreeMap;

/// The column with the number of points that a row is made of.
pub const COUNT_COLUMN: &str = "count";

/// Prefixes of the columns of statistics of each number.
const STATISTICS: [&str; 3 + QUANTILES.len()] =
    ["mean_", "standard_error_", "median_", "q05_", "q25_", "q75_", "q95_"];

/// Most rows whose groups are all in memory, unless one group has more.
const MOST_ROWS: u64 = 100_000;

/// The table of the ensemble of a sweep whose rows have `columns`, made of these rows in their order.
#[derive(Debug)]
pub struct EnsembleTable<'a> {
    ensemble: Ensemble,
    columns: &'a [Column],
    /// Columns of numbers beyond the parameters.
    numbers: Vec<usize>,
    /// The groups that still get rows, which are those of this part of the table.
    part: u64,
    groups: BTreeMap<u64, Group>,
}

/// Values kept of the rows of a group.
#[derive(Debug, Default)]
struct Group {
    shared: Vec<Cell>,
    count: u64,
    /// The present values of each column of numbers.
    numbers: Vec<Vec<f64>>,
}

impl<'a> EnsembleTable<'a> {
    /// Makes one for the rows of `sweep`, if it has an ensemble; `columns` are theirs.
    pub fn new(sweep: &Sweep, columns: &'a [Column]) -> Option<Self> {
        let is_number = |place: &usize| columns[*place].kind != Some(Kind::Word);
        let numbers = (sweep.parameters().len()..columns.len()).filter(is_number).collect();
        Some(Self { ensemble: sweep.ensemble()?, columns, numbers, part: 0, groups: BTreeMap::new() })
    }

    /// True if rows must come group by group, because too many lie between two of one group.
    pub fn is_by_group(&self) -> bool {
        self.ensemble.block() > MOST_ROWS && self.ensemble.block() > self.ensemble.member_count()
    }

    /// The group of the row `index`.
    pub fn group(&self, index: u64) -> u64 {
        self.ensemble.group(index)
    }

    /// The columns: the parameters that the points of a row share, how many they are, and of each result its statistics and how
    /// many points lack it.
    pub fn columns(&self) -> Vec<Column> {
        let shared = self.ensemble.shared.iter().map(|place| self.columns[*place].clone());
        let mut columns: Vec<Column> = shared.collect();
        columns.push(Column::new(COUNT_COLUMN, Kind::Integer));
        for place in &self.numbers {
            let name = &self.columns[*place].name;
            columns.extend(STATISTICS.map(|what| Column::new(format!("{what}{name}"), Kind::Double)));
            columns.push(Column::new(format!("missing_{name}"), Kind::Integer));
        }
        columns
    }

    /// The lines over time of its rows; `lines` are those of the rows that they are made of.
    pub fn lines(&self, lines: &Lines) -> Lines {
        let (shared, cells) = (self.ensemble.shared.len(), STATISTICS.len() + 1);
        let fixed = self.numbers.iter().filter(|place| lines.is_fixed(**place)).count();
        lines.of_statistics(shared, shared + 1 + cells * fixed, cells)
    }

    /// Takes the next row, by index or [by group](Self::is_by_group) and in that by index, and gives the rows of the groups
    /// that have all of theirs. Sums are in the order of the indices.
    pub fn take(&mut self, index: u64, cells: &[Cell]) -> Vec<(u64, Vec<Cell>)> {
        let group = self.group(index);
        let part = if self.is_by_group() { group } else { index / self.ensemble.block() };
        let whole = if part == self.part { Vec::new() } else { self.rest() };
        self.part = part;
        let cell = |place: &usize| cells.get(*place).unwrap_or(&Cell::Empty);
        let shared = || self.ensemble.shared.iter().map(|place| cell(place).clone()).collect();
        let group = self.groups.entry(group).or_insert_with(|| {
            let numbers = vec![Vec::new(); self.numbers.len()];
            Group { shared: shared(), count: 0, numbers }
        });
        group.count += 1;
        for (values, place) in group.numbers.iter_mut().zip(&self.numbers) {
            values.extend(cell(place).number());
        }
        whole
    }

    /// The rows of the groups that were not given yet.
    pub fn rest(&mut self) -> Vec<(u64, Vec<Cell>)> {
        std::mem::take(&mut self.groups).into_iter().map(|(number, group)| (number, group.row())).collect()
    }
}

impl Group {
    fn row(self) -> Vec<Cell> {
        let Self { shared: mut row, count, numbers } = self;
        row.push(Cell::Integer(count));
        for values in numbers {
            let found = Statistics::of(values);
            row.extend(statistics(found.as_ref()));
            row.push(Cell::Integer(count - found.map_or(0, |found| found.count)));
        }
        row
    }
}

fn statistics(found: Option<&Statistics>) -> [Cell; STATISTICS.len()] {
    let Some(Statistics { mean, standard_error, median, quantiles: [q05, q25, q75, q95], .. }) = found else {
        return [const { Cell::Empty }; STATISTICS.len()];
    };
    let (mean, median) = (Some(*mean), Some(*median));
    [mean, *standard_error, median, Some(*q05), Some(*q25), Some(*q75), Some(*q95)].map(Cell::from)
}
