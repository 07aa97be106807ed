//! Equations with few diagonals, solved by elimination with exchange of rows.

use nalgebra::DVector;

/// The factors of a matrix whose numbers lie at most `width` off the diagonal.
pub(super) struct Band {
    width: usize,
    /// Row by row, each from `width` before the diagonal to twice as far behind it.
    numbers: Vec<f64>,
    /// The row that takes the place of each.
    pivots: Vec<usize>,
}

impl Band {
    /// The factors of a matrix of so many rows, from its numbers with their rows and columns.
    pub(super) fn of(size: usize, numbers: &[(usize, usize, f64)]) -> Self {
        let width = numbers.iter().map(|(row, column, _)| row.abs_diff(*column)).max().unwrap_or(0);
        let mut band = Self { width, numbers: vec![0.0; size * (3 * width + 1)], pivots: Vec::new() };
        for (row, column, x) in numbers {
            let place = band.place(*row, *column);
            band.numbers[place] += x;
        }
        (0..size).for_each(|row| band.eliminate(row, size));
        band
    }

    /// Bytes of such a matrix.
    pub(super) fn bytes(size: usize, width: usize) -> usize {
        8 * size * (3 * width + 1)
    }

    fn place(&self, row: usize, column: usize) -> usize {
        row * (3 * self.width + 1) + column + self.width - row
    }

    /// Makes the numbers below the diagonal nothing in a column; those by which its row was multiplied take their place.
    fn eliminate(&mut self, row: usize, size: usize) {
        let (last, count) = (size.min(row + self.width + 1), size.min(row + 2 * self.width + 1) - row);
        let at = |other: usize| self.numbers[self.place(other, row)].abs();
        let pivot = (row..last).max_by(|a, b| at(*a).total_cmp(&at(*b))).unwrap_or(row);
        self.pivots.push(pivot);
        let here = self.place(row, row);
        if pivot != row {
            let there = self.place(pivot, row);
            let (upper, lower) = self.numbers.split_at_mut(there);
            upper[here..here + count].swap_with_slice(&mut lower[..count]);
        }
        if self.numbers[here] == 0.0 {
            self.numbers[here] = f64::EPSILON;
        }
        for other in row + 1..last {
            let there = self.place(other, row);
            let (upper, lower) = self.numbers.split_at_mut(there);
            let (upper, lower) = (&upper[here..here + count], &mut lower[..count]);
            let factor = lower[0] / upper[0];
            lower.iter_mut().zip(upper).skip(1).for_each(|(x, y)| *x -= factor * y);
            lower[0] = factor;
        }
    }

    /// The solution with the right side `b`.
    pub(super) fn solve(&self, mut b: DVector<f64>) -> DVector<f64> {
        let (size, width) = (b.len(), self.width);
        for (row, pivot) in self.pivots.iter().enumerate() {
            b.swap_rows(row, *pivot);
            for other in row + 1..size.min(row + width + 1) {
                b[other] -= self.numbers[self.place(other, row)] * b[row];
            }
        }
        for row in (0..size).rev() {
            let known = row + 1..size.min(row + 2 * width + 1);
            let sum: f64 = known.map(|column| self.numbers[self.place(row, column)] * b[column]).sum();
            b[row] = (b[row] - sum) / self.numbers[self.place(row, row)];
        }
        b
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use schemas::philox::uniform;

    #[test]
    fn a_band_is_solved_as_the_whole_matrix() {
        for (seed, (size, width)) in [(1, 0), (7, 2), (40, 5), (60, 9), (12, 11)].into_iter().enumerate() {
            // nothing on the diagonal, so that rows must change places
            let at = |row: usize, column: usize| match row.abs_diff(column) {
                0 if width > 0 => 0.0,
                off if off > width => 0.0,
                _ => uniform(seed as u64, 3, (row * size + column) as u64) - 0.5,
            };
            let matrix = DMatrix::from_fn(size, size, at);
            let all = (0..size).flat_map(|row| (0..size).map(move |column| (row, column)));
            let numbers: Vec<_> =
                all.map(|(row, column)| (row, column, at(row, column))).filter(|it| it.2 != 0.0).collect();
            let b = DVector::from_fn(size, |row, _| uniform(seed as u64, 4, row as u64));
            let off = &matrix * Band::of(size, &numbers).solve(b.clone()) - b;
            assert!(off.norm() < 1e-10, "{size}, {width}: {}", off.norm());
        }
    }
}
