//! The equations of an orbit of a long chain, solved by products of its derivative with vectors, each a change that is carried over the period.
//!
//! A change hardly goes farther in a period than sound does. So some changes at places far from each other tell the derivative but for what went
//! farther: as a matrix with few diagonals, which makes the equations so nearly those of the identity that few products solve them.
//!
//! # Source
//! J. Sánchez, M. Net, B. García-Archilla, C. Simó, J. Comput. Phys. 201 (2004) 13, doi:10.1016/j.jcp.2004.04.018, for continuation by such products;
//! A. R. Curtis, M. J. D. Powell, J. K. Reid, J. Inst. Math. Appl. 13 (1974) 117, doi:10.1093/imamat/13.1.117, for many columns from one product.

use super::band::Band;
use super::{Linear, Newton, NoOrbit, Problem, Unknown};
use crate::krylov::{Largest, Ritz, arnoldi, gmres};
use crate::map::{Carried, Map};
use crate::multipliers::ON_CIRCLE;
use nalgebra::{DMatrix, DVector};
use schemas::philox::uniform;
use std::collections::BTreeMap;

/// Bytes of vectors that are kept.
const MOST_BYTES: usize = 1 << 30;
/// Least residual of equations, over the size of the right side, which rounding leaves.
const LEAST: f64 = 1e-10;
/// Residual up to which equations are solved; above it they lose a direction.
const MOST: f64 = 0.5;
/// Part of a product that a band may miss.
const MISSED: f64 = 1e-3;
/// Distance by which equations with symmetries are shifted, so that a band has a solution.
const SHIFT: f64 = 1e-3;
/// Products for multipliers, and solutions for those near 1 and −1: near numbers so far outside.
const PRODUCTS: usize = 400;
const NEAR: usize = 100;
const BESIDE: f64 = 0.01;
/// Distance between values up to which they are one, found twice.
const SAME: f64 = 1e-6;
/// Part of a step in which the motion is straight.
const FORWARD: f64 = 1e-3;
/// Size of multipliers that are outside of the unit circle.
const OUTSIDE: f64 = 1.0 + ON_CIRCLE;

/// A derivative nearly: its numbers with rows and columns in the order of the beads, and the numbers of these in that of the coordinates.
struct Nearly {
    numbers: Vec<(usize, usize, f64)>,
    rows: Vec<usize>,
    columns: Vec<usize>,
}

impl Map<'_> {
    /// Changes at the end of all parts, of `changes` at the beginning.
    fn changes(&self, carried: &Carried, mut changes: Vec<Vec<f64>>) -> Result<Vec<Vec<f64>>, NoOrbit> {
        for part in 0..carried.ends.len() {
            changes = self.change(carried, part, &changes)?;
        }
        Ok(changes)
    }
}

