//! Newton's method for orbits: states that a map brings back.
//!
//! Unknown are the state at the beginning (and at those of further parts of the period), and, if they are asked for, the step, which times the
//! number of steps is the period, and a parameter. Where the chain moves by itself, or nothing holds it in its place, the equations
//! `(M − I)·δz = −gap` have no unique solution: as many directions are set to nothing as there are such symmetries, and as many numbers are
//! added to the equations that depend on the others. At an orbit these numbers are 0.
//!
//! A chain that conserves energy and begins without velocities goes back the way that it came. Then displacements alone are unknown,
//! and velocities are made nothing after half of the period, which is a turning point, too.

mod band;
mod equations;
mod products;

use crate::map::{Carried, Coordinates, Map, MapError, check_steps, norm};
use nalgebra::{DMatrix, DVector};
use schemas::config::ConfigError;
use schemas::manifest::Physics;
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;

/// Largest distance from the state a period later, over the size of the states.
pub const TOLERANCE: f64 = 1e-12;

/// Newton steps after which an orbit is given up, and halvings of one that leads away.
const MOST_STEPS: usize = 40;
const MOST_HALVINGS: u32 = 8;

/// A residual that is taken if it falls no more: rounding leaves it where orbits are very unstable, and contacts that open do, whose steps are not
/// those of any smooth motion.
const TAKEN: f64 = 1e-8;

/// Step over that of the seed up to which no time passes in a period.
const SHORTEST: f64 = 1e-6;

/// Distance from the state after a part of a period up to which the state is back: errors of steps are smaller, other states are further away.
const REPEATED: f64 = 1e-4;

/// Part of a step along a branch by which its direction is found.
const WAY: f64 = 1e-3;

/// Relative changes by which derivatives are found as differences: of the step and the parameter, and of a coordinate in the energy.
const CHANGE: f64 = 1e-5;

/// The quantity that chooses an orbit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Asked {
    /// Its period (s).
    PeriodS(f64),
    /// Its energy (J).
    EnergyJ(f64),
    /// The displacement (m) at its beginning of the bead that the seed displaces most.
    AmplitudeM(f64),
}

/// A chain, and the orbit that is asked for.
#[derive(Debug, Clone)]
pub struct Problem {
    /// The run; its time step is chosen anew.
    pub physics: Physics,
    /// The quantity that chooses the orbit.
    pub asked: Asked,
}

/// Chains that differ in one parameter: the problem at each value.
pub type Family<'a> = dyn Fn(f64) -> Result<Problem, ConfigError> + 'a;

/// An orbit that is looked for, as numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unknown {
    /// Coordinates at the beginning of each part of the period.
    pub(crate) points: Vec<Vec<f64>>,
    /// Time step (s).
    pub dt_s: f64,
    /// The parameter.
    pub parameter: f64,
}

/// An orbit found.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    pub(crate) unknown: Unknown,
    /// The derivative of the map of a period, if it is made.
    pub(crate) monodromy: Option<DMatrix<f64>>,
    /// Residual at the beginning of each Newton step, and the last one.
    pub(crate) residuals: Vec<f64>,
}

/// Reason why there is no orbit near the seed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoOrbit {
    /// A state could not be carried.
    #[error(transparent)]
    Map(#[from] MapError),
    /// There is no such chain.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The chain has none, or none that are found in this way.
    #[error("no orbit: {0}")]
    Chain(&'static str),
    /// The residual does not fall.
    #[error(
        "no orbit: Newton's method stays at a residual of {:.1e} (residuals: {}); begin nearer to an orbit, with a smaller amplitude or the \
         state of an orbit of neighbouring values, or divide the period (orbit.segments = 4)",
        residuals.last().copied().unwrap_or(f64::NAN), history(residuals)
    )]
    Stuck {
        /// The residuals of all steps.
        residuals: Vec<f64>,
    },
    /// The equations have no unique solution.
    #[error(
        "the orbit is not unique: more than one multiplier is 1 to rounding where {symmetries} may be; ask for another quantity (period_s, energy_j, \
         amplitude_m), or leave a linear resonance or a bifurcation"
    )]
    NotUnique {
        /// Directions in which an orbit can be displaced.
        symmetries: usize,
    },
    /// None begins at a change of stability, or none that is found in this way.
    #[error("no branch begins there: {0}")]
    Branch(&'static str),
}

