//! The space–time map of a run from when it was first seen until now, in memory of fixed size.

use consumers::space_time::{Cell, singles};

/// Most columns: more than a screen has.
const COLUMNS: usize = 512;
/// Most rows; when they are used up, they are merged in pairs.
const ROWS: usize = 256;

/// Rows of equal numbers of steps; of a cell that stands for several beads or steps, the value farthest from 0.
#[derive(Debug, Clone)]
pub(crate) struct Strip {
    places: usize,
    columns: usize,
    cells: Vec<f32>,
    first_step: u64,
    steps_per_row: u64,
}

impl Strip {
    /// Makes one for a field of so many values.
    pub(crate) fn new(places: usize) -> Self {
        Self { places, columns: places.min(COLUMNS), cells: Vec::new(), first_step: 0, steps_per_row: 1 }
    }

    fn rows(&self) -> usize {
        self.cells.len() / self.columns.max(1)
    }

    /// Enters the values at `step`. Steps that were not seen before it look like the last one that was.
    pub(crate) fn push(&mut self, step: u64, values: &[f64]) {
        if self.rows() == 0 {
            self.first_step = step;
        }
        let Some(since) = step.checked_sub(self.first_step).filter(|_| self.columns > 0) else { return };
        while since / self.steps_per_row >= ROWS as u64 {
            self.merge_pairs();
        }
        let row = usize::try_from(since / self.steps_per_row).unwrap_or(ROWS - 1);
        let old = row < self.rows();
        while self.rows() <= row {
            let last = self.cells.len().saturating_sub(self.columns);
            let copy = self.cells[last..].to_vec();
            self.cells.extend(if copy.is_empty() { vec![0.0; self.columns] } else { copy });
        }
        let cells = &mut self.cells[row * self.columns..(row + 1) * self.columns];
        if !old {
            cells.fill(0.0);
        }
        for (place, value) in singles(values.iter().copied()).take(self.places).enumerate() {
            let cell = &mut cells[place * self.columns / self.places];
            *cell = farther(*cell, value);
        }
    }

    fn merge_pairs(&mut self) {
        let pairs = self.cells.chunks(2 * self.columns);
        self.cells = pairs
            .flat_map(|pair| {
                let (one, other) = pair.split_at(self.columns);
                let other = if other.is_empty() { one } else { other };
                one.iter().zip(other).map(|(one, other)| farther(*one, *other)).collect::<Vec<_>>()
            })
            .collect();
        self.steps_per_row *= 2;
    }

    /// The steps at its upper and lower edge.
    pub(crate) fn steps(&self) -> (u64, u64) {
        (self.first_step, self.first_step + self.rows() as u64 * self.steps_per_row)
    }

    /// The least and the largest value, and 0.
    pub(crate) fn range(&self) -> [f64; 2] {
        let range = self.cells.iter().fold([0.0_f32; 2], |[low, high], value| {
            [if *value < low { *value } else { low }, if *value > high { *value } else { high }]
        });
        range.map(f64::from)
    }

    /// Fits the strip into so many columns and at most so many rows: a row is never shown twice.
    pub(crate) fn fitted(&self, columns: usize, rows: usize) -> Vec<Vec<f64>> {
        let rows = rows.min(self.rows());
        let row = |row: usize| {
            let of = part(row, rows, self.rows());
            let column = |column: usize| {
                let across = part(column, columns, self.columns);
                let cells = of.clone().flat_map(|row| &self.cells[row * self.columns..][across.clone()]);
                f64::from(cells.fold(0.0, |most, cell| farther(most, *cell)))
            };
            (0..columns).map(column).collect()
        };
        (0..rows).map(row).collect()
    }
}

/// The part of `of` things that falls to the `index`-th of `parts`: at least one.
pub(crate) fn part(index: usize, parts: usize, of: usize) -> std::ops::Range<usize> {
    let from = index * of / parts;
    from..((index + 1) * of / parts).max(from + 1)
}

fn farther(one: f32, other: f32) -> f32 {
    if other.outranks(one) { other } else { one }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pulse_never_disappears_however_long_the_run() {
        let mut strip = Strip::new(5000);
        let mut values = vec![0.0; 5000];
        strip.push(7, &values);
        values[1234] = -2.0;
        strip.push(10, &values);
        values[1234] = 0.0;
        strip.push(11, &values);
        for step in (1000..3_000_000).step_by(777) {
            strip.push(step, &values);
        }
        let fitted = strip.fitted(80, 10);
        assert_eq!((fitted.len(), fitted[0].len()), (10, 80));
        let places = |value: f64| {
            let cells = fitted.iter().flatten().enumerate();
            cells.filter(move |(_, cell)| **cell == value).map(|(place, _)| place).collect::<Vec<_>>()
        };
        assert_eq!(places(-2.0), [1234 * 80 / 5000]);
        assert_eq!(strip.range(), [-2.0, 0.0]);
        let (first, end) = strip.steps();
        assert!(first == 7 && end > 2_999_000 && end < 3_020_000, "{end}");
    }

    #[test]
    fn what_was_not_seen_looks_like_what_was_seen_last() {
        let mut strip = Strip::new(1);
        for step in [0, 3] {
            strip.push(step, &[1.0 + step as f64]);
        }
        assert_eq!(strip.fitted(1, 9), [[1.0], [1.0], [1.0], [4.0]]);
        strip.push(2, &[9.0]);
        assert_eq!(strip.fitted(2, 1), [[9.0, 9.0]]);
    }
}