impl Newton<'_> {
    /// Solves the equations, bordered by the directions of the symmetries, to a residual of `tolerance`, but not below [`LEAST`].
    pub(super) fn solve_by_products(
        &self,
        linear: &Linear,
        right_side: &DVector<f64>,
        tolerance: f64,
    ) -> Result<DVector<f64>, NoOrbit> {
        let count = self.unknown.len();
        let map = self.map(&linear.problem);
        let directions =
            self.directions(&linear.problem, &linear.unknown, self.moves_by_itself && !self.turns)?;
        // the equations miss the conjugate; if a chain as a whole has losses, a direction with positive parts, as this has
        let left = directions.iter().map(|direction| self.closed(&(self.conjugate(direction) + direction)));
        let left = DMatrix::from_iterator(count, self.symmetries, left.flat_map(|it| Vec::from(it.data)));
        let right =
            DMatrix::from_fn(self.symmetries, count, |row, column| directions[row][self.unknown[column]]);
        let [columns, rows] = self.further(linear, &[left, right]);
        let nearly = self.nearly(&map, &linear.carried, [&self.closed, &self.unknown], MISSED)?;
        let shift = if self.symmetries > 0 { SHIFT } else { 0.0 } + if self.turns { 0.0 } else { 1.0 };
        let band = nearly.map(|nearly| (nearly.without(shift), nearly));
        let precondition = |x: &DVector<f64>| {
            let solved = band.as_ref().map(|(band, nearly)| nearly.solve(band, x));
            solved.unwrap_or_else(|| x.clone())
        };
        let times = |x: &DVector<f64>| -> Result<DVector<f64>, NoOrbit> {
            let x = precondition(x);
            let change = self.change_of(&self.unknown, x.as_slice());
            let end = DVector::from_vec(map.changes(&linear.carried, vec![change.clone()])?.concat());
            let closed = self.closed(&(end - DVector::from_vec(change))) + &columns * x.rows_range(count..);
            Ok(DVector::from_iterator(x.len(), closed.iter().chain(&(&rows * &x)).copied()))
        };
        let most = (MOST_BYTES / (8 * right_side.len())).min(right_side.len());
        let (solution, left) = gmres(times, right_side, most, tolerance.clamp(LEAST, 1e-6))?;
        if left <= MOST {
            Ok(precondition(&solution))
        } else {
            Err(NoOrbit::NotUnique { symmetries: self.symmetries })
        }
    }

    /// The change whose coordinates `places` are `numbers`, and the others nothing.
    fn change_of(&self, places: &[usize], numbers: &[f64]) -> Vec<f64> {
        let mut change = vec![0.0; self.coordinates.count()];
        places.iter().zip(numbers).for_each(|(place, x)| change[*place] = *x);
        change
    }

    /// Directions in which an orbit can be displaced, at right angles and of length 1: along its motion, if that is asked for, and the chain as a
    /// whole, if nothing holds it.
    fn directions(
        &self,
        problem: &Problem,
        unknown: &Unknown,
        along_motion: bool,
    ) -> Result<Vec<DVector<f64>>, NoOrbit> {
        let mut all = Vec::new();
        if along_motion {
            let map = Map { steps: 1, ..self.map(problem) };
            let moved =
                |part: f64| map.along(part * unknown.dt_s, &unknown.points[..1]).map(DVector::from_vec);
            all.push(moved(FORWARD)? - moved(-FORWARD)?);
        }
        if self.symmetries > usize::from(self.moves_by_itself && !self.turns) {
            all.push(DVector::from_vec(self.coordinates.displacement_of_all()));
        }
        if all.is_empty() {
            return Ok(all);
        }
        let directions = DMatrix::from_columns(&all).qr().q();
        Ok(directions.column_iter().map(DVector::from).collect())
    }

    /// The direction whose part in a change stays, in a chain without losses, where `direction` comes back after a period.
    fn conjugate(&self, direction: &DVector<f64>) -> DVector<f64> {
        let others = self.coordinates.others();
        let kinds = self.coordinates.kinds_and_beads();
        let sign = |place: usize| if kinds[place][0].is_multiple_of(2) { -1.0 } else { 1.0 };
        DVector::from_fn(others.len(), |place, _| sign(place) * direction[others[place]])
    }

    /// The derivative of the coordinates `rows` by those that are `columns` nearly, if few diagonals have all of it but for a part `missed`.
    fn nearly(
        &self,
        map: &Map<'_>,
        carried: &Carried,
        [rows, columns]: [&[usize]; 2],
        missed: f64,
    ) -> Result<Option<Nearly>, NoOrbit> {
        let chain = map.physics.chain();
        let any = DVector::from_fn(columns.len(), |number, _| uniform(0, 1, number as u64) - 0.5);
        let change = self.change_of(columns, any.as_slice());
        let end = DVector::from_vec(map.changes(carried, vec![change])?.concat());
        let product = end.select_rows(rows);
        let mut layout = Layout { beads: chain.mass_kg.len(), reach: 8, is_ring: chain.is_ring };
        while layout.groups() >= 4 && layout.bytes(rows.len()) <= MOST_BYTES {
            let nearly = self.near(map, carried, &layout, [rows, columns])?;
            if (&product - nearly.times(&any)).norm() <= missed * product.norm() {
                return Ok(Some(nearly));
            }
            layout.reach *= 2;
        }
        Ok(None)
    }

    /// The numbers of a derivative at beads in reach of each other.
    fn near(
        &self,
        map: &Map<'_>,
        carried: &Carried,
        layout: &Layout,
        places: [&[usize]; 2],
    ) -> Result<Nearly, NoOrbit> {
        let at = self.coordinates.kinds_and_beads();
        let ordered = |places: &[usize]| {
            let mut numbers: Vec<usize> = (0..places.len()).collect();
            let order = |number: &usize| {
                let [kind, bead] = at[places[*number]];
                (layout.rank(bead), kind)
            };
            numbers.sort_by_key(order);
            numbers
        };
        let [rows, columns] = places.map(ordered);
        let group = |place: usize| [at[place][0], layout.number_in_group(at[place][1])];
        let mut changes = BTreeMap::new();
        for place in places[1] {
            changes.entry(group(*place)).or_insert_with(|| vec![0.0; at.len()])[*place] = 1.0;
        }
        let (groups, changes): (Vec<_>, Vec<_>) = changes.into_iter().unzip();
        let ends: BTreeMap<_, _> = groups.into_iter().zip(map.changes(carried, changes)?).collect();
        let mut of_bead = vec![Vec::new(); layout.beads];
        for (row, number) in rows.iter().enumerate() {
            let place = places[0][*number];
            of_bead[at[place][1]].push((row, place));
        }
        let mut numbers = Vec::new();
        for (column, number) in columns.iter().enumerate() {
            let place = places[1][*number];
            let near = layout.near(at[place][1]).flat_map(|bead| &of_bead[bead]);
            numbers.extend(near.map(|(row, other)| (*row, column, ends[&group(place)][*other])));
        }
        Ok(Nearly { numbers, rows, columns })
    }

    /// The multipliers of the orbit `unknown` that products find first: the largest, and those near 1 and −1; none if they cannot be found.
    pub(crate) fn largest(&self, unknown: &Unknown) -> Result<Option<Largest>, NoOrbit> {
        let problem = (self.family)(unknown.parameter)?;
        let map = Map { steps: self.steps, ..self.map(&problem) };
        // parts are of half of a period where the motion goes back
        let parts = if self.turns { 1 } else { unknown.points.len() };
        let carried = map.carry(unknown.dt_s, &unknown.points[..parts], false)?;
        let count = self.coordinates.count();
        let all: Vec<usize> = (0..count).collect();
        let nearly = self.nearly(&map, &carried, [&all, &all], LEAST)?;
        let times = |change: &DVector<f64>| -> Result<DVector<f64>, NoOrbit> {
            Ok(match &nearly {
                Some(nearly) => nearly.times(change),
                None => map.changes(&carried, vec![change.as_slice().to_vec()])?.concat().into(),
            })
        };
        let first = DVector::from_fn(count, |place, _| uniform(0, 2, place as u64) - 0.5);
        let above = |found: &[Ritz]| {
            let unknown = found.iter().filter(|one| !one.is_found()).map(|one| one.value.norm());
            // a larger one would have outgrown the others in so many products, and what it begins with is a part in √n
            let outgrows = (1e4 * (count as f64).sqrt()).ln() / found.len() as f64;
            unknown.fold(0.0, f64::max) * outgrows.exp()
        };
        let found = arnoldi(times, &first, PRODUCTS.min(count), |found| above(found) < 1.0)?;
        let Some(mut found) = found else { return Ok(None) };
        let above = above(&found);
        found.retain(|one| one.is_found() && one.value.norm() > above.min(OUTSIDE));
        for nearly in nearly.iter().filter(|_| above > 1.0) {
            for centre in [1.0 + BESIDE, -1.0 - BESIDE] {
                for one in nearly.outside_near(centre, &first)? {
                    let is_new = found.iter().all(|other| (one.value - other.value).norm() > SAME);
                    found.extend(Some(one).filter(|one| is_new && one.value.norm() < above));
                }
            }
        }
        // steps have the symmetry of the motion to their errors, which part a pair at 1 by the root
        let lost = |direction: &DVector<f64>| Ok::<_, NoOrbit>((times(direction)? - direction).norm());
        let directions = self.directions(&problem, unknown, self.moves_by_itself)?;
        let lost =
            directions.iter().map(lost).collect::<Result<Vec<_>, _>>()?.into_iter().fold(0.0, f64::max);
        Ok(Some(Largest { found, above, from_one: ON_CIRCLE + 10.0 * lost.sqrt() }))
    }
}

