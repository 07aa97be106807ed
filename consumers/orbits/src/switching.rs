//! Branches that are born where another one changes its stability: of orbits with less symmetry where a multiplier passes 1, and of orbits of twice
//! the period where one passes −1.
//!
//! At the change the equations of an orbit lose a direction across the old branch. The first orbit of a new branch lies on a plane at some distance in this
//! direction, where no orbit of the old branch is near.
//!
//! # Source
//! H. B. Keller, in *Applications of Bifurcation Theory* (ed. P. H. Rabinowitz, Academic Press, 1977), 359.

use crate::branch::{Change, Step, Stretch};
use crate::map::norm;
use crate::multipliers::Instability;
use crate::newton::{NoOrbit, Plane, Unknown};
use crate::{MapError, Orbit, Search};
use serde::{Deserialize, Serialize};

/// Distances of the first orbit from the change, over the size of the orbit, that are tried one after the other.
const DISTANCES: [f64; 3] = [0.02, 0.01, 0.005];
/// Differences of multipliers and relative ones of periods up to which two orbits are one, or are related by a symmetry. At the least distance a
/// new orbit differs by the square of it from an old one.
const SAME: f64 = 1e-6;

/// The beginning of a branch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Beginning {
    /// Periods of the old orbit in one of a new one.
    pub periods: u64,
    /// The first place.
    pub step: Step,
}

impl Change {
    /// True if another branch may be born there: one multiplier passes 1, without a fold, or −1.
    pub fn may_bear(&self) -> bool {
        let names = [Instability::Real, Instability::PeriodDoubling].map(Instability::as_str);
        self.is_located && names.contains(&self.name)
    }

    /// Periods of the old orbit in one that is born there.
    fn periods(&self) -> u64 {
        if self.name == Instability::PeriodDoubling.as_str() { 2 } else { 1 }
    }
}

impl Search<'_> {
    /// The search along the branch that begins there.
    #[must_use]
    pub fn of_branch(&self, beginning: &Beginning) -> Self {
        Self { begun: Some(beginning.step.clone()), ..self.over(beginning.periods) }
    }

    /// The search for orbits of so many periods.
    fn over(&self, periods: u64) -> Self {
        let mut search = self.clone();
        search.newton.periods *= periods;
        search.newton.steps *= periods;
        search.newton.shift_beads *= periods;
        search
    }

    /// The branches that are born at `change`: one, or the two sides of it if these differ.
    ///
    /// # Errors
    /// When none is found.
    pub fn born(&self, change: &Change, stretch: &Stretch) -> Result<Vec<Beginning>, NoOrbit> {
        let periods = change.periods();
        let search = self.over(periods);
        let (mut at, mut regular) = (change.orbit.unknown.clone(), self.start.clone());
        if periods > 1 {
            // the parts of a longer period begin elsewhere
            search.newton.flow(&mut at)?;
            search.newton.flow(&mut regular)?;
        }
        let mut found = search.newton.second(&at, change.along.clone(), &regular);
        if matches!(found, Err(NoOrbit::Branch(_))) && periods == 2 && self.newton.turns {
            // of the two turning points of the old orbit, new ones may have but the other
            at = self.newton.turned(&at)?;
            search.newton.flow(&mut at)?;
            let mut parameter = vec![0.0; change.along.len()];
            parameter.iter_mut().next_back().into_iter().for_each(|last| *last = 1.0);
            found = search.newton.second(&at, parameter, &regular);
        }
        let direction = found?;
        let (first, orbit) = self.first(change, (&search, &at, &direction), stretch)?;
        let mut all = vec![Beginning { periods, step: first }];
        // the other side of a period doubling is the same orbit, a period later
        if periods == 1 {
            let back: Vec<f64> = direction.iter().map(|x| -x).collect();
            match self.first(change, (&search, &at, &back), stretch) {
                Ok((step, _)) => {
                    // sides that are related by a symmetry have equal orbits at one value of the parameter
                    let past = |orbit: &Unknown| orbit.parameter > at.parameter;
                    let there = search.near(Some(&step.unknown), orbit.unknown.parameter);
                    let is_one = there.is_ok_and(|other| is_same(&orbit, &other));
                    if past(&step.unknown) != past(&orbit.unknown) || !is_one {
                        all.push(Beginning { periods, step });
                    }
                }
                Err(why @ NoOrbit::Map(MapError::Stopped)) => return Err(why),
                _ => {}
            }
        }
        Ok(all)
    }

    /// The first place of the branch that leaves `at` in `direction`, found by `search`, with its orbit.
    fn first(
        &self,
        change: &Change,
        (search, at, direction): (&Self, &Unknown, &[f64]),
        stretch: &Stretch,
    ) -> Result<(Step, Orbit), NoOrbit> {
        let mut why = NoOrbit::Branch("Newton's method comes back to the old branch");
        let from = search.newton.numbers(at);
        for part in DISTANCES {
            let length = part * norm(&at.points[0]);
            let through: Vec<f64> = from.iter().zip(direction).map(|(x, d)| x + length * d).collect();
            let guess = search.unknown_near(at, &from, &through)?;
            let plane = Plane { normal: direction.to_vec(), through };
            let found = match search.newton.find(&guess, Some(&plane)) {
                Ok(found) => found,
                Err(stopped @ NoOrbit::Map(MapError::Stopped)) => return Err(stopped),
                Err(other) => {
                    why = other;
                    continue;
                }
            };
            let direction = search.newton.direction(&found, direction)?;
            let orbit = search.orbit(found)?;
            if self.is_old(change, &orbit)? {
                continue;
            }
            let (unknown, length) = (orbit.unknown.clone(), stretch.step * norm(&at.points[0]).max(1.0));
            return Ok((Step { unknown, direction, length, number: 0, is_last: false }, orbit));
        }
        Err(why)
    }

    /// True if `orbit`, near `change`, is one of the old branch: one that comes back after the old period, or that which is found from a place along the
    /// old branch.
    fn is_old(&self, change: &Change, orbit: &Orbit) -> Result<bool, NoOrbit> {
        if change.periods() == 2 {
            return Ok(self.newton.returns(&orbit.unknown)? < SAME);
        }
        let at = &change.orbit.unknown;
        let from = self.newton.numbers(at);
        let way = (orbit.unknown.parameter - at.parameter) / self.newton.units[1];
        let by_parameter = change.along.last().filter(|part| **part != 0.0).map_or(0.0, |part| way / part);
        let to: Vec<f64> = from.iter().zip(&change.along).map(|(x, d)| x + by_parameter * d).collect();
        let guess = Unknown { parameter: orbit.unknown.parameter, ..self.unknown_near(at, &from, &to)? };
        let old = self.newton.find(&guess, None).and_then(|found| self.orbit(found));
        Ok(old.is_ok_and(|old| is_same(orbit, &old)))
    }
}

