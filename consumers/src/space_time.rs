//! Space and time as pictures of bounded size.

use std::ops::{Range, RangeInclusive};

/// The part of a run that a picture shows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Extent {
    /// Beads or contacts, at least one.
    pub places: Range<usize>,
    /// Steps.
    pub steps: RangeInclusive<u64>,
}

/// A value of a cell, where a cell stands for several beads and frames.
pub trait Cell: Copy {
    /// The largest number of columns and of rows, so that a figure stays below 1 MB.
    const MOST: usize;
    /// The value that every other outranks.
    const REST: Self;

    /// True if it is shown rather than `other`.
    fn outranks(self, other: Self) -> bool;
}

/// The value that is largest in magnitude, so that no pulse is lost between pixels.
impl Cell for f32 {
    const MOST: usize = 750;
    const REST: Self = 0.0;

    fn outranks(self, other: Self) -> bool {
        self.abs() > other.abs()
    }
}

/// Numbers as cells.
pub fn singles(values: impl IntoIterator<Item = f64>) -> impl Iterator<Item = f32> {
    #[expect(clippy::cast_possible_truncation, reason = "seven digits are enough for a colour")]
    let single = |value| value as f32;
    values.into_iter().map(single)
}

/// A picture of a quantity over beads or contacts (across) and steps (along), of at most
/// [`Cell::MOST`] cells either way.
///
/// Each row shows what the frames in its steps have; a row that no frame falls into shows that of the frame
/// before, since nothing else was seen until the next one. Rows before the first frame, in gaps and after the last
/// frame are empty.
#[derive(Debug, Clone)]
pub struct Picture<T> {
    extent: Extent,
    /// The column of each place.
    column_of: Vec<usize>,
    columns: usize,
    rows: usize,
    cells: Vec<T>,
    /// The row that each row shows.
    shown: Vec<Option<usize>>,
    /// The row of the last frame, unless some were missed since.
    last_row: Option<usize>,
}

impl<T: Cell> Picture<T> {
    /// An empty picture.
    pub fn new(extent: Extent) -> Self {
        let places = extent.places.len();
        let columns = places.clamp(1, T::MOST);
        let steps = extent.steps.end().saturating_sub(*extent.steps.start()).saturating_add(1);
        let rows = usize::try_from(steps).unwrap_or(usize::MAX).clamp(1, T::MOST);
        Self {
            column_of: (0..places).map(|place| place * columns / places).collect(),
            columns,
            rows,
            cells: vec![T::REST; columns * rows],
            shown: vec![None; rows],
            last_row: None,
            extent,
        }
    }

    /// Enters the values of all places of the chain at `step`; steps outside of the picture are passed over.
    pub fn push(&mut self, step: u64, values: impl IntoIterator<Item = T>) {
        self.push_from(0, step, values);
    }

    /// The same of places from `first` on: the value of all others is [`Cell::REST`].
    pub fn push_from(&mut self, first: usize, step: u64, values: impl IntoIterator<Item = T>) {
        if !self.extent.steps.contains(&step) {
            return;
        }
        let row = self.row_of(step);
        if let Some(last) = self.last_row {
            self.shown[last..row].fill(Some(last));
        }
        self.shown[row] = Some(row);
        self.last_row = Some(row);
        let cells = &mut self.cells[row * self.columns..(row + 1) * self.columns];
        let start = self.extent.places.start;
        let within = values.into_iter().skip(start.saturating_sub(first));
        for (value, column) in within.zip(self.column_of.iter().skip(first.saturating_sub(start))) {
            if value.outranks(cells[*column]) {
                cells[*column] = value;
            }
        }
    }

    /// Frames are missing before the next one.
    pub fn gap(&mut self) {
        self.last_row = None;
    }

    fn row_of(&self, step: u64) -> usize {
        let (first, last) = (*self.extent.steps.start(), *self.extent.steps.end());
        let steps = u128::from(last - first) + 1;
        let row = u128::from(step - first) * self.rows as u128 / steps;
        usize::try_from(row).map_or(self.rows - 1, |row| row.min(self.rows - 1))
    }

    /// The part of the run.
    pub fn extent(&self) -> &Extent {
        &self.extent
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The values, row by row, the earliest row first; none where unknown.
    pub fn cells(&self) -> impl Iterator<Item = Option<T>> {
        self.shown.iter().flat_map(move |shown| {
            let columns = 0..self.columns;
            columns.map(move |column| shown.map(|row| self.cells[row * self.columns + column]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(picture: &Picture<f32>) -> Vec<Option<f32>> {
        picture.cells().collect()
    }

    #[test]
    fn the_largest_value_of_a_cell_is_shown() {
        let extent = Extent { places: 0..2500, steps: 0..=5000 };
        let mut picture = Picture::<f32>::new(extent);
        let mut values = vec![0.0; 2500];
        (values[1234], values[1235]) = (-2.0, 1.0);
        picture.push(0, values.clone());
        picture.push(5000, values);
        assert_eq!((picture.columns(), picture.rows()), (750, 750));
        let found = cells(&picture);
        let filled: Vec<usize> = (0..found.len()).filter(|cell| found[*cell] == Some(-2.0)).collect();
        // the first frame is shown until there is another
        assert_eq!(filled.len(), 750);
        assert!(filled.iter().all(|cell| cell % 750 == 370));
    }

    #[test]
    fn a_part_of_a_run_is_all_of_its_picture() {
        let mut picture = Picture::new(Extent { places: 1..3, steps: 10..=12 });
        for step in 9..14_u16 {
            picture.push(step.into(), [0.5, f32::from(step), 1.0, 7.0]);
        }
        let rows = [10.0, 1.0, 11.0, 1.0, 12.0, 1.0].map(Some);
        assert_eq!(cells(&picture), rows);
    }

    #[test]
    fn what_was_missed_and_what_never_came_stays_empty() {
        let mut picture = Picture::new(Extent { places: 0..1, steps: 0..=9 });
        for step in [2, 4, 7] {
            if step == 7 {
                picture.gap();
            }
            picture.push(step, [1.0]);
        }
        let known: Vec<bool> = cells(&picture).iter().map(Option::is_some).collect();
        assert_eq!(known, [false, false, true, true, true, false, false, true, false, false]);
    }
}
