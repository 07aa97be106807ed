//! Eigenvalues of any square matrix, by double steps of the QR algorithm on its Hessenberg form.
//!
//! The Schur form of `nalgebra` does not end for orthogonal and for defective matrices, which monodromy matrices are.
//!
//! # Source
//! J. G. F. Francis, Comput. J. 4 (1962) 332, doi:10.1093/comjnl/4.4.332; R. S. Martin, G. Peters, J. H. Wilkinson, Numer. Math. 14 (1970) 219,
//! doi:10.1007/BF02163032.

use nalgebra::DMatrix;

/// Steps for one eigenvalue or pair; two or three are usual.
const MOST_STEPS: usize = 90;
/// Steps after which a shift of no meaning breaks a circle.
const CIRCLE: usize = 10;

/// The real and imaginary parts of all eigenvalues of `matrix`, in no order; none if the steps do not end.
pub(crate) fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<[f64; 2]>> {
    // steps that go round in a circle leave it after a change in the last place, which is what the matrix is known to
    let place = f64::EPSILON * matrix.norm() / matrix.nrows() as f64;
    let changed = |row: usize, column: usize| ((7 * row + 13 * column) % 11) as f64 - 5.0;
    let tried = |attempt: u32| {
        let size = f64::from(attempt) * place;
        by_steps(DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| {
            matrix[(row, column)] + size * changed(row, column)
        }))
    };
    (0..4).find_map(tried)
}

fn by_steps(matrix: DMatrix<f64>) -> Option<Vec<[f64; 2]>> {
    let mut found = Vec::with_capacity(matrix.nrows());
    let mut end = matrix.nrows();
    let hessenberg = if end > 2 { matrix.hessenberg().unpack_h() } else { matrix };
    let size = hessenberg.norm();
    let mut part = Part { matrix: hessenberg, size, shifted: 0.0 };
    let mut step = 0;
    while end > 0 {
        let start = part.start(end);
        let last = part.matrix[(end - 1, end - 1)];
        match end - start {
            1 => found.push([last + part.shifted, 0.0]),
            2 => found.extend(part.pair(start)),
            _ => {
                step += 1;
                if step > MOST_STEPS || !last.is_finite() {
                    return None;
                }
                part.step(start, end, step % CIRCLE == 0);
                continue;
            }
        }
        (end, step) = (start, 0);
    }
    Some(found)
}

/// A Hessenberg matrix, whose lower right part gets smaller.
struct Part {
    matrix: DMatrix<f64>,
    /// √(Σ x²) of its numbers.
    size: f64,
    /// Sum of what was taken from the diagonal.
    shifted: f64,
}

impl Part {
    /// The row from which on the rows up to `end` hang together.
    fn start(&self, end: usize) -> usize {
        let h = &self.matrix;
        let is_cut = |row: &usize| {
            let beside = h[(row - 1, row - 1)].abs() + h[(*row, *row)].abs();
            // numbers on the diagonal are small where eigenvalues are near ±i
            h[(*row, row - 1)].abs() <= f64::EPSILON * beside.max(0.01 * self.size / h.nrows() as f64)
        };
        (1..end).rev().find(is_cut).unwrap_or(0)
    }

