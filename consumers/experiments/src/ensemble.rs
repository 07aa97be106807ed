//! The table of an ensemble: a row for the points that differ in one key alone, such as the seed.

use consumers::statistics::{QUANTILES, Statistics};
use consumers::table::{Cell, Column, Kind};
use producer::sweep::{Ensemble, Sweep};
use std::collections::BTreeMap;

/// The column of how many points a row is made of.
pub const COUNT_COLUMN: &str = "count";

/// What is said of each number, before the name of its column.
const STATISTICS: [&str; 3 + QUANTILES.len()] =
    ["mean_", "standard_error_", "median_", "q05_", "q25_", "q75_", "q95_"];

/// The table of the ensemble of a sweep whose rows have `columns`.
#[derive(Debug)]
pub struct EnsembleTable<'a> {
    ensemble: Ensemble,
    columns: &'a [Column],
    /// Columns of numbers beyond the parameters.
    numbers: Vec<usize>,
}

impl<'a> EnsembleTable<'a> {
    /// For the rows of `sweep`, if it has an ensemble; `columns` are theirs.
    pub fn new(sweep: &Sweep, columns: &'a [Column]) -> Option<Self> {
        let is_number = |place: &usize| columns[*place].kind != Some(Kind::Word);
        let numbers = (sweep.parameters().len()..columns.len()).filter(is_number).collect();
        Some(Self { ensemble: sweep.ensemble()?, columns, numbers })
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

    /// A row for each group that `rows`, by index, have points of. Sums are in the order of the indices.
    pub fn rows<'r>(&self, rows: impl Iterator<Item = (u64, &'r [Cell])>) -> BTreeMap<u64, Vec<Cell>> {
        let mut groups: BTreeMap<u64, Vec<&[Cell]>> = BTreeMap::new();
        for (index, cells) in rows {
            groups.entry(self.ensemble.group(index)).or_default().push(cells);
        }
        groups.into_iter().map(|(group, members)| (group, self.row(&members))).collect()
    }

    fn row(&self, members: &[&[Cell]]) -> Vec<Cell> {
        let cell = |member: &[Cell], place: usize| member.get(place).cloned().unwrap_or(Cell::Empty);
        let mut row: Vec<Cell> = match members.first() {
            Some(first) => self.ensemble.shared.iter().map(|place| cell(first, *place)).collect(),
            None => Vec::new(),
        };
        let count = members.len() as u64;
        row.push(Cell::Integer(count));
        for place in &self.numbers {
            let found = Statistics::of(members.iter().filter_map(|member| number(member.get(*place)?)));
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
    let error = standard_error.map_or(Cell::Empty, Cell::Double);
    let [mean, median, q05, q25, q75, q95] =
        [mean, median, q05, q25, q75, q95].map(|value| Cell::Double(*value));
    [mean, error, median, q05, q25, q75, q95]
}

fn number(cell: &Cell) -> Option<f64> {
    match cell {
        Cell::Integer(value) => Some(*value as f64),
        Cell::Double(value) => Some(*value),
        Cell::Word(_) | Cell::Empty => None,
    }
}
