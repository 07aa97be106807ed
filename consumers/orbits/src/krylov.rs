//! Vectors that a matrix makes of one, by products alone: solutions of equations, and the largest eigenvalues.
//!
//! # Source
//! Y. Saad and M. H. Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856, doi:10.1137/0907058; W. E. Arnoldi, Quart. Appl. Math. 9 (1951) 17,
//! doi:10.1090/qam/42792.

use crate::eigenvalues::eigenvalues;
use nalgebra::{Complex, DMatrix, DVector};

/// Part of a vector that is left at right angles to others below which these are taken away once more.
const MUCH_LOST: f64 = 0.7;

/// Residual, over the larger of 1 and its size, of an eigenvalue that is found.
const FOUND: f64 = 1e-8;

/// Vectors at right angles of length 1, each but the first the product of the one before without those before it; and the parts of the products.
struct Krylov {
    basis: Vec<DVector<f64>>,
    columns: Vec<Vec<f64>>,
}

impl Krylov {
    fn begin(first: &DVector<f64>) -> Self {
        Self { basis: vec![first.normalize()], columns: Vec::new() }
    }

    fn last(&self) -> &DVector<f64> {
        &self.basis[self.columns.len()]
    }

    /// Takes the product of the last vector; false if it is in the space of those that are there.
    fn grow(&mut self, mut product: DVector<f64>) -> bool {
        let whole = product.norm();
        let mut column = vec![0.0; self.basis.len()];
        for _ in 0..2 {
            let before = product.norm();
            for (one, part) in self.basis.iter().zip(&mut column) {
                let along = one.dot(&product);
                product.axpy(-along, one, 1.0);
                *part += along;
            }
            if product.norm() > MUCH_LOST * before {
                break;
            }
        }
        let left = product.norm();
        let goes_on = left > 1e-14 * whole;
        column.push(if goes_on { left } else { 0.0 });
        self.columns.push(column);
        self.basis.push(product / left);
        goes_on
    }
}

/// Solves `A·x = b` for the matrix that `times` multiplies by, to a residual of `tolerance` over the size of `b`, in at most `most` products.
/// Gives the residual that is left, too.
pub(crate) fn gmres<E>(
    mut times: impl FnMut(&DVector<f64>) -> Result<DVector<f64>, E>,
    b: &DVector<f64>,
    most: usize,
    tolerance: f64,
) -> Result<(DVector<f64>, f64), E> {
    let mut krylov = Krylov::begin(b);
    // the parts, turned in planes to a triangle, and those of `b`
    let (mut triangle, mut turns, mut parts) =
        (Vec::<Vec<f64>>::new(), Vec::<[f64; 2]>::new(), vec![b.norm()]);
    let mut goes_on = true;
    while goes_on && triangle.len() < most && parts[triangle.len()].abs() > tolerance * b.norm() {
        let product = times(krylov.last())?;
        goes_on = krylov.grow(product);
        let number = triangle.len();
        let mut column = krylov.columns[number].clone();
        for (row, [cosine, sine]) in turns.iter().enumerate() {
            let (a, b) = (column[row], column[row + 1]);
            (column[row], column[row + 1]) = (cosine * a + sine * b, cosine * b - sine * a);
        }
        let length = column[number].hypot(column[number + 1]);
        if length == 0.0 {
            break;
        }
        let [cosine, sine] = [column[number] / length, column[number + 1] / length];
        column[number] = length;
        parts.push(-sine * parts[number]);
        parts[number] *= cosine;
        turns.push([cosine, sine]);
        triangle.push(column);
    }
    let left = parts[triangle.len()].abs() / b.norm();
    let mut solution = DVector::zeros(b.len());
    for (number, column) in triangle.iter().enumerate().rev() {
        let part = parts[number] / column[number];
        parts[..number].iter_mut().zip(column).for_each(|(x, y)| *x -= part * y);
        solution.axpy(part, &krylov.basis[number], 1.0);
    }
    Ok((solution, left))
}

/// An eigenvalue, nearly: `|A·x − μ·x|` over `|x|` is the residual.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ritz {
    pub(crate) value: Complex<f64>,
    pub(crate) residual: f64,
}

/// Eigenvalues of the matrix that `times` multiplies by, on the space of `first` and at most `most` products, as soon as
/// `is_enough` says so: as many as products.
pub(crate) fn arnoldi<E>(
    mut times: impl FnMut(&DVector<f64>) -> Result<DVector<f64>, E>,
    first: &DVector<f64>,
    most: usize,
    is_enough: impl Fn(&[Ritz]) -> bool,
) -> Result<Option<Vec<Ritz>>, E> {
    let mut krylov = Krylov::begin(first);
    let mut looks_at = most.min(50);
    loop {
        let product = times(krylov.last())?;
        let goes_on = krylov.grow(product);
        let count = krylov.columns.len();
        if goes_on && count < looks_at {
            continue;
        }
        let Some(found) = ritz(&krylov.columns) else { return Ok(None) };
        if !goes_on || count == most || is_enough(&found) {
            return Ok(Some(found));
        }
        looks_at = most.min(2 * count);
    }
}

