//! Eigenvalues of symmetric matrices: Householder's reflections make them tridiagonal, implicit QL steps diagonal.
//!
//! # Source
//! R. S. Martin, C. Reinsch, J. H. Wilkinson, *Numer. Math.* 11, 181 (1968), doi:10.1007/BF02161841; A. Dubrulle,
//! R. S. Martin, J. H. Wilkinson, *Numer. Math.* 12, 377 (1968), doi:10.1007/BF02165404.

/// A square matrix, row by row.
#[derive(Debug, Clone)]
pub(crate) struct Square {
    pub(crate) count: usize,
    pub(crate) values: Vec<f64>,
}

/// Eigenvalues, ascending, with an eigenvector of unit length in the row of each.
#[derive(Debug, Clone)]
pub(crate) struct Eigen {
    pub(crate) values: Vec<f64>,
    pub(crate) vectors: Square,
}

impl Square {
    pub(crate) fn zeros(count: usize) -> Self {
        Self { count, values: vec![0.0; count * count] }
    }

    fn identity(count: usize) -> Self {
        let mut square = Self::zeros(count);
        (0..count).for_each(|index| *square.at(index, index) = 1.0);
        square
    }

    pub(crate) fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.values[row * self.count + column]
    }

    pub(crate) fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.count..][..self.count]
    }

    fn row_mut(&mut self, row: usize) -> &mut [f64] {
        &mut self.values[row * self.count..][..self.count]
    }
}

impl Eigen {
    /// The most QL steps for one eigenvalue; two or three are usual.
    const MOST_STEPS: usize = 60;

    /// Computes those of a symmetric matrix; none if the steps do not converge, or a number is not finite.
    pub(crate) fn of(matrix: Square) -> Option<Self> {
        let mut tridiagonal = Tridiagonal::of(matrix);
        tridiagonal.diagonalise(Self::MOST_STEPS)?;
        let Tridiagonal { diagonal, vectors, .. } = tridiagonal;
        if !diagonal.iter().all(|value| value.is_finite()) {
            return None;
        }
        let mut order: Vec<usize> = (0..diagonal.len()).collect();
        order.sort_by(|a, b| diagonal[*a].total_cmp(&diagonal[*b]));
        let values = order.iter().map(|index| diagonal[*index]).collect();
        let rows = order.iter().flat_map(|index| vectors.row(*index)).copied().collect();
        Some(Self { values, vectors: Square { count: order.len(), values: rows } })
    }
}

/// A tridiagonal matrix `T` with `T = V·A·Vᵀ`.
struct Tridiagonal {
    diagonal: Vec<f64>,
    /// Beside the diagonal; the last one is 0.
    beside: Vec<f64>,
    vectors: Square,
}

impl Tridiagonal {
    /// Reflects away each column below the element beside the diagonal; what is 0 there already costs nothing.
    fn of(mut matrix: Square) -> Self {
        let count = matrix.count;
        let mut vectors = Square::identity(count);
        let (mut mirror, mut product) = (vec![0.0; count], vec![0.0; count]);
        for column in 0..count.saturating_sub(2) {
            let first = column + 1;
            (first..count).for_each(|row| mirror[row] = *matrix.at(row, column));
            if mirror[first + 1..].iter().all(|part| *part == 0.0) {
                continue;
            }
            // the reflection is 1 − v·vᵀ·2/|v|²
            let length = dot(&mirror[first..], &mirror[first..]).sqrt();
            let weight = 1.0 / (length * (length + mirror[first].abs()));
            let kept = -length.copysign(mirror[first]);
            mirror[first] -= kept;
            for (row, part) in product.iter_mut().enumerate().skip(first) {
                *part = weight * dot(&matrix.row(row)[first..], &mirror[first..]);
            }
            let half = 0.5 * weight * dot(&product[first..], &mirror[first..]);
            product[first..].iter_mut().zip(&mirror[first..]).for_each(|(part, v)| *part -= half * v);
            for row in first..count {
                let (v, w) = (mirror[row], product[row]);
                add_scaled(&mut matrix.row_mut(row)[first..], -v, &product[first..]);
                add_scaled(&mut matrix.row_mut(row)[first..], -w, &mirror[first..]);
            }
            *matrix.at(first, column) = kept;
            product.fill(0.0);
            (first..count).for_each(|row| add_scaled(&mut product, mirror[row], vectors.row(row)));
            (first..count).for_each(|row| add_scaled(vectors.row_mut(row), -weight * mirror[row], &product));
        }
        let diagonal = (0..count).map(|index| *matrix.at(index, index)).collect();
        let beside = (1..count).map(|index| *matrix.at(index, index - 1)).chain([0.0]).collect();
        Self { diagonal, beside, vectors }
    }

    /// Makes the diagonal that of the eigenvalues, in any order.
    fn diagonalise(&mut self, most_steps: usize) -> Option<()> {
        for first in 0..self.diagonal.len() {
            let mut steps = 0;
            while let Some(last) = self.end_of_block(first) {
                steps += 1;
                if steps > most_steps {
                    return None;
                }
                self.step(first, last);
            }
        }
        Some(())
    }

