//! Branches of orbits along a parameter, by pseudo-arclength: each orbit lies on a plane across the direction of the branch, so that a branch can
//! turn back.

use crate::map::norm;
use crate::multipliers::{Instability, Multiplier};
use crate::newton::{Found, NoOrbit, Plane, Unknown};
use crate::{MapError, Orbit, Search};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// The part of a branch that is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// The parameter at the first orbit.
    pub from: f64,
    /// The parameter at which the branch ends.
    pub to: f64,
    /// First step over the whole stretch, and over the size of the first orbit.
    pub step: f64,
    /// Most orbits.
    pub most: usize,
}

/// A place on a branch, from which it goes on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// The orbit.
    pub unknown: Unknown,
    /// The direction of the branch there.
    pub(crate) direction: Vec<f64>,
    /// Length of the next step.
    pub(crate) length: f64,
    /// Its number, from 0.
    pub(crate) number: usize,
    /// True if the branch ends there.
    pub(crate) is_last: bool,
}

/// A change of stability on a branch.
#[derive(Debug, Clone)]
pub struct Change {
    /// Its name: that of an instability, or `fold` where the branch turns back.
    pub name: &'static str,
    /// The orbit at it.
    pub orbit: Orbit,
    /// The multiplier that leaves the unit circle, or comes back to it.
    pub multiplier: Multiplier,
    /// True if the orbits after it have more instabilities than those before.
    pub begins: bool,
    /// False if it lies somewhere between two orbits, of which `orbit` is the nearer one.
    pub is_located: bool,
    /// The direction of the branch there.
    pub(crate) along: Vec<f64>,
}

/// The way in which a branch ends.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// It reaches its last value.
    Reached,
    /// It comes back to its first value.
    CameBack,
    /// It comes back to its first orbit.
    Closed,
    /// It has as many orbits as it may have.
    Most,
    /// Nothing more is found.
    Lost(NoOrbit),
    /// The caller ended it.
    Stopped,
}

impl End {
    /// One word for it.
    pub fn as_str(&self) -> &'static str {
        match self {
            Self::Reached => "reached",
            Self::CameBack => "came-back",
            Self::Closed => "closed",
            Self::Most => "most",
            Self::Lost(_) => "lost",
            Self::Stopped => "stopped",
        }
    }
}

/// Shortest step, over the whole stretch.
const SHORTEST: f64 = 1e-5;
/// Longest step, over the first one.
const LONGEST: f64 = 2.5;
/// Newton steps up to which a step of the branch grows.
const FEW: usize = 4;
/// Least cosine of the angle between the directions of orbits beside each other.
const STRAIGHT: f64 = 0.95;
/// Distance from the unit circle of a multiplier that passes through it, at most.
const ON_PASSING: f64 = 1e-4;
/// Looks for the place of a change of stability.
const LOOKS: usize = 64;

impl Step {
    /// True if the branch goes the other way along its parameter at `next`.
    pub fn turns(&self, next: &Self) -> bool {
        let way = |step: &Self| step.direction.last().is_some_and(|way| *way > 0.0);
        way(self) != way(next)
    }
}