impl Nearly {
    /// Eigenvalues outside of the unit circle near `centre`, by solutions.
    fn outside_near(&self, centre: f64, first: &DVector<f64>) -> Result<Vec<Ritz>, NoOrbit> {
        let equations = self.without(centre);
        let times = |change: &DVector<f64>| Ok::<_, NoOrbit>(self.solve(&equations, change));
        let found = arnoldi(times, first, NEAR.min(first.len()), |_| false)?.unwrap_or_default();
        let found = found.into_iter().map(|one| one.of_inverse(centre, self.size()));
        Ok(found.filter(|one| one.is_found() && one.value.norm() > OUTSIDE).collect())
    }

    /// Largest sum of the sizes of numbers in a row.
    fn size(&self) -> f64 {
        let mut sums = vec![0.0; self.rows.len()];
        self.numbers.iter().for_each(|(row, _, x)| sums[*row] += x.abs());
        sums.into_iter().fold(0.0, f64::max)
    }

    /// The derivative times `change`.
    fn times(&self, change: &DVector<f64>) -> DVector<f64> {
        let mut product = DVector::zeros(change.len());
        let add = |(row, column, x): &(usize, usize, f64)| {
            product[self.rows[*row]] += x * change[self.columns[*column]];
        };
        self.numbers.iter().for_each(add);
        product
    }