    /// The last row of the block that begins with `first`, if it is more than one row: elsewhere, what is beside the diagonal
    /// is lost in rounding.
    fn end_of_block(&self, first: usize) -> Option<usize> {
        let is_small = |row: usize| {
            let around = self.diagonal[row].abs() + self.diagonal[row + 1].abs();
            self.beside[row].abs() <= f64::EPSILON * around
        };
        let last = (first..self.diagonal.len() - 1).find(|row| is_small(*row));
        let last = last.unwrap_or(self.diagonal.len() - 1);
        (last > first).then_some(last)
    }

    /// One QL step with Wilkinson's shift on the block of rows from `first` to `last`.
    fn step(&mut self, first: usize, last: usize) {
        let Self { diagonal, beside, vectors } = self;
        let ratio = (diagonal[first + 1] - diagonal[first]) / (2.0 * beside[first]);
        let root = (ratio * ratio + 1.0).sqrt();
        let shift = diagonal[first] - beside[first] / (ratio + root.copysign(ratio));
        let (mut rest, mut sine, mut cosine, mut moved) = (diagonal[last] - shift, 1.0, 1.0, 0.0);
        for row in (first..last).rev() {
            let (over, along) = (sine * beside[row], cosine * beside[row]);
            let length = (over * over + rest * rest).sqrt();
            beside[row + 1] = length;
            if length == 0.0 {
                // the block falls apart here
                diagonal[row + 1] -= moved;
                beside[last] = 0.0;
                return;
            }
            (sine, cosine) = (over / length, rest / length);
            let corner = diagonal[row + 1] - moved;
            let turn = (diagonal[row] - corner) * sine + 2.0 * cosine * along;
            moved = sine * turn;
            diagonal[row + 1] = corner + moved;
            rest = cosine * turn - along;
            let (upper, lower) = vectors.values.split_at_mut((row + 1) * vectors.count);
            rotate(&mut upper[row * vectors.count..], &mut lower[..vectors.count], sine, cosine);
        }
        diagonal[first] -= moved;
        beside[first] = rest;
        beside[last] = 0.0;
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add_scaled(to: &mut [f64], factor: f64, from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to += factor * from);
}

fn rotate(one: &mut [f64], other: &mut [f64], sine: f64, cosine: f64) {
    for (one, other) in one.iter_mut().zip(other) {
        (*one, *other) = (cosine * *one - sine * *other, sine * *one + cosine * *other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// 2 on the diagonal and −1 beside it: 2 − 2·cos(nπ/(N + 1)), with sines; closed to a ring, 2 − 2·cos(2πn/N), each twice.
    #[test]
    fn equal_springs_have_their_textbook_eigenvalues() {
        const COUNT: u32 = 41;
        let count = COUNT as usize;
        let mut springs = Square::zeros(count);
        for row in 0..count {
            *springs.at(row, row) = 2.0;
            if row + 1 < count {
                (*springs.at(row, row + 1), *springs.at(row + 1, row)) = (-1.0, -1.0);
            }
        }
        let found = Eigen::of(springs.clone()).expect("converges");
        for mode in 1..=COUNT {
            let (turn, row) = (f64::from(mode) * PI / f64::from(COUNT + 1), mode as usize - 1);
            assert!((found.values[row] - (2.0 - 2.0 * turn.cos())).abs() < 1e-14);
            let scale = (2.0 / f64::from(COUNT + 1)).sqrt().copysign(found.vectors.row(row)[0]);
            for (bead, part) in (1..=COUNT).zip(found.vectors.row(row)) {
                assert!((part - scale * (f64::from(bead) * turn).sin()).abs() < 1e-12);
            }
        }
        (*springs.at(0, count - 1), *springs.at(count - 1, 0)) = (-1.0, -1.0);
        let found = Eigen::of(springs).expect("converges");
        for (index, value) in (0_u32..).zip(found.values) {
            let turn = 2.0 * PI * f64::from(index.div_ceil(2)) / f64::from(COUNT);
            assert!((value - (2.0 - 2.0 * turn.cos())).abs() < 1e-13, "{index}: {value}");
        }
    }

    /// `A·v = λ·v` for each, and the vectors are at right angles, for full matrices whose numbers are of any size.
    #[test]
    fn eigenvectors_are_what_they_are_called() {
        for (count, size) in [(1, 1.0), (2, 1e-20), (3, 1e20), (30, 1e10)] {
            let mut state = 1_u32;
            let mut matrix = Square::zeros(count);
            for row in 0..count {
                for column in 0..=row {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let value = size * (f64::from(state) / f64::from(u32::MAX) - 0.5);
                    (*matrix.at(row, column), *matrix.at(column, row)) = (value, value);
                }
            }
            let found = Eigen::of(matrix.clone()).expect("converges");
            for (one, value) in found.values.iter().enumerate() {
                let vector = found.vectors.row(one);
                for (row, part) in vector.iter().enumerate() {
                    assert!((dot(matrix.row(row), vector) - value * part).abs() < 1e-12 * size);
                }
                for other in 0..=one {
                    let expected = if one == other { 1.0 } else { 0.0 };
                    assert!((dot(vector, found.vectors.row(other)) - expected).abs() < 1e-13);
                }
            }
        }
        let mut endless = Square::zeros(3);
        *endless.at(1, 2) = f64::NAN;
        *endless.at(2, 1) = f64::NAN;
        assert!(Eigen::of(endless).is_none());
    }
}