/// Multipliers of an orbit that products find.
pub(crate) struct Largest {
    pub(crate) found: Vec<Ritz>,
    /// Size above which they are all.
    pub(crate) above: f64,
    /// Distance from 1 of those that are 1 by symmetry.
    pub(crate) from_one: f64,
}

impl Ritz {
    /// True if it is as good as found.
    pub(crate) fn is_found(&self) -> bool {
        self.residual <= FOUND * self.value.norm().max(1.0)
    }

    /// The eigenvalue of a matrix of this size, of whose inverse without `centre` this is one.
    pub(crate) fn of_inverse(self, centre: f64, size: f64) -> Self {
        let away = self.value.inv();
        Self { value: away + centre, residual: self.residual * (size + centre.abs()) * away.norm() }
    }
}

/// The eigenvalues of the Hessenberg matrix of `columns`, as eigenvalues of the whole one.
fn ritz(columns: &[Vec<f64>]) -> Option<Vec<Ritz>> {
    let count = columns.len();
    let square =
        DMatrix::from_fn(count, count, |row, column| columns[column].get(row).copied().unwrap_or(0.0));
    let values = eigenvalues(&square)?;
    let residual = |value: Complex<f64>| {
        // the parts of its vector from the last one up: each row has one more
        let mut vector = vec![Complex::new(0.0, 0.0); count];
        vector[count - 1] = Complex::new(1.0, 0.0);
        for row in (0..count).rev() {
            let sum: Complex<f64> = (row..count).map(|column| vector[column] * square[(row, column)]).sum();
            let rest = value * vector[row] - sum;
            if row == 0 {
                let size = vector.iter().map(Complex::norm_sqr).sum::<f64>().sqrt();
                let beyond = vector[count - 1] * columns[count - 1][count];
                return (rest.norm() + beyond.norm()) / size;
            }
            vector[row - 1] = rest / square[(row, row - 1)];
            let size = vector[row - 1].norm();
            if size > 1e100 {
                for x in &mut vector {
                    *x /= size;
                }
            }
        }
        f64::NAN
    };
    let of = |[re, im]: [f64; 2]| {
        let value = Complex::new(re, im);
        Ritz { value, residual: residual(value) }
    };
    Some(values.into_iter().map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix of no symmetry with these eigenvalues, and complex pairs of this size.
    fn matrix(real: &[f64], pairs: usize, size: f64) -> DMatrix<f64> {
        let count = real.len() + 2 * pairs;
        let mut blocks =
            DMatrix::from_diagonal(&DVector::from_fn(count, |i, _| real.get(i).copied().unwrap_or(0.0)));
        for pair in 0..pairs {
            let (at, angle) = (real.len() + 2 * pair, 0.1 + 3.0 * pair as f64 / pairs as f64);
            for (row, column, x) in
                [(0, 0, angle.cos()), (1, 1, angle.cos()), (0, 1, angle.sin()), (1, 0, -angle.sin())]
            {
                blocks[(at + row, at + column)] = size * x;
            }
        }
        let some = |i, j| 0.3 * f64::sin((3 * i + 5 * j + i * j) as f64) / (count as f64).sqrt();
        let mix = DMatrix::identity(count, count) + DMatrix::from_fn(count, count, some);
        &mix * blocks * mix.clone().try_inverse().expect("mixed")
    }

    fn some(count: usize) -> DVector<f64> {
        DVector::from_fn(count, |i, _| f64::sin(1.0 + (i * i) as f64))
    }

    #[test]
    fn equations_are_solved_to_the_residual_that_is_told() {
        for (matrix, most) in
            [(matrix(&[2.0, -3.0, 0.01], 100, 0.3), 203), (matrix(&[4.0, 1e3], 30, 1.0), 62)]
        {
            let matrix = &matrix + DMatrix::identity(matrix.nrows(), matrix.nrows());
            let b = some(matrix.nrows());
            for tolerance in [1e-3, 1e-12] {
                let times = |x: &DVector<f64>| Ok::<_, ()>(&matrix * x);
                let (x, left) = gmres(times, &b, most, tolerance).expect("no errors");
                let found = (&matrix * x - &b).norm() / b.norm();
                assert!(
                    left <= tolerance && (found - left).abs() < 1e-11,
                    "{tolerance:e}: {found:e}, {left:e}"
                );
            }
        }
    }

    #[test]
    fn the_largest_eigenvalues_are_found_and_no_others() {
        let large = [3.0, -1.7, 1.4];
        let matrix = matrix(&large, 300, 1.0);
        let times = |x: &DVector<f64>| Ok::<_, ()>(&matrix * x);
        let mut found =
            arnoldi(times, &some(matrix.nrows()), 150, |_| false).expect("no errors").expect("values");
        found.retain(Ritz::is_found);
        assert_eq!(found.len(), large.len(), "{found:?}");
        for (one, expected) in found.iter().zip(large) {
            let off = large.iter().map(|x| (one.value - Complex::new(*x, 0.0)).norm()).fold(9.0, f64::min);
            assert!(off < 1e-9, "{one:?} for {expected}");
        }
    }
}