    /// The derivative without `shift` on its diagonal, ready to be solved for.
    fn without(&self, shift: f64) -> Band {
        let diagonal = (0..self.rows.len()).map(|row| (row, row, -shift));
        Band::of(self.rows.len(), &self.numbers.iter().copied().chain(diagonal).collect::<Vec<_>>())
    }

    /// The solution of `band` with the first numbers of `b`; the others stay.
    fn solve(&self, band: &Band, b: &DVector<f64>) -> DVector<f64> {
        let solved = band.solve(b.select_rows(&self.rows));
        let mut all = b.clone();
        self.columns.iter().zip(&solved).for_each(|(number, x)| all[*number] = *x);
        all
    }
}

/// Beads whose changes reach so far, in groups so long that the changes of one bead in each do not meet.
struct Layout {
    beads: usize,
    reach: usize,
    is_ring: bool,
}

impl Layout {
    fn groups(&self) -> usize {
        self.beads / (2 * self.reach + 1)
    }

    /// Bytes of a band of so many coordinates.
    fn bytes(&self, coordinates: usize) -> usize {
        let around = if self.is_ring { 2 } else { 1 };
        Band::bytes(coordinates, coordinates.div_ceil(self.beads) * (self.reach + 1) * around)
    }

    /// The place of a bead in the order of a band: those of a ring lie in pairs, from its ends on.
    fn rank(&self, bead: usize) -> usize {
        if self.is_ring { (2 * bead).min(2 * (self.beads - bead) - 1) } else { bead }
    }

    /// Number of a bead in its group. Groups differ by a bead at most.
    fn number_in_group(&self, bead: usize) -> usize {
        let groups = self.groups();
        let first = |group: usize| (group * self.beads).div_ceil(groups);
        bead - first(bead * groups / self.beads)
    }

    /// The beads in reach of one.
    fn near(&self, bead: usize) -> impl Iterator<Item = usize> {
        let Self { beads, reach, is_ring } = *self;
        let all = bead + beads - reach..=bead + beads + reach;
        all.filter(move |place| is_ring || (beads..2 * beads).contains(place)).map(move |place| place % beads)
    }
}