    /// The eigenvalues of the two rows from `row` on.
    fn pair(&self, row: usize) -> [[f64; 2]; 2] {
        let [a, b, c, d] = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(i, j)| self.matrix[(row + i, row + j)]);
        let half = 0.5 * (a - d);
        let under = half * half + b * c;
        let middle = d + self.shifted;
        if under < 0.0 {
            let im = (-under).sqrt();
            return [[middle + half, im], [middle + half, -im]];
        }
        // the larger root, and the other by the product of both
        let far = half + under.sqrt().copysign(half);
        let near = if far == 0.0 { 0.0 } else { -b * c / far };
        [[middle + far, 0.0], [middle + near, 0.0]]
    }

    /// Makes a double step on the rows from `start` to `end`, with the eigenvalues of the last two rows as shifts, or with others.
    fn step(&mut self, start: usize, end: usize, breaks_circle: bool) {
        let at = |h: &DMatrix<f64>, row: usize, column: usize| h[(end - row, end - column)];
        let (mut x, mut y) = (at(&self.matrix, 1, 1), at(&self.matrix, 2, 2));
        let mut product = at(&self.matrix, 1, 2) * at(&self.matrix, 2, 1);
        if breaks_circle {
            self.shifted += x;
            (0..end).for_each(|row| self.matrix[(row, row)] -= x);
            let size = at(&self.matrix, 1, 2).abs() + at(&self.matrix, 2, 3).abs();
            (x, y, product) = (0.75 * size, 0.75 * size, -0.4375 * size * size);
        }
        let (first, mut bulge) = self.first(start, end, [x, y, product]);
        for row in first + 2..end {
            self.matrix[(row, row - 2)] = 0.0;
            if row > first + 2 {
                self.matrix[(row, row - 3)] = 0.0;
            }
        }
        for row in first..end - 1 {
            let is_last = row == end - 2;
            let mut scale = 1.0;
            if row > first {
                let h = &self.matrix;
                bulge = [
                    h[(row, row - 1)],
                    h[(row + 1, row - 1)],
                    if is_last { 0.0 } else { h[(row + 2, row - 1)] },
                ];
                scale = bulge.iter().map(|x| x.abs()).sum();
                if scale == 0.0 {
                    continue;
                }
                bulge = bulge.map(|x| x / scale);
            }
            let length = bulge.iter().map(|x| x * x).sum::<f64>().sqrt().copysign(bulge[0]);
            if length == 0.0 {
                continue;
            }
            if row > first {
                self.matrix[(row, row - 1)] = -length * scale;
            } else if first > start {
                self.matrix[(row, row - 1)] *= -1.0;
            }
            self.mirror(row, [start, end], bulge, length);
        }
    }

    /// The row at which a double step can begin, and the first column of it.
    fn first(&self, start: usize, end: usize, [x, y, product]: [f64; 3]) -> (usize, [f64; 3]) {
        let h = &self.matrix;
        let mut row = end - 3;
        loop {
            let here = h[(row, row)];
            let (r, s) = (x - here, y - here);
            let column = [
                (r * s - product) / h[(row + 1, row)] + h[(row, row + 1)],
                h[(row + 1, row + 1)] - here - r - s,
                h[(row + 2, row + 1)],
            ];
            let size: f64 = column.iter().map(|x| x.abs()).sum();
            let column = column.map(|x| x / size);
            if row == start {
                return (row, column);
            }
            let before = h[(row, row - 1)].abs() * (column[1].abs() + column[2].abs());
            let beside = h[(row - 1, row - 1)].abs() + here.abs() + h[(row + 1, row + 1)].abs();
            if before <= f64::EPSILON * column[0].abs() * beside {
                return (row, column);
            }
            row -= 1;
        }
    }

    /// Mirrors three rows and columns from `row` on, two at the end, so that `bulge` of this `length` lies along the first.
    fn mirror(&mut self, row: usize, [start, end]: [usize; 2], bulge: [f64; 3], length: f64) {
        let rows = if row == end - 2 { 2 } else { 3 };
        let head = bulge[0] + length;
        let [across, along] =
            [[head / length, bulge[1] / length, bulge[2] / length], [1.0, bulge[1] / head, bulge[2] / head]];
        let h = &mut self.matrix;
        for column in row..end {
            let sum: f64 = (0..rows).map(|k| along[k] * h[(row + k, column)]).sum();
            (0..rows).for_each(|k| h[(row + k, column)] -= sum * across[k]);
        }
        for other in start..end.min(row + 4) {
            let sum: f64 = (0..rows).map(|k| across[k] * h[(other, row + k)]).sum();
            (0..rows).for_each(|k| h[(other, row + k)] -= sum * along[k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(matrix: &DMatrix<f64>) -> Vec<[f64; 2]> {
        let mut found = eigenvalues(matrix).expect("an end");
        found.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        found
    }

    /// A matrix of no symmetry with these real eigenvalues and complex pairs.
    fn with(blocks: &[[f64; 2]]) -> DMatrix<f64> {
        let count = blocks.iter().map(|block| if block[1] == 0.0 { 1 } else { 2 }).sum();
        let (mut diagonal, mut place) = (DMatrix::zeros(count, count), 0);
        for [re, im] in blocks {
            diagonal[(place, place)] = *re;
            if *im != 0.0 {
                (
                    diagonal[(place + 1, place + 1)],
                    diagonal[(place, place + 1)],
                    diagonal[(place + 1, place)],
                ) = (*re, *im, -im);
                place += 1;
            }
            place += 1;
        }
        let mix = DMatrix::from_fn(count, count, |i, j| {
            ((3 * i + 5 * j + i * j + 1) as f64).sin() + if i == j { 3.0 } else { 0.0 }
        });
        let back = mix.clone().try_inverse().expect("mixed");
        mix * diagonal * back
    }

    #[test]
    fn eigenvalues_are_those_that_a_matrix_was_made_of() {
        let angles = (1..20).map(|turn| (f64::from(turn) * 0.15).sin_cos()).map(|(im, re)| [re, im]);
        let blocks: Vec<_> = angles.chain([[2.5, 0.0], [0.4, 0.0], [-1.2, 0.0], [0.0, 1.0]]).collect();
        let pairs = blocks
            .iter()
            .flat_map(|[re, im]| if *im == 0.0 { vec![[*re, 0.0]] } else { vec![[*re, -im], [*re, *im]] });
        let mut expected: Vec<_> = pairs.collect();
        expected.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        for (found, expected) in found(&with(&blocks)).iter().zip(&expected) {
            let error = (found[0] - expected[0]).hypot(found[1] - expected[1]);
            assert!(error < 1e-11, "{found:?} for {expected:?}");
        }
    }

    #[test]
    fn permutations_and_defective_matrices_have_an_end() {
        for count in [1, 2, 3, 7, 40] {
            let turns = DMatrix::from_fn(count, count, |i, j| f64::from(u8::from(i == (j + 1) % count)));
            assert!(found(&turns).iter().all(|[re, im]| (re.hypot(*im) - 1.0).abs() < 1e-12), "{count}");
            let defective =
                DMatrix::from_fn(count, count, |i, j| if i == j || j == i + 1 { 1.0 } else { 0.0 });
            assert!(found(&defective).iter().all(|one| *one == [1.0, 0.0]), "{count}");
        }
    }
}
