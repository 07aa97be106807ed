//! The equations of an orbit as a matrix: solved for a step, and for what they lose where another branch begins.

use super::{Linear, Newton, NoOrbit, Plane, Unknown};
use nalgebra::{DMatrix, DVector, LU};

/// Size of what equations leave of a direction of length 1 up to which they lose it. Places of changes of stability are good to some 1e-9.
const LOST: f64 = 1e-5;

impl Newton<'_> {
    /// The direction of a second branch through `unknown`, at right angles to `along`: there the equations with that plane lose it. Borders
    /// are those at `regular`, as at `unknown` a symmetry could not be told from it.
    pub(crate) fn second(
        &self,
        unknown: &Unknown,
        along: Vec<f64>,
        regular: &Unknown,
    ) -> Result<Vec<f64>, NoOrbit> {
        let plane = Plane { normal: along, through: self.numbers(unknown) };
        let linear = self.linear(unknown, Some(&plane))?;
        let beside = if self.symmetries > 0 { Some(self.linear(regular, None)?) } else { None };
        let regular = beside.as_ref().unwrap_or(&linear);
        let (Some(monodromy), Some(regular)) = (&linear.monodromy, &regular.monodromy) else {
            let why = "it would be found by all multipliers, which are made for chains of up to 1000 beads (500 with resonators)";
            return Err(NoOrbit::Branch(why));
        };
        let borders = self.borders(&self.equations(regular))?;
        let matrix = self.matrix(&linear, monodromy, &borders);
        let singular = NoOrbit::NotUnique { symmetries: self.symmetries };
        let lost = lost(&matrix, 2).ok_or(singular.clone())?;
        let left = (&matrix * &lost).svd(false, true);
        let turned = left.v_t.ok_or(singular)?;
        match left.singular_values.as_slice() {
            [_, least] if *least > LOST => Err(NoOrbit::Branch(
                "the equations of an orbit with the turning points of this one lose none",
            )),
            [second, _] if *second <= LOST => Err(NoOrbit::Branch(
                "two multipliers pass at once, as in rings, and a whole family of directions is possible",
            )),
            _ => self.way(unknown, linear, &(lost * turned.row(1).transpose())),
        }
    }

    /// The equations by the unknown coordinates.
    fn equations(&self, monodromy: &DMatrix<f64>) -> DMatrix<f64> {
        let count = self.unknown.len();
        DMatrix::from_fn(count, count, |row, column| {
            let (row, column) = (self.closed[row], self.unknown[column]);
            monodromy[(row, column)] - if row == column { 1.0 } else { 0.0 }
        })
    }

    /// Directions that `equations` lose by symmetries: as columns, and as rows.
    fn borders(&self, equations: &DMatrix<f64>) -> Result<[DMatrix<f64>; 2], NoOrbit> {
        let symmetries = self.symmetries;
        if symmetries == 0 {
            return Ok([DMatrix::zeros(equations.nrows(), 0), DMatrix::zeros(0, equations.nrows())]);
        }
        let singular = NoOrbit::NotUnique { symmetries };
        let left = lost(&equations.transpose(), symmetries).ok_or(singular.clone())?;
        Ok([left, lost(equations, symmetries).ok_or(singular)?.transpose()])
    }

    /// The changes that are asked for at the end of a period.
    pub(super) fn closed(&self, all: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(self.closed.len(), self.closed.iter().map(|row| all[*row]))
    }

    /// The equations by all unknowns, with `borders`, and the further equations.
    fn matrix(&self, linear: &Linear, monodromy: &DMatrix<f64>, borders: &[DMatrix<f64>; 2]) -> DMatrix<f64> {
        let (count, [columns, rows]) = (self.unknown.len(), self.further(linear, borders));
        let mut matrix = DMatrix::zeros(rows.ncols(), rows.ncols());
        matrix.view_mut((0, 0), (count, count)).copy_from(&self.equations(monodromy));
        matrix.columns_range_mut(count..).rows_range_mut(..count).copy_from(&columns);
        matrix.rows_range_mut(count..).copy_from(&rows);
        matrix
    }

    /// The columns of the equations behind those of the coordinates, and the rows below, with `borders` and the further equations.
    pub(super) fn further(&self, linear: &Linear, [left, right]: &[DMatrix<f64>; 2]) -> [DMatrix<f64>; 2] {
        let (count, by, symmetries) = (self.unknown.len(), linear.by.len(), self.symmetries);
        let mut columns = DMatrix::zeros(count, by + symmetries);
        for (column, by) in linear.by.iter().enumerate() {
            columns.set_column(column, &self.closed(&by.all));
        }
        columns.columns_range_mut(by..).copy_from(left);
        let mut rows = DMatrix::zeros(by + symmetries, count + by + symmetries);
        rows.view_mut((0, 0), (symmetries, count)).copy_from(right);
        for (row, (by_coordinates, by_others, _)) in linear.further.iter().enumerate() {
            let row = symmetries + row;
            for (column, place) in self.unknown.iter().enumerate() {
                rows[(row, column)] = by_coordinates[*place];
            }
            by_others.iter().enumerate().for_each(|(other, by)| rows[(row, count + other)] = *by);
        }
        [columns, rows]
    }

    /// Solves the equations for a Newton step; or, with `along`, for a move by that much off the plane, on which nothing else changes.
    pub(super) fn solve(&self, linear: &Linear, along: Option<f64>) -> Result<DVector<f64>, NoOrbit> {
        let singular = NoOrbit::NotUnique { symmetries: self.symmetries };
        let count = self.unknown.len();
        let size = count + self.symmetries + linear.further.len();
        let mut right_side = DVector::zeros(size);
        if let Some(along) = along {
            right_side[size - 1] = along;
        } else {
            right_side.rows_mut(0, count).copy_from(&-self.closed(&linear.gap));
            for (row, (.., value)) in linear.further.iter().enumerate() {
                right_side[count + self.symmetries + row] = -value;
            }
        }
        let Some(monodromy) = &linear.monodromy else {
            // a step need be no better than the point that it leads to
            let tolerance = if along.is_some() { 0.0 } else { 0.1 * linear.residual };
            return self.solve_by_products(linear, &right_side, tolerance);
        };
        let matrix = self.matrix(linear, monodromy, &self.borders(&self.equations(monodromy))?);
        let solved = LU::new(matrix).solve(&right_side).ok_or(singular.clone())?;
        if solved.iter().all(|x| x.is_finite()) { Ok(solved) } else { Err(singular) }
    }
}

/// Directions that `equations` nearly lose, as columns at right angles.
fn lost(equations: &DMatrix<f64>, count: usize) -> Option<DMatrix<f64>> {
    // a matrix that is singular to the last place cannot be divided by; a change in that place may make another so
    [1.0, 3.0, -5.0].into_iter().find_map(|places| lost_beside(equations, places, count))
}

/// The same by inverse iteration with `AᵀA`, where `A` differs by so many last places on its diagonal.
fn lost_beside(equations: &DMatrix<f64>, places: f64, count: usize) -> Option<DMatrix<f64>> {
    let size = equations.nrows();
    let equations = equations + DMatrix::identity(size, size) * (places * f64::EPSILON * equations.amax());
    let (solver, transposed) = (LU::new(equations.clone()), LU::new(equations.transpose()));
    let some = |row: usize, column: usize| ((row * 7 + column * 13) % 11) as f64 - 4.5;
    let mut found = DMatrix::from_fn(size, count, some);
    for _ in 0..3 {
        found = transposed.solve(&found.qr().q())?;
        found = solver.solve(&found.qr().q())?;
        if !found.iter().all(|x| x.is_finite()) {
            return None;
        }
    }
    Some(found.qr().q())
}