impl Search<'_> {
    /// The orbit that was found earlier.
    ///
    /// # Errors
    /// When it is not one of this search.
    pub fn again(&self, unknown: &Unknown) -> Result<Orbit, NoOrbit> {
        self.orbit(self.newton.find(unknown, None)?)
    }

    /// The orbit at `parameter` near `known`, or near the seed.
    ///
    /// # Errors
    /// When there is none.
    pub fn near(&self, known: Option<&Unknown>, parameter: f64) -> Result<Orbit, NoOrbit> {
        let known = known.unwrap_or(&self.start).clone();
        self.orbit(self.newton.find(&Unknown { parameter, ..known }, None)?)
    }

    /// The search with the units of `stretch`.
    #[must_use]
    pub fn along(mut self, stretch: &Stretch) -> Self {
        self.newton.units[1] = (stretch.to - stretch.from).abs();
        self
    }

    /// Follows the branch from the orbit near the seed; or from `last`, made earlier, on. Tells `look` each orbit and the place
    /// on the branch.
    ///
    /// # Errors
    /// When there is no first orbit.
    pub fn follow(
        &self,
        stretch: &Stretch,
        last: Option<Step>,
        mut look: impl FnMut(&Step, &Orbit) -> ControlFlow<()>,
    ) -> Result<End, NoOrbit> {
        let mut at = if let Some(step) = last {
            step
        } else if let Some(step) = &self.begun {
            if look(step, &self.again(&step.unknown)?).is_break() {
                return Ok(End::Stopped);
            }
            step.clone()
        } else {
            let found = self.near_seed()?;
            let mut forward = vec![0.0; self.newton.coordinates.count() + 2];
            if let Some(last) = forward.last_mut() {
                *last = (stretch.to - stretch.from).signum();
            }
            let direction = self.newton.direction(&found, &forward)?;
            let (unknown, length) = (found.unknown.clone(), stretch.step);
            let step = Step { unknown, direction, length, number: 0, is_last: false };
            if look(&step, &self.orbit(found)?).is_break() {
                return Ok(End::Stopped);
            }
            step
        };
        loop {
            if at.is_last {
                let is_reached = at.unknown.parameter == stretch.to;
                return Ok(if is_reached { End::Reached } else { End::CameBack });
            }
            if at.number + 1 >= stretch.most {
                return Ok(End::Most);
            }
            if self.begun.as_ref().is_some_and(|begun| self.is_closed(begun, &at)) {
                return Ok(End::Closed);
            }
            match self.next(stretch, &at) {
                Ok((step, found)) => {
                    if look(&step, &self.orbit(found)?).is_break() {
                        return Ok(End::Stopped);
                    }
                    at = step;
                }
                Err(NoOrbit::Map(MapError::Stopped)) => return Ok(End::Stopped),
                Err(why) => return Ok(End::Lost(why)),
            }
        }
    }

    /// True if a branch that begins at `begun` is back there: within its next step.
    fn is_closed(&self, begun: &Step, at: &Step) -> bool {
        let (from, to) = (self.newton.numbers(&begun.unknown), self.newton.numbers(&at.unknown));
        let between: Vec<f64> = from.iter().zip(&to).map(|(from, to)| to - from).collect();
        at.number > 3 && norm(&between) < 0.6 * at.length
    }

    /// The next orbit of a branch.
    fn next(&self, stretch: &Stretch, at: &Step) -> Result<(Step, Found), NoOrbit> {
        let mut length = at.length;
        loop {
            match self.tried(stretch, at, length) {
                Ok(Some(next)) => return Ok(next),
                Err(why @ NoOrbit::Map(MapError::Stopped)) => return Err(why),
                Err(why) if length < 2.0 * SHORTEST => return Err(why),
                Ok(None) if length < 2.0 * SHORTEST => {
                    return Err(NoOrbit::Chain("the branch turns too sharply to be followed"));
                }
                _ => length *= 0.5,
            }
        }
    }

    /// The orbit after a step of `length`; none if the branch turns too far in it.
    fn tried(&self, stretch: &Stretch, at: &Step, length: f64) -> Result<Option<(Step, Found)>, NoOrbit> {
        let newton = &self.newton;
        let from = newton.numbers(&at.unknown);
        let through: Vec<f64> = from.iter().zip(&at.direction).map(|(x, d)| x + length * d).collect();
        let number = at.number + 1;
        let last_towards = |to: &[f64]| {
            let way = (stretch.to - stretch.from).signum();
            let parameter = to[to.len() - 1] * newton.units[1];
            let is_passed = |(limit, sign): &(f64, f64)| (parameter - limit) * way * sign >= 0.0;
            let (limit, _) = [(stretch.to, 1.0), (stretch.from, -1.0)].into_iter().find(is_passed)?;
            let found = self.between(&at.unknown, to, limit).and_then(|guess| newton.find(&guess, None));
            let step = |unknown| Step { unknown, number, is_last: true, ..at.clone() };
            Some(found.map(|found| Some((step(found.unknown.clone()), found))))
        };
        let plane = Plane { normal: at.direction.clone(), through };
        let guess = self.unknown_near(&at.unknown, &from, &plane.through);
        let found = match guess.and_then(|guess| newton.find(&guess, Some(&plane))) {
            Ok(found) => found,
            // chains may end where the branch does
            Err(why @ NoOrbit::Config(_)) => return last_towards(&plane.through).unwrap_or(Err(why)),
            Err(why) => return Err(why),
        };
        if let Some(last) = last_towards(&newton.numbers(&found.unknown)) {
            return last;
        }
        let direction = newton.direction(&found, &at.direction)?;
        let cosine: f64 = direction.iter().zip(&at.direction).map(|(a, b)| a * b).sum();
        if cosine < STRAIGHT {
            return Ok(None);
        }
        let grown = if found.residuals.len() <= FEW { 1.5 * length } else { length };
        // over the size of the orbits, which the seed was not yet of
        let longest = LONGEST * stretch.step * norm(&found.unknown.points[0]).max(1.0);
        let (unknown, length) = (found.unknown.clone(), grown.min(longest));
        Ok(Some((Step { unknown, direction, length, number, is_last: false }, found)))
    }

    /// `unknown`, moved from the numbers `from` to `to`; further parts of the period follow the flow.
    pub(crate) fn unknown_near(
        &self,
        unknown: &Unknown,
        from: &[f64],
        to: &[f64],
    ) -> Result<Unknown, NoOrbit> {
        let count = self.newton.coordinates.count();
        let mut next = unknown.clone();
        next.points[0].copy_from_slice(&to[..count]);
        next.dt_s += (to[count] - from[count]) * self.newton.units[0];
        next.parameter += (to[count + 1] - from[count + 1]) * self.newton.units[1];
        self.newton.flow(&mut next)?;
        Ok(next)
    }

    /// A guess of the orbit at `parameter`, between `one` and that of the numbers `to`.
    fn between(&self, one: &Unknown, to: &[f64], parameter: f64) -> Result<Unknown, NoOrbit> {
        let from = self.newton.numbers(one);
        let place = from.len() - 1;
        let part = (parameter / self.newton.units[1] - from[place]) / (to[place] - from[place]);
        let at: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + part * (b - a)).collect();
        Ok(Unknown { parameter, ..self.unknown_near(one, &from, &at)? })
    }

    /// The change of stability between two orbits beside each other on a branch, if there is one.
    ///
    /// # Errors
    /// When no orbit is found between them.
    pub fn change(&self, one: &Orbit, other: &Orbit, turns: bool) -> Result<Option<Change>, NoOrbit> {
        let ends = [one, other].map(|orbit| &orbit.multipliers);
        let counts = ends.map(|end| end.unstable().count());
        if counts[0] == counts[1] {
            return Ok(None);
        }
        let begins = counts[1] > counts[0];
        let [better, worse] = if begins { ends } else { [ends[1], ends[0]] };
        let Some(multiplier) = worse.gained(better) else { return Ok(None) };
        let kind = worse.kind(multiplier);
        let test = |orbit: &Orbit| orbit.multipliers.test(kind, multiplier);
        let (from, to) = (self.newton.numbers(&one.unknown), self.newton.numbers(&other.unknown));
        let difference: Vec<f64> = to.iter().zip(&from).map(|(to, from)| to - from).collect();
        let length = norm(&difference);
        let normal: Vec<f64> = difference.iter().map(|x| x / length).collect();
        let mut ends = [(0.0, test(one), one.clone()), (1.0, test(other), other.clone())];
        let mut is_located = ends[0].1.zip(ends[1].1).is_some_and(|(a, b)| a.signum() != b.signum());
        let name = if turns && kind == Instability::Real { "fold" } else { kind.as_str() };
        for look in 0..if is_located { LOOKS } else { 0 } {
            let [(a, Some(at_a), _), (b, Some(at_b), _)] = &ends else { break };
            // the secant, and the middle each third time and in the end, which always shortens the interval
            let is_middle = look % 3 == 2 || look > LOOKS / 2;
            let part = if is_middle { 0.5 * (a + b) } else { a - at_a * (b - a) / (at_b - at_a) };
            let through: Vec<f64> = from.iter().zip(&difference).map(|(x, d)| x + part * d).collect();
            let guess = self.unknown_near(&one.unknown, &from, &through)?;
            let plane = Plane { normal: normal.clone(), through };
            let orbit = self.orbit(self.newton.find(&guess, Some(&plane))?)?;
            let value = test(&orbit);
            let side = usize::from(value.is_some_and(|value| value.signum() == at_b.signum()));
            let is_there = value.is_some_and(|value| value.abs() < 1e-12) || (b - a).abs() < 1e-12;
            ends[side] = (part, value, orbit);
            if is_there {
                break;
            }
        }
        let nearest = |end: &(f64, Option<f64>, Orbit)| end.1.map_or(f64::INFINITY, f64::abs);
        let [a, b] = ends;
        let orbit = if nearest(&a) < nearest(&b) { a.2 } else { b.2 };
        let near = orbit.multipliers.telling();
        let distance = |one: &Multiplier| {
            (one.size() - 1.0).abs() + 0.1 * (one.angle_rad().abs() - multiplier.angle_rad().abs()).abs()
        };
        let multiplier = near.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(multiplier);
        // where multipliers change places, the one that was looked at jumps
        is_located &= (multiplier.size() - 1.0).abs() < ON_PASSING;
        Ok(Some(Change { name, orbit, multiplier, begins, is_located, along: normal }))
    }
}