/// Some residuals in words.
fn history(residuals: &[f64]) -> String {
    let from = residuals.len().saturating_sub(8);
    residuals[from..].iter().map(|residual| format!("{residual:.0e}")).collect::<Vec<_>>().join(", ")
}

/// A condition beside those of an orbit: the point lies on a plane.
#[derive(Debug, Clone)]
pub(crate) struct Plane {
    /// Its normal, of length 1: by the coordinates, the step and the parameter.
    pub(crate) normal: Vec<f64>,
    /// A point on it.
    pub(crate) through: Vec<f64>,
}

/// Newton's method for the orbits of a family.
#[derive(Clone)]
pub(crate) struct Newton<'a> {
    pub(crate) family: &'a Family<'a>,
    pub(crate) coordinates: Coordinates,
    pub(crate) steps: u64,
    /// Periods of the problem in one of the orbit.
    pub(crate) periods: u64,
    pub(crate) shift_beads: u64,
    /// True if matrices are made, false if vectors are only multiplied by them.
    pub(crate) is_dense: bool,
    /// Set when the search is to be given up.
    pub(crate) stop: &'a AtomicBool,
    /// Coordinates that are unknown, and those whose gaps are made nothing: as many.
    pub(crate) unknown: Vec<usize>,
    pub(crate) closed: Vec<usize>,
    /// True if the motion goes back from the half of the period on: the unknown are displacements, the others velocities.
    pub(crate) turns: bool,
    /// True if nothing drives the chain.
    pub(crate) moves_by_itself: bool,
    /// Directions among the unknown in which an orbit can be displaced.
    pub(crate) symmetries: usize,
    /// The bead whose displacement is an amplitude.
    pub(crate) bead: usize,
    /// Units of the step (s) and the parameter.
    pub(crate) units: [f64; 2],
}

/// The equations at some numbers, and their derivatives.
struct Linear {
    problem: Problem,
    unknown: Unknown,
    carried: Carried,
    /// Distances that the parts leave.
    gaps: Vec<Vec<f64>>,
    /// Distance that all leave together.
    gap: DVector<f64>,
    monodromy: Option<DMatrix<f64>>,
    /// By the step and the parameter, where these are unknown.
    by: Vec<By>,
    /// Further equations: by the coordinates, by the step and the parameter, and the value.
    further: Vec<(Vec<f64>, Vec<f64>, f64)>,
    residual: f64,
}

/// Derivatives by the step or the parameter.
struct By {
    number: Number,
    /// By that number, the end of each part.
    parts: Vec<Vec<f64>>,
    /// All parts together.
    all: DVector<f64>,
}

/// An unknown beside the coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Number {
    Step,
    Parameter,
}