/// True if both are one orbit, or are related by a symmetry.
fn is_same(one: &Orbit, other: &Orbit) -> bool {
    let period = (one.period_s() / other.period_s() - 1.0).abs();
    period < SAME && one.multipliers.difference(&other.multipliers) < SAME
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::File;
    use std::ops::ControlFlow;
    use std::path::Path;
    use std::sync::atomic::AtomicBool;

    /// Two shaken beads: where their orbit doubles its period a branch is born, into however many parts the period is divided.
    #[test]
    fn an_orbit_in_parts_bears_one_of_twice_the_period() {
        let stop = AtomicBool::new(false);
        for segments in [1, 2, 5] {
            let text = format!(
                "chain = {{ beads = 2, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0 }}\n\
                 ends = {{ left = 'fixed', right = 'fixed' }}\nload = {{ precompression_n = 1.0 }}\n\
                 on_site = {{ drag_n_s_per_m = 0.05 }}\norbit = {{ steps = 100, segments = {segments} }}\n\
                 drive = [{{ wall = 'left', displacement_m = {{ sine = {{ amplitude = 0.155, frequency_hz = 0.385 }} }} }}]\n\
                 continue = {{ key = 'drive[0].displacement_m.sine.amplitude', from = 0.155, to = 0.175, branches = true }}"
            );
            let file = File::read(Path::new("orbit.toml"), &text, |config, _| Ok(config)).expect("valid");
            let family = |parameter: f64| file.problem(parameter);
            let (_, stretch) = file.stretch().expect("a branch");
            let search = Search::begin(&family, file.from(), file.options(), &stop).expect("a seed");
            let search = search.along(&stretch);
            let (mut last, mut changes): (Option<(Step, Orbit)>, Vec<Change>) = (None, Vec::new());
            let look = |step: &Step, orbit: &Orbit| {
                if let Some((before, one)) = &last {
                    changes.extend(search.change(one, orbit, before.turns(step)).expect("an orbit"));
                }
                last = Some((step.clone(), orbit.clone()));
                if changes.is_empty() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            };
            search.follow(&stretch, None, look).expect("a branch");
            assert_eq!(changes[0].name, "period doubling");
            let born = search.born(&changes[0], &stretch).expect("a branch of twice the period");
            assert_eq!(born.iter().map(|born| born.periods).collect::<Vec<_>>(), [2], "{segments}");
        }
    }
}