impl Newton<'_> {
    /// The map of `problem`.
    fn map<'b>(&'b self, problem: &'b Problem) -> Map<'b> {
        let steps = if self.turns { self.steps / 2 } else { self.steps };
        let shift_beads = self.shift_beads;
        Map { physics: &problem.physics, coordinates: &self.coordinates, steps, shift_beads, stop: self.stop }
    }

    /// `unknown` as numbers of size 1: the first coordinates, the step, the parameter.
    pub(crate) fn numbers(&self, unknown: &Unknown) -> Vec<f64> {
        let further = [unknown.dt_s / self.units[0], unknown.parameter / self.units[1]];
        unknown.points[0].iter().copied().chain(further).collect()
    }

    /// `unknown` with the parameter `parameter`, and the step that the period asked for has there, if a run may have it.
    fn at(&self, unknown: &Unknown, parameter: f64) -> Result<(Problem, Unknown), NoOrbit> {
        let problem = (self.family)(parameter)?;
        let mut unknown = Unknown { parameter, ..unknown.clone() };
        // that of another period is looked at when the orbit is found
        if let Asked::PeriodS(period_s) = problem.asked {
            unknown.dt_s = self.periods as f64 * period_s / self.steps as f64;
            check_steps(&problem.physics, self.steps, unknown.dt_s)?;
        }
        Ok((problem, unknown))
    }

    /// True if nothing moves, or time does not pass, where a chain moves by itself.
    pub(crate) fn is_at_rest(&self, unknown: &Unknown) -> bool {
        let is_still = norm(&unknown.points[0]) < 1e-6;
        self.moves_by_itself && (is_still || unknown.dt_s <= self.units[0] * SHORTEST)
    }

    /// True if a period that was not asked for runs through an orbit several times: a multiple of a prime up to 13.
    pub(crate) fn is_repeated(&self, unknown: &Unknown) -> Result<bool, NoOrbit> {
        let (problem, unknown) = self.at(unknown, unknown.parameter)?;
        if matches!(problem.asked, Asked::PeriodS(_)) || self.shift_beads > 0 {
            return Ok(false);
        }
        for parts in [2, 3, 5, 7, 11, 13] {
            // back near the middle is back after one part, too, where a slow motion has hardly begun in any case
            let ahead = parts / 2 * self.steps;
            let steps = ahead.div_ceil(parts);
            let dt_s = unknown.dt_s * ahead as f64 / (parts * steps) as f64;
            let map = Map { steps, ..self.map(&problem) };
            let end = map.carry(dt_s, &unknown.points[..1], false)?.ends.pop().unwrap_or_default();
            if distance(&end, &unknown.points[0]) < REPEATED {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Distance, over the size of what is asked for, from what is asked for; none of a period.
    fn asked(&self, problem: &Problem, unknown: &Unknown) -> Option<f64> {
        match problem.asked {
            Asked::PeriodS(_) => None,
            Asked::EnergyJ(energy_j) => Some(self.energy_j(problem, unknown) / energy_j - 1.0),
            Asked::AmplitudeM(amplitude_m) => {
                let (place, unit_m) = self.coordinates.displacement(self.bead)?;
                Some(unknown.points[0][place] * unit_m / amplitude_m - 1.0)
            }
        }
    }

    /// Energy (J) at the beginning.
    pub(crate) fn energy_j(&self, problem: &Problem, unknown: &Unknown) -> f64 {
        let (chain, state) = (problem.physics.chain(), self.state(problem, unknown));
        let mut scratch = vec![0.0; state.u_m.len() - 1];
        chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut scratch).total_j()
    }

    /// The state at the beginning.
    pub(crate) fn state(&self, problem: &Problem, unknown: &Unknown) -> producer::state::ChainState {
        let physics = Physics { dt_s: unknown.dt_s, ..problem.physics.clone() };
        let mut state = producer::state::ChainState::initial(&physics);
        self.coordinates.put(&unknown.points[0], &mut state);
        state
    }

    /// Derivatives of [`asked`](Self::asked) by the coordinates.
    fn asked_by_coordinates(&self, problem: &Problem, unknown: &Unknown) -> Vec<f64> {
        let mut changed = unknown.clone();
        let size = norm(&unknown.points[0]);
        let change = CHANGE * size;
        let mut by = |place: usize, sign: f64| {
            changed.points[0][place] = unknown.points[0][place] + sign * change;
            let value = self.asked(problem, &changed).unwrap_or(0.0);
            changed.points[0][place] = unknown.points[0][place];
            value
        };
        (0..self.coordinates.count())
            .map(|place| (by(place, 1.0) - by(place, -1.0)) / (2.0 * change))
            .collect()
    }

    /// The distances that the parts leave after `carried`, and the residual with those of the further equations.
    fn gaps(&self, unknown: &Unknown, ends: &[Vec<f64>], further: &[f64]) -> (Vec<Vec<f64>>, f64) {
        let mut last = unknown.points[0].clone();
        if self.turns {
            // displacements are free to end anywhere
            last.clone_from(&ends[ends.len() - 1]);
            self.closed.iter().for_each(|place| last[*place] = 0.0);
        }
        let starts = unknown.points.iter().skip(1).chain([&last]);
        let gap = |(end, start): (&Vec<f64>, &Vec<f64>)| end.iter().zip(start).map(|(a, b)| a - b).collect();
        let gaps: Vec<Vec<f64>> = ends.iter().zip(starts).map(gap).collect();
        let size = unknown.points.iter().map(|point| norm(point)).fold(f64::from_bits(1), f64::max);
        let largest = gaps.iter().map(|gap| norm(gap) / size).fold(0.0, larger);
        (gaps, further.iter().map(|value| value.abs()).fold(largest, larger))
    }

    fn off_plane(&self, plane: &Plane, unknown: &Unknown) -> f64 {
        let numbers = self.numbers(unknown);
        let parts = plane.normal.iter().zip(numbers.iter().zip(&plane.through));
        parts.map(|(normal, (x, through))| normal * (x - through)).sum()
    }

    /// Puts the beginnings of all parts but the first where the motion from the first comes to.
    pub(crate) fn flow(&self, unknown: &mut Unknown) -> Result<(), NoOrbit> {
        let parts = unknown.points.len();
        let (problem, mut moved) = self.at(unknown, unknown.parameter)?;
        moved.points.truncate(1);
        let whole = self.map(&problem);
        let map = Map { steps: whole.steps / parts as u64, shift_beads: 0, ..whole };
        for part in 1..parts {
            let end = map.along(moved.dt_s, &moved.points)?;
            unknown.points[part].clone_from(&end);
            moved.points.push(end);
        }
        Ok(())
    }

    /// The residual at `unknown`.
    fn residual(&self, unknown: &Unknown, plane: Option<&Plane>) -> Result<f64, NoOrbit> {
        let (problem, unknown) = self.at(unknown, unknown.parameter)?;
        let carried = self.map(&problem).carry(unknown.dt_s, &unknown.points, false)?;
        let further = self.asked(&problem, &unknown).into_iter();
        let further: Vec<f64> = further.chain(plane.map(|plane| self.off_plane(plane, &unknown))).collect();
        Ok(self.gaps(&unknown, &carried.ends, &further).1)
    }

    /// The equations at `unknown`; with the parameter as an unknown if `plane` is told.
    fn linear(&self, unknown: &Unknown, plane: Option<&Plane>) -> Result<Linear, NoOrbit> {
        let (problem, unknown) = self.at(unknown, unknown.parameter)?;
        let carried = self.map(&problem).carry(unknown.dt_s, &unknown.points, self.is_dense)?;
        let asked = self.asked(&problem, &unknown);
        let mut by = Vec::new();
        let (mut asked_by, mut plane_by) = (Vec::new(), Vec::new());
        let count = self.coordinates.count();
        if asked.is_some() {
            let change = CHANGE * unknown.dt_s / self.units[0];
            let changed = [1.0, -1.0].map(|sign| (&problem, unknown.dt_s + sign * change * self.units[0]));
            by.push(self.difference(Number::Step, (&problem, &unknown), &carried, (change, changed))?);
            asked_by.push(0.0);
            plane_by.extend(plane.map(|plane| plane.normal[count]));
        }
        if let Some(plane) = plane {
            let (change, [(problem_up, up), (problem_down, down)]) = self.beside(&unknown)?;
            let ends = [(&problem_up, up.dt_s), (&problem_down, down.dt_s)];
            by.push(self.difference(Number::Parameter, (&problem, &unknown), &carried, (change, ends))?);
            let slope = |up: f64, down: f64| (up - down) / (2.0 * change);
            let of = |problem, unknown| self.asked(problem, unknown).unwrap_or(0.0);
            if asked.is_some() {
                asked_by.push(slope(of(&problem_up, &up), of(&problem_down, &down)));
            }
            // the step follows the parameter where a period is asked for
            let follows = slope(up.dt_s, down.dt_s) / self.units[0];
            plane_by.push(plane.normal[count + 1] + plane.normal[count] * follows);
        }
        let off_plane = plane.map(|plane| self.off_plane(plane, &unknown));
        let values: Vec<f64> = asked.into_iter().chain(off_plane).collect();
        let (gaps, residual) = self.gaps(&unknown, &carried.ends, &values);
        let mut further = Vec::new();
        if let Some(value) = asked {
            further.push((self.asked_by_coordinates(&problem, &unknown), asked_by, value));
        }
        if let (Some(plane), Some(value)) = (plane, off_plane) {
            further.push((plane.normal[..count].to_vec(), plane_by, value));
        }
        let gap = self.together(&problem, &carried, &gaps)?;
        let monodromy = product(&carried.derivatives);
        Ok(Linear { problem, unknown, carried, gaps, gap, monodromy, by, further, residual })
    }

    /// `unknown` at a larger and a smaller parameter, and half of their difference; one of them is `unknown` itself where there is no chain on its
    /// other side.
    fn beside(&self, unknown: &Unknown) -> Result<(f64, [(Problem, Unknown); 2]), NoOrbit> {
        let changed = |sign: f64| self.at(unknown, unknown.parameter + sign * CHANGE * self.units[1]);
        let here = || self.at(unknown, unknown.parameter);
        Ok(match (changed(1.0), changed(-1.0)) {
            (Ok(up), Ok(down)) => (CHANGE, [up, down]),
            (Ok(up), Err(_)) => (0.5 * CHANGE, [up, here()?]),
            (Err(_), Ok(down)) => (0.5 * CHANGE, [here()?, down]),
            (Err(why), Err(_)) => return Err(why),
        })
    }

    /// Derivatives of the ends of the parts, and of all together, by a number: from chains and steps (s) in which it is larger, and smaller, by
    /// `change`.
    fn difference(
        &self,
        number: Number,
        (problem, unknown): (&Problem, &Unknown),
        carried: &Carried,
        (change, changed): (f64, [(&Problem, f64); 2]),
    ) -> Result<By, NoOrbit> {
        let ends = |(problem, dt_s): (&Problem, f64)| self.map(problem).carry(dt_s, &unknown.points, false);
        let (up, down) = (ends(changed[0])?.ends, ends(changed[1])?.ends);
        let of = |(up, down): (&Vec<f64>, &Vec<f64>)| {
            up.iter().zip(down).map(|(up, down)| (up - down) / (2.0 * change)).collect()
        };
        let parts: Vec<Vec<f64>> = up.iter().zip(&down).map(of).collect();
        let all = self.together(problem, carried, &parts)?;
        Ok(By { number, parts, all })
    }

    /// A change at the end of a part, of `change` at its beginning.
    fn times(
        &self,
        problem: &Problem,
        carried: &Carried,
        part: usize,
        change: DVector<f64>,
    ) -> Result<DVector<f64>, NoOrbit> {
        if let Some(derivative) = carried.derivatives.get(part) {
            return Ok(derivative * change);
        }
        let changed = self.map(problem).change(carried, part, &[change.data.into()])?;
        Ok(DVector::from_vec(changed.concat()))
    }

    /// Changes at the ends of all parts, as they come to the end of the last one.
    fn together(
        &self,
        problem: &Problem,
        carried: &Carried,
        parts: &[Vec<f64>],
    ) -> Result<DVector<f64>, NoOrbit> {
        let mut all = DVector::from_column_slice(&parts[0]);
        for (part, change) in parts.iter().enumerate().skip(1) {
            all = self.times(problem, carried, part, all)? + DVector::from_column_slice(change);
        }
        Ok(all)
    }

    /// Finds the orbit near `start`, on `plane` if it is told.
    pub(crate) fn find(&self, start: &Unknown, plane: Option<&Plane>) -> Result<Found, NoOrbit> {
        let (_, mut unknown) = self.at(start, start.parameter)?;
        let mut residuals = Vec::new();
        for _ in 0..MOST_STEPS {
            let linear = self.linear(&unknown, plane)?;
            let before = linear.residual;
            residuals.push(before);
            let falls = residuals.iter().rev().nth(2).is_none_or(|earlier| before < 0.5 * earlier);
            if before <= TOLERANCE || before <= TAKEN && !falls {
                let monodromy = linear.monodromy;
                let monodromy = monodromy.map(|it| if self.turns { self.there_and_back(&it) } else { it });
                return Ok(Found { unknown, monodromy, residuals });
            }
            let step = self.solve(&linear, None)?;
            let Some(next) = self.damped(&unknown, &linear, &step, plane)? else {
                return Err(NoOrbit::Stuck { residuals });
            };
            unknown = self.at(&next, next.parameter)?.1;
        }
        Err(NoOrbit::Stuck { residuals })
    }

    /// `unknown` after `step`, or after a part of it that leads nearer to an orbit; the nearest of those tried if none does.
    fn damped(
        &self,
        unknown: &Unknown,
        linear: &Linear,
        step: &DVector<f64>,
        plane: Option<&Plane>,
    ) -> Result<Option<Unknown>, NoOrbit> {
        let before = linear.residual;
        let (mut length, mut nearest) = (1.0, None);
        for _ in 0..=MOST_HALVINGS {
            let next = self.moved(unknown, linear, step, length)?;
            if before < 1e-6 {
                // near an orbit rounding decides, and a whole step does no harm
                return Ok(Some(next));
            }
            if let Ok(after) = self.residual(&next, plane) {
                if after < (1.0 - 0.25 * length) * before {
                    return Ok(Some(next));
                }
                if nearest.as_ref().is_none_or(|(least, _)| after < *least) {
                    nearest = Some((after, next));
                }
            }
            length *= 0.5;
        }
        Ok(nearest.map(|(_, next)| next))
    }

    /// The derivative of the map of a period whose second half is the first one backwards, from that of the half: with velocities turned round,
    /// the inverse of a symplectic matrix.
    fn there_and_back(&self, half: &DMatrix<f64>) -> DMatrix<f64> {
        let other = self.coordinates.others();
        // ρ·M⁻¹·ρ with M⁻¹ = −J·Mᵀ·J: the two turns leave no sign
        let back =
            DMatrix::from_fn(other.len(), other.len(), |row, column| half[(other[column], other[row])]);
        back * half
    }

    /// Distance from the state a whole period later, over the size of the state.
    pub(crate) fn returns(&self, unknown: &Unknown) -> Result<f64, NoOrbit> {
        let problem = (self.family)(unknown.parameter)?;
        let map = Map { steps: self.steps, ..self.map(&problem) };
        let end = map.carry(unknown.dt_s, &unknown.points[..1], false)?.ends.pop().unwrap_or_default();
        Ok(distance(&end, &unknown.points[0]))
    }

    /// The direction of the branch of orbits through `found`, along `before`: of length 1.
    pub(crate) fn direction(&self, found: &Found, before: &[f64]) -> Result<Vec<f64>, NoOrbit> {
        let plane = Plane { normal: before.to_vec(), through: self.numbers(&found.unknown) };
        let linear = self.linear(&found.unknown, Some(&plane))?;
        let step = self.solve(&linear, Some(1.0))?;
        self.way(&found.unknown, linear, &step)
    }

    /// The direction of `step` from `unknown`: of length 1.
    fn way(&self, unknown: &Unknown, linear: Linear, step: &DVector<f64>) -> Result<Vec<f64>, NoOrbit> {
        let linear = Linear { gaps: Vec::new(), ..linear };
        // a short way, since chains may end at some value of the parameter; then the other way
        let moved = |length: f64| -> Result<Unknown, NoOrbit> {
            let next = self.moved(unknown, &linear, step, length)?;
            Ok(self.at(&next, next.parameter)?.1)
        };
        let (next, sign) = match moved(WAY) {
            Ok(next) => (next, 1.0),
            Err(_) => (moved(-WAY)?, -1.0),
        };
        let (from, to) = (self.numbers(unknown), self.numbers(&next));
        let difference: Vec<f64> = to.iter().zip(from).map(|(to, from)| to - from).collect();
        let length = sign * norm(&difference);
        Ok(difference.into_iter().map(|x| x / length).collect())
    }

    /// `unknown` half of a period later, where the motion goes back, too.
    pub(crate) fn turned(&self, unknown: &Unknown) -> Result<Unknown, NoOrbit> {
        let (problem, mut later) = self.at(unknown, unknown.parameter)?;
        let carried = self.map(&problem).carry(later.dt_s, &later.points[..1], false)?;
        later.points[0].clone_from(&carried.ends[0]);
        self.closed.iter().for_each(|place| later.points[0][*place] = 0.0);
        if self.asked(&problem, &later).is_some_and(|off| off.abs() > TAKEN) {
            let why = "its orbits turn half of a period later, where the bead has another displacement: ask for orbit.energy_j";
            return Err(NoOrbit::Branch(why));
        }
        Ok(later)
    }

    /// `unknown`, moved by `length` times `step`.
    fn moved(
        &self,
        unknown: &Unknown,
        linear: &Linear,
        step: &DVector<f64>,
        length: f64,
    ) -> Result<Unknown, NoOrbit> {
        let count = self.unknown.len();
        let by: Vec<(&By, f64)> =
            linear.by.iter().zip(step.rows(count, linear.by.len()).iter().copied()).collect();
        let mut next = unknown.clone();
        let mut change = DVector::zeros(self.coordinates.count());
        self.unknown.iter().zip(step.iter()).for_each(|(place, x)| change[*place] = *x);
        for (part, point) in next.points.iter_mut().enumerate() {
            point.iter_mut().zip(change.iter()).for_each(|(x, change)| *x += length * change);
            if part + 1 == unknown.points.len() {
                break;
            }
            change = self.times(&linear.problem, &linear.carried, part, change)?;
            for (by, step) in &by {
                change.iter_mut().zip(&by.parts[part]).for_each(|(change, x)| *change += x * step);
            }
            if let Some(gap) = linear.gaps.get(part) {
                change.iter_mut().zip(gap).for_each(|(change, gap)| *change += gap);
            }
        }
        for (by, step) in by {
            match by.number {
                Number::Step => next.dt_s += length * step * self.units[0],
                Number::Parameter => next.parameter += length * step * self.units[1],
            }
        }
        Ok(next)
    }
}

/// Distance between two states, over their size.
fn distance(end: &[f64], start: &[f64]) -> f64 {
    let gap: Vec<f64> = end.iter().zip(start).map(|(end, start)| end - start).collect();
    norm(&gap) / norm(start).max(norm(end))
}

fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// The derivative of all parts together, if they are known.
fn product(derivatives: &[DMatrix<f64>]) -> Option<DMatrix<f64>> {
    let mut all = derivatives.first()?.clone();
    for derivative in &derivatives[1..] {
        all = derivative * all;
    }
    Some(all)
}
